"""The run of a system of many independent parts of one structure: compiled once, with the parts as lanes."""

from __future__ import annotations

import functools
from collections.abc import Callable, Container, Sequence
from typing import Any, NamedTuple

import numpy as np

from lanewise import Program

from .._jax import Tree, jax
from .native import EngineFunction, compile_function


class LeafPlace(int):
    """The place of a leaf among those of a tree, in the place of the leaf."""


def find_places(taken_apart: Callable[..., Sequence[Tree]], trees: tuple[Tree, ...]) -> list[int]:
    """Places among the leaves of trees of the numbers that a function takes from them; -1 for one that it computes."""
    leaves, structure = jax.tree.flatten(trees)
    places = [LeafPlace(k) for k in range(len(leaves))]
    try:
        taken = taken_apart(*jax.tree.unflatten(structure, places))
        numbers = [int(n) if type(n) is LeafPlace else -1 for n in taken]
        if -1 not in numbers:
            return numbers
    except (TypeError, ValueError, AttributeError):  # it wants numbers
        pass
    traced = jax.make_jaxpr(taken_apart)(*jax.tree.map(np.asarray, trees)).jaxpr
    number = {var: k for k, var in enumerate(traced.invars)}
    return [-1 if hasattr(v, "val") else number.get(v, -1) for v in traced.outvars]


class Split(NamedTuple):
    """Positions of the numbers of each part among those of the whole.

    Attributes:
        example: the first part, (system, state, memory, signals).
        places: places of each leaf of a part among the leaves of the whole, (leaves, parts).
        outputs: outputs of each part the names in the whole by their names in the part.
    """

    example: tuple[Any, Any, Any, Any]
    places: np.ndarray
    outputs: list[dict[str, str]]

    @classmethod
    def of(cls, whole: tuple[Tree, Tree, Tree, Tree]) -> Split | None:
        """Split a (system, state, memory, signals); None if it has no parts, or parts of several structures."""
        outputs: list[dict[str, str]] = []
        structures: list[Any] = []

        def taken_apart(system: Tree, *rest: Any) -> list[Any]:
            parts = system.parts(*rest)
            outputs[:] = [part.outputs for part in parts]
            structures[:] = [jax.tree.structure(part[:4]) for part in parts]
            return [leaf for part in parts for leaf in jax.tree.leaves(part[:4])]

        numbers = find_places(taken_apart, whole)
        if not outputs or any(s != structures[0] for s in structures[1:]) or -1 in numbers:
            return None
        places = np.array(numbers).reshape(len(outputs), -1).T
        leaves = jax.tree.leaves(whole)
        return cls(jax.tree.unflatten(structures[0], [leaves[k] for k in places[:, 0]]), places, outputs)

    def stacked(self, leaves: Sequence[Tree]) -> list[np.ndarray]:
        """The leaves of a part, with the parts as last axis of those that are not the same number for all."""
        arrays = [np.asarray(leaf) for leaf in leaves]
        single = np.array([float(array) if array.ndim == 0 else np.nan for array in arrays])
        return [self._stacked(row, arrays, single) for row in self.places]

    @staticmethod
    def _stacked(row: np.ndarray, arrays: Sequence[np.ndarray], single: np.ndarray) -> np.ndarray:
        first: np.ndarray = arrays[row[0]]
        if (row == row[0]).all():
            return first
        if first.ndim == 0 and first.dtype == single.dtype:
            column: np.ndarray = single[row]
            return column
        return np.stack([arrays[k] for k in row], -1)


class SideBySide:
    """The run of such a system, called like the `EngineFunction` of any other, but for one whole system at a time.

    Args:
        split: the parts.
        function: the run as a function of (system, state, memory, signals) and of the names of `outputs`.
        wanted: names of outputs of the whole; all where None.
        engine: see `native.compile_function`.

    Attributes:
        run: the run of a part, with the parts as lanes.
        engine: engine that runs it.
        reason: why it is not native although that was requested.
    """

    def __init__(
        self, split: Split, function: Callable[..., Tree], wanted: tuple[str, ...] | None, engine: str
    ) -> None:
        self.split, self.wanted = split, wanted
        self._place: dict[str, tuple[int, str]] = {}
        for part, names in enumerate(split.outputs):
            for inner, whole in names.items():
                self._place.setdefault(whole, (part, inner))
        own_names = None if wanted is None else tuple(dict.fromkeys(self._part_of(name)[1] for name in wanted))
        bound = functools.partial(function, outputs=own_names)
        self.run: EngineFunction = compile_function(bound, *split.example, engine=engine, title="part")
        self.engine, self.reason = self.run.engine, self.run.reason

    @property
    def program(self) -> Program:
        """The program of a part, see `EngineFunction.program`."""
        return self.run.program

    def __call__(self, *whole: Tree, **options: Any) -> dict[str, Tree]:
        """Run the whole.

        Args:
            *whole: (system, state, memory, signals), like those that it was split of.
            **options: of `EngineFunction.__call__`, but for lanes, which the parts take.

        Returns:
            The outputs by name, each (samples + 1,).
        """
        trees = jax.tree.unflatten(jax.tree.structure(self.split.example), self.split.stacked(jax.tree.leaves(whole)))
        results = self.run(*trees, lanes=len(self.split.outputs), **options)
        if self.wanted is not None:
            chosen = {name: self._part_of(name) for name in self.wanted}
        else:
            chosen = {}
            for part, names in enumerate(self.split.outputs):
                for inner in results:
                    prefix = known_prefix(inner, names)
                    chosen.setdefault(inner if prefix is None else names[prefix] + inner[len(prefix) :], (part, inner))
        return {name: results[inner][:, part] for name, (part, inner) in chosen.items()}

    def _part_of(self, name: str) -> tuple[int, str]:
        """The part that an output of the whole belongs to, and its name there."""
        prefix = known_prefix(name, self._place)
        if prefix is None:
            return 0, name
        part, inner = self._place[prefix]
        return part, inner + name[len(prefix) :]


def known_prefix(name: str, known: Container[str]) -> str | None:
    """The longest known name that a dotted name begins with."""
    prefix = name
    while prefix not in known:
        prefix, dot, _ = prefix.rpartition(".")
        if not dot:
            return None
    return prefix
