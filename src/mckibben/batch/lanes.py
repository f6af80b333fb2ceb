"""Variants as lanes: grouping by compiled function, and the arrays of each.

Variants are put into groups whose trees have one structure. In a group few variants are built for real, which takes a tenth
of a second each; the others are written into their trees: where a parameter is found to be set, unchanged, at some places of
the trees and nowhere else, its values are written there. What it sets is found by building two variants that differ in it
alone; that the trees of others come out right, bit for bit, is checked on some of them.

The dry run judges every variant: where only the muscle differs and nothing in a protocol waits for an event, the law's
tension at all planned states decides, else the dry run itself.
"""

from __future__ import annotations

import contextlib
import functools
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from .._jax import Scalar, Tree, jax, jit, jnp
from ..assembly.machine import Machine
from ..bench.hardware.computer import Timing
from ..bench.prepare import PreparedRun, RunSegment, with_friction_scale
from ..bench.segment import software_of, timing_of
from ..bench.sensors import MUSCLE
from ..documents import JsonValue
from ..errors import InputError
from ..experiments.dry_run import check, states
from .run_template import KEPT, RunFactory, RunTemplate
from .variants import Variants, power

CHECKED = 2  # variants of a new structure that are built for real, to compare
NEAR = 1e-9  # of the allowed tension: the dry run itself decides there
MOST_STATES = 65_536  # planned states at which tensions are compared at once
STEPS = 64  # of a part, to which the tables of windows are padded, or 16 times as many


class LaneStructure(NamedTuple):
    """Properties that lanes of one compiled function share and that are not arrays.

    Attributes:
        structures: structures of the trees of every part.
        shapes: shapes of the arrays of every part.
        timing: timing of the loop; its latency is an array of the trees.
        every: samples of the loop per sample of the protocol.
    """

    structures: tuple[Any, ...]
    shapes: tuple[Any, ...]
    timing: Timing
    every: int


class BuiltVariant(NamedTuple):
    """A variant that was built individually.

    Attributes:
        bench: bench of it.
        machines: machines of every part.
        parts: parts of the plan.
        fixed: what other lanes must have too.
        leaves: arrays of every part.
        guard: what the dry run looked at beside the muscle; a parameter that changes it is none that a lane can be given.
    """

    bench: PreparedRun
    machines: tuple[Machine, ...]
    parts: tuple[RunSegment, ...]
    fixed: LaneStructure
    leaves: tuple[tuple[np.ndarray, ...], ...]
    guard: tuple[Any, ...]


def build(factory: RunFactory, values: Mapping[str, JsonValue]) -> BuiltVariant:
    """Build a variant of values by path.

    Raises:
        InputError: names what is unknown or out of bounds.
    """
    bench = factory.bench(values)
    timing = timing_of(bench)
    parts = tuple(bench.segments())
    machines, leaves, structures = [], [], []
    for part in parts:
        rig = bench.rig
        machine = rig.machine(
            part.layout, with_friction_scale(bench.unit, part.friction), start=part.start_span, moves=part.moves
        )
        # Tables of set-points as long as the part needs, since every lane may need its own.
        software = software_of(bench, part, timing)
        size = 1024
        while size < sum(s.count for s in part.steps):
            size *= 2
        sequencer: Any = software.sequencer
        table = {n: v[:size] if len(v) >= size else np.pad(v, (0, size - len(v))) for n, v in sequencer.table.items()}
        # By output, the steps of the part in which it is evaluated (steps,).
        size = STEPS
        while size < len(part.steps):
            size *= 16
        windows = {}
        for one in factory.template.outputs:
            if one.sampled:
                chosen = [not one.step or s.step.label == one.step for s in part.steps]
                windows[one.name] = np.pad(np.array(chosen), (0, size - len(chosen)))
        tree = {
            "plant": rig.plant(machine, part.layout, mounted=part.start_span),
            "software": software.replace(sequencer=sequencer.replace(table=table)),
            "pressure": jnp.asarray(part.start_pressure, float),
            "latency": jnp.asarray(timing.latency, float),
            "windows": windows,
        }
        arrays, structure = jax.tree.flatten(tree)
        machines.append(machine)
        leaves.append(tuple(np.asarray(leaf) for leaf in arrays))
        structures.append(structure)
    shapes = tuple(tuple((x.shape, str(x.dtype)) for x in part) for part in leaves)
    fixed = LaneStructure(tuple(structures), shapes, timing._replace(latency=0.0), bench.every)
    limits = bench.rig.limits(bench.layout)
    guard = (bench.layout, bench.plan.rest_length, [len(bench.plan.steps), bench.plan.samples], str(limits))
    return BuiltVariant(bench, tuple(machines), parts, fixed, tuple(leaves), guard)


Places = tuple[tuple[int, int], ...]  # part and number of each array that a parameter sets


def places(one: BuiltVariant, a: float, other: BuiltVariant, b: float) -> Places | None:
    """Positions in the arrays of a parameter that is `a` in one variant and `b` in another.

    None if it also changes structure.
    """
    if one.fixed != other.fixed or one.guard != other.guard:
        return None
    positions = []
    for part, (mine, theirs) in enumerate(zip(one.leaves, other.leaves, strict=True)):
        for i, (x, y) in enumerate(zip(mine, theirs, strict=True)):
            if _same(x, y):
                continue
            if x.dtype != float or not (np.all(x == a) and np.all(y == b)):
                return None
            positions.append((part, i))
    return tuple(positions)


def _same(x: np.ndarray, y: np.ndarray) -> bool:
    return x.shape == y.shape and bool(np.array_equal(x, y, equal_nan=x.dtype == float))


class VariantLane(NamedTuple):
    """One variant that may run: its row, the template it is made from, and its arrays as far as they were set."""

    row: int
    built: BuiltVariant
    values: Mapping[str, float]


class LaneGroup(NamedTuple):
    """Variants that one compiled function runs.

    Attributes:
        family: their common structure.
        lanes: them.
    """

    family: VariantFamily
    lanes: list[VariantLane]


class VariantFamily:
    """All variants of one structure, and the known positions of their parameters."""

    def __init__(self, fixed: LaneStructure) -> None:
        self.fixed = fixed
        self.places: dict[str, Places] = {}
        self.checked = False
        # of every array, whether it was the same in all lanes so far: what once differed is given per lane from then on
        self.shared = [np.ones(len(part), bool) for part in fixed.shapes]

    def write(self, template: BuiltVariant, values: Mapping[str, float]) -> tuple[tuple[np.ndarray, ...], ...]:
        """Arrays of a variant."""
        leaves = [list(part) for part in template.leaves]
        for path, value in values.items():
            for part, i in self.places[path]:
                leaves[part][i] = np.full_like(leaves[part][i], value)
        return tuple(tuple(part) for part in leaves)

    def stacked(self, lanes: Sequence[VariantLane], part: int) -> list[np.ndarray]:
        """Arrays of a part of all lanes: shared ones unchanged, the others with the lanes first."""
        templates = list({id(lane.built): lane.built for lane in lanes}.values())
        number = {id(t): i for i, t in enumerate(templates)}
        which = np.array([number[id(lane.built)] for lane in lanes])
        written: dict[int, list[str]] = {}
        for path in lanes[0].values:
            for at, i in self.places[path]:
                if at == part:
                    written.setdefault(i, []).append(path)
        arrays = []
        for i in range(len(templates[0].leaves[part])):
            leaves = [t.leaves[part][i] for t in templates]
            same = i not in written and all(_same(leaves[0], x) for x in leaves[1:])
            self.shared[part][i] &= same
            if self.shared[part][i]:
                arrays.append(leaves[0])
                continue
            many = np.stack(leaves)[which]
            for path in written.get(i, ()):
                values = np.array([lane.values[path] for lane in lanes])
                many = np.broadcast_to(values.reshape((-1,) + (1,) * (many.ndim - 1)), many.shape).copy()
            arrays.append(many)
        return arrays


LOOKED = 32  # values from either end of a varied number of which it is asked whether they can be meant


class LanePlanner:
    """Converts the variants of a template to lanes; results of the analysis are reused."""

    def __init__(self, run_template: RunTemplate, ranges: Mapping[str, tuple[float, float]]) -> None:
        self.run_template, self.ranges = run_template, ranges
        self.factory = RunFactory(run_template)
        self.families: list[VariantFamily] = []
        self._templates: dict[tuple[Any, ...], BuiltVariant] = {}
        self.apart: set[str] = set()  # paths that do more than stand in a tree: every value is built for real

    def plan(self, variants: Variants) -> tuple[dict[int, str], list[LaneGroup]]:
        """Group the variants; return the errors of invalid ones by row, and the groups of the others."""
        while True:
            before = len(self.apart)
            refused, groups = self._plan(variants)
            if len(self.apart) == before:
                return refused, groups

    def cautions(self, variants: Variants) -> dict[int, tuple[str, ...]]:
        """What must be said of variants, by row: of the first with each word, and of numbers from their ends inwards.

        Between two values of which nothing is said nothing is either, so that not every variant is built for it.
        """
        known: dict[int, tuple[str, ...]] = {}

        def look(row: int) -> tuple[str, ...]:
            if row not in known:
                known[row] = ()
                with contextlib.suppress(InputError):  # refused, with its reason
                    known[row] = self.factory.bench(variants.row(row)).cautions
            return known[row]

        ends: list[list[int]] = []  # rows from each end of a varied number inwards
        for column in variants.columns.values():
            if column.dtype != float:
                for word in dict.fromkeys(column):
                    look(int(np.flatnonzero(column == word)[0]))
                continue
            _, first = np.unique(column, return_index=True)
            ends += [first.tolist(), first[::-1].tolist()]
        always = set.intersection(*(set(look(rows[0])) for rows in ends)) if ends else set()  # of all, not of a number
        for rows in ends:
            for row in rows[:LOOKED]:
                if not set(look(row)) - always:
                    break
        return {row: said for row, said in known.items() if said}

    def _plan(self, variants: Variants) -> tuple[dict[int, str], list[LaneGroup]]:
        before = len(self.apart)
        refused: dict[int, str] = {}
        groups: dict[int, LaneGroup] = {}
        fixed = [v for p, v in variants.columns.items() if v.dtype != float or p in self.apart]
        alike: dict[tuple[Any, ...], list[int]] = {}  # rows that differ in written values only
        for row in range(len(variants)):
            alike.setdefault(tuple(v[row] for v in fixed), []).append(row)
        for rows in alike.values():
            built = self._built(variants, rows, refused)
            if built is None:
                continue
            family = self._family(built, variants.row(rows[0]))
            if len(self.apart) > before:
                return refused, []
            if not family.checked and not self._check(family, built, variants, rows[1:]):
                return refused, []
            lanes = self._judged(family, built, variants, rows, refused)
            for lane in lanes:
                own = self._family(lane.built, variants.row(lane.row))
                groups.setdefault(id(own), LaneGroup(own, [])).lanes.append(lane)
        return refused, list(groups.values())

    def _built(self, variants: Variants, rows: list[int], refused: dict[int, str]) -> BuiltVariant | None:
        while rows:
            values = variants.row(rows[0])
            key = tuple(v for p, v in values.items() if isinstance(v, str) or p in self.apart)
            if (key, len(self.apart)) in self._templates:
                return self._templates[key, len(self.apart)]
            try:
                built = build(self.factory, values)
            except InputError as error:
                refused[rows.pop(0)] = str(error)
                continue
            while len(self._templates) >= KEPT:
                self._templates.pop(next(iter(self._templates)))
            self._templates[key, len(self.apart)] = built
            return built
        return None

    def _free(self, variants: Variants) -> list[str]:
        return [p for p, v in variants.columns.items() if v.dtype == float and p not in self.apart]

    def _family(self, built: BuiltVariant, values: Mapping[str, Any]) -> VariantFamily:
        for family in self.families:
            if family.fixed == built.fixed:
                break
        else:
            family = VariantFamily(built.fixed)
            self.families.append(family)
        for path, value in values.items():
            if isinstance(value, str) or path in self.apart or path in family.places:
                continue
            low, high = self.ranges[path]
            other = high if value != high else low
            if other == value:
                family.places[path] = ()
                continue
            positions = None
            try:
                positions = places(built, value, build(self.factory, {**values, path: other}), other)
            except InputError:
                pass  # allowed alone, but not with the others of this variant
            if positions is None:
                self.apart.add(path)
            else:
                family.places[path] = positions
        return family

    def _check(self, family: VariantFamily, built: BuiltVariant, variants: Variants, rows: Sequence[int]) -> bool:
        """Check that written arrays equal those of built variants; otherwise no path is written."""
        free = self._free(variants)
        for row in rows[:: max(1, len(rows) // CHECKED)][:CHECKED] if free else ():
            values = variants.row(row)
            try:
                real = build(self.factory, values)
            except InputError:
                continue
            if real.fixed != built.fixed or any(p not in family.places for p in free):
                continue
            written = family.write(built, {p: values[p] for p in free})
            if not all(all(map(_same, a, b)) for a, b in zip(real.leaves, written, strict=True)):
                self.apart.update(free)
                return False
        family.checked = True
        return True

    def _judged(
        self,
        family: VariantFamily,
        built: BuiltVariant,
        variants: Variants,
        rows: Sequence[int],
        refused: dict[int, str],
    ) -> list[VariantLane]:
        free = self._free(variants)
        lanes = [VariantLane(r, built, {p: float(variants.columns[p][r]) for p in free}) for r in rows]
        muscle = [p for p in free if p.startswith("muscle.") and self.ranges[p][0] != self.ranges[p][1]]
        findings, accepted = built.bench.findings, built.bench.accepted
        if not muscle:
            if not findings:
                return lanes
            try:
                check(list(findings))
                said = ""
            except InputError as error:
                said = str(error)
            refused |= dict.fromkeys(rows, said)
            return []
        doubtful = np.ones(len(lanes), bool)
        if not findings and not accepted:
            doubtful = _doubtful(family, built, lanes)
        kept = []
        for lane, doubt in zip(lanes, doubtful, strict=True):
            checked = self._looked_at(lane, variants, refused) if doubt else lane
            if checked is not None:
                kept.append(checked)
        return kept

    def _looked_at(self, lane: VariantLane, variants: Variants, refused: dict[int, str]) -> VariantLane | None:
        values = variants.row(lane.row)
        try:
            bench = self.factory.bench(values)
            check(list(bench.findings))
            if bench.accepted or lane.built.bench.accepted or lane.built.bench.findings:
                return VariantLane(lane.row, build(self.factory, values), lane.values)
        except InputError as error:
            refused[lane.row] = str(error)
            return None
        return lane


def _doubtful(family: VariantFamily, built: BuiltVariant, lanes: Sequence[VariantLane]) -> np.ndarray:
    """Mask of the lanes that need a dry run (lanes,): all, unless only a tension depends on the muscle."""
    plan, limits = built.bench.plan, built.bench.rig.limits(built.bench.layout)
    machine = built.machines[0]
    simple = MUSCLE in machine.units and all(
        s.until is None and s.mode == "span" and isinstance(s.motor, np.ndarray) and isinstance(s.pressure, np.ndarray)
        for s in plan.steps
    )
    if not simple:
        return np.ones(len(lanes), bool)
    pairs = np.concatenate([np.stack(states(s, limits, None, 1.0 / plan.sample_rate)) for s in plan.steps], axis=1)
    pairs = np.unique(pairs, axis=1)
    allowed = min(limits.tension, limits.motor_force) * (1.0 - NEAR)
    width = power(len(lanes))
    leaves = family.stacked([*lanes, *[lanes[-1]] * (width - len(lanes))], 0)
    axes = tuple(0 if not s else None for s in family.shared[0])
    most = np.zeros(len(lanes))
    for first in range(0, pairs.shape[1], max(1, MOST_STATES // width)):
        piece = pairs[:, first : first + max(1, MOST_STATES // width)]
        size = 1 << (piece.shape[1] - 1).bit_length()
        padded = np.pad(piece, ((0, 0), (0, size - piece.shape[1])), mode="edge")
        force = _most_tension(family.fixed.structures[0], axes, tuple(leaves), np.arange(width), *padded)
        most = np.maximum(most, np.asarray(force)[: len(lanes)])
    return np.asarray(~(most <= allowed))


@functools.partial(jit, static_argnums=(0, 1))
def _most_tension(
    structure: Any, axes: tuple[int | None, ...], leaves: Tree, lanes: Any, span: Any, pressure: Scalar
) -> Any:
    """Largest tension of every lane's law at some spans [m] and pressures [Pa]."""

    def one(own: Any, lane: Any) -> Any:
        law = jax.tree.unflatten(structure, own)["plant"].machine.units[MUSCLE].law
        return law.tension(span, pressure).max()

    return jax.vmap(one, in_axes=(axes, 0))(leaves, lanes)
