"""References of the benches: what an output is to do over time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..quantities import whole_number, with_unit
from ..simulation.mechanisms import Amount, in_si

MOST = 1e7  # samples of a reference; more are a slip of units
AWAY = 0.4  # of its range that a smooth course may leave its last sample
BETWEEN = 16  # points within a sample at which a course is looked at
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

    def samples(self, period: Amount, preview: int = 0, duration: Amount | None = None) -> np.ndarray:
        """Wanted outputs at the samples and `preview` ones beyond the end, shape (samples + preview,).

        Raises:
            InputError: a period or duration [s, or words with a unit] in which there is no sample, or more than 10 million.
        """
        step = in_si(period, "s", "period")
        lasts = in_si(self.duration if duration is None else duration, "s", "duration")
        if not (step > 0.0 and 0.5 <= lasts / step <= MOST):
            problem = f"must be above zero and the duration, {lasts:g} s, a sample or more, {MOST:.0e} at most"
            raise InputError("period", with_unit(step, "s"), problem)
        if not self._shows(step, lasts):
            problem = f"must be shorter: between samples {self.name}, {self.about}, is another"
            raise InputError("period", with_unit(step, "s"), problem)
        return self.course(step * np.arange(round(lasts / step) + whole_number(preview, "preview")))

    def _shows(self, step: float, lasts: float) -> bool:
        """Whether samples show the course: each hold, or a smooth one as about eight a period of a sine do."""
        if self.hold:
            return step <= self.hold
        count = min(round(lasts / step), 1000)
        between = self.course(step * np.arange(BETWEEN * count) / BETWEEN)
        away = np.abs(between - np.repeat(between[::BETWEEN], BETWEEN)).max()
        return bool(away <= AWAY * np.ptp(between))


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
