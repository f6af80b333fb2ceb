"""Multilayer perceptron: two hidden layers, weight decay chosen on samples held back, three networks averaged."""

from __future__ import annotations

import functools
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ..._jax import jax, jnp
from ..records import BenchmarkRecord
from .columns import LAGS, Points, RecordColumns
from .training import adam

WIDTH, STEPS, RATE = 32, 1000, 1e-2
DECAYS = (1e-5, 1e-4, 1e-3, 1e-2)
MEMBERS = 3
MOST, PADDED = (
    1500,
    64,
)  # points, and what their number is filled up to a multiple of, so that few programs are compiled


class Perceptron:
    """Perceptron with two hidden layers; records in time give earlier inputs and the time as further inputs."""

    def fit(self, train: Sequence[BenchmarkRecord]) -> None:
        """Choose the weight decay on what is held back, then learn from all training samples."""
        self.columns = RecordColumns.of(train, most=MOST, lags=LAGS)
        points = Points.of(self.columns, train, most=MOST)
        shapes = points.inputs.shape[1], points.targets.shape[1]
        start = _weights(np.random.default_rng(0), *shapes)
        # The same start for each decay, and all decays in one program.
        starts = {name: np.stack([value] * len(DECAYS)) for name, value in start.items()}
        kept = _learn(starts, *_padded(points, ~points.held), np.array(DECAYS, np.float32))
        errors = [
            np.mean((np.asarray(_run(_member(kept, i), _single(points.inputs))) - points.targets)[points.held] ** 2)
            for i in range(len(DECAYS))
        ]
        decay = DECAYS[int(np.argmin(errors))] if points.held.any() else DECAYS[1]
        many = [_weights(np.random.default_rng(1 + i), *shapes) for i in range(MEMBERS)]
        starts = {name: np.stack([one[name] for one in many]) for name in start}
        self.members = _learn(
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
    shapes = {"in": (inputs, WIDTH), "mid": (WIDTH, WIDTH), "out": (WIDTH, outputs)}
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


def _learn(starts: Mapping[str, np.ndarray], inputs: Any, targets: Any, shares: Any, decays: np.ndarray) -> Any:
    return jax.jit(jax.vmap(_descent, in_axes=(0, None, None, None, 0)))(starts, inputs, targets, shares, decays)


def _descent(start: Any, inputs: Any, targets: Any, shares: Any, decay: Any) -> Any:
    def loss(weights: Any) -> Any:
        error = jnp.sum(shares[:, None] * (_run(weights, inputs) - targets) ** 2)
        return error + decay * sum(jnp.sum(weights[name] ** 2) for name in ("in", "mid", "out"))

    return adam(functools.partial(jax.value_and_grad(loss)), start, steps=STEPS, rate=RATE)[0]
