"""The state of the test machine for the pages: shape and name, times, and progress of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...documents import JsonValue
from ...quantities import with_unit

if TYPE_CHECKING:
    from .machine import Bench
    from .running import RunController

PACE_NAMES = {"simulated": "as fast as it goes", "real": "real time", "slow": "slow 1:10"}
UNITS = {"pressure": "Pa", "span": "m", "tension": "N", "velocity": "m/s"}


def status_of(bench: Bench) -> dict[str, JsonValue]:
    """Return state, reason and times."""
    run, session, view = bench.running, bench.session, bench.view
    status: dict[str, Any] = {
        "shape": "idle", "name": "Idle", "small": "", "pace": bench.pace, "vented": bench.vented, "why": session.why,
        "trip": bench.when, "moving": False, "paused": False, "time": bench.ended.get("time", 0.0), "ended": bench.ended,
        "asked": "", "by_hand": "ready" if session.ready else view.failed or "getting ready",
    }  # fmt: skip
    if run is not None:
        return status | _running(bench, run)
    if status["why"]:
        small = "not connected" if session.gone and not session.ready else short(status["why"])
        return status | {"shape": "tripped", "name": "Tripped", "small": small}
    if view.moving:
        asked = session.status().set_points
        words = ", ".join(with_unit(v, UNITS[n]) for n, v in asked.items() if n in UNITS)
        small = f"holding {words}" if words else "vented"
        by_hand = {"shape": "running", "name": "By hand", "small": small, "moving": True, "time": view.time}
        return status | by_hand | {"set_points": dict(asked)}
    dry = bench.chosen.dry
    passed = "protocol does not pass" if dry is None or not dry.passed else "ready, dry run passed"
    return status | {"small": "checking the protocol" if dry is None else passed}


def _running(bench: Bench, run: RunController) -> dict[str, JsonValue]:
    step, why = run.state.steps[-1] if run.state.steps else None, bench.session.why
    paused, tripped = bench.clock.halted or bool(run.asked), run.tripped
    shape, name, small = "running", "Running", f"{run.words} \u00b7 {PACE_NAMES[bench.pace]}"
    if tripped or (run.button() and not run.stopping):
        shape, name, small = "tripped", "Tripped", short(tripped or why or "emergency stop")
    elif paused:
        shape, name = "paused", "Paused"
        small = run.asked or f"at {run.time:.3f} s, simulated time stands still"
    return {
        "shape": shape, "name": name, "small": small, "moving": True, "running": True, "paused": paused,
        "time": run.time, "asked": run.asked, "why": why or tripped, "trip": run.when if tripped else None,
        "words": run.words, "cycle": run.cycle, "duration": run.prepared.plan.duration,
        "title": run.prepared.protocol.title, "steps": run.steps(), "measured": run.measured,
        "path": "" if step is None else step["path"], "file": run.file,
    }  # fmt: skip


def short(why: str) -> str:
    """Shorten the reason of a stop to a few words."""
    said = why.split(": ", 1)[-1] if why.startswith("/") else why
    return said.split(" at ")[0].split(":")[0].split(",")[0][:60]


def ended(run: RunController, said: dict[str, JsonValue], why: str) -> dict[str, JsonValue]:
    """Summarise the last run until the next one begins."""
    return {
        **said, "time": run.time, "title": run.prepared.protocol.title, "stopped": bool(why), "why": why,
        "by": run.cause, "trip": run.when if why else None, "steps": run.steps(),
        "duration": run.prepared.plan.duration, "measured": run.measured,
    }  # fmt: skip
