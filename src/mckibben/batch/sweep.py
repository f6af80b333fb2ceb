"""Sweeps: a template and its variants, checked before the run, identified by a hash."""

from __future__ import annotations

import functools
import hashlib
import itertools
import json
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass

from .._jax import Scalar
from ..bench.segment import CHUNK
from ..documents import JsonValue
from ..errors import InputError
from .lanes import BuiltVariant, build
from .outputs import LATER, check_channels, document, wanted
from .run import Results, Runner, known_names, lanes_per_call
from .run_template import RunFactory, RunTemplate
from .variants import Variants, power

SCHEMA = 1
MOST_CORNERS = 16  # combinations of extreme values that are built before anything runs
MOST_WORDS = 64  # values of a path that are words, likewise
MEMORY = 1e9  # that the samples of a block may take in a worker [bytes]
LEAST_BLOCK = 16
MUSCLE_SECONDS = 500.0  # simulated in a block: a few seconds of a core, and no slower than larger blocks


@dataclass(frozen=True)
class Sweep:
    """Variants of a template, as a file states them or as they were made in Python.

    Attributes:
        template: their common part.
        variants: them.
        title: for people.
        engine: that compiles the lanes.
        block: variants that are run and stored at once; chosen by their number where 0.
        memory: most that the samples of a block may take in a worker [bytes].
        where: file, for error messages.
    """

    template: RunTemplate
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
        """SHA-256 of everything that determines the results; engine and blocks do not."""
        digest = hashlib.sha256(json.dumps(self.document(), sort_keys=True, separators=(",", ":")).encode())
        for path, values in self.variants.columns.items():
            digest.update(path.encode())
            digest.update(values.tobytes() if values.dtype == float else "\0".join(values).encode())
        return digest.hexdigest()

    def document(self) -> dict[str, JsonValue]:
        """Shared properties of the variants as a JSON document."""
        template = self.template
        return {
            "schema": SCHEMA,
            "title": self.title,
            "protocol": template.protocol.document(),
            "muscle": template.muscle,
            "rig": template.rig,
            "specimens": {k: s.stated() for k, s in template.specimens.items()},
            "rigs": {k: dict(d) for k, d in template.rigs.items()},
            "set": dict(template.given),
            "plumbing": template.plumbing,
            "noise_seed": template.noise_seed,
            "step": template.step,
            "accept_saturation": template.accept_saturation,
            "outputs": document(template.outputs),
            "parameters": {p: template.settings[p].unit for p in self.variants.columns},
            "variants": len(self.variants),
        }

    def check(self) -> BuiltVariant:
        """Check everything before the run; return the first variant.

        Every value is within its declared bounds, every path at its ends and every word makes a bench, as do the
        combinations of ends while they are few; every output is made of something that there is. What the dry run of a
        variant finds is a result of that variant and not looked at here.

        Raises:
            InputError: names the path, the value and what is allowed.
        """
        for path, (low, high) in self.ranges.items():
            self.template.settings[path].check(low, high, where=self.where)
        factory = RunFactory(self.template)
        first, longest = self._built(factory, self.variants.row(0)), 0
        for values in self._trials():
            longest = max(longest, self._built(factory, values).bench.plan.samples)
        self._check_outputs(first)
        self.sized(1, max(longest, first.bench.plan.samples))
        return first

    def sized(self, workers: int, samples: int, duration: float = 0.0) -> int:
        """Number of variants per block: enough for every worker, within the memory, and soon done: it is what Ctrl-C loses.

        Args:
            workers: that share the work.
            samples: samples of the longest variant.
            duration: of the longest variant; 0 if its time does not count [s].

        Raises:
            InputError: if one variant alone takes more than the memory.
        """
        kept = sum(o.reduce in LATER for o in self.template.outputs)
        # kept samples twice, with their steps; a chunk of all that is looked at; tables of set-points
        whole = 24.0 * samples * (kept + 1) if kept else 0.0
        each = whole + 16.0 * CHUNK * (len(wanted(self.template.outputs)) + 12) + 48.0 * samples
        fits = int(self.memory / each)
        if fits < 1:
            raise InputError(
                "run.memory",
                None,
                f"must be at least {each:.3g} bytes for one variant, got {self.memory:.3g} bytes",
                where=self.where,
            )
        most = lanes_per_call(self.engine)
        if self.engine != "gpu" and duration:
            most = min(most, max(LEAST_BLOCK, 1 << int(MUSCLE_SECONDS / duration).bit_length() >> 1))
        wished = self.block or max(LEAST_BLOCK, min(most, power(-(-len(self.variants) // (2 * workers)))))
        return max(1, min(wished, 1 << (fits.bit_length() - 1), power(len(self.variants))))

    def _built(self, factory: RunFactory, values: Mapping[str, Scalar]) -> BuiltVariant:
        try:
            return build(factory, values)
        except InputError as error:
            raise error.changed(where=error.where or self.where) from None

    def _trials(self) -> Iterator[dict[str, JsonValue]]:
        """Variants at the ends of every range, with every text, and at the corners if they are few."""
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

    def _check_outputs(self, first: BuiltVariant) -> None:
        check_channels(self.template.outputs, *known_names(first), self.where)
        labels = list(dict.fromkeys(s.step.label for part in first.parts for s in part.steps if s.step.label))
        for one in self.template.outputs:
            if one.step and one.step not in labels:
                field = f"outputs.{one.name}.step"
                raise InputError(field, one.step, "the protocol's steps are called", known=labels, where=self.where)


def run_batch(sweep: Sweep, *, progress: Callable[[float], None] = lambda _: None) -> Results:
    """Run all variants of a sweep in this process.

    Args:
        sweep: the sweep to run.
        progress: told the share of the work that is done.

    Raises:
        InputError: as `Sweep.check`.
    """
    sweep.check()
    return Runner(sweep.template, sweep.ranges, engine=sweep.engine).run(sweep.variants, progress)


def blocks(count: int, size: int) -> Iterator[slice]:
    """Split variants into blocks."""
    return (slice(i, min(i + size, count)) for i in range(0, count, size))
