"""What is asked for before something is done: another name, the words of a note, the columns of a file of others."""

from __future__ import annotations

import html
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from ....errors import MckibbenError
from ...parts import Incoming, box, button, call, on_value, refused, text, upload
from ...reader import is_small
from . import files

if TYPE_CHECKING:
    from nicegui.element import Element

HELP = "Of a file of others, where its header does not say it."


class Dialog:
    """A native dialog; Esc closes it while nothing moves.

    Args:
        title: its heading.
    """

    def __init__(self, title: str) -> None:
        with box("dialog", "ask").props(f'aria-label="{html.escape(title)}"') as self._one:
            with box("div", "hd"):
                with box("h2"):
                    text("span", title)
                box("span", "grow")
                button("Close", self.close, small=True, quiet=True)
            self.body = box("div", "bd stack")
        self.said: Element | None = None

    def open(self) -> None:
        """Show it."""
        self.answer("")
        call("openDialog", self._one.id)

    def close(self) -> None:
        """Take it away."""
        call("closeDialog", self._one.id)

    def answer(self, words: str) -> None:
        """A sentence below its fields; nothing takes it away."""
        if self.said is None:
            with self.body:
                self.said = box("div")
        self.said.clear()
        if words:
            with self.said:
                refused(words)

    def place_for_answers(self) -> None:
        """Here, and not at the end."""
        self.said = box("div")


class Typed:
    """A field of words in a dialog: ``value`` is what stands in it."""

    def __init__(
        self, label: str, value: str = "", unit: str = "", about: str = "", done: Callable[[], Any] | None = None
    ) -> None:
        self.value = value
        with box("label", "typed"):
            text("span", label)
            with box("span", "field s"):
                self._box = box("input").props(f'defaultValue="{html.escape(value)}" autocomplete=off')
                if unit:
                    text("span", unit, "u")
            if about:
                text("span", about, "about")
        on_value(self._box, "lab-input", self._came)
        if done is not None:
            self._box.on("keydown.enter", lambda: done())

    def _came(self, event: Any) -> None:
        self.value = str(event.args)

    def set(self, value: str) -> None:
        """Put other words into it."""
        self.value = value
        # as ``defaultValue`` above: a ``value`` that Vue knows would take back what is typed whenever it draws anything
        call("setValue", self._box.id, value)


class Importing:
    """Import a file: dropped or chosen; where a header does not say enough, its columns and units are asked for.

    Args:
        take: given the file, a place for its progress, columns, units and period; gives name and remarks, or raises why it
            is refused.
        done: told the name of what is there now, and remarks.
    """

    def __init__(
        self, take: Callable[[Incoming, Element, Mapping[str, str], Mapping[str, str], str], Any],
        done: Callable[[str, list[str]], Any],
    ) -> None:  # fmt: skip
        self._take, self._done = take, done
        self._file: Incoming | None = None
        self.dialog = Dialog("Import a file")
        with self.dialog.body:
            endings = ", ".join(e.removeprefix(".").upper() for e in files.IMPORTED)
            drop = upload(f"Drop a recording or a file of others here: {endings}", self._came, files.IMPORTED)
            self._picker = drop.props["data-takes"]
            self.dialog.place_for_answers()
            self._progress = box("div")
            self._more = box("div", "stack")
            with self._more:
                text("p", HELP, "small dim")
                self._columns = Typed("Columns", about="such as tension=Load cell; pressure=2; time=1")
                self._units = Typed("Units", about="such as pressure=bar; tension=N")
                self._period = Typed("Interval of the samples", about="where the file has no time, such as 1 ms")
                with box("div", "row"):
                    button("Import", self._again, primary=True)

    def takes(self, place: Element) -> None:
        """Let files be dropped on another place too."""
        place.props(f"data-takes={self._picker}")

    async def _came(self, one: Incoming) -> None:
        self._file = one
        if not is_small(one.path):
            self.dialog.open()  # where it is said how far it is read
        await self._again()

    async def _again(self) -> None:
        one = self._file
        if one is None:
            self.dialog.answer("There is no file yet: drop one first, or choose it.")
            return
        self.dialog.answer("")
        try:
            columns = files.pairs(self._columns.value, "columns", "tank.pressure=2")
            units = files.pairs(self._units.value, "units", "tank.pressure=bar")
            found = await self._take(one, self._progress, columns, units, self._period.value.strip())
        except MckibbenError as error:
            self.dialog.open()  # it is closed where the file was dropped on the list
            self.dialog.answer(str(error))
            return
        one.close()
        self._file = None
        self.dialog.close()
        await self._done(*found)
