"""The state of the test machine for the pages: shape and name, times, and progress of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...documents import JsonValue
from ...quantities import with_unit

if TYPE_CHECKING:
    from .machine import Bench
    from .manual import ManualControl
    from .running import RunController

PACE_NAMES = {"simulated": "as fast as it goes", "real": "real time", "slow": "slow 1:10"}
UNITS = {"pressure": "Pa", "span": "m", "tension": "N", "velocity": "m/s"}


def status_of(bench: Bench) -> dict[str, JsonValue]:
    """Return state, reason and times."""
    run, manual = bench.running, bench.manual
    status: dict[str, Any] = {
        "shape": "idle",
        "name": "Idle",
        "small": "",
        "pace": bench.pace,
        "vented": bench.vented,
        "why": bench.why,
        "trip": bench.when,
        "moving": False,
        "paused": False,
        "time": bench.ended.get("time", 0.0),
        "ended": bench.ended,
        "asked": "",
        "by_hand": "ready"
        if manual is not None and manual.ready
        else (manual.failed if manual else "") or "getting ready",
    }
    if run is not None:
        return status | _running(bench, run)
    if status["why"]:
        failed = manual is not None and status["why"] == manual.failed
        small = "not connected" if failed else short(status["why"])
        return status | {"shape": "tripped", "name": "Tripped", "small": small}
    if manual is not None and manual.moving:
        return status | _manual(manual)
    dry = bench.chosen.dry
    passed = "protocol does not pass" if dry is None or not dry.passed else "ready, dry run passed"
    return status | {"small": "checking the protocol" if dry is None else passed}


def _running(bench: Bench, run: RunController) -> dict[str, JsonValue]:
    step = run.steps[-1] if run.steps else None
    paused, tripped = bench.clock.halted or bool(run.asked), run.tripped
    shape, name, small = "running", "Running", f"{run.words} \u00b7 {PACE_NAMES[bench.pace]}"
    if tripped or (run.button() and not run.stopping):
        shape, name, small = "tripped", "Tripped", short(tripped or bench.why or "emergency stop")
    elif paused:
        shape, name = "paused", "Paused"
        small = run.asked or f"at {run.time:.3f} s, simulated time stands still"
    return {
        "shape": shape,
        "name": name,
        "small": small,
        "moving": True,
        "paused": paused,
        "time": run.time,
        "asked": run.asked,
        "why": bench.why or tripped,
        "duration": run.prepared.plan.duration,
        "words": run.words,
        "trip": run.when if tripped else None,
        "cycle": run.cycle,
        "title": run.prepared.protocol.title,
        "steps": steps_of(run),
        "running": True,
        "measured": run.measured,
        "path": "" if step is None else step["path"],
        "file": run.file,
    }


def _manual(manual: ManualControl) -> dict[str, JsonValue]:
    session = manual.session
    asked = {} if session is None else session.status().set_points
    words = ", ".join(with_unit(v, UNITS[n]) for n, v in asked.items() if n in UNITS)
    return {
        "shape": "running",
        "name": "By hand",
        "small": f"holding {words}" if words else "vented",
        "moving": True,
        "time": manual.time,
        "set_points": dict(asked),
    }


def short(why: str) -> str:
    """Shorten the reason of a stop to a few words."""
    said = why.split(": ", 1)[-1] if why.startswith("/") else why
    return said.split(" at ")[0].split(":")[0].split(",")[0][:60]


def ended(run: RunController, said: dict[str, JsonValue], why: str) -> dict[str, JsonValue]:
    """Summarise the last run until the next one begins."""
    return {
        **said,
        "time": run.time,
        "title": run.prepared.protocol.title,
        "stopped": bool(why),
        "why": why,
        "by": run.cause,
        "trip": run.when if why else None,
        "steps": steps_of(run),
        "duration": run.prepared.plan.duration,
        "measured": run.measured,
    }


def steps_of(run: RunController) -> list[dict[str, JsonValue]]:
    """List the steps that have begun, as a page draws them."""
    steps = []
    for one in run.steps:
        frequency = run.prepared.plan.steps[one["index"] - 1].step.frequency()
        end = one["end"] if one["end"] > one["start"] else None
        steps.append(
            {
                "path": one["path"],
                "label": one["label"] or "step",
                "start": one["start"],
                "end": end,
                "period": 1.0 / frequency if frequency else 0.0,
            }
        )
    return steps
