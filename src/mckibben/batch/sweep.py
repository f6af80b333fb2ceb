"""A sweep: a recipe and its variants, checked before anything runs, with one hash for one piece of work."""

from __future__ import annotations

import functools
import hashlib
import itertools
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ..bench.segment import CHUNK
from ..errors import InputError, suggest
from .outputs import LATER, check_channels, document, wanted
from .recipe import Kitchen, Recipe
from .run import LANES, known_names
from .template import Template, build
from .variants import Variants, power

SCHEMA = 1
MOST_CORNERS = 16  # combinations of extreme values that are built before anything runs
MOST_WORDS = 64  # values of a path that are words, likewise
MEMORY = 1e9  # that the samples of a block may take in a worker [bytes]
LEAST_BLOCK = 16


@dataclass(frozen=True)
class Sweep:
    """Variants of a recipe, as a file states them or as they were made in Python.

    Attributes:
        recipe: what they share.
        variants: them.
        title: for people.
        engine: that compiles the lanes.
        block: variants that are run and stored at once; chosen by their number where 0.
        memory: most that the samples of a block may take in a worker [bytes].
        where: file, for complaints.
    """

    recipe: Recipe
    variants: Variants
    title: str = ""
    engine: str = "auto"
    block: int = 0
    memory: float = MEMORY
    where: str = "sweep"

    @functools.cached_property
    def ranges(self) -> dict[str, tuple[float, float]]:
        """Lowest and highest value of every varied number [SI]."""
        columns = self.variants.columns.items()
        return {p: (float(v.min()), float(v.max())) for p, v in columns if v.dtype == float}

    @functools.cached_property
    def digest(self) -> str:
        """SHA-256 of all that decides the results; engine and blocks do not."""
        told = hashlib.sha256(json.dumps(self.document(), sort_keys=True, separators=(",", ":")).encode())
        for path, values in self.variants.columns.items():
            told.update(path.encode())
            told.update(values.tobytes() if values.dtype == float else "\0".join(values).encode())
        return told.hexdigest()

    def document(self) -> dict[str, Any]:
        """What the variants share, as a store keeps it."""
        recipe = self.recipe
        return {
            "schema": SCHEMA, "title": self.title, "protocol": recipe.protocol.document(), "muscle": recipe.muscle,
            "rig": recipe.rig, "specimens": {k: s.stated() for k, s in recipe.specimens.items()},
            "rigs": {k: dict(d) for k, d in recipe.rigs.items()}, "set": dict(recipe.given),
            "plumbing": recipe.plumbing, "noise_seed": recipe.noise_seed, "step": recipe.step,
            "accept_saturation": recipe.accept_saturation, "outputs": document(recipe.outputs),
            "parameters": {p: recipe.settings[p].unit for p in self.variants.columns}, "variants": len(self.variants),
        }  # fmt: skip

    def check(self) -> Template:
        """Refuse what is wrong before anything runs; gives the first variant.

        Every value is within its declared bounds, every path at its ends and every word makes a bench, as do the
        combinations of ends while they are few; every output is made of something that there is. What the dry run of a
        variant finds is a result of that variant and not looked at here.

        Raises:
            InputError: names the path, the value and what is allowed.
        """
        for path, (low, high) in self.ranges.items():
            self.recipe.settings[path].check(low, high, where=self.where)
        kitchen = Kitchen(self.recipe)
        first, longest = self._built(kitchen, self.variants.row(0)), 0
        for values in self._trials():
            longest = max(longest, self._built(kitchen, values).bench.plan.samples)
        self._check_outputs(first)
        self.sized(1, max(longest, first.bench.plan.samples))
        return first

    def sized(self, workers: int, samples: int) -> int:
        """Variants of a block: enough for every worker, within the memory.

        Args:
            workers: that share the work.
            samples: of the longest variant.

        Raises:
            InputError: if one variant alone takes more than the memory.
        """
        kept = sum(o.reduce in LATER for o in self.recipe.outputs)
        # kept samples twice, with their steps; a chunk of all that is looked at; tables of set-points
        whole = 24.0 * samples * (kept + 1) if kept else 0.0
        each = whole + 16.0 * CHUNK * (len(wanted(self.recipe.outputs)) + 12) + 48.0 * samples
        fits = int(self.memory / each)
        if fits < 1:
            raise InputError(
                "run.memory", f"{self.memory:.3g} bytes", f"one variant takes {each:.3g} bytes", where=self.where
            )
        wished = self.block or max(LEAST_BLOCK, min(LANES, power(-(-len(self.variants) // (2 * workers)))))
        return max(1, min(wished, 1 << (fits.bit_length() - 1), power(len(self.variants))))

    def _built(self, kitchen: Kitchen, values: Mapping[str, Any]) -> Template:
        try:
            return build(kitchen, values)
        except InputError as error:
            raise InputError(error.field, error.value, error.allowed, where=error.where or self.where) from None

    def _trials(self) -> Iterator[dict[str, Any]]:
        """Variants at the ends of every range, with every word, and at the corners while they are few."""
        base = self.variants.row(0)
        for path, values in self.variants.columns.items():
            if values.dtype == object:
                for word in list(dict.fromkeys(values))[:MOST_WORDS]:
                    yield {**base, path: word}
            else:
                yield from ({**base, path: end} for end in self.ranges[path])
        if 2 ** len(self.ranges) <= MOST_CORNERS and len(self.ranges) > 1:
            for corner in itertools.product(*self.ranges.values()):
                yield {**base, **dict(zip(self.ranges, corner, strict=True))}

    def _check_outputs(self, first: Template) -> None:
        check_channels(self.recipe.outputs, *known_names(first), self.where)
        labels = list(dict.fromkeys(s.step.label for part in first.parts for s in part.steps if s.step.label))
        for one in self.recipe.outputs:
            if one.step and one.step not in labels:
                said = f"{suggest(one.step, labels)}the protocol's steps are called {', '.join(labels) or 'nothing'}"
                raise InputError(f"outputs.{one.name}.step", one.step, said, where=self.where)


def run_batch(sweep: Sweep, *, progress: Callable[[float], None] = lambda _: None) -> Any:
    """All variants of a sweep in this process: `run.Results`.

    Args:
        sweep: what to run.
        progress: told the share of the work that is done.

    Raises:
        InputError: as `Sweep.check`.
    """
    from .run import Runner

    sweep.check()
    return Runner(sweep.recipe, sweep.ranges, engine=sweep.engine).run(sweep.variants, progress)


def blocks(count: int, size: int) -> Iterator[slice]:
    """Variants one block after the other."""
    return (slice(i, min(i + size, count)) for i in range(0, count, size))


def codes_of(codes: np.ndarray) -> dict[str, int]:
    """How many variants have each result code, by its name."""
    from .outcome import Outcome

    return {Outcome(c).name.lower(): int(n) for c, n in zip(*np.unique(codes, return_counts=True), strict=True)}
