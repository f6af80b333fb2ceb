"""Models in the benchmark, their runs on tasks, and shares of error with bootstrap intervals over muscles."""

from __future__ import annotations

import copy
import inspect
import math
import sys
import time
import traceback
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Annotated, Any, Protocol, runtime_checkable

import numpy as np

from mckibben._version import __version__
from mckibben.answers import Answer, Column, Table, brief
from mckibben.documents import JsonValue, parse_json, read_text
from mckibben.errors import ConvergenceError, InputError, MissingDataError
from mckibben.muscles.law import TensionLaw
from mckibben.muscles.laws import LAWS
from mckibben.registry import Registry, is_reference, load_reference, named_by_person
from mckibben.verbs import DataFolder, ParameterType, verb

from .datasets import BenchmarkRecord, DataSplit
from .tasks import TASKS, BenchmarkTask, task
from .validation import measured_data
from .validation_page import DASH


@runtime_checkable
class BenchmarkModel(Protocol):
    """A model that takes part in the benchmark; any class with these two methods does.

    Every fold has a new model, so that none remembers what another fold was shown; `fit` is called once, then `predict`. A
    model that cannot do a task raises `InputError` with the reason. The arrays of records cannot be written to: copy those
    that you change.

    Examples:
        >>> import numpy as np
        >>> import mckibben as mk
        >>> class Mean:
        ...     def fit(self, train):
        ...         self.value = np.mean(np.concatenate([r.outputs["tension"] for r in train]))
        ...     def predict(self, record):
        ...         return {"tension": np.full(len(record), self.value)}
        >>> from mckibben_benchmark import run_task, task
        >>> chosen = task("map-above-4-bar")
        >>> run_task(chosen, chosen.load(), "mean", model=Mean()).rms() > 0.2
        True
    """

    def fit(self, train: Sequence[BenchmarkRecord]) -> object:
        """Learn from records with outputs; an output is NaN where it is hidden."""

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Predict the outputs of a record from its inputs, by name, each (n,) [SI]."""


def required_of_model(kind: object) -> str | None:
    """What something must be to take part; None where it does."""
    if isinstance(kind, type) and issubclass(kind, TensionLaw):
        return None
    if not isinstance(kind, type):
        return "a class with the methods fit and predict, or a tension law"
    missing = [name for name in ("fit", "predict") if not callable(getattr(kind, name, None))]
    return f"complete; missing: {', '.join(missing)}" if missing else None


# Models beside the tension laws, each in a module that is loaded on first use: with physics, and without, to compare with.
PHYSICS = {
    "friction": f"{__package__}.physics:FrictionModel",
    "friction_discrepancy": f"{__package__}.physics:FrictionDiscrepancy",
    "seated_braid_memory": f"{__package__}.physics:SeatedBraidMemory",
    "creep": f"{__package__}.physics:CreepModel",
    "kang": f"{__package__}.physics:KangModel",
    "seated_braid_between": f"{__package__}.physics:ReadMuscle",
    "robot_circuit": f"{__package__}.physics:RobotCircuit",
}
COMPETITORS = {
    "gaussian_process": f"{__package__}.learned:GaussianProcess",
    "perceptron": f"{__package__}.learned:Perceptron",
    "gru": f"{__package__}.learned:GatedRecurrentUnit",
    "neural_ode": f"{__package__}.learned:NeuralODE",
    "koopman": f"{__package__}.learned:ExtendedDMD",
}
MODELS: Registry[Callable[[], BenchmarkModel]] = Registry(
    "mckibben.models", "model", PHYSICS | COMPETITORS, accept=required_of_model
)


def model_names(*, competitors: bool = True) -> tuple[str, ...]:
    """Names of all models: the tension laws, then the others.

    Args:
        competitors: with those that know no physics.
    """
    return (*LAWS, *(name for name in MODELS if competitors or name not in COMPETITORS))


def new_model(name: str) -> BenchmarkModel:
    """An untrained model.

    Args:
        name: of a tension law or of a model, such as ``seated_braid``, ``my.py:MyLaw`` or ``my.py:MyModel``.

    Raises:
        InputError: there is none of that name, or it has not what the benchmark needs.
    """
    from .physics import LawModel

    named_by_person(name)
    if is_reference(name):
        kind: Any = load_reference(name, field="model")
        if inspect.isclass(kind) and issubclass(kind, TensionLaw):
            return LawModel(name)
        made = MODELS.find(name)
        try:
            return made()
        except Exception as error:
            words = (str(error).strip().splitlines() or [""])[0]
            problem = (
                f"must be a class that can be called without arguments, which raised {type(error).__name__}: {words}"
            )
            raise InputError("model", name, problem) from error
    if name in LAWS:
        return LawModel(name)
    return MODELS.find(name)()


DRAWS, SEED = 2000, 1
FEWEST_MUSCLES = 3  # with fewer the interval is over what is left out


@dataclass(frozen=True)
class RecordScore:
    """Errors of one phase of a predicted record, relative to the scale of its muscle.

    Attributes:
        fold: what was left out.
        muscle: of the record.
        phase: of a run, empty if it has none.
        sum_squares: of the shares of error.
        count: of the samples.
        largest: share of error.
        total: sum of the signed shares of error.
    """

    fold: str
    muscle: str
    phase: str
    sum_squares: float
    count: int
    largest: float
    total: float

    def __add__(self, other: RecordScore) -> RecordScore:
        """The score of both, of the same phase of what was left out."""
        return replace(
            self,
            sum_squares=self.sum_squares + other.sum_squares,
            count=self.count + other.count,
            largest=max(self.largest, other.largest),
            total=self.total + other.total,
        )


@dataclass(frozen=True)
class TaskScore:
    """Result of a model on a task; `reason` says why it has none.

    Attributes:
        task: its name.
        model: its name.
        records: scores of all predicted records.
        seconds: of processor time, to train and to predict.
        reason: in words, empty if there is a result.
        date: on which it was computed.
    """

    task: str
    model: str
    records: tuple[RecordScore, ...] = ()
    seconds: float = 0.0
    reason: str = ""
    date: str = ""

    __repr__ = brief

    @classmethod
    def from_dict(cls, row: Mapping[str, Any], *, where: str | None = None) -> TaskScore:
        """A result as `to_dict` stores it.

        Raises:
            InputError: something is missing.
        """
        try:
            records = tuple(RecordScore(**part) for part in row["parts"])
            return cls(row["task"], row["model"], records, float(row["seconds"]), row["reason"], row["date"])
        except (KeyError, TypeError, ValueError) as error:
            raise InputError("scores", None, f"must be those of a benchmark; wrong is {error}", where=where) from None

    def to_dict(self) -> dict[str, JsonValue]:
        """All figures as plain values; `parts` are the sums of each phase of what was left out."""
        low, high = self.interval() if self.records else (float("nan"), float("nan"))
        merged: dict[tuple[str, str, str], RecordScore] = {}
        for one in self.records:
            key = one.fold, one.muscle, one.phase
            merged[key] = one + merged[key] if key in merged else one
        return {
            "task": self.task,
            "model": self.model,
            "rms": self.rms(),
            "low": low,
            "high": high,
            "largest": self.largest(),
            "bias": self.bias(),
            "phases": {p: {"rms": self.rms(p), "bias": self.bias(p)} for p in self.phases},
            "interval_over": "muscles" if self.over_muscles else "what is left out",
            "seconds": self.seconds,
            "date": self.date,
            "reason": self.reason,
            "parts": [asdict(part) for part in merged.values()],
        }

    def rms(self, phase: str | None = None) -> float:
        """Root mean square share of error, of one phase if it is named; NaN without a result."""
        some = self._of(phase)
        count = sum(r.count for r in some)
        return float(np.sqrt(sum(r.sum_squares for r in some) / count)) if count else float("nan")

    def bias(self, phase: str | None = None) -> float:
        """Mean signed share of error; NaN without a result."""
        some = self._of(phase)
        count = sum(r.count for r in some)
        return sum(r.total for r in some) / count if count else float("nan")

    def largest(self, phase: str | None = None) -> float:
        """Largest share of error; NaN without a result."""
        return max((r.largest for r in self._of(phase)), default=float("nan"))

    @property
    def over_muscles(self) -> bool:
        """Whether the interval is over muscles; otherwise it is over what is left out."""
        return len({r.muscle for r in self.records}) >= FEWEST_MUSCLES

    def interval(self, *, draws: int = DRAWS) -> tuple[float, float]:
        """95 % interval of the rms share of error, by a bootstrap over muscles or over what is left out.

        NaN without a result, and where there is one unit only.
        """
        units = [r.muscle if self.over_muscles else r.fold for r in self.records]
        names = list(dict.fromkeys(units))
        if len(names) < 2:
            return float("nan"), float("nan")
        number = np.array([names.index(unit) for unit in units])
        squares = np.bincount(number, weights=[r.sum_squares for r in self.records])
        counts = np.bincount(number, weights=[r.count for r in self.records])
        drawn = np.random.default_rng(SEED).integers(0, len(names), size=(draws, len(names)))
        values = np.sqrt(squares[drawn].sum(axis=1) / counts[drawn].sum(axis=1))
        low, high = np.quantile(values, [0.025, 0.975])
        return float(low), float(high)

    def _of(self, phase: str | None) -> list[RecordScore]:
        return [r for r in self.records if phase is None or r.phase == phase]

    @property
    def phases(self) -> tuple[str, ...]:
        """Phases of the records, in their order."""
        return tuple(dict.fromkeys(r.phase for r in self.records if r.phase))


def scales(folds: Sequence[DataSplit], *, swing: bool = False) -> dict[tuple[str, str], float]:
    """What errors relate to: (muscle, output) -> value [SI].

    Args:
        folds: of a task.
        swing: take the largest less the smallest measured value, instead of the largest.
    """
    values: dict[tuple[str, str], list[np.ndarray]] = {}
    for fold in folds:
        for record in (*fold.test, *fold.train):
            for name, measured in record.outputs.items():
                values.setdefault((record.muscle, name), []).append(measured[np.isfinite(measured)])
    whole = {key: np.concatenate(parts) for key, parts in values.items()}
    return {key: float(np.ptp(v) if swing else np.abs(v).max()) for key, v in whole.items()}


def score_record(
    record: BenchmarkRecord, predicted: object, scored: np.ndarray, fold: str, scale: Mapping[tuple[str, str], float]
) -> list[RecordScore]:
    """Score a prediction, phase by phase.

    Args:
        record: with the measured outputs.
        predicted: a mapping from names to values, each (n,).
        scored: which samples count, bool (n,).
        fold: its name.
        scale: of each output of each muscle [SI].

    Raises:
        InputError: an output is missing, has another shape, or is not finite.
    """
    if not isinstance(predicted, Mapping):
        said = f"must be a mapping from {', '.join(record.outputs)} to values, got {type(predicted).__name__}"
        raise InputError("prediction", None, said, where=record.name)
    shares = []
    for name, measured in record.outputs.items():
        if name not in predicted:
            raise InputError("prediction", None, f"must have the output {name!r}", where=record.name)
        try:
            if np.iscomplexobj(predicted[name]):
                raise TypeError("they are complex")
            values = np.asarray(predicted[name], float)
        except (TypeError, ValueError) as error:
            raise InputError(name, None, f"must be an array of numbers: {error}", where=record.name) from None
        if values.shape != measured.shape:
            said = f"must have the shape {measured.shape}, got {values.shape}"
            raise InputError(name, None, said, where=record.name)
        if not np.isfinite(values[scored]).all():
            raise InputError(name, None, "must be finite wherever it is scored", where=record.name)
        shares.append((values - measured) / scale[record.muscle, name])
    phases = np.full(len(record), "") if record.phase is None else record.phase
    each, scores = np.stack(shares), []
    for phase in dict.fromkeys(phases[scored].tolist()):
        some = each[:, scored & (phases == phase)]
        sums = float(np.sum(some**2)), some.size, float(np.abs(some).max()), float(np.sum(some))
        scores.append(RecordScore(fold, record.muscle, phase, *sums))
    return scores


COLUMNS = ("model", "rms", "95 % interval", "largest", "bias")


def percent(share: float, *, sign: bool = False) -> str:
    """A share as text in per cent; more than the whole is ``over``."""
    return "over" if abs(share) > 1.0 else f"{100.0 * share:{'+' if sign else ''}.2f} %"


def interval(score: TaskScore) -> str:
    """The 95 % interval of the rms error as text."""
    low, high = score.interval()
    return DASH if math.isnan(low) else f"{percent(low)} to {percent(high)}"


def cells_of(result: BenchmarkResult, name: str) -> list[list[str]]:
    """Cells of the table of one task, best model first, in the order of `COLUMNS`."""
    return [
        [score.model, percent(score.rms()), interval(score), percent(score.largest()), percent(score.bias(), sign=True)]
        for score in result.of(name)
    ]


@dataclass(frozen=True)
class BenchmarkResult(Answer):
    """Scores of models on tasks.

    Attributes:
        scores: of every model on every task whose data are at hand; models that a task does not suit have a reason.
        absent: tasks whose data are not at hand, with the sentence that says where they are.
        command: that computes it anew; empty of what was read.
    """

    scores: tuple[TaskScore, ...]
    absent: dict[str, str] = field(default_factory=dict)
    command: str = ""

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
        made = {"command": self.command, "version": __version__, "processor_minutes": self.seconds / 60.0}
        return made | {"scores": [one.to_dict() for one in self.scores], "absent": dict(self.absent)}

    def tables(self) -> list[Table]:
        """A table per task, with the models that have no result below."""
        columns = [Column(name, right=bool(i)) for i, name in enumerate(COLUMNS)]
        made = []
        for name in self.tasks:
            one = task(name)
            title = f"{one.title}: errors as shares of {'the swing' if one.of_swing else 'the largest tension'}"
            rows = [dict(zip(COLUMNS, cells, strict=True)) for cells in cells_of(self, name)]
            said = [sentence.replace("`", "") for sentence in self.refusals(name)]
            made.append(Table(title, tuple(columns), rows, (*said, one.note)))
        return made

    def remarks(self) -> list[str]:
        """The tasks that were not run, and why."""
        return [f"{name} was not run: {reason}." for name, reason in self.absent.items()]

    def refusals(self, name: str) -> list[str]:
        """A sentence for each reason why models have no result on a task."""
        reasons: dict[str, list[str]] = {}
        for model, reason in self.refused(name).items():
            reasons.setdefault(reason, []).append(f"`{model}`")
        return [f"No result of {', '.join(models)}: {reason}." for reason, models in reasons.items()]

    @classmethod
    def read(cls, path: str | Path) -> BenchmarkResult:
        """Read a result that the command stored by ``--out result.json``.

        Raises:
            InputError: the file cannot be read, or is no such result.
        """
        try:
            content: Any = parse_json(read_text(path, form="JSON"))
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
        model: the model itself, if it is not one of that name; a copy of it is fitted for each fold.

    Returns:
        The scores, or the reason why the model cannot do the task.
    """
    every = tuple(folds)
    date = datetime.now(UTC).date().isoformat()
    scale, scored = scales(every, swing=chosen.of_swing), []
    began = time.process_time()
    try:
        for fold in every:
            contender = new_model(name) if model is None else copy.deepcopy(model)
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
        packages = [str(Path(str(sys.modules[name].__file__)).parent) for name in ("mckibben", __package__)]
        frames = traceback.extract_tb(error.__traceback__)
        own = [frame for frame in frames if not frame.filename.startswith((*packages, sys.prefix, sys.base_prefix))]
        place = f" in {own[-1].name}, line {own[-1].lineno} of {Path(own[-1].filename).name}" if own else ""
        words = (str(error).strip().splitlines() or [""])[0].rstrip(".")
        reason = f"{name} raised {type(error).__name__}{place}" + (f": {words}" if words else "")
    else:
        return TaskScore(chosen.name, name, tuple(scored), time.process_time() - began, date=date)
    return TaskScore(chosen.name, name, seconds=time.process_time() - began, reason=reason, date=date)


ModelName = Annotated[str, ParameterType("LAW|FILE.py:CLASS")]
TaskName = Annotated[str, ParameterType("TASK")]
EarlierScores = Annotated[Any, ParameterType("SCORES")]  # a file, or the result itself


@verb
def benchmark(
    models: Sequence[ModelName] = (),
    *,
    tasks: Sequence[TaskName] = (),
    folder: DataFolder | None = None,
    competitors: bool = False,
    earlier: EarlierScores | None = None,
    progress: Callable[[str], None] | None = None,
) -> BenchmarkResult:
    """Train models on measured tasks, and score their predictions of what they were not shown.

    A model of your own is a class with the methods fit(train) and predict(record), or a tension law. Tasks
    whose data are not at hand are named. All laws on all tasks take some minutes; with --all, models without
    physics take part: a Gaussian process, a perceptron, a gated recurrent unit, a neural ODE and Koopman's operator.

    Args:
        models: law, other model, or one of your own such as my.py:MyModel; all by default.
        tasks: task, such as map-above-4-bar; all by default.
        folder: folder of measured data; by default the one that MCKIBBEN_DATA names. Without either, only the tasks whose
            data ship are done.
        competitors: run the competitors without physics too, which takes a quarter of an hour.
        earlier: earlier result whose scores are not computed again.
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
    known = earlier if earlier is None or isinstance(earlier, BenchmarkResult) else BenchmarkResult.read(earlier)
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
            before = None if known is None else known.score(one.name, name)
            scores.append(before or run_task(one, folds, name))
    if not scores:
        raise MissingDataError("; ".join(f"{name}: {reason}" for name, reason in absent.items()))
    words = ["mckibben benchmark", *["--all"] * competitors]
    words += [] if earlier is None or known is earlier else [f"--earlier {Path(earlier).name}"]
    words += [*(f"--task {one}" for one in tasks), *(f"--model {one}" for one in models)]
    return BenchmarkResult(tuple(scores), absent, " ".join(words))


def stages(models: Iterable[str] = (), tasks: Iterable[str] = (), *, competitors: bool = False) -> int:
    """Largest number of progress reports of `benchmark`."""
    return len(tuple(models) or model_names(competitors=competitors)) * len(tuple(tasks) or TASKS)
