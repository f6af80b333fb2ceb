"""``study loops`` in words: its tables, its verdicts, what it cannot say, and its JSON."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import typer

from .words import table

if TYPE_CHECKING:
    from ..identification.uncertainty import Estimate
    from ..studies.muscle_loops import LoopStudy, StepCreep, Width

HALVES = ("first", "second")


def loops_json(found: LoopStudy) -> dict[str, Any]:
    """Everything of the study in SI units."""
    return {
        "width_holds": found.width_holds,
        "order_holds": not found.swapped,
        "worst": _width_json(found.worst),
        "widths": [_width_json(w) for w in found.widths],
        "halves": [
            {
                "fitted": which,
                "friction": h.model,
                "parameters": _estimates(h.parameters),
                "curve": h.curve,
                **_errors(h),
                "samples": int(h.train.sum()),
                "converged": h.converged,
                "warnings": list(h.warnings),
            }
            for which, h in zip(HALVES, found.halves, strict=True)
        ],
        "branch_errors": found.branch_errors(),
        "loop": {
            "pressure": found.record.pressure,
            "stroke": found.record.stroke,
            "predicted": found.unseen.stroke,
        },
        "steps": [_step_json(s) for s in found.steps],
        "cannot": limits(found),
    }


def show_loops(found: LoopStudy) -> None:
    """Tables and sentences for a person."""
    halves = list(zip(HALVES, found.halves, strict=True))
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
        for w in found.widths
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
        for s in found.steps
    ]
    columns = ["step", "held, s", "fitted to, s", "law", "seen, mm", "unseen, mm", "largest unseen, mm", "crept, mm"]
    columns += ["in the 95 % band", "its width at the end, mm"]
    table("Creep after a step, its second half from its first", columns, rows, right=range(4, 10))
    typer.echo("")
    for line in _verdicts(found):
        typer.echo(line)
    typer.echo("")
    typer.echo("What these records cannot tell:")
    for line in limits(found):
        typer.echo(f"  {line}")


def limits(found: LoopStudy) -> list[str]:
    """What cannot be predicted from these records, a sentence each."""
    said = []
    outside = [w for w in found.widths if not w.middle]
    if outside:
        worst = max(outside, key=lambda w: abs(w.error) if math.isfinite(w.error) else math.inf)
        said.append(
            f"The ends of the loop: where it is narrow the width is missed by up to {100.0 * abs(worst.error):.0f} %, "
            f"at {_bar(worst.pressure):.2f} bar ({_mm(worst.predicted)} mm predicted, {_mm(worst.measured)} mm measured)."
        )
    if alone := found.branch_errors():
        said.append(
            f"One branch from the other: from the rising branch alone mid-range widths are missed by up to "
            f"{100.0 * alone['up']:.0f} %, from the falling one alone by up to {100.0 * alone['down']:.0f} %. The halves "
            "above are runs of ten samples in turns, on both branches."
        )
    turns = len(found.record.turning_points)
    if turns == 1:
        said.append("Loops within the loop: the record turns once, so that no smaller loop is compared.")
    said.append(
        "The friction as a force: no load was measured. Forces and stiffnesses are stated for a nominal area of "
        f"{_area():g} cm2, which the stroke does not depend on; only their ratio to it is from the data."
    )
    for which, h in zip(HALVES, found.halves, strict=True):
        loose = [n for n, e in h.parameters.items() if not (e.low > 0.0 and e.high < 3.0 * e.low)]
        if loose:
            told = ", ".join("{} {} ({})".format(n, *_shown(h.parameters[n])) for n in loose)
            said.append(f"Parameters of {h.model} from the {which} half that the loop hardly fixes: {told}.")
    for s in found.steps:
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


def _verdicts(found: LoopStudy) -> list[str]:
    from ..studies.muscle_loops import MIDDLE, TARGET

    middle = [w.pressure for w in found.widths if w.middle]
    held, worst = "HELD" if found.width_holds else "MISSED", found.worst
    lines = [
        f"{held}: the width is right to {100.0 * TARGET:g} % where the loop is at least {MIDDLE:g} times as wide as at its "
        f"widest ({_bar(min(middle)):g} to {_bar(max(middle)):g} bar); worst {100.0 * worst.error:+.1f} % at "
        f"{_bar(worst.pressure):g} bar"
    ]
    wrong = ", ".join(f"{_bar(w.pressure):g}" for w in found.swapped)
    reach = (
        f"{len(found.widths)} pressures, {_bar(found.widths[0].pressure):g} to {_bar(found.widths[-1].pressure):g} bar"
    )
    order = "the falling branch lies above the rising one, measured and predicted"
    lines.append(f"MISSED: {order}; not so at {wrong} bar" if wrong else f"HELD: {order}, at all of {reach}")
    for which, h in zip(HALVES, found.halves, strict=True):
        lines += [f"note: {which} half: {w}" for w in h.warnings]
    for s in found.steps:
        lines += [f"note: {s.segment.replace('_', ' ')}: {w}" for w in s.fit.warnings]
    return lines


def _width_json(w: Width) -> dict[str, Any]:
    return {**w._asdict(), "error": w.error}


def _errors(fit: Any) -> dict[str, float]:
    return {
        "rms_seen": fit.rmse(seen=True),
        "rms_unseen": fit.rmse(seen=False),
        "largest_unseen": fit.max_error(seen=False),
    }


def _estimates(parameters: dict[str, Estimate]) -> dict[str, Any]:
    return {name: e._asdict() for name, e in parameters.items()}


def _step_json(s: StepCreep) -> dict[str, Any]:
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
    """The band's place at the end of the record."""
    return int(abs(s.at - s.fit.time[-1]).argmin())


def _shown(e: Estimate) -> list[str]:
    unit = "" if e.unit == "1" else f" {e.unit}"
    return [f"{e.value:.3g}{unit}", f"{e.low:.3g} to {e.high:.3g}"]


def _where(w: Width) -> str:
    return "mid-range" if w.middle else ""


def _area() -> float:
    from ..identification.hysteresis_fit import AREA
    from ..quantities import from_si

    return from_si(AREA, "m^2", "cm^2")


def _bar(pressure: float) -> float:
    from ..quantities import from_si

    return from_si(pressure, "Pa", "bar")


def _mm(length: float, digits: int = 2) -> str:
    from ..quantities import from_si

    return f"{from_si(float(length), 'm', 'mm'):.{digits}f}"
