"""``energy``: input, output and losses of a muscle's working cycle."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .. import muscles
from ..analysis import energy as cycle_energy
from ..errors import InputError
from ..quantities import from_si, parse, with_unit
from ..report.figures import energy_figures, style
from ..specimens import muscle_specimen
from ._outputs import FIGURE, OBJECT, TABLE, OutputKinds, Paths
from ._terminal import (
    Contraction,
    FigureLook,
    FigureWidth,
    Json,
    Law,
    Set,
    SpecimenName,
    caution,
    chosen_law,
    print_json,
    table,
)
from .muscles import parameters

if TYPE_CHECKING:
    from ..analysis.energy import EnergyCurve, WorkingCycles

OUT = OutputKinds(figure=FIGURE, table=TABLE, result=OBJECT)
# Argument of `mckibben.energy` -> option that states it, for error messages.
OPTIONS = {
    "pressure": "--pressure", "cycle": "--cycle", "stretched_length": "--stretched", "contraction": "--contraction",
    "accumulator": "--accumulator", "accumulator_pressure": "--accumulator-pressure", "friction": "--friction",
    "volume": "--volume", "reading": "--reading", "ambient": "--ambient",
}  # fmt: skip


def energy(
    name: SpecimenName,
    pressure: Annotated[
        str | None,
        typer.Option(
            metavar="PRESSURE",
            help="Gauge pressure of the supply; '5 bar' by default, less where the specimen's rated pressure is less.",
        ),
    ] = None,
    cycle: Annotated[
        list[str] | None,
        typer.Option("--cycle", metavar="CYCLE", help="Cycle to compute: maximal, isotonic or valve; all by default."),
    ] = None,
    accumulator: Annotated[
        bool, typer.Option("--accumulator", help="Exchange air with an accumulator at the threshold pressure.")
    ] = False,
    accumulator_pressure: Annotated[
        str | None,
        typer.Option(
            metavar="PRESSURE", help="Exchange air with an accumulator at this gauge pressure, such as '1 bar'."
        ),
    ] = None,
    no_friction: Annotated[bool, typer.Option("--no-friction", help="Compute the cycles without friction.")] = False,
    friction: Annotated[
        str | None,
        typer.Option(
            metavar="FORCE",
            help="Coulomb friction while shortening, such as '2.5 N'; by default as the specimen states it.",
        ),
    ] = None,
    reading: Annotated[
        str,
        typer.Option(
            metavar="READING", help="Where friction acts in the isotonic cycles: printed (output only) or throughout."
        ),
    ] = "printed",
    volume: Annotated[
        str | None,
        typer.Option(
            metavar="VOLUME",
            help="Gas volume: paper (eq. 38b) or potential (the law's own); paper by default where the law has it.",
        ),
    ] = None,
    stretched: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH", help="Length at which cycles begin, such as '15 cm'; by default the upper working length."
        ),
    ] = None,
    contraction: Contraction = None,
    ambient: Annotated[
        str | None, typer.Option(metavar="PRESSURE", help="Absolute pressure of the surroundings, such as '1 bar'.")
    ] = None,
    law: Law = None,
    change: Set = None,
    curve: Annotated[
        bool,
        typer.Option("--curve", help="Also compute efficiency over pressure, from the threshold to twice --pressure."),
    ] = False,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Compute input, output and efficiency of a muscle's working cycles.

    $ mckibben energy nylon --pressure '5 bar' --cycle maximal --curve --out efficiency.svg
    """
    if no_friction and friction is not None:
        raise InputError("--friction", None, "is allowed only without --no-friction")
    with OUT.files(out) as files:
        spec = muscle_specimen(name)
        chosen = chosen_law(law, spec)
        try:
            computed = cycle_energy.energy(
                spec,
                pressure=None if pressure is None else parse(pressure, "Pa", field="--pressure"),
                cycles=cycle or tuple(cycle_energy.CYCLES),
                law=chosen,
                parameters=parameters(change, chosen) if change else None,
                volume=volume,
                stretched_length=stretched,
                contraction=contraction,
                accumulator=accumulator,
                accumulator_pressure=accumulator_pressure,
                friction="0 N" if no_friction else friction,
                reading=reading,
                ambient=ambient,
                curves=curve,
            )
        except InputError as error:
            raise error.changed(field=OPTIONS.get(error.field, error.field)) from None
        warnings = _cautions(computed, pressure, stretched)
        files.write("figure", lambda path: _draw(computed, path))
        files.write_rows(computed.rows(), _units())
        content = computed.to_dict() | {"warnings": warnings}
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            _print(computed)
            files.say()


def _units() -> dict[str, str]:
    """SI units of the columns of a table of cycles."""
    energies = ("input", "output", "compression", "delivery", *cycle_energy.LOSSES)
    lengths = {"shortened_length": "m", "taut_length": "m"}
    volumes = {"shortened_volume": "m^3", "stretched_volume": "m^3"}
    return dict.fromkeys(energies, "J") | lengths | volumes | {"load": "N", "start_pressure": "Pa"}


def _cautions(computed: WorkingCycles, pressure: str | None, stretched: str | None) -> list[str]:
    longest = float(computed.muscles[computed.volume].length_range()[1])
    between = computed.conditions
    return caution(
        *(str(one) for one in muscles.evidence.law_cautions(computed.specimen, computed.law)),
        muscles.plausible.pressure_caution(between.pressure, computed.specimen, text=pressure),
        None
        if stretched is None
        else muscles.plausible.length_caution(
            between.stretched_length, longest, text=stretched, name="stretched length"
        ),
    )


def _draw(computed: WorkingCycles, path: Path) -> None:
    title = computed.specimen.title
    if computed.curves:
        drawn = [energy_figures.EfficiencyLine(n, c) for n, c in computed.curves.items()]
        fig = energy_figures.efficiency_figure(drawn, title=title)
    else:
        fig = energy_figures.loops_figure(computed.loops(), title=title)
    style.save(fig, path)


def _print(computed: WorkingCycles) -> None:
    c, cycles, curves = computed.conditions, computed.cycles, computed.curves
    around = with_unit(float(c.ambient.pressure_abs), "Pa", 5)
    source = f"an accumulator at {with_unit(c.exchange_pressure, 'Pa')}" if c.exchange_pressure else "the surroundings"
    title = f"{computed.specimen.title}, {computed.law}, at {with_unit(c.pressure, 'Pa')}, air from {source} and back"
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
        for name, by in cycles.items()
        for volume, e in by.items()
    ]
    columns = ["cycle", "", "volume", "input, J", "output, J", "efficiency, %", "down to, cm", "load at first, N"]
    table(title, columns, rows, right=[3, 4, 5, 6, 7])
    rows = [
        [name, volume, f"{e.output:.3f}", *(f"{round(getattr(e, k), 3) + 0.0:.3f}" for k in cycle_energy.LOSSES)]
        for name, by in cycles.items()
        for volume, e in by.items()
    ]
    typer.echo("")
    table("Where the input goes, J", ["cycle", "volume", "output", *cycle_energy.LOSSES], rows, right=range(2, 9))
    if curves:
        typer.echo("")
        _print_curves(curves)
    said = f"\nBegins at {with_unit(c.stretched_length, 'm')}, surroundings {around}, friction {with_unit(c.friction, 'N')}."
    isotonic = any(name != "maximal" for name in cycles) and c.friction
    typer.echo(said + (f" Reading '{c.reading}': {cycle_energy.READINGS[c.reading]}." if isotonic else ""))
    if "paper" in computed.muscles and abs(next(iter(cycles.values()))["paper"].unaccounted) > 5e-4:
        typer.echo("Unaccounted: eq. 38b moves with the length below the threshold too, where the gas does not pull.")
    if computed.overstretched:
        most = with_unit(float(computed.muscles[computed.volume].law.length_range()[1]), "m")
        typer.echo(f"Overstretched: the law is made for up to {most}. The stop beyond is left out, as in the paper.")


def _print_curves(curves: Mapping[str, EnergyCurve]) -> None:

    first = next(iter(curves.values()))
    rows = [
        [f"{from_si(float(p), 'Pa', 'bar'):.3f}", *(f"{100.0 * c.cycles.efficiency[i]:.2f}" for c in curves.values())]
        for i, p in enumerate(first.pressure)
        if i % 6 == 0
    ]
    table("Efficiency over pressure, %", ["bar", *curves], rows, right=range(1 + len(curves)))
