"""Where texts and keys stand relative to their axes, in points, so that a figure of another width can move them.

A heading is written at a distance above its axes, a list of numbers at a distance right of them. Both keep that distance
when the axes move, but may not fit a narrow figure; `layout` reads the place of each text and finds another one.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.text import Annotation, Text
    from matplotlib.transforms import ScaledTranslation

_NAME = "_mckibben_place"
_SHEET = "_mckibben_sheet"
_MARGINS = "_mckibben_margins"


class ArtistPlace(NamedTuple):
    """Place of a text, key or line.

    Args:
        axes: to which it belongs.
        kind: ``heading``, ``note``, ``end`` (label at the end of a line), ``rule`` or ``key``.
        x: share of the width of the axes.
        y: share of their height.
        dx: shift to the right [pt].
        dy: shift upwards [pt].
        note: quieter words after a heading.
    """

    axes: Axes
    kind: str
    x: float = 0.0
    y: float = 1.0
    dx: float = 0.0
    dy: float = 0.0
    note: Annotation | None = None


class Sheet(NamedTuple):
    """A figure of this package before it is laid out for a width.

    Args:
        width: that it has on a screen [inch].
        least: width, below which it cannot be read [inch].
        scale: of a drawing, by which it is reduced; 1 for a figure with axes.
        drawing: whether it has a scale of its own and is reduced as a whole.
    """

    width: float
    least: float = 0.0
    scale: float = 1.0
    drawing: bool = False


class BannerRow(NamedTuple):
    """A line of text over all axes of a figure: a sample of a line, words, and quieter words after them."""

    words: Text
    note: Text | None = None
    sample: Line2D | None = None


class FootRow(NamedTuple):
    """An entry of the list under all axes of a figure: a number and words."""

    number: Text
    words: Text


class Margins(NamedTuple):
    """Texts of a figure over and under all its axes."""

    banner: tuple[BannerRow, ...] = ()
    foot: tuple[FootRow, ...] = ()


def shift(ax: Axes, x: float, y: float) -> ScaledTranslation:
    """Transform that moves by points, to add to another."""
    from matplotlib.transforms import ScaledTranslation

    return ScaledTranslation(x / 72.0, y / 72.0, ax.figure.dpi_scale_trans)


def set_place(artist: Artist, place: ArtistPlace) -> None:
    """Record the place of an artist."""
    setattr(artist, _NAME, place)


def place_of(artist: Artist) -> ArtistPlace | None:
    """The place of an artist, None for one without."""
    place: ArtistPlace | None = getattr(artist, _NAME, None)
    return place


def set_sheet(fig: Figure, sheet: Sheet | None) -> None:
    """Record that a figure is one of this package, or with None that it is laid out."""
    setattr(fig, _SHEET, sheet)


def sheet_of(fig: Figure) -> Sheet | None:
    """The layout recorded for a figure by `set_sheet`; None if there is none."""
    sheet: Sheet | None = getattr(fig, _SHEET, None)
    return sheet


def set_margins(fig: Figure, margins: Margins) -> None:
    """Record the texts over and under all axes."""
    setattr(fig, _MARGINS, margins)


def margins_of(fig: Figure) -> Margins:
    """The texts over and under all axes."""
    margins: Margins = getattr(fig, _MARGINS, Margins())
    return margins
