"""``energy``: input, output and losses of a muscle's working cycle."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from .. import components
from .. import muscles as muscle_models
from ..analysis import energy as cycle_energy
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import from_si, parse, with_unit
from ..report.figures import energy_figures, style
from ..specimens import Specimen, specimen
from ._terminal import PICTURES, FigureLook, FigureWidth, Json, Set, caution, chosen_law, print_json, table, writable
from .muscles import parameters

if TYPE_CHECKING:
    from ..analysis.energy import CycleMuscle, EnergyCurve, EnergyCycle


LOSSES = ("friction", "throttling", "exhaust", "emptying", "slackening", "unaccounted")
CURVE_POINTS = 91


class CycleRequest(NamedTuple):
    """The options of one call, resolved: specimen, name of its law, the muscle under each volume, and conditions."""

    spec: Specimen
    law: str
    muscles: dict[str, CycleMuscle]
    volume: str
    conditions: cycle_energy.Conditions
    names: list[str]


def energy(
    name: Annotated[str, typer.Argument(metavar="SPECIMEN", help="Id of a specimen, or the .toml file of one.")],
    pressure: Annotated[str, typer.Option(help="Gauge pressure of the supply, such as '5 bar'.")],
    cycle: Annotated[
        list[str] | None,
        typer.Option("--cycle", help="Cycle to compute: maximal, isotonic or valve; repeatable, all three by default."),
    ] = None,
    accumulator: Annotated[
        bool, typer.Option("--accumulator", help="Exchange air with an accumulator at the threshold pressure.")
    ] = False,
    accumulator_pressure: Annotated[
        str | None, typer.Option(help="Exchange air with an accumulator at this gauge pressure.")
    ] = None,
    no_friction: Annotated[bool, typer.Option("--no-friction", help="Compute the cycles without friction.")] = False,
    friction: Annotated[
        str | None, typer.Option(help="Coulomb friction while shortening; by default as the specimen states it.")
    ] = None,
    reading: Annotated[
        str, typer.Option(help="Where friction acts in the isotonic cycles: printed (output only) or throughout.")
    ] = "printed",
    volume: Annotated[
        str | None,
        typer.Option(
            help="Gas volume: paper (eq. 38b) or potential (the law's own); paper by default where the law has it."
        ),
    ] = None,
    stretched: Annotated[
        str | None, typer.Option(help="Length at which cycles begin; by default the upper working length.")
    ] = None,
    ambient: Annotated[str | None, typer.Option(help="Absolute pressure of the surroundings, such as '1 bar'.")] = None,
    law: Annotated[str | None, typer.Option("--law", help="Law to use instead of the specimen's default.")] = None,
    change: Set = None,
    curve: Annotated[
        bool,
        typer.Option("--curve", help="Also compute efficiency over pressure, from the threshold to twice --pressure."),
    ] = False,
    figure: Annotated[
        Path | None,
        typer.Option("--figure", help="Draw the loops, or with --curve the efficiency: SVG, PDF or PNG file."),
    ] = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    as_json: Json = False,
) -> None:
    """Compute input, output and efficiency of a muscle's working cycles."""
    writable("--figure", figure, *PICTURES)
    spec, chosen, muscles, which = _muscles(name, law, change, volume)
    between = _conditions(
        spec,
        muscles[which],
        pressure,
        stretched,
        ambient,
        exchange=_exchange(accumulator, accumulator_pressure, muscles[which], chosen),
        friction=_friction(spec, friction, none=no_friction),
        reading=reading,
    )
    asked = CycleRequest(spec, chosen, muscles, which, between, _names(cycle))
    cycles = {n: {v: cycle_energy.energy_cycle(m, n, between) for v, m in muscles.items()} for n in asked.names}
    warnings = _cautions(spec, muscles[which], between, pressure, stretched)
    curves = {n: _curve(asked, n) for n in asked.names} if curve else {}
    if figure is not None:
        _draw(asked, curves, figure)
    if as_json:
        print_json(_json(asked, cycles, curves) | {"warnings": warnings})
    else:
        _print(asked, cycles, curves)


def _cautions(
    spec: Specimen, muscle: CycleMuscle, between: cycle_energy.Conditions, pressure: str, stretched: str | None
) -> list[str]:

    longest = float(muscle.length_range()[1])
    return caution(
        muscle_models.plausible.pressure_caution(between.pressure, spec, text=pressure),
        None
        if stretched is None
        else muscle_models.plausible.length_caution(
            between.stretched_length, longest, text=stretched, name="stretched length"
        ),
    )


def _names(cycle: list[str] | None) -> list[str]:

    for name in cycle or []:
        if name not in cycle_energy.CYCLES:
            raise InputError("--cycle", name, known=cycle_energy.CYCLES)
    return list(dict.fromkeys(cycle or cycle_energy.CYCLES))


def _muscles(
    name: str, law: str | None, change: list[str] | None, volume: str | None
) -> tuple[Specimen, str, dict[str, CycleMuscle], str]:
    """Specimen, name of its law, the muscle with each available volume, and the name of the requested volume."""
    spec = specimen(name)
    chosen = chosen_law(law, spec)
    if volume == "":
        raise InputError("--volume", volume, "must be the name of a volume")
    chosen, muscles = cycle_energy.cycles.cycle_muscles(
        spec, chosen, volume or "", parameters(change, chosen) if change else None
    )
    return spec, chosen, muscles, next(iter(muscles))


def _conditions(
    spec: Specimen, muscle: CycleMuscle, pressure: str, stretched: str | None, ambient: str | None, **more: Any
) -> cycle_energy.Conditions:

    around = cycle_energy.cycles.surroundings(spec)
    if ambient is not None:
        around = components.Environment(pressure_abs=parse(ambient, "Pa", field="--ambient"))
    between = cycle_energy.Conditions(
        pressure=parse(pressure, "Pa", field="--pressure"),
        stretched_length=_stretched(spec, muscle, stretched),
        ambient=around,
        exchange_pressure=more["exchange"],
        friction=more["friction"],
        reading=more["reading"],
    )
    between.check(muscle)
    return between


def _stretched(spec: Specimen, muscle: CycleMuscle, text: str | None) -> float:
    """Length at the start of cycles [m], below that of the threads if the specimen states it."""
    if text is None:
        return cycle_energy.cycles.stretched_length(spec, muscle)
    length = parse(text, "m", field="--stretched")
    cycle_energy.cycles.check_threads(spec, length, field="--stretched", shown=text)
    return length


def _exchange(wanted: bool, text: str | None, muscle: CycleMuscle, law: str) -> float:

    if text is not None and wanted:
        raise InputError(
            "--accumulator-pressure", None, "is allowed only without --accumulator, which is at the threshold"
        )
    if text is not None:
        return parse(text, "Pa", field="--accumulator-pressure")
    cure = "--accumulator-pressure with one, such as '0.9 bar'"
    return cycle_energy.cycles.at_threshold(muscle, law, field="--accumulator", cure=cure) if wanted else 0.0


def _friction(spec: Specimen, text: str | None, *, none: bool) -> float:

    if none and text is not None:
        raise InputError("--friction", None, "is allowed only without --no-friction")
    if none:
        return 0.0
    if text is not None:
        return parse(text, "N", field="--friction")
    return cycle_energy.cycles.coulomb_friction(spec)


def _curve(asked: CycleRequest, name: str) -> EnergyCurve:

    muscle, between = asked.muscles[asked.volume], asked.conditions
    at = cycle_energy.cycles.pressures(muscle, between, 2.0 * between.pressure, CURVE_POINTS - 1)
    return cycle_energy.energy_curve(muscle, name, at, between)


def _draw(asked: CycleRequest, curves: dict[str, EnergyCurve], path: Path) -> None:

    if curves:
        drawn = [energy_figures.EfficiencyLine(n, c) for n, c in curves.items()]
        fig = energy_figures.efficiency_figure(drawn, title=asked.spec.title)
    else:
        muscle = asked.muscles[asked.volume]
        loops = [cycle_energy.cycle_loops(muscle, n, asked.conditions) for n in asked.names]
        fig = energy_figures.loops_figure(loops, title=asked.spec.title)
    style.save(fig, path)


def _json(
    asked: CycleRequest, found: dict[str, dict[str, EnergyCycle]], curves: dict[str, EnergyCurve]
) -> dict[str, JsonValue]:

    c, cycles = asked.conditions, []
    for name, by in found.items():
        beside = {v: {k: getattr(e, k) for k in ("input", "output", "efficiency")} for v, e in by.items()}
        del beside[asked.volume]
        cycles.append(
            {
                "name": name,
                "title": cycle_energy.CYCLES[name],
                **by[asked.volume]._asdict(),
                "volume": asked.volume,
                "beside": beside,
            }
        )
    return {
        "cycles": cycles,
        "specimen": asked.spec.id,
        "law": asked.law,
        "volume": asked.volume,
        "pressure": c.pressure,
        "exchange_pressure": c.exchange_pressure,
        "ambient_pressure": float(c.ambient.pressure_abs),
        "stretched_length": c.stretched_length,
        "overstretched": _overstretched(asked),
        "friction": c.friction,
        "reading": c.reading,
    } | ({"curves": [_curve_json(v) for v in curves.values()]} if curves else {})


def _curve_json(curve: EnergyCurve) -> dict[str, JsonValue]:
    return {"name": curve.name, "pressure": curve.pressure} | {
        k: getattr(curve.cycles, k) for k in ("input", "output", "efficiency")
    }


def _overstretched(asked: CycleRequest) -> bool:
    return bool(asked.muscles[asked.volume].law.overstretched(asked.conditions.stretched_length))


def _print(asked: CycleRequest, found: dict[str, dict[str, EnergyCycle]], curves: dict[str, EnergyCurve]) -> None:

    c = asked.conditions
    around = with_unit(float(c.ambient.pressure_abs), "Pa", 5)
    source = f"an accumulator at {with_unit(c.exchange_pressure, 'Pa')}" if c.exchange_pressure else "the surroundings"
    title = f"{asked.spec.title}, {asked.law}, at {with_unit(c.pressure, 'Pa')}, air from {source} and back"
    rows = [
        [
            name,
            cycle_energy.CYCLES[name],
            volume,
            f"{e.input:.3f}",
            f"{e.output:.3f}",
            f"{100.0 * e.efficiency:.2f}",
            f"{100.0 * e.shortened_length:.2f}",
            f"{e.load:.1f}",
        ]
        for name, by in found.items()
        for volume, e in by.items()
    ]
    columns = ["cycle", "", "volume", "input, J", "output, J", "efficiency, %", "down to, cm", "load at first, N"]
    table(title, columns, rows, right=[3, 4, 5, 6, 7])
    rows = [
        [name, volume, f"{e.output:.3f}", *(f"{round(getattr(e, k), 3) + 0.0:.3f}" for k in LOSSES)]
        for name, by in found.items()
        for volume, e in by.items()
    ]
    typer.echo("")
    table("Where the input goes, J", ["cycle", "volume", "output", *LOSSES], rows, right=range(2, 9))
    if curves:
        typer.echo("")
        _print_curves(curves)
    said = f"\nBegins at {with_unit(c.stretched_length, 'm')}, surroundings {around}, friction {with_unit(c.friction, 'N')}."
    isotonic = any(name != "maximal" for name in found) and c.friction
    typer.echo(said + (f" Reading '{c.reading}': {cycle_energy.READINGS[c.reading]}." if isotonic else ""))
    if "paper" in asked.muscles and abs(next(iter(found.values()))["paper"].unaccounted) > 5e-4:
        typer.echo("Unaccounted: eq. 38b moves with the length below the threshold too, where the gas does not pull.")
    if _overstretched(asked):
        most = with_unit(float(asked.muscles[asked.volume].law.length_range()[1]), "m")
        typer.echo(f"Overstretched: the law is made for up to {most}. The stop beyond is left out, as in the paper.")


def _print_curves(curves: dict[str, EnergyCurve]) -> None:

    first = next(iter(curves.values()))
    rows = [
        [f"{from_si(float(p), 'Pa', 'bar'):.3f}", *(f"{100.0 * c.cycles.efficiency[i]:.2f}" for c in curves.values())]
        for i, p in enumerate(first.pressure)
        if i % 6 == 0
    ]
    table("Efficiency over pressure, %", ["bar", *curves], rows, right=range(1 + len(curves)))
