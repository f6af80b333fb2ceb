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
`mckibben.experiments.waveforms`. The `pressure_abs` of the [environment] is absolute. [fit] says how
records of the circuit are read, and what is fitted to them. Files that are named, such as that of a specimen, are looked for
beside this one.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from .. import schema
from .._jax import Scalar, Tree
from ..accessors import implementation
from ..answers import Caution, brief, collect
from ..components import Environment, FlowElement, paths
from ..components.module import map_leaves
from ..documents import JsonValue, parse_toml, path_text, read_text, with_own_paths
from ..engine import STEP, Signal, fastest_rate, held, ramped
from ..engine.rates import RK4_LIMIT
from ..errors import InputError
from ..experiments.waveforms import Waveform, read_waveform, time_words
from ..muscles.build import rest_length_of
from ..muscles.evidence import law_cautions
from ..muscles.plausible import parameter_cautions, pressure_caution, room_caution, span_cautions
from ..pneumatics.build import put_value
from ..pneumatics.circuit import Circuit
from ..pneumatics.volume import Reservoir
from ..quantities import Quantity, named_values, parse
from ..recordings.files import read_points
from ..registry import with_own_references
from ..schema import FileTable, Place, named, nested, read_table
from ..slips import size_caution
from .circuit_parts import NODES, ElementTable, FitTable, NodeTable, PlannedNode, check_length

if TYPE_CHECKING:
    from ..recordings import Recording

SCHEMA = 1
METHODS = ("auto", "rk4", "ros2")
TIME = Quantity("s", (1e-9, 1e7), "time", "", (1e-3, 100.0))
LONGEST = 20_000_000  # samples
FEWEST = 5  # periods of a run; with fewer the period is a slip of its unit


@dataclass(frozen=True, kw_only=True)
class CircuitRunTable:
    """How long a circuit runs, and in which steps."""

    duration: float = schema.number("s", TIME.bounds, "duration of the run")
    period: float = schema.number("s", TIME.bounds, "period of the samples", default=1e-3)
    step: float = schema.number("s", TIME.bounds, "largest step of the physics", default=STEP)
    method: str = schema.word("method of the integration", among=METHODS, default="auto")


@dataclass(frozen=True, kw_only=True)
class CircuitFile:
    """A circuit file as its tables state it."""

    schema: int = SCHEMA
    title: str = ""
    note: str = ""
    environment: Environment = nested(Environment, owner="an environment has", default_factory=Environment)
    nodes: dict[str, NodeTable] = named(NODES, default_factory=dict)
    elements: dict[str, ElementTable] = named(ElementTable, default_factory=dict)
    signals: dict[str, Any] = named(None, default_factory=dict)
    run: CircuitRunTable = nested(CircuitRunTable, owner="a run has")
    fit: FitTable = nested(FitTable, owner="a fit has", default=FitTable())

    def __post_init__(self) -> None:
        for section in ("nodes", "elements"):
            if not getattr(self, section):
                raise InputError(section, None, f"is missing: a circuit needs one [{section}.NAME] or more")
        for name in self.elements.keys() & self.nodes.keys():
            raise InputError(f"elements.{name}", name, "must be a name of its own; a node has this one")


@dataclass(frozen=True)
class PlannedSignal:
    """A waveform, the SI unit of its values, and what it drives."""

    waveform: Waveform
    unit: str
    drives: tuple[str, ...]

    __repr__ = brief

    @property
    def straight(self) -> bool:
        """Whether it is straight between samples; lengths always are, for a wall that jumps would do no work."""
        return self.waveform.straight or self.unit == "m"


@dataclass(frozen=True)
class CircuitPlan:
    """A circuit with its signals and settings, from `mckibben.circuit`; immutable.

    Attributes:
        title: title of the circuit.
        circuit: the state equation.
        nodes: what the file says of each node.
        signals: by name.
        environment: the surroundings.
        duration: duration of the run [s].
        period: period of the samples [s].
        step: largest step of the physics [s].
        method: method of the integration.
        document: the file's tables, with what `change` replaced.
        fit: how records are read, and what is fitted to them.
        overrides: parameters that `change` replaced and no key of the file states [SI].
        where: the file.
        digest: SHA-256 of the file's text.
    """

    title: str
    circuit: Circuit
    nodes: dict[str, PlannedNode]
    signals: dict[str, PlannedSignal]
    environment: Environment
    duration: float
    period: float
    step: float
    method: str
    document: dict[str, Any]
    where: str
    digest: str
    overrides: dict[str, float] = field(default_factory=dict)
    fit: FitTable = field(default_factory=FitTable)

    @functools.cached_property
    def cautions(self) -> tuple[Caution, ...]:
        """What can hardly be meant of sizes, start pressures, lengths and commands that the file states, and of its laws.

        Raises:
            InputError: a command that its element cannot carry out, or a length that no muscle can have.
        """
        said: list[Caution | None] = [*parameter_cautions(self.owner), room_caution(self.environment)]
        if self.samples < FEWEST:
            few = f"a period of {time_words(self.period)} leaves {self.samples + 1} samples of {time_words(self.duration)}"
            said.append(Caution(few, "run.period"))
        said.append(size_caution(self.step, "s", name="run.step", usual=(1e-7, 1.0)))
        values = self.values()
        for name, node in self.nodes.items():
            spec = node.specimen
            courses = [values[node.signal]] if node.signal is not None else []
            if node.law is not None:
                said += law_cautions(spec, node.law)
                rest = rest_length_of(spec, node.law)
                for length in {float(end) for v in courses or [np.array(node.length)] for end in (v.min(), v.max())}:
                    said += span_cautions(length, node.law, rest, spec, name=f"length of {name}")
            held = 0.0
            if isinstance(node.node, Reservoir):
                held = float(node.node.pressure_abs) - float(self.environment.pressure_abs)
            pressures = [node.start, held, *(float(v.max()) for v in courses if node.unit == "Pa" and node.law is None)]
            said += [pressure_caution(p, spec, text=f"{p:g}", name=f"pressure of {name}") for p in pressures]
        for signal, course in values.items():
            if (element := driven(self, signal)) is not None:
                said.append(_beyond_range(element, signal, course, self.where))
        return collect(*said)

    def run(self, *, progress: Callable[[str], None] | None = None) -> Recording:
        """Simulate the circuit for its duration.

        Args:
            progress: called with a few words after each piece of the run.

        Raises:
            ConvergenceError: the integration stopped; says why and when.
        """
        recording: Recording = implementation("run_circuit")(self, progress=progress)
        return recording

    def __repr__(self) -> str:
        return f"CircuitPlan({self.title!r}: {', '.join(self.nodes)}; {self.duration:g} s)"

    @property
    def samples(self) -> int:
        """Sample intervals of the run."""
        return round(self.duration / self.period)

    @property
    def times(self) -> np.ndarray:
        """Times of the samples [s], (samples + 1,)."""
        return self.period * np.arange(self.samples + 1)

    @property
    def starts(self) -> dict[str, float]:
        """Gauge pressure of every volume at the start [Pa]."""
        return {name: self.nodes[name].start for name in self.circuit.chambers}

    def values(self) -> dict[str, np.ndarray]:
        """Values of every signal at all samples, in its SI unit, (samples + 1,)."""
        return {name: s.waveform.at(self.times) for name, s in self.signals.items()}

    def inputs_of(self, signal: str) -> list[str]:
        """Names of the inputs of the circuit that a signal of the file sets; the name itself where it is an input."""
        ends = {"1": "stroke", "Pa": "pressure", "m": "length"}
        nodes = [(name, node) for name, node in self.nodes.items() if node.signal == signal]
        return [f"{name}.{ends['m' if node.law is not None else node.unit]}" for name, node in nodes] or [signal]

    def inputs(
        self, times: np.ndarray | None = None, changed: Mapping[str, Scalar] | None = None, sensed: bool = False
    ) -> dict[str, Signal]:
        """Input signals of the circuit, including delayed commands; ready for `integrate`.

        Args:
            times: times of the samples, instead of the plan's own [s].
            changed: values of some signals at these times, such as from a recording, instead of their waveforms [SI].
            sensed: those of pressures were measured, and are straight between samples whatever the waveform is.
        """
        times = self.times if times is None else times
        values = {name: s.waveform.at(times) for name, s in self.signals.items()} | dict(changed or {})
        signals = {name: (ramped if s.straight else held)(values[name]) for name, s in self.signals.items()}
        for name, planned in self.nodes.items():
            if planned.signal is not None and planned.unit == "1":
                signals[f"{name}.stroke"] = ramped(values[planned.signal])
            elif planned.signal is not None and planned.law is None:
                straight = self.signals[planned.signal].straight or (sensed and planned.signal in (changed or {}))
                absolute = values[planned.signal] + float(self.environment.pressure_abs)
                signals[f"{name}.pressure"] = (ramped if straight else held)(absolute)
            elif planned.law is not None:
                length = np.full(times.shape, planned.length) if planned.signal is None else values[planned.signal]
                signals[f"{name}.length"] = ramped(length)
        # The engine reads from its signals how long to run; a circuit without any still takes time.
        return self.circuit.commands(signals or {"time": ramped(times)})

    def initial(self) -> tuple[Tree, Tree]:
        """State and memory at the start."""
        room = self.environment
        first = {name: s.at(0, 0.0, self.period) for name, s in self.inputs().items()}
        pressures = {name: start + float(room.pressure_abs) for name, start in self.starts.items()}
        state = self.circuit.at_rest(pressures, first, float(room.temperature))
        return state, self.circuit.initial_memory(state, first)

    def rates(self) -> tuple[float, str]:
        """Fastest rate at the start [1/s], and the method that a run begins with."""
        state, memory = self.initial()
        first = {name: s.at(0, 0.0, self.period) for name, s in self.inputs().items()}
        # `fastest_rate` looks at many states at once, and here is one of them
        lead = map_leaves(lambda x: np.asarray(x)[None], (state, memory, first))
        rate = fastest_rate(self.circuit, *lead)
        return rate, self.method if self.method != "auto" else "ros2" if rate * self.inner_step > RK4_LIMIT else "rk4"

    @property
    def inner_step(self) -> float:
        """The step that fits the period a whole number of times [s]."""
        step: float = self.period / max(1, round(np.ceil(self.period / self.step - 1e-9)))
        return step

    @property
    def owner(self) -> dict[str, JsonValue]:
        """Root objects of the dotted paths of declared parameters."""
        return {"nodes": self.circuit.nodes, "elements": self.circuit.elements, "gas": self.circuit.gas}

    def change(self, changes: Mapping[str, str | float]) -> CircuitPlan:
        """Return a plan with other values.

        A key of the file is replaced there, and all that follows from it is rebuilt: a tube of another length has another
        loss. A parameter that no key states is replaced in what was built.

        Args:
            changes: dotted path to a value as text, such as ``{"elements.tube.length": "2 m"}``; the bare number of a
                declared parameter is SI.

        Raises:
            InputError: names the path, the value and what is allowed.
        """
        document, overrides = self.document, dict(self.overrides)
        for path, value in named_values(changes, "changes").items():
            known = dict(paths.parameters(self.owner))
            words = with_bare_unit(value, known[path].unit) if path in known else str(value)
            if path in known and not has(document, path):
                overrides[path] = parse(words, known[path].unit, field=path, where=self.where)
                known[path].check(path, overrides[path], where=self.where)
            else:
                document = _put_value(document, path, words, [*leaves(document), *known], self.where)
        return build_plan(document, where=self.where, digest=self.digest).overridden(overrides)

    def overridden(self, values: Mapping[str, JsonValue]) -> CircuitPlan:
        """Return a plan with parameters of the built circuit replaced [SI]; the values may be traced."""
        for path in values:
            paths.declaration(self.owner, path)
        return replace(self, circuit=paths.put(self.circuit, values), overrides=self.overrides | dict(values))


def driven(plan: CircuitPlan, signal: str) -> FlowElement | None:
    """The element that a signal of a circuit commands; None if it commands none."""
    ends = plan.circuit.ends
    return next((e for name, e in plan.circuit.elements.items() if ends[name][1] == signal), None)


def _beyond_range(element: FlowElement, signal: str, course: np.ndarray, where: str) -> Caution | None:
    low, high = element.command_range
    worst = float(course.max()) if course.max() > high else float(course.min())
    if low <= worst <= high:
        unit = element.command_unit
        return pressure_caution(worst, text=f"{worst:g}", name=f"pressure of signal {signal}") if unit == "Pa" else None
    ends = f"{low:g} to {high:g}"
    if not element.saturates:
        raise InputError(f"signals.{signal}", f"{worst:g}", f"must be from {ends}", where=where)
    return Caution(
        f"a command {signal} of {worst:g} is beyond its range, {ends}: it acts as its end", f"command {signal}"
    )


def with_bare_unit(value: str | float, unit: str) -> str:
    """Value as text; a bare number gets its unit."""
    text = str(value).strip()
    try:
        float(text)
    except ValueError:
        return text
    return text if unit == "1" else f"{text} {unit}"


def leaves(document: object, prefix: str = "") -> Iterator[str]:
    """The dotted paths of all that a document states."""
    if isinstance(document, Mapping):
        for key, value in document.items():
            yield from leaves(value, f"{prefix}.{key}".lstrip("."))
    else:
        yield prefix


def has(document: object, path: str) -> bool:
    """Whether a document contains a dotted path; items of a list are counted from 1."""
    for part in path.split("."):
        if isinstance(document, list) and part.isdigit() and 1 <= int(part) <= len(document):
            document = document[int(part) - 1]
        elif isinstance(document, Mapping) and part in document:
            document = document[part]
        else:
            return False
    return True


def _put_value(document: Any, path: str, value: Any, known: list[str], where: str) -> Any:
    parts = path.split(".")
    inside = parts[0] in ("environment", "run") or (len(parts) > 2 and has(document, ".".join(parts[:2])))
    if not (inside or has(document, path)):
        raise InputError("parameter", path, "no key or parameter has that path", known=known, where=where)
    if parts[0] == "elements" and len(parts) == 3:
        element = put_value(document["elements"][parts[1]], parts[2], _toml(value))
        return {**document, "elements": {**document["elements"], parts[1]: element}}
    try:
        return _inside(document, parts, _toml(value))
    except ValueError:
        raise InputError("parameter", path, "must be a place in the list, counted from 1", where=where) from None


def _inside(document: Any, parts: list[str], value: Any) -> Any:
    head, *rest = parts
    if isinstance(document, list):
        at = int(head)
        if not 1 <= at <= len(document):
            raise ValueError
        return [*document[: at - 1], _inside(document[at - 1], rest, value) if rest else value, *document[at:]]
    if not isinstance(document, Mapping):
        document = {}
    return {**document, head: _inside(document.get(head, {}), rest, value) if rest else value}


def _toml(value: Any) -> Any:
    """A number, a list or a table as TOML writes it; anything else is a text."""
    if not isinstance(value, str):
        return value
    try:
        return parse_toml(f"value = {value}", where="--set")["value"]
    except InputError:
        return value


def read_circuit(path: str | os.PathLike[str]) -> CircuitPlan:
    """Read a circuit file: a circuit with its signals and settings, ready to be changed and run.

    Args:
        path: a TOML file.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.

    Examples:
        >>> import mckibben as mk
        >>> plan = mk.circuit("examples/circuits/muscle-on-a-valve.toml")
        >>> recording = plan.change({"run.duration": "50 ms"}).run()
        >>> recording.meta["result"]
        'done'
    """
    where = path_text(path, "circuit")
    text = read_text(path)
    document = with_own_references(with_own_paths(parse_toml(text, where=where), where), where)
    return build_plan(document, where=where, digest=hashlib.sha256(text.encode()).hexdigest())


def build_plan(document: Mapping[str, JsonValue], *, where: str, digest: str) -> CircuitPlan:
    """The plan of a document that was read; raises as `read_circuit` does."""
    top = FileTable(document, "", where)
    top.schema(SCHEMA)
    file = read_table(CircuitFile, top, owner="a circuit has")
    room = file.environment
    at = {section: Place(section, where or None) for section in ("nodes", "elements")}
    nodes = {name: table.planned(name, at["nodes"].below(name), room) for name, table in file.nodes.items()}
    branches = {name: table.planned(at["elements"].below(name), list(nodes)) for name, table in file.elements.items()}
    try:
        circuit = Circuit.of({n: p.node for n, p in nodes.items()}, {n: b.branch for n, b in branches.items()})
    except InputError as error:  # a circuit knows nothing of the sections of a file
        head = error.field.split(".")[0]
        section = "elements." if head in branches else "nodes." if head in nodes else ""
        raise error.changed(field=section + error.field, where=where) from None
    _has_volume(circuit, nodes, where)
    uses: dict[str, list[tuple[str, str]]] = {}  # what each signal drives, by dotted path, and in which unit
    for name, planned in nodes.items():
        if planned.signal is not None:
            uses.setdefault(planned.signal, []).append((f"nodes.{name}.signal", planned.unit))
    for name, made in branches.items():
        if made.branch.command:
            uses.setdefault(made.branch.command, []).append((f"elements.{name}.command", made.unit))
    plan = CircuitPlan(
        title=file.title or Path(where).stem,
        circuit=circuit,
        nodes=nodes,
        signals=_signals(file.signals, uses, where),
        environment=room,
        **dataclasses.asdict(file.run),
        document=dict(document),
        where=where,
        digest=digest,
        fit=file.fit,
    )
    _check_run(plan)
    return plan


def _has_volume(circuit: Circuit, nodes: Mapping[str, PlannedNode], where: str) -> None:
    for name, planned in nodes.items():
        if not planned.needs_volume:
            continue
        stated = sum(
            float(inner)
            for element, (ends, _) in circuit.ends.items()
            for end, inner in zip(ends, circuit.elements[element].inner_volumes(), strict=True)
            if end == name
        )
        if not stated > 0.0:
            problem = "is missing: nothing that joins here gives the junction volume; "
            problem += "state one, or join a tube that has a bore"
            raise InputError(f"nodes.{name}.volume", None, problem, where=where)


def _signals(
    stated: Mapping[str, JsonValue], uses: Mapping[str, list[tuple[str, str]]], where: str
) -> dict[str, PlannedSignal]:
    for signal, drives in uses.items():
        if signal not in stated:
            if stated:
                raise InputError(drives[0][0], signal, known=stated, where=where)
            raise InputError(drives[0][0], signal, f"state it as [signals.{signal}]", where=where)
    signals = {}
    for name, entry in stated.items():
        if name not in uses:
            raise InputError(f"signals.{name}", None, "is unused: no node or element names it", where=where)
        units = {unit for _, unit in uses[name]}
        places = tuple(place for place, _ in uses[name])
        if len(units) > 1:
            raise InputError(
                f"signals.{name}", ", ".join(places), f"it cannot be in {' and in '.join(sorted(units))}", where=where
            )
        (unit,) = units
        field = f"signals.{name}"

        def read(file: str, time: str | None, column: str | None, unit: str, field: str = field) -> tuple[Tree, Tree]:
            return read_points(Path(where).parent / file, time, column, unit, field=field, where=where)

        wave = read_waveform(entry, unit, field=field, where=where, table=read)
        signals[name] = PlannedSignal(wave, unit, places)
    return signals


def _check_run(plan: CircuitPlan) -> None:
    where, share = plan.where, plan.duration / plan.period
    if share > LONGEST:
        most = f"must be at most {LONGEST} samples, {time_words(LONGEST * plan.period)}"
        raise InputError("run.duration", time_words(plan.duration), most, where=where)
    if share < 0.5 or abs(share - round(share)) > 1e-6 * max(share, 1.0):
        whole = f"must be a whole number of periods of {time_words(plan.period)}"
        raise InputError("run.duration", time_words(plan.duration), whole, where=where)
    for name, signal in plan.signals.items():
        wave = signal.waveform
        if wave.fastest * plan.period > 0.5 * (1.0 + 1e-9):
            need = f"must be {time_words(0.5 / wave.fastest)} or less for signals.{name} ({wave.kind})"
            raise InputError("run.period", time_words(plan.period), need, where=where)
        values = signal.waveform.at(plan.times)
        for muscle, planned in plan.nodes.items():
            if planned.signal == name and planned.law is not None:
                for length in (float(values.min()), float(values.max())):
                    check_length(planned.law, length, f"signals.{name} (the length of {muscle})", where)
            elif planned.signal == name and planned.unit == "Pa":
                lowest = float(values.min())
                if not lowest > -float(plan.environment.pressure_abs):
                    problem = f"drives {muscle} below vacuum, to {lowest:.6g} Pa"
                    raise InputError(f"signals.{name}", None, problem, where=where)
