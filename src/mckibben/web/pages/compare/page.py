"""Elements of the Compare page: a column per muscle, charts at the side."""

from __future__ import annotations

import asyncio
import html
import json
from pathlib import Path
from typing import Any

from ....documents import JsonValue
from ....errors import InputError, MckibbenError
from ....muscles.plausible import pressure_caution
from ....quantities import Quantity, from_si, parse, with_unit
from ....specimens import specimen, specimens
from ....studies.comparison import FULL_PRESSURE, ComparedMuscle, MuscleColumn
from ... import forms
from ...elements import page_document
from ...save import save_menu
from ...specimen_files import specimen_place
from ...transfers import download
from ...widgets import Dialog, box, button, empty, link, loading, page_frame, panel, raw, refused, segments, tell, text
from ...workspace import Workspace
from ..bench import drawing
from . import drawings, jobs
from .stimulation import StimulationPanel

PRESSURE = Quantity(
    "Pa", (0.0, 1e8), "gauge pressure that counts as the full drive of McKibben muscles", "P", (1e5, 8e5)
)


class ComparePage:
    """The Compare page of one visitor.

    Args:
        workspace: state of the server.
        view: parameters of the address.
    """

    def __init__(self, workspace: Workspace, view: dict[str, str]) -> None:
        self.workspace = workspace
        self.muscles = _words(view.get("muscles", ",".join(jobs.FIRST)))[: jobs.MOST]
        self.values = view.get("values", "laws") if view.get("values") in ("laws", "recordings") else "laws"
        self.recordings = _words(view["recordings"])[: jobs.MOST] if "recordings" in view else self._newest()
        self.pressure, self.said = FULL_PRESSURE, ""
        self.cancelled, self.number, self.gone = False, 0, False
        self.typed_pressures = 0  # count of the pressures that were typed
        self.subjects: dict[str, ComparedMuscle] = {}
        if "pressure" in view:
            try:
                self.pressure = parse(view["pressure"], "Pa", field="pressure")
                PRESSURE.check("pressure", self.pressure)
            except InputError as error:
                self.said, self.pressure = str(error), FULL_PRESSURE

    def _newest(self) -> list[str]:
        return [n for n in self.workspace.recordings.names() if n.endswith(".nc")][:3]

    def build(self) -> None:
        """Build the page; the numbers follow."""
        sub = "Muscles side by side, at full drive, per resting length L\u2080 and section"
        with page_frame("compare", sub=sub, sheets=("compare.css",), scripts=("js/compare.js",)) as bar:
            with bar:
                self._full_drive()
                names = {"laws": "From the laws", "recordings": "From recordings"}
                segments(names, self.values, self._source, "Values")
                button("Add muscle", lambda: choose_column(self))
                button("Export table", self._export)
            self.refusal = box("div", "compare-said")
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
            self._say(self.said)
        self.table: Any = None
        self.renew()

    def _leave(self) -> None:
        self.gone = self.cancelled = True
        self.number += 1

    def _full_drive(self) -> None:
        with box("label", "row full-drive"):
            text("span", "Full drive", "small P")
            with box("div", "field") as self.edge:
                shown = forms.shown(self.pressure, PRESSURE)
                self.typed = box("input").set(value=shown, inputmode="decimal", aria_label="Full drive, bar", size="5")
                self.typed.set(title=PRESSURE.doc)
                text("span", "bar", "u")
        self.typed.on_value("change", lambda value: self._drive(str(value)[:80]))

    # ---- what a person does

    async def _drive(self, words: str) -> None:
        self.typed_pressures += 1
        number = self.typed_pressures
        accepted = forms.accept("pressure", words, PRESSURE, self.pressure)
        why = accepted.said
        if not why:
            try:
                await asyncio.to_thread(self._subjects, accepted.value)
            except MckibbenError as error:
                why = f"{error}. The old value, {forms.shown(self.pressure, PRESSURE)}, stays in use."
        if number != self.typed_pressures:
            return  # another one was typed meanwhile
        self.edge.classed("bad", bool(why))
        self.typed.set(aria_invalid="true" if why else "false")
        self.refusal.clear()
        if why:
            self._say(why)
            return
        self.pressure = accepted.value
        caution = pressure_caution(accepted.value, text=words)
        if caution is not None:
            self._say(f"{str(caution)[0].upper()}{str(caution)[1:]}.")
        self.renew()

    def _source(self, value: str) -> None:
        self.values = value
        self.renew()

    def take(self, name: str) -> None:
        """Add a column, or replace the choice of a list."""
        chosen = self.recordings if self.values == "recordings" and name.endswith(".nc") else self.muscles
        if name not in chosen:
            if len(chosen) >= jobs.MOST:
                self._say(f"There can be at most {jobs.MOST} columns")
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
            return
        download("comparison.csv", jobs.exported(self.table))

    def _say(self, words: str) -> None:
        self.refusal.clear()
        with self.refusal:
            refused(words)

    # ---- what is computed

    def path(self, name: str) -> str | Path:
        """Path of the specimen, or of the visitor's file, named by a value of the link."""
        return (
            self.workspace.specimens.found(name) if name.endswith(".toml") else name.replace("/", "").replace("\\", "")
        )

    def _subjects(self, pressure: float) -> dict[str, ComparedMuscle]:
        return {n: jobs.subject_of(self.path(n), pressure) for n in self.muscles}

    def renew(self) -> None:
        """Compute and show the present columns."""
        self.number += 1
        number = self.number
        link(
            muscles=",".join(self.muscles) or "none",
            values=None if self.values == "laws" else self.values,
            recordings=",".join(self.recordings) if self.values == "recordings" else None,
            pressure=None if self.pressure == FULL_PRESSURE else with_unit(self.pressure, "Pa", 12),
        )
        if self.table is None:
            self._wait("", 0)
        self.document.spawn(self._follow(number))

    def _wait(self, name: str, done: int) -> None:
        self.main.clear()
        with self.main, loading(f"Computing Table 1{': ' if name else ''}{name}", done / max(len(self.muscles), 1)):
            pass

    async def _follow(self, number: int) -> None:
        try:
            if self.table is None and self.values == "laws":
                for i, name in enumerate(self.muscles):
                    self._wait(name, i)
                    await asyncio.to_thread(self._warm, name)
                    if number != self.number:
                        return
            result = await asyncio.to_thread(self._computed)
        except Exception as error:  # the page has to hear of it, whatever it is
            known = isinstance(error, MckibbenError)
            said = str(error) if known else f"the comparison failed: {type(error).__name__}: {str(error)[:200]}"
            if number == self.number:
                self.main.clear()
                with self.main:
                    refused(said)
            return
        if number == self.number:
            self._show(*result)

    def _warm(self, name: str) -> None:
        try:
            one = jobs.subject_of(self.path(name), self.pressure)
            jobs.column(one)
            jobs.over_velocity(one)
        except MckibbenError:
            pass  # said in its column

    def _computed(
        self,
    ) -> tuple[list[tuple[str, MuscleColumn | None, ComparedMuscle | None, str]], dict[str, JsonValue]]:
        """Compute every column with its muscle, or the reason why there is none; and the curves."""
        columns: list[tuple[str, MuscleColumn | None, ComparedMuscle | None, str]] = []
        biological = self.values == "recordings"
        for name in self.recordings if biological else []:
            try:
                columns.append((name, jobs.recorded(self.workspace.recordings.found(name)), None, ""))
            except MckibbenError as error:
                said = str(error).replace(f"{self.workspace.recordings.folder}/", "")
                columns.append((name, None, None, said))
        for name in self.muscles:
            try:
                if biological and (name.endswith(".toml") or specimen(name).kind != "biological"):
                    continue
                one = jobs.subject_of(self.path(name), self.pressure)
                columns.append((name, jobs.with_runs(one, jobs.column(one)), one, ""))
            except MckibbenError as error:
                columns.append((name, None, None, str(error)))
        more: dict[str, Any] = {"surfaces": {n: jobs.surface(s) for n, _, s, _ in columns if s is not None}}
        for _, _, muscle, _ in columns:
            if muscle is not None:
                jobs.over_velocity(muscle)
        more["loops"] = []
        for name, column, muscle, _ in columns:
            if column is not None and muscle is None:
                more["loops"].append((name, jobs.loop_of(self.workspace.recordings.found(name))))
        return columns, more

    # ---- what is shown

    def _show(
        self, columns: list[tuple[str, MuscleColumn | None, ComparedMuscle | None, str]], more: dict[str, JsonValue]
    ) -> None:
        self.main.clear()
        known = [c for _, c, _, _ in columns if c is not None]
        self.table = jobs.table(known)
        with self.main:
            if not columns:
                if self.values == "recordings":
                    empty(
                        "No recordings yet. Start a run on the bench, or drop a file on Recordings.",
                        "Go to the bench",
                        "/",
                    )
                else:
                    empty("No muscles to compare.", "Add muscle", lambda: choose_column(self))
            else:
                ComparisonGrid(self, columns).show(more["surfaces"])
        self.shown = [(drawings.LETTERS[i], one) for i, (_, _, one, _) in enumerate(columns) if one is not None]
        self.side(more["loops"], columns)

    def side(self, loops: Any = (), columns: Any = None) -> None:
        """Build the charts."""
        self.velocity.clear()
        with self.velocity:
            if loops:
                letters = {n: drawings.LETTERS[i] for i, (n, _, _, _) in enumerate(columns)}
                drawings.loops_chart([(f"{letters[n]} {Path(n).stem}", xy) for n, xy in loops]).show()
            if self.shown:
                drawings.velocity_chart(self.shown).show()
        show_trials(self)
        self.stimulation.show([one for _, one in self.shown])
        if columns is not None:
            self.letters = [drawings.LETTERS[i] for i, c in enumerate(columns) if c[1] is not None]
        names = [c.name for c in self.table.columns]
        full = self.pressure == FULL_PRESSURE and "nylon" in names and self.values == "laws"
        self.energy.clear()
        with self.energy:
            raw(drawings.efficiencies(self.table, self.letters, full))


def _words(text_: str) -> list[str]:
    return list(dict.fromkeys(w for w in text_.split(",") if w and w != "none"))


# ---- the table of columns


class ComparisonGrid:
    """Table of one page.

    Args:
        face: the page, which moves and drops columns.
        columns: word of the link, column, muscle where it is one by its law, and why there is no column.
    """

    def __init__(
        self, face: ComparePage, columns: list[tuple[str, MuscleColumn | None, ComparedMuscle | None, str]]
    ) -> None:
        self.face, self.columns = face, columns

    def show(self, surfaces: dict[str, JsonValue]) -> None:
        """Build all of it, within the open element."""
        columns, count = self.columns, len(self.columns)
        with box("div", "cmp").style(**{"--columns": str(count)}):
            box("div", "k head")
            for i, (name, column, one, _) in enumerate(columns):
                self._head(drawings.LETTERS[i], name, column, one)
            bad = {i: said for i, (_, column, _, said) in enumerate(columns) if column is None}
            if bad:
                box("div", "k")
                for i in range(count):
                    with box("div", "cell"):
                        if i in bad:
                            refused(bad[i])
            if any(one is not None for _, _, one, _ in columns):
                self._drawings(columns)
                self._surfaces(columns, surfaces)
            self._rows(columns)

    def _head(self, letter: str, name: str, column: MuscleColumn | None, one: ComparedMuscle | None) -> None:
        with box("div", "ch"):
            text("span", letter, "ab")
            title = one.spec.title if one is not None else Path(name).stem
            text("span", _short(title), "title").set(title=title)
            with box("details", "more"):
                raw("\u22ef", "summary", "btn s q").set(aria_label=f"More about {_short(title)}")
                with box("div", "menu-list"):
                    button("Move left", lambda: self.face.move(name, -1), small=True, quiet=True)
                    button("Move right", lambda: self.face.move(name, 1), small=True, quiet=True)
                    if one is not None and one.unit is not None and not name.endswith(".toml"):
                        text("a", "Use on the bench", "btn s q").set(href=f"/?muscle={one.id}")
                    for note in column.notes if column is not None else ():
                        text("p", f"{note}.", "small dim")
                    button("Remove", lambda: self.face.drop(name), small=True, quiet=True)

    def _drawings(self, columns: Any) -> None:
        raw("At rest and fully shortened,<br>one scale<br><span class='faint scale'></span>", "div", "k tall")
        for _, _, one, _ in columns:
            if one is None:
                box("div", "cell")
                continue
            shortest = float(jobs.column(one).values["shortest"])
            spec = (
                drawing.plain(one.spec) if one.unit is not None else {"rest_length": one.rest_length, "fibre": True}
            ) | {
                "shortest": shortest * one.rest_length,
                "full": from_si(one.full, "Pa", "bar"),
                "area": one.section_area,
            }
            with box("div", "cell"):
                words, packed = html.escape(drawings.sizes(one)), html.escape(json.dumps(spec))
                raw(f'<canvas class="drawn" role="img" aria-label="{words}" data-muscle="{packed}"></canvas>')

    def _surfaces(self, columns: Any, surfaces: dict[str, JsonValue]) -> None:
        shown = [s for s in surfaces.values() if s is not None]
        scale = {
            "low": min((float(s.lengths[0]) for s in shown), default=0.6) - 0.04,
            "high": max((float(s.lengths[-1]) for s in shown), default=1.2) + 0.05,
            "top": max((float(s.tension.max()) * from_si(1.0, "N/m^2", "N/cm^2") for s in shown), default=1.0),
        }
        raw(
            '<b class="F">Tension</b> per section, N/cm\u00b2, over <b class="L">length</b> and '
            '<b class="P">pressure</b> or <b>activation</b><br><span class="faint">the same axes in all; point at one, or '
            "use the arrows</span>",
            "div",
            "k tall",
        )
        for i, (name, _, one, _) in enumerate(columns):
            with box("div", "cell chartbox"):
                if one is not None:
                    raw(drawings.surface_markup(one, drawings.LETTERS[i], surfaces[name], scale))
                    if (chart := drawings.surface_chart(one, surfaces[name])) is not None:
                        save_menu(chart.name, chart.figure)

    def _rows(self, columns: Any) -> None:
        place = {id(c): i for i, c in enumerate(c for _, c, _, _ in columns if c is not None)}
        papers = [jobs.paper_values(c.name) if c is not None else {} for _, c, _, _ in columns]
        ends = [
            v for _, c, _, _ in columns if c is not None for n in ("shortest", "longest") if (v := jobs.value_of(c, n))
        ]
        low, high = min(ends, default=0.6) - 0.03, max(ends, default=1.2) + 0.03
        for row in jobs.shown_rows(self.face.table):
            known = [p.get(row.property.name) for p in papers]
            unit = row.property.unit.replace("L0", "L\u2080").replace("^2", "\u00b2").replace("^3", "\u00b3")
            unit = html.escape("" if unit == "1" else unit)
            shown = html.escape("" if unit == "1" else unit)
            raw(f"<span>{html.escape(row.property.title)}</span><span class='u'>{shown}</span>", "div", "k r")
            largest = drawings.largest_of(row, known)
            for i, (_, column, _, _) in enumerate(columns):
                if column is None:
                    box("div", "r")
                elif row.property.name == "dynamic_range":
                    raw(drawings.range_bar(column, low, high, known[i]), "div", "r")
                else:
                    one = columns[i][2]
                    living = one is not None and one.fibre is not None
                    raw(drawings.bar(row, place[id(column)], largest, known[i], living), "div", "r")


def _short(title: str) -> str:
    """Start of a title, up to its first comma or of-phrase; of a biological muscle the kind of its fibres."""
    living, comma, kind = title.partition(", ")
    if living == "Biological muscle" and comma:
        return f"{kind[:1].upper()}{kind[1:]}"
    for stop in (",", " of ", " with "):
        title = title.split(stop)[0]
    return title.removesuffix(" muscle") if len(title) > 18 else title


# ---- dialogs: add a column, run the trials


def choose_column(face: ComparePage) -> None:
    """Build the list of muscles that are not shown; a click adds one."""
    dialog = Dialog("Add a column", "compare-dialog", "bd list", once=True)

    def take(name: str) -> None:
        dialog.close()
        face.take(name)

    with dialog:
        if face.values == "recordings":
            text("h3", "Recordings")
            left = [n for n in face.workspace.recordings.names() if n.endswith(".nc") and n not in face.recordings][:60]
            for name in left:
                button(name.removesuffix(".nc"), lambda n=name: take(n), quiet=True)
            if not left:
                text("p", "There is no other recording.", "small dim")
        kinds = {"mckibben": "McKibben muscles", "biological": "Biological muscles"}
        for kind, title in kinds.items():
            if face.values == "recordings" and kind == "mckibben":
                continue
            text("h3", title)
            others = [s for s in specimens() if s.kind == kind and s.id not in face.muscles]
            for spec in others:
                button(spec.title, lambda n=spec.id: take(n), quiet=True)
            if not others:
                text("p", "All of them are shown.", "small dim")
        own_files = [n for n in face.workspace.specimens.names() if n not in face.muscles]
        if own_files and face.values == "laws":
            text("h3", "Your own")
            for name in own_files:
                button(name.removesuffix(".toml"), lambda n=name: take(n), quiet=True)
        if face.values == "laws":
            specimen_place(face.workspace.specimens, take)
    dialog.open()


def show_trials(face: ComparePage) -> None:
    """Show the isometric steps of the muscles, or a button that runs them."""
    face.step.clear()
    face.running.clear()
    if not face.shown:
        with face.step:
            text("p", "Protocols run on muscles, not on recordings: choose From the laws.", "small dim")
        return
    missing = [(s, n) for _, s in face.shown for n in jobs.PROTOCOLS if jobs.run_known(s, n) is None]
    chart = drawings.step_chart(face.shown)
    with face.step:
        if chart is not None:
            chart.show()
        elif missing:
            words = "isometric step and isokinetic shortening"
            empty(
                f"No muscle has run it yet: {words}, on the simulated machine.",
                "Run the protocols",
                lambda: begin(face),
            )
    if chart is not None and missing:
        with face.running:
            button("Run the rest", lambda: begin(face), small=True)


def begin(face: ComparePage) -> None:
    """Run the missing protocols one after the other; when cancelled, the running one is completed."""
    face.cancelled = False
    face.document.spawn(_run(face))


async def _run(face: ComparePage) -> None:
    todo = [(s, n) for n in jobs.PROTOCOLS for _, s in face.shown if jobs.run_known(s, n) is None]
    number = face.number
    for i, (one, name) in enumerate(todo):
        if face.cancelled or face.number != number:
            break
        _progress(face, f"{one.id}: {name}", i, len(todo))
        try:
            await asyncio.to_thread(jobs.run_of, one, name)
        except MckibbenError as error:
            face.step.clear()
            with face.step:
                refused(str(error))
            return
        except Exception as error:  # the page has to hear of it
            face.step.clear()
            with face.step:
                refused(f"the run failed: {type(error).__name__}: {str(error)[:200]}")
            return
    if not face.gone and face.number == number:
        face.renew()


def _progress(face: ComparePage, words: str, done: int, total: int) -> None:
    def cancel() -> None:
        face.cancelled = True
        _progress(face, f"{words}; ends after it", done, total)

    face.running.clear()
    chart: Any = drawings.step_chart(face.shown)
    face.step.clear()
    with face.step:
        if chart is not None:
            chart.show()
        with box("div", "running").set(role="status"):
            text("span", f"{words}, {done + 1} of {total}", "small")
            raw(f'<i style="width:{100.0 * (done + 0.5) / total:.0f}%" class="share"></i>', "div", "line")
            if not face.cancelled:
                button("Cancel", cancel, small=True)
