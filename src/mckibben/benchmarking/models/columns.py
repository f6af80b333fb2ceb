"""What models without physics learn from: standardised columns of records, and samples held back to choose by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..records import BenchmarkRecord

LAGS = (1, 3, 10, 30)  # samples of the thinned clock, for models that remember nothing themselves
SHARE, SEED = 0.2, 1  # of static points that are held back


@dataclass(frozen=True)
class RecordColumns:
    """Standardised inputs and outputs of records.

    Attributes:
        outputs: their names, in order.
        step: every how many samples a record in time is read.
        lags: earlier samples whose inputs are columns too, and the time is another; None for models with a memory.
        centre: mean of each input column.
        size: standard deviation of each input column; one where it is constant.
        target_centre: mean of each output.
        target_size: standard deviation of each output.
    """

    outputs: tuple[str, ...]
    step: int
    lags: tuple[int, ...] | None
    centre: np.ndarray
    size: np.ndarray
    target_centre: np.ndarray
    target_size: np.ndarray

    @classmethod
    def of(cls, train: Sequence[BenchmarkRecord], *, most: int, lags: tuple[int, ...] | None = None) -> RecordColumns:
        """Columns for records, of which those in time are thinned to at most `most` samples each."""
        step = max(1, *(-(-len(record) // most) for record in train if not record.is_static), 1)
        outputs = tuple(sorted(train[0].outputs))
        raw = np.concatenate([_inputs(record, lags, step)[::step] for record in train])
        targets = np.concatenate([_targets(record, outputs)[::step] for record in train])
        size, target_size = _spread(raw), _spread(targets)
        record = train[0]
        first = len(record.inputs) + bool(record.dimensions.get("rest_length"))
        # First values differ little from record to record: they are measured by what the outputs do.
        size[first : first + len(train[0].initial)] = target_size[: len(train[0].initial)]
        return cls(outputs, step, lags, raw.mean(axis=0), size, np.nanmean(targets, axis=0), target_size)

    def inputs(self, record: BenchmarkRecord) -> np.ndarray:
        """Input columns of all samples (n, inputs)."""
        scaled: np.ndarray = (_inputs(record, self.lags, self.step) - self.centre) / self.size
        return scaled

    def targets(self, record: BenchmarkRecord) -> np.ndarray:
        """Output columns of all samples (n, outputs); NaN where they are hidden."""
        scaled: np.ndarray = (_targets(record, self.outputs) - self.target_centre) / self.target_size
        return scaled

    def initial(self, record: BenchmarkRecord) -> np.ndarray:
        """First value of each output (outputs,)."""
        first = np.array(
            [record.initial.get(name, centre) for name, centre in zip(self.outputs, self.target_centre, strict=True)]
        )
        return np.asarray((first - self.target_centre) / self.target_size)

    def predicted(self, values: np.ndarray) -> Mapping[str, np.ndarray]:
        """Predictions by name [SI] of output columns (n, outputs)."""
        plain = values * self.target_size + self.target_centre
        return {name: plain[:, i] for i, name in enumerate(self.outputs)}


def _spread(values: np.ndarray) -> np.ndarray:
    spread = np.nanstd(values, axis=0)
    return np.where(spread > 1e-9 * np.abs(np.nanmean(values, axis=0)) + 1e-300, spread, 1.0)


def _inputs(record: BenchmarkRecord, lags: tuple[int, ...] | None, step: int) -> np.ndarray:
    """Inputs by name, the contraction in place of the length, what does not change in time, and earlier samples."""
    columns, rest = dict(record.inputs), record.dimensions.get("rest_length")
    if rest and "length" in columns:
        columns["length"] = 1.0 - columns["length"] / rest
    moving = np.stack([columns[name] for name in sorted(columns)], axis=1)
    still = [rest] if rest else []
    if record.is_static:
        return np.column_stack([moving, np.tile(still, (len(record), 1))])
    still += [record.initial[name] for name in sorted(record.initial)]
    parts = [moving, np.tile(still, (len(record), 1))]
    if lags is not None and record.time is not None:
        at = np.arange(len(record))
        parts += [record.time[:, None], *(moving[np.maximum(at - step * lag, 0)] for lag in lags)]
    return np.column_stack(parts)


def _targets(record: BenchmarkRecord, outputs: tuple[str, ...]) -> np.ndarray:
    return np.stack([np.asarray(record.outputs[name], float) for name in outputs], axis=1)


def held_back(train: Sequence[BenchmarkRecord]) -> list[np.ndarray]:
    """Samples of each record that a model may choose by and not learn from, bool (n,).

    Of several muscles the last, of several records the last, of one record in time two of ten pieces, the last among
    them; of static points of one muscle a fifth, drawn.
    """
    muscles = list(dict.fromkeys(record.muscle for record in train))
    if len(muscles) > 1:
        return [np.full(len(record), record.muscle == muscles[-1]) for record in train]
    if len(train) > 1:
        return [np.full(len(record), record is train[-1]) for record in train]
    (record,) = train
    shown = np.flatnonzero(np.isfinite(next(iter(record.outputs.values()))))
    held = np.zeros(len(record), bool)
    if record.is_static:
        count = max(1, round(SHARE * len(shown)))
        held[np.random.default_rng(SEED).choice(shown, count, replace=False)] = True
    else:
        held[shown[np.isin(np.arange(len(shown)) * 10 // len(shown), (4, 9))]] = True
    return [held]


@dataclass(frozen=True)
class Points:
    """Samples without an order: inputs (n, inputs), outputs (n, outputs), and which are held back, bool (n,)."""

    inputs: np.ndarray
    targets: np.ndarray
    held: np.ndarray

    @classmethod
    def of(cls, columns: RecordColumns, train: Sequence[BenchmarkRecord], *, most: int) -> Points:
        """The shown samples of records, at most `most` of them, drawn where there are more."""
        held = np.concatenate([h[:: columns.step] for h in held_back(train)])
        inputs = np.concatenate([columns.inputs(record)[:: columns.step] for record in train])
        targets = np.concatenate([columns.targets(record)[:: columns.step] for record in train])
        shown = np.flatnonzero(np.isfinite(targets).all(axis=1))
        if len(shown) > most:
            shown = np.sort(np.random.default_rng(SEED).choice(shown, most, replace=False))
        return cls(inputs[shown], targets[shown], held[shown])
