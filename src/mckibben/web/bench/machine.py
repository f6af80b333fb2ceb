"""The test machine of the web interface: states, runs, stops and manual set-points for the page in control."""

from __future__ import annotations

import functools
import math
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ...bench.console import COMMANDS, CommandInterpreter, ConsoleCommand, described_dry_run, usage
from ...bench.hardware.simulated import Clock
from ...bench.prepare import PreparedRun
from ...bench.protocol_run import RunState
from ...bench.session import MachineSession, Messages, Session
from ...bench.session.proxy import SessionProxy
from ...documents import JsonValue
from ...errors import InputError, MckibbenError
from ...experiments.protocol import Protocol
from ...experiments.read import protocol_names
from ...quantities import with_unit
from ...recordings.recording import Recording
from ..shelf import plain
from ..stream import Columns, Stream, of_cycle
from ..widgets import sentence
from .chosen import BenchChoice, BenchSelection
from .manual import HardwareSpec, ManualView

if TYPE_CHECKING:
    from ...bench.rig import Rig
    from ...bench.session.interface import ManualSetup
    from ...specimens import Specimen
    from ..workspace import Workspace

PACES = {"simulated": None, "real": 1.0, "slow": 0.1}  # over the wall clock; None: as fast as it goes
MEASURED = 1.0  # over which the pace of a run is measured, by the wall clock [s]
SLOWER = 0.9  # of the chosen pace, below which the pages say how fast it goes
UNDONE = 50  # changes of the choice that can be undone
GRAIN = 0.004  # a machine that is ahead sleeps at least so long [s], so that pages get their share of the processor
KEPT = 2.0  # time for which a session keeps samples for the pages [s]
LAST = 10.0  # time for which the end of a server waits for a run to vent [s]


class Bench:
    """The bench of a server, with one machine, simulated or real."""

    def __init__(
        self, workspace: Workspace, *, muscle: str = "nylon", rig: Rig | str = "paper", spec: HardwareSpec | None = None
    ) -> None:
        self.workspace, self.stream, self.messages = workspace, Stream(), Messages()
        self.pace, self.clock = "real", Clock(grain=GRAIN)  # of runs on the simulated machine
        self._lock, self.spec = threading.RLock(), spec
        self._choosing = threading.RLock()  # a change and its way back are one, also where pages ask for two at once
        words = "" if spec is None else spec.words
        self.chosen = BenchSelection(workspace.protocols, workspace.changed, muscle=muscle, rig=rig, machine=words)
        self.chosen.told = lambda dry: self.messages.say(dry.sentence, kind="done" if dry.passed else "stop")
        self.running: RunController | None = None
        self.vented = False  # by the emergency stop of a page, until the machine is reset
        self.ended: dict[str, Any] = {}  # of the last run
        self._before: list[tuple[float, BenchChoice]] = []  # each change, when and with what was chosen before it
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
        run, session, view = self.running, self.session, self.view
        status: dict[str, Any] = {
            "shape": "idle", "name": "Idle", "small": "", "pace": self.pace, "vented": self.vented, "why": session.why,
            "trip": self.when, "moving": False, "paused": False, "time": self.ended.get("time", 0.0), "ended": self.ended,
            "asked": "", "by_hand": "ready" if session.ready else view.failed or "getting ready",
        }  # fmt: skip
        if run is not None:
            return status | run.status()
        status["at"] = view.at()
        if status["why"]:
            small = "not connected" if session.gone and not session.ready else short(status["why"])
            return status | {"shape": "tripped", "name": "Tripped", "small": small}
        if view.moving:
            asked = session.status().set_points
            words = ", ".join(with_unit(v, UNITS[n]) for n, v in asked.items() if n in UNITS)
            small = f"holding {words}" if words else "vented"
            by_hand = {"shape": "running", "name": "By hand", "small": small, "moving": True, "time": view.time}
            return status | by_hand | {"set_points": dict(asked)}
        dry = self.chosen.dry
        passed = "protocol does not pass" if dry is None or not dry.passed else "ready, dry run passed"
        return status | {"small": "checking the protocol" if dry is None else passed}

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
            "rig": self.choose_rig,
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
        with self._choosing:
            self._require_no_run("change of the protocol")
            before = self.chosen.choice
            said = do(*words)
            if self.chosen.choice != before:
                self._before = [*self._before[1 - UNDONE :], (time.monotonic(), before)]
            return said

    def refusal(self, spec: Specimen) -> str:
        """Return why the selected protocol cannot run with another muscle; empty where it can."""
        return self.chosen.refusal(spec)

    @property
    def changed_at(self) -> float:
        """When the newest change that can be undone was made, by the clock of `time.monotonic` [s]."""
        with self._choosing:  # one that is being made counts
            return self._before[-1][0] if self._before else -math.inf

    def undo(self) -> str:
        """Choose what was chosen before the newest change of muscle, rig or protocol; the way back is no change."""
        with self._choosing:
            if not self._before:
                raise InputError("undo", None, "finds nothing: no muscle, rig or protocol was chosen or changed")
            earlier, choice = self._before[:-1], self._before[-1][1]
            back = functools.partial(self.chosen.restore, choice)
            same = choice.spec is self.chosen.spec and choice.rig is self.chosen.rig
            said = self._change(back) if same else self._set_up(lambda _: back(), "")
            self._before = earlier
            return said

    def _set_up(self, do: Callable[..., str], name: str) -> str:
        with self._choosing:
            self._require_no_run("change of muscle or rig")
            if self.view.moving:
                raise InputError("muscle and rig", None, "must wait: the machine is operated by hand; vent first")
            said = self._change(do, str(name))
            self.messages.say(f"{self.chosen.words()}.")
            self._open_again()
            return said

    def choose_rig(self, name: str) -> str:
        """Choose the rig of a simulated machine."""
        self._require_simulated("rig", "is that of the real machine; choose another one by mckibben serve --rig")
        return self._set_up(self.chosen.choose_rig, name)

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
        closing = threading.Thread(target=self.view.close, name="close", daemon=True)
        closing.start()
        self._closing = [*(t for t in self._closing if t.is_alive()), closing]
        self._open()
        self.view.thread.start()

    # ---- what may not be done to the machine as it is

    def _require_simulated(self, action: str, problem: str) -> None:
        if self.spec is not None:
            raise InputError(action, None, problem)

    def _require_no_run(self, action: str) -> None:
        if self.running is not None:
            name = self.running.prepared.protocol.name
            raise InputError(action, None, f"must wait: {name} is running; stop it first")

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
        """Return the session, if it may be operated by hand."""
        if self.running is not None:
            names = " and ".join(wanted) or "set-points"
            raise InputError(action, None, f"must wait: the running protocol sets the {names}; stop it first")
        self._require_idle(action)
        self._require_ready()
        return self.session

    def _require_ready(self) -> None:
        if not self.session.ready:
            raise MckibbenError(self.view.failed or "by hand: the machine is getting ready; try again in some seconds")

    # ---- runs

    def start(self) -> str:
        """Begin the protocol, on a machine that is set up again where it begins; a real one is brought there."""
        with self._choosing, self._lock:  # of what is chosen now, which a change that was asked for at once may be
            prepared = self.chosen.passed()
            self._require_idle("start")
            if self.spec is None:
                self.view.hold(True)
            else:  # it is shown from now on, also on the way to where the protocol begins
                self._operated("start", ())
                self.view.show()
            self.ended = {}
            self.clock.begin()
            self.running = RunController(self, prepared)
            if self.spec is None:  # from now on pages show this run, of which there is no sample yet
                self.running.announce()
            self.messages.say("Started. Protocol, muscle and rig are saved with the recording.", 0.0, "done")
            for caution in prepared.cautions:
                self.messages.say(caution, 0.0, "caution")
            self.running.thread.start()
        return f"running {prepared.protocol.name}"

    def run_over(self, run: RunController, said: dict[str, JsonValue], why: str) -> None:
        """Note that a run has ended, what is said of it, and what stopped it; called from its thread."""
        with self._lock:
            self.ended = run.summary(said, why)
            self.running = None
            self.clock.halt(False)
            self.view.hold(False)
        self.workspace.changed()

    def pause(self) -> str:
        """Pause the simulated machine."""
        self._require_simulated(
            "pause", "needs a simulated machine; a real one has its own time and can only be stopped"
        )
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
        self._operated("set", wanted).set(**amounts)  # what is refused moves nothing, nor what pages show
        self.view.show()
        if not was_moving:
            self.ended = {}
        return ""

    def vent(self) -> str:
        """Vent at the manual rate."""
        if self.running is None and not (self.session.why or self.view.moving or self.session.busy):
            self._require_ready()
            return "vented"
        self._operated("vent", ["pressure"]).vent()
        self.view.show()
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
        with self._choosing, self._lock:
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

    def note_drawn(self, epoch: int, samples: int) -> None:
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


# ---- runs


# ---- state for the pages

PACE_NAMES = {"simulated": "as fast as it goes", "real": "real time", "slow": "slow 1:10"}
UNITS = {"pressure": "Pa", "span": "m", "tension": "N", "velocity": "m/s"}


def short(why: str) -> str:
    """Shorten the reason of a stop to a few words."""
    said = why.split(": ", 1)[-1] if why.startswith("/") else why
    return said.split(" at ")[0].split(":")[0].split(",")[0][:60]


# ---- the console on the page Bench: the commands of ``mckibben console`` without access to files

# What a page has not: files are on the page Recordings, time goes by itself. And what it has beside the other commands.
ELSEWHERE = {
    "save": "every run is saved by itself; the page Recordings exports it",
    "record": "every run is saved by itself; for a recording by hand use mckibben console",
    "wait": "time goes by itself here", "quit": "close the page",
}  # fmt: skip
HERE = {name: command for name, command in COMMANDS.items() if name not in ELSEWHERE} | {
    "load": ConsoleCommand("load NAME", "Load a protocol.", "protocol"),
    "run": ConsoleCommand(
        "run [NAME]", "Run the loaded protocol if its dry run passes, or load the named one.", "protocol"
    ),
    "check": ConsoleCommand("check", "Report what the dry run found."),
    "pause": ConsoleCommand("pause", "Let simulated time stand still."),
    "resume": ConsoleCommand("resume", "Go on after a pause."),
    "start": ConsoleCommand("start", "Run the loaded protocol if its dry run passes."),
    "note": ConsoleCommand("note TEXT", "Keep a remark."),
}


class PageConsole(CommandInterpreter):
    """A console that operates the bench of a page."""

    def __init__(self, bench: Bench) -> None:
        super().__init__(bench, HERE, ELSEWHERE)
        self.bench = bench

    def answer(self, line: str) -> dict[str, JsonValue]:
        """Execute a line and return the answer; a refusal is an answer, too."""
        try:
            return {"text": self.execute(str(line)[:2000]), "refused": False}
        except MckibbenError as error:
            return {"text": str(error), "refused": True}

    def completions(self, text: str) -> list[str]:
        """List the completions of the last word of a line that a page sent; never a file."""
        return self.complete(str(text)[:400])

    @property
    def protocol(self) -> Protocol:
        """The selected protocol."""
        return self.bench.chosen.protocol

    def use_protocol(self, protocol: Protocol) -> None:
        """Select a protocol, or the selected one with other values."""
        self.bench.actions()["text"](protocol.toml())

    @property
    def setup(self) -> ManualSetup:
        """Limits and rates of manual operation."""
        return self.bench.session.setup

    @property
    def rig(self) -> Rig:
        """The selected rig."""
        return self.bench.chosen.rig

    @property
    def mounted(self) -> Specimen:
        """The selected muscle."""
        return self.bench.chosen.spec

    def dry_run(self) -> str:
        """Describe the dry run of the selected protocol, once it is done."""
        dry = self.bench.chosen.dry
        if dry is None:
            return "the dry run is not done yet"
        return described_dry_run([f["sentence"] for f in dry.plain["findings"]], dry.plain["duration"])

    def protocols(self, start: str) -> list[str]:
        """List the protocols, those of the user too, whose name begins with a text."""
        own = [n.removesuffix(".toml") for n in self.bench.chosen.own.names()]
        return [n for n in [*protocol_names(), *own] if n.startswith(start)]

    def _status(self, words: list[str]) -> str:
        status = self.bench.status()
        said = [f"{status['name'].lower()}: {status['small']}" if status["small"] else status["name"].lower()]
        if status["why"]:
            said.append(str(status["why"]))
        if self.bench.running is None and self.bench.session.ready:
            said += self.bench.session.status().lines()[1:]
        return "\n".join(said)

    def _load(self, words: list[str]) -> str:
        if len(words) != 1:
            raise usage("load", words)
        return str(self.bench.actions()["protocol"](words[0]))

    def _check(self, words: list[str]) -> str:
        return self.dry_run()

    def _run(self, words: list[str]) -> str:
        if words:
            self._load(words)
            return "loaded; run once the dry run has passed"
        return self.bench.start()

    _start = _run

    def _pause(self, words: list[str]) -> str:
        return self.bench.pause()

    def _resume(self, words: list[str]) -> str:
        return self.bench.resume()

    def _note(self, words: list[str]) -> str:
        return self.bench.note(" ".join(words))


SHOWN = 1000.0  # samples that pages get of a second
CAUSES = {
    "emergency_stop": "the emergency stop", "lost_line": "the loss of the machine", "log": "a log that takes no more",
    "missed": "a test that did not come true",
}  # fmt: skip


class RunController:
    """A run of a bench, in a thread of its own, from its start to its saved recording.

    On the simulated machine the recording is that of ``mckibben run --real-time``, bit for bit: same preparation, same seed,
    same loop; only the pace differs, and paced or not a run is the same. On a real machine it is a run of the session that
    has it.

    Args:
        bench: that the run is on; told `Bench.run_over` when it has ended.
        prepared: the run; its dry run has passed.

    Attributes:
        state: that of the session's run.
        time: time of the newest sample that pages have [s].
        thread: started by the bench.
        asked: task of the operator.
        words: which step or cycle it is in.
        cycle: which of how many, where the step has cycles.
        measured: on the last cycle.
        file: name that its recording is to have.
        stopping: why it is ended by hand, which is no trip.
    """

    def __init__(self, bench: Bench, prepared: PreparedRun) -> None:
        self.bench, self.prepared = bench, prepared
        self.new_machine, self.button = bench.spec is None, bench.session.button
        name = plain(prepared.protocol.name)
        self._crash_log: Path | None = None
        if not self.new_machine:
            self._crash_log = bench.workspace.recordings.ready() / bench.workspace.recordings.numbered(name, ".mcap")
            name = self._crash_log.stem
        self.file = f"{name}.nc" if self._crash_log else bench.workspace.recordings.numbered(name, ".nc")
        self.state, self.time, self._answered = RunState(), 0.0, threading.Event()
        self.stopping = self.asked = ""
        self.words = "getting the machine ready" if self.new_machine else "going to where it begins"
        self.cycle: list[int] = []
        self.measured: list[dict[str, Any]] = []
        self._columns, self._count = Columns(prepared.rig), 0
        self._every = max(1, round(prepared.plan.sample_rate / SHOWN))
        self.at_most = prepared.plan.may_end_early
        self._paced: tuple[float, float, Any] | None = None  # since when its pace is measured: wall, run [s], the pace
        self._speed: float | None = None  # time of the run over that of the wall, lately
        self._told_slow = False
        self.thread = threading.Thread(target=self._play, name="run", daemon=True)

    def stop(self, reason: str, *, trip: bool) -> None:
        """Stop the run: at the next sample the valve vents and the motor only brakes."""
        self.button.press(reason, ordinary=not trip)
        if self.button.ordinary and self.state.result != "stopped":
            self.stopping = self.button.reason
        elif not self.button.ordinary:
            self.stopping = ""
        self.bench.clock.viewed(None)  # a stop waits for no page
        self.bench.clock.halt(False)
        self._answered.set()

    def answer(self) -> None:
        """Confirm an operator action."""
        self.asked = ""
        self._answered.set()

    @property
    def tripped(self) -> str:
        """Reason of a stop by an interlock or the emergency stop; empty otherwise."""
        return self.state.message if self.state.result == "stopped" and not self.stopping else ""

    @property
    def cause(self) -> str:
        """Cause of a stop, as the end of "ended by ..."; empty without a stop and after an ordinary one."""
        stop = self.state.stop
        return "" if stop is None or self.stopping else CAUSES.get(str(stop["code"]), "an interlock")

    @property
    def when(self) -> float:
        """Time of the stop, or present time of the run [s]."""
        return float(self.time if self.state.stop is None else self.state.stop["time"])

    def _play(self) -> None:
        record, said = None, "nothing was recorded"
        try:
            record = self.bench.session.run(
                self.prepared, new_machine=self.new_machine, clock=self.bench.clock if self.new_machine else None,
                log=self._crash_log, begun=self._begun, display=self._show, ask=self._ask,
            )  # fmt: skip
        except MckibbenError as error:
            said = str(error)
        except Exception as error:  # a failed run must not end anything else
            said = f"the run failed: {type(error).__name__}: {str(error)[:200]}"
        why, name = self.tripped or self.bench.session.why, None
        if record is None:
            self._say(said, "stop")
        else:
            name, said = self._save(record, why)
        self.bench.run_over(self, {"file": name, "said": said}, why)

    def _save(self, record: Recording, why: str) -> tuple[str | None, str]:
        """Save the recording and say so; return the name of its file, if there is one, and how the run ended."""
        shelf, message = self.bench.workspace.recordings, str(record.meta["message"])
        if self.stopping:
            message = f"Stopped by you at {self.when:.3f} s; the valve vented."
        try:
            shelf.ready()
            with shelf.free(self.file) as path:
                record.save(path)
            if self._crash_log is not None:
                self._crash_log.unlink(missing_ok=True)  # all of it is in the recording
        except (MckibbenError, OSError) as error:
            log = self._crash_log
            said = f"{error}; {f'kept: {log.name}' if log is not None and log.exists() else 'nothing was kept'}"
            self._say(said, "stop")
            return None, said
        if why or not self.new_machine:  # the session has said how it ended
            self._say(f"Recorded as {path.name}{', up to the stop' if why else ''}.", "done")
        else:
            done = record.meta["result"] == "done" or bool(self.stopping)
            self._say(f"{sentence(message)} Recorded as {path.name}.", "done" if done else "stop")
        return path.name, message

    def _say(self, text: str, kind: str = "note") -> None:
        self.bench.messages.say(text, self.when, kind)

    def announce(self) -> None:
        """Show pages the samples of this run from now on."""
        self.bench.stream.begin("run", self.prepared.protocol.name, self._every / self.prepared.plan.sample_rate)

    def _begun(self, state: RunState) -> None:
        self.state = state
        self.bench.view.hold(True)
        if not self.new_machine:
            self.announce()

    def _ask(self, text: str) -> None:
        self.asked = text
        self._answered.clear()
        self.bench.workspace.changed()
        self._answered.wait()
        self.asked = ""
        if self.button():
            raise InputError("run", self.prepared.protocol.name, f"it was stopped before the operator could {text}")
        self.bench.workspace.changed()

    def _show(self, times: np.ndarray, arrays: Mapping[str, np.ndarray]) -> None:
        first = -self._count % self._every
        self._count, self.time = self._count + len(times), float(times[-1])
        columns = {n: v[first :: self._every] for n, v in self._columns.of(arrays).items()}
        if len(next(iter(columns.values()))):
            self.bench.stream.add(columns)
        self._measure_pace()
        self._follow()

    def _measure_pace(self) -> None:
        """Measure how fast the run goes, from the last pause or choice of a pace on, over some time of the wall."""
        now, pace = time.monotonic(), self.bench.pace
        if self.bench.clock.halted or self._paced is None or self._paced[2] != pace:
            self._paced, self._speed = (now, self.time, pace), None
        elif now - self._paced[0] >= MEASURED:
            self._speed = (self.time - self._paced[1]) / (now - self._paced[0])
            self._paced = now, self.time, pace
            if self.slow and not self._told_slow:
                self._told_slow = True
                self._say(f"The run goes at {self.slow}: it is not computed or shown faster.", "caution")

    @property
    def slow(self) -> str:
        """The pace at which a run goes that does not keep up with the chosen one; empty where it does."""
        wanted, speed = PACES[self.bench.pace] if self.new_machine else None, self._speed
        return "" if wanted is None or speed is None or speed >= SLOWER * wanted else f"{speed:.2g} of real time"

    def _follow(self) -> None:
        """Announce the present cycle and measure the last one; after a stop no cycle begins."""
        if not self.state.steps or self.button() or self.state.result == "stopped":
            return
        step, plan = self.state.steps[-1], self.prepared.plan
        planned = plan.steps[step["index"] - 1]
        frequency, label = planned.step.frequency(), step["label"] or f"step {step['index']}"
        if not frequency:
            self.words, self.cycle = label, []
            return
        count = max(1, round(planned.count / plan.sample_rate * frequency))
        cycle = [min(int((self.time - step["start"]) * frequency) + 1, count), count, step["index"]]
        if cycle == self.cycle:
            return
        self.words, self.cycle = f"cycle {cycle[0]} of {count}", cycle
        self._say(f"Cycle {cycle[0]} of {count} began." if cycle[0] > 1 else f"{label.capitalize()} began.")
        if cycle[0] > 1:
            stream = self.bench.stream
            newest = stream.newest(round(2.2 / (frequency * stream.period)))
            self.measured = of_cycle(newest, stream.period, frequency)

    def status(self) -> dict[str, JsonValue]:
        """Return state, reason and times for the pages."""
        step, why, tripped = self.state.steps[-1] if self.state.steps else None, self.bench.session.why, self.tripped
        paused = self.bench.clock.halted or bool(self.asked)
        shape, name, small = "running", "Running", f"{self.words} \u00b7 {self.slow or PACE_NAMES[self.bench.pace]}"
        if tripped or (self.button() and not self.stopping):
            shape, name, small = "tripped", "Tripped", short(tripped or why or "emergency stop")
        elif paused:
            shape, name = "paused", "Paused"
            small = self.asked or f"at {self.time:.3f} s, simulated time stands still"
        return {
            "shape": shape, "name": name, "small": small, "moving": True, "running": True, "paused": paused,
            "time": self.time, "asked": self.asked, "why": why or tripped, "trip": self.when if tripped else None,
            "words": self.words, "cycle": self.cycle, "duration": self.prepared.plan.duration, "at_most": self.at_most,
            "title": self.prepared.protocol.title, "steps": self.steps(), "measured": self.measured,
            "path": "" if step is None else step["path"], "file": self.file,
        }  # fmt: skip

    def summary(self, said: dict[str, JsonValue], why: str) -> dict[str, JsonValue]:
        """Summarise the run once it has ended, with what is said of it and what stopped it."""
        return {
            **said, "time": self.time, "title": self.prepared.protocol.title, "stopped": bool(why), "why": why,
            "by": self.cause, "trip": self.when if why else None, "steps": self.steps(),
            "duration": self.prepared.plan.duration, "at_most": self.at_most, "measured": self.measured,
        }  # fmt: skip

    def steps(self) -> list[dict[str, JsonValue]]:
        """List the steps that have begun, as a page draws them."""
        steps = []
        for one in list(self.state.steps):
            frequency = self.prepared.plan.steps[one["index"] - 1].step.frequency()
            end, period = one["end"] if one["end"] > one["start"] else None, 1.0 / frequency if frequency else 0.0
            about = {"path": one["path"], "label": one["label"] or "step", "start": one["start"]}
            steps.append({**about, "end": end, "period": period})
        return steps
