"""The interface of a session, which consoles, pages and Bluesky devices use wherever the machine's process is."""

from __future__ import annotations

import abc
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Self

import numpy as np

from ...errors import InputError
from ...experiments.protocol import Protocol
from ..prepare import PreparedRun, prepare_on_machine
from ..rig import Rig
from ..software.emergency_stop import EmergencyStop
from .status import Message, Status

if TYPE_CHECKING:
    from ...recordings.recording import Recording
    from ..hardware.clock import Clock
    from ..protocol_run import Display, Progress, RunState
    from .setup import ManualSetup


class MachineSession(abc.ABC):
    """A machine to be operated: `Session` owns it in this process, `SessionProxy` reaches one in another process.

    Attributes:
        rig: whose machine it is.
        button: the emergency stop; another one after every reset.
        ready: whether the machine is sampled and can be operated by hand.
        period: period of the samples of a machine that is ready [s].
    """

    rig: Rig
    button: EmergencyStop
    ready: bool
    period: float

    @abc.abstractmethod
    def make_ready(self) -> None:
        """Set up the machine and begin to sample it by hand; once.

        Raises:
            MckibbenError: if the rig does not allow it, or the machine is not there.
        """

    @property
    @abc.abstractmethod
    def setup(self) -> ManualSetup:
        """Limits, rates and channels of manual operation.

        Raises:
            InputError: if the machine is there for runs only.
        """

    @property
    @abc.abstractmethod
    def simulated(self) -> bool:
        """Whether the machine is a simulated one."""

    @abc.abstractmethod
    def set_speed(self, speed: float) -> None:
        """Let a simulated machine go on at another speed over the wall clock.

        Raises:
            InputError: if the machine is a real one.
        """

    @property
    @abc.abstractmethod
    def gone(self) -> str:
        """Whether the machine is ``lost`` or ``closed``; nothing while it is there."""

    @property
    @abc.abstractmethod
    def why(self) -> str:
        """Reason for which the machine is stopped; empty while it is not stopped."""

    @property
    @abc.abstractmethod
    def busy(self) -> bool:
        """Whether manual commands are pending, or the machine is under pressure."""

    @abc.abstractmethod
    def status(self) -> Status:
        """Return the status of the machine at its newest sample, or the last one of a lost machine."""

    @abc.abstractmethod
    def latest(self) -> dict[str, float]:
        """Return the newest sample: ``time`` of the session [s] and every channel [SI]; empty if there is none."""

    @abc.abstractmethod
    def since(self, time: float) -> tuple[np.ndarray, dict[str, np.ndarray]]:
        """Return the samples after a time [s], as far as they are kept: times (n,) and channels (n,)."""

    @abc.abstractmethod
    def messages(self, after: int = 0) -> list[Message]:
        """Return the messages after the one with a number."""

    @abc.abstractmethod
    def note(self, text: str, kind: str = "note") -> None:
        """Add a message at the time of the newest sample; a recording keeps it, too."""

    @abc.abstractmethod
    def wait(self, seconds: float) -> None:
        """Wait for a time of the machine [s]; return earlier if it is stopped or lost meanwhile."""

    @abc.abstractmethod
    def set(self, **wanted: float | str) -> None:
        """Ask for a ``pressure``, and for one of ``span``, ``velocity`` and ``tension``, as text or SI.

        The set-points go there no faster than `ManualSetup.manual` allows.

        Raises:
            InputError: if the rig does not allow it, or the machine is not in manual mode.
        """

    @abc.abstractmethod
    def vent(self) -> None:
        """Vent at the manual rate; a velocity ends, a span or tension is held."""

    @abc.abstractmethod
    def emergency_stop(self, reason: str = "the button was pressed") -> None:
        """Vent and brake the motor at the next sample, also during a run; the machine stays stopped until `reset`."""

    @abc.abstractmethod
    def reset(self) -> None:
        """Return to manual mode after a stop, vented, with the motor in place.

        Raises:
            InputError: if it is not stopped.
        """

    @abc.abstractmethod
    def control_lost(self) -> None:
        """Note that the client in control disconnected: hold, then vent."""

    @abc.abstractmethod
    def control_back(self) -> None:
        """Note that a client is in control again; the set-points hold, unless the machine has vented."""

    @abc.abstractmethod
    def run(
        self, protocol: Protocol | str | PreparedRun, *, new_machine: bool = False, clock: Clock | None = None,
        log: str | Path | None = None, accept_saturation: bool = False, begun: Callable[[RunState], None] | None = None,
        progress: Progress | None = None, display: Display | None = None, ask: Callable[[str], None] | None = None,
    ) -> Recording:  # fmt: skip
        """Run a protocol, and come back to manual mode, holding the last set-points.

        The machine first goes by hand to where the protocol begins. The recording and other errors are those of `run.run`.

        Args:
            protocol: itself, its name, or what `prepare` made of it.
            new_machine: run on a machine that is set up for this run: a simulated one is made again, with a muscle at rest
                where the protocol begins; a real one is started, its encoder zeroed where the operator mounted the muscle.
                What is operated by hand stands still meanwhile.
            clock: of the time of a simulated machine in this process that is made again; None: as fast as it goes, whole
                chunks at once.
            log: a new ``.mcap`` file, see `run.run`.
            accept_saturation: go on where only the load cell's range would be exceeded.
            begun: given the state of the run when the machine is where it begins.
            progress: told how far it is [s], and the longest time [s].
            display: shown every chunk.
            ask: told what a person has to do; returns when it is done.

        Raises:
            InputError: a finding of the dry run, after which nothing moves; or the machine is not in manual mode.
        """

    @abc.abstractmethod
    def start_recording(self, log: str | Path | None = None) -> None:
        """Record every sample from the next one on, runs included, with `log` also into a new ``.mcap`` file."""

    @abc.abstractmethod
    def stop_recording(self) -> Recording:
        """End the recording, and return what was recorded.

        Raises:
            InputError: if nothing was.
        """

    @abc.abstractmethod
    def close(self) -> None:
        """Stop runs, vent, and release the machine; may be called twice."""

    def require_manual(self, action: str) -> None:
        """Raise an error unless set-points may be given by hand: the machine is ready, and no run or stop holds it.

        Args:
            action: the action, with which the sentence begins.

        Raises:
            InputError: says what keeps the machine from it, and what would help.
        """
        self._require_there(action)
        self._require_ready(action)
        if (running := self.status().protocol) is not None:
            raise InputError(action, None, f"must wait: {running[0]} is running; stop it first")
        self._require_no_stop(action)

    def _require_there(self, action: str) -> None:
        if self.gone:
            why = f": {self.why}" if self.why else ""
            raise InputError(action, None, f"is not possible: the machine is {self.gone}{why}")

    def _require_ready(self, action: str) -> None:
        if not self.ready:
            problem = "the session was opened for runs only; open it with by_hand=True to operate the machine by hand"
            raise InputError(action, None, f"is not possible: {problem}")

    def _require_no_stop(self, action: str) -> None:
        if self.why:
            raise InputError(action, None, f"must wait: the machine is stopped ({self.why}); reset it first")

    def prepare(self, protocol: Protocol | str, accept_saturation: bool = False) -> PreparedRun:
        """Make the dry run of a protocol for this machine, in this process; nothing moves."""
        setup = self.setup
        return prepare_on_machine(protocol, setup.rate, accept_saturation=accept_saturation, **setup.options)

    def __enter__(self) -> Self:
        """Return the session itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Vent and close; at once after an error."""
        if kind is not None:
            self.button.press(f"the session ended with {kind.__name__}")
        self.close()
