"""``conform``: how well a host steps a mechanism with muscles in it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from ..errors import InputError
from ._outputs import OBJECT, OutputKinds, Paths
from ._terminal import Json, note, print_json, table

if TYPE_CHECKING:
    from ..hosts.conformance import Certificate

OUT = OutputKinds(certificate=OBJECT)


def conform_host(
    host: Annotated[
        str,
        typer.Argument(
            metavar="HOST",
            help="Host to test: python, c, mujoco, mujoco-python, warp, newton, drake, opensim, fmi3, fmi2 or libcosim.",
        ),
    ],
    scenario: Annotated[
        list[str] | None,
        typer.Option(
            metavar="SCENARIO",
            help="Scenario to run instead of all: isometric, hang, slack, loop, leak, joint or tank.",
        ),
    ] = None,
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Test a host of muscles: errors, order, work at the border, saved states, smallest mass and speed.

    The exit code is 1 when a limit is not met.

    $ mckibben conform python --scenario hang --out python.json
    """
    from ..hosts.conformance import conform

    with OUT.files(out) as files:
        try:
            certificate = conform(host, scenarios=scenario or None, progress=note)
        except InputError as error:
            raise (error.changed(field="--scenario") if error.field == "scenario" else error) from None
        for path in files["certificate"]:
            certificate.save(path)
        if as_json:
            print_json(certificate.document())
        else:
            _show(certificate)
            files.say()
    if not certificate.holds:
        raise typer.Exit(1)


def _show(certificate: Certificate) -> None:
    content: dict[str, Any] = certificate.content
    typer.echo(f"{content['title']}; {content['version']}; {'staggered' if content['staggered'] else 'synchronous'}")
    rows = []
    for name, measured in content["scenarios"].items():
        for period, row in measured["steps"].items():
            factor, unit = (57.29577951308232, "deg") if measured["rotary"] else (1e3, "mm")
            rows.append(
                [
                    name,
                    f"{1e3 * float(period):g} ms",
                    f"{factor * row['position_error']:.3f} {unit}" if "position_error" in row else "given",
                    f"{row['tension_error']:.3f} N",
                    f"{1e-2 * row['pressure_error']:.2f} mbar",
                    f"{1e3 * row['gap_J']:.2f} mJ",
                ]
            )
    columns = ["scenario", "step", "position", "mean tension", "pressure", "gap of work"]
    table("Largest differences from the same system integrated as one", columns, rows, right=range(1, 6))
    judged = [
        [
            v.what,
            f"{v.value:.3g} {_unit(v.unit)}",
            f"{v.limit:.3g} {_unit(v.unit)}",
            "holds" if v.holds else "is missed",
        ]
        for v in certificate.verdicts
    ]
    table("Limits", ["", "measured", "limit", ""], judged, right=(1, 2))
    if "steps_per_s" in content:
        masses = ", ".join(
            f"{'none' if m is None else f'{1e3 * m:.3g} g'} at {1e3 * float(h):g} ms"
            for h, m in content["smallest_mass_kg"].items()
        )
        typer.echo(f"Smallest mass at the end of a muscle: {masses}.")
        typer.echo(f"{content['steps_per_s']:g} steps of 1 ms in a second, with one muscle.")
    for sentence in content["caveats"]:
        typer.echo(sentence)


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit
