"""Dialogs of the Recordings page: renaming, notes, and the columns of an imported file."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from typing import Any

from ....errors import MckibbenError
from ....recordings.formats import parts_of
from ...elements import Element
from ...reader import is_small, read_outside
from ...transfers import IncomingFile, UploadPlace
from ...widgets import Dialog, TypedField, box, button, select, text
from . import jobs

HELP = "For files of other programs whose header does not state them."


class ImportDialog:
    """Import a file: dropped or chosen; if a header is insufficient, columns and units are requested.

    Args:
        take: given the file, a place for its progress, columns, units, period, and sheet or topic; gives name and remarks,
            or raises why it is refused.
        done: told the name of what is there now, and remarks.
    """

    def __init__(
        self,
        take: Callable[[IncomingFile, Element, Mapping[str, str], Mapping[str, str], str, str], Any],
        done: Callable[[str, list[str]], Any],
    ) -> None:
        self._take, self._done = take, done
        self._file: IncomingFile | None = None
        self._part = ""
        self.dialog = Dialog("Import a file")
        with self.dialog:
            self._upload = UploadPlace("Drop a recording here, or a file of another program", self._came, jobs.IMPORTED)
            self.dialog.place_for_answers()
            self._progress = box("div")
            self._which = box("div", "stack")
            self._more = box("div", "stack")
            with self._more:
                text("p", HELP, "small dim")
                self._columns = TypedField("Columns", about="such as tension=Load cell; pressure=2; time=1")
                self._units = TypedField("Units", about="such as pressure=bar; tension=N")
                self._period = TypedField("Interval of the samples", about="where the file has no time, such as 1 ms")
                with box("div", "row"):
                    button("Import", self._again, primary=True)

    def takes(self, place: Element) -> None:
        """Accept files that are dropped on another element too."""
        self._upload.also(place)

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
            columns = jobs.pairs(self._columns.value, "columns", "tank.pressure=2")
            units = jobs.pairs(self._units.value, "units", "tank.pressure=bar")
            result = await self._take(one, self._progress, columns, units, self._period.value.strip(), self._part)
        except MckibbenError as error:
            self.dialog.open()  # it is closed where the file was dropped on the list
            self.dialog.answer(str(error))
            return
        one.close()
        self._file = None
        self._which.clear()
        self.dialog.close()
        await self._done(*result)
