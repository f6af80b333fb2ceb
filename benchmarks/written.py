"""What a benchmark writes on pages of the documentation: parts between two marks, made of its file of results alone.

A benchmark names its parts as ``WRITTEN``. `tests/habits/test_written_figures.py` makes each anew from the file of results
that lies beside it, and fails where a page says something else.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

DOCS = Path(__file__).resolve().parents[1] / "docs"


class WrittenPart(NamedTuple):
    """A part of a page.

    Attributes:
        page: below ``docs``.
        begin: mark before it.
        end: mark behind it.
        text: makes it of the results.
    """

    page: str
    begin: str
    end: str
    text: Callable[[Any], str]

    def in_page(self, results: Any) -> tuple[str, str]:
        """The page as it is, and as it should be."""
        page = (DOCS / self.page).read_text(encoding="utf-8")
        before, begin, rest = page.partition(self.begin)
        _, end, after = rest.partition(self.end)
        if not begin or not end:
            raise ValueError(f"{self.page} has no part between {self.begin} and {self.end}")
        return page, f"{before}{begin}\n\n{self.text(results)}\n\n{end}{after}"


def write(parts: Sequence[WrittenPart], results: Any) -> None:
    """Write the parts of a benchmark anew."""
    for part in parts:
        (DOCS / part.page).write_text(part.in_page(results)[1], encoding="utf-8")
