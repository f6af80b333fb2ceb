"""The kinds of files that recordings are read from and written to: one registry, open to other packages.

A kind of file is one `FileFormat`. Those of this package are in `BUILT_IN`; another package adds its own by an entry point
of the group ``mckibben.formats``, named after the suffix without its dot:

    [project.entry-points."mckibben.formats"]
    abf = "my_package.axon:FORMAT"

A format is imported when a file with its suffix is met, and not before.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..documents import JsonValue, no_file
from ..errors import InputError, MckibbenError
from ..isolation import call_outside
from ..registry import Registry
from .table import FileFormat, ForeignTable, StoredRecording

# Suffix without its dot -> module beside this one and the name of its format.
BUILT_IN = {
    "nc": "store:NETCDF", "csv": "store:CSV", "mcap": "mcap:FORMAT", "mat": "exchange:MATLAB", "tdms": "exchange:TDMS",
    "parquet": "exchange:PARQUET", "txt": "store:TEXT", "tsv": "store:TEXT", "dat": "store:TEXT", "gz": "store:TEXT",
    "lvm": "store:TEXT", "sto": "store:TEXT", "mot": "store:TEXT", "tra": "store:TEXT", "asc": "store:TEXT",
    "xlsx": "exchange:SPREADSHEETS", "xls": "exchange:SPREADSHEETS", "ods": "exchange:SPREADSHEETS",
    "h5": "store:HDF5", "hdf5": "store:HDF5", "hdf": "store:HDF5", "db3": "messages:BAGS", "bag": "messages:BAGS",
    "ddf": "ddf:FORMAT", "edf": "exchange:EDF", "bdf": "exchange:EDF", "c3d": "exchange:C3D", "mf4": "exchange:MDF",
    "mdf": "exchange:MDF", "zip": "crate:FORMAT",
}  # fmt: skip


# Read by Python alone, in proportional time.
PLAIN_TEXT = tuple(f".{name}" for name in "csv txt tsv dat lvm sto mot tra asc".split())
SMALL_TEXT = 1 << 19  # [B]
_NOT_THERE = "format of another process"


FORMATS: Registry[FileFormat] = Registry(
    "mckibben.formats", "format", {name: f"mckibben.formats.{place}" for name, place in BUILT_IN.items()}
)  # fmt: skip


def readable() -> tuple[str, ...]:
    """Suffixes of all files that can be read, those of other packages last."""
    return tuple(f".{name}" for name in FORMATS)


def writable() -> tuple[str, ...]:
    """Suffixes of all files that can be written."""
    return tuple(f".{name}" for name in FORMATS if FORMATS[name].write is not None)


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
        raise InputError("suffix", path.suffix or str(path), known=writable(), where=str(path))
    return file_format


def parts_of(path: Path) -> tuple[str, list[str]]:
    """Names of the sheets or topics of a file, and the option of `load` that chooses one of them.

    Returns:
        ``("sheet", names)`` or ``("topic", names)``; an empty option where the file has one part, or cannot be read.
    """
    file_format = format_of(path)
    if file_format is None or file_format.parts is None:
        return "", []
    try:
        names = call_outside(parts_as_format, path)
    except MckibbenError:
        return "", []  # reading it says why
    return (file_format.options[0], names) if len(names) > 1 else ("", [])


def part_options(path: Path, part: str) -> dict[str, JsonValue]:
    """Options of `load` that choose a sheet or a topic by its name; none for an empty name."""
    file_format = format_of(path)
    return {file_format.options[0]: part} if part and file_format is not None and file_format.parts is not None else {}


def load(path: Path, **options: object) -> StoredRecording | ForeignTable:
    """Read a file as its format does: as a recording of mckibben, or as the columns of another program's table.

    Args:
        path: the file; of a folder that is a bag of ROS 2, its only file of messages.
        options: keywords of the format, such as ``sheet`` of a spreadsheet; None is left out.

    Raises:
        InputError: no format has the suffix, there is no such file, it cannot be read, or the format has no such option.
    """
    where = str(path)
    if path.is_dir() and (path / "metadata.yaml").is_file():
        inside = sorted(part for part in path.iterdir() if part.suffix in (".db3", ".mcap"))
        if len(inside) != 1:
            raise InputError("folder", where, f"must hold one file .db3 or .mcap; it has {len(inside)}")
        path = inside[0]
    file_format = format_of(path)
    if not path.is_file():
        raise no_file(where)
    if file_format is None:
        raise InputError("suffix", path.suffix or where, known=readable(), where=where)
    if not path.stat().st_size:
        raise InputError("file", None, "is empty", where=where)
    stated = {name: value for name, value in options.items() if value is not None}
    for name in stated:
        if name not in file_format.options:
            known = f"they take {', '.join(file_format.options)}" if file_format.options else "they take no options"
            raise InputError(name, str(stated[name]), f"{file_format.title} have no such option; {known}", where=where)
    try:
        # So small a text takes bounded memory and time without a process of its own.
        if path.suffix.lower() in PLAIN_TEXT and path.stat().st_size <= SMALL_TEXT:
            return file_format.read(path, **stated)
        try:
            return call_outside(read_as_format, path, **stated)
        except InputError as error:
            if error.field != _NOT_THERE:
                raise
            return file_format.read(path, **stated)
    except InputError as error:
        raise error if error.where else error.at(where) from None


def read_as_format(path: Path, **stated: Any) -> StoredRecording | ForeignTable:
    """Call the reader of a path's suffix."""
    return _format_there(path).read(path, **stated)


def parts_as_format(path: Path) -> list[str]:
    """Call what lists the parts of a file, by its suffix."""
    parts = _format_there(path).parts
    return [] if parts is None else parts(path)


def _format_there(path: Path) -> FileFormat:
    file_format = format_of(path)
    if file_format is None:  # of the program that asks, such as a script that added it
        raise InputError(_NOT_THERE)
    return file_format
