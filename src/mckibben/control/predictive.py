"""Model predictive control by lanes: the model runs ahead of the machine, once per move.

    y_j over the horizon, j = 0 as planned, j = 1 .. n with move j raised by `perturb`;   J = (y_j - y_0)/perturb
    minimise |r - d - y_0 - J x|^2 + |weight (differences of the moves u + x)|^2,   |x| <= trust

Behind each sample the model has done what the machine was told; d is the slow part of what the machine does otherwise.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .task import ControlTask


class PredictiveControl:
    """Model predictive control by lanes of `Simulation.batch`.

    Args:
        task: what is driven.
        horizon: [s].
        moves: in it.
        perturb: of a move, for the slope [Pa]; too small a one sees the stuck friction only, and cycles.
        trust: largest change of a move from plan to plan [Pa].
        weight: of a difference between two moves [unit/Pa].
        every: samples from plan to plan.
        share: of the disturbance of the output that is taken in at each sample [1].
    """

    def __init__(
        self,
        task: ControlTask,
        *,
        horizon: float = 0.16,
        moves: int = 8,
        perturb: float = 2e4,
        trust: float = 5e4,
        weight: float | None = None,
        every: int = 2,
        share: float = 0.1,
    ) -> None:
        self.task, self.moves, self.perturb, self.trust = task, moves, perturb, trust
        self.every, self.share = every, share
        self.weight = MOVE_WEIGHTS[task.unit] if weight is None else weight
        self.preview = round(horizon / task.period)
        self._block = np.minimum(np.arange(self.preview) * moves // self.preview, moves - 1)
        self._lanes = task.model.batch(moves + 1)
        self._twin = task.model.with_arrays({})

    def reset(self, measured: Any, window: np.ndarray) -> None:
        """Begin at rest."""
        self._lanes.reset()
        output = self.task.output(self._twin.reset())
        start = self._twin.start_commands()
        name, (offset, slope) = next(iter(self.task.actuators.items()))
        self._plan = np.full(self.preview, self.task.saturated((start[name] - offset) / slope))
        self._off, self._sample, self._told = self.task.output(measured) - output, 0, float(self._plan[0])

    def step(self, measured: Any, window: np.ndarray) -> float:
        """The number for the next period."""
        task = self.task
        if self._sample:  # the model has done what the machine was told
            seen = self._twin.step(**task.commands(self._told))
            self._off += self.share * (task.output(measured) - task.output(seen) - self._off)
        if self._sample % self.every == 0:
            self._plan = self._better(window[1:])
        self._told, self._plan = float(self._plan[0]), np.append(self._plan[1:], self._plan[-1])
        self._sample += 1
        return self._told

    def _better(self, wanted: np.ndarray) -> np.ndarray:
        """A better plan (preview,) [Pa], from the present state of the model."""
        task, lanes, (low, high) = self.task, self._lanes, self.task.limits
        lanes.load_states(self._twin.save_state())
        present = self._plan[[int(np.argmax(self._block == j)) for j in range(self.moves)]]
        # towards the middle of the limits, where a move does something
        sizes = np.where(present > 0.5 * (low + high), -self.perturb, self.perturb)
        raised = np.concatenate([np.zeros((len(self._plan), 1)), np.diag(sizes)[self._block]], axis=1)
        courses = self._plan[:, None] + raised
        outputs = np.array([task.output(lanes.step(**task.commands(row))) for row in courses])
        slopes = (outputs[:, 1:] - outputs[:, :1]) / sizes
        differences = np.eye(self.moves) - np.eye(self.moves, k=-1)
        before = np.zeros(self.moves)
        before[0] = self._told
        rows = np.concatenate([slopes, self.weight * differences])
        error = wanted - self._off - outputs[:, 0]
        right = np.concatenate([error, self.weight * (before - differences @ present)])
        change = np.clip(np.linalg.lstsq(rows, right, rcond=None)[0], -self.trust, self.trust)
        better: np.ndarray = np.clip(self._plan + change[self._block], low, high)
        return better


MOVE_WEIGHTS = {"m": 1e-3 / 1e5, "rad": 0.03 / 1e5}
