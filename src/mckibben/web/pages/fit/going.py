"""How far the fits are, with a button that stops them."""

from __future__ import annotations

import functools
import html
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from ...parts import box, button, note, raw, text
from .work import Work, stop_all

if TYPE_CHECKING:
    from nicegui.element import Element


@functools.cache
def stop_at_the_end() -> None:
    """Let fits end with the server; said once."""
    from nicegui import app

    app.on_shutdown(stop_all)


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
            with self._place, box("div", "going").props("role=status"):
                self._said = text("span", "")
                self._bar = raw("", "div", "line")
                button("Stop fitting", self._stop, small=True)
        left = f", {work.left:.0f}\u2009\u2060s left" if work.left is not None else ""
        self._said.set_content(html.escape(f"Fitting {work.words}{left}" if work.words else "Waiting for other fits"))
        self._bar.set_content(f'<i style="width:{100.0 * work.share:.0f}%"></i>')
