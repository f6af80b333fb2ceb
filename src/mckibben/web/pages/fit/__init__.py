"""The Fit page: tension laws for a table of length, pressure and tension."""

from __future__ import annotations

import asyncio
import functools
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....errors import InputError, MckibbenError
from ....identification import Fit
from ....identification.ranking import Ranking, law_title
from ....muscles.build import rest_length_of
from ....muscles.laws import LAWS, law_type
from ....recordings import ForceMap
from ....report.figures import fit_figures
from ....report.fit_report import fit_document
from ....specimens import specimen
from ...charts import saveable
from ...elements import Element, Timer, call_script, page_document
from ...reader import check_rows
from ...transfers import IncomingFile, UploadPlace, attempt, download, read_with_progress
from ...widgets import (
    THIN,
    asked,
    box,
    button,
    check,
    empty,
    file_size,
    grouped,
    link,
    note,
    page_frame,
    panel,
    raw,
    refused,
    say_refused,
    segments,
    select,
    tell,
    text,
)
from ...workspace import UPLOADS, Workspace
from . import columns, jobs, results
from .jobs import FitJob, FitRequest

if TYPE_CHECKING:
    from starlette.requests import Request

    from ....report.figures.page_charts import Figure


def build(workspace: Workspace, request: Request) -> None:
    """Build the page."""
    sub = "Tension laws to a table of length, pressure and tension"
    with page_frame("fit", sub=sub, sheets=("fit.css",), scripts=("js/fit.js",)) as bar:
        FitPage(workspace, asked(request, *jobs.LINK)).build(bar)


LOOKS = 0.25  # time between two looks at the work that goes on [s]


ROW = 46  # height of a row of the ranking: a law and what is said of it [px]


# Where the page takes what a file does not say, by the first word of a remedy.
WHERE = dict.fromkeys(("column", "unit"), " Choose it in the table above.") | {"rest_length": " Type it below."}


class FitPage:
    """The Fit page of one visitor."""

    def __init__(self, workspace: Workspace, words: Mapping[str, str]) -> None:
        self.workspace, self.asked, self.work = workspace, jobs.from_link(words), FitJob(workspace)
        self.laws = [law for law in words.get("laws", "").split(",") if law in LAWS] or [*LAWS]
        self.law = words.get("law", "")
        self.points: ForceMap | None = None
        self._places: dict[str, Element] = {}
        self._counts: dict[str, Element] = {}  # of the parameters of each law
        self._seen, self._drawn, self._loading, self._asking = -1, "", 0, 0
        self.shown = LawPictures(self._places, words.get("view", ""))

    # ---- the page

    def build(self, bar: Element) -> None:
        """Build the empty page."""
        with bar:
            button("Report as PDF", lambda: _pdf(self))
            button("Open report", lambda: _open(self)).set(data_opens="report")  # by the click itself: see fit.js
            button("Save as specimen file", lambda: _specimen(self))
            button("Use on the bench", lambda: _bench(self), primary=True)
        with box("div", "fit"):
            with box("div", "colx"):
                with panel("File and columns", step=1), box("div", "stack"):
                    drop = UploadPlace("Drop a table of any format here", self._came, UPLOADS)
                    self._words = drop.words.classed("small").classed("dim")
                    with drop.about:
                        self._name = text("b", "")
                    self._place("mapping", "stack mapping" if self.asked else "stack")
                    self._place("given", "stack given-room" if self.asked else "stack")
                with panel("Laws", step=2) as head:
                    with head:
                        button("All", lambda: self._all(), small=True, quiet=True)
                    self._place("laws")
                self._place("cautions", "colx")
            with box("div", "colx"):
                with panel("Ranking", "by the error of points left out; errors in N", step=3) as head:
                    saveable(head, "Ranking", self.shown.draw_ranking)
                    self._place("ranking")
                    if self.asked:
                        self._reserve()
                    self._place("going")
                with panel("Measured and fitted", "points measured, lines the law") as head:
                    with head:
                        segments(VIEWS, self.shown.view, self._look_at, "View")
                    saveable(head, "Measured and fitted", self.shown.draw_law)
                    self._place("muscle")
                    self._place("picture")
            with box("div", "colx last"):
                with panel("Parameters, 95\u2009% intervals"):
                    self._place("parameters")
                for name, title, more in (
                    ("bubbles", "Residuals", "measured \u2212 fitted, by place in the map"),
                    ("left", "Each pressure left out once", ""),
                ):
                    with panel(title, more) as head:
                        saveable(head, title, self.shown.draw_residuals)
                        self._place(name)
        document = page_document()
        self._timer = Timer(document, LOOKS, self._look, active=False)
        document.when_connected(self._begin)  # nobody waits for a file that is read slowly
        self._going = FitProgress(self._places["going"], self.work, self._stop)
        document.on_close(self.work.end)

    def _reserve(self) -> None:
        """Give the ranking the height that it will have, so that nothing below it moves when it comes."""
        self._places["ranking"].style(min_height=f"{ROW * (len(self.laws) + 2)}px")

    def _place(self, name: str, classes: str = "") -> None:
        self._places[name] = box("div", classes or f"room-{name}")  # its name gives it the room that it will take

    async def _begin(self) -> None:
        self._show_laws()
        await self._load(fresh=True)

    # ---- what a person does

    async def _came(self, one: IncomingFile) -> None:
        def store() -> Path:
            check_rows(one.path, jobs.MOST_ROWS, "a fit")  # before anything is stored
            return self.workspace.uploads.store_again(one.name, one.path)

        path = await asyncio.to_thread(store)
        one.close()
        self.law = ""
        await self._ask(FitRequest("table", path.name))

    async def _ask(self, asked: FitRequest) -> None:
        self.asked = asked
        self._link()
        await self._load(fresh=True)

    def _change(self, asked: FitRequest) -> None:
        self.asked = asked
        page_document().spawn(self._load())  # first, so that the old table goes with the message that sets the address
        self._link()

    def _all(self) -> None:
        self.laws = [*LAWS]
        self._link()
        self._show_laws()
        self._fit()

    def _tick(self, law: str, on: bool) -> None:
        self.laws = [one for one in LAWS if (on if one == law else one in self.laws)]
        self._link()
        self._fit()

    async def _pick(self, law: str) -> None:
        self.law = law
        self._link()
        await self._results()

    async def _look_at(self, view: str) -> None:
        self.shown.view = view
        self._link()
        await self.shown.draw()

    def _link(self) -> None:
        parameters = {} if self.asked is None else self.asked.link()
        laws = None if len(self.laws) == len(LAWS) else ",".join(self.laws)
        view = None if self.shown.view == "tension" else self.shown.view
        link(**parameters, laws=laws, law=self.law or None, view=view)

    # ---- file and columns

    def _now(self) -> FitRequest:
        """The request as it is when a field is changed, with what was chosen since the field was built."""
        assert self.asked is not None
        return self.asked

    async def _load(self, *, fresh: bool = False) -> None:
        """Read the requested table; an error is shown beside the columns, and nothing else changes."""
        self._loading += 1
        mine, asked = self._loading, self.asked
        if asked is None:
            with self._places["mapping"]:
                columns.maps(self._ask)
            self._leave("No table yet. Drop a table of any format here.")
            return
        place = self._places["mapping"]
        try:
            path = jobs.file_of(self.workspace, asked)
            reading = await read_with_progress(
                place, f"Reading {asked.name}", jobs.look_and_read, path, asked, passes=2
            )
        except MckibbenError as error:
            if mine == self._loading:
                say_refused(place, error)
                self.points = None
                self._leave("The table was not read: see File and columns.")
            return
        if mine != self._loading:
            return
        look, size, points, wrong, self.asked, parts = reading
        self.points = points
        self._name.say(asked.name)
        self._words.say(f"{grouped(look.total, 0)} rows, {file_size(size)}. Drop another table here")
        with place:
            if parts:
                columns.part(self._now, parts, self._change)
            columns.mapping(self._now, look, self._change, wrong)
            if wrong is not None:
                where = WHERE.get(getattr(wrong, "remedy", "").partition(" ")[0], "")
                if isinstance(wrong, InputError):
                    wrong = wrong.changed(field=wrong.field.replace("_", " "), remedy="")
                refused(f"{str(wrong).rstrip('.')}.{where}")
            elif points is not None:
                text("p", jobs.used(points, self.asked), "small dim")
        if fresh:
            branches = [] if points is None or points.branch is None else sorted({str(b) for b in points.branch})
            self._places["given"].clear()
            with self._places["given"]:
                columns.given(self._now, self._change, branches)
        if points is None:
            self._leave("No fit: the columns are not clear yet.")
            return
        self._fit()

    def _leave(self, words: str) -> None:
        """Show a reason instead of the ranking; nothing is fitted."""
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
        place = self._places["laws"]
        place.clear()
        with place:
            for law in LAWS:
                kind, change = law_type(law), functools.partial(self._tick, law)
                with check(str(kind.title), law in self.laws, change).classed("law"):
                    self._counts[law] = text("span", f"{len(kind.fitted)} parameters", "faint grow num")

    def _fit(self) -> None:
        if self.asked is None or self.points is None:
            return
        self._reserve()
        try:
            self.work.start(self.asked, self.points, self.laws)
        except MckibbenError as error:
            self._leave(str(error))
            return
        self._drawn = ""
        self._timer.active = True

    async def _look(self) -> None:
        if self.work.version == self._seen or self.work.ended:
            return
        self._seen, running = self.work.version, self.work.running
        self._going.show()
        await self._results()
        if not running and self.work.version == self._seen:
            self._timer.active = False

    async def _stop(self) -> None:
        self.work.stop()
        self._places["ranking"].style(min_height="auto")  # no further law comes
        await self._look()

    async def _results(self) -> None:
        asked, points = self.asked, self.points
        if asked is None or points is None:
            return
        self._asking += 1
        mine, laws, running = self._asking, list(self.laws), self.work.running
        study = await asyncio.to_thread(self.work.study, asked, points, laws)
        if mine != self._asking or self.asked is not asked or self.points is not points:
            return  # something else was asked for meanwhile
        for one in study.fits:  # as many as the ranking says: what the table states of the muscle is not fitted
            self._counts[one.law].say(f"{len(one.parameters)} parameters")
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
        now = f"{chosen.law} {[f.law for f in study.fits]} {sorted(study.skipped)} {id(self.points)} {running}"
        if now == self._drawn:
            return
        self._drawn = now
        done, said = len(study.fits) + len(study.skipped), ""
        if running:
            said = f"Preliminary: {done} of {len(laws)} laws are fitted; their places follow with the last one."
        elif done < len(laws):
            said = f"Stopped: the places are those of {done} of {len(laws)} laws."
        place.clear()
        with place:
            with box("p", "small faint"):
                text("span", f"Largest measured tension {grouped(study.points.largest, 1)}{THIN}N. ")
                text("b", said).set(id="preliminary")
            results.ranking(study, chosen.law, self._pick, final=not running)
        for place in (self._places["cautions"], self._places["parameters"]):
            place.clear()
        with self._places["cautions"]:
            results.cautions(chosen, study)
        with self._places["parameters"]:
            results.parameters(chosen)
        await self.shown.show(chosen, study)


class FitProgress:
    """Progress line below the ranking. It is built once per job, so that clicks reach its button."""

    def __init__(self, place: Element, work: FitJob, stop: Callable[[], object]) -> None:
        self._place, self._work, self._stop = place, work, stop
        self._said: Any = None
        self._bar: Any = None

    def show(self) -> None:
        """Show the progress of the fit, or why it ended."""
        work = self._work
        if not work.running:
            self._place.clear()
            self._said = None
            if work.failed:
                with self._place:
                    note(f"A fit ended unexpectedly: {work.failed}", "stop")
            return
        if self._said is None:
            self._place.clear()
            with self._place, box("div", "going").set(role="status"):
                self._said = text("span", "")
                self._bar = raw("", "div", "line")
                button("Stop fitting", self._stop, small=True)
        left = f", {work.left:.0f}\u2009\u2060s left" if work.left is not None else ""
        law, _, done = work.words.partition(": ")
        doing = f"Fitting {law_type(law).title}{', ' * bool(done)}{done}{left}" if law else "Waiting for other fits"
        self._said.say(doing)
        self._bar.put(f'<i style="width:{100.0 * work.share:.0f}%"></i>')


VIEWS = {"tension": "Tension", "errors": "Residuals", "surface": "Surface"}
HEIGHTS = {"tension": 470, "errors": 470, "surface": 470, "bubbles": 206, "left": 190}  # [px]


class LawPictures:
    """Figures of one law, in some elements of a page.

    Args:
        places: by the names ``muscle``, ``picture``, ``bubbles``, ``left``.
        view: one of `VIEWS`, in the place ``picture``.
    """

    def __init__(self, places: Mapping[str, Element], view: str) -> None:
        self._places = places
        self.view = view if view in VIEWS else "tension"
        self._rest: float | None = None
        self._asking = 0
        self._last: tuple[Fit, Ranking] | None = None

    async def show(self, fit: Fit, study: Ranking) -> None:
        """Draw another law, or the same law again."""
        self._last = fit, study
        place, rests = self._places["muscle"], results.rests(study.points)
        place.clear()
        self._rest = self._rest if self._rest in rests else (rests[0] if len(rests) > 1 else None)
        if len(rests) > 1:

            async def another(rest: str) -> None:
                self._rest = float(rest)
                await self.draw()

            with place:
                words = {repr(r): f"{100.0 * r:.4g} cm at rest" for r in rests}
                select(words, repr(self._rest), another, "Muscle")
        await self.draw()

    def draw_law(self, part: object) -> Figure:
        """Draw the figure of the shown view; the surface as its lines."""
        fit, study = self._shown()
        return fit_figures.residuals(fit) if self.view == "errors" else fit_figures.tension_curves(fit, study.points)

    def draw_residuals(self, part: object) -> Figure:
        """Draw the errors of the fit, and of predictions with a pressure or a length left out."""
        return fit_figures.residuals(self._shown()[0])

    def draw_ranking(self, part: object) -> Figure:
        """Draw the laws in their order."""
        return fit_figures.ranking(self._shown()[1])

    def _shown(self) -> tuple[Fit, Ranking]:
        if self._last is None:
            raise InputError("figure", None, "cannot be saved: no law was fitted yet")
        return self._last

    def clear(self) -> None:
        """Remove the figures."""
        self._asking += 1
        self._last = None
        for name in ("muscle", "picture", "bubbles", "left"):
            self._places[name].clear()

    async def draw(self) -> None:
        """Draw the law, as it is to be looked at now."""
        if self._last is None:
            return
        self._asking += 1
        mine, (fit, study) = self._asking, self._last
        data = await asyncio.to_thread(results.drawn, fit, study, self._rest)
        if mine != self._asking:
            return  # another one was asked for meanwhile
        title = law_title(fit)
        named = {
            "picture": (self.view, f"{VIEWS[self.view]} of {title} with the measured points"),
            "bubbles": ("bubbles", f"Residuals of {title} by length and pressure"),
            "left": ("left", f"Largest error of {title} at each pressure when that pressure is left out of the fit"),
        }
        for name, (kind, words) in named.items():
            self._places[name].clear()
            with self._places[name]:
                if name == "left" and not data["left"]:
                    text("p", "The table has one pressure only.", "small dim")
                else:
                    raw(results.figure(kind, data, words, HEIGHTS[kind]))
                if name == "picture":
                    results.values(data)


def _study(view: FitPage) -> Ranking | None:
    """Return the study for a report; show a message and return None if there is none."""
    if view.work.running:
        tell("The fits go on; wait for their end, or stop them first.")
        return None
    if view.asked is None or view.points is None:
        tell("There is no table yet: drop one first.")
        return None
    study = view.work.study(view.asked, view.points, view.laws)
    if not study.fits:
        tell("No law was fitted; there is nothing to write.")
        return None
    return study


async def _pdf(view: FitPage) -> None:
    study = _study(view)
    if study is None:
        return
    tell("Making the report ..")
    data = await attempt(lambda: fit_document([study]).pdf())
    if data is not None:
        download(f"{Path(study.points.name).stem}-fit.pdf", data)


async def _open(view: FitPage) -> None:
    study = _study(view)
    page = None if study is None else await attempt(lambda: fit_document([study]).html())
    if study is None or page is None:
        call_script("dropReport")
    else:
        call_script("showReport", page, f"{Path(study.points.name).stem}-fit.html")


async def _specimen(view: FitPage) -> None:
    """Download the specimen, and add it to the server's specimens, which can be undone."""
    study = _study(view)
    if study is None:
        return

    def store() -> tuple[str, bytes, Path]:
        name, data = _written(study)
        return name, data, view.workspace.specimens.store(name, data)

    stored = await attempt(store)
    if stored is not None:
        name, data, path = stored
        view.workspace.toasts.tell(f"Saved specimens/{path.name}.", undo=lambda: path.unlink(missing_ok=True))
        view.workspace.changed()
        download(name, data)


async def _bench(view: FitPage) -> None:
    """Add the specimen, with the shown law as its first, to the server's specimens, and choose it on the bench."""
    study = _study(view)
    if study is None:
        return
    shown = next((f for f in study.fits if f.law == view.law), study.fits[0])

    def led_by(one: Fit) -> Ranking:
        return replace(study, fits=[one, *(f for f in study.fits if f is not one)])

    def refusal(one: Fit) -> str:
        return view.workspace.machine.refusal(led_by(one).to_specimen()) if one.converged else "it did not converge"

    def store() -> Path:
        if why := refusal(shown):
            others = (f for f in study.fits if f is not shown)
            able = next((f for f in others if not refusal(f)), None)
            if able is not None:  # else the bench says itself what is in the way
                said = f"{law_title(shown)} cannot run the protocol that is on the bench ({why.rstrip('.')})"
                sentence = f"{said}. The best law that can is {law_title(able)}: choose it in the ranking"
                raise InputError("law", shown.law, sentence=sentence)
        first = led_by(shown)
        path = view.workspace.specimens.store_once(*_written(first))
        rest_length_of(specimen(path))  # refused here, and not by the bench
        return path

    path = await attempt(store)
    if path is not None:
        call_script("toBench", [["muscle", path.stem]])


def _written(study: Ranking) -> tuple[str, bytes]:
    letters = [c if c.isalnum() or c in "._-" else "-" for c in Path(study.points.name).stem]
    stem = "".join(letters)[:60].strip("-.") or "table"
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder) / f"{stem}-fit.toml"
        study.save(place)
        return place.name, place.read_bytes()
