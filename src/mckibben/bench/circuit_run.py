"""Runs of circuits, from the plan to the recording."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from .._jax import jnp
from ..analysis.steps import unsettled_at_end
from ..answers import collect, warn
from ..assembly.circuit_file import CircuitPlan
from ..assembly.sentence import run_sentence, sentence
from ..components import Module, Scalar, field
from ..components.module import map_leaves
from ..components.paths import resolved
from ..components.system import Value
from ..engine import Run, Signal, integrate
from ..errors import ConvergenceError
from ..muscles.plausible import reached_cautions
from ..pneumatics.circuit import balance
from ..pneumatics.tubes import InertialTube, LinearTube, QuadraticTube
from ..pneumatics.volume import MovingVolume
from ..recordings import Channel, Recording
from ..recordings.memory import INTEGRATED, check_memory
from ..recordings.provenance import created, versions
from ..specimens import specimen
from .channels import described

CHUNK = 400_000  # steps of a part; each part costs some seconds beside, for its rates are examined

STILL = {"constant", "steps", "pulse"}  # waveforms that keep their last value
OF_THE_PAPER = (LinearTube, QuadraticTube, InertialTube)
DRIVES = {"Pa": "gauge pressure asked for", "m": "length of a muscle", "1": "command"}


class Window(Module):
    """A signal from a given sample on; delayed signals still include earlier values."""

    values: Scalar
    whole: Signal
    first: Any = field(converter=lambda index: jnp.asarray(index))

    def at(self, index: Scalar, share: Scalar, period: Scalar) -> Value:
        """Value at a sample, as in `signals.Signal`."""
        return self.whole.at(self.first + index, share, period)

    def within(self, index: Scalar, begin: Scalar, end: Scalar, share: Scalar, period: Scalar) -> Value:
        """Times within a step at which the signal changes, as in `signals.Signal`."""
        return self.whole.within(self.first + index, begin, end, share, period)


def chunks(plan: CircuitPlan) -> int:
    """Number of parts in which a run is computed, hence of progress reports by `run_circuit`."""
    return len(_edges(plan)) - 1


def run_circuit(plan: CircuitPlan, *, progress: Callable[[str], None] | None = None) -> Recording:
    """Run a circuit and record pressures, temperatures, masses, flows and commands.

    A keyboard interrupt ends the run; what was reached by then is returned, with ``result`` "interrupted".

    Args:
        plan: the circuit to run.
        progress: told how far the run is, `chunks` times.

    Raises:
        ConvergenceError: if the run failed; says when and why.
    """
    check_memory(plan.duration, plan.period, bytes_per_sample=INTEGRATED, field="run.duration", where=plan.where)
    warn(plan.cautions)
    signals = plan.inputs()
    state, memory = start = plan.initial()
    done: list[Run] = []
    edges = _edges(plan)
    at, message = 0, "The run reached its end."
    try:
        for first, last in zip(edges, edges[1:], strict=False):
            windows: Any = {n: Window(s.values[first : last + 1], s, first) for n, s in signals.items()}
            try:
                run = integrate(
                    plan.circuit, state, windows,
                    period=plan.period, memory=memory, step_size=plan.step, method=plan.method,
                )  # fmt: skip
            except ConvergenceError as error:
                begin, end = plan.period * first, plan.period * last
                raise ConvergenceError(f"{plan.where}: between {begin:.4g} s and {end:.4g} s: {error}") from None
            state, memory, at = run.state, run.memory, last
            done.append(run)
            if progress is not None:
                progress(f"{plan.period * last:.4g} s of {plan.duration:.4g} s")
    except KeyboardInterrupt:
        if not done:
            raise
        message = f"Interrupted after {plan.period * at:.4g} s of {plan.duration:.4g} s."
    return _record(plan, done, at, message, start, signals)


def _edges(plan: CircuitPlan) -> list[int]:
    inner = max(1, round(plan.period / plan.inner_step))
    size = max(1, CHUNK // inner)
    return [*range(0, plan.samples, size), plan.samples]


def _record(
    plan: CircuitPlan, done: list[Run], last: int, message: str, start: Any, signals: Mapping[str, Signal]
) -> Recording:
    count = last + 1
    # the first sample of a part is the last of the one before, seen with the new inputs
    outputs = {
        name: np.concatenate([*(r.outputs[name][:-1] for r in done), done[-1].outputs[name][-1:]])
        for name in done[0].outputs
    }
    integrals = map_leaves(lambda *parts: float(sum(parts)), *(r.integrals for r in done))
    first = {n: s.at(0, 0.0, plan.period) for n, s in signals.items()}
    final = {n: s.at(last - 1, 1.0, plan.period) for n, s in signals.items()}
    closed = balance(plan.circuit, start[0], done[-1].state, first, final, integrals)
    complete = last == plan.samples
    meta = {
        "title": plan.title,
        "circuit": sentence(plan),
        "run": run_sentence(plan),
        "description": plan.document,
        "source_sha256": plan.digest,
        "parameters": resolved(plan.owner),
        "environment": {n: float(getattr(plan.environment, n)) for n in ("pressure_abs", "temperature")},
        "balance": {"mass": float(closed.mass), "energy": float(closed.energy)},
        "result": "done" if complete else "interrupted",
        "message": message,
        "stiff": any(r.stiff for r in done),
        "fastest_rate": max(r.fastest for r in done),
        "step": plan.inner_step,
        "versions": versions(),
        "citations": citations(plan),
        "created": created(),
    }
    record = Recording(plan.times[:count], _channels(plan, outputs, signals, count), meta)
    reached = [  # the lengths and the highest pressure that each muscle had
        caution
        for n, node in plan.nodes.items()
        if node.law is not None
        for caution in reached_cautions(record[f"{n}.length"], record[f"{n}.pressure"], node.law, node.specimen, n)
    ]
    warnings = [*map(str, collect(*plan.cautions, *reached)), *_unsettled(plan, record)]
    return Recording(record.time, record.channels, {**meta, "warnings": warnings}) if warnings else record


def _unsettled(plan: CircuitPlan, record: Recording) -> list[str]:
    """Describe what still changes at the end of a run although its signals have been constant for some time."""
    if not {s.waveform.kind for s in plan.signals.values()} <= STILL:
        return []
    changes = [np.flatnonzero(np.diff(record[n])) for n in plan.signals]
    since = max((float(record.time[c[-1] + 1]) for c in changes if c.size), default=float(record.time[0]))
    return unsettled_at_end(record, [f"{n}.pressure" for n in plan.nodes], since)


def _channels(
    plan: CircuitPlan, outputs: Mapping[str, np.ndarray], signals: Mapping[str, Signal], count: int
) -> dict[str, Channel]:
    room = float(plan.environment.pressure_abs)
    channels: dict[str, Channel] = {}
    for name in plan.nodes:
        gauge = outputs[f"{name}.pressure_abs"] - room
        channels[f"{name}.pressure"] = Channel(gauge, unit="Pa", kind="true", meaning=f"gauge pressure of {name}")
    for name, values in outputs.items():
        unit, meaning = described(name)
        channels[name] = Channel(np.broadcast_to(values, (count,)), unit=unit, kind="true", meaning=meaning)
    channels |= _muscles(plan, outputs, signals, count)
    for name, s in plan.signals.items():
        values = s.waveform.at(plan.times[:count])
        channels[name] = Channel(
            values, unit=s.unit, kind="command", meaning=f"{DRIVES[s.unit]}, {', '.join(s.drives)}"
        )
    return channels


def _muscles(
    plan: CircuitPlan, outputs: Mapping[str, np.ndarray], signals: Mapping[str, Signal], count: int
) -> dict[str, Channel]:
    channels = {}
    for name, planned in plan.nodes.items():
        node = plan.circuit.nodes[name]
        if planned.law is None or not isinstance(node, MovingVolume):
            continue
        length = np.asarray(signals[f"{name}.length"].values)[:count]
        gauge = outputs[f"{name}.pressure_abs"] - float(node.ambient)
        volume = np.asarray(node.of(length, gauge)) + float(node.dead_volume)
        tension = np.asarray(planned.law.tension(length, gauge))
        channels[f"{name}.length"] = Channel(length, unit="m", kind="true", meaning=f"length of {name}")
        channels[f"{name}.volume"] = Channel(volume, unit="m^3", kind="true", meaning=f"volume of the gas in {name}")
        channels[f"{name}.tension"] = Channel(
            tension, unit="N", kind="true", meaning=f"tension of {name} by its static law"
        )
    return channels


def citations(plan: CircuitPlan) -> list[str]:
    """Citation keys of the parts of a circuit and their specimens."""
    keys = [key for planned in plan.nodes.values() if planned.law is not None for key in planned.law.cites]
    keys += ["chou1996" for e in plan.circuit.elements.values() if isinstance(e, OF_THE_PAPER)]
    parts = [part for section in ("nodes", "elements") for part in plan.document[section].values()]
    keys += [key for part in parts if "specimen" in part for key in specimen(part["specimen"]).sources]
    return list(dict.fromkeys(keys))
