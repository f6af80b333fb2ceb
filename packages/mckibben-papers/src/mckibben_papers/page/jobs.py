"""The reproduction of the papers, one for all visitors: processes that compute rows, draw figures and write reports.

A process takes jobs from a pipe and answers with what it is at, what it found, and ``done`` or ``refused`` with a sentence.
Ending it is how a job is stopped; recordings that were finished stay in a folder that all processes share.
"""

from __future__ import annotations

import base64
import contextlib
import heapq
import io
import itertools
import logging
import multiprocessing
import os
import shutil
import signal
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

from mckibben.documents import locked
from mckibben.errors import InputError, MckibbenError
from mckibben.recordings import Recording, read_recording
from mckibben.report.document_pdf import compiler
from mckibben.report.figures import style
from mckibben.web.charts import figure_file
from mckibben.web.workspace import Workspace

from ..figures import FIGURES, PaperFigure, figure
from ..report import LEFT_OUT, draw, reproduction_report
from ..reproduction import PAUSE, Folder, kept_in, told
from ..rows import RowOutcome, all_rows, needs_recording, reproduce_row

if TYPE_CHECKING:
    from multiprocessing.connection import Connection


THUMB = 168  # width of a small picture [px]
OFTEN = 0.25  # least time between two words on how far it is [s]
LATER = 5  # less pressing than whatever else the machine does


def work(line: Connection, place: str) -> None:
    """Execute jobs until the pipe is closed."""
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
    of = figure(name)
    said(f"drawing {of.title}")
    picture = of.draw()
    small = io.BytesIO()
    with style.styled():
        picture.savefig(small, format="png", dpi=THUMB / picture.get_size_inches()[0], metadata={"Software": None})
    label = f"{of.title}. {of.caption}"
    line.send(("figure", name, style.inline_svg(picture, f"figure-{name}", label), small.getvalue()))


def _file(line: Connection, said: _Teller, name: str, wish: object) -> None:
    of = figure(name)
    line.send(("file", *figure_file(of.title, lambda _: of.draw(), wish)))


def _report(
    line: Connection, said: _Teller, ending: str, outcomes: list[RowOutcome], figures: list[str], left_out: str
) -> None:
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
    """A worker process, started with its first job, and again after it was stopped."""

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


class RecordingCache(Folder):
    """Recordings by key; concurrent requests for a key share one computation."""

    def __init__(self, place: Path, tell: Callable[[str], None]) -> None:
        super().__init__(place)
        self.tell = tell

    def one(self, key: str, make: Callable[[], Recording]) -> Recording:
        """Return the recording of a key, from the cache or computed now."""
        file = self.file(key)
        while not file.exists():
            with locked(file.with_suffix(".lock")) as mine:
                if mine and not file.exists():  # else another process made it since the look above
                    recording = make()
                    recording.save(file)
                    return recording
            if not mine:
                self.tell("waiting for the recording from which the rows are computed")
                time.sleep(PAUSE)
        return read_recording(file)


HEAVY = 25.0  # a row of recordings takes about so many times as long as another
TOLD_FROM = 0.08  # share of the work from which on the time left is shown


class PaperPicture(NamedTuple):
    """A figure for the page: SVG in the page's colours, and a small PNG as a data URL."""

    svg: str
    small: str


class Reproduction:
    """State of rows, figures and reports; safe for use by several threads."""

    def __init__(self) -> None:
        place = tempfile.mkdtemp(prefix="mckibben-paper-")
        weakref.finalize(self, shutil.rmtree, place, ignore_errors=True)
        self.rows = {row.id: row for row in all_rows()}
        self.outcomes: dict[str, RowOutcome] = {}
        self.failed: dict[str, str] = {}
        self.pictures: dict[str, PaperPicture] = {}
        self.refused: dict[str, str] = {}  # figure: why it was not drawn
        self.asked: dict[str, str] = {}  # figure that is drawn: how far
        self.wanted: list[str] = []  # rows that the run has still to do, the one at work first
        self.now, self.words = "", ""
        self.version = 0
        self._began, self._weight, self._done = 0.0, 0.0, 0.0
        self._lock = threading.RLock()
        self._job: tuple[Any, ...] = ()
        self._rows, self._draws = WorkerProcess(place), WorkerProcess(place)

    def close(self) -> None:
        """End the processes; whatever waits for them is refused."""
        for worker in (self._rows, self._draws):
            worker.close()

    @property
    def running(self) -> bool:
        """Whether rows are being computed."""
        return bool(self.wanted)

    def run(self, names: Sequence[str] | None = None, *, recordings: bool = True) -> None:
        """Compute the missing rows, quick ones first."""
        with self._lock:
            if self.running:
                raise InputError("run", None, "must wait: rows are being computed; stop that first")
            for name in names or ():
                if name not in self.rows:
                    why = "no row begins with that; `mckibben reproduce --json` lists them"
                    raise InputError("row", name[:80], why)
            chosen = [r for r in self.rows.values() if (names is None or r.id in names) and r.id not in self.outcomes]
            quick = [r.id for r in chosen if not needs_recording(r)]
            slow = [r.id for r in chosen if needs_recording(r)] if recordings else []
            self.wanted = quick + slow
            if not self.wanted:
                return
            for name in self.wanted:
                self.failed.pop(name, None)
            self._began, self._done, self._weight = time.monotonic(), 0.0, sum(map(self._cost, self.wanted))
            self.now, self.words = "", "starting"
            self.version += 1
            self._job = ("rows", list(self.wanted))
            self._rows.ask(self._job, self._hear_rows)

    def stop(self) -> None:
        """Stop the computation; results are kept."""
        self._rows.stop(self._job)

    def left(self) -> float | None:
        """Estimated remaining time of the computation [s]; None if unknown."""
        if not self.running or self._done < TOLD_FROM * self._weight:
            return None
        return (time.monotonic() - self._began) * (self._weight - self._done) / self._done

    def _cost(self, name: str) -> float:
        return HEAVY if needs_recording(self.rows[name]) else 1.0

    def _hear_rows(self, kind: str, *more: Any) -> None:
        with self._lock:
            if kind == "row":
                self.now, self.words = more[0], self.rows[more[0]].what
            elif kind == "tell":
                self.words = more[0]
            elif kind == "outcome":
                self.outcomes[more[0].row.id] = more[0]
                self._ended(more[0].row.id)
            elif kind == "failed":
                self.failed[more[0]] = more[1]
                self._ended(more[0])
            else:  # done or refused
                if kind == "refused" and more[0] != STOPPED and self.now:
                    self.failed[self.now] = more[0]
                self.wanted, self.now, self.words = [], "", ""
            self.version += 1

    def _ended(self, name: str) -> None:
        self._done += self._cost(name)
        if name in self.wanted:
            self.wanted.remove(name)

    # ---- figures

    def draw(self, name: str, *, pressing: bool = True) -> None:
        """Draw a figure, if it is not drawn yet."""
        of = figure(name)
        with self._lock:
            if name in self.pictures or (name in self.asked and not pressing):
                return
            again = name in self.asked
            self.refused.pop(name, None)
            self.asked[name] = self.asked.get(name) or "waiting"
            self.version += 1
            if again:
                self._draws.hurry(("figure", name))
            else:
                self._draws.ask(("figure", name), lambda kind, *m: self._hear_figure(of, kind, *m), pressing=pressing)

    def stop_drawing(self, name: str) -> None:
        """Stop drawing a figure."""
        self._draws.stop(("figure", name))

    def file(self, name: str, wish: object) -> tuple[str, bytes]:
        """Draw a figure as a file, see `charts.figure_file`; waits for it."""
        answers = self._waited(("file", name, wish))
        if "file" not in answers:
            raise MckibbenError(str(answers["refused"][0]))
        file, data = answers["file"]
        return file, data

    def _waited(self, job: Job, tell: Callable[[str], None] = lambda words: None) -> dict[str, tuple[Any, ...]]:
        """All that a job answers, by kind."""
        ended, answers = threading.Event(), dict[str, tuple[Any, ...]]()

        def hear(kind: str, *more: Any) -> None:
            answers[kind] = more
            if kind == "tell":
                tell(more[0])
            elif kind in ("done", "refused"):
                ended.set()

        self._draws.ask(job, hear)
        ended.wait()
        return answers

    def ready(self, of: PaperFigure) -> bool:
        """Whether a figure can be drawn without minutes of computation."""
        return not of.recordings or bool(of.rows) and all(r in self.outcomes for r in of.rows)

    def _hear_figure(self, of: PaperFigure, kind: str, *more: Any) -> None:
        with self._lock:
            if kind == "figure":
                small = "data:image/png;base64," + base64.b64encode(more[2]).decode("ascii")
                self.pictures[of.id] = PaperPicture(more[1], small)
            elif kind == "tell":
                self.asked[of.id] = more[0]
            elif kind in ("done", "refused"):
                self.asked.pop(of.id, None)
                if kind == "refused":
                    self.refused[of.id] = more[0]
            self.version += 1

    # ---- report

    def report(self, ending: str, tell: Callable[[str], None]) -> bytes:
        """Write the report of the command line from the present results; wait for it."""
        with self._lock:
            outcomes = [self.outcomes.get(r.id) or RowOutcome(r, None, None, r.note) for r in self.rows.values()]
            figures = [f.id for f in FIGURES.values() if self.ready(f)]
        left_out = "" if len(figures) == len(FIGURES) else LEFT_OUT
        answers = self._waited(("report", ending, outcomes, figures, left_out), tell)
        if "report" not in answers:
            raise InputError("report", ending, str(answers["refused"][0]))
        data: bytes = answers["report"][0]
        return data


_of: weakref.WeakKeyDictionary[Any, Reproduction] = weakref.WeakKeyDictionary()
_one = threading.Lock()


def reproduction(workspace: Workspace) -> Reproduction:
    """Reproduction of a server; made at the first call."""
    with _one:
        if workspace not in _of:
            _of[workspace] = Reproduction()
            workspace.on_close(_of[workspace].close)
        return _of[workspace]
