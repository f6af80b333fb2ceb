"""Recordings overlaid: their charts, the muscle that plays them, values measured on each, and their notes."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import math
import re
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ....analysis.channels import find_cycles
from ....analysis.loops import loops
from ....analysis.segments import segments as recorded_steps
from ....analysis.segments import varied
from ....documents import JsonValue
from ....errors import InputError, MckibbenError
from ....muscles.muscle import built_muscle
from ....quantities import from_si, parse, shown_unit
from ....recordings import Note, Recording
from ....recordings.provenance import told_apart
from ....report.origins import known_specimen
from ...bench.chosen import drawn_muscle
from ...charts import Axis, Chart, ChartLine, Mark, plain_numbers, thinned
from ...elements import page_document
from ...forms import plain_text
from ...stream import channel, places
from ...widgets import (
    THIN,
    Dialog,
    TypedField,
    box,
    button,
    check,
    empty,
    grouped,
    link,
    loading,
    panel,
    segments,
    select,
    tell,
    text,
)
from . import jobs
from .listing import LETTERS, RecordingChoice, whole

HIGH, LOW = 270, 150  # of charts [px]
VIEWS = {"tension": "Tension", "law": "Less the law", "channels": "All channels", "loops": "Loops compared"}
MOST_LOOPS = 12  # that are laid over one another
NAMES = {"pressure": ("Pressure", "bar", "Pa"), "length": ("Length", "cm", "m"), "tension": ("Tension", "N", "N")}
LENGTH, TENSION = Axis("length", "cm", "length"), Axis("Tension", "N", "tension")
# Of the muscle itself: a law speaks of its braid and of the air in it, not of what stands between it and the sensors.
OWN = {
    "length": ("muscle.length", "length", "muscle.span", "span"), "pressure": ("muscle.pressure", "pressure"),
    "tension": ("tension", "muscle.tension"),
}  # fmt: skip


@dataclass(frozen=True)
class OverlaidPart:
    """The shown part of one recording."""

    letter: str  # of `LETTERS`
    name: str
    record: Recording  # the step that is shown, or all of it
    begins: float  # time of its samples that stands at zero of the axis [s]
    words: str = ""  # which step it is; nothing if it is all

    def values(self, channel: str) -> np.ndarray | None:
        """A quantity of `NAMES`, or a channel by its name, in the unit that is shown (n,); None if it was not recorded."""
        name = places(self.record).get(channel) if channel in NAMES else channel
        if name is None or name not in self.record:
            return None
        si = self.record.unit(name)
        unit = NAMES[channel][1] if channel in NAMES else shown_unit(si)
        if channel in NAMES and si != NAMES[channel][2]:
            return None
        zero, one = [0.0, 1.0] if unit == si else [from_si(v, si, unit) for v in (0.0, 1.0)]  # degrees have a zero
        return zero + (one - zero) * self.record[name]


def steps(record: Recording) -> list[tuple[str, Recording]]:
    """Recorded steps with a name for each; the whole recording if it has none."""
    if not record.meta.get("steps"):
        return [("", record)]
    try:
        parts, apart = recorded_steps(record), varied(record)
    except InputError:
        return [("", record)]
    named = []
    for i, part in enumerate(parts, 1):
        step = part.meta["step"]
        case = ", ".join(f"{n.replace('_', ' ')} {step['case'][n]}" for n in apart if n in step["case"])
        named.append((f"{i} {step['label'] or step['path']}{f', {case}' if case else ''}", part))
    return named if len(named) > 1 else [("", parts[0])]


def begins(record: Recording) -> float:
    """Time of the first reversal of the length [s], at which recordings are aligned; else of the first sample."""
    name = places(record).get("length")
    if name is None or last_cycle(record) is None:
        return float(record.time[0])
    return float(record.time[find_cycles(record[name])[0].start])


def last_cycle(record: Recording) -> slice | None:
    """The samples of the last full cycle of the length; nothing if it has none."""
    name = places(record).get("length")
    if name is None:
        return None
    try:
        last = find_cycles(record[name])[-1]
    except MckibbenError:
        return None
    return slice(last.start, last.end + 1)


def charts(parts: Sequence[OverlaidPart], view: str, channels: Sequence[str] = ()) -> list[Chart | str]:
    """Charts of a view, with the named channels below; a message if there is nothing to draw."""
    shown: list[Chart | str | None]
    if view == "channels":
        shown = [over_time(parts, quantity, LOW) for quantity in NAMES]
    else:
        first = less_the_law(parts) if view == "law" else over_length(parts)
        shown = [first, over_time(parts, "tension", LOW) or over_time(parts, "pressure", LOW)]
    drawn = [one for one in (*shown, *(over_time(parts, name, LOW) for name in channels)) if one is not None]
    if not drawn:  # of no muscle: the first channel that was measured
        first_of = (over_time(parts, name, HIGH) for name in other_channels(parts))
        drawn = [next((one for one in first_of if one is not None), "Nothing was recorded beside the time.")]
    return drawn


def other_channels(parts: Sequence[OverlaidPart]) -> list[str]:
    """Channels of the recordings that no chart shows by itself, measured ones first."""
    kinds: dict[str, str] = {}
    for part in parts:
        own = places(part.record).values()
        kinds |= {name: part.record.channels[name].kind for name in part.record.names() if name not in own}
    return sorted(kinds, key=lambda name: kinds[name] == "command")


def over_length(parts: Sequence[OverlaidPart]) -> Chart | None:
    """Chart of tension over length, of the last full cycle if there are cycles."""
    lines = []
    for part in parts:
        x, y = part.values("length"), part.values("tension")
        if x is not None and y is not None:
            lines.append(_loop(part, x, y, len(parts) > 1))
    if not lines:
        return None
    sentence = f"Tension against length of {_named(parts)}; {_cycles(parts)}."
    return Chart(_title("Tension", parts), sentence, LENGTH, TENSION, lines, height=HIGH)


def swept_parts(part: OverlaidPart, record: Recording) -> list[tuple[str, OverlaidPart]]:
    """Steps of one recording with what was varied between them; none where it has one step."""
    named = steps(record)
    apart = varied(record) if len(named) > 1 else {}
    if not apart:
        return []
    cases = [", ".join(str(one.meta["step"]["case"].get(name, "")) for name in apart) for _, one in named]
    return [(case, replace(part, record=one, words=words)) for case, (words, one) in zip(cases, named, strict=True)]


def listed_parts(recordings: Sequence[tuple[str, Recording]]) -> list[tuple[str, OverlaidPart]]:
    """Recordings, their last steps, with the conditions by which they differ; by their names where none does."""
    distinctions = told_apart([record.meta for _, record in recordings])
    labelled = []
    for (name, record), differences in zip(recordings, distinctions, strict=True):
        _, part = steps(record)[-1]
        # a bare number is told with its name
        bare = re.compile(r"[-+]?[\d.]+(?:e[-+]?\d+)?")
        values = [f"{n.replace('_', ' ')} {v}" if bare.fullmatch(v) else v for n, v in differences.items()]
        labelled.append((", ".join(values) or name, OverlaidPart(LETTERS[0], name, part, begins(part))))
    return labelled


def loops_compared(parts: Sequence[tuple[str, OverlaidPart]], title: str) -> Chart | str:
    """Chart of loops of tension over length laid over one another, each with the value of what was varied at its line."""
    drawn = []
    for label, part in parts[:MOST_LOOPS]:
        x, y = part.values("length"), part.values("tension")
        if x is None or y is None:
            continue
        cycle = last_cycle(part.record)
        x, y = x[cycle or slice(None)], y[cycle or slice(None)]
        if cycle is not None and len(y):  # closed, and ending at its highest point, where its label stands
            top = int(np.nanargmax(y))
            x, y = np.append(np.roll(x, -top), x[top]), np.append(np.roll(y, -top), y[top])
        drawn.append((label, x, y))
    if not drawn:
        return "No listed recording has length and tension."

    def first_number(one: tuple[str, np.ndarray, np.ndarray]) -> tuple[float, str]:
        match = re.search(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", one[0])
        return (float(match[0]) if match else math.inf, one[0])

    order = sorted(drawn, key=first_number)
    lines = [
        ChartLine(x, y, label, "tension", width=1.75, opacity=0.45 + 0.55 * (i + 1) / len(order))
        for i, (label, x, y) in enumerate(order)
    ]
    left = len(parts) - len(drawn)
    sentence = f"Tension against length, {len(drawn)} loops: {', '.join(label for label, _, _ in order)}."
    name = title + (f", {left} left out" if left else "")
    return Chart(name, sentence, LENGTH, TENSION, lines, height=HIGH + 150)


def less_the_law(parts: Sequence[OverlaidPart]) -> Chart | str:
    """Tension minus that of the muscle's law at the recorded length and pressure: friction, or error of the law."""
    lines, why = [], ""
    for part in parts:
        try:
            length, rest = _residual(part)
        except MckibbenError as error:
            why = f"{part.letter}: {error}"
            continue
        lines.append(_loop(part, length, rest, len(parts) > 1))
    if not lines:
        return why or "Neither recording names a muscle with a law."
    axis = Axis("Tension less the law", "N", "tension")
    sentence = f"Tension less the law of {_named(parts)} against length; {_cycles(parts)}."
    return Chart(_title("Less the law", parts), sentence, LENGTH, axis, lines, [Mark("", y=0.0)], height=HIGH)


def _residual(part: OverlaidPart) -> tuple[np.ndarray, np.ndarray]:
    """Length [cm], and tension minus the law's at the recorded length and pressure [N]."""
    spec = known_specimen(part.record.meta)
    if spec is None:
        named = str(part.record.meta.get("specimen") or "none")
        raise InputError("muscle", named, "must be one with a law, named by the recording")
    names = {quantity: channel(part.record, of) for quantity, of in OWN.items()}
    for quantity, name in names.items():
        if not name:
            raise InputError(quantity, None, "is not recorded: a law needs length, pressure and tension")
    length, pressure, tension = (part.record[names[w]] for w in ("length", "pressure", "tension"))
    return from_si(1.0, "m", "cm") * length, tension - np.asarray(built_muscle(spec).tension(length, pressure))


def over_time(parts: Sequence[OverlaidPart], channel: str, height: int) -> Chart | None:
    """Chart of a quantity over time, aligned at the first reversals, with the notes."""
    lines, marks = [], []
    for part in parts:
        y = part.values(channel)
        if y is None:
            continue
        time = part.record.time - part.begins
        lines += _estimated(part, time, channel)
        lines.append(_line(part, *_with_gaps(time, y), channel, len(parts) > 1, width=1.75))
        low, high = float(time[0]), float(time[-1])
        for note in part.record.notes:
            at = note.time - part.begins
            if low <= at <= high:
                marks.append(Mark(f"{part.letter}: {note.text}", x=at))
    if not lines:
        return None
    named = NAMES[channel][:2] if channel in NAMES else _named_channel(parts, channel)
    low = min(float(p.record.time[0]) - p.begins for p in parts)
    high = max(float(p.record.time[-1]) - p.begins for p in parts)
    from_ = "from their first reversal" if len(parts) > 1 else "from the first reversal"
    axis = Axis(f"time, {from_}" if any(last_cycle(p.record) for p in parts) else "time", "s", "", low, high)
    sentence = f"{named[0]} of {_named(parts)} against time."
    across = Axis(*named, channel if channel in NAMES else "")
    return Chart(_title(named[0], parts), sentence, axis, across, lines, marks, height)


def _named_channel(parts: Sequence[OverlaidPart], channel: str) -> tuple[str, str]:
    """Name and shown unit of a channel; recordings that state it in another unit are not laid over it."""
    units = {shown_unit(p.record.unit(channel)) for p in parts if channel in p.record}
    if len(units) > 1:
        raise InputError("channel", channel, f"must have one unit in all recordings, got {' and '.join(sorted(units))}")
    return channel, units.pop()


def _estimated(part: OverlaidPart, time: np.ndarray, channel: str) -> list[ChartLine]:
    """What was estimated of a quantity from other sensors: its 95 % interval as an area, and its mean."""
    record, name = part.record, f"estimated.{channel}"
    if channel not in NAMES or name not in record or record.unit(name) != NAMES[channel][2]:
        return []
    unit, si = NAMES[channel][1:]
    mean, low, high = (from_si(1.0, si, unit) * record[f"{name}{end}"] for end in ("", ".low", ".high"))
    area = ChartLine(np.append(time, time[::-1]), np.append(low, high[::-1]), quantity=channel, width=0.5, fill=True)
    return [area, ChartLine(time, mean, "estimated", channel, dash="B", width=1.25)]


def _line(part: OverlaidPart, x: Any, y: Any, channel: str, lettered: bool, width: float) -> ChartLine:
    letter, quantity = part.letter if lettered else "", channel if channel in NAMES else ""
    return ChartLine(x, y, label=letter, quantity=quantity, dash=letter, width=width)


def _loop(part: OverlaidPart, x: np.ndarray, y: np.ndarray, lettered: bool) -> ChartLine:
    some = last_cycle(part.record) or slice(None)
    line = _line(part, x[some], y[some], "tension", lettered, 2.25 if part.letter == LETTERS[0] else 2.0)
    return replace(line, course=(part.record.time - part.begins, x, y))


def _with_gaps(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Insert a gap wherever samples are missing, so that no line is drawn across it."""
    step = np.diff(time)
    holes = np.flatnonzero(step > 3.0 * np.median(step)) + 1 if len(step) else np.array([], int)
    return np.insert(time, holes, np.nan), np.insert(np.asarray(values, float), holes, np.nan)


def _named(parts: Sequence[OverlaidPart]) -> str:
    return " and ".join(f"{p.letter}, {p.name}" for p in parts)


def _title(channel: str, parts: Sequence[OverlaidPart]) -> str:
    ways = {1: "", 2: ": solid A, dashed B"}
    return channel + ways.get(len(parts), f": {LETTERS[0]} to {parts[-1].letter}, each by its dash and its letter")


def played(part: OverlaidPart) -> dict[str, JsonValue] | None:
    """Return what the browser draws a muscle from as a recording has it at the cursor; None without a length."""
    columns = {quantity: part.values(quantity) for quantity in NAMES}
    if columns["length"] is None:
        return None
    spec, known = known_specimen(part.record.meta), {n: v for n, v in columns.items() if v is not None}
    *kept, time = thinned(columns["length"], *known.values(), part.record.time - part.begins)
    series = dict(zip(known, map(plain_numbers, kept[1:]), strict=True))
    longest = float(np.nanmax(columns["length"]))
    muscle = {"rest_length": longest / 100.0, "braid": None} if spec is None else drawn_muscle(spec)
    limits = {n: float(np.nanmax(known[n])) or 1.0 if n in known else 1.0 for n in ("pressure", "tension")}
    lengths = [float(np.nanmin(columns["length"])), longest]
    about = {"muscle": muscle, "limits": limits, "range": lengths, "letter": part.letter, "name": part.name}
    return {**about, "time": plain_numbers(time), **series}


def _cycles(parts: Sequence[OverlaidPart]) -> str:
    return "the last full cycle" if any(last_cycle(p.record) for p in parts) else "all samples"


class Measure(NamedTuple):
    """One property: its name, unit, decimals, and the value of each part; NaN if missing."""

    name: str
    unit: str
    places: int
    values: list[float]


def measures(parts: Sequence[OverlaidPart]) -> list[Measure]:
    """Properties of the parts; a property that none of them has is left out."""
    last: list[Any] = []
    for part in parts:
        there = places(part.record)
        try:
            last.append(loops(part.record, length=there["length"], tension=there["tension"])[-1])
        except (KeyError, MckibbenError):
            last.append(None)
    rows = [
        Measure(name, unit, digits, [scale * getattr(s, key) if s is not None else math.nan for s in last])
        for name, unit, digits, key, scale in (
            ("Mean pressure of the last loop", "bar", 2, "pressure", from_si(1.0, "Pa", "bar")),
            ("Loop width at mid-range, shortening less lengthening", "cm", 3, "width", 1e2),
            ("Loop height at mid-range, lengthening less shortening", "N", 2, "height", 1.0),
            ("Work per cycle", "J", 3, "work", 1.0),
            ("Stiffness", "N/cm", 2, "stiffness", 1e-2),
        )
    ]
    for name, unit, digits, quantity, best in (
        ("Largest tension", "N", 1, "tension", np.nanmax),
        ("Largest pressure", "bar", 2, "pressure", np.nanmax),
        ("Shortest length", "cm", 2, "length", np.nanmin),
    ):
        values = [part.values(quantity) for part in parts]
        rows.append(Measure(name, unit, digits, [math.nan if v is None else float(best(v)) for v in values]))
    rows.append(Measure("Duration", "s", 2, [part.record.duration for part in parts]))
    return [one for one in rows if any(math.isfinite(v) for v in one.values)]


class OverlayPane:
    """Pane with the overlaid recordings."""

    def __init__(
        self,
        choice: RecordingChoice,
        words: Mapping[str, str],
        exports: Callable[[], None],
        look: Callable[[], Awaitable[None]],
    ) -> None:
        self._choice, self._exports, self._look = choice, exports, look
        self._kind = words.get("view", "") if words.get("view") in VIEWS else "tension"
        self._more = [name for name in words.get("channels", "").split(";") if name]
        named = ((words.get(letter), f"p{letter}") for letter in LETTERS.lower())
        self._steps = {name: words.get(key, "") for name, key in named if name}
        self._parts: list[OverlaidPart] = []
        self._asking = 0  # count of what was asked for; an answer that comes later than the next question is dropped

    def build(self) -> None:
        """Build the empty pane."""
        with box("div", "right"):
            with panel("Overlay") as head:
                with head:
                    segments(VIEWS, self._kind, self._look_at, "View")
                    button("Add note", key="N", small=True).set(id="note").on_value("note", self._open_note)
                # what is chosen has its place before it is read, so that nothing moves when it comes
                some = " some" if self._choice.chosen else ""
                self._which = box("div", f"row wrap{some}")
                self._charts = box("div", f"overlay{some}")
                self._notes = box("div", "notes")
            with panel("Measured") as head:
                with head:
                    self._exports()
                self._table = box("div")
        self._dialog = Dialog("Add a note")
        with self._dialog:
            self._on = box("div")
            self._time = TypedField("Time", unit="s", about="as on the time axis")
            self._text = TypedField("Note", done=self._add)
            self._dialog.place_for_answers()
            with box("div", "row"):
                button("Add note", self._add, primary=True)

    def forget(self) -> None:
        """Release the shown recordings when the page is closed."""
        self._asking += 1
        self._parts = []

    def _look_at(self, kind: str) -> None:
        self._kind = kind
        link(view=None if kind == "tension" else kind)
        page_document().spawn(self.show())

    def _show_channel(self, name: str, on: bool) -> None:
        self._more = [n for n in self._more if n != name] + [name] * on
        link(channels=";".join(self._more) or None)
        page_document().spawn(self._draw())

    def relisted(self) -> None:
        """Compare the loops of another list, where they are shown."""
        if self._kind == "loops":
            page_document().spawn(self.show())

    # ---- what is shown

    async def show(self) -> None:
        """Read the chosen recordings and show them; an unreadable one is replaced by its error."""
        self._asking += 1
        mine, wrong, names = self._asking, [], self._choice.chosen
        if not names:
            self._parts = []
            self._nothing()
            if self._kind == "loops":
                await self._compare(mine)
            return
        if not self._parts:
            self._reading()
        parts, steps = [], {}
        for letter, name in zip(LETTERS, names, strict=False):
            try:
                part, steps[letter] = await asyncio.to_thread(self._part, letter, name)
                parts.append(part)
            except MckibbenError as error:
                wrong.append(f"{letter}: {str(error).replace(f'{self._choice.shelf.folder}/', '')}")
        if mine != self._asking:
            return
        self._parts = parts
        self._which.clear()
        with self._which:
            for words in wrong:
                text("p", words, "small err")
            for part in parts:
                _disc(part.letter, part.name)
                if len(named := steps[part.letter]) > 1:
                    words_of = {str(i): words for i, words in enumerate(named)}
                    chosen = str(named.index(part.words))
                    select(words_of, chosen, lambda v, of=part: self._step(of, v), f"Step of {part.letter}")  # type: ignore[misc]
        await self._draw()

    def _part(self, letter: str, name: str) -> tuple[OverlaidPart, list[str]]:
        named, asked = steps(whole(self._choice.path(name))), self._steps.get(name, "")
        at = int(asked) if asked.isdecimal() and int(asked) < len(named) else len(named) - 1
        words, part = named[at]
        return OverlaidPart(letter, Path(name).stem, part, begins(part), words), [words for words, _ in named]

    async def _step(self, part: OverlaidPart, at: str) -> None:
        self._steps[self._file(part)] = at
        link(**{f"p{part.letter.lower()}": at})
        await self.show()

    def _reading(self) -> None:
        self._charts.clear()
        with self._charts, loading("Reading and measuring"):
            pass

    def _nothing(self) -> None:
        for place in (self._which, self._charts, self._notes, self._table):
            place.clear()
        with self._charts:
            empty("Choose a recording in the list; others are laid over it.")
        with self._table:
            loops = self._kind == "loops"
            words = "Choose a recording for its width, height and area of loops."
            text("p", words if loops else "Width, height and area of loops, and peak values.", "small dim")

    async def _compare(self, mine: int) -> None:
        """Show the loops of the steps of the chosen recording, or of all that are listed."""
        self._reading()
        try:
            chart = await asyncio.to_thread(self._compared)
        except MckibbenError as error:
            chart = str(error)
        if mine != self._asking:
            return
        self._charts.clear()
        with self._charts:
            chart.show() if isinstance(chart, Chart) else empty(chart)

    def _compared(self) -> Chart | str:
        if len(self._parts) == 1:
            part = self._parts[0]
            swept = swept_parts(part, whole(self._choice.path(self._file(part))))
            if len(swept) > 1:
                return loops_compared(swept, f"Steps of {part.name}")
        known = []
        for entry in self._choice.listed()[:MOST_LOOPS]:
            with contextlib.suppress(MckibbenError):  # the list says why
                known.append((Path(entry.name).stem, whole(self._choice.path(entry.name))))
        return loops_compared(listed_parts(known), "Loops of the listed recordings")

    async def _draw(self) -> None:
        parts, kind = self._parts, self._kind
        if not parts:
            return
        if kind == "loops":
            await self._compare(self._asking)
            self._list_notes()
            return
        try:
            drawn = await asyncio.to_thread(charts, parts, kind, self._more)
        except InputError as error:  # of a channel that recordings have in units of their own
            drawn = [str(error)]
        measured = await asyncio.to_thread(measures, parts)
        if parts is not self._parts or kind != self._kind:
            return
        self._charts.clear()
        with self._charts:
            for one in drawn:
                if isinstance(one, Chart):
                    with box("div", "timed" if one.x.label.startswith("time") else ""):
                        one.show()
                else:
                    empty(one)
            if muscles := [muscle for part in parts if (muscle := played(part)) is not None]:
                with box("div", "players"):
                    for muscle in muscles:
                        box("div", "player").data("spec", muscle)
            if others := other_channels(parts):
                with box("details").set(open=bool(self._more)):
                    text("summary", f"Other channels ({len(others)})")
                    with box("div", "row wrap small"):
                        for name in others:
                            check(name, name in self._more, functools.partial(self._show_channel, name))
        self._table.clear()
        with self._table:
            _measured(measured, [p.letter for p in parts])
        self._list_notes()

    # ---- notes

    def _list_notes(self) -> None:
        self._notes.clear()
        with self._notes:
            for part in self._parts:
                for note in whole(self._choice.path(self._file(part))).notes:
                    with box("div", "note-line"):
                        _disc(part.letter, "")
                        text("span", f"{note.time - part.begins:.3f}{THIN}s", "num")
                        text("span", note.text, "grow")
                        remove = button("Remove", lambda p=part, n=note: self._remove(p, n), small=True, quiet=True)
                        remove.set(aria_label=f"Remove the note at {note.time:.3f} s")

    def _file(self, part: OverlaidPart) -> str:
        return self._choice.chosen[LETTERS.index(part.letter)]

    def _open_note(self, at: Any) -> None:
        if not self._parts:
            tell("Choose a recording first: click its line.")
            return

        def choose(letter: str) -> None:
            self._noting = letter

        choose(self._parts[-1].letter)
        self._on.clear()
        with self._on:
            segments({p.letter: f"{p.letter} {p.name}" for p in self._parts}, self._noting, choose, "On")
        self._time.set(f"{at:.3f}" if isinstance(at, int | float) else "0")
        self._text.set("")
        self._dialog.open()

    async def _add(self) -> None:
        part = next((p for p in self._parts if p.letter == self._noting), None)
        if part is None:
            return
        try:
            at = parse(plain_text(self._time.value), "s", field="time of a note", bare=True)
            note = Note(at + part.begins, self._text.value.strip())

            def add(record: Recording) -> Recording:
                try:
                    return record.with_note(*note)
                except InputError as error:
                    if error.field != "time of a note":
                        raise
                    low, high = (float(record.time[i]) - part.begins for i in (0, -1))  # on the axis that is shown
                    problem = f"must be between {low:.6g} s and {high:.6g} s, got {at:.6g} s"
                    raise InputError(error.field, None, problem) from None

            await self._rewrite(part, f"Added a note to {part.name}.", add, lambda record: record.without_note(note))
        except MckibbenError as error:
            self._dialog.answer(str(error))

    async def _remove(self, part: OverlaidPart, note: Note) -> None:
        def remove(record: Recording) -> Recording:
            return record.without_note(note)

        try:
            await self._rewrite(part, f"Removed a note of {part.name}.", remove, lambda record: record.with_note(*note))
        except MckibbenError as error:
            tell(str(error))

    async def _rewrite(self, part: OverlaidPart, words: str, *changes: Callable[[Recording], Recording]) -> None:
        """Change the notes of a recording by the first change; Undo makes the second one."""
        change, back = (functools.partial(jobs.rewritten, self._choice.shelf, self._file(part), one) for one in changes)
        await asyncio.to_thread(change)
        self._dialog.close()
        self._choice.tell(words, back)
        await self.show()
        await self._look()


def _disc(letter: str, words: str) -> None:
    with box("span", "lettered"):
        text("span", letter, "ab on")
        if words:
            text("span", words, "small")


def _measured(measured: Sequence[Measure], letters: Sequence[str]) -> None:
    two = len(letters) == 2
    with box("table").set(aria_label="Measured properties"):
        with box("thead"), box("tr"):
            for i, words in enumerate(["Property, last full cycle", *letters, "Unit", *(["B / A"] if two else [])]):
                number = 0 < i <= len(letters) or i > len(letters) + 1
                text("th", words, "num" if number else "").set(scope="col")
        with box("tbody"):
            for one in measured:
                with box("tr"):
                    text("td", one.name)
                    for value in one.values:
                        text("td", grouped(value, one.places), "num strong").set(data_value=repr(value))
                    text("td", one.unit, "dim")
                    if two:
                        a, b = one.values
                        text("td", grouped(b / a if a else None, 2), "num")
