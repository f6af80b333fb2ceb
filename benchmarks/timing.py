"""How things are timed: side by side, in turns, one core, medians.

A round runs every candidate once, one after the other, so that what disturbs the machine disturbs all of them. A ratio is
the median of the rounds' ratios, not the ratio of two medians. Where one core is meant, times are of the processor: of the
calling thread, or of all threads of the process for what computes in threads of its own. Where several are meant, they are
of the clock.
"""

from __future__ import annotations

import os
import statistics
import time
from collections.abc import Callable, Mapping
from typing import Any

CORES = sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))


def pin(cores: list[int] | None = None) -> None:
    """Let this thread, and those it starts from here on, run on some cores only; on the last one unless told otherwise."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, set(cores or CORES[-1:]))


class Times:
    """Seconds by candidate, one per round."""

    def __init__(self, seconds: Mapping[str, list[float]]) -> None:
        self.seconds = dict(seconds)

    def median(self, name: str) -> float:
        """Of a candidate [s]."""
        return statistics.median(self.seconds[name])

    def ratio(self, name: str, base: str) -> float:
        """How many times the time of `base` a candidate takes: the median over the rounds."""
        return statistics.median(a / b for a, b in zip(self.seconds[name], self.seconds[base], strict=True))


def in_turns(
    candidates: Mapping[str, Callable[[], Any]],
    rounds: int,
    *,
    wall: bool = False,
    threaded: tuple[str, ...] = ("XLA",),
) -> Times:
    """Run all candidates once to warm up, then in turns.

    Args:
        candidates: what runs, by name.
        rounds: how often.
        wall: take the time of the clock.
        threaded: names of what computes in threads of its own.
    """
    clocks = {
        name: time.perf_counter if wall else time.process_time if name.startswith(threaded) else time.thread_time
        for name in candidates
    }
    spent: dict[str, list[float]] = {name: [] for name in candidates}
    for run in candidates.values():
        run()
    for _ in range(rounds):
        for name, run in candidates.items():
            now = clocks[name]
            begin = now()
            run()
            spent[name].append(now() - begin)
            if name.startswith(threaded):
                time.sleep(1e-3)  # its threads spin on for a while, on the core of the next
    return Times(spent)
