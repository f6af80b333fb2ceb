"""What a server keeps: files with plain names, so that nothing outside their folder is read or shown, and results."""

from __future__ import annotations

import contextlib
import filecmp
import re
import secrets
import shutil
import threading
import unicodedata
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any, TypeVar

from ..documents import write_text, write_whole
from ..errors import InputError, not_found

R = TypeVar("R")
LARGEST = 200 * 2**20  # of an upload [B]
WELL_NAMED = re.compile(r"[^\W_][\w ._()+-]{0,119}")
LONGEST = 200  # bytes of a name; file systems end at 255
ALLOWED = "must be a plain name of letters, digits, dots, dashes and spaces, without a folder"
_NUMBERED = re.compile(r"-(\d{4})$")
_TRASH = ".deleted"


class Shelf:
    """A folder of files, created with the first file; several threads may store, rename and restore at once.

    Args:
        folder: where it is.
        endings: endings of the files that it takes, in small letters, such as ``.nc``.
    """

    def __init__(self, folder: Path, endings: Iterable[str]) -> None:
        self.folder, self.endings = Path(folder).absolute(), tuple(endings)
        self._lock = threading.RLock()  # from the choice of a name until its file is there

    def names(self) -> list[str]:
        """Names of all files, the newest first."""
        if not self.folder.is_dir():
            return []
        files = [p for p in self.folder.iterdir() if p.suffix.lower() in self.endings and p.is_file()]
        files = [p for p in files if WELL_NAMED.fullmatch(p.name) and not p.is_symlink()]
        return [p.name for p in sorted(files, key=lambda p: (-p.stat().st_mtime, p.name))]

    def path(self, name: str) -> Path:
        """Path of a file, whether it exists or not.

        Raises:
            InputError: if the name has a path in it, or another ending.
        """
        name = unicodedata.normalize("NFC", name) if isinstance(name, str) else name
        plain = isinstance(name, str) and WELL_NAMED.fullmatch(name) and len(name.encode()) <= LONGEST
        if not plain or ".." in name or name.endswith((" ", ".")):
            raise InputError("file", str(name)[:200], ALLOWED)
        if Path(name).suffix.lower() not in self.endings:
            kinds = ", ".join(self.endings)
            raise InputError("file", name, f"must be a name that ends in {kinds}; nothing was stored")
        return self.folder / name

    def found(self, name: str) -> Path:
        """Path of an existing file; refused if there is none."""
        path = self.path(name)
        if not path.is_file() or path.is_symlink():
            raise not_found(name)
        return path

    def ready(self) -> Path:
        """Folder, created if necessary."""
        self.folder.mkdir(parents=True, exist_ok=True)
        return self.folder

    def numbered(self, stem: str, ending: str) -> str:
        """An unused name, such as ``work-loop-0012.nc``, numbered one above the largest number."""
        taken = [_NUMBERED.search(Path(n).stem) for n in self.names()]
        largest = max((int(m[1]) for m in taken if m), default=0)
        name = f"{stem}-{largest + 1:04d}{ending}"
        self.path(name)
        return name

    @contextlib.contextmanager
    def free(self, name: str) -> Iterator[Path]:
        """Path of the name, or of a similar unused one, which nobody else takes while the file is made."""
        path = self.path(name)
        stem, ending = path.stem, path.suffix
        with self._lock:
            for number in range(2, 10_000):
                if not path.exists():
                    break
                path = path.with_name(f"{stem}-{number}{ending}")
            yield path

    def store(self, name: str, data: bytes | Path, largest: int = LARGEST) -> Path:
        """Store an upload, bytes or a file, under a similar unused name.

        Raises:
            InputError: if the name is not allowed, or the file is empty or too large.
        """
        self.path(name)
        check_size(name, data.stat().st_size if isinstance(data, Path) else len(data), largest)
        self.ready()

        def write(part: Path) -> object:
            return shutil.copyfile(data, part) if isinstance(data, Path) else part.write_bytes(data)

        with self.free(name) as path:
            return write_whole(path, write)

    def store_again(self, name: str, data: Path) -> Path:
        """Store an uploaded file; one of the same name and content is used again."""
        path = self.path(name)
        with self._lock:
            return path if path.is_file() and filecmp.cmp(path, data, shallow=False) else self.store(name, data)

    def store_once(self, name: str, data: bytes) -> Path:
        """Return the file that holds these bytes under this or a similar name, as the newest one; else store it."""
        wanted = self.path(name)
        similar = re.compile(rf"{re.escape(wanted.stem)}(-\d+)?{re.escape(wanted.suffix)}")
        with self._lock:
            for path in (self.folder / other for other in self.names() if similar.fullmatch(other)):
                if path.read_bytes() == data:
                    path.touch()
                    return path
            return self.store(name, data)

    def write_text(self, name: str, words: str) -> None:
        """Write a text file; refused if the name is not allowed."""
        path = self.path(name)
        self.ready()
        write_text(path, words)

    def rename(self, name: str, to: str) -> Path:
        """Rename a file; its suffix stays."""
        with self._lock:
            path, other = self.found(name), self.path(to)
            if other.exists():
                raise InputError("file", to, "it is there already")
            if path.suffix.lower() != other.suffix.lower():
                raise InputError("file", to, f"must be a name that ends in {path.suffix}")
            return path.rename(other)

    def delete(self, name: str) -> str:
        """Move a file away so that `restore` can bring it back; return the token for that."""
        with self._lock:
            path, trash = self.found(name), self.folder / _TRASH
            trash.mkdir(exist_ok=True)
            word = f"{secrets.token_hex(8)}{path.suffix}"
            path.rename(trash / word)
        return word

    def restore(self, word: str, name: str) -> Path:
        """Restore a deleted file, under its name or a similar one."""
        with self.free(name) as path:
            return (self.folder / _TRASH / Path(word).name).rename(path)

    def forget(self, word: str) -> None:
        """Delete a file permanently."""
        (self.folder / _TRASH / Path(word).name).unlink(missing_ok=True)
        try:
            (self.folder / _TRASH).rmdir()
        except OSError:
            pass  # others are in it, or it is gone


def plain(words: str, otherwise: str = "run") -> str:
    """Stem of a file name from any text."""
    stem = re.sub(r"[^A-Za-z0-9_-]+", "-", words).strip("-_")[:80]
    return stem or otherwise


def plain_name(name: str) -> str:
    """Convert a name to a plain one: letters of any script stay, other characters become dashes."""
    path = Path(unicodedata.normalize("NFC", name))
    stem = re.sub(r"[^\w .()+-]|\.(?=\.)", "-", path.stem).strip(" .-_") or "file"
    while len(f"{stem}{path.suffix}") > 120 or len(f"{stem}{path.suffix}".encode()) > LONGEST:
        stem = stem[:-1]
    return f"{stem}{path.suffix}"


def check_size(name: str, size: int, largest: int = LARGEST) -> None:
    """Refuse a file that is empty or too large [B]."""
    if not 0 < size <= largest:
        shown = f"{name[:120]} of {size / 2**20:.3g} MB"
        raise InputError("file", shown, f"must be between 1 B and {largest / 2**20:.0f} MB; nothing was stored")


class SharedResults:
    """Results by key, each made once for all pages that ask for it at the same time; those not asked for longest go."""

    def __init__(self, most: int) -> None:
        self._most, self._kept = most, OrderedDict[Any, Any]()
        self._lock, self._makers = threading.Lock(), dict[Any, threading.Lock]()

    def known(self, key: object) -> Any:
        """The result of a key, if it is kept."""
        with self._lock:
            if key in self._kept:
                self._kept.move_to_end(key)
            return self._kept.get(key)

    def get(self, key: object, make: Callable[[], R]) -> R:
        """The result of a key, made now if it is not kept; an error is not kept."""
        with self._lock:
            maker = self._makers.setdefault(key, threading.Lock())
        try:
            with maker:
                result: R | None = self.known(key)
                if result is None:
                    result = make()
                    self.put(key, result)
                return result
        finally:
            with self._lock:
                if key not in self._kept:
                    self._makers.pop(key, None)

    def put(self, key: object, result: object) -> None:
        """Keep a result."""
        with self._lock:
            self._kept[key] = result
            self._kept.move_to_end(key)
            while len(self._kept) > self._most:
                self._makers.pop(self._kept.popitem(last=False)[0], None)
