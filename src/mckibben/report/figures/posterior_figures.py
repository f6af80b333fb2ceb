"""Figures of a posterior: bands of the tension over length, and the parameters by pairs."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ...identification.posterior import Posterior
from ...muscles.laws import law_type
from ...quantities import declared, from_si, shown_unit
from . import style
from .fit_figures import levels_of
from .loop_figures import NAMES
from .style import COLOURS, INK, INK_3, PANEL

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ...batch.posterior import PredictedRun
    from ...identification.hysteresis_fit import LoopFit
    from ...identification.record_posterior import RecordPosterior

KEY = "▲ measured\N{EM SPACE}— median, with 95 % of the samples"
FINE, MOST_LEVELS, MOST_PAIRED, MOST_DOTS = 41, 8, 5, 400


def title_of(posterior: Posterior) -> str:
    """Title of a posterior's law."""
    return str(law_type(posterior.law).title)


@style.styled()
def bands(posterior: Posterior) -> Figure:
    """Draw measured tension over length with the 95 % band of the true tension, one per pressure."""
    fig = style.figure(style.MIDDLE, 4.7)
    ax = fig.add_axes((0.09, 0.11, 0.8, 0.74))
    draw_bands(ax, posterior)
    style.heading(ax, title_of(posterior), KEY, above=24.0)
    return fig


def draw_bands(ax: Axes, posterior: Posterior) -> None:
    """Draw points and bands of the muscle with the largest rest length into axes."""
    points = posterior.points
    if points.rest_length is not None:
        points = points.select(points.rest_length == points.rest_length.max())
    levels, _ = levels_of(points)
    levels = levels[np.unique(np.linspace(0, len(levels) - 1, min(MOST_LEVELS, len(levels))).round().astype(int))]
    cm = from_si(1.0, "m", "cm")
    lengths = np.linspace(points.length.min(), points.length.max(), FINE)
    ends = []
    for level, opacity in zip(levels, style.graded(len(levels), 0.55), strict=True):
        band = posterior.tension(lengths, np.full(FINE, level))
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
    style.heading(ax, f"Loop with friction of {NAMES[fit.model]}", key, above=24.0)
    return fig


def _label(name: str, unit: str) -> str:
    """Name of a parameter with the unit in which it is shown."""
    words = name.replace("_", " ").capitalize()
    return words if unit == "1" else f"{words}, {shown_unit(unit)}"
