"""Files that are kept so that nothing is made twice: machine code and programs, bounded, in one folder.

The folder is the user's cache folder, or the one that MCKIBBEN_KERNELS names; "off" keeps nothing. A file is named by a hash
of everything its content depends on. It is written beside its place and moved there whole, so that neither a process that
dies nor a second one that does the same leaves half a file; what is damaged all the same is made anew.

What is kept is machine code, and whoever can write it can run anything. Only a folder and files that nobody but this user
(or the administrator) owns and can write are used; the checksum finds damage, not malice.
"""

from __future__ import annotations

import contextlib
import functools
import hashlib
import json
import os
import re
import sys
import tempfile
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from ...documents import make_private_folder, only_ours, parse_json
from ...errors import CacheWarning

VARIABLE = "MCKIBBEN_KERNELS"
LIMIT = 256 * 1024 * 1024  # bytes of the folder; beyond it, what was not used for longest goes
LOWERED = 0.9  # share of it that is left then
LEFT_BEHIND = 3600.0  # age at which a part of a file is that of a process that died [s]
_OURS = re.compile(r"[0-9a-f]{40}\.(o|program)|part-\w+")


def folder() -> Path | None:
    """Where files are kept; None where nothing is to be kept, or where others could change it (with a warning)."""
    at = _place()
    if at is None or only_ours(at):
        return at
    _warn(at)
    return None


@functools.cache
def _warn(at: Path) -> None:
    """Say once that a folder is not used."""
    warnings.warn(CacheWarning(at, VARIABLE), stacklevel=4)


def _place() -> Path | None:
    """The folder that is named, or the user's."""
    named = os.environ.get(VARIABLE)
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
    return base / "mckibben" / "kernels"


def found(file: str) -> tuple[bytes, dict[str, Any]] | None:
    """What is kept under a name, and what its maker said about it; None where there is nothing, or it is damaged."""
    at = folder()
    if at is None:
        return None
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError, RecursionError):
        with open(at / file, "rb") as stream:
            if not only_ours(stream.fileno()):
                return None
            whole = stream.read()
        if hashlib.sha256(whole[32:]).digest() == whole[:32]:
            size = int.from_bytes(whole[32:40], "little")
            about = parse_json(whole[40 : 40 + size])
            with contextlib.suppress(OSError):
                os.utime(at / file)  # used now
            return whole[40 + size :], about
    return None


def keep(file: str, data: bytes, about: dict[str, Any]) -> None:
    """Keep something under a name; a folder that cannot be written is no error."""
    at = folder()
    if at is None:
        return
    head = json.dumps(about).encode()
    whole = len(head).to_bytes(8, "little") + head + data
    with contextlib.suppress(OSError):
        make_private_folder(at)
        number, part = tempfile.mkstemp(dir=at, prefix="part-")
        try:
            with open(number, "wb") as stream:
                stream.write(hashlib.sha256(whole).digest() + whole)
            os.replace(part, at / file)
        except OSError:  # as of a full disk
            os.unlink(part)
        _bound(at)


def kept(file: str, make: Callable[[], tuple[bytes, dict[str, Any]]]) -> tuple[bytes, dict[str, Any]]:
    """What is kept under a name, or made."""
    known = found(file)
    if known is not None:
        return known
    made = make()
    keep(file, *made)
    return made


def _bound(at: Path) -> None:
    """Drop what was not used for longest, if there is too much, and what nobody will finish."""
    entries = []
    for entry in os.scandir(at):
        if _OURS.fullmatch(entry.name):
            with contextlib.suppress(OSError):  # another process may have dropped it
                about = entry.stat()
                entries.append((about.st_mtime, about.st_size, entry.path))
    total, now = sum(size for _, size, _ in entries), time.time()
    full = total > LIMIT
    for used, size, path in sorted(entries):
        part = os.path.basename(path).startswith("part-")
        if (part and now - used > LEFT_BEHIND) or (full and not part and total > LOWERED * LIMIT):
            with contextlib.suppress(OSError):
                os.unlink(path)
            total -= size
