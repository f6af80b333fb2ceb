"""``size``: selection of muscle, valve, tube and gas source for given requirements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import muscles
from ..errors import InputError
from ..quantities import parse, with_unit
from ..report.figures import sizing_figures, style
from ..studies import sizing as sizing_package
from ._terminal import Json, caution, print_json, table, told, writable

if TYPE_CHECKING:
    from ..studies.sizing import Judged, LineResult, Sizing


TOP = 5


def size_muscle(
    force: Annotated[str, typer.Option(help="Force at the end of the stroke, such as '50 N'.")],
    stroke: Annotated[str, typer.Option(help="Stroke, such as '3 cm'.")],
    pressure: Annotated[str, typer.Option(help="Gauge pressure, such as '5 bar'.")],
    space: Annotated[
        str | None, typer.Option(metavar="LENGTHxDIAMETER", help="Largest size, such as '20 cm x 3 cm'.")
    ] = None,
    speed: Annotated[str | None, typer.Option(help="Speed of shortening with that force, such as '10 cm/s'.")] = None,
    cycles: Annotated[str | None, typer.Option(help="Frequency of working cycles, such as '1 Hz'.")] = None,
    tube: Annotated[str, typer.Option(help="Length of tube between valve and muscle.")] = "50 cm",
    law: Annotated[
        str, typer.Option(metavar="NAME", help="Law of the braids: linear_threshold, thick_wall or ideal.")
    ] = "linear_threshold",
    muscle: Annotated[
        str | None,
        typer.Option(
            metavar="ID", help="Candidate, or .toml file of a muscle, for which valves and gas sources are sought."
        ),
    ] = None,
    no_lines: Annotated[
        bool, typer.Option("--no-lines", help="Leave out valves and tubes, which are simulated.")
    ] = False,
    top: Annotated[int, typer.Option(help="Number of rows shown of each table.")] = TOP,
    figure: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw force over stroke, and the lines, .svg or .png.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Find the muscle, valve, tube and gas source for a force and a stroke.

    The exit code is 2 when no muscle meets the requirements.
    """
    writable("--figure", figure, ".svg", ".png")
    if top < 1:
        raise InputError("--top", top, "must be 1 or more")
    wish = _wish(force, stroke, pressure, space, speed, cycles, tube)
    if speed is not None and no_lines:
        raise InputError("--speed", None, "is allowed only without --no-lines: a speed takes a valve and a tube")
    warnings = caution(muscles.plausible.pressure_caution(wish.pressure, text=pressure))
    with told("sizing") as tell:
        sizing = sizing_package.size(wish, law=law, muscle=muscle, lines=not no_lines, progress=tell)
    if figure is not None:
        style.save(sizing_figures.design_map(sizing, law=law), figure, dpi=130.0)
    if as_json:
        print_json(_as_json(sizing, top) | {"warnings": warnings})
    else:
        _print(sizing, top)
        if figure is not None:
            typer.echo(f"\nWritten: {figure}")
    if not sizing.reached:
        typer.echo(f"mckibben: {sizing.sentence()}", err=True)
        raise typer.Exit(2)


def _wish(
    force: str, stroke: str, pressure: str, space: str | None, speed: str | None, cycles: str | None, tube: str
) -> sizing_package.Requirements:

    length, diameter = _space(space)

    def value(text: str | None, unit: str, option: str) -> float | None:
        return None if text is None else parse(text, unit, field=option)

    try:
        return sizing_package.Requirements(
            force=parse(force, "N", field="--force"),
            stroke=parse(stroke, "m", field="--stroke"),
            pressure=parse(pressure, "Pa", field="--pressure"),
            length=length,
            diameter=diameter,
            speed=value(speed, "m/s", "--speed"),
            frequency=value(cycles, "Hz", "--cycles"),
            tube_length=parse(tube, "m", field="--tube"),
        )
    except InputError as error:
        option = _OPTIONS.get(error.field)
        slip = muscles.plausible.likely_pressure(pressure) if option == "--pressure" else ""
        raise (error.changed(field=option, problem=error.problem + slip) if option else error) from None


_OPTIONS = {
    "force": "--force",
    "stroke": "--stroke",
    "pressure": "--pressure",
    "length": "--space",
    "diameter": "--space",
    "speed": "--speed",
    "frequency": "--cycles",
    "tube_length": "--tube",
}


def _space(text: str | None) -> tuple[float | None, float | None]:
    """Parse length and diameter from ``20 cm x 3 cm`` [m]; the length alone if there is no x."""
    if text is None:
        return None, None
    parts = [part.strip() for part in text.replace("\N{MULTIPLICATION SIGN}", "x").split("x")]
    if len(parts) > 2 or not all(parts):
        raise InputError("--space", text, "must be a length and a diameter, such as '20 cm x 3 cm', or a length")
    sizes = [parse(part, "m", field="--space") for part in parts]
    return sizes[0], sizes[1] if len(sizes) > 1 else None


def _as_json(found: Sizing, top: int) -> dict[str, Any]:
    from dataclasses import asdict

    return {
        "reached": found.reached,
        "wish": found.wish.parts(),
        "muscles": [_muscle_json(m) for m in found.muscles[:top]],
        "chosen": found.chosen.muscle.id,
        "misses": [
            {"part": m.part, "asked": m.asked, "reachable": m.reachable, "sentence": m.sentence()} for m in found.misses
        ],
        "lines": [asdict(line) for line in found.lines[:top]],
        "lengths": [asdict(line) for line in found.lengths[:top]],
        "sources": [asdict(one) for one in found.sources],
        "piston": {k: None if v is None else {"input": v[0], "output": v[1]} for k, v in found.piston.items()},
        "sentence": None if found.reached else found.sentence(),
    }


def _muscle_json(one: Judged) -> dict[str, Any]:
    m = one.muscle
    return {
        "id": m.id,
        "title": m.title,
        "kind": m.kind,
        "law": m.law_name,
        "verdict": one.verdict,
        "error": {"share": m.error.share, "force": one.error_force, "kind": m.error.kind, "source": m.error.source},
        "end_force": one.end_force,
        "promised_force": one.promised_force,
        "largest_force": one.largest_force,
        "passive": one.passive,
        "stroke": one.stroke,
        "speed": one.speed,
        "friction": m.friction,
        "longest": m.longest,
        "overall_length": m.overall_length,
        "diameter": m.diameter,
        "mass": m.mass,
        "air": one.air,
        "margins": dict(one.margins),
        "nominal": dict(one.nominal),
        "dimensions": dict(m.dimensions),
        "inferred": list(m.inferred),
        "sources": list(m.sources),
    }


# ---- for a person


def _print(found: Sizing, top: int) -> None:

    wish = found.wish
    words = ", ".join(f"{n.replace('_', ' ')} {with_unit(v, _UNITS[n], 3)}" for n, v in wish.parts().items())
    rows = [_muscle_row(one) for one in found.muscles[:top]]
    columns = [
        "muscle",
        "does it",
        "promised, N",
        "law says, N",
        "error",
        "force",
        "stroke",
        "length",
        "diameter",
        "speed",
        "long, cm",
        "wide, mm",
        "mass, g",
        "air, mg",
    ]
    table(f"Muscles for {words} (margins beyond the error of the law)", columns, rows, right=range(2, 14))
    braid = next((m for m in found.muscles[:top] if m.muscle.kind == "braid"), None)
    if braid is not None:
        typer.echo(_braid_words(braid))
    if not found.reached:
        for miss in found.misses:
            typer.echo(f"What would do: {miss.sentence()}" if miss.reachable else f"Not by itself: {miss.part}")
    if found.lines:
        typer.echo("")
        rows = [_line_row(one) for one in found.lines[:top]]
        table(f"Valves and tubes for {found.chosen.muscle.id}", _LINE_COLUMNS, rows, right=range(2, 11))
        typer.echo("best: no other line is as good in time, mass, power, air and flexibility of its tube at once.")
        late = [f"{one.valve} with {one.tube}" for one in found.lines[:top] if not one.settled]
        if late:
            said = "their times are" if len(late) > 1 else "its times are"
            typer.echo(f"The tension has not settled behind {', '.join(late)}: {said} of a step under way.")
    if found.lengths:
        typer.echo("")
        order = sorted(found.lengths, key=lambda x: (x.tube, x.tube_length))
        rows = [[x.tube, with_unit(x.tube_length, "m"), *_times(x), f"{1e6 * x.air:.0f}"] for x in order]
        columns = ["tube", "length", "to force, ms", "rise, ms", "fall, ms", "air, mg"]
        table(f"{found.lengths[0].valve} behind other tubes", columns, rows, right=range(1, 6))
    if not found.sources:
        return
    typer.echo("")
    columns = ["gas source", "J a cycle", "efficiency, %", "cycles", "lasts", "mass, kg", ""]
    rows = [_source_row(s) for s in found.sources]
    table(f"Gas sources for {found.chosen.muscle.id}", columns, rows, right=range(1, 6))
    typer.echo(_piston_words(found))


_LINE_COLUMNS = [
    "valve",
    "tube",
    "to force, ms",
    "rise, ms",
    "fall, ms",
    "valve, g",
    "W",
    "bend, N cm2",
    "air, mg",
    "leak, mg/s",
    "speed, cm/s",
    "best",
]
_SHOWN = ("force", "stroke", "length", "diameter", "speed")
_UNITS = {
    "force": "N",
    "stroke": "m",
    "pressure": "Pa",
    "length": "m",
    "diameter": "m",
    "speed": "m/s",
    "frequency": "Hz",
    "tube_length": "m",
}


def _muscle_row(one: Judged) -> list[str]:
    m = one.muscle
    share = [_percent(one.margins[n]) if n in one.margins else "" for n in _SHOWN]
    mass = "" if m.mass is None else f"{1e3 * m.mass:.3g}"
    return [
        m.id,
        one.verdict,
        f"{one.promised_force:.1f}",
        f"{one.end_force:.1f}",
        f"{m.error.share:.1%}",
        *share,
        f"{100 * m.overall_length:.1f}",
        f"{1e3 * m.diameter:.1f}",
        mass,
        f"{1e6 * one.air:.0f}",
    ]


def _braid_words(one: Judged) -> str:

    d = one.muscle.dimensions
    return (
        f"{one.muscle.id}: threads of {with_unit(d['thread_length'], 'm')} in {d['turns']:.2f} turns, "
        f"{with_unit(d['diameter_90'], 'm')} wide at 90 degrees; {with_unit(d['braid_angle'], 'rad', 3)} at its longest, "
        f"{with_unit(d['longest_length'], 'm')}, {with_unit(d['end_angle'], 'rad', 3)} at the end; "
        f"rest length {with_unit(d['rest_length'], 'm')}."
    )


def _percent(margin: float) -> str:
    return f"{round(margin, 2) + 0.0:+.0%}"


def _times(x: LineResult) -> list[str]:
    return [_ms(x.to_force), _ms(x.rise), _ms(x.fall)]


def _ms(value: float | None) -> str:
    return "never" if value is None else f"{1e3 * value:.1f}"


def _line_row(x: LineResult) -> list[str]:
    speed = "" if x.speed is None else f"{100 * x.speed:.0f}"
    return [
        x.valve,
        x.tube,
        *_times(x),
        f"{1e3 * x.valve_mass:.0f}",
        f"{x.power:.1f}",
        f"{1e4 * x.stiffness:.1f}",
        f"{1e6 * x.air:.0f}",
        f"{1e6 * x.leak:.0f}",
        speed,
        ("*" if x.pareto else "") + ("" if x.keeps_up else " too slow"),
    ]


def _source_row(s: Any) -> list[str]:
    lasts = "" if s.run_time is None else f"{s.run_time / 60.0:.3g} min"
    return [
        s.title,
        f"{s.energy:.3g}",
        f"{100 * s.efficiency:.1f}",
        "" if s.cycles is None else str(s.cycles),
        lasts,
        "" if s.mass is None else f"{s.mass:.3g}",
        ("" if s.able else "no: ") + s.note,
    ]


def _piston_words(found: Sizing) -> str:
    plain, again = found.piston["surroundings"], found.piston["accumulator"]
    if plain is None:
        return "The paper's cycle of maximal shortening is not possible with this muscle."
    said = f"The paper's cycle of maximal shortening: {plain[0]:.2f} J in, {plain[1]:.2f} J out"
    if again is None:
        return said + "; without a threshold there is no accumulator to go back to."
    return said + f"; with an accumulator at the threshold {again[0]:.2f} J in, {again[1]:.2f} J out."
