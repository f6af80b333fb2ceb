"""Figures of studies: models of the tube, characterisation of a muscle, diagnosis of faults."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...quantities import from_si
from ...studies.characterisation.evaluation import HeldOut, relaxation_curve
from ...studies.characterisation.stages import ISOBARS
from ...studies.characterisation.verb import Characterisation
from ...studies.tube_models import LARGE, PERIOD, SMALL, Case, models
from ...studies.tube_study import PAPERS, TubeStudy
from . import style
from .style import COLOURS, INK, INK_2, INK_3, PANEL, RULE, SUNKEN, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


SHOWN = (*PAPERS, "lumped")
DASHES = dict(zip(SHOWN, ((0, (1.2, 1.8)), (0, (5, 1.7, 1.2, 1.7)), (0, (4, 2.3)), "-"), strict=True))
WORDS = {"isothermal": "isothermal walls", "adiabatic": "adiabatic walls", "wall_heat": "heat through the walls"}
BARE = {"facecolor": PANEL, "edgecolor": "none", "pad": 0.6}  # so that lines do not cross words
GOAL = 0.06  # of the improved model [bar]
NOISE_SHOWN = 1.4  # of the noise record [s]
BEFORE, AFTER = 0.1, 0.75  # around the highest step [s]
HEIGHT, FOOT, TOP, STRIP, GAP = 7.3, 0.55, 0.75, 0.62, 0.17  # [inch]
LEFT, ACROSS, BETWEEN, BARS = 0.5, (3.55, 2.15), 0.5, 2.0  # [inch]


@style.styled()
def tube_figure(study: TubeStudy) -> Figure:
    """Draw reference and models on one noise record and on the highest step, their errors, and all rms errors.

    The pressures are those of the small accumulator, on which nothing is refitted.

    Args:
        study: with the paper's three models and the improved one.
    """
    from matplotlib.lines import Line2D

    thermal = study.thermals[-1]
    fig = style.figure(style.WIDE, HEIGHT, rows=True, least=6.5)
    cases = study.cases[thermal, SMALL]
    noise = next(i for i, c in enumerate(cases) if c.record.kind == "noise")
    steps = next(i for i, c in enumerate(cases) if c.record.kind == "steps")
    case = cases[steps]
    rise = int(np.argmax(case.supply == case.supply.max()))
    start = rise * PERIOD - BEFORE
    windows = ((noise, 0.0, NOISE_SHOWN), (steps, *(start, start + AFTER)))
    left = LEFT
    limit = _limit(study, thermal, windows)
    for column, ((index, begin, end), width) in enumerate(zip(windows, ACROSS, strict=True)):
        axes = _column(fig, left, width)
        _pressures(axes[0], study, thermal, index, (begin, end))
        for ax, model in zip(axes[1:], SHOWN, strict=True):
            _error(ax, study, thermal, model, index, (begin, end), limit)
            if column == 0:
                style.note(ax, models()[model].title, x=0.0, y=1.0, dx=3, dy=-5, color=INK, fontweight="bold")
        title = "Noise to 6 Hz" if column == 0 else "Step of 5 bar"
        heading = f"{SMALL.replace('in3', ' in³')}, parameters of 10 in³" if column == 0 else WORDS[thermal]
        style.heading(axes[0], title, heading, above=24.0)
        axes[-1].set_xlabel("Time, s", color=INK, fontweight="bold", fontsize=style.SMALL + 0.5, labelpad=3)
        if column == 0:
            style.note(axes[1], "Model less reference, bar", y=1.0, dy=8, color=COLOURS["pressure"], fontweight="bold")
        left += width + BETWEEN
    lines = [
        Line2D([], [], color=INK_3, lw=0.8, label="in front of the tube"),
        Line2D([], [], color=COLOURS["pressure"], lw=3.2, alpha=0.45, label="behind it: reference"),
        *(Line2D([], [], color=INK, ls=DASHES[m], lw=0.9, label=models()[m].title) for m in SHOWN),
    ]
    style.key(
        axes[0],
        handles=lines,
        loc="center",
        bbox_to_anchor=(0.52, 0.46),
        handlelength=2.4,
        handletextpad=0.7,
        labelspacing=0.55,
        borderpad=0.4,
        labelcolor=INK_2,
    )
    _rms(fig, study, left + 0.75)
    return fig


def _column(fig: Figure, left: float, width: float) -> list[Axes]:
    """Create the axes of the pressures and one strip per model below, [inch] from the left."""
    foot, axes = FOOT, []
    for _ in SHOWN:
        axes.append(_axes(fig, left, foot, width, STRIP))
        foot += STRIP + GAP
    foot += 0.3
    axes.append(_axes(fig, left, foot, width, HEIGHT - TOP - foot))
    return axes[::-1]


def _axes(fig: Figure, left: float, foot: float, width: float, height: float) -> Axes:
    return fig.add_axes((left / style.WIDE, foot / HEIGHT, width / style.WIDE, height / HEIGHT))


def _part(case: Case, window: tuple[float, float]) -> tuple[slice, np.ndarray]:
    some = slice(max(round(window[0] / PERIOD), 0), round(window[1] / PERIOD) + 1)
    return some, PERIOD * np.arange(len(case.supply))[some]


def _pressures(ax: Axes, study: TubeStudy, thermal: str, index: int, window: tuple[float, float]) -> None:
    case = study.cases[thermal, SMALL][index]
    some, time = _part(case, window)
    zero, bar = case.supply.min(), from_si(1.0, "Pa", "bar")
    ax.plot(time, (case.supply - zero)[some] * bar, color=INK_3, lw=0.8, zorder=1)
    ax.plot(time, (case.vessel - zero)[some] * bar, color=COLOURS["pressure"], lw=3.2, alpha=0.45, zorder=2)
    for model in SHOWN:
        predicted = study.result(thermal, model, SMALL).comparisons[index].predicted
        ax.plot(time, (predicted - zero)[some] * bar, color=INK, ls=DASHES[model], lw=0.9, zorder=3)
    ax.set_xlim(time[0], time[-1])
    ax.set_ylim(-0.15, 5.3)
    style.quantity_axes(ax, x=("", None), y=("Pressure, bar", "pressure"))
    ax.tick_params(labelbottom=False)


def _limit(study: TubeStudy, thermal: str, windows: tuple[tuple[int, float, float], ...]) -> float:
    """Limit of the error strips [bar]: the largest error shown."""
    most = 0.0
    for index, begin, end in windows:
        case = study.cases[thermal, SMALL][index]
        some, _ = _part(case, (begin, end))
        for model in SHOWN:
            error = study.result(thermal, model, SMALL).comparisons[index].predicted - case.vessel
            most = max(most, float(np.abs(error[some]).max()))
    return 1.05 * from_si(most, "Pa", "bar")


def _error(
    ax: Axes,
    study: TubeStudy,
    thermal: str,
    model: str,
    index: int,
    window: tuple[float, float],
    limit: float,
) -> None:
    case = study.cases[thermal, SMALL][index]
    some, time = _part(case, window)
    compared = study.result(thermal, model, SMALL).comparisons[index]
    error = (compared.predicted - case.vessel)[some] * from_si(1.0, "Pa", "bar")
    ax.axhline(0.0, color=INK_2, lw=0.7, zorder=1)
    ax.fill_between(time, 0.0, error, color=COLOURS["pressure"], alpha=0.25, lw=0, zorder=2)
    ax.plot(time, error, color=COLOURS["pressure"], lw=1.0, zorder=3)
    ax.set_xlim(time[0], time[-1])
    ax.set_ylim(-limit, limit)
    tick = 0.5 if limit > 0.5 else 0.2
    ax.set_yticks([-tick, 0.0, tick], [number(-tick, 1, sign=True), "0", number(tick, 1, sign=True)])
    if model != SHOWN[-1]:
        ax.tick_params(labelbottom=False)
    rms, lead = from_si(compared.rms, "Pa", "bar"), from_si(compared.lead, "s", "ms")
    words = f"rms {number(rms, 3)}, lead {number(lead, 1, sign=True)} ms"
    style.note(ax, words, x=1.0, y=1.0, dx=-3, dy=-5, ha="right", color=INK_2)


def _rms(fig: Figure, study: TubeStudy, left: float) -> None:
    """Draw bars of the rms error over all records, one pair per reference and model."""
    ax = _axes(fig, left, FOOT, style.WIDE - left - 0.45, HEIGHT - TOP - FOOT)
    count = len(study.thermals)
    each, pause = 1.0, 0.9
    at, middle, longest = 0.0, [], 0.0
    for model in SHOWN:
        middle.append(at + 0.5 * (count - 1) * each)
        for thermal in study.thermals:
            for accumulator, up in ((LARGE, -0.19), (SMALL, 0.19)):
                rms = from_si(study.result(thermal, model, accumulator).rms, "Pa", "bar")
                longest = max(longest, rms)
                filled = accumulator == LARGE
                ax.barh(
                    at + up,
                    rms,
                    0.32,
                    color=COLOURS["pressure"] if filled else PANEL,
                    edgecolor=COLOURS["pressure"],
                    linewidth=0.8,
                    zorder=3,
                )
                style.beside(
                    ax,
                    number(rms, 3),
                    (rms, at + up),
                    (3, 0),
                    va="center_baseline",
                    fontsize=style.SMALL - 1.0,
                    color=INK_2,
                    bbox=BARE,
                    zorder=5,
                )
            words = thermal.replace("_", " ")
            _beside(ax, words, at, dx=-4, ha="right", color=INK_2)
            at += each
        at += pause
    for model, place in zip(SHOWN, middle, strict=True):
        top = place - 0.5 * count * each - 0.12
        _beside(ax, models()[model].title, top, dx=1, color=INK, fontweight="bold", bbox=BARE, zorder=5)
    ax.axvline(GOAL, color=INK, lw=0.9, ls=(0, (4, 2.3)), zorder=4)
    ax.set_ylim(at - pause - 0.4, -1.0)
    ax.set_yticks([])
    ax.grid(axis="y", visible=False)
    ax.set_xlim(0.0, 1.12 * longest)
    ax.set_xlabel("rms, bar", color=COLOURS["pressure"], fontweight="bold", fontsize=style.SMALL + 0.5, labelpad=3)
    style.heading(ax, "All records", "■ 10 in³, fitted  □ 3 in³, kept", above=24.0)
    goal = ax.get_xaxis_transform() + style.shift(ax, 0, 3)
    ax.text(GOAL, 1.0, f"goal {GOAL:g}", transform=goal, fontsize=style.SMALL, color=INK_3, ha="center", va="bottom")


def _beside(ax: Axes, words: str, y: float, *, dx: float, **options: Any) -> None:
    """Draw text at the left edge of axes, at a height in data units, shifted by points."""
    place = ax.get_yaxis_transform() + style.shift(ax, dx, 0)
    ax.text(0.0, y, words, transform=place, fontsize=style.SMALL, va="center", **options)


FINE = 61


@style.styled()
def loops_figure(found: Characterisation) -> Figure:
    """Draw measured tension over span of the map's loops, with the fitted muscle while it shortens and lengthens."""
    fig = style.figure(style.MIDDLE, 4.7)
    ax = fig.add_axes((0.09, 0.11, 0.8, 0.74))
    record, muscle, cm = found.records["map"], found.muscle, from_si(1.0, "m", "cm")
    colour, ends = COLOURS["tension"], []
    for i in range(1, ISOBARS + 1):
        parts = [record.segments(f"{way} {i}")[0] for way in ("shorten", "lengthen")]
        low, high = (float(f(parts[0]["span"])) for f in (np.min, np.max))
        if high - low < 0.01 * found.bounds.rest_length:
            continue
        pressure = float(np.mean(parts[0]["pressure"]))
        for part in parts:
            ax.plot(part["span"] * cm, part["tension"], color=INK_3, lw=style.HAIR, zorder=1)
        lengths = np.linspace(low, high, FINE)
        for way in (-1.0, 1.0):
            tension = np.asarray(muscle.quasi_static_tension(lengths, pressure, way))
            ax.plot(lengths * cm, tension, color=colour, lw=style.LINE, zorder=2)
        bar = style.pressure_text(from_si(pressure, "Pa", "bar"), unit=i == ISOBARS)
        ends.append((float(high * cm), float(parts[0]["tension"][0]), bar))
    room = 0.02 * (found.bounds.rest_length - float(record["span"].min())) * cm
    ax.set_xlim(float(record["span"].min()) * cm - room, found.bounds.rest_length * cm + room)
    ax.set_ylim(-0.02 * found.evaluation.largest, 1.08 * float(record["tension"].max()))
    style.quantity_axes(ax, x=("Span, cm", "length"), y=("Tension, N", "tension"))
    style.end_labels(ax, ends, quantity="pressure")
    style.heading(ax, "Loops of the map", "gray: measured\N{EM SPACE}— fitted, full friction either way", above=24.0)
    return fig


@style.styled()
def relaxation_figure(found: Characterisation) -> Figure:
    """Draw the tension after the stretch, measured and fitted."""
    fig = style.figure(style.NARROW, 2.9)
    ax = fig.add_axes((0.16, 0.17, 0.8, 0.62))
    time, measured, fitted = relaxation_curve(found.records, found.evaluation)
    ax.plot(time, measured, color=INK_3, lw=style.HAIR, zorder=1)
    ax.plot(time, fitted, color=COLOURS["tension"], lw=style.LINE, zorder=2)
    style.quantity_axes(ax, x=("Time since the stretch, s", None), y=("Tension, N", "tension"))
    total = found.evaluation.relaxation.total
    style.heading(ax, "Relaxation", f"{number(total.value / 100.0, 3)} N/cm from 1 s to 30 s", above=22.0)
    return fig


@style.styled()
def held_out_figure(found: Characterisation) -> Figure:
    """Draw the errors of the held-out points over the measured tension, with the 95 % interval."""
    fig = style.figure(style.NARROW, 2.9)
    ax = fig.add_axes((0.16, 0.17, 0.8, 0.62))
    _held_out(ax, found.evaluation.held_out, found.evaluation.half_width)
    share = 100.0 * found.held_out_error
    style.heading(ax, "Held-out points", f"rms {number(share, 2)} % of the largest", above=22.0)
    return fig


def _held_out(ax: Axes, points: tuple[HeldOut, ...], half: float) -> None:
    measured = np.array([p.measured for p in points])
    error = np.array([p.predicted - p.measured for p in points])
    ax.axhspan(-half, half, color=SUNKEN, ec=RULE, lw=style.HAIR, zorder=0)
    ax.axhline(0.0, color=INK_3, lw=style.HAIR, zorder=1)
    ax.plot(measured, error, style.MARKERS["tension"], mfc=COLOURS["tension"], mec=PANEL, mew=0.4, ms=4.5, zorder=2)
    ax.set_ylim(-1.6 * max(half, float(np.abs(error).max())), 1.6 * max(half, float(np.abs(error).max())))
    style.quantity_axes(ax, x=("Measured tension, N", "tension"), y=("Predicted less measured, N", "tension"))
    ax.text(0.99, 0.04, "band: 95 %", transform=ax.transAxes, ha="right", va="bottom", fontsize=style.SMALL, color=INK)


FAULTS_LEFT, FAULTS_TOP, FAULTS_FOOT, FAULTS_ROW = 1.9, 1.75, 0.15, 0.32  # [inch]
FULL = 0.5  # share from which on a number is written in the colour of the paper


@style.styled()
def confusion_figure(matrix: Mapping[str, Mapping[str, int]], titles: Mapping[str, str]) -> Figure:
    """Draw shares of the runs of each fault by what was found; empty where that never happened.

    Args:
        matrix: number of runs by the fault that there was and the one that was found; its first row has all columns.
        titles: faults in words, by name.

    Raises:
        InputError: if there are no runs.
    """
    from matplotlib.patches import Rectangle

    rows = [name for name, row in matrix.items() if sum(row.values())]
    if not rows:
        raise InputError("matrix", None, "must have at least one run")
    columns = list(matrix[rows[0]])
    height = FAULTS_TOP + FAULTS_FOOT + FAULTS_ROW * len(rows)
    fig = style.figure(style.MIDDLE, height, rows=True, least=5.5)
    ax = fig.add_axes(
        (
            FAULTS_LEFT / style.MIDDLE,
            FAULTS_FOOT / height,
            0.93 - FAULTS_LEFT / style.MIDDLE,
            FAULTS_ROW * len(rows) / height,
        )
    )
    ax.set_xlim(-0.5, len(columns) - 0.5)
    ax.set_ylim(len(rows) - 0.5, -0.5)
    ax.grid(visible=False)
    for side in ax.spines.values():
        side.set_visible(False)
    ax.set_yticks(range(len(rows)), [f"{titles.get(n, n)}  {sum(matrix[n].values())}" for n in rows])
    ax.set_xticks(range(len(columns)), [titles.get(n, n) for n in columns], rotation=38, ha="left")
    ax.tick_params(length=0, labelsize=style.SMALL, top=False, labeltop=True, labelbottom=False, bottom=False)
    for y, there in enumerate(rows):
        runs = sum(matrix[there].values())
        for x, found in enumerate(columns):
            share = matrix[there][found] / runs
            ax.add_patch(
                Rectangle((x - 0.47, y - 0.44), 0.94, 0.88, facecolor=PANEL, edgecolor=RULE, lw=style.HAIR, zorder=1)
            )
            if share > 0.0:
                right = there == found
                shade = COLOURS["tension" if right else "pressure"]
                ax.add_patch(
                    Rectangle((x - 0.47, y - 0.44), 0.94, 0.88, facecolor=shade, alpha=max(share, 0.06), lw=0, zorder=2)
                )
                ink = PANEL if share > FULL else INK
                ax.text(
                    x, y, f"{100.0 * share:.0f}", ha="center", va="center", fontsize=style.SMALL, color=ink, zorder=3
                )
    ax.text(
        0.0, 1.0, "Found, % of the runs of each row", transform=fig.transFigure + style.shift(ax, 8, -14),
        fontsize=style.NORMAL, fontweight="bold", color=INK, va="top",
    )  # fmt: skip
    ax.text(
        0.0, 1.0, "rows: the fault that there was, and its runs", transform=fig.transFigure + style.shift(ax, 8, -27),
        fontsize=style.SMALL, color=INK_3, va="top",
    )  # fmt: skip
    return fig
