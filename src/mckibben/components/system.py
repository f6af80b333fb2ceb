"""Interfaces of systems to integrate, from the state equation to the machine that software samples.

A `System` is a state equation with memory beside it for friction; one of many like units is cut into cells by a `Coupling`,
which stand side by side as `UnitRows`. A `Plant` is a system with converters, which `Software` commands on the sample clock.
`SENSORS` are the kinds of analogue sensors that it can have. A rig's file has a table ``[sensors.NAME]`` for each of them,
which may say when its reading stops the machine; the recording has a channel of that name, and a step of a protocol can end
by a test on it. An installed package adds one by an entry point of the group ``mckibben.sensors``.
"""

from __future__ import annotations

import abc
import functools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .._jax import Tree, jax, jnp
from ..registry import Registry
from .module import Module, Scalar, field


class Value(NamedTuple):
    """Value of a signal and its rate of change [1/s] (zero while held)."""

    value: Scalar
    rate: Scalar


class Exchange(NamedTuple):
    """What a store of energy exchanges: net power into it, and a measure of all in and out [W]; or energies [J]."""

    net: Scalar
    turnover: Scalar


class Moment(NamedTuple):
    """The continuous state and the inputs at one moment."""

    state: Tree
    inputs: Mapping[str, Value]


class IndependentPart(NamedTuple):
    """An independent part of a system, as a system of its own.

    Attributes:
        system: the part.
        state: continuous state.
        memory: memory.
        signals: the inputs that it needs.
        outputs: names of its outputs in the whole, by their names in the part.
    """

    system: System
    state: Any
    memory: Any
    signals: dict[str, Any]
    outputs: dict[str, str]


class Coupling(abc.ABC):
    """A system cut into cells, many of them of one structure, and a core by which they act on each other."""

    @abc.abstractmethod
    def cells(self, system: Tree, state: Tree, memory: Tree, signals: Mapping[str, Tree]) -> list[IndependentPart]:
        """The cells of a system with its state, memory and signals; numbers are taken, none is computed."""

    @abc.abstractmethod
    def core(self, system: Tree, state: Tree, memory: Tree, signals: Mapping[str, Tree]) -> IndependentPart:
        """The core of a system with its state, memory and signals."""

    @abc.abstractmethod
    def assembled(
        self, core: Tree, groups: tuple[Tree, ...], weights: tuple[Tree, ...], varied: Tree, mapped: bool
    ) -> System:
        """The system again, with its cells in groups of one structure.

        Its state and memory are tables of those of the core, with the cells' in ``groups``: arrays have the cells as last
        axis there, and those of more axes are `UnitRows`. Signals of group g are named ``g.<name>``; so are its outputs.

        Args:
            core: system of the core.
            groups: systems of the cells of each group, in which what differs has the cells as last axis.
            weights: 1 for each cell, 0 for those that only fill the arrays; (n,) for each group.
            varied: by leaf of each group's system, whether it differs.
            mapped: see `for_each_unit`.
        """


class System(Module):
    """A system of ordinary differential equations with inputs and memory.

    The continuous state, its rate, the memory and the integrals are trees of arrays; the engine knows nothing of what they
    mean. The inputs are a table of the values that the signals have at the moment asked for.
    """

    @abc.abstractmethod
    def rate(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Time derivative of the continuous state, a tree like it [unit/s]."""

    @abc.abstractmethod
    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Rates of the balances' independent integrals, such as enthalpy flows [W]; an empty tree where there are none."""

    def stored_energies(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Energies of the stores whose balance is watched, by name [J]; none by default."""
        return {}

    def balances(self, integrands: Tree) -> dict[str, Exchange]:
        """What each of `stored_energies` exchanges, from `integrands` or from integrals of them: linear in these."""
        return {}

    def slackness(self, integrands: Tree) -> tuple[Scalar, ...]:
        """1 for every muscle that is slack and 0 for one that is taut, from `integrands`; or the time that it was [s]."""
        return ()

    @abc.abstractmethod
    def advance_memory(self, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
        """Memory after a change from `start` to `end` in a time [s]; unchanged if there is none."""

    @abc.abstractmethod
    def outputs(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Recorded outputs, by name [SI]."""

    def commands(self, signals: Mapping[str, Tree]) -> dict[str, Tree]:
        """Signals, with delayed ones for parts that have dead time.

        Every run calls this on the signals it is given. What is late already stays as it is.
        """
        return dict(signals)

    def max_rate_bound(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Scalar:
        """Upper bound of the fastest rate that the system can have near a state [1/s].

        Zero where the modes at the samples tell enough. A run may cross a steep zone between two samples, again and again.
        """
        return jnp.zeros(())

    def parts(self, state: Tree, memory: Tree, signals: Mapping[str, Tree]) -> list[IndependentPart]:
        """The parts that can be integrated side by side; empty if each acts on the others, or where they are few."""
        return []

    def coupling(self) -> Coupling | None:
        """How the system is cut into many cells that act on each other by a core; None if it is not, or into few."""
        return None

    def overloaded(self, outputs: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Whether outputs show a part loaded beyond what it bears (bool), elementwise, by its name; none by default."""
        return {}

    def broken(self, outputs: Mapping[str, Scalar]) -> Scalar:
        """Whether any part is `overloaded` (bool), elementwise."""
        return functools.reduce(jnp.logical_or, self.overloaded(outputs).values(), jnp.asarray(False))

    def admissible(self, state: Tree) -> Scalar:
        """Whether a state can be at all, such as a pressure above vacuum (bool)."""
        return jnp.asarray(True)


class Plant(System):
    """A system with converters: software sees its measured channels only, and sets its inputs once per sample."""

    @abc.abstractmethod
    def sense(self, state: Tree, memory: Tree, inputs: Mapping[str, Value], row: Tree) -> dict[str, Scalar]:
        """Measured channels by name [SI].

        Args:
            state: state of the system.
            memory: memory of the system.
            inputs: in force.
            row: what this sample brings from outside, such as draws of the noise.
        """

    @abc.abstractmethod
    def convert(self, commands: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """The inputs that the output converters hold, by signal, for the commands of the software by name [SI]."""

    @abc.abstractmethod
    def commands(self, signals: Mapping[str, Tree]) -> dict[str, Tree]:
        """Signals of the machine, with delayed ones for parts that have dead time."""

    def straight(self) -> tuple[str, ...]:
        """Names of the inputs that go straight to a new command within its sample, such as a span; all others jump to it."""
        return ()


class Software(Module):
    """A pure step on the sample clock: what a controller, a protocol and its interlocks do with measured channels."""

    @abc.abstractmethod
    def initial(self, measured: Mapping[str, Scalar]) -> Tree:
        """State before the first sample, a tree of arrays."""

    @abc.abstractmethod
    def step(
        self, state: Tree, measured: Mapping[str, Scalar], row: Tree, dt: Scalar
    ) -> tuple[Tree, dict[str, Scalar], dict[str, Scalar]]:
        """Compute one sample: the new state, the commands by name [SI], and values to record."""


class UnitRows(Module):
    """An array for each of n units, as a row (n,) for each of its elements, so that units stand side by side in memory."""

    rows: tuple[Scalar, ...]
    # Shape of the array of one unit.
    shape: tuple[int, ...] = field(static=True, kw_only=True)

    @property
    def whole(self) -> Scalar:
        """The array, with further axes of the rows behind its own."""
        together = jnp.stack(self.rows)
        return together.reshape(*self.shape, *together.shape[1:])


def as_rows(tree: Tree) -> Tree:
    """Replace arrays (.., n) of more than one axis by their rows."""

    def rows(leaf: Any) -> Any:
        shape = np.shape(leaf)[:-1]
        if not shape:
            return leaf
        flat = leaf.reshape(-1, leaf.shape[-1])
        return UnitRows(tuple(flat[k] for k in range(flat.shape[0])), shape=shape)

    return jax.tree.map(rows, tree)


def for_each_unit(
    function: Callable[..., tuple[Tree, Tree]], trees: Tree, varied: Sequence[bool], *, mapped: bool
) -> tuple[Tree, Tree]:
    """Evaluate a function for each unit of a group.

    Args:
        function: function of the trees of one unit; returns a tree of what the unit has, and one of numbers to be added up
            over the units.
        trees: arguments, in which what differs from unit to unit has them as last axis (n); `UnitRows` are arrays there.
        varied: by leaf of the trees, whether it differs.
        mapped: evaluate all units at once, as XLA does best, and not one after the other, which native kernels turn into
            vectors of units.

    Returns:
        What the units have, with n as last axis and arrays as `UnitRows`, and the sums.
    """
    leaves, structure = jax.tree.flatten(trees)
    per_unit = [jnp.moveaxis(jnp.asarray(leaf), -1, 0) for leaf, v in zip(leaves, varied, strict=True) if v]

    def is_rows(x: object) -> bool:
        return isinstance(x, UnitRows)

    def one(row: list[Any]) -> tuple[Tree, Tree]:
        rest = iter(row)
        own = jax.tree.unflatten(structure, [next(rest) if v else leaf for leaf, v in zip(leaves, varied, strict=True)])
        arrays = jax.tree.map(lambda x: x.whole if is_rows(x) else x, own, is_leaf=is_rows)
        result, share = function(*arrays)
        apart = jax.tree.map(lambda x: as_rows(jnp.asarray(x)[..., None]), result)
        return jax.tree.map(lambda x: x[0], apart), share

    if mapped:
        results, shares = jax.vmap(one)(per_unit)
        return results, jax.tree.map(lambda x: x.sum(0), shares)

    def added(sums: Any, row: list[Any]) -> tuple[Tree, Tree]:
        result, share = one(row)
        return jax.tree.map(lambda a, b: a + b, sums, share), result

    shapes = jax.eval_shape(one, [x[0] for x in per_unit])[1]
    sums, results = jax.lax.scan(added, jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes), per_unit)
    return results, sums


# What a sensor is put to [its unit], of the instrumented plant, its machine's state, memory and inputs.
TrueValue = Callable[[Any, Any, Any, Any], Scalar]


@dataclass(frozen=True, kw_only=True)
class SensorKind:
    """A kind of sensor: the quantity it measures, and where.

    Attributes:
        unit: SI unit of its channel.
        quantity: kind of value, which decides its colour: ``pressure``, ``tension``, ``length`` or ``valve``.
        label: in figures and in the web interface, such as ``pressure, muscle``.
        symbol: as the field writes it.
        meaning: meaning of its channel in a recording.
        true_value: what it is put to; straight-line, for it is compiled with the machine.
        set_point: name of the set-point that stands beside it; empty if there is none.
    """

    unit: str
    quantity: str
    label: str
    symbol: str
    meaning: str
    true_value: TrueValue
    set_point: str = ""


SENSORS: Registry[SensorKind] = Registry(
    "mckibben.sensors",
    "sensor",
    {
        "pressure": "mckibben.bench.sensors:PRESSURE",
        "valve_pressure": "mckibben.bench.sensors:VALVE_PRESSURE",
        "tension": "mckibben.bench.sensors:TENSION",
    },
)


def sensor_units(names: Iterable[str]) -> dict[str, str]:
    """SI units of the channels, by sensor."""
    return {name: SENSORS[name].unit for name in names}
