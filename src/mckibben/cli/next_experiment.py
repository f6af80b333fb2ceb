"""``next``: the measurement that teaches most about a fitted muscle within a budget of machine time."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import identification
from ..bench import rig_file
from ..documents import write_text
from ..errors import InputError
from ..quantities import parse, with_unit
from ._outputs import OBJECT, TABLE, OutputKinds, Paths
from ._terminal import Json, Law, print_json, table

if TYPE_CHECKING:
    from ..bench.rig import Rig
    from ..identification.next_points import NextExperiment

OUT = OutputKinds(protocol=(".toml",), table=TABLE, result=OBJECT)
MARGIN = 0.95  # of what a rig bears


def choose_next(
    fit: Annotated[
        Path,
        typer.Option("--from", metavar="FIT", help="Result of `mckibben fit --posterior --out fit.json`."),
    ],
    rig: Annotated[
        str | None,
        typer.Option("--rig", metavar="RIG", help="Test machine whose lengths, pressures and tensions are the limits."),
    ] = None,
    law: Law = None,
    budget: Annotated[
        str, typer.Option(metavar="TIME", help="Machine time of the measurement, such as '5 min'.")
    ] = "5 min",
    wait: Annotated[
        str, typer.Option(metavar="TIME", help="Hold of each point before its reading, for creep, such as '3 s'.")
    ] = "3 s",
    length: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help="Length at which the tension is asked for, such as '12 cm', instead of the parameters.",
        ),
    ] = None,
    pressure: Annotated[
        str | None,
        typer.Option(metavar="PRESSURE", help="Gauge pressure at which the tension is asked for, such as '3 bar'."),
    ] = None,
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Choose the points of length and pressure that teach most next, and write them as a protocol.

    $ mckibben next --from fit.json --rig modern --budget '5 min' --out next.toml
    """  # fmt: skip
    if (length is None) != (pressure is None):
        missing = "--pressure" if pressure is None else "--length"
        raise InputError(missing, None, "is missing: a tension is asked for at a length and a pressure")
    seconds, hold = _time(budget, "--budget", 1.0, 86400.0), _time(wait, "--wait", 0.0, 600.0)
    with OUT.files(out) as files:
        posterior = identification.read_posterior(fit, law=law)
        question = None
        if length is not None and pressure is not None:
            question = parse(length, "m", field="--length"), parse(pressure, "Pa", field="--pressure")
        limits = {} if rig is None else _limits(rig_file.rig(rig))
        try:
            chosen = identification.next_points.next_experiment(
                posterior, budget=seconds, wait=hold, question=question, **limits
            )
        except InputError as error:
            raise error.changed(field=f"--{error.field}") from None
        rows = [
            {"length": a, "pressure": b} for a, b in zip(chosen.length.tolist(), chosen.pressure.tolist(), strict=True)
        ]
        content = _content(chosen, rows)
        files.write("protocol", lambda path: write_text(path, chosen.protocol()))
        files.write_rows(rows, {"length": "m", "pressure": "Pa"})
        files.write_result(content)
        if as_json:
            print_json(content)
            return
        _print(chosen, asked=question is not None)
        files.say()


def _time(text: str, option: str, low: float, high: float) -> float:
    value = parse(text, "s", field=option)
    if not low <= value <= high:
        raise InputError(option, text, f"must be between {low:g} s and {high:g} s")
    return value


def _limits(rig: Rig) -> dict[str, Any]:
    """Lengths [m], pressure [Pa] and tension [N] that a rig bears, with a margin."""
    bearing = [float(rig.interlocks.most_tension)]
    pressures = [float(rig.interlocks.burst_pressure)]
    bearing += [float(rig.sensors["tension"].high)] if "tension" in rig.sensors else []
    pressures += [float(rig.sensors["pressure"].high)] if "pressure" in rig.sensors else []
    return {
        "lengths": (float(rig.shortest), float(rig.longest)),
        "highest_pressure": MARGIN * min(pressures),
        "highest_tension": MARGIN * min(bearing),
    }


def _content(chosen: NextExperiment, rows: list[dict[str, float]]) -> dict[str, Any]:
    return {
        "points": rows,
        "duration": chosen.duration,
        "wait": chosen.wait,
        "information": chosen.information,
        "expected": {
            name: {"now": e._asdict(), "width_left": chosen.expected[name]} for name, e in chosen.intervals.items()
        },
        "tension_deviation": {"now": chosen.deviation[0], "expected": chosen.deviation[1]},
    }


def _print(chosen: NextExperiment, *, asked: bool) -> None:
    rows = [
        [str(i), with_unit(float(length), "m"), with_unit(float(pressure), "Pa")]
        for i, (length, pressure) in enumerate(zip(chosen.length, chosen.pressure, strict=True), 1)
    ]
    title = f"The next {len(chosen)} points, {chosen.duration / 60.0:.3g} min of machine time"
    table(title, ["", "length", "pressure"], rows, right=[0, 1, 2])
    expected = [
        [name, with_unit(e.low, e.unit), with_unit(e.high, e.unit), f"{100.0 * chosen.expected[name]:.0f} %"]
        for name, e in chosen.intervals.items()
    ]
    typer.echo("")
    table("What they teach", ["parameter", "95 % now: from", "to", "width left"], expected, right=[1, 2, 3])
    where = "the tension asked for" if asked else "the tension over the map, rms"
    now, left = chosen.deviation
    typer.echo(f"Standard uncertainty of {where}: {now:.3g} N now, {left:.3g} N expected.")
    typer.echo("Each point is reached with rising pressure from an empty muscle, and held before it is read.")
