"""Sweep files in TOML (schema 1).

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
import os
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..bench.prepare import read_protocol
from ..bench.rig_file import rig as rig_of
from ..documents import JsonValue, read_toml
from ..engine import STEP
from ..engine.native import ENGINES
from ..errors import InputError
from ..experiments.protocol import Protocol
from ..experiments.read import shipped, with_values
from ..muscles.law import TensionLaw
from ..schema import FileTable, Place, entry, named, nested, number, read_part, read_table, shown, verbatim, whole, word
from ..specimens import muscle_specimen
from . import posterior
from .outputs import USUAL, Output, read_outputs
from .run_template import RunTemplate
from .settings import WORDS, Setting
from .sweep import MEMORY, SCHEMA, Sweep
from .variants import MOST, SPACINGS, Variants, between, crossed, grid, latin, listed

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
        parts.append(
            grid({path: _axis(raw, known(path), Place(f"grid.{path}", where)) for path, raw in file.grid.items()})
        )
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
    """The values of a path of the grid."""
    if isinstance(raw, Mapping):
        ends = read_part(GridRange, raw, place, "they have")
        low, high, spacing = ends.read(one, place)
        share = np.linspace(0.0, 1.0, ends.count) if ends.count > 1 else np.zeros(1)
        return [float(x) for x in between(one.path, low, high, spacing, share)]
    if isinstance(raw, list) and raw:
        return [one.read(value, where=place.where) for value in raw]
    raise place.fail(
        raw, 'must be a list of values, such as ["1 m", "2 m"], or a range { from = .., to = .., count = .. }'
    )


def _template(file: SweepFile, folder: Path, where: str) -> RunTemplate:
    protocol = _protocol(file.protocol, folder)
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


def _protocol(name: str, folder: Path) -> Protocol:
    return read_protocol(_found(name, folder)) if name.lower().endswith(".toml") else shipped(name)


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
