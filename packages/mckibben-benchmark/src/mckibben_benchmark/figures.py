"""Figures of the validation: every law on every static data set, and a loop with creep that its other half predicts."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from mckibben.errors import InputError
from mckibben.muscles.laws import law_type
from mckibben.quantities import from_si
from mckibben.report.figures import formats, style
from mckibben.report.figures.fit_figures import FRICTIONS
from mckibben.report.figures.style import COLOURS, INK, INK_2, INK_3, PANEL, RULE, SUNKEN, number

from .muscle_loops import TARGET, LoopStudy, StepCreep
from .validation import StaticResult, Validation, ordered_laws

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SHADE = COLOURS["tension"]
LOW, HIGH = 0.2, 100.0  # ends of the axes [% of the largest tension]
NAMES, GAP, TOP, FOOT, ROW = 2.05, 0.13, 0.98, 0.5, 0.3  # [inch]
ACROSS = 10.0 - 72.0 * NAMES  # where names and key begin, from the first panel [pt]
LANE = 0.16  # between the two marks of a law [rows]


@style.styled()
def errors_figure(validation: Validation) -> Figure:
    """Draw errors of all laws, best first: one pressure left out, above 4 bar, and with published numbers.

    Raises:
        InputError: if there is no static data set.
    """
    if not validation.static:
        raise InputError("data sets", None, "must be at least one static data set")
    laws = ordered_laws(validation.static)
    height = TOP + FOOT + ROW * len(laws)
    fig = style.figure(style.WIDE, height, rows=True, least=6.5)
    width = (style.WIDE - NAMES - 0.12 - GAP * (len(validation.static) - 1)) / len(validation.static)
    for i, one in enumerate(validation.static):
        left = NAMES + i * (width + GAP)
        ax = fig.add_axes((left / style.WIDE, FOOT / height, width / style.WIDE, ROW * len(laws) / height))
        _panel(ax, one, laws)
        if i == 0:
            for y, law in enumerate(laws):
                at = 1.0 - (y + 0.5) / len(laws)
                style.note(ax, law_type(law).title, y=at, dx=ACROSS, color=INK, fontsize=style.NORMAL - 0.5)
            parts = [
                "▲ rms, one pressure left out",
                "▷ rms, above 4 bar from below",
                "┃ largest of these",
                "◇ rms, not fitted to these data",
            ]
            title = "Error of prediction, % of the largest tension"
            style.note(ax, title, dx=ACROSS, dy=53, color=INK, fontweight="bold", fontsize=style.NORMAL)
            style.note(ax, "\N{EM SPACE}".join(parts), dx=ACROSS, dy=38, color=INK_2)
            if any(one.apart for one in validation.static):
                words = "grey: below half the gap of the two branches"
                if formats.current_style().width is None:
                    style.note(ax, words, dx=ACROSS + 470.0, dy=38, color=INK_3)
                else:
                    style.note(ax, words, dx=ACROSS, dy=26, color=INK_3)
    return fig


def _panel(ax: Axes, one: StaticResult, laws: Sequence[str]) -> None:
    ax.set_xscale("log")
    ax.set_xlim(LOW, HIGH)
    ax.set_ylim(len(laws) - 0.5, -0.5)
    ax.grid(visible=False, axis="y")
    ax.spines["left"].set_visible(False)
    ax.set_xticks([1.0, 10.0, 100.0], ["1", "10", "100"])
    ax.set_xticks([m * d for d in (0.1, 1.0, 10.0) for m in (2, 3, 5) if LOW <= m * d <= HIGH], minor=True, labels=[])
    ax.grid(visible=True, axis="x", which="minor", lw=0.4)
    ax.set_yticks([])
    ax.set_xlabel("Error, %", color=SHADE, fontweight="bold", fontsize=style.SMALL + 0.5, labelpad=2)
    size = one.points.largest
    if one.apart:
        ax.axvspan(LOW, 100.0 * one.apart[0] / size, facecolor=SUNKEN, edgecolor="none", zorder=0)
    for y in range(1, len(laws)):
        ax.axhline(y - 0.5, color=RULE, lw=style.HAIR, zorder=0)
    for y, law in enumerate(laws):
        _row(ax, y, law, one)
    style.heading(ax, one.of.name, above=15.0)
    style.note(ax, f"{int(one.points.taut.sum())} points, {number(size, 0)} N", dy=9)


def _row(ax: Axes, y: int, law: str, one: StaticResult) -> None:
    size = one.points.largest
    for f in one.fits:
        if f.law != law:
            continue
        cross = f.cross.get("pressure")
        pair = (cross.rmse, cross.max_error) if cross else (f.rmse, f.max_error)
        _pair(ax, y - LANE, [v / size for v in pair], beyond=False)
        if f.holdout:
            _pair(ax, y + LANE, [v / size for v in (f.holdout.rmse, f.holdout.max_error)], beyond=True)
    title = law_type(law).title
    for u in one.unfitted:
        if u.title == title:
            at = min(100.0 * u.rmse / size, HIGH)
            ax.plot([at], [y], "D", mfc=PANEL, mec=INK, mew=1.0, ms=4.6, zorder=5, clip_on=False)


def _pair(ax: Axes, y: float, pair: Sequence[float], *, beyond: bool) -> None:
    """Draw an rms and a largest error [share]; an arrow marks a value beyond the axis."""
    rms, largest = (100.0 * v if math.isfinite(v) else math.inf for v in pair)
    ends = [max(min(v, HIGH), LOW) for v in (rms, largest)]
    ax.plot(ends, [y, y], color=SHADE, lw=1.0, ls=(0, (2.5, 1.6)) if beyond else "-", zorder=2)
    if largest <= HIGH:
        ax.plot([largest], [y], "|", color=SHADE, ms=6, mew=1.4, zorder=3)
    else:
        ax.plot([HIGH], [y], ">", color=INK, ms=4, mew=0, zorder=3, clip_on=False)
    if rms <= HIGH:
        marker, face = (">", PANEL) if beyond else ("^", SHADE)
        ax.plot([rms], [y], marker, mfc=face, mec=SHADE, mew=1.0, ms=4.8, zorder=4)


# ---- a loop and its creep

LOOP_HEIGHT = 6.9  # [inch]
LOOP_LEFT, LOOP_FOOT, LOOP_TOP, GAP_X, GAP_Y = 0.5, 0.55, 0.75, 0.7, 1.25  # [inch]
LOOP_TALL = (LOOP_HEIGHT - LOOP_FOOT - LOOP_TOP - GAP_Y) / 2.0
LAWS = {"free": "free amplitudes", "logarithmic": "equal steps per decade"}
DOTS: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 2.6, "mfc": INK, "mec": "none"}
MODEL_LINE: dict[str, Any] = {"color": COLOURS["length"], "lw": style.LINE + 0.2}


@style.styled()
def loop_study_figure(study: LoopStudy) -> Figure:
    """Draw loop and width above, measured and predicted outside the fit; creep and its band below."""
    fig = style.figure(style.WIDE, LOOP_HEIGHT)
    across = (style.WIDE - LOOP_LEFT - GAP_X - 0.35) / 2.0
    places = [
        (LOOP_LEFT + i * (across + GAP_X), LOOP_FOOT + (1 - j) * (LOOP_TALL + GAP_Y))
        for j in range(2)
        for i in range(2)
    ]
    axes = [
        fig.add_axes((x / style.WIDE, y / LOOP_HEIGHT, across / style.WIDE, LOOP_TALL / LOOP_HEIGHT)) for x, y in places
    ]
    _study_loop(axes[0], study)
    _study_width(axes[1], study)
    for ax, step in zip(axes[2:], study.steps, strict=True):
        _creep(ax, step)
    return fig


def _study_loop(ax: Axes, study: LoopStudy) -> None:
    bar, mm = from_si(1.0, "Pa", "bar"), from_si(1.0, "m", "mm")
    record = study.record
    ax.plot(record.pressure * bar, record.stroke * mm, label="measured", zorder=2, **DOTS)
    ax.plot(record.pressure * bar, study.unseen.stroke * mm, label="model, from the other half", zorder=3, **MODEL_LINE)
    style.quantity_axes(ax, x=("Gauge pressure, bar", "pressure"), y=("Stroke, mm", "length"))
    rms = float(np.sqrt(np.mean((study.unseen.stroke - record.stroke) ** 2))) * mm
    names = " and ".join(dict.fromkeys(FRICTIONS.get(h.model, h.model) for h in study.halves))
    style.heading(ax, "Loop", f"{names}; rms of the unseen samples {number(rms, 2)} mm", above=24.0)
    _key(ax, "upper left")
    for way, words, share, shift in ((1, "rising", 0.55, (8, -4)), (-1, "falling", 0.4, (-8, 4))):
        some = np.flatnonzero(record.branch == way)
        i = some[np.argmin(np.abs(record.pressure[some] - record.pressure.min() - share * np.ptp(record.pressure)))]
        style.beside(
            ax,
            words,
            (record.pressure[i] * bar, record.stroke[i] * mm),
            shift,
            va="center",
            ha="left" if way > 0 else "right",
            color=INK_2,
        )


def _study_width(ax: Axes, study: LoopStudy) -> None:
    bar, mm = from_si(1.0, "Pa", "bar"), from_si(1.0, "m", "mm")
    at = np.array([w.pressure for w in study.widths]) * bar
    measured, predicted = (np.array([getattr(w, n) for w in study.widths]) * mm for n in ("measured", "predicted"))
    middle = np.array([w.middle for w in study.widths])
    low, high = (np.where(middle, (1.0 + s * TARGET) * measured, np.nan) for s in (-1.0, 1.0))
    label = f"measured \N{PLUS-MINUS SIGN} {100.0 * TARGET:g} %, mid-range"
    ax.fill_between(at, low, high, color=SUNKEN, ec=RULE, lw=style.HAIR, zorder=1, label=label)
    ax.axhline(0.0, color=INK_3, lw=style.HAIR, zorder=1)
    ax.plot(at, measured, label="measured", zorder=2, **DOTS | {"ms": 4.0})
    ax.plot(at, predicted, label="model", zorder=3, **MODEL_LINE)
    style.quantity_axes(ax, x=("Gauge pressure, bar", "pressure"), y=("Width in stroke, mm", "length"))
    ax.set_ylim(min(0.0, 1.1 * float(predicted.min()), 1.1 * float(measured.min())), 1.28 * float(measured.max()))
    worst = study.worst
    note = f"worst mid-range {number(100.0 * worst.error, 1, sign=True)} % at {number(worst.pressure * bar, 2)} bar"
    style.heading(ax, "Width", note, above=24.0)
    _key(ax, "upper left")


def _creep(ax: Axes, step: StepCreep) -> None:
    mm, fit = from_si(1.0, "m", "mm"), step.fit
    training, time = fit.train, fit.time
    late = step.late
    split = 0.5 * (float(time[training][-1]) + float(time[~training][0]))
    end = float(step.at[-1])
    shown = step.at > 0.0
    ax.axvspan(split, end * 1.3, color=SUNKEN, lw=0, zorder=0, label="not seen by the fit")
    ax.fill_between(
        step.at[shown],
        step.low[shown] * mm,
        step.high[shown] * mm,
        color=COLOURS["length"],
        alpha=0.22,
        lw=0,
        zorder=1,
        label="95 % band",
    )
    ax.plot(step.at[shown], fit.predict(step.at[shown]) * mm, label="model", zorder=3, **MODEL_LINE)
    ax.plot(time[1:], fit.stroke[1:] * mm, label="measured", zorder=2, **DOTS)
    ax.set_xscale("log")
    ax.set_xlim(float(time[1]) * 0.9, end * 1.3)
    if late is not None:
        ax.plot(
            [late.time], [late.measured * mm], zorder=4, ls="none", marker="o", ms=5.5, mfc="none", mec=INK, mew=1.2
        )
        style.beside(ax, "end of hold", (late.time, late.measured * mm), (-8, 0), ha="right", va="center", color=INK)
    style.quantity_axes(ax, x=(f"Time since {number(step.start)} s, s", None), y=("Stroke, mm", "length"))
    style.tick_numbers(ax.xaxis)
    ax.tick_params(axis="x", which="minor", length=0)
    rms = [number(fit.rmse(seen=which) * mm, 3) for which in (True, False)]
    note = f"{LAWS.get(fit.law, fit.law)}; rms seen {rms[0]} mm, unseen {rms[1]} mm"
    style.heading(ax, f"Creep, {step.segment.replace('_', ' ')}", note, above=24.0)
    _key(ax, "upper left" if fit.stroke[-1] >= fit.stroke[0] else "lower left")


def _key(ax: Axes, where: Literal["upper left", "lower left"]) -> None:
    style.key(ax, loc=where, labelcolor=INK_2, handlelength=2.0, borderpad=0.3)
