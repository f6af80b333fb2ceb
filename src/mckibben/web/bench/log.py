"""The status messages of a machine, newest last; each with its time, a kind and a sentence."""

from __future__ import annotations

import threading
from collections import deque
from typing import Any

KEPT = 500
KINDS = ("note", "done", "caution", "stop")


class Log:
    """The newest messages; safe for use by several threads."""

    def __init__(self) -> None:
        self._lock, self._count = threading.Lock(), 0
        self._kept: deque[dict[str, Any]] = deque(maxlen=KEPT)

    def say(self, text: str, kind: str = "note", time: float | None = None) -> None:
        """Add a message, at a time of the run [s] if it has one."""
        with self._lock:
            self._count += 1
            self._kept.append({"number": self._count, "time": time, "kind": kind, "text": text})

    def after(self, number: int) -> list[dict[str, Any]]:
        """Return the messages after the one with a number."""
        with self._lock:
            return [m for m in self._kept if m["number"] > number]
