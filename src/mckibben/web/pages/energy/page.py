"""The Energy page of one visitor: header, panels, and the newest choice, computed in a thread."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import json
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ....analysis.energy import READINGS
from ....analysis.energy.cycles import SETTINGS
from ....documents import JsonValue
from ....errors import InputError, MckibbenError
from ....quantities import from_si, with_unit
from ....report.figures.energy_figures import energy_flow_figure
from ...elements import Element, page_document
from ...forms import accept, field
from ...save import saveable
from ...shelf import Shelf
from ...specimen_files import specimen_place
from ...transfers import IncomingFile, UploadPlace, download, run_in_thread
from ...widgets import Dialog, box, button, empty, link, panel, raw, refused, segments, select, text
from ...workspace import Workspace
from .cycles import TITLES, curves, curves_key, cycle_document, cycle_report, efficiency_picture, loops_picture
from .flow import account, cycle_names, flow_document, stretch
from .state import LINKED, EnergyChoice, conditions, described, from_link, muscles, to_link, with_muscle

if TYPE_CHECKING:
    from ....report.figures.page_charts import Figure


async def begin(workspace: Workspace, words: dict[str, str], bar: Element, place: Element) -> None:
    """Load the computing modules, then build the page."""
    loaded = await run_in_thread(place, "Loading the muscles", _loaded, words, workspace.specimens)
    if loaded is not None:
        await EnergyPage(workspace, words, bar, place, *loaded).show()


def _loaded(words: dict[str, str], own: Shelf) -> tuple[EnergyChoice, list[str], dict[str, str]]:

    choice, said = from_link({k: v for k, v in words.items() if k in LINKED}, own)
    return choice, said, muscles(own)


class EnergyPage:
    """The Energy page of one visitor.

    Args:
        workspace: state of the server.
        words: words of the link.
        bar: place of the buttons in the heading.
        place: place of all below.
        choice: the choice of the link.
        said: messages about refused values.
        muscles: id and title of those that can be chosen.
    """

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
            self.offer()
            button("Add muscle", self.add)
            button("Report", self.report)
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
                    self.recorded = RecordedFlow(self, head)
                    saveable(head, "Energy flow", lambda _: self.recorded.picture())
                with panel("Efficiency over supply pressure") as head:
                    saveable(head, "Efficiency", lambda _: efficiency_picture(self.good))
                    self.curve = box("div", "e-curve e-draw")
        if self.said:
            self.controls.refuse(" ".join(self.said))
        self.recorded.begin()
        await self.draw()

    def offer(self) -> None:
        """List the muscles; the chosen one is among them."""
        self.list.clear()
        names = self.muscles
        if self.choice.muscle not in names:
            names = {self.choice.muscle: self.choice.muscle} | names
        with self.list:
            select(names, self.choice.muscle, self.choose, "Muscle")

    def choose(self, name: str) -> None:
        """Take another muscle; one that is not there any more is refused."""
        try:
            self.choice = with_muscle(self.choice, name, self.workspace.specimens)
        except MckibbenError as error:
            self.controls.refuse(f"{error}. The previous choice stays in use.")
            self.offer()
            return
        self.changed()

    def add(self) -> None:
        """Ask for a specimen file, and choose it."""

        async def take(name: str) -> None:
            dialog.close()
            self.muscles = await asyncio.to_thread(muscles, self.workspace.specimens)
            with self.bar:
                self.choose(name)
                self.offer()

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
                self.offer()
                self.controls.restore()
                self.controls.refuse(f"{error}. The previous choice stays in use.")
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
        if choice == self.choice:
            link(**to_link(choice))
        self.recorded.accumulator_changed()

    async def report(self) -> None:
        """Download the report of the shown cycle."""
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


class CycleControls:
    """Controls of the working cycle."""

    def __init__(self, view: EnergyPage) -> None:
        self.view, self.again = view, False
        self.refused = ""  # pressure that was typed and refused
        with box("section", "panel supply").set(aria_label="Cycle"):
            self._pressure()
            self.choices = box("div").style(display="contents")
        self.more = box("details", "panel conditions")
        self.under = box("div", "e-under")
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
            self.typed.set(value=f"{pressure:.6g}")

    def refuse(self, sentence: str) -> None:
        """Show why an action was refused."""
        self.under.clear()
        with self.under:
            refused(sentence)

    def agree(self, *, rebuilt: bool) -> None:
        """Update the controls to the present choice."""
        if rebuilt or self.again:
            self.rebuild()
        self._say_conditions()

    # ---- pressure

    def _pressure(self) -> None:
        choice = self.view.choice
        value = from_si(choice.pressure, "Pa", "bar")
        high = max(HIGH, value)
        raw(f"{SIGN}Supply pressure", "label", "P lead").set(for_="supply-pressure")
        self.track = box("div", "tr P")
        with self.track:
            box("i")
            dragged = box("input").set(
                id="supply-pressure",
                type="range",
                min=LOW,
                max=f"{high:g}",
                step=STEP,
                value=f"{value:g}",
                aria_label="Supply pressure, bar",
            )
        self.track.set(data_spec=json.dumps(value))
        dragged.on_value("input", self.dragged, wait=0.08)
        with box("div", "number"):
            with box("div", "field P") as self.edge:
                self.typed = box("input").set(
                    value=f"{value:.6g}",
                    inputmode="decimal",
                    aria_label="Supply pressure",
                    aria_describedby="supply-said",
                )
                text("span", "bar", "u")
            self.said = box("div", "said").set(id="supply-said")
        self.typed.on_value("change", self.entered)

    def dragged(self, given: object) -> None:
        """Take the position of the slider."""
        value = float(str(given))
        if self.refused:  # else the browser has the number already
            self.refusal("", f"{value:.6g}")
        self.typed.set(value=f"{value:.6g}")
        self.view.changed(pressure=min(max(value, LOW), max(HIGH, value)) * 1e5 if value == value else 5e5)

    def entered(self, words: object) -> None:
        """Read a typed number; an error is shown beside the field."""
        choice = self.view.choice
        accepted = accept("pressure", str(words)[:60], SETTINGS["pressure"], choice.pressure)
        why = accepted.said
        if not why:
            try:
                conditions(_with(choice, pressure=accepted.value))
            except MckibbenError as error:
                why = f"{error}. The old value, {from_si(choice.pressure, 'Pa', 'bar'):.6g}, stays in use."
        self.refusal(why, str(words)[:60] if why else f"{from_si(accepted.value, 'Pa', 'bar'):.6g}")
        if not why:
            self.track.set(data_spec=json.dumps(from_si(accepted.value, "Pa", "bar")))
            self.view.changed(pressure=accepted.value)

    def refusal(self, why: str, words: str) -> None:
        """Show below a number why it was refused, and keep the text for correction."""
        self.said.clear()
        self.refused = words if why else ""
        self.typed.set(value=words)
        self.edge.classed("bad", bool(why))
        self.typed.set(aria_invalid="true" if why else "false")
        if why:
            with self.said:
                refused(why)

    # ---- the rest

    def _choices(self) -> None:
        choice, go = self.view.choice, self.view.changed
        own = choice.friction or described(choice).conditions.friction
        segments(TITLES, choice.cycle, lambda v: go(cycle=v), "Cycle")
        segments(
            {"atmosphere": "Atmosphere", "accumulator": "Accumulator"},
            choice.exchange,
            lambda v: go(exchange=v),
            "Exchange",
        )
        rubs = {"as": f"Friction {own:g}\u2009\u2060N", "none": "None"} if own else {"none": "No friction"}
        pressed = "none" if choice.friction == 0.0 or not own else "as"
        usual = own if choice.friction not in (None, 0.0) else None
        segments(rubs, pressed, lambda v: go(friction=0.0 if v == "none" else usual), "Friction")

    def _conditions(self) -> None:
        choice = self.view.choice
        self.line = text("summary", "Conditions")
        usual = described(choice)
        own = {
            "stretched_length": usual.conditions.stretched_length,
            "accumulator_pressure": usual.threshold,
            "friction": usual.conditions.friction,
        }
        chosen = {name: getattr(choice, name) for name in own}
        values = {name: own[name] if chosen[name] is None else chosen[name] for name in own}
        with box("div", "bd form"):
            for name, value in values.items():
                field(name, SETTINGS[name], value, functools.partial(self._set, name))
            with box("div", "row wrap"):
                if len(usual.specimen.laws) > 1:
                    names = {n: n.replace("_", " ") for n in usual.specimen.laws}
                    select(names, usual.law, lambda v: self.view.changed(law=v, volume=""), "Law")
                volumes = {v: VOLUMES[v] for v in sorted(usual.muscles)}
                select(volumes, usual.volume, lambda v: self.view.changed(volume=v), "Volume of the gas")
                words = {"printed": "Friction in the output only", "throughout": "Friction throughout"}
                readings = {r: words[r] for r in READINGS}
                select(
                    readings, choice.reading, lambda v: self.view.changed(reading=v), "Reading of the isotonic cycles"
                )
        self._say_conditions()

    def _set(self, name: str, value: float) -> None:
        """Set a condition; if no cycle is possible, show why and keep the old value."""
        choice = _with(self.view.choice, **{name: value})
        conditions(choice)
        if name == "accumulator_pressure" and value >= choice.pressure:
            raise InputError(name, None, f"must be below the pressure of the supply, got {value / 100000.0:g} bar")
        self.again = name == "friction"  # which the bar shows too
        self.view.changed(**{name: value})

    def _say_conditions(self) -> None:
        try:
            c = conditions(self.view.choice)
        except MckibbenError:
            return
        around = with_unit(float(c.ambient.pressure_abs), "Pa", 5)
        volume = VOLUMES[described(self.view.choice).volume].lower()
        words = f"Conditions: begins at {with_unit(c.stretched_length, 'm')}, surroundings {around}, {volume}"
        self.line.say(words)


def _with(choice: EnergyChoice, **what: Any) -> EnergyChoice:
    from dataclasses import replace

    return replace(choice, **what)


ENDINGS = (".nc", ".csv", ".mcap")
MOST = 200  # recordings in the list
TRIED = 6  # newest ones among which an account is sought
EMPTY = "No recordings yet. Start a run on the bench, or drop a file here."
NO_AIR = "The newest recordings show no use of air. Choose another one, start a run on the bench, or drop a file here."


class RecordedFlow:
    """Energy flow of a recording.

    Args:
        view: view of the page.
        head: place of the lists in the panel's heading.
    """

    def __init__(self, view: EnergyPage, head: Element) -> None:
        self.view = view
        with head:
            self.head = box("div", "row")
        self.name, self.part, self.kind = (view.words.get(k, "") for k in ("recording", "part", "account"))
        self.account: Any = None
        self.simulated = True
        self.told: float | None = None  # pressure of the accumulator whose saving is shown [Pa]
        self.place = box("div", "e-flow-place")

    def names(self) -> list[str]:
        """Names of the recordings from which an account can be made, the newest first."""
        return [n for n in self.view.workspace.recordings.names() if n.lower().endswith(ENDINGS)][:MOST]

    def begin(self) -> None:
        """Show the lists, and the recording of the link or the newest one."""
        names = self.names()
        if not self.name and names:
            page_document().spawn(self.newest(names))
        elif not self.name:
            self.none()
        else:
            page_document().spawn(self.load())

    def none(self) -> None:
        """Say that there is nothing to show, and take a file."""
        self.place.clear()
        with self.place:
            empty(NO_AIR if self.names() else EMPTY, "To the bench", "/")
            UploadPlace("A recording of mckibben: .nc, .csv or .mcap", self.dropped, ENDINGS)

    async def newest(self, names: list[str]) -> None:
        """Show the newest recording of which there is an account; those of biological muscles, for one, have no air."""
        for name in names[:TRIED]:
            with contextlib.suppress(MckibbenError):
                await asyncio.to_thread(self._account, name, "")
                self.name = name
                await self.load()
                return
        self.lists()
        self.none()

    async def dropped(self, one: IncomingFile) -> None:
        """Store an uploaded file with the recordings."""
        path = await asyncio.to_thread(self.view.workspace.recordings.store, one.name, one.path)
        one.close()
        self.name = path.name
        self.view.workspace.changed()
        await self.load()

    def lists(self) -> None:
        """Build the lists of recordings, sections and kinds of account."""
        self.head.clear()
        names = self.names()
        shown = {n: n for n in ([] if self.name in names or not self.name else [self.name]) + names}
        if not self.name:
            shown = {"": "choose"} | shown
        with self.head:
            if self.account is not None and self.account.cycles:
                select(cycle_names(self.account), self.part, self.stretched, "Stretch of the recording")
            if self.account is not None and self.simulated:
                kinds = {"": "As simulated", "measured": "From measured channels"}
                select(kinds, self.kind, self.kinded, "Account")
            select(shown, self.name, self.chosen, "Recording")

    async def chosen(self, name: str) -> None:
        """Show another recording."""
        self.name, self.part, self.kind, self.account = name, "", "", None
        await self.load()

    async def kinded(self, kind: str) -> None:
        """Show another kind of account."""
        self.kind, self.part, self.account = kind, "", None
        await self.load()

    def stretched(self, part: str) -> None:
        """Show another section of the recording."""
        self.part = part
        self.draw()

    async def load(self) -> None:
        """Compute the account and draw it."""
        with self.view.bar:  # the list that was chosen from is made again
            name, kind = self.name, self.kind
            link(recording=name, account=kind or None, part=self.part or None)
            self.lists()
            result = await run_in_thread(self.place, f"Summing up {name}", self._account, name, kind)
            if result is None or (name, kind) != (self.name, self.kind):
                return
            self.account, _, self.simulated = result
            self.draw()
            self.lists()

    def _account(self, name: str, kind: str) -> Any:

        path = self.view.workspace.recordings.found(name)
        try:
            try:
                return account(path, kind, "")
            except InputError as error:
                if error.field != "muscle":
                    raise
                return account(path, kind, self.view.good.source)  # the page's muscle, where the recording names none
        except (ArithmeticError, LookupError, OSError, RuntimeError, TypeError) as error:  # what others wrote into it
            why = f"{type(error).__name__}: {error}"[:200]
            raise InputError("file", name, f"no account can be made of what is in it ({why})") from None

    def draw(self) -> None:
        """Draw the present account."""
        if self.account is None:
            return
        link(part=self.part or None)
        self.told = self.accumulator()
        self.place.clear()
        with self.place:
            try:
                document = flow_document(self.account, self.part, self.told)
            except MckibbenError as error:
                refused(str(error))
                return
            box("div", "e-flow").data("spec", document)

    def picture(self) -> Figure:
        """Draw the streams of the present account."""
        if self.account is None:
            raise InputError("figure", None, "cannot be saved: no recording is shown")
        return energy_flow_figure(stretch(self.account, self.part)[0])

    def accumulator(self) -> float | None:
        """Gauge pressure of the accumulator chosen for the cycle [Pa]."""
        choice = self.view.good
        return conditions(choice).exchange_pressure if choice.exchange == "accumulator" else None

    def accumulator_changed(self) -> None:
        """Update the saving after a change of the accumulator."""
        if self.account is not None and self.accumulator() != self.told:
            self.draw()
