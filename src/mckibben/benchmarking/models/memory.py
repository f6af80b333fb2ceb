"""Friction with memory and creep as models of the benchmark: the fits of `mckibben.identification` to paths and steps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ...errors import InputError
from ...identification.creep_fit import LAWS, CreepFit, fit_creep
from ...identification.hysteresis_fit import AREA, SMOOTH, fit_loops
from ...identification.path_record import PathRecord
from ...quantities import to_si
from ..records import BenchmarkRecord

HELD = to_si(0.06, "bar", "Pa", field="pressure")  # of a pressure that is held, by a sensor of three digits
KNOTS = {"stroke": 9, "displacement": 5}  # of the curve; a pair moves by a tenth of a millimetre and is nearly linear
MOST = 400  # samples of a path; a longer record is thinned, for quasi-static friction knows no time
DRIVES = {"stroke": "pressure", "displacement": "force"}  # what moves along the path, and what moves it


class FrictionModel:
    """A smooth monotone curve with Dahl's or Bouc and Wen's friction, with or without creep, as the shown samples say.

    For a pair of muscles the force takes the place of the pressure, and each pressure of the closed muscles follows the
    displacement by a straight line, as their volume does for small motions.
    """

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit curve and friction to the shown samples of one record.

        Raises:
            InputError: the record is not of one path of stroke and pressure, or of displacement and force.
            ConvergenceError: the fit ended where it began.
        """
        record, *others = train
        self.moved = next((name for name in DRIVES if name in record.outputs), "")
        if others or record.time is None or DRIVES.get(self.moved) not in record.inputs:
            raise InputError("task", None, "must be one path of stroke or displacement: this friction knows no other")
        if self.moved == "stroke" and np.ptp(record.inputs["pressure"]) <= HELD:
            raise InputError("task", None, "must be of a path that turns: friction shows where the motion turns")
        step = -(-len(record) // MOST)
        path = record.every(step)
        measured = path.outputs[self.moved]
        shown = np.isfinite(measured)
        bridged = np.interp(np.arange(len(path)), np.flatnonzero(shown), measured[shown])  # only its range is read
        self.fitted = fit_loops(
            self._path(path, bridged),
            models=SMOOTH,
            train=shown,
            creeps=(0.0, float("nan")),
            known={"per_pressure": 0.0},
            knots=KNOTS[self.moved],
        )[0]
        self.lines = {
            name: np.polyfit(measured[shown], path.outputs[name][shown], 1)
            for name in record.outputs
            if name != self.moved
        }
        self.step = step

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """What moves along the path of the record that was shown in part, and what follows it."""
        return self.outputs(record, self.fitted.predicted)

    def outputs(self, record: BenchmarkRecord, path: np.ndarray) -> Mapping[str, np.ndarray]:
        """What moves along a record, of its values at the samples that the fit read, and what follows it."""
        at, every = np.arange(0, len(record), self.step), np.arange(len(record))
        moved = np.interp(every, at, path)
        return {self.moved: moved} | {name: np.polyval(line, moved) for name, line in self.lines.items()}

    def _path(self, record: BenchmarkRecord, moved: np.ndarray) -> PathRecord:
        drive = record.inputs[DRIVES[self.moved]]
        return PathRecord(drive if self.moved == "stroke" else drive / AREA, moved, record.name, record.time)


class FrictionDiscrepancy:
    """The curve with friction and creep of `FrictionModel`, and a discrepancy that is smooth along the path.

    Size and length of the discrepancy are found from the shown samples: see `identification.discrepancy`.
    """

    def __init__(self) -> None:
        self.friction = FrictionModel()

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit curve, friction and creep to the shown samples of one record, then the discrepancy.

        Raises:
            InputError: the record is not of one path of stroke and pressure, or of displacement and force.
            ConvergenceError: the fit ended where it began, or did not converge.
        """
        self.friction.fit(train)
        self.path = self.friction.fitted.with_discrepancy()

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """What moves along the path of the record that was shown in part, and what follows it."""
        return self.friction.outputs(record, self.path.predicted)


class CreepModel:
    """Kelvin-Voigt elements, free or alike; the shown samples choose by Akaike's criterion."""

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Fit to the shown samples of a step that is held.

        Raises:
            InputError: the record is not of stroke in time at a held pressure.
        """
        record, *others = train
        if others or record.time is None or "stroke" not in record.outputs:
            raise InputError("task", None, "must be the stroke after one step: creep knows no other")
        pressure, stroke = record.inputs["pressure"], record.outputs["stroke"]
        if np.ptp(pressure) > HELD:
            raise InputError("task", None, "must be of a held pressure: creep is what happens then")
        shown = np.isfinite(stroke)
        fits = [fit_creep(record.time, np.where(shown, stroke, 0.0), train=shown, law=law) for law in LAWS]
        self.fitted: CreepFit = min(fits, key=lambda fit: fit.aicc)

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Stroke at the times of the record."""
        if record.time is None:
            raise InputError("task", None, "must be the stroke after one step: creep knows no other")
        return {"stroke": self.fitted.predict(record.time)}
