"""Dialogs of the Circuit page: opening and saving circuits, waveforms as text, and use on the bench."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ....documents import parse_toml, write_text
from ....errors import InputError
from ...elements import call_script
from ...shelf import Shelf
from ...transfers import IncomingFile, UploadPlace, download
from ...widgets import Dialog, box, button, link, refused, tell, text
from .bench_rig import muscle_of, rig_text
from .document import LARGEST, read_text, starts, text_of

if TYPE_CHECKING:
    from .page import CircuitPage

NAME = "circuit"  # of a rig, where the circuit has no name of its own


def load(face: CircuitPage) -> None:
    """Build the dialog of saved circuits, examples, and a place for a file."""
    dialog = Dialog("Load a circuit", "circuit-dialog", "bd circuits", once=True)

    def take(document: Any, name: str = "") -> None:
        face.open(document)
        link(file=name or None)
        dialog.close()

    with dialog:
        text("h3", "Examples")
        for title, document in starts().items():
            button(title, lambda d=document: take(d), quiet=True)
        saved = face.shelf.names()
        text("h3", "Saved")
        if not saved:
            text("p", "No circuit was saved yet.", "small dim")
        said = box("div")
        for file in saved:
            button(file.removesuffix(".toml"), lambda f=file: _read(face, f, take, said), quiet=True)

        def came(one: IncomingFile) -> None:
            name, data = one.name, one.content()
            if len(data) > LARGEST:
                raise InputError(
                    "file", None, f"must be at most {LARGEST >> 10} kB, got {len(data) >> 10} kB; nothing was stored"
                )
            if not name.lower().endswith(".toml"):
                raise InputError("file", name[:120], "must be a .toml file; nothing was stored")
            try:
                words = data.decode("utf-8")
            except UnicodeDecodeError:
                raise InputError("file", name[:120], "must be TOML in UTF-8; nothing was stored") from None
            take(read_text(words))

        UploadPlace("Drop a circuit's .toml file here", came, (".toml",))
    dialog.open()


def _read(face: CircuitPage, file: str, take: Any, said: Any) -> None:
    said.clear()
    try:
        take(read_text(face.shelf.found(file).read_text(encoding="utf-8")), file.removesuffix(".toml"))
    except InputError as error:
        with said:
            refused(str(error))


def save(face: CircuitPage) -> None:
    """Build the dialog to save or download the circuit."""
    dialog = Dialog("Save the circuit", "circuit-dialog", "bd", once=True)
    with dialog:
        with box("div", "f"):
            text("label", "Name").set(for_="circuit-name")
            with box("div", "field"):
                typed = box("input").set(id="circuit-name", placeholder="name", autocomplete="off")
        said = box("div")
        with box("div", "row"):
            done = button("Save", primary=True)
            button("Download", lambda: download("circuit.toml", face.toml().encode()))
        text("p", "A saved circuit runs on the command line too: mckibben circuit run FILE.toml", "small dim")

    def keep(name: str) -> None:
        said.clear()
        try:
            _store(face.shelf, name, face.toml())
        except InputError as error:
            with said:
                refused(str(error))
            return
        link(file=name)
        tell(f"Saved as {name}.")
        dialog.close()

    name = ""

    def typed_in(words: object) -> None:
        nonlocal name
        name = str(words)[:200]

    typed.on_value("input", typed_in)
    typed.on_value("entered", lambda value: keep(str(value)[:200]))
    done.on("click", lambda: keep(name))
    dialog.open()


def _store(shelf: Shelf, name: str, words: str) -> None:
    path = shelf.path(f"{name}.toml")
    shelf.ready()
    write_text(path, words)


def waveform(face: CircuitPage) -> None:
    """Build the dialog of the signals as text."""
    signals = face.desk.document.get("signals")
    if not signals:
        text(
            "p",
            "Nothing in this circuit is driven: it only fills or empties from its start pressures.",
            "small dim note-line",
        )
        return
    with box("div", "waveform"):
        text("label", "Signals, as the file states them").set(for_="circuit-signals")
        words = text_of({"signals": signals})
        area = text("textarea", words, "text").set(id="circuit-signals", spellcheck="false", rows="6")
        said = box("div", "err-place")

    def came(typed: str) -> None:
        said.clear()
        try:
            if len(typed) > LARGEST:
                raise InputError("signals", None, f"must be at most {LARGEST} characters, got {len(typed)}")
            signals = parse_toml(typed, where="signals").get("signals", {})
            read_text(text_of({**face.desk.document, "signals": signals}))
            face.change(lambda d: {**d, "signals": signals})
        except InputError as error:
            with said:
                refused(str(error))

    area.on_value("change", lambda value: came(str(value)))


def to_bench(face: CircuitPage) -> None:
    """Build the dialog that takes the circuit and its muscle to the bench.

    Raises:
        InputError: the bench has no place for a part, or another page is in control.
    """
    plan = face.desk.plan
    muscle, rigs = muscle_of(plan), Shelf(face.workspace.recordings.folder / "rigs", (".toml",))
    _store(rigs, NAME, rig_text(plan, NAME))
    call_script("toBench", [["muscle", muscle], ["rig", NAME]])  # in the order of the link of the bench
