"""Linear algebra as another library or processor returns it: `pytest --disturb-linalg SEED`.

What LAPACK returns is determined to rounding only, singular and eigenvectors up to their sign, and a basis of a null
space or of a degenerate eigenspace up to a rotation; least squares do not know the order of their rows. All of it is changed
here, in process, by seed: a result that changes visibly was read from what has no meaning. Tests that compare bits are
marked `bits`.
"""

from __future__ import annotations

import functools
import zlib
from collections.abc import Callable
from typing import Any

import jax
import numpy as np

ULP = np.finfo(float).eps
NULL = 1e-12  # share of the largest strength below which a direction is of the null space
EQUAL = 1e-13  # values that differ by less, as a share of the largest, have one eigenspace

NUMPY = ("eig", "eigh", "eigvals", "eigvalsh", "svd", "svdvals", "qr", "lstsq", "solve", "cholesky", "inv", "pinv")
SCIPY = (*NUMPY, "cho_solve", "solve_triangular")


class Disturbance:
    """What one seed changes; as of a library, the same arguments have the same results."""

    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.chance = np.random.default_rng(seed)

    def begin(self, *arguments: Any) -> None:
        """Take the changes that belong to some arguments."""
        plain = [b for a in arguments for b in (a if isinstance(a, tuple) else (a,)) if not isinstance(b, str)]
        sums = [zlib.crc32(np.ascontiguousarray(a).tobytes()) for a in plain]
        self.chance = np.random.default_rng([self.seed, *sums])

    def install(self) -> None:
        """Replace the functions in the modules by whose names they are called."""
        import jax.numpy as jnp
        import numpy.lib._polynomial_impl as polynomials  # `polyfit` holds its own reference
        import scipy.linalg
        import scipy.optimize
        from jax._src import source_info_util

        source_info_util.register_exclusion(__file__)  # what is traced names the line that called it
        for names, module in (
            (NUMPY, np.linalg),
            (SCIPY, scipy.linalg),
            (NUMPY, jnp.linalg),
            (("lstsq",), polynomials),
        ):
            for name in names:
                if (real := getattr(module, name, None)) is not None:
                    setattr(module, name, self.changed(name, real))
        for name in ("least_squares", "lsq_linear", "nnls"):
            setattr(scipy.optimize, name, getattr(self, name)(getattr(scipy.optimize, name)))

    def changed(self, name: str, real: Callable[..., Any]) -> Callable[..., Any]:
        """A function of linear algebra whose results are others of those that it may return."""
        turn = {"svd": self.svd, "eigh": self.vectors, "eig": self.vectors, "qr": self.qr}.get(name)

        @functools.wraps(real)
        def call(*args: Any, **options: Any) -> Any:
            result = real(*args, **options)
            if any(isinstance(a, jax.core.Tracer) for a in args):
                return result
            parts = list(result) if isinstance(result, tuple) else [result]
            self.begin(*args)
            arrays = [np.array(p) if _floating(p) else p for p in parts]
            if turn is not None:
                turn(name, arrays)
            arrays = [self.rounded(a) if _floating(a) else a for a in arrays]
            if any(type(p).__module__.startswith("jax") for p in parts):
                import jax.numpy as jnp

                arrays = [jnp.asarray(a) for a in arrays]
            if not isinstance(result, tuple):
                return arrays[0]
            return type(result)(*arrays) if hasattr(result, "_fields") else tuple(arrays)

        return call

    def rounded(self, values: Any) -> Any:
        """Values (..) with an error of one unit of the last place, or none."""
        changed = values * (1.0 + ULP * self.chance.integers(-1, 2, np.shape(values)))
        return changed.astype(values.dtype) if isinstance(values, np.ndarray) else type(values)(changed)

    def rotation(self, size: int) -> np.ndarray:
        return _QR(self.chance.standard_normal((size, size)))[0]

    def svd(self, _: str, parts: list[Any]) -> None:
        if len(parts) == 1:  # values alone
            return
        left, strength, directions = parts
        for at in np.ndindex(strength.shape[:-1]):
            u, s, vh = left[at], strength[at], directions[at]
            strong = int(np.sum(s > NULL * max(s[0], 1e-300))) if s.size else 0
            for begin, end in _runs(s[:strong]):
                turn = self.rotation(end - begin)
                u[:, begin:end], vh[begin:end] = u[:, begin:end] @ turn.T, turn @ vh[begin:end]
            u[:, strong:] = u[:, strong:] @ self.rotation(u.shape[1] - strong)
            vh[strong:] = self.rotation(len(vh) - strong) @ vh[strong:]

    def vectors(self, name: str, parts: list[Any]) -> None:
        values, vectors = parts
        if np.iscomplexobj(values):
            return  # pairs belong together
        for at in np.ndindex(values.shape[:-1]):
            v = vectors[at]
            for begin, end in _runs(values[at]) if name == "eigh" else ((i, i + 1) for i in range(v.shape[1])):
                v[:, begin:end] = v[:, begin:end] @ self.rotation(end - begin)

    def qr(self, _: str, parts: list[Any]) -> None:
        triangle = parts[-1]
        if len(parts) > 2 or triangle.ndim != 2:
            return
        signs = self.chance.choice([-1.0, 1.0], len(triangle))
        triangle *= signs[:, None]
        if len(parts) == 2:
            parts[0] *= signs

    def least_squares(self, real: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(real)
        def call(fun: Any, x0: Any, jac: Any = "2-point", **options: Any) -> Any:
            count = len(np.atleast_1d(fun(x0, *options.get("args", ()), **options.get("kwargs", {}))))
            self.begin(x0)
            order = self.chance.permutation(count)
            rows = functools.partial(_rows, order=order)
            found = real(rows(fun), x0, rows(jac) if callable(jac) else jac, **options)
            found.fun, found.jac = found.fun[np.argsort(order)], found.jac[np.argsort(order)]
            return found

        return call

    def lsq_linear(self, real: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(real)
        def call(A: Any, b: Any, *args: Any, **options: Any) -> Any:
            self.begin(A, b)
            order = self.chance.permutation(len(b))
            found = real(A[order], b[order], *args, **options)
            found.fun = found.fun[np.argsort(order)]
            return found

        return call

    def nnls(self, real: Callable[..., Any]) -> Callable[..., Any]:
        @functools.wraps(real)
        def call(A: Any, b: Any, *args: Any, **options: Any) -> Any:
            self.begin(A, b)
            order = self.chance.permutation(len(b))
            return real(np.asarray(A)[order], np.asarray(b)[order], *args, **options)

        return call


_QR = np.linalg.qr


def _floating(values: Any) -> bool:
    return hasattr(values, "dtype") and np.issubdtype(values.dtype, np.inexact)


def _rows(function: Callable[..., Any], order: np.ndarray) -> Callable[..., Any]:
    return lambda *args, **options: np.atleast_1d(function(*args, **options))[order]


def _runs(values: np.ndarray) -> list[tuple[int, int]]:
    """Where values that are one to rounding begin and end; they are in order."""
    if not values.size:
        return []
    size = max(float(np.abs(values).max()), 1e-300)
    ends = [0, *(np.flatnonzero(np.abs(np.diff(values)) > EQUAL * size) + 1).tolist(), values.size]
    return list(zip(ends[:-1], ends[1:], strict=True))
