"""From one file to another, by suffix: recordings of mckibben, and files of others, which become one.

| suffix | read | written | needs |
|---|---|---|---|
| ``.nc`` | of mckibben | all that a recording holds | |
| ``.csv`` | of mckibben and others | all | |
| ``.mcap`` | logs of mckibben, closed or not; JSON, and ROS 2 messages of plain numbers, of others | all | |
| ``.mat`` | of mckibben and others, versions 5 and 7.3 | all, version 5 | pymatreader to read |
| ``.tdms`` | of mckibben and others | all | npTDMS |
| ``.parquet`` | of mckibben and others | all | polars |
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ..documents import write_whole
from ..errors import InputError
from ..extras import library
from ..quantities import with_unit
from .imports import Given, Imported, assembled
from .matlab import matlab_names, read_matlab, write_matlab
from .mcap_file import is_log, read_log, write_log
from .mcap_foreign import columns_of
from .parquet import read_parquet, write_parquet
from .read_record import read_record
from .recording import Recording
from .store import CSV_HEAD, read_recording, save
from .tdms import read_tdms, write_tdms

_TEXTS = (".csv", ".txt", ".gz")
READ = (".nc", ".csv", ".txt", ".csv.gz", ".txt.gz", ".mcap", ".mat", ".tdms", ".parquet")
WRITTEN = (".nc", ".csv", ".mcap", ".mat", ".tdms", ".parquet")


_NEEDED = {".tdms": ("nptdms", "TDMS files"), ".parquet": ("polars", "Parquet files")}  # to write


def convert(
    source: str | Path,
    target: str | Path,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    period: float | None = None,
) -> Imported:
    """Read a file, and write it as the other's suffix says; the target is replaced when all is written.

    Args:
        source: of mckibben or of others.
        target: ends in one of `WRITTEN`.
        columns: of somebody else's file, channel name -> label or number of the column from 1; then only these are read.
        units: of somebody else's file, channel name -> unit in words, where the file says none or a wrong one.
        period: of somebody else's file without a time, the interval of the samples [s].

    Returns:
        The recording, and a line for each thing that was lost or changed on the way.

    Raises:
        InputError: names file, column, value and what is allowed.
    """
    target = Path(target)
    if target.suffix.lower() not in WRITTEN:
        raise InputError("suffix", target.suffix or str(target), f"known are {', '.join(WRITTEN)}", where=str(target))
    if not target.absolute().parent.is_dir():
        raise InputError("file", str(target), f"there is no folder {target.parent}")
    if target.exists() and Path(source).exists() and target.samefile(source):
        raise InputError("file", str(target), "it is the one to be read; say another name")
    if target.suffix.lower() in _NEEDED:  # said before a long file is read
        module, files = _NEEDED[target.suffix.lower()]
        library(module, f"{files} need", where=str(target))
    read = read_any(source, columns=columns, units=units, period=period)
    return Imported(read.recording, [*read.remarks, *write(read.recording, target)])


def read_any(
    path: str | Path,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    period: float | None = None,
) -> Imported:
    """Read a recording of mckibben, or a file of others, as `convert` does."""
    path = Path(path)
    suffix, where = path.suffix.lower(), str(path)
    if suffix not in {*_TEXTS, *_OTHERS, ".nc", ".mcap"}:
        raise InputError("suffix", path.suffix or where, f"known are {', '.join(READ)}", where=where)
    if not path.is_file():
        raise InputError("file", where, "no such file")
    asked: dict[str, Any] = {"columns": columns, "units": units, "period": period}
    if suffix in _TEXTS and not _is_own_text(path):
        record = read_record(path, **asked)
        return Imported(record, list(record.meta["source"].get("left_out", [])))
    if suffix == ".mcap":
        if not is_log(path):
            return _foreign(path, asked)
        log = read_log(path)
        found: Any = Imported(log.recording, log.remarks)
    elif suffix in _OTHERS:
        found = _OTHERS[suffix](path)
        if isinstance(found, tuple):
            given, notes, remarks = found
            read = assembled(path, given, notes=notes, **asked)
            return Imported(read.recording, [*remarks, *read.remarks])
        found = Imported(found, [])
    else:
        found = Imported(read_recording(path), [])
    for option, value in asked.items():
        if value:
            allowed = "a recording of mckibben says these itself; they are for files of others"
            shown = ", ".join(value) if isinstance(value, Mapping) else with_unit(value, "s")
            raise InputError(option.removesuffix("s"), shown, allowed, where=where)
    return found


def write(recording: Recording, path: str | Path) -> list[str]:
    """Write a recording as the suffix says.

    Returns:
        A line for each thing that the format holds otherwise than a recording does.
    """
    path = Path(path)
    suffix = path.suffix.lower()
    if suffix not in _WRITERS:
        save(recording, path)
        return []
    write_whole(path, lambda part: _WRITERS[suffix](recording, part))
    if suffix == ".mat":
        names = zip(recording.channels, matlab_names(recording.channels), strict=True)
        changed = [(name, plain) for name, plain in names if name != plain]
        if changed:
            name, plain = changed[0]
            told = f"such as {plain} for {name}; mckibben reads the names as they were"
            return [f"{len(changed)} names are written as MATLAB allows them, {told}"]
    return []


def _foreign(path: Path, asked: dict[str, Any]) -> Imported:
    given, remarks = columns_of(path)
    read = assembled(path, given, **asked)
    return Imported(read.recording, [*remarks, *read.remarks])


def _is_own_text(path: Path) -> bool:
    if path.suffix.lower() != ".csv":
        return False
    with open(path, "rb") as stream:
        return stream.readline(200).removeprefix(b"\xef\xbb\xbf").strip() == CSV_HEAD.encode()


_Read = Callable[[Path], Recording | tuple[list[Given], dict[str, Any], list[str]]]
_OTHERS: dict[str, _Read] = {".mat": read_matlab, ".tdms": read_tdms, ".parquet": read_parquet}
_WRITERS: dict[str, Callable[[Recording, Path], None]] = {
    ".mat": write_matlab,
    ".tdms": write_tdms,
    ".parquet": write_parquet,
    ".mcap": write_log,
}
