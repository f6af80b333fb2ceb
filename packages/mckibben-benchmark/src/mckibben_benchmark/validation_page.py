"""Markdown page of the validation for the documentation."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

from mckibben.identification import Fit
from mckibben.quantities import from_si

from .datasets import JUMPS, LOOP
from .muscle_loops import LoopStudy, stroke_errors
from .validation import LOOP_FOLDER, ROBOT_FOLDER, VARIABLE, StaticResult, Validation, ordered_laws

FRONT = "---\nhide:\n  - toc\n---"  # the tables are as wide as the page
HEAD = "<!-- written by `mckibben study validation`; do not edit -->"
ABOVE = "above 4 bar"
COLUMNS = (
    "law",
    "free",
    "rmse",
    "largest",
    "pressure out, rms",
    "pressure out",
    "length out",
    "block out",
    "muscle out",
)
DASH = "–"
INTRO = f"""\
Every tension law against every static data set that was at hand, and the studies of friction, creep and air beside
them: how well a law meets what it was fitted to, and how well it predicts what it was not shown. One command makes
this page and its figure anew:

```sh needs=measured_data
$ {VARIABLE}=/folder/of/measured/data mckibben study validation --out docs/reference/validation.md
```

Without that folder it uses the two force maps that ship with the package, and says so. `--only NAME` and `--law NAME`
take some of the data sets and of the laws, `--json` prints all numbers in SI units."""
LEGEND = """\
*Free* is the number of fitted parameters. *Rmse* and *largest* are errors at the points that were fitted. *Pressure
out* leaves one pressure out at a time (a tenth of the points, where no pressure was held), refits and predicts it;
*length out*, *block out* and *muscle out* do the same with one length, a patch of neighbouring lengths and pressures,
one muscle of a rest length. *Above 4 bar* trains up to that gauge pressure and predicts the rest. All but the rmse
are the largest single error unless they say rms, as a share of the largest measured tension; *over* is more than that
tension. [Uncertainty](../explanation/uncertainty.md) says how to read these columns. Rows with 0 free parameters were
not fitted to these data at all: they take their numbers from print, or from a fit to another muscle.

In the figure, laws are ordered by their error with one pressure left out, averaged over the data sets. What is off
the axis is drawn at its end. In the grey range no law without friction can be on both branches of a loop."""
END = """\
## What is not here

The measurements of Chou and Hannaford (1996) themselves are not published: their printed coefficients, readings and
tables are held against this package [number by number](index.md#the-papers-number-by-number). The tube models are held
against a distributed tube, not against a measurement ([The tube study](../explanation/tube-study.md)). How far two muscles
of one make differ is told by one row only: numbers of a measured DMSP-20-300 on the maker's curves for that bore. No law
was held against a muscle that had worn, or that was warm."""


def page(validation: Validation, *, figure: str = "", version: str = "") -> str:
    """Compose the page.

    Args:
        validation: the results.
        figure: path of the figure, as seen from the page; none by default.
        version: version of the package that computed it.
    """
    parts = [FRONT, "# Validation", HEAD, INTRO, _seen(validation, version)]
    if validation.static:
        parts += ["## All laws on all static data", _summary(validation.static)]
        if figure:
            parts.append(f"![Errors of every law on every static data set]({figure})")
        parts.append(LEGEND)
    for one in validation.static:
        parts += [f"## {one.of.title}", _described(one), _table_of(one)]
        said = [f"- `{f.law}`: {w}" for f in one.fits for w in f.warnings]
        said += [f"- `{law}` was left out: {why}" for law, why in one.skipped.items()]
        parts += ["\n".join(said)] if said else []
    if validation.loops:
        parts += ["## Friction and creep: a loop and two steps of a DMSP-10-250", *_loops(validation.loops)]
    if validation.jumps:
        parts += ["## Air: the jumping robot", *_jumps(validation)]
    return "\n\n".join([*parts, END]) + "\n"


def table(columns: Sequence[str], rows: Iterable[Sequence[str]], *, right: Sequence[str] | None = None) -> str:
    """A Markdown table; all but the first column and one without a head are right-aligned, or those that are named."""
    named = [c in right if right is not None else bool(i and c) for i, c in enumerate(columns)]
    ends = ("---:" if at_right else "---" for at_right in named)
    return "\n".join([_line(columns), f"|{'|'.join(ends)}|", *(_line(row) for row in rows)])


def share(newton: float | None, largest: float) -> str:
    """Format an error as a share of the largest tension."""
    if newton is None or math.isnan(newton):
        return DASH
    part = newton / largest
    return f"{100.0 * part:.2f} %" if part < 1.0 else "over" if math.isfinite(part) else "fails"


def _line(cells: Sequence[str]) -> str:
    return "| " + " | ".join(c.replace("|", "\\|").replace("\n", " ") for c in cells) + " |"


def _seen(validation: Validation, version: str) -> str:
    rows = [
        [r.of.title, f"{len(r.points)}", f"{r.points.largest:.1f} N", r.of.source, r.of.licence]
        for r in validation.static
    ]
    if validation.loops:
        count = len(validation.loops.record.pressure)
        rows.append(["Loop and creep of a DMSP-10-250", f"{count}", DASH, LOOP.source, LOOP.licence])
    if validation.jumps:
        rows.append(["Jumping robot", f"{len(validation.jumps)} jumps", DASH, JUMPS.source, JUMPS.licence])
    heading = f"Computed with version {version} from these data:" if version else "Computed from these data:"
    columns = ["data", "points", "largest tension", "source", "licence"]
    lines = [heading, table(columns, rows, right=("points", "largest tension"))]
    if validation.absent:
        absent = "; ".join(f"{name} (`{file}`)" for name, file in validation.absent.items())
        lines.append(f"**Not at hand when this page was made**, and so not on it: {absent}.")
    return "\n\n".join(lines)


def _summary(static: Sequence[StaticResult]) -> str:
    """Root mean square error with one pressure left out, per law and data set; best on average first."""
    rows = []
    for law in ordered_laws(static):
        cells = []
        for one in static:
            error = one.predicted(law)
            text = share(error, one.points.largest)
            cells.append(f"**{text}**" if law == one.fits[0].law else text)
        rows.append([f"`{law}`", *cells])
    words = (
        "Root mean square error of prediction with one pressure left out, as a share of the largest tension; the best of "
        "each column is bold. Laws that know no rest length are not made for the last column."
    )
    return words + "\n\n" + table(["law", *(one.of.name for one in static)], rows)


def _described(one: StaticResult) -> str:
    points = one.points
    low, high = (from_si(float(v), "Pa", "bar") for v in (points.pressure.min(), points.pressure.max()))
    text = (
        f"{int(points.taut.sum())} points with tension of {len(points)}, {low:.2g} to {high:.3g} bar, largest tension "
        f"{points.largest:.1f} N. Source: {one.of.source}; licence: {one.of.licence}."
    )
    if one.of.pressure_zero:
        text += f" The pressure sensor's zero of {from_si(one.of.pressure_zero, 'Pa', 'kPa'):g} kPa is taken off."
    if one.apart:
        rms, most = one.apart
        text += (
            f" Rising and falling branch lie {2.0 * rms:.1f} N (rms) apart, so that where both were measured no law "
            f"without friction can have an rmse below {rms:.1f} N ({share(rms, points.largest)}), nor a largest error "
            f"below {share(most, points.largest)}."
        )
    return f"{text} {one.of.note}".rstrip()


def _table_of(one: StaticResult) -> str:
    largest = one.points.largest
    rows = [[*_fitted(f, largest), "" if f.converged else "did not converge"] for f in one.fits]
    rows += [
        [u.title, "0", f"{u.rmse:.2f} N", share(u.max_error, largest), *[DASH] * 6, u.origin] for u in one.unfitted
    ]
    columns = [*COLUMNS, ABOVE, ""]
    keep = [i for i in range(len(columns)) if i < 4 or any(r[i] not in (DASH, "") for r in rows)]
    return table([columns[i] for i in keep], [[r[i] for i in keep] for r in rows])


def _fitted(f: Fit, largest: float) -> list[str]:
    crossed = [share(f.cross[s].max_error, largest) if s in f.cross else DASH for s in _SCHEMES]
    return [
        f"`{f.law}`",
        str(len(f.parameters)),
        f"{f.rmse:.2f} N",
        share(f.max_error, largest),
        share(f.cv_rmse, largest),
        *crossed,
        share(f.holdout.max_error if f.holdout else None, largest),
    ]


_SCHEMES = ("pressure", "length", "block", "rest_length")


def _loops(study: LoopStudy) -> list[str]:
    rows = [
        [f"{which} half of the loop, from the other", f"`{half.model}`", *map(_mm, stroke_errors(half).values())]
        for which, half in zip(("second", "first"), study.halves, strict=True)
    ]
    for step in study.steps:
        words = f"creep after {step.segment.replace('_', ' ')}, second half from the first"
        rows.append([words, f"`{step.fit.law}`", *map(_mm, stroke_errors(step.fit).values())])
    worst = study.worst
    alone = study.branch_errors()
    text = (
        f"The width of the loop that no fit saw is off by at most {100.0 * abs(worst.error):.1f} % mid-range (worst at "
        f"{from_si(worst.pressure, 'Pa', 'bar'):g} bar, {_mm(worst.measured)} measured)."
    )
    if alone:
        text += (
            f" From the rising branch alone it is off by up to {100.0 * alone['up']:.0f} %, from the falling one alone "
            f"by up to {100.0 * alone['down']:.0f} %."
        )
    text += f" Files: `{LOOP_FOLDER}`. How it is done, and its limits: [The loop study](../explanation/loop-study.md)."
    return [table(["what is predicted", "model", "rms, seen", "rms, unseen", "largest, unseen"], rows), text]


def _jumps(validation: Validation) -> list[str]:
    rows = [
        [
            f"`{j.name}`",
            _mbar(j.rms_others),
            _mbar(j.rms),
            _mbar(j.largest),
            f"{1e3 * j.lead:+.1f} ms".replace("-", "−"),
            "" if j.converged else "stopped at the limit of evaluations",
        ]
        for j in validation.jumps
    ]
    columns = ["jump left out", "rms of the jumps fitted", "rms, predicted", "largest, predicted", "furthest lead", ""]
    text = (
        "Each of four jumps is predicted by a circuit (tank, tubes, valves, muscles) whose parameters were fitted to the "
        "other three; errors are those of one tank pressure and four muscle pressures, which swing by 1.9 to 2.9 bar. "
        f"Files: `{ROBOT_FOLDER}`. What these data cannot tell: [The robot study](../explanation/robot-study.md)."
    )
    return [text, table(columns, rows)]


def _mm(value: float) -> str:
    return f"{from_si(value, 'm', 'mm'):.3f} mm"


def _mbar(value: float) -> str:
    return f"{from_si(value, 'Pa', 'mbar'):.0f} mbar"
