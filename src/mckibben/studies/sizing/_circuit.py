"""Simulation of muscles held behind a valve until their tension has settled."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..._jax import Tree, jax, jnp
from ...analysis.steps import LAST, settling
from ...assembly.build import AirLine, circuit_for
from ...assembly.muscle_unit import MuscleUnit
from ...components import Environment, Scalar
from ...components.flow import FlowElement
from ...components.module import flatten, map_leaves
from ...components.system import Moment, System, Value
from ...documents import JsonValue
from ...engine.integration import march
from ...engine.native import call_compiled, call_in_lanes
from ...engine.rates import RK4_LIMIT
from ...engine.signals import Signal, held, ramped
from ...muscles.law import TensionLaw
from ...pneumatics.circuit import Circuit
from ...pneumatics.orifice import Orifice
from ...pneumatics.tubes import LumpedTube
from ...pneumatics.valves import PressureRegulator, SpoolValve, ThreeWayValve

LONGER = (4.0, 16.0)  # times a lane's time constants of filling, for a tension that has not settled by then


def settled_courses(lanes: Sequence[Lane], done: Sequence[Course]) -> list[Course]:
    """Repeat courses until the tension of held muscles settles before the turn.

    Args:
        lanes: lanes of the courses.
        done: their courses; those that have settled are taken as they are, the others run again for longer.

    Returns:
        The courses; one that has not settled even then says so.
    """
    settled = list(done)
    for times in LONGER:
        late = [i for i, course in enumerate(settled) if course.sound and not course.settled]
        if not late:
            break
        again = courses([replace(lanes[i], fills=times * lanes[i].fills) for i in late])
        for i, course in zip(late, again, strict=True):
            settled[i] = course if course.sound else settled[i]
    return settled


NAME = "muscle"
SAMPLES, TURN = 640, 400  # of a lane, and the sample at which a held muscle is vented or a drawn one begins to shorten
FILLS = 5.0  # time constants of filling until then
CHUNK = 32  # lanes that run together: each circuit is compiled for one number of them
OPENINGS, VALVE_TIMES = 2048, 10.0  # steps of a valve's own motion, and how many of its times that lasts
MOST_STEPS = 2000  # of the physics in a sample, beyond which a lane is given up
RESERVE = 1.1  # on the steps that the first guess asks for


@dataclass(frozen=True, eq=False)
class Lane:
    """A muscle behind one valve and tube.

    Attributes:
        unit: the muscle.
        valve: between supply, port and room.
        tube: from the port to the muscle.
        pressure: gauge pressure that is requested [Pa].
        supply: gauge pressure of the supply [Pa].
        length: at which the muscle is held, or from which it is drawn [m].
        stroke: by which it shortens from the turn on; zero where it is vented instead [m].
        speed: with which it shortens [m/s].
        environment: the room.
        fills: time constants of filling until a held muscle is vented.
    """

    unit: MuscleUnit
    valve: FlowElement
    tube: LumpedTube
    pressure: float
    supply: float
    length: float
    stroke: float = 0.0
    speed: float = 0.0
    environment: Environment = Environment()
    fills: float = FILLS


@dataclass(frozen=True, eq=False)
class Course:
    """Response of a lane to the command: times [s], gauge pressures [Pa], lengths [m], static tensions [N]; (n,) each."""

    time: np.ndarray
    pressure: np.ndarray
    length: np.ndarray
    tension: np.ndarray
    turn: float  # when the valve was shut or the shortening began [s]
    sound: bool  # False where no step was short enough; the rest then means nothing

    @property
    def top(self) -> float:
        """Tension just before the turn [N]."""
        return float(self.tension[self.time < self.turn][-1])

    @property
    def settled(self) -> bool:
        """Whether the tension of a held muscle settles before the turn, by the criterion of `analysis.steps`."""
        late = (self.time < self.turn) & (self.time >= (1.0 - LAST) * self.turn)
        return settling(self.time[late], self.tension[late], self.top - float(self.tension[0]))[1]


class _Watched(System):
    """A circuit with the muscle's pressure and tension as outputs; accounts would double the compilation."""

    circuit: Circuit
    law: TensionLaw
    room: Scalar

    def rate(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Rates of change of the circuit."""
        return self.circuit.rate(state, memory, inputs)

    def integrands(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> Tree:
        """Return no integrands."""
        return {}

    def advance_memory(self, memory: Tree, start: Moment, end: Moment, duration: Scalar) -> Tree:
        """Advance the memory of the circuit."""
        return self.circuit.advance_memory(memory, start, end, duration)

    def commands(self, signals: Mapping[str, JsonValue]) -> dict[str, JsonValue]:
        """Commands of the circuit."""
        return self.circuit.commands(signals)

    def outputs(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Gauge pressure [Pa], static tension [N], and the bound of the fastest mode [1/s]."""
        gauge = state["pressure"][NAME] - self.room
        return {
            "pressure": gauge,
            "tension": self.law.tension(inputs[f"{NAME}.length"].value, gauge),
            "rate": self.circuit.max_rate_bound(state, memory, inputs),
        }


def line_conductance(valve: FlowElement, tube: LumpedTube) -> float:
    """Approximate sonic conductance of filling, valve and tube in series, for time scales [m^3/(s Pa)]."""
    slender = float(tube.length / tube.diameter)
    pipe = Orifice.of_hole(float(tube.diameter), discharge=(1.0 + float(tube.ends) + 0.02 * slender) ** -0.5)
    fill = float(getattr(valve, "fill").conductance)  # noqa: B009
    return float((fill**-2 + float(pipe.conductance) ** -2) ** -0.5)


def time_scale(lane: Lane, port: float) -> float:
    """Approximate filling time: volume over conductance times atmospheric pressure; port volume [m^3]."""
    volume = float(lane.unit.law.braid_volume(lane.length - lane.stroke, lane.pressure))
    volume += float(lane.tube.inner_volume()) + port
    return volume / (line_conductance(lane.valve, lane.tube) * float(lane.environment.pressure_abs))


def courses(lanes: Sequence[Lane]) -> list[Course]:
    """Simulate all lanes; those with circuits of the same structure run together."""
    prepared = [_prepared(lane) for lane in lanes]
    groups: list[tuple[Any, list[int]]] = []  # tables in static fields have no hash
    for i, (tree, _) in enumerate(prepared):
        structure = flatten(tree)[1]
        alike = next((members for known, members in groups if known == structure), None)
        if alike is None:
            groups.append((structure, alike := []))
        alike.append(i)
    results: list[Course | None] = [None] * len(lanes)
    for _, members in groups:
        order = sorted(members, key=lambda i: prepared[i][1])
        for begin in range(0, len(order), CHUNK):
            part = order[begin : begin + CHUNK]
            for i, course in zip(part, _together([lanes[i] for i in part], [prepared[i] for i in part]), strict=True):
                results[i] = course
    return [c for c in results if c is not None]


def _prepared(lane: Lane) -> tuple[Any, float]:
    """Circuit, signals, period and pressures of a lane, and the steps per sample."""
    regulated = isinstance(lane.valve, PressureRegulator)
    valve: Any = lane.valve if regulated else (lane.valve.fill, lane.valve.vent)  # type: ignore[attr-defined]
    circuit = circuit_for(
        {NAME: lane.unit}, supply=lane.supply, line=AirLine(valve=valve, tube=lane.tube), environment=lane.environment
    )
    port = float(circuit.nodes[f"{NAME}.port"].volume)  # type: ignore[union-attr]
    valve_time = _valve_time(lane.valve)
    fill = lane.fills * time_scale(lane, port) + valve_time
    moving = lane.stroke / lane.speed if lane.stroke > 0.0 else 0.0
    period = max(fill / TURN, moving / (0.8 * (SAMPLES - TURN)))
    time = period * np.arange(SAMPLES + 1)
    turn = period * TURN
    shut = lane.stroke == 0.0
    moved = np.clip((time - turn) * lane.speed, 0.0, lane.stroke)
    signals: dict[str, Signal] = {f"{NAME}.length": ramped(lane.length - moved)}
    if regulated:
        open_ = np.where((time < turn) | (not shut), lane.pressure, 0.0)
        signals[f"{NAME}.valve"] = held(open_)
    else:
        up = _openings(lane.valve, 1.0)
        fill_, vent_ = (np.interp(time, up[0], u) for u in up[1:])
        if shut:
            down = _openings(lane.valve, -1.0 if isinstance(lane.valve, SpoolValve) else 0.0)
            late = time >= turn
            fill_, vent_ = (
                np.where(late, np.interp(time - turn, down[0], d), u)
                for d, u in zip(down[1:], (fill_, vent_), strict=True)
            )
        signals |= {f"{NAME}.fill": ramped(fill_), f"{NAME}.vent": ramped(vent_)}
    room = float(lane.environment.pressure_abs)
    watched = _Watched(circuit, lane.unit.law, jnp.asarray(room))
    rate = _stiffest(watched, signals, period, lane)
    return (watched, signals, jnp.asarray(period), jnp.asarray(room)), rate * period / RK4_LIMIT


def _stiffest(watched: _Watched, signals: dict[str, Signal], period: float, lane: Lane) -> float:
    """First guess of the fastest rate: the port alone, at supply pressure [1/s]."""
    valve = lane.valve
    band, conductance = float(valve.fill.linear_band), float(valve.fill.conductance)  # type: ignore[attr-defined]
    p = lane.supply + float(lane.environment.pressure_abs)
    x = min(band / (p * (1.0 - float(valve.fill.critical_ratio))), 0.5)  # type: ignore[attr-defined]
    slope = 3.0 * conductance * 1.185 / ((1.0 - float(valve.fill.critical_ratio)) * np.sqrt(x * (2.0 - x)))  # type: ignore[attr-defined]
    if isinstance(valve, PressureRegulator):
        slope += conductance * 1.185 * p / float(valve.band)
    port = float(watched.circuit.nodes[f"{NAME}.port"].volume)  # type: ignore[union-attr]
    return float(2.0 * slope * 1.4 * 287.0 * 350.0 / (port + 0.5 * float(lane.tube.inner_volume())))


def _together(lanes: Sequence[Lane], prepared: Sequence[tuple[Any, float]]) -> list[Course]:
    stacked = map_leaves(lambda *leaves: np.stack(leaves), *(tree for tree, _ in prepared))
    steps = max(1, int(np.ceil(max(RESERVE * n for _, n in prepared))))
    while True:
        steps = min(steps, MOST_STEPS)
        out = call_in_lanes(_marched, (np.int64(steps),), (stacked,))
        h = stacked[2] / steps
        needed = np.max(out["rate"], axis=1) * h / RK4_LIMIT
        # Beyond the limit by a little is still stable in practice: the bound is an upper one.
        short = np.nan_to_num(needed, nan=np.inf) <= 1.0 + 1e-9
        if bool(short.all()) or steps == MOST_STEPS:
            break
        worst = float(np.max(needed))
        steps = int(np.ceil(steps * (1.05 * worst if np.isfinite(worst) else 2.0)))
    results = []
    for i in range(len(lanes)):
        period = float(stacked[2][i])
        tension, pressure = out["tension"][i], out["pressure"][i]
        sound = bool(short[i] and np.isfinite(tension).all() and np.isfinite(pressure).all())
        length = stacked[1][f"{NAME}.length"].values[i]
        time = period * np.arange(SAMPLES + 1)
        results.append(Course(time, pressure, length, tension, period * TURN, sound))
    return results


def _marched(steps: Any, lane: Any) -> dict[str, Tree]:
    """Outputs of a prepared lane at all samples, with a number of steps in each."""
    watched, signals, period, room = lane
    signals = watched.circuit.commands(signals)
    first = {n: s.at(0, 0.0, period) for n, s in signals.items()}
    circuit = watched.circuit
    state = circuit.at_rest({name: room for name in circuit.chambers}, first)
    if "muscle.valve" in circuit.elements:  # a regulator rests at zero until the command comes
        state["elements"]["muscle.valve"] = jnp.zeros(())
    memory = circuit.initial_memory(state, first)
    _, kept = march(watched, state, memory, signals, period, steps, SAMPLES, False, integrals=False)
    outputs: dict[str, Tree] = kept[2]
    return outputs


# ---- a valve's own motion


def _valve_time(valve: FlowElement) -> float:
    """Time in which a valve opens and settles [s]."""
    if isinstance(valve, ThreeWayValve):
        return float(valve.drive.opening_dead_time + valve.drive.opening_time)
    lag, dead = getattr(valve, "lag", 0.0), getattr(valve, "dead_time", 0.0)
    return 3.0 * float(lag) + float(dead)


def _openings(valve: FlowElement, command: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Times after a command [s], and openings of fill and vent."""
    key = tuple(float(x) for x in flatten(valve)[0])
    return _opening_course(_Same(valve, key), command)


class _Same:
    """A valve that equals another with the same numbers, so that its motion is computed once."""

    def __init__(self, valve: FlowElement, key: tuple[float, ...]) -> None:
        self.valve, self.key = valve, (type(valve), *key)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, _Same) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)


@functools.lru_cache(maxsize=64)
def _opening_course(same: _Same, command: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    valve: Any = same.valve
    dead = 0.0 if valve.delay() is None else float(valve.delay())
    h = VALVE_TIMES * (_valve_time(valve) + 1e-5) / OPENINGS
    fill, vent = call_compiled(_moved, valve, np.float64(command), np.float64(h))
    time = h * np.arange(OPENINGS + 1)
    return np.concatenate([[0.0], dead + time]), np.append(fill[0], fill), np.append(vent[0], vent)


def _moved(valve: Any, command: Scalar, h: Scalar) -> tuple[Scalar, Scalar]:
    """Openings of fill and vent over `OPENINGS` steps, from the other end of the stroke (midpoint rule)."""
    rising = command > 0.5

    def start(at: Scalar) -> Any:
        return jnp.where(rising, 0.0, jnp.ones_like(at))

    # A spool begins at mid position, both edges shut, when it opens, and wide open when it vents.
    state = jax.tree.map(start, valve.initial())

    def opening(state: Tree) -> Any:
        at = valve.drive.opening(state) if hasattr(valve, "drive") else state
        return jnp.stack(valve.openings(at))

    def one(state: Tree, _: Any) -> Any:
        half = jax.tree.map(lambda x, r: x + 0.5 * h * r, state, valve.rates((), state, (), command))
        new = jax.tree.map(lambda x, r: x + h * r, state, valve.rates((), half, (), command))
        return new, opening(new)

    _, later = jax.lax.scan(one, state, None, length=OPENINGS)
    both = jnp.concatenate([opening(state)[None], later])
    return both[:, 0], both[:, 1]
