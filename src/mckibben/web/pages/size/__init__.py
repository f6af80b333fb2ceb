"""The Size page: muscle, valve, tube and gas source for a force and a stroke."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...elements import page_document
from ...shell import asked
from ...widgets import box, page_frame
from ...workspace import Workspace
from .question import LINKED

if TYPE_CHECKING:
    from starlette.requests import Request


def build(workspace: Workspace, request: Request) -> None:
    """Build the page; the answer follows when it is displayed."""
    words = asked(request, *LINKED)
    with page_frame("size", sub="Muscle, valve, tube and gas source for a load", sheets=("size.css",)) as bar:
        place = box("div", "size")

        async def begin() -> None:
            from .page import SizePage

            await SizePage(workspace, words, bar, place).show()

        page_document().when_connected(begin)
