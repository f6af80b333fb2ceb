"""The page The paper: every printed number and figure, with our values."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...elements import page_document
from ...shell import asked
from ...widgets import box, page_frame
from ...workspace import Workspace

if TYPE_CHECKING:
    from starlette.requests import Request

LINKED = ("row", "figure", "form")  # what the server has to know; the browser keeps filter, search and folds


def build(workspace: Workspace, request: Request) -> None:
    """Build the page; slow parts follow when it is displayed."""
    words = asked(request, *LINKED)
    with page_frame(
        "paper",
        sub="C.-P. Chou, B. Hannaford: every printed number, table and figure, theirs and ours",
        sheets=("paper.css",),
        scripts=("js/paper.js",),
    ) as bar:
        place = box("div", "paper")

        async def begin() -> None:
            from .page import begin as go

            await go(workspace, words, bar, place)

        page_document().when_connected(begin)
