"""Controllers by name: PID, inverses of the muscle with and without its memory, and iterative learning.

Each is made by ``Class(task)`` with gains tuned on reference R2 of bench B1, or with one's own; see `task.Controller`. The
references are shaped to a rate that a muscle can follow before anything else sees them.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from .inverse import Inverse
from .references import RateLimit
from .task import Controller, ControlTask

SHAPED_TO = 80e-3 / 27e-3  # usual rate of shaped references, in ranges of the output per second [1/s]
RANGES = {"m": 27e-3, "rad": 0.6}  # usual ranges of outputs [unit]
RESTS = 0.3  # for which an integral rests after a shaped reference lags behind what is wanted [s]
FILLING = 0.1  # for which it rests after a command was at a limit: dead time, and the filling of the muscle [s]


class RestingIntegral:
    """Integral of an error that rests where the error says nothing of the plant: in steps and saturation, and a while after.

    Args:
        period: of the samples [s].
    """

    def __init__(self, period: float) -> None:
        self.period, self.value, self._rests = period, 0.0, 0

    def add(self, error: float, *, moving: bool, saturated: bool) -> None:
        """Take in the error of a sample, unless it rests."""
        rests = RESTS if moving else FILLING if saturated else 0.0
        self._rests = max(self._rests - 1, round(rests / self.period))
        if self._rests <= 0:
            self.value += error * self.period


class PID:
    """u = u0 + kp e + ki sum(e) T - kd dy/dt: with a filter of the velocity, and an integral that stops at saturation.

    Args:
        task: what is driven.
        proportional: kp [Pa/m], of a joint [Pa/rad].
        integral: ki [Pa/(m s)].
        derivative: kd [Pa s/m], of the measured output.
        velocity_lag: time constant of the velocity's filter [s].
    """

    preview = 0

    def __init__(
        self,
        task: ControlTask,
        *,
        proportional: float | None = None,
        integral: float | None = None,
        derivative: float | None = None,
        velocity_lag: float = 0.02,
    ) -> None:
        usual = PID_GAINS[task.unit]
        self.task, self.velocity_lag = task, velocity_lag
        stated = (proportional, integral, derivative)
        self.gains = tuple(own if one is None else one for one, own in zip(stated, usual, strict=True))

    def reset(self, measured: Any, window: np.ndarray) -> None:
        """Begin at rest, with the number that the model holds this output by."""
        self._output, self._velocity = self.task.output(measured), 0.0
        self._sum = Inverse(self.task, memory=False).reset(self._output)

    def step(self, measured: Any, window: np.ndarray) -> float:
        """The number for the next period."""
        output, (kp, ki, kd), period = self.task.output(measured), self.gains, self.task.period
        rate = (output - self._output) / period
        self._velocity += (rate - self._velocity) * period / (self.velocity_lag + period)
        self._output, error = output, window[0] - output
        wanted = self._sum + kp * error - kd * self._velocity
        acting = self.task.saturated(wanted)
        if (wanted - acting) * error <= 0.0:
            self._sum += ki * error * period
        return acting


class InverseControl:
    """Inverse of the muscle, ahead of the reference, with a PI on what is left.

        u(t) = P(t + preview) + lead dP/dt + kp e + ki sum(e) T

    The reference is shaped to a `rate`; the integral rests while the shaped reference lags behind, as it does at each
    step of a staircase, and while the command is at a limit.

    Args:
        task: what is driven.
        memory: whether friction and creep are inverted, and not the law alone.
        feedback: whether the PI acts.
        lead: by which the pressure leads, for the filling of the muscle [s].
        ahead: by which the reference is looked up, for the dead time [s].
        proportional: kp [Pa/m], of a joint [Pa/rad].
        integral: ki [Pa/(m s)].
        rate: of the shaped reference [unit/s].
    """

    def __init__(
        self,
        task: ControlTask,
        *,
        memory: bool = True,
        feedback: bool = True,
        lead: float | None = None,
        ahead: float = 0.04,
        proportional: float | None = None,
        integral: float | None = None,
        rate: float | None = None,
    ) -> None:
        kp, ki = PI_GAINS[task.unit]
        self.task, self.feedback = task, feedback
        self.lead = LEADS[task.unit] if lead is None else lead
        self.gains = kp if proportional is None else proportional, ki if integral is None else integral
        self.preview = round(ahead / task.period)
        self._shaper = RateLimit(SHAPED_TO * RANGES[task.unit] if rate is None else rate, task.period)
        self._inverse = Inverse(task, memory=memory)

    def reset(self, measured: Any, window: np.ndarray) -> None:
        """Begin at rest."""
        output = self.task.output(measured)
        self._shaper.reset(output)
        self._pressure = self._inverse.reset(output)
        self._past = deque([output] * (self.preview + 1), self.preview + 1)
        self._sum = RestingIntegral(self.task.period)

    def step(self, measured: Any, window: np.ndarray) -> float:
        """The number for the next period."""
        task, shaper = self.task, self._shaper
        # the end of the window is shaped, and what was shaped before is what is wanted now
        (shaped,) = shaper.shape(window[-1:])
        before, self._pressure = self._pressure, self._inverse.advance(shaped)
        self._past.append(shaped)
        wanted = self._pressure + self.lead * (self._pressure - before) / task.period
        if not self.feedback:
            return task.saturated(wanted)
        kp, ki = self.gains
        error = self._past[0] - task.output(measured)
        number = wanted + kp * error + ki * self._sum.value
        acting = task.saturated(number)
        self._sum.add(error, moving=shaper.moving, saturated=acting != number)
        return acting


class IterativeLearning:
    """Goes through the reference again and again, and corrects the command by the errors that were later.

        v_j+1(t) = filter(v_j(t) + gain e_j(t + ahead)),   u = static inverse + v

    The filter is a mean over some samples to both sides. A repeat that got worse is taken back, and the gain halved.

    Args:
        task: what is driven.
        repeats: in all.
        gain: of the correction [Pa/m], of a joint [Pa/rad].
        ahead: by which an error is later than what made it [s].
        width: of the filter [s].
    """

    preview = 0

    def __init__(
        self, task: ControlTask, *, repeats: int = 9, gain: float | None = None, ahead: float = 0.1, width: float = 0.05
    ) -> None:
        self.task, self.repeats = task, repeats
        self.gain = LEARNING_GAINS[task.unit] if gain is None else gain
        self.late, self.half = round(ahead / task.period), round(0.5 * width / task.period)
        self._base = InverseControl(task, memory=False, feedback=False)
        self.preview = self._base.preview
        self._correction: np.ndarray | None = None
        self._best: tuple[float, np.ndarray | None, np.ndarray] | None = None

    def reset(self, measured: Any, window: np.ndarray) -> None:
        """Begin a repeat."""
        self._base.reset(measured, window)
        self._sample = 0

    def step(self, measured: Any, window: np.ndarray) -> float:
        """The number for the next period."""
        number = self._base.step(measured, window)
        if self._correction is not None:
            number += self._correction[min(self._sample, len(self._correction) - 1)]
        self._sample += 1
        return self.task.saturated(number)

    def learn(self, errors: np.ndarray) -> None:
        """Correct the command by the errors of the repeat that has ended [SI]."""
        size = float(np.sqrt(np.mean(errors**2)))
        if self._best is None or size < self._best[0]:
            self._best = size, self._correction, errors
        else:
            self.gain *= 0.5
        _, correction, errors = self._best
        late = np.concatenate([errors[self.late :], np.repeat(errors[-1:], self.late)])
        raw = self.gain * late if correction is None else correction + self.gain * late
        kernel = np.full(2 * self.half + 1, 1.0 / (2 * self.half + 1))
        self._correction = np.convolve(np.pad(raw, self.half, "edge"), kernel, "valid")


PID_GAINS = {"m": (3.0e7, 2.0e8, 0.0), "rad": (8.0e5, 8.0e6, 0.0)}
LEADS = {"m": 0.09, "rad": 0.06}
PI_GAINS = {"m": (0.08e8, 1.0e8), "rad": (4.0e5, 4.0e6)}
LEARNING_GAINS = {"m": 0.6e7, "rad": 2.0e5}


def _named(place: str, **options: Any) -> Callable[[ControlTask], Controller]:
    """A controller by name, whose module is loaded when it is made."""

    def make(task: ControlTask) -> Controller:
        from . import lqi, predictive, published

        later = (lqi.LQI, predictive.PredictiveControl, published.PublishedControl)
        kinds = {**globals(), **{kind.__name__: kind for kind in later}}
        made: Controller = kinds[place](task, **options)
        return made

    return make


CONTROLLERS: dict[str, Callable[[ControlTask], Controller]] = {
    "pid": _named("PID"),
    "inverse": _named("InverseControl", memory=False),
    "memory-inverse": _named("InverseControl"),
    "memory-inverse-open": _named("InverseControl", feedback=False),
    "lqi": _named("LQI"),
    "lqi-memory": _named("LQI", memory=True),
    "learning": _named("IterativeLearning"),
    "mpc": _named("PredictiveControl"),
    "published-feedforward": _named("PublishedControl", kind="feedforward"),
    "published-pid": _named("PublishedControl", kind="pid"),
    "published-lqi": _named("PublishedControl", kind="lqi"),
}
