"""Prediction of pressures in a jumping robot, by a circuit that was fitted to its other jumps.

The trials are those of the GTDynamics project (Georgia Tech Research Corp.; BSD-style licence, not shipped): a folder per
trial with ``pres_filt.txt`` (time, tank and four muscle pressures, kPa gauge), ``t_valve.txt`` (when the four valves were
opened and closed, s), ``angle_pre.txt`` and ``vid_time.txt`` (joint angles, rad, and the times of the camera's frames, s).
What the circuit is told of a trial are its first pressures, the commands of its valves and how far its joints have turned;
the camera's first frame is taken as the start. All the rest is compared.
"""

from __future__ import annotations

import dataclasses
import functools
from collections.abc import Callable, Sequence
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from mckibben.answers import Answer, Caution, Column, Table
from mckibben.assembly.circuit_file import CircuitPlan, read_circuit
from mckibben.documents import JsonValue
from mckibben.errors import InputError, MissingDataError
from mckibben.identification import CircuitFit, Trial, fit_circuit
from mckibben.identification.trial import trial_from_record
from mckibben.recordings import Channel, Recording, read_record
from mckibben.verbs import Count, DataFolders, ParameterPath, verb

MUSCLES = ("knee_right", "hip_right", "hip_left", "knee_left")  # in the order of the files
PRESSURES, VALVES, ANGLES, FRAMES = "pres_filt.txt", "t_valve.txt", "angle_pre.txt", "vid_time.txt"


def robot_plan() -> CircuitPlan:
    """Circuit of the robot's air, with first guesses and free parameters."""
    with resources.as_file(resources.files(__package__) / "jumping_robot.toml") as path:
        return read_circuit(path)


def read_trial(folder: str | Path) -> Recording:
    """Read the folder of a trial as a recording: measured pressures, valve commands, and angles turned since the start.

    Time is that of the valves' commands, in whole periods from 0; most records begin 1 ms after that, and hold their first
    pressures until then.

    Raises:
        MissingDataError: if a file is not there.
        InputError: names the file and what is wrong with it.
    """
    folder = Path(folder)
    for name in (PRESSURES, VALVES, ANGLES, FRAMES):
        if not (folder / name).is_file():
            raise MissingDataError(f"{folder}: no {name}; a trial's folder holds it")
    names = ("tank", *(f"muscle_{m}" for m in MUSCLES))
    columns: dict[str, str | int] = {"time": 1}
    columns.update({f"{n}.pressure": i for i, n in enumerate(names, 2)})
    units = {f"{n}.pressure": "kPa" for n in names}
    record = _on_the_valves_clock(read_record(folder / PRESSURES, columns=columns, units=units))
    opened, closed = _numbers(folder / VALVES, (2, len(MUSCLES)))
    angles = _numbers(folder / ANGLES, (None, len(MUSCLES)))
    frames = _numbers(folder / FRAMES, (None, 1))[:, 0]
    count = min(len(angles), len(frames))
    clock = frames[:count] - frames[0]
    if not (np.diff(clock) > 0.0).all():
        raise InputError(FRAMES, None, "must have times that rise", where=str(folder))
    first = [float(record[f"muscle_{m}.pressure"][0]) for m in MUSCLES]
    vented = np.full(len(record.time), np.median(first))
    added = {"room.pressure": Channel(vented, unit="Pa", kind="measured", meaning="what vented muscles read")}
    for i, m in enumerate(MUSCLES):
        is_open = (record.time >= opened[i] - 1e-9) & (record.time < closed[i] - 1e-9)
        added[f"open_{m}"] = Channel(is_open.astype(float), unit="1", kind="command")
        turned = np.abs(np.interp(record.time, clock, angles[:count, i] - angles[0, i]))
        added[f"angle_{m}"] = Channel(
            turned, unit="1", kind="measured", meaning="angle turned since the start, in radians"
        )
    return record.with_channels(added).with_meta(title=folder.name)


def _on_the_valves_clock(record: Recording) -> Recording:
    """A record interpolated to multiples of its period from 0, when the first valves were switched on."""
    period = record.period
    time = period * np.arange(int(np.floor(record.time[-1] / period + 1e-9)) + 1)
    channels = {n: c.with_values(np.interp(time, record.time, c.values)) for n, c in record.channels.items()}
    return Recording(time, channels, record.meta)


def robot_trial(folder: str | Path, plan: CircuitPlan) -> Trial:
    """Read a trial's folder for comparison."""
    return trial_of_recording(read_trial(folder), plan, name=Path(folder).name)


def trial_of_recording(record: Recording, plan: CircuitPlan, *, name: str) -> Trial:
    """Prepare a recording as `read_trial` makes it for comparison; valves' lines begin at the pressure of their muscles."""
    lines = {f"line_{m}": f"muscle_{m}" for m in MUSCLES}
    trial = trial_from_record(plan, record, name=name)
    first = {line: trial.initial[muscle] for line, muscle in lines.items()}
    return trial.replace(initial={**trial.initial, **first})


def robot_study(
    fitted: Sequence[str | Path],
    predicted: Sequence[str | Path] = (),
    *,
    free: Sequence[str] = (),
    evaluations: int = 40,
    progress: Callable[[str], None] | None = None,
) -> tuple[CircuitFit, list[Trial]]:
    """Fit tank, tubes, valves and muscle volumes to some trials and predict others with them.

    Args:
        fitted: folders of the trials that are fitted.
        predicted: folders of those that are only predicted.
        free: parameters to fit instead of the circuit's own list.
        evaluations: most of them.
        progress: called with a sentence after every evaluation.

    Returns:
        The fit, and all its trials in that order.
    """
    plan = robot_plan()
    trials, others = ([robot_trial(f, plan) for f in folders] for folders in (fitted, predicted))
    result = fit_circuit(
        trials, free or plan.fit.free, predict=others, step=plan.step, progress=progress, evaluations=evaluations
    )
    return result, [*trials, *others]


class RobotFold(NamedTuple):
    """A jump that was predicted from the others: its name, and the fit to the others with its prediction."""

    trial: str
    fit: CircuitFit

    @property
    def rms(self) -> float:
        """Error of its predicted pressures [Pa]."""
        return self.fit.rms(fitted=False)


def robot_folds(
    folders: Sequence[str | Path],
    *,
    free: Sequence[str] = (),
    evaluations: int = 40,
    progress: Callable[[str], None] | None = None,
) -> tuple[tuple[RobotFold, ...], list[Trial]]:
    """Predict each trial by a fit to all the others.

    Args:
        folders: folders of the trials, three or more with different names.
        free: parameters to fit instead of the circuit's own list.
        evaluations: most of them, for each fit.
        progress: called with a sentence after every evaluation.

    Returns:
        A fold for each trial, and the trials, both in that order.

    Raises:
        InputError: there are fewer than three trials, or two of one name.
    """
    names = [Path(folder).name for folder in folders]
    if len(folders) < 3 or len(set(names)) < len(names):
        demand = "must be three or more with different names, to predict each from the others"
        raise InputError("trials", ", ".join(names), demand)
    folds, trials = [], []

    def told(name: str, words: str) -> None:
        if progress is not None:
            progress(f"without {name}: {words}")

    for left in folders:
        tell = None if progress is None else functools.partial(told, Path(left).name)
        fitted = [folder for folder in folders if folder != left]
        result, all_trials = robot_study(fitted, [left], free=free, evaluations=evaluations, progress=tell)
        folds.append(RobotFold(Path(left).name, result))
        trials.append(all_trials[-1])
    return tuple(folds), trials


def merged_folds(folds: Sequence[RobotFold]) -> CircuitFit:
    """Return the first fit with the predictions and errors of all folds in place of its own, to be drawn."""
    first = folds[0].fit
    return dataclasses.replace(
        first,
        errors=tuple(e for fold in folds for e in fold.fit.errors if not e.fitted),
        predicted={fold.trial: fold.fit.predicted[fold.trial] for fold in folds},
    )


@dataclasses.dataclass(frozen=True)
class RobotFit(Answer):
    """The air of a jumping robot, fitted to some of its jumps: what `robot_fit` computes.

    Attributes:
        title: of the circuit.
        fit: the parameters and all errors; of jumps that were each predicted from the others, those of the predictions.
        trials: the jumps, fitted ones first.
        folds: a fit without each jump; empty where one fit predicts.
        cautions: none; what is said against a fit is among its warnings.
    """

    title: str
    fit: CircuitFit
    trials: tuple[Trial, ...]
    folds: tuple[RobotFold, ...] = ()
    cautions: tuple[Caution, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """The fit, or the errors and the fit of each fold, as plain values [SI]."""
        if not self.folds:
            return self.fit.to_dict()
        return {
            "rms": {fold.trial: fold.rms for fold in self.folds},
            "trials": {fold.trial: fold.fit.to_dict() for fold in self.folds},
        }

    def tables(self) -> list[Table]:
        """Parameters and errors of the fit, or the errors of each jump that was predicted from the others."""
        if not self.folds:
            return self.fit.tables(self.title)
        rows = []
        for fold in self.folds:
            errors = [e.rms for e in fold.fit.errors if not e.fitted]
            names = (*self.trials[0].channels, "all", "fitted")
            row: dict[str, Any] = dict(zip(names, (*errors, fold.rms, fold.fit.rms()), strict=True))
            rows.append(row | {"trial": fold.trial})
        heads = {c: c.split(".")[0].replace("_", " ") for c in self.trials[0].channels}
        heads |= {"all": "all", "fitted": "fit to the others"}
        numbers = (Column(key, title, "Pa", shown="mbar", places=".0f") for key, title in heads.items())
        lost = [
            f"The search without {fold.trial} did not converge: {fold.fit.message}."
            for fold in self.folds
            if not fold.fit.converged
        ]
        columns = (Column("trial", "predicted from the others"), *numbers)
        return [Table(f"{self.title}: rms errors", columns, rows, tuple(lost))]


@verb
def robot_fit(
    *trials: DataFolders,
    predict: DataFolders | None = None,
    each: bool = False,
    free: Sequence[ParameterPath] | None = None,
    evaluations: Count = 40,
    progress: Callable[[str], None] | None = None,
) -> RobotFit:
    """Fit the air of a jumping robot to some of its jumps, and predict the others.

    Args:
        trials: folders of the trials to fit, one each.
        predict: trial to predict with the fitted parameters.
        each: predict each trial by a fit to all the others.
        free: parameter to fit instead of all 21.
        evaluations: largest number of evaluations of the circuit.
        progress: called with a sentence after every evaluation.

    Raises:
        InputError: a folder or a file in it is missing, or what is predicted is not allowed together.
        ConvergenceError: the fit ended where it began.
    """
    if evaluations < 1:
        raise InputError("evaluations", evaluations, "must be 1 or more")
    if each and predict:
        raise InputError("predict", str(predict[0]), "is allowed only without {each=True}, which predicts every trial")
    options: dict[str, Any] = {"free": free or (), "evaluations": evaluations, "progress": progress}
    title = robot_plan().title
    if each:
        folds, every = robot_folds(trials, **options)
        return RobotFit(title, merged_folds(folds), tuple(every), folds)
    fit, every = robot_study(trials, predict or (), **options)
    return RobotFit(title, fit, tuple(every))


def _numbers(path: Path, shape: tuple[int | None, int]) -> np.ndarray:
    """A table of numbers without a header; lines that begin with # are skipped."""
    try:
        values = np.loadtxt(path, delimiter=",", ndmin=2)
    except ValueError as error:
        raise InputError("file", None, f"is not a table of numbers: {error}", where=str(path)) from None
    if values.shape[1] != shape[1] or (shape[0] is not None and values.shape[0] != shape[0]) or len(values) < 2:
        rows = "several" if shape[0] is None else str(shape[0])
        raise InputError(
            "file", None, f"must have {rows} rows of {shape[1]} numbers, got shape {values.shape}", where=str(path)
        )
    if not np.isfinite(values).all():
        raise InputError("file", None, "must have finite numbers", where=str(path))
    return values
