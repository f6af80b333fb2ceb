"""Notes of a person on a recording: a time and a line of text, in the meta under ``notes``."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, NamedTuple

from ..errors import InputError
from .recording import Recording

KEY = "notes"
LONGEST = 200  # characters of a note


class Note(NamedTuple):
    """One note: time of the recording [s], and words."""

    time: float
    text: str


def notes_of(meta: Mapping[str, Any]) -> list[Note]:
    """The notes of a recording's meta by time; what is none is passed over."""
    listed = meta.get(KEY)
    found = []
    for one in listed if isinstance(listed, list) else []:
        time, text = (one.get(k) for k in ("time", "text")) if isinstance(one, Mapping) else (None, None)
        if (
            isinstance(time, int | float)
            and not isinstance(time, bool)
            and math.isfinite(time)
            and isinstance(text, str)
        ):
            found.append(Note(float(time), text))
    return sorted(found)


def noted(record: Recording, time: float, text: str) -> Recording:
    """The recording with one more note.

    Args:
        record: any.
        time: within it [s].
        text: one line.

    Raises:
        InputError: the time lies outside, or the text is no line.
    """
    words = text.strip()
    if not words or len(words) > LONGEST or not words.isprintable():
        shown = words[:40] + (".." if len(words) > 40 else "")
        raise InputError("note", shown, f"allowed is one line of 1 to {LONGEST} characters")
    first, last = float(record.time[0]), float(record.time[-1])
    if not first <= time <= last:
        raise InputError("time of a note", f"{time:.6g} s", f"allowed are {first:.6g} s to {last:.6g} s")
    return _with(record, sorted([*notes_of(record.meta), Note(float(time), words)]))


def without_note(record: Recording, note: Note) -> Recording:
    """The recording without a note."""
    return _with(record, [one for one in notes_of(record.meta) if one != note])


def _with(record: Recording, notes: list[Note]) -> Recording:
    return record.with_meta({KEY: [one._asdict() for one in notes]})
