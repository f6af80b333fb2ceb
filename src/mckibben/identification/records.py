"""Trials from recordings: which channel is compared with the circuit, which one drives it, and where the run begins."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..assembly.circuit_plan import CircuitPlan
from ..errors import InputError
from ..pneumatics.volume import Reservoir
from ..recordings.recording import Recording
from .trial import Trial

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

    Channels find their places by name: ``<volume>.pressure`` (gauge) and ``<volume>.pressure_abs`` are compared, the
    pressure of a reservoir that follows a signal drives it, and so does a channel named after a signal, or
    ``<element>.command``. What the recording does not have is taken from the circuit's own waveforms and start pressures.

    Args:
        plan: the circuit as read from its file.
        record: what was measured or simulated.
        name: of the trial, for tables and complaints.
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
        raise InputError("channels", ", ".join(record.names()), f"none to compare; allowed are {known}", where=name)
    if measured:
        for node in measured:
            if node not in plan.circuit.chambers:
                known = ", ".join(plan.circuit.chambers)
                raise InputError("measured", node, f"no such volume; allowed are {known}", where=name)
        compared = {channel: values for channel, values in compared.items() if channel.rpartition(".")[0] in measured}
    given = _given(plan, record, pressures, ambient, name)
    for signal, channel in (inputs or {}).items():
        if signal not in plan.signals:
            raise InputError("inputs", signal, f"no such signal; known are {', '.join(plan.signals)}", where=name)
        given[signal] = _raw(record, channel, plan.signals[signal].unit, name)
    times = record.time - record.time[0]
    # A sensor saw what happened between its samples on either side; what a simulation held, it held.
    sensed = not {"true", "command"} & {record.channels[n].kind for n in record.names() if n.endswith(PRESSURES)}
    signals = plan.inputs(times=times, given=given, sensed=sensed)
    # The circuit itself makes the commands that are late by a dead time: that may be fitted.
    late = {f"{n}.command" for n, e in plan.circuit.elements.items() if e.delay() is not None}
    signals = {n: s for n, s in signals.items() if n not in late}
    initial = {
        node: float(values[0]) if values is not None else plan.starts[node] + ambient
        for node, values in ((n, pressures[n]) for n in plan.circuit.chambers)
    }
    return Trial(
        name=name,
        circuit=plan.circuit,
        signals=signals,
        initial=initial,
        measured=compared,
        period=record.period,
        temperature=float(plan.environment.temperature),
        follows={
            f"{node}.{what}": planned.signal
            for node, planned in plan.nodes.items()
            for what in ("pressure", "length", "stroke")
            if planned.signal is not None and f"{node}.{what}" in signals
        },
    )


def _given(
    plan: CircuitPlan, record: Recording, pressures: Mapping[str, np.ndarray | None], ambient: float, name: str
) -> dict[str, np.ndarray]:
    """Signals that the recording holds, in the unit that each signal has."""
    found: dict[str, np.ndarray] = {}
    for signal, its in plan.signals.items():
        if signal in record:
            found[signal] = _raw(record, signal, its.unit, name)
    for element, (_, command) in plan.circuit.ends.items():
        if command is not None and f"{element}.command" in record:
            found.setdefault(command, _raw(record, f"{element}.command", plan.signals[command].unit, name))
    for node, planned in plan.nodes.items():
        values = pressures[node]
        if planned.signal is None:
            continue
        if isinstance(plan.circuit.nodes[node], Reservoir):
            if values is not None:
                found.setdefault(planned.signal, values - ambient)
        elif f"{node}.length" in record:
            found.setdefault(planned.signal, _raw(record, f"{node}.length", "m", name))
    return found


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
        raise InputError("channel", channel, f"the record has {', '.join(record.names())}", where=name)
    if record.unit(channel) != unit:
        raise InputError(channel, f"in {record.unit(channel)}", f"allowed are values in {unit}", where=name)
    return record[channel]
