"""Trees of one structure side by side: arrays with the units of a group as last axis, and functions of each unit."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from .._jax import Tree, jax, jnp
from .module import Module, Scalar, field


class UnitRows(Module):
    """An array for each of n units, as a row (n,) for each of its elements, so that units stand side by side in memory."""

    rows: tuple[Scalar, ...]
    # Shape of the array of one unit.
    shape: tuple[int, ...] = field(static=True, kw_only=True)

    @property
    def whole(self) -> Scalar:
        """The array, with further axes of the rows behind its own."""
        together = jnp.stack(self.rows)
        return together.reshape(*self.shape, *together.shape[1:])


def as_rows(tree: Tree) -> Tree:
    """Replace arrays (.., n) of more than one axis by their rows."""
    return jax.tree.map(_as_rows, tree)


def _as_rows(leaf: Any) -> Any:
    shape = np.shape(leaf)[:-1]
    if not shape:
        return leaf
    flat = leaf.reshape(-1, leaf.shape[-1])
    return UnitRows(tuple(flat[k] for k in range(flat.shape[0])), shape=shape)


def without_rows(tree: Tree) -> Tree:
    """Replace rows by the arrays that they are of."""

    def is_rows(x: object) -> bool:
        return isinstance(x, UnitRows)

    return jax.tree.map(lambda x: x.whole if is_rows(x) else x, tree, is_leaf=is_rows)


def for_each_unit(
    function: Callable[..., tuple[Tree, Tree]], trees: Tree, varied: Sequence[bool], *, mapped: bool
) -> tuple[Tree, Tree]:
    """Evaluate a function for each unit of a group.

    Args:
        function: function of the trees of one unit; returns a tree of what the unit has, and one of numbers to be added up
            over the units.
        trees: arguments, in which what differs from unit to unit has them as last axis (n); `UnitRows` are arrays there.
        varied: by leaf of the trees, whether it differs.
        mapped: evaluate all units at once, as XLA does best, and not one after the other, which native kernels turn into
            vectors of units.

    Returns:
        What the units have, with n as last axis and arrays as `UnitRows`, and the sums.
    """
    leaves, structure = jax.tree.flatten(trees)
    per_unit = [jnp.moveaxis(jnp.asarray(leaf), -1, 0) for leaf, v in zip(leaves, varied, strict=True) if v]

    def one(row: list[Any]) -> tuple[Tree, Tree]:
        rest = iter(row)
        own = [next(rest) if v else leaf for leaf, v in zip(leaves, varied, strict=True)]
        result, share = function(*without_rows(jax.tree.unflatten(structure, own)))
        apart = jax.tree.map(lambda x: as_rows(jnp.asarray(x)[..., None]), result)
        return jax.tree.map(lambda x: x[0], apart), share

    if mapped:
        results, shares = jax.vmap(one)(per_unit)
        return results, jax.tree.map(lambda x: x.sum(0), shares)

    def added(sums: Any, row: list[Any]) -> tuple[Tree, Tree]:
        result, share = one(row)
        return jax.tree.map(lambda a, b: a + b, sums, share), result

    shapes = jax.eval_shape(one, [x[0] for x in per_unit])[1]
    sums, results = jax.lax.scan(added, jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), shapes), per_unit)
    return results, sums
