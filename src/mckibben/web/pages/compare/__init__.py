"""The Compare page: braided and biological muscles by Table 1 of the paper, from laws or recordings."""

from __future__ import annotations

from typing import Any

from ...laboratory import Laboratory
from ...shell import asked


def build(lab: Laboratory, request: Any) -> None:
    """Build the page."""
    from .page import ComparePage

    ComparePage(lab, asked(request, "muscles", "values", "recordings", "pressure")).build()
