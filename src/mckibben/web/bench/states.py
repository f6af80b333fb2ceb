"""What pages see of the test machine: its state as a shape and a word, times, and how far a run is."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...quantities import with_unit
from .pace import NAMES

if TYPE_CHECKING:
    from .by_hand import ByHand
    from .going import Going
    from .machine import Bench

UNITS = {"pressure": "Pa", "span": "m", "tension": "N", "velocity": "m/s"}


def status_of(bench: Bench) -> dict[str, Any]:
    """State, why and times."""
    going, hand = bench.going, bench.hand
    found: dict[str, Any] = {
        "shape": "idle", "name": "Idle", "small": "", "pace": bench.pace.name, "vented": bench.vented, "why": bench.why,
        "trip": bench.when, "moving": False, "paused": False, "time": bench.ended.get("time", 0.0), "ended": bench.ended,
        "asked": "",
        "by_hand": "ready" if hand is not None and hand.ready else (hand.failed if hand else "") or "getting ready",
    }  # fmt: skip
    if going is not None:
        return found | _running(bench, going)
    if bench.why:
        return found | {"shape": "tripped", "name": "Tripped", "small": bench.small}
    if hand is not None and hand.moving:
        return found | _manual(hand)
    dry = bench.chosen.dry
    passed = "protocol does not pass" if dry is None or not dry.passed else "ready, dry run passed"
    return found | {"small": "checking the protocol" if dry is None else passed}


def _running(bench: Bench, going: Going) -> dict[str, Any]:
    step = going.steps[-1] if going.steps else None
    paused, tripped = bench.pace.halted or bool(going.asked), going.tripped
    shape, name, small = "running", "Running", f"{going.words} \u00b7 {NAMES[bench.pace.name]}"
    if tripped or (bench.why and going.button()):
        shape, name, small = "tripped", "Tripped", bench.small or short(tripped)
    elif paused:
        shape, name = "paused", "Paused"
        small = going.asked or f"at {going.time:.3f} s, simulated time stands still"
    return {
        "shape": shape, "name": name, "small": small, "moving": True, "paused": paused, "time": going.time,
        "asked": going.asked, "why": bench.why or tripped, "duration": going.bench.plan.duration, "words": going.words,
        "trip": bench.when if bench.why else going.when if tripped else None, "cycle": going.cycle,
        "title": going.bench.protocol.title, "steps": steps_of(going), "running": True, "measured": going.measured,
        "path": "" if step is None else step["path"], "file": going.file,
    }  # fmt: skip


def _manual(hand: ByHand) -> dict[str, Any]:
    session = hand.session
    asked = {} if session is None else session.status().set_points
    words = ", ".join(with_unit(v, UNITS[n]) for n, v in asked.items() if n in UNITS)
    return {
        "shape": "running", "name": "By hand", "small": f"holding {words}" if words else "vented", "moving": True,
        "time": hand.time, "set_points": dict(asked),
    }  # fmt: skip


def short(why: str) -> str:
    """What stopped it, in a few words; of a line, what happened to it."""
    said = why.split(": ", 1)[-1] if why.startswith("/") else why
    return said.split(" at ")[0].split(":")[0].split(",")[0][:60]


def ended(going: Going, said: dict[str, Any], why: str) -> dict[str, Any]:
    """What is told of the last run until the next one."""
    return {
        **said, "time": going.time, "title": going.bench.protocol.title, "stopped": bool(why), "why": why, "by": going.cause,
        "trip": going.when if why else None, "steps": steps_of(going), "duration": going.bench.plan.duration,
        "measured": going.measured,
    }  # fmt: skip


def steps_of(going: Going) -> list[dict[str, Any]]:
    """The steps that have begun, as a page draws them."""
    found = []
    for one in going.steps:
        frequency = going.bench.plan.steps[one["index"] - 1].step.frequency()
        end = one["end"] if one["end"] > one["start"] else None
        found.append(
            {
                "path": one["path"], "label": one["label"] or "step", "start": one["start"], "end": end,
                "period": 1.0 / frequency if frequency else 0.0,
            }
        )  # fmt: skip
    return found
