"""Files: read whole, or one clear line; written whole, or as they were.

TOML and JSON of any origin are parsed here and nowhere else, within bounds of length and depth: parsers, and whatever walks
through what they give, need more than proportional time for deep trees, and end in errors of Python's stack.
"""

from __future__ import annotations

import contextlib
import io
import json
import os
import re
import secrets
import stat
import tomllib
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

from .errors import InputError, not_found

if TYPE_CHECKING:
    from typing_extensions import Buffer

# What JSON and TOML hold: tables and lists of texts, numbers and truth values, as `json.loads` gives them. Readers check it.
JsonValue: TypeAlias = Any

LONGEST = 8 << 20  # of a text of TOML [B]; long tables of numbers stand in files of their own
LONGEST_NAME = 255  # of a file or folder, which no usual file system exceeds [B]
DEEPEST = 64  # tables and lists inside of one another

# What decides how deep a text is: brackets and, in TOML, the dots of a key; not what stands in strings and comments.
_TOML = re.compile(
    r'''"""(?:\\.|[^\\])*?"{3,5}|"(?:\\.|[^"\\\n])*"|'{3}.*?'{3,5}|'[^'\n]*'|\#[^\n]*'''
    r"""|(?P<open>[\[{])|(?P<close>[\]}])|(?P<dot>\.)|(?P<end>[\n=,])|(?P<lost>["'])""",
    re.DOTALL,
)
_LONG_NUMBER = re.compile(r"\d{301}")
_JSON = re.compile(r""""(?:\\.|[^"\\])*"|(?P<open>[\[{])|(?P<close>[\]}])|(?P<lost>")""", re.DOTALL)


def path_text(path: Any, field: str = "file") -> str:
    """The text of a path, or of a name in whose place a path may stand.

    Raises:
        InputError: it is neither, or no file can have that name.
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(field, None, f"must be a name or the path of a file, got {path!r}")
    text = os.fspath(path)
    try:
        longest = max(map(len, os.fsencode(text).split(os.fsencode(os.sep))))
    except UnicodeEncodeError:  # of no letter
        longest = LONGEST_NAME + 1
    if not isinstance(text, str) or "\0" in text or longest > LONGEST_NAME:
        raise not_found(repr(text), "file" if field == "file" else f"{field} file")
    if not text.strip():  # of which a path would be the folder where one is
        raise InputError(field, text, "must be a name or the path of a file")
    return text


def read_text(path: str | os.PathLike[str], *, field: str = "file", form: str = "TOML") -> str:
    """The text of a file.

    Args:
        path: path of a file in UTF-8.
        field: its name in error messages.
        form: what it is written in, in error messages.

    Raises:
        InputError: there is no such file, or it is no text.
    """
    where = path_text(path, field if field.isalpha() else "file")

    def at_once(path: str, flags: int) -> int:  # also a pipe into which nobody writes
        return os.open(path, flags | getattr(os, "O_NONBLOCK", 0))

    try:
        with open(path, "rb", opener=at_once) as stream:
            if stat.S_ISFIFO(os.fstat(stream.fileno()).st_mode):
                raise no_file(where)
            data = stream.read(LONGEST + 1)
        if data is None:  # a device that has nothing to say yet
            raise no_file(where)
        if len(data) > LONGEST:
            raise InputError(field, where, f"must be at most {LONGEST >> 20} MiB long; it is longer")
        return data.decode("utf-8-sig")  # some editors begin a file with the mark of its encoding
    except IsADirectoryError:
        raise InputError(field, where, f"must be a {form} file; it is a folder") from None
    except FileNotFoundError:
        raise not_found(where, "file" if field == "file" or not field.isalpha() else f"{field} file") from None
    except OSError as error:
        raise InputError(field, where, f"it cannot be read ({error.strerror})") from None
    except UnicodeDecodeError as error:
        raise InputError(field, None, f"must be {form} in UTF-8: {error}", where=where) from None


def no_file(path: str | os.PathLike[str]) -> InputError:
    """The error about a path at which no plain file is: nothing, a folder, or a pipe or device, which might never end."""
    if not os.path.exists(path):
        return not_found(path)
    what = "a folder" if os.path.isdir(path) else "a pipe, socket or device, whose end nobody knows"
    return InputError("file", os.fspath(path), f"must be a plain file; it is {what}")


def parse_toml(text: str, *, where: str, field: str = "file") -> dict[str, JsonValue]:
    """The tables of a text.

    Raises:
        InputError: says where it is no TOML, or that it is too long or nested too deeply.
    """
    if len(text) > LONGEST:
        raise InputError(field, None, f"must be at most {LONGEST >> 20} MiB long", where=where)
    try:
        if not _is_deep(text, _TOML):
            document = tomllib.loads(text)
            if not _holds_deep(document):
                return document
    except (ValueError, RecursionError) as error:  # a number of 5,000 digits is a plain ValueError
        raise InputError(field, None, f"is not TOML: {error}", where=where) from None
    raise InputError(field, None, f"must have at most {DEEPEST} tables and lists inside one another", where=where)


def editable_toml(text: str, *, where: str, field: str = "file") -> Any:
    """The same tables as a document whose comments and order stay when values are replaced and it is written again.

    Raises:
        InputError: as of `parse_toml`.
    """
    import tomlkit

    parse_toml(text, where=where, field=field)
    return tomlkit.parse(text)


def parse_json(text: str | bytes, **options: Any) -> JsonValue:
    """Parse a text of JSON, unless it is nested too deeply.

    Args:
        text: text of any length; a caller that takes it from outside limits that.
        **options: of `json.loads`.

    Raises:
        ValueError: it is none, or nested too deeply.
    """
    if isinstance(text, bytes):
        text = text.decode("utf-8")
    if text.count("[") + text.count("{") > DEEPEST and _is_deep(text, _JSON):
        raise ValueError(f"more than {DEEPEST} lists and objects inside of one another")

    def whole(digits: str) -> int:  # that a float can hold
        if len(digits) > 300:
            raise ValueError("a whole number has more than 300 digits")
        return int(digits)

    if _LONG_NUMBER.search(text):
        options.setdefault("parse_int", whole)
    return json.loads(text, **options)


def _is_deep(text: str, tokens: re.Pattern[str]) -> bool:
    """Whether brackets or the dots of a key go too deep; what follows a string without an end is the parser's to refuse."""
    depth = dots = 0
    for token in tokens.finditer(text):
        kind = token.lastgroup
        if kind == "open":
            depth, dots = depth + 1, 0
        elif kind == "close":
            depth -= 1
        elif kind == "dot":
            dots += 1
        elif kind == "end":
            dots = 0
        elif kind == "lost":
            return False
        if depth > DEEPEST or dots >= DEEPEST:
            return True
    return False


def _holds_deep(document: JsonValue) -> bool:
    """Whether tables and lists go too deep, as dotted keys within tables can; `ValueError` of a number no float holds."""
    level = [document]
    for _ in range(DEEPEST):
        values = [inner for outer in level for inner in (outer.values() if isinstance(outer, Mapping) else outer)]
        if any(isinstance(value, int) and abs(value) >> 63 for value in values):
            raise ValueError("a whole number takes more than 64 bits")
        level = [value for value in values if isinstance(value, Mapping | list)]
        if not level:
            return False
    return True


def read_toml(path: str | os.PathLike[str], *, field: str = "file") -> dict[str, JsonValue]:
    """The tables of a file.

    Raises:
        InputError: as `read_text` and `parse_toml`.
    """
    return parse_toml(read_text(path, field=field), where=os.fspath(path), field=field)


def with_own_paths(document: JsonValue, where: str | os.PathLike[str], key: str = "specimen") -> JsonValue:
    """The tables of a file with the files that they name under a key, found from the folder of the file itself.

    Args:
        document: the tables.
        where: the file that they come from.
        key: whose values that end in ``.toml`` are paths; others are names of what ships.
    """

    def found(value: Any) -> JsonValue:
        named = isinstance(value, str) and value.lower().endswith(".toml")
        return str(Path(where).parent / value) if named else value  # an absolute path stays

    if isinstance(document, dict):
        return {k: found(v) if k == key else with_own_paths(v, where, key) for k, v in document.items()}
    return [with_own_paths(v, where, key) for v in document] if isinstance(document, list) else document


def write_whole(path: str | os.PathLike[str], write: Callable[[Path], object], *, field: str = "file") -> Path:
    """Write a file atomically: `write` fills a temporary file, which is moved into place when it is complete on the disk.

    A reader never meets half a file, and what stood there stays until then.

    Args:
        path: path of the file.
        write: makes a file at the path that it is given, which has the same ending.
        field: its name in error messages.

    Returns:
        The path written.

    Raises:
        InputError: there is no such folder, or the file cannot be written.
    """
    path = Path(path)
    if not path.absolute().parent.is_dir():
        raise InputError(field, str(path), f"there is no folder {path.parent}")
    if path.is_dir():
        raise InputError(field, str(path), "it cannot be written: it is a folder")
    part = path.with_name(f".{secrets.token_hex(4)}.part{path.suffix}")
    try:
        write(part)
        with open(part, "rb+") as stream:
            os.fsync(stream.fileno())
        os.replace(part, path)
    except OSError as error:
        why = " ".join((error.strerror or str(error)).split())
        raise InputError(field, str(path), f"it cannot be written ({why})") from None
    except InputError as error:
        if error.value == str(part):  # nobody knows that name
            raise error.changed(field=field, value=str(path)) from None
        raise
    finally:
        with contextlib.suppress(OSError):
            part.unlink(missing_ok=True)
    return path


class ErrorKeepingFile(io.RawIOBase):
    """A new file for libraries that cannot bear an error: it keeps the first one, and forgets all that is written after it.

    HDF5 brings its process down when it cannot close a file; polars and matplotlib's PDF do not say that the disk is full.
    An error is reported when this file is closed.

    Args:
        path: path of the file.
    """

    def __init__(self, path: str | os.PathLike[str]) -> None:
        self._file = open(path, "wb+", buffering=0)
        self._at = self._end = 0
        self.error: OSError | None = None

    def readable(self) -> bool:
        """Return True; it is writable and seekable too."""
        return True

    writable = seekable = readable

    def write(self, data: Buffer) -> int:
        """Write, or do as if."""
        view = memoryview(data).cast("B")
        done = 0
        while done < len(view) and self.error is None:
            try:
                self._file.seek(self._at + done)
                done += self._file.write(view[done:]) or 0
            except OSError as error:
                self.error = error
        self._at += len(view)
        self._end = max(self._end, self._at)
        return len(view)

    def readinto(self, buffer: Buffer) -> int:
        """Read bytes; zeros where writing failed."""
        view = memoryview(buffer).cast("B")
        view[:] = bytes(len(view))
        self._file.seek(self._at)
        size = min(len(view), max(self._end - self._at, 0))
        self._file.readinto(view[:size])
        self._at += size
        return size

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        """Go to a place."""
        self._at = offset + (0, self._at, self._end)[whence]
        return self._at

    def tell(self) -> int:
        """The place."""
        return self._at

    def truncate(self, size: int | None = None) -> int:
        """Make it as long as that."""
        self._end = self._at if size is None else size
        if self.error is None:
            try:
                self._file.truncate(self._end)
            except OSError as error:
                self.error = error
        return self._end

    def close(self) -> None:
        """Close the file, and raise the stored error."""
        if self.closed:
            return
        super().close()
        self._file.close()
        if self.error is not None:
            raise self.error


@contextlib.contextmanager
def locked(path: Path) -> Iterator[bool]:
    """Lock a file against other processes and threads, and say whether that worked; nobody waits.

    The system frees the lock of a process that dies. The file stays, since another process may be about to lock it.

    Raises:
        OSError: the folder cannot be written to, or its file system has no locks.
    """
    with open(path, "a+b") as file:
        held = True
        try:
            if os.name == "nt":  # pragma: no cover
                import msvcrt

                msvcrt.locking(file.fileno(), msvcrt.LK_NBLCK, 1)  # type: ignore[attr-defined,unused-ignore]
            else:
                import fcntl

                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except (BlockingIOError, PermissionError):
            held = False
        yield held


def write_text(path: str | os.PathLike[str], text: str, *, field: str = "file") -> Path:
    """Write a text in UTF-8, its lines ended as they are, as `write_whole` writes."""
    return write_whole(path, lambda part: part.write_bytes(text.encode()), field=field)
