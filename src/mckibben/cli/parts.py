"""``parts``: catalogue of valves, tubes, gas sources, laws and muscles, with numbers, units and sources."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..documents import write_text
from ..quantities import from_si, parse, with_unit
from ..recordings.tables import write_table
from ..studies import parts as catalogue
from ._outputs import OBJECT, TABLE, OutputKinds, Paths
from ._terminal import Json, print_json, table

if TYPE_CHECKING:
    from ..studies.parts import ListedPart

OUT = OutputKinds(table=TABLE, result=OBJECT)
# Columns of the table of each kind: number, heading, and unit in which it is shown.
COLUMNS: dict[str, tuple[tuple[str, str, str], ...]] = {
    "valves": (
        ("nominal_flow", "nominal flow, l/min", "l/min"), ("mass", "mass, g", "g"), ("current", "current, A", "A"),
        ("voltage", "voltage, V", "V"),
    ),
    "tubes": (
        ("inner_diameter", "inside, mm", "mm"), ("outer_diameter", "outside, mm", "mm"),
        ("bend_radius", "bends to, mm", "mm"), ("modulus", "modulus, MPa", "MPa"), ("density", "density, kg/m^3", "kg/m^3"),
    ),
    "sources": (
        ("pressure", "pressure, bar", "bar"), ("filling", "filling, g", "g"), ("free_flow", "free flow, l/min", "l/min"),
        ("stored_energy", "battery, kJ", "kJ"), ("mass", "mass, kg", "kg"),
    ),
    "laws": (),
    "muscles": (
        ("rest_length", "rest length, mm", "mm"), ("bore", "bore, mm", "mm"),
        ("rated_pressure", "rated, bar", "bar"),
    ),
}  # fmt: skip
ALSO = {"bore": "rest_inner_diameter"}  # another name of a number, in specimens
FORMS = {"valves": "element", "sources": "form", "muscles": "law"}


def list_parts(
    what: Annotated[
        str | None,
        typer.Argument(
            metavar="PART",
            help="Kind to list: valves, tubes, sources, laws or muscles; or the name of a part, whose page is shown.",
        ),
    ] = None,
    min_flow: Annotated[
        str | None,
        typer.Option(
            metavar="FLOW", help="Least nominal flow of a valve, or free flow of a compressor, such as '100 l/min'."
        ),
    ] = None,
    max_mass: Annotated[str | None, typer.Option(metavar="MASS", help="Largest mass, such as '300 g'.")] = None,
    out: Annotated[Paths, OUT.option(note="A table has one row per number, in SI units.")] = None,
    as_json: Json = False,
) -> None:
    """List valves, tubes, gas sources, laws and muscles with numbers, units and sources.

    $ mckibben parts valves --min-flow '300 l/min' --out valves.csv
    """
    with OUT.files(out) as files:
        some = _chosen(what, min_flow, max_mass)
        files.write("table", lambda path: _write(some, path))
        content = {"parts": [one.to_dict() for one in some]}
        files.write_result(content)
        if as_json:
            print_json(content)
        elif len(some) == 1 and what not in (None, *catalogue.KINDS):
            _print_page(some[0])
        else:
            _print_lists(some)
        if not as_json:
            files.say()


def _write(some: tuple[ListedPart, ...], path: Path) -> None:
    """Write one row per number."""
    text = catalogue.csv_of(some)
    if path.suffix == ".csv":
        write_text(path, text)
        return
    heads, *rows = csv.reader(io.StringIO(text))
    write_table({head: [row[i] for row in rows] for i, head in enumerate(heads)}, path)


def _chosen(what: str | None, min_flow: str | None, max_mass: str | None) -> tuple[ListedPart, ...]:
    if what is not None and what not in catalogue.KINDS and min_flow is None and max_mass is None:
        return (catalogue.part(what),)
    return catalogue.list_parts(
        what,
        min_flow=None if min_flow is None else parse(min_flow, "m^3/s", field="--min-flow"),
        max_mass=None if max_mass is None else parse(max_mass, "kg", field="--max-mass"),
    )


def columns_of(kind: str, some: Iterable[ListedPart]) -> tuple[list[str], dict[str, list[str]]]:
    """Headings of the numbers of a kind that some of its parts state, and the cells of each part by its name."""
    stated = [c for c in COLUMNS[kind] if any(_cell(one, c[0], c[2]) for one in some)]
    return [heading for _, heading, _ in stated], {
        one.id: [_cell(one, n, unit) for n, _, unit in stated] for one in some
    }


def _print_lists(some: tuple[ListedPart, ...]) -> None:
    for kind, title in catalogue.KINDS.items():
        rows = [one for one in some if one.kind == kind]
        if not rows:
            continue
        heads, numbers = columns_of(kind, rows)
        form = [FORMS[kind]] if kind in FORMS else []
        head = ["name", "what it is", *form, *heads, *(["parameters"] if kind == "laws" else ["numbers", "inferred"])]
        cells = []
        for one in rows:
            counts = [str(len(one.numbers)), str(len(one.inferred()))]
            last = [", ".join(n.name for n in one.numbers)] if kind == "laws" else counts
            cells.append([one.id, one.title, *([one.form] if form else []), *numbers[one.id], *last])
        table(title, head, cells, right=() if kind == "laws" else range(2 + len(form), len(head)))
        typer.echo("")
    if not some:
        typer.echo("No part fits.")
        return
    typer.echo(
        "* inferred: no source at hand prints it. mckibben parts NAME shows every number with its source and range."
    )


def _cell(one: ListedPart, name: str, unit: str) -> str:
    number = one.number(name) or one.number(ALSO.get(name, ""))
    if number is None or number.value is None:
        return ""
    return f"{from_si(number.value, number.unit, unit):.4g}{'*' if number.inferred else ''}"


def _print_page(one: ListedPart) -> None:
    typer.echo(f"{one.id}: {one.title} ({one.kind}{f', {one.form}' if one.form else ''})")
    if one.note:
        typer.echo(one.note)
    typer.echo("")
    rows = []
    for n in one.numbers:
        value = "" if n.value is None else with_unit(n.value, n.unit)
        span = "" if n.low is None or n.high is None else f"{with_unit(n.low, n.unit)} to {with_unit(n.high, n.unit)}"
        rows.append([n.name, value, span, "inferred" if n.inferred else n.source, n.note])
    table("", ["number", "value", "range", "source", "note"], rows, right=[1, 2])
    typer.echo("")
    for line in one.references():
        typer.echo(line)
    typer.echo(f"Its name can be used in: {one.named_in}.")
