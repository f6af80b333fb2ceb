"""The view of one visitor of the page Recordings: what is searched, which two are chosen, how they are shown."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ....errors import MckibbenError
from ...elements import Element, Timer, page_document
from ...laboratory import Laboratory
from ...widgets import box, empty, link, tell, text
from . import entries, listing
from .actions import Actions
from .entries import Entry
from .listing import LETTERS
from .pane import Pane

WORDS = ("q", "muscle", "protocol", "origin")
LINK = ("a", "b", "pa", "pb", "view", *WORDS)
LOOKS = 2.0  # time between two looks into the folder [s]
AT_ONCE = 6  # recordings that are read before the list is drawn again


class View:
    """One visitor's.

    Args:
        lab: the laboratory.
        words: of the link.
    """

    def __init__(self, lab: Laboratory, words: Mapping[str, str]) -> None:
        self.lab = lab
        self.words = {k: words.get(k, "") for k in WORDS}
        self.chosen = [n for n in dict.fromkeys((words.get("a", ""), words.get("b", ""))) if n]
        self.entries: list[Entry] = []
        self.pane = Pane(self, words)
        self.actions = Actions(self)
        self._seen: Any = None
        self._offered: set[tuple[str, str]] | None = None
        self._reading = False

    def build(self, bar: Element) -> None:
        """Make the places."""
        with bar:
            self._told = text("span", "", "small dim")
            self.actions.buttons()
        with box("div", "recordings"):
            with box("section", "panel list").set(aria_label="List of recordings") as whole:
                self._filters = listing.tools(self.words, self._searched)
                self._list = box("div", "scroll-list")
            self._lines = listing.Lines(self._list, self.pick)
            self.pane.build()
        self.actions.build()
        self.actions.importing.takes(whole)
        document = page_document()
        document.on_close(self.pane.forget)
        document.when_connected(self.begin)  # nobody waits for files that are read slowly
        Timer(document, LOOKS, self.look)

    async def begin(self) -> None:
        """Show what is known at once, the rest as it is read; a name of the link that is not there is passed over."""
        there = self.lab.recordings.names()
        for name in [n for n in self.chosen if n not in there]:
            self.chosen.remove(name)
            tell(f"{name[:120]}: no such recording.")
        self._quick(there)
        await self.pane.show(self.chosen)

    # ---- list

    async def look(self) -> None:
        """See whether files came, went or changed."""
        state = await asyncio.to_thread(self._state)
        if state == self._seen or self._reading:
            return
        self._seen, self._reading = state, True
        try:
            await self._read([name for name, _ in state])
        finally:
            self._reading = False

    def _state(self) -> list[tuple[str, Any]]:
        found = []
        for name in self.lab.recordings.names():
            with contextlib.suppress(OSError):
                found.append((name, entries.key_of(self.lab.recordings.path(name))))
        return found

    def _quick(self, names: list[str]) -> None:
        """What was read before, without reading anything."""
        before = {e.name: e for e in self.entries}
        unread = {n: before.get(n, Entry(n, origin="", sign="", said="is being read")) for n in names}
        found = [entries.known(self.lab.recordings.path(n)) or unread[n] for n in names]
        self.entries = found
        self._draw()

    async def _read(self, names: list[str]) -> None:
        self._quick(names)
        missing = [n for n in names if entries.known(self.lab.recordings.path(n)) is None]
        missing.sort(key=lambda n: n not in self.chosen)
        for start in range(0, len(missing), AT_ONCE):
            for name in missing[start : start + AT_ONCE]:
                await asyncio.to_thread(entries.entry, self.lab.recordings.path(name))
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
        left = listing.wanted(self.entries, self.words)
        if left:
            self._lines.show(left, self.chosen)
            return
        self._lines.clear()
        with self._list:
            if not self.entries:
                words = "No recordings yet. Start a run on the bench, or drop a file here."
                empty(words, "Import file", self.actions.importing.dialog.open)
            else:
                empty("No recording has all of this.", "Show all", self._all)

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
        """Choose one, or let it go; a third takes the place of the second."""
        if name in self.chosen:
            self.chosen.remove(name)
        else:
            self.chosen = [*self.chosen[:1], name]
        await self._chosen()

    async def choose(self, names: list[str]) -> None:
        """Choose these."""
        self.chosen = names[:2]
        await self._chosen()

    async def _chosen(self) -> None:
        both = [*self.chosen, None, None][:2]
        link(a=both[0], b=both[1])
        self._draw()
        await self.pane.show(self.chosen)

    def path(self, name: str) -> Path:
        """Where a chosen recording is."""
        return self.lab.recordings.found(name)

    def refuse(self, error: MckibbenError) -> None:
        """Say why something was not done."""
        tell(str(error))
