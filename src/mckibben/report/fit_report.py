"""Report of an identification.

It holds the data and their source, the ranking, figures, parameters with intervals, cautions in plain words, versions
and the papers. The same studies give the same file: it carries no date.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..estimation import INDIFFERENT
from ..identification import Fit
from ..identification.fit import ALIKE
from ..identification.ranking import COLUMNS, SCHEMES, Ranking, cautions_of
from ..muscles.laws import law_type
from ..quantities import declared, from_si, shown_unit, with_unit
from .blocks import (
    Block,
    Cite,
    Figure,
    Fold,
    Gauge,
    Heading,
    Hyperlink,
    KeyValues,
    NoteBox,
    Paragraph,
    References,
    ReportTable,
    Section,
    Span,
    TableCell,
    TableColumn,
    TableRow,
    Text,
    headed,
    numeric,
    power_text,
    unit_text,
    versions,
    versions_text,
)
from .document import Document
from .figures import fit_figures
from .figures.fit_figures import law_title
from .figures.style import number, symbol_text

__all__ = ["fit_document", "fit_report", "versions", "write_fit_report"]

DIVERGES = 10.0  # a prediction that errs by more than this many times the largest tension says nothing
FAILED = "a fit without the points left out did not converge, or had too few points"
READING = (
    (
        "Fitted",
        "Least squares of the tension over all points that carry any, all weighted alike, from many starting "
        "points. A small error here says that the formula can bend to the data, no more.",
    ),
    (
        "Left out",
        "Every pressure, length or block of neighbouring points is left out once and predicted by a fit to the "
        "rest. The order of the laws follows the root mean square error of all these predictions. Leaving out the "
        "shortest or the longest length asks for extrapolation, which is why that column is the worst.",
    ),
    (
        "Trained up to",
        "A separate fit sees only the lower pressures and predicts the upper ones: what to expect beyond your own "
        "measurement.",
    ),
    (
        "ΔAICc",
        "Akaike's criterion, corrected for small samples, above its lowest value: misfit with a charge for each "
        "parameter; 0 is the best, 10 is a clear difference. It takes errors as independent, which systematic "
        "misfit is not, so that it does not decide the order.",
    ),
    (
        "Intervals",
        "95 %, linearised at the solution, from Student's t. They too take errors as independent, so that true "
        "ones are wider. Two parameters that correlate near ±1 trade places within theirs.",
    ),
    (
        "Slack",
        "A braid cannot push. Points without tension say where the muscle hangs slack, not how large a force is, "
        "and are left out of fits and errors unless stated above.",
    ),
)


def write_fit_report(studies: Iterable[Ranking], path: str | Path) -> Path:
    """Write the report of one or more studies to an ``.html`` or ``.pdf`` file.

    Args:
        studies: one for each force map, with its fits, best first.
        path: path of the file.

    Returns:
        The path.
    """
    return fit_document(studies).write(path)


def fit_report(studies: Iterable[Ranking]) -> str:
    """Return the report of one or more studies as HTML text; arguments as for `write_fit_report`."""
    return fit_document(studies).html()


def fit_document(studies: Iterable[Ranking]) -> Document:
    """Build the report of one or more studies; arguments as for `write_fit_report`."""
    shown = list(studies)
    these = "this muscle" if len(shown) == 1 else "these muscles"
    lead = f"Which law describes {these}, how well it predicts what it was not shown, and what its parameters are."
    versions_said = f"{versions_text()}. Fits are deterministic: the same table and versions give this file again."
    keys = dict.fromkeys(key for study in shown for key in study.papers())
    sections = (
        *(Section(study.title, tuple(_study(study, f"s{i}")), f"s{i}") for i, study in enumerate(shown, 1)),
        Section("How to read this", (KeyValues(READING),), "reading"),
        Section("Papers this rests on", (References(tuple(list(keys))),), "papers"),
        Section("Versions", (Paragraph(versions_said),), "versions"),
    )
    return Document("Tension laws fitted to measured force", sections, lead)


# ---- a study


def _study(study: Ranking, mark: str) -> list[Block]:
    best = study.fits[0]
    facts: list[tuple[str, Text]] = [*_facts(study)]
    source = study.data_source()
    facts += [("Source", f"Data: {source}")] if source else []
    held_out = next((f.holdout.what for f in study.fits if f.holdout), "")
    blocks: list[Block] = [
        Paragraph(_summary(study), "lead"),
        KeyValues(tuple(facts)),
        Heading("Ranking"),
        Figure(
            fit_figures.ranking(study),
            "Filled triangle: root mean square error of points that the fit was not shown; the bar ends at the largest. "
            + (f"Open triangle, dashed: points above, {held_out}. " if held_out else "")
            + "A black mark on the frame: outside of it.",
            f"Ranking of the laws for {study.title}; the table below has its numbers.",
        ),
        *_table(study, mark),
    ]
    for fit in study.fits:
        anchor, inner = f"{mark}-{fit.law}", _law(fit, study, main=fit is best)
        count = len(cautions_of(fit, study.points.largest))
        words = f"▲ {count} caution{'s' if count > 1 else ''}"
        title = (law_title(fit), *((" ", Span(words, "caution")) if count else ()))
        blocks += [Fold(title, tuple(inner), anchor, opened=fit is best)]
        if fit is best and len(study.fits) > 1:
            blocks.append(Heading("Other laws"))
    return blocks


def _summary(study: Ranking) -> str:
    best, size = study.fits[0], study.points.largest
    if not best.converged:
        return "No law converged on this table; the numbers below are not to be used."
    words = f"{law_title(best)} fits with {_newton(best.rmse)} root mean square"
    rms, worst = best.left_out_rmse, best.left_out_max_error
    if rms is not None and worst is not None and math.isfinite(rms):
        words += f" and predicts points that it was not shown to {_newton(rms)}, at worst {_newton(worst)}"
        words += f" or {_percent(worst, size)} of the largest tension"
    if best.holdout and best.holdout.max_error < DIVERGES * size:
        words += f"; {best.holdout.what} it errs by at most {_percent(best.holdout.max_error, size)} above"
    words += "."
    able = [f for f in study.fits if f.converged and f.holdout and math.isfinite(f.holdout.max_error)]
    if able and best.holdout:
        far = min(able, key=lambda f: f.holdout.max_error if f.holdout else math.inf)
        if far is not best and far.holdout and far.holdout.max_error < 0.5 * best.holdout.max_error:
            most = _percent(far.holdout.max_error, size)
            words += f" To go beyond the measured pressures take {law_title(far)}: {most} there."
    return words


def _facts(study: Ranking) -> list[tuple[str, str]]:
    points = study.points
    taut = int(points.taut.sum())
    asked = len(study.fits[0].points) > taut
    used = "and ask the laws for zero tension" if asked else "and are left out of the fits"
    rows = [
        ("Table", points.name),
        ("Points", f"{len(points)}, of them {taut} with tension; {len(points) - taut} hung slack {used}"),
        ("Length", _range(points.length, "m")),
        ("Pressure, gauge", _range(points.pressure, "Pa")),
        *[("Left out", f"{remark[0].upper()}{remark[1:]}") for remark in points.remarks],
        ("Largest tension", f"{_newton(points.largest, 1)}; errors in % refer to it"),
    ]
    if points.rest_length is not None:
        rests = np.unique(points.rest_length)
        rows.insert(3, ("Rest length", ", ".join(_readable(with_unit(float(r), "m")) for r in rests[:6])))
    return rows


def _range(values: np.ndarray, unit: str) -> str:
    low, high = (_readable(with_unit(float(v), unit)) for v in (values.min(), values.max()))
    return f"{low} to {high}, {len(np.unique(np.round(values, 9)))} values"


# ---- the ranking


def _table(study: Ranking, mark: str) -> list[Block]:
    ranked = study.ranked()
    every = {"left_out": "all left out"} | {key: f"each {SCHEMES[key]} left out" for key in SCHEMES}
    groups = {key: said for key, said in every.items() if any(f"{key}_rmse" in row for row in ranked)}
    held_out = next((f.holdout.what for f in study.fits if f.holdout), "")
    groups |= {"above": held_out} if held_out else {}
    # place and law, then what of the answer stands in which group
    keys = {"rmse": "fitted", "max_error": "fitted", "share": "fitted"}
    keys |= {f"{key}_{of}": words for key, words in groups.items() for of in ("rmse", "share")}
    columns = [TableColumn("", number=True), TableColumn("Law"), TableColumn("Par.", number=True)]
    for key, words in keys.items():
        unit = "%" if key.endswith("share") else "N"
        columns.append(TableColumn("rms" if key.endswith("rmse") else "largest", unit, True, group=words))
    columns += [TableColumn("\u0394AICc", number=True), TableColumn("Verdict", wide=True)]
    largest = number(study.points.largest, 1)
    predicted = any(f.left_out_rmse is not None for f in study.fits)
    score = (
        "the root mean square error of all points that were left out" if predicted else "AICc, as nothing was left out"
    )
    unless = (
        f"it predicts better by more than {100.0 * ALIKE:g} %" if predicted else f"its AICc is lower by {INDIFFERENT:g}"
    )
    note = (
        f"Ranked by {score}. A parameter that ended at a bound, or that the data do not contain, counts for nothing, and a "
        f"law with one comes behind any other unless {unless}. A law of which the data leave a parameter undetermined, or "
        "that could not be checked, comes behind all that were. Errors in N, the largest also in % of the largest "
        f"tension, {largest} N; the best of each column is bold."
    )
    usable = [row for row in ranked if "fit" in row and row["fit"].converged]
    best = {key: min((row.get(key, math.inf) for row in usable), default=math.nan) for key in (*keys, "distance")}
    rows = []
    for row in ranked:
        cells = [_cell(row, key, best[key]) for key in (*keys, "distance")]
        if "fit" not in row:
            rows.append(TableRow(("", row["title"], "–", *cells, row["verdict"]), look="quiet"))
            continue
        look: Any = "" if not row["verdict"] else "caution" if row["fit"].converged else "stop"
        state = TableCell(row["verdict"] or "converged", look)
        link, place = Hyperlink(row["title"], f"{mark}-{row['law']}"), str(row["place"]).replace("-", "–")
        first: Any = "first" if place == "1" else ""
        rows.append(TableRow((place, link, str(row["free"]), *cells, state), look=first))
    blocks: list[Block] = [Paragraph(note, "quiet"), ReportTable(tuple(columns), tuple(rows), head=1)]
    if study.skipped:
        reasons = "; ".join(f"{str(law_type(name).title)} ({reason})" for name, reason in study.skipped.items())
        blocks.append(Paragraph(f"Passed over: {reasons}.", "quiet"))
    return blocks


def _cell(row: Mapping[str, Any], key: str, best: float) -> TableCell:
    """A number of the ranking as its column says it, or a dash with its reason."""
    value, fitted = row.get(key), "fit" in row
    if value is None:
        why = "not asked for, or the table has one group only"
        return TableCell("–", hint=why if fitted else "nothing was fitted, so nothing was left out")
    words = replace(COLUMNS[key], beside=False).text(value)
    if not math.isfinite(value):
        few = "too few points for this criterion"
        return TableCell("–", hint=few) if key == "distance" else TableCell(words, hint=FAILED)
    look: Any = "best" if value == best and fitted and row["fit"].converged else ""
    return TableCell(words.replace("-", "\N{MINUS SIGN}"), look)


# ---- one law


def _law(fit: Fit, study: Ranking, *, main: bool) -> list[Block]:
    kind = law_type(fit.law)
    meaning = (kind.__doc__ or "").strip().split("\n")[0]
    cautions, held = cautions_of(fit, study.points.largest), _held(fit)
    columns = headed("", "Parameter", *numeric("Value", "Half-width"), "Unit", "−50 % to +50 % of the value")
    rows = tuple(_parameter(name, fit) for name in fit.parameters)
    blocks: list[Block] = [Paragraph((meaning, " ", Cite(tuple(kind.cites))))]
    blocks += [NoteBox("Caution", tuple(cautions))] if cautions else []
    blocks.append(ReportTable(columns, rows, "Parameters with 95 % intervals", head=1))
    blocks += [Paragraph(f"Not fitted: {held}.", "quiet")] if held else []
    return [*blocks, _curves(fit, study), *(_more_pictures(fit) if main else [])]


def _curves(fit: Fit, study: Ranking) -> Figure:
    return Figure(
        fit_figures.tension_curves(fit, study.points),
        "Tension over length. Triangles are measured, lines the fitted law, each from its free length on; "
        "the gauge pressure stands at the line's end. Open circles: the muscle hung slack there at one or more pressures.",
        f"{study.title}: measured tension over length and {law_title(fit)}, one line per pressure.",
        wide=False,
    )


def _more_pictures(fit: Fit) -> list[Figure]:
    title, figures = law_title(fit), []
    matrix = fit_figures.correlation(fit)
    if matrix is not None:
        words = "Near +1 or −1 the data fix a combination of the two parameters, not each of them."
        figures.append(Figure(matrix, words, f"Correlation of the estimates of {title}.", wide=False))
    figures.append(
        Figure(
            fit_figures.residuals(fit),
            "Errors of the fit, and of points predicted by fits that were not shown their pressure or length. "
            "The band is 1\N{NO-BREAK SPACE}% of the largest tension; "
            "black marks on the frame stand for points outside of it.",
            f"Errors of {title}, fitted and predicted.",
        )
    )
    beyond = fit_figures.hold_out(fit)
    if beyond is not None:
        figures.append(
            Figure(
                beyond,
                "A separate fit saw the shaded pressures only. Filled triangles are measured, open ones predicted; "
                "the length stands at the line's end. The band is 3\N{NO-BREAK SPACE}% of the largest tension.",
                f"{title} trained at low pressure and asked above.",
            )
        )
    return figures


def _parameter(name: str, fit: Fit) -> TableRow:
    estimate, q = fit.parameters[name], declared(law_type(fit.law))[name]
    unit = shown_unit(estimate.unit)
    value, low, high = (from_si(v, estimate.unit, unit) if math.isfinite(v) else v for v in estimate[:3])
    half = 0.5 * (high - low) if math.isfinite(high - low) else math.inf
    text, spread = value_and_half(value, half)
    meaning = (f"{q.doc} ", Span(name, "code"))
    whisker: Gauge | str = "–"
    if value and math.isfinite(half):
        share = half / abs(value)
        label = f"half-width {100.0 * share:.3g} % of the value"
        whisker = Gauge(label, 0.0, whisker=(-2.0 * share, 2.0 * share), ruled=(-1.0, 0.0, 1.0))
    return TableRow((_symbol(q.symbol, name), meaning, TableCell(text, "best"), spread, unit_text(unit), whisker))


def value_and_half(value: float, half: float) -> tuple[str, str]:
    """Format a value and its half-width with the same power of ten, the half-width to two digits."""
    if not math.isfinite(value):
        return "–", "–"
    size = max(abs(value), half if math.isfinite(half) else 0.0, 1e-300)
    power = math.floor(math.log10(size))
    power = power if power >= 6 or power <= -4 else 0
    scaled, spread = value / 10.0**power, half / 10.0**power
    if math.isfinite(spread) and spread > 0.0:
        digits = min(max(1 - math.floor(math.log10(spread)), 0), 6)
    else:
        digits = min(max(3 - math.floor(math.log10(max(abs(scaled), 1e-6))), 0), 6)
    tail = power_text(power) if power else ""
    if not math.isfinite(spread):
        return number(scaled, digits) + tail, "not determined"
    return number(scaled, digits) + tail, f"±\N{THIN SPACE}{number(spread, digits)}{tail}"


def _held(fit: Fit) -> str:
    fields = declared(law_type(fit.law))
    parts = []
    for name, value in fit.known.items():
        low, high = float(np.min(value)), float(np.max(value))
        text = _readable(with_unit(low, fields[name].unit))
        if high != low:
            text += " to " + _readable(with_unit(high, fields[name].unit))
        parts.append(f"{fields[name].doc} {text}")
    return "; ".join(parts)


# ---- words


def _newton(value: float, digits: int | None = None) -> str:
    return number(value, digits if digits is not None else 2 if abs(value) < 10.0 else 1) + "\N{NO-BREAK SPACE}N"


def _percent(value: float, size: float) -> str:
    share = 100.0 * value / size
    return number(share, 2 if share < 10.0 else 0) + "\N{NO-BREAK SPACE}%"


def _readable(text: str) -> str:
    """Format a value with its unit: a typographic minus, and a non-breaking space."""
    return text.replace("-", "\N{MINUS SIGN}").replace(" deg", "°").replace(" ", "\N{NO-BREAK SPACE}")


def _symbol(symbol: str, name: str) -> Text:
    if not symbol:
        return ""
    head = symbol.rstrip("0123456789")
    if head == symbol and "_" in symbol:
        head = symbol.split("_")[0]
    elif head == symbol and symbol_text(symbol) == symbol and len(symbol) > 1:
        head = symbol[0]
    low = symbol[len(head) :].lstrip("_")
    return (Span(symbol_text(head), "symbol"), *((Span(low, "sub"),) if low else ()))
