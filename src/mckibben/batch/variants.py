"""Tables of variants: one column per dotted path, SI floats or text, one row per variant.

They are made by a grid, a Latin hypercube, a list, or drawn from the posterior of a fit, and may be crossed.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..answers import brief
from ..documents import JsonValue
from ..errors import InputError, each_once
from ..quantities import random_generator

SPACINGS = ("linear", "log")
MOST = 10_000_000  # variants of a sweep


@dataclass(frozen=True)
class Variants:
    """Columns of one length: float64 in SI, or objects for text."""

    columns: Mapping[str, np.ndarray]

    __repr__ = brief

    def __len__(self) -> int:
        return len(next(iter(self.columns.values()))) if self.columns else 1

    def __getitem__(self, part: slice) -> Variants:
        return Variants({path: values[part] for path, values in self.columns.items()})

    def row(self, index: int) -> dict[str, JsonValue]:
        """Return one variant: the value of every path."""
        return {path: v[index] if v.dtype == object else float(v[index]) for path, v in self.columns.items()}

    def rows(self) -> Iterator[dict[str, JsonValue]]:
        """Iterate over all variants, in order."""
        return (self.row(i) for i in range(len(self)))


def column(values: Sequence[object]) -> np.ndarray:
    """Convert values to a column of numbers; if one is text, all become text."""
    if all(isinstance(v, float) for v in values):
        return np.asarray(values, float)
    objects = np.empty(len(values), object)
    objects[:] = [v if isinstance(v, str) else repr(v) for v in values]
    return objects


def grid(axes: Mapping[str, Sequence[object]]) -> Variants:
    """Combine the values of all paths in every way; the last path varies fastest."""
    columns = [column(each_once(path, values)) for path, values in axes.items()]
    counts = [len(c) for c in columns]
    _few(int(np.prod(counts, dtype=object)) if counts else 1)
    places = np.indices(counts).reshape(len(counts), -1) if counts else np.zeros((0, 1), int)
    return Variants({path: c[i] for path, c, i in zip(axes, columns, places, strict=True)})


def latin(ranges: Mapping[str, tuple[float, float, str]], count: int, *, seed: int = 0) -> Variants:
    """Draw a Latin hypercube: every path takes one value in each of `count` equal parts of its range.

    Args:
        ranges: low, high [SI] and spacing, ``linear`` or ``log``, of each path.
        count: count of the variants.
        seed: same seed, same variants.

    Raises:
        InputError: if a range is upside down, or a logarithmic one reaches zero.
    """
    from scipy.stats import qmc

    _few(count)
    unit = qmc.LatinHypercube(len(ranges), seed=random_generator(seed)).random(count)
    return Variants({p: between(p, *r, u) for (p, r), u in zip(ranges.items(), unit.T, strict=True)})


def between(path: str, low: float, high: float, spacing: str, share: np.ndarray) -> np.ndarray:
    """Values at shares of a range, 0 to 1; both ends are exact [SI].

    Raises:
        InputError: as `latin`.
    """
    if not low <= high:
        raise InputError(path, None, f"must be a range that rises, got {low:g} to {high:g}")
    if spacing == "log":
        if not low > 0.0:
            raise InputError(
                path, None, f"must begin above zero, for the range is logarithmic, got {low:g} to {high:g}"
            )
        return np.asarray(np.clip(low * (high / low) ** share, low, high))
    return np.asarray(np.clip(low + (high - low) * share, low, high))


def listed(rows: Sequence[Mapping[str, object]]) -> Variants:
    """Make variants from a list; all name the same paths.

    Raises:
        InputError: if one lacks a path that another has.
    """
    names = list(dict.fromkeys(path for row in rows for path in row))
    for i, row in enumerate(rows, 1):
        for path in names:
            if path not in row:
                raise InputError(f"list.{i}.{path}", None, "is missing: every variant of a list states the same paths")
    _few(len(rows))
    return Variants({path: column([row[path] for row in rows]) for path in names})


def crossed(*parts: Variants) -> Variants:
    """Combine every variant of each part with every variant of the others; the last part varies fastest.

    Raises:
        InputError: if two parts vary the same path.
    """
    names = [path for part in parts for path in part.columns]
    for path in names:
        if names.count(path) > 1:
            raise InputError(path, None, "is varied twice: only one place may vary a path")
    counts = [len(part) for part in parts]
    _few(int(np.prod(counts, dtype=object)))
    places = np.indices(counts).reshape(len(counts), -1)
    pairs = itertools.chain.from_iterable(
        ((path, values[i]) for path, values in part.columns.items()) for part, i in zip(parts, places, strict=True)
    )
    return Variants(dict(pairs))


def _few(count: int) -> None:
    if not 1 <= count <= MOST:
        raise InputError("variants", count, f"must be between 1 and {MOST:,}")


def power(count: int) -> int:
    """Smallest power of two not below a count: sizes of calls and blocks, so that few are compiled."""
    return 1 << (max(count, 1) - 1).bit_length()
