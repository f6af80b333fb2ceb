"""The list of recordings: entries, read once for each state of their file, with search, three filters, and lines."""

from __future__ import annotations

import contextlib
import html
import math
import threading
import time
import weakref
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from ....analysis.channels import find_cycles
from ....documents import JsonValue
from ....errors import MckibbenError
from ....recordings import Recording, read_any
from ....recordings.provenance import cautions_of, conditions, differing_conditions
from ....report.blocks import is_number, mapping, significant
from ....report.origins import known_specimen
from ...elements import Element
from ...reader import read_outside
from ...shelf import SharedResults, Shelf
from ...stream import places
from ...widgets import SIGNS, THIN, box, raw, select
from ...workspace import Workspace

WHOLE = 6  # whole recordings that are kept
WHOLE_BYTES = 32 * 2**20  # of the channels of these; a larger one is there as long as a page shows it [B]
STILL = 0.002  # share of its largest value by which a length must vary to be driven
WIDE, HIGH = 122, 34  # of a thumbnail [px]
_entries = SharedResults(2000)
_whole: OrderedDict[Any, Recording] = OrderedDict()
_used: weakref.WeakValueDictionary[Any, Recording] = weakref.WeakValueDictionary()  # by pages
_lock = threading.Lock()


@dataclass(frozen=True)
class RecordingEntry:
    """An entry of the list; all text but the thumbnail's is from a user's file."""

    name: str
    about: str = ""
    muscle: str = ""
    origin: str = "file"  # simulated, measured, or file
    protocol: str = ""
    created: float = 0.0  # when [s since the epoch]
    duration: float = 0.0  # [s]
    size: int = 0
    sign: str = "check"  # check, caution or stop; none if the user ended it
    said: str = ""  # remark
    notes: tuple[str, ...] = ()  # a person's
    thumb: str = ""  # an SVG
    conditions: tuple[tuple[str, str], ...] = ()  # muscle, rig, protocol and its numbers: name and text

    def holds(self, words: str) -> bool:
        """Whether the entry contains all search terms."""
        text = " ".join((self.name, self.about, self.muscle, self.protocol, self.origin, self.said, *self.notes))
        return all(word in text.lower() for word in words.lower().split())


def key_of(path: Path) -> tuple[str, int, int]:
    """Identify the present state of a file."""
    about = path.stat()
    return str(path), about.st_mtime_ns, about.st_size


def whole(path: Path) -> Recording:
    """Read a recording, or import a file of another program."""
    key = key_of(path)
    with _lock:
        if key in _whole:
            _whole.move_to_end(key)
            return _whole[key]
        if (used := _used.get(key)) is not None:
            return used
    recording = read_outside(read_any, path).recording
    with _lock:
        _used[key] = _whole[key] = recording
        sizes = {k: sum(int(c.values.nbytes) for c in one.channels.values()) for k, one in _whole.items()}
        while len(sizes) > WHOLE or sum(sizes.values()) > WHOLE_BYTES:
            del sizes[_whole.popitem(last=False)[0]]
    return recording


def known(path: Path) -> RecordingEntry | None:
    """Cached entry of a file if the file has not changed since, else None."""
    entry: RecordingEntry | None = None
    with contextlib.suppress(OSError):  # it was deleted meanwhile
        entry = _entries.known(key_of(path))
    return entry


def entry(path: Path) -> RecordingEntry:
    """Entry of a file, or the reason why it cannot be read."""
    if (line := known(path)) is not None:
        return line
    try:
        key = key_of(path)
    except OSError:  # it was deleted meanwhile
        return RecordingEntry(path.name, sign="stop", said="no such file")
    try:
        line = _described(path, whole(path))
    except MckibbenError as error:
        said, state = str(error).replace(str(path), path.name), path.stat()
        line = RecordingEntry(path.name, created=state.st_mtime, size=state.st_size, sign="stop", said=said)
    _entries.put(key, line)
    return line


def _described(path: Path, record: Recording) -> RecordingEntry:
    meta = record.meta
    spec, document = known_specimen(meta), mapping(meta.get("protocol"))
    title = str(meta.get("title") or path.stem)
    sentence = str(meta.get("sentence") or meta.get("run") or meta.get("circuit") or "").removeprefix(f"{title}. ")
    said = meta.get("specimen")
    named = spec.title if spec else str(mapping(said).get("title") or mapping(said).get("id") or (said or ""))
    simulated = any(c.kind == "true" for c in record.channels.values())
    sign, words = _sign(meta)
    try:
        date = datetime.fromisoformat(str(meta.get("created")))
        created = (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()
    except ValueError:
        created = path.stat().st_mtime
    return RecordingEntry(
        name=path.name,
        about=f"{title}. {sentence}"[:300] if sentence else title,
        muscle=named,
        origin="simulated" if simulated else "file" if meta.get("source") else "measured",
        protocol=str(document.get("name") or (meta.get("protocol") if isinstance(meta.get("protocol"), str) else "")),
        created=created,
        duration=record.duration,
        size=path.stat().st_size,
        sign=sign,
        said=words,
        notes=tuple(n.text for n in record.notes),
        thumb=thumbnail(record),
        conditions=tuple(conditions(meta).items()),
    )


def _sign(meta: Mapping[str, JsonValue]) -> tuple[str, str]:
    """The most important remark: why the run ended, which limit was reached, or whether the energy closes."""
    if str(meta.get("result", "done")) != "done":
        events = meta.get("events")
        ended = mapping(events[-1]).get("code") if isinstance(events, list) and events else None
        return "" if ended == "stop" else "stop", str(meta.get("message") or meta.get("result"))
    remarks = [c.text for c in cautions_of(meta) if c.parameter != "source"]
    if remarks:
        more = f" (and {len(remarks) - 1} more)" if len(remarks) > 1 else ""
        return "caution", f"{remarks[0]}{more}"
    energy = mapping(meta.get("balance")).get("energy")
    if energy is not None and is_number(energy):
        return "check", f"energy closes, {significant(float(energy), 1)}"
    source = mapping(mapping(meta.get("source")).get("columns"))
    left = mapping(meta.get("source")).get("left_out")
    if isinstance(left, list) and left:
        return "caution", "; ".join(map(str, left))[:300]
    if source:
        return "check", f"{len(source)} channel{'s' if len(source) != 1 else ''} mapped"
    return "check", str(meta.get("message") or "complete")


# ---- thumbnails


def thumbnail(record: Recording) -> str:
    """Draw pressure, length and tension over time, each in its own range, and tension over length."""
    there, lines = places(record), []
    length = record[there["length"]] if "length" in there else np.zeros(1)
    looped = "tension" in there and bool(np.nanstd(length) > STILL * np.nanmax(length))
    some = np.unique(np.linspace(0, len(record) - 1, 90).astype(int))
    time = record.time[some] - record.time[0]
    across = 2.0 + (76.0 if looped else 116.0) * time / (time[-1] or 1.0)
    others = [n for n, c in record.channels.items() if c.kind != "command"][:1] if not there else []
    for quantity in ("tension", "length", "pressure"):
        if quantity in there:
            lines.append(_path(across, _within(record[there[quantity]][some]), f"var(--q-{quantity})"))
    lines += [_path(across, _within(record[name][some]), "var(--ink-2)") for name in others]
    if looped:
        first, last = 0, len(record) - 1
        with contextlib.suppress(MckibbenError):  # it does not go to and fro
            first, last = find_cycles(length)[-1].start, find_cycles(length)[-1].end
        at = np.unique(np.linspace(first, last, 80).astype(int))
        x = 120.0 - 34.0 / 26.0 * (_within(length[at]) - (HIGH - 30.0))
        lines.append(_path(x, _within(record[there["tension"]][at]), "var(--q-tension)", "var(--q-tension-fill)"))
    return f'<svg width="{WIDE}" height="{HIGH}" viewBox="0 0 {WIDE} {HIGH}" aria-hidden="true">{"".join(lines)}</svg>'


def _within(values: np.ndarray) -> np.ndarray:
    """Convert values to heights of a thumbnail [px], the largest on top."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return HIGH - 4.0 - 26.0 * (values - low) / ((high - low) or 1.0)


def _path(x: np.ndarray, y: np.ndarray, colour: str, fill: str = "none") -> str:
    points = "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True) if np.isfinite(a) and np.isfinite(b))
    return f'<path d="M{points}" fill="{fill}" stroke="{colour}" stroke-width="1.3"/>' if points else ""


LETTERS = "ABCDEF"  # of recordings that are laid over one another
MOST_SHARED = 6  # conditions that all share, that the page lists
ORIGINS = {"": "Origin: any", "simulated": "Simulated", "measured": "Measured", "file": "Imported"}
CHECK = (
    '<svg width="13" height="11" viewBox="0 0 13 11" aria-hidden="true"><path d="M1 6l3.500 3.500L12 1" fill="none" '
    'stroke="var(--ink-2)" stroke-width="1.7"/></svg>'
)
GLASS = (
    '<svg width="14" height="14" aria-hidden="true"><circle cx="6" cy="6" r="4.5" fill="none" stroke="var(--ink-2)" '
    'stroke-width="1.5"/><path d="M9.500 9.500L13 13" stroke="var(--ink-2)" stroke-width="1.5"/></svg>'
)


def tools(words: dict[str, str], change: Callable[[str, str], object]) -> Element:
    """Build search and filters; return the place of the filters, to be filled when the entries are known."""
    with box("div", "hd finds"):
        with box("div", "field grow"):
            raw(GLASS, "span")
            typed = box("input").set(id="search", type="search", aria_label="Search", value=words.get("q", ""))
            typed.set(placeholder="Search name, muscle, protocol, note")
        typed.on_value("input", lambda value: change("q", str(value)), wait=0.2)
        return box("div", "row wrap")


def filters(words: dict[str, str], entries: Sequence[RecordingEntry], change: Callable[[str, str], object]) -> None:
    """Build the filters: muscle, protocol, and origin of a recording."""
    for key in ("muscle", "protocol"):
        now, label, values = words.get(key, ""), key.capitalize(), sorted({getattr(e, key) for e in entries} - {""})
        names = {"": f"{label}: any", **{v: v for v in values}, **({now: now} if now else {})}
        select(names, now, lambda v, k=key: change(k, v), label)  # type: ignore[misc]
    now = words.get("origin", "")
    select(ORIGINS, now if now in ORIGINS else "", lambda v: change("origin", v), "Origin")


def shown_differences(entries: Sequence[RecordingEntry]) -> tuple[list[str], str]:
    """Names of the conditions by which entries differ, and a sentence about those that all share."""
    read = [dict(e.conditions) for e in entries if e.conditions]
    names = differing_conditions(read) if len(read) > 1 else []
    shared = {n: v for n, v in (read[0] if read else {}).items() if n not in names}
    words = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in list(shared.items())[:MOST_SHARED])
    more = len(shared) - MOST_SHARED
    return names, f"Same in all: {words}{f' and {more} more' if more > 0 else ''}." if shared else ""


WORDS = ("q", "muscle", "protocol", "origin")  # search and filters


@dataclass
class RecordingChoice:
    """What one visitor sees and has chosen of the recordings."""

    workspace: Workspace
    words: dict[str, str]
    chosen: list[str]
    entries: list[RecordingEntry] = field(default_factory=list)

    @property
    def shelf(self) -> Shelf:
        """Folder of the recordings."""
        return self.workspace.recordings

    def path(self, name: str) -> Path:
        """Path of a chosen recording; refused if there is none."""
        return self.shelf.found(name)

    def listed(self) -> list[RecordingEntry]:
        """Entries that match search and filters."""
        words = self.words
        same = [e for e in self.entries if all(not words[k] or getattr(e, k) == words[k] for k in WORDS[1:])]
        return [e for e in same if e.holds(words["q"])]

    def tell(self, words: str, undo: Callable[[], object] | None = None) -> None:
        """Tell all pages what was done, and how it is undone."""
        self.workspace.toasts.tell(words, undo=undo)
        self.workspace.changed()


class RecordingLines:
    """Lines of the list; a click, Enter or Space toggles the choice. Unchanged lines are not rebuilt."""

    def __init__(self, place: Element, pick: Callable[[str], object]) -> None:
        self._place, self._pick = place, pick
        self._shown: dict[str, tuple[RecordingEntry, str, str | None]] = {}
        self._made: dict[str, Any] = {}

    def clear(self) -> None:
        """Clear the lines, for other content."""
        self._place.clear()
        self._shown, self._made = {}, {}

    def show(self, entries: Sequence[RecordingEntry], chosen: Sequence[str], differences: Sequence[str] | None) -> None:
        """Show the entries, with letters for the chosen ones."""
        letters = dict(zip(chosen, LETTERS, strict=False))
        now = {e.name: (e, letters.get(e.name, ""), _apart(e, differences)) for e in entries}
        if [*now] != [*self._made]:
            self.clear()
            with self._place, box("table", "rows") as table, box("tbody").set(role="presentation"):
                table.set(role="listbox", aria_multiselectable="true", aria_label="Recordings")
                for name in now:
                    self._made[name] = line = raw("", "tr", "pick").set(tabindex="0", role="option", data_name=name)
                    for event in ("click", "enter", "space"):
                        line.on(event, lambda n=name: self._pick(n))
        for name, (one, letter, apart) in now.items():
            if self._shown.get(name) != now[name]:
                line = self._made[name]
                line.put(_line(one, letter, apart))
                line.classed("sel", bool(letter))
                line.set(aria_selected="true" if letter else "false")
        self._shown = now


def _apart(one: RecordingEntry, differences: Sequence[str] | None) -> str | None:
    """Values of the conditions that differ, as text; None where the description is shown."""
    if differences is None:
        return None
    own = dict(one.conditions)
    facts = [f"{name.replace('_', ' ')} {own[name]}" for name in differences if name in own]
    return " \u00b7 ".join(facts) or "nothing differs"


def _line(one: RecordingEntry, letter: str, apart: str | None) -> str:
    name, about = html.escape(one.name.rpartition(".")[0]), html.escape(one.about if apart is None else apart)
    sign = CHECK if one.sign == "check" else SIGNS.get(one.sign, "")
    said = html.escape(one.said)
    if one.notes:
        said += f", {len(one.notes)} note{'s' if len(one.notes) > 1 else ''}"
    where, mark = ", ".join(w for w in (one.muscle, one.origin) if w), "" if apart is None else ' class="apart"'
    return (
        f'<td><span class="ab" aria-hidden="true">{letter or "+"}</span><span class="vh">'
        f"{'chosen as ' + letter if letter else 'overlay'}</span></td>"
        f'<td class="th">{one.thumb}</td><td title="{about}"><b>{name}</b><small{mark}>{about}</small></td>'
        f'<td title="{said}"><small class="who">{html.escape(where)}</small>'
        f'<small class="sign">{sign}<span>{said}</span></small></td>'
        f'<td class="num"><small>{when(one.created)}</small><small>{duration(one.duration)}</small></td>'
    )


def when(seconds: float) -> str:
    """Format a date: the time today, the day before that."""
    if not seconds:
        return "\u2013"
    then, now = datetime.fromtimestamp(seconds), datetime.fromtimestamp(time.time())
    days = (now.date() - then.date()).days
    if days == 0:
        return f"today {then:%H:%M}"
    if days == 1:
        return f"yesterday {then:%H:%M}"
    return f"{then.day}{THIN}{then:%b}" if 0 < days < 300 else f"{then:%Y-%m-%d}"


def duration(seconds: float) -> str:
    """Format a duration with about three digits [s]."""
    if not seconds or not math.isfinite(seconds):
        return "\u2013"
    return f"{seconds:.{1 if seconds >= 2.0 else 2}f}{THIN}s" if seconds < 1000.0 else f"{seconds / 60.0:.0f}{THIN}min"
