"""Cache of machine code and programs, of limited size, in one private folder.

The folder is the user's cache folder, or the one that an environment variable names; "off" there keeps nothing. An
application that keeps its programs in a folder of its own says so with `use_cache` before it compiles anything. A file is
named by a hash of everything that its content depends on. It is written beside its place and moved there whole, so that
neither a process that dies nor a second one that does the same leaves half a file; a damaged file is made again.

The files are machine code, and anyone who can write them can run anything. Only a folder and files that nobody but this user
(or the administrator) owns and can write to are used; the checksum finds damage, not malice.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import re
import stat
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from .errors import CacheWarning

Description = Mapping[str, Any]  # of plain words and numbers
LIMIT = 256 * 1024 * 1024  # bytes of the folder; beyond it, the files that were not used for longest are deleted
LOWERED = 0.9  # share of the limit that is left then
LEFT_BEHIND = 3600.0  # age at which an unfinished file is that of a process that died [s]
_OWN_FILES = re.compile(r"[0-9a-f]{40}\.(o|program)|part-\w+")


class CacheSettings(NamedTuple):
    """Place of cached files: the folder in the user's cache folder, and the environment variable that overrides it."""

    application: str = "lanewise"
    variable: str = "LANEWISE_CACHE"


_settings = CacheSettings()


def use_cache(application: str, variable: str) -> None:
    """Keep files in the cache folder of an application.

    Args:
        application: name of its folder in the user's cache folder, such as ``~/.cache`` on Linux.
        variable: environment variable that names another folder, or is ``off``.
    """
    global _settings
    _settings = CacheSettings(application, variable)


def cache_folder() -> Path | None:
    """Folder in use; None if caching is off, or if other users could change it (with a warning)."""
    folder = _configured_folder()
    if folder is None or is_private(folder):
        return folder
    _warn(folder, _settings.variable)
    return None


@functools.cache
def _warn(folder: Path, variable: str) -> None:
    """Warn once that a folder is not used."""
    warnings.warn(CacheWarning(folder, variable), stacklevel=4)


def _configured_folder() -> Path | None:
    named = os.environ.get(_settings.variable)
    if named == "off":
        return None
    if named:
        return Path(named)
    if sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    elif sys.platform == "darwin":
        base = Path.home() / "Library" / "Caches"
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return base / _settings.application / "kernels"


def load(file: str) -> tuple[bytes, Description] | None:
    """Content and description of a cached file; None if there is none, or it is damaged."""
    if (folder := cache_folder()) is None or (known := read(folder / file, private=True)) is None:
        return None
    with contextlib.suppress(OSError):
        os.utime(folder / file)  # used now
    return known


def read(path: Path, *, private: bool = False) -> tuple[bytes, Description] | None:
    """Content and description of a file that `store` wrote; None if it is missing, damaged or not `private`."""
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError, RecursionError):
        with open(path, "rb") as stream:
            if private and not is_private(stream.fileno()):
                return None
            whole = stream.read()
        if hashlib.sha256(whole[32:]).digest() == whole[:32]:
            size = int.from_bytes(whole[32:40], "little")
            return whole[40 + size :], json.loads(whole[40 : 40 + size])
    return None


def store(file: str, data: bytes, description: Description) -> None:
    """Cache data with a description of plain text and numbers; a read-only folder is no error."""
    folder = cache_folder()
    if folder is None:
        return
    head = json.dumps(description).encode()
    whole = len(head).to_bytes(8, "little") + head + data
    with contextlib.suppress(OSError):
        make_private_folder(folder)
        number, part = tempfile.mkstemp(dir=folder, prefix="part-")
        try:
            with open(number, "wb") as stream:
                stream.write(hashlib.sha256(whole).digest() + whole)
            os.replace(part, folder / file)
        except OSError:  # as of a full disk
            os.unlink(part)
        _delete_oldest(folder)


def load_or_make(file: str, make: Callable[[], tuple[bytes, Description]]) -> tuple[bytes, Description]:
    """Content and description of a cached file, created if there is none."""
    if (known := load(file)) is not None:
        return known
    made = make()
    store(file, *made)
    return made


def _delete_oldest(folder: Path) -> None:
    """Delete the files unused for longest, if there are too many, and abandoned ones."""
    entries = []
    for entry in os.scandir(folder):
        if _OWN_FILES.fullmatch(entry.name):
            with contextlib.suppress(OSError):  # another process may have deleted it
                status = entry.stat()
                entries.append((status.st_mtime, status.st_size, entry.path))
    total, now = sum(size for _, size, _ in entries), time.time()
    full = total > LIMIT
    for used, size, path in sorted(entries):
        part = os.path.basename(path).startswith("part-")
        if (part and now - used > LEFT_BEHIND) or (full and not part and total > LOWERED * LIMIT):
            with contextlib.suppress(OSError):
                os.unlink(path)
            total -= size


def is_private(place: str | os.PathLike[str] | int) -> bool:
    """Whether only this user and the administrator own a folder or file, and can write to it.

    Args:
        place: a path, which is private where there is nothing yet, or the number of an open file.
    """
    if not hasattr(os, "geteuid"):
        return True  # Windows: a user's own folders have access lists that keep others out
    try:
        status = os.stat(place)
    except OSError:
        return True
    return status.st_uid in (0, os.geteuid()) and not status.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def make_private_folder(path: Path) -> None:
    """Make a folder, and those above it that are not there yet, for this user alone."""
    for folder in (*reversed(path.parents), path):
        if not folder.is_dir():
            folder.mkdir(mode=0o700, exist_ok=True)
