"""``study``: complete studies of one question each, with fixed inputs and seeds."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import identification
from .._version import __version__
from ..documents import JsonValue, write_text
from ..errors import InputError
from ..quantities import from_si
from ..report.figures import ranking_figures, run_figures, study_figures, style
from ..studies import jumping_robot, muscle_loops, tube_models, validation, validation_page
from ..studies import tube_study as tubes
from ._outputs import FIGURE, OBJECT, OutputKinds, Paths
from ._progress import progress, told
from ._terminal import FigureLook, FigureWidth, Json, print_json, table
from .circuit import circuit_fit_json, show_circuit_fit

if TYPE_CHECKING:
    from collections.abc import Sequence

    from ..estimation import Estimate
    from ..identification import Fit
    from ..studies.muscle_loops import LoopStudy, StepCreep, Width
    from ..studies.tube_study import Claim, TubeStudy
    from ..studies.validation import StaticResult, Validation

OUT = OutputKinds(figure=FIGURE, result=OBJECT)
PAGE = OutputKinds(page=(".md",), result=OBJECT)


def study_tube(
    quick: Annotated[
        bool, typer.Option("--quick", help="Use one seed, and the reference with wall heat only.")
    ] = False,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Compare lumped models of a tube with the distributed one, claim by claim.

    The exit code is 1 when a target is missed.

    $ mckibben study tube --quick --out tube.svg
    """
    options: dict[str, Any] = {"seeds": tubes.QUICK_SEEDS, "thermals": tubes.QUICK_THERMALS} if quick else {}
    with OUT.files(out) as files:
        with progress("tube study", tubes.stages(**options)) as advance:
            study = tubes.tube_study(**options, progress=advance)
        judged = tubes.claims(study)
        files.write("figure", lambda path: style.save(study_figures.tube_figure(study), path))
        content = _as_json(study, judged)
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            _print(study, judged)
            files.say()
    if any(c.source == "target" and c.verdict in (tubes.NOT, tubes.PARTLY) for c in judged):
        raise typer.Exit(1)


def study_robot(
    trials: Annotated[list[Path], typer.Argument(metavar="FOLDER", help="Folders of the trials to fit, one each.")],
    predict: Annotated[
        list[Path] | None,
        typer.Option(metavar="FOLDER", help="Trial to predict with the fitted parameters."),
    ] = None,
    each: Annotated[bool, typer.Option("--each", help="Predict each trial by a fit to all the others.")] = False,
    free: Annotated[list[str] | None, typer.Option(metavar="PATH", help="Parameter to fit instead of all 21.")] = None,
    evaluations: Annotated[
        int, typer.Option(metavar="N", min=1, help="Largest number of evaluations of the circuit.")
    ] = 40,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Fit the air of a jumping robot to some of its jumps, and predict the others.

    $ mckibben study robot 0p02_knee_80psi 0p06_65psi --predict 0p09_65psi --out robot.svg
    """
    if each:
        if predict:
            raise InputError("--predict", str(predict[0]), "is allowed only without --each, which predicts every trial")
        _each_from_the_others(trials, free or (), evaluations, out, as_json=as_json)
        return
    with OUT.files(out) as files:
        with told("fitting", evaluations) as tell:
            result, all_trials = jumping_robot.robot_study(
                trials, predict or [], free=free or (), evaluations=evaluations, progress=tell
            )
        title = jumping_robot.robot_plan().title
        files.write("figure", lambda path: style.save(run_figures.overview(result, all_trials, title=title), path))
        content = circuit_fit_json(result)
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            show_circuit_fit(result, title)
            files.say()


def _each_from_the_others(
    trials: list[Path], free: Sequence[str], evaluations: int, out: list[Path] | None, *, as_json: bool
) -> None:
    """Predict each jump from the others, and print the errors of the predictions."""
    with OUT.files(out) as files:
        with told("fitting") as tell:
            folds, every = jumping_robot.robot_folds(trials, free=free, evaluations=evaluations, progress=tell)
        title = jumping_robot.robot_plan().title
        drawn = jumping_robot.merged_folds(folds)
        files.write("figure", lambda path: style.save(run_figures.overview(drawn, every, title=title), path))
        content: dict[str, JsonValue] = {
            "rms": {fold.trial: fold.rms for fold in folds},
            "trials": {fold.trial: circuit_fit_json(fold.fit) for fold in folds},
        }
        files.write_result(content)
        if as_json:
            print_json(content)
            return
        pressures = [c.split(".")[0].replace("_", " ") for c in every[0].channels]
        rows, heads = [], ["predicted from the others", *pressures, "all", "fit to the others"]
        for fold in folds:
            errors = [e.rms for e in fold.fit.errors if not e.fitted]
            rows.append([fold.trial, *(f"{v / 100.0:.0f}" for v in (*errors, fold.rms, fold.fit.rms()))])
        table(f"{title}: rms errors in mbar", heads, rows, right=range(1, len(heads)))
        for fold in folds:
            if not fold.fit.converged:
                typer.echo(f"The search without {fold.trial} did not converge: {fold.fit.message}.")
        files.say()


def study_loops(
    folder: Annotated[
        Path, typer.Argument(metavar="FOLDER", help="Folder with the loop and the steps of a DMSP-10-250.")
    ],
    friction: Annotated[
        list[str] | None,
        typer.Option(
            metavar="FRICTION", help="Friction model to try: maxwell_slip, dahl or bouc_wen; by default the last two."
        ),
    ] = None,
    width: FigureWidth = None,
    look: FigureLook = "screen",
    out: Annotated[Paths, OUT.option()] = None,
    as_json: Json = False,
) -> None:
    """Predict half of a muscle's loop and creep from the other half.

    The exit code is 1 when the width or the order of the branches is missed.

    $ mckibben study loops dmsp_10_250_hysteresis --out loops.svg
    """
    with OUT.files(out) as files:
        with progress("loops", muscle_loops.STAGES) as advance:
            study = muscle_loops.loop_study(
                folder, frictions=friction or identification.hysteresis_fit.SMOOTH, progress=advance
            )
        files.write("figure", lambda path: style.save(study_figures.loop_study_figure(study), path))
        content = loops_json(study)
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            show_loops(study)
            files.say()
    if study.swapped or not study.width_holds:
        raise typer.Exit(1)


def study_validation(
    data: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Folder of measured data; by default the one that MCKIBBEN_DATA names."),
    ] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="DATASET", help="Data set, such as DMSP-20-300, loops or robot; all by default."),
    ] = None,
    law: Annotated[list[str] | None, typer.Option(metavar="LAW", help="Law to fit; all laws by default.")] = None,
    out: Annotated[Paths, PAGE.option(note="The figure of the page is written beside it.")] = None,
    as_json: Json = False,
) -> None:
    """Fit every tension law to every data set, and cross-validate it.

    With all data it takes a quarter of an hour or more, two minutes of it for the robot. Data sets that
    are not at hand are named.

    $ mckibben study validation --only DMSP-10-250 --law ideal --out validation.md
    """
    with PAGE.files(out) as files:
        with progress("validation", validation.stages(only or (), law or ())) as advance:
            result = validation.validation(data, only=only or (), laws=law or (), progress=advance)
        written: list[str] = []
        files.write("page", lambda path: written.extend(str(one) for one in write_page(result, path)))
        content = validation_json(result)
        files.write_result(content)
        if as_json:
            print_json(content | ({"files": written} if written else {}))
            return
        show_validation(result)
        for path in dict.fromkeys([*written, *map(str, files.named())]):
            typer.echo(f"Written: {path}")


def _as_json(study: TubeStudy, judged: list[Claim]) -> dict[str, JsonValue]:
    rows = []
    for thermal, results in study.results.items():
        for r in results:
            rows.append(
                {
                    "thermal": thermal,
                    "model": r.model,
                    "accumulator": r.accumulator,
                    "volume": study.cases[thermal, r.accumulator][0].volume,
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
        "cost": study.cost._asdict() if study.cost else {},
        "waveforms": [{"name": r.name, "seed": r.seed, "sentence": r.sentence()} for r in study.records],
        "hottest": {f"{thermal}, {a}": value for (thermal, a), value in study.hottest.items()},
    }


def _print(study: TubeStudy, judged: list[Claim]) -> None:

    waves = [[r.name, r.sentence()] for r in study.records]
    table(
        f"Gauge pressure in front of the tube, {1.0 / tube_models.PERIOD:g} samples per second",
        ["record", "what"],
        waves,
    )
    for thermal, results in study.results.items():
        typer.echo("")
        rows = [
            [
                tube_models.models()[r.model].title,
                _accumulator(r.accumulator),
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
        references = list(c.numbers)
        names = dict.fromkeys(name for numbers in c.numbers.values() for name in numbers)
        table(
            "",
            ["", *(r.replace("_", " ") for r in references)],
            [[f"  {_label(n)}", *(_number(n, c.numbers[r].get(n)) for r in references)] for n in names],
            right=range(1, len(references) + 1),
        )
        typer.echo("")


def _parameter(name: str, e: Any) -> str:
    unit = "" if e.unit == "1" else f" {e.unit}"
    return f"{name} {e.value:.3g} ({e.low:.3g} to {e.high:.3g}){unit}"


_LABELS = {
    "verdict": "verdict",
    "cutoff": "cut-off frequency, π rad/s",
    "speed_low": "rate of rise over the reference's, below a third of the pressure",
    "speed_high": "rate of rise over the reference's, above two thirds",
    "lead_low": "lead below a third of the pressure, ms",
    "lead_high": "lead above two thirds, ms",
    "costs": "rms with parameters kept over rms refitted",
    "rms_kept": "rms on 3 in³, parameters kept, bar",
    "rms_refitted": "rms on 3 in³, refitted, bar",
    "rms_quadratic_kept": "rms on 3 in³, quadratic, parameters kept, bar",
    "rms_quadratic_refitted": "rms on 3 in³, quadratic, refitted, bar",
    "operations_ratio": "ratio of operations",
    "ratio": "ratio of the measured times",
    "ratio_with_vessel_heat": "ratio with heat transfer in the vessel",
    "R1_quadratic": "R1, quadratic, with 95 % interval, Pa s/m",
    "R1_inertial": "R1, inertial, with 95 % interval, Pa s/m",
}


def _label(name: str) -> str:
    """What a number of a claim is, with its unit; the beginning of its name states the quantity."""
    if known := _LABELS.get(name):
        return known
    kind, _, rest = name.partition("_")
    model, _, last = rest.rpartition("_")
    where = ""
    if last in tube_models.ACCUMULATORS or rest in tube_models.ACCUMULATORS:
        rest, where = ("lumped" if rest in tube_models.ACCUMULATORS else model), f", {_accumulator(last or rest)}"
    if kind == "moved":
        return f"{rest} when refitted on 3 in³, %"
    what = tube_models.models()[rest].title + where
    return {"rms": f"rms, {what}, bar", "lead": f"lead, {what}, ms"}[kind]


def _number(name: str, value: Any) -> str:
    if value is None or isinstance(value, str):
        return value or ""
    if isinstance(value, dict):
        return f"{value['value']:.3g} ({value['low']:.2g} to {value['high']:.2g})"
    if not math.isfinite(value):
        return "from zero"
    kind = name.partition("_")[0]
    if kind == "rms":
        return f"{from_si(value, 'Pa', 'bar'):.3f}"
    if kind == "lead":
        return f"{1e3 * value:+.1f}"
    if kind == "moved":
        return f"{100.0 * value:+.0f}"
    return f"{value / math.pi if kind == 'cutoff' else value:.2f}"


def _accumulator(name: str) -> str:
    return name.replace("in3", " in³")


HALVES = ("first", "second")


def loops_json(study: LoopStudy) -> dict[str, JsonValue]:
    """Convert the study to JSON, in SI units."""
    return {
        "width_holds": study.width_holds,
        "order_holds": not study.swapped,
        "worst": _width_json(study.worst),
        "widths": [_width_json(w) for w in study.widths],
        "halves": [
            {
                "fitted": which,
                "friction": h.model,
                "parameters": {name: e._asdict() for name, e in h.parameters.items()},
                "curve": h.curve,
                **_errors(h),
                "samples": int(h.train.sum()),
                "converged": h.converged,
                "warnings": list(h.warnings),
            }
            for which, h in zip(HALVES, study.halves, strict=True)
        ],
        "branch_errors": study.branch_errors(),
        "loop": {
            "pressure": study.record.pressure,
            "stroke": study.record.stroke,
            "predicted": study.unseen.stroke,
        },
        "steps": [_step_json(s) for s in study.steps],
        "cannot": limits(study),
    }


def show_loops(study: LoopStudy) -> None:
    """Print tables and sentences."""
    halves = list(zip(HALVES, study.halves, strict=True))
    rows = [
        [which, h.model, *(_mm(v, 3) for v in (h.rmse(seen=True), h.rmse(seen=False), h.max_error(seen=False)))]
        for which, h in halves
    ]
    columns = ["fitted half", "friction", "seen, mm", "unseen, mm", "largest unseen, mm"]
    table("Each half of the loop from the other, rms errors of the stroke", columns, rows, right=[2, 3, 4])
    typer.echo("")
    rows = [[which, name, *_shown(e)] for which, h in halves for name, e in h.parameters.items()]
    table("", ["fitted half", "parameter", "value", "95 %"], rows, right=[2, 3])
    typer.echo("")
    rows = [
        [f"{_bar(w.pressure):.2f}", _mm(w.measured), _mm(w.predicted), f"{100.0 * w.error:+.1f}", _where(w)]
        for w in study.widths
    ]
    columns = ["pressure, bar", "measured, mm", "model, mm", "error, %", ""]
    table("Width of the loop, each sample by the half that did not see it", columns, rows, right=[0, 1, 2, 3])
    typer.echo("")
    rows = [
        [
            s.segment.replace("_", " "),
            f"{s.start:g} to {s.start + s.fit.time[-1]:.2f}",
            f"{s.start + s.fit.time[s.fit.train][-1]:.2f}",
            s.fit.law,
            *(_mm(v, 3) for v in (s.fit.rmse(seen=True), s.fit.rmse(seen=False), s.fit.max_error(seen=False))),
            _mm(abs(s.fit.stroke[-1] - s.fit.stroke[0])),
            "{} of {}".format(*s.inside),
            _mm(s.high[_last(s)] - s.low[_last(s)]),
        ]
        for s in study.steps
    ]
    columns = ["step", "held, s", "fitted to, s", "law", "seen, mm", "unseen, mm", "largest unseen, mm", "crept, mm"]
    columns += ["in the 95 % band", "its width at the end, mm"]
    table("Creep after a step, its second half from its first", columns, rows, right=range(4, 10))
    typer.echo("")
    for line in _verdicts(study):
        typer.echo(line)
    typer.echo("")
    typer.echo("What these records cannot tell:")
    for line in limits(study):
        typer.echo(f"  {line}")


def limits(study: LoopStudy) -> list[str]:
    """Limits of what these records can predict, a sentence each."""
    said = []
    outside = [w for w in study.widths if not w.middle]
    if outside:
        worst = max(outside, key=lambda w: abs(w.error) if math.isfinite(w.error) else math.inf)
        said.append(
            f"The ends of the loop: where it is narrow the width is missed by up to {100.0 * abs(worst.error):.0f} %, "
            f"at {_bar(worst.pressure):.2f} bar ({_mm(worst.predicted)} mm predicted, {_mm(worst.measured)} mm measured)."
        )
    if alone := study.branch_errors():
        said.append(
            f"One branch from the other: from the rising branch alone mid-range widths are missed by up to "
            f"{100.0 * alone['up']:.0f} %, from the falling one alone by up to {100.0 * alone['down']:.0f} %. The halves "
            "above are runs of ten samples in turns, on both branches."
        )
    turns = len(study.record.turning_points)
    if turns == 1:
        said.append("Loops within the loop: the record turns once, so that no smaller loop is compared.")
    said.append(
        "The friction as a force: no load was measured. Forces and stiffnesses are stated for a nominal area of "
        f"{_area():g} cm2, which the stroke does not depend on; only their ratio to it is from the data."
    )
    for which, h in zip(HALVES, study.halves, strict=True):
        loose = [n for n, e in h.parameters.items() if not (e.low > 0.0 and e.high < 3.0 * e.low)]
        if loose:
            names = ", ".join("{} {} ({})".format(n, *_shown(h.parameters[n])) for n in loose)
            said.append(f"Parameters of {h.model} from the {which} half that the loop hardly fixes: {names}.")
    for s in study.steps:
        if s.late is None:
            continue
        end, late = s.start + s.late.time, s.late
        text = (
            f"The end of the hold: {_mm(late.predicted)} mm predicted at {end:g} s, {_mm(late.measured)} mm measured, from "
            f"{s.fit.time[s.fit.train][-1]:.2f} s of creep; with elements slower than those, {_mm(late.low)} to "
            f"{_mm(late.high)} mm would fit as well."
        )
        if math.isfinite(late.drift) and late.drift:
            text += f" The pressure drifts meanwhile, which the loop's slope makes {_mm(late.drift)} mm of it."
        said.append(text)
    return said


def _verdicts(study: LoopStudy) -> list[str]:

    middle = [w.pressure for w in study.widths if w.middle]
    held, worst = "HELD" if study.width_holds else "MISSED", study.worst
    lines = [
        f"{held}: the width is right to {100.0 * muscle_loops.TARGET:g} % where the loop is at least "
        f"{muscle_loops.MIDDLE:g} times as wide as at its "
        f"widest ({_bar(min(middle)):g} to {_bar(max(middle)):g} bar); worst {100.0 * worst.error:+.1f} % at "
        f"{_bar(worst.pressure):g} bar"
    ]
    wrong = ", ".join(f"{_bar(w.pressure):g}" for w in study.swapped)
    reach = (
        f"{len(study.widths)} pressures, {_bar(study.widths[0].pressure):g} to {_bar(study.widths[-1].pressure):g} bar"
    )
    order = "the falling branch lies above the rising one, measured and predicted"
    lines.append(f"MISSED: {order}; not so at {wrong} bar" if wrong else f"HELD: {order}, at all of {reach}")
    for which, h in zip(HALVES, study.halves, strict=True):
        lines += [f"note: {which} half: {w}" for w in h.warnings]
    for s in study.steps:
        lines += [f"note: {s.segment.replace('_', ' ')}: {w}" for w in s.fit.warnings]
    return lines


def _width_json(w: Width) -> dict[str, JsonValue]:
    return {**w._asdict(), "error": w.error}


def _errors(fit: Any) -> dict[str, float]:
    return {
        "rms_seen": fit.rmse(seen=True),
        "rms_unseen": fit.rmse(seen=False),
        "largest_unseen": fit.max_error(seen=False),
    }


def _step_json(s: StepCreep) -> dict[str, JsonValue]:
    inside, count = s.inside
    return {
        "segment": s.segment,
        "start": s.start,
        "law": s.fit.law,
        "time_constants": s.fit.time_constants,
        "amplitudes": [a._asdict() for a in s.fit.amplitudes],
        **_errors(s.fit),
        "inside_band": inside,
        "unseen": count,
        "time": s.fit.time,
        "stroke": s.fit.stroke,
        "predicted": s.fit.predicted,
        "fitted": s.fit.train,
        "band": {"time": s.at, "low": s.low, "high": s.high},
        "end_of_hold": s.late._asdict() if s.late else None,
        "warnings": list(s.fit.warnings),
    }


def _last(s: StepCreep) -> int:
    """Range of the band at the end of the record."""
    return int(abs(s.at - s.fit.time[-1]).argmin())


def _shown(e: Estimate) -> list[str]:
    unit = "" if e.unit == "1" else f" {e.unit}"
    return [f"{e.value:.3g}{unit}", f"{e.low:.3g} to {e.high:.3g}"]


def _where(w: Width) -> str:
    return "mid-range" if w.middle else ""


def _area() -> float:

    return from_si(identification.hysteresis_fit.AREA, "m^2", "cm^2")


def _bar(pressure: float) -> float:

    return from_si(pressure, "Pa", "bar")


def _mm(length: float, digits: int = 2) -> str:

    return f"{from_si(float(length), 'm', 'mm'):.{digits}f}"


def write_page(validation: Validation, path: Path) -> list[Path]:
    """Write the page, and its figure if there is a static data set; return the paths."""
    figure = path.with_name(f"{path.stem}-errors.svg")
    if validation.static:
        style.save(ranking_figures.errors_figure(validation), figure)
    text = validation_page.page(validation, figure=figure.name if validation.static else "", version=__version__)
    write_text(path, text)
    return [path, figure] if validation.static else [path]


def validation_json(validation: Validation) -> dict[str, JsonValue]:
    """Convert the validation to JSON, in SI units."""
    return {
        "static": [_static_json(r) for r in validation.static],
        "loops": loops_json(validation.loops) if validation.loops else None,
        "jumps": [j._asdict() for j in validation.jumps],
        "absent": validation.absent,
    }


def _static_json(r: StaticResult) -> dict[str, JsonValue]:

    return {
        "name": r.of.name,
        "title": r.of.title,
        "source": r.of.source,
        "licence": r.of.licence,
        "points": len(r.points),
        "taut": int(r.points.taut.sum()),
        "largest_tension": r.points.largest,
        "branches_apart": None if r.apart is None else {"half_rms": r.apart[0], "half_largest": r.apart[1]},
        "fits": [f.to_dict() for f in r.fits],
        "unfitted": [
            {"law": u.title, "origin": u.origin, "rmse": u.rmse, "max_error": u.max_error} for u in r.unfitted
        ],
        "skipped": r.skipped,
    }


def show_validation(validation: Validation) -> None:
    """Print one table per data set, then loops and jumps, then the missing data."""
    for r in validation.static:
        rows = [_row(f, r.points.largest) for f in r.fits]
        rows += [
            [
                u.title,
                "0",
                f"{u.rmse:.2f} N",
                validation_page.share(u.max_error, r.points.largest),
                "-",
                "-",
                "-",
                u.origin,
            ]
            for u in r.unfitted
        ]
        title = f"{r.of.title}: {int(r.points.taut.sum())} points with tension, largest {r.points.largest:.1f} N"
        columns = ["law", "free", "rmse", "largest", "pressure out, rms", "pressure out", "above 4 bar", ""]
        table(title, columns, rows, right=range(1, 7))
        typer.echo("")
    if validation.loops:
        worst = validation.loops.worst
        typer.echo(
            f"Loop of a DMSP-10-250: width of the unseen loop off by at most {100.0 * abs(worst.error):.1f} % mid-range"
        )
    for j in validation.jumps:
        typer.echo(f"Jump {j.name} from the others: {from_si(j.rms, 'Pa', 'mbar'):.0f} mbar rms")
    for name, file in validation.absent.items():
        typer.echo(f"not at hand: {name} ({file})")


def _row(f: Fit, largest: float) -> list[str]:

    held = validation_page.share(f.holdout.max_error if f.holdout else None, largest)
    crossed = [validation_page.share(f.cv_rmse, largest), validation_page.share(f.cv_max_error, largest), held]
    state = "" if f.converged else "did not converge"
    return [
        f.law,
        str(len(f.parameters)),
        f"{f.rmse:.2f} N",
        validation_page.share(f.max_error, largest),
        *crossed,
        state,
    ]
