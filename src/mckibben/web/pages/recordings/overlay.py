"""Two recordings overlaid, as charts and as values measured on both."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ....analysis.channels import find_cycles
from ....analysis.segments import segments, varied
from ....errors import InputError, MckibbenError
from ....muscles.build import built_muscle
from ....quantities import from_si
from ....recordings.provenance import told_apart
from ....report.origins import known_specimen
from ...charts import Axis, Chart, ChartLine, Mark
from .listing import LETTERS
from .state import channel, places

if TYPE_CHECKING:
    from ....recordings import Recording

HIGH, LOW = 270, 150  # of charts [px]
VIEWS = {"tension": "Tension", "law": "Less the law", "channels": "All channels", "loops": "Loops compared"}
MOST_LOOPS = 12  # that are laid over one another
NAMES = {"pressure": ("Pressure", "bar", "Pa"), "length": ("Length", "cm", "m"), "tension": ("Tension", "N", "N")}
# Of the muscle itself: a law speaks of its braid and of the air in it, not of what stands between it and the sensors.
OWN = {
    "length": ("muscle.length", "length", "muscle.span", "span"), "pressure": ("muscle.pressure", "pressure"),
    "tension": ("tension", "muscle.tension"),
}  # fmt: skip


@dataclass(frozen=True)
class OverlaidPart:
    """The shown part of one recording.

    Attributes:
        letter: A or B.
        name: name of its file.
        record: the step that is shown, or all of it.
        begins: time of its samples that stands at zero of the axis [s].
        words: which step it is; nothing if it is all.
    """

    letter: str
    name: str
    record: Recording
    begins: float
    words: str = ""

    def values(self, channel: str) -> np.ndarray | None:
        """A quantity in the unit that is shown (n,), and nothing if it was not recorded."""
        name = places(self.record).get(channel)
        if name is None:
            return None
        unit, si = NAMES[channel][1:]
        return from_si(1.0, si, unit) * self.record[name] if self.record.unit(name) == si else None


def steps(record: Recording) -> list[tuple[str, Recording]]:
    """Recorded steps with a name for each; the whole recording if it has none."""
    if not record.meta.get("steps"):
        return [("", record)]
    try:
        parts, apart = segments(record), varied(record)
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
    cycle = last_cycle(record)
    if name is None or cycle is None:
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


def charts(parts: Sequence[OverlaidPart], view: str) -> list[Chart | str]:
    """Charts of a view; a message if there is nothing to draw."""
    if view == "channels":
        shown: list[Chart | str] = [c for quantity in NAMES if (c := over_time(parts, quantity, LOW)) is not None]
        return shown or [_others(parts)]
    first: Chart | str | None = less_the_law(parts) if view == "law" else over_length(parts)
    second = over_time(parts, "tension", LOW) or over_time(parts, "pressure", LOW)
    both = [c for c in (first, second) if c is not None]
    return both or [_others(parts)]


def over_length(parts: Sequence[OverlaidPart]) -> Chart | None:
    """Chart of tension over length, of the last full cycle if there are cycles."""
    lines = []
    for part in parts:
        x, y = part.values("length"), part.values("tension")
        if x is not None and y is not None:
            some = last_cycle(part.record) or slice(None)
            lines.append(_loop(part, x[some], y[some], len(parts) > 1))
    if not lines:
        return None
    sentence = f"Tension against length of {_named(parts)}; {_cycles(parts)}."
    return Chart(_title("Tension", parts), sentence, _axis("length"), _axis("tension"), lines, height=HIGH)


def swept_parts(part: OverlaidPart, record: Recording) -> list[tuple[str, OverlaidPart]]:
    """Steps of one recording with what was varied between them; none where it has one step."""
    named = steps(record)
    apart = varied(record) if len(named) > 1 else {}
    if not apart:
        return []
    return [
        (
            ", ".join(str(one.meta["step"]["case"].get(name, "")) for name in apart),
            replace(part, record=one, words=words),
        )
        for words, one in named
    ]


def listed_parts(recordings: Sequence[tuple[str, Recording]]) -> list[tuple[str, OverlaidPart]]:
    """Recordings, their last steps, with the conditions by which they differ; by their names where none does."""
    distinctions = told_apart([record.meta for _, record in recordings])
    labelled = []
    for (name, record), differences in zip(recordings, distinctions, strict=True):
        _, part = steps(record)[-1]
        label = ", ".join(_value_label(*one) for one in differences.items()) or name
        labelled.append((label, OverlaidPart(LETTERS[0], name, part, begins(part))))
    return labelled


def loops_compared(parts: Sequence[tuple[str, OverlaidPart]], title: str) -> Chart | str:
    """Chart of loops of tension over length laid over one another, each with the value of what was varied at its line."""
    drawn = []
    for label, part in parts[:MOST_LOOPS]:
        x, y = part.values("length"), part.values("tension")
        if x is None or y is None:
            continue
        some = last_cycle(part.record) or slice(None)
        x, y = x[some], y[some]
        if last_cycle(part.record) is not None and len(
            y
        ):  # closed, and ending at its highest point, where its label stands
            top = int(np.nanargmax(y))
            x, y = np.append(np.roll(x, -top), x[top]), np.append(np.roll(y, -top), y[top])
        drawn.append((label, x, y))
    if not drawn:
        return "No listed recording has length and tension."
    order = sorted(drawn, key=lambda one: _first_number(one[0]))
    lines = [
        ChartLine(x, y, label, "tension", width=1.75, opacity=0.45 + 0.55 * (i + 1) / len(order))
        for i, (label, x, y) in enumerate(order)
    ]
    left = len(parts) - len(drawn)
    sentence = f"Tension against length, {len(drawn)} loops: {', '.join(label for label, _, _ in order)}."
    name = title + (f", {left} left out" if left else "")
    return Chart(name, sentence, _axis("length"), _axis("tension"), lines, height=HIGH + 150)


def _value_label(name: str, value: str) -> str:
    """A value as the label of a line: with its name if it is a bare number."""
    bare = re.fullmatch(r"[-+]?[\d.]+(?:e[-+]?\d+)?", value)
    return f"{name.replace('_', ' ')} {value}" if bare else value


def _first_number(text: str) -> tuple[float, str]:
    match = re.search(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?", text)
    return (float(match[0]) if match else math.inf, text)


def less_the_law(parts: Sequence[OverlaidPart]) -> Chart | str:
    """Tension minus that of the muscle's law at the recorded length and pressure: friction, or error of the law."""
    lines, why = [], ""
    for part in parts:
        try:
            length, rest = _residual(part)
        except MckibbenError as error:
            why = f"{part.letter}: {error}"
            continue
        some = last_cycle(part.record) or slice(None)
        lines.append(_loop(part, length[some], rest[some], len(parts) > 1))
    if not lines:
        return why or "Neither recording names a muscle with a law."
    axis = Axis("Tension less the law", "N", "tension")
    sentence = f"Tension less the law of {_named(parts)} against length; {_cycles(parts)}."
    marks = [Mark("", y=0.0)]
    return Chart(_title("Less the law", parts), sentence, _axis("length"), axis, lines, marks, height=HIGH)


def _residual(part: OverlaidPart) -> tuple[np.ndarray, np.ndarray]:
    """Length [cm], and tension minus the law's at the recorded length and pressure [N]."""
    spec = known_specimen(part.record.meta)
    if spec is None:
        raise InputError(
            "muscle",
            str(part.record.meta.get("specimen") or "none"),
            "must be one with a law, named by the recording",
        )
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
        lines.append(_line(part, *_with_gaps(time, y), channel, len(parts) > 1, width=1.75))
        low, high = float(time[0]), float(time[-1])
        for note in part.record.notes:
            at = note.time - part.begins
            if low <= at <= high:
                marks.append(Mark(f"{part.letter}: {note.text}", x=at))
    if not lines:
        return None
    low = min(float(p.record.time[0]) - p.begins for p in parts)
    high = max(float(p.record.time[-1]) - p.begins for p in parts)
    from_ = "from their first reversal" if len(parts) > 1 else "from the first reversal"
    axis = Axis(f"time, {from_}" if any(last_cycle(p.record) for p in parts) else "time", "s", "", low, high)
    sentence = f"{NAMES[channel][0]} of {_named(parts)} against time."
    return Chart(
        _title(NAMES[channel][0], parts), sentence, axis, Axis(*NAMES[channel][:2], channel), lines, marks, height
    )


def _others(parts: Sequence[OverlaidPart]) -> Chart | str:
    """Chart of the first measured channel over time, for recordings without a muscle."""
    part = parts[0]
    name = next((n for n in part.record.names() if part.record.channels[n].kind != "command"), "")
    if not name:
        return "Nothing was recorded beside the time."
    values, axis = part.record[name], Axis(name, part.record.unit(name))
    line = ChartLine(*_with_gaps(part.record.time - part.begins, values), label=part.letter)
    return Chart(name, f"{name} of {part.name} against time.", Axis("time", "s"), axis, [line], height=HIGH)


def _line(part: OverlaidPart, x: Any, y: Any, channel: str, lettered: bool, **more: Any) -> ChartLine:
    return ChartLine(
        x, y, label=part.letter if lettered else "", quantity=channel, dash=part.letter if lettered else "", **more
    )


def _loop(part: OverlaidPart, x: np.ndarray, y: np.ndarray, lettered: bool) -> ChartLine:
    return _line(part, x, y, "tension", lettered, width=2.25 if part.letter == LETTERS[0] else 2.0)


def _with_gaps(time: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Insert a gap wherever samples are missing, so that no line is drawn across it."""
    step = np.diff(time)
    holes = np.flatnonzero(step > 3.0 * np.median(step)) + 1 if len(step) else np.array([], int)
    return np.insert(time, holes, np.nan), np.insert(np.asarray(values, float), holes, np.nan)


def _axis(channel: str) -> Axis:
    return Axis(NAMES[channel][0] if channel != "length" else "length", NAMES[channel][1], channel)


def _named(parts: Sequence[OverlaidPart]) -> str:
    return " and ".join(f"{p.letter}, {p.name}" for p in parts)


def _title(channel: str, parts: Sequence[OverlaidPart]) -> str:
    return f"{channel}: solid A, dashed B" if len(parts) > 1 else channel


def _cycles(parts: Sequence[OverlaidPart]) -> str:
    return "the last full cycle" if any(last_cycle(p.record) for p in parts) else "all samples"


class Measure(NamedTuple):
    """One property: its name, unit, decimals, and the value of each part; NaN if missing."""

    name: str
    unit: str
    places: int
    values: list[float]


def measures(parts: Sequence[OverlaidPart]) -> list[Measure]:
    """Properties of one or two parts; a property that none of them has is left out."""
    shapes = [_last_loop(part) for part in parts]
    rows = [
        Measure(name, unit, digits, [scale * getattr(s, key) if s is not None else math.nan for s in shapes])
        for name, unit, digits, key, scale in (
            ("Mean pressure of the last loop", "bar", 2, "pressure", from_si(1.0, "Pa", "bar")),
            ("Loop width at mid-range", "cm", 3, "width", 1e2),
            ("Loop height at mid-range", "N", 2, "height", 1.0),
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


def _last_loop(part: OverlaidPart) -> Any:
    from ....analysis.loops import loops

    there = places(part.record)
    try:
        return loops(part.record, length=there["length"], tension=there["tension"])[-1]
    except (KeyError, MckibbenError):
        return None
