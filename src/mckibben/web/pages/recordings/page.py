"""The Recordings page of one visitor: search, choice of two recordings, and actions on them."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from urllib.parse import quote

from ....errors import InputError, MckibbenError
from ...elements import Element, Timer, call_script, page_document
from ...transfers import IncomingFile, download, read_with_progress
from ...widgets import Dialog, TypedField, box, button, check, empty, link, tell, text
from ...workspace import Workspace
from . import jobs, listing, state
from .dialogs import ImportDialog
from .listing import LETTERS
from .pane import OverlayPane
from .state import RecordingEntry

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
