"""Files of recordings: read, written and converted by suffix.

| suffix | read | written | needs |
|---|---|---|---|
| ``.nc`` | of mckibben | all that a recording holds | |
| ``.csv`` | of mckibben and of other programs | all | |
| ``.mcap`` | logs of mckibben, closed or not; JSON, and ROS 2 messages of plain numbers, of other programs | all | |
| ``.mat`` | of mckibben and of other programs, versions 5 and 7.3 | all, version 5 | pymatreader to read |
| ``.tdms`` | of mckibben and of other programs | all | npTDMS |
| ``.parquet`` | of mckibben and of other programs | all | polars |

Further kinds come from other packages: see `formats`.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from ..documents import write_whole
from ..errors import InputError
from ..quantities import with_unit
from ._store import is_recording_csv
from ._text_records import read_record
from .columns import assemble
from .formats import ForeignTable, ImportResult, format_of, is_text_table, readable, writer_of
from .mcap import read_log
from .recording import Recording

RECORDINGS = (".nc", ".csv", ".mcap")  # that `read_recording` takes


def read_recording(path: str | Path) -> Recording:
    """Read a recording: netCDF and CSV as `Recording.save` wrote them, or the live log of a bench (``.mcap``).

    What a log lost, because it was never closed or is damaged, stands in the metadata's ``warnings``.

    Raises:
        InputError: there is no such file, it is no recording, or a newer version wrote it.
    """
    path = Path(path)
    if path.suffix.lower() not in RECORDINGS:
        known = f"known are {', '.join(RECORDINGS)}"
        raise InputError("suffix", path.suffix or str(path), known, where=str(path))
    # A log that is damaged where it says that it is one still has its samples.
    content = read_log(path) if path.suffix.lower() == ".mcap" else load(path)
    assert not isinstance(content, ForeignTable)
    return content.recording


def load(path: Path) -> ImportResult | ForeignTable:
    """Read a file as its format does: as a recording of mckibben, or as the columns of another program's table.

    Raises:
        InputError: no format has the suffix, there is no such file, or it cannot be read.
    """
    file_format = format_of(path)
    if file_format is None:
        raise InputError("suffix", path.suffix or str(path), f"known are {', '.join(readable())}", where=str(path))
    if not path.is_file():
        raise InputError("file", str(path), "no such file")
    try:
        return file_format.read(path)
    except InputError as error:
        raise error if error.where else error.at(str(path)) from None


def read_any(
    path: str | Path,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    period: float | None = None,
) -> ImportResult:
    """Read a recording of mckibben, or a file of another program, as `convert` does."""
    path = Path(path)
    where = str(path)
    if format_of(path) is None and not is_text_table(path):
        raise InputError("suffix", path.suffix or where, f"known are {', '.join(readable())}", where=where)
    if not path.is_file():
        raise InputError("file", where, "no such file")
    options: dict[str, Any] = {"columns": columns, "units": units, "period": period}
    if is_text_table(path) and not is_recording_csv(path):
        record = read_record(path, **options)
        return ImportResult(record, list(record.meta["source"].get("left_out", [])))
    content = load(path)
    if isinstance(content, ForeignTable):
        result = assemble(path, content.columns, notes=content.notes, **options)
        return ImportResult(result.recording, [*content.remarks, *result.remarks])
    for option, value in options.items():
        if value:
            allowed = "a recording of mckibben says these itself; they are for files of others"
            shown = ", ".join(value) if isinstance(value, Mapping) else with_unit(value, "s")
            raise InputError(option.removesuffix("s"), shown, allowed, where=where)
    return content


def write(recording: Recording, path: str | Path) -> list[str]:
    """Write a recording in the format of the suffix, atomically.

    Returns:
        A line for each thing that the format holds otherwise than a recording does.

    Raises:
        InputError: the suffix is unknown, or the file cannot be written.
    """
    path = Path(path)
    write_part = writer_of(path).write
    assert write_part is not None
    remarks: list[str] = []
    write_whole(path, lambda part: remarks.extend(write_part(recording, part)))
    return remarks


def convert(
    source: str | Path,
    target: str | Path,
    *,
    columns: Mapping[str, str | int] | None = None,
    units: Mapping[str, str] | None = None,
    period: float | None = None,
) -> ImportResult:
    """Read a file, and write it in the format of the target's suffix, atomically.

    Args:
        source: source of mckibben or of another program.
        target: ends in the suffix of a format that is written.
        columns: of another program's file, channel name -> label or number of the column from 1; then only these are read.
        units: units of another program's file, channel name -> unit as text, where the file states none or a wrong one.
        period: period of another program's file without a time, the interval of the samples [s].

    Returns:
        The recording, and a line for each thing that was lost or changed on the way.

    Raises:
        InputError: names file, column, value and what is allowed.
    """
    target = Path(target)
    target_format = writer_of(target)
    if not target.absolute().parent.is_dir():
        raise InputError("file", str(target), f"there is no folder {target.parent}")
    if target.exists() and Path(source).exists() and target.samefile(source):
        raise InputError("file", str(target), "it is the one to be read; say another name")
    target_format.check_libraries(str(target))
    result = read_any(source, columns=columns, units=units, period=period)
    return ImportResult(result.recording, [*result.remarks, *write(result.recording, target)])
