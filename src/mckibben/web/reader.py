"""Reading of large files in a separate process, so that neither the emergency stop nor memory depends on them.

A read in the server holds its interpreter: a stop waits for it, and what a hundred megabytes of cells took is not
given back. Here the server only waits at a pipe; the process ends with its answer, when somebody stops it, when it takes too
long, and with the server. One file is read at a time, for two would take the processor from the bench.
"""

from __future__ import annotations

import contextlib
import ctypes
import gc
import multiprocessing
import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from .. import isolation
from ..errors import InputError, MckibbenError
from ..isolation import LargeAnswerError, ReadingLimits, small_answers

if TYPE_CHECKING:
    from multiprocessing.connection import Connection

T = TypeVar("T")
SMALL = 2 * 2**20  # up to so much is read in the server, sooner than a process begins [B]
SMALL_ARRAYS = 32 * 2**20  # the same of a netCDF file, whose numbers need not be made from words [B]
SMALL_CONTENT = 64 * 2**20  # memory that what such files hold may take in the server [B]
LOOK = 0.05  # time between two looks at whether it was stopped [s]
OFTEN = 0.25  # time between two words on how far it is [s]
LATER = 10  # how much less pressing it is than the bench, see `os.nice`
BLOCK = 2**20  # [B]
MMAP_THRESHOLD, ARENA_MAX = -3, -8  # the numbers by which `mallopt` knows them
STOPPED = "Reading was stopped."
_one = threading.Lock()


class ReadingStopped(MckibbenError):  # noqa: N818 - nothing went wrong
    """The user stopped the reading of a file, or left the page."""


class ReaderProcess:
    """A function of a module, called with a file in a separate process.

    Args:
        function: is given `path` and `given`; all of these, and what it returns, must be picklable.
        path: the file.
        given: further arguments.
        passes: how often the function reads the file, for `share`.
    """

    def __init__(self, function: Callable[..., Any], path: Path, *arguments: Any, passes: int = 1) -> None:
        self._function, self._path, self._given, self._passes = function, path, arguments, passes
        self._stop, self._begun = threading.Event(), 0.0
        self._share = 0.0

    @property
    def share(self) -> float:
        """Share of the file that has been read."""
        return min(self._share, 1.0)

    @property
    def waits(self) -> bool:
        """Whether another file is read first."""
        return not self._begun

    @property
    def left(self) -> float | None:
        """Remaining time of reading [s], as soon as it can be estimated."""
        gone = time.monotonic() - self._begun
        return gone * (1.0 - self.share) / self.share if self._begun and self.share > 0.05 and gone > 1.0 else None

    def stop(self) -> None:
        """End the process; a waiting caller gets an error."""
        self._stop.set()

    def result(self) -> Any:
        """Wait for the function and return its result.

        Raises:
            MckibbenError: as the function does; or the process died, took too long, or was stopped.
        """
        while not _one.acquire(timeout=LOOK):
            self._check()
        try:
            return self._read()
        finally:
            _one.release()

    def _check(self) -> None:
        if self._stop.is_set():
            raise ReadingStopped(STOPPED)

    def _read(self) -> Any:
        self._check()
        context = multiprocessing.get_context("spawn")
        line, other = context.Pipe()
        limits = ReadingLimits.of(self._path.stat().st_size, self._passes)
        args = (other, self._function, self._path, self._given, self._passes, limits)
        process = context.Process(target=_serve, args=args, daemon=True, name="reader")
        self._begun = time.monotonic()
        process.start()
        other.close()
        try:
            while True:
                self._check()
                if time.monotonic() - self._begun > limits.time:
                    raise limits.no_time(self._path.name)
                if line.poll(LOOK):
                    kind, answer = line.recv()
                    if kind == "done":
                        return answer
                    if kind == "refused":
                        raise answer
                    self._share = answer
        except (EOFError, OSError):
            raise InputError("file", self._path.name, "the process that read it ended before it was done") from None
        finally:
            process.kill()
            process.join()
            process.close()
            line.close()


def bound_freed_memory() -> None:
    """Make glibc return freed large arrays to the system at once, and keep small ones in one place for all threads.

    Otherwise it keeps blocks of up to 32 MB for later as soon as one such block was freed, and memory of its own for every
    thread: each run has new threads, so that a server would grow with each of them.
    """
    with contextlib.suppress(OSError, AttributeError):
        for option, value in ((MMAP_THRESHOLD, BLOCK), (ARENA_MAX, 1)):
            ctypes.CDLL(None).mallopt(option, ctypes.c_int(value))


def read_outside(function: Callable[..., T], path: Path, *arguments: object) -> T:
    """Call a function with a file: in a separate process if the file is large, else at once."""
    if is_small(path):
        with contextlib.suppress(LargeAnswerError), small_answers(SMALL_CONTENT):
            return function(path, *arguments)
    result: T = ReaderProcess(function, path, *arguments).result()
    return result


def is_small(path: Path) -> bool:
    """Whether reading a file takes less time than starting a process."""
    return path.stat().st_size <= (SMALL_ARRAYS if path.suffix.lower() == ".nc" else SMALL)


def check_rows(path: Path, most: int, use: str) -> None:
    """Refuse a text file with too many lines, without reading its cells.

    Args:
        path: a file; one that is no text has no lines.
        most: that are allowed.
        use: description of their purpose.

    Raises:
        MckibbenError: says how many there are and how many are allowed.
    """
    if path.suffix.lower() not in (".csv", ".txt", ".tsv", ".dat"):
        return
    count = 0
    with open(path, "rb") as stream:
        while block := stream.read(BLOCK):
            count += block.count(b"\n")
    if count > most:
        has = f"The file has {count:,} lines; {use} takes up to {most:,}".replace(",", "\u2009")
        raise MckibbenError(f"{has}. Keep one in {-(-count // most)} of them, or a part of the file.")


def _serve(
    line: Connection,
    function: Callable[..., Any],
    path: Path,
    arguments: tuple[Any, ...],
    passes: int,
    limits: ReadingLimits,
) -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the server ends this process
    with contextlib.suppress(OSError, AttributeError):
        os.nice(LATER)
    isolation.enter(limits)
    gc.disable()  # of millions of cells none is garbage before the end, and looking takes as long as reading
    lock = threading.Lock()
    threading.Thread(target=_tell, args=(line, lock, path, passes), daemon=True).start()
    try:
        answer: tuple[str, Any] = ("done", function(path, *arguments))
    except MckibbenError as error:
        answer = ("refused", error)
    except MemoryError:
        answer = ("refused", limits.no_memory(path.name))
    except Exception as error:  # whatever a reader makes of a damaged file, the page hears of it
        answer = (
            "refused",
            InputError("file", path.name, f"it cannot be read ({type(error).__name__}: {error})"[:300]),
        )
    with lock, contextlib.suppress(OSError):
        line.send(answer)
    os._exit(0)  # giving back millions of cells one by one takes longer than the end of the process


def _tell(line: Connection, lock: threading.Lock, path: Path, passes: int) -> None:
    """Report how much of the file has been read, as far as the system knows; end with the server."""
    server, size, done, before = os.getppid(), max(path.stat().st_size, 1), 0, 0.0
    while os.getppid() == server:
        at = _place(path)
        if at is not None:
            done += before > 0.5 > at / size  # it is read once more
            before = at / size
            with lock, contextlib.suppress(OSError):
                line.send(("share", (min(done, passes - 1) + before) / passes))
        time.sleep(OFTEN)
    os._exit(1)


def _place(path: Path) -> int | None:
    """Position up to which this process has read an open file [B]; None if unknown."""
    whole = str(path.resolve())
    with contextlib.suppress(OSError, ValueError):
        for number in os.listdir("/proc/self/fd"):
            with contextlib.suppress(OSError):
                if os.readlink(f"/proc/self/fd/{number}") == whole:
                    text = Path(f"/proc/self/fdinfo/{number}").read_text()
                    return int(text.split("pos:", 1)[1].split(None, 1)[0])
    return None
