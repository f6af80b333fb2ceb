"""Runs of models on tasks."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from ..answers import brief
from ..documents import JsonValue, parse_json, read_text
from ..errors import ConvergenceError, InputError, MissingDataError
from ..registry import is_reference
from ..studies.validation import measured_data
from .model import BenchmarkModel, model_names, new_model
from .records import DataSplit
from .scores import TaskScore, scales, score_record
from .tasks import TASKS, BenchmarkTask, task


@dataclass(frozen=True)
class BenchmarkResult:
    """Scores of models on tasks.

    Attributes:
        scores: of every model on every task whose data are at hand; models that a task does not suit have a reason.
        absent: tasks whose data are not at hand, with the sentence that says where they are.
    """

    scores: tuple[TaskScore, ...]
    absent: dict[str, str] = field(default_factory=dict)

    __repr__ = brief

    def of(self, name: str) -> list[TaskScore]:
        """Scores on one task, best first."""
        done = [s for s in self.scores if s.task == name and s.records]
        return sorted(done, key=lambda s: s.rms())

    def refused(self, name: str) -> dict[str, str]:
        """Models without a result on a task, with the reason."""
        return {s.model: s.reason for s in self.scores if s.task == name and not s.records}

    @property
    def tasks(self) -> tuple[str, ...]:
        """Names of the tasks with results, in their order."""
        return tuple(dict.fromkeys(s.task for s in self.scores))

    def to_dict(self) -> dict[str, JsonValue]:
        """All figures as plain values, for JSON; errors are shares of the largest measured tension of the muscle."""
        return {"scores": [one.to_dict() for one in self.scores], "absent": dict(self.absent)}

    @classmethod
    def read(cls, path: str | Path) -> BenchmarkResult:
        """Read a result that the command stored by ``--out result.json``.

        Raises:
            InputError: the file cannot be read, or is no such result.
        """
        try:
            content: Any = parse_json(read_text(path))
        except ValueError as error:
            raise InputError("file", None, f"is not JSON: {error}", where=str(path)) from None
        rows = content.get("scores") if isinstance(content, dict) else None
        if not isinstance(rows, list) or not all(isinstance(row, dict) for row in rows):
            raise InputError("scores", None, "is missing: the file must be a result of the benchmark", where=str(path))
        absent = content.get("absent")
        scores = tuple(TaskScore.from_dict(row, where=str(path)) for row in rows)
        return cls(scores, absent if isinstance(absent, dict) else {})

    def score(self, task: str, model: str) -> TaskScore | None:
        """The result of a model on a task, if it was computed."""
        return next((s for s in self.scores if (s.task, s.model) == (task, model)), None)

    @property
    def seconds(self) -> float:
        """Processor time of all results [s]."""
        return sum(s.seconds for s in self.scores)


def run_task(
    chosen: BenchmarkTask, folds: Iterable[DataSplit], name: str, *, model: BenchmarkModel | None = None
) -> TaskScore:
    """Train and score a model on the folds of a task.

    Args:
        chosen: the task.
        folds: of the task, see `BenchmarkTask.load`.
        name: of the model.
        model: the model itself, if it is not one of that name.

    Returns:
        The scores, or the reason why the model cannot do the task.
    """
    every = tuple(folds)
    date = datetime.now(UTC).date().isoformat()
    scale, scored = scales(every, swing=chosen.of_swing), []
    began = time.process_time()
    try:
        contender = new_model(name) if model is None else model
        for fold in every:
            contender.fit(fold.train)
            for record, counted in zip(fold.test, fold.scored, strict=True):
                predicted = contender.predict(record.unseen())
                scored += score_record(record, predicted, counted, fold.name, scale)
    except (InputError, ConvergenceError) as error:
        reason = str(error)
    except Exception as error:
        if model is None and not is_reference(name):
            raise  # a model of this package has a bug
        # What went wrong in a model that someone else wrote, and the last of its own lines, in one sentence
        package = str(Path(__file__).parents[1])
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if not frame.filename.startswith((package, sys.prefix, sys.base_prefix))]
        place = f" in {own[-1].name}, line {own[-1].lineno} of {Path(own[-1].filename).name}" if own else ""
        words = (str(error).strip().splitlines() or [""])[0].rstrip(".")
        reason = f"{name} raised {type(error).__name__}{place}" + (f": {words}" if words else "")
    else:
        return TaskScore(chosen.name, name, tuple(scored), time.process_time() - began, date=date)
    return TaskScore(chosen.name, name, seconds=time.process_time() - began, reason=reason, date=date)


def benchmark(
    models: Iterable[str] = (),
    *,
    tasks: Iterable[str] = (),
    folder: str | Path | None = None,
    competitors: bool = False,
    earlier: BenchmarkResult | None = None,
    progress: Callable[[str], None] | None = None,
) -> BenchmarkResult:
    """Train models on the tasks of the benchmark, and score their predictions of what they were not shown.

    Args:
        models: names, such as ``seated_braid`` or ``my.py:MyModel``; all of this package by default.
        tasks: names, such as ``map-pressure-out``; all by default.
        folder: of measured data; the one that MCKIBBEN_DATA names where left out. Without either, only the tasks whose
            data ship are done.
        competitors: by default also models without physics, which take a quarter of an hour.
        earlier: results that are not computed again.
        progress: called with a description of the next piece of work, once for each model on each task.

    Raises:
        InputError: for an unknown name, a folder that is not there, or data with another content.
        MissingDataError: the data of none of the tasks are at hand.

    Examples:
        >>> import mckibben as mk
        >>> result = mk.benchmark(["ideal"], tasks=["map-above-4-bar"])
        >>> 0.1 < result.of("map-above-4-bar")[0].rms() < 0.4
        True
    """
    chosen = [task(name) for name in (tuple(tasks) or TASKS)]
    names = tuple(models) or model_names(competitors=competitors)
    for name in names:
        new_model(name)  # refuses a wrong word before anything is computed
    data, tell = measured_data(folder), progress or (lambda _: None)
    scores: list[TaskScore] = []
    absent: dict[str, str] = {}
    for one in chosen:
        try:
            folds = one.load(data)
        except MissingDataError as error:
            absent[one.name] = str(error)
            continue
        for name in names:
            tell(f"{one.name}, {name}")
            known = earlier and earlier.score(one.name, name)
            scores.append(known or run_task(one, folds, name))
    if not scores:
        raise MissingDataError("; ".join(f"{name}: {reason}" for name, reason in absent.items()))
    return BenchmarkResult(tuple(scores), absent)


def stages(models: Iterable[str] = (), tasks: Iterable[str] = (), *, competitors: bool = False) -> int:
    """Largest number of progress reports of `benchmark`."""
    return len(tuple(models) or model_names(competitors=competitors)) * len(tuple(tasks) or TASKS)
