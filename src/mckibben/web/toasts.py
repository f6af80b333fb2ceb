"""Notices of completed actions, with Undo for 20 s, at the foot of a page."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..documents import JsonValue
from ..errors import InputError

LASTS = 20.0  # time for which a thing can be undone [s]


@dataclass
class Toast:
    """Notice of one completed action.

    Attributes:
        number: counted from 1.
        text: description of the action, a sentence.
        undo: brings it back; None if nothing can.
        commit: makes it final when its time has run out.
        left: time that is left while nobody looks at it closely [s].
        since: when that began to run [s]; None while it waits.
    """

    number: int
    text: str
    undo: Callable[[], Any] | None
    commit: Callable[[], Any] | None
    left: float
    since: float | None


class Toasts:
    """Notices of a server; safe for use by several threads.

    Args:
        clock: seconds that only go forward.
    """

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock, self._lock, self._count = clock, threading.RLock(), 0
        self._kept: dict[int, Toast] = {}
        self.version = 0

    def tell(
        self,
        text: str,
        undo: Callable[[], object] | None = None,
        commit: Callable[[], object] | None = None,
        lasts: float = LASTS,
    ) -> int:
        """Add a notice; return its number."""
        with self._lock:
            self._count += 1
            self._kept[self._count] = Toast(self._count, text, undo, commit, lasts, self._clock())
            self.version += 1
            return self._count

    def undo(self, number: int | None = None) -> str:
        """Undo the newest action, or a given one; return its description.

        Raises:
            InputError: if nothing can be undone any more.
        """
        with self._lock:
            can = [n for n, t in self._kept.items() if t.undo is not None and (number is None or n == number)]
            if not can:
                raise InputError("undo", None, f"comes too late: what was done can be undone for {LASTS:g} s")
            toast = self._kept.pop(can[-1])
            self.version += 1
        assert toast.undo is not None
        toast.undo()
        return toast.text

    def wait(self, number: int, waits: bool) -> None:
        """Pause the time of a notice while the pointer is on it, or resume it."""
        with self._lock:
            toast = self._kept.get(number)
            if toast is None or (toast.since is None) == waits:
                return
            now = self._clock()
            if toast.since is None:
                toast.since = now
            else:
                toast.left, toast.since = toast.left - (now - toast.since), None
            self.version += 1

    def close(self, number: int) -> None:
        """Commit an action, since its notice was closed."""
        with self._lock:
            toast = self._kept.pop(number, None)
            self.version += 1
        if toast is not None and toast.commit is not None:
            toast.commit()

    def tick(self) -> None:
        """Commit actions whose time for Undo is over."""
        now = self._clock()
        with self._lock:
            over = [t.number for t in self._kept.values() if t.since is not None and now - t.since >= t.left]
        for number in over:
            self.close(number)

    def finish(self) -> None:
        """Commit all actions."""
        for number in list(self._kept):
            self.close(number)

    def plain(self) -> list[dict[str, JsonValue]]:
        """Notices for JSON, the oldest first; ``left`` is the remaining time [s]."""
        now = self._clock()
        with self._lock:
            return [
                {
                    "number": t.number,
                    "text": t.text,
                    "undo": t.undo is not None,
                    "waits": t.since is None,
                    "left": max(0.0, t.left - (0.0 if t.since is None else now - t.since)),
                }
                for t in self._kept.values()
            ]
