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
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..bench.rig_file import rig as rig_of
from ..bench.software.waveform_import import read_protocol
from ..documents import read_toml
from ..engine import STEP
from ..engine.native import ENGINES
from ..errors import InputError
from ..experiments.protocol import Protocol
from ..experiments.read import shipped, with_values
from ..schema import FileTable
from ..specimens import specimen
from . import posterior
from .outputs import read_outputs
from .run_template import RunTemplate
from .settings import WORDS, Setting
from .sweep import MEMORY, SCHEMA, Sweep
from .variants import MOST, SPACINGS, Variants, between, crossed, grid, latin, listed

SECTIONS = (
    "schema", "title", "protocol", "muscle", "rig", "plumbing", "noise_seed", "step", "accept_saturation", "set", "grid",
    "latin", "list", "posterior", "outputs", "run",
)  # fmt: skip
STEPS = (1e-7, 1e-3)


def read_sweep(path: str | os.PathLike[str]) -> Sweep:
    """Read a sweep from a file; `Sweep.check` checks it against protocol, rig and muscle.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed.
    """
    where = os.fspath(path)
    top = FileTable(read_toml(path, field="sweep"), "", where)
    top.only(SECTIONS, "a sweep has")
    top.schema(SCHEMA)
    folder = Path(where).parent
    template = _template(top, folder)
    settings: dict[str, Setting] = {}

    def known(name: str) -> Setting:
        if name not in settings:
            settings[name] = template.setting(name, where=where)
        return settings[name]

    parts = [_grid(top, known), _latin(top, known), _list(top, known), _posterior(top, known, folder)]
    if all(p is None for p in parts):
        raise top.fail("variants", None, "are missing: a sweep needs one of [grid], [latin], [[list]] and [posterior]")
    variants = crossed(*[p for p in parts if p is not None])
    for name in variants.columns:
        if name in template.given:
            raise InputError(name, None, "must be either set or varied", where=where)
    template = _with_files(dataclasses.replace(template, settings=settings), variants, folder, where)
    run = top.table("run")
    run.only(("block", "memory", "engine"))
    return Sweep(
        template,
        variants,
        title=top.text("title"),
        where=where,
        engine=run.word("engine", "auto", among=ENGINES),
        block=run.whole("block", 1, 2**16) if "block" in run.values else 0,
        memory=run.number("memory", "byte", MEMORY),
    )


def _template(top: FileTable, folder: Path) -> RunTemplate:
    protocol = _protocol(top.word("protocol"), folder)
    muscle, rig = _found(top.word("muscle"), folder), _found(top.word("rig", "paper"), folder)
    accept = top.values.get("accept_saturation", False)
    if not isinstance(accept, bool):
        raise top.fail("accept_saturation", accept, "must be true or false")
    step = top.number("step", "s", STEP)
    if not STEPS[0] <= step <= STEPS[1]:
        raise top.fail("step", top.values["step"], "must be between 0.1 us and 1 ms")
    template = RunTemplate(
        protocol=protocol,
        muscle=muscle,
        rig=rig,
        specimens={muscle: specimen(muscle)},
        rigs={rig: dict(rig_of(rig).document)},
        outputs=read_outputs(top),
        plumbing=top.text("plumbing"),
        step=step,
        accept_saturation=accept,
        noise_seed=top.whole("noise_seed", 0, 2**32 - 1, 0),
    )
    settings = top.table("set")
    for path in settings.values:
        if path in WORDS:
            raise settings.fail(path, settings.values[path], "it stands at the top of the file")
    words = {p: template.setting(p, where=top.where).text(raw, where=top.where) for p, raw in settings.values.items()}
    with_values(protocol, {k: v for k, v in words.items() if not k.startswith(("rig.", "muscle."))}, where=top.where)
    return dataclasses.replace(template, given=words)


def _protocol(name: str, folder: Path) -> Protocol:
    return read_protocol(_found(name, folder)) if name.lower().endswith(".toml") else shipped(name)


def _found(name: str, folder: Path) -> str:
    """Path of a file named by the sweep, relative to its own file; other names are of shipped objects."""
    return str(folder / name) if name.lower().endswith(".toml") else name


def _grid(top: FileTable, known: Any) -> Variants | None:
    table = top.table("grid")
    if not table.values:
        return None
    axes = {}
    for path, raw in table.values.items():
        one = known(path)
        if isinstance(raw, Mapping):
            entry = FileTable.of(raw, table.field(path), top.where)
            entry.only(("from", "to", "count", "spacing"))
            low, high, spacing = _range(entry, one)
            count = entry.whole("count", 1, MOST)
            share = np.linspace(0.0, 1.0, count) if count > 1 else np.zeros(1)
            axes[path] = [float(x) for x in between(path, low, high, spacing, share)]
        elif isinstance(raw, list) and raw:
            axes[path] = [one.read(value, where=top.where) for value in raw]
        else:
            raise table.fail(path, raw, "must be a list of values, or a range { from, to, count }")
    return grid(axes)


def _range(entry: FileTable, one: Setting) -> tuple[float, float, str]:
    ends = []
    for key in ("from", "to"):
        if key not in entry.values:
            raise entry.fail(key, None, "is missing: a range has both ends")
        value = one.read(entry.values[key], where=entry.where)
        if isinstance(value, str):
            raise entry.fail(key, value, "it is a word, and words stand in a list")
        ends.append(value)
    return ends[0], ends[1], entry.word("spacing", "linear", among=SPACINGS)


def _latin(top: FileTable, known: Any) -> Variants | None:
    table = top.table("latin")
    if not table.values:
        return None
    table.only(("count", "seed", "ranges"))
    ranges = {}
    for path, raw in table.table("ranges").values.items():
        entry = FileTable.of(raw, f"latin.ranges.{path}", top.where)
        entry.only(("from", "to", "spacing"))
        ranges[path] = _range(entry, known(path))
    if not ranges:
        raise table.fail("ranges", None, "is missing: a table of ranges { from, to } by path")
    count = table.whole("count", 1, MOST)
    return latin(ranges, count, seed=table.whole("seed", 0, 2**32 - 1, 0))


def _list(top: FileTable, known: Any) -> Variants | None:
    raw = top.values.get("list", [])
    if not isinstance(raw, list):
        raise top.fail("list", raw, "must be a list of tables, [[list]]")
    rows = [FileTable.of(one, f"list.{i}", top.where).values for i, one in enumerate(raw, 1)]
    if not rows:
        return None
    return listed([{path: known(path).read(v, where=top.where) for path, v in row.items()} for row in rows])


def _posterior(top: FileTable, known: Any, folder: Path) -> Variants | None:
    table = top.table("posterior")
    if not table.values:
        return None
    table.only(("fit", "law", "samples", "count", "seed"))
    if ("fit" in table.values) == ("samples" in table.values):
        raise table.fail("fit", None, "must be stated, or samples, but not both")
    seed = table.whole("seed", 0, 2**32 - 1, 0)
    count = table.whole("count", 1, MOST) if "count" in table.values else None
    if "samples" in table.values:
        return posterior.of_samples(folder / table.word("samples"), count, known, seed=seed)
    if count is None:
        raise table.fail("count", None, "is missing: a fit needs the number of draws")
    return posterior.of_json(folder / table.word("fit"), table.text("law"), count, known, seed=seed)


def _with_files(template: RunTemplate, variants: Variants, folder: Path, where: str) -> RunTemplate:
    """Add the files of every muscle and rig that a variant names, in their present state."""
    specimens, rigs = dict(template.specimens), dict(template.rigs)
    for path, read in (
        ("muscle", lambda n: specimens.setdefault(n, specimen(_found(n, folder)))),
        ("rig", lambda n: rigs.setdefault(n, dict(rig_of(_found(n, folder)).document))),
    ):
        for name in dict.fromkeys(variants.columns.get(path, ())):
            try:
                read(str(name))
            except InputError as error:
                raise error if error.where else error.at(where) from None
    return dataclasses.replace(template, specimens=specimens, rigs=rigs)
