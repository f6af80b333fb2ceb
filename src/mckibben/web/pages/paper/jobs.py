"""Background work of the page The paper: processes that compute rows, draw figures and write reports.

A process takes jobs from a pipe and answers with what it is at, what it found, and ``done`` or ``refused`` with a sentence.
Ending it is how a job is stopped; recordings that were finished stay in a folder that all processes share.
"""

from __future__ import annotations

import contextlib
import hashlib
import heapq
import io
import itertools
import logging
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from ....errors import MckibbenError
from ....recordings import Recording, read_recording
from ....report.document_pdf import compiler
from ....report.figures import style
from ....report.paper_figures import figure
from ....report.reproduction_report import draw, reproduction_report
from ....reproduction.recorded import PAUSE, Folder, kept_in, told
from ....reproduction.rows import all_rows, reproduce_row
from ...save import figure_file

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from ....reproduction import RowOutcome

THUMB = 168  # width of a small picture [px]
OFTEN = 0.25  # least time between two words on how far it is [s]
LATER = 5  # less pressing than whatever else the machine does


def work(line: Connection, place: str) -> None:
    """Execute jobs until the pipe is closed.

    Args:
        line: jobs come and answers go through it.
        place: folder of the recordings.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends this process
    with contextlib.suppress(OSError, AttributeError):
        os.nice(LATER)

    said = _Teller(line)
    with told(said), kept_in(RecordingCache(Path(place), said)), contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            kind, *arguments = line.recv()
            try:
                JOBS[kind](line, said, *arguments)
                line.send(("done",))
            except MckibbenError as error:
                line.send(("refused", str(error)))
            except (ArithmeticError, OSError, RuntimeError, ValueError) as error:
                line.send(("refused", f"{type(error).__name__}: {error}"[:400]))


class _Teller:
    """Forwards messages at a readable rate."""

    def __init__(self, line: Connection) -> None:
        self.line, self.last = line, 0.0

    def __call__(self, words: str) -> None:
        now = time.monotonic()
        if now - self.last >= OFTEN:
            self.last = now
            self.line.send(("tell", words))


def _rows(line: Connection, said: _Teller, names: Sequence[str]) -> None:
    """Compute rows; one that fails does not stop the others."""
    known = {row.id: row for row in all_rows()}
    for name in names:
        line.send(("row", name))
        try:
            line.send(("outcome", reproduce_row(known[name])))
        except (MckibbenError, ArithmeticError, OSError) as error:
            line.send(("failed", name, str(error)[:600]))


def _figure(line: Connection, said: _Teller, name: str) -> None:
    """Draw one figure in the paper's form."""
    of = figure(name)
    said(f"drawing {of.title}")
    picture = of.draw()
    small = io.BytesIO()
    with style.styled():
        picture.savefig(small, format="png", dpi=THUMB / picture.get_size_inches()[0], metadata={"Software": None})
    label = f"{of.title}. {of.caption}"
    line.send(("figure", name, style.inline_svg(picture, f"figure-{name}", label), small.getvalue()))


def _file(line: Connection, said: _Teller, name: str, wish: object) -> None:
    """Draw one figure as a file."""
    of = figure(name)
    line.send(("file", *figure_file(of.title, lambda _: of.draw(), wish)))


def _report(
    line: Connection, said: _Teller, ending: str, outcomes: list[RowOutcome], figures: list[str], left_out: str
) -> None:
    """Write the report of the command line."""
    if ending == ".pdf":
        compiler()  # refuses before minutes of work are done
    drawn = draw([figure(f) for f in figures], lambda f: said(f"figure {f.id}: {f.title}"))
    said("writing the report")
    document = reproduction_report(outcomes, drawn, left_out=left_out)
    line.send(("report", document.pdf() if ending == ".pdf" else document.html().encode("utf-8")))


Job: TypeAlias = tuple[Any, ...]  # the name of a job in `JOBS`, and what its function takes behind line and teller
JOBS: dict[str, Any] = {"rows": _rows, "figure": _figure, "file": _file, "report": _report}


_log = logging.getLogger(__name__)
IDLE = 180.0  # after which a process that has nothing to do is ended [s]
LAST = 10.0  # longest wait for the thread of a process that was closed [s]
STOPPED = "stopped"


class WorkerProcess:
    """A worker process, started with its first job, and again after it was stopped.

    Args:
        place: folder of the recordings.
    """

    def __init__(self, place: str) -> None:
        self.place = place
        self._jobs: list[tuple[int, int, Job, Callable[..., None]]] = []  # a heap
        self._count, self._lock = itertools.count(), threading.Condition()
        self._at: Job | None = None  # the job that is done now
        self._stopped = self._closed = False
        self._process: Any = None
        self._line: Any = None
        self._thread: threading.Thread | None = None

    def ask(self, job: Job, hear: Callable[..., None], *, pressing: bool = True) -> None:
        """Queue a job; `hear` is called with every answer, in another thread, with ``done`` or ``refused`` last."""
        with self._lock:
            if not self._closed:
                heapq.heappush(self._jobs, (0 if pressing else 1, next(self._count), job, hear))
                self._lock.notify()
                if self._thread is None:
                    self._thread = threading.Thread(target=self._go, name="paper", daemon=True)
                    self._thread.start()
                return
        hear("refused", STOPPED)

    def hurry(self, job: Job) -> None:
        """Execute a queued job before others."""
        with self._lock:
            self._jobs = [(0, *one[1:]) if one[2] == job else one for one in self._jobs]
            heapq.heapify(self._jobs)

    def stop(self, job: Job) -> None:
        """Stop a job; if it is running, its process ends and the others continue in a new one."""
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

    def close(self) -> None:
        """End the process and refuse all jobs, those to come too, so that none starts a process while this one ends."""
        with self._lock:
            self._closed = self._stopped = True
            waiting, self._jobs = self._jobs, []
            if self._process is not None:
                self._process.terminate()
            thread = self._thread
            self._lock.notify()
        for *_, hear in waiting:
            hear("refused", STOPPED)
        if thread is not None:
            thread.join(LAST)

    def _go(self) -> None:
        while True:
            with self._lock:
                self._lock.wait_for(lambda: self._jobs or self._closed, IDLE)
                if not self._jobs:
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
            hear("refused", STOPPED if self._stopped else "the worker process ended; request it again")

    def _begin(self) -> None:
        with self._lock:
            if self._stopped:
                raise EOFError  # before it began
            if self._process is not None and self._process.is_alive():
                return
            self._end()
            context = multiprocessing.get_context("spawn")
            self._line, other = context.Pipe()
            self._process = context.Process(target=work, args=(other, self.place), daemon=True, name="paper")
            self._process.start()
            other.close()

    def _end(self) -> None:
        if self._process is None:
            return
        self._process.terminate()
        self._process.join(5.0)
        self._line.close()
        self._process = self._line = None


YOUNG = 5.0  # age of a claim without a name in it that may still be written [s]


class RecordingCache(Folder):
    """Recordings by key; concurrent requests for a key share one computation.

    Args:
        place: place of the folder.
        tell: told when it is waited.
    """

    def __init__(self, place: Path, tell: Callable[[str], None]) -> None:
        super().__init__(place)
        self.tell = tell

    def one(self, key: str, make: Callable[[], Recording]) -> Recording:
        """Return the recording of a key, from the cache or computed now."""
        name = hashlib.sha256(key.encode()).hexdigest()[:24]
        file, claim = self.place / f"{name}.nc", self.place / f"{name}.claim"
        while not file.exists():
            if not self._mine(claim):
                self.tell("waiting for the recording from which the rows are computed")
                time.sleep(PAUSE)
                continue
            try:
                recording = make()
                recording.save(file)
                return recording
            finally:
                claim.unlink(missing_ok=True)
        return read_recording(file)

    def _mine(self, claim: Path) -> bool:
        try:
            line = os.open(claim, os.O_CREAT | os.O_EXCL | os.O_WRONLY)
        except FileExistsError:
            if _left(claim):
                claim.unlink(missing_ok=True)
            return False
        os.write(line, str(os.getpid()).encode())
        os.close(line)
        return True


def _left(claim: Path) -> bool:
    """Whether the process of a claim has ended."""
    try:
        owner = claim.read_text()
        if not owner:
            return time.time() - claim.stat().st_mtime > YOUNG
        os.kill(int(owner), 0)
    except ProcessLookupError:
        return True
    except (FileNotFoundError, PermissionError):
        return False
    return False
