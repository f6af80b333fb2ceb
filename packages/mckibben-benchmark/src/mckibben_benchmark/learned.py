"""Models without physics: regression on columns without memory of its own, and networks, trained by Adam.

Gaussian process: a linear and a squared exponential kernel with a length for each input, by marginal likelihood. Extended
dynamic mode decomposition: one linear step of lifted outputs and inputs, run freely from the first outputs; source: M. O.
Williams, I. G. Kevrekidis and C. W. Rowley, J. Nonlinear Science 25, 2015, doi:10.1007/s00332-015-9258-5; with inputs: M.
Korda and I. Mezic, Automatica 93, 2018, doi:10.1016/j.automatica.2018.03.046.

Networks: a perceptron, a gated recurrent unit, and a neural ordinary differential equation. The recurrent ones read inputs
on a thinned clock and begin in a state that depends on the first outputs. How long they learn is chosen on what is held
back; then they learn so long from all training samples. Predictions at all samples are those of several runs on thinned
clocks that begin one sample after the other. Sources: K. Cho et al., Learning phrase representations using RNN
encoder-decoder, EMNLP 2014; R. T. Q. Chen et al., Neural ordinary differential equations, NeurIPS 2018.
"""

from __future__ import annotations

import abc
import functools
import itertools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mckibben._jax import jax, jnp
from mckibben.errors import InputError

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

    def run_freely(
        self, record: BenchmarkRecord, run: Callable[[np.ndarray, np.ndarray], Any]
    ) -> Mapping[str, np.ndarray]:
        """Predictions at all samples by runs on thinned clocks that begin one sample after the other.

        Args:
            record: in time.
            run: outputs (runs, n, outputs) from inputs (runs, n, inputs) and first outputs (runs, outputs).
        """
        step, count = self.step, len(record)
        length = -(-count // step)
        # Sample i of run k is sample i step + k of the record.
        inputs = _filled(self.inputs(record), length * step).reshape(length, step, -1).swapaxes(0, 1)
        values = np.asarray(run(inputs, np.tile(self.initial(record), (step, 1))), float)
        return self.predicted(values.swapaxes(0, 1).reshape(length * step, -1)[:count])


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


TUNED, MOST_PREDICTED, ROWS = 500, 1500, 4000  # points to choose the kernel by, to predict from, and predicted at once
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

        self.columns = RecordColumns.of(train, most=MOST_PREDICTED, lags=LAGS)
        points = Points.of(self.columns, train, most=MOST_PREDICTED)
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
        """Outputs of free runs from the first ones."""
        return self.columns.run_freely(record, functools.partial(self._free, self.chosen[0], self.matrix))

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


DECAY_FIRST, DECAY_SECOND, SMALL, CLIP = 0.9, 0.999, 1e-8, 1.0


def adam(value_and_slope: Callable[[Any], Any], start: Any, *, steps: int, rate: float, until: Any = None) -> Any:
    """Descend with a rate that falls to zero by a cosine, and gradients clipped to a norm of one.

    Args:
        value_and_slope: of the weights; the value is what is returned for each step.
        start: weights, a dict of arrays.
        steps: number of steps.
        rate: first rate.
        until: step from which the weights stay as they are; `steps` by default.

    Returns:
        The weights, and the value before each step.

    Source: D. P. Kingma and J. Ba, Adam: a method for stochastic optimization, ICLR 2015.
    """
    last = steps if until is None else until
    tree = jax.tree_util.tree_map

    def step(carry: Any, i: Any) -> Any:
        weights, first, second = carry
        value, slope = value_and_slope(weights)
        norm = jnp.sqrt(sum(jnp.sum(g * g) for g in jax.tree_util.tree_leaves(slope)))
        slope = tree(lambda g: jnp.nan_to_num(g * jnp.minimum(1.0, CLIP / (norm + SMALL))), slope)
        first = tree(lambda m, g: DECAY_FIRST * m + (1.0 - DECAY_FIRST) * g, first, slope)
        second = tree(lambda v, g: DECAY_SECOND * v + (1.0 - DECAY_SECOND) * g * g, second, slope)
        count = i + 1.0
        pace = jnp.where(i < last, rate * 0.5 * (1.0 + jnp.cos(jnp.pi * i / steps)), 0.0)

        def moved(w: Any, m: Any, v: Any) -> Any:
            size = jnp.sqrt(v / (1.0 - DECAY_SECOND**count)) + SMALL
            return (w - pace * (m / (1.0 - DECAY_FIRST**count)) / size).astype(w.dtype)

        return (tree(moved, weights, first, second), first, second), value

    zero = tree(jnp.zeros_like, start)
    carry, values = jax.lax.scan(step, (start, zero, zero), jnp.arange(steps, dtype=jnp.float32))
    return carry[0], values


LAYER, DESCENT, RATE = 32, 1000, 1e-2
DECAYS = (1e-5, 1e-4, 1e-3, 1e-2)
MEMBERS = 3
# Points, and what their number is filled up to a multiple of, so that few programs are compiled.
MOST_POINTS, PADDED = 1500, 64


class Perceptron:
    """Perceptron with two hidden layers; records in time give earlier inputs and the time as further inputs."""

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Choose the weight decay on what is held back, then learn from all training samples."""
        self.columns = RecordColumns.of(train, most=MOST_POINTS, lags=LAGS)
        points = Points.of(self.columns, train, most=MOST_POINTS)
        shapes = points.inputs.shape[1], points.targets.shape[1]
        start = _weights(np.random.default_rng(0), *shapes)
        # The same start for each decay, and all decays in one program.
        starts = {name: np.stack([value] * len(DECAYS)) for name, value in start.items()}
        kept = _learn_all(starts, *_padded(points, ~points.held), np.array(DECAYS, np.float32))
        errors = [
            np.mean((np.asarray(_run(_member(kept, i), _single(points.inputs))) - points.targets)[points.held] ** 2)
            for i in range(len(DECAYS))
        ]
        decay = DECAYS[int(np.argmin(errors))] if points.held.any() else DECAYS[1]
        many = [_weights(np.random.default_rng(1 + i), *shapes) for i in range(MEMBERS)]
        starts = {name: np.stack([one[name] for one in many]) for name in start}
        self.members = _learn_all(
            starts, *_padded(points, np.ones(len(points.held), bool)), np.full(MEMBERS, decay, np.float32)
        )

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Mean of the networks at the samples of a record."""
        inputs = _single(self.columns.inputs(record))
        return self.columns.predicted(
            np.mean([np.asarray(_run(_member(self.members, i), inputs), float) for i in range(MEMBERS)], axis=0)
        )


def _single(values: np.ndarray) -> np.ndarray:
    return np.asarray(values, np.float32)


def _member(weights: Mapping[str, Any], i: int) -> dict[str, Any]:
    return {name: value[i] for name, value in weights.items()}


def _weights(draw: np.random.Generator, inputs: int, outputs: int) -> dict[str, np.ndarray]:
    shapes = {"in": (inputs, LAYER), "mid": (LAYER, LAYER), "out": (LAYER, outputs)}
    weights = {name: _single(draw.standard_normal(s) / np.sqrt(s[0])) for name, s in shapes.items()}
    return weights | {f"{name}_bias": np.zeros(s[1], np.float32) for name, s in shapes.items()}


def _run(weights: Mapping[str, Any], inputs: Any) -> Any:
    hidden = jnp.tanh(inputs @ weights["in"] + weights["in_bias"])
    hidden = jnp.tanh(hidden @ weights["mid"] + weights["mid_bias"])
    return hidden @ weights["out"] + weights["out_bias"]


def _padded(points: Points, used: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Inputs, outputs and weights of samples, filled up with samples of no weight."""
    count = -(-len(used) // PADDED) * PADDED - len(used)

    def fill(values: np.ndarray) -> np.ndarray:
        return np.pad(_single(values), [(0, count), *[(0, 0)] * (values.ndim - 1)])

    return fill(points.inputs), fill(points.targets), fill(used / max(used.sum(), 1))


def _learn_all(starts: Mapping[str, np.ndarray], inputs: Any, targets: Any, shares: Any, decays: np.ndarray) -> Any:
    return jax.jit(jax.vmap(_descent, in_axes=(0, None, None, None, 0)))(starts, inputs, targets, shares, decays)


def _descent(start: Any, inputs: Any, targets: Any, shares: Any, decay: Any) -> Any:
    def loss(weights: Any) -> Any:
        error = jnp.sum(shares[:, None] * (_run(weights, inputs) - targets) ** 2)
        return error + decay * sum(jnp.sum(weights[name] ** 2) for name in ("in", "mid", "out"))

    return adam(jax.value_and_grad(loss), start, steps=DESCENT, rate=RATE)[0]


MOST_SAMPLES = 750  # samples of a record that are learned from
HIDDEN, WIDTH, LATENT = 24, 32, 6
STEPS = 300
PACE = 0.1  # of the differential equation, per sample of the thinned clock

Weights = Mapping[str, Any]


class _Recurrent(abc.ABC):
    """What both networks with a memory share."""

    @abc.abstractmethod
    def shapes(self, inputs: int, outputs: int) -> dict[str, Any]:
        """Shapes of the weights by name, for numbers of inputs and outputs."""

    @abc.abstractmethod
    def cell(self, weights: Weights, state: Any, now: Any) -> Any:
        """Next state of (batch, states) from weights, state and inputs."""

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Choose the number of steps on what is held back, then learn from all training samples.

        Raises:
            InputError: the records are not in time.
        """
        if any(record.is_static for record in train):
            raise InputError("task", None, "must be of records in time: a model with a memory knows no static points")
        self.columns = columns = RecordColumns.of(train, most=MOST_SAMPLES)
        step, held = columns.step, held_back(train)
        length = max(-(-len(record) // step) for record in train)
        inputs = np.stack([_filled(columns.inputs(record)[::step], length) for record in train])
        targets = np.stack([_filled(columns.targets(record)[::step], length, np.nan) for record in train])
        first = np.stack([columns.initial(record) for record in train])
        aside = np.stack([_filled(h[::step].astype(float), length) for h in held]) > 0.5
        shown = np.isfinite(targets).all(axis=-1)
        shapes = self.shapes(inputs.shape[-1], targets.shape[-1])
        draw = np.random.default_rng(0)
        start = {n: np.asarray(draw.standard_normal(s) / np.sqrt(s[0]), np.float32) for n, s in shapes.items()}
        start |= {f"{n}_bias": np.zeros(s[-1], np.float32) for n, s in shapes.items() if n != "past"}
        data = tuple(np.asarray(v, np.float32) for v in (inputs, np.nan_to_num(targets), first))
        learn = jax.jit(self._learn)
        _, errors = learn(start, *data, _shares(shown & ~aside), _shares(shown & aside), STEPS)
        smooth = np.convolve(np.nan_to_num(np.asarray(errors), nan=np.inf), np.ones(5) / 5.0, "valid")
        until = int(np.argmin(smooth)) + 3 if (shown & aside).any() else STEPS
        self.weights, _ = learn(start, *data, _shares(shown), _shares(shown), until)

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        """Outputs of the network, from the first ones."""
        run = jax.jit(self._outputs)
        return self.columns.run_freely(record, lambda u, first: run(self.weights, _single(u), _single(first)))

    def _outputs(self, weights: Weights, inputs: Any, first: Any) -> Any:
        state = jnp.tanh(first @ weights["begin"] + weights["begin_bias"])

        def step(state: Any, now: Any) -> Any:
            state = self.cell(weights, state, now)
            return state, state @ weights["out"] + now @ weights["past"] + weights["out_bias"]

        _, values = jax.lax.scan(step, state, jnp.swapaxes(inputs, 0, 1))
        return jnp.swapaxes(values, 0, 1)

    def _learn(self, start: Any, inputs: Any, targets: Any, first: Any, used: Any, judged: Any, until: Any) -> Any:
        def loss(weights: Any) -> Any:
            squares = jnp.mean((self._outputs(weights, inputs, first) - targets) ** 2, axis=-1)
            return jnp.sum(used * squares), jnp.sum(judged * squares)

        def value_and_slope(weights: Any) -> Any:
            (_, aside), slope = jax.value_and_grad(loss, has_aux=True)(weights)
            return aside, slope

        return adam(value_and_slope, start, steps=STEPS, rate=RATE, until=until)


class GatedRecurrentUnit(_Recurrent):
    """A layer of gated recurrent units, with the inputs straight to the outputs beside it."""

    def shapes(self, inputs: int, outputs: int) -> dict[str, Any]:
        """Gates, and the inputs straight to the outputs."""
        both = (inputs + HIDDEN, HIDDEN)
        gates = {"reset": both, "update": both, "candidate": both}
        return gates | {"begin": (outputs, HIDDEN), "out": (HIDDEN, outputs), "past": (inputs, outputs)}

    def cell(self, weights: Weights, state: Any, now: Any) -> Any:
        """Next state of the gates."""
        both = jnp.concatenate([now, state], axis=-1)
        reset, update = (jax.nn.sigmoid(both @ weights[n] + weights[f"{n}_bias"]) for n in ("reset", "update"))
        both = jnp.concatenate([now, reset * state], axis=-1)
        return (1.0 - update) * state + update * jnp.tanh(both @ weights["candidate"] + weights["candidate_bias"])


class NeuralODE(_Recurrent):
    """A state whose rate is a network of state and inputs, by Heun's steps; the state is more than the outputs."""

    def shapes(self, inputs: int, outputs: int) -> dict[str, Any]:
        """A hidden layer for the rate of the state."""
        states = outputs + LATENT
        rate = {"in": (inputs + states, WIDTH), "rate": (WIDTH, states)}
        return rate | {"begin": (outputs, states), "out": (states, outputs), "past": (inputs, outputs)}

    def cell(self, weights: Weights, state: Any, now: Any) -> Any:
        """Next state by a step of Heun."""

        def rate(x: Any) -> Any:
            hidden = jnp.tanh(jnp.concatenate([now, x], axis=-1) @ weights["in"] + weights["in_bias"])
            return hidden @ weights["rate"] + weights["rate_bias"] - x

        first = rate(state)
        return state + 0.5 * PACE * (first + rate(state + PACE * first))


def _filled(values: np.ndarray, length: int, fill: float | None = None) -> np.ndarray:
    added = length - len(values)
    if fill is None:
        return np.concatenate([values, np.repeat(values[-1:], added, axis=0)])
    return np.concatenate([values, np.full((added, *values.shape[1:]), fill)])


def _shares(chosen: np.ndarray) -> np.ndarray:
    return np.asarray(chosen / max(chosen.sum(), 1), np.float32)
