"""A circuit from a TOML file (schema 1), with its signals, surroundings and run; everything wrong is named by dotted path.

    schema = 1
    title = "A tank that fills"
    [nodes.supply]
    kind = "reservoir"            # or atmosphere, volume, compliant, muscle, junction
    pressure = "5 bar"            # gauge, as all pressures of nodes and signals
    [nodes.tank]
    kind = "volume"
    volume = "120 ml"
    heat = "isothermal"
    [elements.tube]
    kind = "lumped_tube"          # `mckibben.pneumatics.build.ELEMENTS` has all
    from = "supply"               # or one key per port, by its name
    to = "tank"
    length = "60 cm"
    diameter = "2 mm"
    [run]
    duration = "2 s"              # period = "1 ms", step = "50 us", method = "auto"

Valves name a signal as `command`, reservoirs and muscles as `signal`; [signals.NAME] is a waveform of
`mckibben.experiments.waveforms`. The pressure of the [environment] is absolute. [fit] says how
records of the circuit are read, and what is fitted to them. Files that are named, such as that of a specimen, are looked for
beside this one.
"""

from __future__ import annotations

import hashlib
import os
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..components import Environment
from ..documents import parse_toml, read_text, with_own_paths
from ..engine import STEP
from ..errors import InputError, suggest
from ..experiments.waveforms import Waveform, read_waveform, time_words
from ..pneumatics.circuit import Branch, Circuit
from ..quantities import Quantity, declared
from ..schema import FileTable
from .circuit_elements import read_branch
from .circuit_nodes import PlannedNode, check_length, read_node
from .circuit_plan import CircuitPlan, PlannedSignal
from .fit_table import read_fit

SCHEMA = 1
SECTIONS = ("schema", "title", "note", "environment", "nodes", "elements", "signals", "run", "fit")
METHODS = ("auto", "rk4", "ros2")
TIME = Quantity("s", (1e-9, 1e7), "time", "", (1e-3, 100.0))
LONGEST = 20_000_000  # samples


def read_circuit(path: str | os.PathLike[str]) -> CircuitPlan:
    """Read a circuit and what to do with it.

    Args:
        path: a TOML file.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.
    """
    where = os.fspath(path)
    text = read_text(path)
    document = with_own_paths(parse_toml(text, where=where), where)
    return build_plan(document, where=where, digest=hashlib.sha256(text.encode()).hexdigest())


def build_plan(document: Mapping[str, Any], *, where: str, digest: str) -> CircuitPlan:
    """The plan of a document that was read; raises as `read_circuit` does."""
    top = FileTable(document, "", where)
    if document.get("schema") != SCHEMA:
        raise InputError(
            "schema", document.get("schema", "missing"), f"this version reads schema {SCHEMA}", where=where
        )
    top.only(SECTIONS, "a circuit has")
    top.word("note", "-")
    room = _environment(top.table("environment"))
    nodes = {name: read_node(name, entry, room) for name, entry in _named(top, "nodes")}
    elements = dict(_named(top, "elements"))
    for name in elements:
        if name in nodes:
            raise top.fail(f"elements.{name}", name, "a node has that name; choose another one")
    branches = {name: read_branch(entry, list(nodes)) for name, entry in elements.items()}
    circuit = _circuit(nodes, {n: b.branch for n, b in branches.items()}, where)
    _has_volume(circuit, nodes, where)
    uses = _uses(nodes, {n: (b.branch.command, b.unit) for n, b in branches.items() if b.branch.command})
    signals = _signals(top, uses, where)
    run = top.table("run")
    run.only(("duration", "period", "step", "method"), "a run has")
    plan = CircuitPlan(
        title=top.word("title", Path(where).stem),
        circuit=circuit,
        nodes=nodes,
        signals=signals,
        environment=room,
        duration=run.number("duration", "s", declared=TIME),
        period=run.number("period", "s", 1e-3, declared=TIME),
        step=run.number("step", "s", STEP, declared=TIME),
        method=run.word("method", "auto", among=METHODS),
        document=dict(document),
        where=where,
        digest=digest,
        fit=read_fit(top.table("fit")),
    )
    _check_run(plan)
    return plan


def _environment(entry: FileTable) -> Environment:
    entry.only(("pressure", "temperature"), "an environment has")
    known = declared(Environment)
    plain = Environment()
    return Environment(
        pressure_abs=entry.number("pressure", "Pa", float(plain.pressure_abs), declared=known["pressure_abs"]),
        temperature=entry.number("temperature", "K", float(plain.temperature), declared=known["temperature"]),
    )


def _named(top: FileTable, section: str) -> list[tuple[str, FileTable]]:
    entry = top.table(section)
    if not entry.values:
        raise top.fail(section, "missing", f"must be one [{section}.NAME] or more")
    _check_names(entry)
    return [(name, entry.table(name)) for name in entry.values]


def _check_names(entry: FileTable) -> None:
    for name in entry.values:
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", name):
            raise entry.fail(name, name, "must be a name of letters, digits, - and _ that begins with a letter")


def _circuit(nodes: Mapping[str, PlannedNode], branches: Mapping[str, Branch], where: str) -> Circuit:
    try:
        return Circuit.of({name: n.node for name, n in nodes.items()}, branches)
    except InputError as error:
        head = error.field.split(".")[0]
        section = "elements." if head in branches else "nodes." if head in nodes else ""
        raise InputError(section + error.field, error.value, error.allowed, where=where) from None


def _has_volume(circuit: Circuit, nodes: Mapping[str, PlannedNode], where: str) -> None:
    for name, planned in nodes.items():
        if not planned.needs_volume:
            continue
        given = sum(
            float(inner)
            for element, (ends, _) in circuit.ends.items()
            for end, inner in zip(ends, circuit.elements[element].inner_volumes(), strict=True)
            if end == name
        )
        if not given > 0.0:
            raise InputError(
                f"nodes.{name}.volume",
                "missing",
                "nothing that joins here gives the junction volume; state one, or join a tube that has a bore",
                where=where,
            )


def _uses(
    nodes: Mapping[str, PlannedNode], commands: Mapping[str, tuple[str | None, str]]
) -> dict[str, list[tuple[str, str]]]:
    """Signal -> what it drives, by dotted path, and in which unit."""
    found: dict[str, list[tuple[str, str]]] = {}
    for name, planned in nodes.items():
        if planned.signal is not None:
            found.setdefault(planned.signal, []).append((f"nodes.{name}.signal", planned.unit))
    for name, (signal, unit) in commands.items():
        found.setdefault(str(signal), []).append((f"elements.{name}.command", unit))
    return found


def _signals(top: FileTable, uses: Mapping[str, list[tuple[str, str]]], where: str) -> dict[str, PlannedSignal]:
    stated = top.table("signals").values
    _check_names(top.table("signals"))
    for signal, drives in uses.items():
        if signal not in stated:
            hint = f"known are {', '.join(stated)}" if stated else f"state it as [signals.{signal}]"
            raise InputError(drives[0][0], signal, f"{suggest(signal, stated)}{hint}", where=where)
    found = {}
    for name, entry in stated.items():
        if name not in uses:
            raise InputError(
                f"signals.{name}", "unused", "must be a signal that a node or an element names", where=where
            )
        units = {unit for _, unit in uses[name]}
        places = tuple(place for place, _ in uses[name])
        if len(units) > 1:
            raise InputError(
                f"signals.{name}", ", ".join(places), f"it cannot be in {' and in '.join(sorted(units))}", where=where
            )
        (unit,) = units
        wave = read_waveform(entry, unit, field=f"signals.{name}", where=where, table=_reader(where, name))
        found[name] = PlannedSignal(wave, unit, places)
    return found


def _reader(where: str, name: str) -> Any:
    def read(file: str, time: str | None, column: str | None, unit: str) -> tuple[Any, Any]:
        from .signal_table import read_points

        return read_points(Path(where).parent / file, time, column, unit, field=f"signals.{name}", where=where)

    return read


def _check_run(plan: CircuitPlan) -> None:
    where, share = plan.where, plan.duration / plan.period
    if share > LONGEST:
        raise InputError(
            "run.duration",
            time_words(plan.duration),
            f"must be at most {LONGEST} samples, {time_words(LONGEST * plan.period)}",
            where=where,
        )
    if share < 0.5 or abs(share - round(share)) > 1e-6 * max(share, 1.0):
        raise InputError(
            "run.duration",
            time_words(plan.duration),
            f"must be a whole number of periods of {time_words(plan.period)}",
            where=where,
        )
    for name, signal in plan.signals.items():
        _resolved(name, signal.waveform, plan)
        values = signal.waveform.at(plan.times)
        for muscle, planned in plan.nodes.items():
            if planned.signal == name and planned.law is not None:
                for length in (float(values.min()), float(values.max())):
                    check_length(planned.law, length, f"signals.{name} (the length of {muscle})", where)
            elif (
                planned.signal == name
                and planned.unit == "Pa"
                and not float(values.min()) > -float(plan.environment.pressure_abs)
            ):
                raise InputError(
                    f"signals.{name}", f"{float(values.min()):.6g} Pa", f"it drives {muscle} below vacuum", where=where
                )


def _resolved(name: str, wave: Waveform, plan: CircuitPlan) -> None:
    if wave.fastest * plan.period > 0.5 * (1.0 + 1e-9):
        need = time_words(0.5 / wave.fastest)
        raise InputError(
            "run.period",
            time_words(plan.period),
            f"signals.{name} ({wave.kind}) needs {need} or less",
            where=plan.where,
        )
