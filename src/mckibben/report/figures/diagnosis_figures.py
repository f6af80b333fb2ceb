"""Figure of a confusion matrix: which fault a rig had, and which one was found."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ...errors import InputError
from . import style
from .style import COLOURS, INK, INK_3, PANEL, RULE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

NAMES, TOP, FOOT, ROW = 1.9, 1.75, 0.15, 0.32  # [inch]
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
    height = TOP + FOOT + ROW * len(rows)
    fig = style.figure(style.MIDDLE, height, rows=True, least=5.5)
    ax = fig.add_axes((NAMES / style.MIDDLE, FOOT / height, 0.93 - NAMES / style.MIDDLE, ROW * len(rows) / height))
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
