"""``next``: the measurement that teaches most about a fitted muscle, or tells two laws apart, within a budget of time."""

from __future__ import annotations

import itertools
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import identification
from ..bench import rig_file
from ..documents import write_text
from ..errors import InputError
from ..quantities import parse, with_unit
from ._outputs import OBJECT, TABLE, OutputKinds, Paths
from ._terminal import Json, Law, caution, print_json, table

if TYPE_CHECKING:
    from ..bench.rig import Rig
    from ..identification.next_points import LawTest, NextExperiment

OUT = OutputKinds(protocol=(".toml",), table=TABLE, result=OBJECT)
MARGIN = 0.95  # of what a rig bears
APART = 3.3  # standard deviations between two laws of which readings find the right one with 95 %


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
    laws: Annotated[
        str | None,
        typer.Option(
            metavar="LAWS",
            help="Two laws of the fit to tell apart, such as gas_spring,linear_threshold, instead of the parameters of one.",
        ),
    ] = None,
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
    $ mckibben next --from fit.json --laws gas_spring,linear_threshold --out next.toml
    """
    if (length is None) != (pressure is None):
        missing = "--pressure" if pressure is None else "--length"
        raise InputError(missing, None, "is missing: a tension is asked for at a length and a pressure")
    for option, value in (("--law", law), ("--length", length)):
        if laws is not None and value is not None:
            raise InputError(option, None, "is allowed only without --laws")
    names = None if laws is None else _two(laws)
    seconds, hold = _time(budget, "--budget", 1.0, 86400.0), _time(wait, "--wait", 0.0, 600.0)
    with OUT.files(out) as files:
        posteriors = [identification.read_posterior(fit, law=name) for name in names or (law,)]
        question = None
        if length is not None and pressure is not None:
            question = parse(length, "m", field="--length"), parse(pressure, "Pa", field="--pressure")
        limits = {"budget": seconds, "wait": hold} | ({} if rig is None else _limits(rig_file.rig(rig)))
        chosen: NextExperiment | LawTest
        try:
            if names is not None:
                chosen = identification.next_points.law_test(posteriors, **limits)
            else:
                chosen = identification.next_points.next_experiment(posteriors[0], question=question, **limits)
        except InputError as error:
            raise error.changed(field=f"--{error.field}") from None
        warnings = caution(None if question is None else posteriors[0].beyond(*question))
        rows, units = _rows(chosen)
        content = _content(chosen, rows) | {"warnings": warnings}
        files.write("protocol", lambda path: write_text(path, chosen.protocol()))
        files.write_rows(rows, units)
        files.write_result(content)
        if as_json:
            print_json(content)
            return
        if isinstance(chosen, identification.next_points.LawTest):
            _print_test(chosen)
        else:
            _print(chosen, asked=question is not None)
        typer.echo("Each point is reached with rising pressure from an empty muscle, and held before it is read.")
        files.say()


def _two(laws: str) -> tuple[str, str]:
    """Names of two laws from the text of an option."""
    names = [name.strip() for name in laws.split(",")]
    if len(names) != 2 or not all(names) or names[0] == names[1]:
        raise InputError("--laws", laws, "must be two laws, such as gas_spring,linear_threshold")
    return names[0], names[1]


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


def _rows(chosen: NextExperiment | LawTest) -> tuple[list[dict[str, float]], dict[str, str]]:
    """A row per point, and the unit of each column."""
    columns = {"length": chosen.length, "pressure": chosen.pressure}
    units = {"length": "m", "pressure": "Pa"}
    if isinstance(chosen, identification.next_points.LawTest):
        for name, tensions in zip(chosen.laws, chosen.tensions, strict=True):
            columns[f"tension_{name}"], units[f"tension_{name}"] = tensions, "N"
        columns["deviations"], units["deviations"] = chosen.deviations, "1"
    values = [column.tolist() for column in columns.values()]
    return [dict(zip(columns, row, strict=True)) for row in zip(*values, strict=True)], units


def _content(chosen: NextExperiment | LawTest, rows: list[dict[str, float]]) -> dict[str, Any]:
    content: dict[str, Any] = {"points": rows, "duration": chosen.duration, "wait": chosen.wait}
    if isinstance(chosen, identification.next_points.LawTest):
        return content | {"laws": list(chosen.laws), "distance": chosen.distance, "recognised": chosen.recognised}
    return content | {
        "information": chosen.information,
        "expected": {
            name: {"now": e._asdict(), "width_left": chosen.expected[name]} for name, e in chosen.intervals.items()
        },
        "tension_deviation": {"now": chosen.deviation[0], "expected": chosen.deviation[1]},
    }


def _title(chosen: NextExperiment | LawTest) -> str:
    return f"The next {len(chosen)} points, {chosen.duration / 60.0:.3g} min of machine time"


def _print(chosen: NextExperiment, *, asked: bool) -> None:
    rows, last = [], 0
    for (length, pressure), repeated in itertools.groupby(zip(chosen.length, chosen.pressure, strict=True)):
        first, last = last + 1, last + len(list(repeated))
        number = str(first) if first == last else f"{first} to {last}"
        rows.append([number, with_unit(float(length), "m"), with_unit(float(pressure), "Pa")])
    table(_title(chosen), ["", "length", "pressure"], rows, right=[0, 1, 2])
    expected = [
        [name, with_unit(e.low, e.unit), with_unit(e.high, e.unit), f"{100.0 * chosen.expected[name]:.0f} %"]
        for name, e in chosen.intervals.items()
    ]
    typer.echo("")
    table("What they teach", ["parameter", "95 % now: from", "to", "width left"], expected, right=[1, 2, 3])
    if not chosen.narrows and not asked:
        typer.echo(
            "No point within the map and the limits separates the parameters from what the law has no parameter for; "
            "the points are those that leave least uncertainty of the tension."
        )
    where = "the tension asked for" if asked else "the tension over the map, rms"
    now, left = chosen.deviation
    typer.echo(f"Standard uncertainty of {where}: {now:.3g} N now, {left:.3g} N expected.")


def _print_test(chosen: LawTest) -> None:
    rows = [
        [str(i), with_unit(row["length"], "m"), with_unit(row["pressure"], "Pa"),
         *(with_unit(row[f"tension_{name}"], "N") for name in chosen.laws), f"{row['deviations']:.2g}"]
        for i, row in enumerate(_rows(chosen)[0], 1)
    ]  # fmt: skip
    first, second = chosen.laws
    heads = ["", "length", "pressure", f"{first} expects", f"{second} expects", "standard deviations apart"]
    table(_title(chosen), heads, rows, right=range(6))
    share = f"{100.0 * chosen.recognised:.3g} %"
    verdict = "These readings tell the laws apart" if chosen.distance >= APART else (
        "No readings within the map, the limits and the budget tell the laws apart"
    )  # fmt: skip
    typer.echo(
        f"{verdict}: {first} and {second} expect them {chosen.distance:.2g} standard deviations apart, of noise, "
        f"discrepancy and parameters. If one of the laws is right, they speak for it with a probability of {share}."
    )
