"""Results of a fit: ranking, parameters with intervals, cautions, and figures."""

from __future__ import annotations

import html
import inspect
import json
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from ....documents import JsonValue
from ....identification import Fit
from ....identification.ranking import COLUMNS, Ranking, cautions_of
from ....muscles.laws import LAWS, law_type
from ....quantities import declared, from_si, shown_unit
from ....recordings import ForceMap
from ....report.blocks import unit_text
from ....report.figures.fit_figures import levels_of, pulling, tension_grid
from ....report.figures.style import symbol_text
from ....report.fit_report import value_and_half
from ...charts import plain_numbers
from ...widgets import THIN, box, grouped, note, raw, table, text

HALF = 0.5  # of the value, that the scale of the intervals shows to either side


def ranking(study: Ranking, chosen: str, pick: Callable[[str], object], final: bool) -> None:
    """Build the table of laws, best first, and published ones below; a click or Enter picks a row.

    Until the last law is fitted rows stand in the order of the laws, without a place or a distance from the best.
    """
    rows = study.ranked()
    if not final:
        order = [*LAWS, *(row["law"] for row in rows)]
        rows = [row | {"place": "-", "distance": None} for row in sorted(rows, key=lambda row: order.index(row["law"]))]
    widest = max((row["rmse"] for row in rows if math.isfinite(row["rmse"])), default=1.0)
    held = next((f.holdout.what for f in study.fits if f.holdout), "")
    above = [held] if held else []
    columns = ["", "Law", "Parameters", "RMS error", "Largest error", "RMS, left out", *above, "\u0394 AICc"]
    with box("div", "scroll-x"), box("table", "rank").set(aria_label="Ranking"):
        with box("thead"), box("tr"):
            for i, column in enumerate(columns):
                text("th", column, "num" if i not in (1, 3) else "").set(scope="col")
        with box("tbody"):
            for row in rows:
                _row(row, widest, bool(held), chosen, pick)


def _row(row: Mapping[str, Any], widest: float, held: bool, chosen: str, pick: Callable[[str], object]) -> None:
    law = row["law"] if "fit" in row else ""  # a published one has no row to pick
    picked = bool(law) and law == chosen

    def number(key: str) -> str:
        words = COLUMNS[key].text(row.get(key)).removesuffix(" N").replace(" %", f"{THIN}%")
        return "\u2013" if words == "-" else words.replace("-", "\u2212")

    with box("tr", "sel" if picked else "") as line:
        line.set(data_law=law, data_rmse=repr(row["rmse"]), data_most=repr(row["max_error"]))
        line.set(data_left=repr(row.get("left_out_rmse")), data_aicc=repr(row.get("aicc")))
        if law:
            line.classed("pick").set(tabindex="0", aria_current="true" if picked else "false")
            line.on("click", lambda: pick(law)).on("enter", lambda: pick(law))
        text("td", str(row.get("place", "")).replace("-", "\u2013"))
        title = html.escape(row["title"])
        why = f' <span class="faint">{html.escape(row["verdict"])}</span>' if law and row["verdict"] else ""
        raw((f"<b>{title}</b>" if picked else title) + why, "td", "law-name")
        text("td", str(row["free"]) if law else "published", "num" if law else "num faint")
        share = min(1.0, row["rmse"] / widest) if math.isfinite(row["rmse"]) else 1.0
        bar = f'<span class="track"><i style="width:{100.0 * share:.1f}%"></i></span>'
        raw(f'<div>{bar}<span class="num">{number("rmse")}</span></div>', "td", "bar")
        raw(f'{number("max_error")} <span class="faint">{number("share")}</span>', "td", "num")
        text("td", number("left_out_rmse"), "num")
        if held:
            text("td", number("above_share"), "num")
        text("td", beyond_best(row.get("distance")), "num")


def beyond_best(distance: float | None) -> str:
    """Distance of a criterion from the least of the converged fits, which one that did not converge may be below."""
    words = COLUMNS["distance"].text(distance)
    if words == "-" or not distance:
        return "\u2013" if words == "-" else "0"
    return words.replace("-", "\u2212") if distance < 0.0 else f"+{words}"


def parameters(fit: Fit) -> None:
    """Show each parameter with its half-width and unit, and a whisker over a scale of half its value to either side."""
    # equations as the law's module states them: the indented lines of its docstring
    module, fields = inspect.getmodule(law_type(fit.law)), declared(law_type(fit.law))
    lines = (module.__doc__ or "").splitlines() if module else []
    equations = [line[4:].rstrip() for line in lines if line.startswith("    ") and "=" in line]
    if equations:
        text("pre", "\n".join(equations), "formula")
    with box("table", "par").set(aria_label="Parameters with 95 % intervals"), box("tbody"):
        for name, e in fit.parameters.items():
            unit, about = shown_unit(e.unit), fields[name].doc
            value, low, high = (from_si(v, e.unit, unit) if math.isfinite(v) else v for v in e[:3])
            half = 0.5 * (high - low) if math.isfinite(high - low) else math.inf
            said, spread = value_and_half(value, half)
            ends = {"data_value": repr(e.value), "data_low": repr(e.low), "data_high": repr(e.high)}
            with box("tr").set(data_parameter=name, **ends):
                raw(html.escape(symbol_text(fields[name].symbol, name).replace("_", " ")), "td", "sym").set(title=about)
                text("td", said, "num").style(font_weight="600")
                text("td", spread, "num faint")
                text("td", unit_text(unit), "faint")
                raw(_whisker(value, half), "td").style(width="124px")
            with box("tr"):
                cell = raw(f"<small>{html.escape(about)}</small>", "td").set(colspan="5")
                cell.style(padding_top="0", border_top="0")
    scale = f"\u221250{THIN}% &#160;&#160;&#160; of the value &#160;&#160;&#160; +50{THIN}%"
    raw(scale, "p", "faint small num").style(padding="4px 6px")


def _whisker(value: float, half: float) -> str:
    if not (value and math.isfinite(half)):
        return '<span class="faint">not determined</span>'
    share = half / abs(value)
    reach = 56.0 * min(share, HALF) / HALF
    ends = "".join(
        f'<path d="M{60 + s * reach:.1f} 2v8" stroke="var(--ink)" stroke-width="1.5"/>'
        if share <= HALF
        else f'<path d="M{60 + s * 52} 2l{s * 6} 4l{-s * 6} 4" fill="none" stroke="var(--ink)" stroke-width="1.5"/>'
        for s in (-1, 1)
    )
    return (
        f'<svg height="12" viewBox="0 0 120 12" role="img" aria-label="plus minus {100.0 * share:.3g} percent of the value">'
        f'<path d="M60 0v12" stroke="var(--edge)"/><path d="M{60 - reach:.1f} 6H{60 + reach:.1f}" stroke="var(--ink)" '
        f'stroke-width="2"/>{ends}<circle cx="60" cy="6" r="3" fill="var(--ink)"/></svg>'
    )


def cautions(fit: Fit, study: Ranking) -> None:
    """Show the cautions about one law, and why others could not be fitted."""
    sentences = cautions_of(fit, study.points.largest)
    if sentences:
        note(" ".join(sentences))
    if study.skipped:
        with box("details"):
            text("summary", "Laws that were left out")
            for law, why in study.skipped.items():
                text("p", f"{law}: {why}", "small dim")


STRONG = 7  # curves that are drawn heavy and have their pressure beside them
SLACK = 400  # lengths without tension that are marked
MOST_POINTS = 3000  # of a table that are drawn
GRID = (13, 17)  # pressures and lengths of the surface


def rests(points: ForceMap) -> list[float]:
    """Rest lengths of the muscles in a table [m]; empty if it names none."""
    return [] if points.rest_length is None else [float(r) for r in np.unique(points.rest_length[points.taut])]


def drawn(fit: Fit, study: Ranking, rest: float | None) -> dict[str, JsonValue]:
    """Compute everything that the figures of one law need."""
    points, same = study.points, np.ones(len(study.points), bool)
    if rest is not None and points.rest_length is not None:
        same = points.rest_length == rest
    some, taut = points.select(same), same[points.taut]
    # known parameters of the muscles that are chosen may differ from those of the others
    known = {k: float(np.asarray(v)[taut].max()) for k, v in fit.known.items() if np.ndim(v) and taut.any()}
    law = fit.build(**known)
    cm, bar = from_si(1.0, "m", "cm"), from_si(1.0, "Pa", "bar")
    low, high = float(some.length.min()), float(some.length.max())
    own = None if some.rest_length is None else float(some.rest_length.max())
    reach = max(high, own or high)
    levels, _ = levels_of(some)
    lengths = np.linspace(low - 0.025 * (reach - low), reach, 61)
    pulls = []  # the part of each curve with positive tension, up to the longest length of the law
    for force in tension_grid(law, lengths, levels):
        end = int(np.flatnonzero(force > 0.0)[-1]) + 1 if (force > 0.0).any() else 0
        pulls.append(pulling(lengths[:end], force[:end]))
    surface = np.linspace(low, reach, GRID[1]), np.linspace(0.0, float(some.pressure.max()), GRID[0])
    heights = np.maximum(tension_grid(law, surface[0], surface[1]), 0.0)
    return {
        "points": _points(fit, taut, cm, bar),
        "slack": sorted({_short(v * cm) for v in some.length[~some.taut]})[:: max(1, int((~some.taut).sum()) // SLACK)],
        "curves": [
            {"P": _short(p * bar), "x": plain_numbers(x * cm), "y": plain_numbers(y)}
            for p, (x, y) in zip(levels, pulls, strict=True)
        ],
        "labelled": sorted({int(i) for i in np.linspace(0, len(levels) - 1, min(STRONG, len(levels))).round()}),
        "x": [_short((lengths[0] - 0.01 * (reach - low)) * cm), _short((reach + 0.03 * (reach - low)) * cm)],
        "top": _short(float(some.tension.max())),
        "highest": _short(float(some.pressure.max()) * bar),
        "rest": None if own is None else _short(own * cm),
        "percent": 0.01 * points.largest,
        "left": _left(fit, taut, cm, bar),
        "source": f"Data: {study.data_source()}" if study.data_source() else "",
        "surface": {
            "lengths": plain_numbers(surface[0] * cm),
            "pressures": plain_numbers(surface[1] * bar),
            "tension": [plain_numbers(row) for row in heights],
        },
    }


def figure(kind: str, data: dict[str, JsonValue], name: str, height: int) -> str:
    """Element that the browser draws into."""
    needed = {
        "tension": "points slack curves labelled x top rest source",
        "errors": "points x percent",
        "bubbles": "points x highest",
        "left": "left highest percent",
        "surface": "points surface top highest",
    }[kind]
    spec = html.escape(json.dumps({k: data[k] for k in needed.split()}, separators=(",", ":")))
    return (
        f'<figure class="fitplot" tabindex="0" role="img" aria-label="{html.escape(name)}" data-kind="{kind}" '
        f'data-height="{height}" style="height:{height}px" data-fit="{spec}"></figure>'
    )


def _points(fit: Fit, taut: np.ndarray, cm: float, bar: float) -> list[dict[str, float]]:
    """Length [cm], pressure [bar], tension and measured less fitted [N] of every taut point, of `MOST_POINTS` at most."""
    at = np.flatnonzero(taut)
    if len(at) > MOST_POINTS:  # evenly some, and those with the largest errors
        worst = at[np.argsort(-np.abs(fit.error[at]))[: MOST_POINTS // 10]]
        at = np.union1d(at[np.linspace(0, len(at) - 1, MOST_POINTS - len(worst)).astype(int)], worst)
    columns = (fit.points.length * cm, fit.points.pressure * bar, fit.points.tension, -fit.error)
    rows = zip(*(column[at] for column in columns), strict=True)
    return [{"L": _short(x), "P": _short(p), "F": _short(f), "e": _short(e)} for x, p, f, e in rows]


def _left(fit: Fit, taut: np.ndarray, cm: float, bar: float) -> list[dict[str, float]]:
    """Largest error of the points of every pressure when it was left out, measured less predicted [N]."""
    if "pressure" not in fit.cross:
        return []
    error, errors = -fit.cross["pressure"].error, []
    pressures = np.round(fit.points.pressure, 6)
    for p in np.unique(pressures[taut]):
        points = np.flatnonzero(taut & (pressures == p) & np.isfinite(error))
        if points.size:
            worst = points[np.argmax(np.abs(error[points]))]
            place = {"L": _short(fit.points.length[worst] * cm), "P": _short(p * bar)}
            errors.append({**place, "e": _short(error[worst])})
    return errors


def _short(value: float) -> float:
    return float(f"{value:.7g}")


def values(data: dict[str, JsonValue]) -> None:
    """Table of the points, for screen readers."""
    rows = [
        [grouped(p["L"], 2), grouped(p["P"], 3), grouped(p["F"], 1), grouped(p["e"], 2)] for p in data["points"][:400]
    ]
    with box("details", "values"):
        text("summary", "Table of values")
        heads = ("Length, cm", "Pressure, bar", "Tension, N", "Measured \u2212 fitted, N")
        table(heads, rows, right=(0, 1, 2, 3), name="Measured points")
