"""Files of recordings: import, export, repair, reports, with the messages of the command line."""

from __future__ import annotations

import os
import re
import tempfile
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from ....errors import InputError, MckibbenError
from ....formats.registry import part_options
from ....quantities import parse
from ....recordings import Recording, read_any, write
from ....recordings.files import read_log
from ....report.recording_report import recording_report
from ...reader import check_rows
from ...shelf import Shelf
from ...workspace import UPLOADS, Workspace
from .listing import whole

FORMATS = {".nc": "netCDF", ".csv": "CSV", ".parquet": "Parquet", ".mat": "MAT", ".mcap": "MCAP", ".tdms": "TDMS"}
MOST_ROWS = 5_000_000  # of a table that becomes a recording: more than an hour at 1 kHz
_rewriting = threading.Lock()  # of two notes that are added at once both stay


class ImportedFile(NamedTuple):
    """Result of importing a file."""

    own: bool  # it is a recording of mckibben, and is taken as it is
    remarks: list[str]  # a line for each thing that was not taken over as it is


class StatedField(NamedTuple):
    """A field of the import dialog, for what the file of another program does not say.

    Args:
        label: of the field.
        example: what may be typed.
        remedy: first word of the remedy of an error that it puts right.
        about: when it is needed, before the example.
    """

    label: str
    example: str
    remedy: str = ""
    about: str = "such as"


STATED = {
    "columns": StatedField("Columns", "tension=Load cell; pressure=2; time=1", "column"),
    "units": StatedField("Units", "pressure=bar; tension=N", "unit"),
    "scales": StatedField("Scales of raw signals", "pressure=2 bar/V - 1 bar; tension=0.5 N/count", "scale"),
    "header": StatedField(
        "Names of the columns", "time_ms, pressure_bar, force_N", "header", "where the file has none, such as"
    ),
    "decimal": StatedField("Decimal mark", "a . or a ,", "decimal", "where numbers fit both:"),
    "period": StatedField("Interval of the samples", "1 ms", "period", "where the file has no time, such as"),
}


def imported(path: Path, name: str, target: Path, stated: Mapping[str, str], part: str = "") -> ImportedFile:
    """Make a recording of a file, in a separate process if the file is large.

    Args:
        path: the file.
        name: name that its sender gave it.
        target: that the recording is written to, if the file is none already.
        stated: what a person stated of the file as text, by the keys of `STATED`; empty text for nothing.
        part: sheet of a spreadsheet or topic of a bag, where one is chosen.

    Raises:
        InputError: names column, value and what is allowed.
    """
    check_kind(name)
    check_rows(path, MOST_ROWS, "a recording")
    given = {name: value.strip() for name, value in stated.items() if value.strip()}
    options: dict[str, Any] = {
        name: pairs(value, name, STATED[name].example) if "=" in STATED[name].example else value
        for name, value in given.items()
    }
    if "columns" in options:
        options["columns"] = {k: int(v) if v.isdecimal() else v for k, v in options["columns"].items()}
    if "period" in options:
        options["period"] = parse(given["period"], "s", field="period", bare=True)
    try:
        read = read_any(path, **options, **part_options(path, part))
    except MckibbenError as error:
        # the file by the name that its sender gave it, not by the path of its copy
        plain = error.changed(remedy="") if isinstance(error, InputError) else error
        sentence = f"{str(plain).replace(str(path), name).rstrip('.')}."
        remedy, _, lacking = str(getattr(error, "remedy", "")).partition(" ")
        if (field := next((one for one in STATED.values() if one.remedy == remedy), None)) is not None:
            example = re.sub("^[^=;]*(?==)", lacking, field.example) if lacking else field.example
            sentence += f" Say it under {field.label}, such as {example.partition(';')[0]}."
        if isinstance(error, InputError):  # it keeps the field that is to blame
            raise error.changed(where="", sentence=sentence, remedy="") from None
        raise MckibbenError(sentence) from None
    if path.suffix.lower() in (".nc", ".mcap") and not read.recording.meta.get("source"):
        return ImportedFile(True, read.remarks)
    meta = {"title": name if read.recording.meta.get("title") == path.name else read.recording.meta.get("title")}
    source = read.recording.meta.get("source")
    if isinstance(source, Mapping):
        meta["source"] = {**source, "file": name}
    read.recording.with_meta(meta).save(target)
    return ImportedFile(False, read.remarks)


def check_kind(name: str) -> None:
    """Refuse a file whose name states another content."""
    if Path(name).suffix.lower() not in UPLOADS:
        allowed = f"must be a name that ends in {', '.join(UPLOADS)}; nothing was stored"
        raise InputError("file", name[:120], allowed)


class ExportedFile(NamedTuple):
    """A file to be downloaded, with remarks on what differs from the recording."""

    name: str
    data: bytes
    remarks: list[str]


def exported(path: Path, suffix: str) -> ExportedFile:
    """Convert a recording to another format."""
    if path.suffix.lower() == suffix:
        return ExportedFile(path.name, path.read_bytes(), [])
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / f"{path.stem}{suffix}"
        remarks = write(read_any(path).recording, place)
        return ExportedFile(place.name, place.read_bytes(), remarks)


def repaired(workspace: Workspace, name: str) -> tuple[str, list[str]]:
    """Recover a recording from an incomplete log, which is kept; return its name, and what was lost."""
    path = workspace.recordings.found(name)
    if path.suffix.lower() != ".mcap":
        raise InputError("file", name, "must be a log of a bench, .mcap; others are written whole or not at all")
    try:
        recording = read_log(path)
    except MckibbenError as error:
        raise MckibbenError(str(error).replace(str(path), name)) from None
    with workspace.recordings.free(f"{path.stem}.nc") as target:
        recording.recording.save(target)
    return target.name, ["The log was complete."] if recording.whole else recording.remarks


def rewritten(shelf: Shelf, name: str, change: Callable[[Recording], Recording]) -> None:
    """Change a recording as its file has it now, but keep its date, so that the list keeps its order."""
    with _rewriting:
        path = shelf.found(name)
        record, before = change(whole(path)), path.stat()
        write(record, path)
        os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns + 1_000_000))


def report(path: Path) -> ExportedFile:
    """Write the report of a recording as a PDF file."""
    data = recording_report(read_any(path).recording, name=path.name).pdf()
    return ExportedFile(f"{path.stem}.pdf", data, [])


def pairs(text: str, option: str, example: str) -> dict[str, str]:
    """Parse text such as ``NAME=COLUMN``, separated by semicolons or new lines, to a table."""
    table = {}
    for word in text.replace("\n", ";").split(";"):
        if not word.strip():
            continue
        name, equals, value = word.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise InputError(option, word.strip(), f"must be NAME=VALUE, such as {example}")
        table[name.strip()] = value.strip()
    return table
