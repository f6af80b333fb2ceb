"""Measured runs of a circuit: input signals, records, and predictions."""

from __future__ import annotations

import dataclasses
import difflib
import fnmatch
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .._jax import Scalar, Tree, jax
from ..answers import Caution
from ..assembly.circuit_file import CircuitPlan
from ..components import paths
from ..documents import JsonValue
from ..engine import STEP, Run, Signal, held, integrate, march, ramped
from ..engine.prediction import Prediction, prediction
from ..errors import ConvergenceError, InputError
from ..pneumatics.circuit import Circuit
from ..pneumatics.volume import Reservoir
from ..recordings.recording import Recording


@dataclass(frozen=True)
class Trial:
    """A record on a uniform clock, ready to be compared with a circuit.

    Args:
        name: in tables and error messages.
        circuit: the model, with the parameters known so far.
        signals: input signals, on the record's clock.
        initial: absolute pressure of every volume at the start [Pa].
        measured: by the name of a circuit's output, such as ``tank.pressure_abs``, one value per sample [SI].
        period: period of the samples [s].
        temperature: temperature of all gas at the start [K].
        follows: signals that come from another one, by its name; what delays that one delays them too.
        cautions: recorded pressures that neither drive nor are compared.
    """

    name: str
    circuit: Circuit
    signals: Mapping[str, Signal]
    initial: Mapping[str, float]
    measured: Mapping[str, np.ndarray]
    period: float
    temperature: float = 293.15
    follows: Mapping[str, str] = field(default_factory=dict)
    cautions: tuple[Caution, ...] = ()

    def __post_init__(self) -> None:
        """Refuse what could not be compared."""
        if not self.measured:
            raise InputError("measured", None, "must be at least one recorded channel", where=self.name)
        lengths = {len(v) for v in self.measured.values()} | {len(s.values) for s in self.signals.values()}
        if len(lengths) != 1:
            raise InputError(
                "samples", str(sorted(lengths)), "all channels and signals need one length", where=self.name
            )
        for name, values in self.measured.items():
            if not np.isfinite(values).all():
                raise InputError(name, None, "must be finite", where=self.name)
            if name.endswith(".pressure_abs") and (np.asarray(values) < 0.0).any():
                allowed = "must be absolute pressures of 0 Pa or more; below vacuum"
                raise InputError(name, float(np.min(values)), allowed, where=self.name)
        for name, signal in self.signals.items():
            if not np.isfinite(np.asarray(signal.values)).all():
                raise InputError(name, None, "must be finite", where=self.name)
        self._check_start()

    def _check_start(self) -> None:
        for name, value, unit in (("period", self.period, "s"), ("temperature", self.temperature, "K")):
            if not (np.isfinite(value) and value > 0.0):
                raise InputError(name, float(value), f"must be above 0 {unit}", where=self.name)
        for name in self.circuit.chambers:
            value = self.initial.get(name, float("nan"))
            if not (np.isfinite(value) and value > 0.0):
                stated = float(value) if name in self.initial else None
                raise InputError(f"initial.{name}", stated, "must be an absolute pressure above 0 Pa", where=self.name)
        driven = [getattr(node, "signal", None) for node in self.circuit.nodes.values()]
        for needed in (*driven, *(command for _, command in self.circuit.ends.values())):
            if needed is not None and needed not in self.signals:
                known = ", ".join(self.signals) or "none"
                raise InputError("signals", needed, f"missing; the trial has {known}", where=self.name)

    def replace(self, **changes: JsonValue) -> Trial:
        """A copy with some fields changed, checked like a new one."""
        return dataclasses.replace(self, **changes)

    @property
    def channels(self) -> tuple[str, ...]:
        """Names of the measured outputs, in order."""
        return tuple(self.measured)

    @property
    def samples(self) -> int:
        """Intervals of the clock."""
        return len(next(iter(self.measured.values()))) - 1

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the signals that come from no other one."""
        return tuple(name for name in self.signals if name not in self.follows)

    def check(self) -> None:
        """Refuse channels that the circuit has no output for."""
        circuit, signals = self.with_parameters({})
        state, memory = _start(circuit, signals, self.initial, self.period, self.temperature)
        inputs = {name: s.at(0, 0.0, self.period) for name, s in signals.items()}
        known = circuit.outputs(state, memory, inputs)
        for name in self.channels:
            if name not in known:
                raise InputError("measured", name, "outputs are", known=known, where=self.name)

    def with_parameters(self, changes: Mapping[str, Scalar]) -> tuple[Circuit, dict[str, Signal]]:
        """Circuit and signals with values at dotted paths replaced; ``signals.<name>.delay`` delays an input."""
        return _changed(self.circuit, self.signals, changes, tuple(self.follows.items()))

    def run(self, changes: Mapping[str, Scalar], *, step: float = STEP, method: str = "auto") -> Run:
        """The run with parameters at dotted paths replaced, checked like any run."""
        circuit, signals = self.with_parameters(changes)
        state, memory = _start(circuit, signals, self.initial, self.period, self.temperature)
        try:
            return integrate(circuit, state, signals, period=self.period, memory=memory, step_size=step, method=method)
        except ConvergenceError as error:
            raise ConvergenceError(f"{self.name}: {error}") from None

    def model(self, names: tuple[tuple[str, ...], ...], inner: int, stiff: bool) -> Prediction:
        """Prediction of the measured outputs (channels, samples + 1) by values, each at one path or several.

        With a number of steps per sample, and by the Rosenbrock method where the circuit is stiff.
        """
        leaves = (self.circuit, dict(self.signals), {k: float(v) for k, v in self.initial.items()})
        follows = tuple(self.follows.items())
        static = (names, self.channels, self.period, self.temperature, inner, self.samples, stiff, follows)
        return prediction(lambda values, *known: _outputs(known, values, *static), len(names), *leaves, name=static)


def _changed(
    circuit: Circuit, signals: Mapping[str, Signal], changes: Mapping[str, Scalar], follows: tuple[tuple[str, str], ...]
) -> tuple[Circuit, dict[str, Signal]]:
    changed = paths.put(circuit, {p: v for p, v in changes.items() if not p.startswith("signals.")})
    late = dict(signals)
    for path, value in changes.items():
        if path.startswith("signals."):
            name = path.removeprefix("signals.").removesuffix(".delay")
            for each in (name, *(other for other, first in follows if first == name)):
                late[each] = late[each].delayed(value)
    return changed, changed.commands(late)


def _start(circuit: Circuit, signals: Mapping[str, Signal], initial: Any, period: Scalar, temperature: Scalar) -> Any:
    inputs = {name: s.at(0, 0.0, period) for name, s in signals.items()}
    state = circuit.at_rest(initial, inputs, temperature)
    return state, circuit.initial_memory(state, inputs)


def _outputs(
    leaves: Tree,
    values: Any,
    names: Any,
    channels: Any,
    period: Scalar,
    temperature: Scalar,
    inner: int,
    samples: int,
    stiff: bool,
    follows: Any,
) -> Any:
    circuit, signals, initial = leaves
    changes = {path: value for many, value in zip(names, values, strict=True) for path in many}
    circuit, signals = _changed(circuit, signals, changes, follows)
    state, memory = _start(circuit, signals, initial, period, temperature)
    _, kept = march(circuit, state, memory, signals, period, inner, samples, stiff)
    return jax.numpy.stack([kept[2][name] for name in channels])


def matching(pattern: str, circuit: Circuit, signals: Iterable[str]) -> tuple[str, ...]:
    """Dotted paths that match a pattern such as ``elements.valve_*.passage.conductance``.

    Raises:
        InputError: if there is none, with the nearest paths; and for paths of different units, which no value serves.
    """
    units = {path: q.unit for path, q in paths.parameters(circuit)} | {f"signals.{name}.delay": "s" for name in signals}
    matches = tuple(path for path in units if fnmatch.fnmatchcase(path, pattern))
    if not matches:
        near = difflib.get_close_matches(pattern, units, n=3) or sorted(units)
        raise InputError("free", pattern, known=near)
    different = [path for path in matches if units[path] != units[matches[0]]]
    if different:
        reason = f"one value cannot be {matches[0]} [{units[matches[0]]}] and {different[0]} [{units[different[0]]}]"
        raise InputError("free", pattern, reason)
    return matches


def expand(patterns: Iterable[str], trial: Trial) -> dict[str, tuple[str, ...]]:
    """Expand patterns to dotted paths; one value serves all paths of a pattern.

    Raises:
        InputError: for a pattern that matches nothing, and for a path that two patterns match.
    """
    expanded: dict[str, tuple[str, ...]] = {}
    taken: dict[str, str] = {}
    for pattern in patterns:
        expanded[pattern] = matching(pattern, trial.circuit, trial.inputs)
        for path in expanded[pattern]:
            if path in taken:
                raise InputError("free", pattern, f"{path} is free already, by {taken[path]}")
            taken[path] = pattern
    return expanded


PRESSURES = (".pressure", ".pressure_abs")


def trial_from_record(
    plan: CircuitPlan,
    record: Recording,
    *,
    name: str,
    measured: Mapping[str, str] | None = None,
    inputs: Mapping[str, str] | None = None,
) -> Trial:
    """A trial of a circuit from one recording, on a uniform clock of the recording's own period.

    Channels find their places by name: ``<volume>.pressure`` (gauge) and ``<volume>.pressure_abs`` are compared; the
    pressure of a reservoir drives it, whether the file has a signal or a constant there, and so does a channel named
    after a signal, or ``<element>.command``. What the recording does not have is taken from the circuit's own waveforms
    and start pressures.

    Args:
        plan: the circuit as read from its file.
        record: measured or simulated recording.
        name: name of the trial, for tables and error messages.
        measured: what to compare instead: a volume's name to the channel that recorded its pressure.
        inputs: what drives instead: a signal's name to the channel that recorded it.

    Raises:
        InputError: names the trial, the channel and what is missing.
    """
    record = record.uniform(record.period)
    ambient = float(plan.environment.pressure_abs)
    pressures = {node: _pressure(record, node, ambient, name) for node in plan.circuit.nodes}
    pressures |= {node: _channel(record, channel, ambient, name) for node, channel in (measured or {}).items()}
    compared = {
        f"{node}.pressure_abs": values
        for node, values in pressures.items()
        if values is not None and node in plan.circuit.chambers
    }
    if not compared:
        known = ", ".join(f"{node}.pressure" for node in plan.circuit.chambers)
        names = ", ".join(record.names())
        sentence = f"No channel of the record can be compared with {known}; it has {names}"
        raise InputError("channels", names, where=name, sentence=sentence)
    if measured:
        for node in measured:
            if node not in plan.circuit.chambers:
                known = ", ".join(plan.circuit.chambers)
                raise InputError("measured", node, f"must be {known}; there is no such volume", where=name)
        compared = {channel: values for channel, values in compared.items() if channel.rpartition(".")[0] in measured}
    trial = _given(plan, record, pressures, ambient, name)
    for signal, channel in (inputs or {}).items():
        if signal not in plan.signals:
            raise InputError("inputs", signal, "signals are", known=plan.signals, where=name)
        trial[signal] = _raw(record, channel, plan.signals[signal].unit, name)
    times = record.time - record.time[0]
    # A sensor saw what happened between its samples on either side; what a simulation held, it held.
    sensed = not {"true", "command"} & {record.channels[n].kind for n in record.names() if n.endswith(PRESSURES)}
    signals = plan.inputs(times=times, changed=trial, sensed=sensed)
    # The circuit itself makes the commands that are late by a dead time: that may be fitted.
    late = {f"{n}.command" for n, e in plan.circuit.elements.items() if e.delay() is not None}
    signals = {n: s for n, s in signals.items() if n not in late}
    initial = {
        node: float(values[0]) if values is not None else plan.starts[node] + ambient
        for node, values in ((n, pressures[n]) for n in plan.circuit.chambers)
    }
    # A reservoir of constant pressure in the file is driven as well: what was measured is known better.
    nodes = dict(plan.circuit.nodes)
    for node, values in pressures.items():
        kind = nodes[node]
        if values is not None and type(kind) is Reservoir and kind.signal is None:
            nodes[node] = kind.replace(signal=f"{node}.pressure")
            signals[f"{node}.pressure"] = (ramped if sensed else held)(values)
    used = {f"{node}{end}" for node in pressures for end in PRESSURES} | {
        *(measured or {}).values(),
        *(inputs or {}).values(),
    }
    unused = [n for n in record.names() if n.endswith(PRESSURES) and n not in used and n not in plan.signals]
    why = f"is not used: the circuit's nodes are {', '.join(plan.circuit.nodes)}"
    return Trial(
        name=name,
        circuit=plan.circuit.replace(nodes=nodes),
        signals=signals,
        initial=initial,
        measured=compared,
        period=record.period,
        temperature=float(plan.environment.temperature),
        follows={
            f"{node}.{quantity}": planned.signal
            for node, planned in plan.nodes.items()
            for quantity in ("pressure", "length", "stroke")
            if planned.signal is not None and f"{node}.{quantity}" in signals
        },
        cautions=tuple(Caution(f"{name}: {channel} {why}", channel) for channel in unused),
    )


def _given(
    plan: CircuitPlan, record: Recording, pressures: Mapping[str, np.ndarray | None], ambient: float, name: str
) -> dict[str, np.ndarray]:
    signals: dict[str, np.ndarray] = {}
    for signal, its in plan.signals.items():
        if signal in record:
            signals[signal] = _raw(record, signal, its.unit, name)
    for element, (_, command) in plan.circuit.ends.items():
        if command is not None and f"{element}.command" in record:
            signals.setdefault(command, _raw(record, f"{element}.command", plan.signals[command].unit, name))
    for node, planned in plan.nodes.items():
        values = pressures[node]
        if planned.signal is None:
            continue
        if isinstance(plan.circuit.nodes[node], Reservoir):
            if values is not None:
                signals.setdefault(planned.signal, values - ambient)
        elif f"{node}.length" in record:
            signals.setdefault(planned.signal, _raw(record, f"{node}.length", "m", name))
    return signals


def _pressure(record: Recording, node: str, ambient: float, name: str) -> np.ndarray | None:
    for channel in (f"{node}.pressure_abs", f"{node}.pressure"):
        if channel in record:
            return _channel(record, channel, ambient, name)
    return None


def _channel(record: Recording, channel: str, ambient: float, name: str) -> np.ndarray:
    values = _raw(record, channel, "Pa", name)
    return values if channel.endswith("_abs") else values + ambient


def _raw(record: Recording, channel: str, unit: str, name: str) -> np.ndarray:
    if channel not in record:
        raise InputError("channel", channel, "the record has", known=record.names(), where=name)
    if record.unit(channel) != unit:
        raise InputError(channel, None, f"must be values in {unit}, got {record.unit(channel)}", where=name)
    return record[channel]
