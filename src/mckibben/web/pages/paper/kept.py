"""A folder of recordings that several processes share: each is made once, and one whose maker was stopped is made again."""

from __future__ import annotations

import hashlib
import os
import time
from collections.abc import Callable
from pathlib import Path

from ....recordings import Recording, read_recording
from ....reproduction.recorded import PAUSE, Folder

YOUNG = 5.0  # age of a claim without a name in it that may still be written [s]


class Kept(Folder):
    """Recordings by key; whoever asks for one that another makes waits for it.

    Args:
        place: of the folder.
        tell: told when it is waited.
    """

    def __init__(self, place: Path, tell: Callable[[str], None]) -> None:
        super().__init__(place)
        self.tell = tell

    def one(self, key: str, make: Callable[[], Recording]) -> Recording:
        """The recording with a key: as it was left here, or made now and left here."""
        name = hashlib.sha256(key.encode()).hexdigest()[:24]
        file, claim = self.place / f"{name}.nc", self.place / f"{name}.claim"
        while not file.exists():
            if not self._mine(claim):
                self.tell("waiting for the recording that the rows are computed of")
                time.sleep(PAUSE)
                continue
            try:
                found = make()
                found.save(file)
                return found
            finally:
                claim.unlink(missing_ok=True)
        return read_recording(file)

    def _mine(self, claim: Path) -> bool:
        try:
            line = os.open(claim, os.O_CREAT | os.O_EXCL | os.O_WRONLY)
        except FileExistsError:
            if _left(claim):
                claim.unlink(missing_ok=True)
            return False
        os.write(line, str(os.getpid()).encode())
        os.close(line)
        return True


def _left(claim: Path) -> bool:
    """Whether the process that made a claim is gone."""
    try:
        owner = claim.read_text()
        if not owner:
            return time.time() - claim.stat().st_mtime > YOUNG
        os.kill(int(owner), 0)
    except ProcessLookupError:
        return True
    except (FileNotFoundError, PermissionError):
        return False
    return False
