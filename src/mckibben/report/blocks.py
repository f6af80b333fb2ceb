"""The blocks of a report: headings, paragraphs, tables, gauges, figures, notes and references, as immutable values.

A text is a string, a piece of `Span`, `Cite` or `Hyperlink`, or a tuple of these. Strings are never read as markup: every
sign in them stands for itself in both files. Numbers, units and flat tables of a report are formatted here too.
"""

from __future__ import annotations

import html
import math
import platform
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal, Union

from .._version import __version__
from ..documents import JsonValue
from ..quantities import from_si, shown_unit
from .figures.colours import LIGHT

if TYPE_CHECKING:
    from matplotlib.figure import Figure as Drawing


TIED = "\N{THIN SPACE}\N{WORD JOINER}"  # between a number and its unit: it never breaks
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_UNITS = {"1": "", "-": "", "deg": "°", "percent": "%", "ohm": "Ω", "kg/s": "g/s", "kg": "g"}
_SCALED = {"kg/s": "g/s", "kg": "g"}


def person_unit(si_unit: str) -> str:
    """Usual unit for display of a quantity."""
    return _SCALED.get(si_unit, shown_unit(si_unit))


def unit_text(unit: str) -> str:
    """Format a unit: ``m^3/(s*Pa)`` becomes m³/(s·Pa); empty for a pure number."""
    text = _UNITS.get(unit, unit) if unit not in _SCALED else unit
    text = text.replace("^0.5", "⁰·⁵")
    text = re.sub(r"\^(-?\d+)", lambda m: m[1].translate(_RAISED), text)
    text = re.sub(r"\b(L|[cm]?m)([23])\b", lambda m: m[1] + m[2].translate(_RAISED), text)
    return text.replace("L0", "L₀").replace("*", "·").replace(" ", "\N{NO-BREAK SPACE}")


def significant(value: float, digits: int = 4) -> str:
    """Format a number with significant digits, grouped; with powers of ten if it is very large or small."""
    if not math.isfinite(value):
        return "\N{EN DASH}" if math.isnan(value) else "∞" if value > 0 else "\N{MINUS SIGN}∞"
    size = abs(float(f"{value:.{digits}g}"))
    if size and not 1e-4 <= size < 1e7:
        mantissa, power = f"{value:.{digits - 1}e}".split("e")
        mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        return minus(mantissa) + power_text(int(power))
    places = max(digits - 1 - math.floor(math.log10(size)), 0) if size else 0
    text = f"{value:,.{places}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return minus("0" if text == "-0" else text).replace(",", "\N{THIN SPACE}")


def power_text(power: int) -> str:
    """Format a power of ten: ``× 10`` and the exponent."""
    return f"\N{THIN SPACE}×\N{THIN SPACE}10{str(power).translate(_RAISED)}"


def minus(text: str) -> str:
    """Replace a hyphen before a digit by a typographic minus."""
    return re.sub(r"(?<![\w.\]])-(?=[\d.])", "\N{MINUS SIGN}", text)


def amount(value: float, si_unit: str, digits: int = 4) -> str:
    """Format an SI value with its usual unit."""
    unit = person_unit(si_unit)
    return tied(significant(from_si(value, si_unit, unit), digits), unit)


def tied(text: str, unit: str) -> str:
    """Join a number and its unit by a non-breaking space."""
    words = unit_text(unit)
    return f"{text}{TIED if words != '°' else ''}{words}" if words else text


def listed(words: Iterable[str]) -> str:
    """Join words by commas, with ``and`` before the last."""
    items = list(words)
    return items[0] if len(items) == 1 else ", ".join(items[:-1]) + f" and {items[-1]}" if items else ""


def mapping(value: object) -> Mapping[str, JsonValue]:
    """Return the value if it is a table, else an empty one, since recordings may contain anything."""
    return value if isinstance(value, Mapping) else {}


def is_number(value: object) -> bool:
    """Whether the value is a number, and not a truth value."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def flat(value: object, name: str = "") -> Iterator[tuple[str, str]]:
    """Iterate over the leaves of nested tables and lists: dotted name and text; a list of plain values is one leaf."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from flat(inner, f"{name}.{key}" if name else str(key))
    elif isinstance(value, list | tuple) and any(isinstance(v, Mapping | list | tuple) for v in value):
        for i, inner in enumerate(value, 1):
            yield from flat(inner, f"{name}.{i}" if name else str(i))
    elif isinstance(value, list | tuple):
        yield name, ", ".join(_leaf(v) for v in value)
    else:
        yield name, _leaf(value)


def _leaf(value: Any) -> str:
    if value is None:
        return "\N{EN DASH}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return significant(float(value), 6) if is_number(value) else str(value)


def versions() -> list[tuple[str, str]]:
    """Names and versions of the package, of its libraries, and of Python."""
    from importlib.metadata import version

    return [
        ("mckibben", __version__),
        *((n, version(n)) for n in ("jax", "numpy", "scipy")),
        ("Python", platform.python_version()),
    ]


def versions_text() -> str:
    """Names and versions of the package, of its libraries, and of Python, as a line."""
    return ", ".join(f"{name} {version}" for name, version in versions())


Look = Literal["strong", "code", "quiet", "symbol", "sub", "struck", "caution", "stop"]
Tone = Literal["", "caution", "stop"]
Text = Union[str, "Span", "Cite", "Hyperlink", tuple[Any, ...]]


@dataclass(frozen=True)
class Span:
    """A piece of text with a style."""

    text: str
    look: Look


@dataclass(frozen=True)
class Cite:
    """Numbers of references, in brackets; the document's `References` must hold the keys."""

    keys: tuple[str, ...]


@dataclass(frozen=True)
class Hyperlink:
    """A piece of text that links to an anchor of the document."""

    text: str
    to: str


@dataclass(frozen=True)
class Gauge:
    """A number on its own scale, drawn in a cell: a permitted band, a tick of the paper, a dot of ours.

    Places lie between -1 and 1; a dot or a whisker beyond is an arrow at the end. `label` is for those who cannot see.
    """

    label: str
    dot: float
    tick: float | None = None
    band: tuple[float, float] | None = None
    whisker: tuple[float, float] | None = None
    ruled: tuple[float, ...] = ()


@dataclass(frozen=True)
class TableCell:
    """A table cell with a style, or an explanation of a dash."""

    text: Text
    look: Literal["", "best", "caution", "stop"] = ""
    hint: str = ""


@dataclass(frozen=True)
class TableColumn:
    """A table column: title and unit, whether it is numeric, whether it takes the remaining width.

    Neighbours of the same `group` share a heading above theirs.
    """

    title: Text = ""
    unit: str = ""
    number: bool = False
    wide: bool = False
    group: str = ""


def headed(*heads: str | TableColumn) -> tuple[TableColumn, ...]:
    """Columns of a table; a string is the title of a column of words."""
    return tuple(TableColumn(head) if isinstance(head, str) else head for head in heads)


def numeric(*heads: str | tuple[str, str]) -> tuple[TableColumn, ...]:
    """Columns of numbers, each by its title, or by title and unit."""
    return tuple(TableColumn(*((head, "") if isinstance(head, str) else head), number=True) for head in heads)


@dataclass(frozen=True)
class TableRow:
    """A table row; a note stands below its cells, beginning at the one that names the row."""

    cells: tuple[Text | TableCell | Gauge, ...]
    note: Text = ""
    look: Literal["", "first", "quiet"] = ""


# ---- blocks


@dataclass(frozen=True)
class Heading:
    """A heading inside a section."""

    text: str


@dataclass(frozen=True)
class Paragraph:
    """A paragraph; the lead of a section is larger, a quiet one smaller."""

    text: Text
    look: Literal["", "lead", "quiet"] = ""


@dataclass(frozen=True)
class KeyValues:
    """A list of names and values."""

    pairs: tuple[tuple[str, Text], ...]


@dataclass(frozen=True)
class ReportTable:
    """Rows of cells under columns; `head` is the column that names the row."""

    columns: tuple[TableColumn, ...]
    rows: tuple[TableRow, ...]
    caption: str = ""
    head: int = 0

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row.cells) != len(self.columns):
                raise ValueError(f"a row has {len(row.cells)} cells, the table {len(self.columns)} columns")


@dataclass(frozen=True)
class Figure:
    """A picture with its caption: a matplotlib figure, or the bytes of an SVG or PNG file.

    `alt` says to those who cannot see it what it shows. Figures that are not `wide` may stand side by side.
    """

    picture: Drawing | bytes
    caption: Text
    alt: str
    wide: bool = True
    anchor: str = ""

    def __post_init__(self) -> None:
        if not self.alt.strip():
            raise ValueError("a figure needs words for those who cannot see it")


@dataclass(frozen=True)
class NoteBox:
    """A highlighted box: a heading, then one or several sentences."""

    title: str
    items: tuple[Text, ...]
    tone: Tone = "caution"


@dataclass(frozen=True)
class Listing:
    """Preformatted text, such as BibTeX."""

    text: str


@dataclass(frozen=True)
class Fold:
    """A collapsible group of blocks; open in print and in PDF files."""

    title: Text
    blocks: tuple[Block, ...]
    anchor: str = ""
    opened: bool = False


@dataclass(frozen=True)
class References:
    """References of a report, numbered, by their keys; an unknown key stands for itself."""

    keys: tuple[str, ...]


Block = Heading | Paragraph | KeyValues | ReportTable | Figure | NoteBox | Listing | Fold | References


@dataclass(frozen=True)
class Section:
    """A section of a document, with an anchor for links."""

    title: str
    blocks: tuple[Block, ...]
    anchor: str = ""


class DocumentContent:
    """What a document holds, as its writers take it; see `Document`."""

    title: str
    sections: tuple[Section, ...]
    lead: Text
    references: tuple[str, ...]

    def anchors(self) -> list[str]:
        """Anchors of the sections, in order."""
        return [s.anchor or f"section{i}" for i, s in enumerate(self.sections, 1)]


def pieces(text: Text) -> Iterator[str | Span | Cite | Hyperlink]:
    """Pieces of a text in their order."""
    if isinstance(text, tuple):
        for part in text:
            yield from pieces(part)
    elif text != "":
        yield text


def plain(text: Text) -> str:
    """Text without styles and citations."""
    return "".join(p if isinstance(p, str) else "" if isinstance(p, Cite) else p.text for p in pieces(text))


def printable(text: str) -> str:
    """Text in which invalid characters, such as control characters, are replaced."""
    return "".join(c if c in "\n\t" or not _unfit(ord(c)) else "\N{REPLACEMENT CHARACTER}" for c in text)


def _unfit(code: int) -> bool:
    return code < 0x20 or 0x7F <= code < 0xA0 or 0xD800 <= code < 0xE000 or code & 0xFFFE == 0xFFFE


def walk(blocks: tuple[Block, ...]) -> Iterator[Block]:
    """Iterate over all blocks in order, those inside folds after their fold."""
    for block in blocks:
        yield block
        if isinstance(block, Fold):
            yield from walk(block.blocks)


def texts_of(block: Block) -> Iterator[Text]:
    """Iterate over all texts of a block that may contain links and citations."""
    if isinstance(block, Paragraph):
        yield block.text
    elif isinstance(block, KeyValues):
        yield from (value for _, value in block.pairs)
    elif isinstance(block, Figure):
        yield block.caption
    elif isinstance(block, NoteBox):
        yield from block.items
    elif isinstance(block, Fold):
        yield block.title
    elif isinstance(block, ReportTable):
        yield from (c.title for c in block.columns)
        for row in block.rows:
            yield row.note
            for cell in row.cells:
                if not isinstance(cell, Gauge):
                    yield cell.text if isinstance(cell, TableCell) else cell


# ---- gauges


WIDTH, HEIGHT, HALF = 120, 14, 48  # of the picture, and of its scale from 0 to 1 [px]


def gauge_svg(gauge: Gauge, *, recoloured: bool = False) -> str:
    """Draw a gauge as an SVG element.

    Args:
        gauge: the gauge.
        recoloured: in the colours of the page around it, light or dark.
    """
    # ink for our value, grey for the permitted range
    colour = {name: f"var(--{name})" if recoloured else LIGHT[name] for name in ("ink", "edge", "rule")}
    parts = []
    if gauge.band is not None:
        low, high = (_x(max(-1.0, min(1.0, end))) for end in gauge.band)
        parts.append(f'<rect x="{low:.1f}" y="4" width="{high - low:.1f}" height="6" fill="{colour["rule"]}"/>')
    ruled = "".join(f"M{_x(at):.1f} 1V13" for at in gauge.ruled)
    if ruled:
        parts.append(f'<path d="{ruled}" stroke="{colour["rule"]}" fill="none"/>')
    if gauge.tick is not None:
        parts.append(f'<path d="M{_x(gauge.tick):.1f} 1V13" stroke="{colour["edge"]}" stroke-width="1.5" fill="none"/>')
    if gauge.whisker is not None:
        ends = "".join(_end(at, side) for at, side in zip(gauge.whisker, (-1, 1), strict=True))
        low, high = (_x(max(-1.0, min(1.0, at))) for at in gauge.whisker)
        line = f"M{low:.1f} 7H{high:.1f}{ends}"
        parts.append(f'<path d="{line}" stroke="{colour["ink"]}" stroke-width="1.3" fill="none"/>')
    parts.append(_dot(gauge.dot, colour["ink"]))
    label = html.escape(printable(gauge.label), quote=True)
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" viewBox="0 0 {WIDTH} {HEIGHT}" '
        f'role="img" aria-label="{label}">{"".join(parts)}</svg>'
    )


def _x(place: float) -> float:
    return WIDTH / 2.0 + HALF * place


def _end(at: float, side: int) -> str:
    if abs(at) <= 1.0:
        return f"M{_x(at):.1f} 3V11"
    tip = _x(side * 1.14)
    return f"M{tip - 5.0 * side:.1f} 3L{tip:.1f} 7L{tip - 5.0 * side:.1f} 11"


def _dot(at: float, ink: str) -> str:
    if abs(at) <= 1.0:
        return f'<circle cx="{_x(at):.1f}" cy="7" r="3" fill="{ink}"/>'
    side = 1 if at > 0.0 else -1
    tip = _x(side * 1.18)
    back = tip - 7.0 * side
    return f'<path d="M{tip:.1f} 7L{back:.1f} 3V11Z" fill="{ink}"/>'
