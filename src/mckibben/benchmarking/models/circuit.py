"""The circuit of the jumping robot as a model of the benchmark: fitted to trials, as `mckibben study robot` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...errors import InputError
from ...identification.circuit_fit import fit_circuit, run_trial
from ...identification.trial import Trial
from ...recordings import Channel, Recording
from ...studies.jumping_robot import MUSCLES, robot_plan, trial_of_recording
from ..records import BenchmarkRecord

EVALUATIONS = 40  # of each fit, as in the study


class RobotCircuit:
    """Tank, tubes, valves and muscles with volume and wall heat; the parameters that the circuit's file frees are fitted."""

    def __init__(self) -> None:
        self.plan = robot_plan()
        self.changes: dict[str, float] = {}

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit conductances, volumes, delays and heat to the pressures of all trials at once.

        Raises:
            InputError: the records are not of the robot.
            ConvergenceError: the circuit cannot be run.
        """
        trials = [self._trial(record) for record in train]
        self.changes = fit_circuit(trials, self.plan.fit.free, step=self.plan.step, evaluations=EVALUATIONS).changes

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Gauge pressures of tank and muscles [Pa], from those at the start, valve commands and angles."""
        outputs = run_trial(self._trial(record), self.changes, step=self.plan.step).outputs
        ambient = float(self.plan.environment.pressure_abs)
        return {name: np.asarray(outputs[f"{name}_abs"]) - ambient for name in record.initial}

    def _trial(self, record: BenchmarkRecord) -> Trial:
        needed = [f"{kind}_{muscle}" for kind in ("open", "angle") for muscle in MUSCLES]
        if record.time is None or not set(needed) <= set(record.inputs):
            raise InputError("task", None, "must be of the jumping robot: its circuit knows no other")
        count = len(record)
        # Where pressures are to be predicted, a trial still needs channels to compare: they hold their first value.
        pressures = {name: record.outputs.get(name, np.full(count, first)) for name, first in record.initial.items()}
        vented = np.median([first for name, first in record.initial.items() if name.startswith("muscle_")])
        channels = {name: Channel(values, "Pa", "measured") for name, values in pressures.items()}
        channels |= {name: Channel(record.inputs[name], "1", "measured") for name in needed}
        channels["room.pressure"] = Channel(np.full(count, vented), "Pa", "measured")
        return trial_of_recording(Recording(record.time, channels), self.plan, name=record.name)
