"""What the pictures of a fit show, in the units of their axes: points, curves, errors, predictions, the surface."""

from __future__ import annotations

import html
import json
from typing import TYPE_CHECKING, Any

import numpy as np

from ....quantities import from_si

if TYPE_CHECKING:
    from ....identification import Fit
    from ....recordings import ForceMap
    from ....report.fit_study import Study

STRONG = 7  # curves that are drawn heavy and have their pressure beside them
SLACK = 400  # lengths without tension that are marked
MOST_POINTS = 3000  # of a table that are drawn
GRID = (13, 17)  # pressures and lengths of the surface


def rests(points: ForceMap) -> list[float]:
    """The rest lengths of the muscles of a table [m]; none where it has none."""
    return [] if points.rest_length is None else [float(r) for r in np.unique(points.rest_length[points.taut])]


def drawn(fit: Fit, study: Study, rest: float | None) -> dict[str, Any]:
    """All that the pictures of one law need.

    Args:
        fit: the law.
        study: that it belongs to.
        rest: rest length of the muscle that is shown [m], where the table has several.
    """
    from ....report.figures.fit_figures import levels_of, tension_grid
    from ....report.fit_report import ATTRIBUTIONS

    points, same = study.points, np.ones(len(study.points), bool)
    if rest is not None and points.rest_length is not None:
        same = points.rest_length == rest
    some, taut = points.select(same), same[points.taut]
    law = _law(fit, taut)
    cm, bar = from_si(1.0, "m", "cm"), from_si(1.0, "Pa", "bar")
    low, high = float(some.length.min()), float(some.length.max())
    own = None if some.rest_length is None else float(some.rest_length.max())
    reach = max(high, own or high)
    levels, _ = levels_of(some)
    lengths = np.linspace(low - 0.025 * (reach - low), reach, 61)
    pulls = [_pull(lengths, force) for force in tension_grid(law, lengths, levels)]
    surface = np.linspace(low, reach, GRID[1]), np.linspace(0.0, float(some.pressure.max()), GRID[0])
    heights = np.maximum(tension_grid(law, surface[0], surface[1]), 0.0)
    return {
        "points": _points(fit, taut, cm, bar),
        "slack": sorted({_short(v * cm) for v in some.length[~some.taut]})[:: max(1, int((~some.taut).sum()) // SLACK)],
        "curves": [
            {"P": _short(p * bar), "x": _rounded(x * cm), "y": _rounded(y)}
            for p, (x, y) in zip(levels, pulls, strict=True)
        ],
        "labelled": sorted({int(i) for i in np.linspace(0, len(levels) - 1, min(STRONG, len(levels))).round()}),
        "x": [_short((lengths[0] - 0.01 * (reach - low)) * cm), _short((reach + 0.03 * (reach - low)) * cm)],
        "top": _short(float(some.tension.max())),
        "highest": _short(float(some.pressure.max()) * bar),
        "rest": None if own is None else _short(own * cm),
        "percent": 0.01 * points.largest,
        "left": _left(fit, taut, cm, bar),
        "source": "; ".join(
            f"Data: {ATTRIBUTIONS[k]}" for k in (study.specimen.sources if study.specimen else ()) if k in ATTRIBUTIONS
        ),
        "surface": {
            "lengths": _rounded(surface[0] * cm), "pressures": _rounded(surface[1] * bar),
            "tension": [_rounded(row) for row in heights],
        },
    }  # fmt: skip


def figure(kind: str, data: dict[str, Any], name: str, height: int) -> str:
    """The element that the browser draws into."""
    needed = {
        "tension": "points slack curves labelled x top rest source", "errors": "points x percent",
        "bubbles": "points x highest", "left": "left highest percent", "surface": "points surface top highest",
    }[kind]  # fmt: skip
    spec = html.escape(json.dumps({k: data[k] for k in needed.split()}, separators=(",", ":")))
    return (
        f'<figure class="fitplot" tabindex="0" role="img" aria-label="{html.escape(name)}" data-kind="{kind}" '
        f'data-height="{height}" style="height:{height}px" data-fit="{spec}"></figure>'
    )


def _pull(lengths: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The part of a curve on which the braid pulls, up to the longest length that the law knows; [m], [N]."""
    from ....report.figures.fit_figures import pulling

    last = np.flatnonzero(force > 0.0)
    end = int(last[-1]) + 1 if last.size else 0
    return pulling(lengths[:end], force[:end])


def _law(fit: Fit, taut: np.ndarray) -> Any:
    """The law of the muscles whose taut points are chosen, bool (n,): what is known of each may differ."""
    own = {k: float(np.asarray(v)[taut].max()) for k, v in fit.known.items() if np.ndim(v) and taut.any()}
    return fit.build(**own)


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
    """For every pressure the largest error of its points when it was left out, measured less predicted [N]."""
    if "pressure" not in fit.cross:
        return []
    error, found = -fit.cross["pressure"].error, []
    pressures = np.round(fit.points.pressure, 6)
    for p in np.unique(pressures[taut]):
        here = np.flatnonzero(taut & (pressures == p) & np.isfinite(error))
        if here.size:
            worst = here[np.argmax(np.abs(error[here]))]
            place = {"L": _short(fit.points.length[worst] * cm), "P": _short(p * bar)}
            found.append({**place, "e": _short(error[worst])})
    return found


def _short(value: float) -> float:
    return float(f"{value:.7g}")


def _rounded(values: np.ndarray) -> list[float]:
    return [_short(v) for v in values]


def values(data: dict[str, Any]) -> None:
    """The points as a table, for who cannot see them."""
    from ...widgets import box, table, text
    from .results import number

    rows = [[number(p["L"], 2), number(p["P"], 3), number(p["F"], 1), number(p["e"], 2)] for p in data["points"][:400]]
    with box("details", "values"):
        text("summary", "Table of values")
        heads = ("Length, cm", "Pressure, bar", "Tension, N", "Measured \u2212 fitted, N")
        table(heads, rows, right=(0, 1, 2, 3), name="Measured points")
