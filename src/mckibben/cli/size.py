"""``size``: selection of muscle, valve, tube and gas source for given requirements."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from .. import __version__, identification, muscles
from ..documents import write_text
from ..errors import InputError
from ..quantities import parse
from ..report.figures import sizing_figures, style
from ..specimens import save_specimen
from ..studies import sizing as sizing_package
from ._outputs import FIGURE, OBJECT, SPECIMEN, TABLE, OutputKinds, Paths
from ._progress import told
from ._terminal import FigureLook, FigureWidth, FromPosterior, Json, caution, print_json, table, writable

if TYPE_CHECKING:
    from ..studies.sizing import Sizing


TOP = 5
OUT = OutputKinds(figure=FIGURE, specimen=SPECIMEN, table=TABLE, result=OBJECT)
# Options by the name of the value that is refused, where they are not its own.
OPTIONS = {
    "length": "--space",
    "diameter": "--space",
    "frequency": "--cycles",
    "rate": "--cycles",
    "tube_length": "--tube",
}


def size_muscle(
    stroke: Annotated[str, typer.Option(metavar="LENGTH", help="Stroke, such as '3 cm'.")],
    pressure: Annotated[str, typer.Option(metavar="PRESSURE", help="Gauge pressure, such as '5 bar'.")],
    force: Annotated[
        str | None, typer.Option(metavar="FORCE", help="Force at the end of the stroke, such as '50 N'.")
    ] = None,
    load: Annotated[
        str | None,
        typer.Option(metavar="MASS", help="Mass that hangs on the muscle, instead of a force, such as '5 kg'."),
    ] = None,
    space: Annotated[
        str | None, typer.Option(metavar="LENGTHxDIAMETER", help="Largest size, such as '20 cm x 3 cm'.")
    ] = None,
    speed: Annotated[
        str | None, typer.Option(metavar="SPEED", help="Speed of shortening with that force, such as '10 cm/s'.")
    ] = None,
    cycles: Annotated[
        str | None, typer.Option(metavar="FREQUENCY", help="Frequency of working cycles, such as '1 Hz'.")
    ] = None,
    working_time: Annotated[
        str | None,
        typer.Option(metavar="TIME", help="Time at work each day, such as '8 h', for the energy and air of a day."),
    ] = None,
    tube: Annotated[str, typer.Option(metavar="LENGTH", help="Length of tube between valve and muscle.")] = "50 cm",
    valve: Annotated[
        list[str] | None,
        typer.Option(
            metavar="VALVE",
            help="Valve to try instead of all: a name, a .toml file, or numbers of its catalogue, such as "
            "'Cv=0.3, switching_time=8 ms'.",
        ),
    ] = None,
    battery: Annotated[
        str | None,
        typer.Option(
            metavar="ENERGY", help="Battery of your own for a small compressor and the valve, such as '100 Wh'."
        ),
    ] = None,
    tank: Annotated[
        str | None,
        typer.Option(metavar="TANK", help="Tank of air of your own, such as '2 l at 200 bar'."),
    ] = None,
    muscle: Annotated[
        str | None,
        typer.Option(
            metavar="SPECIMEN",
            help="Candidate, or .toml file of a muscle, for which valves and gas sources are sought.",
        ),
    ] = None,
    from_posterior: FromPosterior = None,
    law: Annotated[
        str, typer.Option(metavar="LAW", help="Law of the braids: linear_threshold, thick_wall or ideal.")
    ] = "linear_threshold",
    no_lines: Annotated[
        bool, typer.Option("--no-lines", help="Leave out valves and tubes, which are simulated.")
    ] = False,
    circuit: Annotated[
        Path | None,
        typer.Option(metavar="OUT", help="Write the chosen muscle, valve and tube as a circuit into this .toml file."),
    ] = None,
    top: Annotated[int, typer.Option(metavar="N", help="Number of rows shown of each table.")] = TOP,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Find the muscle, valve, tube and gas source for a force and a stroke.

    The exit code is 2 when no muscle meets the requirements.

    $ mckibben size --force '50 N' --stroke '3 cm' --pressure '5 bar' --cycles '1 Hz' --working-time '8 h' --out map.svg
    """
    writable("--circuit", circuit, ".toml")
    if top < 1:
        raise InputError("--top", top, "must be 1 or more")
    for option, value in (("--speed", speed), ("--valve", valve), ("--circuit", circuit)):
        if value and no_lines:
            raise InputError(
                option, None, f"is allowed only without --no-lines: a {option[2:]} takes a valve and a tube"
            )
    if from_posterior is not None and muscle is None:
        raise InputError("--from-posterior", None, "is allowed only with --muscle, whose law was fitted")
    samples = None if from_posterior is None else identification.read_posterior(from_posterior)
    parse(pressure, "Pa", field="--pressure")
    with OUT.files(out) as files:
        try:
            with told("sizing", sizing_package.stages(lines=not no_lines, speed=speed is not None)) as tell:
                sizing = sizing_package.size(
                    force=force,
                    load=load,
                    stroke=stroke,
                    pressure=pressure,
                    space=space,
                    speed=speed,
                    rate=cycles,
                    working_time=working_time,
                    tube_length=tube,
                    valve=valve,
                    battery=battery,
                    tank=tank,
                    posterior=samples,
                    law=law,
                    muscle=muscle,
                    lines=not no_lines,
                    progress=tell,
                )
        except InputError as error:
            raise _named(error, pressure) from None
        files.write("figure", lambda path: style.save(sizing_figures.design_map(sizing, law=law), path))
        heading = f"sized by mckibben {__version__}; not measured"
        files.write("specimen", lambda path: save_specimen(sizing.to_specimen(), path, heading=heading))
        if circuit is not None:
            write_text(circuit, sizing_package.toml_of(sizing.to_circuit()))
        content = sizing.to_dict(top) | {"warnings": caution(*sizing.cautions)}
        files.write_rows(
            [
                {key: value for key, value in row.items() if not isinstance(value, dict | list)}
                for row in content["muscles"]
            ]
        )
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            _print(sizing, top)
            files.say()
            if circuit is not None:
                typer.echo(f"Written: {circuit}")
    if not sizing.reached:
        typer.echo(f"mckibben: {sizing.sentence()}", err=True)
        raise typer.Exit(2)


def _named(error: InputError, pressure: str) -> InputError:
    """The error with the option that was typed."""
    field, _, key = error.field.partition(".")
    if error.where is not None and error.where != "valve":
        return error  # in a file
    option = OPTIONS.get(field, f"--{field.replace('_', '-')}") + (f" {key}" if key else "")
    slip = muscles.plausible.likely_pressure(pressure) if field == "pressure" else ""
    return error.changed(field=option, problem=error.problem + slip, where=None)


def _print(sizing: Sizing, top: int) -> None:
    for i, one in enumerate(sizing_package.tables_of(sizing, top)):
        if i:
            typer.echo("")
        table(one.title, one.columns, one.rows, right=range(one.text_columns, len(one.columns)))
        for note in one.notes:
            typer.echo(note)
