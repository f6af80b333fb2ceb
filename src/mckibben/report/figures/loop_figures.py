"""Figure of the loop study: the loop with the prediction of its other half, its width, and creep with its band."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from ...quantities import from_si
from ...studies.muscle_loops import TARGET, LoopStudy, StepCreep
from . import style
from .style import COLOURS, INK, INK_2, INK_3, RULE, SUNKEN, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


HEIGHT = 6.9  # [inch]
LEFT, FOOT, TOP, GAP_X, GAP_Y = 0.5, 0.55, 0.75, 0.7, 1.25  # [inch]
TALL = (HEIGHT - FOOT - TOP - GAP_Y) / 2.0
NAMES = {"bouc_wen": "Bouc-Wen", "dahl": "Dahl", "maxwell_slip": "Maxwell-slip"}
LAWS = {"free": "free amplitudes", "logarithmic": "equal steps per decade"}
DOTS: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 2.6, "mfc": INK, "mec": "none"}
LINE: dict[str, Any] = {"color": COLOURS["length"], "lw": style.LINE + 0.2}


@style.styled()
def loops_figure(study: LoopStudy) -> Figure:
    """Draw loop and width above, measured and predicted outside the fit; creep and its band below."""
    fig = style.figure(style.WIDE, HEIGHT)
    across = (style.WIDE - LEFT - GAP_X - 0.35) / 2.0
    places = [(LEFT + i * (across + GAP_X), FOOT + (1 - j) * (TALL + GAP_Y)) for j in range(2) for i in range(2)]
    axes = [fig.add_axes((x / style.WIDE, y / HEIGHT, across / style.WIDE, TALL / HEIGHT)) for x, y in places]
    _loop(axes[0], study)
    _width(axes[1], study)
    for ax, step in zip(axes[2:], study.steps, strict=True):
        _creep(ax, step)
    return fig


def _loop(ax: Axes, study: LoopStudy) -> None:
    bar, mm = from_si(1.0, "Pa", "bar"), from_si(1.0, "m", "mm")
    record = study.record
    ax.plot(record.pressure * bar, record.stroke * mm, label="measured", zorder=2, **DOTS)
    ax.plot(record.pressure * bar, study.unseen.stroke * mm, label="model, from the other half", zorder=3, **LINE)
    style.quantity_axes(ax, x=("Gauge pressure, bar", "pressure"), y=("Stroke, mm", "length"))
    rms = float(np.sqrt(np.mean((study.unseen.stroke - record.stroke) ** 2))) * mm
    names = " and ".join(dict.fromkeys(NAMES.get(h.model, h.model) for h in study.halves))
    style.heading(ax, "Loop", f"{names}; rms of the unseen samples {number(rms, 2)} mm", above=24.0)
    _key(ax, "upper left")
    for way, words, share, shift in ((1, "rising", 0.55, (8, -4)), (-1, "falling", 0.4, (-8, 4))):
        some = np.flatnonzero(record.branch == way)
        i = some[np.argmin(np.abs(record.pressure[some] - record.pressure.min() - share * np.ptp(record.pressure)))]
        ax.annotate(
            words,
            (record.pressure[i] * bar, record.stroke[i] * mm),
            shift,
            textcoords="offset points",
            va="center",
            ha="left" if way > 0 else "right",
            fontsize=style.SMALL,
            color=INK_2,
        )


def _width(ax: Axes, study: LoopStudy) -> None:
    bar, mm = from_si(1.0, "Pa", "bar"), from_si(1.0, "m", "mm")
    at = np.array([w.pressure for w in study.widths]) * bar
    measured, predicted = (np.array([getattr(w, n) for w in study.widths]) * mm for n in ("measured", "predicted"))
    middle = np.array([w.middle for w in study.widths])
    low, high = (np.where(middle, (1.0 + s * TARGET) * measured, np.nan) for s in (-1.0, 1.0))
    label = f"measured \N{PLUS-MINUS SIGN} {100.0 * TARGET:g} %, mid-range"
    ax.fill_between(at, low, high, color=SUNKEN, ec=RULE, lw=style.HAIR, zorder=1, label=label)
    ax.axhline(0.0, color=INK_3, lw=style.HAIR, zorder=1)
    ax.plot(at, measured, label="measured", zorder=2, **DOTS | {"ms": 4.0})
    ax.plot(at, predicted, label="model", zorder=3, **LINE)
    style.quantity_axes(ax, x=("Gauge pressure, bar", "pressure"), y=("Width in stroke, mm", "length"))
    ax.set_ylim(min(0.0, 1.1 * float(predicted.min()), 1.1 * float(measured.min())), 1.28 * float(measured.max()))
    worst = study.worst
    note = f"worst mid-range {number(100.0 * worst.error, 1, sign=True)} % at {number(worst.pressure * bar, 2)} bar"
    style.heading(ax, "Width", note, above=24.0)
    _key(ax, "upper left")


def _creep(ax: Axes, step: StepCreep) -> None:
    from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

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
    ax.plot(step.at[shown], fit.predict(step.at[shown]) * mm, label="model", zorder=3, **LINE)
    ax.plot(time[1:], fit.stroke[1:] * mm, label="measured", zorder=2, **DOTS)
    ax.set_xscale("log")
    ax.set_xlim(float(time[1]) * 0.9, end * 1.3)
    if late is not None:
        ax.plot(
            [late.time], [late.measured * mm], zorder=4, ls="none", marker="o", ms=5.5, mfc="none", mec=INK, mew=1.2
        )
        ax.annotate(
            "end of hold",
            (late.time, late.measured * mm),
            (-8, 0),
            textcoords="offset points",
            ha="right",
            va="center",
            fontsize=style.SMALL,
            color=INK,
        )
    style.quantity_axes(ax, x=(f"Time since {number(step.start)} s, s", None), y=("Stroke, mm", "length"))
    ax.xaxis.set_major_locator(LogLocator(10, subs=(1.0, 2.0, 5.0)))
    ax.xaxis.set_major_formatter(FuncFormatter(lambda value, _: number(value)))
    ax.xaxis.set_minor_formatter(NullFormatter())
    ax.tick_params(axis="x", which="minor", length=0)
    rms = [number(fit.rmse(seen=which) * mm, 3) for which in (True, False)]
    note = f"{LAWS.get(fit.law, fit.law)}; rms seen {rms[0]} mm, unseen {rms[1]} mm"
    style.heading(ax, f"Creep, {step.segment.replace('_', ' ')}", note, above=24.0)
    _key(ax, "upper left" if fit.stroke[-1] >= fit.stroke[0] else "lower left")


def _key(ax: Axes, where: Literal["upper left", "lower left"]) -> None:
    ax.legend(
        loc=where,
        frameon=False,
        fontsize=style.SMALL,
        labelcolor=INK_2,
        handlelength=2.0,
        labelspacing=0.35,
        borderpad=0.3,
    )
