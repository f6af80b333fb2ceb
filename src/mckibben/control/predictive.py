"""Model predictive control by lanes: the model runs ahead of the machine, once per move.

    y_j over the horizon, j = 0 as planned, j = 1 .. n with move j raised by `perturb`;   J = (y_j - y_0)/perturb
    minimise |r - d - y_0 - J x|^2 + |weight (differences of the moves u + x)|^2,   |x| <= trust
    number = u + kp e + ki sum(e) T

Behind each sample the model has done what was planned for it; d is the slow part of what the machine does otherwise. While
the reference moves, d follows and the PI rests. Where it holds, d stands and the PI acts: to a plan whose friction gives
way less softly than the machine's, d is a chase that does not end. The plan keeps to what the PI leaves of the limits.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ..errors import InputError
from ..simulation.mechanisms import Amount
from .controllers import FILLING, RESTS, USUAL
from .inverse import Inverse
from .steps import RestingIntegral
from .task import ControlTask, TaskControl

HOLDS = {"m": 1e-6, "rad": 2e-5}  # change of a reference up to which it holds [unit]
STANDS = {"m": 2e-6, "rad": 4e-5}  # foreseen error up to which a plan stands [unit]


class PredictiveControl(TaskControl):
    """Model predictive control by lanes of `Simulation.batch`, with a PI where the reference holds.

    Args:
        task: what is driven.
        horizon: [s].
        moves: in it.
        perturb: of a move, for the slope [Pa]; too small a one sees the stuck friction only, and cycles.
        trust: largest change of a move from plan to plan [Pa].
        weight: of a difference between two moves [unit/Pa].
        every: samples from plan to plan.
        share: of the disturbance of the output that is taken in at each sample [1].
        proportional: kp [Pa/m], of a joint [Pa/rad].
        integral: ki [Pa/(m s)].
    """

    def __init__(
        self,
        task: ControlTask,
        *,
        horizon: Amount = 0.16,
        moves: int = 8,
        perturb: Amount = 2e4,
        trust: Amount = 5e4,
        weight: Amount | None = None,
        every: int = 2,
        share: float = 0.2,
        proportional: Amount | None = None,
        integral: Amount | None = None,
    ) -> None:
        self._numbers = self._take(
            task, USUAL, horizon=horizon, moves=moves, perturb=perturb, trust=trust, weight=weight, every=every,
            share=share, proportional=proportional, integral=integral,
        )  # fmt: skip
        self.preview = round(self._numbers["horizon"] / task.period)
        if moves > self.preview:
            raise InputError("moves", moves, f"must be {self.preview} at most, the samples of the horizon")
        self._block = np.minimum(np.arange(self.preview) * moves // self.preview, moves - 1)
        self._lanes = task.model.batch(moves + 1)
        self._twin, self._inverse = task.model.with_arrays({}), Inverse(task, memory=False)

    def reset(self, measured: Any, window: np.ndarray) -> None:
        """Begin at rest, with the number by which the model holds its output."""
        self._lanes.reset()
        output = self.task.output(self._twin.reset())
        self._plan = np.full(self.preview, self._inverse.reset(output))
        self._off, self._sample, self._told = self.task.output(measured) - output, 0, float(self._plan[0])
        self._before, self._wanted, self._moving = output, float(window[0]), 0
        self._integral, self._full = RestingIntegral(0.0, 0.0), 0

    def step(self, measured: Any, window: np.ndarray) -> float:
        """The number for the next period."""
        task, p, output = self.task, self._numbers, self.task.output(measured)
        error = float(window[0]) - output
        changed = np.abs(window - self._wanted).max() > HOLDS[task.unit]
        self._moving = round(RESTS / task.period) if changed else max(self._moving - 1, 0)
        self._wanted, rests = float(window[0]), max(self._moving, self._full)
        self._integral = self._integral.add(p["integral"] * error, rests, task.period, np)
        feedback = float(self._integral.value)
        if self._moving:
            # the median of three shows what was a sample ago
            self._off += p["share"] * (output - self._before - self._off)
        else:
            feedback += p["proportional"] * error
        if self._sample:  # the model has done what was planned
            self._before = float(task.output(self._twin.step(**task.commands(self._told))))
        if self._sample % p["every"] == 0:
            self._plan = self._better(window[1:], feedback)
        number = float(self._plan[0]) + feedback
        acting = task.saturated(number)
        self._full = round(FILLING / task.period) - 1 if acting != number else 0  # samples left from the next one on
        self._told, self._plan = task.saturated(acting - feedback), np.append(self._plan[1:], self._plan[-1])
        self._sample += 1
        return acting

    def _better(self, wanted: np.ndarray, feedback: float) -> np.ndarray:
        """A better plan (preview,) [Pa], from the present state of the model."""
        task, p, lanes, (low, high) = self.task, self._numbers, self._lanes, self.task.limits
        low, high = max(low, low - feedback), min(high, high - feedback)
        lanes.load_states(self._twin.save_state())
        present = self._plan[[int(np.argmax(self._block == j)) for j in range(p["moves"])]]
        # towards the middle of the limits, where a move does something
        sizes = np.where(present > 0.5 * (low + high), -p["perturb"], p["perturb"])
        raised = np.concatenate([np.zeros((len(self._plan), 1)), np.diag(sizes)[self._block]], axis=1)
        courses = self._plan[:, None] + raised
        outputs = np.array([task.output(lanes.step(**task.commands(row))) for row in courses])
        error = wanted - self._off - outputs[:, 0]
        if np.abs(error).max() < STANDS[task.unit]:
            return self._plan
        slopes = (outputs[:, 1:] - outputs[:, :1]) / sizes
        differences = np.eye(p["moves"]) - np.eye(p["moves"], k=-1)
        before = np.zeros(p["moves"])
        before[0] = self._told
        rows = np.concatenate([slopes, p["weight"] * differences])
        right = np.concatenate([error, p["weight"] * (before - differences @ present)])
        change = np.clip(np.linalg.lstsq(rows, right, rcond=None)[0], -p["trust"], p["trust"])
        better: np.ndarray = np.clip(self._plan + change[self._block], low, high)
        return better
