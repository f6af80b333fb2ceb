"""What can be done with the chosen recordings: rename, delete, import, repair, export, report, open elsewhere."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

from ....errors import InputError, MckibbenError
from ...elements import Element, call_script
from ...transfers import IncomingFile, download, read_with_progress
from ...widgets import Dialog, TypedField, box, button, tell
from . import files
from .dialogs import Importing

if TYPE_CHECKING:
    from .view import View


class Actions:
    """Of one view.

    Args:
        view: whose recordings are chosen.
    """

    def __init__(self, view: View) -> None:
        self._view = view
        self.format = ".nc"

    def buttons(self) -> None:
        """In the bar of the page."""
        button("Open on Energy", lambda: self._open("energy"))
        button("Open on Fit", lambda: self._open("fit"))
        button("Rename", self._rename)
        button("Delete", self._delete, key="Del").set(id="delete")
        box("span", "parted")
        button("Import file", lambda: self.importing.dialog.open())
        button("Repair", self._repair)

    def build(self) -> None:
        """The dialogs, which are closed."""
        self._renaming = Dialog("Rename a recording")
        with self._renaming:
            self._name = TypedField("Name", done=self._renamed)
            self._renaming.place_for_answers()
            with box("div", "row"):
                button("Rename", self._renamed, primary=True)
        self.importing = Importing(self._take, self._taken)

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
        shelf, lab = self._view.lab.recordings, self._view.lab
        if to == name:
            self._renaming.close()
            return
        try:
            shelf.rename(name, to)
        except InputError as error:
            self._renaming.answer(str(error))
            return
        lab.toasts.tell(f"Renamed {Path(name).stem} to {Path(to).stem}.", undo=lambda: shelf.rename(to, name))
        lab.changed()
        self._renaming.close()
        await self._view.choose([*self._view.chosen[:-1], to])
        await self._view.look()

    async def _delete(self) -> None:
        for name in [*self._some()]:
            try:
                self._view.lab.delete(name)
            except MckibbenError as error:
                tell(str(error))
        await self._view.choose([])
        await self._view.look()

    # ---- import and repair

    async def _take(
        self, one: IncomingFile, place: Element, columns: Mapping[str, str], units: Mapping[str, str], period: str
    ) -> tuple[str, list[str]]:
        """Make a recording of a file that came; its name, and remarks."""
        files.check_kind(one.name)
        shelf, target = self._view.lab.recordings, one.path.with_name("taken.nc")
        words = f"Reading {one.name}"
        read = await read_with_progress(
            place, words, files.imported, one.path, one.name, target, columns, units, period
        )
        plain, data = (one.name, one.path) if read.own else (f"{Path(one.name).stem}.nc", target)
        return (await asyncio.to_thread(shelf.store, plain, data)).name, read.remarks

    async def _taken(self, name: str, remarks: list[str]) -> None:
        self._view.lab.toasts.tell(f"Imported {Path(name).stem}.")
        self._view.lab.changed()
        for remark in remarks[:3]:
            tell(f"Note: {remark}")
        await self._view.choose([*self._view.chosen[:1], name])
        await self._view.look()

    async def _repair(self) -> None:
        for name in self._some()[-1:]:
            try:
                found, remarks = await asyncio.to_thread(files.repaired, self._view.lab, name)
            except MckibbenError as error:
                tell(str(error))
                return
            await self._taken(found, remarks)

    # ---- export

    async def export(self) -> None:
        """Download the chosen ones as the chosen kind of file."""
        await self._each(files.exported, self.format)

    async def report(self) -> None:
        """Download the reports of the chosen ones."""

        def made(path: Path) -> tuple[str, bytes, list[str]]:
            return *files.report(path), []

        await self._each(made)

    async def _each(self, make: Any, *given: Any) -> None:
        for name in [*self._some()]:
            try:
                path = self._view.path(name)
                found, data, remarks = await asyncio.to_thread(make, path, *given)
            except MckibbenError as error:
                tell(str(error))
                continue
            download(found, data)
            for remark in remarks:
                tell(f"Note: {remark}")
