"""HTML output of documents, and the drawing of gauges."""

from __future__ import annotations

import base64
import functools
import html
import itertools
from collections.abc import Iterator, Sequence
from importlib import resources
from typing import TYPE_CHECKING, Any

from markupsafe import Markup

from ..citations import known_keys, reference
from .blocks import (
    Block,
    Cite,
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
    pieces,
    plain,
    printable,
)
from .figures.colours import LIGHT, style_sheet
from .figures.style import inline_svg

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


if TYPE_CHECKING:
    from .document import Document


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


def page(document: Document) -> str:
    """Return the document as the text of an HTML file."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("mckibben.report"),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    writer = _Writer(document)
    rules = (resources.files(__package__) / "templates" / "document.css").read_text(encoding="utf-8")
    anchors = document.anchors()
    return environment.get_template("document.html.j2").render(
        title=printable(document.title),
        lead=writer.text(document.lead),
        style=Markup(style_sheet("screen") + rules),
        contents=[(a, printable(s.title)) for a, s in zip(anchors, document.sections, strict=True)],
        sections=[
            (anchor, printable(s.title), writer.blocks(s.blocks))
            for anchor, s in zip(anchors, document.sections, strict=True)
        ],
    )


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
