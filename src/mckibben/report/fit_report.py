"""The report of an identification: one HTML file that needs nothing else, for people who want to trust a law or not.

It holds the data and their source, the ranking, figures, parameters with intervals, cautions in plain words, versions
and the papers. The same studies give the same file: it carries no date.
"""

from __future__ import annotations

import math
import platform
from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from markupsafe import Markup, escape

from ..citations import reference
from ..identification import Fit
from ..muscles.laws import law_type
from ..quantities import declared, from_si, shown_unit, with_unit
from .figures import fit_figures
from .figures.fit_figures import law_title
from .figures.style import inline_svg, number, symbol_text
from .study import Study

# Open-access tables that ship with the package, by the key of their paper.
ATTRIBUTIONS = {"martens2017": "M. Martens, I. Boblan, Actuators 2017, 6(4), 33, CC BY 4.0"}
SCHEMES = {"pressure": "pressure", "length": "length", "block": "block", "rest_length": "rest length"}
DIVERGES = 10.0  # a prediction that errs by more than this many times the largest tension says nothing


class Cell(NamedTuple):
    """One number of a table: its text, what a dash stands for, and whether it is the best of its column."""

    text: str
    title: str = ""
    best: bool = False


class Row(NamedTuple):
    """One law in the ranking."""

    place: str
    name: str
    cites: tuple[int, ...]
    parameters: str
    cells: list[Cell]
    state: str
    words: str
    anchor: str


class ParameterRow(NamedTuple):
    """One fitted parameter as a person reads it."""

    symbol: Markup
    name: str
    meaning: str
    value: Markup
    half: Markup
    unit: Markup
    relative: float | None


class Picture(NamedTuple):
    """A figure as an element of the page, and its caption."""

    svg: Markup
    caption: str
    wide: bool = True


class LawBlock(NamedTuple):
    """All about one law of a study."""

    anchor: str
    title: str
    meaning: str
    cites: tuple[int, ...]
    parameters: list[ParameterRow]
    held: str
    cautions: list[str]
    pictures: list[Picture]


def write_fit_report(studies: Iterable[Study], path: str | Path) -> Path:
    """Write the report of one or more studies as one self-contained HTML file.

    Args:
        studies: one for each force map, with its fits, best first.
        path: of the file.

    Returns:
        The path.
    """
    text = fit_report(studies)
    path = Path(path)
    path.write_text(text, encoding="utf-8", newline="\n")
    return path


def fit_report(studies: Iterable[Study]) -> str:
    """The report of one or more studies as HTML text; arguments as for `write_fit_report`."""
    import jinja2

    found = list(studies)
    keys = _cited(found)
    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("mckibben.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template("fit_report.html.j2").render(
        studies=[_study_page(study, f"s{i}", keys) for i, study in enumerate(found, 1)],
        references=[reference(key) for key in keys],
        versions=versions(),
    )


def versions() -> list[tuple[str, str]]:
    """What computed a report: name and version of the package, of the libraries under it, and of Python."""
    from importlib.metadata import version

    from .. import __version__

    return [
        ("mckibben", __version__),
        *((n, version(n)) for n in ("jax", "numpy", "scipy")),
        ("Python", platform.python_version()),
    ]


# ---- a study


def _study_page(study: Study, mark: str, keys: list[str]) -> dict[str, Any]:
    best = study.fits[0]
    schemes = [s for s in SCHEMES if any(s in f.cross for f in study.fits)]
    held_out = next((f.holdout.what for f in study.fits if f.holdout), "")
    ranking = Picture(
        _inline(
            fit_figures.ranking(study),
            f"{mark}r",
            f"Ranking of the laws for {study.title}; the table below has its numbers.",
        ),
        "Filled triangle: root mean square error of points whose pressure the fit was not shown; "
        "the bar ends at the largest. "
        + (f"Open triangle, dashed: points above, {held_out}. " if held_out else "")
        + "A black mark on the frame: outside of it.",
    )
    return {
        "mark": mark,
        "title": study.title,
        "summary": _summary(study),
        "facts": _facts(study),
        "sources": _sources(study),
        "largest": number(study.points.largest, 1),
        "schemes": [SCHEMES[s] for s in schemes],
        "held_out": held_out,
        "rows": _ranking_rows(study, mark, schemes, bool(held_out), keys),
        "ranking": ranking,
        "laws": [_law_block(fit, study, f"{mark}-{fit.law}", keys, main=fit is best) for fit in study.fits],
        "skipped": [(_title(name), reason) for name, reason in study.skipped.items()],
    }


def _summary(study: Study) -> str:
    best, size = study.fits[0], study.points.largest
    if not best.converged:
        return "No law converged on this table; the numbers below are not to be used."
    words = f"{law_title(best)} fits with {_newton(best.rmse)} root mean square"
    cross = best.cross.get("pressure")
    if cross and not cross.failed:
        words += f" and predicts pressures that it was not shown to {_newton(cross.rmse)}"
        words += f", at worst {_newton(cross.max_error)}"
        words += f" or {_percent(cross.max_error, size)} of the largest tension"
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


def _facts(study: Study) -> list[tuple[str, str]]:
    points = study.points
    taut = int(points.taut.sum())
    asked = len(study.fits[0].points) > taut
    used = "and ask the laws for zero tension" if asked else "and are left out of the fits"
    rows = [
        ("Table", points.name),
        ("Points", f"{len(points)}, of them {taut} with tension; {len(points) - taut} hung slack {used}"),
        ("Length", _range(points.length, "m")),
        ("Pressure, gauge", _range(points.pressure, "Pa")),
        ("Largest tension", f"{_newton(points.largest, 1)}; errors in % refer to it"),
    ]
    if points.rest_length is not None:
        rests = np.unique(points.rest_length)
        rows.insert(3, ("Rest length", ", ".join(_readable(with_unit(float(r), "m")) for r in rests[:6])))
    return rows


def _sources(study: Study) -> list[str]:
    if study.specimen is None:
        return []
    notes = [ATTRIBUTIONS[key] for key in study.specimen.sources if key in ATTRIBUTIONS]
    return notes or [reference(study.specimen.source())]


def _range(values: np.ndarray, unit: str) -> str:
    low, high = (_readable(with_unit(float(v), unit)) for v in (values.min(), values.max()))
    return f"{low} to {high}, {len(np.unique(np.round(values, 9)))} values"


# ---- the ranking


def _ranking_rows(study: Study, mark: str, schemes: list[str], held_out: bool, keys: list[str]) -> list[Row]:
    size = study.points.largest
    numbers = [_numbers(fit, schemes, held_out, size) for fit in study.fits]
    usable = [n for n, f in zip(numbers, study.fits, strict=True) if f.converged]
    best = [_lowest(column) for column in zip(*usable, strict=True)] if usable else [math.nan] * len(numbers[0])
    lowest = min((f.aicc for f in study.fits if f.converged), default=math.nan)
    rows = []
    for i, (fit, values) in enumerate(zip(study.fits, numbers, strict=True), 1):
        cells = [_cell(v, b, j, size, fit.converged) for j, (v, b) in enumerate(zip(values, best, strict=True))]
        distance = fit.aicc - lowest
        if math.isfinite(distance):
            cells.append(Cell(number(distance, 1 if distance < 100.0 else 0), best=distance == 0.0))
        else:
            cells.append(Cell("–", "too few points for this criterion"))
        state, words = _state(fit, size)
        cites = _cite_numbers(law_type(fit.law).cites, keys)
        place = str(i) if fit.converged else "–"
        rows.append(
            Row(place, law_title(fit), cites, str(len(fit.parameters)), cells, state, words, f"{mark}-{fit.law}")
        )
    for title, error in study.published:
        rms, most = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
        cells = [_cell(v, math.nan, j, size, True) for j, v in enumerate((rms, most, most / size))]
        cells += [Cell("–", "nothing was fitted, so nothing was left out")] * (2 * (len(schemes) + held_out) + 1)
        rows.append(Row("", title, (), "–", cells, "", "not fitted here", ""))
    return rows


def _lowest(column: Iterable[float | None]) -> float:
    return min((v for v in column if v is not None and math.isfinite(v)), default=math.nan)


def _numbers(fit: Fit, schemes: list[str], held_out: bool, size: float) -> list[float | None]:
    """Fitted rms [N], largest [N] and its share; then rms [N] and largest share for each scheme and the hold-out."""
    values: list[float | None] = [fit.rmse, fit.max_error, fit.max_error / size]
    for scheme in schemes:
        cross = fit.cross.get(scheme)
        values += [cross.rmse, cross.max_error / size] if cross else [None, None]
    if held_out:
        values += [fit.holdout.rmse, fit.holdout.max_error / size] if fit.holdout else [None, None]
    return values


def _cell(value: float | None, best: float, column: int, size: float, converged: bool) -> Cell:
    share = column == 2 or (column > 2 and column % 2 == 0)
    if value is None:
        return Cell("–", "not asked for, or the table has one group only")
    if not math.isfinite(value):
        return Cell("–", "a fit without the points left out did not converge, or had too few points")
    if value > (DIVERGES if share else DIVERGES * size):
        return Cell("diverges", "more than ten times the largest tension")
    digits = (2 if value < 0.1 else 1) if share else (2 if value < 10.0 else 1)
    return Cell(number(100.0 * value if share else value, digits), best=converged and value == best)


def _state(fit: Fit, size: float) -> tuple[str, str]:
    """A mark and a few words: whether a fit converged, and what to mind."""
    if not fit.converged:
        return "stop", "did not converge"
    words = []
    if any("apart" in w for w in fit.warnings):
        words.append("parameters hard to tell apart")
    if any("bound" in w for w in fit.warnings):
        words.append("a parameter on its bound")
    if any("do not contain" in w for w in fit.warnings):
        words.append("a parameter not in the data")
    if fit.holdout and not fit.holdout.max_error < 0.2 * size:
        words.append("does not extrapolate in pressure")
    if any(c.failed for c in fit.cross.values()):
        words.append("some points could not be predicted")
    return ("caution", "; ".join(words)) if words else ("", "converged")


# ---- one law


def _law_block(fit: Fit, study: Study, anchor: str, keys: list[str], *, main: bool) -> LawBlock:
    kind = law_type(fit.law)
    return LawBlock(
        anchor=anchor,
        title=law_title(fit),
        meaning=(kind.__doc__ or "").strip().split("\n")[0],
        cites=_cite_numbers(kind.cites, keys),
        parameters=[_parameter(name, fit) for name in fit.parameters],
        held=_held(fit),
        cautions=_cautions(fit, study.points.largest),
        pictures=[_curves(fit, study, anchor), *(_more_pictures(fit, anchor) if main else [])],
    )


def _curves(fit: Fit, study: Study, anchor: str) -> Picture:
    title = law_title(fit)
    fig = fit_figures.tension_curves(fit, study.points)
    return Picture(
        _inline(
            fig, _word(anchor, "c"), f"{study.title}: measured tension over length and {title}, one line per pressure."
        ),
        "Tension over length. Triangles are measured, lines the fitted law, each from its free length on; "
        "the gauge pressure stands at the line's end. Open circles: the muscle hung slack there at one or more pressures.",
        wide=False,
    )


def _more_pictures(fit: Fit, anchor: str) -> list[Picture]:
    title, found = law_title(fit), []
    matrix = fit_figures.correlation(fit)
    if matrix is not None:
        found.append(
            Picture(
                _inline(matrix, _word(anchor, "k"), f"Correlation of the estimates of {title}."),
                "Near +1 or −1 the data fix a combination of the two parameters, not each of them.",
                wide=False,
            )
        )
    found.append(
        Picture(
            _inline(fit_figures.residuals(fit), _word(anchor, "e"), f"Errors of {title}, fitted and predicted."),
            "Errors of the fit, and of points predicted by fits that were not shown their pressure or length. "
            "The band is 1\N{NO-BREAK SPACE}% of the largest tension; "
            "black marks on the frame stand for points outside of it.",
        )
    )
    beyond = fit_figures.hold_out(fit)
    if beyond is not None:
        found.append(
            Picture(
                _inline(beyond, _word(anchor, "h"), f"{title} trained at low pressure and asked above."),
                "A separate fit saw the shaded pressures only. Filled triangles are measured, open ones predicted; "
                "the length stands at the line's end. The band is 3\N{NO-BREAK SPACE}% of the largest tension.",
            )
        )
    return found


def _word(anchor: str, letter: str) -> str:
    return anchor.replace("_", "") + letter


def _parameter(name: str, fit: Fit) -> ParameterRow:
    estimate, q = fit.parameters[name], declared(law_type(fit.law))[name]
    unit = shown_unit(estimate.unit)
    value, low, high = (from_si(v, estimate.unit, unit) if math.isfinite(v) else v for v in estimate[:3])
    half = 0.5 * (high - low) if math.isfinite(high - low) else math.inf
    text, spread = _value_and_half(value, half)
    relative = half / abs(value) if value and math.isfinite(half) else None
    return ParameterRow(_symbol(q.symbol, name), name, q.doc, text, spread, _unit(unit), relative)


def _value_and_half(value: float, half: float) -> tuple[Markup, Markup]:
    """A value and its half-width with the same power of ten, the half-width to two digits."""
    if not math.isfinite(value):
        return Markup("–"), Markup("–")
    size = max(abs(value), half if math.isfinite(half) else 0.0, 1e-300)
    power = math.floor(math.log10(size))
    power = power if power >= 6 or power <= -4 else 0
    scaled, spread = value / 10.0**power, half / 10.0**power
    if math.isfinite(spread) and spread > 0.0:
        digits = min(max(1 - math.floor(math.log10(spread)), 0), 6)
    else:
        digits = min(max(3 - math.floor(math.log10(max(abs(scaled), 1e-6))), 0), 6)
    tail = Markup("\N{THIN SPACE}×\N{THIN SPACE}10<sup>{}</sup>").format(number(power)) if power else Markup("")
    if not math.isfinite(spread):
        return escape(number(scaled, digits)) + tail, escape("not determined")
    width = Markup("±\N{THIN SPACE}{}").format(number(spread, digits)) + tail
    return escape(number(scaled, digits)) + tail, width


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


def _cautions(fit: Fit, size: float) -> list[str]:
    found = []
    if not fit.converged:
        found.append(
            f"The fit did not converge ({fit.message}). Its numbers are not to be used, and it is ranked last."
        )
    told = [w for w in fit.warnings if not w.startswith("did not converge")]
    found += [_sentence(w) for w in told]
    if any("apart" in w for w in told):
        found.append(
            "Where two parameters cannot be told apart, trust what the law predicts near the data, not these values."
        )
    for scheme, cross in fit.cross.items():
        if cross.failed:
            found.append(
                f"With one {SCHEMES.get(scheme, scheme)} left out, {cross.failed} of {cross.groups} fits had too few points "
                "or did not converge; no error is stated for that column."
            )
    if fit.holdout and not fit.holdout.max_error < 0.2 * size:
        bounded = fit.holdout.max_error < DIVERGES * size
        how = f"by up to {_percent(fit.holdout.max_error, size)}" if bounded else "without bound"
        what = _sentence(fit.holdout.what)[:-1]
        found.append(f"{what}, it misses what lies above {how}. Do not use it beyond the pressures measured.")
    across = [n for n, e in fit.parameters.items() if math.isfinite(e.high - e.low) and e.low < 0.0 < e.high]
    if across:
        found.append(f"The interval of {_listed(across)} includes zero.")
    return found


# ---- words


def _cited(studies: list[Study]) -> list[str]:
    keys: dict[str, None] = {}
    for study in studies:
        keys |= dict.fromkeys(study.specimen.sources if study.specimen else ())
        for fit in study.fits:
            keys |= dict.fromkeys(law_type(fit.law).cites)
    return list(keys)


def _cite_numbers(cites: Iterable[str], keys: list[str]) -> tuple[int, ...]:
    return tuple(sorted(keys.index(key) + 1 for key in cites))


def _title(law: str) -> str:
    return str(law_type(law).title)


def _inline(fig: Any, name: str, label: str) -> Markup:
    return Markup(inline_svg(fig, name, label))


def _newton(value: float, digits: int | None = None) -> str:
    return number(value, digits if digits is not None else 2 if abs(value) < 10.0 else 1) + "\N{NO-BREAK SPACE}N"


def _percent(value: float, size: float) -> str:
    share = 100.0 * value / size
    return number(share, 2 if share < 10.0 else 0) + "\N{NO-BREAK SPACE}%"


def _readable(text: str) -> str:
    """A value with its unit in type: a true minus, and a space that does not break."""
    return text.replace("-", "\N{MINUS SIGN}").replace(" deg", "°").replace(" ", "\N{NO-BREAK SPACE}")


def _unit(unit: str) -> Markup:
    import re

    if unit == "1":
        return Markup("")
    text = str(escape(unit)).replace("deg", "°").replace("*", "\N{MIDDLE DOT}").replace("^0.5", "^½")
    return Markup(re.sub(r"\^(-?\d+|½)", r"<sup>\1</sup>", text))


def _symbol(symbol: str, name: str) -> Markup:
    if not symbol:
        return Markup("")
    head = symbol.rstrip("0123456789")
    if head == symbol and "_" in symbol:
        head = symbol.split("_")[0]
    elif head == symbol and symbol_text(symbol) == symbol and len(symbol) > 1:
        head = symbol[0]
    low = symbol[len(head) :].lstrip("_")
    return Markup("<i>{}</i>").format(symbol_text(head)) + (Markup("<sub>{}</sub>").format(low) if low else Markup(""))


def _sentence(text: str) -> str:
    first = text.split(" ", 1)[0]
    return (text if "_" in first else text[:1].upper() + text[1:]).rstrip(".") + "."


def _listed(names: list[str]) -> str:
    return names[0] if len(names) == 1 else ", ".join(names[:-1]) + " and " + names[-1]
