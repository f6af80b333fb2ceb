"""Figures of what recordings tell: loops over measured ones and over a parameter, frequency responses, repeatability."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...analysis.frequency import FrequencyResponse
from ...analysis.loops import LoopResiduals, loop_residuals, measured_channels
from ...analysis.repeatability import Repeatability
from ...batch.store import parameter_units, read_results
from ...errors import InputError
from ...quantities import with_unit
from ...recordings import Channel, ForceMap, Recording
from ...recordings.provenance import labels
from . import style
from .places import describe, recording_source
from .recording_figures import ChannelPanel, checked_names, panels, path
from .style import INK, INK_3, PANEL, RULE, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


HEIGHT, LOWER = 5.2, 1.15  # of the figure and of the residuals [inch]
LEFT, BESIDE, TOP, FOOT, GAP = 0.6, 1.05, 0.75, 0.5, 0.5  # around and between the axes [inch]
SAMPLED = 120  # points of a loop among which the place of its label is sought
MOST_POINTS = 160  # of measured samples that are drawn as marks


class SweptLoop(NamedTuple):
    """A loop and the value of the parameter that it stands for: horizontal and vertical values [SI] (n,)."""

    words: str
    x: np.ndarray
    y: np.ndarray


@style.styled()
def measured_loop_figure(
    simulated: Recording,
    measured: Recording | ForceMap,
    *,
    across: str = "span",
    channel: str = "tension",
    title: str | None = None,
) -> Figure:
    """Draw measured data over a simulated loop, and below them what the simulation is more than the measurement.

    The heading states the rms residual in the unit of the channel and in % of the measured range.

    Args:
        simulated: recording with full cycles.
        measured: recording with full cycles, or a table of static points.
        across: channel on the horizontal axis.
        channel: channel on the vertical axis.
        title: instead of the recording's own.

    Raises:
        InputError: a channel is missing, there is no full cycle, or the loops have no common range.
    """
    residuals = loop_residuals(simulated, measured, across=across, channel=channel)
    x, y = _panels(simulated, across, channel)
    fig = style.figure(style.MIDDLE, HEIGHT)
    wide = (LEFT / style.MIDDLE, 1.0 - (LEFT + BESIDE) / style.MIDDLE)
    upper = fig.add_axes((wide[0], (FOOT + LOWER + GAP) / HEIGHT, wide[1], 1.0 - (FOOT + LOWER + GAP + TOP) / HEIGHT))
    lower = fig.add_axes((wide[0], FOOT / HEIGHT, wide[1], LOWER / HEIGHT), sharex=upper)
    draw_measured_loop(upper, simulated, measured, x, y)
    colour = style.colour(y.quantity)
    lower.axhline(0.0, color=INK_3, lw=style.HAIR, zorder=1)
    for up, words, dash in ((True, "rising", "-"), (False, "falling", style.RECORDING_DASHES[1])):
        some = residuals.rising == up
        if not some.any():
            continue
        at, error = residuals.at[some] * x.scale(), residuals.error[some] * y.scale()
        if np.all(residuals.rising):  # static points
            lower.plot(at, error, ls="none", marker="o", ms=3.0, mfc=PANEL, mec=colour, mew=0.8)
        else:
            lower.plot(at, error, color=colour, lw=style.LINE, ls=dash, label=words)
    if lower.get_legend_handles_labels()[0]:
        style.key(lower, loc="upper left", bbox_to_anchor=(1.005, 1.06), labelspacing=0.5)
    style.quantity_axes(upper, x=("", x.quantity), y=(y.heading, y.quantity))
    unit = y.heading.partition(",")[2]
    style.quantity_axes(lower, x=(x.heading, x.quantity), y=(f"Simulated less measured,{unit}", y.quantity))
    upper.tick_params(labelbottom=False)
    head = str(simulated.meta.get("title", "")) if title is None else title
    style.heading(upper, head, residual_words(residuals, y), above=24.0)
    describe(fig, recording_source(simulated))
    return fig


def residual_words(residuals: LoopResiduals, panel: ChannelPanel) -> str:
    """The rms residual with its unit, and in % of the measured range."""
    rms = float(f"{residuals.rms * panel.scale():.3g}")
    unit = panel.heading.rpartition(", ")[2]
    return f"rms residual {number(rms)} {unit}, {number(100.0 * residuals.relative, 1)} % of the range"


def _panels(record: Recording, across: str, channel: str) -> tuple[ChannelPanel, ChannelPanel]:
    first, second = checked_names(record, [across], field="across"), checked_names(record, [channel], field="channel")
    return panels(record, first)[0], panels(record, second)[0]


def draw_measured_loop(
    ax: Axes, simulated: Recording, measured: Recording | ForceMap, x: ChannelPanel, y: ChannelPanel
) -> None:
    """Draw a simulated loop as a line and measured data as open marks."""
    (across,), (channel,) = x.names, y.names
    line = path(simulated.time, simulated[across] * x.scale(), simulated[channel] * y.scale())
    ax.plot(*line, color=style.colour(y.quantity), lw=style.HEAVY, label="simulated", zorder=2)
    if isinstance(measured, ForceMap):
        values = measured.length * x.scale(), measured.tension * y.scale()
    else:
        names = measured_channels(measured, across, channel)
        values = measured[names[0]] * x.scale(), measured[names[1]] * y.scale()
    step = max(len(values[0]) // MOST_POINTS, 1)
    look: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 3.0, "mfc": PANEL, "mec": INK, "mew": 0.7}
    ax.plot(values[0][::step], values[1][::step], label="measured", zorder=3, **look)
    style.key(ax, loc="best", labelspacing=0.5)


# ---- over a swept parameter


@style.styled()
def swept_loops_figure(loops: Sequence[SweptLoop], x: ChannelPanel, y: ChannelPanel, *, title: str = "") -> Figure:
    """Draw loops over one another, each labelled at its line with the value of the parameter.

    Raises:
        InputError: there is no loop.
    """
    if not loops:
        raise InputError("recordings", None, "must be one or more")
    fig = style.figure(style.MIDDLE, 4.7)
    ax = fig.add_axes((0.085, 0.11, 0.87, 0.71))
    curves = []
    for one, opacity in zip(loops, style.graded(len(loops), 0.45), strict=True):
        across, up = one.x * x.scale(), one.y * y.scale()
        ax.plot(across, up, color=style.colour(y.quantity), lw=style.LINE + 0.2, alpha=opacity, gid=one.words)
        some = np.flatnonzero(np.isfinite(across) & np.isfinite(up))
        curves.append(np.stack([across[some], up[some]], axis=1)[:: max(len(some) // SAMPLED, 1)])
    ax.margins(x=0.08, y=0.08)
    ax.set_xlim(*ax.get_xlim())
    ax.set_ylim(*ax.get_ylim())
    style.quantity_axes(ax, x=(x.heading, x.quantity), y=(y.heading, y.quantity))
    style.heading(ax, title, above=24.0)
    for one, curve, (i, sides) in zip(loops, curves, _apart(ax, curves), strict=True):
        style.beside(
            ax,
            one.words,
            curve[i],
            (5 * sides[0], 4 * sides[1]),
            ha="left" if sides[0] > 0 else "right",
            va="bottom" if sides[1] > 0 else "top",
            color=INK,
            annotation_clip=False,
            zorder=5,
            bbox={"boxstyle": "square,pad=0.1", "fc": PANEL, "ec": "none", "alpha": 0.8},
        )
    return fig


def _apart(ax: Axes, curves: Sequence[np.ndarray]) -> list[tuple[int, tuple[int, int]]]:
    """Point of each loop that is farthest from the others and from labels, and the side of the loop on which it lies."""
    places = [ax.transAxes.inverted().transform(ax.transData.transform(curve)) for curve in curves]
    chosen: list[tuple[int, tuple[int, int]]] = []
    labels_at: list[np.ndarray] = []
    for i, place in enumerate(places):
        others = [p for j, p in enumerate(places) if j != i] + [at[None] for at in labels_at]
        if others:
            every = np.concatenate(others)
            nearest = np.sqrt(((place[:, None] - every[None]) ** 2).sum(axis=2)).min(axis=1)
        else:
            nearest = place.sum(axis=1)
        best = int(np.argmax(nearest))
        middle = place.mean(axis=0)
        chosen.append((best, (1 if place[best, 0] >= middle[0] else -1, 1 if place[best, 1] >= middle[1] else -1)))
        labels_at.append(place[best])
    return chosen


def loops_of_recordings(
    recordings: Sequence[Recording],
    *,
    across: str = "span",
    channel: str = "tension",
    words: Sequence[str] | None = None,
) -> tuple[list[SweptLoop], ChannelPanel, ChannelPanel]:
    """A loop of each recording, named by what it differs in from the others.

    Args:
        recordings: of one kind.
        across: channel on the horizontal axis.
        channel: channel on the vertical axis.
        words: names instead of what differs.
    """
    named = labels([one.meta for one in recordings]) if words is None else list(words)
    x, y = _panels(recordings[0], across, channel)
    loops = []
    for one, word in zip(recordings, named, strict=True):
        checked_names(one, [across, channel], field="channel")
        loops.append(SweptLoop(word, *path(one.time, one[across], one[channel])))
    return loops, x, y


def loops_of_sweep(
    folder: str | Path, *, across: str = "span", channel: str = "tension"
) -> tuple[list[SweptLoop], ChannelPanel, ChannelPanel]:
    """A loop of each variant of a sweep that kept the samples of both channels.

    Raises:
        InputError: it is no folder of a sweep, or it did not keep the samples.
    """
    variants, results = read_results(folder)
    for name in (across, channel):
        if name not in results.outputs or results.outputs[name].ndim < 2:
            sampled = [n for n, v in results.outputs.items() if v.ndim > 1 and n != "time"]
            known = ", ".join(sampled) or "none"
            raise InputError("sweep", name, f"must be an output with reduce = 'samples'; those are {known}")
    paths, units = list(variants.columns), parameter_units(folder)
    loops = []
    for i, code in enumerate(results.code):
        if code == 0:
            row = [(variants.columns[p][i], units[p] or "1") for p in paths]
            value = ", ".join(with_unit(v, unit) if isinstance(v, float) else str(v) for v, unit in row)
            loops.append(SweptLoop(value, results.outputs[across][i], results.outputs[channel][i]))
    probe = Recording(np.zeros(2), {across: Channel(np.zeros(2), "m"), channel: Channel(np.zeros(2), "N")})
    x, y = _panels(probe, across, channel)
    return loops, x, y


MARGIN, BASE, HEAD, BETWEEN = 0.62, 0.5, 0.8, 0.5  # around and between the axes [inch]
MAGNITUDE, PHASE, COHERENCE = 2.1, 1.5, 0.8  # heights of the axes [inch]


class BodeTitles(NamedTuple):
    """Texts of a Bode figure: its heading, the note after it, and the unit of the magnitude."""

    heading: str
    note: str = ""
    unit: str = ""


@style.styled()
def bode_figure(response: FrequencyResponse, titles: BodeTitles, *, cutoff: float = float("nan")) -> Figure:
    """Draw magnitude and phase over frequency, with the coherence if it is below one somewhere.

    Args:
        response: at frequencies in rising order.
        titles: texts of the figure.
        cutoff: frequency that is marked [Hz]; none if it is not a number.
    """
    measured = bool(np.any(response.coherence < 1.0))
    heights = [MAGNITUDE, PHASE, *([COHERENCE] if measured else [])]
    height = HEAD + sum(heights) + BETWEEN * (len(heights) - 1) + BASE
    fig = style.figure(style.MIDDLE, height)
    axes: list[Axes] = []
    top = height - HEAD
    for own in heights:
        box = (MARGIN / style.MIDDLE, (top - own) / height, 1.0 - (MARGIN + 0.3) / style.MIDDLE, own / height)
        axes.append(fig.add_axes(box, sharex=axes[0] if axes else None))
        top -= own + BETWEEN
    unit = f", {titles.unit}" if titles.unit else ""
    _course(axes[0], response.frequency, response.magnitude, f"Magnitude{unit}", log=True)
    _course(axes[1], response.frequency, np.degrees(response.phase), "Phase, degrees")
    if measured:
        _course(axes[2], response.frequency, response.coherence, "Coherence")
        axes[2].set_ylim(0.0, 1.05)
    style.heading(axes[0], titles.heading, titles.note, above=30.0)
    if np.isfinite(cutoff):
        for ax in axes[:2]:
            ax.axvline(cutoff, color=INK_3, lw=0.9, ls=(0, (4, 2.3)))
        style.beside(
            axes[0],
            f"\N{MINUS SIGN}3 dB at {cutoff:.3g} Hz",
            (cutoff, 0.04),
            (-4, 0),
            xycoords=("data", "axes fraction"),
            ha="right",
            color=INK_3,
        )
    for ax in axes[:-1]:
        ax.tick_params(labelbottom=False)
    axes[-1].set_xlabel("Frequency, Hz", color=INK, fontweight="bold", fontsize=style.SMALL + 0.5, labelpad=3)
    return fig


def _course(ax: Axes, frequency: np.ndarray, values: np.ndarray, title: str, *, log: bool = False) -> None:
    style.quantity_axes(ax, x=("", None), y=(title, None))
    ax.set_xscale("log")
    if log:
        ax.set_yscale("log")
    marks: dict[str, Any] = {"marker": "o", "ms": 3.0} if len(frequency) <= 40 else {}
    ax.plot(frequency, values, color=INK, lw=style.LINE, **marks)
    ax.margins(x=0.02)


@style.styled()
def repeatability_figure(repeatability: Repeatability, *, title: str, channel: str, over: str) -> Figure:
    """Draw every repetition faintly with the mean course, and below the deviation of each from the mean.

    Args:
        repeatability: the repetitions, in the unit in which they are shown.
        title: title of the figure.
        channel: title of the channel with its unit, such as ``"Tension, N"``.
        over: title of the axis below, such as ``"Phase of the cycle"``.
    """
    upper, lower = 2.4, 1.2
    height = HEAD + upper + BETWEEN + lower + BASE
    fig = style.figure(style.MIDDLE, height)
    across = (MARGIN / style.MIDDLE, 1.0 - (MARGIN + 0.3) / style.MIDDLE)
    top = fig.add_axes((across[0], (height - HEAD - upper) / height, across[1], upper / height))
    low = fig.add_axes((across[0], BASE / height, across[1], lower / height), sharex=top)
    mean = repeatability.courses.mean(axis=0)
    quantity = channel.partition(",")[0].lower()
    shade = style.colour(quantity if quantity in style.COLOURS else None)
    for course in repeatability.courses:
        top.plot(repeatability.at, course, color=shade, lw=0.7, alpha=0.35)
        low.plot(repeatability.at, course - mean, color=shade, lw=0.7, alpha=0.5)
    top.plot(repeatability.at, mean, color=INK, lw=style.HEAVY)
    low.axhline(0.0, color=RULE, lw=0.8)
    style.quantity_axes(top, x=("", None), y=(channel, quantity if quantity in style.COLOURS else None))
    style.quantity_axes(low, x=(over, None), y=(f"Distance from the mean,{channel.partition(',')[2]}", None))
    top.tick_params(labelbottom=False)
    top.margins(x=0.0)
    style.heading(top, title, f"{repeatability.repetitions} repetitions and their mean", above=30.0)
    return fig
