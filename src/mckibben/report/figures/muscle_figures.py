"""Figures of one muscle and its law: tension and volume over length, free length over pressure, and the braid to scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from ...errors import InputError
from ...muscles.braid import BraidShape, braid_of
from ...muscles.build import law_from_specimen
from ...muscles.law import TensionLaw
from ...muscles.plausible import HIGHEST_PRESSURE
from ...quantities import from_si
from ...specimens import Specimen
from . import formats, style
from .fit_figures import pulling, tension_grid
from .style import COLOURS, INK, INK_2, INK_3, PANEL, SUNKEN, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.transforms import Transform


FINE = 81
SCALES = (5.0, 2.0, 1.0, 0.5, 0.4, 0.25, 0.2, 0.1, 0.05, 0.02, 0.01)


# ---- curves of a law


@style.styled()
def law_curves(law: TensionLaw, *, title: str, pressures: Sequence[float] | None = None) -> Figure:
    """Draw a law: tension over length, free length over pressure, and volume over length if the law has one.

    Args:
        law: the law.
        title: title of the muscle.
        pressures: gauge pressures of the lines [Pa]; 1 to 5 bar by default.
    """
    bars = np.array(sorted(pressures or [1e5, 2e5, 3e5, 4e5, 5e5]), float)
    span = working_lengths(law, float(bars[-1]))
    with_volume = law.has_volume()
    fig = style.figure(style.WIDE, 3.9)
    ratios = [1.55, 1.0, 1.0] if with_volume else [1.55, 1.0]
    grid = fig.add_gridspec(
        1, len(ratios), left=0.05, right=0.945, bottom=0.13, top=0.745, wspace=0.36, width_ratios=ratios
    )
    panels = [fig.add_subplot(g) for g in (grid[i] for i in range(len(ratios)))]
    draw_tension(panels[0], law, span, bars)
    style.heading(panels[0], title, law.title, above=46.0)
    style.heading(panels[0], "Under load", "○ free length; grey: always slack", above=24.0)
    draw_free_length(panels[1], law, float(bars[-1]))
    style.heading(panels[1], "Unloaded", above=24.0)
    if with_volume:
        draw_volume(panels[2], law, span, bars)
        style.heading(panels[2], "Gas inside", above=24.0)
    return fig


def stated_braid(law: TensionLaw, stated: Specimen | None) -> BraidShape | None:
    """The braid of a law, else of another law that the specimen states; None where none of them has a braid."""
    others = [] if stated is None else [law_from_specimen(stated, name) for name in stated.laws]
    return next((shape for one in (law, *others) if (shape := braid_of(one)) is not None), None)


def working_lengths(law: TensionLaw, highest: float) -> tuple[float, float]:
    """Range from just below the free length at the highest pressure [Pa] to the upper working or rest length [m]."""
    free = float(np.asarray(law.free_length(highest)))
    low, high = (float(np.asarray(end)) for end in law.length_range())
    stated = [float(v) for name in ("upper_length", "rest_length") if (v := getattr(law, name, None)) is not None]
    longest = min(max(stated), high) if stated else low + 0.9 * (high - low)
    return max(low, free - 0.06 * max(longest - free, 0.1 * longest)), longest


def draw_tension(ax: Axes, law: TensionLaw, span: tuple[float, float], pressures: np.ndarray) -> None:
    """Draw tension over length, one line per gauge pressure [Pa]; the muscle is slack left of each free length."""
    cm = from_si(1.0, "m", "cm")
    lengths = np.linspace(*span, FINE)
    force = tension_grid(law, lengths, pressures)
    margin = 0.025 * (span[1] - span[0])
    ax.set_xlim((span[0] - margin) * cm, (span[1] + margin) * cm)
    top = float(np.nanmax(force[:, -1])) * 1.07
    ax.set_ylim(-0.03 * top, top)
    style.quantity_axes(ax, x=("Length, cm", "length"), y=("Tension, N", "tension"))
    # Never taut here: shorter than the free length at the highest pressure drawn.
    free, line = pulling(lengths, force[-1])
    if len(free) < len(lengths) or line[0] == 0.0:
        ax.axvspan(
            ax.get_xlim()[0], float(free[0]) * cm if len(free) else ax.get_xlim()[1], color=SUNKEN, lw=0, zorder=0
        )
    ends = []
    for pressure, row, opacity in zip(pressures, force, style.graded(len(pressures), 0.5), strict=True):
        x, y = pulling(lengths, row)
        if not len(x):
            continue
        ax.plot(x * cm, y, color=COLOURS["tension"], lw=style.LINE + 0.3, alpha=opacity, zorder=2)
        if y[0] == 0.0:
            ax.plot([x[0] * cm], [0.0], "o", mfc=PANEL, mec=INK_3, mew=0.8, ms=4.0, zorder=3, clip_on=False)
        bar = from_si(float(pressure), "Pa", "bar")
        ends.append((float(x[-1]) * cm, float(y[-1]), number(bar)))
    if ends:
        ends[-1] = (*ends[-1][:2], ends[-1][2] + "\N{NO-BREAK SPACE}bar")
    style.end_labels(ax, ends, quantity="pressure")


def draw_free_length(ax: Axes, law: TensionLaw, highest: float) -> None:
    """Draw length of the unloaded muscle over gauge pressure, up to `highest` [Pa]."""
    pressures = np.linspace(0.0, highest, FINE)
    free = np.asarray(law.free_length(pressures))
    ax.plot(
        pressures * from_si(1.0, "Pa", "bar"), free * from_si(1.0, "m", "cm"), color=COLOURS["length"], lw=style.HEAVY
    )
    ax.set_xlim(0.0, from_si(highest, "Pa", "bar") * 1.02)
    low, high = ax.get_ylim()
    room = max(0.04 * high - (high - low), 0.0) / 2.0  # a free length that hardly moves looks as if it hardly moves
    ax.set_ylim(low - room, high + room)
    style.quantity_axes(ax, x=("Pressure, bar", "pressure"), y=("Free length, cm", "length"))


def draw_volume(ax: Axes, law: TensionLaw, span: tuple[float, float], pressures: np.ndarray) -> None:
    """Draw gas volume over length at the lowest and the highest gauge pressure [Pa], in ink as a derived quantity."""
    cm, ml = from_si(1.0, "m", "cm"), from_si(1.0, "m^3", "cm^3")
    lengths = np.linspace(*span, FINE)
    shown = [float(pressures[-1])] if len(pressures) == 1 else [float(pressures[0]), float(pressures[-1])]
    curves = [np.asarray(law.volume(lengths, p)) * ml for p in shown]
    if len(curves) > 1 and np.abs(curves[0] - curves[1]).max() < 0.01 * curves[1].max():
        shown, curves = shown[-1:], curves[-1:]
    for curve, opacity in zip(curves, style.graded(len(curves), 0.55), strict=True):
        ax.plot(lengths * cm, curve, color=INK, lw=style.LINE + 0.3, alpha=opacity)
    margin = 0.025 * (span[1] - span[0])
    ax.set_xlim((span[0] - margin) * cm, (span[1] + margin) * cm)
    ax.set_ylim(0.0, max(float(c.max()) for c in curves) * 1.08)
    style.quantity_axes(ax, x=("Length, cm", "length"), y=("Volume, cm³", None))
    labels = [number(from_si(p, "Pa", "bar")) for p in shown]
    labels[-1] = labels[-1] + "\N{NO-BREAK SPACE}bar" if len(curves) > 1 else ""
    ends = [(lengths[-1] * cm, float(c[-1]), t) for c, t in zip(curves, labels, strict=True) if t]
    style.end_labels(ax, ends, quantity="pressure")


# ---- laws beyond their ranges

THREADS = 10  # that are drawn in each direction; a real braid has more
PER_ROW = 4
STRETCHED = (0.7, 1.3)  # of the rest length
BARS = (0.0, 1e5, 3e5, 6e5)  # gauge [Pa]
TICKS = (0.0, 1.0, 10.0, 50.0)


@style.styled()
def range_curves(laws: Mapping[str, TensionLaw]) -> Figure:
    """Draw the tension of laws from 0.7 to 1.3 rest lengths, within their ranges and beyond.

    The tension is over that at the longest length and 10 bar, on an axis that is straight up to one and logarithmic beyond.
    A law without a rest length is drawn over its longest length.

    Args:
        laws: laws by the names that stand above the panels.
    """
    rows = -(-len(laws) // PER_ROW)
    fig = style.figure(style.WIDE, 0.9 + 1.9 * rows)
    grid = fig.add_gridspec(
        rows, PER_ROW, left=0.075, right=0.975, bottom=0.3 / rows, top=1.0 - 0.42 / rows, wspace=0.2, hspace=0.8
    )
    for place, (name, law) in enumerate(laws.items()):
        ax = fig.add_subplot(grid[divmod(place, PER_ROW)])
        low, high = (float(np.asarray(end)) for end in law.length_range())
        rest = float(getattr(law, "rest_length", high))
        share = np.unique(np.concatenate([np.linspace(*STRETCHED, 241), high / rest + np.linspace(0.0, 0.03, 61)]))
        full = float(law.tension(high, HIGHEST_PRESSURE))
        force = np.asarray(law.tension(share[:, None] * rest, np.array(BARS))) / full
        for line, opacity in zip(force.T, style.graded(len(BARS), 0.3), strict=True):
            ax.plot(share, line, color=COLOURS["tension"], lw=style.LINE, alpha=opacity, zorder=2)
        for start, end in ((STRETCHED[0], low / rest), (high / rest, STRETCHED[1])):
            if end > start:
                ax.axvspan(start, end, color=SUNKEN, lw=0, zorder=0)
        ax.set_xlim(*STRETCHED)
        ax.set_yscale("symlog", linthresh=1.0, linscale=1.0)
        ax.set_ylim(-0.05, 100.0)
        ax.set_xticks([0.7, 1.0, 1.3])
        ax.set_yticks(TICKS, [number(tick) for tick in TICKS])
        ax.minorticks_off()
        style.quantity_axes(
            ax,
            x=("Length over rest length" if place >= len(laws) - PER_ROW else "", "length"),
            y=("Tension, relative" if place % PER_ROW == 0 else "", "tension"),
        )
        style.heading(ax, name, "0, 1, 3, 6 bar; grey: out of range" if place == 0 else "", above=24.0)
    return fig


# ---- the muscle to scale


@style.styled()
def muscle_drawing(shape: BraidShape, lengths: Sequence[float], *, title: str, remarks: Sequence[str] = ()) -> Figure:
    """Draw a muscle at a few lengths to scale: diameter and braid angle follow the length, cos(theta) = L/b.

    Args:
        shape: the braid.
        lengths: braid lengths, longest first [m]; below the thread length.
        title: title of the muscle.
        remarks: a word for each length, such as "at rest".

    Raises:
        InputError: if a length is not between zero and the thread length.
    """
    _check_lengths(shape, lengths)
    fitting = 0.045 * max(lengths)
    widths = [shape.diameter(v) for v in lengths]
    inch = 72.0 * from_si(1.0, "m", "inch")  # points in a metre
    across = formats.drawn_width(style.MIDDLE)
    room = 72.0 * across - 70.0
    scale = next((s for s in SCALES if (max(lengths) + 2.0 * fitting) * inch * s <= room), SCALES[-1])
    gaps, head, foot = 46.0, 44.0, 34.0  # [pt]
    tall = head + foot + sum(w * inch * scale + gaps for w in widths)
    fig = style.drawing(across, tall / 72.0)
    ax = fig.add_axes((0.0, 0.0, 1.0, 1.0))
    ax.set_axis_off()
    per_point = 1.0 / (inch * scale)  # metres on paper
    ax.set_xlim(0.0, 72.0 * across * per_point)
    ax.set_ylim(tall * per_point, 0.0)
    left, y = 14.0 * per_point + fitting, head * per_point
    for value, width, remark in zip(lengths, widths, list(remarks) + [""] * len(lengths), strict=False):
        draw_braid(ax, shape, value, (left, y + 0.5 * width), fitting, min(widths), THREADS, per_point)
        _dimensions(ax, shape, value, (left, y + 0.5 * width), fitting, per_point, remark)
        y += width + gaps * per_point
    head_text = ax.text(
        14.0 * per_point, 16.0 * per_point, title, fontsize=style.NORMAL, fontweight="bold", va="center"
    )
    ratio = f"{scale:g} : 1" if scale >= 1.0 else f"1 : {1.0 / scale:g}"
    words = f"braid to scale, {ratio} on paper"
    if across >= style.MIDDLE:
        words += f"; {THREADS} threads each way drawn"
    style.beside(ax, words, (1, 0), (7, 0), xycoords=head_text, color=INK_3, va="bottom")
    _scale_bar(ax, 14.0 * per_point, (tall - 16.0) * per_point, per_point, max(lengths))
    return fig


def draw_muscle(ax: Axes, shape: BraidShape, lengths: Sequence[float]) -> None:
    """A muscle at a few lengths, longest first [m], into axes, to the scale that their width leaves.

    Raises:
        InputError: if a length is not between zero and the thread length.
    """
    _check_lengths(shape, lengths)
    fitting, widths = 0.045 * max(lengths), [shape.diameter(v) for v in lengths]
    box = ax.get_window_extent()
    wide, tall = (72.0 * size / ax.figure.dpi for size in (box.width, box.height))
    gap = 46.0  # [pt]
    point = max(
        (max(lengths) + 2.0 * fitting) / max(wide - 40.0, 20.0), sum(widths) / max(tall - gap * len(widths), 20.0)
    )
    ax.set_axis_off()
    ax.set_xlim(0.0, wide * point)
    ax.set_ylim(tall * point, 0.0)
    left, y = 10.0 * point + fitting, 8.0 * point
    for value, width in zip(lengths, widths, strict=True):
        at = (left, y + 0.5 * width)
        draw_braid(ax, shape, value, at, fitting, min(widths), THREADS, point)
        _dimensions(ax, shape, value, at, fitting, point, "")
        y += width + gap * point


def _check_lengths(shape: BraidShape, lengths: Sequence[float]) -> None:
    for value in lengths:
        if not 0.0 < value < shape.thread_length:
            raise InputError(
                "length",
                None,
                f"must be between 0 m and {shape.thread_length:.4g} m, the thread length, got {value:.4g} m",
            )


def draw_braid(
    ax: Axes,
    shape: BraidShape,
    length: float,
    at: tuple[float, float],
    fitting: float,
    clamp: float,
    threads: int,
    point: float,
    transform: Transform | None = None,
) -> None:
    """Draw a muscle with its two end fittings.

    Args:
        ax: axes to draw into.
        shape: the braid.
        length: of the braid [m].
        at: where the braid begins, on its axis [m].
        fitting: length of an end fitting [m].
        clamp: diameter of an end fitting, without its rim [m].
        threads: drawn in each direction.
        point: of the paper [m].
        transform: of the drawing, whose muscle lies along x; that of the data by default.
    """
    from matplotlib.collections import LineCollection
    from matplotlib.patches import Rectangle

    where: dict[str, Any] = {} if transform is None else {"transform": transform}
    x0, middle = at
    radius = 0.5 * shape.diameter(length)
    ax.add_patch(Rectangle((x0, middle - radius), length, 2.0 * radius, fc=SUNKEN, ec="none", lw=0, zorder=1, **where))
    count = max(int(24 * shape.turns) + 1, 49)
    x = np.linspace(0.0, length, count)
    front, back = [], []
    for hand in (1.0, -1.0):
        for k in range(threads):
            phase = hand * 2.0 * np.pi * shape.turns * x / length + 2.0 * np.pi * k / threads
            line = np.stack([x0 + x, middle + radius * np.sin(phase)], axis=1)
            near = np.cos(phase) >= 0.0
            front += _runs(line, near)
            back += _runs(line, ~near)
    ax.add_collection(LineCollection(back, colors=INK_3, linewidths=0.35, alpha=0.35, zorder=2, **where))
    ax.add_collection(LineCollection(front, colors=INK_2, linewidths=0.75, zorder=3, **where))
    ax.plot([x0, x0 + length], [middle - radius] * 2, color=INK, lw=0.9, zorder=4, **where)
    ax.plot([x0, x0 + length], [middle + radius] * 2, color=INK, lw=0.9, zorder=4, **where)
    half = 0.5 * clamp + 1.5 * point
    for end in (x0 - fitting, x0 + length):
        ax.add_patch(Rectangle((end, middle - half), fitting, 2.0 * half, fc=INK_3, ec=INK, lw=0.9, zorder=5, **where))


def _runs(line: np.ndarray, keep: np.ndarray) -> list[np.ndarray]:
    """Pieces of a line on which `keep` holds, extended by one point so that they meet."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], keep, [False]]).astype(int)))
    return [line[a : b + 1] for a, b in zip(edges[::2], edges[1::2], strict=True) if b - a > 0]


def _dimensions(
    ax: Axes, shape: BraidShape, length: float, at: tuple[float, float], fitting: float, point: float, remark: str
) -> None:
    x0, middle = at
    width = shape.diameter(length)
    low = middle + 0.5 * width + 11.0 * point
    green = COLOURS["length"]
    ax.plot([x0, x0 + length], [low, low], color=green, lw=0.8)
    for end in (x0, x0 + length):
        ax.plot([end, end], [low - 4 * point, low + 4 * point], color=green, lw=0.8)
    angle = shape.degrees(length)
    text = f"{number(from_si(length, 'm', 'cm'), 2)}\N{NO-BREAK SPACE}cm"
    label = ax.text(x0, low + 6.0 * point, text, color=green, fontweight="bold", fontsize=style.SMALL, va="top")
    rest = f"braid angle {number(angle, 1)}°\N{EM SPACE}diameter {number(from_si(width, 'm', 'mm'), 1)}\N{NO-BREAK SPACE}mm"
    if remark:
        rest = f"{remark}\N{EM SPACE}{rest}"
    style.beside(ax, rest, (1, 1), (9, 0), xycoords=label, va="top", color=INK_2)
    side = x0 + length + fitting + 9.0 * point
    ax.plot([side, side], [middle - 0.5 * width, middle + 0.5 * width], color=INK_3, lw=0.8)
    for end in (-0.5, 0.5):
        ax.plot([side - 3 * point, side + 3 * point], [middle + end * width] * 2, color=INK_3, lw=0.8)


def _scale_bar(ax: Axes, x: float, y: float, point: float, longest: float) -> None:
    bar = next(v for v in (0.2, 0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001, 0.0) if v <= 0.35 * longest)
    ax.plot([x, x + bar], [y, y], color=INK, lw=1.6, solid_capstyle="butt")
    ax.text(
        x + bar + 6.0 * point,
        y,
        f"{number(from_si(bar, 'm', 'cm'))}\N{NO-BREAK SPACE}cm",
        va="center",
        fontsize=style.SMALL,
        color=INK_2,
    )


# A slender head that points up, notched behind: an equilateral triangle would not say which way it points.
ARROWS = 3  # along a path
HEAD = ((0.0, 1.0), (0.62, -0.8), (0.0, -0.5), (-0.62, -0.8), (0.0, 1.0))


class DrawnLoop(NamedTuple):
    """A closed or open path: displacement [m] and force [N] of equal shape (n,), in the order of time."""

    displacement: np.ndarray
    force: np.ndarray
    label: str = ""


@style.styled()
def loop_figure(
    first: DrawnLoop, second: DrawnLoop | None = None, *, title: str, note: str = "", zero: bool = True
) -> Figure:
    """Draw force over displacement with arrows along the path; a second loop is dashed.

    Args:
        first: drawn solid.
        second: drawn dashed, such as the same with half the range.
        title: heading.
        note: quieter words after it.
        zero: draw the line of no force.
    """
    fig = style.figure(style.MIDDLE * 0.75, 3.9)
    ax = fig.add_axes((0.12, 0.13, 0.74, 0.70))
    loops = [first] if second is None else [first, second]
    millimetres = from_si(1.0, "m", "mm")
    every_x = np.concatenate([np.asarray(p.displacement) for p in loops]) * millimetres
    every_y = np.concatenate([np.asarray(p.force) for p in loops])
    for values, limits in ((every_x, ax.set_xlim), (every_y, ax.set_ylim)):
        room = 0.06 * (values.max() - values.min()) or 1.0
        limits(values.min() - room, values.max() + room)
    if zero:
        ax.axhline(0.0, color=INK_2, lw=0.7, zorder=1)
    for path, dash in zip(loops, style.RECORDING_DASHES, strict=False):
        x, y = np.asarray(path.displacement) * millimetres, np.asarray(path.force)
        ax.plot(x, y, ls=dash, color=COLOURS["tension"], lw=style.LINE + 0.3, zorder=3)
        _arrows(ax, x, y)
        if path.label:
            i = int(np.argmax(x + 1e-9 * y))
            style.beside(ax, path.label, (x[i], y[i]), (8, -3), va="center", annotation_clip=False, fontweight="bold")
    style.quantity_axes(ax, x=("Displacement, mm", "length"), y=("Tension, N", "tension"))
    style.heading(ax, title, note, above=24.0)
    return fig


def _arrows(ax: Axes, x: np.ndarray, y: np.ndarray) -> None:
    """Draw arrowheads along a path, at equal shares of its drawn length after the first quarter."""
    from matplotlib.markers import MarkerStyle
    from matplotlib.path import Path
    from matplotlib.transforms import Affine2D

    points = ax.transData.transform(np.stack([x, y], axis=1))
    walked = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(points, axis=0).T))])
    if walked[-1] == 0.0:
        return
    for share in (np.arange(ARROWS) + 0.6) / ARROWS:
        i = min(max(int(np.searchsorted(walked, share * walked[-1])), 1), len(x) - 1)
        # The direction over a few points, for that of one step may be lost in noise.
        step = points[min(i + 1, len(x) - 1)] - points[max(i - 2, 0)]
        turned = float(np.degrees(np.arctan2(step[1], step[0]))) - 90.0
        head = MarkerStyle(Path(HEAD), transform=Affine2D().rotate_deg(turned))
        ax.plot([x[i]], [y[i]], marker=head, ms=14, mfc=COLOURS["tension"], mec="none", mew=0.0, zorder=4)
