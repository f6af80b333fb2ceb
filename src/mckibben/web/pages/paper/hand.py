"""A worker process with its queue: jobs one after the other, the pressing ones first, and a stop that is at once."""

from __future__ import annotations

import heapq
import itertools
import logging
import multiprocessing
import threading
from collections.abc import Callable
from typing import Any

from .worker import work

_log = logging.getLogger(__name__)
IDLE = 180.0  # after which a process that has nothing to do is ended [s]
STOPPED = "stopped"


class Hand:
    """One process; it is started with its first job, and again after a stop.

    Args:
        place: folder of the recordings.
    """

    def __init__(self, place: str) -> None:
        self.place = place
        self._jobs: list[tuple[int, int, tuple[Any, ...], Callable[..., None]]] = []  # a heap
        self._count, self._lock = itertools.count(), threading.Condition()
        self._at: tuple[Any, ...] | None = None  # the job that is done now
        self._stopped = False
        self._process: Any = None
        self._line: Any = None
        self._thread: threading.Thread | None = None

    def ask(self, job: tuple[Any, ...], hear: Callable[..., None], *, pressing: bool = True) -> None:
        """Put a job in the queue; `hear` is told every answer, in another thread, ``done`` or ``refused`` the last."""
        with self._lock:
            heapq.heappush(self._jobs, (0 if pressing else 1, next(self._count), job, hear))
            self._lock.notify()
            if self._thread is None:
                self._thread = threading.Thread(target=self._go, name="paper", daemon=True)
                self._thread.start()

    def hurry(self, job: tuple[Any, ...]) -> None:
        """Do a job that waits before others that do."""
        with self._lock:
            self._jobs = [(0, *one[1:]) if one[2] == job else one for one in self._jobs]
            heapq.heapify(self._jobs)

    def stop(self, job: tuple[Any, ...]) -> None:
        """Stop a job; one that is done now ends with its process, others go on in a new one."""
        with self._lock:
            waiting = [one for one in self._jobs if one[2] == job]
            self._jobs = [one for one in self._jobs if one[2] != job]
            heapq.heapify(self._jobs)
            if self._at == job:
                self._stopped = True
                if self._process is not None:
                    self._process.terminate()
        for *_, hear in waiting:
            hear("refused", STOPPED)

    def _go(self) -> None:
        while True:
            with self._lock:
                if not self._jobs and not self._lock.wait_for(lambda: self._jobs, IDLE):
                    self._end()
                    self._thread = None
                    return
                *_, job, hear = heapq.heappop(self._jobs)
                self._at, self._stopped = job, False
            self._do(job, hear)
            with self._lock:
                self._at = None

    def _do(self, job: tuple[Any, ...], hear: Callable[..., None]) -> None:
        try:
            self._begin()
            self._line.send(job)
            while True:
                answer = self._line.recv()
                try:
                    hear(*answer)
                except Exception:  # a listener's fault is no reason to leave the others without answers
                    _log.exception("a listener of the paper's process failed")
                if answer[0] in ("done", "refused"):
                    return
        except (EOFError, OSError):
            with self._lock:
                self._end()
            hear("refused", STOPPED if self._stopped else "the process that worked at it ended; ask for it again")

    def _begin(self) -> None:
        with self._lock:
            if self._process is not None and self._process.is_alive():
                return
            self._end()
            context = multiprocessing.get_context("spawn")
            self._line, other = context.Pipe()
            self._process = context.Process(target=work, args=(other, self.place), daemon=True, name="paper")
            self._process.start()
            other.close()
            if self._stopped:
                self._process.terminate()

    def _end(self) -> None:
        if self._process is None:
            return
        self._process.terminate()
        self._process.join(5.0)
        self._line.close()
        self._process = self._line = None
