"""A session at the test machine: manual operation, runs of protocols, and recordings, from any thread.

    with Session("paper", "nylon") as machine:
        machine.set(pressure="3 bar", span="12 cm")
        record = machine.run("isotonic-triangle")

One machine, simulated or real, is sampled without a gap from the beginning to the end: by hand in a loop that holds the
set-points, then by the loop of a run, then by hand again. Its physics and its controllers go on. A stop stays until
`Session.reset`.
"""

from __future__ import annotations

import contextlib
import functools
import gc
import threading
import time
from collections.abc import Callable, Generator
from pathlib import Path
from typing import Any

import numpy as np

from ...assembly.muscle_unit import MuscleUnit
from ...engine import STEP
from ...errors import InputError, LineLostError, MckibbenError
from ...experiments.amounts import CHANNELS
from ...experiments.protocol import Protocol
from ...quantities import with_unit
from ...recordings.recording import Recording
from ...specimens import Specimen
from .. import channels
from ..hardware.interface import Hardware
from ..hardware.simulated import Clock
from ..prepare import PreparedRun
from ..protocol_run import Display, NewMachine, Progress, ProtocolRun, RunState, Stage, channels_of
from ..recorder import ManualRecording
from ..rig import Rig
from ..rig_file import rig as rig_of
from ..sample_loop import LOOK, Lateness, SampledMachine, SampleLoop, Setpoints
from ..segment import AFTER_STOP, Chunk
from ..software.interlocks import EmergencyStop, Trip, stop_sentence
from ..software.sequencer import ABANDONED, SPAN, TENSION, VELOCITY
from .continued import ContinuedMachine, SampledSession
from .interface import (
    CLOSED,
    HOLD,
    IDLE,
    LOST,
    MANUAL,
    MODES,
    RUNNING,
    STOPPED,
    ManualSetup,
    Message,
    Messages,
    SampleRing,
    Status,
)

VENTED = 2e3  # pressure below which nothing is left to vent [Pa]
LONGEST = 3.0  # time for which the end of a session waits for that [s]
SEEN = 2.0  # time within which what was asked for shows, by the wall clock [s]
STEP_OF_TIME = 0.1  # time between two looks at a machine whose time goes only while a caller waits [s]
QUIET = 0.6  # time after which a machine that rests stands still [s]


class Session(SampledSession):
    """The owner of a machine and its clock. All methods may be called from any thread.

    Args:
        rig: a rig, its name or file.
        muscle: a specimen, its id or file, or a muscle.
        hardware: a machine, closed with the session; None: a simulated one in the same process.
        unit: what was built from the specimen, where something of it was changed.
        span: at which the muscle is mounted, as text or [m]; the rest length by default.
        plumbing: the way to join the pneumatic parts; the usual one by default.
        rate: samples per second [1/s].
        speed: speed of a simulated machine over the wall clock. None: as fast as it goes, and only while a caller waits.
        seed: seed of the sensors' noise.
        step: largest step of the physics [s].
        keep: time for which samples are kept for displays [s].
        hold: time for which set-points are held after `control_lost` [s].
        rests: a simulated machine stands still while nothing is asked of it.
        by_hand: make the machine ready to be operated by hand; else only runs with `new_machine` are possible until
            `make_ready`.
        messages: where the session adds its messages; its own ones by default.

    Raises:
        InputError: names what is unknown, what the rig does not allow, or that the machine does not fit the rig.

    Examples:
        >>> import mckibben as mk
        >>> with mk.Session("paper", "nylon", speed=None) as machine:
        ...     machine.set(pressure="2 bar", span="13.5 cm")
        ...     machine.wait(1.5)
        ...     round(machine.latest()["pressure"] / 1e5, 1)
        2.0
    """

    def __init__(
        self, rig: Rig | str = "paper", muscle: Specimen | MuscleUnit | str = "nylon", hardware: Hardware | None = None, *,
        unit: MuscleUnit | None = None, span: float | str | None = None, plumbing: str | None = None,
        rate: float | None = None, speed: float | None = 1.0, seed: int = 0, step: float = STEP, keep: float = 30.0,
        hold: float = HOLD, rests: bool = False, by_hand: bool = True,
        messages: Messages | None = None,
    ) -> None:  # fmt: skip
        if speed is not None and not speed > 0.0:
            raise InputError("speed", speed, "must be a factor above zero")
        self.rig = rig if isinstance(rig, Rig) else rig_of(rig)
        self.button, self._why = EmergencyStop(), ""
        self._setting_up = functools.partial(
            ManualSetup, self.rig, span=span, rate=rate, hold=hold, muscle=muscle, unit=unit, plumbing=plumbing,
            seed=seed, step=step,
        )  # fmt: skip
        self._given, self._keep, self._speed = hardware, keep, speed
        self._stepped = speed is None and hardware is None
        self._rests = rests and not self._stepped and hardware is None
        self.clock = Clock(speed, grain=0.004 if self._rests else 0.0, halted=self._stepped or self._rests)
        self._lock, self._acting = threading.RLock(), threading.RLock()
        self._messages = Messages() if messages is None else messages
        self._recording: ManualRecording | None = None
        self._run: ProtocolRun | None = None
        self._run_loop: SampleLoop | None = None
        self._gone = ""  # lost or closed
        self._alone, self._since_alone = False, 0.0
        self._first_news = 0  # number of the first sample whose stops are news
        self._used = False  # whether anything was asked for since it was last vented
        # aside: the machine that is operated by hand stands still during a run on a new machine
        self.ready = self._aside = False
        if by_hand:
            self.make_ready()

    def make_ready(self) -> None:
        """Set up the machine and begin to sample it by hand; see `MachineSession`."""
        setup = self._setup = self._setting_up()
        self.period = setup.timing.period
        hardware = setup.simulated(self.clock) if self._given is None else self._given
        self.machine = SampledMachine(hardware, self.period)
        self._ring, self._setpoints = SampleRing(max(1, round(self._keep / self.period))), Setpoints()
        self._loop = SampleLoop(
            self.machine, setup.converters, setup.software(), outputs=setup.machine.signals(), setpoints=self._setpoints,
            stop=lambda: self.button(), tell=functools.partial(self.observe, by_hand=True), ended=self._ended_by_hand,
        )  # fmt: skip
        # what has been made by now stays, so that nobody looks through it again while samples wait
        gc.collect()
        gc.freeze()
        self._loop.start()
        self.ready = True
        self.wait(self.period)
        if not self._stepped:
            threading.Thread(target=self._tend, name="session", daemon=True).start()

    # ---- samples as they come

    @property
    def setup(self) -> ManualSetup:
        """Limits, rates and channels of manual operation; see `MachineSession`."""
        self._require_ready("by hand")
        return self._setup

    @property
    def simulated(self) -> bool:
        """Whether the machine is simulated in this process."""
        return self._given is None or self._given.state() is not None

    @property
    def why(self) -> str:
        """Reason for which the machine is stopped; empty while it is not stopped."""
        pressed = self.button() and not self.button.ordinary
        return self._why or (self.button.reason if pressed else "")

    @property
    def gone(self) -> str:
        """Reason for which the machine is lost or closed; empty while it is available."""
        return self._gone

    @property
    def busy(self) -> bool:
        """Whether manual commands are pending, or the machine is under pressure."""
        return self._state() == MANUAL or self.latest().get("pressure", 0.0) > VENTED

    def set_speed(self, speed: float) -> None:
        """Go on at another speed from now on; see `MachineSession`."""
        if not self.simulated:
            raise InputError("speed", speed, "must be left out: a real machine has its own time")
        self._speed = speed
        if not self._alone:
            self.clock.speed = speed

    def observe(self, chunk: Chunk, *, by_hand: bool = False) -> None:
        """Take a chunk of samples of the manual loop or of a run, in their order."""
        results, numbers = chunk.results, chunk.numbers
        arrays, times = channels_of(results, chunk.size), self.period * numbers
        with self._lock:
            self._ring.add(times, arrays)
            if self._recording is not None:
                try:
                    self._recording.take(numbers, chunk.lateness, arrays)
                except MckibbenError as error:
                    self._recording = None
                    self._messages.say(f"nothing is recorded any more: {error}", float(times[-1]), "stop")
            news = (results.shown["code"] > 0) & (numbers >= self._first_news)
            if news.any() and not self._why:
                self._stopped(chunk, int(np.argmax(news)), times)
            if by_hand and self._setpoints["pressure"] > 0.0 and (results.shown["step"] == ABANDONED).any():
                self._abandon(float(times[-1]))

    def _abandon(self, when: float | None = None) -> None:
        self._rest()
        self._say("nobody is in control: vented, and the motor holds", "stop", when)

    def _stopped(self, chunk: Chunk, i: int, times: np.ndarray) -> None:
        shown, when = chunk.results.shown, float(times[i])
        code = int(shown["code"][i])
        if code == Trip.EMERGENCY_STOP:
            self._why = stop_sentence(self.button, when)
        else:
            at = {n: float(v[i]) for n, v in chunk.results.measured.items() if not n.endswith(".code")}
            self._why = self._setup.watch.reason(code, at | {"velocity": float(shown["velocity"][i])}, when)
        self._rest()
        self._say(self._why, "stop", when, code=Trip(code).name.lower())

    def _collect(self) -> None:
        with self._lock:
            run_loop = self._run_loop
            if self.ready and not (run_loop is not None and run_loop.pending) and self._loop.kept:
                self._loop.chunk()

    def _tend(self) -> None:
        quiet = 0.0
        while self._gone != CLOSED:
            self._collect()
            if self._rests and not self.clock.halted and self._loop.alive:
                quiet = 0.0 if self.busy else quiet + LOOK
                if quiet > QUIET:
                    self.clock.halt()
                    quiet = 0.0
                late = self._alone and time.monotonic() - self._since_alone > float(self.setup.manual.hold)
                if late and self._setpoints["pressure"] > 0.0:
                    self._abandon()  # a busy computer lets the machine's own time go slower
            time.sleep(LOOK)

    # ---- the machine from loop to loop

    def lend(self, run_loop: SampleLoop) -> SampleLoop:
        """End the manual loop between two samples, so that the loop of a run can continue.

        Raises:
            LineLostError: if the machine is not there any more.
        """
        loop = self._loop.leave()
        with self._lock:
            loop.chunk()
            self._run_loop = run_loop
        if self._gone:
            raise LineLostError(self.why or self._gone)
        if self._stepped:
            self.clock.halt(False)
        return loop

    def resume(self, loop: SampleLoop) -> None:
        """Return to manual operation after the last sample of a run, at its set-points, or vented if it was stopped."""
        if self._stepped:
            self.clock.halt()
        error = loop.lost or loop.failed
        if error is not None:
            self._lose(error)
            return
        mode, value = loop.motor
        held = (TENSION, value) if mode == TENSION else (SPAN, np.nan)
        self._setpoints.change(
            pressure=loop.number("command.pressure"), open=float(loop.opened), mode=held[0], motor=held[1], alone=0.0
        )
        self._used = True
        if loop.halted:
            self._rest()
        self._loop.start(after=loop)

    def _ended_by_hand(self, loop: SampleLoop) -> None:
        error = loop.lost or loop.failed
        if error is not None:
            self._lose(error)

    def _lose(self, error: BaseException) -> None:
        with self._lock:
            if self._gone:
                return
            self._gone, self._why = LOST, str(error) or type(error).__name__
            self._say(self.why, "stop")
        self.clock.interrupt()

    def _rest(self) -> None:
        """Reset the set-points: vented, and the motor stays in place."""
        self._setpoints.change(pressure=0.0, open=1.0, mode=SPAN, motor=np.nan, alone=0.0)
        self._used = False

    def _wake(self) -> None:
        """Wake a machine that is halted while no commands are pending."""
        if self._rests and self.clock.halted:
            self.clock.halt(False)

    def _between(self, act: Callable[[int], None]) -> None:
        """Call a function between two samples with the number of the next one."""
        machine, done = self.machine, threading.Event()
        if self.gone or (self.clock.halted and self._loop.alive):
            act(machine.number)
            return

        def acted(number: int) -> None:
            act(number)
            done.set()

        machine.mark = acted
        while not (done.wait(LOOK) or self.gone):
            pass
        if not done.is_set():
            act(machine.number)

    # ---- what it is

    def wait(self, seconds: float) -> None:
        """Wait for a time of the machine [s]; see `MachineSession`."""
        self._require_ready("wait")
        machine, before = self.machine, self._why
        until, step = machine.number + max(1, round(seconds / self.period)), max(1, round(STEP_OF_TIME / self.period))
        while machine.number < until and self._why == before and not self._gone:
            if self._stepped and self._loop.alive:
                self.clock.advance(self.clock.count + min(until - machine.number, step))
            else:
                self._wake()
                time.sleep(LOOK / 4.0)
            self._collect()

    def _until(self, true: Callable[[], bool], longest: float) -> None:
        end = time.monotonic() + longest
        self._collect()
        while not true() and time.monotonic() < end:
            time.sleep(LOOK / 4.0)
            self._collect()

    def latest(self) -> dict[str, float]:
        """Return the newest sample; see `MachineSession`."""
        self._collect()
        with self._lock:
            return self._ring.latest() if self.ready else {}

    def since(self, time: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the samples after a time [s]; see `MachineSession`."""
        self._collect()
        with self._lock:
            return self._ring.since(time) if self.ready else (np.zeros(0), {})

    def messages(self, after: int = 0) -> list[Message]:
        """Return the messages after the one with a number."""
        self._collect()
        return self._messages.after(after)

    def note(self, text: str, kind: str = "note") -> None:
        """Add a message at the time of the newest sample; a recording keeps it, too."""
        with self._lock:
            self._say(text, kind)

    def _say(self, text: str, kind: str = "note", time: float | None = None, **more: Any) -> None:
        when = self._now if time is None else time
        self._messages.say(text, when, kind)
        self._remark(text, when, **more)

    @property
    def _now(self) -> float:
        return self.machine.number * self.period if self.ready else 0.0

    def _remark(self, text: str, time: float | None = None, **more: Any) -> None:
        with self._lock:
            if self._recording is not None:
                self._recording.remark(text, self._now if time is None else time, **more)

    def status(self) -> Status:
        """Return the status of the machine at its newest sample."""
        at, run, recording = self.latest(), self._run, self._recording
        asked = {n.removeprefix("command."): v for n, v in at.items() if n.startswith("command.") and np.isfinite(v)}
        kept = () if self.why else ("pressure",) if self.rig.motor is None else tuple(asked)
        asked = {n: v for n, v in asked.items() if n in kept}
        running = None if run is None else (run.prepared.protocol.name, run.state.time, run.prepared.plan.duration)
        return Status(
            state=self._state(), why=self.why, time=at.get("time", 0.0),
            measured={n: at[n] for n in channels.measured() if n in at}, set_points=asked,
            deadlines=self._loop.deadlines() if self.ready else Lateness.of(np.zeros(0), 1.0),
            protocol=running, recorded=None if recording is None else recording.time,
        )  # fmt: skip

    def _state(self) -> str:
        if self._gone:
            return self._gone
        if self._run is not None:
            return RUNNING
        return STOPPED if self.why else MANUAL if self._used else IDLE

    # ---- by hand

    def set(self, **wanted: float | str) -> None:
        """Ask for set-points; see `MachineSession`."""
        with self._acting:
            self.require_manual(", ".join(wanted))
            self.ask_for(**wanted)

    def ask_for(self, **wanted: float | str) -> None:
        """Change the set-points without checking the mode of the machine."""
        for name in wanted:
            if name not in ("pressure", *MODES):
                raise InputError("set-point", name, known=("pressure", *MODES))
        motors = [n for n in wanted if n in MODES]
        if len(motors) > 1:
            problem = f"the motor controls one thing, and that is {motors[0]}"
            raise InputError(motors[1], str(wanted[motors[1]]), problem)
        amounts = {name: self.setup.amount(name, value) for name, value in wanted.items()}
        self._alone = False
        change = {"alone": 0.0} | ({"pressure": amounts["pressure"]} if "pressure" in amounts else {})
        if motors:
            change |= {"mode": float(MODES[motors[0]]), "motor": amounts[motors[0]]}
        self._setpoints.change(**change)
        self._used = True
        self._remark(", ".join(f"{n} {with_unit(v, CHANNELS[n])}" for n, v in amounts.items()))
        self._wake()

    def vent(self) -> None:
        """Vent at the manual rate; see `MachineSession`."""
        with self._acting:
            self.require_manual("vent")
            ends = {"mode": float(SPAN), "motor": np.nan} if self._setpoints["mode"] == VELOCITY else {}
            self._setpoints.change(pressure=0.0, open=1.0, **ends)
            self._used = False
            self._remark("vent")

    def emergency_stop(self, reason: str = "the button was pressed") -> None:
        """Stop, vent and brake; see `MachineSession`."""
        self.button.press(reason)
        if not self.ready and self._run is None and not self._why:
            self._why = stop_sentence(self.button, 0.0)
            self._messages.say(self.why, None, "stop")
        if not self.ready or self._aside:
            return
        self._wake()
        if self._stepped and self._run is None and not self._why:
            self.wait(self.period)
            self.wait(AFTER_STOP)
        self._until(lambda: bool(self._why or self._gone), SEEN)

    def reset(self) -> None:
        """Return to manual mode after a stop; see `MachineSession`."""
        with self._acting:
            self._require_there("reset")
            if self._run is not None or not self.why:
                raise InputError("reset", None, "is allowed only after a stop, while nothing runs")
            with self._lock:
                self.button, self._why = EmergencyStop(), ""
                if self.ready:
                    self._rest()
                    self._loop.renew()
                    self._first_news = self.machine.number + 1  # samples on their way still show the old stop
            self.note("reset")
            if self.ready:
                self.wait(2.0 * self.period)

    def control_lost(self) -> None:
        """Note that the client in control disconnected; see `MachineSession`."""
        self._require_ready("control")
        self._alone, self._since_alone = True, time.monotonic()
        if self._rests:
            self.clock.speed = 1.0  # the time after which it vents is by the wall clock
        self._setpoints.change(alone=1.0)

    def control_back(self) -> None:
        """Note that a client is in control again; see `MachineSession`."""
        self._require_ready("control")
        self._alone = False
        if self._rests:
            self.clock.speed = self._speed
        self._collect()
        self._setpoints.change(alone=0.0)

    # ---- protocols

    def run(
        self, protocol: Protocol | str | PreparedRun, *, new_machine: bool = False, clock: Clock | None = None,
        stop: Callable[[], bool] | None = None, log: str | Path | None = None, accept_saturation: bool = False,
        begun: Callable[[RunState], None] | None = None, progress: Progress | None = None,
        display: Display | None = None, ask: Callable[[str], None] | None = None,
    ) -> Recording:  # fmt: skip
        """Run a protocol; see `MachineSession`. `stop` is asked whether to end it; else the session's button."""
        with self._acting:
            if not new_machine:
                self.require_manual("run")
            self._require_there("run")
            if stop is None:
                self._require_no_stop("run")
            prepared = protocol if isinstance(protocol, PreparedRun) else self.prepare(protocol, accept_saturation)
            attended = ask is not None
            stage: Stage = NewMachine(self._given, clock) if new_machine else ContinuedMachine(self, prepared, attended)
            run = ProtocolRun(
                prepared, stage, progress=progress, display=display, ask=ask, log=log, begun=begun,
                stop=self.button if stop is None else stop,
            )  # fmt: skip
            if not new_machine:
                self.note(f"run {prepared.protocol.name}")
            self._run, record = run, None
            try:
                with self._set_aside() if new_machine else contextlib.nullcontext():
                    record = run.play()
            finally:
                self._run = self._run_loop = None
                self._collect()
                self._settle(run, new_machine, record is not None)
            return record

    def _settle(self, run: ProtocolRun, new_machine: bool, recorded: bool) -> None:
        """Say how a run ended, and keep why it was stopped until `reset`, unless the user ended it on purpose."""
        state = run.state
        # a stop by hand after an interlock has acted, while the machine vents, does not make that undone
        ordinary = bool(getattr(run.stop, "ordinary", False)) and (state.stop is None or state.stop["code"] == "stop")
        with self._lock:
            if new_machine and state.result == "stopped" and not ordinary and not self._why:
                self._why = state.message
                self._messages.say(state.message, state.time if state.stop is None else state.stop["time"], "stop")
            elif not new_machine and recorded:
                done = state.result == "done"
                if done or not self._why:  # a stop that the samples showed has been told
                    self._say(f"{run.prepared.protocol.name}: {state.message}", "done" if done else "stop")
                self._why = self._why or ("" if done else state.message)
        if not new_machine and ordinary and self._why and not self._gone:
            self.reset()

    @contextlib.contextmanager
    def _set_aside(self) -> Generator[None, None, None]:
        """Let the machine that is operated by hand stand still, vented, during a run on another one."""
        opened, self._aside = self.ready, True
        if opened:
            self._rest()
            self._loop.leave()
            self._collect()
        try:
            yield
        finally:
            self._aside, self.button = False, EmergencyStop()  # that of the run belongs to its machine
            if opened and not self._gone:
                self.clock.halt(self._rests or self._stepped)
                self._loop.start()

    # ---- recordings by hand

    def start_recording(self, log: str | Path | None = None) -> None:
        """Record from the next sample on; see `MachineSession`."""
        with self._acting:
            if self._recording is not None:
                raise InputError("record", None, "is on already; use record off")
            self._require_there("record")
            self._require_ready("record")
            recording = ManualRecording(self.setup.prepared, self.setup.timing, self.machine, log)
            self._recording = recording
            self._between(recording.begin)

    def stop_recording(self) -> Recording:
        """End the recording, and return what was recorded; see `MachineSession`."""
        with self._acting:
            recording = self._recording
            if recording is None:
                raise InputError("record", None, "is off already; use record on")
            self._between(recording.end)
            self._until(recording.complete, SEEN)
            self._recording = None
            return recording.close(self.setup.machine, self.setup.closed, "The recording was ended by hand.")

    # ---- its end

    def close(self) -> None:
        """Stop runs, vent, and release the machine; may be called twice."""
        if self._run is not None:
            self.button.press("the session was closed")
        with self._acting:
            if self._gone == CLOSED or not self.ready:
                self._gone = CLOSED
                return
            if not self._gone:
                self._rest()
                left = LONGEST
                while not self._gone and self.latest().get("pressure", 0.0) > VENTED and left > 0.0:
                    self.wait(0.1)
                    left -= 0.1
            if self._recording is not None:
                with contextlib.suppress(InputError):
                    self.stop_recording()
            self._loop.leave()
            self._collect()
            self.machine.hardware.close()
            self._gone = CLOSED
            gc.unfreeze()
