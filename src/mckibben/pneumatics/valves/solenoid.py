"""Dynamics of a switching valve: a coil, and a plunger between two stops.

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

from ..._jax import jnp
from ...components import Module, Scalar
from ...quantities import quantity
from .shares import between, share

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
