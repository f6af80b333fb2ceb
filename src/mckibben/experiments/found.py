"""What a check of the dry run says."""

from __future__ import annotations

from typing import NamedTuple


class Found(NamedTuple):
    """A field, its value and what is allowed, in words; `said` where the three make no good sentence."""

    field: str
    value: str
    allowed: str
    said: str = ""

    def text(self) -> str:
        """As a sentence without its place."""
        return self.said or f"{self.field} is {self.value}; {self.allowed}"
