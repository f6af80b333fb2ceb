"""The kinds of files that recordings are read from and written to: one registry, open to other packages.

A kind of file is one `FileFormat`. Those of this package are in `BUILT_IN`; another package adds its own by an entry point
of the group ``mckibben.formats``, named after the suffix without its dot:

    [project.entry-points."mckibben.formats"]
    ddf = "my_package.aurora:FORMAT"

A format is imported when a file with its suffix is met, and not before.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ..errors import InputError
from ..extras import library
from ..registry import Registry

if TYPE_CHECKING:
    from .recording import Recording

# Suffix without its dot -> module beside this one and the name of its format.
BUILT_IN = {
    "nc": "_store:NETCDF", "csv": "_store:CSV", "mcap": "mcap:FORMAT", "mat": "_matlab:FORMAT", "tdms": "_tdms:FORMAT",
    "parquet": "_parquet:FORMAT",
}  # fmt: skip
# Text tables of other programs, which are read with the meaning of their header at hand; see `text`.
TEXT_TABLES = (".csv", ".txt", ".csv.gz", ".txt.gz")


class ForeignColumn(NamedTuple):
    """A column of a file that another program wrote.

    Args:
        label: its name in the file.
        values: (n,) numbers, flags or dates.
        unit: as text, where the file states one beside the name.
        clock: columns that share their samples share this word.
        time: (n,) [s] where the file implies it, by a rate or by stamps.
    """

    label: str
    values: np.ndarray
    unit: str | None = None
    clock: str = ""
    time: np.ndarray | None = None


class ForeignTable(NamedTuple):
    """Columns of a file of another program, its metadata, and a line for each loss."""

    columns: list[ForeignColumn]
    notes: Mapping[str, Any] = {}
    remarks: list[str] = []


class ImportResult(NamedTuple):
    """A recording, and a line for each thing that was not taken over as it is."""

    recording: Recording
    remarks: list[str]


@dataclass(frozen=True, kw_only=True)
class FileFormat:
    """A file format.

    Attributes:
        title: its name in the plural, for sentences, such as ``"TDMS files"``.
        read: reads a file, as a recording of mckibben or as the columns of another program's table; raises `InputError`.
        write: writes a recording and returns a line for each thing that the format holds otherwise; None if the format
            is only read.
        requires: library without which nothing is written, a key of `extras.LIBRARIES`.
    """

    title: str
    read: Callable[[Path], ImportResult | ForeignTable]
    write: Callable[[Recording, Path], list[str]] | None = field(default=None)
    requires: str = ""

    def check_libraries(self, where: str) -> None:
        """Refuse to write where a library is missing, before a long file is read.

        Raises:
            MissingLibraryError: names the library and how to install it.
        """
        if self.requires:
            library(self.requires, f"{self.title} need", where=where)


FORMATS: Registry[FileFormat] = Registry(
    "mckibben.formats", "format", {name: f"mckibben.recordings.{place}" for name, place in BUILT_IN.items()}
)  # fmt: skip


def suffixes() -> tuple[str, ...]:
    """Suffixes of all formats, those of other packages last."""
    return tuple(f".{name}" for name in FORMATS)


def readable() -> tuple[str, ...]:
    """Suffixes of all files that can be read, text tables among them."""
    return tuple(dict.fromkeys((*suffixes(), *TEXT_TABLES)))


def writable() -> tuple[str, ...]:
    """Suffixes of all files that can be written."""
    return tuple(f".{name}" for name in FORMATS if FORMATS[name].write is not None)


def is_text_table(path: Path) -> bool:
    """Whether a file has the suffix of a text table."""
    return path.suffix.lower() in (".csv", ".txt", ".gz")


def format_of(path: Path) -> FileFormat | None:
    """The format of a path by its suffix; None if no package knows it."""
    return FORMATS.get(path.suffix.lower().removeprefix("."))


def writer_of(path: Path) -> FileFormat:
    """The format in which a path is written.

    Raises:
        InputError: no format has the suffix, or its files are only read.
    """
    file_format = format_of(path)
    if file_format is None or file_format.write is None:
        raise InputError("suffix", path.suffix or str(path), f"known are {', '.join(writable())}", where=str(path))
    return file_format
