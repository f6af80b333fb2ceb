"""The Recordings page: list, search, overlay of two, notes, export, deletion with Undo."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...shell import asked
from ...widgets import page_frame
from ...workspace import Workspace

if TYPE_CHECKING:
    from starlette.requests import Request


def build(workspace: Workspace, request: Request) -> None:
    """Build the page."""
    from .page import LINK, RecordingsPage

    words = asked(request, *LINK)
    with page_frame("recordings", sheets=("recordings.css",), scripts=("js/recordings.js",)) as bar:
        view = RecordingsPage(workspace, words)
        view.build(bar)
