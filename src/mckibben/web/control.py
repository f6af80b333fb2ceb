"""Control of the machine: which page has it, and which pages watch.

One page at a time is in control. It goes by the public name of its `identity`, which a reload keeps. When it vanishes,
whatever runs runs on; after `HOLD` [s] the next page that asks gets the controls without being asked for.
"""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass

HOLD = 5.0  # time for which the controls wait for a page that vanished [s]
AFTER = 1.0  # until then what was held by hand is vented, before a page that did not ask is in control [s]


@dataclass
class Watcher:
    """A watching page.

    Attributes:
        lines: how many connections it has; none while it is away.
        left: when the last one ended [s].
    """

    lines: int = 0
    left: float = 0.0


class Control:
    """The control token, passed between pages; safe for use by several threads.

    Args:
        clock: seconds that only go forward.
        lost: called when the page in control vanishes.
        back: called when a client is in control again.
    """

    def __init__(self, clock: Callable[[], float], lost: Callable[[], None], back: Callable[[], None]) -> None:
        self._clock, self._lost, self._back = clock, lost, back
        self._lock = threading.RLock()
        self._pages: dict[str, Watcher] = {}
        self.holder: str | None = None
        self.wanted: str | None = None  # who asked for the controls

    def join(self, page: str) -> None:
        """Add a page; the first one, or the one in control that returns, gets control."""
        with self._lock:
            self._pages.setdefault(page, Watcher()).lines += 1
            if self.holder is None or (self.holder != page and self._free()):
                self.holder = page
            if self.holder == page:
                self._back()

    def leave(self, page: str) -> None:
        """Remove one connection of a page."""
        with self._lock:
            one = self._pages.get(page)
            if one is None:
                return
            one.lines -= 1
            if one.lines > 0:
                return
            one.left = self._clock()
            if self.wanted == page:
                self.wanted = None
            if self.holder == page:
                self._lost()
            else:
                del self._pages[page]

    def ask(self, page: str) -> bool:
        """Request control for a page; return whether it has control now."""
        with self._lock:
            if self.holder == page:
                return True
            if self.holder is None or self._free() or not self.present:
                self._take(page)
                return True
            self.wanted = page
            return False

    def give(self, page: str) -> bool:
        """Hand control over to the page that requested it; return whether that happened."""
        with self._lock:
            if self.holder != page or self.wanted is None:
                return False
            self._take(self.wanted)
            return True

    def tick(self) -> None:
        """Pass control to the only other page if the page in control has been away for too long."""
        with self._lock:
            there = [name for name, one in self._pages.items() if one.lines > 0]
            if len(there) == 1 and there[0] != self.holder and self._free(HOLD + AFTER):
                self._take(there[0])

    def keep(self, page: str) -> None:
        """Refuse the request for control."""
        with self._lock:
            if self.holder == page:
                self.wanted = None

    def _take(self, page: str) -> None:
        before, self.holder, self.wanted = self.holder, page, None
        if before is not None and self._pages.get(before, Watcher()).lines == 0:
            self._pages.pop(before, None)
        self._back()

    def holds(self, page: str) -> bool:
        """Whether a page is in control."""
        return self.holder == page

    @property
    def present(self) -> bool:
        """Whether the page in control is connected."""
        return self.holder is not None and self._pages.get(self.holder, Watcher()).lines > 0

    @property
    def watching(self) -> int:
        """Number of other connected pages."""
        with self._lock:
            return sum(1 for name, one in self._pages.items() if one.lines > 0 and name != self.holder)

    def _free(self, longest: float = HOLD) -> bool:
        """Whether the page in control has been away for longer than a time [s]."""
        one = self._pages.get(self.holder or "")
        return one is None or (one.lines == 0 and self._clock() - one.left > longest)
