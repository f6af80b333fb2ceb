"""The run of a system of many cells that act on each other by a core: cells of one structure are evaluated as arrays."""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np

from lanewise import Program

from .._jax import Tree, jax
from ..components.system import Coupling, System, as_rows
from .native import EngineFunction, compile_function
from .side_by_side import find_places, known_prefix

BLOCK = 8  # cells of a group are filled up to a multiple of it, so that all vectors of cells are full
SHORTEST = 72  # rows of a group at least: up to 64 numbers of an array are written out by the compiler


class CellGroup(NamedTuple):
    """Cells of one structure.

    Attributes:
        structure: structure of a cell, (system, state, memory, signals).
        places: places of each leaf of a cell among the leaves of the whole, (leaves, cells), cells that fill up included.
        outputs: outputs of each cell: their names in the whole by their names in the cell.
    """

    structure: Any
    places: np.ndarray
    outputs: list[dict[str, str]]

    @property
    def weights(self) -> np.ndarray:
        """1 for each cell, 0 for those that fill up."""
        return (np.arange(self.places.shape[1]) < len(self.outputs)).astype(float)


def find_groups(coupling: Coupling, whole: tuple[Tree, Tree, Tree, Tree]) -> list[CellGroup] | None:
    """Group the cells of (system, state, memory, signals) by structure; None if one has a number that the whole has not."""
    outputs: list[dict[str, str]] = []
    structures: list[Any] = []

    def taken_apart(*trees: Tree) -> list[Any]:
        cells = coupling.cells(*trees)
        outputs[:] = [cell.outputs for cell in cells]
        structures[:] = [jax.tree.structure(cell[:4]) for cell in cells]
        return [leaf for cell in cells for leaf in jax.tree.leaves(cell[:4])]

    numbers = iter(find_places(taken_apart, whole))
    rows: dict[Any, list[int]] = {}
    for k, structure in enumerate(structures):
        rows.setdefault(structure, []).append(k)
    cells = [[next(numbers) for _ in range(structure.num_leaves)] for structure in structures]
    groups = []
    for structure, members in rows.items():
        places = np.array([cells[k] for k in members]).T
        if (places < 0).any():
            return None
        size = max(-(-len(members) // BLOCK) * BLOCK, SHORTEST)
        filled = np.concatenate([places, np.repeat(places[:, -1:], size - len(members), 1)], 1)
        groups.append(CellGroup(structure, filled, [outputs[k] for k in members]))
    return groups


class CoupledRun:
    """The run of such a system, called like the `EngineFunction` of any other, but for one whole system at a time.

    Args:
        coupling: how it is cut.
        groups: its cells.
        example: (system, state, memory, signals).
        function: the run as a function of these and of the names of `outputs`.
        wanted: names of outputs of the whole; all where None.
        engine: see `native.compile_function`.
    """

    def __init__(
        self,
        coupling: Coupling,
        groups: list[CellGroup],
        example: tuple[Tree, Tree, Tree, Tree],
        function: Callable[..., Tree],
        wanted: tuple[str, ...] | None,
        engine: str,
    ) -> None:
        self.coupling, self.groups, self.wanted, self._engine = coupling, groups, wanted, engine
        self._place: dict[str, tuple[int, int, str]] = {}  # group, cell and name in it, of a name in the whole
        for g, group in enumerate(groups):
            for cell, names in enumerate(group.outputs):
                for inner, name in names.items():
                    self._place.setdefault(name, (g, cell, inner))
        inner_names = None if wanted is None else tuple(dict.fromkeys(self._inner_of(name)[0] for name in wanted))
        self._function = functools.partial(function, outputs=inner_names)
        self._runs: dict[Any, EngineFunction] = {}
        self.run = self._run_of(self.arguments(*example))
        self.engine, self.reason = self.run.engine, self.run.reason

    @property
    def program(self) -> Program:
        """The program for the example, called with the leaves of `arguments`; see `EngineFunction.program`."""
        return self.run.program

    def arguments(self, *whole: Tree) -> tuple[System, Tree, Tree, Tree]:
        """(system, state, memory, signals) with the cells as arrays."""
        leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(whole)]
        single = np.array([float(leaf) if leaf.ndim == 0 and leaf.dtype == float else np.nan for leaf in leaves])
        core = self.coupling.core(*whole)
        state, memory, signals = {**core.state, "groups": ()}, {**core.memory, "groups": ()}, dict(core.signals)
        systems, varied = [], []
        for g, group in enumerate(self.groups):
            stacked = [_stacked(row, leaves, single) for row in group.places]
            same = [bool((array == array[..., :1]).all()) for array in stacked]
            chosen = [array[..., 0] if equal else array for array, equal in zip(stacked, same, strict=True)]
            system, _, _, own = jax.tree.unflatten(group.structure, chosen)
            flags = jax.tree.unflatten(group.structure, [not equal for equal in same])[0]
            _, start, kept, _ = jax.tree.unflatten(group.structure, stacked)
            systems.append(system)
            varied.append(tuple(jax.tree.leaves(flags)))
            state["groups"] += (as_rows(start),)
            memory["groups"] += (as_rows(kept),)
            signals |= {f"{g}.{name}": signal for name, signal in own.items()}
        weights = tuple(group.weights for group in self.groups)
        mapped = self._engine == "xla"
        system = self.coupling.assembled(core.system, tuple(systems), weights, tuple(varied), mapped)
        return system, state, memory, signals

    def _run_of(self, arguments: tuple[Tree, ...]) -> EngineFunction:
        """The compiled run for what differs from cell to cell in these."""
        shapes = tuple(np.shape(leaf) for leaf in jax.tree.leaves(arguments))
        key = jax.tree.structure(arguments), shapes
        if key not in self._runs:
            self._runs[key] = compile_function(self._function, *arguments, engine=self._engine, title="machine")
        return self._runs[key]

    def __call__(self, *whole: Tree, **options: Any) -> dict[str, Tree]:
        """Run the whole.

        Args:
            *whole: (system, state, memory, signals), like those of the example.
            **options: of `EngineFunction.__call__`, but for lanes.

        Returns:
            The outputs by name, each (samples + 1,).
        """
        arguments = self.arguments(*whole)
        results = self._run_of(arguments)(*arguments, **options)
        if self.wanted is not None:
            chosen = {name: self._inner_of(name) for name in self.wanted}
            return {name: self._part(results[inner], cell) for name, (inner, cell) in chosen.items()}
        outputs = {}
        for inner, values in results.items():
            g, _, name = inner.partition(".")
            if not g.isdigit():
                outputs[inner] = values
                continue
            for cell, names in enumerate(self.groups[int(g)].outputs):
                prefix = known_prefix(name, names)
                if prefix is not None:
                    outputs.setdefault(names[prefix] + name[len(prefix) :], values[:, cell])
        return outputs

    @staticmethod
    def _part(values: Any, cell: int | None) -> Any:
        return values if cell is None else values[:, cell]

    def _inner_of(self, name: str) -> tuple[str, int | None]:
        """Name of an output in the array form, and the cell that it is of."""
        prefix = known_prefix(name, self._place)
        if prefix is None:
            return name, None
        g, cell, inner = self._place[prefix]
        return f"{g}.{inner}{name[len(prefix) :]}", cell


def _stacked(row: np.ndarray, leaves: Sequence[np.ndarray], single: np.ndarray) -> np.ndarray:
    """A leaf of all cells, with the cells as last axis."""
    first = leaves[row[0]]
    if first.ndim == 0 and first.dtype == single.dtype:
        column: np.ndarray = single[row]
        return column
    return np.stack([leaves[k] for k in row], -1)
