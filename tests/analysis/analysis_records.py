"""Recordings of which every number is known: linear spring with friction, at any clock, noise and number of counts."""

import numpy as np

from mckibben.recordings import Channel, Recording

STIFFNESS, FRICTION = 2300.0, 2.5  # the nylon muscle at 5 bar: N/m, N
MIDDLE, RANGE = 0.13, 0.04  # of the length [m]
PULL = 60.0  # at the middle [N]
COUNT = 100.0 / 256  # of an 8-bit converter over 100 N [N]


def phase(time: np.ndarray, frequency: float, start: float = 0.0) -> np.ndarray:
    """In cycles; 0 is the shortest length."""
    return frequency * time + start


def triangle(cycles: np.ndarray) -> np.ndarray:
    """From -1 at phase 0 to 1 at phase 1/2."""
    return 1.0 - 4.0 * np.abs(np.mod(cycles, 1.0) - 0.5)


def sine(cycles: np.ndarray) -> np.ndarray:
    return -np.cos(2.0 * np.pi * cycles)


def counts(values: np.ndarray, count: float) -> np.ndarray:
    return count * np.round(values / count)


def clock(duration: float, rate: float = 1000.0) -> np.ndarray:
    return np.arange(round(duration * rate) + 1) / rate


def record(time: np.ndarray, **channels: np.ndarray) -> Recording:
    """Channels of the muscle by their last name; `command` is the valve's."""
    units = {"length": "m", "tension": "N", "pressure": "Pa", "command": "1"}
    names = {name: "valve.command" if name == "command" else f"muscle.{name}" for name in channels}
    return Recording(time, {names[n]: Channel(v, units[n], "measured") for n, v in channels.items()})


def coulomb(
    time: np.ndarray,
    *,
    wave=triangle,
    frequency: float = 1.0,
    start: float = 0.0,
    span: float = RANGE,
    low: float = MIDDLE - 0.5 * RANGE,
    friction: float = FRICTION,
    viscosity: float = 0.0,
    lag: float = 0.0,
    noise: float = 0.0,
    count: float = 0.0,
    seed: int = 0,
) -> Recording:
    """A spring with Coulomb friction that turns at once: a parallelogram. The tension comes `lag` late."""

    def state(t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        x = low + 0.5 * span * (1.0 + wave(phase(t, frequency, start)))
        step = 1e-7
        return x, (low + 0.5 * span * (1.0 + wave(phase(t + step, frequency, start))) - x) / step

    length, _ = state(time)
    late, velocity = state(time - lag)
    tension = PULL + STIFFNESS * (late - MIDDLE) + friction * np.sign(velocity) + viscosity * velocity
    tension = tension + np.random.default_rng(seed).normal(0.0, noise, time.size)
    return record(time, length=length, tension=counts(tension, count) if count else tension)
