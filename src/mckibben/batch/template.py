"""One variant on the host, as the trees of arrays that a lane is made of, and which of them a parameter sets.

Building a bench from words takes a tenth of a second, so it is not done for every lane. Where a parameter is found to be
set, unchanged, at some places of the trees and nowhere else, other variants are made by writing their values there. What it
sets is found by building two variants that differ in it alone; that the trees of others come out right, bit for bit, is
checked on some of them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from ..assembly.machine import Machine
from ..bench.hardware.computer import Timing
from ..bench.prepare import PreparedRun, RunSegment
from ..bench.segment import software_of, timing_of, with_friction_scale
from ..bench.software.loop import BenchSoftware
from .recipe import Kitchen

STEPS = 64  # of a part, to which the tables of windows are padded, or 16 times as many


class Fixed(NamedTuple):
    """What lanes of one compiled function have in common and no array holds.

    Attributes:
        structures: of the trees of every part.
        shapes: of the arrays of every part.
        timing: of the loop; its latency is an array of the trees.
        every: samples of the loop per sample of the protocol.
    """

    structures: tuple[Any, ...]
    shapes: tuple[Any, ...]
    timing: Timing
    every: int


class Template(NamedTuple):
    """A variant that was built for real.

    Attributes:
        bench: of it.
        machines: of every part.
        parts: of the plan.
        fixed: what other lanes must have too.
        leaves: arrays of every part.
        guard: what the dry run looked at beside the muscle; a parameter that changes it is none that a lane can be given.
    """

    bench: PreparedRun
    machines: tuple[Machine, ...]
    parts: tuple[RunSegment, ...]
    fixed: Fixed
    leaves: tuple[tuple[np.ndarray, ...], ...]
    guard: tuple[Any, ...]


def build(kitchen: Kitchen, values: Mapping[str, Any]) -> Template:
    """A variant.

    Args:
        kitchen: of the recipe.
        values: by path.

    Raises:
        InputError: names what is unknown or out of bounds.
    """
    bench = kitchen.bench(values)
    timing = timing_of(bench)
    parts = tuple(bench.segments())
    machines, leaves, structures = [], [], []
    for part in parts:
        rig = bench.rig
        machine = rig.machine(
            part.layout, with_friction_scale(bench.unit, part.friction), start=part.start_span, moves=part.moves
        )  # fmt: skip
        tree = {
            "plant": rig.plant(machine, part.layout, mounted=part.start_span),
            "software": _trimmed(software_of(bench, part, timing), part),
            "pressure": jnp.asarray(part.start_pressure, float),
            "latency": jnp.asarray(timing.latency, float),
            "windows": _windows(kitchen, part),
        }
        found, structure = jax.tree.flatten(tree)
        machines.append(machine)
        leaves.append(tuple(np.asarray(leaf) for leaf in found))
        structures.append(structure)
    shapes = tuple(tuple((x.shape, str(x.dtype)) for x in part) for part in leaves)
    fixed = Fixed(tuple(structures), shapes, timing._replace(latency=0.0), bench.every)
    limits = bench.rig.limits(bench.layout)
    guard = (bench.layout, bench.plan.rest_length, [len(bench.plan.steps), bench.plan.samples], str(limits))
    return Template(bench, tuple(machines), parts, fixed, tuple(leaves), guard)


def _trimmed(software: BenchSoftware, part: RunSegment) -> BenchSoftware:
    """With tables of set-points as long as the part needs, for there may be one for every lane."""
    size = 1024
    while size < sum(s.count for s in part.steps):
        size *= 2
    own: Any = software.sequencer
    table = {n: v[:size] if len(v) >= size else np.pad(v, (0, size - len(v))) for n, v in own.table.items()}
    trimmed: BenchSoftware = software.replace(sequencer=own.replace(table=table))
    return trimmed


def _windows(kitchen: Kitchen, part: RunSegment) -> dict[str, np.ndarray]:
    """Of every output, at which steps of the part it looks (steps,)."""
    size = STEPS
    while size < len(part.steps):
        size *= 16
    found = {}
    for one in kitchen.recipe.outputs:
        if one.sampled:
            chosen = [not one.step or s.step.label == one.step for s in part.steps]
            found[one.name] = np.pad(np.array(chosen), (0, size - len(chosen)))
    return found


Places = tuple[tuple[int, int], ...]  # part and number of each array that a parameter sets


def places(one: Template, a: float, other: Template, b: float) -> Places | None:
    """Where a parameter stands that is `a` in one variant and `b` in another; None where it does more than stand there."""
    if one.fixed != other.fixed or one.guard != other.guard:
        return None
    found = []
    for part, (mine, theirs) in enumerate(zip(one.leaves, other.leaves, strict=True)):
        for i, (x, y) in enumerate(zip(mine, theirs, strict=True)):
            if _same(x, y):
                continue
            if x.dtype != float or not (np.all(x == a) and np.all(y == b)):
                return None
            found.append((part, i))
    return tuple(found)


def same_leaves(one: tuple[tuple[np.ndarray, ...], ...], other: tuple[tuple[np.ndarray, ...], ...]) -> bool:
    """Whether two variants are the same, bit for bit."""
    pairs = [(x, y) for a, b in zip(one, other, strict=True) for x, y in zip(a, b, strict=True)]
    return all(_same(x, y) for x, y in pairs)


def _same(x: np.ndarray, y: np.ndarray) -> bool:
    return x.shape == y.shape and bool(np.array_equal(x, y, equal_nan=x.dtype == float))
