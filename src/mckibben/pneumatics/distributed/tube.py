"""The distributed tube: its parameters, the rates of change within it and behind its ends, and its integration in time.

Heun's method (the strong-stability-preserving Runge-Kutta method of second order) with a step chosen from the state: the
waves, the wall and the vessels bound it, and it divides the rest of the sample period. Friction and heat are part of every
stage, so that a steady state does not depend on the step. Source: S. Gottlieb, C.-W. Shu and E. Tadmor, SIAM Review 43,
2001, doi:10.1137/S003614450036757X.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..._jax import jax, jnp
from ...components import Module, Scalar, field, jit_arrays
from ...components.gas import AIR, Gas
from ...errors import ConvergenceError, InputError, choice
from ...quantities import declared, quantity
from .ends import End, EndState, ReservoirEnd, TubeFace
from .equations import WALLS, Conserved, Medium, Primitive, WallRates, hllc, reconstruct, wall_rates

# Largest step over the time in which a wave crosses a cell: linear stability of the scheme ends at 1.
COURANT = 0.8
# Largest step times the fastest rate of friction or heat exchange; Heun's method is stable up to 2.
WALL_STEP = 0.5


class TubeState(NamedTuple):
    """State variables of the integration."""

    cells: Conserved  # shape (cells,)
    left: EndState
    right: EndState
    heat: Scalar  # given by the tube's wall since the start [J]
    passed: tuple[Scalar, Scalar]  # mass [kg] and energy [J] through both ends, without regard to direction


class DistributedTube(Module):
    """A straight tube of constant section, resolved along its length: the reference for the lumped models.

    Args:
        cells: number of cells, 4 or more; 50 give the steady flow of a metre of tubing within 0.01 %, choked within 0.03 %.
        wall: ``isothermal``, ``adiabatic``, or ``wall_heat`` with the heat transfer of developed pipe flow.
    """

    length: Scalar = quantity("m", (1e-3, 1e3), "length", symbol="l", typical=(0.05, 10.0))
    diameter: Scalar = quantity("m", (1e-5, 1.0), "inner diameter", symbol="D", typical=(1e-3, 2e-2))
    roughness: Scalar = quantity("m", (0.0, 1e-2), "sand roughness of the wall", symbol="eps", default=1.5e-6)
    wall_temperature: Scalar = quantity("K", (100.0, 1000.0), "temperature of the wall", symbol="Tw", default=293.15)
    friction_scale: Scalar = quantity("1", (0.0, 100.0), "multiple of the wall friction; 0 leaves it out", default=1.0)
    gas: Gas = AIR
    cells: int = field(static=True, kw_only=True, default=50)
    wall: str = field(static=True, kw_only=True, default="wall_heat")

    def __check_init__(self) -> None:
        """Refuse too few cells, an unknown wall, and roughness outside the range of the friction law."""
        super().__check_init__()
        where = type(self).__name__
        if not isinstance(self.cells, int) or self.cells < 4:
            raise InputError("cells", self.cells, "must be 4 or more", where=where)
        if self.wall not in WALLS:
            raise InputError("wall", self.wall, f"must be {choice(WALLS)}", where=where)
        if not isinstance(self.roughness, jax.core.Tracer) and self.roughness > 0.05 * self.diameter:
            raise InputError("roughness", float(self.roughness), "must be up to 5 % of the diameter [m]", where=where)

    @property
    def area(self) -> Scalar:
        """Section [m^2]."""
        return 0.25 * jnp.pi * self.diameter**2

    @property
    def cell_length(self) -> Scalar:
        """Length of a cell [m]."""
        return self.length / self.cells

    @property
    def medium(self) -> Medium:
        """The gas under this wall."""
        return Medium(self.gas, isothermal=self.wall == "isothermal")

    def content(self, cells: Conserved) -> tuple[Scalar, Scalar]:
        """Mass [kg] and total energy [J] of the gas in the tube."""
        volume = self.area * self.cell_length
        return volume * jnp.sum(cells.density), volume * jnp.sum(cells.energy)


def end_faces(
    tube: DistributedTube, left: End, right: End, state: TubeState, time: Scalar
) -> tuple[TubeFace, TubeFace, Primitive, Primitive]:
    """Fluxes out of both ends, and the reconstructed states at the left and right faces of the cells."""
    medium = tube.medium
    cells = medium.primitive(state.cells)
    pairs = [reconstruct(jnp.asarray(values)) for values in cells]
    lower, upper = (Primitive(*(pair[side] for pair in pairs)) for side in (0, 1))
    at_left = _outward(_part(lower, 0), _part(cells, 0), -1.0)
    at_right = _outward(_part(upper, -1), _part(cells, -1), 1.0)
    return (
        left.face(medium, at_left, state.left, time, tube.area),
        right.face(medium, at_right, state.right, time, tube.area),
        lower,
        upper,
    )


def _part(state: Primitive, at: int | slice) -> Primitive:
    return Primitive(*(jnp.asarray(values)[at] for values in state))


def _outward(face: Primitive, cell: Primitive, sign: float) -> Primitive:
    """State at an end, extrapolated but never to less than a third of the cell's pressure and temperature."""
    return Primitive(
        jnp.maximum(face.pressure, cell.pressure / 3.0),
        sign * face.velocity,
        jnp.maximum(face.temperature, cell.temperature / 3.0),
    )


def rates(tube: DistributedTube, left: End, right: End, state: TubeState, time: Scalar) -> TubeState:
    """Time derivative of the whole state."""
    gas, medium = tube.gas, tube.medium
    at_left, at_right, lower, upper = end_faces(tube, left, right, state, time)
    inner = hllc(medium, _part(upper, slice(None, -1)), _part(lower, slice(1, None)))
    first = (-at_left.mass, at_left.momentum, -at_left.energy)
    last = (at_right.mass, at_right.momentum, at_right.energy)
    faces = [
        jnp.concatenate([jnp.asarray(a)[None], q, jnp.asarray(b)[None]])
        for a, q, b in zip(first, inner, last, strict=True)
    ]
    mass, momentum, energy = ((q[:-1] - q[1:]) / tube.cell_length for q in faces)

    wall = _wall(tube, medium.primitive(state.cells))
    cells = Conserved(mass, momentum - wall.friction * state.cells.momentum, energy + wall.heating)
    return TubeState(
        cells,
        left.rate(gas, state.left, at_left, tube.area),
        right.rate(gas, state.right, at_right, tube.area),
        tube.area * tube.cell_length * jnp.sum(wall.heating),
        (
            tube.area * (jnp.abs(at_left.mass) + jnp.abs(at_right.mass)),
            tube.area * (jnp.abs(at_left.energy) + jnp.abs(at_right.energy)),
        ),
    )


def _wall(tube: DistributedTube, state: Primitive) -> WallRates:
    own = {name: getattr(tube, name) for name in ("diameter", "roughness", "wall_temperature", "friction_scale")}
    return wall_rates(tube.gas, state, **own, heat=tube.wall == "wall_heat")


def hold_temperature(tube: DistributedTube, state: TubeState) -> TubeState:
    """The exchange of an isothermal wall, infinitely fast: the heat is what the temperature asks for."""
    if tube.wall != "isothermal":
        return state
    velocity = state.cells.momentum / state.cells.density
    energy = state.cells.density * (tube.gas.cv * tube.wall_temperature + 0.5 * velocity**2)
    heat = tube.area * tube.cell_length * jnp.sum(energy - state.cells.energy)
    return state._replace(cells=state.cells._replace(energy=energy), heat=state.heat + heat)


def largest_step(tube: DistributedTube, left: End, right: End, state: TubeState) -> Scalar:
    """Time step that waves, walls and the vessels allow [s].

    The wall's rates are those of the speed that a single step could bring about, not of the present one.
    """
    medium, now = tube.medium, tube.medium.primitive(state.cells)
    fastest = jnp.abs(now.velocity) + medium.sound_speed(now.temperature)
    span = jnp.minimum(tube.cell_length, jnp.minimum(left.least_volume(), right.least_volume()) / tube.area)
    wall = _wall(tube, now._replace(velocity=fastest))
    rate = jnp.max(jnp.maximum(wall.friction, wall.exchange))
    return jnp.minimum(COURANT * span / jnp.max(fastest), WALL_STEP / rate)


# ---- results


class Sample(NamedTuple):
    """State at a recorded moment, as arrays on the device."""

    cells: Primitive
    faces: tuple[TubeFace, TubeFace]
    behind: tuple[Primitive, Primitive]
    ends: tuple[EndState, EndState]
    heat: Any


class EndRecord(NamedTuple):
    """An end over time; arrays of shape (samples,). Flow and velocity are positive in the direction of x at both ends."""

    pressure: np.ndarray  # absolute, static, at the end of the tube [Pa]
    temperature: np.ndarray  # there [K]
    velocity: np.ndarray  # there [m/s]
    mass_flow: np.ndarray  # [kg/s]
    enthalpy_flow: np.ndarray  # total [W]
    outside_pressure: np.ndarray  # in the reservoir or the vessel [Pa]; nan behind a closed end
    outside_temperature: np.ndarray  # there [K]
    mass: np.ndarray  # content of the vessel, or what a reservoir has received [kg]
    energy: np.ndarray  # likewise [J]
    heat: np.ndarray  # from the vessel's wall since the start [J]


class TubeBalance(NamedTuple):
    """Balances of the whole run: change of contents against independently integrated fluxes.

    The heat of an isothermal wall (or vessel) is what its temperature asks for: there the energy balance proves nothing
    about the heat, and `heat_is_remainder` says so.
    """

    mass_error: float  # gain of tube and ends, over content at the start and throughput [1]
    energy_error: float  # likewise less heat [1]
    mass_throughput: float  # through both ends, without regard to direction [kg]
    energy_throughput: float  # [J]
    heat: float  # from the tube's wall [J]
    heat_is_remainder: bool


class TubeResult(NamedTuple):
    """A simulated tube."""

    times: np.ndarray  # (samples,) [s]
    positions: np.ndarray  # centres of the cells, (cells,) [m]
    pressure: np.ndarray  # absolute, (samples, cells) [Pa]
    velocity: np.ndarray  # (samples, cells) [m/s]
    temperature: np.ndarray  # (samples, cells) [K]
    left: EndRecord
    right: EndRecord
    heat: np.ndarray  # from the tube's wall since the start, (samples,) [J]
    balance: TubeBalance
    steps: int


def assemble(
    tube: DistributedTube,
    ends: tuple[End, End],
    states: tuple[TubeState, TubeState],
    recorded: Sample,
    times: np.ndarray,
    steps: int,
) -> TubeResult:
    """The result from what lies at the ends, the states at the start and the end of the run, and the samples."""
    centres = (np.arange(tube.cells) + 0.5) * float(tube.cell_length)
    area = float(tube.area)
    at_left, at_right = (
        _end_record(area, sign, recorded.faces[k], recorded.behind[k], recorded.ends[k])
        for k, sign in enumerate((-1.0, 1.0))
    )
    (pressure, velocity, temperature), heat = map(np.asarray, recorded.cells), np.asarray(recorded.heat)
    cells, balance = (pressure, velocity, temperature), _balance(tube, ends, *states)
    return TubeResult(times, centres, *cells, at_left, at_right, heat, balance, steps)


def _end_record(area: float, sign: float, face: TubeFace, behind: Primitive, state: EndState) -> EndRecord:
    at, flows = face.state, (sign * area * face.mass, sign * area * face.energy)
    columns = at.pressure, at.temperature, sign * at.velocity, *flows, behind.pressure, behind.temperature, *state
    return EndRecord(*map(np.asarray, columns))


def _balance(tube: DistributedTube, ends: tuple[End, End], start: TubeState, end: TubeState) -> TubeBalance:
    def content(state: TubeState) -> np.ndarray:
        """Mass and energy of the tube and behind either end, shape (3, 2)."""
        tube_content = [float(x) for x in tube.content(state.cells)]
        return np.array([tube_content, *([float(e.mass), float(e.energy)] for e in (state.left, state.right))])

    heat = float(end.heat)
    received = np.array([0.0, heat + float(end.left.heat) + float(end.right.heat)])
    before, after, passed = content(start), content(end), np.array(end.passed, float)
    error = (np.sum(after - before, axis=0) - received) / (np.sum(before, axis=0) + passed)
    remainder = tube.wall == "isothermal" or any(e.heat_is_remainder() for e in ends)
    return TubeBalance(float(error[0]), float(error[1]), float(passed[0]), float(passed[1]), heat, remainder)


# ---- integration


def simulate(
    tube: DistributedTube,
    left: End,
    right: End,
    *,
    duration: float,
    sample_period: float,
    pressure_abs: Scalar,
    temperature: Scalar = 293.15,
    velocity: Scalar = 0.0,
    most_steps: int = 20_000_000,
) -> TubeResult:
    """Integrate a tube and record it.

    Args:
        tube: the tube.
        left: end at x = 0.
        right: end at x = length.
        duration: time to simulate [s].
        sample_period: time between two recorded states, a whole part of the duration [s].
        pressure_abs: absolute pressure at the start, one value or one per cell [Pa].
        temperature: temperature at the start, likewise [K]; an isothermal wall sets its own.
        velocity: velocity at the start, likewise [m/s].
        most_steps: where the integration gives up.

    Raises:
        InputError: for values that are not allowed, or when more than `most_steps` steps would be needed.
        ConvergenceError: when the solution stopped being finite.
    """
    samples = _sample_count(duration, sample_period)
    start = _start(tube, left, right, pressure_abs, temperature, velocity)
    step = float(largest_step(tube, left, right, start))
    if duration / step > most_steps:
        raise InputError(
            "duration", duration, f"the step is {step:.3g} s, which allows up to {step * most_steps:.4g} s"
        )
    (end, steps), recorded = _integrate(
        tube, left, right, start, samples, jnp.asarray(sample_period, float), most_steps
    )
    result = assemble(tube, (left, right), (start, end), recorded, np.arange(samples + 1) * sample_period, int(steps))
    if int(steps) >= most_steps:
        raise InputError("duration", duration, f"must be what {most_steps} steps reach; the flow needs more")
    if not np.all(np.isfinite(result.pressure)) or np.any(result.pressure <= 0.0):
        bad = ~np.all(np.isfinite(result.pressure) & (result.pressure > 0.0), axis=1)
        raise ConvergenceError(
            f"the tube has no finite state from {result.times[bad][0]:.4g} s on; the scheme is made for pressures within "
            "a factor of 1000 of each other"
        )
    return result


def _sample_count(duration: float, period: float) -> int:
    for name, value in (("duration", duration), ("sample_period", period)):
        if not np.isfinite(value) or value <= 0.0:
            raise InputError(name, value, "must be a time above 0 s")
    count = round(duration / period)
    if count < 1 or abs(duration / period - count) > 1e-6 * count:
        raise InputError("sample_period", period, f"must be a whole part of the duration, {duration:g} s")
    return count


def _start(
    tube: DistributedTube, left: End, right: End, pressure_abs: Scalar, temperature: Scalar, velocity: Scalar
) -> TubeState:
    limits = declared(ReservoirEnd)
    values = {"pressure_abs": pressure_abs, "temperature": temperature, "velocity": velocity}
    for name, value in values.items():
        if np.shape(value) not in ((), (tube.cells,)):
            raise InputError(
                name, None, f"must be one, or one for each of {tube.cells} cells, got {np.shape(value)} values"
            )
        if name in limits:
            limits[name].check(name, value)
        elif not np.all(np.isfinite(value)):
            raise InputError(name, value, "must be finite values")
    if tube.wall == "isothermal":
        values["temperature"] = tube.wall_temperature
    pressure, warmth, speed = (jnp.broadcast_to(jnp.asarray(v, float), (tube.cells,)) for v in values.values())
    cells = tube.medium.conserved(Primitive(pressure, speed, warmth))
    zero = jnp.zeros(())
    return TubeState(cells, left.initial(tube.gas), right.initial(tube.gas), zero, (zero, zero))


@jit_arrays
def _integrate(
    tube: DistributedTube, left: End, right: End, start: TubeState, samples: int, period: Scalar, most_steps: int
) -> tuple[tuple[TubeState, Scalar], Sample]:
    def euler_step(state: TubeState, time: Scalar, step: Scalar) -> TubeState:
        slope = rates(tube, left, right, state, time)
        return hold_temperature(tube, jax.tree.map(lambda value, rate: value + step * rate, state, slope))

    def heun_step(state: TubeState, time: Scalar, step: Scalar) -> TubeState:
        # the mean of the start and of two Euler steps on; a loop, so that the rates are compiled once
        twice = jax.lax.fori_loop(0, 2, lambda k, ahead: euler_step(ahead, time + k * step, step), state)
        return hold_temperature(tube, jax.tree.map(lambda a, b: 0.5 * (a + b), state, twice))

    def going(inner: tuple[TubeState, Scalar, Scalar, Scalar]) -> Scalar:
        _, _, left_over, steps = inner
        return (left_over > 0.0) & (steps < most_steps)

    def advance(inner: tuple[TubeState, Scalar, Scalar, Scalar]) -> tuple[TubeState, Scalar, Scalar, Scalar]:
        state, until, left_over, steps = inner
        parts = jnp.ceil(left_over / largest_step(tube, left, right, state))
        step = left_over / parts
        state = heun_step(state, until - left_over, step)
        return state, until, jnp.where(parts > 1.0, left_over - step, 0.0), steps + 1

    def one_sample(carry: tuple[TubeState, Scalar], index: Scalar) -> tuple[tuple[TubeState, Scalar], Sample]:
        state, steps = carry
        time = index * period
        faces, gas = end_faces(tube, left, right, state, time)[:2], tube.gas
        behind = (left.outside(gas, state.left, time), right.outside(gas, state.right, time))
        ends = (state.left, state.right)
        recorded = Sample(tube.medium.primitive(state.cells), faces, behind, ends, state.heat)
        wait = jnp.where(index < samples, period, 0.0)  # nothing follows the last sample
        inner: tuple[TubeState, Scalar, Scalar, Scalar] = state, (index + 1) * period, wait, steps
        state, _, _, steps = jax.lax.while_loop(going, advance, inner)
        return (state, steps), recorded

    return jax.lax.scan(one_sample, (start, jnp.zeros((), int)), jnp.arange(samples + 1))
