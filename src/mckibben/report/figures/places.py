"""What a figure carries along: where its texts and keys stand relative to their axes, in points, and what its data are.

A heading is written at a distance above its axes, a list of numbers at a distance right of them. Both keep that distance
when the axes move, but may not fit a narrow figure; `layout` reads the place of each text and finds another one. A file of a
figure says what was drawn, and the version that drew it.
"""

from __future__ import annotations

import html
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from ..._version import __version__

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.lines import Line2D
    from matplotlib.text import Annotation, Text
    from matplotlib.transforms import ScaledTranslation

    from ...recordings import Recording


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


_SOURCE = "_mckibben_source"


class Provenance(NamedTuple):
    """Title of a figure, the source of its data, and the program."""

    title: str
    source: str
    program: str


def describe(fig: Figure, source: str) -> None:
    """Record the source of what a figure shows."""
    setattr(fig, _SOURCE, source)


def provenance_of(fig: Figure) -> Provenance:
    """What a figure says about itself; its title is its first heading."""
    texts = [t for ax in fig.axes for t in ax.texts if (p := place_of(t)) is not None and p.kind == "heading"]
    title = " ".join(texts[0].get_text().split()) if texts else ""
    return Provenance(title, str(getattr(fig, _SOURCE, "")), f"mckibben {__version__}")


def recording_source(recording: Recording) -> str:
    """Run, muscle, rig and seed of a recording, in one line."""
    meta = recording.meta
    named = {"protocol": "protocol", "specimen": "muscle", "rig": "rig", "circuit": "circuit", "seed": "seed"}
    parts = [f"{word} {_named(meta[key])}" for key, word in named.items() if meta.get(key) not in (None, "")]
    if meta.get("created"):
        parts.append(f"recorded {meta['created']}")
    return ", ".join(parts)


def _named(value: Any) -> str:
    if isinstance(value, Mapping):
        return str(next((value[key] for key in ("name", "id", "title") if value.get(key)), "of its own"))
    return str(value)


def file_entries(origin: Provenance, suffix: str) -> dict[str, str | None]:
    """Metadata of a PDF or PNG file, without a date."""
    if suffix == ".pdf":
        file_entries: dict[str, str | None] = {"Creator": origin.program, "Producer": None, "CreationDate": None}
        return file_entries | {k: v for k, v in (("Title", origin.title), ("Subject", origin.source)) if v}
    software: dict[str, str | None] = {"Software": origin.program}
    return software | {k: v for k, v in (("Title", origin.title), ("Description", origin.source)) if v}


def in_svg(text: str, origin: Provenance) -> str:
    """An SVG document with its metadata as Dublin Core."""
    words = {"title": origin.title, "description": origin.source, "creator": origin.program}
    terms = "".join(f"<dc:{name}>{html.escape(word)}</dc:{name}>" for name, word in words.items() if word)
    block = (
        '<metadata><rdf:RDF xmlns:dc="http://purl.org/dc/elements/1.1/" xmlns:rdf="http://www.w3.org/1999/02/22-rdf-syntax-ns#">'
        f'<rdf:Description rdf:about="">{terms}</rdf:Description></rdf:RDF></metadata>'
    )
    return re.sub(r"(<svg\b[^>]*>)", lambda m: f"{m[1]}\n {block}", text, count=1)
