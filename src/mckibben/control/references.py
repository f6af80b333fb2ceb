"""References of the benches: what an output is to do over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

SKIPPED = 2.0  # at the beginning of a reference, in which nothing is scored [s]
PUBLISHED_STROKES = 3.82e-3, 26.68e-3  # [m]
HOLD = 2.0  # of the staircase [s]


@dataclass(frozen=True)
class Reference:
    """A wanted output.

    Attributes:
        name: short name.
        about: what it is, one phrase.
        unit: SI unit of the output.
        duration: [s].
        course: wanted output [unit] at times [s].
        hold: how long each step of a staircase is held [s]; 0 for a smooth course, whose future a controller is shown.
    """

    name: str
    about: str
    unit: str
    duration: float
    course: Callable[[np.ndarray], np.ndarray]
    hold: float = 0.0

    def samples(self, period: float, preview: int = 0, duration: float | None = None) -> np.ndarray:
        """Wanted outputs at the samples and `preview` ones beyond the end, shape (samples + preview,)."""
        count = round((duration or self.duration) / period)
        return self.course(period * np.arange(count + preview))


def _staircase(time: np.ndarray) -> np.ndarray:
    low, high = PUBLISHED_STROKES
    levels = low + (high - low) * np.random.default_rng(12345).uniform(0.05, 0.85, 450)
    held: np.ndarray = levels[np.minimum((time / HOLD + 1e-9).astype(int), len(levels) - 1)]
    return held


def _sines(mean: float, *parts: tuple[float, float, float]) -> Callable[[np.ndarray], np.ndarray]:
    return lambda time: (
        mean
        + sum((size * np.sin(2.0 * np.pi * rate * time + phase) for size, rate, phase in parts), np.zeros_like(time))
    )


REFERENCES = {
    one.name: one
    for one in (
        Reference("R1", "60 random holds of 2 s, the published staircase; no step is known before", "m", 120.0,
                  _staircase, HOLD),
        Reference("R2", "15 + 6 sin(2 pi 0.25 t) + 4 sin(2 pi 0.7 t + 1) mm", "m", 20.0,
                  _sines(15e-3, (6e-3, 0.25, 0.0), (4e-3, 0.7, 1.0))),
        Reference("R3", "0.25 sin(2 pi 0.5 t) + 0.08 sin(2 pi 1.3 t) rad", "rad", 10.0,
                  _sines(0.0, (0.25, 0.5, 0.0), (0.08, 1.3, 0.0))),
        Reference("R4", "15 + 10 sin(2 pi t) mm, which the air cannot follow", "m", 10.0,
                  _sines(15e-3, (10e-3, 1.0, 0.0))),
    )
}  # fmt: skip
