"""The tube study's fixed waveforms, and the distributed tube's answer to them, which stands in for the measured pressures.

100 cm of 1/8 in tube from a given pressure into an accumulator of 10 in3 or 3 in3. The paper does not say which pressures
its valve gave, so the study has its own: all between 0 and 5 bar gauge, on a clock of 1 kHz, 3 s long, straight between
samples, fixed by whole-number seeds and equal on every machine.

* noise: sines of equal amplitude at every multiple of 1/3 Hz up to 6 Hz, their phases from the seed, moved and stretched
  so that the samples reach from 0 to 5 bar exactly.
* steps: from 0 bar to 1, 3 and 5 bar and back, each edge in 5 ms; the order and the times between come from the seed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..components import Environment
from ..experiments.waveforms import MultiSine, Table
from ..experiments.waveforms.random import uniform
from ..quantities import with_unit

LENGTH, DIAMETER = 1.0, 3.175e-3  # 100 cm of 1/8 in tube [m]
AREA = 0.25 * np.pi * DIAMETER**2  # its bore [m^2]
ACCUMULATORS = {"10in3": 164e-6, "3in3": 49e-6}  # [m^3]
LARGE, SMALL = ACCUMULATORS  # fitted on the first, transferred to the second

PERIOD, DURATION = 1e-3, 3.0  # clock and length of a record [s]
TOP = 5e5  # highest gauge pressure [Pa]
LEVELS = (1e5, 3e5, 5e5)  # of the steps [Pa]
CUTOFF = 6.0  # of the noise [1/s]
EDGE = 5e-3  # of a step [s]
FIRST = 0.1  # rest before the first step [s]
SEEDS = (1, 2)

THERMALS = ("isothermal", "adiabatic", "wall_heat")
CONDUCTANCE = 0.3  # from the large accumulator's gas to its wall, where there is wall heat [W/K]
CELLS = 25  # of the reference; 50 give a vessel pressure within 1 Pa rms of it

Wave = MultiSine | Table


class Record(NamedTuple):
    """What drives the tube: gauge pressure in front of it [Pa], over samples of `PERIOD`."""

    name: str
    kind: str
    seed: int
    wave: Wave

    def pressure_abs(self) -> np.ndarray:
        """Absolute pressure [Pa], (samples,)."""
        return float(Environment().pressure_abs) + np.clip(self.wave.at(clock()), 0.0, TOP)

    def sentence(self) -> str:
        """In words."""
        if isinstance(self.wave, Table):
            levels = ", ".join(with_unit(v, "Pa") for v in self.wave.values[2::4])
            times = ", ".join(f"{t:.3f}" for t in self.wave.times[1::2])
            return f"steps from 0 bar to {levels} and back, at {times} s, edges of {1e3 * EDGE:g} ms, seed {self.seed}"
        count = len(self.wave.frequencies)
        top = with_unit(TOP, "Pa")
        return f"noise, {count} sines of random phase up to {CUTOFF:g} Hz, between 0 bar and {top}, seed {self.seed}"


def clock() -> np.ndarray:
    """Times of the samples [s]."""
    return PERIOD * np.arange(round(DURATION / PERIOD) + 1)


def records(seeds: tuple[int, ...] = SEEDS) -> list[Record]:
    """The records of some seeds: noise first, then steps."""
    return [
        *(Record(f"noise {seed}", "noise", seed, noise(seed)) for seed in seeds),
        *(Record(f"steps {seed}", "steps", seed, steps(seed)) for seed in seeds),
    ]


def noise(seed: int) -> MultiSine:
    """Band-limited noise between 0 and `TOP` gauge [Pa]."""
    count = round(CUTOFF * DURATION)
    wave = MultiSine(
        amplitude=1.0,
        frequencies=tuple(k / DURATION for k in range(1, count + 1)),
        phases=tuple(2.0 * np.pi * uniform(seed, np.arange(count))),
    )
    values = wave.at(clock())
    stretch = TOP / (values.max() - values.min())
    return MultiSine(mean=-stretch * values.min(), amplitude=stretch, frequencies=wave.frequencies, phases=wave.phases)


def steps(seed: int) -> Table:
    """Steps to each of the `LEVELS` and back [Pa]."""
    drawn = uniform(seed, np.arange(3 * len(LEVELS)))
    order = np.argsort(drawn[: len(LEVELS)], kind="stable")
    holds = 1.0 + drawn[len(LEVELS) :]  # the longest lasts at most twice the shortest
    starts = FIRST + (DURATION - FIRST) * np.concatenate([[0.0], np.cumsum(holds)[:-1]]) / np.sum(holds)
    edges = np.round(starts / PERIOD) * PERIOD
    times, values = [0.0], [0.0]
    for i, at in enumerate(edges):
        times += [float(at), float(at + EDGE)]
        values += [values[-1], 0.0 if i % 2 else LEVELS[order[i // 2]]]
    return Table(times=tuple(times), values=tuple(values))


def surface_share(volume: float) -> float:
    """Surface of a vessel over that of the large accumulator of the same shape; volume [m^3]."""
    return float((volume / ACCUMULATORS[LARGE]) ** (2.0 / 3.0))


class Answer(NamedTuple):
    """Pressure in the vessel behind the distributed tube [Pa], and the hottest gas in it [K]."""

    pressure_abs: np.ndarray
    hottest: float


def reference(pressure_abs: np.ndarray, volume: float, thermal: str) -> Answer:
    """What the distributed tube makes of a record.

    Args:
        pressure_abs: in front of the tube [Pa], on the clock.
        volume: of the accumulator [m^3].
        thermal: ``isothermal``, ``adiabatic`` or ``wall_heat``, for the tube's wall and for the vessel's alike.
    """
    from ..pneumatics.distributed import DistributedTube, ReservoirEnd, VesselEnd, simulate
    from ..pneumatics.heat import Isothermal, WallHeat

    conductance = CONDUCTANCE * surface_share(volume) if thermal == "wall_heat" else 0.0
    start = float(pressure_abs[0])
    result = simulate(
        DistributedTube(length=LENGTH, diameter=DIAMETER, cells=CELLS, wall=thermal),
        ReservoirEnd(pressure_abs=pressure_abs, times=clock()),
        VesselEnd(
            volume=volume,
            pressure_abs=start,
            heat=Isothermal() if thermal == "isothermal" else WallHeat(conductance=conductance),
        ),
        duration=DURATION,
        sample_period=PERIOD,
        pressure_abs=start,
    )
    return Answer(np.asarray(result.right.outside_pressure), float(np.max(result.right.outside_temperature)))
