"""Figures of muscles side by side, normalised: static curves above, protocols below, and matches.

McKibben muscles are drawn in the colour of tension, biological ones in ink; several of a kind differ by their dashes, and
each line ends in its letter, so that the figure reads in greyscale too.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...errors import InputError
from ...quantities import from_si
from ...studies.comparison.match import Match
from ...studies.comparison.protocols import LOAD, PULSE, STIFF_AT, Trials, trials
from . import style
from .places import BannerRow, Margins, set_margins
from .style import COLOURS, INK, INK_2, INK_3, RECORDING_DASHES, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ...studies.comparison import MuscleTable


WIDTH = style.WIDE  # [inch]
LEFT, RIGHT, FOOT, KEY_LINE, KEY, GAP_X, GAP_Y, TALL = 0.42, 0.4, 0.5, 0.2, 0.3, 0.62, 1.02, 1.72  # [inch]
COLUMNS = 4
MS = from_si(1.0, "s", "ms")
NEAR = 0.07  # of the axes: letters that are nearer are written together
Panel = tuple[str, str, str, tuple[str, str | None], tuple[str, str | None], Callable[..., None]]


@style.styled()
def comparison_figure(muscles: Sequence[Trials], matches: Sequence[Match] = ()) -> Figure:
    """Draw a row of static curves, a row of protocols if they were run, and a row per match.

    Raises:
        InputError: nothing to draw, or more muscles of a kind than there are dashes.
    """
    if not muscles:
        raise InputError("muscles", None, "must be one or more")
    lines = _lines(muscles)
    panels = [
        [p for p in row if any(_CURVE.get(p[0], p[0]) in t.curves for t in muscles)] for row in (_STATIC, _PROTOCOLS)
    ]
    rows = [row for row in panels if row]
    count = len(rows) + len(matches)
    above = KEY + KEY_LINE * len(muscles)
    height = FOOT + above + 0.62 + count * TALL + (count - 1) * GAP_Y
    fig = style.figure(WIDTH, height)
    _key(fig, muscles, lines, height)
    across = (WIDTH - LEFT - RIGHT - (COLUMNS - 1) * GAP_X) / COLUMNS

    def axes(row: int, column: int) -> Axes:
        y = FOOT + (count - 1 - row) * (TALL + GAP_Y)
        x = LEFT + column * (across + GAP_X)
        return fig.add_axes((x / WIDTH, y / height, across / WIDTH, TALL / height))

    for i, row in enumerate(rows):
        for j, panel in enumerate(row):
            _panel(axes(i, j), panel, muscles, lines)
    for i, match in enumerate(matches, len(rows)):
        for j, name in enumerate(_MATCHED):
            _matched(axes(i, j), match, name)
    return fig


def table_figure(compared: MuscleTable) -> Figure:
    """Draw the muscles of a comparison: static curves, and protocols and matches where it has them.

    Raises:
        InputError: only recordings were compared, which have no law to draw.
    """
    if not compared.muscles:
        raise InputError("muscles", None, "are missing: a recording alone has no law to draw")
    curves = compared.trials or [trials(muscle, names=()) for muscle in compared.muscles]
    return comparison_figure(curves, compared.matches)


class _Line:
    """Style and letter of a muscle."""

    def __init__(self, letter: str, dash: Any, biological: bool) -> None:
        self.letter, self.biological = letter, biological
        self.style: dict[str, Any] = {
            "color": INK if biological else COLOURS["tension"],
            "ls": dash,
            "lw": style.LINE if biological else style.HEAVY,
        }


def _lines(muscles: Sequence[Trials]) -> list[_Line]:
    used = {True: 0, False: 0}
    lines = []
    for i, one in enumerate(muscles):
        biological = one.muscle.fibre is not None
        if used[biological] >= len(RECORDING_DASHES):
            allowed = f"must be {len(RECORDING_DASHES)} of a kind in one figure"
            raise InputError("muscles", len(muscles), allowed)
        lines.append(_Line(chr(ord("A") + i), RECORDING_DASHES[used[biological]], biological))
        used[biological] += 1
    return lines


def _key(fig: Figure, muscles: Sequence[Trials], lines: Sequence[_Line], height: float) -> None:
    from matplotlib.lines import Line2D

    rows = []
    for i, (one, line) in enumerate(zip(muscles, lines, strict=True)):
        y = (height - KEY + 0.06 - KEY_LINE * i) / height
        x = np.array([LEFT, LEFT + 0.42]) / WIDTH
        sample = Line2D(x, [y, y], **line.style)
        fig.add_artist(sample)
        title = f"{line.letter}  {one.muscle.spec.title}"
        drive = (
            "full activation" if line.biological else f"full drive {number(from_si(one.muscle.full, 'Pa', 'bar'))} bar"
        )
        size = f"F₀ {one.muscle.full_tension:.3g} N, L₀ {number(from_si(one.muscle.rest_length, 'm', 'cm'))} cm"
        said = fig.text(
            (LEFT + 0.52) / WIDTH, y, title, va="center", fontsize=style.NORMAL, fontweight="bold", color=INK
        )
        fig.draw_without_rendering()
        end = said.get_window_extent().x1 / fig.dpi
        note = fig.text((end + 0.12) / WIDTH, y, f"{drive}, {size}", va="center", fontsize=style.SMALL, color=INK_3)
        rows.append(BannerRow(said, note, sample))
    set_margins(fig, Margins(banner=tuple(rows)))


def _panel(ax: Axes, panel: Panel, muscles: Sequence[Trials], lines: Sequence[_Line]) -> None:
    name, title, remark, x, y, finish = panel
    ends = []
    curve = _CURVE.get(name, name)
    for one, line in zip(muscles, lines, strict=True):
        if curve not in one.curves:
            continue
        drawn = one.curves[curve]
        across, up = _DRAWN[name](drawn, one) if name in _DRAWN else drawn
        ax.plot(across, up, **line.style)
        ends.append((across, up, line))
    style.quantity_axes(ax, x=x, y=y)
    style.heading(ax, title, remark)
    finish(ax, muscles, lines)
    _letters(ax, ends)


def _letters(ax: Axes, ends: Sequence[tuple[np.ndarray, np.ndarray, _Line]]) -> None:
    """Draw the letter of each line at its end; lines that end together share a place."""
    low, high = ax.get_xlim()
    bottom, top = ax.get_ylim()
    marks: list[tuple[float, float, str, bool]] = []
    for x, y, line in ends:
        inside = np.flatnonzero((x >= low) & (x <= high) & (y >= bottom) & (y <= top))
        if not inside.size:
            continue
        last = inside[np.argmax(x[inside])]
        place = (float(x[last]) - low) / (high - low), (float(y[last]) - bottom) / (top - bottom)
        near = [i for i, m in enumerate(marks) if np.hypot(m[0] - place[0], m[1] - place[1]) < NEAR]
        if near:
            old = marks[near[0]]
            marks[near[0]] = (old[0], old[1], f"{old[2]}, {line.letter}", old[3] or line.biological)
        else:
            marks.append((*place, line.letter, line.biological))
    for across, up, letters, biological in marks:
        if len(marks) == 1 and len(ends) > 1:  # all lines end here: letters would tell nothing
            return
        style.beside(
            ax,
            letters,
            (across, up),
            (4, 0),
            xycoords="axes fraction",
            va="center",
            fontweight="bold",
            color=style.colour(None if biological else "tension"),
            annotation_clip=False,
            bbox={"boxstyle": "round,pad=0.1", "fc": style.PANEL, "ec": "none", "alpha": 0.8},
        )


# ---- what is special in a panel


def _per_section(curve: Any, one: Trials) -> Any:
    """Tension per section [N/cm^2]; nothing if the section is not known."""
    lengths, relative = curve
    area = one.muscle.section_area
    scale = np.nan if area is None else from_si(one.muscle.full_tension / area, "N/m^2", "N/cm^2")
    return lengths, relative * scale


def _milliseconds(curve: Any, _: Trials) -> Any:
    return curve[0] * MS, curve[1]


_CURVE = {"section": "force_length", "step": "rise"}  # panels that show another curve's numbers
_DRAWN: dict[str, Callable[[Any, Trials], Any]] = {
    "section": _per_section,
    "twitch": _milliseconds,
    "step": _milliseconds,
    "release": _milliseconds,
}


def _nothing(ax: Axes, muscles: Sequence[Trials], lines: Sequence[_Line]) -> None:
    ax.set_ylim(bottom=0.0)


def _lengths(ax: Axes, muscles: Sequence[Trials], lines: Sequence[_Line]) -> None:
    for one, line in zip(muscles, lines, strict=True):
        ax.plot(*one.curves["passive"], **{**line.style, "lw": 0.8, "alpha": 0.7})
    ax.set_xlim(0.55, 1.5)
    ax.set_ylim(0.0, 2.0)


def _section(ax: Axes, muscles: Sequence[Trials], lines: Sequence[_Line]) -> None:
    ends = [
        np.nanmax(_per_section(t.curves["force_length"], t)[1]) for t in muscles if t.muscle.section_area is not None
    ]
    ax.set_xlim(0.55, 1.5)
    ax.set_ylim(0.0, 1.08 * max(ends, default=1.0))


def _speeds(ax: Axes, muscles: Sequence[Trials], lines: Sequence[_Line]) -> None:
    for one, line in zip(muscles, lines, strict=True):
        if "force_velocity" in one.curves:
            x, y = one.curves["force_velocity"]
            marker = "o" if line.biological else "^"
            ax.plot(x[1:], y[1:], ls="none", marker=marker, ms=3.2, mfc=style.PANEL, mec=line.style["color"], mew=0.9)
    ax.set_ylim(0.0, 1.1)
    ax.set_xlim(left=0.0)


def _until(end: float) -> Callable[..., None]:
    def finish(ax: Axes, muscles: Sequence[Trials], lines: Sequence[_Line]) -> None:
        ax.set_xlim(-20.0, end)
        ax.set_ylim(bottom=0.0)

    return finish


def _twitch(ax: Axes, muscles: Sequence[Trials], lines: Sequence[_Line]) -> None:
    _until(300.0)(ax, muscles, lines)
    ax.axvspan(0.0, PULSE * MS, ymax=0.03, color=INK_3, lw=0)


def _step(ax: Axes, muscles: Sequence[Trials], lines: Sequence[_Line]) -> None:
    for one, line in zip(muscles, lines, strict=True):
        if "fall" in one.curves:
            time, pull = one.curves["fall"]
            ax.plot(time * MS, pull, **line.style)
    _until(200.0)(ax, muscles, lines)


_LENGTH = ("Length over L₀", "length")
_TENSION = ("Tension over F₀", "tension")
_TIME = ("Time, ms", None)
_SPEED = ("Shortening velocity, L₀/s", None)
_STATIC: list[Panel] = [
    ("section", "Tension per section", "full drive", _LENGTH, ("N/cm²", "tension"), _section),
    ("force_length", "Tension", "thin: not driven", _LENGTH, _TENSION, _lengths),
    ("stiffness", "Stiffness", f"at {STIFF_AT:g} L₀", _TENSION, ("dF/dL, F₀/L₀", None), _nothing),
    ("force_velocity", "Tension", "isokinetic", _SPEED, ("Over the isometric one", "tension"), _speeds),
]
_PROTOCOLS: list[Panel] = [
    ("twitch", "Isometric twitch", f"bar: {PULSE * MS:.0f} ms command", _TIME, _TENSION, _twitch),
    ("step", "Isometric step", "rise and fall", _TIME, _TENSION, _step),
    ("release", "Quick release", f"to {LOAD:g} F₀", _TIME, _LENGTH, lambda ax, *_: ax.set_xlim(0.0, 300.0)),
    ("work_loop", "Work loop", "1 Hz", _LENGTH, _TENSION, _nothing),
]


# ---- a match

_MATCHED = ("force_length", "passive", "force_velocity", "twitch")
_TITLES = {
    "force_length": ("Full drive", _LENGTH),
    "passive": ("Not driven", _LENGTH),
    "force_velocity": ("Shortening", _SPEED),
    "twitch": ("Twitch", _TIME),
}


def _matched(ax: Axes, match: Match, name: str) -> None:
    scale = MS if name == "twitch" else 1.0
    colour = COLOURS["tension"]
    curves = (
        (match.target_curves, match.target.id, {"color": INK, "lw": style.LINE, "ls": "-"}),
        (match.curves_before, f"{match.muscle.id} as built", {"color": colour, "lw": 1.0, "ls": RECORDING_DASHES[2]}),
        (match.curves_after, "with elements", {"color": colour, "lw": style.HEAVY, "ls": "-"}),
    )
    for which, label, how in curves:
        x, y = which[name]
        ax.plot(scale * x, y, label=label, **how)
    if name == "twitch" and match.simulated is not None:
        x, y = match.simulated
        label = "the same, on a machine"
        ax.plot(
            scale * x[::60], y[::60], ls="none", marker="^", ms=3.0, mfc=style.PANEL, mec=colour, mew=0.8, label=label
        )
    title, x_title = _TITLES[name]
    style.quantity_axes(ax, x=x_title, y=("Over that at rest length", "tension"))
    remark = f"rms {match.rms_before[name]:.2f} to {match.rms_after[name]:.2f}"
    style.heading(ax, title, remark)
    top = 1.2 * max(float(match.target_curves[name][1].max()), float(match.curves_after[name][1].max()), 0.25)
    ax.set_ylim(0.0, top)
    if name == "twitch":  # its legend has all lines; there is room for it beside the steepest curve
        others = ax.figure.axes[-2]
        style.key(
            others,
            *ax.get_legend_handles_labels(),
            loc="center right",
            bbox_to_anchor=(1.02, 0.56),
            fontsize=style.SMALL - 1.0,
            handlelength=2.0,
            labelspacing=0.5,
            borderpad=0.4,
            labelcolor=INK_2,
        )
