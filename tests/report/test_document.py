"""A document: nothing in a text is markup, the page needs nothing else, both files say the same, and it stays the same."""

import json
import re
import sys
from html.parser import HTMLParser

import pytest

from mckibben.errors import InputError
from mckibben.report import document_pdf
from mckibben.report.blocks import (
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
    Section,
    Span,
    TableCell,
    TableColumn,
    TableRow,
    plain,
    printable,
)
from mckibben.report.document import Document, checked_place
from mckibben.report.figures import style

typst = pytest.importorskip("typst")

# Signs that are markup in HTML, in typst, or in neither but often spoiled on the way.
NASTY = r"""<b>&amp; # $x^2$ @me \ \n "q" 's' _u_ *s* `c` [l] {b} // ~ <lab> #panic() é Ω 日本"""
CONTROL = "a\x00b\x1bc\x85d\ud800e\ufffff"  # no file may hold these
PICTURE = b'<svg xmlns="http://www.w3.org/2000/svg" width="90" height="30"><rect width="90" height="30"/></svg>'
PIXEL = bytes.fromhex(
    "89504e470d0a1a0a0000000d4948445200000001000000010802000000907753de0000000c4944415408d763f8ffff3f0005fe02fedccc59e7"
    "0000000049454e44ae426082"
)


@style.styled()
def drawing():
    fig = style.figure(3.0, 2.0)
    ax = fig.add_axes((0.2, 0.2, 0.7, 0.6))
    ax.plot([0.0, 1.0], [0.0, 1.0], color=style.INK)
    ax.set_title("<b>&amp; \\ # @")
    return fig


def full(text: str = NASTY) -> Document:
    """Every block there is, with a text at every place that takes one."""
    cells = (
        text,
        TableCell(text, "caution", hint=text),
        TableCell(text, "best"),
        Gauge(text, 0.3, tick=0.0, band=(-0.5, 0.5)),
    )
    columns = (
        TableColumn(text, wide=True),
        TableColumn(text, text, number=True, group=text),
        TableColumn("c"),
        TableColumn("gauge"),
    )
    out = Gauge("out", 2.0, whisker=(-0.2, 1.7), ruled=(0.0,))
    rows = (TableRow(cells, note=text), TableRow(("x", "y", TableCell("z", "stop"), out), look="first"))
    return Document(
        text,
        (
            Section(text, (
                Paragraph(
                    (text, Span(text, "strong"), Span(text, "code"), Cite(("chou1996",)), Hyperlink(text, "fold")), "lead"
                ),
                Paragraph(tuple(Span(text, look) for look in ("quiet", "symbol", "sub", "struck", "caution", "stop"))),
                KeyValues(((text, text), ("b", "c"))),
                NoteBox(text, (text, "two")), NoteBox("Stop", (text,), "stop"), NoteBox("Plain", (text,), ""),
                Heading(text), ReportTable(columns, rows, text), Figure(drawing(), text, text), Figure(PICTURE, "", text),
                Figure(PIXEL, text, "a pixel", wide=False, anchor="pixel"),
            )),
            Section("Second", (Fold(text, (Listing(text + "\n  indented"), Heading("inner")), "fold"),)),
            Section("Third", (References(("chou1996", text)),), "third"),
        ),
        lead=text,
    )  # fmt: skip


class Reader(HTMLParser):
    """Words of a page, what it would load, its ids and links; every tag must be closed."""

    void = {"meta", "br", "img", "path", "circle", "rect", "use"}

    def __init__(self, page: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.words: list[str] = []
        self.loads: list[str] = []
        self.ids: list[str] = []
        self.links: list[str] = []
        self.labels: list[str] = []
        self.feed(page)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attrs) -> None:
        if tag not in self.void:
            self.open.append(tag)
        for name, value in attrs:
            assert not name.startswith("on")
            if name in ("src", "srcset", "data", "poster") or (name == "href" and tag != "a"):
                self.loads.append(value)
            if name == "href" and tag == "a":
                self.links.append(value)
            if name == "id":
                self.ids.append(value)
            if name in ("title", "alt", "aria-label"):
                self.labels.append(value)

    def handle_startendtag(self, tag, attrs) -> None:
        self.handle_starttag(tag, attrs)
        if tag not in self.void:
            self.open.pop()

    def handle_endtag(self, tag) -> None:
        if tag not in self.void:
            assert self.open.pop() == tag

    def handle_data(self, data) -> None:
        if not self.open or self.open[-1] != "style":
            self.words.append(data)

    def text(self) -> str:
        return " ".join("".join(self.words).split())


def strings(document: Document) -> list[str]:
    """The strings that typst is given, as typst reads them; what is left of its text must be free of them."""
    source = document_pdf.sources(document)["main"].decode()
    found = re.findall(r'"((?:[^"\\]|\\.)*)"', source, re.S)
    return [re.sub(r"\\(.)", lambda m: {"n": "\n", "t": "\t"}.get(m[1], m[1]), s) for s in found]


def test_a_page_loads_nothing_and_runs_nothing():
    page = full().html()
    found = Reader(page)
    assert all(load.startswith(("#", "data:image/")) for load in found.loads)
    assert "data:image/svg+xml;base64," in page and "data:image/png;base64," in page
    assert "<script" not in page and "<link" not in page and "@import" not in page
    assert not re.search(r"url\((?!#)", page)


def test_ids_differ_and_links_lead_somewhere():
    found = Reader(full().html())
    assert len(found.ids) == len(set(found.ids))
    assert {link.removeprefix("#") for link in found.links} <= set(found.ids)
    assert {"fold", "third", "pixel", "ref1", "ref2"} <= set(found.ids)


def test_no_sign_of_a_text_is_markup_on_the_page():
    page = full().html()
    found = Reader(page)
    assert "<lab>" not in page and "<b>&amp;" not in page
    plain_document = full("word")
    # as often as a plain word would stand there, in text and in what is read aloud
    assert found.text().count("<b>&amp; # $x^2$ @me \\") == Reader(plain_document.html()).text().count("word")
    assert sum(NASTY in label for label in found.labels) == sum(
        "word" in x for x in Reader(plain_document.html()).labels
    )


def test_no_sign_of_a_text_is_markup_for_typst():
    text = NASTY.replace("_", "").replace("// ", "")  # in code a space of no width follows where it may break
    assert sum(text in s for s in strings(full(text))) == sum("word" in s for s in strings(full("word")))
    source = document_pdf.sources(full(text))["main"].decode()
    assert "panic" not in re.sub(r'"(?:[^"\\]|\\.)*"', "", source, flags=re.S)


def test_the_words_of_typst_come_back_from_typst():
    # typst's own reader of its own language: what it evaluates is what was meant
    for text in (NASTY, "ends with a backslash \\", '"', '\\"', "a\nb\tc", "\\u{41}", ""):
        assert json.loads(typst.eval(b"", document_pdf.quoted(text))) == text


def test_a_pdf_is_made_of_every_block_and_is_the_same_twice():
    document = full()
    first = document.pdf()
    assert first.startswith(b"%PDF-") and first == document.pdf()
    assert b"/CreationDate" not in first and b"/ModDate" not in first
    assert b"/StructTreeRoot" in first  # tagged, for those who cannot see it


def test_the_same_document_gives_the_same_page():
    assert full().html() == full().html()


def test_both_files_have_the_same_words():
    document = full("Überschrift")
    pages, told = Reader(document.html()).text(), "\n".join(strings(document))
    for word in ("Überschrift", "indented", "inner", "Third", "Stop", "two", "doi:10.1109/70.481753", "gauge"):
        assert word in pages and word in told


def test_control_signs_and_halves_of_pairs_are_replaced():
    assert printable(CONTROL) == "a\N{REPLACEMENT CHARACTER}b\N{REPLACEMENT CHARACTER}c\N{REPLACEMENT CHARACTER}d" + (
        "\N{REPLACEMENT CHARACTER}e\N{REPLACEMENT CHARACTER}f"
    )
    assert printable("line\n\ttab é 日本 😀") == "line\n\ttab é 日本 😀"
    document = full(CONTROL)
    assert document.html().encode("utf-8") and document.pdf().startswith(b"%PDF-")


def test_a_hint_is_told_on_paper_too():
    table = ReportTable((TableColumn("x"),), (TableRow((TableCell("–", hint="nobody measured it"),)),))
    document = Document("t", (Section("s", (table,)),))
    assert 'title="nobody measured it"' in document.html()
    assert any("–: nobody measured it" in s for s in strings(document))


def test_links_and_citations_that_lead_nowhere_are_refused():
    for text in (Hyperlink("x", "nowhere"), Cite(("chou1996",))):
        with pytest.raises(ValueError, match="nowhere"):
            Document("t", (Section("s", (Paragraph(text),)),))
    with pytest.raises(ValueError, match="same: more than once"):
        Document("t", (Section("a", (), "same"), Section("b", (Fold("c", (), "same"),))))
    with pytest.raises(ValueError, match="1 cells"):
        ReportTable((TableColumn("a"), TableColumn("b")), (TableRow(("x",)),))
    with pytest.raises(ValueError, match="cannot see"):
        Figure(PICTURE, "caption", " ")


def test_plain_leaves_the_words():
    assert plain(("a ", Span("b", "strong"), Cite(("k",)), (" c", Hyperlink(" d", "e")))) == "a b c d"


@pytest.mark.parametrize(
    ("name", "says"),
    [("report.txt", "ends in .html or .pdf"), ("report", "ends in"), ("no/such/report.pdf", "older not found"),
     ("folder.html", "it is a folder")],
)  # fmt: skip
def test_a_bad_place_is_one_clear_line(tmp_path, name, says):
    (tmp_path / "folder.html").mkdir()
    with pytest.raises(InputError, match=says) as complaint:
        full("word").write(tmp_path / name)
    assert "\n" not in str(complaint.value)


def test_without_typst_a_line_names_the_extra_and_pages_still_work(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "typst", None)
    with pytest.raises(InputError, match=r"mckibben\[report\]"):
        checked_place(tmp_path / "report.pdf")
    assert full("word").write(tmp_path / "report.html").read_text(encoding="utf-8").startswith("<!doctype html>")
