"""Predictions and their derivatives by a vector of values, for fits."""

from __future__ import annotations

from collections.abc import Callable, Hashable
from typing import Any, NamedTuple

import numpy as np

import lanewise

from .._jax import Scalar, Tree, jax
from .native import compile_function

MOST = 32  # predictions that are remembered
_known: dict[Any, Any] = {}


class Prediction(NamedTuple):
    """Predictions for values (n,), an array, and their derivatives, with an axis (n,) behind."""

    predict: Callable[[np.ndarray], np.ndarray]
    slopes: Callable[[np.ndarray], np.ndarray]


def prediction(
    function: Callable[..., Tree], count: int, *fixed: Tree, engine: str = "auto", name: Hashable = None
) -> Prediction:
    """The prediction of a JAX function that returns one array, by native kernels where it can be lowered.

    Args:
        function: function of (values, *fixed).
        count: count of the values.
        *fixed: trees that stay as they are.
        engine: see `native.compile_function`.
        name: name of the function, where another one of that name, with trees of the same structure and shapes, is the same
            function; it is then compiled once.

    Raises:
        InputError: an unknown engine.
        EngineError: with ``native``, an operation that no kernel can do.
    """
    leaves, structure = jax.tree.flatten(fixed)
    key = (name, count, structure, tuple(np.shape(x) for x in leaves), engine)
    both = _known.get(key) if name is not None else None
    if both is None:
        both = _made(function, count, fixed, engine)
        if name is not None:
            _known[key] = both
            while len(_known) > MOST:
                _known.pop(next(iter(_known)))
    return Prediction(
        lambda values: np.asarray(both[0](values, fixed)), lambda values: np.asarray(both[1](values, fixed))
    )


def _made(function: Callable[..., Tree], count: int, fixed: Any, engine: str) -> tuple[Tree, Tree]:
    made = compile_function(function, np.zeros(count), *fixed, engine=engine)
    if made.engine == "xla":
        jacobian = jax.jit(jax.jacfwd(function))
        return (lambda values, fixed: made(values, *fixed)), (lambda values, fixed: jacobian(values, *fixed))
    kernels = lanewise.Derivatives(made.program, "default", None)

    def arrays(values: Scalar, fixed: Any) -> list[np.ndarray]:
        return [np.asarray(values, float), *map(np.asarray, jax.tree.leaves(fixed))]

    def predict(values: Scalar, fixed: Any) -> Any:
        return kernels.run(arrays(values, fixed), 0)[0]

    def slopes(values: Scalar, fixed: Any) -> Any:
        lanes = [x[None] for x in arrays(values, fixed)]
        return np.moveaxis(kernels.jvp([*lanes, np.eye(count)], 1, (0,))[0], 0, -1)

    return predict, slopes
