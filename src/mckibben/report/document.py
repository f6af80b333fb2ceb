"""Reports as immutable trees of blocks, written as one self-contained HTML file or as PDF.

Nothing here looks at a clock: the same document gives the same file.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from ..documents import write_whole
from ..errors import InputError, not_found
from . import document_html, document_pdf
from .blocks import Cite, Figure, Fold, Hyperlink, References, Section, Text, pieces, texts_of, walk

ENDINGS = (".html", ".pdf")


@dataclass(frozen=True)
class Document:
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

    def anchors(self) -> list[str]:
        """Anchors of the sections, in order."""
        return [s.anchor or f"section{i}" for i, s in enumerate(self.sections, 1)]

    def html(self) -> str:
        """Return the page: styles and figures are included, without scripts and external files."""
        return document_html.page(self)

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
