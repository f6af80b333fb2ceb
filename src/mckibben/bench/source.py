"""What a run consists of: chunks of samples, from a simulation in its own time or from a loop by the wall clock."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from ..engine import sampled
from .hardware.in_process import Rows
from .hardware.plant import Rigged
from .software.loop import BenchSoftware
from .software.timing import Timing

CHUNK = 500  # samples between two looks at the display, at the rates, and at whether somebody interrupts
AFTER_STOP = 0.5  # time for which a stopped machine is sampled further, so that it is seen to vent [s]


class Chunk(NamedTuple):
    """Some samples in a row.

    Attributes:
        seen: of each, as arrays (size,); without true channels where the machine is real.
        size: number of the samples.
        inner: steps of the physics per sample; 0 where it was not computed here.
        carry: the machine after them, where it was.
    """

    seen: sampled.Seen
    size: int
    inner: int = 0
    carry: sampled.Carry | None = None


def simulated(
    plant: Rigged, software: BenchSoftware, carry: sampled.Carry, rows: Rows, timing: Timing
) -> Iterator[Chunk]:
    """Chunk after chunk as fast as it goes, with steps that the plant's own rates allow."""
    while True:
        carry, seen, inner = sampled.advance(
            plant, software, carry, rows.next(), period=timing.period, inner=timing.inner, latency=timing.latency
        )
        yield Chunk(seen, CHUNK, inner, carry)
