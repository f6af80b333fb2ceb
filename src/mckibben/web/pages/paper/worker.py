"""A process of its own that computes rows, draws figures and writes reports, so that the server goes on meanwhile.

It takes jobs from a pipe and answers with what it is at, what it found, and ``done`` or ``refused`` with a sentence. Ending
the process is how a job is stopped; recordings that were finished stay in the folder.
"""

from __future__ import annotations

import contextlib
import io
import os
import signal
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

    from ....reproduction import RowOutcome

THUMB = 168  # width of a small picture [px]
OFTEN = 0.25  # least time between two words on how far it is [s]
LATER = 5  # less pressing than whatever else the machine does


def work(line: Connection, place: str) -> None:
    """Do jobs until the pipe ends.

    Args:
        line: jobs come and answers go through it.
        place: folder of the recordings.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends this process
    with contextlib.suppress(OSError, AttributeError):
        os.nice(LATER)
    from ....errors import MckibbenError
    from ....reproduction.recorded import kept_in, told
    from .kept import Kept

    said = _Teller(line)
    with told(said), kept_in(Kept(Path(place), said)), contextlib.suppress(EOFError, BrokenPipeError):
        while True:
            kind, *given = line.recv()
            try:
                JOBS[kind](line, said, *given)
                line.send(("done",))
            except MckibbenError as error:
                line.send(("refused", str(error)))
            except (ArithmeticError, OSError, RuntimeError, ValueError) as error:
                line.send(("refused", f"{type(error).__name__}: {error}"[:400]))


class _Teller:
    """Passes words on, but not more often than a person reads."""

    def __init__(self, line: Connection) -> None:
        self.line, self.last = line, 0.0

    def __call__(self, words: str) -> None:
        now = time.monotonic()
        if now - self.last >= OFTEN:
            self.last = now
            self.line.send(("tell", words))


def _rows(line: Connection, said: _Teller, names: Sequence[str]) -> None:
    """Compute rows; one that cannot be computed does not keep the others from it."""
    from ....errors import MckibbenError
    from ....reproduction.rows import all_rows, reproduce_row

    known = {row.id: row for row in all_rows()}
    for name in names:
        line.send(("row", name))
        try:
            line.send(("outcome", reproduce_row(known[name])))
        except (MckibbenError, ArithmeticError, OSError) as error:
            line.send(("failed", name, str(error)[:600]))


def _figure(line: Connection, said: _Teller, name: str) -> None:
    """Draw one figure in the paper's form."""
    from ....report.figures import style
    from ....report.paper_figures import figure

    of = figure(name)
    said(f"drawing {of.title}")
    picture = of.draw()
    small = io.BytesIO()
    with style.styled():
        picture.savefig(small, format="png", dpi=THUMB / picture.get_size_inches()[0], metadata={"Software": None})
    label = f"{of.title}. {of.caption}"
    line.send(("figure", name, style.inline_svg(picture, f"figure-{name}", label), small.getvalue()))


def _report(
    line: Connection, said: _Teller, ending: str, outcomes: list[RowOutcome], figures: list[str], left_out: str
) -> None:
    """Write the report of the command line."""
    from ....report.document_pdf import compiler
    from ....report.paper_figures import figure
    from ....report.reproduction_report import draw, reproduction_report

    if ending == ".pdf":
        compiler()  # refuses before minutes of work are done
    drawn = draw([figure(f) for f in figures], lambda f: said(f"figure {f.id}: {f.title}"))
    said("writing the report")
    document = reproduction_report(outcomes, drawn, left_out=left_out)
    line.send(("report", document.pdf() if ending == ".pdf" else document.html().encode("utf-8")))


JOBS: dict[str, Any] = {"rows": _rows, "figure": _figure, "report": _report}
