"""Dynamics of a switching valve: a coil and a plunger between two stops, with a pilot stage between them or without.

    dc/dt = (u - c)/tau,   tau = dead time/ln(2/(1 - W))            u the command, 0 to 1; of switching on where u > c
    dx/dt = d (1 - S)/T,   d = clip((c - 1/2)/W, -1, 1)             slowed over the last S of the stroke before a stop

The magnetic flux c lags behind the command, and the plunger starts when it has passed half. From rest this is the stated
dead time, one for switching on and one for switching off. A pulse shorter than the dead time moves nothing, and one after
which the flux had no time to settle meets the next command earlier: that is why a fast valve has a dead zone and a
saturation under pulse-width modulation. A pure transport delay, which would only shift every pulse, has neither.

The seat covers the first S of the stroke, so that the valve is wide open one opening time after the plunger started.
Range: constant supply voltage, no bouncing; times are those of a catalogue, measured from rest. Source: the lag of the flux
is that of a coil with resistance and inductance, as in M. Taghizadeh, A. Ghaffari and F. Najafi, Modeling and identification
of a solenoid valve for PWM control applications, Comptes Rendus Mecanique 337, 2009.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from .._jax import jnp
from ..components import Module, Scalar
from ..quantities import quantity


def share(x: Scalar) -> Scalar:
    """A number held to 0 to 1."""
    x = jnp.asarray(x, float)
    return jnp.where(x < 0.0, 0.0, jnp.where(x > 1.0, 1.0, x))


def eased(x: Scalar) -> Scalar:
    """Smooth step from 0 at x = 0 to 1 at x = 1; its slope is at most `EASED_SLOPE`."""
    y = share(x)
    return y * y * (3.0 - 2.0 * y)


EASED_SLOPE = 1.5


def switched(command: Scalar) -> Scalar:
    """Command of what is on or off, 1 above a half and else 0; what is no number stays none."""
    command = jnp.asarray(command, float)
    return jnp.where(command > 0.5, 1.0, jnp.where(command <= 0.5, 0.0, command))


def between(x: Scalar, low: Scalar, high: Scalar) -> Scalar:
    """A number held between two bounds."""
    x = jnp.asarray(x, float)
    return jnp.where(x < low, low, jnp.where(x > high, high, x))


WIDTH = 0.1  # flux beyond one half at which the plunger has its full speed; W above
SEAT = 0.1  # share of the stroke that the seat covers, and over which a stop slows it; S above
HALF = math.log(2.0 / (1.0 - WIDTH))  # time until the middle of that ramp, in time constants


class Plunger(NamedTuple):
    """State of a switching valve: magnetic flux and stroke, both 0 to 1."""

    flux: Scalar
    stroke: Scalar


class Solenoid(Module):
    """Drive of a switching valve."""

    opening_dead_time: Scalar = quantity("s", (2e-5, 1.0), "from switching on to first motion", typical=(1e-3, 2e-2))
    closing_dead_time: Scalar = quantity("s", (2e-5, 1.0), "from switching off to first motion", typical=(1e-3, 2e-2))
    opening_time: Scalar = quantity("s", (1e-4, 10.0), "of the motion from closed to open", typical=(5e-4, 2e-2))
    closing_time: Scalar = quantity("s", (1e-4, 10.0), "of the motion from open to closed", typical=(5e-4, 2e-2))

    def initial(self) -> Plunger:
        """Off and closed."""
        return Plunger(jnp.zeros(()), jnp.zeros(()))

    def rates(self, state: Plunger, command: Scalar) -> Plunger:
        """Rates of flux and stroke [1/s]."""
        wanted = share(jnp.asarray(command, float))
        dead = jnp.where(wanted > state.flux, self.opening_dead_time, self.closing_dead_time)
        return Plunger((wanted - state.flux) * HALF / dead, self.stroke_rate(state))

    def stroke_rate(self, state: Plunger) -> Scalar:
        """Rate of the stroke [1/s], towards the stop to which the flux drives the plunger."""
        drive = between((state.flux - 0.5) / WIDTH, -1.0, 1.0)
        opens = (1.0 - SEAT) / self.opening_time * share((1.0 - state.stroke) / SEAT)
        closes = (1.0 - SEAT) / self.closing_time * share(state.stroke / SEAT)
        return drive * jnp.where(drive >= 0.0, opens, closes)

    def opening(self, state: Plunger) -> Scalar:
        """Share that is open [1]."""
        return share((state.stroke - SEAT) / (1.0 - 2.0 * SEAT))

    def widest(self, state: Plunger, command: Scalar) -> Scalar:
        """The opening it may soon have [1]: of use where a bound is wanted."""
        return jnp.where((jnp.asarray(command) > 0.5) | (state.flux > 0.5), 1.0, self.opening(state))


LEAST = 1e-2  # least logarithm of rated pressure over spring pressure that counts, so that tau stays positive


class PilotStage(Module):
    """Pilot stage that takes its gas from the inlet of the valve.

        dc/dt = f p/p_r,   f = (1 + W)/(2 dead time of opening)              switched on, until P = p
        dc/dt = -c/tau,    tau = dead time of closing/ln(p_r/(p_s (1 - W)))  switched off
        c = P/(2 p_s)      P the pressure of the chamber, p that of the inlet

    The coil of a pilot-operated valve connects the chamber with the inlet or with the room. The piston moves as the
    flux of a direct-acting valve makes its plunger move (W as there), with the
    chamber's pressure in place of the flux: it opens the valve above the pressure p_s of the spring, and closes it
    below. The flow through the pilot's orifice, while it is choked, goes with the pressure upstream: so the dead time
    of opening is inversely proportional to the inlet pressure, that of closing goes with the logarithm of the pressure
    from which the chamber is emptied. At the rated inlet pressure p_r both are the stated ones. All pressures are
    absolute.

    Range: a choked orifice, thus p_s about twice the pressure of the room; with an inlet pressure below p_s the valve
    stays closed. The chamber is isothermal and takes no noticeable gas, the coil no noticeable time. Source: choked
    flow of ISO 6358-1:2013 into and out of a constant volume.
    """

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
