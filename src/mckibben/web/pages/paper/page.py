"""The page The paper as one visitor sees it: the rows, the chosen figure, and the progress of the computation."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Any

from ....errors import InputError, MckibbenError
from ....report.paper_figures import FIGURES
from ...elements import Element, Timer, page_document
from ...save import save_menu
from ...transfers import download, run_in_thread
from ...widgets import box, button, link, loading, note, raw, refused, segments, tell, text

if TYPE_CHECKING:
    from ...workspace import Workspace
    from .state import Reproduction

LOOK = 0.4  # time between two looks at the run [s]
FIRST = "12c"  # figure that is shown where the link names none
CALM = 2.5  # time for which a page must have stood before small pictures are drawn for it [s]
FORMS = {"form": "In the paper\u2019s form", "numbers": "Its numbers"}


async def begin(workspace: Workspace, words: dict[str, str], bar: Element, place: Element) -> None:
    """Load the computing modules, then build the page."""
    loaded = await run_in_thread(place, "Loading the rows", _loaded, workspace)
    if loaded is not None:
        PaperPage(workspace, words, bar, place, loaded).show()


def _loaded(workspace: Workspace) -> Reproduction:
    from . import rows  # noqa: F401  (loads the figures' register in this thread)
    from .state import reproduction

    return reproduction(workspace)


class PaperPage:
    """The page The paper of one visitor."""

    def __init__(
        self, workspace: Workspace, words: dict[str, str], bar: Element, place: Element, all_: Reproduction
    ) -> None:
        self.workspace, self.bar, self.place, self.all, self.figures = workspace, bar, place, all_, FIGURES
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
            self.figure = FIRST if not self.row else self._shows(self.row)
        self.asks = bool(words.get("row") or words.get("figure"))
        self.version, self.began, self.calm = -1, time.monotonic(), False
        self.shown: Any = None  # what the body of the figure was made of

    def _shows(self, row: str) -> str:
        """The figure that shows a row; nothing if none does."""
        return next((f.id for f in self.figures.values() if row in f.rows), "")

    def show(self) -> None:
        """Build the page."""
        from .rows import fixed_document

        with self.bar:
            for words, ending in (("Report as PDF", ".pdf"), ("Report as HTML", ".html")):
                button(words, lambda e=ending: self.report(e))
            self.quick = button("Run without recordings", lambda: self.run(recordings=False))
            self.go = button("Run all", self.run, primary=True)
            self.halt = button("Stop", self.all.stop, primary=True)
        with self.place:
            self.under = box("div", "p-under")
            with self.under:
                for sentence in self.said:
                    refused(sentence)
            box("section", "panel p-sum").set(aria_label="Progress and verdicts")
            self.root = box("section", "panel p-root").set(aria_label="Rows")
            self.root.data("fixed", fixed_document())
            self.root.on_value("pick", self.picked)
            with box("div", "p-right"):
                with box("section", "panel p-figure chartbox"):
                    self.head = box("div", "hd")
                    self.body = box("div", "p-body")
                box("section", "panel p-figures").set(aria_label="Figures")
            self.small = box("div").set(hidden=True)  # each picture goes to the browser once
        self.look()
        self.chosen()
        Timer(page_document(), LOOK, self.look)

    # ---- what a visitor does

    def run(self, *, recordings: bool = True, names: list[str] | None = None) -> None:
        """Compute the missing rows."""
        try:
            self.all.run(names, recordings=recordings)
        except MckibbenError as error:
            tell(str(error))
        if not self.all.running:
            tell("Every row is computed already.")
        self.look()

    def picked(self, value: object) -> None:
        """Take the row or figure that was chosen in the browser."""
        choice = value if isinstance(value, dict) else {}
        row, figure = str(choice.get("row") or ""), str(choice.get("figure") or "")
        if row and row in self.all.rows:
            of = self.figures.get(self.figure)
            self.row, self.figure = row, self.figure if of is not None and row in of.rows else self._shows(row)
        elif figure in self.figures:
            of = self.figures[figure]
            self.row, self.figure = self.row if self.row in of.rows else "", figure
        self.asks = True
        link(row=self.row or None, figure=self.figure or None)
        self.root.data("chosen", {"row": self.row, "figure": self.figure})
        self.chosen()

    def again(self, name: str) -> None:
        """Retry a figure that was stopped or refused."""
        self.all.draw(name)
        self.chosen()

    def formed(self, form: str) -> None:
        """Switch between the paper's form and its numbers."""
        self.form = form
        link(form=None if form == "form" else form)
        self.chosen()

    async def report(self, ending: str) -> None:
        """Download the report of the present results."""
        with self.under:
            place, line = box("div"), text("p", "", "p-caption")
        self.writing.append((line, messages := ["starting"]))

        def tell_on(words: str) -> None:
            messages[0] = words

        data = await run_in_thread(
            place, "Writing the report: its figures are drawn again", self.all.report, ending, tell_on
        )
        self.writing.remove((line, messages))
        line.delete()
        if data is not None:
            place.delete()
            download(f"reproduction{ending}", data)

    # ---- what is shown

    def look(self) -> None:
        """Show the changes since the last call."""
        for line, messages in self.writing:
            line.say(messages[0])
        if not self.calm and time.monotonic() - self.began > CALM:
            self.calm = True
            if not self.asks:
                self.asks = True
                self.chosen()
            for f in self.figures.values():
                if not f.recordings:
                    self.all.draw(f.id, pressing=False)
        if self.version == self.all.version:
            return
        from .rows import state_document

        self.version = self.all.version
        self.root.data("state", state_document(self.all))
        self.root.data("chosen", {"row": self.row, "figure": self.figure})
        with self.small:
            for name in [n for n in list(self.all.pictures) if n not in self.sent]:
                self.sent.add(name)
                box("i", "p-pic").set(data_figure=name, data_small=self.all.pictures[name].small)
        for control, on in (
            (self.go, not self.all.running),
            (self.quick, not self.all.running),
            (self.halt, self.all.running),
        ):
            control.set(hidden=not on)
        self.drawn()

    def chosen(self) -> None:
        """Show the chosen figure, and draw it if necessary."""
        self.shown = None
        of = self.figures.get(self.figure)
        if of is not None and self.asks and self.form == "form" and self.figure not in self.all.refused:
            self.all.draw(self.figure)
        self.head.clear()
        with self.head:
            from .rows import named

            with box("h2"):
                text(
                    "span",
                    f"{named(of)}: {of.title[:1].lower()}{of.title[1:]}" if of else "No figure shows this number",
                )
            box("span", "grow")
            if of is not None:
                segments(FORMS, self.form, self.formed, "Show")
                save_menu(named(of), make=lambda _, wish: self.all.file(of.id, wish))
        self.drawn()

    def drawn(self) -> None:
        """Content of the chosen figure, as far as it exists."""
        all_, name = self.all, self.figure
        outcome = all_.outcomes.get(self.row)
        key = (
            name,
            self.row,
            self.form,
            name in all_.pictures,
            all_.asked.get(name),
            all_.refused.get(name),
            outcome,
            all_.failed.get(self.row),
            all_.running,
            len(all_.outcomes) if self.form == "numbers" else 0,
        )
        if key == self.shown:
            return
        self.shown = key
        self.body.clear()
        with self.body:
            if name and self.form == "numbers":
                box("div", "p-numbers").data("numbers", {"figure": name, "row": self.row})
            elif name:
                self._picture(name)
            if name and (caption := self.figures[name].caption):
                text("p", caption, "p-caption")
            if self.row:
                self._row()

    def _picture(self, name: str) -> None:
        all_ = self.all
        if name in all_.pictures:
            # wider than a phone: who has no mouse scrolls it by the arrows
            raw(all_.pictures[name].svg, "div", "p-svg").set(tabindex="0", role="group", aria_label="The figure")
        elif name in all_.refused:
            refused(f"{self.figures[name].title}: {all_.refused[name]}")
            button("Draw it", lambda: self.again(name))
        else:
            with loading(all_.asked.get(name) or "drawing", classes="p-wait"):
                if self.figures[name].recordings and name in all_.asked:
                    text("span", "It is drawn from recordings of the simulated machine, which take minutes.", "small")
                    button("Stop drawing", lambda: all_.stop_drawing(name), small=True)

    def _row(self) -> None:
        """Show the chosen row, and the button that computes it."""
        from ....reproduction.rows import said_of
        from .rows import said

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
                button("Compute this row", lambda: self.run(names=[self.row]), small=True)
