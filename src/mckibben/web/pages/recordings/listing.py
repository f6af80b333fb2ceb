"""The list of recordings: search, three filters, and lines of which up to two are chosen."""

from __future__ import annotations

import html
import math
import time
from collections.abc import Callable, Sequence
from datetime import datetime
from typing import Any

from ....recordings.provenance import differing_conditions
from ...elements import Element
from ...widgets import SIGNS, box, raw, select
from .state import RecordingEntry

LETTERS = "AB"
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
THIN = "\u2009\u2060"


def tools(words: dict[str, str], change: Callable[[str, str], object]) -> Element:
    """Build search and filters; return the place of the filters, to be filled when the entries are known."""
    with box("div", "hd finds"):
        with box("div", "field grow"):
            raw(GLASS, "span")
            typed = box("input").set(
                id="search", type="search", aria_label="Search", placeholder="Search name, muscle, protocol, note"
            )
            typed.set(value=words.get("q", ""))
        typed.on_value("input", lambda value: change("q", str(value)), wait=0.2)
        return box("div", "row wrap")


def filters(words: dict[str, str], entries: Sequence[RecordingEntry], change: Callable[[str, str], object]) -> None:
    """Build the filters: muscle, protocol, and origin of a recording."""
    for key, label, values in (
        ("muscle", "Muscle", sorted({e.muscle for e in entries if e.muscle})),
        ("protocol", "Protocol", sorted({e.protocol for e in entries if e.protocol})),
    ):
        now = words.get(key, "")
        names = {"": f"{label}: any", **{v: v for v in values}, **({now: now} if now else {})}
        select(names, now, lambda v, k=key: change(k, v), label)  # type: ignore[misc]
    now = words.get("origin", "")
    select(ORIGINS, now if now in ORIGINS else "", lambda v: change("origin", v), "Origin")


def shown_differences(entries: Sequence[RecordingEntry]) -> tuple[list[str], dict[str, str]]:
    """Names of the conditions by which entries differ, and those that all share."""
    read = [dict(e.conditions) for e in entries if e.conditions]
    names = differing_conditions(read) if len(read) > 1 else []
    return names, {n: v for n, v in (read[0] if read else {}).items() if n not in names}


def same_words(shared: dict[str, str]) -> str:
    """Sentence about the conditions that all listed recordings share."""
    words = ", ".join(f"{name.replace('_', ' ')} {value}" for name, value in list(shared.items())[:MOST_SHARED])
    more = len(shared) - MOST_SHARED
    return f"Same in all: {words}{f' and {more} more' if more > 0 else ''}." if shared else ""


def wanted(entries: Sequence[RecordingEntry], words: dict[str, str]) -> list[RecordingEntry]:
    """Entries that match search and filters."""
    kept = []
    for one in entries:
        same = all(not words.get(k) or getattr(one, k) == words[k] for k in ("muscle", "protocol", "origin"))
        if same and one.holds(words.get("q", "")):
            kept.append(one)
    return kept


class RecordingLines:
    """Lines of the list; a click, Enter or Space toggles the choice. Unchanged lines are not rebuilt.

    Args:
        place: that they stand in.
        pick: called with the name that was selected or deselected.
    """

    def __init__(self, place: Element, pick: Callable[[str], object]) -> None:
        self._place, self._pick = place, pick
        self._shown: dict[str, tuple[RecordingEntry, str, str | None]] = {}
        self._made: dict[str, Any] = {}

    def clear(self) -> None:
        """Clear the lines, for other content."""
        self._place.clear()
        self._shown, self._made = {}, {}

    def show(self, entries: Sequence[RecordingEntry], chosen: Sequence[str], differences: Sequence[str] | None) -> None:
        """Show the entries, with letters for the chosen ones.

        Args:
            entries: in their order.
            chosen: names of the chosen ones.
            differences: conditions that are shown in place of the description; None for the description.
        """
        now = {
            e.name: (e, LETTERS[chosen.index(e.name)] if e.name in chosen else "", _apart(e, differences))
            for e in entries
        }
        if [*now] != [*self._made]:
            self.clear()
            with self._place, box("table", "rows") as table, box("tbody").set(role="presentation"):
                table.set(role="listbox", aria_multiselectable="true", aria_label="Recordings")
                for name in now:
                    self._made[name] = self._new(name)
        for name, (one, letter, apart) in now.items():
            if self._shown.get(name) != now[name]:
                line = self._made[name]
                line.put(_line(one, letter, apart))
                line.classed("sel", bool(letter))
                line.set(aria_selected="true" if letter else "false")
        self._shown = now

    def _new(self, name: str) -> Element:
        line = raw("", "tr", "pick").set(tabindex="0", role="option", data_name=name)
        line.on("click", lambda: self._pick(name)).on("enter", lambda: self._pick(name))
        return line.on("space", lambda: self._pick(name))


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


def amount(size: int) -> str:
    """Format the size of a file."""
    return f"{size / 2**20:.3g}{THIN}MB" if size >= 2**20 else f"{size / 2**10:.3g}{THIN}kB"
