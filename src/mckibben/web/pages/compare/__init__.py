"""The Compare page: braided and biological muscles by Table 1 of the paper, from laws or recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...laboratory import Laboratory
from ...shell import asked

if TYPE_CHECKING:
    from starlette.requests import Request


def build(lab: Laboratory, request: Request) -> None:
    """Build the page."""
    from .page import ComparePage

    ComparePage(lab, asked(request, "muscles", "values", "recordings", "pressure")).build()
