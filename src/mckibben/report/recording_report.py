"""The report of a recording: what was done, with what, what came of it, and what it rests on.

It reads the recording alone, whether a simulation, a real machine or another laboratory wrote it; what a recording does not
hold is left out. The only date in it is the recording's own.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..citations import bibtex, known_keys
from ..recordings.recording import Recording
from . import recording_tables as tables
from .document import (
    Block,
    Column,
    Document,
    Figure,
    Fold,
    Heading,
    KeyValues,
    Listing,
    Note,
    Paragraph,
    References,
    Row,
    Section,
    Span,
    Table,
    Text,
)
from .origins import inferred_inputs, known_specimen, parameters
from .recording_loops import as_written, loop_blocks
from .words import amount, flat, is_number, listed, mapping, minus, significant, tied, versions_text

MOST_FURTHER = 60  # lines of what a recording says beside all that is known here
# Keys of the meta that have a place of their own, or are too long for one.
_TOLD = frozenset(
    "title sentence circuit run protocol digest rig rig_document plumbing specimen rest_length inferred environment seed "
    "warnings citations versions created parameters balance friction energy saturation timing steps events result message "
    "calibration deadlines description step gaps".split()
)


def recording_report(record: Recording, *, name: str = "") -> Document:
    """The report of a recording.

    Args:
        record: any recording.
        name: of its file, which stands for a missing title.
    """
    meta = record.meta
    sections = [
        Section("What was done", tuple(_done(record, name)), "done"),
        Section("What was recorded", tuple(_figures(record)), "recorded"),
        *_sections(record),
        *_rests(meta),
    ]
    return Document(str(meta.get("title") or name or "Recording"), tuple(sections), _sentence(meta))


def write_recording_report(file: str | os.PathLike[str], out: str | Path) -> Path:
    """Read a recording and write its report to an ``.html`` or ``.pdf`` file.

    Raises:
        InputError: the recording cannot be read, or the report not be written; says why.
    """
    from ..recordings import read_recording
    from .document import checked_place

    place = checked_place(out)
    return recording_report(read_recording(Path(file)), name=Path(file).name).write(place)


def _sentence(meta: Mapping[str, Any]) -> str:
    said = str(meta.get("sentence") or "").removeprefix(f"{meta.get('title')}.").strip()
    return said or ", ".join(str(meta[k]) for k in ("circuit", "run") if meta.get(k))


# ---- what was done


def _done(record: Recording, name: str) -> list[Block]:
    meta = record.meta
    blocks: list[Block] = []
    if meta.get("result", "done") != "done":
        words = ": ".join(str(w) for w in (meta["result"], meta.get("message")) if w)
        blocks.append(Note("The run did not reach its end", (words,), "stop"))
    cautions = [*_warnings(meta), *tables.saturation(meta)]
    if cautions:
        blocks.append(Note("Caution", tuple(cautions)))
    return [*blocks, KeyValues(tuple(_facts(record, name)))]


def _warnings(meta: Mapping[str, Any]) -> list[str]:
    found = meta.get("warnings")
    return [str(mapping(w).get("text", w)) for w in found] if isinstance(found, list) else []


def _facts(record: Recording, name: str) -> list[tuple[str, Text]]:
    meta = record.meta
    facts: list[tuple[str, Text]] = []

    def add(title: str, *words: Any) -> None:
        told = ", ".join(str(w) for w in words if w)
        if told:
            facts.append((title, told))

    spec = known_specimen(meta)
    add(
        "Muscle",
        spec.title if spec else "",
        meta.get("specimen") if not isinstance(meta.get("specimen"), Mapping) else "",
    )
    if is_number(meta.get("rest_length")):
        add("Rest length", amount(meta["rest_length"], "m"))
    rig = mapping(meta.get("rig_document"))
    add("Test machine", rig.get("title"), f"rig {meta['rig']}" if meta.get("rig") else "")
    add("Air", f"plumbing “{meta['plumbing']}”" if meta.get("plumbing") else "", *_room(meta))
    add("Protocol", mapping(meta.get("protocol")).get("name"), mapping(meta.get("protocol")).get("source"))
    add("Recorded", meta.get("created"))
    add("Time", *tables.clock(record))
    timing = {k: v for k, v in mapping(meta.get("timing")).items() if is_number(v) and v > 0.0}
    control = [f"software at {tied(significant(timing['control_rate']), 'Hz')}"] if "control_rate" in timing else []
    control += [f"{k} {amount(timing[k] * 1e3, '1')} ms" for k in ("latency", "step") if k in timing]
    add("Clocks", *control)
    add("Result", meta.get("message") or meta.get("result"))
    add("Seed of the noise", str(meta["seed"]) if is_number(meta.get("seed")) else "")
    add("File", name)
    if meta.get("digest"):
        facts.append(("Protocol's hash", Span(str(meta["digest"]), "code")))
    return facts


def _room(meta: Mapping[str, Any]) -> list[str]:
    room = mapping(meta.get("environment"))
    found = []
    if is_number(room.get("pressure_abs")):
        found.append(f"room at {amount(room['pressure_abs'], 'Pa', 5)} absolute")
    if is_number(room.get("temperature")):
        found.append(tied(significant(room["temperature"]), "K"))
    return found


# ---- what was recorded


def _figures(record: Recording) -> list[Block]:
    if not any(np.isfinite(record[name]).any() for name in record.names()):
        return [Paragraph("No channel holds a value.")]
    from .figures.recording_figures import time_figure
    from .figures.recording_panels import usual_channels

    shown = usual_channels([record])
    kinds = {record.channels[n].kind for n in shown}
    words = ["Measured channels are lines"] if "measured" in kinds else []
    words += [
        "true ones of the simulation thin lines on them" if words else "lines are true values of the simulation"
    ] * ("true" in kinds)
    words += ["commands dashed"] * ("command" in kinds)
    caption = f"{listed(words)}. A line ends where samples are missing."
    over = Figure(as_written(time_figure(record)), caption[0].upper() + caption[1:], f"Over time: {listed(shown)}.")
    return [over, *loop_blocks(record), Heading("Channels"), tables.channels(record)]


# ---- the rest


def _sections(record: Recording) -> list[Section]:
    meta = record.meta
    found = (
        ("Steps and events", "steps", [*tables.steps(record), *tables.events(meta)]),
        ("Balances", "balances", tables.balances(meta)),
        ("Where the energy went", "energy", tables.energy(meta)),
        ("Calibration", "calibration", tables.calibration(meta)),
        ("Deadlines", "deadlines", tables.deadlines(meta)),
        ("Parameters and their origin", "parameters", _parameters(meta)),
    )
    return [Section(title, tuple(blocks), anchor) for title, anchor, blocks in found if blocks]


def _parameters(meta: Mapping[str, Any]) -> list[Block]:
    blocks: list[Block] = []
    guessed = inferred_inputs(meta)
    if guessed:
        rows = tuple(Row((Span(g.name, "code"), g.value, g.file), note=g.note) for g in guessed)
        columns = (Column("Name in its file"), Column("Value", wide=True), Column("File"))
        words = (
            "No source prints these; they were chosen so that what is printed follows, or as such parts usually are."
        )
        blocks += [Paragraph(words), Table(columns, rows, "Inferred, as far as this run used it")]
    resolved = parameters(meta)
    if resolved:
        rows = tuple(Row((Span(p.path, "code"), p.value, ("○ " if p.inferred else "") + p.origin)) for p in resolved)
        columns = (Column("Path"), Column("Value"), Column("Origin", wide=True))
        count = sum(p.inferred for p in resolved)
        title = ("All parameters of the run ", Span(f"{len(resolved)}, of them {count} inferred, marked ○", "quiet"))
        words = "Default or derived: the package's own value, or one that follows from the files of rig and specimen."
        blocks.append(Fold(title, (Table(columns, rows), Paragraph(words, "quiet"))))
    further = [p for k, v in meta.items() if k not in _TOLD for p in flat(v, str(k))]
    if further:
        kept = tuple((name, minus(text)) for name, text in further[:MOST_FURTHER])
        rest = len(further) - len(kept)
        more = (Paragraph(f"And {rest} more, in the recording.", "quiet"),) if rest else ()
        blocks.append(Fold("Further, as the recording says it", (KeyValues(kept), *more)))
    return blocks


def _rests(meta: Mapping[str, Any]) -> list[Section]:
    """Papers and versions."""
    cited = meta.get("citations")
    keys = dict.fromkeys(str(k) for k in cited) if isinstance(cited, list) else {}
    spec = known_specimen(meta)
    keys |= dict.fromkeys(spec.sources if spec else ())
    found = []
    if keys:
        known = [k for k in keys if k in known_keys()]
        listing = (Fold("BibTeX", (Listing(bibtex(known)),)),) if known else ()
        found.append(Section("Papers this run rests on", (References(tuple(keys)), *listing), "papers"))
    ran = ", ".join(f"{n} {v}" for n, v in mapping(meta.get("versions")).items())
    pairs = (("The run", ran),) if ran else ()
    found.append(Section("Versions", (KeyValues((*pairs, ("This report", versions_text()))),), "versions"))
    return found
