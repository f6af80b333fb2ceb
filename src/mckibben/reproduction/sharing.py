"""Two processes that make recordings for the same rows: what one of them has begun, the other does not begin again.

The rows are computed here from the first one on. A second process computes them from the last one on, only to make
recordings, which it leaves in a folder. A recording that is read there is the one that was made, bit for bit.
"""

from __future__ import annotations

import contextlib
import hashlib
import multiprocessing
import os
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from ..errors import MckibbenError
from ..recordings import Recording, read_recording
from .rows import needs_recording, reproduce_row, select

PAUSE = 0.05  # between two looks at what the other process has done [s]
WORTH = 6  # rows with recordings from which on a second process is worth its start


class ElsewhereError(MckibbenError):
    """The other process is at this recording already."""


class Folder:
    """Where both processes leave their recordings.

    Args:
        place: of the folder.
        alive: whether the other process lives, for whose recording it is waited then; where left out, nobody waits.
    """

    def __init__(self, place: Path, alive: Callable[[], bool] | None = None) -> None:
        self.place, self.alive = place, alive

    def one(self, key: str, make: Callable[[], Recording]) -> Recording:
        """The recording with a key: as the other process left it, or made here.

        Raises:
            ElsewhereError: the other process makes it, and it is not waited for.
        """
        name = hashlib.sha256(key.encode()).hexdigest()[:24]
        file = self.place / f"{name}.nc"
        if not self._claimed(name):
            if self.alive is None:
                raise ElsewhereError(key)
            while self.alive() and not file.exists():
                time.sleep(PAUSE)
            if file.exists():
                return read_recording(file)
            return make()
        found = make()
        if self.alive is None:
            found.save(file)
        return found

    def _claimed(self, name: str) -> bool:
        try:
            os.close(os.open(self.place / f"{name}.claim", os.O_CREAT | os.O_EXCL))
        except FileExistsError:
            return False
        return True


_folders: list[Folder] = []


def shared(key: str, make: Callable[[], Recording]) -> Recording:
    """The recording with a key, made here unless another process does."""
    return _folders[-1].one(key, make) if _folders else make()


@contextlib.contextmanager
def kept_in(folder: Folder) -> Iterator[None]:
    """While inside, recordings come from a folder and go there."""
    _folders.append(folder)
    try:
        yield
    finally:
        _folders.remove(folder)


@contextlib.contextmanager
def helped(identifiers: list[str]) -> Iterator[None]:
    """While inside, a second process makes recordings for these rows, where that is worth its start."""
    wanted = [row.id for row in select(None, identifiers) if needs_recording(row)] if identifiers else []
    if len(wanted) < WORTH or (os.cpu_count() or 1) < 2 or multiprocessing.parent_process() is not None:
        yield
        return
    with tempfile.TemporaryDirectory(prefix="mckibben-") as place:
        other = multiprocessing.get_context("spawn").Process(target=_help, args=(place, wanted), daemon=True)
        other.start()
        _folders.append(Folder(Path(place), other.is_alive))
        try:
            yield
        finally:
            _folders.pop()
            other.terminate()
            other.join()


def _help(place: str, identifiers: list[str]) -> None:
    """The second process: what fails is left to the first, which says why."""
    import signal

    from . import load

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the first process ends this one
    load()
    _folders.append(Folder(Path(place)))
    for row in reversed(select(None, identifiers)):
        with contextlib.suppress(MckibbenError, ArithmeticError, OSError):
            reproduce_row(row)
