"""Reading a table for the page: a look into the file first, so that what is refused can be put right beside the columns."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from ....errors import InputError
from ...reader import check_rows
from . import source
from .source import Asked

if TYPE_CHECKING:
    from ....recordings import ForceMap
    from ....recordings.force_map import TablePreview


class Reading(NamedTuple):
    """What came of reading a table.

    Attributes:
        look: into the file.
        size: of the file [B].
        points: the table; nothing where it was refused.
        wrong: why it was refused.
        asked: how it was read in the end.
    """

    look: TablePreview
    size: int
    points: ForceMap | None
    wrong: InputError | None
    asked: Asked


def read(path: Path, asked: Asked) -> Reading:
    """Look into a file, of `source.file_of`, and read it.

    Raises:
        InputError: it is no table at all, or has more rows than a fit takes.
    """
    from ....recordings.force_map import preview_table

    check_rows(path, source.MOST_ROWS, "a fit")
    try:
        look = preview_table(path)
    except InputError as error:
        raise error.changed(where=path.name) from None
    if asked.kind == "recording":
        asked = _of_recording(path, asked, look)
    try:
        return Reading(look, path.stat().st_size, source.read(path, asked), None, asked)
    except InputError as error:
        return Reading(look, path.stat().st_size, None, error, asked)


def _of_recording(path: Path, asked: Asked, look: Any) -> Asked:
    """A recording says its rest length, and a real machine's span stands for the length, where nothing else is said."""
    from ....recordings import read_any

    spans = [c for c in look.header if c.split(" [")[0] in ("span", "muscle.span")]
    if not {"length", "contraction"} & {*look.meant, *dict(asked.columns)} and spans:
        asked = asked.with_pair("columns", "length", spans[0])
    rest = read_any(path).recording.meta.get("rest_length")
    if not asked.rest and isinstance(rest, float):
        asked = dataclasses.replace(asked, rest=f"{100.0 * rest:.10g} cm")
    return asked


def used(points: ForceMap, asked: Asked) -> str:
    """Which rows count, in words."""
    taut = int(points.taut.sum())
    slack, told = len(points) - taut, int(points.informative_slack.sum())
    left = "".join(f" {remark[0].upper()}{remark[1:]}." for remark in points.remarks)
    if not slack:
        return f"{taut} rows used.{left}"
    what = "row reads" if slack == 1 else "rows read"
    use = f"; {told} of them ask the laws for zero tension" if asked.slack and told else ""
    return (
        f"{taut} rows used. {slack} {what} zero tension: the muscle is slack there, so errors do not count them{use}."
        + left
    )
