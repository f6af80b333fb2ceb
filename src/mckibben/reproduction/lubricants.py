"""The paper's lubricants: what they take off the friction, from recordings of the dry and of the lubricated muscle."""

from __future__ import annotations

from ..analysis.loops import Loop, loop, loop_ratio
from .recorded import SPAN, TENSION, recording, reproduces, step_of

CYCLES = {"precondition": 2, "cycles": 3}


def treated(lubricant: str) -> Loop:
    """The loop with a lubricant on the muscle."""
    return loop(
        step_of(recording("lubricant-test", lubricant=lubricant, **CYCLES), "loops"), length=SPAN, tension=TENSION
    )


@reproduces(
    "friction.lubricated",
    "1",
    "with WD-40: the rig takes a tenth off the friction, so this tests the measurement, not the lubricant",
)
def lubricated() -> float:
    """Height of the loop with WD-40 over that without."""
    return loop_ratio(treated("WD-40"), treated("no lubricant")).height
