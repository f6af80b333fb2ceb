"""The Size page of one visitor: form, pictures, chosen combination and tables; computed in a thread by `mckibben.size`."""

from __future__ import annotations

import asyncio
import threading
from collections import OrderedDict
from collections.abc import Callable
from dataclasses import replace
from urllib.parse import urlencode

from ....errors import InputError, MckibbenError
from ....specimens import specimen_ids
from ....specimens.parts import parts
from ....specimens.write import specimen_toml
from ....studies.sizing import BRAID_LAWS, OBJECTIVES, Sizing, size
from ...elements import Element, call_script
from ...transfers import download
from ...widgets import box, button, check, empty, link, loading, panel, raw, refused, select, table, tell, text
from ...widgets import note as caution
from ...workspace import Workspace
from ..circuit.document import packed
from .drawings import SizingCharts, charts_of, facts_of
from .question import FIELD_OF, FIELDS, QuestionField, SizeQuestion, from_link

ROWS = 8  # of the tables
KEPT = 12  # answers that are kept for other visitors and for the way back
LOOKS = 0.25  # time between two words on the progress [s]

_answers: OrderedDict[SizeQuestion, tuple[Sizing, SizingCharts]] = OrderedDict()
_lock = threading.Lock()


def answer(question: SizeQuestion, progress: Callable[[str], None]) -> tuple[Sizing, SizingCharts]:
    """The sizing of a question with its charts; kept, so that a link is answered at once the second time.

    Raises:
        MckibbenError: as `mckibben.size` does.
    """
    with _lock:
        if question in _answers:
            _answers.move_to_end(question)
            return _answers[question]
    sizing = size(progress=progress, **question.arguments())
    progress("charts")
    result = sizing, charts_of(sizing)
    with _lock:
        _answers[question] = result
        while len(_answers) > KEPT:
            _answers.popitem(last=False)
    return result


class SizePage:
    """The Size page of one visitor.

    Args:
        workspace: state of the server.
        words: words of the link.
        bar: place of the buttons in the heading.
        place: place of all below.
    """

    def __init__(self, workspace: Workspace, words: dict[str, str], bar: Element, place: Element) -> None:
        self.workspace, self.bar, self.place = workspace, bar, place
        self.question = from_link(words)
        self.sizing: Sizing | None = None
        self.number = 0
        self.errors: dict[str, tuple[Element, Element, Element]] = {}

    async def show(self) -> None:
        """Build the page, and answer the question of the link."""
        with self.bar:
            button("Save as specimen file", self.save_muscle)
            button("Open as circuit", self.open_circuit)
            button("Take to the bench", self.take_to_bench, primary=True)
        with self.place:
            with box("div", "size-form"):
                self._form()
            with box("div", "size-answer"):
                self.status = box("div", "size-status")
                self.result = box("div", "size-result")
        await self.find()

    # ---- the question

    def _form(self) -> None:
        with panel("Question"):
            for heading, group in FIELDS:
                with box("fieldset", "form"):
                    text("legend", heading)
                    for one in group:
                        self._field(one)
            with box("fieldset", "form"):
                text("legend", "Which muscle")
                select(
                    _muscles(self.question.muscle), self.question.muscle, lambda v: self._take("muscle", v), "Muscle"
                )
                laws = {name: f"Braids by {name.replace('_', ' ')}" for name in BRAID_LAWS}
                select(laws, self.question.law, lambda v: self._take("law", v), "Law of the braids")
                check(
                    "Valves and tubes, simulated",
                    self.question.lines == "yes",
                    lambda on: self._take("lines", "yes" if on else "no"),
                )
            self.said = box("div", "size-said")
            button("Find", self.find, primary=True)

    def _field(self, one: QuestionField) -> None:
        with box("div", "f"):
            text("label", one.label, one.quantity).set(for_=f"size-{one.name}")
            with box("div", "field s") as edge:
                typed = box("input").set(
                    id=f"size-{one.name}",
                    value=getattr(self.question, one.name),
                    autocomplete="off",
                    aria_describedby=f"size-about-{one.name} size-error-{one.name}",
                )
            place = box("div").set(id=f"size-error-{one.name}").style(display="contents")
            text("span", one.about, "about").set(id=f"size-about-{one.name}")
        self.errors[one.name] = (typed, edge, place)
        typed.on_value("change", lambda value: self._take(one.name, str(value)[:200]))
        typed.on_value("entered", lambda value: self._enter(one.name, str(value)[:200]))

    def _take(self, name: str, words: str) -> None:
        if words.strip() == getattr(self.question, name):
            return  # the browser says "change" after Enter, too: a message that stands by now must not go
        self.question = replace(self.question, **{name: words.strip()})
        self._refuse("", "")

    async def _enter(self, name: str, words: str) -> None:
        self._take(name, words)
        await self.find()

    def _refuse(self, name: str, why: str) -> None:
        """Show a sentence beside the field that it is about, else above the button; an empty one removes all."""
        for field, (typed, edge, place) in self.errors.items():
            bad = bool(why) and field == name
            edge.classed("bad", bad)
            typed.set(aria_invalid="true" if bad else "false")
            place.clear()
            if bad:
                with place:
                    refused(why)
        self.said.clear()
        if why and name not in self.errors:
            with self.said:
                refused(why)

    # ---- the answer

    async def find(self) -> None:
        """Answer the present question; one that was changed meanwhile is answered next."""
        self.number += 1
        number, question = self.number, self.question
        words = ["Sizing"]
        link(**question.link())
        self._refuse("", "")
        with self.status, loading(words[0]):
            progress = text("span", "", "size-progress")
        self.result.classed("old", True)
        job = asyncio.ensure_future(asyncio.to_thread(answer, question, words.append))
        try:
            while not (await asyncio.wait({job}, timeout=LOOKS))[0]:
                if number == self.number:
                    progress.say(words[-1])
            sizing, charts = job.result()
        except MckibbenError as error:
            if number == self.number:
                self.status.clear()
                field = error.field.partition(".")[0] if isinstance(error, InputError) else ""
                self._refuse(FIELD_OF.get(field, field), f"{error}.")
            return
        if number == self.number:
            self.status.clear()
            self.sizing = sizing
            self._show(sizing, charts)

    def _show(self, sizing: Sizing, charts: SizingCharts) -> None:
        self.result.classed("old", False)
        self.result.clear()
        with self.result:
            for said in sizing.cautions:
                caution(f"{said.text[0].upper()}{said.text[1:]}.")
            with box("div", "size-top"):
                with panel("Chosen", sizing.chosen.muscle.title if sizing.reached else "nothing reaches it"):
                    self._chosen(sizing)
                with panel("Force over stroke", "promised: after friction and the error of the law"):
                    charts.force.show()
                if charts.lines is not None:
                    with panel("Valves and tubes", "in full colour: beaten by none in everything"):
                        charts.lines.show()
            for one in sizing.first(ROWS).tables():
                with panel(one.title):
                    table(one.heads, one.cells(), right=one.right, name=one.title)
                    for note in one.notes:
                        text("p", note, "small dim")

    def _chosen(self, sizing: Sizing) -> None:
        if not sizing.reached:
            empty(f"{sizing.sentence()}.")
            return
        with box("dl", "size-facts"):
            for fact in facts_of(sizing):
                with box("div"):
                    text("dt", fact.label, fact.quantity)
                    with box("dd"):
                        text("span", fact.value, "value").set(data_fact=fact.label)
                        if fact.range:
                            text("span", fact.range, "small dim")
        raw("In brackets: what the numbers leave that no source prints.", "p", "small dim")

    # ---- to other pages

    def _reached(self) -> Sizing | None:
        if self.sizing is None or not self.sizing.reached:
            tell("There is no muscle yet that does it.")
            return None
        return self.sizing

    async def save_muscle(self) -> None:
        """Download the chosen muscle as a specimen file."""
        sizing = self._reached()
        if sizing is not None:
            data = await asyncio.to_thread(_specimen_data, sizing)
            download(f"{sizing.chosen.muscle.id}.toml", data)

    async def take_to_bench(self) -> None:
        """Open the bench with the chosen muscle; one that does not ship is stored with the visitor's specimens."""
        sizing = self._reached()
        if sizing is None:
            return
        name = sizing.chosen.muscle.id
        if name not in specimen_ids("mckibben"):
            data = await asyncio.to_thread(_specimen_data, sizing)
            path = await asyncio.to_thread(self.workspace.specimens.store_once, f"{name}.toml", data)
            name = path.stem
        call_script("goTo", f"/?{urlencode({'muscle': name})}")

    def open_circuit(self) -> None:
        """Open the chosen muscle, valve and tube as a circuit."""
        sizing = self._reached()
        if sizing is None:
            return
        try:
            document = sizing.to_circuit()
        except InputError as error:
            tell(f"{error}.")
            return
        call_script("goTo", f"/circuit?{urlencode({'c': packed(document)})}")


def _specimen_data(sizing: Sizing) -> bytes:
    return specimen_toml(sizing.to_specimen(), heading="sized by mckibben; not measured").encode()


def _muscles(present: str) -> dict[str, str]:
    names = [*(f"braid-{objective}" for objective in OBJECTIVES), *specimen_ids("mckibben")]
    names += [part.id for part in parts("fluidic_muscle")]
    if present and present not in names:
        names.append(present)
    return {"": "The best muscle"} | {name: name for name in names}
