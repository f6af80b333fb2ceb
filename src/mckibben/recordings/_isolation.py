"""Isolation of readers that a damaged file can crash or hang; and the seal that makes that unnecessary.

HDF5 follows whatever addresses it finds in a file, for ever if they form a ring, and holds the interpreter meanwhile. So a
netCDF file gets a seal at its end, a digest of all before it, which HDF5 does not look at. A file whose seal is whole is as
it was written. Any other one is read by a separate process, which may be ended.
"""

from __future__ import annotations

import hashlib
import os
import pickle
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

MARK = b"\nmckibben-seal:"
DIGEST = 32  # [B]
PATIENCE = 20.0  # longest time of a reader for a small file [s]
SPEED = 2e6  # least that it reads beyond that [B/s]
_BLOCK = 1 << 20
Result = TypeVar("Result")
_ROOT = str(Path(__file__).parents[2])  # where this package is found
_CHILD = """
import pickle, sys
from importlib import import_module
sys.path.append(sys.argv[4])
read = getattr(import_module(sys.argv[1]), sys.argv[2])
try:
    found = True, read(sys.argv[3])
except Exception as error:
    found = False, str(error) or type(error).__name__
sys.stdout.buffer.write(pickle.dumps(found))
"""


def seal(path: Path) -> None:
    """Append a seal to a file."""
    digest = _digest(path, os.path.getsize(path))
    with open(path, "ab") as stream:
        stream.write(MARK + digest)


def sealed(path: Path) -> bool | None:
    """Whether a file is as it was when its seal was put; None if it has none."""
    size = os.path.getsize(path) - DIGEST - len(MARK)
    if size < 0:
        return None
    with open(path, "rb") as stream:
        stream.seek(size)
        end = stream.read()
    return end[len(MARK) :] == _digest(path, size) if end.startswith(MARK) else None


def read_in_process(read: Callable[[str], Result], path: Path) -> Result:
    """Call a reader of a module in a separate process.

    Raises:
        ValueError: it failed, died or did not come to an end; says which.
    """
    # -P: not a module that lies beside somebody's data
    command = [sys.executable, "-P", "-c", _CHILD, read.__module__, read.__name__, str(path), _ROOT]
    patience = PATIENCE + os.path.getsize(path) / SPEED
    try:
        done = subprocess.run(command, capture_output=True, timeout=patience, check=False)
    except subprocess.TimeoutExpired:
        raise ValueError(f"it is damaged: reading it did not come to an end within {patience:.0f} s") from None
    if done.returncode:
        raise ValueError("it is damaged: the process that read it crashed")
    succeeded, result = pickle.loads(done.stdout)
    if not succeeded:
        raise ValueError(result)
    answer: Result = result
    return answer


def check_self_contained(path: str | os.PathLike[str]) -> None:
    """Refuse an HDF5 file with links to other files.

    Raises:
        ValueError: names the variable.
    """
    import h5py

    if not h5py.is_hdf5(path):
        return
    with h5py.File(path, "r") as file:
        groups, known = [file["/"]], set()
        while groups:
            group = groups.pop()
            for name in group:
                link = group.get(name, getlink=True)
                if isinstance(link, h5py.ExternalLink):
                    raise ValueError(f"{name} lies in another file, {link.filename}")
                if isinstance(link, h5py.SoftLink):
                    continue  # what it leads to is met, too
                item = group[name]
                if isinstance(item, h5py.Dataset) and (item.external or item.is_virtual):
                    raise ValueError(f"the numbers of {name} lie in another file")
                address = h5py.h5o.get_info(item.id).addr
                if isinstance(item, h5py.Group) and address not in known:
                    known.add(address)
                    groups.append(item)


def _digest(path: Path, size: int) -> bytes:
    digest = hashlib.sha256()
    with open(path, "rb") as stream:
        while size > 0 and (block := stream.read(min(_BLOCK, size))):
            digest.update(block)
            size -= len(block)
    return digest.digest()
