"""State of a server: the machine, the folder of recordings, the control token, and the actions to undo.

Nothing in it knows of pages or sockets. A page says `act` with the name of an action and its words, and hears a sentence;
`status` is what every page shows in its top bar.
"""

from __future__ import annotations

import json
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, Protocol

from ..documents import JsonValue
from ..errors import InputError, MckibbenError
from ..recordings.formats import readable
from .control import Control
from .shelf import Shelf
from .stream import Stream
from .toasts import Toasts

RECORDINGS = (".nc", ".csv", ".mcap", ".mat", ".tdms", ".parquet")
UPLOADS = readable()  # tables of a fit, and files that become recordings
FRESH = 0.04  # time for which a status is the same for all pages, where nothing is known to have changed [s]
FREE = ("emergency_stop", "stop", "ask_control", "undo", "toast", "status")  # actions of any page, in control or not


class PageMachine(Protocol):
    """Interface of the test machine to the pages; `bench.Bench` implements it."""

    stream: Stream

    def begin(self) -> None:
        """Prepare the machine, in separate threads."""

    def status(self) -> dict[str, JsonValue]:
        """State, reason and times for the state block."""

    def describe(self) -> dict[str, JsonValue]:
        """Rarely changing properties: muscle, rig, protocol, limits, dry run."""

    def log(self, after: int) -> list[dict[str, JsonValue]]:
        """Messages after the one with a number."""

    def actions(self) -> Mapping[str, Callable[..., JsonValue]]:
        """Available actions by name."""

    def emergency_stop(self, reason: str) -> None:
        """Vent at once."""

    def shown(self, epoch: int, samples: int) -> None:
        """Note how many samples the page in control has drawn."""

    def control_lost(self) -> None:
        """Note that no page is in control."""

    def control_back(self) -> None:
        """Note that a page is in control again."""

    def close(self) -> None:
        """Vent, and release the machine."""


class Workspace:
    """State of a server, shared by all its pages.

    Args:
        folder: folder of the recordings.
        machine: makes the test machine; given this state, for its files and notices.
        clock: seconds that only go forward.
    """

    def __init__(
        self, folder: Path, machine: Callable[[Workspace], PageMachine], clock: Callable[[], float] = time.monotonic
    ) -> None:
        self.recordings = Shelf(folder, RECORDINGS)
        self.uploads = Shelf(folder / "uploads", UPLOADS)
        self.protocols = Shelf(folder / "protocols", (".toml",))
        self.specimens = Shelf(folder / "specimens", (".toml",))
        self.toasts = Toasts(clock)
        self.began = time.time()  # what was saved earlier was saved by another server
        self._version, self._lock = 0, threading.Lock()
        self._ends: list[Callable[[], None]] = []
        self._told: tuple[tuple[int, int], float, str] | None = None
        self.machine = machine(self)
        self.control = Control(clock, self.machine.control_lost, self.machine.control_back)
        self._own: dict[str, Callable[..., Any]] = {
            "emergency_stop": self._emergency_stop,
            "ask_control": self._ask,
            "give_control": self._give,
            "keep_control": self._keep,
            "undo": self._undo,
            "toast": self._toast,
        }

    def begin(self) -> None:
        """Prepare the machine."""
        self.machine.begin()

    @property
    def server(self) -> str:
        """Identity of this server, also contained in every frame of samples; new after a restart."""
        return self.machine.stream.server

    def saved_before(self, name: str) -> str | None:
        """Path that an earlier server saved for a recording of a given name: the recording, or its log."""
        for ending in (".nc", ".mcap"):
            try:
                path = self.recordings.found(f"{Path(name).stem}{ending}")
            except InputError:
                continue
            if path.stat().st_mtime < self.began:
                return path.name
        return None

    @property
    def version(self) -> tuple[int, int]:
        """Version that changes whenever `status` or a notice may have changed."""
        return self._version, self.toasts.version

    def changed(self) -> None:
        """Note a change of state."""
        with self._lock:
            self._version += 1

    def status(self) -> dict[str, JsonValue]:
        """Status shown on every page: state, time, who is in control."""
        control = self.control
        return {
            **self.machine.status(),
            "holder": control.holder,
            "present": control.present,
            "watching": control.watching,
            "wanted": control.wanted,
        }

    def told(self) -> str:
        """Status as JSON, computed once for all pages that ask within `FRESH`."""
        now, version = time.monotonic(), self.version
        made = self._told
        if made is None or made[0] != version or now - made[1] > FRESH:
            made = (version, now, json.dumps(self.status(), separators=(",", ":"), default=float))
            self._told = made
        return made[2]

    def act(self, page: str, action: str, words: Mapping[str, JsonValue] | None = None) -> dict[str, JsonValue]:
        """Perform an action for a page; errors of the user are returned, not raised.

        Returns:
            ``ok``, and ``said``: what came of it, or why it was refused, with ``field`` where one is to blame.
        """
        known = {**self.machine.actions(), **self._own}
        try:
            if action not in known:
                raise InputError("action", action[:80], known=known)
            if action not in FREE and not self.control.holds(page):
                who = "another page is in control" if self.control.present else "nobody is in control"
                raise InputError(action.replace("_", " "), None, f"must wait: {who}; ask for the controls first")
            arguments = {**(words or {}), "page": page} if action in self._own else dict(words or {})
            said = known[action](**arguments)
            return {"ok": True, "said": said}
        except InputError as error:
            return {"ok": False, "said": str(error), "field": error.field, "allowed": error.problem}
        except MckibbenError as error:
            return {"ok": False, "said": str(error), "field": None}
        except (TypeError, ValueError, OverflowError, AttributeError):  # words come from outside, and are of any kind
            return {"ok": False, "said": f"{action} is given other words than it takes", "field": action}
        finally:
            self.changed()

    def shown(self, page: str, epoch: int, samples: int) -> None:
        """Note how many samples of an epoch a page has drawn, if it is in control."""
        if self.control.holds(page):
            self.machine.shown(epoch, samples)

    def delete(self, name: str) -> None:
        """Delete a recording; it can be restored while its notice is shown."""
        word = self.recordings.delete(name)
        self.toasts.tell(
            f"Deleted {Path(name).stem}.",
            undo=lambda: self.recordings.restore(word, name),
            commit=lambda: self.recordings.forget(word),
        )
        self.changed()

    def tick(self) -> None:
        """Handle time-outs; called a few times a second."""
        self.toasts.tick()
        holder = self.control.holder
        self.control.tick()
        if self.control.holder != holder:
            self.changed()

    def on_close(self, do: Callable[[], None]) -> None:
        """Call a function when the server ends, such as one that ends background work; the machine waits for it."""
        self._ends.append(do)

    def end_work(self) -> None:
        """End the background work of all pages."""
        while self._ends:
            self._ends.pop()()

    def close(self) -> None:
        """Vent, and commit all actions."""
        self.end_work()
        self.machine.close()
        self.toasts.finish()

    def _emergency_stop(self, page: str, reason: str = "") -> str:
        self.machine.emergency_stop(str(reason)[:80] or "from the web interface")
        return "vented"

    def _ask(self, page: str) -> str:
        return "in control" if self.control.ask(page) else "asked; the page in control was told"

    def _give(self, page: str) -> str:
        if not self.control.give(page):
            raise InputError("controls", None, "are kept: nobody has asked for them")
        return "handed over"

    def _keep(self, page: str) -> str:
        self.control.keep(page)
        return "kept"

    def _undo(self, page: str, number: int | None = None) -> str:
        return f"undone: {self.toasts.undo(number)}"

    def _toast(self, page: str, number: int, waits: bool | None = None) -> str:
        if waits is None:
            self.toasts.close(int(number))
        else:
            self.toasts.wait(int(number), bool(waits))
        return ""
