"""Files of recordings: import, export, repair, reports, with the messages of the command line."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from ....errors import InputError, MckibbenError
from ....formats.registry import part_options
from ....quantities import parse
from ....recordings import Recording, read_any, write
from ....recordings.files import read_log
from ....report.recording_report import recording_report
from ...reader import check_rows
from ...workspace import UPLOADS, Workspace

FORMATS = {".nc": "netCDF", ".csv": "CSV", ".parquet": "Parquet", ".mat": "MAT", ".mcap": "MCAP", ".tdms": "TDMS"}
MOST_ROWS = 5_000_000  # of a table that becomes a recording: more than an hour at 1 kHz


class ImportedFile(NamedTuple):
    """Result of importing a file."""

    own: bool  # it is a recording of mckibben, and is taken as it is
    remarks: list[str]  # a line for each thing that was not taken over as it is


def imported(
    path: Path,
    name: str,
    target: Path,
    columns: Mapping[str, str],
    units: Mapping[str, str],
    period: str,
    part: str = "",
) -> ImportedFile:
    """Make a recording of a file, in a separate process if the file is large.

    Args:
        path: the file.
        name: name that its sender gave it.
        target: that the recording is written to, if the file is none already.
        columns: channel name -> label or number of the column, as text.
        units: channel name -> unit as text.
        period: interval of the samples as text, where the file has no time.
        part: sheet of a spreadsheet or topic of a bag, where one is chosen.

    Raises:
        InputError: names column, value and what is allowed.
    """
    check_kind(name)
    check_rows(path, MOST_ROWS, "a recording")
    places = {k: int(v) if v.isdecimal() else v for k, v in columns.items()}
    step = parse(period, "s", field="period", bare=True) if period else None
    try:
        options = part_options(path, part)
        read = read_any(path, columns=places or None, units=dict(units) or None, period=step, **options)
    except MckibbenError as error:
        # the file by the name that its sender gave it, not by the path of its copy
        plain = error.changed(remedy="") if isinstance(error, InputError) else error
        sentence = f"{str(plain).replace(str(path), name).rstrip('.')}."
        remedy, _, lacking = str(getattr(error, "remedy", "")).partition(" ")
        if remedy in ("column", "unit"):  # it can be said in the dialog
            example = f"Columns, such as {lacking}=2" if remedy == "column" else f"Units, such as {lacking}=bar"
            sentence += f" Say it under {example}."
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
    target = workspace.recordings.folder / workspace.recordings.free(f"{path.stem}.nc")
    recording.recording.save(target)
    return target.name, ["The log was complete."] if recording.whole else recording.remarks


def rewritten(path: Path, record: Recording) -> None:
    """Overwrite a recording's file, but keep its date, so that the list keeps its order."""
    before = path.stat()
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
