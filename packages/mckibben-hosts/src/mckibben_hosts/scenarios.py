"""Scenarios by which hosts are compared: a mechanism, a part in it, commands, forces, and the same system integrated as one.

Commands and forces change on a grid of 10 ms, which every step of a host divides, so that all hosts see the same ones. The
reference is the system of part and mechanism as one state equation, integrated by the engine with steps of 25 us.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mckibben.assembly.loads import Body, HostLoad, JointLoad, MomentArm
from mckibben.assembly.machine import Machine
from mckibben.engine import held, integrate, ramped
from mckibben.engine.signals import Value
from mckibben.errors import InputError
from mckibben.simulation.air import Air

from .part import Part

GRID = 1e-2  # on which commands, forces and corners of paths lie [s]
STEPS = (5e-4, 1e-3, 2e-3, 5e-3)  # of hosts [s]
FINE = 1e-4  # period of the samples of a reference [s]
REFERENCE_STEP = 2.5e-5  # of the physics of a reference [s]
SUPPLY = 6e5  # [Pa]
START = 0.14  # span of the muscle [m]
MASS, GRAVITY = 4.0, 9.80665  # [kg], [m/s^2]
ARM, INERTIA, HINGE_SPAN = 0.02, 4e-3, 0.135  # of the hinge [m], [kg m^2], [m]
LEAKAGE = 0.02  # of the leaking valve, over its full conductance
LEAKING = "circuit.elements.muscle.valve.leakage"


@dataclass(frozen=True)
class HostMechanism:
    """A mechanism of one degree of freedom, with a muscle or two.

        inertia d2q/dt2 = load + force + sum arm_i tension_i,   span_i = span0_i - arm_i q

    Attributes:
        inertia: mass [kg], or moment of inertia [kg m^2].
        arms: by muscle; -1 where the position is the span, a moment arm [m] at a hinge.
        spans: of each muscle at position zero [m].
        load: constant force [N] or moment [N m] to larger positions.
        start: position at the start [m] or [rad].
        rotary: whether it is a hinge.
        path: positions on the grid where they are given, straight between; None where the mechanism moves by itself.
    """

    inertia: float
    arms: Mapping[str, float]
    spans: Mapping[str, float]
    load: float = 0.0
    start: float = 0.0
    rotary: bool = False
    path: tuple[float, ...] | None = None

    def span(self, position: float) -> dict[str, float]:
        """Span of each muscle [m]."""
        return {name: self.spans[name] - arm * position for name, arm in self.arms.items()}

    def span_rate(self, rate: float) -> dict[str, float]:
        """Rate of each span [m/s]."""
        return {name: -arm * rate for name, arm in self.arms.items()}

    def acceleration(self, tensions: Mapping[str, float], force: float) -> float:
        """Acceleration [m/s^2] or [rad/s^2] under tensions [N] and an outside force [N] or moment [N m]."""
        pull = sum(arm * tensions[name] for name, arm in self.arms.items())
        return (self.load + force + pull) / self.inertia


class HostMoment(NamedTuple):
    """What a mechanism in a host gets for one step.

    Attributes:
        commands: by name [SI].
        force: mean over the step's impulse, from outside [N] or [N m].
        position: where the path has it at the step's start; None where the mechanism moves by itself.
        rate: of the path; in a staggered host half a step older.
    """

    commands: dict[str, float]
    force: float
    position: float | None
    rate: float | None


class HostReference(NamedTuple):
    """The system integrated as one, at every `FINE`.

    Attributes:
        time: [s].
        positions: [m] or [rad].
        rates: [m/s] or [rad/s].
        tensions: at the host's end of each muscle [N].
        pressures: gauge, of each muscle [Pa].
        turnover: work that went to and fro at the ends of the muscles [J].
    """

    time: np.ndarray
    positions: np.ndarray
    rates: np.ndarray
    tensions: dict[str, np.ndarray]
    pressures: dict[str, np.ndarray]
    turnover: float

    def mean_tensions(self, muscle: str, begins: np.ndarray, ends: np.ndarray) -> np.ndarray:
        """Mean tensions over intervals [N]; begins and ends [s]."""
        values = self.tensions[muscle]
        whole = np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(self.time))])
        begins = np.maximum(begins, 0.0)
        gained = np.interp(ends, self.time, whole) - np.interp(begins, self.time, whole)
        return np.asarray(gained / (ends - begins))


@dataclass(frozen=True)
class Scenario:
    """A mechanism with a part, and what happens to it.

    Attributes:
        name: short name.
        title: one phrase.
        part: the part.
        mechanism: what the host moves.
        commands: by name, one value per interval of the grid.
        forces: from outside, one mean per interval of the grid; none if empty.
        parameters: of the part that differ, by dotted path.
        closed: whether no gas comes into the part or leaves it.
    """

    name: str
    title: str
    part: Part
    mechanism: HostMechanism
    commands: Mapping[str, tuple[float, ...]]
    forces: tuple[float, ...] = ()
    parameters: Mapping[str, float] = field(default_factory=dict)
    closed: bool = False

    @property
    def duration(self) -> float:
        """Duration [s]."""
        return GRID * len(next(iter(self.commands.values())))

    def count(self, period: float) -> int:
        """Number of steps of a host; their period [s]."""
        return round(self.duration / period)

    def first_commands(self) -> dict[str, float]:
        """The commands that lasted before the start."""
        return {name: values[0] for name, values in self.commands.items()}

    def moments(self, period: float, *, staggered: bool) -> list[HostMoment]:
        """What each step of a host gets.

        Args:
            period: of the host's steps [s].
            staggered: whether its rates are half a step older than its positions.
        """
        count = self.count(period)
        at = np.arange(count) * period
        places = np.minimum((at / GRID + 1e-9).astype(int), len(next(iter(self.commands.values()))) - 1)
        forces = np.zeros(count)
        if self.forces:  # means over the steps, from the impulse that had been given before each moment
            grid = GRID * np.arange(len(self.forces) + 1)
            impulse = np.concatenate([[0.0], np.cumsum(self.forces)]) * GRID
            begin = at - 0.5 * period if staggered else at
            forces = (np.interp(begin + period, grid, impulse) - np.interp(begin, grid, impulse)) / period
        grid = GRID * np.arange(len(self.mechanism.path or ()))
        behind, before = (period, 0.0) if staggered else (0.0, period)
        moments = []
        for k in range(count):
            position = rate = None
            if self.mechanism.path is not None:
                ends = np.interp([at[k], at[k] - behind, at[k] + before], grid, self.mechanism.path)
                position, rate = float(ends[0]), float(ends[2] - ends[1]) / period
            commands = {name: values[places[k]] for name, values in self.commands.items()}
            moments.append(HostMoment(commands, float(forces[k]), position, rate))
        return moments

    def machine(self) -> Machine:
        """Part and mechanism as one state equation."""
        hosted, mechanism = self.part.with_parameters(self.parameters).hosted, self.mechanism
        load: Any
        held = tuple(self.part.muscles)
        if mechanism.path is not None:
            load = HostLoad(held=held)
        elif mechanism.rotary:
            arms = {
                n: MomentArm(coefficients=np.array([a]), span=mechanism.spans[n]) for n, a in mechanism.arms.items()
            }
            load = JointLoad(arms=arms, inertia=mechanism.inertia, signal="force")
        else:
            mass, weight = mechanism.inertia, mechanism.load
            load = Body(held=held, start=mechanism.start, mass=mass, weight=weight, signal="force")
        return Machine.of(hosted.circuit, hosted.muscles, load, hosted.environment)

    def reference(self) -> HostReference:
        """The system integrated as one.

        Raises:
            ConvergenceError: it cannot be integrated.
        """
        machine, hosted = self.machine(), self.part.with_parameters(self.parameters).hosted
        per = round(GRID / FINE)
        signals: dict[str, Any] = {}
        for drive in hosted.drives:
            values = np.repeat(self.commands[drive.command], per)
            signals[drive.signal] = held(np.append(values, values[-1]))
        samples = len(next(iter(signals.values())).values)
        time = FINE * np.arange(samples)
        if self.mechanism.path is not None:
            grid = GRID * np.arange(len(self.mechanism.path))
            positions = np.interp(time, grid, self.mechanism.path)
            for name in self.part.muscles:
                spans = [self.mechanism.span(x)[name] for x in self.mechanism.path]
                signals[f"{name}.span"] = ramped(np.interp(time, grid, spans))
        else:
            forces = np.repeat(self.forces, per) if self.forces else np.zeros(samples - 1)
            signals["force"] = held(np.append(forces, forces[-1]))
        room = float(hosted.environment.pressure_abs)
        first = {n: Value(np.asarray(s.values[0]), np.zeros(())) for n, s in signals.items()}
        state, memory = machine.initial({n: float(gauge) + room for n, gauge in hosted.start.items()}, first)
        out = integrate(machine, state, signals, period=FINE, memory=memory, step_size=REFERENCE_STEP).outputs
        if self.mechanism.path is None:
            positions = np.asarray(out["load.angle" if self.mechanism.rotary else "load.position"])
        tensions = {n: np.asarray(out[f"{n}.load_tension"]) for n in self.part.muscles}
        turnover = 0.0
        for name, pulls in tensions.items():
            moved = np.diff(-self.mechanism.arms[name] * positions)
            turnover += float(np.abs(0.5 * (pulls[1:] + pulls[:-1]) * moved).sum())
        pressures = {n: np.asarray(out[f"{n}.pressure"]) for n in self.part.muscles}
        return HostReference(time, positions, np.gradient(positions, FINE), tensions, pressures, turnover)


@functools.cache
def single_part() -> Part:
    """The nylon muscle with a pressure at which it carries about 4 kg at the start."""
    air = Air(supply=SUPPLY)
    empty = Part("nylon", air, span=START)
    carries = float(empty.hosted.muscles["muscle"].law.pressure_for(MASS * GRAVITY, START))
    return Part("nylon", air, span=START, pressure=carries, title="nylon muscle of the scenarios")


@functools.cache
def pair_part() -> Part:
    """Two nylon muscles, each with a valve of its own."""
    both = {"flexor": "nylon", "extensor": "nylon"}
    return Part(both, Air(supply=SUPPLY), span=HINGE_SPAN, title="pair of nylon muscles of the scenarios")


@functools.cache
def tank_part() -> Part:
    """Two nylon muscles on a tank that is not filled again."""
    return Part.from_circuit(Path(str(resources.files(__package__) / "shared_tank.toml")), span=START)


@functools.cache
def _carried(part: Part) -> float:
    """Weight that muscles carry at rest [N]: nothing moves at first, so that a rate half a step old is none."""
    values = part.observe(part.rest(), span=START)._asdict()
    return float(sum(values["tension" if len(part.muscles) == 1 else f"{name}_tension"] for name in part.muscles))


def hanging(mass: float | None = None, weight: float | None = None, part: Part | None = None) -> HostMechanism:
    """A mass [kg] with a weight [N] at the ends of muscles side by side; by default the ones that they carry at rest.

    Args:
        mass: the mass [kg].
        weight: the weight [N].
        part: one of those of the scenarios; the single muscle by default.
    """
    part = part or single_part()
    weight = _carried(part) if weight is None else weight
    mass = weight / GRAVITY if mass is None else mass
    arms, spans = dict.fromkeys(part.muscles, -1.0), dict.fromkeys(part.muscles, 0.0)
    return HostMechanism(mass, arms, spans, load=weight, start=START)


def _given(path: Any) -> HostMechanism:
    return replace(hanging(), path=tuple(float(x) for x in path), start=float(path[0]))


def _series(*pieces: tuple[float, int]) -> tuple[float, ...]:
    return tuple(value for value, count in pieces for _ in range(count))


def _isometric() -> Scenario:
    command = {"muscle": _series((0.0, 3), (0.5, 7), (0.0, 10), (-0.5, 8), (0.0, 12))}
    path = _given(np.full(41, START))
    return Scenario("isometric", "filled and vented at one span", single_part(), path, command)


def _hang() -> Scenario:
    command = {"muscle": _series((0.0, 3), (0.08, 10), (0.0, 12), (-0.08, 10), (0.0, 25))}
    return Scenario("hang", "a weight lifted and let down", single_part(), hanging(), command)


def _slack() -> Scenario:
    pushes, still = _series((0.0, 5), (-80.0, 5), (0.0, 30)), {"muscle": _series((0.0, 40))}
    return Scenario("slack", "a weight thrown up and caught", single_part(), hanging(), still, pushes)


def _loop() -> Scenario:
    path = START - 5e-3 * (1.0 - np.cos(2.0 * np.pi * GRID * np.arange(61) / 0.3))
    still = {"muscle": _series((0.0, 60))}
    return Scenario("loop", "a span to and fro, valve closed", single_part(), _given(path), still)


def _leak() -> Scenario:
    command, leaks = {"muscle": _series((0.0, 3), (0.06, 10), (0.0, 47))}, {LEAKING: LEAKAGE}
    return Scenario("leak", "a weight on a valve that leaks", single_part(), hanging(), command, parameters=leaks)


def _joint() -> Scenario:
    both = [(0.0, 5), (0.1, 10), (0.0, 10)]
    turn = [(0.04, 10), (0.0, 25), (-0.08, 10), (0.0, 20), (0.04, 10), (0.0, 20)]
    commands = {"flexor": _series(*both, *turn), "extensor": _series(*both, *((-value, n) for value, n in turn))}
    arms, spans = {"flexor": ARM, "extensor": -ARM}, dict.fromkeys(commands, HINGE_SPAN)
    mechanism = HostMechanism(INERTIA, arms, spans, rotary=True)
    return Scenario("joint", "a hinge between two muscles", pair_part(), mechanism, commands)


def _tank() -> Scenario:
    part, title = tank_part(), "a weight on two muscles with one tank, handed over, thrown up and caught"
    left = _series((0.0, 3), (-0.03, 10), (0.0, 12), (0.03, 10), (0.0, 40))
    right = _series((0.0, 3), (0.04, 10), (0.0, 12), (-0.03, 10), (0.0, 40))
    pushes = _series((0.0, 45), (-60.0, 5), (0.0, 25))
    return Scenario("tank", title, part, hanging(part=part), {"left": left, "right": right}, pushes, closed=True)


SCENARIOS: dict[str, Callable[[], Scenario]] = {
    "isometric": _isometric,
    "hang": _hang,
    "slack": _slack,
    "loop": _loop,
    "leak": _leak,
    "joint": _joint,
    "tank": _tank,
}


def scenario(name: str) -> Scenario:
    """The scenario of a name; raises `InputError` with the nearest one."""
    if name not in SCENARIOS:
        raise InputError("scenario", name, known=tuple(SCENARIOS))
    return SCENARIOS[name]()
