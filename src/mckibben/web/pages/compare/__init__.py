"""The Compare page: braided and biological muscles by Table 1 of the paper, from laws or recordings."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...shell import asked
from ...workspace import Workspace

if TYPE_CHECKING:
    from starlette.requests import Request


def build(workspace: Workspace, request: Request) -> None:
    """Build the page."""
    from .page import ComparePage

    ComparePage(workspace, asked(request, "muscles", "values", "recordings", "pressure")).build()
