"""The test machine of the web interface: states, runs, stops and manual set-points for the page in control."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from ...bench.hardware.clock import Clock
from ...bench.session import MachineSession, Messages, Session
from ...bench.session.proxy import SessionProxy
from ...documents import JsonValue
from ...errors import InputError, MckibbenError
from ..pages.bench.dry import DryRun
from ..stream import Stream
from .chosen import BenchSelection
from .console import PageConsole
from .manual import HardwareSpec, ManualView
from .running import RunController
from .states import PACE_NAMES, ended, status_of

if TYPE_CHECKING:
    from ...bench.rig import Rig
    from ..workspace import Workspace

PACES = {"simulated": None, "real": 1.0, "slow": 0.1}  # over the wall clock; None: as fast as it goes
GRAIN = 0.004  # a machine that is ahead sleeps at least so long [s], so that pages get their share of the processor
KEPT = 2.0  # time for which a session keeps samples for the pages [s]
LAST = 10.0  # time for which the end of a server waits for a run to vent [s]


class Bench:
    """The bench of a server, with one machine, simulated or real.

    Args:
        workspace: state of the server, which has the folders and is told of changes.
        muscle: on it at first; a specimen's id.
        rig: at first, or its name. That of a real machine stays.
        spec: the real machine; None: a simulated one.
    """

    def __init__(
        self, workspace: Workspace, *, muscle: str = "nylon", rig: Rig | str = "paper", spec: HardwareSpec | None = None
    ) -> None:
        self.workspace, self.stream, self.messages = workspace, Stream(), Messages()
        self.pace, self.clock = "real", Clock(grain=GRAIN)  # of runs on the simulated machine
        self._lock, self.spec = threading.RLock(), spec
        words = "" if spec is None else spec.words
        self.chosen = BenchSelection(workspace.protocols, workspace.changed, muscle=muscle, rig=rig, machine=words)
        self.chosen.told = self._dried
        self.running: RunController | None = None
        self.vented = False  # by the emergency stop of a page, until the machine is reset
        self.ended: dict[str, Any] = {}  # of the last run
        self._closing: list[threading.Thread] = []
        self._open()
        self.console = PageConsole(self)

    def begin(self) -> None:
        """Make the first dry run and the machine by hand ready, in separate threads."""
        self.chosen.begin()
        self.view.thread.start()

    @property
    def when(self) -> float | None:
        """Time of the stop that the machine is in [s]."""
        why = self.session.why
        if why and self.ended.get("stopped"):
            time: float | None = self.ended["trip"]  # on the time of the run
            return time
        return next((m.time for m in reversed(self.messages.after(0)) if why and m.text == why), None)

    # ---- what pages see

    def status(self) -> dict[str, JsonValue]:
        """Return state, reason and times for the pages."""
        return status_of(self)

    def describe(self) -> dict[str, JsonValue]:
        """Return muscle, rig, protocol and dry run for the pages."""
        return self.chosen.parts

    def log(self, after: int) -> list[dict[str, JsonValue]]:
        """Return the messages after the one with a number."""
        return [message._asdict() for message in self.messages.after(after)]

    def actions(self) -> Mapping[str, Callable[..., JsonValue]]:
        """Return the actions that a page may request, by name."""
        chosen = self.chosen
        return {
            "muscle": lambda name: self._set_up(chosen.muscle, name),
            "rig": self._choose_rig,
            "protocol": lambda name: self._change(chosen.load, name),
            "value": lambda name, words: self._change(chosen.value, name, words),
            "text": lambda text: self._change(chosen.text, text), "save": lambda name: chosen.save(str(name)),
            "dry_run": lambda: self._change(chosen.again), "cure": lambda: self._change(chosen.cure),
            "start": self.start, "pause": self.pause, "resume": self.resume, "step": self.step, "stop": self.stop,
            "reset": self.reset, "pace": self.choose_pace, "set": self.set, "vent": self.vent, "note": self.note,
            "say": self.console.answer, "complete": self.console.completions,
        }  # fmt: skip

    # ---- the choice

    def _change(self, do: Callable[..., str], *words: Any) -> str:
        self._require_no_run("change of the protocol")
        return do(*words)

    def _set_up(self, do: Callable[..., str], name: str) -> str:
        self._require_no_run("change of muscle or rig")
        if self.view.moving:
            raise InputError("muscle and rig", None, "must wait: the machine is operated by hand; vent first")
        said = do(str(name))
        self.messages.say(f"{self.chosen.words()}.")
        self._open_again()
        return said

    def _choose_rig(self, name: str) -> str:
        self._require_simulated("rig", "is that of the real machine; choose another one by mckibben serve --rig")
        return self._set_up(self.chosen.choose_rig, name)

    def _dried(self, dry: DryRun) -> None:
        self.messages.say(dry.sentence, kind="done" if dry.passed else "stop")

    def _open(self) -> None:
        """Take the machine of the choice, which is made ready when the thread of its view begins."""
        rig, muscle = self.chosen.rig, self.chosen.spec
        if self.spec is None:
            self.session: MachineSession = Session(
                rig, muscle, speed=PACES[self.pace] or 1.0, keep=KEPT, rests=True, by_hand=False, messages=self.messages
            )
        else:
            words, lock_step = self.spec
            self.session = SessionProxy(
                words, rig, muscle, lock_step=lock_step, keep=KEPT, by_hand=False, messages=self.messages
            )
            caution = "lengths count from the muscle's rest length, at which it is taken to stand"
            self.messages.say(f"Connecting to {words}; {caution}.", kind="caution")
        after = () if self.spec is None else self._closing
        self.view = ManualView(self.session, rig, self.stream, self.workspace.changed, after)

    def _open_again(self) -> None:
        """Release the machine in a separate thread, and open the selected one."""
        closing = threading.Thread(target=self.view.close, name="close", daemon=True)
        closing.start()
        self._closing = [*(t for t in self._closing if t.is_alive()), closing]
        self._open()
        self.view.thread.start()

    # ---- what may not be done to the machine as it is

    def _require_simulated(
        self,
        action: str,
        problem: str = "needs a simulated machine; a real one has its own time and can only be stopped",
    ) -> None:
        if self.spec is not None:
            raise InputError(action, None, problem)

    def _require_no_run(self, action: str) -> None:
        if self.running is not None:
            raise InputError(
                action, None, f"must wait: {self.running.prepared.protocol.name} is running; stop it first"
            )

    def _require_idle(self, action: str) -> None:
        self._require_no_run(action)
        if why := self.session.why:
            raise InputError(action, None, f"must wait: the machine is stopped ({why}); reset it first")

    def _require_run(self, action: str) -> RunController:
        if self.running is None:
            raise InputError(action, None, "needs a run, and nothing is running")
        if self.running.button():
            raise InputError(action, None, "is too late: the run is being stopped")
        return self.running

    def _operated(self, action: str, wanted: Iterable[str]) -> MachineSession:
        """Return the session, if it may be operated by hand; pages see its samples from now on."""
        if self.running is not None:
            names = " and ".join(wanted) or "set-points"
            raise InputError(action, None, f"must wait: the running protocol sets the {names}; stop it first")
        self._require_idle(action)
        self._require_ready()
        self.view.show()
        return self.session

    def _require_ready(self) -> None:
        if not self.session.ready:
            raise MckibbenError(self.view.failed or "by hand: the machine is getting ready; try again in some seconds")

    # ---- runs

    def start(self) -> str:
        """Begin the protocol, on a machine that is set up again where it begins; a real one is brought there."""
        prepared = self.chosen.passed()
        with self._lock:
            self._require_idle("start")
            if self.spec is None:
                self.view.hold(True)
            else:  # it is shown from now on, also on the way to where the protocol begins
                self._operated("start", ())
            self.ended = {}
            self.clock.begin()
            self.running = RunController(self, prepared)
            self.messages.say("Started. Protocol, muscle and rig are saved with the recording.", 0.0, "done")
            for caution in prepared.cautions:
                self.messages.say(caution, 0.0, "caution")
            self.running.thread.start()
        return f"running {prepared.protocol.name}"

    def run_over(self, run: RunController, said: dict[str, JsonValue], why: str) -> None:
        """Note that a run has ended, what is said of it, and what stopped it; called from its thread."""
        with self._lock:
            self.ended = ended(run, said, why)
            self.running = None
            self.clock.halt(False)
            self.view.hold(False)
        self.workspace.changed()

    def pause(self) -> str:
        """Pause the simulated machine."""
        self._require_simulated("pause")
        run = self._require_run("pause")
        self.clock.halt()
        said = "Paused by you. Simulated time stands still; pressure and length are held."
        self.messages.say(said, run.time, "caution")
        return f"paused at {run.time:.3f} s, holding"

    def resume(self) -> str:
        """Resume a paused run, or confirm an operator action."""
        run = self._require_run("resume")
        run.answer()
        self.clock.halt(False)
        return "running"

    def step(self, samples: int = 1) -> str:
        """Advance a paused run by some samples."""
        self._require_run("step")
        if not self.clock.halted:
            raise InputError("step", None, "is allowed only while the run is paused")
        self.clock.step(max(1, min(1000, int(samples))))
        return ""

    def stop(self) -> str:
        """End the run and vent; no trip, so that nothing has to be reset."""
        run = self.running
        if run is None:
            return self.vent()
        run.stop("stopped by hand", trip=False)
        return "stopped"

    def choose_pace(self, name: str) -> str:
        """Choose the pace of the simulated machine."""
        self._require_simulated("pace", "can be chosen only for a simulated machine; a real one has its own time")
        if name not in PACES:
            raise InputError("pace", name, known=PACES)
        self.pace, self.clock.speed = name, PACES[name]
        self.session.set_speed(PACES[name] or 1.0)
        return PACE_NAMES[name]

    # ---- by hand

    def set(self, **wanted: float | str) -> str:
        """Change set-points: ``pressure``, and one of ``length``, ``velocity`` and ``tension``; as text or SI."""
        amounts = {("span" if n == "length" else n): v if isinstance(v, str) else float(v) for n, v in wanted.items()}
        was_moving = self.view.moving
        self._operated("set", wanted).set(**amounts)
        if not was_moving:
            self.ended = {}
        return ""

    def vent(self) -> str:
        """Vent at the manual rate."""
        if self.running is None and not (self.session.why or self.view.moving or self.session.busy):
            self._require_ready()
            return "vented"
        self._operated("vent", ["pressure"]).vent()
        return "venting"

    def note(self, text: str) -> str:
        """Add a note to the messages."""
        run = self.running
        self.messages.say(f"Note: {str(text)[:400]}", None if run is None else run.time)
        return "noted"

    # ---- stops

    def emergency_stop(self, reason: str) -> None:
        """Vent at once; the machine stays stopped until `reset`."""
        with self._lock:
            run, self.vented = self.running, True
        if run is not None:
            run.stop(reason, trip=True)
        else:
            self.session.emergency_stop(reason)
        self.workspace.changed()

    def reset(self) -> str:
        """Return to manual operation after a stop, vented."""
        with self._lock:
            if self.running is not None:
                raise InputError("reset", None, "must wait: the run is being stopped; try again once it has vented")
            if not self.session.why:
                raise InputError("reset", None, "is allowed only after a stop")
            if self.session.gone:  # another try
                self._open_again()
            else:
                if self.spec is not None:
                    self._require_ready()
                self.session.reset()
            self.vented = False
        return "reset"

    def shown(self, epoch: int, samples: int) -> None:
        """Note how many samples of an epoch the page in control has drawn."""
        if self.running is not None and epoch == self.stream.epoch:
            self.clock.viewed(samples * self.stream.period)

    def control_lost(self) -> None:
        """Note that the client in control disconnected: a run continues, manual set-points hold for 5 s, then vent."""
        self.clock.viewed(None)
        if self.session.ready:  # before, nothing is held
            self.session.control_lost()

    def control_back(self) -> None:
        """Note that a client is in control again."""
        self.clock.viewed(None)
        if self.session.ready:
            self.session.control_back()

    def close(self) -> None:
        """Vent and end all threads."""
        if self.running is not None:
            self.running.stop("the server was closed", trip=False)
            self.running.thread.join(LAST)
        self.chosen.close()
        self.view.close()
        for closing in self._closing:
            closing.join(LAST)
