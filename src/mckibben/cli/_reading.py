"""Options of commands that read the file of another program: how it is understood, in the words of `describe_file`."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from .. import verbs
from ..documents import JsonValue
from ..quantities import parse
from ._terminal import pairs


def _option(parameter: str) -> Any:
    one = verbs.described("analysis.description:describe_file").parameters[parameter]
    return typer.Option(metavar=one.type.word, help=one.about)


Column = Annotated[list[str] | None, _option("columns")]
Unit = Annotated[list[str] | None, _option("units")]
Scale = Annotated[list[str] | None, _option("scales")]
Period = Annotated[str | None, _option("period")]
Decimal = Annotated[str | None, _option("decimal")]
Header = Annotated[str | None, _option("header")]
Sheet = Annotated[str | None, _option("sheet")]
Topic = Annotated[str | None, _option("topic")]
GearRatio = Annotated[str | None, _option("gear_ratio")]


def format_options(**options: str | None) -> dict[str, JsonValue]:
    """The options of a file format that were stated."""
    return {name: value for name, value in options.items() if value is not None}


def column_places(words: list[str] | None) -> dict[str, str | int] | None:
    """The columns of ``--column``, numbers as such."""
    named = pairs(words, "--column", "force='F [N]'")
    return {name: int(place) if place.isdecimal() else place for name, place in named.items()} or None


def stated_columns(
    column: list[str] | None, unit: list[str] | None, scale: list[str] | None, period: str | None
) -> dict[str, Any]:
    """What the options state of the columns of a file of another program."""
    return {
        "columns": column_places(column),
        "units": pairs(unit, "--unit", "force=N") or None,
        "scales": pairs(scale, "--scale", "pressure='2 bar/V'") or None,
        "period": None if period is None else parse(period, "s", field="--period", bare=True),
    }
