"""Controllers by name: PID, inverses of the muscle with and without its memory, and iterative learning.

Each is made by ``Class(task)`` with gains tuned on reference R2 of bench B1, those of a PI on an inverse or a plan on a
staircase of other levels than R1's and on other plants than are scored, or with one's own; see `task.Controller`. The
references are shaped to a rate that a muscle can follow before anything else sees them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, Tree, jnp
from ..simulation.mechanisms import Amount
from .inverse import Inverse, advance_inverse
from .steps import Outputs, RestingIntegral, Sample, StepControl, clip, shape
from .task import RANGES, ControlTask, TaskControl

SHAPED_TO = 80e-3 / 27e-3  # usual rate of shaped references, in ranges of the output per second [1/s]
RESTS = 0.3  # for which an integral rests after a shaped reference lags behind what is wanted [s]
FILLING = 0.1  # for which it rests after a command was at a limit: dead time, and the filling of the muscle [s]


class PIDState(NamedTuple):
    """What a PID remembers: the last output, its filtered rate, and the number without proportional and derivative."""

    output: Scalar
    velocity: Scalar
    total: Scalar


class PID(StepControl):
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
        proportional: Amount | None = None,
        integral: Amount | None = None,
        derivative: Amount | None = None,
        velocity_lag: Amount = 0.02,
    ) -> None:
        gains = {"proportional": proportional, "integral": integral, "derivative": derivative}
        numbers = self._take(task, PID_GAINS, **gains, velocity_lag=velocity_lag)
        self._inverse = Inverse(task, memory=False)
        self._compile(_pid_step, (), numbers | clock(task))

    def begin(self, output: float) -> PIDState:
        """The state at rest, with the number by which the model holds this output."""
        return PIDState(output, 0.0, self._inverse.reset(output))


def clock(task: ControlTask) -> dict[str, float]:
    """Period [s] and limits of the number [Pa], as parameters of a step."""
    return {"period": task.period, "low": task.limits[0], "high": task.limits[1]}


def _pid_step(p: Any, state: PIDState, sample: Sample) -> tuple[PIDState, Outputs]:
    rate = (sample.output - state.output) / p["period"]
    velocity = state.velocity + (rate - state.velocity) * p["period"] / (p["velocity_lag"] + p["period"])
    error = sample.wanted - sample.output
    number = state.total + p["proportional"] * error - p["derivative"] * velocity
    acting = clip(number, p["low"], p["high"])
    grown = state.total + p["integral"] * error * p["period"]
    total = jnp.where((number - acting) * error <= 0.0, grown, state.total)
    return PIDState(sample.output, velocity, total), Outputs(acting)


class FeedForward(NamedTuple):
    """What an inverse ahead of the reference remembers: shaped references of the preview, number, memory of the muscle."""

    past: Any
    number: Scalar
    memory: Tree

    @classmethod
    def parameters(cls, task: ControlTask, inverse: Inverse, lead: float, rate: float) -> dict[str, Any]:
        """Parameters of `advance`: parts of the model, lead [s], rate of the shaped reference [unit/s], and the clock's."""
        units, load = inverse.parts
        more = {"rests": round(RESTS / task.period), "filling": round(FILLING / task.period)}
        output = {"zero": task.zero, "sign": task.sign, "most": rate * task.period, "lead": lead}
        return {"units": units, "load": load} | output | {k: float(v) for k, v in more.items()} | clock(task)

    @classmethod
    def begin(cls, inverse: Inverse, output: float, preview: int) -> FeedForward:
        """At rest at an output [unit]."""
        return cls(np.full(preview + 1, output), inverse.reset(output), inverse.rest)

    def advance(self, actuators: Any, p: Any, wanted: Scalar) -> tuple[FeedForward, Scalar, Scalar]:
        """Go on by one sample towards the end of the window.

        Returns:
            What is remembered, the command u of the muscles' pressure with its lead [Pa], and whether the shaped reference
            lags behind.
        """
        # the end of the window is shaped, and what was shaped before is what is wanted now
        shaped, moving = shape(self.past[-1], wanted, p["most"])
        start, to = (p["zero"] + p["sign"] * output for output in (self.past[-1], shaped))
        parts, ends = (p["units"], p["load"]), (p["period"], p["low"], p["high"])
        memory, number = advance_inverse(actuators, parts, self.memory, to, start, self.number, *ends)
        past = jnp.append(self.past[1:], shaped)
        return FeedForward(past, number, memory), number + p["lead"] * (number - self.number) / p["period"], moving


class InverseState(NamedTuple):
    """What an inverse with a PI remembers."""

    ahead: FeedForward
    integral: RestingIntegral


class InverseControl(StepControl):
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
        lead: Amount | None = None,
        ahead: Amount = 0.04,
        proportional: Amount | None = None,
        integral: Amount | None = None,
        rate: Amount | None = None,
    ) -> None:
        gains = {"proportional": proportional, "integral": integral}
        numbers = self._take(task, USUAL, memory=memory, feedback=feedback, lead=lead, ahead=ahead, rate=rate, **gains)
        self.preview, self._inverse = round(numbers["ahead"] / task.period), Inverse(task, memory=memory)
        parameters = FeedForward.parameters(task, self._inverse, numbers["lead"], numbers["rate"])
        parameters |= {name: numbers[name] for name in gains}
        self._compile(_inverse_step, (self._inverse.actuators, feedback), parameters)

    def begin(self, output: float) -> InverseState:
        """The state at rest."""
        return InverseState(FeedForward.begin(self._inverse, output, self.preview), RestingIntegral(0.0, 0.0))


def _inverse_step(
    actuators: Any, feedback: bool, p: Any, state: InverseState, sample: Sample
) -> tuple[InverseState, Outputs]:
    ahead, wanted, moving = state.ahead.advance(actuators, p, sample.wanted)
    if not feedback:
        return InverseState(ahead, state.integral), Outputs(clip(wanted, p["low"], p["high"]))
    error = ahead.past[0] - sample.output
    number = wanted + p["proportional"] * error + p["integral"] * state.integral.value
    acting = clip(number, p["low"], p["high"])
    rests = jnp.where(moving, p["rests"], jnp.where(acting != number, p["filling"], 0.0))
    return InverseState(ahead, state.integral.add(error, rests, p["period"])), Outputs(acting)


class IterativeLearning(TaskControl):
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
        self,
        task: ControlTask,
        *,
        repeats: int = 9,
        gain: Amount | None = None,
        ahead: Amount = 0.1,
        width: Amount = 0.05,
    ) -> None:
        numbers = self._take(task, USUAL, repeats=repeats, gain=gain, ahead=ahead, width=width)
        self.repeats, self.gain = numbers["repeats"], numbers["gain"]
        self.late, self.half = round(numbers["ahead"] / task.period), round(0.5 * numbers["width"] / task.period)
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


# Numbers that are used where none are stated, by the unit of the output.
PID_GAINS = {
    "proportional": {"m": 3.0e7, "rad": 8.0e5}, "integral": {"m": 2.0e8, "rad": 8.0e6},
    "derivative": dict.fromkeys(RANGES, 0.0),
}  # fmt: skip
USUAL = {
    "proportional": {"m": 1.4e7, "rad": 4.0e5}, "integral": {"m": 2.0e8, "rad": 4.0e6}, "lead": {"m": 0.09, "rad": 0.06},
    "gain": {"m": 0.6e7, "rad": 2.0e5}, "rate": {unit: SHAPED_TO * size for unit, size in RANGES.items()},
    "weight": {"m": 1e-3 / 1e5, "rad": 0.03 / 1e5},
}  # fmt: skip
