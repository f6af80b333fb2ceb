"""``compare``: braided and biological muscles, from their laws, from recordings, and in equal protocols."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..citations import reference
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import parse, with_unit
from ..report import document
from ..report.figures import comparison_figures, style
from ..specimens import muscle_specimen
from ..studies import comparison
from ._outputs import FIGURE, OBJECT, REPORT, TABLE, OutputKinds, Paths
from ._progress import told
from ._terminal import FigureLook, FigureWidth, Json, caution, pairs, print_json, table

if TYPE_CHECKING:
    from ..studies.comparison.match import Match, Tuned

OUT = OutputKinds(report=REPORT, figure=FIGURE, table=TABLE, result=OBJECT)
OPTIONS = ("law", "match", "rig", "stimulation")  # of `compare`, by which a refused value is named
_EXAMPLE = "phase='60 deg' or duty=0.3"


def compare_muscles(
    muscles: Annotated[
        list[str] | None, typer.Argument(metavar="SPECIMEN", help="Ids of specimens, or .toml files of them.")
    ] = None,
    recording: Annotated[
        list[Path] | None,
        typer.Option(metavar="RECORDING", help="Recording to show as a further column."),
    ] = None,
    pressure: Annotated[
        str, typer.Option(metavar="PRESSURE", help="Gauge pressure that counts as the full drive of McKibben muscles.")
    ] = "5 bar",
    protocols: Annotated[
        bool,
        typer.Option(
            "--protocols", help="Also run twitch, step, release, force-velocity and work loop on each muscle."
        ),
    ] = False,
    stimulation: Annotated[
        list[str] | None,
        typer.Option(
            "--stimulation",
            metavar="NAME=VALUE",
            help=f"Stimulate biological muscles in the work loop: phase, duty, rate or width, such as {_EXAMPLE}.",
        ),
    ] = None,
    match: Annotated[
        str | None,
        typer.Option(
            metavar="SPECIMEN",
            help="Also search elements that bring each McKibben muscle close to this biological one.",
        ),
    ] = None,
    rig: Annotated[
        str | None,
        typer.Option(metavar="RIG", help="Rig for the protocols; by default the paper's where its range allows."),
    ] = None,
    law: Annotated[
        str | None,
        typer.Option("--law", metavar="LAW", help="Law to use for the muscles that state it instead of their default."),
    ] = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Compare muscles with each other, and with published biological muscle.

    $ mckibben compare nylon fast-fibre --out compared.csv --out compared.svg
    """
    for place in out or []:
        if place.suffix in REPORT:
            document.checked_place(place, field="--out")
    parse(pressure, "Pa", field="--pressure")
    specs = [muscle_specimen(name) for name in muscles or []]
    with OUT.files(out) as files:
        if files["figure"] and not specs:
            raise InputError("--out", None, "needs a specimen: a recording alone has no law to draw")
        count = comparison.stages(specs, protocols=protocols, match=match)
        try:
            with told("comparing", count or None) as tell:
                compared = comparison.compare(
                    specs,
                    recordings=recording or [],
                    pressure=pressure,
                    law=law,
                    protocols=protocols,
                    stimulation=pairs(stimulation, "--stimulation", _EXAMPLE) if stimulation else None,
                    match=match,
                    rig=rig,
                    progress=tell,
                )
        except InputError as error:
            if error.field not in OPTIONS or error.where:
                raise
            options = re.sub(r"\b(protocols|match)\b(?=[ ,])", r"--\1", error.problem)
            raise error.changed(field=f"--{error.field}", problem=options) from None
        warnings = caution(*compared.cautions)
        files.write("figure", lambda path: style.save(comparison_figures.table_figure(compared), path))
        files.write("report", lambda path: compared.report(path))
        files.write_rows(_rows(compared))
        content = _as_json(compared) | {"warnings": warnings}
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            _print(compared)
            files.say()


def _rows(compared: comparison.MuscleTable) -> list[dict[str, Any]]:
    """A row per property, in the unit that it is shown in."""
    names = [column.name for column in compared.columns]
    return [
        {"property": row.property.title, "unit": row.property.unit, **dict(zip(names, row.shown(), strict=True))}
        for row in compared.rows()
    ]


def _as_json(table: comparison.MuscleTable) -> dict[str, JsonValue]:
    rows = []
    for row in table.rows():
        one: dict[str, Any] = {"property": row.property.name, "unit": row.property.unit, "values": row.shown()}
        one |= {"title": row.property.title, "published": None}
        ends, p = row.shown_range(), row.published
        if ends is not None and p is not None:
            one["published"] = {
                "low": ends[0],
                "high": ends[1],
                "sources": list(p.sources),
                "through": p.through,
                "derived": p.derived,
                "note": p.note,
            }
        rows.append(one)
    out: dict[str, Any] = {
        "columns": [c.name for c in table.columns],
        "rows": rows,
        "about": [{"title": c.title, "from": c.kind, "notes": list(c.notes)} for c in table.columns],
    }
    return out | ({"match": [_match_json(m) for m in table.matches]} if table.matches else {})


def _match_json(match: Match) -> dict[str, JsonValue]:
    keys = ("path", "title", "unit", "start", "value", "low", "high", "hit")
    return {
        "muscle": match.muscle.id,
        "target": match.target.id,
        "before": dict(match.rms_before),
        "after": dict(match.rms_after),
        "twitch_simulated": match.rms_simulated,
        "parameters": [{k: getattr(p, k) for k in keys} for p in match.parameters],
    }


def _print(found: comparison.MuscleTable) -> None:
    lines, keys = [], {"chou1996": None}
    for row in found.rows():
        ends = row.shown_range()
        published = "" if ends is None else _number(ends[0]) if ends[0] == ends[1] else " to ".join(map(_number, ends))
        lines.append([row.property.title, row.property.unit, *(_number(v) for v in row.shown()), published])
        if row.published is not None:
            keys |= dict.fromkeys(row.published.sources)
    names = [c.name for c in found.columns]
    table("Muscles side by side", ["", "unit", *names, "biological, published"], lines, right=range(2, len(names) + 3))
    for column in found.columns:
        for note in column.notes:
            typer.echo(f"{column.name}: {note}.")
    for one in found.matches:
        _print_match(one)
    typer.echo("")
    for key in keys:
        typer.echo(f"[{key}] {reference(key)}")


def _print_match(match: Match) -> None:
    typer.echo("")
    titles = {
        "force_length": "force-length",
        "passive": "passive",
        "force_velocity": "force-velocity",
        "all": "together",
    }
    rows = [[titles.get(n, n), f"{match.rms_before[n]:.3f}", f"{match.rms_after[n]:.3f}"] for n in match.rms_before]
    table(
        f"{match.muscle.id} with elements, towards {match.target.id}: rms difference over the tension at rest length",
        ["curve", "as built", "with elements"],
        rows,
        right=[1, 2],
    )
    if match.simulated is not None:
        typer.echo(f"The twitch with elements on the test machine, circuit and all: {match.rms_simulated:.3f}.")
    typer.echo("")
    table("", ["element", "as built", "found", "at its bound"], [_tuned(p) for p in match.parameters], right=[1, 2])


def _tuned(p: Tuned) -> list[str]:

    if not p.hit:
        return [p.title, with_unit(p.start, p.unit), with_unit(p.value, p.unit), ""]
    end = p.low if p.hit == "low" else p.high  # the search stops a rounding before it
    return [p.title, with_unit(p.start, p.unit), with_unit(end, p.unit), "lower" if p.hit == "low" else "upper"]


def _number(value: float | None) -> str:
    if value is None or value != value:
        return "\N{EN DASH}"
    return f"{value:.0f}" if abs(value) >= 1000.0 else f"{value:.3g}"
