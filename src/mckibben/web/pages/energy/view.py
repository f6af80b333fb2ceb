"""What one visitor of the page Energy sees and does: a choice, and the newest of its wishes computed in a thread."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from ....errors import MckibbenError
from ...elements import Element, page_document
from ...transfers import download, run_in_thread
from ...widgets import box, button, link, panel, select, text

if TYPE_CHECKING:
    from ...laboratory import Laboratory
    from .choice import Choice


async def begin(lab: Laboratory, words: dict[str, str], bar: Element, place: Element) -> None:
    """Load what computes, then fill the page."""
    found = await run_in_thread(place, "Loading the muscles", _loaded, words)
    if found is not None:
        await View(lab, words, bar, place, *found).show()


def _loaded(words: dict[str, str]) -> tuple[Choice, list[str], dict[str, str]]:
    from .choice import LINKED, from_link, muscles

    choice, said = from_link({k: v for k, v in words.items() if k in LINKED})
    return choice, said, muscles()


class View:
    """One visitor's page.

    Args:
        lab: of the recordings.
        words: of the link.
        bar: place of the buttons in the heading.
        place: of all below.
        choice: what the link says.
        said: what of it was refused.
        muscles: id and title of those that can be chosen.
    """

    def __init__(
        self, lab: Laboratory, words: dict[str, str], bar: Element, place: Element, choice: Choice, said: list[str],
        muscles: dict[str, str],
    ) -> None:  # fmt: skip
        self.lab, self.words, self.bar, self.place, self.muscles = lab, words, bar, place, muscles
        self.choice, self.good, self.said = choice, choice, said
        self.wish, self.busy = 0, False

    async def show(self) -> None:
        """Build the page, and compute for the first time."""
        from .controls import Controls
        from .recorded import Recorded

        with self.bar:
            select(self.muscles, self.choice.muscle, lambda m: self.changed(muscle=m, law=""), "Muscle")
            button("Report", self.report)
        with self.place:
            self.controls = Controls(self)
            with box("div", "e-grid"):
                with panel("Air: pressure against volume", "gas in compressor and muscle"):
                    self.piston = box("div", "e-piston e-draw")
                with panel("Muscle: tension against length", "the same cycle"):
                    self.tendon = box("div", "e-tendon e-draw")
                with panel("Per cycle"):
                    self.numbers = box("div", "e-numbers")
                    with box("details", "values"):
                        text("summary", "Where the input goes")
                        self.losses = box("div", "e-losses scroll")
                with panel("Where the air\u2019s energy went", "exergy against the surroundings") as head:
                    self.recorded = Recorded(self, head)
                with panel("Efficiency over supply pressure"):
                    self.curve = box("div", "e-curve e-draw")
        if self.said:
            self.controls.refuse(" ".join(self.said))
        self.recorded.begin()
        await self.draw()

    def changed(self, **what: Any) -> None:
        """A visitor chose something; it is computed and shown in a task of its own."""
        self.choice = replace(self.choice, **what)
        self.controls.under.clear()
        page_document().spawn(self.draw())

    async def draw(self) -> None:
        """Compute and show the newest choice; those that came while another was computed are passed over."""
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

    async def _once(self, choice: Choice) -> None:
        from .choice import to_link
        from .cycles import curves, curves_key, cycle_document

        try:
            document = await asyncio.to_thread(cycle_document, choice)
            lines = await asyncio.to_thread(curves, curves_key(choice))
        except MckibbenError as error:
            if choice == self.choice:
                self.choice = self.good
                self.controls.rebuild()
                self.controls.refuse(f"{error}. What was chosen before stays in use.")
            return
        self.good, muscle = choice, choice.muscle != self.good.muscle or choice.law != self.good.law
        for place, part in (
            (self.piston, document), (self.tendon, document), (self.numbers, document), (self.losses, document),
            (self.curve, lines | {k: document[k] for k in ("pressure", "exchange", "efficiency", "other_efficiency")}),
        ):  # fmt: skip
            place.data("spec", part)
        self.controls.agree(rebuilt=muscle)
        link(**to_link(choice))
        self.recorded.accumulator_changed()

    async def report(self) -> None:
        """Download the report of the cycle that is shown."""
        from .report import cycle_report

        page = await run_in_thread(self.controls.under, "Writing the report", cycle_report, self.good)
        if page is not None:
            download(f"energy-{self.good.muscle}-{self.good.cycle}.html", page)
