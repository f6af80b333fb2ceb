"""Options in the words of a verb, for commands that are none: how a foreign file is understood, and a test machine."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .. import verbs
from ..documents import JsonValue
from ..quantities import parse
from ._terminal import pairs

FILE, RUN = verbs.FILE, "studies.rig_run:record_run"


def _option(place: str, parameter: str, *names: str) -> Any:
    one = verbs.described(place).parameters[parameter]
    return typer.Option(*names, metavar=one.type.word or None, min=one.type.least, help=one.about)


Column = Annotated[list[str] | None, _option(FILE, "columns")]
Unit = Annotated[list[str] | None, _option(FILE, "units")]
Scale = Annotated[list[str] | None, _option(FILE, "scales")]
Period = Annotated[str | None, _option(FILE, "period")]
Decimal = Annotated[str | None, _option(FILE, "decimal")]
Header = Annotated[str | None, _option(FILE, "header")]
Sheet = Annotated[str | None, _option(FILE, "sheet")]
Topic = Annotated[str | None, _option(FILE, "topic")]
GearRatio = Annotated[str | None, _option(FILE, "gear_ratio")]
Start = Annotated[str | None, _option("analysis.energy_accounts:energy_account", "start", "--from")]
End = Annotated[str | None, _option("analysis.energy_accounts:energy_account", "end", "--to")]
ProtocolName = Annotated[
    str, typer.Argument(metavar="PROTOCOL", help=verbs.described(RUN).parameters["protocol"].about)
]
Muscle = Annotated[str, _option(RUN, "muscle", "--muscle")]
RigName = Annotated[str, _option(RUN, "rig", "--rig")]
Plumbing = Annotated[str | None, _option(RUN, "plumbing")]
NoiseSeed = Annotated[int, _option(RUN, "seed")]
Change = Annotated[list[str] | None, _option(RUN, "changes", "--set")]
On = Annotated[str | None, _option(RUN, "machine", "--on")]
LockStep = Annotated[bool, _option(RUN, "lock_step", "--lock-step")]
CalibrationFile = Annotated[Path | None, _option(RUN, "calibration", "--calibration")]
Contraction = Annotated[str | None, _option("studies.tension:tension", "contraction")]


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
