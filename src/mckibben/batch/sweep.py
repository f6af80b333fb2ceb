"""Sweeps: a template and its variants, from TOML files (schema 1) too, checked before the run, identified by a hash.

A file of all sections:

schema = 1
title = "Threads and tubes"
protocol = "isometric-step"            # a shipped one or a .toml file; so are muscle and rig
muscle = "nylon"
rig = "paper"
[set]                                  # the same for all variants, as `mckibben run --set`
range = "full"
cycles = 1
[grid]                                 # every combination
"rig.plumbing.direct.tube.length" = ["0.5 m", "1 m", "2 m"]
"muscle.law.passive_stiffness" = { from = "3 N/cm", to = "5 N/cm", count = 5 }   # spacing = "log"
[latin]                                # a Latin hypercube, beside or instead of the grid
count = 100
seed = 1
[latin.ranges]
"muscle.law.threshold_pressure" = { from = "0.8 bar", to = "1 bar" }
[[list]]                               # one variant each
muscle = "bridgestone"
[posterior]                            # fit = what `mckibben fit --json` printed, or samples = a CSV table
fit = "fit.json"
count = 200
[outputs.peak]                         # see `outputs`; the usual ones by default
channel = "tension"
reduce = "max"
[run]
block = 256                            # variants that are run and stored at once
memory = "1 GB"

A section that is not needed is left out.
"""

from __future__ import annotations

import dataclasses
import functools
import hashlib
import itertools
import json
import os
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .._jax import Scalar
from ..bench.rig_file import rig as rig_of
from ..bench.segment import CHUNK
from ..documents import JsonValue, read_toml
from ..engine import STEP
from ..engine.native import ENGINES
from ..errors import InputError
from ..experiments.read import read_protocol, shipped, with_values
from ..muscles.law import TensionLaw
from ..schema import FileTable, Place, entry, named, nested, number, read_part, read_table, shown, verbatim, whole, word
from ..specimens import muscle_specimen
from . import posterior
from .lanes import BuiltVariant, build
from .outputs import LATER, USUAL, Output, check_channels, document, read_outputs, wanted
from .run import Results, Runner, known_names, lanes_per_call
from .run_template import WORDS, RunFactory, RunTemplate, Setting
from .variants import MOST, SPACINGS, Variants, between, crossed, grid, latin, listed, power

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
        check_channels(self.template.outputs, *known_names(first), self.where)
        labels = list(dict.fromkeys(s.step.label for part in first.parts for s in part.steps if s.step.label))
        for one in self.template.outputs:
            if one.step and one.step not in labels:
                field = f"outputs.{one.name}.step"
                raise InputError(field, one.step, "the protocol's steps are called", known=labels, where=self.where)
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
            said = f"must be at least {each:.3g} bytes for one variant, got {self.memory:.3g} bytes"
            raise InputError("run.memory", None, said, where=self.where)
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


Known = Callable[[str], Setting]


@dataclass(frozen=True, kw_only=True)
class Ends:
    """The ends of a range, each as the setting that it is of reads it, and how values lie between them."""

    low: Any = verbatim("one end of the range", key="from")
    high: Any = verbatim("other end of the range", key="to")
    spacing: str = word(among=SPACINGS, default="linear")

    def read(self, one: Setting, place: Place) -> tuple[float, float, str]:
        """The ends [SI] and the spacing; words have no range."""
        ends = []
        for key, raw in (("from", self.low), ("to", self.high)):
            value = one.read(raw, where=place.where)
            if isinstance(value, str):
                raise place.below(key).fail(value, "it is a word, and words stand in a list")
            ends.append(value)
        return ends[0], ends[1], self.spacing


@dataclass(frozen=True, kw_only=True)
class GridRange(Ends):
    """Values of a grid, evenly spaced."""

    count: int = whole(1, MOST, "number of values")


@dataclass(frozen=True, kw_only=True)
class LatinTable:
    """A Latin hypercube."""

    count: int = whole(1, MOST, "number of variants")
    seed: int = whole(0, 2**32 - 1, default=0)
    ranges: dict[str, Ends] = named(
        Ends, "table of ranges { from, to } by path", owner="a range has", pattern=".*", default_factory=dict
    )

    def variants(self, known: Known, place: Place) -> Variants:
        """The variants; refuses a table without ranges."""
        if not self.ranges:
            raise place.below("ranges").fail(None, "is missing: a table of ranges { from, to } by path")
        at = place.below("ranges")
        ranges = {path: ends.read(known(path), at.below(path)) for path, ends in self.ranges.items()}
        return latin(ranges, self.count, seed=self.seed)


@dataclass(frozen=True, kw_only=True)
class PosteriorTable:
    """Draws from the result of a fit, or from samples of another program."""

    fit: str | None = None
    law: str = ""
    samples: str | None = None
    count: int | None = whole(1, MOST, "number of draws", default=None)
    seed: int = whole(0, 2**32 - 1, default=0)

    def __post_init__(self) -> None:
        if (self.fit is None) == (self.samples is None):
            raise InputError("fit", None, "must be stated, or samples, but not both")
        if self.samples is None and self.count is None:
            raise InputError("count", None, "is missing: a fit needs the number of draws")

    def variants(self, known: Known, folder: Path, muscle: tuple[str, TensionLaw]) -> Variants:
        """The variants, from a file beside that of the sweep, of a muscle with its name."""
        if self.fit is None or self.count is None:
            return posterior.of_samples(folder / str(self.samples), self.count, known, seed=self.seed)
        return posterior.of_json(folder / self.fit, self.law, self.count, known, seed=self.seed, muscle=muscle)


@dataclass(frozen=True, kw_only=True)
class SweepRunTable:
    """How the variants are run."""

    block: int = whole(1, 2**16, "variants that are run and stored at once", default=0)
    memory: float = number("byte", doc="memory of the results", default=MEMORY)
    engine: str = word(among=ENGINES, default="auto")


def _read_rows(raw: object, place: Place) -> tuple[Mapping[str, JsonValue], ...]:
    if not isinstance(raw, list):
        raise place.fail(raw, "must be a list of tables of values by path, each under [[list]]")
    return tuple(place.below(i).table(one).values for i, one in enumerate(raw, 1))


@dataclass(frozen=True, kw_only=True)
class SweepFile:
    """A sweep file as its tables state it."""

    schema: int = SCHEMA
    title: str = ""
    protocol: str
    muscle: str
    rig: str = "paper"
    plumbing: str = ""
    noise_seed: int = whole(0, 2**32 - 1, default=0)
    step: float = number("s", (1e-7, 1e-3), "largest step of the physics", default=STEP)
    accept_saturation: bool = False
    settings: dict[str, Any] = named(None, key="set", pattern=".*", default_factory=dict)
    grid: dict[str, Any] = named(None, pattern=".*", default_factory=dict)
    latin: LatinTable | None = nested(LatinTable, owner="they have", default=None)
    rows: tuple[Mapping[str, Any], ...] = entry(_read_rows, key="list", default=())
    posterior: PosteriorTable | None = nested(PosteriorTable, owner="they have", default=None)
    outputs: tuple[Output, ...] = entry(read_outputs, default=USUAL)
    run: SweepRunTable = nested(SweepRunTable, owner="a run has", default=SweepRunTable())


def read_sweep(path: str | os.PathLike[str]) -> Sweep:
    """Read a sweep from a file; `Sweep.check` checks it against protocol, rig and muscle.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.
    """
    where = os.fspath(path)
    top = FileTable(read_toml(path, field="sweep"), "", where)
    top.schema(SCHEMA)
    file = read_table(SweepFile, top, owner="a sweep has")
    folder = Path(where).parent
    template = _template(file, folder, where)
    settings: dict[str, Setting] = {}

    def known(name: str) -> Setting:
        if name not in settings:
            settings[name] = template.setting(name, where=where)
        return settings[name]

    parts = []
    if file.grid:
        axes = {path: _axis(raw, known(path), Place(f"grid.{path}", where)) for path, raw in file.grid.items()}
        parts.append(grid(axes))
    if file.latin is not None:
        parts.append(file.latin.variants(known, Place("latin", where)))
    if file.rows:
        parts.append(listed([{path: known(path).read(v, where=where) for path, v in row.items()} for row in file.rows]))
    if file.posterior is not None:
        parts.append(file.posterior.variants(known, folder, (file.muscle, template.first_unit.law)))
    if not parts:
        raise top.fail("variants", None, "are missing: a sweep needs one of [grid], [latin], [[list]] and [posterior]")
    variants = crossed(*parts)
    for name in variants.columns:
        if name in template.given:
            raise InputError(name, None, "must be either set or varied", where=where)
    template = _with_files(dataclasses.replace(template, settings=settings), variants, folder, where)
    return Sweep(template, variants, title=file.title, where=where, **dataclasses.asdict(file.run))


def _axis(raw: object, one: Setting, place: Place) -> list[float | str]:
    if isinstance(raw, Mapping):
        ends = read_part(GridRange, raw, place, "they have")
        low, high, spacing = ends.read(one, place)
        share = np.linspace(0.0, 1.0, ends.count) if ends.count > 1 else np.zeros(1)
        return [float(x) for x in between(one.path, low, high, spacing, share)]
    if isinstance(raw, list) and raw:
        return [one.read(value, where=place.where) for value in raw]
    said = 'must be a list of values, such as ["1 m", "2 m"], or a range { from = .., to = .., count = .. }'
    raise place.fail(raw, said)


def _template(file: SweepFile, folder: Path, where: str) -> RunTemplate:
    name = file.protocol
    protocol = read_protocol(_found(name, folder)) if name.lower().endswith(".toml") else shipped(name)
    muscle, rig = _found(file.muscle, folder), _found(file.rig, folder)
    template = RunTemplate(
        protocol=protocol,
        muscle=muscle,
        rig=rig,
        specimens={muscle: muscle_specimen(muscle)},
        rigs={rig: dict(rig_of(rig).document)},
        outputs=file.outputs,
        plumbing=file.plumbing,
        step=file.step,
        accept_saturation=file.accept_saturation,
        noise_seed=file.noise_seed,
    )
    for path in file.settings:
        if path in WORDS:
            raise InputError(f"set.{path}", shown(file.settings[path]), "it stands at the top of the file", where=where)
    words = {path: template.setting(path, where=where).text(raw, where=where) for path, raw in file.settings.items()}
    with_values(protocol, {k: v for k, v in words.items() if not k.startswith(("rig.", "muscle."))}, where=where)
    return dataclasses.replace(template, given=words)


def _found(name: str, folder: Path) -> str:
    """Path of a file named by the sweep, relative to its own file; other names are of shipped objects."""
    return str(folder / name) if name.lower().endswith(".toml") else name


def _with_files(template: RunTemplate, variants: Variants, folder: Path, where: str) -> RunTemplate:
    """Add the files of every muscle and rig that a variant names, in their present state."""
    specimens, rigs = dict(template.specimens), dict(template.rigs)
    for path, read in (
        ("muscle", lambda n: specimens.setdefault(n, muscle_specimen(_found(n, folder)))),
        ("rig", lambda n: rigs.setdefault(n, dict(rig_of(_found(n, folder)).document))),
    ):
        for name in dict.fromkeys(variants.columns.get(path, ())):
            try:
                read(str(name))
            except InputError as error:
                raise error if error.where else error.at(where) from None
    return dataclasses.replace(template, specimens=specimens, rigs=rigs)
