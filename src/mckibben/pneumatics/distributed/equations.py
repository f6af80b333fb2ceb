"""State and wave relations of gas in a tube of constant section.

    d/dt (rho, rho u, rho E) + d/dx (rho u, rho u^2 + P, u (rho E + P)) = (0, -lambda rho u, 4 q/D)
    E = cv T + u^2/2,   P = rho R T

(eqs. 14-15 in one dimension, with the sign of the pressure work corrected: energy leaves by P u; the wall enters by the
friction rate lambda [1/s] and the heat flux q [W/m2] into the gas). A simple wave that reaches an end carries

    u + 2 c/(gamma - 1) = const,  P ~ c^(2 gamma/(gamma - 1))      or, at constant temperature,      u + c ln P = const.

With an isothermal wall the temperature is that of the wall at all times, and sound moves at sqrt(R T).
Range: ideal gas, flow uniform over the section, any Mach number. Source: E. F. Toro, Riemann Solvers and Numerical
Methods for Fluid Dynamics, 3rd ed., 2009, chapters 1 and 3.
"""

from __future__ import annotations

from typing import NamedTuple

from ..._jax import jnp
from ...components import Module, Scalar, field
from ..gas import AIR, Gas


class Conserved(NamedTuple):
    """Conserved quantities in each cell, per volume; arrays of shape (cells,)."""

    density: Scalar  # [kg/m^3]
    momentum: Scalar  # [kg/(m^2 s)]
    energy: Scalar  # total, [J/m^3]


class Primitive(NamedTuple):
    """Measurable quantities of the same state."""

    pressure: Scalar  # absolute, static [Pa]
    velocity: Scalar  # [m/s]
    temperature: Scalar  # static [K]


class Medium(Module):
    """The gas and whether its temperature is held by the wall."""

    gas: Gas = AIR
    isothermal: bool = field(static=True, default=False)

    def primitive(self, state: Conserved) -> Primitive:
        """Pressure, velocity and temperature of conserved quantities."""
        velocity = state.momentum / state.density
        temperature = (state.energy / state.density - 0.5 * velocity**2) / self.gas.cv
        return Primitive(state.density * self.gas.gas_constant * temperature, velocity, temperature)

    def conserved(self, state: Primitive) -> Conserved:
        """Conserved quantities of a measured state."""
        density = self.gas.density(state.pressure, state.temperature)
        energy = density * (self.gas.cv * state.temperature + 0.5 * state.velocity**2)
        return Conserved(density, density * state.velocity, energy)

    def total_enthalpy(self, state: Primitive) -> Scalar:
        """Enthalpy and kinetic energy, cp T + u^2/2 [J/kg]."""
        return self.gas.cp * state.temperature + 0.5 * state.velocity**2

    def at_rest(self, state: Primitive) -> Primitive:
        """The state brought to rest without loss: total pressure and temperature."""
        kinetic = 0.5 * state.velocity**2
        still = jnp.zeros_like(kinetic)
        if self.isothermal:
            rise = jnp.exp(kinetic / (self.gas.gas_constant * state.temperature))
            return Primitive(state.pressure * rise, still, state.temperature)
        gamma = self.gas.heat_ratio
        ratio = 1.0 + kinetic / (self.gas.cp * state.temperature)
        return Primitive(state.pressure * ratio ** (gamma / (gamma - 1.0)), still, state.temperature * ratio)

    def sound_speed(self, temperature: Scalar) -> Scalar:
        """Speed of small waves [m/s]; isothermal waves are slower by the root of gamma."""
        ratio = 1.0 if self.isothermal else self.gas.heat_ratio
        return jnp.sqrt(ratio * self.gas.gas_constant * temperature)

    def wave_state(self, inside: Primitive, speed: Scalar) -> Primitive:
        """State behind a wave that brings gas of state ``inside``, moving towards the end, to a speed [m/s]."""
        sound = self.sound_speed(inside.temperature)
        if self.isothermal:
            pressure = inside.pressure * jnp.exp((inside.velocity - speed) / sound)
            return Primitive(pressure, speed, inside.temperature)
        gamma = self.gas.heat_ratio
        ratio = jnp.maximum(1.0 + 0.5 * (gamma - 1.0) * (inside.velocity - speed) / sound, 1e-2)
        pressure = inside.pressure * ratio ** (2.0 * gamma / (gamma - 1.0))
        return Primitive(pressure, speed, inside.temperature * ratio**2)

    def choked_exit_speed(self, inside: Primitive) -> Scalar:
        """Speed at which gas of state ``inside`` leaves at the speed of sound, or its own if that is higher [m/s]."""
        sound = self.sound_speed(inside.temperature)
        if self.isothermal:
            return jnp.maximum(sound, inside.velocity)
        gamma = self.gas.heat_ratio
        sonic = ((gamma - 1.0) * inside.velocity + 2.0 * sound) / (gamma + 1.0)
        return jnp.maximum(sonic, inside.velocity)

    def nozzle(self, pressure: Scalar, temperature: Scalar, wall_temperature: Scalar, speed: Scalar) -> Primitive:
        """State of gas drawn without loss out of rest at a pressure [Pa] and temperature [K] to a speed [m/s]."""
        if self.isothermal:
            fall = jnp.exp(-0.5 * speed**2 / (self.gas.gas_constant * wall_temperature))
            return Primitive(pressure * fall, speed, wall_temperature)
        gamma = self.gas.heat_ratio
        ratio = 1.0 - 0.5 * speed**2 / (self.gas.cp * temperature)
        return Primitive(pressure * ratio ** (gamma / (gamma - 1.0)), speed, temperature * ratio)

    def choked_entry_speed(self, temperature: Scalar, wall_temperature: Scalar) -> Scalar:
        """Highest speed at which gas at rest enters [m/s]."""
        if self.isothermal:
            return self.sound_speed(wall_temperature)
        gamma = self.gas.heat_ratio
        return jnp.sqrt(2.0 / (gamma + 1.0)) * self.sound_speed(temperature)
