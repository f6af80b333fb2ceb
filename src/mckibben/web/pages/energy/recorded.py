"""The lower panel of the page Energy: a recording is chosen, and where its energy went is drawn."""

from __future__ import annotations

import asyncio
from typing import TYPE_CHECKING, Any

from ....errors import InputError, MckibbenError
from ...elements import Element, page_document
from ...transfers import IncomingFile, UploadPlace, run_in_thread
from ...widgets import box, empty, link, refused, select

if TYPE_CHECKING:
    from .view import View

ENDINGS = (".nc", ".csv", ".mcap")
MOST = 200  # recordings in the list
EMPTY = "No recordings yet. Start a run on the bench, or drop a file here."


class Recorded:
    """Of one visitor.

    Args:
        view: of the page.
        head: place of the lists in the panel's heading.
    """

    def __init__(self, view: View, head: Element) -> None:
        self.view, self.head = view, head
        self.name, self.part, self.kind = (view.words.get(k, "") for k in ("recording", "part", "account"))
        self.account: Any = None
        self.simulated = True
        self.told: float | None = None  # pressure of the accumulator whose saving is told [Pa]
        self.place = box("div", "e-flow-place")

    def names(self) -> list[str]:
        """Of the recordings that an account can be made of, the newest first."""
        return [n for n in self.view.lab.recordings.names() if n.lower().endswith(ENDINGS)][:MOST]

    def begin(self) -> None:
        """Show the lists, and the recording that the link names or the newest one."""
        names = self.names()
        if not self.name and names:
            self.name = names[0]
        if not self.name:
            with self.place:
                empty(EMPTY, "To the bench", "/")
                UploadPlace("A recording of mckibben: .nc, .csv or .mcap", self.dropped, ENDINGS)
            return
        page_document().spawn(self.load())

    async def dropped(self, one: IncomingFile) -> None:
        """A file came; it is kept with the recordings."""
        path = await asyncio.to_thread(self.view.lab.recordings.store, one.name, one.path)
        one.close()
        self.name = path.name
        self.view.lab.changed()
        await self.load()

    def lists(self) -> None:
        """Recording, stretch and kind of account, in the heading."""
        from .flow import cycle_names

        self.head.clear()
        names = self.names()
        shown = {n: n for n in ([] if self.name in names or not self.name else [self.name]) + names}
        with self.head:
            if self.account is not None and self.account.cycles:
                select(cycle_names(self.account), self.part, self.stretched, "Stretch of the recording")
            if self.account is not None and self.simulated:
                kinds = {"": "As simulated", "measured": "From measured channels"}
                select(kinds, self.kind, self.kinded, "Account")
            select(shown, self.name, self.chosen, "Recording")

    async def chosen(self, name: str) -> None:
        """Another recording."""
        self.name, self.part, self.kind, self.account = name, "", "", None
        await self.load()

    async def kinded(self, kind: str) -> None:
        """Another kind of account."""
        self.kind, self.part, self.account = kind, "", None
        await self.load()

    def stretched(self, part: str) -> None:
        """Another stretch."""
        self.part = part
        self.draw()

    async def load(self) -> None:
        """Make the account and draw it."""
        with self.view.bar:  # the list that was chosen from is made anew
            name, kind = self.name, self.kind
            link(recording=name, account=kind or None, part=self.part or None)
            self.lists()
            found = await run_in_thread(self.place, f"Summing up {name}", self._account, name, kind)
            if found is None or (name, kind) != (self.name, self.kind):
                return
            self.account, _, self.simulated = found
            self.draw()
            self.lists()

    def _account(self, name: str, kind: str) -> Any:
        from .flow import account

        path = self.view.lab.recordings.found(name)
        try:
            try:
                return account(path, kind, "")
            except InputError as error:
                if error.field != "muscle":
                    raise
                return account(path, kind, self.view.good.muscle)  # the page's muscle, where the recording names none
        except (ArithmeticError, LookupError, OSError, RuntimeError, TypeError) as error:  # what others wrote into it
            why = f"{type(error).__name__}: {error}"[:200]
            raise InputError("file", name, f"no account can be made of what is in it ({why})") from None

    def draw(self) -> None:
        """Draw the account that is there."""
        from .flow import flow_document

        if self.account is None:
            return
        link(part=self.part or None)
        self.told = self.accumulator()
        self.place.clear()
        with self.place:
            try:
                document = flow_document(self.account, self.part, self.told)
            except MckibbenError as error:
                refused(str(error))
                return
            box("div", "e-flow").data("spec", document)

    def accumulator(self) -> float | None:
        """Gauge pressure of the accumulator that is chosen above [Pa]."""
        from .choice import conditions

        choice = self.view.good
        return conditions(choice).exchange_pressure if choice.exchange == "accumulator" else None

    def accumulator_changed(self) -> None:
        """Tell another saving where the accumulator above has changed."""
        if self.account is not None and self.accumulator() != self.told:
            self.draw()
