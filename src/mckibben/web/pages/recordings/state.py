"""Entries of the list of recordings, read once for each state of their file, one after the other."""

from __future__ import annotations

import threading
import weakref
from collections import OrderedDict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ....analysis.channels import find_cycles
from ....documents import JsonValue
from ....errors import MckibbenError
from ....recordings.metadata import cautions_of
from ....recordings.provenance import conditions
from ....report.words import is_number, mapping, significant
from ...reader import read_outside

if TYPE_CHECKING:
    from ....recordings import Recording

KEPT, WHOLE = 2000, 6  # entries, and whole recordings, that are kept
WHOLE_BYTES = 32 * 2**20  # of the channels of these; a larger one is there as long as a page shows it [B]
STILL = 0.002  # share of its largest value by which a length must vary to be driven
WIDE, HIGH = 122, 34  # of a thumbnail [px]
COLOURS = {"pressure": "pressure", "length": "length", "tension": "tension"}
_entries: OrderedDict[Any, RecordingEntry] = OrderedDict()
_whole: OrderedDict[Any, Recording] = OrderedDict()
_used: weakref.WeakValueDictionary[Any, Recording] = weakref.WeakValueDictionary()  # by pages
_lock = threading.Lock()


@dataclass(frozen=True)
class RecordingEntry:
    """An entry of the list; all text but the thumbnail's is from a user's file.

    Attributes:
        name: name of the file.
        about: description of the experiment.
        muscle: which one.
        origin: ``simulated``, ``measured``, or ``file``.
        protocol: name of the protocol.
        created: when [s since the epoch].
        duration: [s].
        size: size of the file [B].
        sign: ``check``, ``caution`` or ``stop``; none if the user ended it.
        said: remark.
        notes: a person's.
        thumb: an SVG.
        conditions: muscle, rig, protocol and its numbers: name and text.
    """

    name: str
    about: str = ""
    muscle: str = ""
    origin: str = "file"
    protocol: str = ""
    created: float = 0.0
    duration: float = 0.0
    size: int = 0
    sign: str = "check"
    said: str = ""
    notes: tuple[str, ...] = ()
    thumb: str = ""
    conditions: tuple[tuple[str, str], ...] = ()

    def holds(self, words: str) -> bool:
        """Whether the entry contains all search terms."""
        text = " ".join(
            (self.name, self.about, self.muscle, self.protocol, self.origin, self.said, *self.notes)
        ).lower()
        return all(word in text for word in words.lower().split())


def key_of(path: Path) -> tuple[str, int, int]:
    """Identify the present state of a file."""
    about = path.stat()
    return str(path), about.st_mtime_ns, about.st_size


def whole(path: Path) -> Recording:
    """Read a recording, or import a file of another program.

    Raises:
        InputError: it cannot be read; says why.
    """
    key = key_of(path)
    with _lock:
        if key in _whole:
            _whole.move_to_end(key)
            return _whole[key]
        if (used := _used.get(key)) is not None:
            return used
    recording = read_outside(_read, path)
    with _lock:
        _used[key] = _whole[key] = recording
        while len(_whole) > WHOLE or sum(map(_size, _whole.values())) > WHOLE_BYTES:
            _whole.popitem(last=False)
    return recording


def _read(path: Path) -> Recording:
    from ....recordings import read_any

    return read_any(path).recording


def _size(record: Recording) -> int:
    return sum(int(c.values.nbytes) for c in record.channels.values())


def known(path: Path) -> RecordingEntry | None:
    """Cached entry of a file if the file has not changed since, else None."""
    try:
        key = key_of(path)
    except OSError:
        return None
    with _lock:
        return _entries.get(key)


def entry(path: Path) -> RecordingEntry:
    """Entry of a file, or the reason why it cannot be read."""
    line = known(path)
    if line is not None:
        return line
    try:
        key = key_of(path)
    except OSError:  # it was deleted meanwhile
        return RecordingEntry(path.name, sign="stop", said="no such file")
    try:
        line = _described(path, whole(path))
    except MckibbenError as error:
        when, size = path.stat().st_mtime, path.stat().st_size
        line = RecordingEntry(
            path.name, created=when, size=size, sign="stop", said=str(error).replace(str(path), path.name)
        )
    with _lock:
        _entries[key] = line
        while len(_entries) > KEPT:
            _entries.popitem(last=False)
    return line


def _described(path: Path, record: Recording) -> RecordingEntry:
    from ....report.origins import known_specimen

    meta = record.meta
    spec, document = known_specimen(meta), mapping(meta.get("protocol"))
    title = str(meta.get("title") or path.stem)
    sentence = str(meta.get("sentence") or meta.get("run") or meta.get("circuit") or "").removeprefix(f"{title}. ")
    said = meta.get("specimen")
    named = spec.title if spec else str(mapping(said).get("title") or mapping(said).get("id") or (said or ""))
    simulated = any(c.kind == "true" for c in record.channels.values())
    sign, words = _sign(meta)
    notes = record.notes
    return RecordingEntry(
        name=path.name,
        about=f"{title}. {sentence}"[:300] if sentence else title,
        muscle=named,
        origin="simulated" if simulated else "file" if meta.get("source") else "measured",
        protocol=str(document.get("name") or (meta.get("protocol") if isinstance(meta.get("protocol"), str) else "")),
        created=_when(meta.get("created"), path),
        duration=record.duration,
        size=path.stat().st_size,
        sign=sign,
        said=words,
        notes=tuple(n.text for n in notes),
        thumb=thumbnail(record),
        conditions=tuple(conditions(meta).items()),
    )


def _when(words: Any, path: Path) -> float:
    try:
        date = datetime.fromisoformat(str(words))
    except ValueError:
        return path.stat().st_mtime
    return (date if date.tzinfo else date.replace(tzinfo=UTC)).timestamp()


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


def channel(record: Recording, names: Sequence[str]) -> str:
    """The first of some channels that a recording has; nothing if it has none."""
    return next((n for n in names if n in record and np.isfinite(record[n]).any()), "")


def places(record: Recording) -> dict[str, str]:
    """Channels of length, pressure and tension, measured ones first."""
    from ....report.recording_report import LENGTHS, PRESSURES, TENSIONS

    named = {"length": LENGTHS, "pressure": PRESSURES, "tension": TENSIONS}
    channels = {quantity: channel(record, names) for quantity, names in named.items()}
    return {quantity: name for quantity, name in channels.items() if name}


def thumbnail(record: Recording) -> str:
    """Draw pressure, length and tension over time, each in its own range, and tension over length."""
    there, lines = places(record), []
    moves = "length" in there and float(np.nanstd(record[there["length"]])) > STILL * float(
        np.nanmax(record[there["length"]])
    )
    looped = moves and "tension" in there
    some = np.unique(np.linspace(0, len(record) - 1, 90).astype(int))
    time = record.time[some] - record.time[0]
    across = 2.0 + (76.0 if looped else 116.0) * time / (time[-1] or 1.0)
    others = [n for n, c in record.channels.items() if c.kind != "command"][:1] if not there else []
    for quantity in ("tension", "length", "pressure"):
        if quantity in there:
            lines.append(_path(across, _within(record[there[quantity]][some]), f"var(--q-{COLOURS[quantity]})"))
    lines += [_path(across, _within(record[name][some]), "var(--ink-2)") for name in others]
    if looped:
        part = _last_cycle(record, there["length"])
        at = np.unique(np.linspace(part.start, part.stop - 1, 80).astype(int))
        x, y = _within(record[there["length"]][at]), _within(record[there["tension"]][at])
        lines.append(_path(86.0 + 34.0 * (1.0 - (y_to_share(x))), y, "var(--q-tension)", "var(--q-tension-fill)"))
    return f'<svg width="{WIDE}" height="{HIGH}" viewBox="0 0 {WIDE} {HIGH}" aria-hidden="true">{"".join(lines)}</svg>'


def _last_cycle(record: Recording, name: str) -> slice:
    try:
        last = find_cycles(record[name])[-1]
        return slice(last.start, last.end + 1)
    except MckibbenError:
        return slice(0, len(record))


def _within(values: np.ndarray) -> np.ndarray:
    """Convert values to heights of a thumbnail [px], the largest on top."""
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return HIGH - 4.0 - 26.0 * (values - low) / ((high - low) or 1.0)


def y_to_share(heights: np.ndarray) -> np.ndarray:
    """Convert heights of `_within` to shares of the range from its top."""
    return (heights - (HIGH - 30.0)) / 26.0


def _path(x: np.ndarray, y: np.ndarray, colour: str, fill: str = "none") -> str:
    points = "L".join(f"{a:.1f} {b:.1f}" for a, b in zip(x, y, strict=True) if np.isfinite(a) and np.isfinite(b))
    return f'<path d="M{points}" fill="{fill}" stroke="{colour}" stroke-width="1.3"/>' if points else ""
