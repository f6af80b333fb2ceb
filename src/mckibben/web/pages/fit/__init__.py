"""The Fit page: tension laws for a table of length, pressure and tension."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...laboratory import Laboratory
from ...shell import asked
from ...widgets import page_frame

if TYPE_CHECKING:
    from starlette.requests import Request


def build(lab: Laboratory, request: Request) -> None:
    """Build the page."""
    from .page import FitPage
    from .state import LINK

    words = asked(request, *LINK)
    sub = "Tension laws to a table of length, pressure and tension"
    with page_frame("fit", sub=sub, sheets=("fit.css",), scripts=("js/fit.js",)) as bar:
        view = FitPage(lab, words)
        view.build(bar)
