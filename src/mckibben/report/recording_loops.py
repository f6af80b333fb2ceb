"""Loops of a recording: one channel over another where its cycles are, and the shape of each."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from ..analysis.cycles import find_cycles
from ..analysis.loops import loop
from ..analysis.segments import segments, steps_of, varied
from ..errors import InputError
from ..recordings.recording import Recording
from .document import Block, Column, Figure, Row, Table
from .words import listed, significant

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing

# Channels that are driven, and those that answer, the ones that are measured first.
LENGTHS = ("span", "muscle.length", "muscle.span", "length")
TENSIONS = ("tension", "muscle.tension")
PRESSURES = ("pressure", "muscle.pressure")
LEAST_TURN = 0.02  # share of the largest value by which a channel must move to be driven


def as_written(drawn: Drawing) -> Drawing:
    """The figure with its words as they stand: a dollar sign in a name from outside begins no formula."""
    from matplotlib.text import Text

    for text in drawn.findobj(Text):
        text.set_parse_math(False)
    return drawn


def loop_blocks(record: Recording) -> list[Block]:
    """Figures and tables of loops, for each label of steps in which the length or the pressure goes through cycles."""
    blocks: list[Block] = []
    for label, parts in _groups(record):
        length, tension, pressure = (_first(parts[0], names) for names in (LENGTHS, TENSIONS, PRESSURES))
        if length and tension and (some := _cycling(parts, length)):
            blocks += [_figure(some, length, tension, label), *_table(some, length, tension, _told_apart(record))]
        elif pressure and (some := _cycling(parts, pressure)):
            answers = [n for n in (length, tension) if n and any(_moves(p[n]) for p in some)]
            blocks += [_figure(some, pressure, n, label) for n in answers[:1]]
    return blocks


def _groups(record: Recording) -> list[tuple[str, list[Recording]]]:
    if not record.meta.get("steps"):
        return [("", [record])]
    try:
        labels = dict.fromkeys(str(s["label"]) for s in steps_of(record) if s["recorded"])
        return [(label, segments(record, label)) for label in labels]
    except InputError:
        return [("", [record])]


def _first(record: Recording, names: Sequence[str]) -> str:
    return next((n for n in names if n in record and np.isfinite(record[n]).all()), "")


def _moves(values: np.ndarray) -> bool:
    return bool(np.ptp(values) > LEAST_TURN * np.abs(values).max())


def _cycling(parts: Sequence[Recording], name: str) -> list[Recording]:
    found = []
    for part in parts:
        try:
            if name in part and np.isfinite(part[name]).all() and _moves(part[name]) and find_cycles(part[name]):
                found.append(part)
        except InputError:
            continue
    return found


def _figure(parts: list[Recording], across: str, up: str, label: str) -> Block:
    from .figures.recording_figures import against_figure

    where = f", step “{label}”" if label else ""
    title = f"{_word(up).capitalize()} over {_word(across)}"
    drawn = against_figure(parts, across, channels=[up], title=f"{title}{where}")
    caption = (
        f"{title}{where}: {len(parts)} recorded part{'s' if len(parts) > 1 else ''}, each in the shade of its case."
    )
    return Figure(as_written(drawn), caption, f"{title}{where}.")


def _word(name: str) -> str:
    return name.rpartition(".")[2].replace("_", " ")


def _table(parts: list[Recording], length: str, tension: str, apart: list[str]) -> list[Block]:
    """Width, height, work and stiffness of the mean loop of each part."""
    rows = []
    for part in parts:
        try:
            found = loop(part, length=length, tension=tension)
        except InputError:
            continue
        values = (1e3 * found.width, found.height, found.work, 1e-2 * found.stiffness, found.friction)
        count = len(find_cycles(part[length]))
        rows.append(Row((_case(part, apart), str(count), *(significant(v) for v in values))))
    if not rows:
        return []
    columns = (
        Column("Case"), Column("Cycles", number=True), Column("Width", "mm", True), Column("Height", "N", True),
        Column("Work", "J", True), Column("Stiffness", "N/cm", True), Column("Friction", "N", True),
    )  # fmt: skip
    words = (
        f"Mean loop of each part, {_word(tension)} over {_word(length)}. Width at mid-range of the tension, height at "
    )
    return [
        Table(
            columns,
            tuple(rows),
            words + "that of the length, both positive where the muscle takes work in; friction is half the height. "
            "Work per cycle is positive where the muscle does it",
        )
    ]


def _told_apart(record: Recording) -> list[str]:
    """What varies among the steps."""
    return [*varied(record)] if record.meta.get("steps") else []


def _case(part: Recording, apart: list[str]) -> str:
    step = part.meta.get("step")
    if not step:
        return "whole recording"
    told = [f"{n.replace('_', ' ')} {step['case'][n]}" for n in apart if n in step["case"]]
    return listed(told) or str(step["label"])
