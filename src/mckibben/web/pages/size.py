"""The Size page: muscle, valve, tube and gas source for a force and a stroke, computed in a thread by `mckibben.size`."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING, NamedTuple
from urllib.parse import urlencode

import numpy as np

from ...documents import JsonValue
from ...errors import InputError, MckibbenError
from ...quantities import with_unit
from ...specimens import specimen_ids, specimen_toml
from ...specimens.parts import parts
from ...studies.sizing import BRAID_LAWS, OBJECTIVES, Judged, Sizing, size
from ...studies.sizing.candidate import LawAtPressure
from ...studies.sizing.tables import ms, ranged
from ...verbs import answer as ask
from ..charts import Axis, Chart, ChartLine
from ..elements import Element, call_script, page_document
from ..forms import InputField, show_cautions
from ..shelf import SharedResults
from ..transfers import download
from ..widgets import (
    asked,
    box,
    button,
    check,
    empty,
    ended,
    link,
    loading,
    page_frame,
    panel,
    raw,
    say_refused,
    select,
    table,
    tell,
    text,
)
from ..workspace import Workspace
from .circuit.document import packed

if TYPE_CHECKING:
    from starlette.requests import Request


def build(workspace: Workspace, request: Request) -> None:
    """Build the page; the answer follows when it is displayed."""
    words = asked(request, *LINKED)
    with page_frame("size", sub="Muscle, valve, tube and gas source for a load", sheets=("size.css",)) as bar:
        page = SizePage(workspace, words, bar, box("div", "size"))
        page_document().when_connected(page.show)
        page_document().on_close(page.leave)


# ---- the question


class QuestionField(NamedTuple):
    """A field of the form: argument of `mckibben.size`, label, class of its quantity, and what to write."""

    name: str
    label: str
    quantity: str
    about: str


FIELDS = {
    "What it must do": (
        QuestionField("force", "Force", "F", "at the end of the stroke, such as 50 N"),
        QuestionField("load", "or load", "F", "a mass that hangs on it, such as 5 kg"),
        QuestionField("stroke", "Stroke", "L", "such as 3 cm"),
        QuestionField("pressure", "Pressure", "P", "gauge, such as 5 bar"),
        QuestionField("space", "Space", "L", "length x diameter, such as 25 cm x 3 cm"),
        QuestionField("speed", "Speed", "L", "of shortening with that force, such as 10 cm/s"),
    ),
    "How often": (
        QuestionField("rate", "Cycles", "", "such as 1 Hz"),
        QuestionField("working_time", "Each day", "", "time at work, such as 8 h"),
    ),
    "With what": (
        QuestionField("tube_length", "Tube", "L", "from the valve to the muscle, such as 50 cm"),
        QuestionField("valve", "Valve", "v", "a name, or numbers of a catalogue: Cv=0.3, switching_time=8 ms"),
        QuestionField("battery", "Battery", "", "for a small compressor and the valve, such as 100 Wh"),
        QuestionField("tank", "Tank", "", "of air, such as 2 l at 200 bar"),
    ),
}
# Field of the form in which a value is put right, by the name that an error or a caution has.
FIELD_OF = {
    "length": "space", "diameter": "space", "frequency": "rate", "working time": "working_time",
    "tube length": "tube_length",
}  # fmt: skip


TICK = "Valves and tubes, simulated"


@dataclass(frozen=True)
class SizeQuestion:
    """Words of the form, by argument of `mckibben.size`; nothing where none is required."""

    force: str = "50 N"
    load: str = ""
    stroke: str = "3 cm"
    pressure: str = "5 bar"
    space: str = ""
    speed: str = ""
    rate: str = "1 Hz"
    working_time: str = "8 h"
    tube_length: str = "50 cm"
    valve: str = ""
    battery: str = ""
    tank: str = ""
    muscle: str = ""
    law: str = "linear_threshold"
    lines: str = "yes"

    def arguments(self) -> dict[str, JsonValue]:
        """Arguments of `mckibben.size`."""
        stated = {f.name: getattr(self, f.name).strip() or None for f in fields(self)}
        return stated | {"lines": self.lines == "yes"}

    def link(self) -> dict[str, str | None]:
        """Parameters of the page's address; None for those that are usual, ``none`` for those left empty."""
        usual = SizeQuestion()
        values = {f.name: getattr(self, f.name) for f in fields(self)}
        return {n: None if v == getattr(usual, n) else v or "none" for n, v in values.items()}


LINKED = tuple(f.name for f in fields(SizeQuestion))


def from_link(words: Mapping[str, str]) -> SizeQuestion:
    """The question of a link; what it does not state is as usual."""
    stated = {name: "" if text == "none" else text for name, text in words.items() if name in LINKED}
    if stated.get("load"):
        stated.setdefault("force", "")  # the usual force is none that anybody gave
    return replace(SizeQuestion(), **stated)


# ---- what is drawn

POINTS = 97
SLOWEST = 3.0  # times the best line's time, up to which lines are drawn
DASHES = ("A", "B", "C", "D")


class SizingFact(NamedTuple):
    """A line of the chosen combination: label, class of its quantity, value, and the range in brackets."""

    label: str
    quantity: str
    value: str
    range: str = ""


def _force_chart(sizing: Sizing) -> Chart:
    wish = sizing.wish
    strokes = np.linspace(0.0, 2.0 * wish.stroke, POINTS)
    top = 1.15 * max(2.6 * wish.force, 1.2 * sizing.chosen.end_force)
    # the chosen muscle, then the best of each kind
    best = [next((m for m in sizing.muscles if m.muscle.kind == kind), None) for kind in ("braid", "specimen", "size")]
    some: list[Judged] = [sizing.chosen, *(m for m in best if m and m.muscle.id != sizing.chosen.muscle.id)]
    lines = []
    for one, dash in zip(some, DASHES, strict=False):
        m = one.muscle
        pull = LawAtPressure(m.law, wish.pressure).tension(m.longest - strokes) - m.friction - one.error_force
        kept = (pull > 0.0) & (pull < 1.5 * top)
        chosen = one is sizing.chosen
        lines.append(
            ChartLine(
                100.0 * strokes[kept], pull[kept], m.id, quantity="tension", dash=dash, width=2.5 if chosen else 1.5,
                opacity=1.0 if chosen else 0.75,
            )
        )  # fmt: skip
    lines.append(ChartLine([100.0 * wish.stroke], [wish.force], "required", points=True, line=False))
    said = (
        f"{sizing.chosen.muscle.id} promises {sizing.chosen.promised_force:.1f} N at a stroke of "
        f"{100.0 * wish.stroke:.3g} cm, where {wish.force:.4g} N are required."
    )
    return Chart(
        f"At {wish.pressure / 1e5:g} bar", said, Axis("Stroke", "cm", "length", low=0.0),
        Axis("Promised force", "N", "tension", low=0.0, high=top), lines,
    )  # fmt: skip


def _lines_chart(sizing: Sizing) -> Chart | None:
    every = [one for one in sizing.lines if one.to_force is not None]
    if not every:
        return None
    able = [one for one in every if (one.to_force or 0.0) <= SLOWEST * (every[0].to_force or 0.0)]
    best, pareto = able[0], [one for one in able[1:] if one.pareto]
    rest = [one for one in able[1:] if not one.pareto]
    lines = [
        ChartLine(
            [1e3 * one.mass for one in some], [1e3 * (one.to_force or 0.0) for one in some], quantity="valve", points=True,
            line=False, opacity=opacity,
        )
        for some, opacity in ((rest, 0.35), (pareto, 1.0))
        if some
    ]  # fmt: skip
    label = f"{best.valve}, {best.tube}"
    lines.append(
        ChartLine([1e3 * best.mass], [1e3 * (best.to_force or 0.0)], label, quantity="tension", points=True, line=False)
    )
    said = (
        f"{label} reaches the force after {ms(best.to_force)} ms and weighs {1e3 * best.mass:.0f} g; {len(able)} of "
        f"{len(every)} lines are drawn, slower ones stand in the table."
    )
    heaviest, slowest = 1e3 * max(one.mass for one in able), 1e3 * max(one.to_force or 0.0 for one in able)
    mass = Axis("Mass of valve and tube", "g", low=0.0, high=1.2 * heaviest)
    time = Axis("Time to the force", "ms", low=0.0, high=1.1 * slowest)
    return Chart(f"For {sizing.chosen.muscle.id}", said, mass, time, lines)


def facts_of(sizing: Sizing) -> list[SizingFact]:
    """The chosen combination, with the ranges that inferred numbers leave."""
    one, line, spread = sizing.chosen, sizing.line, sizing.spread
    law = f"law {one.end_force:.1f} {'' if spread is None else _brackets(*spread.force, 1.0)}"
    across = f"{100 * one.muscle.overall_length:.1f} cm, {1e3 * one.muscle.diameter:.1f} mm"
    facts = [
        SizingFact("Muscle", "", one.muscle.id, one.verdict),
        SizingFact("Force at the end", "F", f"{one.promised_force:.1f} N", law),
        SizingFact("Length, width", "L", across),
    ]
    if line is not None:
        times = "" if sizing.time_range is None else _brackets(*sizing.time_range, 1e3)
        facts += [
            SizingFact("Valve", "v", line.valve, f"{line.power_shown} W, {line.valve_mass_shown} g"),
            SizingFact("Tube", "L", line.tube, with_unit(line.tube_length, "m")),
            SizingFact("Time to the force", "", f"{ms(line.to_force)} ms", times),
        ]
        if line.speed is not None:
            facts.append(SizingFact("Speed", "L", f"{100 * line.speed:.0f} cm/s"))
    air = one.air if line is None else line.air
    left = "" if spread is None else _brackets(*spread.air, 1e6)
    facts.append(SizingFact("Air of a cycle", "q", f"{1e6 * air:.0f} mg", left))
    source = next((s for s in sizing.gas_sources if s.able), None)
    if source is not None:
        facts.append(SizingFact("Gas source", "", source.title))
        facts.append(SizingFact("Energy of a cycle", "", f"{ranged(source.energy, source.energy_range, 'J', 'J')} J"))
        if source.run_time is not None:
            facts.append(SizingFact("Lasts", "", f"{ranged(source.run_time, source.run_time_range, 's', 'min')} min"))
        if source.daily is not None:
            daily = ranged(source.daily, source.daily_range, "J", "W h")
            facts.append(SizingFact("Energy of a day", "", f"{daily} W h"))
    if sizing.daily is not None:
        low, high = sizing.daily.air_range
        facts.append(SizingFact("Air of a day", "q", f"{sizing.daily.air:.3g} kg", f"({low:.3g} to {high:.3g})"))
    return facts


def _brackets(low: float, high: float, scale: float) -> str:
    ends = [f"{scale * end:.3g}" for end in (low, high)]
    return "" if ends[0] == ends[1] else f"({ends[0]} to {ends[1]})"


# ---- the page

ROWS = 8  # of the tables
LOOKS = 0.25  # time between two words on the progress [s]
_answers = SharedResults(12)  # for other visitors and for the way back


def _called(name: str) -> str:
    """A parameter of `mckibben.size` as sentences on the page call it."""
    return f"an unticked '{TICK}'" if name == "lines" else name.replace("_", " ")


class SizeAnswer(NamedTuple):
    """A sizing with its charts: force over stroke; time over mass of valves with tubes, None where none was looked for."""

    sizing: Sizing
    force: Chart
    lines: Chart | None


def answer(question: SizeQuestion, progress: Callable[[str], None]) -> SizeAnswer:
    """The sizing of a question with its charts; kept, so that a link is answered at once the second time."""

    def make() -> SizeAnswer:
        sizing = ask(size, {**question.arguments(), "progress": progress}, _called)
        progress("charts")
        return SizeAnswer(sizing, _force_chart(sizing), _lines_chart(sizing) if sizing.lines else None)

    return _answers.get(question, make)


class SizePage:
    """The Size page of one visitor."""

    def __init__(self, workspace: Workspace, words: dict[str, str], bar: Element, place: Element) -> None:
        self.workspace, self.bar, self.place = workspace, bar, place
        self.question = from_link(words)
        self.sizing: Sizing | None = None
        self.number = 0  # of the newest question
        self.fields: dict[str, InputField] = {}

    def leave(self) -> None:
        """Give up the question that is being answered, as the page is closed."""
        self.number += 1

    async def show(self) -> None:
        """Build the page, and answer the question of the link."""
        with self.bar:
            button("Save as specimen file", self._save_muscle)
            button("Open as circuit", self._open_circuit)
            button("Take to the bench", self._take_to_bench, primary=True)
        with self.place:
            with box("div", "size-form"), panel("Question"):
                self._form()
            with box("div", "size-answer"):
                self.status, self.remarked = box("div", "size-status"), box("div", "size-status stack")
                self.result = box("div", "size-result")
        await self._find()

    def _form(self) -> None:
        question = self.question
        for heading, group in FIELDS.items():
            with box("fieldset", "form"):
                text("legend", heading)
                for one in group:
                    self.fields[one.name] = InputField(
                        one.label, getattr(question, one.name), functools.partial(self._take, one.name),
                        name=f"size-{one.name}", about=one.about, colour=one.quantity,
                    )  # fmt: skip
                    self.fields[one.name].input.on_value("entered", functools.partial(self._enter, one.name))
        self.fields |= {name: self.fields[field] for name, field in FIELD_OF.items()}
        with box("fieldset", "form"):
            text("legend", "Which muscle")
            names = [*(f"braid-{objective}" for objective in OBJECTIVES), *specimen_ids("mckibben")]
            names += [part.id for part in parts("fluidic_muscle")]
            muscles = {"": "The best muscle"} | {name: name for name in (*names, question.muscle) if name}
            select(muscles, question.muscle, lambda v: self._take("muscle", v), "Muscle")
            laws = {name: f"Braids by {name.replace('_', ' ')}" for name in BRAID_LAWS}
            select(laws, question.law, lambda v: self._take("law", v), "Law of the braids")
            simulated = question.lines == "yes"
            check(TICK, simulated, lambda on: self._take("lines", "yes" if on else "no"))
        self.said = box("div", "size-said")
        button("Find", self._find, primary=True)

    def _take(self, name: str, words: str) -> None:
        words = words.strip()[:200]
        if words == getattr(self.question, name):
            return  # the browser says "change" after Enter, too: a message that stands by now must not go
        self.question = replace(self.question, **{name: words})
        self._refuse("", "")

    async def _enter(self, name: str, words: str) -> None:
        self._take(name, words)
        await self._find()

    def _refuse(self, name: str, why: str) -> None:
        """Show a sentence beside the field that it is about, else above the button; an empty one removes all."""
        for field in dict.fromkeys(self.fields.values()):
            field.refuse(why if field is self.fields.get(name) else "")
        say_refused(self.said, "" if name in self.fields else why)

    # ---- the answer

    async def _find(self) -> None:
        """Answer the present question; one that was changed meanwhile is answered next."""
        self.number += 1
        number, question = self.number, self.question
        words = ["Sizing"]
        link(**question.link())
        self._refuse("", "")
        self.status.clear()
        with self.status, loading(words[0]):
            progress = text("span", "", "size-progress")
        self.result.classed("old", True)

        def told(stage: str) -> None:
            if number != self.number:  # nobody waits for it, and the newest question needs the processor
                raise MckibbenError("another question was asked meanwhile")
            words.append(stage)

        job = asyncio.ensure_future(asyncio.to_thread(answer, question, told))
        # Of a page that was closed nobody asks for the answer, nor why there is none.
        job.add_done_callback(lambda done: done.cancelled() or done.exception())
        try:
            while not (await asyncio.wait({job}, timeout=LOOKS))[0]:
                if number == self.number:
                    progress.say(words[-1])
            found = job.result()
        except MckibbenError as error:
            if number == self.number:
                self.status.clear()
                name = error.field if isinstance(error, InputError) else ""
                # else a key within it: of "valve switching_time" the valve
                self._refuse(name if name in self.fields else name.partition(" ")[0], ended(error))
            return
        if number == self.number:
            self.status.clear()
            self.sizing = found.sizing
            self._show(found)

    def _show(self, found: SizeAnswer) -> None:
        sizing = found.sizing
        show_cautions(sizing.cautions, self.fields, self.remarked)
        self.result.classed("old", False)
        self.result.clear()
        with self.result:
            with box("div", "size-top"):
                with panel("Chosen", sizing.chosen.muscle.title if sizing.reached else "nothing reaches it"):
                    if not sizing.reached:
                        empty(f"{sizing.sentence()}.")
                    else:
                        with box("dl", "size-facts"):
                            for fact in facts_of(sizing):
                                with box("div"):
                                    text("dt", fact.label, fact.quantity)
                                    with box("dd"):
                                        text("span", fact.value, "value").set(data_fact=fact.label)
                                        if fact.range:
                                            text("span", fact.range, "small dim")
                        raw("In brackets: what the numbers leave that no source prints.", "p", "small dim")
                with panel("Force over stroke", "promised: after friction and the error of the law"):
                    found.force.show()
                if found.lines is not None:
                    with panel("Valves and tubes", "in full colour: beaten by none in everything"):
                        found.lines.show()
            for one in sizing.first(ROWS).tables():
                with panel(one.title):
                    table(one.heads, one.cells(), right=one.right, name=one.title)
                    for note in one.notes:
                        text("p", note, "small dim")

    # ---- to other pages

    def _reached(self) -> Sizing | None:
        if self.sizing is None or not self.sizing.reached:
            tell("There is no muscle yet that does it.")
            return None
        return self.sizing

    async def _save_muscle(self) -> None:
        if (sizing := self._reached()) is not None:
            data = await asyncio.to_thread(_specimen_data, sizing)
            download(f"{sizing.chosen.muscle.id}.toml", data)

    async def _take_to_bench(self) -> None:
        """Open the bench with the chosen muscle; one that does not ship is stored with the visitor's specimens."""
        if (sizing := self._reached()) is None:
            return
        name = sizing.chosen.muscle.id
        if name not in specimen_ids("mckibben"):
            data = await asyncio.to_thread(_specimen_data, sizing)
            name = (await asyncio.to_thread(self.workspace.specimens.store_once, f"{name}.toml", data)).stem
        call_script("goTo", f"/?{urlencode({'muscle': name})}")

    def _open_circuit(self) -> None:
        if (sizing := self._reached()) is None:
            return
        try:
            call_script("goTo", f"/circuit?{urlencode({'c': packed(sizing.to_circuit())})}")
        except InputError as error:
            tell(ended(error))


def _specimen_data(sizing: Sizing) -> bytes:
    return specimen_toml(sizing.to_specimen(), heading="sized by mckibben; not measured").encode()
