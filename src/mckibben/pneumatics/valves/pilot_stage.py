"""Pilot stage of a switching valve: a chamber that the inlet fills, and a piston between it and a spring.

    dc/dt = f p/p_r,   f = (1 + W)/(2 dead time of opening)              switched on, until P = p
    dc/dt = -c/tau,    tau = dead time of closing/ln(p_r/(p_s (1 - W)))  switched off
    c = P/(2 p_s)      P the pressure of the chamber, p that of the inlet

The coil of a pilot-operated valve connects the chamber with the inlet or with the room. The piston moves as the flux of a
direct-acting valve makes its plunger move (`mckibben.pneumatics.valves.solenoid`, also of W), with the chamber's pressure in
place of the flux: it opens the valve above the pressure p_s of the spring, and closes it below. The flow through the
pilot's orifice, while it is choked, goes with the pressure upstream: so the dead time of opening is inversely proportional
to the inlet pressure, that of closing goes with the logarithm of the pressure from which the chamber is emptied. At
the rated inlet pressure p_r both are the stated ones. All pressures are absolute.

Range: a choked orifice, thus p_s about twice the pressure of the room; with an inlet pressure below p_s the valve stays
closed. The chamber is isothermal and takes no noticeable gas, the coil no noticeable time. Source: choked flow of ISO
6358-1:2013 into and out of a constant volume.
"""

from __future__ import annotations

from ..._jax import jnp
from ...components import Module, Scalar
from ...quantities import quantity
from .shares import between, share
from .solenoid import WIDTH, Plunger, Solenoid

LEAST = 1e-2  # least logarithm of rated pressure over spring pressure that counts, so that tau stays positive


class PilotStage(Module):
    """Pilot stage that takes its gas from the inlet of the valve."""

    pilot_rated_pressure_abs: Scalar = quantity(
        "Pa",
        (1e4, 1e8),
        "absolute inlet pressure at which a pilot-operated valve has its dead times",
        typical=(2e5, 1.1e6),
    )
    pilot_spring_pressure_abs: Scalar = quantity(
        "Pa",
        (1e4, 1e8),
        "absolute pressure of the pilot chamber at which the spring of a pilot-operated valve gives way",
        typical=(2e5, 5e5),
    )

    def rates(self, drive: Solenoid, state: Plunger, command: Scalar, inlet_abs: Scalar) -> Plunger:
        """Rates of chamber pressure, in the place of the flux, and stroke [1/s], at an absolute inlet pressure [Pa]."""
        on = share(jnp.asarray(command, float))
        full = 0.5 * inlet_abs / self.pilot_spring_pressure_abs
        filling = 0.5 * (1.0 + WIDTH) / drive.opening_dead_time * (inlet_abs / self.pilot_rated_pressure_abs)
        filling = filling * between((full - state.flux) / WIDTH, -1.0, 1.0)
        fall = jnp.log(self.pilot_rated_pressure_abs / (self.pilot_spring_pressure_abs * (1.0 - WIDTH)))
        emptying = state.flux * jnp.maximum(fall, LEAST) / drive.closing_dead_time
        return Plunger(on * filling - (1.0 - on) * emptying, drive.stroke_rate(state))
