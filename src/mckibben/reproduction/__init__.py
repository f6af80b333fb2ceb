"""The papers, number by number: what is printed, what we compute, and what that says."""

from __future__ import annotations

from collections.abc import Callable

from .rows import Outcome, Row, needs_recording, reproduce_row, select

__all__ = ["Outcome", "Row", "load", "reproduce"]


def reproduce(
    part: str | None = None,
    rows: list[str] | None = None,
    *,
    progress: Callable[[Row], None] | None = None,
    tell: Callable[[str], None] | None = None,
    recordings: bool = True,
) -> list[Outcome]:
    """Compute rows of the papers and judge each.

    Args:
        part: ``I`` to ``IV`` or ``discussion``; all where left out.
        rows: beginnings of identifiers, such as ``table1.nylon``.
        progress: called with each row before it is computed.
        tell: called with words while a recording is made, of which several rows are computed; that takes minutes.
        recordings: off leaves out the rows that need them.
    """
    from .recorded import told

    load()

    outcomes = []
    with told(tell):
        for row in select(part, rows):
            if not recordings and needs_recording(row):
                continue
            if progress:
                progress(row)
            outcomes.append(reproduce_row(row))
    return outcomes


def load() -> None:
    """Let every module of the rows register what it computes."""
    from . import discussion, isometric, isotonic, lubricants, part1, part2, part4, quasi_static, sinusoids, static_fit  # noqa: F401
