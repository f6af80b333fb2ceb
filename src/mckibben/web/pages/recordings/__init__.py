"""The Recordings page: list, search, overlay, notes, export, deletion with Undo."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from ....errors import InputError, MckibbenError
from ....formats.registry import parts_of
from ...elements import Element, Timer, call_script, page_document
from ...reader import is_small, read_outside
from ...transfers import IncomingFile, UploadPlace, attempt, download, read_with_progress
from ...widgets import (
    Dialog,
    TypedField,
    asked,
    box,
    button,
    check,
    empty,
    file_size,
    link,
    page_frame,
    segments,
    select,
    tell,
    text,
)
from ...workspace import UPLOADS, Workspace
from . import jobs, listing
from .listing import LETTERS, WORDS, RecordingChoice, RecordingEntry
from .overlay import OverlayPane

if TYPE_CHECKING:
    from starlette.requests import Request

LINK = (*LETTERS.lower(), *(f"p{x}" for x in LETTERS.lower()), "view", "channels", "differences", *WORDS)
LOOKS = 2.0  # time between two looks into the folder [s]
AT_ONCE = 6  # recordings that are read before the list is drawn again
MANY = 6  # recordings that fill the list where it stands above what is read: it has its height before they come


def build(workspace: Workspace, request: Request) -> None:
    """Build the page."""
    with page_frame("recordings", sheets=("recordings.css",), scripts=("js/recordings.js",)) as bar:
        RecordingsPage(workspace, asked(request, *LINK)).build(bar)


class RecordingsPage:
    """The Recordings page of one visitor."""

    def __init__(self, workspace: Workspace, words: Mapping[str, str]) -> None:
        named = dict.fromkeys(words.get(letter, "") for letter in LETTERS.lower())
        self.choice = RecordingChoice(workspace, {k: words.get(k, "") for k in WORDS}, [n for n in named if n])
        self._apart = words.get("differences") == "1"  # the list tells what differs
        self._compared: list[str] = []  # names of the listed recordings
        self.actions = RecordingActions(self.choice, self._choose, self.look)
        self.pane = OverlayPane(self.choice, words, self.actions.exports, self.look)
        self._seen: Any = None
        self._offered: set[tuple[str, str]] | None = None
        self._reading = False

    def build(self, bar: Element) -> None:
        """Build the empty page."""
        with bar:
            self._told = text("span", "", "small dim")
            self.actions.buttons()
        with box("div", "recordings"):
            count = len(self.choice.shelf.names())
            many = " many" if count >= MANY else ""
            with box("section", f"panel list{many}").set(aria_label="List of recordings") as whole:
                self._filters = listing.tools(self.choice.words, self._searched)
                with box("div", "apart-bar"):
                    check("Only what differs", self._apart, self._told_apart)
                    self._same = text("span", "", "small faint")
                self._list = box("div", f"scroll-list rows{min(count, MANY)}")
            self._lines = listing.RecordingLines(self._list, self._pick)
            self.pane.build()
        self.actions.build(whole)
        document = page_document()
        document.on_close(self.pane.forget)
        document.when_connected(self._begin)  # nobody waits for files that are read slowly
        Timer(document, LOOKS, self.look)

    async def _begin(self) -> None:
        """Show cached entries at once, others as they are read; unknown names of the link are skipped."""
        there = self.choice.shelf.names()
        for name in [n for n in self.choice.chosen if n not in there]:
            self.choice.chosen.remove(name)
            tell(f"{name[:120]}: no such recording.")
        self._quick(there)
        await self.pane.show()

    # ---- list

    async def look(self) -> None:
        """Look for new, removed or changed files."""

        def state() -> list[tuple[str, Any]]:
            entries = []
            for name in self.choice.shelf.names():
                with contextlib.suppress(OSError):  # it was deleted meanwhile
                    entries.append((name, listing.key_of(self.choice.shelf.path(name))))
            return entries

        now = await asyncio.to_thread(state)
        if now == self._seen or self._reading:
            return
        self._seen, self._reading = now, True
        try:
            await self._read([name for name, _ in now])
        finally:
            self._reading = False

    def _quick(self, names: list[str]) -> None:
        """Show the cached entries, without reading any file."""
        before = {e.name: e for e in self.choice.entries}
        unread = {n: before.get(n, RecordingEntry(n, origin="", sign="", said="is being read")) for n in names}
        self.choice.entries = [listing.known(self.choice.shelf.path(n)) or unread[n] for n in names]
        self._draw()

    async def _read(self, names: list[str]) -> None:
        shelf, chosen = self.choice.shelf, self.choice.chosen
        self._quick(names)
        missing = [n for n in names if listing.known(shelf.path(n)) is None]
        missing.sort(key=lambda n: n not in chosen)
        for start in range(0, len(missing), AT_ONCE):
            for name in missing[start : start + AT_ONCE]:
                await asyncio.to_thread(listing.entry, shelf.path(name))
            self._quick(names)
        if any(n not in names for n in self.choice.chosen):
            await self._choose([n for n in self.choice.chosen if n in names])

    def _draw(self) -> None:
        entries = self.choice.entries
        values = {(e.muscle, e.protocol) for e in entries}
        if values != self._offered:
            self._offered = values
            self._filters.clear()
            with self._filters:
                listing.filters(self.choice.words, entries, self._searched)
        count, size = len(entries), sum(e.size for e in entries)
        amount = f", {file_size(size)}" if size else ""
        which = ", ".join(LETTERS[: len(self.choice.chosen)])
        now = f" \u00b7 {which} chosen" if which else ""
        self._told.say(f"{count} recording{'s' if count != 1 else ''}{amount}{now}")
        self._rows()

    def _rows(self) -> None:
        left = self.choice.listed()
        names, shared = listing.shown_differences(left) if self._apart else (None, "")
        self._same.say(shared)
        if self._compared != [e.name for e in left]:
            self._compared = [e.name for e in left]
            self.pane.relisted()
        if left:
            self._lines.show(left, self.choice.chosen, names)
            return
        self._lines.clear()
        with self._list:
            if not self.choice.entries:
                words = "No recordings yet. Start a run on the bench, or drop a file here."
                empty(words, "Import file", self.actions.importing.dialog.open)
            else:
                empty("No recording matches.", "Show all", self._all)

    def _told_apart(self, on: bool) -> None:
        self._apart = on
        link(differences="1" if on else None)
        self._rows()

    def _searched(self, key: str, value: str) -> None:
        self.choice.words[key] = value
        link(**{key: value or None})
        self._rows()

    def _all(self) -> None:
        self.choice.words = dict.fromkeys(WORDS, "")
        link(**dict.fromkeys(WORDS))
        self._offered = None
        self._draw()

    # ---- choice

    async def _pick(self, name: str) -> None:
        """Toggle the choice of a recording; where all letters are given, the last one is replaced."""
        chosen = self.choice.chosen
        others = [n for n in chosen if n != name]
        await self._choose(others if name in chosen else [*others[: len(LETTERS) - 1], name])

    async def _choose(self, names: list[str]) -> None:
        self.choice.chosen = names
        link(**dict.fromkeys(LETTERS.lower()) | dict(zip(LETTERS.lower(), names, strict=False)))
        self._draw()
        await self.pane.show()


class RecordingActions:
    """Actions on the chosen recordings."""

    def __init__(
        self,
        choice: RecordingChoice,
        choose: Callable[[list[str]], Awaitable[None]],
        look: Callable[[], Awaitable[None]],
    ) -> None:
        self._choice, self._choose, self._look, self._format = choice, choose, look, ".nc"

    def buttons(self) -> None:
        """Build the buttons in the header of the page."""
        button("Open on Energy", lambda: self._open("energy"))
        button("Open on Fit", lambda: self._open("fit"))
        button("Rename", self._rename)
        button("Delete", self._delete, key="Del").set(id="delete")
        box("span", "parted")
        button("Import file", lambda: self.importing.dialog.open())
        button("Repair", self._repair)

    def exports(self) -> None:
        """Build the buttons that export the chosen recordings."""

        def choose(suffix: str) -> None:
            self._format = suffix

        text("span", "Export as", "small faint")
        segments(jobs.FORMATS, ".nc", choose, "Format")
        button("Export", lambda: self._each(jobs.exported, self._format), small=True, primary=True)
        button("Report", lambda: self._each(jobs.report), small=True)

    def build(self, whole: Element) -> None:
        """Build the closed dialogs; a file may be dropped on the whole list too."""
        self._renaming = Dialog("Rename a recording")
        with self._renaming:
            self._name = TypedField("Name", done=self._renamed)
            self._renaming.place_for_answers()
            with box("div", "row"):
                button("Rename", self._renamed, primary=True)
        self.importing = ImportDialog(self._take, self._taken)
        self.importing.upload.also(whole)

    def _some(self) -> list[str]:
        if not self._choice.chosen:
            tell("Choose a recording first: click its line.")
        return [*self._choice.chosen]

    def _open(self, where: str) -> None:
        for name in self._some()[-1:]:
            call_script("goTo", f"/{where}?recording={quote(name)}")

    # ---- rename and delete

    def _rename(self) -> None:
        for name in self._some()[-1:]:
            self._name.set(Path(name).stem)
            self._renaming.open()

    async def _renamed(self) -> None:
        if not self._choice.chosen:
            return
        name, shelf = self._choice.chosen[-1], self._choice.shelf
        to = self._name.value.strip() + Path(name).suffix
        if to == name:
            self._renaming.close()
            return
        try:
            shelf.rename(name, to)
        except InputError as error:
            self._renaming.answer(str(error))
            return
        self._choice.tell(f"Renamed {Path(name).stem} to {Path(to).stem}.", lambda: shelf.rename(to, name))
        self._renaming.close()
        await self._choose([*self._choice.chosen[:-1], to])
        await self._look()

    async def _delete(self) -> None:
        for name in self._some():
            try:
                self._choice.workspace.delete(name)
            except MckibbenError as error:
                tell(str(error))
        await self._choose([])
        await self._look()

    # ---- import, repair, export

    async def _take(self, one: IncomingFile, place: Element, *stated: Any) -> tuple[str, list[str]]:
        """Import an uploaded file, with what was stated of it; return its name, and remarks."""
        jobs.check_kind(one.name)
        target = one.path.with_name("taken.nc")
        read = await read_with_progress(
            place, f"Reading {one.name}", jobs.imported, one.path, one.name, target, *stated
        )
        name, data = (one.name, one.path) if read.own else (f"{Path(one.name).stem}.nc", target)
        return (await asyncio.to_thread(self._choice.shelf.store, name, data)).name, read.remarks

    async def _taken(self, name: str, remarks: list[str]) -> None:
        self._choice.tell(f"Imported {Path(name).stem}.")
        for remark in remarks[:3]:
            tell(f"Note: {remark}")
        await self._choose([*self._choice.chosen[:1], name])
        await self._look()

    async def _repair(self) -> None:
        for name in self._some()[-1:]:
            repaired = await attempt(jobs.repaired, self._choice.workspace, name)
            if repaired is not None:
                await self._taken(*repaired)

    async def _each(self, make: Callable[..., jobs.ExportedFile], *arguments: str) -> None:
        for name in self._some():
            made = await attempt(lambda n=name: make(self._choice.path(n), *arguments))
            if made is not None:
                download(made.name, made.data)
                for remark in made.remarks:
                    tell(f"Note: {remark}")


class ImportDialog:
    """Import a file: dropped or chosen; if a header is insufficient, columns and units are requested.

    Args:
        take: given the file, a place for its progress, what was stated of it, and sheet or topic; gives name and remarks, or
            raises why it is refused.
        done: told the name of what is there now, and remarks.

    Attributes:
        upload: the place for the file.
    """

    def __init__(
        self, take: Callable[..., Awaitable[tuple[str, list[str]]]], done: Callable[[str, list[str]], Awaitable[None]]
    ) -> None:
        self._take, self._done = take, done
        self._file: IncomingFile | None = None
        self._part = ""
        self.dialog = Dialog("Import a file")
        with self.dialog:
            self.upload = UploadPlace("Drop a recording here, or a file of another program", self._came, UPLOADS)
            self.dialog.place_for_answers()
            self._progress = box("div")
            self._which = box("div", "stack")
            with box("div", "stack"):
                text("p", "For files of other programs whose header does not state them.", "small dim")
                self._stated = {
                    name: TypedField(one.label, about=f"{one.about} {one.example}") for name, one in jobs.STATED.items()
                }
                with box("div", "row"):
                    button("Import", self._again, primary=True)

    async def _came(self, one: IncomingFile) -> None:
        self._file, self._part = one, ""
        self._which.clear()
        option, names = await asyncio.to_thread(read_outside, parts_of, one.path)
        if names:
            self.dialog.open()
            self._choose(option, names)
            return
        if not is_small(one.path):
            self.dialog.open()  # where it is said how far it is read
        await self._again()

    def _choose(self, option: str, names: list[str]) -> None:
        """Ask which sheet or topic of the file is meant; Import reads it."""
        whole = {} if option == "sheet" else {"": "all topics"}
        self._part = names[0] if option == "sheet" else ""

        def chosen(name: str) -> None:
            self._part = name

        with self._which:
            text("p", f"The file has {len(names)} {option}s. Choose one, then Import.", "small")
            select(whole | {name: name for name in names}, self._part, chosen, option.capitalize())

    async def _again(self) -> None:
        one = self._file
        if one is None:
            self.dialog.answer("There is no file yet: drop one first, or choose it.")
            return
        self.dialog.answer("")
        try:
            stated = {name: field.value for name, field in self._stated.items()}
            result = await self._take(one, self._progress, stated, self._part)
        except MckibbenError as error:
            self.dialog.open()  # it is closed where the file was dropped on the list
            self.dialog.answer(str(error))
            return
        one.close()
        self._file = None
        self._which.clear()
        self.dialog.close()
        await self._done(*result)
