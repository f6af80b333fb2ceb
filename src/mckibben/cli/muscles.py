"""``show`` and ``tension``: properties of a muscle, and its tension."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from .. import identification, muscles
from ..answers import collect
from ..citations import reference
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import declared, from_si, parse, shown_unit, values, with_unit
from ..report.figures import muscle_figures, style
from ..specimens import Specimen, SpecimenNumber, muscle_specimen, save_specimen, specimen, specimens
from ._outputs import FIGURE, OBJECT, SPECIMEN, TABLE, OutputKinds, Paths
from ._terminal import (
    Contraction,
    FigureLook,
    FigureWidth,
    FromPosterior,
    Json,
    Law,
    Set,
    SpecimenName,
    assignments,
    caution,
    chosen_law,
    print_json,
    several,
    table,
)

if TYPE_CHECKING:
    from ..answers import Caution
    from ..identification import Posterior

Name = Annotated[
    str,
    typer.Argument(metavar="SPECIMEN|LAW", help="Id of a specimen, the .toml file of one, or the name of a law."),
]
SHOWN = OutputKinds(figure=FIGURE, table=TABLE, result=OBJECT, specimen=SPECIMEN)
POINTS = OutputKinds(table=TABLE, result=OBJECT)
BAND = {"tension_low": "N", "tension_high": "N"}
# Units of a law's state at a point, in the order in which they are shown.
UNITS = {"tension": "N", "passive": "N", "active": "N", "volume": "m^3", "stiffness": "N/m", "free_length": "m"}


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


def tension(
    name: Name,
    length: Annotated[
        str | None,
        typer.Option(metavar="LENGTH", help="Distance between the anchors, such as '12 cm', or a range '10:15 cm'."),
    ] = None,
    contraction: Contraction = None,
    pressure: Annotated[
        str | None, typer.Option(metavar="PRESSURE", help="Gauge pressure, such as '5 bar', or a range '1:5 bar'.")
    ] = None,
    activation: Annotated[
        str | None,
        typer.Option(
            metavar="ACTIVATION", help="Activation of a biological muscle, between 0 and 1, or a range '0:1:0.25'."
        ),
    ] = None,
    wanted: Annotated[
        str | None,
        typer.Option(
            "--for", metavar="FORCE", help="Find the lowest pressure for this tension instead, such as '50 N'."
        ),
    ] = None,
    law: Law = None,
    change: Set = None,
    from_posterior: FromPosterior = None,
    out: Annotated[Paths, POINTS.option()] = None,
    as_json: Json = False,
) -> None:
    """Compute tension, volume and state of a muscle at one length and pressure.

    A range of lengths, contractions or pressures, such as '1:5 bar' or '0:25:5 %', gives a table.

    $ mckibben tension nylon --length '12 cm' --pressure '5 bar'
    $ mckibben tension nylon --contraction '0:20:5 %' --pressure '1:5 bar' --out map.csv
    """
    with POINTS.files(out) as files:
        spec, chosen, built = _resolve(name, law, change)
        biological = spec is not None and spec.kind == "biological"
        lengths = _lengths(length, contraction, muscles.Muscle(built, specimen=spec))
        if wanted is not None:
            drives = [_drive_for(wanted, pressure, activation, built, lengths)]
        elif biological:
            assert spec is not None
            drives = _activations(activation, pressure, spec)
        else:
            drives = _pressures(pressure, activation, name)
        about_lengths = muscles.Muscle(built, specimen=spec).length_cautions(lengths, text=length)
        about_pressures = (
            None if pressure is None else muscles.plausible.pressure_caution(max(drives), spec, text=pressure)
        )
        warnings = (
            [] if biological else caution(*about_lengths, about_pressures, *muscles.evidence.law_cautions(spec, chosen))
        )
        points = [_point(built, at, drive, biological) for at in lengths for drive in drives]
        warnings += caution(*(str(one) for one in _add_ranges(points, spec, chosen, built)))
        if from_posterior is not None:
            posterior = identification.read_posterior(from_posterior, law=chosen)
            posterior.check_muscle(built, name)
            warnings += caution(posterior.beyond(lengths, drives))
            warnings += caution(_add_bands(points, posterior))
        error = muscles.evidence.error_of(spec, chosen)
        about: dict[str, Any] = {"law": chosen, "specimen": None if spec is None else spec.id, "warnings": warnings}
        about["law_error"] = muscles.evidence.law_error(spec, chosen)
        defaults = [] if spec is not None else _defaults(built, change, chosen)
        if spec is None:
            about |= {"parameters": values(built), "defaults": defaults}
        answer = points[0] | about if len(points) == 1 else {"points": points} | about
        flat = [{key: value for key, value in point.items() if key != "by_law"} for point in points]
        files.write_rows(flat, UNITS | {"length": "m", "pressure": "Pa", "braid_length": "m"} | BAND)
        files.write_result(answer)
        if as_json:
            print_json(answer)
            return
        title = f"{built.title} law" if spec is None else f"{spec.title}, {chosen}"
        band = "range" if from_posterior is None else "95 %"  # what low and high are the ends of
        if len(points) == 1:
            _print_point(points[0], title, biological, band)
        else:
            _print_points(points, title, biological, band)
        if error is not None:
            typer.echo(f"Error of the law: {error}.")
        if defaults:
            units = declared(type(built))
            said = ", ".join(f"{n} = {with_unit(float(getattr(built, n)), units[n].unit)}" for n in defaults)
            typer.echo(f"Not given, by default of the law: {said}.")
        files.say()


def _lengths(length: str | None, contraction: str | None, muscle: muscles.Muscle) -> list[float]:
    """Lengths of the options [m]."""
    if (length is None) == (contraction is None):
        problem = "is missing: give a length such as '12 cm', or a contraction such as --contraction '20 %'"
        raise InputError("--length", None, problem if length is None else "is allowed only without --contraction")
    if length is None:
        shares = several(contraction, "1", "--contraction")
        try:
            return [float(muscle.length_at(share)) for share in shares]
        except InputError as error:
            raise error.changed(field="--contraction") from None
    lengths = several(length, "m", "--length")
    for at in lengths:
        _positive(at, "--length", length)
    return lengths


def _pressures(pressure: str | None, activation: str | None, name: str) -> list[float]:
    """Gauge pressures of the options [Pa]."""
    if activation is not None:
        raise InputError("--activation", activation, f"{name} is no biological muscle; give --pressure or --for")
    if pressure is None:
        raise InputError(
            "--pressure", None, "is missing: give a gauge pressure such as '5 bar', or a tension with --for"
        )
    pressures = several(pressure, "Pa", "--pressure")
    if min(pressures) < -1.1e5 or max(pressures) > 1e8:
        raise InputError("--pressure", pressure, "must be between -1.1 bar (vacuum) and 1000 bar gauge")
    return pressures


def _drive_for(wanted: str, pressure: str | None, activation: str | None, built: Any, lengths: list[float]) -> float:
    """The lowest gauge pressure [Pa] or activation [1] for a tension at one length."""
    for option, value in (("--pressure", pressure), ("--activation", activation)):
        if value is not None:
            raise InputError("--for", None, f"is allowed only without {option}, which it finds")
    if len(lengths) > 1:
        raise InputError("--for", wanted, "is allowed only with one length")
    return float(built.pressure_for(parse(wanted, "N", field="--for"), lengths[0]))


def _point(built: Any, length: float, drive: float, biological: bool) -> dict[str, Any]:
    """State of a law at a length [m] and a gauge pressure [Pa] or activation [1]."""
    state = built.state(length, drive)
    return {
        "length": length,
        ("activation" if biological else "pressure"): drive,
        "tension": float(state.tension),
        "passive": float(state.passive),
        "active": float(state.active),
        "volume": float(state.volume),
        "slack": bool(state.slack),
        "overstretched": bool(state.overstretched),
        "stiffness": float(state.stiffness),
        "braid_length": float(state.braid_length),
        "free_length": float(built.free_length(drive)),
    }


def _add_ranges(points: list[dict[str, Any]], spec: Specimen | None, name: str, built: Any) -> tuple[Caution, ...]:
    """What ranges of a specimen's numbers, and other laws of a braid, leave of the tension at each point, beside it.

    Returns:
        Cautions where the laws of a braid differ, for the point at which they do most, and where none can pull.
    """
    if spec is None or spec.kind != "mckibben":
        return ()
    at = [np.array([p[name] for p in points]) for name in ("length", "pressure")]
    ends = muscles.ranges.tension_range(spec, name, built, *at)
    for point, low, high in zip(points, *ends, strict=True) if ends is not None else ():
        point |= {"tension_low": float(low), "tension_high": float(high)}
    said = []
    for point in points:
        others = muscles.sleeve.other_laws(spec, name, point["length"], point["pressure"])
        point |= {"by_law": {name: point["tension"]} | others} if others else {}
        differing = muscles.sleeve.differing_caution(spec, name, point["tension"], others)
        said += [(max(others.values()) - min(others.values()), differing)] if differing else []
    pulls = np.array([p["tension"] for p in points])
    beyond = muscles.evidence.beyond_braid_caution(built, at[0], pulls)
    return collect(max(said, key=lambda one: one[0])[1] if said else None, beyond)


def _add_bands(points: list[dict[str, Any]], posterior: Posterior) -> str | None:
    """The 95 % band of the tension at each point, beside the tension.

    Returns:
        A caution where tensions lie outside of it; None if there is none.
    """
    band = posterior.tension([p["length"] for p in points], [p["pressure"] for p in points])
    for point, low, high in zip(points, band.low, band.high, strict=True):
        point |= {"tension_low": float(low), "tension_high": float(high)}
    outside = [p for p in points if not p["tension_low"] <= p["tension"] <= p["tension_high"]]
    if not outside:
        return None
    which = "" if len(points) == 1 else f" at {len(outside)} of {len(points)} points"
    return (
        f"the tension of the muscle's own parameters lies outside of the 95 % of the posterior{which}, which adds to the "
        "law what its measured points have besides; the parameters are not the posterior's, or the law lacks that much"
    )


def _print_point(point: dict[str, Any], title: str, biological: bool, band: str) -> None:
    rows = [
        [k.replace("_", " "), "not known to this law" if point[k] != point[k] else with_unit(point[k], u)]
        for k, u in UNITS.items()
    ]
    rows[1:1] = [[f"by {law}", with_unit(pull, "N")] for law, pull in list(point.get("by_law", {}).items())[1:]]
    if "tension_low" in point:
        ends = " to ".join(with_unit(point[f"tension_{end}"], "N") for end in ("low", "high"))
        if ends != f"{rows[0][1]} to {rows[0][1]}":  # ranges of numbers that do not matter here say nothing
            rows.insert(1, [f"tension, {band}", ends])
    words = ["slack" if point["slack"] else "taut"] + (["overstretched"] if point["overstretched"] else [])
    force = f"activation {point['activation']:g}" if biological else with_unit(point["pressure"], "Pa")
    table(f"{title}, at {with_unit(point['length'], 'm')} and {force}: {', '.join(words)}", ["", ""], rows, right=[1])


def _print_points(points: list[dict[str, Any]], title: str, biological: bool, band: str) -> None:
    drive = "activation" if biological else "pressure"
    units = {"length": "m", drive: "1" if biological else "Pa", "tension": "N"}
    units |= {"tension_low": "N", "tension_high": "N"} if "tension_low" in points[0] else {}
    units |= {"volume": "m^3", "stiffness": "N/m"}
    words = {"tension_low": f"{band}: from", "tension_high": "to"}
    heads = [words.get(name, name) + ("" if unit == "1" else f", {shown_unit(unit)}") for name, unit in units.items()]
    rows = []
    for point in points:
        numbers = [from_si(point[name], unit, shown_unit(unit)) for name, unit in units.items()]
        states = ["slack"] * point["slack"] + ["overstretched"] * point["overstretched"]
        rows.append([*("" if number != number else f"{number:.4g}" for number in numbers), ", ".join(states)])
    table(title, [*heads, ""], rows, right=range(len(heads)))


def _resolve(name: str, law: str | None, change: list[str] | None) -> tuple[Specimen | None, str, Any]:
    """The specimen, None if a law is named; the name of the law, and the muscle."""
    if name in muscles.laws.LAWS:
        if law is not None:
            raise InputError("--law", None, f"is allowed only with a specimen; {name} is a law itself")
        return None, name, _named_law(name, parameters(change, name))
    spec = muscle_specimen(name)
    if spec.kind == "valve":
        raise InputError("specimen", spec.id, "must be a muscle; it is a valve")
    chosen = chosen_law(law, spec)
    if spec.kind == "biological":
        return spec, chosen, _law(spec, chosen, {})
    changes: dict[str, Any] = dict(parameters(change, chosen, of=spec))
    muscle = muscles.build.muscle(spec, law=chosen, **changes)
    return muscle.specimen, chosen, muscle.law  # perhaps cut to another length


def _named_law(name: str, parameters: dict[str, float]) -> Any:
    """Build a law by its name with given parameters, without any specimen."""
    missing = muscles.build.missing_parameters(name, parameters)
    if missing:
        words = " ".join(f"--set {key}={placeholder(q.unit)}" for key, q in missing)
        stated = [s.id for s in specimens() if name in s.laws]
        others = f" or name a specimen that states this law with --law {name}: {', '.join(stated)}" if stated else ""
        needs = muscles.build.needed_words(missing)
        sentence = f"The law {name} needs {needs}. Give {'it' if len(missing) == 1 else 'them'} with {words},{others}"
        raise InputError(f"{name}.{missing[0][0]}", "not given", f"give {words}", sentence=sentence.rstrip(","))
    return muscles.build.build_law(name, parameters)


def parameters(words: Iterable[str] | None, law: str, of: Specimen | None = None) -> dict[str, float]:
    """Parse ``--set`` arguments to parameters of a law [SI], and of a specimen; a bare number is taken as SI."""
    known = declared(muscles.laws.law_type(law))
    known |= {} if of is None else {"rest_length": muscles.dimensions.REST_LENGTH}  # which its law need not have
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
    return muscles.build.built_muscle(spec, law=law, **changes).law


def _activations(activation: str | None, pressure: str | None, spec: Specimen) -> list[float]:
    """Activations of the options [1]."""
    if pressure is not None:
        raise InputError("--pressure", pressure, f"{spec.id} is a biological muscle; give --activation from 0 to 1")
    if activation is None:
        raise InputError(
            "--activation", None, f"is missing: {spec.id} is a biological muscle, which needs one from 0 to 1"
        )
    drives = several(activation, "1", "--activation")
    if not all(0.0 <= value <= 1.0 for value in drives):
        raise InputError("--activation", activation, "must be between 0 and 1")
    return drives


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
        raise InputError("--out", spec.id, "curves are drawn for McKibben muscles only")
    style.save(muscle_figures.law_curves(law, title=spec.title), path)
