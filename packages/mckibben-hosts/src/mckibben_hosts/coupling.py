"""Muscles with their air as a part of another program: spans in, mean tensions out.

The border is the end of the muscle, or of its tendon where it has one. Whether it is taut or slack is its own state, so
that nothing algebraic crosses, and the part has substeps of its own. In one call for a step h of the host, it

1. ramps each span from where the last ramp ended to ``span + ahead * rate``, ``ahead`` being h, or h/2 where the host's
   rates are half a step older than its positions, as those of a semi-implicit Euler method are (a staggered host);
2. takes its own steps;
3. returns the mean tension over the step, with which the host is to step its mechanism, and whether it is sound: where an
   energy balance does not close, it takes its own steps again, shorter ones, before it says so.

The ramp is continuous, so that braid and cord are never shocked, and on a straight ramp mean tension times displacement is
the work exactly. The coupling is of second order in h, through slack and snap too.

A command acts at once and holds; in a staggered host, whose step begins and ends half a step earlier, it is the mean of old
and new, and the first step lasts h/2. Commands of parts with dead time are kept on the way until they arrive, whatever the
steps of the host: see `CommandLine`.

All of it is a pure function of (part, state, inputs, timing), which is lowered to C, and run here by native kernels.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from mckibben._jax import Array, Tree, jax, jnp
from mckibben.assembly.loads import HostLoad
from mckibben.assembly.machine import Machine
from mckibben.assembly.muscle_unit import MuscleUnit
from mckibben.components import Environment, Module, Scalar, field
from mckibben.components.system import Exchange, Moment
from mckibben.engine.rates import RK4_LIMIT
from mckibben.engine.signals import Signal, Value
from mckibben.engine.soundness import PLACING, Soundness, balance_errors, soundness, switched
from mckibben.engine.step import advance_memory_of, outputs_of, step, watched_of, zero_integrals
from mckibben.muscles.plausible import span_limits
from mckibben.pneumatics.circuit import Circuit
from mckibben.quantities import as_array, quantity
from mckibben.simulation.stepping import CommandInput

LINE = 32  # changes of a command that are on their way at once; more frequent ones are merged in pairs
MOST_STEPS = 1_000_000  # of the physics in a step of the host
RAN_AWAY = (
    0.3  # error of a balance over a step of Euler's method, by the powers at its ends, from which on it runs away
)
EULER = 1e-12  # rounding of a step of Euler's method, of the state [1]
REPEATS = 4  # times that a step is taken at most, each in four times as many steps, until its balances close
ACCOUNTS = ("enthalpy", "heat", "lost")  # integrals of the machine that are kept beside the work of each muscle [J]
OF_MUSCLES = {
    "tension_end": "load_tension",
    "pressure": "pressure",
    "length": "length",
    "velocity": "velocity",
    "volume": "volume",
    "temperature": "temperature",
    "friction": "friction",
    "slack": "slack",
}
"""Outputs of a muscle at the end of a step, by name, with the machine's name."""


class CommandLine(Module):
    """Changes of a command on their way to a part with dead time.

    The command in force now, and for each change its size and the time until it arrives. Steps see the mean over themselves,
    as they do of delayed signals in the engine (`Signal.within`), which keeps the second order. Slots without a change have
    the size zero. A change that follows the last one sooner than a `LINE`-th of the dead time is merged with it at their
    common centre, so that the line cannot run over.
    """

    now: Scalar
    sizes: Array = field(converter=as_array)
    due: Array = field(converter=as_array)

    @classmethod
    def resting(cls, value: Scalar) -> CommandLine:
        """A line on which nothing is on its way."""
        return cls(value + jnp.zeros(()), jnp.zeros(LINE), jnp.zeros(LINE))

    @property
    def newest(self) -> Scalar:
        """The command that was given last."""
        return self.now + self.sizes.sum()

    def given(self, value: Scalar, delay: Scalar) -> CommandLine:
        """The line after a command at this moment.

        Args:
            value: the command.
            delay: dead time [s].
        """
        change = value - self.newest
        filled = self.sizes != 0.0
        last = jnp.argmax(jnp.where(filled, self.due, -1.0))
        close = filled.any() & (delay - self.due[last] < delay / (LINE - 1))
        both = self.sizes[last] + change
        # the centre of two changes; of two that cancel, the earlier
        share = jnp.where(both == 0.0, 0.0, jnp.clip(change / jnp.where(both == 0.0, 1.0, both), 0.0, 1.0))
        place = jnp.where(close, last, jnp.argmin(filled))
        here = jnp.arange(LINE) == place
        size = jnp.where(close, both, change)
        due = jnp.where(close, self.due[last] + share * (delay - self.due[last]), delay)
        return CommandLine(self.now, jnp.where(here, size, self.sizes), jnp.where(here, due, self.due))

    def after(self, duration: Scalar) -> CommandLine:
        """The line a time later [s]."""
        arrived = self.due <= duration
        return CommandLine(
            self.now + jnp.where(arrived, self.sizes, 0.0).sum(),
            jnp.where(arrived, 0.0, self.sizes),
            jnp.where(arrived, 0.0, self.due - duration),
        )

    def at(self, index: Scalar, share: Scalar, period: Scalar) -> Value:
        """The command at a share of a step."""
        arrived = self.due <= share * period
        return Value(self.now + jnp.where(arrived, self.sizes, 0.0).sum(), jnp.zeros(()))

    def within(self, index: Scalar, begin: Scalar, end: Scalar, share: Scalar, period: Scalar) -> Value:
        """The mean command from `begin` to `end`, shares of the step."""
        present = jnp.clip((end * period - self.due) / ((end - begin) * period), 0.0, 1.0)
        return Value(self.now + (self.sizes * present).sum(), jnp.zeros(()))


class HostedMuscles(Module):
    """Muscles with their air, whose mechanism is another program's; the parameters of a part.

    Args:
        circuit: the air.
        muscles: by name, each with a node of the circuit.
        environment: the surroundings.
        start: gauge pressure of every chamber at the start [Pa].
        drives: commands, and the signals that they set.
        late: elements with dead time, each with the signal of its command.
    """

    circuit: Circuit
    muscles: dict[str, MuscleUnit]
    environment: Environment
    start: dict[str, Scalar]
    substep: Scalar = quantity("s", (1e-7, 1e-2), "largest step of the physics", default=5e-5)
    drives: tuple[CommandInput, ...] = field(static=True, kw_only=True)
    late: tuple[tuple[str, str], ...] = field(static=True, kw_only=True, default=())

    @classmethod
    def of(
        cls, machine: Machine, *, drives: tuple[CommandInput, ...], start: Mapping[str, float], substep: float
    ) -> HostedMuscles:
        """The part of a machine whose load is a `HostLoad`.

        Args:
            machine: the state equation.
            drives: commands, and the signals that they set.
            start: gauge pressure of every chamber at the start [Pa].
            substep: largest step of the physics [s].
        """
        late = []
        for name, element in machine.circuit.elements.items():
            signal, delay = machine.circuit.ends[name][1], element.delay()
            if signal is not None and delay is not None and float(np.asarray(delay)) > 0.0:
                late.append((name, signal))
        return cls(
            machine.circuit,
            machine.units,
            machine.environment,
            {name: float(value) for name, value in start.items()},
            substep=substep,
            drives=drives,
            late=tuple(late),
        )

    @property
    def machine(self) -> Machine:
        """The state equation."""
        return Machine(self.circuit, self.muscles, HostLoad(held=tuple(self.muscles)), self.environment)

    @property
    def commands(self) -> tuple[str, ...]:
        """Names of the commands."""
        return tuple(dict.fromkeys(drive.command for drive in self.drives))


class HostStep(NamedTuple):
    """A step of the host: its length [s], and 1 where its rates are half a step older than its positions, else 0."""

    period: Scalar
    staggered: Scalar


class HostInputs(NamedTuple):
    """What the host gives: span [m] and its rate [m/s] of each muscle, and the commands."""

    span: Mapping[str, Scalar]
    rate: Mapping[str, Scalar]
    command: Mapping[str, Scalar]


class IntegratorStep(NamedTuple):
    """A step that the host itself has integrated: where it began, and its length.

    Attributes:
        physics: state of the machine at its start.
        inputs: at its start.
        duration: its length [s].
    """

    physics: Any
    inputs: HostInputs
    duration: Scalar


class PartState(NamedTuple):
    """All that changes; numbers only, so that a host may keep it as an array, copy it and bring it back.

    Attributes:
        started: 0 where nothing was set yet: the part then rests at the present span; 1 at rest, 2 after the first step.
        physics: state of the machine.
        memory: memory of the machine.
        reach: span at which the last ramp ended, by muscle [m].
        command: given last, by name.
        lines: commands on their way, by element with dead time.
        work: of the host on each muscle since the start [J].
        accounts: of the machine since the start, see `ACCOUNTS` [J].
    """

    started: Scalar
    physics: Any
    memory: Any
    reach: Mapping[str, Scalar]
    command: Mapping[str, Scalar]
    lines: Mapping[str, CommandLine]
    work: Mapping[str, Scalar]
    accounts: Mapping[str, Scalar]


class PartOutputs(NamedTuple):
    """What the host gets.

    Attributes:
        tension: mean over the step, by muscle [N]: what the mechanism is to be stepped with.
        muscle: at the end of the step, by muscle, see `OF_MUSCLES` [SI].
        work: of the host on each muscle since the start [J].
        rate_bound: bound of the fastest mode [1/s].
        sound: code of the step, see `engine.soundness`: 1 where the state is finite and possible, every span one that its
            muscle can take, and the balances close.
    """

    tension: Mapping[str, Scalar]
    muscle: Mapping[str, Mapping[str, Scalar]]
    work: Mapping[str, Scalar]
    rate_bound: Scalar
    sound: Scalar


def rest(part: HostedMuscles, inputs: HostInputs) -> PartState:
    """State at rest at the spans and commands of a moment: every braid is in balance, friction is relaxed."""
    machine = part.machine
    room = machine.environment.pressure_abs
    pressures = {name: gauge + room for name, gauge in part.start.items()}
    lines = {element: CommandLine.resting(_driven(part, inputs.command)[signal]) for element, signal in part.late}
    still = HostInputs(inputs.span, dict.fromkeys(inputs.rate, jnp.zeros(())), inputs.command)
    physics, memory = machine.at_rest(pressures, _moment(part, still, lines))

    given = (physics, memory, dict(inputs.span), dict(inputs.command))
    physics, memory, reach, command = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), given)
    work, accounts = (dict.fromkeys(names, jnp.zeros(())) for names in (part.muscles, ACCOUNTS))
    return PartState(jnp.ones(()), physics, memory, reach, command, lines, work, accounts)


def advance(
    part: HostedMuscles, state: PartState, inputs: HostInputs, timing: HostStep
) -> tuple[PartState, PartOutputs]:
    """One step of the host; the state must have been set by `rest` or a step before."""
    machine = part.machine
    staggered = timing.staggered > 0.5
    first = state.started < 1.5
    duration = jnp.where(staggered & first, 0.5 * timing.period, timing.period)
    ahead = jnp.where(staggered, 0.5 * timing.period, timing.period)
    reach = {name: span + ahead * inputs.rate[name] for name, span in inputs.span.items()}
    command = {
        name: jnp.where(staggered & ~first, 0.5 * (value + state.command[name]), value)
        for name, value in inputs.command.items()
    }
    driven = _driven(part, command)
    straight = {d.signal for d in part.drives if d.straight}
    before = _driven(part, state.command)
    signals: dict[str, Any] = {}
    for name, value in driven.items():
        begin = before[name] if name in straight else value
        signals[name] = Signal(jnp.stack([begin, value]), straight=name in straight)
    for name, end in reach.items():
        signals[f"{name}.span"] = Signal(jnp.stack([state.reach[name], end]), straight=True)
    lines = {}
    for element, signal in part.late:
        delay = machine.circuit.elements[element].delay()
        assert delay is not None  # of an element with a line
        lines[element] = state.lines[element].given(driven[signal], delay)
    signals |= {f"{element}.command": lines[element] for element, _ in part.late} | _undelayed(part, signals)

    bound = machine.max_rate_bound(state.physics, state.memory, _at(signals, 0.0, duration))
    count = jnp.ceil(jnp.maximum(duration / part.substep, duration * bound / RK4_LIMIT) - 1e-9)
    at_start = _at(signals, 0.0, duration)
    start = state.physics, state.memory, zero_integrals(machine, state.physics, state.memory, at_start)
    stored = machine.stored_energies(state.physics, state.memory, at_start)

    def attempt(_: Any, carry: Any) -> Any:
        ended, code, steps = carry
        again = code != Soundness.SOUND
        inner = jnp.where(again, jnp.clip(steps, 1.0, MOST_STEPS), 0.0).astype(int)

        def one(i: Any, physics: Any) -> Any:
            begin, end = i / inner, (i + 1) / inner

            def now(share: Any) -> dict[str, Value]:
                return {name: s.within(0, begin, end, share, duration) for name, s in signals.items()}

            return step(machine, physics, now, duration / inner, False)

        new = jax.lax.fori_loop(0, inner, one, start)
        ended = jax.tree.map(lambda a, b: jnp.where(again, a, b), new, ended)
        left = machine.stored_energies(ended[0], ended[1], _at(signals, 1.0, duration))
        errors = balance_errors(stored, left, machine.balances(ended[2]), duration)
        changed = switched(machine.slackness(ended[2]), duration) & (steps < PLACING * count)
        at_end = _at(signals, 1.0, duration)
        seen = outputs_of(machine, ended[0], ended[1], at_end)
        return ended, soundness(machine, ended[0], ended[1], seen, errors, changed)[1], 4.0 * steps

    unknown = jnp.full((), float(Soundness.IMPOSSIBLE))
    (physics, memory, sums), code, _ = jax.lax.fori_loop(0, REPEATS, attempt, (start, unknown, count))
    code = jnp.where(code == Soundness.SWITCHED, float(Soundness.SOUND), code)
    work = {name: state.work[name] + sums[f"load.{name}.work"] for name in part.muscles}
    new = PartState(
        jnp.full((), 2.0),
        physics,
        memory,
        reach,
        {name: value + jnp.zeros(()) for name, value in inputs.command.items()},
        {element: line.after(duration) for element, line in lines.items()},
        work,
        {name: state.accounts[name] + sums[name] for name in ACCOUNTS},
    )
    tension = {name: sums[f"load.{name}.impulse"] / duration for name in part.muscles}
    return new, _outputs(part, new, _at(signals, 1.0, duration), tension)._replace(sound=code)


def observe(part: HostedMuscles, state: PartState, inputs: HostInputs) -> PartOutputs:
    """Outputs at a moment, without going on; the mean tension is the present one."""
    return _outputs(part, state, _moment(part, inputs, state.lines), None)


def rates(part: HostedMuscles, state: PartState, inputs: HostInputs) -> Tree:
    """Rates of the machine's state, for a host that integrates itself."""
    return part.machine.rate(state.physics, state.memory, _moment(part, inputs, state.lines))


def complete(
    part: HostedMuscles, state: PartState, inputs: HostInputs, before: IntegratorStep
) -> tuple[PartState, PartOutputs]:
    """State and outputs after a step of a host that integrates itself: memory goes along the step, and work is counted.

    Where the state went straight along its rate, the integrator is Euler's. With too long a step that one jumps to and fro
    about the motion, and leaves as much of its balances open as it exchanges, by the trapezoidal rule. Of other integrators
    the path between the ends is not known, and nothing is said of their balances.

    Args:
        part: the part; none of its elements has dead time.
        state: with the physics at the end of the step, the rest as at its start.
        inputs: at the end of the step.
        before: the start of the step, and its length.
    """
    machine = part.machine
    start = Moment(before.physics, _moment(part, before.inputs, state.lines))
    end = Moment(state.physics, _moment(part, inputs, state.lines))
    memory = advance_memory_of(machine, state.memory, start, end, before.duration)
    pulls = [
        outputs_of(machine, moment.state, kept, moment.inputs)
        for moment, kept in ((start, state.memory), (end, memory))
    ]
    mean = {name: 0.5 * sum(pull[f"{name}.load_tension"] for pull in pulls) for name in part.muscles}
    moved = {name: span - before.inputs.span[name] for name, span in inputs.span.items()}
    after = state._replace(
        started=jnp.full((), 2.0),
        memory=memory,
        reach=dict(inputs.span),
        command=dict(inputs.command),
        work={name: state.work[name] + mean[name] * moved[name] for name in part.muscles},
    )
    ends = (start.state, state.memory, start.inputs), (end.state, memory, end.inputs)
    stored, left = (machine.stored_energies(*at) for at in ends)
    (first, _), (last, _) = (watched_of(machine, *at) for at in ends)
    exchanges = {
        name: Exchange(*(0.5 * before.duration * (a + b) for a, b in zip(first[name], last[name], strict=True)))
        for name in first
    }
    rates_at_start = machine.rate(start.state, state.memory, start.inputs)
    by_euler = jnp.stack(
        [
            jnp.abs(new - old - before.duration * rate) <= EULER * (jnp.abs(old) + jnp.abs(new))
            for old, new, rate in zip(*map(jax.tree.leaves, (start.state, end.state, rates_at_start)), strict=True)
        ]
    ).all()
    errors = {
        name: jnp.where(by_euler, error, 0.0)
        for name, error in balance_errors(stored, left, exchanges, before.duration).items()
    }
    seen = outputs_of(machine, state.physics, memory, end.inputs)
    code = soundness(machine, state.physics, memory, seen, errors, limit=RAN_AWAY)[1]
    return after, _outputs(part, after, end.inputs, None)._replace(sound=code)


def _driven(part: HostedMuscles, command: Mapping[str, Any]) -> dict[str, Any]:
    room = part.environment.pressure_abs
    return {d.signal: command[d.command] + (room if d.gauge else 0.0) for d in part.drives}


def _undelayed(part: HostedMuscles, signals: Mapping[str, Any]) -> dict[str, Any]:
    """The commands of elements that could have dead time and have none."""
    circuit = part.circuit
    late = {element for element, _ in part.late}
    ends = {n: circuit.ends[n][1] for n, e in circuit.elements.items() if n not in late and e.delay() is not None}
    return {f"{name}.command": signals[signal] for name, signal in ends.items() if signal is not None}


def _moment(part: HostedMuscles, inputs: HostInputs, lines: Mapping[str, CommandLine]) -> dict[str, Value]:
    zero = jnp.zeros(())
    values = {name: Value(value + zero, zero) for name, value in _driven(part, inputs.command).items()}
    values |= {f"{n}.span": Value(span + zero, inputs.rate[n] + zero) for n, span in inputs.span.items()}
    values |= {f"{element}.command": line.at(0, 0.0, 1.0) for element, line in lines.items()}
    return values | _undelayed(part, values)


def _at(signals: Mapping[str, Any], share: float, period: Any) -> dict[str, Value]:
    return {name: signal.at(0, share, period) for name, signal in signals.items()}


def _outputs(part: HostedMuscles, state: PartState, values: Any, tension: Mapping[str, Scalar] | None) -> PartOutputs:
    machine = part.machine
    out = outputs_of(machine, state.physics, state.memory, values)
    muscle = {name: {k: out[f"{name}.{v}"] for k, v in OF_MUSCLES.items()} for name in part.muscles}
    bound = machine.max_rate_bound(state.physics, state.memory, values) + jnp.zeros(())
    inside = []  # whether every muscle can have its span
    for name, span in state.reach.items():
        low, high, _ = span_limits(part.muscles[name].law)
        inside.append((span >= low) & (span <= high))
    possible = jnp.stack(inside).all()
    return PartOutputs(
        tension or {name: values_of["tension_end"] for name, values_of in muscle.items()},
        muscle,
        state.work,
        bound,
        jnp.where(possible, soundness(machine, state.physics, state.memory, out)[1], 0.0),
    )
