"""The view of one visitor of the page Fit: what is asked, what came of it, and where it stands on the page."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Mapping
from typing import TYPE_CHECKING

from ....errors import MckibbenError
from ...elements import Element, Timer, page_document
from ...laboratory import UPLOADS, Laboratory
from ...transfers import IncomingFile, UploadPlace, read_with_progress
from ...widgets import box, button, check, empty, link, panel, refused, segments, text
from . import columns, files, reading, results, source
from .going import Going
from .shown import VIEWS, Shown
from .source import Asked
from .work import Work

if TYPE_CHECKING:
    from ....recordings import ForceMap
    from ....report.fit_study import Study

LOOKS = 0.25  # time between two looks at the work that goes on [s]


class View:
    """One visitor's.

    Args:
        lab: the laboratory.
        words: of the link.
    """

    def __init__(self, lab: Laboratory, words: Mapping[str, str]) -> None:
        from ....muscles.laws import LAWS

        self.lab, self.asked, self.work = lab, source.from_link(words), Work(lab)
        self.laws = [law for law in words.get("laws", "").split(",") if law in LAWS] or [*LAWS]
        self.law = words.get("law", "")
        self.points: ForceMap | None = None
        self._places: dict[str, Element] = {}
        self._seen, self._drawn, self._loading = -1, "", 0
        self.shown = Shown(self._places, words.get("view", ""))

    # ---- the page

    def build(self, bar: Element) -> None:
        """Make the places, empty as yet."""
        with bar:
            files.buttons(self)
        with box("div", "fit"):
            with box("div", "colx"):
                self._first()
                with panel("Laws", step=2) as head:
                    with head:
                        button("All", lambda: self._all(), small=True, quiet=True)
                    self._place("laws")
                self._place("cautions", "colx")
            with box("div", "colx"):
                with panel("Ranking", "by AICc, without parameters at a bound; errors in N", step=3):
                    self._place("ranking")
                    self._place("going")
                with panel("Measured and fitted", "points measured, lines the law") as head:
                    with head:
                        segments(VIEWS, self.shown.view, self._look_at, "View")
                    self._place("muscle")
                    self._place("picture")
            with box("div", "colx last"):
                for name, title, more in (
                    ("parameters", "Parameters, 95\u2009% intervals", ""),
                    ("bubbles", "Residuals", "measured \u2212 fitted, by place in the map"),
                    ("left", "Each pressure left out once", ""),
                ):
                    with panel(title, more):
                        self._place(name)
        document = page_document()
        self._timer = Timer(document, LOOKS, self.look, active=False)
        document.when_connected(self.begin)  # nobody waits for a file that is read slowly
        self._going = Going(self._places["going"], self.work, self.stop)
        document.on_close(self.work.end)

    def _first(self) -> None:
        with panel("File and columns", step=1), box("div", "stack"):
            drop = UploadPlace("Drop a CSV, MAT or TDMS file here", self._came, UPLOADS)
            self._words = drop.words.classed("small").classed("dim")
            with drop.about:
                self._name = text("b", "")
            self._place("mapping", "stack")
            self._place("given", "stack")

    def _place(self, name: str, classes: str = "") -> None:
        self._places[name] = box("div", classes)

    async def begin(self) -> None:
        """Do what the link asks for."""
        self._show_laws()
        await self.load(fresh=True)

    # ---- what a person does

    async def _came(self, one: IncomingFile) -> None:
        path = await asyncio.to_thread(source.stored, self.lab, one.name, one.path)
        one.close()
        self.law = ""
        await self.ask(Asked("table", path.name), fresh=True)

    async def ask(self, asked: Asked, *, fresh: bool = False) -> None:
        """Read a table, or read it otherwise, and fit the laws to it."""
        self.asked = asked
        self._link()
        await self.load(fresh=fresh)

    def _change(self, asked: Asked) -> None:
        self.asked = asked
        self._link()
        page_document().spawn(self.load())

    def _all(self) -> None:
        from ....muscles.laws import LAWS

        self.laws = [*LAWS]
        self._link()
        self._show_laws()
        self._fit()

    def _tick(self, law: str, on: bool) -> None:
        from ....muscles.laws import LAWS

        self.laws = [one for one in LAWS if (on if one == law else one in self.laws)]
        self._link()
        self._fit()

    async def pick(self, law: str) -> None:
        """Show another law's curves."""
        self.law = law
        self._link()
        await self._results()

    def _look_at(self, view: str) -> None:
        self.shown.view = view
        self._link()
        page_document().spawn(self.shown.look_at(view))

    def _link(self) -> None:
        from ....muscles.laws import LAWS

        found = {} if self.asked is None else self.asked.link()
        laws = None if len(self.laws) == len(LAWS) else ",".join(self.laws)
        link(**found, laws=laws, law=self.law or None, view=None if self.shown.view == "tension" else self.shown.view)

    # ---- file and columns

    async def load(self, *, fresh: bool = False) -> None:
        """Read what is asked; what is wrong stands beside the columns, and nothing else changes."""
        self._loading += 1
        mine, asked = self._loading, self.asked
        if asked is None:
            self._nothing()
            return
        place = self._places["mapping"]
        try:
            path = source.file_of(self.lab, asked)
            found = await read_with_progress(place, f"Reading {asked.name}", reading.read, path, asked, passes=2)
        except MckibbenError as error:
            if mine == self._loading:
                with place:
                    refused(str(error))
                self.points = None
                self._leave("The table was not read: see File and columns.")
            return
        if mine != self._loading:
            return
        look, size, points, wrong, self.asked = found
        self.points = points
        self._name.say(asked.name)
        ending = "MB" if size >= 2**20 else "kB"
        amount = f"{max(size / (2**20 if ending == 'MB' else 1024), 0.1):.3g}"
        rows = results.number(look.total, 0)
        self._words.say(f"{rows} rows, {amount}\u2009\u2060{ending}. Drop another CSV, MAT or TDMS here")
        with place:
            columns.mapping(self.asked, look, self._change, wrong)
            if wrong is not None:
                where = (
                    " Choose it in the table above."
                    if getattr(wrong, "remedy", "").startswith(("column", "unit"))
                    else ""
                )
                refused(f"{str(wrong).rstrip('.')}.{where}")
            elif points is not None:
                text("p", reading.used(points, self.asked), "small dim")
        if fresh:
            self._given(points)
        if points is None:
            self._leave("No fit: the columns are not clear yet.")
            return
        self._fit()

    def _given(self, points: ForceMap | None) -> None:
        branches = [] if points is None or points.branch is None else sorted({str(b) for b in points.branch})
        self._places["given"].clear()
        with self._places["given"]:
            columns.given(lambda: self.asked, self._change, branches)  # type: ignore[arg-type, return-value]

    def _nothing(self) -> None:
        with self._places["mapping"]:
            columns.maps(lambda asked: self.ask(asked, fresh=True))
        self._leave("No table yet. Drop a CSV, MAT or TDMS file here.")

    def _leave(self, words: str) -> None:
        """Nothing is fitted; say why where the ranking stands."""
        self.work.stop()
        self._going.show()
        self.shown.clear()
        for name in ("ranking", "cautions", "parameters"):
            self._places[name].clear()
        with self._places["ranking"]:
            empty(words)
        self._drawn = ""

    # ---- laws and results

    def _show_laws(self) -> None:
        from ....muscles.laws import LAWS, law_type

        place = self._places["laws"]
        place.clear()
        with place:
            for law in LAWS:
                kind = law_type(law)
                count = f"{len(kind.fitted)} parameters"
                check(str(kind.title), law in self.laws, functools.partial(self._tick, law), count).classed("law")

    def _fit(self) -> None:
        if self.asked is None or self.points is None:
            return
        try:
            self.work.start(self.asked, self.points, self.laws)
        except MckibbenError as error:
            self._leave(str(error))
            return
        self._drawn = ""
        self._timer.active = True

    async def look(self) -> None:
        """Show what the work has come to."""
        if self.work.version == self._seen or self.work.ended:
            return
        self._seen, running = self.work.version, self.work.running
        self._going.show()
        await self._results()
        if not running and self.work.version == self._seen:
            self._timer.active = False

    async def stop(self) -> None:
        """Keep what is there."""
        self.work.stop()
        await self.look()

    async def _study(self) -> Study | None:
        """What was found by now; nothing where something else is asked meanwhile."""
        asked, points = self.asked, self.points
        if asked is None or points is None:
            return None
        study = await asyncio.to_thread(self.work.study, asked, points, list(self.laws))
        return study if self.asked is asked and self.points is points else None

    async def _results(self) -> None:
        study = await self._study()
        if study is None:
            return
        place = self._places["ranking"]
        if not study.fits:
            place.clear()
            with place:
                if self.work.running:
                    text("p", "The first law is being fitted.", "empty")
                else:
                    empty("No law was fitted." if self.laws else "No law is chosen.")
                    for law, why in study.skipped.items():
                        text("p", f"{law}: {why}", "small dim")
            return
        chosen = next((f for f in study.fits if f.law == self.law), study.fits[0])
        laws = [f.law for f in study.fits]
        now = f"{chosen.law} {laws} {sorted(study.skipped)} {id(self.points)}"
        if now == self._drawn:
            return
        self._drawn = now
        place.clear()
        with place:
            text("p", f"Largest measured tension {results.number(study.points.largest, 1)}\u2009\u2060N", "small faint")
            results.ranking(study, chosen.law, self.pick)
        for name, fill in (
            ("cautions", lambda: results.cautions(chosen, study)),
            ("parameters", lambda: results.parameters(chosen)),
        ):
            self._places[name].clear()
            with self._places[name]:
                fill()
        await self.shown.show(chosen, study)
