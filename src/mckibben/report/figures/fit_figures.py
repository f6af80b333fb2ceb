"""Figures of an identification: curves over points, residuals, ranking, correlation, extrapolation, and a posterior's bands.

Points are measured, lines are the law. Tension and its errors are in the colour of tension, pressures written at the
line ends in theirs.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from ...components import jit_arrays
from ...identification import Fit
from ...identification.posterior import Posterior
from ...identification.ranking import Ranking
from ...muscles.law import TensionLaw
from ...muscles.laws import law_type
from ...quantities import declared, from_si, shown_unit
from ...recordings import ForceMap
from . import style
from .ranking_figures import draw_ranking as draw_ranking
from .ranking_figures import law_title as law_title
from .ranking_figures import ranking as ranking
from .style import COLOURS, INK, INK_2, INK_3, PANEL, SUNKEN, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ...batch.posterior import PredictedRun
    from ...identification.hysteresis_fit import LoopFit
    from ...identification.record_posterior import RecordPosterior


MOST_LINES, MOST_LABELS, MOST_PANELS = 24, 8, 3
FINE = 61
FRICTIONS = {"bouc_wen": "Bouc-Wen", "dahl": "Dahl", "maxwell_slip": "Maxwell-slip"}
KEY = "▲ measured\N{EM SPACE}○ measured, slack\N{EM SPACE}— law"


# ---- 1 tension over length


@style.styled()
def tension_curves(fit: Fit, points: ForceMap) -> Figure:
    """Draw the tension of a whole table and a law over length, a line per pressure, a panel per rest length."""
    muscles = _muscles(fit, points)
    several = len(muscles) > 1
    fig = style.figure(style.MIDDLE, 5.0 if several else 4.7)
    grid = fig.add_gridspec(
        1, len(muscles), left=0.075, right=0.895, bottom=0.105, top=0.81 if several else 0.855, wspace=0.68
    )
    for i, (rest, law, some) in enumerate(muscles):
        ax = fig.add_subplot(grid[i])
        draw_curves(ax, law, some, top=points.largest)
        if i == 0:
            style.heading(ax, law_title(fit), KEY, above=44.0 if several else 24.0)
        if several and rest:
            style.heading(ax, f"{number(from_si(rest, 'm', 'cm'), 1)}\N{NO-BREAK SPACE}cm at rest", above=24.0)
    return fig


def _muscles(fit: Fit, points: ForceMap) -> list[tuple[float | None, TensionLaw, ForceMap]]:
    """The muscles of a table, each with its law and its points; the shortest, the longest and one between of many."""
    if points.rest_length is None:
        return [(None, fit.build(), points)]
    rests = np.unique(points.rest_length[points.taut])
    chosen = rests[np.unique(np.linspace(0, len(rests) - 1, min(MOST_PANELS, len(rests))).round().astype(int))]
    muscles: list[tuple[float | None, TensionLaw, ForceMap]] = []
    for rest in chosen:
        same = fit.points.rest_length == rest if fit.points.rest_length is not None else np.ones(len(fit.points), bool)
        known = {k: float(np.asarray(v)[same].max()) for k, v in fit.known.items() if np.ndim(v)}
        muscles.append((float(rest), fit.build(**known), points.select(points.rest_length == rest)))
    return muscles


@functools.cache
def _tension_function() -> Callable[[TensionLaw, Any, Any], Any]:
    def force(law: TensionLaw, length: Any, pressure: Any) -> Any:
        return law.braid_tension(length, pressure)

    return jit_arrays(force)


def tension_grid(law: TensionLaw, lengths: np.ndarray, pressures: Iterable[float]) -> np.ndarray:
    """Signed force of the braid (pressures, n) [N] at lengths (n,) [m] and gauge pressures [Pa]; negative where slack."""
    function = _tension_function()
    # One pressure at a time and as an array, so that a law is compiled once for all figures.
    return np.stack([np.asarray(function(law, lengths, np.asarray(p, float))) for p in pressures])


def draw_fit(ax: Axes, fit: Fit, points: ForceMap) -> None:
    """Points and lines of the table's muscle, of several rest lengths the longest, into axes."""
    _, law, some = _muscles(fit, points)[-1]
    draw_curves(ax, law, some, top=some.largest)


def draw_curves(ax: Axes, law: TensionLaw, points: ForceMap, *, top: float) -> None:
    """Draw points and lines into axes; labels right of them need about 45 pt."""
    taut = points.select(points.taut)
    levels, near = levels_of(points)
    low, high = float(points.length.min()), float(points.length.max())
    reach = max(high, float(points.rest_length.max())) if points.rest_length is not None else high
    reach = max(high, min(reach, float(law.length_range()[1])))  # beyond its range a law is no curve to draw
    margin = 0.025 * (reach - low)
    lengths = np.linspace(low - margin, reach, FINE)
    tension = tension_grid(law, lengths, levels)
    cm = from_si(1.0, "m", "cm")
    ax.set_xlim((lengths[0] - margin) * cm, (reach + margin) * cm)
    ax.set_ylim(-0.015 * top, 1.06 * max(top, float(np.nanmax(np.minimum(tension, 1.5 * top)))))
    style.quantity_axes(ax, x=("Length, cm", "length"), y=("Tension, N", "tension"))
    room = 10.5  # of a label [pt]
    labelled = _apart(ax, tension[:, -1], room)
    for i, opacity in enumerate(style.graded(len(levels), 0.55)):
        strong = i in labelled
        taut_lengths, line = pulling(lengths, tension[i])
        ax.plot(
            taut_lengths * cm,
            line,
            color=COLOURS["tension"],
            lw=style.LINE if strong else 0.6,
            alpha=opacity if strong else 0.45,
            zorder=2,
            solid_capstyle="round",
        )
    slack = ~points.taut & near
    hanging = np.unique(np.round(points.length[slack], 6))
    ax.plot(hanging * cm, np.zeros(len(hanging)), "o", mfc=PANEL, mec=INK_3, mew=0.7, ms=3.2, clip_on=False, zorder=3)
    shown = taut.select(near[points.taut])
    ax.plot(
        shown.length * cm,
        shown.tension,
        style.MARKERS["tension"],
        mfc=COLOURS["tension"],
        mec=PANEL,
        mew=0.4,
        ms=5.0,
        zorder=4,
    )
    bar = [from_si(float(p), "Pa", "bar") for p in levels]
    ends = [(reach * cm, float(tension[i, -1]), style.pressure_text(bar[i], unit=i == max(labelled))) for i in labelled]
    style.end_labels(ax, ends, quantity="pressure", gap=room)


def pulling(lengths: np.ndarray, force: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Part of a curve with positive tension, from its free length on; lengths [m], signed forces [N].

    Only the stretch that ends at the longest length is drawn: a law may pull again far below its range.
    """
    signs = np.flatnonzero(~(force > 0.0))
    first = int(signs[-1]) + 1 if signs.size else 0
    if first == 0 or first == len(force):
        return lengths[first:], force[first:]
    a, b = force[first - 1], force[first]
    share = a / (a - b) if np.isfinite(a) else 1.0
    start = lengths[first - 1] + share * (lengths[first] - lengths[first - 1])
    return np.concatenate([[start], lengths[first:]]), np.concatenate([[0.0], force[first:]])


def levels_of(points: ForceMap) -> tuple[np.ndarray, np.ndarray]:
    """Pressures of the lines [Pa], and the points on each; a selection for a table without common pressures."""
    taut = points.pressure[points.taut]
    distinct = np.unique(np.round(taut, 3))
    if len(distinct) <= MOST_LINES:
        return distinct, np.ones(len(points), bool)
    step = 1e5 if taut.max() > 4e5 else 0.5e5 if taut.max() > 2e5 else taut.max() / 5.0
    levels = np.arange(1, int(taut.max() / step + 0.05) + 1) * step
    return levels, np.abs(points.pressure[:, None] - levels).min(axis=1) < 0.01 * taut.max()


def _apart(ax: Axes, ends: np.ndarray, room: float) -> list[int]:
    """Lines to label: from the highest down, each at least 1.6 labels below the previous one."""
    height = ax.get_window_extent().height * 72.0 / ax.figure.dpi
    low, high = ax.get_ylim()
    points = (ends - low) / (high - low) * height
    chosen: list[int] = []
    for i in reversed(range(len(ends))):
        if points[i] <= height and (
            not chosen or points[chosen[-1]] - points[i] >= max(1.6 * room, height / (MOST_LABELS + 1))
        ):
            chosen.append(i)
    return chosen[::-1] or [int(np.argmin(ends))]


# ---- 2 residuals


@style.styled()
def residuals(fit: Fit) -> Figure:
    """Draw errors over pressure: of the fit, and of points predicted with their pressure and their length left out.

    The band is 1 % of the largest tension either way. What lies outside the frame is drawn on its edge and counted.
    """
    panels = [("Fitted", "all points seen", fit.error, "pressure")]
    if "pressure" in fit.cross:
        panels.append(("Predicted", "its pressure left out", fit.cross["pressure"].error, "pressure"))
    scheme = "rest_length" if "rest_length" in fit.cross else "length"
    if scheme in fit.cross:
        left_out = "its rest length left out" if scheme == "rest_length" else "its length left out"
        panels.append(("Predicted", left_out, fit.cross[scheme].error, "length"))
    fig = style.figure(style.WIDE, 3.3)
    grid = fig.add_gridspec(1, len(panels), left=0.05, right=0.955, bottom=0.155, top=0.80, wspace=0.13)
    errors = np.concatenate([np.abs(e[np.isfinite(e)]) for _, _, e, _ in panels[:2]])
    limit = max(1.15 * float(errors.max()), 0.017 * fit.points.largest)
    limit = min(limit, 8.0 * max(float(np.sqrt(np.mean(errors**2))), 0.005 * fit.points.largest))
    for i, (head, remark, error, over) in enumerate(panels):
        ax = fig.add_subplot(grid[i])
        values, title = _over(fit.points, over)
        _draw_errors(ax, values, error, limit, filled=i == 0)
        style.quantity_axes(ax, x=(title, over), y=("Law less measured, N", "tension"))
        low, high = float(values.min()), float(values.max())
        margin = 0.05 * (high - low) or 0.05 * abs(high) or 1.0
        ax.set_xlim(*((0.0 if (over == "pressure") and low >= 0.0 else low - margin), high + margin))
        style.heading(ax, head, remark, above=24.0)
        _band(ax, 0.01 * fit.points.largest, label=i == len(panels) - 1)
    return fig


def _over(points: ForceMap, what: str) -> tuple[np.ndarray, str]:
    if what == "pressure":
        return np.array([from_si(float(p), "Pa", "bar") for p in points.pressure]), "Pressure, bar"
    return points.length * from_si(1.0, "m", "cm"), "Length, cm"


def _draw_errors(ax: Axes, values: np.ndarray, error: np.ndarray, limit: float, *, filled: bool) -> None:
    there = np.isfinite(error)
    size = 4.6 if len(error) < 200 else 2.6
    inside = there & (np.abs(error) <= 0.96 * limit)
    ax.set_ylim(-limit, limit)
    ax.axhline(0.0, color=INK_2, lw=0.8, zorder=1)
    look: dict[str, Any] = {
        "mfc": COLOURS["tension"] if filled else PANEL,
        "mec": COLOURS["tension"],
        "mew": 0.8,
        "ms": size,
    }
    ax.plot(
        values[inside],
        error[inside],
        style.MARKERS["tension"],
        alpha=0.9 if len(error) < 200 else 0.5,
        zorder=3,
        **look,
    )
    beyond = there & ~inside
    for sign in (1, -1):
        some = beyond & (np.sign(error) == sign)
        if some.any():
            at = np.unique(np.round(values[some], 6))
            edge = np.full(len(at), sign * limit)
            ax.plot(at, edge, "^" if sign > 0 else "v", color=INK, ms=5, mew=0, zorder=4, clip_on=False)
    remarks = []
    if beyond.any():
        worst = error[beyond][np.argmax(np.abs(error[beyond]))]
        remarks.append(f"{int(beyond.sum())} outside, up to {number(worst, 0, sign=True)}\N{NO-BREAK SPACE}N")
    if (~there).any():
        remarks.append(f"{int((~there).sum())} not predicted")
    if remarks:
        style.note(ax, "; ".join(remarks), x=1.0, dx=-4, dy=6, ha="right", va="bottom", color=INK)


def _band(ax: Axes, half: float, *, label: bool, percent: str = "1") -> None:
    ax.axhspan(-half, half, color=SUNKEN, lw=0, zorder=0)
    for edge, sign in ((half, "+"), (-half, "\N{MINUS SIGN}")):
        ax.axhline(edge, color=INK_3, lw=0.6, ls=(0, (5, 3)), zorder=1)
        if label:
            style.beside(
                ax,
                f"{sign}{percent}\N{NO-BREAK SPACE}%",
                (1.0, edge),
                (4, 0),
                xycoords=("axes fraction", "data"),
                color=INK_2,
                va="center",
                annotation_clip=False,
            )


# ---- 3 correlation


@style.styled()
def correlation(fit: Fit) -> Figure | None:
    """Draw the correlation of the estimates in a matrix; near one, the data cannot separate two.

    Returns:
        None for a single parameter.
    """
    from matplotlib.patches import Rectangle

    names = list(fit.parameters)
    n = len(names)
    fields = declared(law_type(fit.law))
    symbols = [style.symbol_text(fields[name].symbol, name) for name in names]
    if n < 2:
        return None
    side = min(0.5, 2.7 / (n - 1))
    height = 1.0 + side * (n - 1)
    fig = style.figure(style.NARROW, height)
    ax = fig.add_axes((0.6 / style.NARROW, 0.4 / height, side * (n - 1) / style.NARROW, side * (n - 1) / height))
    ax.set_xlim(0, n - 1)
    ax.set_ylim(n - 1, 0)
    ax.set_axis_off()
    matrix = fit.correlation if fit.correlation is not None else np.full((n, n), np.nan)
    for i in range(n - 1):
        middle = (i + 0.5) / (n - 1)
        style.note(ax, symbols[i + 1], y=1.0 - middle, dx=-6, ha="right", color=INK, fontsize=style.NORMAL)
        style.note(ax, symbols[i], x=middle, y=0.0, dy=-9, ha="center", color=INK, fontsize=style.NORMAL)
        for j in range(i + 1):
            value = float(matrix[i + 1, j])
            there = math.isfinite(value)
            strength = min(abs(value), 1.0) if there else 0.0
            # Cubed, so that what is harmless stays light and only what is near one turns dark.
            ax.add_patch(Rectangle((j, i), 1, 1, fc=INK, ec="none", lw=0, alpha=0.05 + 0.85 * strength**3))
            ax.add_patch(Rectangle((j, i), 1, 1, fc="none", ec=PANEL, lw=1.5))
            text = number(value, 4 if strength > 0.9985 else 3 if strength > 0.985 else 2, sign=True)
            size = min(style.SMALL, 0.88 * 72.0 * side / (0.62 * len(text)))
            ax.text(
                j + 0.5,
                i + 0.5,
                text,
                ha="center",
                va="center_baseline",
                fontsize=size,
                color=PANEL if strength > 0.75 else INK,
            )
    style.heading(ax, "Correlation", "of the estimates, \N{MINUS SIGN}1 to +1", above=14.0)
    return fig


# ---- 4 beyond the training


@style.styled()
def hold_out(fit: Fit) -> Figure | None:
    """Draw tension over pressure per length: measured, and predicted above the training pressures.

    Returns:
        None if the fit has no hold-out.
    """
    if fit.holdout is None:
        return None
    points = fit.points
    # The separate fit was not shown the points at the highest pressures
    out: np.ndarray = points.pressure > np.sort(points.pressure)[fit.holdout.trained_on - 1]
    error = np.full(len(points), np.nan)
    error[out] = fit.holdout.error
    fig = style.figure(style.WIDE, 3.7)
    grid = fig.add_gridspec(1, 2, left=0.05, right=0.955, bottom=0.14, top=0.81, wspace=0.27, width_ratios=[1.25, 1.0])
    left, right = fig.add_subplot(grid[0]), fig.add_subplot(grid[1])
    pressure, title = _over(points, "pressure")
    border = 0.5 * (pressure[~out].max() + pressure[out].min())
    _draw_predictions(left, points, pressure, error, out)
    limit = 1.15 * max(float(np.abs(error[np.isfinite(error)]).max(initial=0.0)), 0.033 * points.largest)
    _draw_errors(right, pressure[out], error[out], min(limit, 0.25 * points.largest), filled=False)
    style.quantity_axes(right, x=(title, "pressure"), y=("Predicted less measured, N", "tension"))
    right.set_xlim(border - 0.3 * (pressure.max() - border), pressure.max() * 1.03)
    for ax in (left, right):
        ax.axvspan(0.0, border, color=COLOURS["pressure"], alpha=0.09, lw=0, zorder=0)
        ax.axvline(border, color=COLOURS["pressure"], lw=0.9, ls=(0, (4, 2.3)), zorder=1)
    note = f"{fit.holdout.what}: {fit.holdout.trained_on} of {len(points)} points"
    style.heading(left, law_title(fit), "▲ measured\N{EM SPACE}△ predicted", above=24.0)
    style.heading(right, "Errors of the prediction", note, above=24.0)
    _band(right, 0.03 * points.largest, label=True, percent="3")
    style.note(left, "shown to the fit", x=0.04, y=0.95, color=COLOURS["pressure"])
    return fig


def _draw_predictions(ax: Axes, points: ForceMap, pressure: np.ndarray, error: np.ndarray, out: np.ndarray) -> None:
    top = 1.08 * points.largest
    ax.set_xlim(0.0, pressure.max() * 1.03)
    ax.set_ylim(0.0, top)
    style.quantity_axes(ax, x=("Pressure, bar", "pressure"), y=("Tension, N", "tension"))
    ends = []
    rest = np.zeros(len(points)) if points.rest_length is None else points.rest_length
    keys = np.unique(np.round(np.stack([points.length, rest], axis=1), 6), axis=0)
    most = MOST_LABELS if len(points) < 30 * MOST_LABELS else 4
    chosen = keys[np.unique(np.linspace(0, len(keys) - 1, min(most, len(keys))).round().astype(int))]
    series = [
        (float(length), np.flatnonzero(np.isclose(points.length, length, atol=1e-6) & np.isclose(rest, r, atol=1e-6)))
        for length, r in chosen
    ]
    shade = COLOURS["tension"]
    for opacity, (length, member) in zip(style.graded(len(series), 0.6), series, strict=True):
        order = member[np.argsort(pressure[member], kind="stable")]
        ax.plot(pressure[order], points.tension[order], "-", color=shade, lw=0.6, alpha=0.45, zorder=2)
        dense = len(order) > 30
        ax.plot(
            pressure[order],
            points.tension[order],
            "^",
            mfc=shade,
            mec=PANEL,
            mew=0.4,
            ms=3.2 if dense else 4.6,
            alpha=opacity,
            zorder=3,
        )
        later = order[out[order]]
        if dense and len(later):
            later = later[np.unique(np.linspace(0, len(later) - 1, 9).round().astype(int))]
        predicted = points.tension[later] + error[later]
        shown = np.isfinite(predicted) & (predicted <= top) & (predicted >= 0.0)
        ax.plot(pressure[later][shown], predicted[shown], "^", mfc="none", mec=INK, mew=0.9, ms=7.5, zorder=4)
        if len(order):
            ends.append(
                (float(pressure[order[-1]]), float(points.tension[order[-1]]), f"{from_si(length, 'm', 'cm'):.1f}")
            )
    if ends:
        ends[-1] = (*ends[-1][:2], ends[-1][2] + "\N{NO-BREAK SPACE}cm")
    style.end_labels(ax, ends, quantity="length")


# ---- all at a glance


@style.styled()
def overview(studies: Iterable[Ranking]) -> Figure:
    """Draw up to two studies, 14.4 inch wide: the curves of the best law, and the ranking of all.

    Two studies stand side by side, each ranking below its curves; of a single one it stands beside them.
    """
    shown = list(studies)[:2]
    single = len(shown) == 1
    fig = style.figure(14.4, 4.7 if single else 8.1)
    for i, study in enumerate(shown):
        left = 0.045 + 0.5 * i
        best = study.fits[0]
        ax = fig.add_axes((left, 0.15, 0.405, 0.66) if single else (left, 0.505, 0.405, 0.395))
        draw_fit(ax, best, study.points)
        style.heading(ax, study.title, f"▲ measured\N{EM SPACE}○ slack\N{EM SPACE}— {law_title(best)}", above=24.0)
        ranks = fig.add_axes((0.7, 0.15, 0.17, 0.6) if single else (left + 0.155, 0.07, 0.17, 0.295))
        draw_ranking(ranks, study, names=0.155 * 72.0 * 14.4, brief=True)
    return fig


BANDS_KEY = "▲ measured\N{EM SPACE}— median, with 95 % of the samples"
BANDS_FINE, MOST_LEVELS, MOST_PAIRED, MOST_DOTS = 41, 8, 5, 400


def title_of(posterior: Posterior) -> str:
    """Title of a posterior's law."""
    return str(law_type(posterior.law).title)


@style.styled()
def bands(posterior: Posterior) -> Figure:
    """Draw measured tension over length with the 95 % band of the true tension, one per pressure."""
    fig = style.figure(style.MIDDLE, 4.7)
    ax = fig.add_axes((0.09, 0.11, 0.8, 0.74))
    draw_bands(ax, posterior)
    style.heading(ax, title_of(posterior), BANDS_KEY, above=24.0)
    return fig


def draw_bands(ax: Axes, posterior: Posterior) -> None:
    """Draw points and bands of the muscle with the largest rest length into axes."""
    points = posterior.points
    if points.rest_length is not None:
        points = points.select(points.rest_length == points.rest_length.max())
    levels, _ = levels_of(points)
    levels = levels[np.unique(np.linspace(0, len(levels) - 1, min(MOST_LEVELS, len(levels))).round().astype(int))]
    cm = from_si(1.0, "m", "cm")
    lengths = np.linspace(points.length.min(), points.length.max(), BANDS_FINE)
    ends = []
    for level, opacity in zip(levels, style.graded(len(levels), 0.55), strict=True):
        band = posterior.tension(lengths, np.full(BANDS_FINE, level))
        colour = COLOURS["tension"]
        ax.fill_between(lengths * cm, band.low, band.high, color=colour, alpha=0.22, lw=0, zorder=1)
        ax.plot(lengths * cm, band.median, color=colour, lw=style.LINE, alpha=opacity, zorder=2)
        near = np.abs(points.pressure - level) < 0.01 * points.pressure.max()
        ax.plot(
            points.length[near] * cm, points.tension[near], style.MARKERS["tension"], mfc=colour, mec=PANEL, mew=0.4,
            ms=4.0, zorder=3,
        )  # fmt: skip
        bar = style.pressure_text(from_si(float(level), "Pa", "bar"), unit=level == levels[-1])
        ends.append((float(lengths[-1] * cm), float(band.median[-1]), bar))
    margin = 0.025 * np.ptp(lengths) * cm
    ax.set_xlim(lengths[0] * cm - margin, lengths[-1] * cm + margin)
    ax.set_ylim(-0.015 * points.largest, None)
    style.quantity_axes(ax, x=("Length, cm", "length"), y=("Tension, N", "tension"))
    style.end_labels(ax, ends, quantity="pressure")


@style.styled()
def parameter_pairs(posterior: Posterior) -> Figure:
    """Draw the samples of the parameters by pairs, with the 95 % interval of each; of many parameters the first five."""
    units = declared(law_type(posterior.law))
    names = list(posterior.samples)[:MOST_PAIRED]
    count = max(len(names) - 1, 1)
    side = 6.2 / max(count, 2)
    fig = style.figure(side * count + 1.3, side * count + 1.1)
    grid = fig.add_gridspec(count, count, left=0.15, right=0.97, bottom=0.13, top=0.9, wspace=0.12, hspace=0.3)
    rows = posterior.rows(min(MOST_DOTS, len(posterior)))
    intervals = posterior.intervals()

    def shown(name: str, value: np.ndarray | float) -> np.ndarray:
        unit = units[name].unit
        return np.asarray(value) * from_si(1.0, unit, shown_unit(unit))

    for i in range(count):
        for j in range(i + 1):
            across, up = names[j], names[min(i + 1, len(names) - 1)]
            ax = fig.add_subplot(grid[i, j])
            ax.plot(
                shown(across, posterior.samples[across][rows]), shown(up, posterior.samples[up][rows]), ".",
                color=INK, alpha=0.25, ms=2.0, mew=0,
            )  # fmt: skip
            for name, line in ((across, ax.axvline), (up, ax.axhline)):
                for end in (intervals[name].low, intervals[name].high):
                    line(float(shown(name, end)), color=INK_3, lw=0.5, ls=(0, (3, 2)))
            label = [_label(name, units[name].unit) for name in (across, up)]
            style.quantity_axes(ax, x=(label[0] if i == count - 1 else "", None), y=(label[1] if j == 0 else "", None))
            ax.tick_params(labelbottom=i == count - 1, labelleft=j == 0)
            ax.locator_params(axis="x", nbins=3)
            ax.locator_params(axis="y", nbins=4)
            if i == j == 0:
                style.heading(ax, title_of(posterior), "samples; dashed: 95 % of each parameter", above=28.0)
    return fig


@style.styled()
def run_bands(predicted: PredictedRun, *, title: str) -> Figure:
    """Draw the 95 % bands of a run's channels over time, one panel each."""
    names = {"pressure": "Pressure", "tension": "Tension", "span": "Length"}
    fig = style.figure(style.MIDDLE, 6.0)
    grid = fig.add_gridspec(len(names), 1, left=0.1, right=0.97, bottom=0.09, top=0.87, hspace=0.45)
    for i, (channel, word) in enumerate(names.items()):
        ax = fig.add_subplot(grid[i])
        quantity = "length" if channel == "span" else channel
        unit = predicted.unit(channel)
        factor = from_si(1.0, unit, shown_unit(unit))
        low, middle, high = (factor * end for end in predicted.band(channel))
        ax.fill_between(predicted.time, low, high, color=COLOURS[quantity], alpha=0.25, lw=0)
        ax.plot(predicted.time, middle, color=COLOURS[quantity], lw=style.LINE)
        last = i == len(names) - 1
        style.quantity_axes(ax, x=("Time, s" if last else "", None), y=(f"{word}, {shown_unit(unit)}", quantity))
        if i == 0:
            style.heading(ax, title, "median, with 95 % of the samples of the posterior", above=28.0)
    return fig


@style.styled()
def loop_bands(fit: LoopFit, samples: RecordPosterior | None) -> Figure:
    """Draw a measured loop of stroke over pressure with the fitted one, or with the 95 % band of its posterior."""
    record, branch = fit.record, fit.record.branch
    bar, mm = from_si(1.0, "Pa", "bar"), from_si(1.0, "m", "mm")
    fig = style.figure(style.MIDDLE, 4.7)
    ax = fig.add_axes((0.09, 0.11, 0.87, 0.74))
    ax.plot(record.pressure * bar, record.stroke * mm, "o", ms=2.6, mfc=INK, mec="none", zorder=2)
    band = None if samples is None else samples.band()
    middle = fit.predicted if band is None else band.median
    if band is not None:
        for way in (1, -1):
            some = np.flatnonzero(branch == way)
            some = some[np.argsort(record.pressure[some])]
            at = record.pressure[some] * bar
            ax.fill_between(at, band.low[some] * mm, band.high[some] * mm, color=COLOURS["length"], alpha=0.25, lw=0)
    ax.plot(record.pressure * bar, middle * mm, color=COLOURS["length"], lw=style.LINE, zorder=3)
    style.quantity_axes(ax, x=("Gauge pressure, bar", "pressure"), y=("Stroke, mm", "length"))
    key = "● measured\N{EM SPACE}— " + ("fitted" if band is None else "median, with 95 % of the samples")
    style.heading(ax, f"Loop with friction of {FRICTIONS[fit.model]}", key, above=24.0)
    return fig


def _label(name: str, unit: str) -> str:
    """Name of a parameter with the unit in which it is shown."""
    words = name.replace("_", " ").capitalize()
    return words if unit == "1" else f"{words}, {shown_unit(unit)}"
