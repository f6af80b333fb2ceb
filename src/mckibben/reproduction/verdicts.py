"""What became of the printed numbers, by kind: agreement with a number that an input was inferred from is no evidence.

The kinds stand in one table, in the order in which they are counted; command line, report and screen take their words,
and the headline, from here.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from .rows import Outcome, Row, accepted_band

REASONED = 0.1  # relative tolerance from which on a row must say why it is so wide


class Kind(NamedTuple):
    """A kind of verdict.

    Attributes:
        key: its name in files and on the screen.
        verdict: of one row.
        counted: what follows its number in the headline where that is one, and where it is more.
        meaning: what it says, a phrase.
    """

    key: str
    verdict: str
    counted: tuple[str, str]
    meaning: str


KINDS = {
    kind.verdict: kind
    for kind in (
        Kind("holds", "holds", ("holds", "hold"), "ours agrees with the print as closely as the row asks"),
        Kind(
            "calibrated", "holds, calibrated", ("is calibrated", "are calibrated"),
            "agrees, but an input was inferred from this row or its companion: no prediction",
        ),
        Kind(
            "synthetic", "synthetic", ("is synthetic", "are synthetic"),
            "no measured curve is printed; ours is computed against the distributed reference",
        ),
        Kind(
            "open", "open", ("is open", "are open"),
            "ours is shown with the reason for the difference, and never tuned to the print",
        ),
        Kind(
            "misprint", "misprint", ("is a misprint", "are misprints"),
            "the printed value is wrong; ours is the corrected one",
        ),
        Kind("short", "falls short", ("falls short", "fall short"), "ours does not agree"),
        Kind("to come", "to come", ("is to come", "are to come"), "not computed yet"),
    )
}  # fmt: skip
DIFFERING = ("holds", "calibrated", "synthetic", "open", "short")  # keys whose differences the headline shows


class Tally(NamedTuple):
    """How many rows are of a kind, and between what their differences lie, of those that have one.

    Attributes:
        kind: of verdict.
        rows: of that kind.
        lowest: relative difference from the print; None where no row has one, or none is of interest.
        highest: the same.
    """

    kind: Kind
    rows: int
    lowest: float | None
    highest: float | None


def kind_of(outcome: Outcome) -> Kind:
    """The kind of verdict of a row."""
    return KINDS[outcome.verdict]


def relative_difference(row: Row, ours: float | None) -> float | None:
    """How far ours lies from the print, over the print, or from the nearer end of an interval; 0 within it.

    None where nothing is computed or the print is zero.
    """
    if ours is None:
        return None
    paper = row.paper
    if isinstance(paper, tuple):
        if paper[0] <= ours <= paper[1]:
            return 0.0
        paper = min(paper, key=lambda end: abs(ours - end))
    return (ours - paper) / abs(paper) if paper else None


def relative_tolerance(row: Row) -> float | None:
    """Half of what counts as agreement over its middle; None where nothing does."""
    allowed = accepted_band(row)
    return None if allowed is None or not allowed[0] else abs(allowed[1] / allowed[0])


def tallies(outcomes: Iterable[Outcome]) -> list[Tally]:
    """The kinds that occur, in their order."""
    listed = list(outcomes)
    found = []
    for kind in KINDS.values():
        rows = [o for o in listed if kind_of(o) is kind]
        differences = [relative_difference(o.row, o.ours) for o in rows] if kind.key in DIFFERING else []
        known = [d for d in differences if d is not None]
        if rows:
            found.append(Tally(kind, len(rows), min(known, default=None), max(known, default=None)))
    return found


def headline(outcomes: Sequence[Outcome]) -> str:
    """One sentence: how many numbers there are, and how many of each kind, with their differences from the print."""
    counted = tallies(outcomes)
    parts = [f"{t.rows} {t.kind.counted[t.rows != 1]}{_between(t)}" for t in counted]
    if not any(t.kind.key == "short" for t in counted) and any(t.kind.key != "to come" for t in counted):
        parts.append("none falls short")
    numbers = "1 printed number" if len(outcomes) == 1 else f"{len(outcomes)} printed numbers"
    return f"{numbers}: {', '.join(parts)}." if parts else "No printed number was asked for."


def _between(tally: Tally) -> str:
    """The differences of a kind in per cent, in brackets; nothing where there are none."""
    if tally.lowest is None or tally.highest is None:
        return ""
    ends = dict.fromkeys(percent(d) for d in (tally.lowest, tally.highest))
    return f" ({' to '.join(ends)} %)"


def percent(share: float, digits: int = 0) -> str:
    """A relative difference in per cent, with its sign and without the per cent sign."""
    words = f"{100.0 * share:+.{digits}f}"
    return "0" if float(words) == 0.0 else words.replace("-", "\N{MINUS SIGN}")
