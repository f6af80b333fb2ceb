"""``show``: properties of a muscle."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from .. import muscles
from ..citations import reference
from ..documents import JsonValue
from ..errors import InputError
from ..report.figures import muscle_figures, style
from ..specimens import Specimen, SpecimenNumber, save_specimen, specimen
from ._outputs import FIGURE, OBJECT, SPECIMEN, TABLE, OutputKinds, Paths
from ._terminal import (
    FigureLook,
    FigureWidth,
    Json,
    Law,
    SpecimenName,
    caution,
    chosen_law,
    print_json,
    table,
)

SHOWN = OutputKinds(figure=FIGURE, table=TABLE, result=OBJECT, specimen=SPECIMEN)


def show(
    name: SpecimenName,
    law: Law = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, SHOWN.option()] = None,
    as_json: Json = False,
) -> None:
    """Show the parameters of a muscle with their units and sources, and its law.

    $ mckibben show nylon --out nylon.svg
    """
    with SHOWN.files(out) as files:
        spec = specimen(name)
        chosen = chosen_law(law, spec)
        built = None if spec.kind == "valve" else _law(spec, chosen, {})
        groups = {"properties": spec.properties} | ({f"laws.{chosen}": spec.laws[chosen]} if built else {})
        groups |= {f"errors.{chosen}": spec.errors[chosen]} if chosen in spec.errors else {}
        groups |= {f"friction.{k}": g for k, g in spec.friction.items()}
        numbers = [(f"{path}.{key}", p) for path, group in groups.items() for key, p in group.items()]
        error = muscles.evidence.error_of(spec, chosen)
        cautions = caution(*(str(one) for one in muscles.evidence.law_cautions(spec, chosen)))
        files.write("figure", lambda path: _draw(built, spec, path))
        files.write("specimen", lambda path: save_specimen(spec, path))
        files.write_rows([{"parameter": path} | _entry(p) for path, p in numbers])
        content = {
            "id": spec.id,
            "title": spec.title,
            "law": chosen,
            "laws": list(spec.laws),
            "parameters": {path: _entry(p) for path, p in numbers},
            "sources": spec.sources,
            "law_error": muscles.evidence.law_error(spec, chosen),
            "warnings": cautions,
        }
        files.write_result(content)
        if as_json:
            print_json(content)
            return
        rows = [[path, _value(p), p.source, "inferred" if p.inferred else "", p.note] for path, p in numbers]
        table(f"{spec.title} ({spec.id})", ["parameter", "value", "source", "", "note"], rows, right=[1])
        others = ", ".join(k for k in spec.laws if k != chosen) or "none"
        typer.echo(f"\nLaw: {getattr(built, 'title', chosen)}. Other laws stated: {others}." if built else "")
        if error is not None:
            typer.echo(f"Error of the law: {error}.")
        for key in dict.fromkeys(spec.sources):
            typer.echo(f"[{key}] {reference(key)}")
        files.say()


def _law(spec: Specimen, law: str, changes: dict[str, Any]) -> Any:
    return muscles.build.built_muscle(spec, law=law, **changes).law


def _value(p: SpecimenNumber) -> str:
    value = ", ".join(f"{v:g}" for v in p.value) if isinstance(p.value, list) else f"{p.value:g}"
    return value if p.unit == "1" else f"{value} {p.unit}"


def _entry(p: SpecimenNumber) -> dict[str, JsonValue]:
    return {"value": p.value, "unit": p.unit, "source": p.source, "inferred": p.inferred, "note": p.note}


def _draw(law: Any, spec: Specimen, path: Path) -> None:

    if spec.kind != "mckibben":
        raise InputError("--out", spec.id, "curves are drawn for McKibben muscles only")
    style.save(muscle_figures.law_curves(law, title=spec.title), path)
