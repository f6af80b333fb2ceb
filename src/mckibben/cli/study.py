"""``study``: questions that the laboratory answers as a whole, with fixed inputs and seeds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .words import Json, print_json, progress, table, told, writable

if TYPE_CHECKING:
    from ..studies.tube_claims import Claim
    from ..studies.tube_study import TubeStudy

study = typer.Typer(
    name="study",
    help="Questions that the laboratory answers as a whole: tube, robot, loops, validation.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


def add_to(app: typer.Typer) -> None:
    """Add these commands to the table."""
    app.add_typer(study)


@study.callback()
def _studies() -> None:
    """Questions that the laboratory answers as a whole, with fixed inputs and seeds."""


@study.command("tube")
def tube(
    quick: Annotated[bool, typer.Option("--quick", help="One seed and the reference with wall heat only.")] = False,
    figure: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw the models and their errors, .svg or .png.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Lumped models of a tube against the distributed one: do the claims hold? Exit code 1 when a target is missed."""
    from ..studies.tube_claims import NOT, PARTLY, claims
    from ..studies.tube_study import QUICK_SEEDS, QUICK_THERMALS, stages, tube_study

    writable("--figure", figure, ".svg", ".png")
    options: dict[str, Any] = {"seeds": QUICK_SEEDS, "thermals": QUICK_THERMALS} if quick else {}
    with progress("tube study", stages(**options)) as advance:
        found = tube_study(**options, progress=advance)
    judged = claims(found)
    if figure is not None:
        from ..report.figures import style
        from ..report.figures.tube_figures import tube_figure

        style.save(tube_figure(found), figure, dpi=130.0)
    if as_json:
        print_json(_as_json(found, judged))
    else:
        _print(found, judged)
    if any(c.source == "target" and c.verdict in (NOT, PARTLY) for c in judged):
        raise typer.Exit(1)


@study.command("robot")
def robot(
    trials: Annotated[list[Path], typer.Argument(metavar="FOLDER..", help="Trials to fit, a folder each.")],
    predict: Annotated[
        list[Path] | None, typer.Option(metavar="FOLDER", help="Trial to predict with what was fitted.")
    ] = None,
    free: Annotated[list[str] | None, typer.Option(metavar="PATH", help="Parameter to fit, instead of all 19.")] = None,
    evaluations: Annotated[int, typer.Option(help="Most evaluations of the circuit.", min=1)] = 40,
    figure: Annotated[Path | None, typer.Option(metavar="FILE", help="Draw measured and predicted.")] = None,
    as_json: Json = False,
) -> None:
    """Fit the air of a jumping robot to some of its jumps, and predict the pressures of others."""
    from ..studies.jumping_robot import robot_plan, robot_study
    from .circuit_fit import fit_json, show_fit

    writable("--figure", figure, ".svg", ".png")
    with told("fitting") as tell:
        found, all_trials = robot_study(trials, predict or [], free=free or (), evaluations=evaluations, progress=tell)
    title = robot_plan().title
    if figure is not None:
        from ..report.figures import circuit_fit_figures, style

        style.save(circuit_fit_figures.overview(found, all_trials, title=title), figure)
    if as_json:
        print_json(fit_json(found))
    else:
        show_fit(found, title)


@study.command("loops")
def loops(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder with the loop and the steps of a DMSP-10-250.")
    ],
    friction: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Friction to try: maxwell_slip, dahl, bouc_wen; the last two if left out."),
    ] = None,
    figure: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Draw loop, width and creep, .svg or .png.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Predict half of a muscle's loop and creep from the other half. Exit code 1 when width or branch order is missed."""
    from ..studies.muscle_loops import SMOOTH, STAGES, loop_study
    from .study_loops import loops_json, show_loops

    writable("--figure", figure, ".svg", ".png")
    with progress("loops", STAGES) as advance:
        found = loop_study(folder, frictions=friction or SMOOTH, progress=advance)
    if figure is not None:
        from ..report.figures import style
        from ..report.figures.loop_figures import loops_figure

        style.save(loops_figure(found), figure)
    if as_json:
        print_json(loops_json(found))
    else:
        show_loops(found)
    if found.swapped or not found.width_holds:
        raise typer.Exit(1)


@study.command("validation")
def validation(
    data: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder of measured data; MCKIBBEN_DATA names it where left out."),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME", help="Data set, such as DMSP-20-300, loops or robot; all where left out."),
    ] = None,
    law: Annotated[list[str] | None, typer.Option(metavar="NAME", help="Law to fit; all where left out.")] = None,
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.md", help="Write the page of the documentation, a figure beside it.")
    ] = None,
    as_json: Json = False,
) -> None:
    """Every tension law against every data set at hand: errors, cross-validation, numbers as published.

    With all data it takes a quarter of an hour or more, two minutes of it for the robot. What is not at hand is named, not
    passed over.
    """
    from ..studies import validation as rooms
    from .study_validation import show_validation, validation_json, write_page

    writable("--out", out, ".md")
    with progress("validation", rooms.stages(only or (), law or ())) as advance:
        found = rooms.validation(data, only=only or (), laws=law or (), progress=advance)
    written = [] if out is None else [str(path) for path in write_page(found, out)]
    if as_json:
        print_json(validation_json(found) | ({"files": written} if written else {}))
        return
    show_validation(found)
    for path in written:
        typer.echo(f"Written: {path}")


def _as_json(found: TubeStudy, judged: list[Claim]) -> dict[str, Any]:
    rows = []
    for thermal, results in found.results.items():
        for r in results:
            rows.append(
                {
                    "thermal": thermal,
                    "model": r.model,
                    "accumulator": r.accumulator,
                    "volume": found.cases[thermal, r.accumulator][0].volume,
                    "rms": r.rms,
                    "lead": r.lead,
                    "fitted": r.fitted,
                    "vessel": r.vessel,
                    "parameters": {name: e._asdict() for name, e in r.parameters.items()},
                    "records": [{"record": c.record, "rms": c.rms, "lead": c.lead} for c in r.comparisons],
                    "warnings": list(r.warnings),
                }
            )
    return {
        "claims": [c._asdict() for c in judged],
        "table": rows,
        "cost": found.cost._asdict() if found.cost else {},
        "waveforms": [{"name": r.name, "seed": r.seed, "sentence": r.sentence()} for r in found.records],
        "hottest": {f"{thermal}, {a}": value for (thermal, a), value in found.hottest.items()},
    }


def _print(found: TubeStudy, judged: list[Claim]) -> None:
    from ..quantities import from_si
    from ..studies.tube_models import models
    from ..studies.tube_records import PERIOD

    waves = [[r.name, r.sentence()] for r in found.records]
    table(f"Gauge pressure in front of the tube, {1.0 / PERIOD:g} samples per second", ["record", "what"], waves)
    for thermal, results in found.results.items():
        typer.echo("")
        rows = [
            [
                models()[r.model].title,
                r.accumulator,
                "fitted" if r.fitted else "transferred" if r.parameters else "as it is",
                f"{from_si(r.rms, 'Pa', 'bar'):.3f}",
                f"{1e3 * r.lead:+.1f}",
                ", ".join(_parameter(n, e) for n, e in r.parameters.items()) if r.fitted else "",
            ]
            for r in results
        ]
        table(
            f"Against the distributed tube, {thermal.replace('_', ' ')}",
            ["model", "accumulator", "", "rms, bar", "lead, ms", "parameters with 95 % intervals"],
            rows,
            right=[3, 4],
        )
    typer.echo("")
    for c in judged:
        typer.echo(f"{c.verdict.upper()}: {c.claim}" + ("" if c.source == "paper" else f" ({c.source})"))
        for name, numbers in c.numbers.items():
            typer.echo(f"  {name.replace('_', ' ')}: {_words(numbers)}")


def _parameter(name: str, e: Any) -> str:
    unit = "" if e.unit == "1" else f" {e.unit}"
    return f"{name} {e.value:.3g} ({e.low:.3g} to {e.high:.3g}){unit}"


def _words(numbers: dict[str, Any]) -> str:
    return ", ".join(_word(name, value) for name, value in numbers.items())


def _word(name: str, value: Any) -> str:
    """A number of a claim as a person reads it; the beginning of its name says what it is."""
    from ..quantities import from_si

    if isinstance(value, str):
        return value
    kind, _, rest = name.partition("_")
    rest = rest.replace("_", " ")
    if not isinstance(value, dict) and not math.isfinite(value):
        return f"{rest} from zero"
    if isinstance(value, dict):
        return f"{rest}: {kind} {value['value']:.3g} ({value['low']:.2g} to {value['high']:.2g}) Pa s/m"
    if kind == "rms":
        return f"{rest} {from_si(value, 'Pa', 'bar'):.3f} bar"
    if kind == "lead":
        return f"lead {rest} {1e3 * value:+.1f} ms"
    if kind == "moved":
        return f"{rest} moves {100.0 * value:+.0f} %"
    if kind == "cutoff":
        return f"cut-off {value / math.pi:.2f} pi rad/s"
    return f"{name.replace('_', ' ')} {value:.2f}"
