"""The controllers of tbazina/pam_lqi_pid with their printed gains, foretold on a bench.

    u = lookup(r) + creep + ks e + ki sum(e) + kd de/dt        feedforward, PID
    u = lookup(r) + creep + ks e + ki sum(e) + kp (P - lookup(r))      LQI

All stand on two lookups of the pressure over the stroke, of a slow rise and a slow fall, chosen at each new level by the
sign of the error with a dead band. Gains are in volts of the regulator, mm and bar; sums are over samples of 10 ms. Where a
gain is printed twice, the first is that of the rising branch.
"""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from ..errors import InputError
from .benches import VOLT
from .task import ControlTask, TaskControl

MILLI, BAR = 1e-3, 1e5
BANDS = {"feedforward": 0.575 * MILLI, "pid": 0.575 * MILLI, "lqi": 0.14 * MILLI}  # dead bands [m]
PID_UP, PID_DOWN = (0.40, 0.0013, 0.039), (0.45, 0.0017, 0.029)  # V/mm, V/mm per sample, V s/mm
LQI_UP, LQI_DOWN = (0.4, 0.0101, -0.518), (0.4, 0.0101, -0.550)  # V/mm, V/mm per sample, V/bar
CREEP, AFTER, SLOPE, LAG = 0.192, 0.31, 19, 0.85  # share of a step up; [s]; samples of a slope; its lag [s]
SWEEP = 30.0  # of a lookup [s]


class PublishedControl(TaskControl):
    """A published controller, on lookups of the model.

    Args:
        task: of one muscle.
        kind: of the controller.

    Raises:
        InputError: another task, or a kind that was not published.
    """

    preview = 0

    def __init__(self, task: ControlTask, *, kind: Literal["feedforward", "pid", "lqi"] = "lqi") -> None:
        if kind not in BANDS:
            raise InputError("kind", kind, known=BANDS)
        self._take(task, {})
        self.task, self.kind = task.of_one_muscle(), kind
        (low, high), sim = task.limits, task.model
        sim.reset()
        for _ in range(round(1.0 / task.period)):
            sim.step(**task.commands(low))
        ramp = np.linspace(low, high, round(SWEEP / task.period))
        outputs = [[task.output(sim.step(**task.commands(p))) for p in way] for way in (ramp, ramp[::-1])]
        rising, falling = (np.maximum.accumulate(one) for one in (outputs[0], outputs[1][::-1]))
        self._lookups = {1: (rising, ramp), -1: (falling, ramp)}

    def reset(self, measured: Any, window: np.ndarray) -> None:
        """Begin on the rising branch."""
        self._branch, self._sum, self._goal, self._step, self._since = 1, 0.0, float(window[0]), 0.0, 0.0
        self._errors, self._slope = [0.0] * SLOPE, 0.0

    def step(self, measured: Any, window: np.ndarray) -> float:
        """The pressure for the next period."""
        task, wanted = self.task, float(window[0])
        error = wanted - task.output(measured)
        if wanted != self._goal:
            if abs(error) > BANDS[self.kind]:
                self._branch = 1 if error > 0.0 else -1
            self._step, self._goal, self._since = wanted - self._goal, wanted, 0.0
        self._since += task.period
        late = self._since - AFTER
        creep = CREEP * np.exp(-late) * self._step if late > 0.0 and self._step > 0.0 else 0.0
        looked = float(np.interp(wanted + creep, *self._lookups[self._branch]))
        self._errors = [*self._errors[1:], error / MILLI]
        rate = (self._errors[-1] - self._errors[0]) / ((SLOPE - 1) * task.period)
        self._slope += (rate - self._slope) * task.period / (LAG + task.period)
        volts = 0.0
        if self.kind == "pid":
            ks, ki, kd = PID_UP if self._branch > 0 else PID_DOWN
            volts = ks * error / MILLI + ki * self._sum + kd * self._slope
        elif self.kind == "lqi":
            ks, ki, kp = LQI_UP if self._branch > 0 else LQI_DOWN
            volts = ks * error / MILLI + ki * self._sum + kp * (measured.pressure - looked) / BAR
        number = looked + VOLT * volts
        acting = task.saturated(number)
        if (number - acting) * error <= 0.0:
            self._sum += error / MILLI
        return acting
