"""Commands that this package adds to ``mckibben``: ``export`` and ``conform``. Entry points name them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mckibben.cli._outputs import OBJECT, OutputKinds
from mckibben.cli._terminal import Json, caution, print_json
from mckibben.cli._values import KINDS, specimens, words
from mckibben.cli._verb import VerbCommand
from mckibben.errors import InputError
from mckibben.verbs import ParameterType

KINDS.update(
    {
        "CIRCUIT|SPECIMEN": ParameterType(names=specimens, suffixes=(".toml",)),
        "TARGET": ParameterType(names=words("c")),
        "HOST": ParameterType(names=words("python", "c")),
        "SCENARIO": ParameterType(names=words("isometric", "hang", "slack", "loop", "leak", "joint")),
    }
)

conform = VerbCommand(
    "mckibben_hosts.conformance:conform",
    OutputKinds(result=OBJECT),
    ("conform python --scenario hang --out python.json",),
    options={"scenarios": "scenario"},
    doing=("conforming", lambda given: None),
)


def export_part(
    source: Annotated[
        str, typer.Argument(metavar="CIRCUIT|SPECIMEN", help="Circuit file with muscles, or a muscle with usual air.")
    ],
    target: Annotated[
        str,
        typer.Option(
            "--for", metavar="TARGET", help="Kind of program that takes it: c, fmi3, fmi2, mujoco, warp or ros2."
        ),
    ] = "c",
    name: Annotated[
        str, typer.Option(metavar="TEXT", help="Beginning of all names in C, and name of the files.")
    ] = "muscle_part",
    supply: Annotated[
        str | None,
        typer.Option(metavar="PRESSURE", help="Gauge pressure of the supply of a muscle, '6 bar' by default."),
    ] = None,
    valve: Annotated[
        str | None, typer.Option(metavar="VALVE", help="Valve of a muscle, MPYE-5-1-8-LF by default.")
    ] = None,
    span: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help="Span of every muscle at the start, such as '14 cm'; 0.9 of the rest length by default.",
        ),
    ] = None,
    tendon: Annotated[
        str | None,
        typer.Option(
            metavar="STIFFNESS",
            help="Stiffness of a tendon between each muscle and the mechanism, such as '100 N/mm'; none by default.",
        ),
    ] = None,
    substep: Annotated[str, typer.Option(metavar="TIME", help="Largest step of the muscle's physics.")] = "50 us",
    out: Annotated[
        Path | None,
        typer.Option(metavar="PATH", help="Folder for the files, made where missing, or FMU; --name by default."),
    ] = None,
    as_json: Json = False,
) -> None:
    """Export a muscle with its air as a part of another program: spans in, tensions out.

    $ mckibben export nylon --for c --out nylon_c
    """
    from mckibben.assembly.build import assumption_table

    from .part import part_of
    from .targets import export, export_cautions

    try:
        part = part_of(source, supply=supply, valve=valve, span=span, substep=substep, tendon=tendon)
        files = export(part, target, Path(name) if out is None else out, name=name)
    except InputError as error:
        options = {
            "supply": "--supply",
            "valve": "--valve",
            "tendon": "--tendon",
            "substep": "--substep",
            "target": "--for",
            "name": "--name",
            "out": "--out",
        }
        field = "--span" if error.field.startswith("span") else options.get(error.field, error.field)
        raise error.changed(field=field) from None
    warnings = caution(*export_cautions(part, target))
    masses = part.smallest_masses()
    if as_json:
        print_json(
            {
                "files": [str(path) for path in files],
                "muscles": list(part.muscles),
                "commands": list(part.commands),
                "mounting": part.mounting,
                "assumptions": assumption_table(part.assumptions),
                "smallest_mass_kg": {f"{h!r}": mass for h, mass in masses.items()},
                "warnings": list(warnings),
            }
        )
        return
    for path in files:
        typer.echo(str(path))
    commands = ", ".join(part.commands) or "none"
    typer.echo(f"Muscles {', '.join(part.muscles)}; commands {commands}.")
    typer.echo(f"Held and assumed: {part.statement}.")
    felt = ", ".join(f"{1e3 * mass:.3g} g at {1e3 * h:g} ms" for h, mass in masses.items())
    typer.echo(f"Estimate of the smallest mass at the end of a muscle that an explicit step can move: {felt}.")
