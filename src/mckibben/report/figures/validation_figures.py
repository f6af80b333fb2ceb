"""Figure of every law on every static data set: errors of prediction, a panel per data set, a row per law."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ...errors import InputError
from ...muscles.laws import law_type
from ...studies.validation import StaticResult, Validation, ordered_laws
from . import formats, style
from .style import COLOURS, INK, INK_2, INK_3, PANEL, RULE, SUNKEN, number

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
        ax = fig.add_axes(
            (left / style.WIDE, FOOT / height, width / style.WIDE, ROW * len(laws) / height),
        )
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
