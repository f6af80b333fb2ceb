"""Nodes of a circuit: reservoirs whose pressure is given, and volumes whose pressure follows from what enters them.

Every node keeps mass and pressure; the temperature follows from the gas law. With V(L, P') a moving volume,

    adiabatic and wall:  dP/dt (V + gamma P dV/dP) = (gamma - 1)(sum H + Q) - gamma P dV/dL dL/dt
    isothermal:          dP/dt (V + P dV/dP) = R T sum w - P dV/dL dL/dt
    polytropic:          dP/dt (V + n P dV/dP) = n (R T sum w - P dV/dL dL/dt)

so that mass closes to rounding whatever the heat does, and the heat that keeps a temperature is reported and not assumed.
Range: slow changes are isothermal (tens of seconds in a small volume), fast ones adiabatic (1 to 6 bar ends at 393 K); a
wall with 0.05-1 W/K lies between. n between 1 and gamma is an average of a whole stroke.
"""

from __future__ import annotations

import abc
from collections.abc import Callable
from typing import Any, NamedTuple

from .._jax import jax, jit, jnp
from ..components import AbstractVar, Module, Scalar, field
from ..components.flow import GasState
from ..components.programs import evaluated
from ..quantities import quantity


class VolumeState(NamedTuple):
    """A volume at one moment: value [m^3], dV/dP [m^3/Pa], and the rate at which motion alone changes it [m^3/s]."""

    value: Scalar
    per_pressure: Scalar
    moving: Scalar


class Inflow(NamedTuple):
    """Flow into a volume: mass [kg/s] and enthalpy [W]."""

    mass: Scalar
    enthalpy: Scalar


class HeatModel(Module):
    """Turns inflow and motion into a pressure rate and a heat flow."""

    @abc.abstractmethod
    def rates(self, at: GasState, volume: VolumeState, inflow: Inflow) -> tuple[Scalar, Scalar]:
        """Pressure rate [Pa/s] and heat into the gas [W]."""


def _heat(at: GasState, rate: Any, volume: VolumeState, inflow: Inflow) -> Scalar:
    """Heat that the energy balance then requires [W]: Q = dU/dt - sum H + P dV/dt."""
    p: Any = at.pressure_abs
    change = volume.moving + volume.per_pressure * rate
    stored = (volume.value * rate + p * change) / (at.gas.heat_ratio - 1.0)
    heat: Scalar = stored - inflow.enthalpy + p * change
    return heat


class Isothermal(HeatModel):
    """The gas stays at the temperature it has."""

    def rates(self, at: GasState, volume: VolumeState, inflow: Inflow) -> tuple[Scalar, Scalar]:
        """Pressure rate [Pa/s] and heat into the gas [W]."""
        drive = at.gas.gas_constant * at.temperature * inflow.mass - at.pressure_abs * volume.moving
        rate = drive / (volume.value + at.pressure_abs * volume.per_pressure)
        return rate, _heat(at, rate, volume, inflow)


class Polytropic(HeatModel):
    """P V^n is constant for a closed volume."""

    exponent: Scalar = quantity("1", (1.0, 1.67), "polytropic exponent", symbol="n", default=1.2)

    def rates(self, at: GasState, volume: VolumeState, inflow: Inflow) -> tuple[Scalar, Scalar]:
        """Pressure rate [Pa/s] and heat into the gas [W]."""
        drive = at.gas.gas_constant * at.temperature * inflow.mass - at.pressure_abs * volume.moving
        rate = self.exponent * drive / (volume.value + self.exponent * at.pressure_abs * volume.per_pressure)
        return rate, _heat(at, rate, volume, inflow)


class WallHeat(HeatModel):
    """Heat in proportion to the difference from the wall's temperature; adiabatic with a conductance of zero."""

    conductance: Scalar = quantity(
        "W/K", (0.0, 1e4), "heat conductance to the wall", symbol="hA", typical=(1e-2, 5.0), default=0.0
    )
    wall_temperature: Scalar = quantity("K", (200.0, 500.0), "temperature of the wall", symbol="Tw", default=293.15)

    def rates(self, at: GasState, volume: VolumeState, inflow: Inflow) -> tuple[Scalar, Scalar]:
        """Pressure rate [Pa/s] and heat into the gas [W]."""
        heat = self.conductance * (self.wall_temperature - at.temperature)
        gamma = at.gas.heat_ratio
        drive = (gamma - 1.0) * (inflow.enthalpy + heat) - gamma * at.pressure_abs * volume.moving
        rate = drive / (volume.value + gamma * at.pressure_abs * volume.per_pressure)
        return rate, heat + jnp.zeros_like(rate)


def adiabatic() -> WallHeat:
    """Return a wall without heat transfer."""
    return WallHeat(conductance=0.0)


# ---- nodes


class Reservoir(Module):
    """A node of given pressure and temperature: a supply, the atmosphere, or a measured pressure."""

    pressure_abs: Scalar = quantity("Pa", (0.0, 1e8), "absolute pressure", symbol="P", default=101325.0)
    temperature: Scalar = quantity("K", (100.0, 1000.0), "temperature", symbol="T", default=293.15)
    # Name of a signal that gives the absolute pressure instead [Pa].
    signal: str | None = field(static=True, kw_only=True, default=None)


class Junction(Reservoir):
    """A node of another circuit, as seen from this one: the input of its signal is a `GasState`."""


class Chamber(Module):
    """A node that stores gas."""

    heat: AbstractVar[HeatModel]
    # Name of the signal of its length, where it moves [m].
    signal: AbstractVar[str | None]

    @abc.abstractmethod
    def volume_state(self, pressure_abs: Scalar, length: Scalar, velocity: Scalar) -> VolumeState:
        """The volume at an absolute pressure [Pa], a length [m] and its rate [m/s]."""


class FixedVolume(Chamber):
    """A rigid vessel."""

    volume: Scalar = quantity("m^3", (1e-12, 1e3), "volume", symbol="V", typical=(1e-6, 1e-2))
    heat: HeatModel = Isothermal()
    signal: str | None = field(static=True, kw_only=True, default=None)

    def volume_state(self, pressure_abs: Scalar, length: Scalar, velocity: Scalar) -> VolumeState:
        """Constant."""
        zero = jnp.zeros_like(pressure_abs * 1.0)
        return VolumeState(self.volume + zero, zero, zero)


class CompliantVolume(Chamber):
    """A compliant volume: V = V0 + c P' + s x (1 - k x/2), of a bellows, a hose, or a muscle known from a record only.

    P' is the gauge pressure and x the value of its signal, such as a stroke [m] or the angle of a joint [rad], for which
    `swept` is the volume per unit. A muscle sweeps less the shorter it is: with k, `saturation`, nothing from x = 1/k on.
    Range: where V is close to that in P' and x; never below a tenth of V0.
    """

    volume: Scalar = quantity("m^3", (1e-12, 1e3), "volume at rest", symbol="V0", typical=(1e-6, 1e-2))
    compliance: Scalar = quantity(
        "m^3/Pa", (0.0, 1e-3), "volume per pressure", symbol="c", typical=(1e-13, 1e-9), default=0.0
    )
    swept: Scalar = quantity(
        "m^3", (-1e3, 1e3), "volume per unit of the signal", symbol="s", typical=(1e-6, 1e-2), default=0.0
    )
    saturation: Scalar = quantity(
        "1", (0.0, 1e6), "share by which the swept volume falls off, per unit of the signal", symbol="k", default=0.0
    )
    ambient: Scalar = quantity("Pa", (0.0, 1e7), "absolute pressure outside", symbol="P0", default=101325.0)
    heat: HeatModel = Isothermal()
    signal: str | None = field(static=True, kw_only=True, default=None)

    def volume_state(self, pressure_abs: Scalar, length: Scalar, velocity: Scalar) -> VolumeState:
        """Linear in the pressure and quadratic in the signal, with a floor."""
        fallen = jnp.minimum(self.saturation * length, 1.0)
        beyond = self.saturation * length > 1.0
        reach = jnp.where(beyond, 0.5 / jnp.where(beyond, self.saturation, 1.0), length * (1.0 - 0.5 * fallen))
        value = self.volume + self.compliance * (pressure_abs - self.ambient) + self.swept * reach
        low = value < 0.1 * self.volume
        free = jnp.where(low, 0.0, 1.0)
        rate = free * self.swept * (1.0 - fallen) * velocity
        return VolumeState(jnp.where(low, 0.1 * self.volume, value), free * self.compliance, rate)


class MovingVolume(Chamber):
    """A volume V(L, P') such as a muscle's, with both partial derivatives.

    `of` is a function of length [m] and gauge pressure [Pa], such as ``law.braid_volume``; fittings add their `dead_volume`.
    """

    of: Callable[[Any, Any], Any] = field(kw_only=True)
    ambient: Scalar = quantity("Pa", (0.0, 1e7), "absolute pressure outside", symbol="P0", default=101325.0)
    dead_volume: Scalar = quantity("m^3", (0.0, 1.0), "volume of the fittings", typical=(1e-7, 1e-3), default=0.0)
    heat: HeatModel = Isothermal()
    signal: str | None = field(static=True, kw_only=True, default="length")

    def volume_state(self, pressure_abs: Scalar, length: Scalar, velocity: Scalar) -> VolumeState:
        """Value and derivatives by one forward tangent each."""
        gauge = pressure_abs - self.ambient
        length, gauge = jnp.broadcast_arrays(jnp.asarray(length, float), jnp.asarray(gauge, float))
        value, per_pressure = jax.jvp(lambda p: self.of(length, p), (gauge,), (jnp.ones_like(gauge),))
        per_length = jax.jvp(lambda x: self.of(x, gauge), (length,), (jnp.ones_like(length),))[1]
        return VolumeState(value + self.dead_volume, per_pressure, per_length * velocity)


class MuscleGas(MovingVolume):
    """The gas of a muscle in the circuit of a machine: its law stands with the muscle, and the room with the environment."""

    of: Callable[[Any, Any], Any] | None = field(static=True, kw_only=True, default=None)  # type: ignore[assignment]
    ambient: Any = quantity("Pa", (0.0, 1e7), "absolute pressure outside", symbol="P0", default=None)

    def within(self, of: Callable[[Any, Any], Any], ambient: Scalar) -> MovingVolume:
        """The volume by a law in a room at an absolute pressure [Pa]."""
        return MovingVolume(of=of, ambient=ambient, dead_volume=self.dead_volume, heat=self.heat, signal=self.signal)

    def volume_state(self, pressure_abs: Scalar, length: Scalar, velocity: Scalar) -> VolumeState:
        """Not known here.

        Raises:
            TypeError: always; see `within`.
        """
        raise TypeError("the circuit of a machine does not know the volumes of its muscles; Machine.joined does")


@evaluated
@jit  # traced once for all that asks for it
def volume_of(node: Chamber, pressure_abs: Scalar, length: Scalar, velocity: Scalar) -> VolumeState:
    """`Chamber.volume_state`."""
    return node.volume_state(pressure_abs, length, velocity)
