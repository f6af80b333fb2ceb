"""Linear quadratic control with an integral and a Kalman filter, from a linear model of small motions about the middle.

    x = (P, y, dy/dt, u of the dead time),   x+ = A x + B u,   measured (P, y);   u = -K (x - x_r) - k_i sum(r - y) T

A and B are least squares on what the model does under small random commands, so that fill and relief of a valve count as
they do together at that amplitude. Feed-forward is an inverse of the muscle.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from .controllers import SHAPED_TO, RestingIntegral
from .inverse import Inverse
from .references import RateLimit
from .task import ControlTask

AMPLITUDE = 1e4  # of the commands of the linear model [Pa]
SAMPLES = 600  # on which it rests
TRUST = {"m": (1e-5, 2e-5), "rad": (1e-4, 1e-4)}  # noise of a sample of the model's output, and of the measured one


class LQI:
    """Linear quadratic control with an integral and a Kalman filter, on an inverse of the muscle.

    Args:
        task: of one muscle, with pressure and position measured.
        memory: whether the inverse knows friction and creep.
        effort: weight of the number u against the error [m/Pa].
        integral: weight of the integral against the error [1/s].
        lead: of the feed-forward [s].
        ahead: by which the reference is looked up [s].
    """

    def __init__(
        self,
        task: ControlTask,
        *,
        memory: bool = False,
        effort: float = 2e-8,
        integral: float = 4.0,
        lead: float = 0.09,
        ahead: float = 0.04,
    ) -> None:
        from scipy.linalg import solve_discrete_are

        self.task, self.lead, self.preview = task, lead, round(ahead / task.period)
        self._inverse, self._shaper = Inverse(task, memory=memory), RateLimit(SHAPED_TO * 27e-3, task.period)
        self.late = task.model.depth - 2
        self.A, self.B = small_motion_model(task, self.late)
        size = len(self.B)
        self.C = np.zeros((2, size))
        self.C[0, 0] = self.C[1, 1] = 1.0
        # with the integral of the error behind the state
        whole = np.zeros((size + 1, size + 1))
        whole[:size, :size], whole[size, 1], whole[size, size] = self.A, -task.period, 1.0
        weights = np.diag([0.0, 1.0, *[0.0] * (size - 2), integral**2])
        command = np.append(self.B, 0.0)[:, None]
        cost = solve_discrete_are(whole, command, weights, np.array([[effort**2]]))
        self.gain = np.linalg.solve(effort**2 + command.T @ cost @ command, command.T @ cost @ whole)[0]
        model, read = TRUST[task.unit]
        drawn = np.diag([5e2, model, 1e-2, *[1.0] * (size - 3)]) ** 2
        noise = np.diag([600.0, read]) ** 2
        spread = solve_discrete_are(self.A.T, self.C.T, drawn, noise)
        self.filter = spread @ self.C.T @ np.linalg.inv(self.C @ spread @ self.C.T + noise)

    def reset(self, measured: Any, window: np.ndarray) -> None:
        """Begin at rest; the state is that of the deviations from the feed-forward."""
        output = self.task.output(measured)
        self._shaper.reset(output)
        self._pressure = self._inverse.reset(output)
        self._outputs, self._pressures = [output] * (self.preview + 1), [self._pressure] * (self.preview + 1)
        self._state, self._told, self._sum = np.zeros(len(self.B)), 0.0, RestingIntegral(self.task.period)

    def step(self, measured: Any, window: np.ndarray) -> float:
        """The number for the next period."""
        task, shaper = self.task, self._shaper
        (shaped,) = shaper.shape(window[-1:])
        before, self._pressure = self._pressure, self._inverse.advance(shaped)
        self._outputs, self._pressures = [*self._outputs[1:], shaped], [*self._pressures[1:], self._pressure]
        wanted = self._pressure + self.lead * (self._pressure - before) / task.period
        output = task.output(measured)
        ahead = self.A @ self._state + self.B * self._told
        seen = np.array([measured.pressure - self._pressures[0], output - self._outputs[0]])
        self._state = ahead + self.filter @ (seen - self.C @ ahead)
        number = wanted - float(self.gain @ np.append(self._state, self._sum.value))
        acting = task.saturated(number)
        self._told = acting - wanted
        self._sum.add(self._outputs[0] - output, moving=shaper.moving, saturated=acting != number)
        return acting


def small_motion_model(task: ControlTask, late: int) -> tuple[np.ndarray, np.ndarray]:
    """A (n, n) and B (n,) of the state (P, y, dy/dt, commands on their way, the oldest first), by least squares.

    Args:
        task: of one muscle.
        late: samples of dead time.
    """
    sim = task.model
    sim.reset()
    low, high = task.limits
    middle, random = 0.4 * (low + high), np.random.default_rng(1)
    rows, told = [], []
    for k in range(200 + SAMPLES):
        if k < 200:
            number = middle
        elif k % 5 == 0:
            number = middle + AMPLITUDE * random.choice([-1.0, -0.5, 0.5, 1.0])
        seen = sim.step(**task.commands(number))
        rows.append((seen.pressure, task.output(seen), task.sign * seen.velocity))
        told.append(number)
    states, numbers = np.array(rows[200 - 1 :]), np.array(told[200 - 1 :])
    states, numbers = states - states.mean(axis=0), numbers - middle
    acting = np.roll(numbers, late)[late + 1 :]  # that acts in the sample that ends in each row
    known = np.concatenate([states[late:-1], acting[:, None]], axis=1)
    scale = np.maximum(known.std(axis=0), 1e-12)
    fitted = np.linalg.lstsq(known / scale, states[late + 1 :], rcond=None)[0].T / scale
    size = 3 + late
    A, B = np.zeros((size, size)), np.zeros(size)
    A[:3, :3] = fitted[:, :3]
    if late == 0:
        B[:3] = fitted[:, 3]
        return A, B
    A[:3, 3] = fitted[:, 3]
    A[3:-1, 4:] = np.eye(late - 1)
    B[-1] = 1.0
    return A, B
