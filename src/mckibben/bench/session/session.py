"""A session at the test machine: operated by hand, running protocols, recorded, by whoever is there, from any thread.

    with Session("paper", "nylon") as machine:
        machine.set(pressure="3 bar", span="12 cm")
        record = machine.run("isotonic-triangle")

One machine, simulated or real, is sampled without a gap from the beginning to the end: by hand in a loop that holds the
set-points, then by the loop of a run, then by hand again. Its physics and its controllers go on. A stop stays until
`Session.reset`.
"""

from __future__ import annotations

import contextlib
import gc
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Self

import numpy as np

from ...assembly.muscle_unit import MuscleUnit
from ...engine import STEP
from ...errors import InputError
from ...experiments.protocol import Protocol
from ...quantities import with_unit
from ...recordings.recording import Recording
from ...specimens import Specimen
from ..hardware.interface import Hardware
from ..rig import Rig
from ..run import Display, Progress, Run
from ..segment import AFTER_STOP
from ..software.emergency_stop import EmergencyStop
from ..software.sequencer import SPAN, VELOCITY
from .core import Core
from .record import Recorder
from .run import OnMachine, SessionRun, prepared
from .setup import MODES, Setup
from .status import CLOSED, Message, Status

__all__ = ["Message", "Session", "Status"]

VENTED = 2e3  # pressure below which nothing is left to vent [Pa]
LONGEST = 3.0  # time for which the end of a session waits for that [s]
SEEN = 2.0  # time within which what was asked for shows, by the wall clock [s]


class Session(Core):
    """A machine in somebody's hands. All methods may be called from any thread.

    Args:
        rig: a rig, its name or file.
        muscle: a specimen, its id or file, or a muscle.
        hardware: a machine at the border, closed with the session; None: a simulated one in the same process.
        unit: what was built from the specimen, where something of it was changed.
        span: at which it is mounted, in words or [m]; the rest length where left out.
        plumbing: the way to join the pneumatic parts; the usual one where left out.
        rate: samples per second [1/s].
        speed: of a simulated machine over the wall clock. None: as fast as it goes, and only while somebody waits.
        seed: of the sensors' noise.
        step: largest step of the physics [s].
        keep: time for which samples are kept for displays [s].
        hold: time for which set-points are held after `control_lost` [s].

    Raises:
        InputError: names what is unknown, what the rig does not allow, or that the machine does not fit the rig.
    """

    def __init__(
        self, rig: Rig | str = "paper", muscle: Specimen | MuscleUnit | str = "nylon", hardware: Hardware | None = None, *,
        unit: MuscleUnit | None = None, span: float | str | None = None, plumbing: str | None = None,
        rate: float | None = None, speed: float | None = 1.0, seed: int = 0, step: float = STEP, keep: float = 30.0,
        hold: float = 5.0,
    ) -> None:  # fmt: skip
        setup = Setup(
            rig, muscle, hardware, unit=unit, span=span, plumbing=plumbing, rate=rate, speed=speed, seed=seed, step=step,
            hold=hold,
        )  # fmt: skip
        super().__init__(setup, keep=keep, stepped=speed is None and hardware is None)

    def set(self, **wanted: float | str) -> None:
        """Ask for a ``pressure``, and for one of ``span``, ``velocity`` and ``tension``, in words or SI.

        The set-points go there no faster than `Setup.manual` allows.

        Raises:
            InputError: if the rig does not allow it, or the machine is not in manual mode.
        """
        with self._acting:
            self._free(", ".join(wanted))
            self.ask_for(**wanted)

    def ask_for(self, **wanted: float | str) -> None:
        """The same without asking who has the machine."""
        for name in wanted:
            if name not in ("pressure", *MODES):
                raise InputError("set-point", name, f"known are pressure, {', '.join(MODES)}")
        motors = [n for n in wanted if n in MODES]
        if len(motors) > 1:
            raise InputError(
                motors[1], str(wanted[motors[1]]), f"the motor controls one thing, and that is {motors[0]}"
            )
        given = {name: self.setup.amount(name, value) for name, value in wanted.items()}
        change = {"alone": 0.0} | ({"pressure": given["pressure"]} if "pressure" in given else {})
        if motors:
            change |= {"mode": float(MODES[motors[0]]), "motor": given[motors[0]]}
        self._wishes.change(**change)
        self._used = True
        units = {"pressure": "Pa", "span": "m", "velocity": "m/s", "tension": "N"}
        self._remark(", ".join(f"{n} {with_unit(v, units[n])}" for n, v in given.items()))

    def vent(self) -> None:
        """Let the pressure down at the manual rate; a velocity ends, a span or tension is held."""
        with self._acting:
            self._free("vent")
            ends = {"mode": float(SPAN), "motor": np.nan} if self._wishes["mode"] == VELOCITY else {}
            self._wishes.change(pressure=0.0, open=1.0, **ends)
            self._used = False
            self._remark("vent")

    def emergency_stop(self, reason: str = "the button was pressed") -> None:
        """At the next sample the valve vents and the motor only brakes, whatever goes on; until `reset`."""
        self.button.press(reason)
        if self._gate is not None and self._run is None and not self.why:
            self.wait(self.period)
            self.wait(AFTER_STOP)
        self._until(lambda: bool(self.why or self._gone), SEEN)

    def reset(self) -> None:
        """After a stop: manual mode again, vented, with the motor where it is.

        Raises:
            InputError: if it is not stopped.
        """
        with self._acting:
            if self._gone or self._run is not None or not self.why:
                raise InputError("reset", self.status().state, "allowed is after a stop, while nothing runs")
            with self._lock:
                self._rest()
                self.button, self.why = EmergencyStop(), ""
                self._loop.renew()
                self._from = self.setup.ground.number + 1
            self.note("reset")
            self.wait(2.0 * self.period)

    def run(
        self, protocol: Protocol | str | OnMachine, *, log: str | Path | None = None, progress: Progress | None = None,
        display: Display | None = None, ask: Callable[[str], None] | None = None, accept_saturation: bool = False,
        begun: Callable[[Run], None] | None = None,
    ) -> Recording:  # fmt: skip
        """Do a protocol and come back to manual mode, holding the last set-points.

        The machine first goes by hand to where the protocol begins; then `begun` is told the run, for what it is doing.
        Other arguments, recording and errors are those of `run.run`.

        Raises:
            InputError: a finding of the dry run, after which nothing moves; or the machine is not in manual mode.
        """
        with self._acting:
            self._free("run")
            bench = self.prepared(protocol, accept_saturation) if not isinstance(protocol, OnMachine) else protocol
            doing = SessionRun(self, bench, ask)
            name, self._run = bench.protocol.name, doing
            self.note(f"run {name}")
            try:
                record = doing.go(log, progress, display, begun)
            finally:
                self._run = None
                self._collect()
            said, done = str(record.meta["message"]), record.meta["result"] == "done"
            with self._lock:
                if done or not self.why:  # a stop that the samples showed has been told
                    self._say(f"{name}: {said}", "done" if done else "stop")
                self.why = self.why or ("" if done else said)
            return record

    def prepared(self, protocol: Protocol | str, accept_saturation: bool = False) -> OnMachine:
        """A protocol on this machine with the findings of the dry run, from where it begins."""
        return prepared(protocol, self.setup.rate, accept_saturation=accept_saturation, **self.setup.options)

    def start_recording(self, log: str | Path | None = None) -> None:
        """Keep every sample from the next one on, runs included, and with `log` also in a new ``.mcap`` file."""
        with self._acting:
            if self._record is not None:
                raise InputError("record", "on", "it is recording already; allowed is off")
            self._alive("record")
            recorder = Recorder(self.setup.bench, self.setup.timing, self.setup.ground, log)
            self._record = recorder
            self._between(recorder.begin)

    def stop_recording(self) -> Recording:
        """What was recorded.

        Raises:
            InputError: if nothing was.
        """
        with self._acting:
            recorder = self._record
            if recorder is None:
                raise InputError("record", "off", "nothing is being recorded; allowed is on")
            self._between(recorder.end)
            self._until(recorder.complete, SEEN)
            self._record = None
            closed = self.setup.closed if self.setup.ground.machine is not None else None
            return recorder.close(self.setup.machine, closed, "The recording was ended by hand.")

    def control_lost(self) -> None:
        """Whoever was in control is not there any more: after `hold` the machine vents, until something is asked again."""
        self._wishes.change(alone=1.0)

    def control_back(self) -> None:
        """Somebody is in control; what was asked for holds, unless it has vented by now."""
        self._collect()
        self._wishes.change(alone=0.0)

    def close(self) -> None:
        """Stop what runs, vent, and let go of the machine; may be called twice."""
        if self._run is not None:
            self.button.press("the session was closed")
        with self._acting:
            if self._gone == CLOSED:
                return
            if not self._gone:
                self._rest()
                left = LONGEST
                while not self._gone and self.latest().get("pressure", 0.0) > VENTED and left > 0.0:
                    self.wait(0.1)
                    left -= 0.1
            if self._record is not None:
                with contextlib.suppress(InputError):
                    self.stop_recording()
            self._loop.leave()
            self._collect()
            self.setup.ground.hardware.close()
            self._gone = CLOSED
            gc.unfreeze()

    def __enter__(self) -> Self:
        """The session itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """It vents, whatever happened; at once where that was no good."""
        if kind is not None:
            self.button.press(f"the session ended with {kind.__name__}")
        self.close()
