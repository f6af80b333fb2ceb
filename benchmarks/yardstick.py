"""The yardstick S1: three states, the same numbers for every program that is compared.

    V = L (b^2 - L^2)/(4 pi n^2),   F = -(P - P0) dV/dL,   m dv/dt = F - m g - c v + k max(-x, 0),   L = L0 - x
    dP/dt = n (R T w - P dV/dt)/V,   w = u C rho0 p1 psi(p2/p1)       fills for u = sin(2 pi t) above zero, else vents

x is the contraction [m]. Its root has an infinite slope at equal pressures; here it is rounded over 1 Pa, as the library
rounds every orifice. From rest at P0 + 1000 Pa. `reference` is the exact root, integrated by Radau.
"""

from __future__ import annotations

from typing import Any

import jax.numpy as jnp
import numpy as np

from mckibben.components import Scalar
from mckibben.components.flow import GasState
from mckibben.components.gas import REFERENCE_TEMPERATURE
from mckibben.components.module import derivative
from mckibben.components.system import Moment, System
from mckibben.muscles import braid
from mckibben.pneumatics.orifice import Orifice, opening_flow

NUMBERS = {
    "rest": 0.25, "thread": 0.30, "turns": 1.6, "mass": 5.0, "damping": 60.0, "stop": 2e4, "gravity": 9.81, "supply": 7e5,
    "room": 101325.0, "gas_constant": 287.0, "temperature": 293.0, "exponent": 1.2,
}  # fmt: skip
CONDUCTANCE, RATIO, DENSITY, BAND = 3e-9, 0.3, 1.185, 1.0
TOLERANCES = (1e-3, 1e-4, 1e-5, 1e-6, 1e-7)  # of programs that choose their steps
START = (0.0, 0.0, NUMBERS["room"] + 1000.0)  # contraction [m], its rate [m/s], absolute pressure [Pa]


class Yardstick(System):
    """S1 with the library's own braid and orifice."""

    rest: Scalar
    thread: Scalar
    turns: Scalar
    mass: Scalar
    damping: Scalar
    stop: Scalar
    gravity: Scalar
    supply: Scalar
    room: Scalar
    gas_constant: Scalar
    temperature: Scalar
    exponent: Scalar
    valve: Orifice

    def rate(self, state: Any, memory: Any, inputs: Any) -> Any:
        """Rates of contraction, velocity and pressure."""
        x, v, p = state
        u = inputs["valve"].value
        volume = lambda length: braid.volume(length, thread_length=self.thread, turns=self.turns)  # noqa: E731
        length = self.rest - x
        per_length = derivative(volume, length)
        fills = u >= 0.0
        # one temperature throughout: that of the reference atmosphere leaves the conductance as it is
        a = GasState(jnp.where(fills, self.supply, p), REFERENCE_TEMPERATURE)
        b = GasState(jnp.where(fills, p, self.room), REFERENCE_TEMPERATURE)
        flow = opening_flow(self.valve, a, b, jnp.abs(u))
        w = jnp.where(fills, flow, -flow)
        push = (self.room - p) * per_length - self.damping * v + self.stop * jnp.maximum(-x, 0.0)
        filling = self.gas_constant * self.temperature * w + p * per_length * v
        return v, push / self.mass - self.gravity, self.exponent * filling / volume(length)

    def integrands(self, state: Any, memory: Any, inputs: Any) -> Any:
        """None."""
        return ()

    def advance_memory(self, memory: Any, start: Moment, end: Moment, duration: Any) -> Any:
        """No memory."""
        return memory

    def outputs(self, state: Any, memory: Any, inputs: Any) -> dict[str, Any]:
        """Contraction [m] and absolute pressure [Pa]."""
        return {"contraction": state[0], "pressure_abs": state[2]}


def yardstick() -> Yardstick:
    """S1 as stated."""
    valve = Orifice(conductance=CONDUCTANCE, critical_ratio=RATIO, linear_band=BAND)
    return Yardstick(**{name: jnp.asarray(value) for name, value in NUMBERS.items()}, valve=valve)


def plain_rate(time: float, y: Any) -> tuple[float, float, float]:
    """The right-hand side as one writes it in plain Python, with the exact root."""
    from math import pi, sin, sqrt

    n = NUMBERS
    x, v, p = y
    length = n["rest"] - x
    per_turn = 1.0 / (4.0 * pi * n["turns"] ** 2)
    volume = length * (n["thread"] ** 2 - length**2) * per_turn
    per_length = (n["thread"] ** 2 - 3.0 * length**2) * per_turn
    u = sin(2.0 * pi * time)
    a, b = (n["supply"], p) if u >= 0.0 else (p, n["room"])
    sign = 1.0 if a >= b else -1.0
    p1, p2 = max(a, b), min(a, b)
    ratio = p2 / p1
    psi = 1.0 if ratio <= RATIO else sqrt(max(1.0 - ((ratio - RATIO) / (1.0 - RATIO)) ** 2, 0.0))
    w = sign * u * CONDUCTANCE * DENSITY * p1 * psi
    push = (n["room"] - p) * per_length - n["damping"] * v + n["stop"] * max(-x, 0.0)
    filling = n["gas_constant"] * n["temperature"] * w + p * per_length * v
    return v, push / n["mass"] - n["gravity"], n["exponent"] * filling / volume


def reference(times: Any) -> np.ndarray:
    """Contraction, velocity and pressure at times [s] by Radau with tolerances of 1e-10, (3, times)."""
    from scipy.integrate import solve_ivp

    span = (0.0, float(times[-1]))
    # in steps that a half wave of the valve's command ends: there the flow has a kink
    found = solve_ivp(plain_rate, span, START, "Radau", times, rtol=1e-10, atol=(1e-13, 1e-12, 1e-6), max_step=5e-3)
    return np.asarray(found.y)
