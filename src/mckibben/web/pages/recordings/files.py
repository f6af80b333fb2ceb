"""Files of recordings: import, export, repair, reports; all in the words of the command line."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from ....errors import InputError, MckibbenError
from ...laboratory import RECORDINGS, Laboratory

FORMATS = {".nc": "netCDF", ".csv": "CSV", ".parquet": "Parquet", ".mat": "MAT", ".mcap": "MCAP", ".tdms": "TDMS"}
IMPORTED = (*RECORDINGS, ".txt")


def said_of(error: MckibbenError, path: Path, name: str) -> str:
    """A sentence with the file's own name in the place of where it was kept."""
    return str(error).replace(str(path), name)


def imported(
    lab: Laboratory, name: str, data: bytes, columns: Mapping[str, str], units: Mapping[str, str], period: str
) -> tuple[str, list[str]]:
    """Take over a file: one of mckibben as it is, one of others as a recording; its name, and remarks.

    Raises:
        InputError: names column, value and what is allowed; nothing is stored then.
    """
    from ....quantities import parse
    from ....recordings.convert import read_any

    suffix = Path(name).suffix.lower()
    if suffix not in IMPORTED:
        raise InputError(
            "file", name[:120], f"allowed is a name that ends in {', '.join(IMPORTED)}; nothing was stored"
        )
    places = {k: int(v) if v.isdecimal() else v for k, v in columns.items()}
    step = parse(period, "s", field="period", bare=True) if period else None
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / f"given{suffix}"
        path.write_bytes(data)
        try:
            read = read_any(path, columns=places or None, units=dict(units) or None, period=step)
        except MckibbenError as error:
            raise MckibbenError(said_of(error, path, name)) from None
        own = suffix in (".nc", ".mcap") and not read.recording.meta.get("source")
        if own:
            return lab.recordings.store(name, data).name, read.remarks
        meta = {
            "title": Path(name).name
            if read.recording.meta.get("title") == path.name
            else read.recording.meta.get("title")
        }
        source = read.recording.meta.get("source")
        if isinstance(source, Mapping):
            meta["source"] = {**source, "file": name}
        place = Path(folder) / "taken.nc"
        read.recording.with_meta(meta).save(place)
        plain = f"{Path(name).stem}.nc"
        return lab.recordings.store(plain, place.read_bytes()).name, read.remarks


def exported(path: Path, suffix: str) -> tuple[str, bytes, list[str]]:
    """A recording as another kind of file: its name, the bytes, and what that format holds otherwise."""
    from ....recordings.convert import read_any, write

    if path.suffix.lower() == suffix:
        return path.name, path.read_bytes(), []
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / f"{path.stem}{suffix}"
        remarks = write(read_any(path).recording, place)
        return place.name, place.read_bytes(), remarks


def repaired(lab: Laboratory, name: str) -> tuple[str, list[str]]:
    """Save as a recording what is left of a log that was cut off; the log stays. Its name, and what was lost."""
    from ....recordings.mcap_file import read_log

    path = lab.recordings.found(name)
    if path.suffix.lower() != ".mcap":
        raise InputError("file", name, "allowed is a log of a bench, .mcap; others are written whole or not at all")
    try:
        found = read_log(path)
    except MckibbenError as error:
        raise MckibbenError(said_of(error, path, name)) from None
    target = lab.recordings.folder / lab.recordings.free(f"{path.stem}.nc")
    found.recording.save(target)
    return target.name, ["The log was whole."] if found.whole else found.remarks


def rewritten(path: Path, record: object) -> None:
    """Write a recording over its file; the list keeps its order, for the date of the file stays, but for a millisecond."""
    from ....recordings.convert import write
    from ....recordings.recording import Recording

    assert isinstance(record, Recording)
    before = path.stat()
    write(record, path)
    os.utime(path, ns=(before.st_atime_ns, before.st_mtime_ns + 1_000_000))


def report(path: Path) -> tuple[str, bytes]:
    """The report of a recording as a PDF file."""
    from ....recordings.convert import read_any
    from ....report.recording_report import recording_report

    return f"{path.stem}.pdf", recording_report(read_any(path).recording, name=path.name).pdf()


def pairs(text: str, option: str, example: str) -> dict[str, str]:
    """Lines or words such as ``NAME=COLUMN``, parted by semicolons or new lines, as a table."""
    found = {}
    for word in text.replace("\n", ";").split(";"):
        if not word.strip():
            continue
        name, equals, value = word.partition("=")
        if not equals or not name.strip() or not value.strip():
            raise InputError(option, word.strip(), f"allowed is NAME=VALUE, such as {example}")
        found[name.strip()] = value.strip()
    return found
