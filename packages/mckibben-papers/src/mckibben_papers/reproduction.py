"""Reproduction of the papers, number by number: printed and computed values, and verdicts.

Rows are computed from the first one on. Where several need recordings, a second process computes them from the last one on,
only to make recordings, which it leaves in a folder.
"""

from __future__ import annotations

import contextlib
import multiprocessing
import os
import signal
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from mckibben.errors import MckibbenError

from .recorded import Folder, kept_in, saved_in, told
from .rows import PrintedRow, RowOutcome, needs_recording, reproduce_row, select

WORTH = 6  # rows with recordings from which on a second process is worth its start


def reproduce(
    part: str | None = None,
    rows: list[str] | None = None,
    *,
    progress: Callable[[PrintedRow], None] | None = None,
    tell: Callable[[str], None] | None = None,
    recordings: bool = True,
    save: str | os.PathLike[str] | None = None,
) -> list[RowOutcome]:
    """Compute rows of the papers and judge each.

    Args:
        part: ``I`` to ``IV`` or ``discussion``; all by default.
        rows: beginnings of identifiers, such as ``table1.nylon``.
        progress: called with each row before it is computed.
        tell: called with words while a recording is made, of which several rows are computed; that takes minutes.
        recordings: off leaves out the rows that need them.
        save: folder into which the recordings of these rows are written, as ``.nc`` files.

    Raises:
        InputError: there is no such part or row, or the folder is a file.

    Examples:
        >>> import mckibben as mk
        >>> sorted({str(outcome.verdict) for outcome in mk.reproduce(rows=["table1.nylon"], recordings=False)})
        ['arithmetic', 'open']
    """
    outcomes = []
    wanted = select(part, rows)
    with told(tell), saved_in(save):
        for row in wanted:
            if not recordings and needs_recording(row):
                continue
            if progress:
                progress(row)
            outcomes.append(reproduce_row(row))
    return outcomes


@contextlib.contextmanager
def helped(identifiers: list[str]) -> Iterator[None]:
    """Let a second process make recordings for these rows, within the context, if that saves time."""
    wanted = [row.id for row in select(None, identifiers) if needs_recording(row)] if identifiers else []
    if len(wanted) < WORTH or (os.cpu_count() or 1) < 2 or multiprocessing.parent_process() is not None:
        yield
        return
    with tempfile.TemporaryDirectory(prefix="mckibben-") as place:
        other = multiprocessing.get_context("spawn").Process(target=_help, args=(place, wanted), daemon=True)
        other.start()
        try:
            with kept_in(Folder(Path(place), other.is_alive)):
                yield
        finally:
            other.terminate()
            other.join()


def _help(place: str, identifiers: list[str]) -> None:
    """Compute rows in the second process; failures are left to the first, which reports them."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends this one
    with kept_in(Folder(Path(place))):
        for row in reversed(select(None, identifiers)):
            with contextlib.suppress(MckibbenError, ArithmeticError, OSError):
                reproduce_row(row)
