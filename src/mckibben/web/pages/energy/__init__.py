"""The Energy page: cycles of Part IV over the supply pressure, and the energy flow of recordings."""

from __future__ import annotations

import asyncio
import functools
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ....analysis.energy import READINGS
from ....analysis.energy.cycles import SETTINGS
from ....documents import JsonValue
from ....errors import InputError, MckibbenError
from ....quantities import from_si, with_unit
from ...charts import saveable
from ...elements import Element, page_document
from ...forms import InputField, accept, field, refusal, show_cautions
from ...transfers import download, run_in_thread, specimen_place
from ...widgets import Dialog, asked, box, button, link, page_frame, panel, raw, say_refused, segments, select, text
from ...workspace import Workspace
from .cycles import (
    LINKED,
    TITLES,
    EnergyChoice,
    curves,
    curves_key,
    cycle_document,
    cycle_report,
    described,
    efficiency_picture,
    from_link,
    loops_picture,
    muscles,
    to_link,
    with_muscle,
    working_cycle,
)
from .flow import LINKED_FLOW, RecordedFlow

if TYPE_CHECKING:
    from starlette.requests import Request


def build(workspace: Workspace, request: Request) -> None:
    """Build the page; slow parts follow when it is displayed."""
    words = asked(request, *LINKED, *LINKED_FLOW)
    sub = "Compressed air in, work out"
    with page_frame("energy", sub=sub, sheets=("energy.css",), scripts=("js/energy.js",)) as bar:
        place = box("div", "energy")

        def load() -> tuple[EnergyChoice, list[str], dict[str, str]]:
            own = workspace.specimens
            return *from_link({k: v for k, v in words.items() if k in LINKED}, own), muscles(own)

        async def begin() -> None:
            loaded = await run_in_thread(place, "Loading the muscles", load)
            if loaded is not None:
                await EnergyPage(workspace, words, bar, place, *loaded).show()

        page_document().when_connected(begin)


class EnergyPage:
    """The Energy page of one visitor."""

    def __init__(
        self,
        workspace: Workspace,
        words: dict[str, str],
        bar: Element,
        place: Element,
        choice: EnergyChoice,
        said: list[str],
        muscles: dict[str, str],
    ) -> None:
        self.workspace, self.words, self.bar, self.place, self.muscles = workspace, words, bar, place, muscles
        self.choice, self.good, self.said = choice, choice, said
        self.wish, self.busy = 0, False

    async def show(self) -> None:
        """Build the page, and compute for the first time."""
        with self.bar:
            self.list = box("div", "row")
            self._offer()
            button("Add muscle", self._add)
            button("Report", self._report)
        with self.place:
            self.controls = CycleControls(self)
            with box("div", "e-grid"):
                with panel("Air: pressure against volume", "gas in compressor and muscle") as head:
                    saveable(head, "Working cycle", lambda _: loops_picture(self.good))
                    self.piston = box("div", "e-piston e-draw")
                with panel("Muscle: tension against length", "the same cycle") as head:
                    saveable(head, "Working cycle", lambda _: loops_picture(self.good))
                    self.tendon = box("div", "e-tendon e-draw")
                with panel("Per cycle"):
                    self.numbers = box("div", "e-numbers")
                    with box("details", "values"):
                        text("summary", "Where the input goes")
                        self.losses = box("div", "e-losses scroll")
                with panel("Energy flow of the air", "exergy against the surroundings") as head:
                    self.recorded = RecordedFlow(self.workspace, self.words, head, self.bar, lambda: self.good)
                    saveable(head, "Energy flow", lambda _: self.recorded.picture())
                with panel("Efficiency over supply pressure") as head:
                    saveable(head, "Efficiency", lambda _: efficiency_picture(self.good))
                    self.curve = box("div", "e-curve e-draw")
        if self.said:
            say_refused(self.controls.under, " ".join(self.said))
        self.recorded.begin()
        await self.draw()

    def _offer(self) -> None:
        self.list.clear()
        names = self.muscles
        if self.choice.muscle not in names:  # chosen by its name, though it has no volume
            names = {self.choice.muscle: self.choice.muscle} | names
        with self.list:
            select(names, self.choice.muscle, self._choose, "Muscle")

    def _choose(self, name: str) -> None:
        try:
            self.choice = with_muscle(self.choice, name, self.workspace.specimens)
        except MckibbenError as error:
            say_refused(self.controls.under, f"{error}. The previous choice stays in use.")
            self._offer()
            return
        self.changed()

    def _add(self) -> None:
        async def take(name: str) -> None:
            dialog.close()
            self.muscles = await asyncio.to_thread(muscles, self.workspace.specimens)
            with self.bar:
                self._choose(name)
                self._offer()

        with (dialog := Dialog("Add a muscle", once=True)):
            specimen_place(self.workspace.specimens, take)
        dialog.open()

    def changed(self, **what: JsonValue) -> None:
        """Take a changed choice, and compute and show it in a task."""
        self.choice = replace(self.choice, **what)
        if "pressure" not in what:  # a slider that is dragged would tell the browser too often
            link(**to_link(self.choice))  # at once, for whoever reloads the page meanwhile
        self.controls.under.clear()
        page_document().spawn(self.draw())

    async def draw(self) -> None:
        """Compute and show the newest choice; superseded ones are skipped."""
        # of a slider that is dragged many choices come while one is computed: one at a time, and then the newest
        self.wish += 1
        if self.busy:
            return
        self.busy = True
        try:
            done = 0
            with self.bar:  # whatever was clicked may be gone by then
                while done != self.wish:
                    done = self.wish
                    await self._once(self.choice)
        finally:
            self.busy = False

    async def _once(self, choice: EnergyChoice) -> None:
        try:
            document = await asyncio.to_thread(cycle_document, choice)
            lines = await asyncio.to_thread(curves, curves_key(choice))
        except MckibbenError as error:
            if choice == self.choice:
                self.choice = self.good
                link(**to_link(self.good))
                self._offer()
                self.controls.restore()
                say_refused(self.controls.under, f"{error}. The previous choice stays in use.")
            return
        self.good, muscle = choice, choice.muscle != self.good.muscle or choice.law != self.good.law
        for place, part in (
            (self.piston, document),
            (self.tendon, document),
            (self.numbers, document),
            (self.losses, document),
            (self.curve, lines | {k: document[k] for k in ("pressure", "exchange", "efficiency", "other_efficiency")}),
        ):
            place.data("spec", part)
        self.controls.agree(rebuilt=muscle)
        show_cautions(working_cycle(choice).cautions, self.controls.fields, self.controls.remarked)
        if choice == self.choice:
            link(**to_link(choice))
        self.recorded.accumulator_changed()

    async def _report(self) -> None:
        page = await run_in_thread(self.controls.under, "Writing the report", cycle_report, self.good)
        if page is not None:
            download(f"energy-{Path(self.good.muscle).stem}-{self.good.cycle}.html", page)


LOW, HIGH, STEP = 1.0, 10.0, 0.1  # of the slider [bar]
SIGN = (
    '<svg class="key" width="26" height="12" viewBox="0 0 26 12" aria-hidden="true"><path d="M0 6H26" '
    'stroke="var(--q-pressure)" stroke-width="2"/><circle cx="13" cy="6" r="3.4" fill="var(--q-pressure)" '
    'stroke="var(--panel)" stroke-width="1.2"/></svg>'
)
VOLUMES = {"": "Volume as usual", "paper": "Volume of eq. 38b", "potential": "Volume of the law"}
WORDS = {"printed": "Friction in the output only", "throughout": "Friction throughout"}


class CycleControls:
    """Controls of the working cycle.

    Attributes:
        fields: by the name of the parameter.
        under: place below the controls, of what was refused.
        remarked: place of cautions that are about none of the fields.
    """

    def __init__(self, view: EnergyPage) -> None:
        self.view, self.again = view, False
        self.refused = ""  # pressure that was typed and refused
        self.fields: dict[str, InputField] = {}
        with box("section", "panel supply").set(aria_label="Cycle"):
            self._pressure()
            self.choices = box("div").style(display="contents")
        self.more = box("details", "panel conditions")
        self.under, self.remarked = box("div", "e-under"), box("div", "e-under e-about")
        self.rebuild()

    def rebuild(self) -> None:
        """Rebuild the controls from the choice; a pressure that is being typed stays."""
        self.again = False
        self.choices.clear()
        self.more.clear()
        with self.choices:
            self._choices()
        with self.more:
            self._conditions()
        if self.refused:
            self.entered(self.refused)  # by the muscle of now

    def restore(self) -> None:
        """Show the previous choice again."""
        self.rebuild()
        if not self.refused:
            pressure = from_si(self.view.choice.pressure, "Pa", "bar")
            self.track.set(data_spec=json.dumps(pressure))
            self.fields["pressure"].show(f"{pressure:.6g}")

    def agree(self, *, rebuilt: bool) -> None:
        """Update the controls to the present choice."""
        if rebuilt or self.again:
            self.rebuild()
        self._say_conditions()

    # ---- pressure

    def _pressure(self) -> None:
        value = from_si(self.view.choice.pressure, "Pa", "bar")
        raw(f"{SIGN}Supply pressure", "label", "P lead").set(for_="supply-pressure")
        with box("div", "tr P") as self.track:
            box("i")
            dragged = box("input").set(
                id="supply-pressure",
                type="range",
                min=LOW,
                max=f"{max(HIGH, value):g}",
                step=STEP,
                value=f"{value:g}",
                aria_label="Supply pressure, bar",
            )
        self.track.set(data_spec=json.dumps(value))
        dragged.on_value("input", self._dragged, wait=0.08)
        self.fields["pressure"] = InputField(
            "",
            f"{value:.6g}",
            self.entered,
            name="supply",
            unit="bar",
            called="Supply pressure",
            classes="number",
            edge="field P",
            said="said pop",
        )
        self.fields["pressure"].input.set(inputmode="decimal")

    def _dragged(self, given: object) -> None:
        value = float(str(given))
        if self.refused:  # else the browser has the number already
            self.refused = ""
            self.fields["pressure"].refuse("")
        self.fields["pressure"].show(f"{value:.6g}")
        self.view.changed(pressure=min(max(value, LOW), max(HIGH, value)) * 1e5 if value == value else 5e5)

    def entered(self, words: str) -> None:
        """Read a typed pressure; an error is shown beside the field."""
        choice = self.view.choice
        try:
            pressure = accept("pressure", words[:60], SETTINGS["pressure"])
            working_cycle(replace(choice, pressure=pressure))
        except MckibbenError as error:
            self.refused = words[:60]
            why = refusal(error, f"{from_si(choice.pressure, 'Pa', 'bar'):.6g}")
            self.fields["pressure"].refuse(why, self.refused)
            return
        self.refused, bar = "", from_si(pressure, "Pa", "bar")
        self.fields["pressure"].refuse("", f"{bar:.6g}")
        self.track.set(data_spec=json.dumps(bar))
        self.view.changed(pressure=pressure)

    # ---- the rest

    def _choices(self) -> None:
        choice, go = self.view.choice, self.view.changed
        own = choice.friction or described(choice).conditions.friction
        segments(TITLES, choice.cycle, lambda v: go(cycle=v), "Cycle")
        ends = {"atmosphere": "Atmosphere", "accumulator": "Accumulator"}
        segments(ends, choice.exchange, lambda v: go(exchange=v), "Exchange")
        rubs = {"as": f"Friction {own:g}\u2009\u2060N", "none": "None"} if own else {"none": "No friction"}
        pressed = "none" if choice.friction == 0.0 or not own else "as"
        usual = own if choice.friction not in (None, 0.0) else None
        segments(rubs, pressed, lambda v: go(friction=0.0 if v == "none" else usual), "Friction")

    def _conditions(self) -> None:
        choice, go = self.view.choice, self.view.changed
        self.line = text("summary", "Conditions")
        usual = described(choice)
        own = {
            "stretched_length": usual.conditions.stretched_length,
            "accumulator_pressure": usual.threshold,
            "friction": usual.conditions.friction,
        }
        with box("div", "bd form"):
            for name, value in own.items():
                chosen = getattr(choice, name)
                change = functools.partial(self._set, name)
                self.fields[name] = field(name, SETTINGS[name], value if chosen is None else chosen, change)
            self.fields["stretched length"] = self.fields["stretched_length"]  # as cautions call it
            with box("div", "row wrap"):
                if len(usual.specimen.laws) > 1:
                    names = {n: n.replace("_", " ") for n in usual.specimen.laws}
                    select(names, usual.law, lambda v: go(law=v, volume=""), "Law")
                volumes = {v: VOLUMES[v] for v in sorted(usual.muscles)}
                select(volumes, usual.volume, lambda v: go(volume=v), "Volume of the gas")
                readings = {r: WORDS[r] for r in READINGS}
                select(readings, choice.reading, lambda v: go(reading=v), "Reading of the isotonic cycles")
        self._say_conditions()

    def _set(self, name: str, value: float) -> None:
        """Set a condition; if no cycle is possible, show why and keep the old value."""
        choice = self.view.choice
        working_cycle(replace(choice, **{name: value}))  # type: ignore[arg-type]
        if name == "accumulator_pressure" and value >= choice.pressure:
            raise InputError(name, None, f"must be below the pressure of the supply, got {value / 100000.0:g} bar")
        self.again = name == "friction"  # which the bar shows too
        self.view.changed(**{name: value})

    def _say_conditions(self) -> None:
        try:
            computed = working_cycle(self.view.choice)
        except MckibbenError:
            return
        c = computed.conditions
        around = with_unit(float(c.ambient.pressure_abs), "Pa", 5)
        words = f"Conditions: begins at {with_unit(c.stretched_length, 'm')}, surroundings {around}"
        self.line.say(f"{words}, {VOLUMES[computed.volume].lower()}")
