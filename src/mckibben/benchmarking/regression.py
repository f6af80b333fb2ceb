"""Models without physics or memory of their own, and the standardised columns that all models without physics learn from.

Gaussian process: a linear and a squared exponential kernel with a length for each input, by marginal likelihood. Extended
dynamic mode decomposition: one linear step of lifted outputs and inputs, run freely from the first outputs; source: M. O.
Williams, I. G. Kevrekidis and C. W. Rowley, J. Nonlinear Science 25, 2015, doi:10.1007/s00332-015-9258-5; with inputs: M.
Korda and I. Mezic, Automatica 93, 2018, doi:10.1016/j.automatica.2018.03.046.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from .datasets import BenchmarkRecord

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


TUNED, MOST, ROWS = 500, 1500, 4000  # points to choose the kernel by, to predict from, and predicted at once
STARTS = ((0.0, 0.0), (1.0, -2.0))  # logarithm of the lengths, and of the variance of the linear kernel
BOUNDS = (-6.0, 8.0)
JITTER = 1e-8


class GaussianProcess:
    """Gaussian process with noise; records in time give earlier inputs and the time as further inputs.

    Source: C. E. Rasmussen and C. K. I. Williams, Gaussian Processes for Machine Learning, MIT Press 2006, chapter 5.
    """

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Choose the kernel by the marginal likelihood of the training samples, and condition on them."""
        from scipy import optimize

        self.columns = RecordColumns.of(train, most=MOST, lags=LAGS)
        points = Points.of(self.columns, train, most=MOST)
        some = np.random.default_rng(0).permutation(len(points.inputs))[:TUNED]
        inputs, targets = points.inputs[some], points.targets[some]
        count = inputs.shape[1]
        solutions = [
            optimize.minimize(
                likelihood,
                np.r_[np.full(count, length), 0.0, linear, -4.0],
                args=(inputs, targets),
                jac=True,
                method="L-BFGS-B",
                bounds=[BOUNDS] * count + [(-8.0, 8.0)] * 2 + [(-14.0, 2.0)],
                options={"maxiter": 80},
            )
            for length, linear in STARTS
        ]
        self.chosen = min(solutions, key=lambda s: float(s.fun)).x
        self.inputs = points.inputs
        covariance = kernel(self.chosen, self.inputs, self.inputs)
        covariance[np.diag_indices_from(covariance)] += np.exp(self.chosen[-1]) + JITTER
        self.weights = np.linalg.solve(covariance, points.targets)

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Mean of the process at the samples of a record."""
        inputs = self.columns.inputs(record)
        blocks = [inputs[i : i + ROWS] for i in range(0, len(inputs), ROWS)]
        return self.columns.predicted(
            np.concatenate([kernel(self.chosen, block, self.inputs) @ self.weights for block in blocks])
        )


def kernel(chosen: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Covariance without noise (n, m) of inputs (n, d) and (m, d), by logarithms of d lengths, two variances and noise."""
    covariance: np.ndarray = _radial(chosen, a, b) + np.exp(chosen[-2]) * (1.0 + a @ b.T)
    return covariance


def _radial(chosen: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    u, v = a / np.exp(chosen[:-3]), b / np.exp(chosen[:-3])
    squares = np.maximum((u**2).sum(axis=1)[:, None] + (v**2).sum(axis=1) - 2.0 * u @ v.T, 0.0)
    return np.asarray(np.exp(chosen[-3] - 0.5 * squares))


def likelihood(chosen: np.ndarray, inputs: np.ndarray, targets: np.ndarray) -> tuple[float, np.ndarray]:
    """Negative logarithm of the marginal likelihood, but for a constant, and its derivative."""
    from scipy import linalg

    radial = _radial(chosen, inputs, inputs)
    linear = np.exp(chosen[-2]) * (1.0 + inputs @ inputs.T)
    noise = np.exp(chosen[-1])
    covariance = radial + linear + (noise + JITTER) * np.eye(len(inputs))
    try:
        factor = linalg.cho_factor(covariance, lower=True)
    except linalg.LinAlgError:
        return 1e10, np.zeros_like(chosen)
    weights, count = linalg.cho_solve(factor, targets), targets.shape[1]
    value = 0.5 * float(np.sum(targets * weights)) + count * float(np.log(np.diag(factor[0])).sum())
    slope = 0.5 * (count * linalg.cho_solve(factor, np.eye(len(inputs))) - weights @ weights.T)
    shaped = slope * radial
    scaled = inputs / np.exp(chosen[:-3])
    # Sum of shaped_ij (x_i - x_j)^2 for each input, without a matrix for each.
    lengths = 2.0 * (shaped.sum(axis=1) @ scaled**2 - np.sum(scaled * (shaped @ scaled), axis=0))
    return value, np.r_[lengths, shaped.sum(), np.sum(slope * linear), noise * np.trace(slope)]


MOST_STEPS = 750  # samples of a record that are learned from
CHOICES = tuple(itertools.product((1, 2), (1e-6, 1e-4, 1e-2)))  # degree of the lifting, and ridge
REACH = 5.0  # standard deviations beyond which a free run is held


class ExtendedDMD:
    """Polynomial lifting of two outputs in a row and two inputs in a row; degree and ridge are chosen by free runs."""

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Choose degree and ridge by a free run over what is held back, then learn from all training samples.

        Raises:
            InputError: the records are not in time.
        """
        if any(record.is_static for record in train):
            raise InputError("task", None, "must be of records in time: a model of steps knows no static points")
        self.columns = RecordColumns.of(train, most=MOST_STEPS)
        step, aside = self.columns.step, held_back(train)
        runs = [
            (self.columns.inputs(r)[::step], self.columns.targets(r)[::step], h[::step], self.columns.initial(r))
            for r, h in zip(train, aside, strict=True)
        ]
        errors = {}
        for choice in CHOICES:
            matrix = self._matrix(choice, [(u, np.where(h[:, None], np.nan, y)) for u, y, h, _ in runs])
            squares = [
                (self._free(choice[0], matrix, u[None], first[None])[0] - y)[h & np.isfinite(y).all(axis=1)] ** 2
                for u, y, h, first in runs
                if h.any()
            ]
            errors[choice] = float(np.mean(np.concatenate(squares)))
        self.chosen = min(errors, key=lambda choice: errors[choice])
        self.matrix = self._matrix(self.chosen, [(u, y) for u, y, _, _ in runs])

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Outputs of a free run; runs on thinned clocks begin one sample after the other."""
        step, count = self.columns.step, len(record)
        length = -(-count // step)
        inputs = self.columns.inputs(record)
        inputs = np.concatenate([inputs, np.repeat(inputs[-1:], length * step - count, axis=0)])
        inputs = inputs.reshape(length, step, -1).swapaxes(0, 1)
        first = np.tile(self.columns.initial(record), (step, 1))
        values = self._free(self.chosen[0], self.matrix, inputs, first)
        return self.columns.predicted(values.swapaxes(0, 1).reshape(length * step, -1)[:count])

    def _matrix(self, choice: tuple[int, float], runs: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
        """Ridge regression of each output on what was lifted one step before (lifted, outputs)."""
        degree, ridge = choice
        known = [(np.concatenate([y[1:-1], y[:-2], u[2:], u[1:-1]], axis=1), y[2:] - y[1:-1]) for u, y in runs]
        states = np.concatenate([state for state, _ in known])
        changes = np.concatenate([change for _, change in known])
        shown = np.isfinite(states).all(axis=1) & np.isfinite(changes).all(axis=1)
        lifted = lift(states[shown], degree)
        gram = lifted.T @ lifted / len(lifted)
        gram[np.diag_indices_from(gram)] += ridge
        return np.linalg.solve(gram, lifted.T @ changes[shown] / len(lifted))

    def _free(self, degree: int, matrix: np.ndarray, inputs: np.ndarray, first: np.ndarray) -> np.ndarray:
        """Free runs (runs, n, outputs) from first outputs (runs, outputs) with inputs (runs, n, inputs)."""
        before = now = first
        values, earlier = [now], inputs[:, 0]
        for at in range(1, inputs.shape[1]):
            current = inputs[:, at]
            change = lift(np.concatenate([now, before, current, earlier], axis=1), degree) @ matrix
            before, now, earlier = now, np.clip(now + change, -REACH, REACH), current
            values.append(now)
        return np.stack(values, axis=1)


def lift(states: np.ndarray, degree: int) -> np.ndarray:
    """One, the states (n, d), and their products for degree 2 (n, lifted)."""
    columns = [np.ones((len(states), 1)), states]
    if degree == 2:
        i, j = np.triu_indices(states.shape[1])
        columns.append(states[:, i] * states[:, j])
    return np.concatenate(columns, axis=1)
