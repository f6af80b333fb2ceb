"""The Fit page: tension laws for a table of length, pressure and tension."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...shell import asked
from ...widgets import page_frame
from ...workspace import Workspace

if TYPE_CHECKING:
    from starlette.requests import Request


def build(workspace: Workspace, request: Request) -> None:
    """Build the page."""
    from .page import FitPage
    from .state import LINK

    words = asked(request, *LINK)
    sub = "Tension laws to a table of length, pressure and tension"
    with page_frame("fit", sub=sub, sheets=("fit.css",), scripts=("js/fit.js",)) as bar:
        view = FitPage(workspace, words)
        view.build(bar)
