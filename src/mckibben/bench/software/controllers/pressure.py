"""Pressure of a muscle by the electro-valve: the set-point goes to the valve, an integral corrects what remains.

    u = r + I,   dI/dt = ki (r - p),   |I| <= trim limit

The valve is itself a regulator. The paper's machine sent it the set-point only (part II and III of the report); ki = 0 does
the same. The limit of the trim is its anti-windup: during a step the muscle lags, and what the valve will reach by
itself is not to be added again. Range: stable for ki below about 0.4/(dead time and lag of valve, tube and sensor).
"""

from __future__ import annotations

from typing import Any

from ....components import Module, Scalar
from ....quantities import quantity
from .trim import TrimState, bounded, first_trim, next_trim


class PressureControl(Module):
    """Feedforward with an integral trim, bounded by what the valve can be asked for; pressures are gauge."""

    ki: Scalar = quantity("1/s", (0.0, 1e4), "integral gain of the pressure", default=0.0)
    trim_limit: Scalar = quantity("Pa", (0.0, 1e7), "largest correction of the set-point", default=5e4)
    low: Scalar = quantity("Pa", (-1e5, 1e7), "least pressure asked of the valve", default=0.0)
    high: Scalar = quantity("Pa", (1.0, 1e8), "largest pressure asked of the valve", default=1e6)

    def initial(self) -> TrimState:
        """Without a trim."""
        return first_trim()

    def step(
        self, state: TrimState, set_point: Any, pressure: Any, dt: Any, active: Any = 1.0
    ) -> tuple[TrimState, Scalar]:
        """One sample: the new state and the pressure asked of the valve [Pa].

        Args:
            state: of `initial` or of the sample before.
            set_point: of the pressure [Pa].
            pressure: measured [Pa].
            dt: sampling period [s].
            active: 1 while the pressure is controlled, 0 while the muscle is shut off.
        """
        wanted = set_point + state.trim
        growth = self.ki * dt * (set_point - pressure)
        after = next_trim(state, growth, active, wanted=wanted, low=self.low, high=self.high, limit=self.trim_limit)
        return after, bounded(wanted, self.low, self.high)
