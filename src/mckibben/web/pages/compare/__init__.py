"""The Compare page: braided and biological muscles by Table 1 of the paper, a column each, with charts at the side."""

from __future__ import annotations

import asyncio
import contextlib
import html
import json
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

from ....answers import collect
from ....errors import InputError, MckibbenError
from ....muscles.plausible import pressure_caution
from ....quantities import Quantity, from_si, parse, with_unit
from ....specimens import specimen, specimens
from ....specimens.published import published_ranges
from ....studies.comparison import FULL_PRESSURE, ComparedMuscle, MuscleColumn, MuscleTable
from ....verbs import typed
from ... import forms
from ...bench.chosen import drawn_muscle
from ...charts import save_menu
from ...elements import page_document
from ...transfers import download, specimen_place
from ...widgets import (
    Dialog,
    asked,
    box,
    button,
    empty,
    link,
    loading,
    page_frame,
    panel,
    raw,
    refused,
    say_refused,
    segments,
    tell,
    text,
)
from ...workspace import Workspace
from . import drawings
from .stimulation import StimulationPanel

if TYPE_CHECKING:
    from starlette.requests import Request


def build(workspace: Workspace, request: Request) -> None:
    """Build the page."""
    ComparePage(workspace, asked(request, "muscles", "values", "recordings", "pressure")).build()


ABOUT = "gauge pressure that counts as the full drive of McKibben muscles"
PRESSURE = Quantity("Pa", (0.0, 1e8), ABOUT, "P", (1e5, 8e5))


class Compared(NamedTuple):
    """A column of the page: the word of the link, its values, the muscle of a law, and why there are no values."""

    name: str
    column: MuscleColumn | None
    muscle: ComparedMuscle | None
    said: str = ""


class ComparePage:
    """The Compare page of one visitor."""

    def __init__(self, workspace: Workspace, view: dict[str, str]) -> None:
        self.workspace = workspace
        self.muscles = _words(view.get("muscles", ",".join(drawings.FIRST)))
        self.values = view["values"] if view.get("values") == "recordings" else "laws"
        newest = [n for n in workspace.recordings.names() if n.endswith(".nc")][:3]
        self.recordings = _words(view["recordings"]) if "recordings" in view else newest
        self.pressure, self.said = FULL_PRESSURE, ""
        self.cancelled, self.number, self.gone = False, 0, False
        self.typed_pressures = 0  # count of the pressures that were typed
        if "pressure" in view:
            try:
                self.pressure = parse(view["pressure"], "Pa", field="pressure")
                PRESSURE.check("pressure", self.pressure)
            except InputError as error:
                self.said, self.pressure = str(error), FULL_PRESSURE

    def build(self) -> None:
        """Build the page; the numbers follow."""
        sub = "Muscles side by side, at full drive, per resting length L\u2080 and section"
        with page_frame("compare", sub=sub, sheets=("compare.css",), scripts=("js/compare.js",)) as bar:
            with bar:
                self.typed = forms.InputField(
                    "Full drive", forms.shown(self.pressure, PRESSURE), self._drive, unit="bar", colour="small P",
                    hint=PRESSURE.doc, classes="row full-drive", edge="field", said="pop",
                )  # fmt: skip
                self.typed.input.set(inputmode="decimal")
                names = {"laws": "From the laws", "recordings": "From recordings"}
                segments(names, self.values, lambda value: self.renew(values=value), "Values")
                button("Add muscle", lambda: choose_column(self))
                button("Export table", self._export)
            with box("div", "compare-grid"):
                self.main = box("section", "panel compare-table").set(aria_label="Table 1, drawn", tabindex="0")
                with box("div", "compare-side"):
                    with panel("Tension against velocity"):
                        self.velocity = box("div", "place")
                    with panel("Same protocol", sub="isometric step") as head:
                        with head:
                            self.running = box("div")
                        self.step = box("div", "place")
                    self.stimulation = StimulationPanel(self.workspace)
                    with panel("Energy efficiency"):
                        self.energy = box("div", "place small-place")
        self.document = page_document()
        self.document.on_close(self._leave)
        if self.said:
            self.typed.refuse(self.said)
        self.table: MuscleTable | None = None
        self.renew()

    def _leave(self) -> None:
        self.gone = self.cancelled = True
        self.number += 1

    # ---- what a person does

    async def _drive(self, words: str) -> None:
        self.typed_pressures += 1
        number = self.typed_pressures
        pressure, why = self.pressure, ""
        try:
            pressure = forms.accept("pressure", words[:80], PRESSURE)
            # a muscle may refuse it, and all of them would be gone
            await asyncio.to_thread(lambda: [self._subject(name, pressure) for name in self.muscles])
        except MckibbenError as error:
            why = forms.refusal(error, forms.shown(self.pressure, PRESSURE))
        if number != self.typed_pressures:
            return  # another one was typed meanwhile
        self.typed.refuse(why)
        if not why:
            self.pressure = pressure
            self.renew()

    def take(self, name: str) -> None:
        """Add a column, or replace the choice of a list."""
        chosen = self.recordings if self.values == "recordings" and name.endswith(".nc") else self.muscles
        if name not in chosen:
            if len(chosen) >= drawings.MOST:
                tell(f"There can be at most {drawings.MOST} columns.")
                return
            chosen.append(name)
        self.renew()

    def drop(self, name: str) -> None:
        """Remove a column."""
        for chosen in (self.muscles, self.recordings):
            if name in chosen:
                chosen.remove(name)
        self.renew()

    def move(self, name: str, by: int) -> None:
        """Move a column left or right."""
        chosen = self.recordings if name in self.recordings else self.muscles
        i = chosen.index(name)
        j = min(max(i + by, 0), len(chosen) - 1)
        chosen[i], chosen[j] = chosen[j], chosen[i]
        self.renew()

    def _export(self) -> None:
        if self.table is None:
            tell("The table is not there yet.")
        else:
            download("comparison.csv", drawings.exported(self.table))

    # ---- what is computed

    def _subject(self, name: str, pressure: float) -> ComparedMuscle:
        """Muscle of a specimen, or of the visitor's file, named by a value of the link."""
        own = name.endswith(".toml")
        path = self.workspace.specimens.found(name) if own else name.replace("/", "").replace("\\", "")
        return drawings.subject_of(path, pressure)

    def renew(self, values: str = "") -> None:
        """Compute and show the present columns, or those of ``laws`` or ``recordings``."""
        self.values = values or self.values
        self.number += 1
        link(
            muscles=",".join(self.muscles) or "none",
            values=None if self.values == "laws" else self.values,
            recordings=",".join(self.recordings) if self.values == "recordings" else None,
            pressure=None if self.pressure == FULL_PRESSURE else with_unit(self.pressure, "Pa", 12),
        )
        if self.table is None:
            self._wait("", 0)
        self.document.spawn(self._follow(self.number))

    def _wait(self, name: str, done: int) -> None:
        self.main.clear()
        with self.main, loading(f"Computing Table 1{': ' if name else ''}{name}", done / max(len(self.muscles), 1)):
            pass

    async def _follow(self, number: int) -> None:
        try:
            if self.table is None and self.values == "laws":
                for i, name in enumerate(self.muscles):
                    self._wait(name, i)
                    with contextlib.suppress(MckibbenError):  # said in its column
                        await asyncio.to_thread(self._by_law, name)
                    if number != self.number:
                        return
            columns, surfaces, loops = await asyncio.to_thread(self._computed)
        except Exception as error:  # the page has to hear of it, whatever it is
            known = isinstance(error, MckibbenError)
            said = str(error) if known else f"the comparison failed: {type(error).__name__}: {str(error)[:200]}"
            if number == self.number:
                say_refused(self.main, said)
            return
        if number == self.number:
            self._show(columns, surfaces, loops)

    def _by_law(self, name: str) -> Compared:
        one = self._subject(name, self.pressure)
        column = drawings.with_runs(one, drawings.column(one))
        drawings.over_velocity(one)  # compiled here, not where it is drawn
        return Compared(name, column, one)

    def _computed(self) -> tuple[list[Compared], dict[str, drawings.Surface | None], dict[str, drawings.Loop]]:
        """Compute every column with its muscle, or the reason why there is none; surfaces and recorded loops."""
        columns, loops, recorded = [], {}, self.values == "recordings"
        for name in self.recordings if recorded else ():
            try:
                path = self.workspace.recordings.found(name)
                loops[name] = drawings.loop_of(path)
                columns.append(Compared(name, drawings.column_of_recording(path), None))
            except MckibbenError as error:
                said = str(error).replace(f"{self.workspace.recordings.folder}/", "")
                columns.append(Compared(name, None, None, said))
        for name in self.muscles:
            try:
                if not recorded or not name.endswith(".toml") and specimen(name).kind == "biological":
                    columns.append(self._by_law(name))
            except MckibbenError as error:
                columns.append(Compared(name, None, None, str(error)))
        return columns, {one.name: drawings.surface(one.muscle) for one in columns if one.muscle is not None}, loops

    # ---- what is shown

    def _show(
        self, columns: list[Compared], surfaces: dict[str, drawings.Surface | None], loops: dict[str, drawings.Loop]
    ) -> None:
        self.main.clear()
        self.table = MuscleTable(tuple(one.column for one in columns if one.column is not None), published_ranges())
        with self.main:
            if columns:
                ComparisonGrid(self, self.table, columns).show(surfaces)
            elif self.values == "recordings":
                words = "No recordings yet. Start a run on the bench, or drop a file on Recordings."
                empty(words, "Go to the bench", "/")
            else:
                empty("No muscles to compare.", "Add muscle", lambda: choose_column(self))
        letters = {one.name: drawings.LETTERS[i] for i, one in enumerate(columns)}
        self.shown = [(letters[one.name], one.muscle) for one in columns if one.muscle is not None]
        braided = [one for _, one in self.shown if one.unit is not None]
        self.typed.warn(
            collect(*(pressure_caution(self.pressure, one.spec, text=typed(self.pressure)) for one in braided))
        )
        self.velocity.clear()
        with self.velocity:
            if loops:
                drawings.loops_chart([(f"{letters[n]} {Path(n).stem}", xy) for n, xy in loops.items()]).show()
            if self.shown:
                drawings.velocity_chart(self.shown).show()
        show_trials(self)
        self.stimulation.show([one for _, one in self.shown])
        names = [c.name for c in self.table.columns]
        full = self.pressure == FULL_PRESSURE and "nylon" in names and self.values == "laws"
        self.energy.clear()
        with self.energy:
            known = [letters[one.name] for one in columns if one.column is not None]
            raw(drawings.efficiencies(self.table, known, full))


def _words(text_: str) -> list[str]:
    return list(dict.fromkeys(w for w in text_.split(",") if w and w != "none"))[: drawings.MOST]


# ---- the table of columns


class ComparisonGrid:
    """Table of one page."""

    def __init__(self, page: ComparePage, table: MuscleTable, columns: list[Compared]) -> None:
        self.page, self.table, self.columns = page, table, columns

    def show(self, surfaces: dict[str, drawings.Surface | None]) -> None:
        """Build all of it, within the open element."""
        with box("div", "cmp").style(**{"--columns": str(len(self.columns))}):
            box("div", "k head")
            for letter, one in zip(drawings.LETTERS, self.columns, strict=False):
                self._head(letter, one)
            if any(one.column is None for one in self.columns):
                box("div", "k")
                for one in self.columns:
                    with box("div", "cell"):
                        if one.column is None:
                            refused(one.said)
            if any(one.muscle is not None for one in self.columns):
                self._drawings()
                self._surfaces(surfaces)
            self._rows()

    def _head(self, letter: str, one: Compared) -> None:
        name, muscle = one.name, one.muscle
        with box("div", "ch"):
            text("span", letter, "ab")
            title = muscle.spec.title if muscle is not None else Path(name).stem
            text("span", _short(title), "title").set(title=title)
            with box("details", "more"):
                raw("\u22ef", "summary", "btn s q").set(aria_label=f"More about {_short(title)}")
                with box("div", "menu-list"):
                    button("Move left", lambda: self.page.move(name, -1), small=True, quiet=True)
                    button("Move right", lambda: self.page.move(name, 1), small=True, quiet=True)
                    if muscle is not None and muscle.unit is not None and not name.endswith(".toml"):
                        text("a", "Use on the bench", "btn s q").set(href=f"/?muscle={muscle.id}")
                    for note in one.column.notes if one.column is not None else ():
                        text("p", f"{note}.", "small dim")
                    button("Remove", lambda: self.page.drop(name), small=True, quiet=True)

    def _drawings(self) -> None:
        raw("At rest and fully shortened,<br>one scale<br><span class='faint scale'></span>", "div", "k tall")
        for _, _, one, _ in self.columns:
            with box("div", "cell"):
                if one is None:
                    continue
                rest, fibre = one.rest_length, {"rest_length": one.rest_length, "fibre": True}
                shortest = float(drawings.column(one).values["shortest"]) * rest
                drawn = (drawn_muscle(one.spec) if one.unit is not None else fibre) | {
                    "shortest": shortest,
                    "full": from_si(one.full, "Pa", "bar"),
                    "area": one.section_area,
                }
                words = f"{with_unit(rest, 'm', 3)} at rest, {with_unit(shortest, 'm', 3)} fully shortened"
                packed = html.escape(json.dumps(drawn))
                raw(f'<canvas class="drawn" role="img" aria-label="{words}" data-muscle="{packed}"></canvas>')

    def _surfaces(self, surfaces: dict[str, drawings.Surface | None]) -> None:
        shown = [s for s in surfaces.values() if s is not None]
        scale = {
            "low": min((float(s.lengths[0]) for s in shown), default=0.6) - 0.04,
            "high": max((float(s.lengths[-1]) for s in shown), default=1.2) + 0.05,
            "top": max((float(s.tension.max()) * from_si(1.0, "N/m^2", "N/cm^2") for s in shown), default=1.0),
        }
        about = (
            '<b class="F">Tension</b> per section, N/cm\u00b2, over <b class="L">length</b> and <b class="P">pressure</b> '
            'or <b>activation</b><br><span class="faint">the same axes in all; point at one, or use the arrows</span>'
        )
        raw(about, "div", "k tall")
        for letter, (name, _, one, _) in zip(drawings.LETTERS, self.columns, strict=False):
            with box("div", "cell chartbox"):
                if one is not None:
                    raw(drawings.surface_markup(one, letter, surfaces[name], scale))
                    if (chart := drawings.surface_chart(one, surfaces[name])) is not None:
                        save_menu(chart.name, chart.figure)

    def _rows(self) -> None:
        known = [one.column for one in self.columns if one.column is not None]
        papers = [drawings.paper_values(c.name) if c is not None else {} for _, c, _, _ in self.columns]
        ends = [v for c in known for n in ("shortest", "longest") if (v := drawings.value_of(c, n))]
        low, high = min(ends, default=0.6) - 0.03, max(ends, default=1.2) + 0.03
        # the ends of the dynamic range share one row, efficiencies are at the side
        apart = ("shortest", "longest", "efficiency", "efficiency_accumulator")
        for row in (r for r in self.table.properties() if r.property.name not in apart):
            printed = [p.get(row.property.name) for p in papers]
            unit = row.property.unit.replace("L0", "L\u2080").replace("^2", "\u00b2").replace("^3", "\u00b3")
            unit = html.escape("" if unit == "1" else unit)
            raw(f"<span>{html.escape(row.property.title)}</span><span class='u'>{unit}</span>", "div", "k r")
            largest, place = drawings.largest_of(row, printed), 0  # among those that have values
            for one, paper in zip(self.columns, printed, strict=True):
                if one.column is None:
                    box("div", "r")
                    continue
                if row.property.name == "dynamic_range":
                    raw(drawings.range_bar(one.column, low, high, paper), "div", "r")
                else:
                    living = one.muscle is not None and one.muscle.fibre is not None
                    raw(drawings.bar(row, place, largest, paper, living), "div", "r")
                place += 1


def _short(title: str) -> str:
    """Start of a title, up to its first comma or of-phrase; of a biological muscle the kind of its fibres."""
    living, comma, kind = title.partition(", ")
    if living == "Biological muscle" and comma:
        return f"{kind[:1].upper()}{kind[1:]}"
    for stop in (",", " of ", " with "):
        title = title.split(stop)[0]
    return title.removesuffix(" muscle") if len(title) > 18 else title


# ---- dialogs: add a column, run the trials


def choose_column(page: ComparePage) -> None:
    """Build the list of muscles that are not shown; a click adds one."""
    dialog, recorded = Dialog("Add a column", "compare-dialog", "bd list", once=True), page.values == "recordings"

    def take(name: str) -> None:
        dialog.close()
        page.take(name)

    def offer(title: str, names: dict[str, str], none: str = "") -> None:
        if names or none:
            text("h3", title)
        for name, words in names.items():
            button(words, lambda n=name: take(n), quiet=True)
        if none and not names:
            text("p", none, "small dim")

    with dialog:
        if recorded:
            left = [n for n in page.workspace.recordings.names() if n.endswith(".nc") and n not in page.recordings][:60]
            offer("Recordings", {n: n.removesuffix(".nc") for n in left}, "There is no other recording.")
        kinds = {"mckibben": "McKibben muscles", "biological": "Biological muscles"}
        for kind in [*kinds][recorded:]:
            others = {s.id: s.title for s in specimens() if s.kind == kind and s.id not in page.muscles}
            offer(kinds[kind], others, "All of them are shown.")
        if not recorded:
            own = [n for n in page.workspace.specimens.names() if n not in page.muscles]
            offer("Your own", {n: n.removesuffix(".toml") for n in own})
            specimen_place(page.workspace.specimens, take)
    dialog.open()


def show_trials(page: ComparePage) -> None:
    """Show the isometric steps of the muscles, or a button that runs them."""
    page.step.clear()
    page.running.clear()
    if not page.shown:
        with page.step:
            text("p", "Protocols run on muscles, not on recordings: choose From the laws.", "small dim")
        return

    def begin() -> None:
        page.cancelled = False
        page.document.spawn(_run(page, _missing(page)))

    missing, chart = _missing(page), drawings.step_chart(page.shown)
    with page.step:
        if chart is not None:
            chart.show()
        elif missing:
            words = "isometric step and isokinetic shortening"
            empty(f"No muscle has run it yet: {words}, on the simulated machine.", "Run the protocols", begin)
    if chart is not None and missing:
        with page.running:
            button("Run the rest", begin, small=True)


def _missing(page: ComparePage) -> list[tuple[ComparedMuscle, str]]:
    every = [(one, name) for name in drawings.PROTOCOLS for _, one in page.shown]
    return [(one, name) for one, name in every if drawings.run_known(one, name) is None]


async def _run(page: ComparePage, missing: list[tuple[ComparedMuscle, str]]) -> None:
    """Run protocols one after the other; when cancelled, the running one is completed."""
    number = page.number
    for i, (one, name) in enumerate(missing):
        if page.cancelled or page.number != number:
            break
        _progress(page, f"{one.id}: {name}", i, len(missing))
        try:
            await asyncio.to_thread(drawings.run_of, one, name)
        except Exception as error:  # the page has to hear of it, whatever it is
            known = isinstance(error, MckibbenError)
            said = str(error) if known else f"the run failed: {type(error).__name__}: {str(error)[:200]}"
            say_refused(page.step, said)
            return
    if not page.gone and page.number == number:
        page.renew()


def _progress(page: ComparePage, words: str, done: int, total: int) -> None:
    def cancel() -> None:
        page.cancelled = True
        _progress(page, f"{words}; ends after it", done, total)

    page.running.clear()
    chart = drawings.step_chart(page.shown)
    page.step.clear()
    with page.step:
        if chart is not None:
            chart.show()
        with box("div", "running").set(role="status"):
            text("span", f"{words}, {done + 1} of {total}", "small")
            raw(f'<i style="width:{100.0 * (done + 0.5) / total:.0f}%" class="share"></i>', "div", "line")
            if not page.cancelled:
                button("Cancel", cancel, small=True)
