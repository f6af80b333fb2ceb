"""Ends of the tube: closed, a reservoir whose pressure is given over time, or a rigid vessel."""

from __future__ import annotations

import abc
from typing import NamedTuple

import numpy as np

from ..._jax import Array, jnp
from ...components import Module, Scalar
from ...errors import InputError
from ...quantities import quantity
from ..gas import Gas
from ..heat import HeatModel, Inflow, Isothermal, VolumeState, WallHeat
from .equations import Medium, Primitive
from .openings import OpenBore, Opening, TubeFace, closed_face, open_face


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
        rise, heat = self.heat.rates(
            gas, inside.pressure, inside.temperature, VolumeState(self.volume, zero, zero), inflow
        )
        return EndState(inflow.mass, self.volume * rise / (gas.heat_ratio - 1.0), heat)

    def least_volume(self) -> Scalar:
        """Volume of the vessel [m^3]."""
        return self.volume

    def heat_is_remainder(self) -> bool:
        """Unless its wall decides on the heat."""
        return not isinstance(self.heat, WallHeat)
