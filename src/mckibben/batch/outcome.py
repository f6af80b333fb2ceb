"""What became of one variant: a code that an array can hold, and a sentence."""

from __future__ import annotations

import enum

from ..engine.integration import Result


class Outcome(enum.IntEnum):
    """Result code of a lane; those of the engine, and what a bench adds to them."""

    NOT_RUN = -1
    DONE = 0
    NOT_FINITE = 1
    TOO_STIFF = 2
    IMPOSSIBLE = 3
    STOPPED = 4
    REFUSED = 5

    @property
    def sentence(self) -> str:
        """What it means, without the numbers of a lane."""
        return SENTENCES[self]


SENTENCES = {
    Outcome.NOT_RUN: "It has not been run yet.",
    Outcome.DONE: Result.DONE.value,
    Outcome.NOT_FINITE: Result.NOT_FINITE.value,
    Outcome.TOO_STIFF: Result.TOO_STIFF.value,
    Outcome.IMPOSSIBLE: Result.IMPOSSIBLE.value,
    Outcome.STOPPED: "The bench stopped it: an interlock tripped, or a test that had to come true did not.",
    Outcome.REFUSED: "Nothing moved: the dry run or a value's bounds spoke against it.",
}
