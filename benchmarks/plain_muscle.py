"""The muscle of `cases.tube` as one writes it in plain Python for SciPy: a right-hand side of six numbers.

Friction is Dahl's as a rate, dz/dt = v - |v| z/d(P), held on its limit where that shrinks under it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any


def ramp(x: float, width: float) -> tuple[float, float, float]:
    """The rounded ramp with slope and bend."""
    y = x / width + 0.5
    if y >= 1.0:
        return x, 1.0, 0.0
    if y <= 0.0:
        return 0.0, 0.0, 0.0
    value = width * y**5 * (7.0 + y * (-14.0 + y * (10.0 - 2.5 * y)))
    slope = y**4 * (35.0 + y * (-84.0 + y * (70.0 - 20.0 * y)))
    return value, slope, 140.0 * (y * (1.0 - y)) ** 3 / width


def rate_of(n: Mapping[str, float], supply: Callable[[float], float]) -> Callable[[float, Any], list[float]]:
    """The right-hand side for parameters by the kernel's names and a supply's absolute pressure over time [Pa]."""
    kg, shortest, rest, upper = n["per_pressure"], n["shortest"], n["rest"], n["upper"]
    passive, stop, threshold, width = n["passive"], n["stop"], n["threshold"], n["width"]
    braid0 = n["rest_volume"] + 0.5 * kg * (rest - shortest) ** 2
    upper_volume = braid0 - 0.5 * kg * (upper - shortest) ** 2
    bladder, room_width, dead = 0.6 * upper_volume, 0.8 * upper_volume, n["dead"]
    mass, viscosity, stop_damping, travel = n["mass"], n["viscosity"], n["stop_damping"], n["stop_travel"]
    k, slack, toe_length, loss, span = n["cord_stiffness"], n["cord_slack"], n["cord_toe"], n["cord_loss"], n["span"]
    limit, per_pressure, contact = n["limit"], n["limit_per_pressure"], n["contact"]
    gas, gamma, ambient, conductance, wall = (
        n["gas_constant"],
        n["heat_ratio"],
        n["ambient"],
        n["conductance"],
        n["wall"],
    )
    supply_rt, r1, r2, area, length_of_tube = (
        gas * n["supply_temperature"],
        n["viscous"],
        n["turbulent"],
        n["tube_area"],
        n["tube_length"],
    )

    def rate(time: float, y: Any) -> list[float]:
        length, v, p, m, w, z = y
        source, gauge, d = supply(time), p - ambient, length - shortest
        room, room1, _ = ramp(braid0 - 0.5 * kg * d * d - bladder, room_width)
        carried, carried1, carried2 = ramp(gauge - threshold, width)
        volume = bladder + carried1 * room + dead
        slope = kg * d * room1
        over = max(length - upper, 0.0)
        tension = passive * (length - rest) + stop * over * over + carried * slope
        stretch = span - slack - length
        toe = min(max(stretch, 0.0), toe_length)
        pull = k * (0.5 * toe * toe / toe_length + max(stretch - toe_length, 0.0)) * max(1.0 - loss * v, 0.0)
        damping = viscosity + stop_damping * min(over / travel, 1.0) ** 2
        yielded = (limit + per_pressure * max(gauge, 0.0)) / contact
        held = min(max(z, -yielded), yielded)
        rt = p * volume / m
        passing = supply_rt if w >= 0.0 else rt
        speed = 2.0 * w * passing / ((source + p) * area)
        heat = conductance * (wall - rt / gas)
        dp = gamma * (w * passing + p * carried1 * slope * v) + (gamma - 1.0) * heat
        dp /= volume + gamma * p * carried2 * room
        dz = v - abs(v) * held / yielded
        if abs(z) >= yielded:
            grows = per_pressure * dp / contact if gauge > 0.0 else 0.0
            dz = min(dz, grows) if z > 0.0 else max(dz, -grows)
        dw = (source - p - r1 * speed - r2 * speed * abs(speed)) * area / length_of_tube
        return [v, (pull - tension - contact * held - damping * v) / mass, dp, w, dw, dz]

    return rate
