"""State of a server: the machine, the folder of recordings, which page is in control, and the actions to undo.

Nothing in it knows of pages or sockets. A page says `act` with the name of an action and its words, and hears a sentence;
`status` is what every page shows in its top bar.

One page at a time is in control. It goes by the public name of its identity, which a reload keeps. When it vanishes,
whatever runs runs on; after `HOLD` [s] the next page that asks gets the controls without being asked for.
"""

from __future__ import annotations

import json
import math
import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from ..documents import JsonValue
from ..errors import InputError, MckibbenError
from ..formats.registry import readable
from .shelf import Shelf
from .stream import Stream

if TYPE_CHECKING:
    from ..specimens import Specimen

HOLD = 5.0  # time for which the controls wait for a page that vanished [s]
AFTER = 1.0  # until then what was held by hand is vented, before a page that did not ask is in control [s]


@dataclass
class Watcher:
    """A watching page."""

    lines: int = 0  # how many connections it has; none while it is away
    left: float = 0.0  # when the last one ended [s]


class Control:
    """The control token, passed between pages; safe for use by several threads."""

    def __init__(self, clock: Callable[[], float], lost: Callable[[], None], back: Callable[[], None]) -> None:
        self._clock, self._lost, self._back = clock, lost, back
        self._lock = threading.RLock()
        self._pages: dict[str, Watcher] = {}
        self.holder: str | None = None
        self.wanted: str | None = None  # who asked for the controls

    def join(self, page: str) -> None:
        """Add a page; the first one, or the one in control that returns, gets control."""
        with self._lock:
            self._pages.setdefault(page, Watcher()).lines += 1
            if self.holder is None or (self.holder != page and self._free()):
                self.holder = page
            if self.holder == page:
                self._back()

    def leave(self, page: str) -> None:
        """Remove one connection of a page."""
        with self._lock:
            one = self._pages.get(page)
            if one is None:
                return
            one.lines -= 1
            if one.lines > 0:
                return
            one.left = self._clock()
            if self.wanted == page:
                self.wanted = None
            if self.holder == page:
                self._lost()
            else:
                del self._pages[page]

    def ask(self, page: str) -> bool:
        """Request control for a page; return whether it has control now."""
        with self._lock:
            if self.holder == page:
                return True
            if self.holder is None or self._free() or not self.present:
                self._take(page)
                return True
            self.wanted = page
            return False

    def give(self, page: str) -> bool:
        """Hand control over to the page that requested it; return whether that happened."""
        with self._lock:
            if self.holder != page or self.wanted is None:
                return False
            self._take(self.wanted)
            return True

    def tick(self) -> None:
        """Pass control to the only other page if the page in control has been away for too long."""
        with self._lock:
            there = [name for name, one in self._pages.items() if one.lines > 0]
            if len(there) == 1 and there[0] != self.holder and self._free(HOLD + AFTER):
                self._take(there[0])

    def keep(self, page: str) -> None:
        """Refuse the request for control."""
        with self._lock:
            if self.holder == page:
                self.wanted = None

    def _take(self, page: str) -> None:
        before, self.holder, self.wanted = self.holder, page, None
        if before is not None and self._pages.get(before, Watcher()).lines == 0:
            self._pages.pop(before, None)
        self._back()

    def holds(self, page: str) -> bool:
        """Whether a page is in control."""
        return self.holder == page

    @property
    def present(self) -> bool:
        """Whether the page in control is connected."""
        return self.holder is not None and self._pages.get(self.holder, Watcher()).lines > 0

    @property
    def watching(self) -> int:
        """Number of other connected pages."""
        with self._lock:
            return sum(1 for name, one in self._pages.items() if one.lines > 0 and name != self.holder)

    def _free(self, longest: float = HOLD) -> bool:
        """Whether the page in control has been away for longer than a time [s]."""
        one = self._pages.get(self.holder or "")
        return one is None or (one.lines == 0 and self._clock() - one.left > longest)


LASTS = 20.0  # time for which a thing can be undone [s]


@dataclass
class Toast:
    """Notice of one completed action."""

    number: int  # counted from 1
    text: str
    undo: Callable[[], Any] | None  # brings it back; None if nothing can
    commit: Callable[[], Any] | None  # makes it final when its time has run out
    left: float  # time that is left while nobody looks at it closely [s]
    since: float | None  # when that began to run [s]; None while it waits
    made: float  # when it was told [s]


class Toasts:
    """Notices of a server; safe for use by several threads."""

    def __init__(self, clock: Callable[[], float]) -> None:
        self._clock, self._lock, self._count = clock, threading.RLock(), 0
        self._kept: dict[int, Toast] = {}
        self.version = 0

    def tell(
        self,
        text: str,
        undo: Callable[[], object] | None = None,
        commit: Callable[[], object] | None = None,
        lasts: float = LASTS,
    ) -> int:
        """Add a notice; return its number."""
        with self._lock:
            self._count += 1
            now = self._clock()
            self._kept[self._count] = Toast(self._count, text, undo, commit, lasts, now, now)
            self.version += 1
            return self._count

    @property
    def newest(self) -> float:
        """When the newest action that can be undone was told [s]."""
        with self._lock:
            return max((t.made for t in self._kept.values() if t.undo is not None), default=-math.inf)

    def undo(self, number: int | None = None) -> str:
        """Undo the newest action, or a given one; return its description."""
        with self._lock:
            can = [n for n, t in self._kept.items() if t.undo is not None and (number is None or n == number)]
            if not can:
                raise InputError("undo", None, f"finds nothing: an action can be undone for {LASTS:g} s")
            toast = self._kept.pop(can[-1])
            self.version += 1
        assert toast.undo is not None
        toast.undo()
        return toast.text

    def wait(self, number: int, waits: bool) -> None:
        """Pause the time of a notice while the pointer is on it, or resume it."""
        with self._lock:
            toast = self._kept.get(number)
            if toast is None or (toast.since is None) == waits:
                return
            now = self._clock()
            if toast.since is None:
                toast.since = now
            else:
                toast.left, toast.since = toast.left - (now - toast.since), None
            self.version += 1

    def close(self, number: int) -> None:
        """Commit an action, since its notice was closed."""
        with self._lock:
            toast = self._kept.pop(number, None)
            self.version += 1
        if toast is not None and toast.commit is not None:
            toast.commit()

    def tick(self) -> None:
        """Commit actions whose time for Undo is over."""
        now = self._clock()
        with self._lock:
            over = [t.number for t in self._kept.values() if t.since is not None and now - t.since >= t.left]
        for number in over:
            self.close(number)

    def finish(self) -> None:
        """Commit all actions."""
        for number in list(self._kept):
            self.close(number)

    def plain(self) -> list[dict[str, JsonValue]]:
        """Notices for JSON, the oldest first; ``left`` is the remaining time [s]."""
        now = self._clock()
        with self._lock:
            left = {t.number: t.left - (0.0 if t.since is None else now - t.since) for t in self._kept.values()}
            return [
                {
                    "number": n,
                    "text": t.text,
                    "undo": t.undo is not None,
                    "waits": t.since is None,
                    "left": max(0.0, left[n]),
                }
                for n, t in self._kept.items()
            ]


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

    @property
    def changed_at(self) -> float:
        """When the newest change that can be undone was made [s]; minus infinity without one."""

    def undo(self) -> str:
        """Undo the newest change of what is to run; return its description."""

    def refusal(self, spec: Specimen) -> str:
        """Why what is to run cannot run with another muscle; empty where it can."""

    def note_drawn(self, epoch: int, samples: int) -> None:
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
        self._undoing = threading.Lock()  # which action is the newest is asked when the one before is undone
        self._ends: list[Callable[[], None]] = []
        self._told: tuple[tuple[int, int], float, str] | None = None
        self.machine = machine(self)
        self.control = Control(clock, self.machine.control_lost, self.machine.control_back)
        self._own: dict[str, Callable[..., Any]] = {
            "emergency_stop": self._emergency_stop,
            "ask_control": lambda page: (
                "in control" if self.control.ask(page) else "asked; the page in control was told"
            ),
            "give_control": self._give,
            "keep_control": self._keep,
            "undo": self._undo,
            "toast": self._toast,
        }

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

    def note_drawn(self, page: str, epoch: int, samples: int) -> None:
        """Note how many samples of an epoch a page has drawn, if it is in control."""
        if self.control.holds(page):
            self.machine.note_drawn(epoch, samples)

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

    def _undo(self, page: str, number: int | None = None, bench: bool = False) -> str:
        """Undo an action by its number, or the newest: the page Bench asks for its own changes, too."""
        with self._undoing:
            if bench and number is None and self.control.holds(page) and self.machine.changed_at > self.toasts.newest:
                return f"undone: {self.machine.undo()}"
            return f"undone: {self.toasts.undo(number)}"

    def _give(self, page: str) -> str:
        if not self.control.give(page):
            raise InputError("controls", None, "are kept: nobody has asked for them")
        return "handed over"

    def _keep(self, page: str) -> str:
        self.control.keep(page)
        return "kept"

    def _toast(self, page: str, number: int, waits: bool | None = None) -> str:
        if waits is None:
            self.toasts.close(int(number))
        else:
            self.toasts.wait(int(number), bool(waits))
        return ""
