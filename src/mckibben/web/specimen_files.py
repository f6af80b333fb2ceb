"""Specimen files of a visitor: those in the server's folder, which the pages offer, and the place for another one."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from ..errors import InputError, MckibbenError
from ..specimens import Specimen, muscle_specimen
from .shelf import Shelf, plain_name
from .transfers import IncomingFile, UploadPlace

ENDINGS = (".toml",)
LARGEST = 2**20  # of a specimen file [B]
WORDS = "A specimen file of your own: .toml, as mckibben braid and the page Fit write it"


class SpecimenFile(NamedTuple):
    """A specimen file as it was when it was chosen: its path, and when it was changed [ns]."""

    path: str
    changed: int


def specimen_file(shelf: Shelf, name: str) -> SpecimenFile:
    """Find a file of a visitor by its name; refused if there is none."""
    path = shelf.found(name)
    return SpecimenFile(str(path), path.stat().st_mtime_ns)


def read_specimen(path: Path, name: str) -> Specimen:
    """Read a specimen file; messages state its name, not the folder of the server.

    Raises:
        InputError: the file states no muscle.
    """
    try:
        return muscle_specimen(path)
    except InputError as error:
        raise error.changed(where=name) if error.where else error.changed(sentence=f"{name}: {error}") from None


def own_titles(shelf: Shelf, fits: Callable[[Path], bool]) -> dict[str, str]:
    """Names of the files of a visitor, the newest first, with the words of a list; unsuitable ones are left out."""
    titles = {}
    for name in shelf.names():
        try:
            if fits(shelf.path(name)):
                titles[name] = f"{Path(name).stem} (your own)"
        except MckibbenError:
            continue  # said where it is chosen by its name
    return titles


def store_specimen(shelf: Shelf, file: IncomingFile) -> str:
    """Store an uploaded specimen file, and return its name on the shelf; the same content is stored once.

    Raises:
        InputError: the file states no muscle, or is too large; nothing was stored.
    """
    name = plain_name(file.name)
    if file.path.stat().st_size > LARGEST:
        raise InputError("file", name, f"must be at most {LARGEST >> 20} MB; nothing was stored")
    read_specimen(file.path, name)
    return shelf.store_once(name, file.content()).name


def specimen_place(shelf: Shelf, take: Callable[[str], object]) -> UploadPlace:
    """Build the place for a specimen file; `take` is told its name on the shelf."""

    def came(file: IncomingFile) -> object:
        name = store_specimen(shelf, file)
        file.close()
        return take(name)

    return UploadPlace(WORDS, came, ENDINGS)
