"""Reading of files by a process that may be ended: what one file can cost is bounded, whatever library parses it.

Parsers of foreign bytes crash, hang with the interpreter held, or take all memory. So they run in a process of their own,
which is kept warm for the next file. It takes the name of a function and JSON, and gives back JSON and the bytes of arrays:
nothing that comes back is code. Ctrl-C and a stop of the server never wait for it.

Limits, each raised by an environment variable: memory (`MEMORY`), by default 1 GiB and 24 bytes for each byte of the file,
at most half of the machine's; time (`TIME`), by default 20 s and 2.5 s for each megabyte. Linux enforces the memory; other
systems let a process have what it asks for, and only the time holds there.
"""

from __future__ import annotations

import atexit
import contextlib
import contextvars
import importlib
import itertools
import json
import os
import re
import select
import signal
import struct
import sys
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from . import errors
from .errors import InputError, MckibbenError

if TYPE_CHECKING:
    import numpy as np

T = TypeVar("T")
MEMORY, TIME = "MCKIBBEN_READ_MEMORY", "MCKIBBEN_READ_TIME"
LEAST_MEMORY, MEMORY_PER_BYTE = 1 << 30, 24  # [B], 1
LEAST_TIME, TIME_PER_BYTE = 20.0, 2.5e-6  # [s], [s/B]
# Suffixes of files that are never parsed here.
PARSED = tuple(
    f".{name}"
    for name in "nc mcap mat tdms parquet gz xlsx xls ods h5 hdf5 hdf db3 bag ddf edf bdf c3d mf4 mdf zip".split()
)
AT_ONCE = 4  # files that are read at the same time
KEPT = 16 << 20  # a process that has read a larger file is not kept [B]
IDLE = 120.0  # time after which a process that reads nothing ends [s]
_ROOT = str(Path(__file__).parents[1])  # where this package is found
_CHILD = f"import sys; sys.path.append({_ROOT!r}); from {__name__} import serve; serve(*sys.argv[1:])"
_THREADS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "POLARS_MAX_THREADS")  # stacks of threads count as memory
_UNITS = {"": 1.0, "k": 1e3, "m": 1e6, "g": 1e9, "t": 1e12, "ki": 2.0**10, "mi": 2.0**20, "gi": 2.0**30, "ti": 2.0**40}
_SIZE = re.compile(r"\s*(\d+\.?\d*)\s*([kmgt]i?|)b?\s*", re.I)
_SECONDS = re.compile(r"\s*(\d+\.?\d*)\s*(s|min|h|)\s*")
_PIPE = 1 << 20  # what lies ready for this process at most [B]
_LENGTH = struct.Struct("<Q")
_WEIGHT, _TEXT_WEIGHT = 32, 12  # [B] that a number, and a letter of a cell, take at most where they are understood
_KINDS = "biufcmMSU"  # of arrays that travel as bytes
LAST_WORDS = 1 << 16  # of what a process has complained of, in which the reason of its end is looked for [B]
_NO_MEMORY = re.compile(r"alloc|out of memory|MemoryError", re.I)  # how libraries say that they got none
_carried: dict[str, type] = {}  # what may come back beside JSON and arrays, by name


def carried(kind: type[T]) -> type[T]:
    """Let values of a type come back from a process that reads: its constructor takes its fields in their order."""
    _carried[kind.__name__] = kind
    return kind


class ReadingLimits(NamedTuple):
    """Memory [B] and time [s] of a process that reads a file."""

    memory: int
    time: float

    @classmethod
    def of(cls, size: int, passes: int = 1) -> ReadingLimits:
        """Limits for a file of a size [B] that is read some times.

        Raises:
            InputError: an environment variable states no size or time.
        """
        memory = min(LEAST_MEMORY + MEMORY_PER_BYTE * size, max(_physical() // 2, LEAST_MEMORY))
        time = LEAST_TIME + passes * TIME_PER_BYTE * size
        stated, words = os.environ.get(MEMORY), os.environ.get(TIME)
        if stated:
            match = _SIZE.fullmatch(stated)
            if match is None:
                raise InputError(MEMORY, stated, "must be a size such as 4 GB")
            memory = max(int(float(match[1]) * _UNITS[match[2].lower()]), 1 << 28)
        if words:
            match = _SECONDS.fullmatch(words)
            if match is None:
                raise InputError(TIME, words, "must be a time such as 10 min")
            time = float(match[1]) * {"s": 1.0, "": 1.0, "min": 60.0, "h": 3600.0}[match[2]]
        return cls(memory, time)

    def no_memory(self, name: str) -> InputError:
        """The error of a file that needs more memory."""
        said = f"reading it takes more than {self.memory / 2**30:.3g} GiB of memory"
        more = f"if you trust the file, {MEMORY}='{max(2, round(2e-9 * self.memory))} GB' allows more"
        return InputError("file", name, sentence=f"{said}; {more}", where=name)

    def no_time(self, name: str) -> InputError:
        """The error of a file that takes more time."""
        said = f"reading it did not come to an end within {self.time:.0f} s"
        more = f"if the file is sound, {TIME}='{round(4 * self.time)} s' allows more"
        return InputError("file", name, sentence=f"{said}; {more}", where=name)


def _physical() -> int:
    try:
        return os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (ValueError, OSError, AttributeError):
        return 8 << 30


class LargeAnswerError(MckibbenError):
    """A file holds more than `small_answers` allows."""


_largest_answer: contextvars.ContextVar[int] = contextvars.ContextVar("largest_answer", default=1 << 62)


@contextlib.contextmanager
def small_answers(most: int) -> Iterator[None]:
    """Refuse files whose content takes much memory, before this process has it.

    Args:
        most: memory that the content may take [B]; beyond it `LargeAnswerError` is raised.
    """
    before = _largest_answer.set(most)
    try:
        yield
    finally:
        _largest_answer.reset(before)


class _Reader:
    """A process that calls functions with files, one after the other."""

    def __init__(self, module: str = "") -> None:
        import subprocess
        import tempfile

        environment = {**os.environ, **dict.fromkeys(_THREADS, "1")}
        self.complaints = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the process
        # -P: not a module that lies beside somebody's data; a session of its own: Ctrl-C is for this process
        self.process = subprocess.Popen(
            [sys.executable, "-P", "-c", _CHILD, module], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
            stderr=self.complaints, env=environment, start_new_session=True, bufsize=0,
        )  # fmt: skip
        self.owner = os.getpid()
        with contextlib.suppress(ImportError, AttributeError, OSError):
            import fcntl

            fcntl.fcntl(self.process.stdout, fcntl.F_SETPIPE_SZ, _PIPE)  # type: ignore[arg-type]

    def call(self, function: str, arguments: list[Any], options: Mapping[str, Any], limits: ReadingLimits) -> Any:
        late = threading.Event()

        def end() -> None:
            late.set()
            self.process.kill()

        watch = threading.Timer(limits.time, end)
        watch.daemon = True
        watch.start()
        name = str(arguments[0])
        before = self.complaints.seek(0, os.SEEK_END)  # of files that it read earlier
        largest = min(limits.memory, _largest_answer.get())
        request = json.dumps([os.getcwd(), function, arguments, options, *limits, largest]).encode()
        try:
            stdin = self.process.stdin
            assert stdin is not None
            stdin.write(_LENGTH.pack(len(request)) + request)
            tree, arrays = self._answer(limits)
        except (OSError, EOFError, ValueError):
            self.process.kill()
            self.process.wait()
            if late.is_set():
                raise limits.no_time(name) from None
            self.complaints.seek(max(before, self.complaints.seek(0, os.SEEK_END) - LAST_WORDS))
            if _NO_MEMORY.search(self.complaints.read().decode("utf-8", "replace")):
                raise limits.no_memory(name) from None
            raise InputError("file", None, "is damaged: the process that read it crashed", where=name) from None
        finally:
            watch.cancel()
        kind, value = tree
        if kind == "large" and largest < limits.memory:
            raise LargeAnswerError(name)
        if kind in ("memory", "large"):
            raise limits.no_memory(name)
        if kind == "error":
            raise _error(*unpack(value, arrays))
        return unpack(value, arrays)

    def _answer(self, limits: ReadingLimits) -> tuple[Any, Iterator[np.ndarray]]:
        import numpy as np

        (length,) = _LENGTH.unpack(self._bytes(_LENGTH.size))
        if length > limits.memory:
            raise ValueError
        tree, layouts = json.loads(self._bytes(length))
        arrays, total = [], 0
        for kind, shape in layouts:
            dtype = np.dtype(kind)
            if dtype.kind not in _KINDS or any(n < 0 for n in shape):
                raise ValueError
            total += dtype.itemsize * int(np.prod(shape))
            if total > limits.memory:
                raise ValueError
            array = np.empty(shape, dtype)
            if array.size and dtype.itemsize:
                self._fill(memoryview(array.reshape(-1).view(np.uint8)))
            arrays.append(array)
        return tree, iter(arrays)

    def _bytes(self, count: int) -> bytearray:
        data = bytearray(count)
        self._fill(memoryview(data))
        return data

    def _fill(self, view: memoryview) -> None:
        stdout: Any = self.process.stdout
        while view:
            count = stdout.readinto(view)
            if not count:
                raise EOFError
            view = view[count:]

    def end(self) -> None:
        """End the process; a child of `fork` only forgets that of its parent."""
        if self.owner == os.getpid():
            self.process.kill()
            self.process.wait()
        else:  # without the lock of `wait`, which another thread may have held at the fork
            self.process.returncode = 0
        for stream in (self.process.stdin, self.process.stdout, self.complaints):
            with contextlib.suppress(OSError):
                stream.close()  # type: ignore[union-attr]


_idle: list[_Reader] = []
_lock = threading.Lock()
_places = threading.BoundedSemaphore(AT_ONCE)
inside: ReadingLimits | None = None  # of this process, where it is one that may be ended


def start_for(words: Iterable[str], module: str) -> None:
    """Begin a process before it is needed, while other things are being loaded, if some words name a file to parse."""
    if any(word.lower().endswith(PARSED) and os.path.isfile(word) for word in words):
        start(module)


def start(module: str) -> None:
    """Begin a process before it is needed, while other things are being loaded, where there is a processor for it.

    Args:
        module: full name of the module whose functions it will call.
    """
    with _lock:
        if not _idle and not inside and (os.cpu_count() or 1) > 1:
            with contextlib.suppress(OSError):
                _idle.append(_Reader(module))


def close() -> None:
    """End the process that waits for a file."""
    with _lock:
        while _idle:
            _idle.pop().end()


atexit.register(close)


def call_outside(function: Callable[..., T], path: Path, *arguments: Any, **options: Any) -> T:
    """Call a function of a module with a file in a process that may be ended; at once where this is such a process.

    Args:
        function: of this package; arguments and options are JSON, its result JSON, arrays, and types that are `carried`.
        path: the file.
        *arguments: further arguments.
        **options: keywords.

    Raises:
        InputError: as the function does; or reading takes more memory or time than `ReadingLimits` allow, or crashes.
    """
    if inside:
        return function(path, *arguments, **options)
    size = path.stat().st_size
    limits = ReadingLimits.of(size)
    place = f"{function.__module__}:{function.__name__}"
    with _places:
        reader = _take()
        try:
            result: T = reader.call(place, [str(path), *arguments], options, limits)
        except MckibbenError:
            _give(reader, size)
            raise
        except BaseException:  # Ctrl-C, too
            reader.end()
            raise
        _give(reader, size)
    return result


def _take() -> _Reader:
    with _lock:
        while _idle:
            reader = _idle.pop()
            if reader.owner == os.getpid() and reader.process.poll() is None:
                return reader
            reader.end()
    return _Reader()


def _give(reader: _Reader, size: int) -> None:
    with _lock:
        if not _idle and size <= KEPT and reader.process.poll() is None:
            _idle.append(reader)
            return
    reader.end()


# ---- in the process


def serve(module: str = "") -> None:
    """Answer calls until nobody asks; a module that they will need is loaded before the first one."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    # Libraries write to standard output, too: answers have a way of their own.
    out = os.fdopen(os.dup(1), "wb", buffering=0)
    os.dup2(2, 1)
    stdin = os.fdopen(os.dup(0), "rb", buffering=0)
    if module:
        importlib.import_module(module)
    while os.name != "posix" or select.select([stdin], [], [], IDLE)[0]:
        head = stdin.read(_LENGTH.size)
        if len(head) < _LENGTH.size:
            return
        request = b""
        (length,) = _LENGTH.unpack(head)
        while len(request) < length:
            request += stdin.read(length - len(request))
        folder, function, arguments, options, memory, time, largest = json.loads(request)
        with contextlib.suppress(OSError):
            os.chdir(folder)
        enter(ReadingLimits(memory, time))
        kind, value = _outcome(function, arguments, options)
        arrays: list[np.ndarray] = []
        try:
            packed = pack(value, arrays)
            if sum(_TEXT_WEIGHT * a.nbytes if a.dtype.char == "B" else _WEIGHT * a.size for a in arrays) > largest:
                arrays, packed, kind = [], None, "large"
            tree = json.dumps([[kind, packed], [[a.dtype.str, a.shape] for a in arrays]]).encode()
        except MemoryError:
            arrays, tree = [], b'[["memory", null], []]'
        del value
        _write(out, _LENGTH.pack(len(tree)) + tree)
        for array in arrays:
            _write(out, memoryview(array.reshape(-1).view("u1")) if array.size and array.dtype.itemsize else b"")
        del arrays
        leave()


def _outcome(function: str, arguments: list[Any], options: dict[str, Any]) -> tuple[str, Any]:
    module, _, name = function.partition(":")
    try:
        read = getattr(importlib.import_module(module), name)
        return "done", read(Path(arguments[0]), *arguments[1:], **options)
    except MckibbenError as error:
        _, (_, args), state = error.__reduce__()
        return "error", [type(error).__name__, list(args), state]
    except MemoryError:
        return "memory", None
    except Exception as error:  # whatever a parser meets in a broken file
        if lacks_memory(error):
            return "memory", None
        words = " ".join(f"{type(error).__name__}: {error}".split())[:200]
        refused = InputError("file", None, f"cannot be read ({words})")
        return "error", ["InputError", list(refused.args), vars(refused)]


def check_unpacked(size: float) -> None:
    """Refuse content that will not fit, before it is unpacked.

    Args:
        size: as far as it is known [B].

    Raises:
        MemoryError: in a process that may be ended, of more than an eighth of its memory.
    """
    if inside is not None and size > inside.memory / 8:
        raise MemoryError


def lacks_memory(error: BaseException) -> bool:
    """Whether an error of a library says that there was no memory."""
    return isinstance(error, MemoryError) or _NO_MEMORY.search(str(error)) is not None


def enter(limits: ReadingLimits) -> None:
    """Make this process one that may be ended: limited memory, and time after which the system ends it."""
    global inside
    inside = limits
    with contextlib.suppress(ImportError, ValueError, OSError):
        import resource

        resource.setrlimit(resource.RLIMIT_DATA, (limits.memory, resource.getrlimit(resource.RLIMIT_DATA)[1]))
    if hasattr(signal, "setitimer"):
        signal.signal(signal.SIGALRM, signal.SIG_DFL)
        # If nobody else ends it: its parent may have been killed.
        signal.setitimer(signal.ITIMER_REAL, limits.time + 5.0)


def leave() -> None:
    """Take the limit of time back."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.0)


def _write(out: Any, data: Any) -> None:
    view = memoryview(data)
    while view:
        view = view[out.write(view) :]


# ---- what travels


def pack(value: Any, arrays: list[np.ndarray]) -> Any:
    """A value as JSON; its arrays are put into a list."""
    import numpy as np

    if value is None or type(value) in (bool, int, float, str):
        return value
    for kind in (bool, int, float, str):  # of a subclass the plain value
        if isinstance(value, kind):
            return kind(value)
    if isinstance(value, np.generic):
        return pack(value.item(), arrays) if value.dtype.kind in "biufU" else str(value)
    name = type(value).__name__
    if name in _carried:
        return {"$": name, "of": [pack(getattr(value, field), arrays) for field in value.__match_args__]}
    if isinstance(value, np.ndarray):
        return _pack_array(value, arrays)
    if isinstance(value, Mapping):
        return {"$": "map", "of": [[pack(k, arrays), pack(v, arrays)] for k, v in value.items()]}
    many = isinstance(value, list) and len(value) > 1000 and all(type(v) is int for v in value)
    if many or isinstance(value, range):
        with contextlib.suppress(OverflowError):
            arrays.append(np.asarray(value, np.int64))
            return {"$": "numbers"}
    if isinstance(value, list | tuple):
        return [pack(one, arrays) for one in value]
    return str(value)


def _pack_array(value: np.ndarray, arrays: list[np.ndarray]) -> Any:
    import numpy as np

    if value.dtype.kind in _KINDS:
        arrays.append(np.ascontiguousarray(value).reshape(value.shape))
        return {"$": "array"}
    cells = value.ravel().tolist()
    if all(type(cell) is str for cell in cells) and not any("\0" in cell for cell in cells):
        text = "\0".join(cells).encode("utf-8", "surrogatepass")
        arrays.append(np.frombuffer(text, np.uint8))
        return {"$": "cells", "shape": value.shape}
    plain = (type(None), bool, int, float, str)
    objects = [cell if type(cell) in plain else str(cell) for cell in cells]
    return {"$": "objects", "shape": value.shape, "of": objects}


def unpack(tree: Any, arrays: Iterator[np.ndarray]) -> Any:
    """What `pack` has packed."""
    if isinstance(tree, list):
        return [unpack(one, arrays) for one in tree]
    if not isinstance(tree, dict):
        return tree
    kind = tree["$"]
    if kind == "map":
        return {unpack(k, arrays): unpack(v, arrays) for k, v in tree["of"]}
    if kind == "array":
        return next(arrays)
    if kind == "numbers":
        return next(arrays).tolist()
    if kind in ("cells", "objects"):
        import numpy as np

        shape = tuple(tree["shape"])
        values = np.empty(int(np.prod(shape)), object)
        text = b"" if kind == "objects" else next(arrays).tobytes()
        cells = tree["of"] if kind == "objects" else text.decode("utf-8", "surrogatepass").split("\0")
        values[:] = list(itertools.islice(cells, values.size))
        return values.reshape(shape)
    return _carried[kind](*[unpack(one, arrays) for one in tree["of"]])


def _error(name: str, args: list[Any], state: dict[str, Any]) -> MckibbenError:
    kind = getattr(errors, name, None)
    if not (isinstance(kind, type) and issubclass(kind, MckibbenError)):
        kind = MckibbenError
    error = kind.__new__(kind, *args)
    error.__dict__.update(state)
    return error
