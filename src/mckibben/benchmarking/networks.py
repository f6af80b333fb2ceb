"""Networks: a perceptron, a gated recurrent unit, and a neural ordinary differential equation, all trained by Adam.

The recurrent ones read inputs on a thinned clock and begin in a state that depends on the first outputs. How long they learn
is chosen on what is held back; then they learn so long from all training samples. Predictions at all samples are those of
several runs on thinned clocks that begin one sample after the other.
Sources: K. Cho et al., Learning phrase representations using RNN encoder-decoder, EMNLP 2014; R. T. Q. Chen et al., Neural
ordinary differential equations, NeurIPS 2018.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from .._jax import jax, jnp
from ..errors import InputError
from .datasets import BenchmarkRecord
from .regression import LAGS, Points, RecordColumns, held_back

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
MOST_POINTS, PADDED = (
    1500,
    64,
)  # points, and what their number is filled up to a multiple of, so that few programs are compiled


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

    return adam(functools.partial(jax.value_and_grad(loss)), start, steps=DESCENT, rate=RATE)[0]


MOST = 750  # samples of a record that are learned from
HIDDEN, WIDTH, LATENT = 24, 32, 6
STEPS = 300
PACE = 0.1  # of the differential equation, per sample of the thinned clock

Weights = Mapping[str, Any]


class _Recurrent:
    """What both share; `cell` makes the next state of (batch, states) from weights, state and inputs."""

    def __init__(self, cell: Callable[[Weights, Any, Any], Any], shapes: Callable[[int, int], dict[str, Any]]) -> None:
        self.cell, self.shapes = cell, shapes

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Choose the number of steps on what is held back, then learn from all training samples.

        Raises:
            InputError: the records are not in time.
        """
        if any(record.is_static for record in train):
            raise InputError("task", None, "must be of records in time: a model with a memory knows no static points")
        self.columns = columns = RecordColumns.of(train, most=MOST)
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
        start |= {n: np.zeros(s[-1], np.float32) for n, s in _biases(shapes).items()}
        data = tuple(np.asarray(v, np.float32) for v in (inputs, np.nan_to_num(targets), first))
        learn = jax.jit(self._learn)
        _, errors = learn(start, *data, _shares(shown & ~aside), _shares(shown & aside), STEPS)
        smooth = np.convolve(np.nan_to_num(np.asarray(errors), nan=np.inf), np.ones(5) / 5.0, "valid")
        until = int(np.argmin(smooth)) + 3 if (shown & aside).any() else STEPS
        self.weights, _ = learn(start, *data, _shares(shown), _shares(shown), until)

    def predict(self, record: BenchmarkRecord) -> Mapping[str, np.ndarray]:
        step, count = self.columns.step, len(record)
        length = -(-count // step)
        # Sample i of run k is sample i step + k of the record.
        inputs = _filled(self.columns.inputs(record), length * step).reshape(length, step, -1).swapaxes(0, 1)
        first = np.tile(self.columns.initial(record), (step, 1))
        values = jax.jit(self._outputs)(self.weights, np.asarray(inputs, np.float32), np.asarray(first, np.float32))
        whole = np.asarray(values, float).swapaxes(0, 1).reshape(length * step, -1)
        return self.columns.predicted(whole[:count])

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

    def __init__(self) -> None:
        super().__init__(_gated, _gated_shapes)


class NeuralODE(_Recurrent):
    """A state whose rate is a network of state and inputs, by Heun's steps; the state is more than the outputs."""

    def __init__(self) -> None:
        super().__init__(_heun, _rate_shapes)


def _filled(values: np.ndarray, length: int, fill: float | None = None) -> np.ndarray:
    added = length - len(values)
    if fill is None:
        return np.concatenate([values, np.repeat(values[-1:], added, axis=0)])
    return np.concatenate([values, np.full((added, *values.shape[1:]), fill)])


def _shares(chosen: np.ndarray) -> np.ndarray:
    return np.asarray(chosen / max(chosen.sum(), 1), np.float32)


def _biases(shapes: Mapping[str, Any]) -> dict[str, Any]:
    return {f"{name}_bias": shape for name, shape in shapes.items() if name != "past"}


def _gated_shapes(inputs: int, outputs: int) -> dict[str, Any]:
    both = (inputs + HIDDEN, HIDDEN)
    gates = {"reset": both, "update": both, "candidate": both}
    return gates | {"begin": (outputs, HIDDEN), "out": (HIDDEN, outputs), "past": (inputs, outputs)}


def _gated(weights: Weights, state: Any, now: Any) -> Any:
    both = jnp.concatenate([now, state], axis=-1)
    reset, update = (jax.nn.sigmoid(both @ weights[n] + weights[f"{n}_bias"]) for n in ("reset", "update"))
    both = jnp.concatenate([now, reset * state], axis=-1)
    return (1.0 - update) * state + update * jnp.tanh(both @ weights["candidate"] + weights["candidate_bias"])


def _rate_shapes(inputs: int, outputs: int) -> dict[str, Any]:
    states = outputs + LATENT
    return {
        "in": (inputs + states, WIDTH),
        "rate": (WIDTH, states),
        "begin": (outputs, states),
        "out": (states, outputs),
        "past": (inputs, outputs),
    }


def _heun(weights: Weights, state: Any, now: Any) -> Any:
    def rate(x: Any) -> Any:
        hidden = jnp.tanh(jnp.concatenate([now, x], axis=-1) @ weights["in"] + weights["in_bias"])
        return hidden @ weights["rate"] + weights["rate_bias"] - x

    first = rate(state)
    return state + 0.5 * PACE * (first + rate(state + PACE * first))
