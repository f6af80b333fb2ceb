"""Reports as immutable trees of blocks, written as one self-contained HTML file, or as PDF by `document_pdf`.

Nothing here looks at a clock: the same document gives the same file.
"""

from __future__ import annotations

import base64
import functools
import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path
from typing import Any

from markupsafe import Markup

from ..citations import known_keys, reference
from ..documents import write_whole
from ..errors import InputError, not_found
from . import document_pdf
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
    Section,
    Span,
    TableCell,
    TableRow,
    Text,
    gauge_svg,
    pieces,
    plain,
    printable,
    texts_of,
    walk,
)
from .figures.colours import style_sheet
from .figures.style import inline_svg

ENDINGS = (".html", ".pdf")


@dataclass(frozen=True)
class Document(DocumentContent):
    """A report.

    Attributes:
        title: title of the report.
        sections: in their order.
        lead: summary under the title.

    Raises:
        ValueError: two anchors are the same, or a link or a citation leads nowhere.
    """

    title: str
    sections: tuple[Section, ...]
    lead: Text = ""
    references: tuple[str, ...] = field(init=False, default=())

    def __post_init__(self) -> None:
        blocks = [b for s in self.sections for b in walk(s.blocks)]
        keys = tuple(k for b in blocks if isinstance(b, References) for k in b.keys)
        anchors = [*self.anchors(), *(b.anchor for b in blocks if isinstance(b, Fold | Figure) and b.anchor)]
        texts = [self.lead, *(t for b in blocks for t in texts_of(b))]
        wanted = {p.to for t in texts for p in pieces(t) if isinstance(p, Hyperlink)}
        cited = {k for t in texts for p in pieces(t) if isinstance(p, Cite) for k in p.keys}
        for text, wrong in (
            ("more than once", {a for a in anchors if anchors.count(a) > 1} | {k for k in keys if keys.count(k) > 1}),
            ("nowhere", (wanted - set(anchors)) | (cited - set(keys))),
        ):
            if wrong:
                raise ValueError(f"{', '.join(sorted(wrong))}: {text} in the document")
        object.__setattr__(self, "references", keys)

    def html(self) -> str:
        """Return the page: styles and figures are included, without scripts and external files."""
        import jinja2

        environment = jinja2.Environment(
            loader=jinja2.PackageLoader("mckibben.report"),
            autoescape=True,
            undefined=jinja2.StrictUndefined,
            trim_blocks=True,
            lstrip_blocks=True,
        )
        writer = _Writer(self)
        rules = (resources.files(__package__) / "templates" / "document.css").read_text(encoding="utf-8")
        anchors = self.anchors()
        return environment.get_template("document.html.j2").render(
            title=printable(self.title),
            lead=writer.text(self.lead),
            style=Markup(style_sheet("screen") + rules),
            contents=[(a, printable(s.title)) for a, s in zip(anchors, self.sections, strict=True)],
            sections=[
                (anchor, printable(s.title), writer.blocks(s.blocks))
                for anchor, s in zip(anchors, self.sections, strict=True)
            ],
        )

    def pdf(self) -> bytes:
        """Return the PDF file, tagged for screen readers.

        Raises:
            InputError: typst, which sets it, is not installed.
        """
        return document_pdf.pdf(self)

    def write(self, path: str | Path) -> Path:
        """Write to an ``.html`` or ``.pdf`` file, by its suffix.

        Raises:
            InputError: the ending is another, the folder is not there, or what sets a PDF file is not installed.
        """
        place = checked_place(path)
        data = self.pdf() if place.suffix == ".pdf" else self.html().encode("utf-8")
        return write_whole(place, lambda part: part.write_bytes(data), field="report")


def checked_place(path: str | Path, *, field: str = "report") -> Path:
    """Check that a report can be written to a path, before the work is done.

    Raises:
        InputError: as `Document.write`; `field` is what it calls the place.
    """
    place = Path(path)
    if place.suffix not in ENDINGS:
        raise InputError(field, str(place), f"must be a name that ends in {' or '.join(ENDINGS)}")
    if not place.absolute().parent.is_dir():
        raise not_found(place.absolute().parent, "folder")
    if place.is_dir():
        raise InputError(field, str(place), "must be the name of a file; it is a folder")
    if place.suffix == ".pdf":
        document_pdf.compiler()
    return place


# ---- HTML


_TAGS = {
    "strong": ("b", ""),
    "code": ("code", ""),
    "struck": ("s", ""),
    "quiet": ("span", "quiet"),
    "symbol": ("i", "s"),
    "sub": ("sub", ""),
    "caution": ("span", "caution-ink"),
    "stop": ("span", "stop-ink"),
}
_MARKS = {"caution": "▲", "stop": "■"}  # before a cell of that look: colour is never alone


class _Writer:
    """Writes the blocks of one document; figures are counted, so that their ids differ."""

    def __init__(self, document: Document) -> None:
        self.numbers = {key: i for i, key in enumerate(document.references, 1)}
        self.figures = itertools.count(1)

    def text(self, text: Text) -> Markup:
        return Markup("").join(self._piece(piece) for piece in pieces(text))

    def _piece(self, piece: str | Span | Cite | Hyperlink) -> Markup:
        if isinstance(piece, str):
            return Markup("{}").format(printable(piece))
        if isinstance(piece, Hyperlink):
            return Markup('<a href="#{}">{}</a>').format(piece.to, printable(piece.text))
        if isinstance(piece, Cite):
            links = (Markup('<a href="#ref{0}">{0}</a>').format(n) for n in sorted(self.numbers[k] for k in piece.keys))
            return Markup('<span class="cite">[{}]</span>').format(Markup(", ").join(links)) if piece.keys else Markup()
        tag, kind = _TAGS[piece.look]
        named = Markup(' class="{}"').format(kind) if kind else Markup()
        return Markup("<{0}{1}>{2}</{0}>").format(Markup(tag), named, printable(piece.text))

    def blocks(self, blocks: Sequence[Block]) -> Markup:
        """Write blocks in order; neighbouring figures share a row if they fit."""
        out = []
        for pictures, some in itertools.groupby(blocks, lambda b: isinstance(b, Figure)):
            written = Markup("\n").join(self._block(b) for b in some)
            out.append(Markup('<div class="figures">\n{}\n</div>').format(written) if pictures else written)
        return Markup("\n").join(out)

    @functools.singledispatchmethod
    def _block(self, block: Any) -> Markup:
        raise TypeError(f"no block of a document: {block!r}")

    @_block.register
    def _(self, block: Heading) -> Markup:
        return Markup("<h3>{}</h3>").format(printable(block.text))

    @_block.register
    def _(self, block: Paragraph) -> Markup:
        kind = Markup(' class="{}"').format(block.look) if block.look else Markup()
        return Markup("<p{}>{}</p>").format(kind, self.text(block.text))

    @_block.register
    def _(self, block: KeyValues) -> Markup:
        rows = (Markup("<dt>{}</dt><dd>{}</dd>").format(printable(k), self.text(v)) for k, v in block.pairs)
        return Markup('<dl class="facts">\n{}\n</dl>').format(Markup("\n").join(rows))

    @_block.register
    def _(self, block: NoteBox) -> Markup:
        one = len(block.items) == 1
        items = (Markup("<p>{}</p>" if one else "<li>{}</li>").format(self.text(i)) for i in block.items)
        body = Markup("").join(items)
        head = Markup("<strong>{}</strong>").format(printable(block.title))
        body = body if one else Markup("<ul>{}</ul>").format(body)
        return Markup('<div class="note {}" role="note">{}{}</div>').format(block.tone or "plain", head, body)

    @_block.register
    def _(self, block: Listing) -> Markup:
        return Markup('<pre tabindex="0">{}</pre>').format(printable(block.text))

    @_block.register
    def _(self, block: Fold) -> Markup:
        named = Markup(' id="{}"').format(block.anchor) if block.anchor else Markup()
        named += Markup(" open") if block.opened else Markup()
        return Markup("<details{}><summary>{}</summary>\n{}\n</details>").format(
            named, self.text(block.title), self.blocks(block.blocks)
        )

    @_block.register
    def _(self, block: References) -> Markup:
        known = known_keys()
        items = (
            Markup('<li id="ref{}">{}</li>').format(self.numbers[k], printable(reference(k) if k in known else k))
            for k in block.keys
        )
        return Markup('<ol class="papers">\n{}\n</ol>').format(Markup("\n").join(items))

    @_block.register
    def _(self, block: Figure) -> Markup:
        kind = Markup(' id="{}"').format(block.anchor) if block.anchor else Markup()
        kind += Markup(' class="wide"') if block.wide else Markup()
        caption = Markup("\n<figcaption>{}</figcaption>").format(self.text(block.caption)) if block.caption else ""
        return Markup("<figure{}>\n{}{}\n</figure>").format(kind, self._picture(block), caption)

    def _picture(self, figure: Figure) -> Markup:
        name, alt = f"f{next(self.figures)}", printable(figure.alt)
        if not isinstance(figure.picture, bytes):
            return Markup(inline_svg(figure.picture, name, alt))
        kind = "png" if figure.picture.startswith(b"\x89PNG") else "svg+xml"
        # As an image, a file from elsewhere can neither run a script nor reach the page.
        data = base64.b64encode(figure.picture).decode("ascii")
        return Markup('<img alt="{}" src="data:image/{};base64,{}">').format(alt, kind, data)

    # ---- tables

    @_block.register
    def _(self, block: ReportTable) -> Markup:
        label = printable(block.caption) or ", ".join(plain(c.title) for c in block.columns if plain(c.title))
        caption = Markup("<caption>{}</caption>\n").format(printable(block.caption)) if block.caption else Markup()
        head = Markup("\n").join(self._head(block))
        body = Markup("\n").join(self._row(row, block) for row in block.rows)
        return Markup(
            '<div class="scroll" role="region" tabindex="0" aria-label="{}"><table{}>\n'
            "{}<thead>\n{}\n</thead>\n<tbody>\n{}\n</tbody></table></div>"
        ).format(label, Markup(' class="numbers"') if _folds(block) else Markup(), caption, head, body)

    def _head(self, table: ReportTable) -> Iterator[Markup]:
        if any(c.group for c in table.columns):
            cells = []
            for group, some in itertools.groupby(table.columns, lambda c: c.group):
                scope = Markup(' scope="colgroup" class="g"') if group else Markup()
                cells.append(Markup('<th colspan="{}"{}>{}</th>').format(len(list(some)), scope, printable(group)))
            yield Markup('<tr class="over">{}</tr>').format(Markup("").join(cells))
        cells = []
        for column, kind in zip(table.columns, _kinds(table), strict=True):
            unit = Markup("<span>{}</span>").format(printable(column.unit)) if column.unit else Markup()
            cells.append(Markup('<th scope="col"{}>{}{}</th>').format(kind, self.text(column.title), unit))
        yield Markup("<tr>{}</tr>").format(Markup("").join(cells))

    def _row(self, row: TableRow, table: ReportTable) -> Markup:
        kinds = [*_kinds(table)]
        cells = [self._cell(c, kinds[i], heads=i == table.head) for i, c in enumerate(row.cells)]
        looks = " ".join(w for w in (row.look, "noted" if row.note else "") if w)
        kind = Markup(' class="{}"').format(looks) if looks else Markup()
        written = Markup("<tr{}>{}</tr>").format(kind, Markup("").join(cells))
        if row.note:
            before = Markup('<td colspan="{}"></td>').format(table.head) if table.head else Markup()
            across = len(table.columns) - table.head
            cell = Markup('<td colspan="{}">{}</td>').format(across, self.text(row.note))
            written += Markup('\n<tr class="below">{}{}</tr>').format(before, cell)
        return written

    def _cell(self, cell: Text | TableCell | Gauge, kind: Markup, *, heads: bool) -> Markup:
        if isinstance(cell, Gauge):
            return Markup('<td class="gauge">{}</td>').format(Markup(gauge_svg(cell, recoloured=True)))
        full = cell if isinstance(cell, TableCell) else TableCell(cell)
        text = self.text(full.text)
        if full.look == "best":
            text = Markup("<b>{}</b>").format(text)
        elif full.look:
            text = Markup('<span class="{}-ink"><span aria-hidden="true">{}</span> {}</span>').format(
                full.look, _MARKS[full.look], text
            )
        hint = Markup(' title="{}"').format(printable(full.hint)) if full.hint else Markup()
        return Markup("<{0}{1}{2}>{3}</{4}>").format(
            Markup('th scope="row"' if heads else "td"), kind, hint, text, Markup("th" if heads else "td")
        )


def _folds(table: ReportTable) -> bool:
    """Whether each row is a name and up to three numbers, which stand below it on a narrow screen."""
    name, *others = table.columns
    plain_rows = not any(c.group for c in table.columns) and not any(row.note for row in table.rows)
    return plain_rows and table.head == 0 and not name.number and len(others) <= 3 and all(c.number for c in others)


def _kinds(table: ReportTable) -> Iterator[Markup]:
    before = ""
    for column in table.columns:
        words = ["n"] * column.number + ["w"] * column.wide + ["g"] * (column.group not in ("", before))
        before = column.group
        yield Markup(' class="{}"').format(" ".join(words)) if words else Markup()
