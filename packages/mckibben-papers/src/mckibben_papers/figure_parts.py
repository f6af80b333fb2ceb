"""Common parts of the paper's figures: sizes, headings, style of printed curves, and our numbers beside printed ones.

What is computed here has the colour of its quantity, or ink and a full line where it is derived. What is printed is ink:
open circles for points, long dashes for lines. Keys and numbers stand right of the axes, where they cover no data.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from mckibben.documents import JsonValue
from mckibben.report.figures import style
from mckibben.report.figures.places import ArtistPlace, set_place
from mckibben.report.figures.style import CAUTION, INK, INK_2, INK_3, MIDDLE, PANEL, SMALL, number
from mckibben.specimens import specimen

from .rows import PrintedRow, RowOutcome, Value, computed_row, rows_by_name
from .rows import printed as printed

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D


LEFT, FOOT, TOP = 0.5, 0.5, 0.72  # around axes [inch]
BESIDE = 2.85  # right of the axes, for numbers and keys [inch]
COLUMNS = (0.0, 134.0, 180.0)  # of the numbers: words from here, ours up to here, the paper's up to here [pt]
LEADING = 13.0  # of the numbers [pt]
KEY_MARK: dict[str, Any] = {"ls": "none", "marker": "o", "ms": 6.0, "mfc": PANEL, "mec": INK, "mew": 1.2}
MARK: dict[str, Any] = KEY_MARK | {"zorder": 8}
PRINTED: dict[str, Any] = {"color": INK, "ls": (0, (10, 3)), "lw": 0.9}
SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


# ---- sizes and headings


def panel(height: float, *, wide: float = MIDDLE, beside: float = BESIDE) -> tuple[Figure, Axes]:
    """Create a figure with one pair of axes, and space right of them [inch]."""
    fig, (ax,) = stack([1.0], height, wide=wide, beside=beside)
    return fig, ax


def stack(
    shares: Sequence[float],
    height: float,
    *,
    wide: float = MIDDLE,
    beside: float = BESIDE,
    gap: float = 0.34,
    columns: Sequence[float] = (1.0,),
) -> tuple[Figure, list[Axes]]:
    """Create a figure with axes below each other, row by row if there are several columns.

    Args:
        shares: heights relative to each other, from the top.
        height: height of the figure [inch].
        wide: width of the figure [inch].
        beside: room right of the axes [inch].
        gap: between axes [inch].
        columns: widths relative to each other.
    """
    fig = style.figure(wide, height)
    tall = (height - FOOT - TOP - gap * (len(shares) - 1)) / sum(shares)
    across = (wide - LEFT - beside - gap * (len(columns) - 1)) / sum(columns)
    axes, y = [], height - TOP
    for share in shares:
        y -= share * tall
        x = LEFT
        for column in columns:
            axes.append(fig.add_axes((x / wide, y / height, column * across / wide, share * tall / height)))
            x += column * across + gap
        y -= gap
    return fig, axes


def title(ax: Axes, figure: str, words: str, *, above: float = 26.0) -> None:
    """Write the number of the figure in the paper, and its title, `above` the axes [pt]."""
    style.heading(ax, label(figure), words, above=above)


def label(figure: str) -> str:
    """Displayed form of a figure's key: ``3a``, ``table1``, ``1994-3a``."""
    year, _, name = figure.rpartition("-")
    words = "Table 1" if name == "table1" else f"Fig. {name}"
    return f"{words}, {year}" if year else words


def right_axis(ax: Axes, words: str, quantity: str | None) -> Axes:
    """Add a second vertical axis, its title above it at the right."""
    other = ax.twinx()
    look: dict[str, Any] = {"fontweight": "bold", "fontsize": SMALL + 0.5, "rotation": 0, "ha": "right", "va": "bottom"}
    other.set_ylabel(words, color=style.colour(quantity), **look)
    other.yaxis.set_label_coords(1.0, 1.0, transform=ax.transAxes + style.shift(ax, 18, 5))
    style.tick_numbers(other.yaxis)
    other.grid(visible=False)
    return other


# ---- ours and the paper's


@functools.cache
def outcome(identifier: str) -> RowOutcome:
    """A row with our value, with the numbers of specimen and rig, which are drawn."""
    return computed_row(rows_by_name()[identifier])


class NumberEntry(NamedTuple):
    """A line of the list of numbers: label with unit, our value and the paper's as text, and a remark.

    `mark` is ``*`` where ours is no prediction, ``†`` where the paper's is a misprint, ``§`` where a difference stays open,
    else empty.
    """

    words: str
    ours: str
    paper: str = ""
    mark: str = ""


def entry(words: str, identifier: str, digits: int = 3) -> NumberEntry:
    """Line of a row, with the row's unit after the label."""
    one = outcome(identifier)
    assert one.ours is not None
    unit = unit_words(one.row.unit)
    return NumberEntry(
        f"{words}, {unit}" if unit else words, shown(one.ours, digits), as_printed(one.row.paper), mark(one.row)
    )


def mark(of: PrintedRow) -> str:
    """Sign for the verdict on a row."""
    if of.expect in ("erratum", "open"):
        return {"erratum": "†", "open": "§"}[of.expect]
    return "*" if of.calibrated else ""


def unit_words(unit: str) -> str:
    """Format the unit of a row; empty for a pure number."""
    for plain, typed in (("cm2", "cm²"), ("cm3", "cm³"), ("in3", "in³"), ("s2", "s²"), ("L0", "L₀"), ("deg", "°")):
        unit = unit.replace(plain, typed)
    return "" if unit == "-" else unit.replace("- ", "")


def as_printed(value: Value) -> str:
    """Value with the digits of the print; an interval with a dash."""
    if isinstance(value, tuple):
        return "\N{EN DASH}".join(as_printed(v) for v in value)
    digits = len(f"{value:e}".split("e")[0].replace(".", "").strip("-").rstrip("0"))
    return shown(value, max(digits, 1)) if abs(value) < 1e-3 else number(value)


def shown(value: float, digits: int = 3) -> str:
    """Format a value with significant digits; very small and very large ones with a power of ten."""
    if value == 0.0 or not math.isfinite(value):
        return number(value)
    power = math.floor(math.log10(abs(value)))
    if not -4 < power < 6:
        return f"{number(value / 10.0**power, digits - 1)}·10{str(power).translate(SUPERSCRIPT)}"
    return number(round(value, digits - 1 - power), max(digits - 1 - power, 0))


def numbers(ax: Axes, entries: Sequence[NumberEntry], *, dx: float = 20.0, remarks: Sequence[str] = ()) -> None:
    """List our numbers and the paper's, right of the axes by `dx` [pt], and quieter remarks below."""
    look: dict[str, Any] = {"fontsize": SMALL, "va": "center_baseline"}
    words, ours, paper = (dx + c for c in COLUMNS)
    y = -4.0
    if entries:
        style.note(ax, "ours", x=1.0, dx=ours, dy=y, **look | {"ha": "right", "color": INK, "fontweight": "bold"})
        style.note(ax, "paper", x=1.0, dx=paper, dy=y, **look | {"ha": "right", "color": INK_2})
        y -= LEADING + 1.0
    for one in entries:
        style.note(ax, one.words + one.mark.replace("†", ""), x=1.0, dx=words, dy=y, **look | {"color": INK_2})
        style.note(ax, one.ours, x=1.0, dx=ours, dy=y, **look | {"ha": "right", "color": INK, "fontweight": "bold"})
        colour = CAUTION if one.mark == "†" else INK_2
        style.note(
            ax, one.paper + one.mark.replace("*", ""), x=1.0, dx=paper, dy=y, **look | {"ha": "right", "color": colour}
        )
        y -= LEADING
    feet = {"*": "* an input was inferred from the print", "†": "† misprint", "§": "§ open: the row's note says why"}
    for foot in [*(words for sign, words in feet.items() if any(e.mark == sign for e in entries)), *remarks]:
        style.note(ax, foot, x=1.0, dx=words, dy=y, **look | {"color": INK_3})
        y -= LEADING - 1.0


def key(ax: Axes, handles: Sequence[Artist], *, dx: float = 20.0, below: float | None = None) -> None:
    """Draw a key of the lines, right of the axes: at their foot, or a distance below their top [pt]."""
    y, drop = (0.0, 0.0) if below is None else (1.0, below)
    legend = style.key(
        ax.figure,
        handles=list(handles),
        loc="lower left" if below is None else "upper left",
        bbox_to_anchor=(1.0, y),
        bbox_transform=ax.transAxes + style.shift(ax, dx - 3.0, -drop),
        labelcolor=INK_2,
        labelspacing=0.4,
        borderpad=0.0,
        borderaxespad=0.0,
    )
    set_place(legend, ArtistPlace(ax, "key"))


def sample(words: str, **look: JsonValue) -> Line2D:
    """A line or mark for a key."""
    from matplotlib.lines import Line2D

    return Line2D([], [], label=words, **look)


def rest_length(muscle: str) -> float:
    """L0 [m]."""
    return specimen(muscle).property_si("rest_length", "m")


def printed_key(words: str = "paper", *, line: bool = False) -> Line2D:
    """Entry of printed curves in a key."""
    return sample(words, **(PRINTED if line else KEY_MARK))


def ours(quantity: str | None, **look: JsonValue) -> dict[str, JsonValue]:
    """Style of a computed line of a quantity."""
    return {"color": style.colour(quantity), "lw": style.LINE + 0.2, "zorder": 4} | look
