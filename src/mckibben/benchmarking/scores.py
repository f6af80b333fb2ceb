"""Figures of merit: shares of error, root mean square and largest, with bootstrap intervals over muscles."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from ..answers import brief
from ..documents import JsonValue
from ..errors import InputError
from .records import BenchmarkRecord, DataSplit

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
    record: BenchmarkRecord,
    predicted: object,
    scored: np.ndarray,
    fold: str,
    scale: Mapping[tuple[str, str], float],
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
    return list(_by_phase(np.stack(shares), phases, scored, fold, record.muscle))


def _by_phase(
    shares: np.ndarray, phases: np.ndarray, scored: np.ndarray, fold: str, muscle: str
) -> Iterable[RecordScore]:
    for phase in dict.fromkeys(phases[scored].tolist()):
        some = shares[:, scored & (phases == phase)]
        yield RecordScore(
            fold, muscle, phase, float(np.sum(some**2)), some.size, float(np.abs(some).max()), float(np.sum(some))
        )
