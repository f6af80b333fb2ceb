"""The Recordings page of one visitor: search, choice of two recordings, and actions on them."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from ....errors import InputError, MckibbenError
from ....quantities import parse
from ...charts import Chart
from ...elements import Element, Timer, call_script, page_document
from ...transfers import IncomingFile, download, read_with_progress
from ...widgets import Dialog, TypedField, box, button, check, empty, link, loading, panel, segments, select, tell, text
from ...workspace import Workspace
from . import jobs, listing, overlay, state
from .dialogs import ImportDialog
from .listing import LETTERS
from .overlay import VIEWS, OverlaidPart
from .state import RecordingEntry

if TYPE_CHECKING:
    from ....recordings import Note

WORDS = ("q", "muscle", "protocol", "origin")
LINK = ("a", "b", "pa", "pb", "view", "differences", *WORDS)
LOOKS = 2.0  # time between two looks into the folder [s]
AT_ONCE = 6  # recordings that are read before the list is drawn again


class RecordingsPage:
    """The Recordings page of one visitor.

    Args:
        workspace: state of the server.
        words: words of the link.
    """

    def __init__(self, workspace: Workspace, words: Mapping[str, str]) -> None:
        self.workspace = workspace
        self.words = {k: words.get(k, "") for k in WORDS}
        self.chosen = [n for n in dict.fromkeys((words.get("a", ""), words.get("b", ""))) if n]
        self.entries: list[RecordingEntry] = []
        self.apart = words.get("differences") == "1"  # the list tells what differs
        self._compared: list[str] = []  # names of the listed recordings
        self.pane = OverlayPane(self, words)
        self.actions = RecordingActions(self)
        self._seen: Any = None
        self._offered: set[tuple[str, str]] | None = None
        self._reading = False

    def build(self, bar: Element) -> None:
        """Build the empty page."""
        with bar:
            self._told = text("span", "", "small dim")
            self.actions.buttons()
        with box("div", "recordings"):
            with box("section", "panel list").set(aria_label="List of recordings") as whole:
                self._filters = listing.tools(self.words, self._searched)
                with box("div", "apart-bar"):
                    check("Only what differs", self.apart, self._told_apart)
                    self._same = text("span", "", "small faint")
                self._list = box("div", "scroll-list")
            self._lines = listing.RecordingLines(self._list, self.pick)
            self.pane.build()
        self.actions.build()
        self.actions.importing.takes(whole)
        document = page_document()
        document.on_close(self.pane.forget)
        document.when_connected(self.begin)  # nobody waits for files that are read slowly
        Timer(document, LOOKS, self.look)

    async def begin(self) -> None:
        """Show cached entries at once, others as they are read; unknown names of the link are skipped."""
        there = self.workspace.recordings.names()
        for name in [n for n in self.chosen if n not in there]:
            self.chosen.remove(name)
            tell(f"{name[:120]}: no such recording.")
        self._quick(there)
        await self.pane.show(self.chosen)

    # ---- list

    async def look(self) -> None:
        """Look for new, removed or changed files."""
        state = await asyncio.to_thread(self._state)
        if state == self._seen or self._reading:
            return
        self._seen, self._reading = state, True
        try:
            await self._read([name for name, _ in state])
        finally:
            self._reading = False

    def _state(self) -> list[tuple[str, Any]]:
        entries = []
        for name in self.workspace.recordings.names():
            with contextlib.suppress(OSError):
                entries.append((name, state.key_of(self.workspace.recordings.path(name))))
        return entries

    def _quick(self, names: list[str]) -> None:
        """Show the cached entries, without reading any file."""
        before = {e.name: e for e in self.entries}
        unread = {n: before.get(n, RecordingEntry(n, origin="", sign="", said="is being read")) for n in names}
        entries = [state.known(self.workspace.recordings.path(n)) or unread[n] for n in names]
        self.entries = entries
        self._draw()

    async def _read(self, names: list[str]) -> None:
        self._quick(names)
        missing = [n for n in names if state.known(self.workspace.recordings.path(n)) is None]
        missing.sort(key=lambda n: n not in self.chosen)
        for start in range(0, len(missing), AT_ONCE):
            for name in missing[start : start + AT_ONCE]:
                await asyncio.to_thread(state.entry, self.workspace.recordings.path(name))
            self._quick(names)
        gone = [n for n in self.chosen if n not in names]
        if gone:
            self.chosen = [n for n in self.chosen if n in names]
            await self._chosen()

    def _draw(self) -> None:
        values = {(e.muscle, e.protocol) for e in self.entries}
        if values != self._offered:
            self._offered = values
            self._filters.clear()
            with self._filters:
                listing.filters(self.words, self.entries, self._searched)
        self._tell()
        self._rows()

    def _rows(self) -> None:
        left = self.listed()
        names, shared = listing.shown_differences(left) if self.apart else (None, {})
        self._same.say(listing.same_words(shared))
        if self._compared != [e.name for e in left]:
            self._compared = [e.name for e in left]
            self.pane.relisted()
        if left:
            self._lines.show(left, self.chosen, names)
            return
        self._lines.clear()
        with self._list:
            if not self.entries:
                words = "No recordings yet. Start a run on the bench, or drop a file here."
                empty(words, "Import file", self.actions.importing.dialog.open)
            else:
                empty("No recording matches.", "Show all", self._all)

    def listed(self) -> list[RecordingEntry]:
        """Entries that match search and filters."""
        return listing.wanted(self.entries, self.words)

    def _told_apart(self, on: bool) -> None:
        self.apart = on
        link(differences="1" if on else None)
        self._rows()

    def _tell(self) -> None:
        count, size = len(self.entries), sum(e.size for e in self.entries)
        amount = f", {listing.amount(size)}" if size else ""
        which = " and ".join(LETTERS[: len(self.chosen)])
        now = f" \u00b7 {which} chosen" if which else ""
        self._told.say(f"{count} recording{'s' if count != 1 else ''}{amount}{now}")

    def _searched(self, key: str, value: str) -> None:
        self.words[key] = value
        link(**{key: value or None})
        self._rows()

    def _all(self) -> None:
        self.words = dict.fromkeys(WORDS, "")
        link(**dict.fromkeys(WORDS))
        self._offered = None
        self._draw()

    # ---- choice

    async def pick(self, name: str) -> None:
        """Toggle the choice of a recording; a third one replaces the second."""
        if name in self.chosen:
            self.chosen.remove(name)
        else:
            self.chosen = [*self.chosen[:1], name]
        await self._chosen()

    async def choose(self, names: list[str]) -> None:
        """Choose some recordings."""
        self.chosen = names[:2]
        await self._chosen()

    async def _chosen(self) -> None:
        both = [*self.chosen, None, None][:2]
        link(a=both[0], b=both[1])
        self._draw()
        await self.pane.show(self.chosen)

    def path(self, name: str) -> Path:
        """Path of a chosen recording."""
        return self.workspace.recordings.found(name)

    def refuse(self, error: MckibbenError) -> None:
        """Show why an action was refused."""
        tell(str(error))


class RecordingActions:
    """Actions on the chosen recordings.

    Args:
        view: whose recordings are chosen.
    """

    def __init__(self, view: RecordingsPage) -> None:
        self._view = view
        self.format = ".nc"

    def buttons(self) -> None:
        """Build the buttons in the header of the page."""
        button("Open on Energy", lambda: self._open("energy"))
        button("Open on Fit", lambda: self._open("fit"))
        button("Rename", self._rename)
        button("Delete", self._delete, key="Del").set(id="delete")
        box("span", "parted")
        button("Import file", lambda: self.importing.dialog.open())
        button("Repair", self._repair)

    def build(self) -> None:
        """Build the closed dialogs."""
        self._renaming = Dialog("Rename a recording")
        with self._renaming:
            self._name = TypedField("Name", done=self._renamed)
            self._renaming.place_for_answers()
            with box("div", "row"):
                button("Rename", self._renamed, primary=True)
        self.importing = ImportDialog(self._take, self._taken)

    def _some(self) -> list[str]:
        if not self._view.chosen:
            tell("Choose a recording first: click its line.")
        return self._view.chosen

    def _open(self, where: str) -> None:
        for name in self._some()[-1:]:
            call_script("goTo", f"/{where}?recording={quote(name)}")

    # ---- rename and delete

    def _rename(self) -> None:
        for name in self._some()[-1:]:
            self._name.set(Path(name).stem)
            self._renaming.open()

    async def _renamed(self) -> None:
        if not self._view.chosen:
            return
        name = self._view.chosen[-1]
        to = self._name.value.strip() + Path(name).suffix
        shelf, workspace = self._view.workspace.recordings, self._view.workspace
        if to == name:
            self._renaming.close()
            return
        try:
            shelf.rename(name, to)
        except InputError as error:
            self._renaming.answer(str(error))
            return
        workspace.toasts.tell(f"Renamed {Path(name).stem} to {Path(to).stem}.", undo=lambda: shelf.rename(to, name))
        workspace.changed()
        self._renaming.close()
        await self._view.choose([*self._view.chosen[:-1], to])
        await self._view.look()

    async def _delete(self) -> None:
        for name in [*self._some()]:
            try:
                self._view.workspace.delete(name)
            except MckibbenError as error:
                tell(str(error))
        await self._view.choose([])
        await self._view.look()

    # ---- import and repair

    async def _take(
        self,
        one: IncomingFile,
        place: Element,
        columns: Mapping[str, str],
        units: Mapping[str, str],
        period: str,
        part: str,
    ) -> tuple[str, list[str]]:
        """Import an uploaded file; return its name, and remarks."""
        jobs.check_kind(one.name)
        shelf, target = self._view.workspace.recordings, one.path.with_name("taken.nc")
        words = f"Reading {one.name}"
        choices = one.name, target, columns, units, period, part
        read = await read_with_progress(place, words, jobs.imported, one.path, *choices)
        plain, data = (one.name, one.path) if read.own else (f"{Path(one.name).stem}.nc", target)
        return (await asyncio.to_thread(shelf.store, plain, data)).name, read.remarks

    async def _taken(self, name: str, remarks: list[str]) -> None:
        self._view.workspace.toasts.tell(f"Imported {Path(name).stem}.")
        self._view.workspace.changed()
        for remark in remarks[:3]:
            tell(f"Note: {remark}")
        await self._view.choose([*self._view.chosen[:1], name])
        await self._view.look()

    async def _repair(self) -> None:
        for name in self._some()[-1:]:
            try:
                name_of_file, remarks = await asyncio.to_thread(jobs.repaired, self._view.workspace, name)
            except MckibbenError as error:
                tell(str(error))
                return
            await self._taken(name_of_file, remarks)

    # ---- export

    async def export(self) -> None:
        """Download the chosen recordings in the chosen format."""
        await self._each(jobs.exported, self.format)

    async def report(self) -> None:
        """Download the reports of the chosen recordings."""

        def made(path: Path) -> tuple[str, bytes, list[str]]:
            return *jobs.report(path), []

        await self._each(made)

    async def _each(self, make: Any, *arguments: Any) -> None:
        for name in [*self._some()]:
            try:
                path = self._view.path(name)
                file_name, data, remarks = await asyncio.to_thread(make, path, *arguments)
            except MckibbenError as error:
                tell(str(error))
                continue
            download(file_name, data)
            for remark in remarks:
                tell(f"Note: {remark}")


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
