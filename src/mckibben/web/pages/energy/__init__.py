"""The Energy page: cycles of Part IV over the supply pressure, and the energy flow of recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...elements import page_document
from ...shell import asked
from ...widgets import box, page_frame
from ...workspace import Workspace

if TYPE_CHECKING:
    from starlette.requests import Request

LINKED = (
    "muscle", "law", "cycle", "pressure", "exchange", "accumulator_pressure", "friction", "stretched_length", "volume",
    "reading", "recording", "part", "account",
)  # fmt: skip


def build(workspace: Workspace, request: Request) -> None:
    """Build the page; slow parts follow when it is displayed."""
    words = asked(request, *LINKED)
    with page_frame(
        "energy",
        sub="Compressed air in, work out",
        sheets=("energy.css",),
        scripts=("js/energy.js",),
    ) as bar:
        place = box("div", "energy")

        async def begin() -> None:
            from .page import begin as go

            await go(workspace, words, bar, place)

        page_document().when_connected(begin)
