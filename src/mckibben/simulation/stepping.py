"""One sample of a simulation as pure functions: a machine that a user's controller commands, step by step.

`step_vectors` is what `Simulation.step` calls as a native kernel: trees are packed in vectors, so that a call takes five
arrays and leaves two. `recorded_vectors` is the same sample with all outputs and the integrals of the balances.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from .._jax import Tree, jnp
from ..answers import Caution, brief
from ..assembly.machine import Machine
from ..components import Environment, Scalar, field
from ..components.system import Exchange, Moment, Plant
from ..engine import sampled
from ..engine.packed import Layout
from ..engine.signals import Signal, Value
from ..engine.soundness import balance_errors, soundness, switched
from ..engine.step import integrands_of, watched_of, zero_integrals
from ..errors import InputError
from ..muscles.plausible import LEAST_PRESSURE, SLIP, highest_usual_pressure, pressure_caution, stretch_caution
from ..pneumatics.circuit import Circuit
from ..pneumatics.solenoid import between
from ..pneumatics.volume import Reservoir
from ..quantities import with_unit
from ..slips import size_caution
from ..specimens import Specimen


@dataclass(frozen=True)
class SimulationState:
    """A simulation at a moment, for `Simulation.load_state`; it can be pickled, and the simulation goes on bit for bit.

    Attributes:
        sample: number of samples since the reset.
        carry: state, memory and past commands, as a vector.
        observed: the true observation with what is `BEHIND` it.
        shown: the observation as it was returned, with noise; empty if there is none.
        commands: in force.
        noise: state of the generator of the noise.
        structure: fingerprint of the simulation that made it.
        lines: what its readouts remember.
    """

    sample: int
    carry: np.ndarray
    observed: np.ndarray
    shown: tuple[float, ...]
    commands: np.ndarray
    noise: Mapping[str, Any]
    structure: str
    lines: tuple[tuple[float, ...], ...] = ()

    __repr__ = brief


class CommandInput(NamedTuple):
    """What a command drives: a signal of the machine, and what it means.

    Attributes:
        command: name by which the user commands it.
        signal: signal of the machine.
        gauge: whether the command is a gauge pressure and the signal an absolute one.
        straight: whether the signal goes straight to the command within the sample, as a span does.
        unit: SI unit.
        meaning: one phrase.
        range: commands that differ in what they do [unit]; beyond, a valve acts as at the end.
        hard: whether a command beyond the range is refused, as a span is that no muscle can have.
        usual: sizes from and to which it is usual [unit]; what lies beyond is said once.
        limits: within which a command is held before it acts [unit]; None for none.
    """

    command: str
    signal: str
    gauge: bool = False
    straight: bool = False
    unit: str = "1"
    meaning: str = ""
    range: tuple[float, float] = (-math.inf, math.inf)
    hard: bool = False
    usual: tuple[float, float] = (0.0, math.inf)
    limits: tuple[float, float] | None = None

    def reach(self, circuit: Circuit, room: Environment) -> float:
        """Highest set-point that the supply of its regulators lets them reach [unit]; infinite of other commands."""
        ambient = float(np.max(room.pressure_abs))
        fed = [circuit.nodes[nodes[0]] for nodes, signal in circuit.ends.values() if signal == self.signal]
        given = [one for one in fed if isinstance(one, Reservoir) and one.signal is None and self.unit == "Pa"]
        return min((float(np.min(one.pressure_abs)) - ambient for one in given), default=math.inf)

    def silent(self, spec: Specimen | None = None, *, reach: float = math.inf) -> tuple[float, float]:
        """Commands from and to which there is nothing to say [unit]; `check` knows the rest.

        Args:
            spec: muscle whose pressure it is.
            reach: see `reach`.
        """
        (low, high), (least, most) = self.range, self.usual
        if self.unit == "Pa":
            least, most = LEAST_PRESSURE, min(highest_usual_pressure(spec), reach + LEAST_PRESSURE)
        return max(low, least or -most), min(high, most)

    def check(self, value: float, spec: Specimen | None = None, *, reach: float = math.inf) -> Caution | None:
        """Caution about a command that acts otherwise than it says, or can hardly be meant; None if it is usual.

        Args:
            value: of the command [unit].
            spec: muscle whose pressure it is.
            reach: see `reach`.

        Raises:
            InputError: it is no finite number, or cannot be carried out.
        """
        low, high = self.range
        if not math.isfinite(value):
            raise InputError(self.command, value, "must be a finite number")
        shown, ends = with_unit(value, self.unit), f"{with_unit(low, self.unit)} to {with_unit(high, self.unit)}"
        ends = ends if math.isfinite(high) else f"{with_unit(low, self.unit)} and more"
        if low <= value <= high:
            if self.unit == "Pa":
                unusual = pressure_caution(value, spec, text=f"{value:g}", name=f"command {self.command}")
                above = f"a command {self.command} of {shown} is above the supply of {with_unit(reach, 'Pa')}"
                said = f"{above}, which is all that comes" if value > reach + LEAST_PRESSURE else ""
                return unusual or (Caution(said, f"command {self.command}") if said else None)
            if self.straight and value > self.usual[1]:  # a span
                return stretch_caution(value, self.usual[1], spec, name=f"command {self.command}")
            return size_caution(value, self.unit, name=f"command {self.command}", usual=self.usual)
        if self.hard:
            raise InputError(self.command, shown, f"must be from {ends}")
        end = with_unit(low if value < low else high, self.unit)
        said = f"a command {self.command} of {shown} is beyond its range, {ends}: it acts as {end}"
        return Caution(said, f"command {self.command}")


class SaidCommands(dict[tuple[str, int], float]):
    """Commands of which something was said: by name and side of their range, the one that was farthest out.

    What is said of 8 bar is not all that is to be said of 8000: a command that is `SLIP` times as far out is a new one.
    """

    def farther(self, name: str, value: float, high: float) -> bool:
        """Whether a command [SI] is farther out than what was said of it; `high` is the upper end of what is usual."""
        side = self._side(value, high)
        before = self.get((name, side))
        if before is None:
            return True
        return abs(value) < abs(before) / SLIP if side == 0 else abs(value) > SLIP * abs(before)

    def keep(self, name: str, value: float, high: float) -> None:
        """Remember that something was said of a command [SI]."""
        self[name, self._side(value, high)] = value

    @staticmethod
    def _side(value: float, high: float) -> int:
        return 1 if value > high else -1 if value < 0.0 else 0  # the last: too small, where the smaller is farther out


class CommandedMachine(Plant):
    """A machine whose signals are set once per sample by commands, and of which an observation shows some outputs."""

    machine: Machine
    drives: tuple[CommandInput, ...] = field(static=True, kw_only=True)
    # Fields of the observation, each with the output of the machine that it shows.
    shown: tuple[tuple[str, str], ...] = field(static=True, kw_only=True)

    def sense(self, state: Tree, memory: Tree, inputs: Mapping[str, Value], row: Tree) -> dict[str, Scalar]:
        """The fields of the observation."""
        outputs = self.machine.outputs(state, memory, inputs)
        return {name: outputs[output] for name, output in self.shown}

    def convert(self, commands: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """The signals that the commands set."""
        ambient = self.machine.environment.pressure_abs
        held = {
            d.command: commands[d.command] if d.limits is None else between(commands[d.command], *d.limits)
            for d in self.drives
        }
        return {d.signal: held[d.command] + (ambient if d.gauge else 0.0) for d in self.drives}

    def straight(self) -> tuple[str, ...]:
        """The signals of spans."""
        return tuple(d.signal for d in self.drives if d.straight)

    def commands(self, signals: Mapping[str, Tree]) -> dict[str, Tree]:
        """As the machine has it."""
        return self.machine.commands(signals)

    def rate(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Of the machine."""
        return self.machine.rate(state, memory, inputs)

    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Of the machine."""
        return self.machine.integrands(state, memory, inputs)

    def stored_energies(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Of the machine [J]."""
        return self.machine.stored_energies(state, memory, inputs)

    def balances(self, integrands: Tree) -> dict[str, Exchange]:
        """Of the machine."""
        return self.machine.balances(integrands)

    def slackness(self, integrands: Tree) -> tuple[Scalar, ...]:
        """Of the machine."""
        return self.machine.slackness(integrands)

    def advance_memory(self, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
        """Of the machine."""
        return self.machine.advance_memory(memory, start, end, duration)

    def outputs(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Of the machine."""
        return self.machine.outputs(state, memory, inputs)

    def max_rate_bound(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Scalar:
        """Of the machine [1/s]."""
        return self.machine.max_rate_bound(state, memory, inputs)

    def overloaded(self, outputs: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Of the machine."""
        return self.machine.overloaded(outputs)

    def admissible(self, state: Tree) -> Scalar:
        """Whether every volume holds gas above vacuum."""
        return self.machine.admissible(state)


class Layouts(NamedTuple):
    """Layouts of a commanded machine and of what goes from sample to sample, and the names of the commands."""

    plant: Layout
    carry: Layout
    commands: tuple[str, ...]


def rest_carry(
    plant: CommandedMachine, pressures: Mapping[str, float], commands: Mapping[str, float], depth: int
) -> tuple[Tree, Tree, dict[str, np.ndarray]]:
    """State, memory and past commands of a machine at rest.

    Args:
        plant: the machine.
        pressures: absolute pressure of every chamber [Pa].
        commands: as they have lasted [SI].
        depth: samples of them that are remembered.
    """
    lasting = {name: np.full((depth,), float(value)) for name, value in plant.convert(commands).items()}
    late = plant.commands({name: Signal(values) for name, values in lasting.items()})
    inputs = {name: Value(np.asarray(signal.values[-1]), np.zeros(())) for name, signal in late.items()}
    state, memory = plant.machine.initial(pressures, inputs)
    return state, memory, lasting


class StepResult(NamedTuple):
    """The end of a sample.

    Attributes:
        carry: state, memory and past commands.
        observation: by field.
        imbalance: largest relative error of a balance that is watched; 0 with all integrals, when none is.
        rate_bound: bound of the fastest mode [1/s].
        sound: code of the sample, see `engine.soundness`.
        integrals: all integrals over the sample, or of what is watched.
        inputs: in force at the end.
    """

    carry: Any
    observation: dict[str, Scalar]
    imbalance: Scalar
    rate_bound: Scalar
    sound: Scalar
    integrals: Any
    inputs: dict[str, Any]


def advance_sample(
    plant: CommandedMachine,
    carry: Tree,
    commands: Mapping[str, Scalar],
    period: Scalar,
    inner: Scalar,
    *,
    stiff: bool,
    integrals: bool = False,
) -> StepResult:
    """Hold new commands for one sample and integrate the physics to its end.

    Args:
        plant: the machine.
        carry: state, memory and past commands from the sample before.
        commands: by name [SI].
        period: period of the sample [s].
        inner: whole steps of the physics.
        stiff: use the Rosenbrock method.
        integrals: whether all integrals of the accounts are wanted; without them, balances are watched.
    """
    state, memory, history = carry
    before = sampled.Carry(state, memory, (), (), history)
    now = sampled.inputs_of(plant, before, None, period)
    of = integrands_of if integrals else watched_of
    before = before._replace(integrals=zero_integrals(plant, state, memory, now, of))
    after, _ = sampled.act(
        plant, before, commands, period=period, inner=inner, latency=None, stiff=stiff, integrands=of
    )
    inputs = sampled.inputs_of(plant, after, None, period)
    errors, slack = None, ()
    if not integrals:
        exchanges, slack = after.integrals
        # an input that jumps at the start of the sample, such as a span's rate, moves nothing that is stored
        stored = plant.stored_energies(state, memory, now)
        left = plant.stored_energies(after.state, after.memory, inputs)
        errors = balance_errors(stored, left, exchanges, period)
    return StepResult(
        (after.state, after.memory, after.history),
        *_seen(plant, after.state, after.memory, inputs, errors, switched(slack, period)),
        after.integrals,
        inputs,
    )


def _seen(
    plant: CommandedMachine,
    state: Tree,
    memory: Tree,
    inputs: Mapping[str, Value],
    errors: Mapping[str, Scalar] | None = None,
    changed: Scalar = False,
) -> tuple[dict[str, Scalar], Scalar, Scalar, Scalar]:
    bound = plant.max_rate_bound(state, memory, inputs)
    imbalance, code = soundness(plant, state, memory, plant.outputs(state, memory, inputs), errors, changed)
    return plant.sense(state, memory, inputs, {}), imbalance, bound, code


BEHIND = (
    3  # numbers of a vector behind the observation: error of a balance, bound of the fastest mode, code of the sample
)


def unnamed_command(values: Sequence[object], commands: Sequence[str]) -> InputError:
    """The error for commands of `step` that are given without their names, with the call that names them."""
    shown = [*map(repr, values), *["..."] * len(commands)]
    call = ", ".join(f"{name}={value}" for name, value in zip(commands, shown, strict=False))
    return InputError("step", None, f"takes its commands by name, as in step({call})")


def step_vectors(
    layouts: Layouts, stiff: bool, plant: Tree, carry: Tree, commands: Tree, period: Scalar, inner: Scalar
) -> tuple[Tree, Tree]:
    """One sample of vectors: (parameters, carry, commands) to (carry, observation with what is `BEHIND` it)."""
    machine = layouts.plant.unpack(plant)
    named = {name: commands[i] for i, name in enumerate(layouts.commands)}
    end = advance_sample(machine, layouts.carry.unpack(carry), named, period, inner, stiff=stiff)
    seen = _observed(machine, end.observation, end.imbalance, end.rate_bound, end.sound)
    return layouts.carry.packed(end.carry), seen


def _observed(plant: CommandedMachine, observation: Mapping[str, Scalar], *behind: Any) -> Any:
    numbers = [observation[name] for name, _ in plant.shown]
    return jnp.stack([jnp.asarray(x, float) for x in (*numbers, *behind)])


def observe_vectors(layouts: Layouts, plant: Tree, carry: Tree) -> Tree:
    """The observation in a carry, with what is `BEHIND` it."""
    machine, (state, memory, history) = layouts.plant.unpack(plant), layouts.carry.unpack(carry)
    inputs = sampled.inputs_of(machine, sampled.Carry(state, memory, (), (), history), None, 1.0)
    return _observed(machine, *_seen(machine, state, memory, inputs))


def recorded_vectors(
    layouts: Layouts, stiff: bool, plant: Tree, carry: Tree, commands: Tree, period: Scalar, inner: Scalar
) -> tuple[Tree, dict[str, Scalar], dict[str, Scalar]]:
    """One sample for a recording: the carry, the integrals of the balances, and all outputs at its end."""
    machine = layouts.plant.unpack(plant)
    named = {name: commands[i] for i, name in enumerate(layouts.commands)}
    end = advance_sample(machine, layouts.carry.unpack(carry), named, period, inner, stiff=stiff, integrals=True)
    state, memory, _ = end.carry
    return layouts.carry.packed(end.carry), end.integrals, machine.outputs(state, memory, end.inputs)


def outputs_at(layouts: Layouts, plant: Tree, carry: Tree) -> dict[str, Tree]:
    """All outputs in a carry."""
    machine, (state, memory, history) = layouts.plant.unpack(plant), layouts.carry.unpack(carry)
    inputs = sampled.inputs_of(machine, sampled.Carry(state, memory, (), (), history), None, 1.0)
    at: dict[str, Tree] = machine.outputs(state, memory, inputs)
    return at
