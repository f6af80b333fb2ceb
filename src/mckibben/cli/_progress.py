"""Progress with the time left, and Ctrl-C: a command ends at once and says what is kept.

Python's own handling of Ctrl-C waits until compiled code returns, which may take many seconds. A thread is woken by the
signal itself and ends the process if the command has not ended within `PATIENCE`; not while a file is written, and not while
a machine is moving, which is vented first.
"""

from __future__ import annotations

import contextlib
import math
import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import typer

from . import _terminal

PATIENCE = 0.12  # that a command has to end by itself after Ctrl-C [s]
PATIENT_PIPE = 2.0  # that work takes before its progress is written into a pipe [s]
INTERRUPTED = 130
ENDING = tuple(getattr(signal, n) for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n))


class _Guard:
    """State of the guard of one call."""

    def __init__(self) -> None:
        self.ended = threading.Event()
        self.protected = 0
        self.kept: list[str] = []
        self.sentence: str | Callable[[], str] = "nothing was written"


_guard = _Guard()


def sentence() -> str:
    """What is said after Ctrl-C."""
    if _guard.kept:
        return f"interrupted; kept: {', '.join(_guard.kept)}"
    return f"interrupted; {_guard.sentence() if callable(_guard.sentence) else _guard.sentence}"


def keep(path: str) -> None:
    """Name a file that stays whatever happens from now on."""
    _guard.kept.append(path)


def ended() -> None:
    """Tell that the command has ended by itself after Ctrl-C."""
    _guard.ended.set()


@contextlib.contextmanager
def protected() -> Iterator[None]:
    """Let Ctrl-C not end the process by force: while a file is written or a machine moves."""
    guard = _guard
    guard.protected += 1
    try:
        yield
    finally:
        guard.protected -= 1


@contextlib.contextmanager
def guarded() -> Iterator[None]:
    """End the process soon after Ctrl-C, even in the midst of compiled code; what is kept starts again with every call."""
    global _guard
    before, _guard = _guard, _Guard()
    try:
        with _watched():
            yield
    finally:
        _guard = before


@contextlib.contextmanager
def _watched() -> Iterator[None]:
    """A thread that ends the process, where this thread is the one that gets signals and nobody else handles them."""
    if threading.current_thread() is not threading.main_thread() or os.name == "nt":
        yield
        return
    if signal.getsignal(signal.SIGINT) is not signal.default_int_handler:
        yield
        return
    woken, wakes = socket.socketpair()
    wakes.setblocking(False)
    former = signal.set_wakeup_fd(wakes.fileno(), warn_on_full_buffer=False)
    watcher = threading.Thread(target=_watch, args=(woken, _guard), name="interrupts", daemon=True)
    watcher.start()
    try:
        yield
    finally:
        signal.set_wakeup_fd(former)
        _guard.ended.set()
        wakes.close()
        watcher.join(1.0)
        woken.close()


def _watch(woken: socket.socket, guard: _Guard) -> None:
    with contextlib.suppress(OSError):
        while data := woken.recv(1):
            if data[0] in ENDING:
                while not guard.ended.wait(PATIENCE):
                    if not guard.protected:
                        _end(128 + data[0])
                return


def _end(code: int) -> None:
    """End the process and those that it has started."""
    multiprocessing = sys.modules.get("multiprocessing")
    for child in multiprocessing.active_children() if multiprocessing is not None else []:
        with contextlib.suppress(OSError):
            child.kill()
    if sys.stderr.isatty():
        sys.stderr.write("\r\x1b[2K\x1b[?25h")  # the line of the progress, and a cursor again
    typer.echo(f"{_terminal.program(31)}: {sentence()}", err=True)
    for stream in (sys.stdout, sys.stderr):
        with contextlib.suppress(OSError, ValueError):
            stream.flush()
    os._exit(code)


# ---- progress


class Progress:
    """A bar with the time left, a line with the time passed where the amount of work is not known, or lines in a pipe."""

    def __init__(self, bar: Any, task: Any, title: str, *, piped: bool = False) -> None:
        self._bar, self._task, self._what = bar, task, title
        self._begin, self._next = time.monotonic(), PATIENT_PIPE if piped else math.inf

    def __call__(self, words: str = "", by: float = 1.0) -> None:
        """Tell what is done now, and how many parts more are done."""
        self._show(words, 1.0, advance=by)

    def tell(self, words: str) -> None:
        """Tell what is done now."""
        self(words, 0.0)

    def at(self, done: float, total: float) -> None:
        """Tell how far it is, both in seconds of the run."""
        self._show(f"{done:.1f} s of {total:.1f} s", completed=done, total=total)

    def reached(self, done: float, total: float, words: str) -> None:
        """Tell how much is done altogether, with words."""
        self._show(words, completed=done, total=total)

    def _show(self, words: str, pause: float = 1.5, **changes: float) -> None:
        said = f"{self._what}: {words}" if words else self._what
        if self._bar is not None:
            self._bar.update(self._task, description=said, **changes)
        elif (passed := time.monotonic() - self._begin) >= self._next:
            typer.echo(said, err=True)
            self._next = pause * passed  # a stage has a line of its own, and hours of samples have twenty


def _is_piped() -> bool:
    """Whether standard error goes to another program or a file, and is not collected by this one."""
    with contextlib.suppress(OSError, ValueError, AttributeError):
        return sys.stderr.fileno() >= 0
    return False


@contextlib.contextmanager
def progress(
    title: str,
    total: float | None = None,
    *,
    saved: str | Callable[[], str] = "nothing was written",
    guarded: bool = True,
) -> Iterator[Progress]:
    """Show progress on standard error: on a terminal as a bar, in a pipe or file as lines.

    Args:
        title: is done, such as ``fitting``.
        total: parts of the work; None if that is not known.
        saved: what stays after Ctrl-C, as a sentence; or a function that says it at that moment.
        guarded: whether Ctrl-C may end the process by force.
    """
    _terminal.say_cautions()
    _guard.sentence = saved
    with contextlib.nullcontext() if guarded else protected():
        if not sys.stderr.isatty() or _terminal.is_quiet():
            yield Progress(None, None, title, piped=_is_piped() and not _terminal.is_quiet())
            return
        from rich import progress as rich_progress
        from rich.console import Console

        columns: list[Any] = [rich_progress.TextColumn("{task.description}")]
        if total is None:
            columns = [rich_progress.SpinnerColumn(), *columns, rich_progress.TimeElapsedColumn()]
        else:
            left = rich_progress.TimeRemainingColumn(elapsed_when_finished=True)
            columns += [rich_progress.BarColumn(), left, rich_progress.TextColumn("left")]
        with rich_progress.Progress(*columns, console=Console(stderr=True), transient=True) as bar:
            yield Progress(bar, bar.add_task(title, total=total), title)


@contextlib.contextmanager
def told(title: str, stages: int | None = None) -> Iterator[Callable[[str], None]]:
    """Progress of work whose stages report when they begin; yields the function to report to.

    Args:
        title: is done, such as ``sizing``.
        stages: most of them, of which the time left follows; None if that is not known.
    """
    with progress(title, stages) as bar:
        begun = 0

        def tell(words: str) -> None:
            nonlocal begun
            bar(words, 1.0 if stages is not None and begun else 0.0)
            begun += 1

        yield tell
