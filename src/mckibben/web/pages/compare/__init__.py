"""Compare: muscles side by side by Table 1 of the paper, braided and biological, from their laws or from recordings."""

from __future__ import annotations

from typing import Any

from ...laboratory import Laboratory
from ...shell import asked


def build(lab: Laboratory, request: Any) -> None:
    """The page."""
    from .page import ComparePage

    ComparePage(lab, asked(request, "muscles", "values", "recordings", "pressure")).build()
