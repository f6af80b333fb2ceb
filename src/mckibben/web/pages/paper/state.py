"""State of the reproduction of the papers: one for all visitors, computed in processes of its own."""

from __future__ import annotations

import base64
import shutil
import tempfile
import threading
import time
import weakref
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

from ....errors import InputError, MckibbenError
from ....report.paper_figures import FIGURES, PaperFigure, figure
from ....reproduction import RowOutcome
from ....reproduction.rows import all_rows, needs_recording
from .jobs import STOPPED, WorkerProcess

if TYPE_CHECKING:
    from ....web.workspace import Workspace

HEAVY = 25.0  # a row of recordings takes about so many times as long as another
TOLD_FROM = 0.08  # share of the work from which on the time left is shown
LEFT_OUT = "Rows that need recordings of the simulated test machine were left out."


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
        """Compute the missing rows, quick ones first.

        Args:
            names: names of rows; all by default.
            recordings: off leaves out the rows that take recordings of the simulated test machine.

        Raises:
            InputError: it runs already, or there is no such row.
        """
        with self._lock:
            if self.running:
                raise InputError("run", None, "must wait: rows are being computed; stop that first")
            for name in names or ():
                if name not in self.rows:
                    raise InputError(
                        "row", name[:80], "no row begins with that; `mckibben reproduce --json` lists them"
                    )
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
            self._changed()
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
            self._changed()

    def _ended(self, name: str) -> None:
        self._done += self._cost(name)
        if name in self.wanted:
            self.wanted.remove(name)

    # ---- figures

    def draw(self, name: str, *, pressing: bool = True) -> None:
        """Draw a figure, if it is not drawn yet.

        Raises:
            InputError: there is no such figure.
        """
        of = figure(name)
        with self._lock:
            if name in self.pictures or (name in self.asked and not pressing):
                return
            again = name in self.asked
            self.refused.pop(name, None)
            self.asked[name] = self.asked.get(name) or "waiting"
            self._changed()
            if again:
                self._draws.hurry(("figure", name))
            else:
                self._draws.ask(("figure", name), lambda kind, *m: self._hear_figure(of, kind, *m), pressing=pressing)

    def stop_drawing(self, name: str) -> None:
        """Stop drawing a figure."""
        self._draws.stop(("figure", name))

    def file(self, name: str, wish: object) -> tuple[str, bytes]:
        """Draw a figure as a file, see `web.save.figure_file`; waits for it.

        Raises:
            MckibbenError: if it cannot be drawn.
        """
        ended, answers = threading.Event(), dict[str, tuple[Any, ...]]()

        def hear(kind: str, *more: Any) -> None:
            answers[kind] = more
            if kind in ("done", "refused"):
                ended.set()

        self._draws.ask(("file", name, wish), hear)
        ended.wait()
        if "file" not in answers:
            raise MckibbenError(str(answers.get("refused", ("the figure was not drawn",))[0]))
        file, data = answers["file"]
        return file, data

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
            self._changed()

    # ---- report

    def report(self, ending: str, tell: Callable[[str], None]) -> bytes:
        """Write the report of the command line from the present results; wait for it.

        Raises:
            InputError: it cannot be written; says why.
        """
        with self._lock:
            outcomes = [self.outcomes.get(r.id) or RowOutcome(r, None, None, r.note) for r in self.rows.values()]
            figures = [f.id for f in FIGURES.values() if self.ready(f)]
        reports: list[bytes] = []
        why: list[str] = []
        ended = threading.Event()

        def hear(kind: str, *more: Any) -> None:
            if kind == "report":
                reports.append(more[0])
            elif kind == "tell":
                tell(more[0])
            elif kind in ("done", "refused"):
                why.extend(more)
                ended.set()

        full = len(figures) == len(FIGURES)
        self._draws.ask(("report", ending, outcomes, figures, "" if full else LEFT_OUT), hear)
        ended.wait()
        if not reports:
            raise InputError("report", ending, why[0] if why else STOPPED)
        return reports[0]

    def _changed(self) -> None:
        self.version += 1


_of: weakref.WeakKeyDictionary[Any, Reproduction] = weakref.WeakKeyDictionary()
_one = threading.Lock()


def reproduction(workspace: Workspace) -> Reproduction:
    """Reproduction of a server; made at the first call."""
    with _one:
        if workspace not in _of:
            _of[workspace] = Reproduction()
            workspace.on_close(_of[workspace].close)
        return _of[workspace]
