"""The pictures of the law that is picked, and which of the table's muscles they show."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import TYPE_CHECKING

from ...elements import Element
from ...widgets import raw, select, text
from . import pictures

if TYPE_CHECKING:
    from ....identification import Fit
    from ....report.fit_study import Study

VIEWS = {"tension": "Tension", "errors": "Residuals", "surface": "Surface"}
HEIGHTS = {"tension": 470, "errors": 470, "surface": 470, "bubbles": 206, "left": 190}  # [px]


class Shown:
    """What stands in some places of a page.

    Args:
        places: by the names ``muscle``, ``picture``, ``bubbles``, ``left``.
        view: one of `VIEWS`, in the place ``picture``.
    """

    def __init__(self, places: Mapping[str, Element], view: str) -> None:
        self._places = places
        self.view = view if view in VIEWS else "tension"
        self._rest: float | None = None
        self._asking = 0
        self._last: tuple[Fit, Study] | None = None

    async def show(self, fit: Fit, study: Study) -> None:
        """Another law, or the same anew."""
        self._last = fit, study
        place, rests = self._places["muscle"], pictures.rests(study.points)
        place.clear()
        self._rest = self._rest if self._rest in rests else (rests[0] if len(rests) > 1 else None)
        if len(rests) > 1:
            words = {repr(r): f"{100.0 * r:.4g} cm at rest" for r in rests}
            with place:
                select(words, repr(self._rest), self._another, "Muscle")
        await self._draw()

    async def look_at(self, view: str) -> None:
        """Another view of the same."""
        self.view = view
        await self._draw()

    def clear(self) -> None:
        """Nothing is there any more."""
        self._asking += 1
        self._last = None
        for name in ("muscle", "picture", "bubbles", "left"):
            self._places[name].clear()

    async def _another(self, rest: str) -> None:
        self._rest = float(rest)
        await self._draw()

    async def _draw(self) -> None:
        if self._last is None:
            return
        self._asking += 1
        mine, (fit, study) = self._asking, self._last
        data = await asyncio.to_thread(pictures.drawn, fit, study, self._rest)
        if mine != self._asking:
            return  # another one was asked for meanwhile
        title = fit.law.replace("_", " ")
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
                    raw(pictures.figure(kind, data, words, HEIGHTS[kind]))
                if name == "picture":
                    pictures.values(data)
