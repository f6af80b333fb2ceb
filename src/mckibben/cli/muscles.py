"""``show`` and ``tension``: properties of a muscle, and its tension."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from .. import muscles
from ..citations import reference
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import declared, parse, shown_unit, values, with_unit
from ..report.figures import muscle_figures, style
from ..specimens import Specimen, SpecimenNumber, specimen, specimens
from ._terminal import (
    PICTURES,
    FigureLook,
    FigureWidth,
    Json,
    Set,
    assignments,
    caution,
    chosen_law,
    print_json,
    table,
    writable,
)

Name = Annotated[
    str,
    typer.Argument(metavar="SPECIMEN_OR_LAW", help="Id of a specimen, the .toml file of one, or the name of a law."),
]
Law = Annotated[str | None, typer.Option("--law", help="Law to use instead of the specimen's default.")]


def show(
    name: Annotated[str, typer.Argument(metavar="SPECIMEN", help="Id of a specimen, or the .toml file of one.")],
    law: Law = None,
    figure: Annotated[
        Path | None, typer.Option("--figure", help="Draw the muscle's curves into this SVG, PDF or PNG file.")
    ] = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    as_json: Json = False,
) -> None:
    """Show the parameters of a muscle with their units and sources, and its law."""
    writable("--figure", figure, *PICTURES)
    spec = specimen(name)
    chosen = chosen_law(law, spec)
    built = None if spec.kind == "valve" else _law(spec, chosen, {})
    groups = {"properties": spec.properties} | ({f"laws.{chosen}": spec.laws[chosen]} if built else {})
    groups |= {f"friction.{k}": g for k, g in spec.friction.items()}
    if figure is not None:
        _draw(built, spec, figure)
    if as_json:
        entries = {f"{path}.{key}": _entry(p) for path, group in groups.items() for key, p in group.items()}
        print_json(
            {
                "id": spec.id,
                "title": spec.title,
                "law": chosen,
                "laws": list(spec.laws),
                "parameters": entries,
                "sources": spec.sources,
            }
        )
        return
    rows = []
    for path, group in groups.items():
        for key, p in group.items():
            rows.append([f"{path}.{key}", _value(p), p.source, "inferred" if p.inferred else "", p.note])
    table(f"{spec.title} ({spec.id})", ["parameter", "value", "source", "", "note"], rows, right=[1])
    others = ", ".join(k for k in spec.laws if k != chosen) or "none"
    typer.echo(f"\nLaw: {getattr(built, 'title', chosen)}. Other laws stated: {others}." if built else "")
    for key in dict.fromkeys(spec.sources):
        typer.echo(f"[{key}] {reference(key)}")


def tension(
    name: Name,
    length: Annotated[str, typer.Option(help="Distance between the anchors, such as '12 cm'.")],
    pressure: Annotated[str | None, typer.Option(help="Gauge pressure, such as '5 bar'.")] = None,
    activation: Annotated[str | None, typer.Option(help="Activation of a biological muscle, between 0 and 1.")] = None,
    wanted: Annotated[
        str | None, typer.Option("--for", help="Find the lowest pressure for this tension instead.")
    ] = None,
    law: Law = None,
    change: Set = None,
    as_json: Json = False,
) -> None:
    """Compute tension, volume and state of a muscle at one length and pressure."""
    spec, chosen, built = _resolve(name, law, change)
    biological = spec is not None and spec.kind == "biological"
    at = parse(length, "m", field="--length")
    _positive(at, "--length", length)
    cautions = [] if biological else [muscles.plausible.length_caution(at, float(built.length_range()[1]), text=length)]
    if spec is not None and biological:
        drive = _activation(activation, pressure, spec)
    elif activation is not None:
        raise InputError("--activation", activation, f"{name} is no biological muscle; give --pressure or --for")
    elif wanted is not None:
        if pressure is not None:
            raise InputError("--for", None, "is allowed only without --pressure, which it finds")
        drive = built.pressure_for(parse(wanted, "N", field="--for"), at)
    else:
        if pressure is None:
            raise InputError(
                "--pressure", None, "is missing: give a gauge pressure such as '5 bar', or a tension with --for"
            )
        drive = parse(pressure, "Pa", field="--pressure")
        if drive < -1.1e5 or drive > 1e8:
            raise InputError("--pressure", pressure, "must be between -1.1 bar (vacuum) and 1000 bar gauge")
        cautions.append(muscles.plausible.pressure_caution(drive, spec, text=pressure))
    state, free = built.state(at, drive), built.free_length(drive)
    warnings = caution(*cautions)
    answer: dict[str, Any] = {
        "tension": float(state.tension),
        "passive": float(state.passive),
        "active": float(state.active),
        "volume": float(state.volume),
        "slack": bool(state.slack),
        "overstretched": bool(state.overstretched),
        "law": chosen,
        "stiffness": float(state.stiffness),
        "braid_length": float(state.braid_length),
        "free_length": float(free),
        "specimen": None if spec is None else spec.id,
        "length": at,
        ("activation" if biological else "pressure"): drive,
        "warnings": warnings,
    }
    defaults = [] if spec is not None else _defaults(built, change, chosen)
    if spec is None:
        answer |= {"parameters": values(built), "defaults": defaults}
    if as_json:
        print_json(answer)
        return
    shown = {"tension": "N", "passive": "N", "active": "N", "volume": "m^3", "stiffness": "N/m", "free_length": "m"}
    rows = [
        [k.replace("_", " "), "not known to this law" if answer[k] != answer[k] else with_unit(answer[k], u)]
        for k, u in shown.items()
    ]
    words = ["slack" if answer["slack"] else "taut"] + (["overstretched"] if answer["overstretched"] else [])
    force = f"activation {drive:g}" if biological else with_unit(drive, "Pa")
    title = f"{built.title} law" if spec is None else f"{spec.title}, {chosen}"
    table(f"{title}, at {with_unit(at, 'm')} and {force}: {', '.join(words)}", ["", ""], rows, right=[1])
    if defaults:
        units = declared(type(built))
        said = ", ".join(f"{n} = {with_unit(float(getattr(built, n)), units[n].unit)}" for n in defaults)
        typer.echo(f"Not given, by default of the law: {said}.")


def _resolve(name: str, law: str | None, change: list[str] | None) -> tuple[Specimen | None, str, Any]:
    """The specimen, None if a law is named; the name of the law, and the muscle."""
    if name in muscles.laws.LAWS:
        if law is not None:
            raise InputError("--law", None, f"is allowed only with a specimen; {name} is a law itself")
        return None, name, _named_law(name, parameters(change, name))
    spec = specimen(name)
    if spec.kind == "valve":
        raise InputError("specimen", spec.id, "must be a muscle; it is a valve")
    chosen = chosen_law(law, spec)
    if spec.kind == "biological":
        return spec, chosen, _law(spec, chosen, {})
    return spec, chosen, _law(spec, chosen, parameters(change, chosen))


def _named_law(name: str, given: dict[str, float]) -> Any:
    """Build a law by its name with given parameters, without any specimen."""
    missing = muscles.build.missing_parameters(name, given)
    if missing:
        words = " ".join(f"--set {key}={placeholder(q.unit)}" for key, q in missing)
        stated = [s.id for s in specimens() if name in s.laws]
        others = f" or name a specimen that states this law with --law {name}: {', '.join(stated)}" if stated else ""
        needs = muscles.build.needed_words(missing)
        sentence = f"The law {name} needs {needs}. Give {'it' if len(missing) == 1 else 'them'} with {words},{others}"
        raise InputError(f"{name}.{missing[0][0]}", "not given", f"give {words}", sentence=sentence.rstrip(","))
    return muscles.build.build_law(name, given)


def parameters(words: Iterable[str] | None, law: str) -> dict[str, float]:
    """Parse ``--set`` arguments to parameters of a law [SI]; a bare number is taken as SI."""
    known = declared(muscles.laws.law_type(law))
    values = {}
    for name, text in assignments(words).items():
        if name not in known:
            raise InputError(f"--set {name}", text, f"{law} has", known=known)
        values[name] = parse(text, known[name].unit, field=f"--set {name}", bare=True)
    return values


def placeholder(unit: str) -> str:
    """Placeholder of a value that the user has to give: ``'.. cm'``."""
    return ".." if unit == "1" else f"'.. {shown_unit(unit)}'"


def _defaults(built: Any, change: list[str] | None, law: str) -> list[str]:
    """Parameters of a law with default values."""
    stated = parameters(change, law)
    return [name for name in declared(type(built)) if name not in stated]


def _law(spec: Specimen, law: str, changes: dict[str, Any]) -> Any:
    return muscles.build.muscle(spec, law=law, **changes).law


def _activation(activation: str | None, pressure: str | None, spec: Specimen) -> float:

    if pressure is not None:
        raise InputError("--pressure", pressure, f"{spec.id} is a biological muscle; give --activation from 0 to 1")
    if activation is None:
        raise InputError(
            "--activation", None, f"is missing: {spec.id} is a biological muscle, which needs one from 0 to 1"
        )
    value = parse(activation, "1", field="--activation")
    if not 0.0 <= value <= 1.0:
        raise InputError("--activation", activation, "must be between 0 and 1")
    return value


def _positive(value: float, field: str, text: str) -> None:
    if value <= 0.0 or value > 100.0:
        raise InputError(field, text, "must be a length above 0 and up to 100 m")


def _value(p: SpecimenNumber) -> str:
    value = ", ".join(f"{v:g}" for v in p.value) if isinstance(p.value, list) else f"{p.value:g}"
    return value if p.unit == "1" else f"{value} {p.unit}"


def _entry(p: SpecimenNumber) -> dict[str, JsonValue]:
    return {"value": p.value, "unit": p.unit, "source": p.source, "inferred": p.inferred, "note": p.note}


def _draw(law: Any, spec: Specimen, path: Path) -> None:

    if spec.kind != "mckibben":
        raise InputError("--figure", spec.id, "curves are drawn for McKibben muscles only")
    style.save(muscle_figures.law_curves(law, title=spec.title), path)
