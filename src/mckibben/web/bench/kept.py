"""What becomes of a run when it has ended: its recording in the folder, and a sentence."""

from __future__ import annotations

from typing import Any

from ...errors import MckibbenError
from ..shelf import Shelf
from .going import Going
from .log import Log


def kept(going: Going, shelf: Shelf, log: Log, why: str = "") -> dict[str, Any]:
    """Save what was recorded, and say so.

    Args:
        going: the run, which has ended.
        shelf: of the recordings.
        log: that is told.
        why: what stopped it, where the log knows that already.

    Returns:
        ``file``, the name of the recording or None, and ``said``.
    """
    if going.record is None:
        said = going.error or "nothing was recorded"
        log.say(said, "stop", going.time)
        return {"file": None, "said": said}
    message = str(going.record.meta["message"])
    if going.stopping:
        message = f"Stopped by you at {going.time:.3f} s; the valve vented."
    try:
        shelf.ready()
        beside = None if going.on is None else going.on.log
        name = shelf.free(going.file) if beside is None else going.file
        going.record.save(shelf.path(name))
        if beside is not None:
            beside.unlink(missing_ok=True)  # all of it is in the recording
    except (MckibbenError, OSError) as error:
        log.say(str(error), "stop", going.time)
        return {"file": None, "said": str(error)}
    done = going.record.meta["result"] == "done" or bool(going.stopping)
    if why:
        log.say(f"Recorded as {name}, up to the stop.", "done", going.time)
    else:
        log.say(
            f"{message[:1].upper()}{message[1:].rstrip('.')}. Recorded as {name}.",
            "done" if done else "stop",
            going.time,
        )
    return {"file": name, "said": message}
