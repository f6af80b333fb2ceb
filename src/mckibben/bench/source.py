"""Where the samples of a run come from: a simulation in its own time, or a loop by the wall clock.

Both call the same pure functions of `engine.sampled` and give the samples in chunks of one size.
"""

from __future__ import annotations

import gc
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any, NamedTuple, Protocol

import jax
import numpy as np

from ..engine import sampled
from ..engine.packed import Packed, pack
from .hardware.plant import Rigged
from .software.loop import BenchSoftware
from .software.timing import Timing

CHUNK = 500  # samples between two looks at the display, at the rates, and at whether somebody interrupts
AFTER_STOP = 0.5  # time for which a stopped machine is sampled further, so that it is seen to vent [s]
SPIN = 3e-4  # time before a deadline from which the loop no longer sleeps, for the system wakes it late [s]
LATE = 0.1  # share of a period from which a sample counts as late


class Rows(Protocol):
    """What every sample brings from outside."""

    def next(self) -> dict[str, Any]:
        """Of the next chunk, each (CHUNK,)."""


Chunk = tuple[sampled.Carry, sampled.Seen, int]
Source = Callable[[Rigged, BenchSoftware, sampled.Carry, Rows, Timing], Iterator[Chunk]]


def simulated(
    plant: Rigged, software: BenchSoftware, carry: sampled.Carry, rows: Rows, timing: Timing
) -> Iterator[Chunk]:
    """Chunk after chunk as fast as it goes, with steps that the plant's own rates allow."""
    while True:
        carry, seen, inner = sampled.advance(
            plant, software, carry, rows.next(), period=timing.period, inner=timing.inner, latency=timing.latency
        )
        yield carry, seen, inner


class Lateness(NamedTuple):
    """How a loop kept its deadlines.

    Attributes:
        samples: all of them; none is left out, a late one is made up for as fast as it goes.
        late: those that began later than `LATE` of a period.
        behind: those that began later than a whole period.
        percentiles: of the lateness, 50, 99, 99.9 and 100 % [s].
    """

    samples: int
    late: int
    behind: int
    percentiles: tuple[float, float, float, float]

    @classmethod
    def of(cls, lateness: np.ndarray, period: float) -> Lateness:
        """Of the lateness of every sample (n,) [s]."""
        found = np.percentile(lateness, [50.0, 99.0, 99.9, 100.0]) if lateness.size else np.zeros(4)
        late, behind = (int((lateness > share * period).sum()) for share in (LATE, 1.0))
        half, most, nearly, largest = (float(x) for x in found)
        return cls(lateness.size, late, behind, (half, most, nearly, largest))


class WallClock:
    """A loop by the wall clock on the simulated machine, which advances by a sample after each action.

    Every sample waits for its deadline, a whole number of periods after the first. Nothing is compiled, allocated or
    collected while it runs; what was seen is given afterwards. `lateness` then holds that of every sample [s].
    """

    def __init__(self, longest: float) -> None:
        """For a run of at most a time [s]."""
        self.longest = longest
        self.lateness = np.zeros(0)
        self.stop: Callable[[], bool] | None = None

    def __call__(
        self, plant: Rigged, software: BenchSoftware, carry: sampled.Carry, rows: Rows, timing: Timing
    ) -> Iterator[Chunk]:
        """The whole part by the wall clock, then its chunks."""
        loop = _Loop(plant, software, carry, rows, timing, self.longest + 2.0 * AFTER_STOP)
        count = loop.run(self.stop)
        self.lateness = np.concatenate([self.lateness, loop.lateness[:count]])
        for first in range(0, max(count, 1), CHUNK):
            yield loop.carry(), loop.chunk(first, min(first + CHUNK, count)), timing.inner
        while True:  # nothing more is to come
            yield loop.carry(), loop.chunk(count, count), timing.inner


class _Loop:
    """Compiled vectors of one part, and what every sample of it showed."""

    def __init__(
        self, plant: Rigged, software: BenchSoftware, carry: sampled.Carry, rows: Rows, timing: Timing, longest: float
    ) -> None:
        self.timing, self.period = timing, timing.period
        most = int(np.ceil(longest / timing.period)) + CHUNK
        drawn = [rows.next() for _ in range(-(-most // CHUNK))]
        brought = jax.tree.map(lambda *parts: np.concatenate(parts), *drawn)
        row = jax.tree.map(lambda x: x[0], brought)
        physics = carry._replace(software=())
        period, inner, latency = timing.period, timing.inner, timing.latency
        self.observe = Packed(lambda c, r: sampled.observe(plant, c, r, period=period, latency=latency), physics, row)
        measured = self.observe.tree(0, self.observe(pack(physics), pack(row))[0])
        self.think = Packed(lambda s, m, r: software.step(s, m, r, period), carry.software, measured, row)
        commands = self.think.tree(1, self.think(pack(carry.software), pack(measured), pack(row))[1])
        self.act = Packed(
            lambda c, u: sampled.act(plant, c, u, period=period, inner=inner, latency=latency, stiff=False),
            physics, commands,
        )  # fmt: skip
        self.physics, self.software = pack(physics), pack(carry.software)
        self.rows = np.stack([np.asarray(x, float) for x in jax.tree.leaves(brought)], axis=1)[:most]
        self.lateness = np.zeros(most)
        self.kept: list[tuple[np.ndarray, ...]] = []
        self.place = {name: self.think.index(2, name) for name in ("running", "code", "missed")}

    def run(self, stop: Callable[[], bool] | None) -> int:
        """All samples by the wall clock; how many there were."""
        left = round(AFTER_STOP / self.period)
        interval = sys.getswitchinterval()
        gc.collect()
        gc.disable()
        sys.setswitchinterval(1e-4)
        try:
            origin = time.perf_counter() + 5.0 * self.period
            for k in range(len(self.lateness)):
                self.lateness[k] = _wait(origin + k * self.period)
                row = self.rows[k]
                measured, look = self.observe(self.physics, row)
                self.software, commands, shown = self.think(self.software, measured, row)
                self.physics, newest = self.act(self.physics, commands)
                self.kept.append((measured, look, newest, shown))
                if shown[self.place["running"]] < 0.5:
                    halted = shown[self.place["code"]] > 0.5 or shown[self.place["missed"]] > 0.5
                    left = left - 1 if halted else 0
                    if left <= 0:
                        return k + 1
                elif k % 100 == 0 and stop is not None and stop():
                    return k + 1
        finally:
            gc.enable()
            sys.setswitchinterval(interval)
        return len(self.kept)

    def carry(self) -> sampled.Carry:
        """The machine after the last sample."""
        found: sampled.Carry = self.act.tree(0, self.physics)
        return found

    def chunk(self, first: int, last: int) -> sampled.Seen:
        """Samples as arrays of the usual size, the last one repeated as not running where there are fewer."""
        rows = self.kept[first:last] or self.kept[-1:]
        rows = rows + rows[-1:] * (CHUNK - len(rows))
        measured, look, newest, shown = (np.stack(part) for part in zip(*rows, strict=True))
        seen = self.think.columns(2, shown)
        seen["running"] = np.where(np.arange(CHUNK) < last - first, seen["running"], 0.0)
        at: sampled.Look = self.observe.columns(1, look)
        return sampled.Seen(
            at.outputs, self.observe.columns(0, measured), self.act.columns(1, newest), seen, at.steepest, at.sound
        )


def _wait(deadline: float) -> float:
    """Wait for a time of `time.perf_counter` [s]; how much later it is then [s]."""
    ahead = deadline - time.perf_counter()
    if ahead > SPIN:
        time.sleep(ahead - SPIN)
    while (now := time.perf_counter()) < deadline:
        pass
    return now - deadline
