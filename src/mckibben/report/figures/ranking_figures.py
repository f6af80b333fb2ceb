"""Figure of the ranking of a fit: laws by their errors, a row per law."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from ...identification.ranking import COLUMNS, Ranking
from ...identification.ranking import law_title as law_title
from . import formats, style
from .style import CAUTION, COLOURS, INK, INK_2, INK_3, PANEL, RULE, number

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


NARROW_TABLE, WIDE_TABLE = 5.5, 9.0  # widths of a figure, below which the ranking has fewer columns [inch]


class _Row(NamedTuple):
    name: str
    remark: str
    converged: bool
    predicted: tuple[float, float] | None  # root mean square and largest, share of the largest tension
    beyond: tuple[float, float] | None
    fitted: tuple[float, float]


@style.styled()
def ranking(study: Ranking) -> Figure:
    """Draw laws in their ranking with errors of prediction, in % of the largest tension on a logarithmic axis.

    Root mean square and largest error of points that were left out; dashed, those above the training pressures.
    """
    each = 0.42 if formats.drawn_width(style.WIDE) < NARROW_TABLE else 0.315  # [inch]
    fig = style.figure(style.WIDE, 1.13 + each * (len(study.fits) + len(study.published)), rows=True)
    height = fig.get_figheight()
    ax = fig.add_axes((0.285, 0.47 / height, 0.405, 1.0 - 1.13 / height))
    draw_ranking(ax, study, names=0.285 * 72.0 * style.WIDE - 14.0)
    return fig


def _rows(study: Ranking) -> list[_Row]:
    rows, size = [], study.points.largest
    for row in study.ranked():
        fitted, title = "fit" in row, row["title"]
        converged = not fitted or row["fit"].converged
        if not fitted and len(title) > 24:
            title = title.split(",")[0]  # what follows the comma has no room beside the bars
        predicted, beyond = (
            (row[f"{key}_rmse"] / size, row[f"{key}_share"]) if f"{key}_rmse" in row else None
            for key in ("left_out", "above")
        )
        remark = "published" if not fitted else str(row["free"]) if converged else "not converged"
        rows.append(_Row(title, remark, converged, predicted, beyond, (row["rmse"] / size, row["share"])))
    return rows


def draw_ranking(ax: Axes, study: Ranking, *, names: float, brief: bool = False) -> None:
    """Draw one line per law with two lanes: predicted above, beyond the training below; numbers at the right.

    Args:
        ax: the axes.
        study: the laws, best first.
        names: how far left of the axes the names begin [pt].
        brief: fewer columns.
    """
    # In a column, names stand above the lanes and the table is reduced to the largest errors.
    narrow = formats.drawn_width(style.WIDE) < NARROW_TABLE
    brief = brief or formats.drawn_width(style.WIDE) < WIDE_TABLE
    rows, lanes = _rows(study), (-0.12, -0.36) if narrow else (0.17, -0.17)
    values = [
        100.0 * v
        for r in rows
        for pair in (r.predicted, r.beyond, None if r.predicted else r.fitted)
        if pair
        for v in pair
    ]
    finite = [v for v in values if math.isfinite(v) and v > 0.0]
    low, high = 0.1, 100.0
    if finite:  # errors above the largest tension itself are cut off
        low, high = min(finite) / 1.5, max(1.4 * min(max(finite), 100.0), 2.0 * min(finite))
    ax.set_xscale("log")
    ax.set_xlim(low, high)
    ax.set_ylim(len(rows) - 0.45, -0.6)
    ax.grid(visible=False, axis="y")
    ax.spines["left"].set_visible(False)
    steps = (1, 3) if brief and high > 100.0 * low else (1, 2, 5)
    ticks = [t for d in range(-3, 5) for t in (step * 10.0**d for step in steps) if low <= t <= high]
    ax.set_xticks(ticks, [number(t) for t in ticks])
    ax.minorticks_off()
    ax.set_yticks([])
    ax.set_xlabel(
        "Error, % of the largest tension",
        color=COLOURS["tension"],
        fontweight="bold",
        fontsize=style.SMALL + 0.5,
        labelpad=3,
    )
    for i, row in enumerate(rows):
        if i:
            ax.axhline(i - 0.5, color=RULE, lw=style.HAIR, zorder=0)
        pairs = (row.predicted or row.fitted, row.beyond)
        looks = ("fitted" if row.predicted is None else "predicted", "beyond")
        alone = (-0.2, 0.0) if narrow else (0.0, 0.0)
        for lane, pair, look in zip(lanes if row.beyond else alone, pairs, looks, strict=True):
            if pair:
                _draw_pair(ax, i - lane, [100.0 * v for v in pair], look, high, converged=row.converged)
        quiet = INK if row.converged else INK_3
        weight = "bold" if i == 0 else "normal"
        style.note(
            ax,
            row.name if row.converged or not narrow else f"{row.name}, {row.remark}",
            y=_share(ax, i - 0.3 if narrow else i),
            dx=0.0 if narrow else -names,
            color=quiet,
            fontweight=weight,
            fontsize=style.SMALL if brief else style.NORMAL,
        )
        if not narrow and (not brief or not row.remark.isdigit()):
            style.note(ax, row.remark, y=_share(ax, i), dx=-8, ha="right", color=INK_2 if row.converged else CAUTION)
    if not narrow:
        style.note(ax, "law", dx=-names, dy=9, va="bottom")
    if brief:
        style.note(ax, "▲ ▷ rms\N{EM SPACE}┃ largest", dx=0, dy=9, va="bottom", color=COLOURS["tension"])
    else:
        style.note(ax, "parameters", dx=-8, dy=9, ha="right", va="bottom")
    _columns(ax, rows, next((f.holdout.what for f in study.fits if f.holdout), ""), brief, below=0.2 if narrow else 0.0)


def _share(ax: Axes, row: float) -> float:
    bottom, top = ax.get_ylim()
    return (row - bottom) / (top - bottom)


def _draw_pair(ax: Axes, y: float, pair: Sequence[float], look: str, high: float, *, converged: bool) -> None:
    rms, largest = pair
    shade = COLOURS["tension"] if converged else INK_3
    marker, face = {"predicted": ("^", shade), "beyond": (">", PANEL), "fitted": ("s", shade)}[look]
    dash: Any = (0, (2.5, 1.6)) if look == "beyond" else "-"
    ends = [min(v, high) if not math.isnan(v) else high for v in (rms, largest)]
    ax.plot(ends, [y, y], color=shade, lw=1.0, ls=dash, zorder=2)
    if math.isfinite(largest) and largest <= high:
        ax.plot([largest], [y], "|", color=shade, ms=7, mew=1.6, zorder=3)
    else:
        ax.plot([high], [y], ">", color=INK, ms=5, mew=0, zorder=3, clip_on=False)
    if math.isfinite(rms) and rms <= high:
        ax.plot([rms], [y], marker, mfc=face, mec=shade, mew=1.0, ms=5.4, zorder=4)


def _columns(ax: Axes, rows: list[_Row], trained: str, brief: bool, *, below: float) -> None:
    """Write numbers at the right of the ranking, `below` their row [rows]; their heads are the key to the markers."""
    predicted: list[Callable[[_Row], float | None]] = [
        lambda r: r.predicted[0] if r.predicted else None,
        lambda r: r.predicted[1] if r.predicted else None,
        lambda r: r.beyond[0] if r.beyond else None,
        lambda r: r.beyond[1] if r.beyond else None,
    ]
    columns = [("▲ rms", 52.0), ("┃ largest", 104.0), ("▷ rms", 168.0), ("┃ largest", 220.0)]
    heads = [("points left out", 12.0, 104.0), (trained, 128.0, 220.0)]
    if brief:
        columns = [("", 0.0), ("┃ largest", 56.0), ("", 0.0), ("┃ largest", 120.0)]
        heads = [("▲ left out", 8.0, 56.0), (trained.replace("trained", "▷"), 66.0, 120.0)]
    for head, start, end in heads[: 2 if trained else 1]:
        style.rule(ax, start, end, 22.0)
        style.note(ax, head, x=1.0, dx=end, dy=25, ha="right", va="bottom", color=INK_2)
    for (word, dx), value in list(zip(columns, predicted, strict=True))[: 4 if trained else 2]:
        if not word:
            continue
        style.note(ax, word, x=1.0, dx=dx, dy=9, ha="right", va="bottom", color=COLOURS["tension"])
        best = min((v for r in rows if r.converged and (v := value(r)) is not None), default=math.nan)
        for i, row in enumerate(rows):
            share = value(row)
            weight = "bold" if share == best else "normal"
            style.note(
                ax,
                "" if share is None else _percent(share),
                x=1.0,
                y=_share(ax, i + below),
                dx=dx,
                ha="right",
                color=INK,
                fontweight=weight,
            )
    for i, row in enumerate(rows):
        if row.remark == "published":
            words = ("■ rms ", " ┃ ") if brief else ("■ fitted by its authors: rms ", ", ┃ largest ")
            text = f"{words[0]}{_percent(row.fitted[0])}{words[1]}{_percent(row.fitted[1])}"
            style.note(ax, text, x=1.0, y=_share(ax, i + below), dx=8 if brief else 12, color=INK_2)


def _percent(share: float) -> str:
    if not share <= 1.0:
        return COLUMNS["share"].text(share if share == share else math.inf)
    value = 100.0 * share
    return number(value, 2 if value < 9.995 else 1) + "\N{NO-BREAK SPACE}%"
