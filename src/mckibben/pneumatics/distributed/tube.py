"""The distributed tube: its parameters, and the rates of change within it and behind its ends."""

from __future__ import annotations

from typing import NamedTuple

from ..._jax import jax, jnp
from ...components import Module, Scalar, field
from ...errors import InputError, choice
from ...quantities import quantity
from ..gas import AIR, Gas
from .ends import End, EndState
from .equations import Conserved, Medium, Primitive
from .flux import hllc, reconstruct
from .openings import TubeFace
from .wall import WALLS, WallRates, wall_rates

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
    return wall_rates(
        tube.gas,
        state,
        diameter=tube.diameter,
        roughness=tube.roughness,
        wall_temperature=tube.wall_temperature,
        friction_scale=tube.friction_scale,
        heat=tube.wall == "wall_heat",
    )


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
