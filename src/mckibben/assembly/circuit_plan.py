"""A circuit with all that a run of it needs: signals, start pressures, surroundings, duration and clocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from ..components import Environment, paths
from ..documents import parse_toml
from ..engine import Signal, fastest_rate, held, ramped
from ..engine.rates import RK4_LIMIT
from ..errors import InputError, suggest
from ..experiments.waveforms import Waveform
from ..pneumatics.circuit import Circuit
from ..pneumatics.sizes import put_value
from ..quantities import parse
from .circuit_nodes import PlannedNode
from .fit_table import FitTable


@dataclass(frozen=True)
class PlannedSignal:
    """A waveform, the SI unit of its values, and what it drives."""

    waveform: Waveform
    unit: str
    drives: tuple[str, ...]

    @property
    def straight(self) -> bool:
        """Whether it is straight between samples; lengths always are, for a wall that jumps would do no work."""
        return self.waveform.straight or self.unit == "m"


@dataclass(frozen=True)
class CircuitPlan:
    """What `read_circuit` makes of a file; immutable.

    Attributes:
        title: of the circuit.
        circuit: the state equation.
        nodes: what the file says of each node.
        signals: by name.
        environment: the surroundings.
        duration: of the run [s].
        period: of the samples [s].
        step: largest step of the physics [s].
        method: of the integration.
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

    @property
    def samples(self) -> int:
        """Sample intervals of the run."""
        return round(self.duration / self.period)

    @property
    def times(self) -> np.ndarray:
        """Of the samples [s], (samples + 1,)."""
        return self.period * np.arange(self.samples + 1)

    @property
    def starts(self) -> dict[str, float]:
        """Gauge pressure of every volume at the start [Pa]."""
        return {name: self.nodes[name].start for name in self.circuit.chambers}

    def values(self) -> dict[str, np.ndarray]:
        """Every signal at all samples, in its SI unit, (samples + 1,)."""
        return {name: s.waveform.at(self.times) for name, s in self.signals.items()}

    def inputs(
        self, times: Any = None, given: Mapping[str, Any] | None = None, sensed: bool = False
    ) -> dict[str, Signal]:
        """What the circuit is driven by, commands with dead time included; ready for `integrate`.

        Args:
            times: of the samples, instead of the plan's own [s].
            given: values of some signals at these times, such as from a recording, instead of their waveforms [SI].
            sensed: those of pressures were measured, and are straight between samples whatever the waveform is.
        """
        times = self.times if times is None else times
        values = {name: s.waveform.at(times) for name, s in self.signals.items()} | dict(given or {})
        found = {name: (ramped if s.straight else held)(values[name]) for name, s in self.signals.items()}
        for name, planned in self.nodes.items():
            if planned.signal is not None and planned.unit == "1":
                found[f"{name}.stroke"] = ramped(values[planned.signal])
            elif planned.signal is not None and planned.law is None:
                straight = self.signals[planned.signal].straight or (sensed and planned.signal in (given or {}))
                absolute = values[planned.signal] + float(self.environment.pressure_abs)
                found[f"{name}.pressure"] = (ramped if straight else held)(absolute)
            elif planned.law is not None:
                length = np.full(times.shape, planned.length) if planned.signal is None else values[planned.signal]
                found[f"{name}.length"] = ramped(length)
        # The engine reads from its signals how long to run; a circuit without any still takes time.
        return self.circuit.commands(found or {"time": ramped(times)})

    def initial(self) -> tuple[Any, Any]:
        """State and memory at the start."""
        room = self.environment
        first = {name: s.at(0, 0.0, self.period) for name, s in self.inputs().items()}
        pressures = {name: start + float(room.pressure_abs) for name, start in self.starts.items()}
        state = self.circuit.at_rest(pressures, first, float(room.temperature))
        return state, self.circuit.initial_memory(state, first)

    def rates(self) -> tuple[float, str]:
        """Fastest rate at the start [1/s], and the method that a run begins with."""
        import jax
        import jax.numpy as jnp

        state, memory = self.initial()
        first = {name: s.at(0, 0.0, self.period) for name, s in self.inputs().items()}
        lead = jax.tree.map(lambda x: jnp.asarray(x)[None], (state, memory, first))
        rate = fastest_rate(self.circuit, *lead)
        return rate, self.method if self.method != "auto" else "ros2" if rate * self.inner_step > RK4_LIMIT else "rk4"

    @property
    def inner_step(self) -> float:
        """The step that fits the period a whole number of times [s]."""
        return self.period / max(1, round(np.ceil(self.period / self.step - 1e-9)))

    @property
    def owner(self) -> dict[str, Any]:
        """What the declared parameters are addressed in."""
        return {"nodes": self.circuit.nodes, "elements": self.circuit.elements, "gas": self.circuit.gas}

    def change(self, changes: Mapping[str, str | float]) -> CircuitPlan:
        """The same plan with other values.

        A key of the file is replaced there, and all that follows from it is built anew: a tube of another length has another
        loss. A parameter that no key states is replaced in what was built.

        Args:
            changes: dotted path to a value in words, such as ``{"elements.tube.length": "2 m"}``; the bare number of a
                declared parameter is SI.

        Raises:
            InputError: names the path, the value and what is allowed.
        """
        from .circuit_file import build_plan

        document, overrides = self.document, dict(self.overrides)
        for path, value in changes.items():
            known = dict(paths.parameters(self.owner))
            words = with_bare_unit(value, known[path].unit) if path in known else str(value)
            if path in known and not has(document, path):
                overrides[path] = parse(words, known[path].unit, field=path, where=self.where)
                known[path].check(path, overrides[path], where=self.where)
            else:
                document = _put(document, path, words, [*leaves(document), *known], self.where)
        return build_plan(document, where=self.where, digest=self.digest).overridden(overrides)

    def overridden(self, values: Mapping[str, Any]) -> CircuitPlan:
        """With declared parameters replaced in what was built [SI]; they may be traced."""
        for path in values:
            paths.declaration(self.owner, path)
        return replace(self, circuit=paths.put(self.circuit, values), overrides=self.overrides | dict(values))


def with_bare_unit(value: str | float, unit: str) -> str:
    """A value in words; a bare number gets its unit."""
    text = str(value).strip()
    try:
        float(text)
    except ValueError:
        return text
    return text if unit == "1" else f"{text} {unit}"


def leaves(document: Any, prefix: str = "") -> Iterator[str]:
    """The dotted paths of all that a document states."""
    if isinstance(document, Mapping):
        for key, value in document.items():
            yield from leaves(value, f"{prefix}.{key}".lstrip("."))
    else:
        yield prefix


def has(document: Any, path: str) -> bool:
    """Whether a document states something at a dotted path; parts of a list are counted from 1."""
    for part in path.split("."):
        if isinstance(document, list) and part.isdigit() and 1 <= int(part) <= len(document):
            document = document[int(part) - 1]
        elif isinstance(document, Mapping) and part in document:
            document = document[part]
        else:
            return False
    return True


def _put(document: Any, path: str, value: Any, known: list[str], where: str) -> Any:
    parts = path.split(".")
    inside = parts[0] in ("environment", "run") or (len(parts) > 2 and has(document, ".".join(parts[:2])))
    if not (inside or has(document, path)):
        raise InputError("parameter", path, f"{suggest(path, known)}no such key or parameter", where=where)
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
