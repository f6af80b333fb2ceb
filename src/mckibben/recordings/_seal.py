"""The seal of a netCDF file, and links of HDF5 to other files.

The seal is a digest of all before it, which HDF5 does not look at: a file whose seal is whole is as it was written, unless
somebody forged it. It is no reason to trust a file: whatever HDF5 parses, it parses in a process that may be ended.
"""

from __future__ import annotations

import hashlib
import os
from pathlib import Path

MARK = b"\nmckibben-seal:"
DIGEST = 32  # [B]
_BLOCK = 1 << 20


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
