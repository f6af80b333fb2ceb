"""State and wave relations of gas in a tube of constant section.

    d/dt (rho, rho u, rho E) + d/dx (rho u, rho u^2 + P, u (rho E + P)) = (0, -lambda rho u, 4 q/D)
    E = cv T + u^2/2,   P = rho R T

(eqs. 14-15 in one dimension, with the sign of the pressure work corrected: energy leaves by P u; the wall enters by the
friction rate lambda [1/s] and the heat flux q [W/m2] into the gas). A simple wave that reaches an end carries

    u + 2 c/(gamma - 1) = const,  P ~ c^(2 gamma/(gamma - 1))      or, at constant temperature,      u + c ln P = const.

With an isothermal wall the temperature is that of the wall at all times, and sound moves at sqrt(R T).
Range: ideal gas, flow uniform over the section, any Mach number. Source: E. F. Toro, Riemann Solvers and Numerical
Methods for Fluid Dynamics, 3rd ed., 2009, chapters 1 and 3.

Fluxes between cells: piecewise linear reconstruction and the HLLC approximate Riemann solver.

Pressure, velocity and temperature are reconstructed with van Leer's limiter (second order where the solution is smooth,
monotone at fronts). A steady pipe flow is nearly linear from cell to cell, so that the states on both sides of a face
nearly agree and HLLC dissipates next to nothing there: no correction is needed at low Mach numbers (at Mach 0.05 and 50
cells the steady flow errs by 3e-8).

Sources: E. F. Toro, M. Spruce and W. Speares, Shock Waves 4, 1994, doi:10.1007/BF01414629; wave speeds of S. F. Davis,
SIAM J. Sci. Stat. Comput. 9, 1988, doi:10.1137/0909030; B. van Leer, J. Comput. Phys. 14, 1974,
doi:10.1016/0021-9991(74)90019-9 (limiter), and 32, 1979, doi:10.1016/0021-9991(79)90145-1 (reconstruction).

Friction of developed pipe flow at the wall, and heat transfer.

    dP/dx = -f rho u |u| / (2 D)                                                                 f as in `tubes`
    q = (Nu k/D) (Tw - T - r u^2/(2 cp)),    Nu = 3.66                                              laminar
    Nu = (f/8)(Re - 1000) Pr / (1 + 12.7 sqrt(f/8) (Pr^(2/3) - 1))                                  turbulent (Gnielinski)

Between Re = 2300 and 4000 both f and Nu pass smoothly from one to the other. The recovery factor r = Pr^(1/3) makes the
driving temperature that of an insulated wall. Range: Re below 1e8, roughness up to 5 % of the diameter; steady, developed
flow: the extra friction of fast oscillations and of the first ten to fifty diameters is left out.

Sources: V. Gnielinski, Int. Chem. Eng. 16, 1976;
F. M. White, Fluid Mechanics and Viscous Fluid Flow.
"""

from __future__ import annotations

from typing import NamedTuple

from ..._jax import Array, jnp
from ...components import Module, Scalar, field
from ...components.gas import AIR, Gas
from ..tubes import LAMINAR_END, haaland, turbulence


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


# ---- fluxes between cells


def limited(before: Scalar, after: Scalar) -> Array:
    """Van Leer's slope from the differences to both neighbours: their harmonic mean, or zero at an extremum."""
    product = before * after
    return jnp.where(product > 0.0, 2.0 * product / jnp.where(product > 0.0, before + after, 1.0), 0.0)


def _one_sided(near: Scalar, far: Scalar) -> Array:
    """Slope of an end cell, which has one neighbour: the difference to it, unless the next one contradicts."""
    return jnp.where(near * far > 0.0, jnp.sign(near) * jnp.minimum(jnp.abs(near), 3.0 * jnp.abs(far)), 0.0)


def reconstruct(values: Array) -> tuple[Scalar, Scalar]:
    """Values at the left and at the right face of each cell; shapes (cells,) to twice (cells,)."""
    steps = values[1:] - values[:-1]
    inner = limited(steps[:-1], steps[1:])
    first, last = _one_sided(steps[0], steps[1]), _one_sided(steps[-1], steps[-2])
    half = 0.5 * jnp.concatenate([first[None], inner, last[None]])
    return values - half, values + half


def hllc(medium: Medium, left: Primitive, right: Primitive) -> Conserved:
    """Flux through the face between two states, positive to the right; shapes broadcast.

    Returns:
        Flux of mass [kg/(m2 s)], momentum [Pa] and energy [W/m2].
    """
    gas = medium.gas
    sound_left, sound_right = medium.sound_speed(left.temperature), medium.sound_speed(right.temperature)
    slowest = jnp.minimum(left.velocity - sound_left, right.velocity - sound_right)
    fastest = jnp.maximum(left.velocity + sound_left, right.velocity + sound_right)
    inflow_left = gas.density(left.pressure, left.temperature) * (slowest - left.velocity)
    inflow_right = gas.density(right.pressure, right.temperature) * (fastest - right.velocity)
    contact = (right.pressure - left.pressure + left.velocity * inflow_left - right.velocity * inflow_right) / (
        inflow_left - inflow_right
    )
    # The side from which the contact moves away, and its outer wave.
    from_left = contact >= 0.0
    pressure, velocity, temperature = (jnp.where(from_left, a, b) for a, b in zip(left, right, strict=True))
    wave = jnp.where(from_left, slowest, fastest)
    inflow = jnp.where(from_left, inflow_left, inflow_right)
    supersonic = jnp.where(from_left, slowest >= 0.0, fastest <= 0.0)

    between = jnp.where(supersonic, velocity, contact)
    density = inflow / (wave - between)
    star_pressure = pressure + inflow * (between - velocity)
    mass = density * between
    energy = gas.cv * temperature + 0.5 * velocity**2
    # rho* E* = rho* (E + (S* - u)(S* + P/(rho (S - u))))
    star_energy = density * (energy + (between - velocity) * (between + pressure / inflow))
    return Conserved(mass, mass * between + star_pressure, between * (star_energy + star_pressure))


# ---- the wall: friction and heat


WALLS = ("isothermal", "adiabatic", "wall_heat")
PRANDTL = 0.71
LAMINAR_NUSSELT = 3.66  # developed flow, constant wall temperature


class WallRates(NamedTuple):
    """Effect of the wall on the gas, per cell."""

    friction: Scalar  # lambda [1/s]: the momentum decays at this rate
    heating: Scalar  # heat given to the gas [W/m^3]
    exchange: Scalar  # rate at which the temperature approaches the wall's [1/s]


def nusselt(reynolds_number: Scalar, relative_roughness: Scalar) -> Scalar:
    """Nusselt number of a wall at constant temperature, at any Reynolds number."""
    share = turbulence(reynolds_number)
    re = jnp.maximum(reynolds_number, LAMINAR_END)
    eighth = haaland(re, relative_roughness) / 8.0
    turbulent = eighth * (re - 1000.0) * PRANDTL / (1.0 + 12.7 * jnp.sqrt(eighth) * (PRANDTL ** (2.0 / 3.0) - 1.0))
    nusselt: Scalar = (1.0 - share) * LAMINAR_NUSSELT + share * turbulent
    return nusselt


def wall_rates(
    gas: Gas,
    state: Primitive,
    *,
    diameter: Scalar,
    roughness: Scalar,
    wall_temperature: Scalar,
    friction_scale: Scalar,
    heat: bool,
) -> WallRates:
    """Friction and heat of cells of shape (cells,); lengths [m], temperature [K].

    Written per speed, so that it is finite at rest: f |u|/(2 D) is 32 mu/(rho D^2) in laminar flow.
    """
    density, viscosity = gas.density(state.pressure, state.temperature), gas.viscosity(state.temperature)
    speed = jnp.abs(state.velocity)
    re = density * speed * diameter / viscosity
    share, rough = turbulence(re), roughness / diameter
    factor = haaland(re, rough)
    laminar = 32.0 * viscosity / (density * diameter**2)
    friction = friction_scale * ((1.0 - share) * laminar + share * factor * speed / (2.0 * diameter))
    if not heat:
        return WallRates(friction, jnp.zeros_like(speed), jnp.zeros_like(speed))
    conductance = 4.0 * nusselt(re, rough) * gas.conductivity(state.temperature) / diameter**2  # [W/(m^3 K)]
    recovered = state.temperature + PRANDTL ** (1.0 / 3.0) * state.velocity**2 / (2.0 * gas.cp)
    return WallRates(friction, conductance * (wall_temperature - recovered), conductance / (density * gas.cv))
