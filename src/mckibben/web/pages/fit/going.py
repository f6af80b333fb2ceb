"""How far the fits are, with a button that stops them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...elements import Element
from ...widgets import box, button, note, raw, text
from .work import Work


class Going:
    """The line below the ranking. It is made once for all of a work, so that a click on its button meets it.

    Args:
        place: where it stands while there is something to say.
        work: that goes on.
        stop: what the button does.
    """

    def __init__(self, place: Element, work: Work, stop: Callable[[], Any]) -> None:
        self._place, self._work, self._stop = place, work, stop
        self._said: Any = None
        self._bar: Any = None

    def show(self) -> None:
        """What is done now, or why it came to an end."""
        work = self._work
        if not work.running:
            self._place.clear()
            self._said = None
            if work.failed:
                with self._place:
                    note(f"A fit came to an end before its time: {work.failed}", "stop")
            return
        if self._said is None:
            self._place.clear()
            with self._place, box("div", "going").set(role="status"):
                self._said = text("span", "")
                self._bar = raw("", "div", "line")
                button("Stop fitting", self._stop, small=True)
        left = f", {work.left:.0f}\u2009\u2060s left" if work.left is not None else ""
        self._said.say(f"Fitting {work.words}{left}" if work.words else "Waiting for other fits")
        self._bar.put(f'<i style="width:{100.0 * work.share:.0f}%"></i>')
