"""Files that are kept so that nothing is made twice: machine code and programs, bounded, in one folder.

The folder is the user's cache folder, or the one that MCKIBBEN_KERNELS names; "off" keeps nothing. A file is named by a hash
of everything its content depends on. It is written beside its place and moved there whole, so that neither a process that
dies nor a second one that does the same leaves half a file; what is damaged all the same is made anew.
"""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

VARIABLE = "MCKIBBEN_KERNELS"
LIMIT = 256 * 1024 * 1024  # bytes of the folder; beyond it, what was not used for longest goes
LOWERED = 0.9  # share of it that is left then
LEFT_BEHIND = 3600.0  # age at which a part of a file is that of a process that died [s]
_OURS = re.compile(r"[0-9a-f]{40}\.(o|program)|part-\w+")


def folder() -> Path | None:
    """Where files are kept, or None."""
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
    with contextlib.suppress(OSError, ValueError, KeyError, TypeError):
        whole = (at / file).read_bytes()
        if hashlib.sha256(whole[32:]).digest() == whole[:32]:
            size = int.from_bytes(whole[32:40], "little")
            about = json.loads(whole[40 : 40 + size])
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
        at.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=at, prefix="part-", delete=False) as part:
            part.write(hashlib.sha256(whole).digest() + whole)
        os.replace(part.name, at / file)
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
