"""PDF output of documents, by typst: tagged, with descriptions of figures, and without a date.

Every word goes to typst as a string, which it does not read as markup.
"""

from __future__ import annotations

import base64
import functools
import itertools
from collections.abc import Iterator, Sequence
from importlib import resources
from pathlib import Path
from types import ModuleType
from typing import Any

from ..citations import known_keys, reference
from ..extras import library
from .blocks import (
    Block,
    Cite,
    DocumentContent,
    Figure,
    Fold,
    Gauge,
    Heading,
    Hyperlink,
    KeyValues,
    Listing,
    NoteBox,
    Paragraph,
    References,
    ReportTable,
    Span,
    TableCell,
    TableRow,
    Text,
    gauge_svg,
    pieces,
    plain,
    printable,
)
from .figures.style import PANEL, to_svg

SMALLEST, LARGEST = 6.2, 8.2  # type of tables [pt]
FULL = 7  # columns that stand in the largest type
PAPER = "#ffffff"  # of the printed page, which takes the place of the panel behind a figure
WIDEST = 11.5  # figure across an upright page [inch]; there type of 8 pt still has 4.8 pt
FOOT = 90  # signs of the title at the foot of a page


def pdf(document: DocumentContent) -> bytes:
    """Return the document as a PDF file.

    Raises:
        MissingLibraryError: typst is not installed.
    """
    from matplotlib import get_data_path

    typst = compiler()
    fonts = Path(get_data_path()) / "fonts" / "ttf"  # has that of the figures
    return bytes(typst.compile(sources(document), format="pdf", font_paths=[str(fonts)], pdf_standards="ua-1"))


def compiler(instead: str = "HTML reports do without it") -> ModuleType:
    """Load the library for PDF files; `instead` states what works without it.

    Raises:
        MissingLibraryError: it is not installed.
    """
    return library("typst", "PDF reports need", instead=instead)


def sources(document: DocumentContent) -> dict[str, bytes]:
    """Input files of typst: the text under ``main``, and the figures by their names."""
    return _Writer(document).files


def quoted(text: str) -> str:
    """Quote a text as a string of typst."""
    escaped = printable(text).replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\t", "\\t")
    return f'"{escaped}"'


def _wrapped(png: bytes) -> bytes:
    """Wrap a PNG picture in an SVG file, since typst takes further inputs as text only."""
    wide, high = (int.from_bytes(png[at : at + 4], "big") for at in (16, 20))
    data = base64.b64encode(png).decode("ascii")
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" width="{wide}" height="{high}" viewBox="0 0 {wide} {high}">'
        f'<image width="{wide}" height="{high}" href="data:image/png;base64,{data}"/></svg>'
    ).encode()


def _label(anchor: str) -> str:
    return f" #label({quoted(anchor)})" if anchor else ""


def _very_wide(block: Block) -> bool:
    """Whether a figure's type would be too small across an upright page."""
    if not isinstance(block, Figure) or isinstance(block.picture, bytes):
        return False
    return bool(block.picture.get_figwidth() > WIDEST)


class _Writer:
    """Writes one document; `files` holds the text and the figures."""

    def __init__(self, document: DocumentContent) -> None:
        self.numbers = {key: i for i, key in enumerate(document.references, 1)}
        self.count = itertools.count(1)
        self.level = 3
        self.files: dict[str, bytes] = {}
        style = (resources.files(__package__) / "templates" / "document.typ").read_text(encoding="utf-8")
        self.files["main"] = "\n".join([*self._opening(document, style), *self._body(document)]).encode()

    def _opening(self, document: DocumentContent, style: str) -> Iterator[str]:
        title = " ".join(document.title.split())
        short = title if len(title) <= FOOT else title[: FOOT - 1] + "\N{HORIZONTAL ELLIPSIS}"
        yield f"#set document(title: {quoted(title)}, date: none)"
        yield f"#let short-title = {quoted(short)}"
        yield style
        yield f"#heading(level: 1, outlined: false, {quoted(document.title)})"

    def _body(self, document: DocumentContent) -> Iterator[str]:
        if document.lead:
            yield f"#lead({self.text(document.lead)})"
        if len(document.sections) > 3:
            yield "#contents"
        for anchor, section in zip(document.anchors(), document.sections, strict=True):
            yield f"#heading(level: 2, {quoted(section.title)}) #label({quoted(anchor)})"
            yield from self.blocks(section.blocks)

    # ---- words

    def text(self, text: Text) -> str:
        return "[" + "".join(f"#{self._piece(p)};" for p in pieces(text)) + "]"

    def _piece(self, piece: str | Span | Cite | Hyperlink) -> str:
        if isinstance(piece, str):
            return quoted(" ".join(piece.split("\n")))
        if isinstance(piece, Hyperlink):
            return f"link(label({quoted(piece.to)}), {quoted(piece.text)})"
        if isinstance(piece, Cite):
            numbers = sorted(self.numbers[k] for k in piece.keys)
            links = '#", ";'.join(f'#link(label("ref{n}"), "{n}");' for n in numbers)
            return f'text(size: 0.86em, fill: ink-3)[#"[";{links}#"]";]' if numbers else '""'
        text = piece.text
        if piece.look == "code":  # a long dotted name may break after its dots
            text = "".join(c + "\N{ZERO WIDTH SPACE}" if c in "._/" else c for c in text)
        return f"{piece.look}-look({quoted(text)})"

    # ---- blocks

    def blocks(self, blocks: Sequence[Block]) -> Iterator[str]:
        """Write blocks in order; neighbouring very wide figures go on landscape pages."""
        for lying, some in itertools.groupby(blocks, _very_wide):
            yield from ["#page(flipped: true)["] * lying
            for block in some:
                yield from self._block(block)
            yield from ["]"] * lying

    @functools.singledispatchmethod
    def _block(self, block: Any) -> Iterator[str]:
        raise TypeError(f"no block of a document: {block!r}")

    @_block.register
    def _(self, block: Heading) -> Iterator[str]:
        yield f"#heading(level: {self.level}, {quoted(block.text)})"

    @_block.register
    def _(self, block: Paragraph) -> Iterator[str]:
        yield f"#{block.look or 'par'}({self.text(block.text)})"

    @_block.register
    def _(self, block: KeyValues) -> Iterator[str]:
        yield f"#facts({', '.join(f'fact({quoted(k)}), {self.text(v)}' for k, v in block.pairs)})"

    @_block.register
    def _(self, block: NoteBox) -> Iterator[str]:
        yield f"#note({quoted(block.tone)}, {quoted(block.title)}, {', '.join(self.text(i) for i in block.items)})"

    @_block.register
    def _(self, block: Listing) -> Iterator[str]:
        yield f"#listing({quoted(block.text)})"

    @_block.register
    def _(self, block: Fold) -> Iterator[str]:
        yield f"#heading(level: {self.level}, outlined: false, {self.text(block.title)}){_label(block.anchor)}"
        self.level += 1
        yield from self.blocks(block.blocks)
        self.level -= 1

    @_block.register
    def _(self, block: References) -> Iterator[str]:
        known = known_keys()
        items = (f'[#{quoted(reference(k) if k in known else k)};#label("ref{self.numbers[k]}")]' for k in block.keys)
        yield f"#papers({', '.join(items)})"

    @_block.register
    def _(self, block: Figure) -> Iterator[str]:
        picture = block.picture
        if not isinstance(picture, bytes):
            picture = to_svg(picture).replace(PANEL, PAPER).encode()
        name = self._kept(_wrapped(picture) if picture.startswith(b"\x89PNG") else picture)
        caption = self.text(block.caption) if block.caption else "none"
        yield f"#drawn({quoted(name)}, {quoted(block.alt)}, {caption}){_label(block.anchor)}"

    def _kept(self, picture: bytes) -> str:
        name = f"p{next(self.count)}.svg"
        self.files[name] = picture
        return name

    # ---- tables

    @_block.register
    def _(self, block: ReportTable) -> Iterator[str]:
        if block.caption:
            yield f"#titled({quoted(block.caption)})"
        widths = ", ".join("1fr" if c.wide else "auto" for c in block.columns)
        align = ", ".join("right + top" if c.number else "left + top" for c in block.columns)
        size = max(SMALLEST, min(LARGEST, LARGEST * (FULL / len(block.columns)) ** 0.5))
        yield "#{"
        yield f"set text(size: {size:.2f}pt)"
        yield f"table(columns: ({widths},), align: ({align},),"
        yield "table.header("
        if any(c.group for c in block.columns):
            for group, some in itertools.groupby(block.columns, lambda c: c.group):
                yield f"table.cell(colspan: {len(list(some))}, align: left, head({quoted(group)}, {quoted('')})),"
        for column in block.columns:
            yield f"head({self.text(column.title)}, {quoted(column.unit)}),"
        yield "), head-line,"
        for row in block.rows:
            for i, cell in enumerate(row.cells):
                written = self._cell(cell, row)
                # what spans both keeps a note on the page of its row
                spans = bool(row.note) and i < block.head
                yield f"table.cell(rowspan: 2, breakable: false, {written})," if spans else f"{written},"
            if row.note:
                yield f"below({len(block.columns) - block.head}, {self.text(row.note)}),"
            yield "grid-line,"
        yield ")"
        yield "}"
        hints = dict.fromkeys(
            (plain(c.text), c.hint) for r in block.rows for c in r.cells if isinstance(c, TableCell) and c.hint
        )
        if hints:
            legend = "; ".join(f"{text}: {hint}" for text, hint in hints)
            yield f"#quiet({self.text(legend + '.')})"

    def _cell(self, cell: Text | TableCell | Gauge, row: TableRow) -> str:
        if isinstance(cell, Gauge):
            name = self._kept(gauge_svg(cell).encode())
            return f"gauge({quoted(name)}, {quoted(cell.label)})"
        full = cell if isinstance(cell, TableCell) else TableCell(cell)
        text = self.text(full.text)
        if full.look == "best":
            text = f"strong({text})"
        elif full.look:
            text = f"toned({quoted(full.look)}, {text})"
        return f"table.cell(fill: sunken, {text})" if row.look == "first" and not row.note else text
