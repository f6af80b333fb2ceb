"""Hosts as `mckibben conform` sees them: an adapter builds a part into a host and opens scenarios there.

A host without mechanics of its own, such as a loop in C or a master of FMUs, needs only a `PartInstance`: the loop around
it is here (`LoopHost`). A host with mechanics of its own implements `HostAdapter` and `HostedMechanism`.
"""

from __future__ import annotations

import abc
import ctypes
import functools
import platform
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, ClassVar, NamedTuple

import numpy as np

from .c_source import PartSource, build_library, c_source, compiler_version
from .part import Part
from .scenarios import HostMoment, Scenario

Numbers = Mapping[str, float]  # by the name of a muscle or a command
MASSES = "physics.circuit.mass."  # beginning of the paths of the masses of gas in a part's state


class PartReadings(NamedTuple):
    """What a part in a host has returned of its last step.

    Attributes:
        tension: mean over the step, by muscle [N].
        pressure: gauge, at its end, by muscle [Pa].
        work: of the host on all muscles since the start, as the part accounts for it [J].
        gas: in all volumes of the part at the end of the step [kg]; None where the host does not know it.
    """

    tension: dict[str, float]
    pressure: dict[str, float]
    work: float
    gas: float | None = None

    @classmethod
    def of_variables(cls, muscles: Sequence[str], values: Sequence[float]) -> PartReadings:
        """Readings from the variables of an FMU.

        Args:
            muscles: names of the muscles.
            values: tension of every muscle [N], pressure of every muscle [Pa], work on every muscle [J], and the masses
                of gas [kg], if the host has them.
        """
        count = len(muscles)
        tension, pressure = (dict(zip(muscles, values[k * count :], strict=False)) for k in (0, 1))
        gas = values[3 * count :]
        return cls(tension, pressure, float(sum(values[2 * count : 3 * count])), float(sum(gas)) if len(gas) else None)

    @classmethod
    def of(cls, part: Part, state: np.ndarray, outputs: Any) -> PartReadings:
        """What a part has returned in Python: its state after the step, and its outputs as `Part.step` returns them."""
        values, alone = outputs._asdict(), len(part.muscles) == 1
        tension, pressure, work = (
            {n: values[name if alone else f"{n}_{name}"] for n in part.muscles}
            for name in ("tension", "pressure", "work")
        )
        return cls(tension, pressure, sum(work.values()), part.gas_mass(state))


class PartInstance(abc.ABC):
    """A part in a host without mechanics, at some moment; at first at rest at the span and commands of its first step."""

    @abc.abstractmethod
    def step(self, period: float, span: Numbers, rate: Numbers, commands: Numbers) -> PartReadings:
        """Go on by one step of the host.

        Args:
            period: of the step [s].
            span: of each muscle at its start [m].
            rate: of each span [m/s].
            commands: by name [SI].
        """

    @abc.abstractmethod
    def save(self) -> Any:
        """All that changes, in a form that stays as it is."""

    @abc.abstractmethod
    def restore(self, saved: Any) -> None:
        """Return to what `save` returned, perhaps of another instance of the same part."""

    @abc.abstractmethod
    def look(self, span: Numbers, rate: Numbers, commands: Numbers) -> None:
        """Evaluate outputs without going on."""


class HostedMechanism(abc.ABC):
    """The mechanism of a scenario with its part, in a host, at some moment."""

    @property
    @abc.abstractmethod
    def position(self) -> float:
        """Position [m] or [rad]."""

    @property
    @abc.abstractmethod
    def rate(self) -> float:
        """Rate of the position [m/s] or [rad/s]."""

    @abc.abstractmethod
    def step(self, moment: HostMoment) -> PartReadings:
        """Go on by one step of the host."""

    @abc.abstractmethod
    def save(self) -> Any:
        """All that changes, in a form that stays as it is."""

    @abc.abstractmethod
    def restore(self, saved: Any) -> None:
        """Return to what `save` returned, perhaps of a copy."""

    @abc.abstractmethod
    def copy(self) -> HostedMechanism:
        """Another one at the same moment, which does not change when this one goes on."""

    @abc.abstractmethod
    def reset(self) -> None:
        """Return to the start."""

    @abc.abstractmethod
    def look(self, moment: HostMoment) -> None:
        """Evaluate without going on."""


class RebuiltMechanism(HostedMechanism):
    """A mechanism whose copy is built anew and brought to the same moment."""

    def __init__(self, scenario: Scenario, period: float) -> None:
        self.scenario, self.period = scenario, period
        self.build()
        self._first = self.save()

    @abc.abstractmethod
    def build(self) -> None:
        """Make the scenario in the host, at its start."""

    def copy(self) -> HostedMechanism:
        """Another one at the same moment."""
        twin = type(self)(self.scenario, self.period)
        twin.restore(self.save())
        return twin

    def reset(self) -> None:
        """Return to the start."""
        self.restore(self._first)


class OwnActuator(NamedTuple):
    """An actuator for McKibben muscles that a host brings along, and a part with the same braid, where the braid is slack.

    Attributes:
        title: the actuator, its braid and pressure, as a phrase.
        span: shorter than the free length of the braid [m].
        own_tension: of the host's actuator, negative where it pushes [N].
        tension: of the part [N].
    """

    title: str
    span: float
    own_tension: float
    tension: float


class HostAdapter(abc.ABC):
    """A host into which parts can be built.

    Attributes:
        name: by which it is asked for.
        title: what it is, in a phrase.
        staggered: whether its rates are half a step older than its positions.
        caveats: what could not be tested here, as sentences.
        untested: tests of states that the host has no means for, by their names in `conformance.STATE_CHECKS`.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    staggered: ClassVar[bool]
    caveats: ClassVar[tuple[str, ...]] = ()
    untested: ClassVar[tuple[str, ...]] = ()

    @abc.abstractmethod
    def version(self) -> str:
        """Name and version of the host."""

    @abc.abstractmethod
    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The mechanism and part of a scenario at their start; the host's step [s]."""

    def close(self) -> None:  # noqa: B027 - most build nothing
        """Remove what was built; nothing by default."""

    def own_actuator(self) -> OwnActuator | None:
        """The host's own actuator beside a part; None where it brings none along."""
        return None


class _LoopMechanism(HostedMechanism):
    """A mechanism stepped by a loop of ours: semi-implicitly where the host is staggered, else by the mean acceleration."""

    def __init__(self, scenario: Scenario, period: float, *, staggered: bool, make: Any) -> None:
        self.scenario, self.instance, self.period = scenario, make(), period
        self.staggered, self._make = staggered, make
        self._position, self._rate = scenario.mechanism.start, 0.0
        self._first = self.instance.save()

    @property
    def position(self) -> float:
        return self._position

    @property
    def rate(self) -> float:
        return self._rate

    def step(self, moment: HostMoment) -> PartReadings:
        mechanism, h = self.scenario.mechanism, self.period
        if moment.position is not None and moment.rate is not None:
            self._position, self._rate = moment.position, moment.rate
        spans, rates = mechanism.span(self._position), mechanism.span_rate(self._rate)
        readings: PartReadings = self.instance.step(
            h, spans, rates, moment.commands
        )  # the part first, then the mechanism
        if moment.position is not None:
            self._position += h * self._rate
            return readings
        acceleration, before = mechanism.acceleration(readings.tension, moment.force), self._rate
        self._rate += h * acceleration
        self._position += h * (self._rate if self.staggered else 0.5 * (before + self._rate))
        return readings

    def save(self) -> Any:
        return self._position, self._rate, self.instance.save()

    def restore(self, saved: Any) -> None:
        self._position, self._rate, part = saved
        self.instance.restore(part)

    def copy(self) -> HostedMechanism:
        twin = _LoopMechanism(self.scenario, self.period, staggered=self.staggered, make=self._make)
        twin.restore(self.save())
        return twin

    def reset(self) -> None:
        self._position, self._rate = self.scenario.mechanism.start, 0.0
        self.instance.restore(self._first)

    def look(self, moment: HostMoment) -> None:
        mechanism = self.scenario.mechanism
        self.instance.look(mechanism.span(self._position), mechanism.span_rate(self._rate), moment.commands)


class LoopHost(HostAdapter):
    """A host without mechanics of its own."""

    @abc.abstractmethod
    def instance(self, part: Part, parameters: Mapping[str, float]) -> PartInstance:
        """A new instance of a part, with some parameters by dotted path changed."""

    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The mechanism and part of a scenario at their start."""
        make = functools.partial(self.instance, scenario.part, scenario.parameters)
        return _LoopMechanism(scenario, period, staggered=self.staggered, make=make)


class _PythonInstance(PartInstance):
    """A part that is stepped from Python."""

    def __init__(self, part: Part, staggered: bool) -> None:
        self.part, self.staggered = part, staggered
        self.state: np.ndarray | None = None

    def step(self, period: float, span: Numbers, rate: Numbers, commands: Numbers) -> PartReadings:
        if self.state is None:
            self.state = self.part.rest(span, **commands)
        self.state, readings = self.part.step(
            self.state, period=period, span=span, rate=rate, staggered=self.staggered, **commands
        )
        return PartReadings.of(self.part, self.state, readings)

    def save(self) -> Any:
        return self.state

    def restore(self, saved: Any) -> None:
        self.state = saved

    def look(self, span: Numbers, rate: Numbers, commands: Numbers) -> None:
        if self.state is not None:
            self.part.observe(self.state, span=span, rate=rate, **commands)


class PythonHost(LoopHost):
    """A loop in Python that knows position and rate at one time."""

    name, title, staggered = "python", "loop in Python, mean acceleration", False

    def version(self) -> str:
        """Version of Python."""
        return f"Python {platform.python_version()}"

    def instance(self, part: Part, parameters: Mapping[str, float]) -> PartInstance:
        """A new instance of a part."""
        return _PythonInstance(part.with_parameters(parameters), self.staggered)


class _CompiledPart:
    """A part as a shared library."""

    def __init__(self, source: PartSource, folder: Path) -> None:
        source.write(folder)
        self.name, self.source = source.name, source
        library = build_library([folder / f"{source.name}.c"], folder / f"{source.name}.so")
        self.library = ctypes.CDLL(str(library))
        groups = ("parameters", "state", "inputs", "outputs")
        self.sizes = {g: int(sum(np.prod(v.shape) for v in source.of(g))) for g in groups}
        self.inputs, self.outputs = source.places("inputs"), source.places("outputs")
        self.masses = [at for path, at in source.places("state").items() if path.startswith(MASSES)]
        self.step, self.observe = self.library[f"{source.name}_step"], self.library[f"{source.name}_observe"]
        self.step.argtypes = [ctypes.c_void_p] * 3 + [ctypes.c_double, ctypes.c_int, ctypes.c_void_p]
        self.observe.argtypes = [ctypes.c_void_p] * 4
        self.step.restype = self.observe.restype = None

    def parameters(self, changes: Mapping[str, float]) -> np.ndarray:
        kind = ctypes.c_double * self.sizes["parameters"]
        values = np.array(kind.in_dll(self.library, f"{self.name}_default_parameters"))
        places = self.source.places("parameters")
        for path, value in changes.items():
            values[places[path]] = value
        return values


class _CInstance(PartInstance):
    """A part that is stepped in C."""

    def __init__(self, compiled: _CompiledPart, part: Part, changes: Mapping[str, float], staggered: bool) -> None:
        self.compiled, self.muscles, self.staggered = compiled, part.muscles, int(staggered)
        others = (np.zeros(compiled.sizes[group]) for group in ("state", "inputs", "outputs"))
        self.numbers = [compiled.parameters(changes), *others]
        self.pointers = [vector.ctypes.data for vector in self.numbers]

    def _put(self, span: Numbers, rate: Numbers, commands: Numbers) -> None:
        places, inputs = self.compiled.inputs, self.numbers[2]
        for group, values in (("span", span), ("rate", rate), ("command", commands)):
            for name, value in values.items():
                inputs[places[f"{group}.{name}"]] = value

    def step(self, period: float, span: Numbers, rate: Numbers, commands: Numbers) -> PartReadings:
        self._put(span, rate, commands)
        parameters, state, inputs, outputs = self.pointers
        self.compiled.step(parameters, state, inputs, period, self.staggered, outputs)
        values, places = self.numbers[3], self.compiled.outputs
        return PartReadings(
            {n: float(values[places[f"tension.{n}"]]) for n in self.muscles},
            {n: float(values[places[f"muscle.{n}.pressure"]]) for n in self.muscles},
            float(sum(values[places[f"work.{n}"]] for n in self.muscles)),
            float(self.numbers[1][self.compiled.masses].sum()),
        )

    def save(self) -> Any:
        return self.numbers[1].copy()

    def restore(self, saved: Any) -> None:
        self.numbers[1][:] = saved

    def look(self, span: Numbers, rate: Numbers, commands: Numbers) -> None:
        self._put(span, rate, commands)
        self.compiled.observe(*self.pointers)


class BuildingHost(LoopHost):
    """A host without mechanics for which each part is built once, into a folder that is removed with the host."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="mckibben-")
        self._built: dict[str, Any] = {}

    @abc.abstractmethod
    def build(self, part: Part, folder: Path) -> Any:
        """What all instances of a part share; the folder is not there yet."""

    def built(self, part: Part) -> Any:
        """What was built for a part, now or before."""
        key = part.fingerprint
        if key not in self._built:
            self._built[key] = self.build(part, Path(self._folder.name, key))
        return self._built[key]

    def close(self) -> None:
        """Remove what was built."""
        self._built.clear()
        self._folder.cleanup()


class CHost(BuildingHost):
    """The part in C, called by a loop that steps as game engines do."""

    name, title, staggered = "c", "C called from Python, semi-implicit Euler", True

    def version(self) -> str:
        """Version of the compiler."""
        return compiler_version()

    def build(self, part: Part, folder: Path) -> _CompiledPart:
        """The library of a part."""
        return _CompiledPart(c_source(part, "part"), folder)

    def instance(self, part: Part, parameters: Mapping[str, float]) -> PartInstance:
        """A new instance of a part, which is compiled once."""
        return _CInstance(self.built(part), part, parameters, self.staggered)
