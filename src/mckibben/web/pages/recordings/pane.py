"""The right side: overlay of the chosen recordings, their notes, and measured properties."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....errors import InputError, MckibbenError
from ....quantities import parse
from ...charts import Chart
from ...elements import page_document
from ...widgets import Dialog, TypedField, box, button, empty, link, loading, panel, segments, select, text
from . import jobs, overlay, state
from .listing import LETTERS
from .overlay import VIEWS, OverlaidPart

if TYPE_CHECKING:
    from ....recordings import Note
    from .page import RecordingsPage

THIN = "\u2009\u2060"


class OverlayPane:
    """Pane with the overlaid recordings.

    Args:
        view: whose recordings are chosen.
        words: words of the link.
    """

    def __init__(self, view: RecordingsPage, words: Mapping[str, str]) -> None:
        self._view = view
        self._kind = words.get("view", "") if words.get("view") in VIEWS else "tension"
        self._steps = {
            name: words.get(key, "") for name, key in ((words.get("a"), "pa"), (words.get("b"), "pb")) if name
        }
        self._parts: list[OverlaidPart] = []
        self._asking = 0

    def build(self) -> None:
        """Build the empty pane."""
        with box("div", "right"):
            with panel("Overlay") as head:
                with head:
                    segments(VIEWS, self._kind, self._look_at, "View")
                    note = button("Add note", key="N", small=True).set(id="note")
                    note.on_value("note", self._open_note)
                self._which = box("div", "row wrap")
                self._charts = box("div", "overlay")
                self._notes = box("div", "notes")
            with panel("Measured") as head:
                with head:
                    text("span", "Export as", "small faint")
                    segments(jobs.FORMATS, ".nc", self._format, "Format")
                    button("Export", lambda: self._view.actions.export(), small=True, primary=True)
                    button("Report", lambda: self._view.actions.report(), small=True)
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

    def _format(self, suffix: str) -> None:
        self._view.actions.format = suffix

    def _look_at(self, kind: str) -> None:
        self._kind = kind
        link(view=None if kind == "tension" else kind)
        page_document().spawn(self.show(self._view.chosen))

    def relisted(self) -> None:
        """Compare the loops of another list, where they are shown."""
        if self._kind == "loops":
            page_document().spawn(self.show(self._view.chosen))

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
            swept = overlay.swept_parts(part, state.whole(self._view.path(self._name(part))))
            if len(swept) > 1:
                return overlay.loops_compared(swept, f"Steps of {part.name}")
        known = []
        for entry in self._view.listed()[: overlay.MOST_LOOPS]:
            with contextlib.suppress(MckibbenError):  # the list says why
                known.append((Path(entry.name).stem, state.whole(self._view.path(entry.name))))
        return overlay.loops_compared(overlay.listed_parts(known), "Loops of the listed recordings")

    # ---- what is shown

    async def show(self, names: Sequence[str]) -> None:
        """Read the chosen recordings and show them; an unreadable one is replaced by its error."""
        self._asking += 1
        mine, wrong = self._asking, []
        if not names and self._kind == "loops":
            self._parts = []
            for place in (self._which, self._notes, self._table):
                place.clear()
            with self._table:
                text("p", "Choose a recording for its width, height and area of loops.", "small dim")
            await self._compare(mine)
            return
        if not names:
            self._parts = []
            self._nothing("Choose a recording in the list; a second one is laid over it.")
            return
        if not self._parts:
            self._reading()
        parts, choices = [], []
        for letter, name in zip(LETTERS, names, strict=False):
            try:
                part = await asyncio.to_thread(self._part, letter, name)
            except MckibbenError as error:
                wrong.append(f"{letter}: {str(error).replace(str(self._view.workspace.recordings.folder) + '/', '')}")
                continue
            parts.append(part[0])
            choices.append((name, letter, part[1], part[2]))
        if mine != self._asking:
            return
        self._parts = parts
        self._which.clear()
        with self._which:
            for words in wrong:
                text("p", words, "small err")
            for name, letter, steps, now in choices:
                _disc(letter, Path(name).stem)
                if len(steps) > 1:
                    words_of = {str(i): w for i, w in enumerate(steps)}
                    select(words_of, str(now), lambda v, n=name: self._step(n, v), f"Step of {letter}")  # type: ignore[misc]
        await self._draw()

    def _part(self, letter: str, name: str) -> tuple[OverlaidPart, list[str], int]:
        record = state.whole(self._view.path(name))
        steps = overlay.steps(record)
        asked = self._steps.get(name, "")
        at = int(asked) if asked.isdecimal() and int(asked) < len(steps) else len(steps) - 1
        words, part = steps[at]
        return OverlaidPart(letter, Path(name).stem, part, overlay.begins(part), words), [w for w, _ in steps], at

    async def _step(self, name: str, at: str) -> None:
        self._steps[name] = at
        letter = LETTERS[self._view.chosen.index(name)].lower()
        link(**{f"p{letter}": at})
        await self.show(self._view.chosen)

    def _reading(self) -> None:
        self._charts.clear()
        with self._charts, loading("Reading and measuring"):
            pass

    def _nothing(self, words: str) -> None:
        for place in (self._which, self._charts, self._notes, self._table):
            place.clear()
        with self._charts:
            empty(words)
        with self._table:
            text("p", "Width, height and area of loops, and peak values.", "small dim")

    async def _draw(self) -> None:
        parts, kind = self._parts, self._kind
        if not parts:
            return
        if kind == "loops":
            await self._compare(self._asking)
            self._list_notes()
            return
        charts = await asyncio.to_thread(overlay.charts, parts, kind)
        measures = await asyncio.to_thread(overlay.measures, parts)
        if parts is not self._parts or kind != self._kind:
            return
        self._charts.clear()
        with self._charts:
            for one in charts:
                if isinstance(one, Chart):
                    timed = box("div", "timed" if one.x.label.startswith("time") else "")
                    if one.x.low is not None and one.x.high is not None:
                        timed.set(data_low=repr(one.x.low), data_high=repr(one.x.high))
                    with timed:
                        one.show()
                else:
                    empty(one)
        self._table.clear()
        with self._table:
            _measured(measures, [p.letter for p in parts])
        self._list_notes()

    # ---- notes

    def _list_notes(self) -> None:
        self._notes.clear()
        with self._notes:
            for part in self._parts:
                for note in state.whole(self._view.path(self._name(part))).notes:
                    with box("div", "note-line"):
                        _disc(part.letter, "")
                        text("span", f"{note.time - part.begins:.3f}{THIN}s", "num")
                        text("span", note.text, "grow")
                        remove = button("Remove", lambda p=part, n=note: self._remove(p, n), small=True, quiet=True)
                        remove.set(aria_label=f"Remove the note at {note.time:.3f} s")

    def _name(self, part: OverlaidPart) -> str:
        return self._view.chosen[LETTERS.index(part.letter)]

    def _open_note(self, at: Any) -> None:
        if not self._parts:
            self._view.refuse(MckibbenError("Choose a recording first: click its line."))
            return
        self._noting = self._parts[-1].letter
        self._on.clear()
        with self._on:
            names = {p.letter: f"{p.letter} {p.name}" for p in self._parts}
            segments(names, self._noting, self._note_on, "On")
        self._time.set(f"{at:.3f}" if isinstance(at, int | float) else "0")
        self._text.set("")
        self._dialog.open()

    def _note_on(self, letter: str) -> None:
        self._noting = letter

    async def _add(self) -> None:
        part = next((p for p in self._parts if p.letter == self._noting), None)
        if part is None:
            return
        try:
            at = parse(self._time.value.replace("\u2212", "-"), "s", field="time of a note", bare=True)
            path = self._view.path(self._name(part))
            record = await asyncio.to_thread(state.whole, path)
            try:
                new = record.with_note(at + part.begins, self._text.value)
            except InputError as error:
                if error.field != "time of a note":
                    raise
                low, high = (float(record.time[i]) - part.begins for i in (0, -1))
                raise InputError(
                    error.field, None, f"must be between {low:.6g} s and {high:.6g} s, got {at:.6g} s"
                ) from None
            await asyncio.to_thread(jobs.rewritten, path, new)
        except MckibbenError as error:
            self._dialog.answer(str(error))
            return
        self._dialog.close()
        self._done(f"Added a note to {part.name}.", path, record)
        await self._again()

    async def _remove(self, part: OverlaidPart, note: Note) -> None:
        try:
            path = self._view.path(self._name(part))
            record = await asyncio.to_thread(state.whole, path)
            await asyncio.to_thread(jobs.rewritten, path, record.without_note(note))
        except MckibbenError as error:
            self._view.refuse(error)
            return
        self._done(f"Removed a note of {part.name}.", path, record)
        await self._again()

    def _done(self, words: str, path: Path, before: Any) -> None:
        self._view.workspace.toasts.tell(words, undo=lambda: jobs.rewritten(path, before))
        self._view.workspace.changed()

    async def _again(self) -> None:
        await self.show(self._view.chosen)
        await self._view.look()


def _disc(letter: str, words: str) -> None:
    with box("span", "lettered"):
        text("span", letter, "ab on")
        if words:
            text("span", words, "small")


def _measured(measures: Sequence[overlay.Measure], letters: Sequence[str]) -> None:
    """Show the table of properties, with ratios if there are two recordings."""
    two = len(letters) > 1
    with box("table").set(aria_label="Measured properties"):
        with box("thead"), box("tr"):
            for i, words in enumerate(["Property, last full cycle", *letters, "Unit", *(["B / A"] if two else [])]):
                number = 0 < i <= len(letters) or i > len(letters) + 1
                text("th", words, "num" if number else "").set(scope="col")
        with box("tbody"):
            for one in measures:
                with box("tr"):
                    text("td", one.name)
                    for value in one.values:
                        text("td", _number(value, one.places), "num strong").set(data_value=repr(value))
                    text("td", one.unit, "dim")
                    if two:
                        a, b = one.values
                        text("td", _number(b / a, 2) if a and math.isfinite(b / a) else "\u2013", "num")


def _number(value: float, places: int) -> str:
    if not math.isfinite(value):
        return "\u2013"
    return f"{value:,.{places}f}".replace(",", "\u2009").replace("-", "\u2212")
