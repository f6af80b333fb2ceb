"""Ends of the tube: closed, a reservoir whose pressure is given over time, or a rigid vessel, and the openings before them.

The wave that reaches the end fixes pressure and temperature there as functions of the speed; the opening adds one more
relation, and the speed is its root. Gas leaves at the static pressure outside, or at the speed of sound if that pressure
is lower than the choked one; it enters from rest, without loss but for the coefficient given, at most at the speed of
sound. Speeds are counted outward by the caller and are positive here, whichever way the gas moves.
"""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ..._jax import Array, jax, jnp
from ...components import Module, Scalar
from ...components.flow import GasState, TwoPort
from ...components.gas import Gas
from ...errors import InputError
from ...quantities import quantity
from ..volume import HeatModel, Inflow, Isothermal, VolumeState, WallHeat
from .equations import Medium, Primitive

# The root is sought until the residual is this share of its largest value. That takes 4-8 steps, and more only at the kink
# of an almost sharp orifice.
ROOT_SHARE, ROOT_STEPS = 1e-13, 40


def falling_root(residual: Callable[[Scalar], Scalar], highest: Scalar) -> tuple[Scalar, Scalar]:
    """Zero of a falling residual in [0, highest], and the remaining residual, 0 if it vanishes.

    Regula falsi in which an end that stays twice counts less: N. Anderson and A. Bjorck, BIT 13, 1973,
    doi:10.1007/BF01951936. It needs no derivative, which an orifice near equal pressures may not have.
    """
    at_zero, at_highest = residual(jnp.zeros_like(highest)), residual(highest)
    enough = ROOT_SHARE * jnp.maximum(jnp.abs(at_zero), jnp.abs(at_highest))

    def narrow(bracket: tuple[Scalar, ...]) -> tuple[Scalar, ...]:
        low, high, at_low, at_high, moved, best, least, steps = bracket
        speed = jnp.clip(low + (high - low) * at_low / (at_low - at_high), low, high)
        now = residual(speed)
        up = jnp.where(now > 0.0, 1.0, -1.0)  # which end moves
        # An end that stays twice counts less, so that it does not stay for ever.
        shrink = 1.0 - now / jnp.where(up > 0.0, at_low, at_high)
        shrink = jnp.where(moved == up, jnp.where(shrink > 0.0, shrink, 0.5), 1.0)
        better = jnp.abs(now) < least
        return (
            jnp.where(up > 0.0, speed, low),
            jnp.where(up > 0.0, high, speed),
            jnp.where(up > 0.0, now, shrink * at_low),
            jnp.where(up > 0.0, shrink * at_high, now),
            up,
            jnp.where(better, speed, best),
            jnp.where(better, jnp.abs(now), least),
            steps + 1.0,
        )

    def going(bracket: tuple[Scalar, ...]) -> Scalar:
        return (at_highest < 0.0) & (bracket[6] > enough) & (bracket[7] < ROOT_STEPS)

    zero = jnp.zeros_like(highest)
    start: tuple[Scalar, ...] = (zero, highest, at_zero, at_highest, zero, zero, jnp.abs(at_zero), zero)
    speed = jax.lax.while_loop(going, narrow, start)[5]
    left = jnp.maximum(at_highest, 0.0)
    return jnp.where(left > 0.0, highest, speed), left


class TubeFace(NamedTuple):
    """Flux through an end, positive out of the tube, and the state there."""

    mass: Scalar  # [kg/(m^2 s)]
    momentum: Scalar  # P + rho u^2 [Pa], whichever the direction
    energy: Scalar  # [W/m^2]
    state: Primitive  # velocity outward


class Opening(Module):
    """Relation between the flow through an end and the pressures on both sides.

    Both residuals are the drive minus the flow: they fall with the speed and vanish where it is right.
    """

    @abc.abstractmethod
    def outward(self, medium: Medium, leaving: Primitive, outside: Primitive, area: Scalar) -> Scalar:
        """Residual for gas that leaves."""

    @abc.abstractmethod
    def inward(
        self, medium: Medium, entering: Primitive, nozzle: Primitive, outside: Primitive, area: Scalar
    ) -> Scalar:
        """Residual for gas that enters; ``nozzle`` is its state at the same speed without loss."""

    @abc.abstractmethod
    def choked_pressure(self, medium: Medium, entering: Primitive, residual: Scalar) -> Scalar:
        """Pressure [Pa] at which gas enters at the speed of sound while a drive remains."""


class OpenBore(Opening):
    """An open end. A sharp entry has a loss of 0.5; a flush exit only that of its velocity."""

    entry_loss: Scalar = quantity("1", (0.0, 100.0), "pressure lost on entry over rho u^2/2", symbol="K", default=0.0)
    exit_loss: Scalar = quantity(
        "1", (0.0, 100.0), "pressure lost on exit over rho u^2/2, beyond the dynamic pressure", symbol="Ke", default=0.0
    )

    def outward(self, medium: Medium, leaving: Primitive, outside: Primitive, area: Scalar) -> Scalar:
        """Static pressure above that outside and the loss [Pa]."""
        dynamic = 0.5 * medium.gas.density(leaving.pressure, leaving.temperature) * leaving.velocity**2
        return leaving.pressure - outside.pressure - self.exit_loss * dynamic

    def inward(
        self, medium: Medium, entering: Primitive, nozzle: Primitive, outside: Primitive, area: Scalar
    ) -> Scalar:
        """Pressure behind the nozzle and the loss, above that in the tube [Pa]."""
        dynamic = 0.5 * medium.gas.density(entering.pressure, entering.temperature) * entering.velocity**2
        return nozzle.pressure - self.entry_loss * dynamic - entering.pressure

    def choked_pressure(self, medium: Medium, entering: Primitive, residual: Scalar) -> Scalar:
        """The pressure behind the nozzle [Pa]."""
        return entering.pressure + residual


class Restriction(Opening):
    """An orifice or a valve at the end.

    Args:
        flow: an element such as `Orifice`, its first port outside and its second at the tube; or a function
            ``flow(P_up, T_up, P_down)`` that gives the mass flow [kg/s] in either direction from the total pressure [Pa]
            and temperature [K] upstream and the static pressure downstream. It never falls with P_up.
        command: what drives the element: the share that is open.
    """

    flow: TwoPort | Callable[[Any, Any, Any], Any]
    command: Scalar = quantity("1", (0.0, 1.0), "share of the restriction that is open", default=1.0)

    def __check_init__(self) -> None:
        """Refuse a restriction without flow."""
        super().__check_init__()
        if not isinstance(self.flow, TwoPort) and not callable(self.flow):
            raise InputError("flow", self.flow, "must be an element or a function of P_up, T_up and P_down")

    def _entering_flow(self, medium: Medium, outside: Primitive, inside: Primitive, *, leaves: bool) -> Scalar:
        if isinstance(self.flow, TwoPort):
            port, at_tube = (GasState(gas.pressure, gas.temperature, medium.gas) for gas in (outside, inside))
            return self.flow.mass_flow(port, at_tube, self.flow.initial(), self.command)
        entering: Scalar
        if leaves:
            entering = -self.command * self.flow(inside.pressure, inside.temperature, outside.pressure)
        else:
            entering = self.command * self.flow(outside.pressure, outside.temperature, inside.pressure)
        return entering

    def outward(self, medium: Medium, leaving: Primitive, outside: Primitive, area: Scalar) -> Scalar:
        """Flow of the restriction above that of the tube [kg/(m2 s)]."""
        density = medium.gas.density(leaving.pressure, leaving.temperature)
        flow = -self._entering_flow(medium, outside, medium.at_rest(leaving), leaves=True)
        return flow / area - density * leaving.velocity

    def inward(
        self, medium: Medium, entering: Primitive, nozzle: Primitive, outside: Primitive, area: Scalar
    ) -> Scalar:
        """Flow of the restriction above that of the tube [kg/(m2 s)]."""
        density = medium.gas.density(entering.pressure, entering.temperature)
        return self._entering_flow(medium, outside, entering, leaves=False) / area - density * entering.velocity

    def choked_pressure(self, medium: Medium, entering: Primitive, residual: Scalar) -> Scalar:
        """Pressure at which the tube takes the choked flow of the restriction [Pa]."""
        density = residual / jnp.maximum(entering.velocity, 1e-3)
        return entering.pressure + density * medium.gas.gas_constant * entering.temperature


def closed_face(medium: Medium, inside: Primitive) -> TubeFace:
    """A closed end: nothing passes; ``inside`` is the state next to it, its velocity outward."""
    state = medium.wave_state(inside, jnp.zeros_like(inside.velocity))
    zero = jnp.zeros_like(state.pressure)
    return TubeFace(zero, state.pressure, zero, state)


def open_face(medium: Medium, inside: Primitive, outside: Primitive, opening: Opening, area: Scalar) -> TubeFace:
    """Flux through an end that an opening joins to gas at rest.

    Args:
        medium: the gas.
        inside: state next to the end, velocity outward (scalars).
        outside: pressure and temperature of the gas at rest outside.
        opening: the opening.
        area: section of the tube [m^2].
    """
    wall_temperature = inside.temperature  # of use to an isothermal wall only
    leaves = medium.wave_state(inside, 0.0).pressure > outside.pressure

    def entering(speed: Scalar) -> tuple[Primitive, Primitive]:
        nozzle = medium.nozzle(outside.pressure, outside.temperature, wall_temperature, speed)
        return Primitive(medium.wave_state(inside, -speed).pressure, speed, nozzle.temperature), nozzle

    def out(_: None) -> TubeFace:
        def residual(speed: Scalar) -> Scalar:
            return opening.outward(medium, medium.wave_state(inside, speed), outside, area)

        speed, _left = falling_root(residual, medium.choked_exit_speed(inside))
        return _face(medium, medium.wave_state(inside, speed), 1.0, medium.wave_state(inside, speed))

    def into(_: None) -> TubeFace:
        def residual(speed: Scalar) -> Scalar:
            return opening.inward(medium, *entering(speed), outside, area)

        speed, left = falling_root(residual, medium.choked_entry_speed(outside.temperature, wall_temperature))
        state, _nozzle = entering(speed)
        state = state._replace(
            pressure=jnp.where(left > 0.0, opening.choked_pressure(medium, state, left), state.pressure)
        )
        return _face(medium, state, -1.0, outside)

    face: TubeFace = jax.lax.cond(leaves, out, into, None)
    return face


def _face(medium: Medium, state: Primitive, sign: float, source: Primitive) -> TubeFace:
    """Flux of a state that moves at a positive speed, ``sign`` being its direction; its energy is that of ``source``."""
    flow = medium.gas.density(state.pressure, state.temperature) * state.velocity
    energy = sign * flow * medium.total_enthalpy(source)
    return TubeFace(
        sign * flow, state.pressure + flow * state.velocity, energy, state._replace(velocity=sign * state.velocity)
    )


# ---- ends


class EndState(NamedTuple):
    """Total flow through an end, or the contents of its vessel."""

    mass: Scalar  # [kg]
    energy: Scalar  # [J]
    heat: Scalar  # taken from the vessel's wall since the start [J]


class End(Module):
    """An end of the tube with everything behind it."""

    @abc.abstractmethod
    def initial(self, gas: Gas) -> EndState:
        """State at the start."""

    @abc.abstractmethod
    def outside(self, gas: Gas, state: EndState, time: Scalar) -> Primitive:
        """State of the gas behind the end, at rest."""

    @abc.abstractmethod
    def face(self, medium: Medium, inside: Primitive, state: EndState, time: Scalar, area: Scalar) -> TubeFace:
        """Flux out of the tube; ``inside`` has its velocity outward, ``area`` is the tube's section [m^2]."""

    def rate(self, gas: Gas, state: EndState, face: TubeFace, area: Scalar) -> EndState:
        """Time derivative of the state: flow through the end."""
        return EndState(face.mass * area, face.energy * area, jnp.zeros_like(face.mass))

    def least_volume(self) -> Scalar:
        """Volume that bounds the time step [m^3]."""
        return jnp.inf

    def heat_is_remainder(self) -> bool:
        """Whether the heat behind this end follows from a prescribed temperature or exponent."""
        return False


class ClosedEnd(End):
    """A plug."""

    def initial(self, gas: Gas) -> EndState:
        """Return an empty state."""
        return EndState(jnp.zeros(()), jnp.zeros(()), jnp.zeros(()))

    def outside(self, gas: Gas, state: EndState, time: Scalar) -> Primitive:
        """Return zeros, since there is no outside."""
        return Primitive(jnp.full((), jnp.nan), jnp.zeros(()), jnp.full((), jnp.nan))

    def face(self, medium: Medium, inside: Primitive, state: EndState, time: Scalar, area: Scalar) -> TubeFace:
        """State at the closed face, without flow."""
        return closed_face(medium, inside)


class ReservoirEnd(End):
    """Gas at rest whose pressure and temperature are given, constant or over time.

    Values are straight between the ``times`` and constant before and after; a jump is two times close to each other.
    Inside the tube it acts as the total pressure while gas enters, as the static one while it leaves.
    """

    pressure_abs: Scalar = quantity("Pa", (1.0, 1e8), "absolute pressure, one value or one per time", symbol="P")
    temperature: Scalar = quantity("K", (100.0, 2000.0), "temperature, one value or one per time", default=293.15)
    times: Array = quantity("s", (-1e9, 1e9), "times of the values, rising", default=0.0)
    opening: Opening = OpenBore()

    def __check_init__(self) -> None:
        """Refuse times that do not rise and tables of different lengths."""
        super().__check_init__()
        times = np.asarray(self.times)
        if times.ndim > 1 or np.any(np.diff(np.atleast_1d(times)) <= 0.0):
            raise InputError("times", times.tolist(), "must be one list of rising times", where="ReservoirEnd")
        for name in ("pressure_abs", "temperature"):
            shape = np.shape(getattr(self, name))
            if shape not in ((), times.shape):
                raise InputError(name, None, f"must be one, or {times.shape}, got {shape} values", where="ReservoirEnd")

    def initial(self, gas: Gas) -> EndState:
        """State before any flow."""
        return EndState(jnp.zeros(()), jnp.zeros(()), jnp.zeros(()))

    def outside(self, gas: Gas, state: EndState, time: Scalar) -> Primitive:
        """Prescribed pressure and temperature."""
        return Primitive(self._at(self.pressure_abs, time), jnp.zeros(()), self._at(self.temperature, time))

    def _at(self, values: Scalar, time: Scalar) -> Scalar:
        values = jnp.asarray(values)
        if values.ndim == 0 or values.shape[0] == 1:
            return values.reshape(())
        # counting is faster than a search for one time in a table of a few thousand
        after = jnp.clip(jnp.sum(self.times <= time), 1, len(self.times) - 1)
        begin, end = self.times[after - 1], self.times[after]
        share = jnp.clip((time - begin) / (end - begin), 0.0, 1.0)
        return (1.0 - share) * values[after - 1] + share * values[after]

    def face(self, medium: Medium, inside: Primitive, state: EndState, time: Scalar, area: Scalar) -> TubeFace:
        """Through the opening."""
        return open_face(medium, inside, self.outside(medium.gas, state, time), self.opening, area)


class VesselEnd(End):
    """A rigid vessel, in which inflowing gas comes to rest."""

    volume: Scalar = quantity("m^3", (1e-12, 1e3), "volume", symbol="V", typical=(1e-6, 1e-2))
    pressure_abs: Scalar = quantity("Pa", (1.0, 1e8), "absolute pressure at the start", symbol="P0", default=101325.0)
    temperature: Scalar = quantity("K", (100.0, 2000.0), "temperature at the start", symbol="T0", default=293.15)
    heat: HeatModel = Isothermal()
    opening: Opening = OpenBore()

    def initial(self, gas: Gas) -> EndState:
        """State of the vessel at the start, from its gas."""
        energy = self.pressure_abs * self.volume / (gas.heat_ratio - 1.0)
        return EndState(gas.mass(self.pressure_abs, self.volume, self.temperature), energy, jnp.zeros(()))

    def outside(self, gas: Gas, state: EndState, time: Scalar) -> Primitive:
        """Pressure and temperature in the vessel."""
        pressure = (gas.heat_ratio - 1.0) * state.energy / self.volume
        return Primitive(pressure, jnp.zeros(()), gas.temperature(pressure, self.volume, state.mass))

    def face(self, medium: Medium, inside: Primitive, state: EndState, time: Scalar, area: Scalar) -> TubeFace:
        """Through the opening."""
        return open_face(medium, inside, self.outside(medium.gas, state, time), self.opening, area)

    def rate(self, gas: Gas, state: EndState, face: TubeFace, area: Scalar) -> EndState:
        """Time derivative of the state: inflow of mass and energy, and heat of the wall."""
        zero = jnp.zeros_like(face.mass)
        inside = self.outside(gas, state, 0.0)
        inflow = Inflow(face.mass * area, face.energy * area)
        at = GasState(inside.pressure, inside.temperature, gas)
        rise, heat = self.heat.rates(at, VolumeState(self.volume, zero, zero), inflow)
        return EndState(inflow.mass, self.volume * rise / (gas.heat_ratio - 1.0), heat)

    def least_volume(self) -> Scalar:
        """Volume of the vessel [m^3]."""
        return self.volume

    def heat_is_remainder(self) -> bool:
        """Unless its wall decides on the heat."""
        return not isinstance(self.heat, WallHeat)
