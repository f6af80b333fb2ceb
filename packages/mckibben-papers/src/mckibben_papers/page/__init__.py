"""The page The paper: every printed number and figure, with our values, worded as in the report."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from mckibben.documents import JsonValue
from mckibben.errors import InputError, MckibbenError
from mckibben.report.blocks import minus, significant, unit_text
from mckibben.web.charts import save_menu
from mckibben.web.elements import Element, Timer, page_document
from mckibben.web.transfers import download, run_in_thread
from mckibben.web.widgets import asked, box, button, link, loading, note, page_frame, raw, refused, segments, tell, text
from mckibben.web.workspace import Workspace

from ..figures import FIGURES
from ..report import PARTS, PREDICTIONS, difference, figure_name, printed
from ..rows import (
    BASES,
    KINDS,
    PrintedRow,
    RowOutcome,
    accepted_band,
    all_rows,
    headline,
    is_prediction,
    kind_of,
    needs_recording,
    said_of,
)
from .jobs import Reproduction, reproduction

if TYPE_CHECKING:
    from starlette.requests import Request


def build(workspace: Workspace, request: Request) -> None:
    """Build the page; slow parts follow when it is displayed."""
    words = asked(request, "row", "figure", "form")  # the browser keeps filter, search and folds
    sub = "C.-P. Chou, B. Hannaford: every printed number, table and figure, theirs and ours"
    with page_frame("paper", sub=sub, sheets=("paper.css",), scripts=("js/paper.js",)) as bar:
        place = box("div", "paper")

        async def begin() -> None:
            loaded = await run_in_thread(place, "Loading the rows", reproduction, workspace)
            if loaded is not None:
                PaperPage(words, bar, place, loaded).show()

        page_document().when_connected(begin)


# What a row is by its print alone shows before it is computed.
FORETOLD = "predictions"  # group of rows that is listed first
EXPECTED = {"erratum": "misprint", "open": "open", "synthetic": "synthetic"}


def fixed_document() -> dict[str, JsonValue]:
    """Constant part of the document: parts, their rows, and figures."""
    return {
        "kinds": [{"key": k.key, "one": k.verdict, "many": k.counted[1], "meaning": k.meaning} for k in KINDS.values()],
        "parts": [{"id": k, "title": v} for k, v in {FORETOLD: PREDICTIONS, **PARTS}.items()],
        "rows": [_row_document(r) for r in all_rows()],
        "figures": [
            {
                "id": f.id,
                "name": figure_name(f, " "),
                "title": f.title,
                "rows": f.rows,
                "recordings": f.recordings,
                "part": f.part,
            }
            for f in FIGURES.values()
        ],
    }


def _row_document(row: PrintedRow) -> dict[str, JsonValue]:
    kind = EXPECTED.get(row.expect) or KINDS[BASES[row.basis]].key
    return {
        "id": row.id,
        "part": FORETOLD if is_prediction(row) else row.part,
        "what": minus(row.heading),
        "paper": printed(row.paper),
        "unit": unit_text(row.unit),
        "kind": "repeats" if row.repeats else kind if row.printed else "unprinted",
        "recordings": needs_recording(row),
        "figures": [f.id for f in FIGURES.values() if row.id in f.rows],
        "note": said(said_of(row)),
    }


def outcome_document(outcome: RowOutcome) -> dict[str, JsonValue]:
    """Result of a row; ``place`` is our value on its tolerance, from -1 to 1 between the ends."""
    row, ours = outcome.row, outcome.ours
    content: dict[str, Any] = {"kind": kind_of(outcome).key, "note": said(outcome.note)}
    if ours is not None:
        content |= {"ours": significant(ours), "value": ours, "difference": difference(row, ours)}
        allowed = accepted_band(row)
        if allowed is not None and allowed[1] > 0.0:
            content |= {"place": (ours - allowed[0]) / allowed[1], "half": significant(allowed[1], 2)}
    return content


def said(note: str) -> str:
    """Format a note as HTML."""
    return minus(note.replace("+-", "\u00b1").replace("`", ""))


def state_document(all_: Reproduction) -> dict[str, JsonValue]:
    """Changing part of the document: outcomes, failures, and running jobs."""
    left = all_.left()
    return {
        "outcomes": {k: outcome_document(v) for k, v in list(all_.outcomes.items())},
        "failed": dict(all_.failed),
        "wanted": list(all_.wanted),
        "now": all_.now,
        "words": all_.words,
        "headline": headline(list(all_.outcomes.values())) if all_.outcomes else "",
        "left": None if left is None else round(left),
        "asked": dict(all_.asked),
    }


def _showing(row: str) -> str:
    return next((f.id for f in FIGURES.values() if row in f.rows), "")


LOOK = 0.4  # time between two looks at the run [s]
FIRST = "12c"  # figure that is shown where the link names none
CALM = 2.5  # time for which a page must have stood before small pictures are drawn for it [s]
FORMS = {"form": "In the paper\u2019s form", "numbers": "Its numbers"}


class PaperPage:
    """The page The paper of one visitor."""

    def __init__(self, words: dict[str, str], bar: Element, place: Element, all_: Reproduction) -> None:
        self.bar, self.place, self.all = bar, place, all_
        self.said: list[str] = []
        self.writing: list[tuple[Any, list[str]]] = []  # reports that are written: a line, and how far
        self.sent: set[str] = set()  # figures whose small picture the browser has
        self.row, self.figure = words.get("row", ""), words.get("figure", "")
        self.form = words.get("form", "") if words.get("form") in FORMS else "form"
        if self.row and self.row not in all_.rows:
            self.said.append(str(InputError("row", self.row, "no row begins with that")))
            self.row = ""
        if self.figure and self.figure not in FIGURES:
            self.said.append(str(InputError("figure", self.figure, known=FIGURES)))
            self.figure = ""
        if not self.figure:
            self.figure = FIRST if not self.row else _showing(self.row)
        self.asks = bool(words.get("row") or words.get("figure"))
        self.version, self.began, self.calm = -1, time.monotonic(), False
        self.shown: Any = None  # what the body of the figure was made of

    def show(self) -> None:
        """Build the page."""
        with self.bar:
            for words, ending in (("Report as PDF", ".pdf"), ("Report as HTML", ".html")):
                button(words, lambda e=ending: self._report(e))
            self.quick = button("Run without recordings", lambda: self._run(recordings=False))
            self.go = button("Run all", self._run, primary=True)
            self.halt = button("Stop", self.all.stop, primary=True)
        with self.place:
            self.under = box("div", "p-under")
            with self.under:
                for sentence in self.said:
                    refused(sentence)
            box("section", "panel p-sum").set(aria_label="Progress and verdicts")
            self.root = box("section", "panel p-root").set(aria_label="Rows")
            self.root.data("fixed", fixed_document())
            self.root.on_value("pick", self._picked)
            with box("div", "p-right"):
                with box("section", "panel p-figure chartbox"):
                    self.head = box("div", "hd")
                    self.body = box("div", "p-body")
                box("section", "panel p-figures").set(aria_label="Figures")
            self.small = box("div").set(hidden=True)  # each picture goes to the browser once
        self._look()
        self._chosen()
        Timer(page_document(), LOOK, self._look)

    # ---- what a visitor does

    def _run(self, *, recordings: bool = True, names: list[str] | None = None) -> None:
        try:
            self.all.run(names, recordings=recordings)
        except MckibbenError as error:
            tell(str(error))
        if not self.all.running:
            tell("Every row is computed already.")
        self._look()

    def _picked(self, value: object) -> None:
        choice = value if isinstance(value, dict) else {}
        row, figure = str(choice.get("row") or ""), str(choice.get("figure") or "")
        if row and row in self.all.rows:
            of = FIGURES.get(self.figure)
            self.row, self.figure = row, self.figure if of is not None and row in of.rows else _showing(row)
        elif figure in FIGURES:
            of = FIGURES[figure]
            self.row, self.figure = self.row if self.row in of.rows else "", figure
        self.asks = True
        link(row=self.row or None, figure=self.figure or None)
        self.root.data("chosen", {"row": self.row, "figure": self.figure})
        self._chosen()

    def _again(self, name: str) -> None:
        self.all.draw(name)
        self._chosen()

    def _formed(self, form: str) -> None:
        self.form = form
        link(form=None if form == "form" else form)
        self._chosen()

    async def _report(self, ending: str) -> None:
        with self.under:
            place, line = box("div"), text("p", "", "p-caption")
        self.writing.append((line, messages := ["starting"]))

        def tell_on(words: str) -> None:
            messages[0] = words

        about = "Writing the report: its figures are drawn again"
        data = await run_in_thread(place, about, self.all.report, ending, tell_on)
        self.writing.remove((line, messages))
        line.delete()
        if data is not None:
            place.delete()
            download(f"reproduction{ending}", data)

    # ---- what is shown

    def _look(self) -> None:
        for line, messages in self.writing:
            line.say(messages[0])
        if not self.calm and time.monotonic() - self.began > CALM:
            self.calm = True
            if not self.asks:
                self.asks = True
                self._chosen()
            for f in FIGURES.values():
                if not f.recordings:
                    self.all.draw(f.id, pressing=False)
        if self.version == self.all.version:
            return
        self.version = self.all.version
        self.root.data("state", state_document(self.all))
        self.root.data("chosen", {"row": self.row, "figure": self.figure})
        with self.small:
            for name in [n for n in list(self.all.pictures) if n not in self.sent]:
                self.sent.add(name)
                box("i", "p-pic").set(data_figure=name, data_small=self.all.pictures[name].small)
        for control in (self.go, self.quick):
            control.set(hidden=self.all.running)
        self.halt.set(hidden=not self.all.running)
        self._drawn()

    def _chosen(self) -> None:
        self.shown = None
        of = FIGURES.get(self.figure)
        if of is not None and self.asks and self.form == "form" and self.figure not in self.all.refused:
            self.all.draw(self.figure)
        self.head.clear()
        with self.head:
            with box("h2"):
                title = (
                    f"{figure_name(of, ' ')}: {of.title[:1].lower()}{of.title[1:]}"
                    if of
                    else "No figure shows this number"
                )
                text("span", title)
            box("span", "grow")
            if of is not None:
                segments(FORMS, self.form, self._formed, "Show")
                save_menu(figure_name(of, " "), make=lambda _, wish: self.all.file(of.id, wish))
        self._drawn()

    def _drawn(self) -> None:
        """Content of the chosen figure, as far as it exists."""
        all_, name = self.all, self.figure
        figure = name in all_.pictures, all_.asked.get(name), all_.refused.get(name)
        row = all_.outcomes.get(self.row), all_.failed.get(self.row), all_.running
        now = name, self.row, self.form, figure, row, len(all_.outcomes) if self.form == "numbers" else 0
        if now == self.shown:
            return  # what stands there keeps its place and its focus
        self.shown = now
        self.body.clear()
        with self.body:
            if name and self.form == "numbers":
                box("div", "p-numbers").data("numbers", {"figure": name, "row": self.row})
            elif name:
                self._picture(name)
            if name and (caption := FIGURES[name].caption):
                text("p", caption, "p-caption")
            if self.row:
                self._row()

    def _picture(self, name: str) -> None:
        all_ = self.all
        if name in all_.pictures:
            # wider than a phone: who has no mouse scrolls it by the arrows
            raw(all_.pictures[name].svg, "div", "p-svg").set(tabindex="0", role="group", aria_label="The figure")
        elif name in all_.refused:
            refused(f"{FIGURES[name].title}: {all_.refused[name]}")
            button("Draw it", lambda: self._again(name))
        else:
            with loading(all_.asked.get(name) or "drawing", classes="p-wait"):
                if FIGURES[name].recordings and name in all_.asked:
                    text("span", "It is drawn from recordings of the simulated machine, which take minutes.", "small")
                    button("Stop drawing", lambda: all_.stop_drawing(name), small=True)

    def _row(self) -> None:
        row, outcome = self.all.rows[self.row], self.all.outcomes.get(self.row)
        if self.row in self.all.failed:
            note(f"{row.what}: {self.all.failed[self.row]}", "stop")
        words = said(outcome.note if outcome else said_of(row))
        verdict = outcome.verdict if outcome else ""
        if verdict == "misprint" or row.expect == "erratum":
            note(f"Misprint. {words[:1].upper()}{words[1:]}. Ours is the corrected value; misprints are counted apart.")
        elif verdict == "falls short":
            note(f"Falls short. {words}", "stop")
        elif words:
            text("p", f"{row.what[:1].upper()}{row.what[1:]}: {words}.", "p-caption")
        if outcome is None and not self.all.running:
            with box("div", "p-caption"):
                button("Compute this row", lambda: self._run(names=[self.row]), small=True)
