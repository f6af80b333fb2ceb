"""Metadata that a foreign format has no field for, as one line of JSON: names, units, kinds, meanings.

MCAP, MATLAB, TDMS and Parquet files of mckibben carry it; with it they give back exactly what was saved. It reads
``{"schema": 1, "channels": [{"name": .., "unit": .., "kind": .., "meaning": ..}, ..], "meta": {..}}``.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..documents import JsonValue, parse_json
from ..errors import InputError
from ..isolation import lacks_memory
from .table import Channel, StoredRecording

# {"$float": "nan"} stands for a number that JSON has no word for; keys that begin with $ are kept for this.
_MARK = "$float"
SCHEMA = 1  # of recordings in files
# The key, property or variable of a file that holds the line.
KEY = "mckibben"


class Sidecar(NamedTuple):
    """Channels by name without their values, metadata, and the stated number of samples."""

    channels: dict[str, Channel]
    meta: dict[str, Any]
    samples: int | None = None

    def recording(self, time: ArrayLike, columns: Sequence[ArrayLike]) -> StoredRecording:
        """The recording of a time (n,) [s] and columns (n,) in the order of the channels [their units]."""
        filled = zip(self.channels.items(), columns, strict=True)
        return StoredRecording(
            np.asarray(time), {name: channel.with_values(values) for (name, channel), values in filled}, self.meta
        )

    def from_columns(
        self, columns: Mapping[str, ArrayLike], time: str, names: Sequence[str], where: str
    ) -> StoredRecording:
        """The recording of a file's columns, by the name of the time and those of the channels in their order."""
        for name in (time, *names):
            if name not in columns:
                raise InputError(
                    f"column {name}", None, f"is missing: the line {KEY!r} of the file names it", where=where
                )
        try:
            return self.recording(columns[time], [columns[name] for name in names])
        except InputError as error:
            raise error.at(where) from None


def to_json(meta: Mapping[str, JsonValue], *, ascii_only: bool = False) -> str:
    """Format the metadata as one line of standard JSON."""
    return json.dumps(_marked(meta), ensure_ascii=ascii_only, allow_nan=False)


def from_json(text: str) -> JsonValue:
    """Parse what `to_json` wrote."""
    return parse_json(text, object_hook=lambda table: float(table[_MARK]) if _MARK in table else table)


def file_attributes(meta: Mapping[str, JsonValue]) -> dict[str, JsonValue]:
    """The global attributes of a netCDF file: the metadata as JSON, and title and date once more for other programs."""
    lines = {key: meta[key] for key in ("title", "created") if isinstance(meta.get(key), str)}
    plain = {key: text for key, text in lines.items() if text and text.isprintable()}
    return {**plain, "schema": SCHEMA, "meta": to_json(meta)}


def _marked(value: Any) -> JsonValue:
    if isinstance(value, float) and not math.isfinite(value):
        return {_MARK: repr(value)}
    if isinstance(value, dict):
        return {key: _marked(item) for key, item in value.items()}
    return [_marked(item) for item in value] if isinstance(value, list) else value


def dumps(channels: Mapping[str, Channel], meta: Mapping[str, JsonValue], samples: int | None = None) -> str:
    """Write channels and meta as the line of JSON, in ASCII, for not every program reads other letters."""
    listed = [{"name": n, "unit": c.unit, "kind": c.kind, "meaning": c.meaning} for n, c in channels.items()]
    more = {} if samples is None else {"samples": samples}
    return to_json({"schema": SCHEMA, "channels": listed, "meta": meta, **more}, ascii_only=True)


def loads(text: object, where: str | None = None) -> Sidecar:
    """Read what `dumps` wrote.

    Raises:
        InputError: it is damaged, or a newer version wrote it.
    """
    table = parse(text, KEY, where)
    if not isinstance(table, Mapping):
        raise InputError(KEY, str(text)[:60], "must be an object of JSON", where=where)
    check_schema(table.get("schema"), where)
    listed, meta = table.get("channels"), table.get("meta")
    if not isinstance(listed, list) or not all(isinstance(item, Mapping) for item in listed):
        raise InputError(f"channels of {KEY}", str(listed)[:60], "must be a list of objects", where=where)
    if not isinstance(meta, Mapping):
        raise InputError(f"meta of {KEY}", str(meta)[:60], "must be an object", where=where)
    try:
        channels = {
            str(item.get("name")): Channel(
                np.empty(0), item.get("unit", ""), item.get("kind", ""), item.get("meaning", "")
            )
            for item in listed
        }
    except InputError as error:
        raise error.at(where) if where else error from None
    if len(channels) != len(listed):
        raise InputError(f"channels of {KEY}", None, "must be each name once; one is there twice", where=where)
    samples = table.get("samples")
    return Sidecar(channels, dict(meta), samples if isinstance(samples, int) else None)


def check_schema(schema: object, where: str | None = None) -> None:
    """Raise an error for a sidecar that no version, or a newer version, of mckibben wrote."""
    if schema is None:
        problem = "is missing: this is no recording of mckibben; a table of others is converted into one first"
        raise InputError("schema", None, problem, where=where)
    if not isinstance(schema, int | np.integer) or isinstance(schema, bool) or schema < 1:
        raise InputError("schema", str(schema), f"must be a whole number from 1 to {SCHEMA}", where=where)
    if schema > SCHEMA:
        problem = f"must be at most {SCHEMA} for this version of mckibben; a newer one wrote it"
        raise InputError("schema", int(schema), problem, where=where)


def parse(text: object, what: str, where: str | None = None) -> JsonValue:
    """Parse JSON, None of nothing; `InputError` where it is damaged."""
    if text is None:
        return None
    try:
        return from_json(str(text))
    except (json.JSONDecodeError, ValueError, TypeError, RecursionError) as error:
        raise InputError(what, str(text)[:60], f"must be JSON ({one_line(error)})", where=where) from None


@contextmanager
def unreadable(kind: str, where: str | None = None) -> Iterator[None]:
    """Say in one line what a library met in a broken file of a kind, such as ``a MATLAB file``; no memory is not broken."""
    try:
        yield
    except (InputError, MemoryError, KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # whatever libraries raise; a panic of polars is no Exception
        if lacks_memory(error):
            raise MemoryError from None
        raise InputError("file", None, f"cannot be read as {kind} ({one_line(error)})", where=where) from None


@contextmanager
def undecodable(problem: str = "") -> Iterator[None]:
    """Raise a `ValueError` of what a library met in a message, in its words or in those; no memory stays what it is."""
    try:
        yield
    except Exception as error:
        if lacks_memory(error):
            raise
        raise ValueError(problem or one_line(error) or type(error).__name__) from None


def one_line(error: BaseException) -> str:
    """The message of an error in one line of at most 200 characters."""
    return " ".join(str(error).split())[:200]
