"""A protocol that the RunEngine lets go: it runs on the session's loop, and its recording becomes a stream of events."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, Self

import numpy as np

from ...errors import InputError, MckibbenError
from ...experiments.dry_run import check
from ...experiments.protocol import Protocol
from ...recordings.recording import Recording
from ..metadata import initial_metadata
from .machine import DeviceContext, Keys, Reading
from .status import DeviceStatus

PAGE = 1000  # samples in a page of events
ENDS = 10.0  # time for which the end of a stopped run is waited for [s]


class ProtocolFlyer:
    """One protocol on the machine of a session, as often as it is wanted.

    Bluesky: Flyable, EventPageCollectable, Configurable, Stageable, Stoppable, Pausable, HasHints, HasParent. A protocol
    cannot wait in its midst: a pause stops it, and `resume` is refused. A protocol that wants a person is refused.

    Args:
        machine: whose.
        protocol: itself, the name of a shipped one, or the path of a ``.toml`` file.
        accept_saturation: go on where only the cell's range would be exceeded.
        logs: folder for a ``.mcap`` log of every run, which survives this program.
        declared: for plans that declare their streams, with any name; else the stream is called like the flyer, as ``fly``
            and its like want it.

    Raises:
        InputError: what cannot be read, or the first finding of the dry run.

    Attributes:
        recording: recording of the last run, once it is over.
        log: log of the last run.
    """

    parent = None

    def __init__(
        self, machine: DeviceContext, protocol: Protocol | str, *, accept_saturation: bool = False,
        logs: str | Path | None = None, declared: bool = False,
    ) -> None:  # fmt: skip
        self.machine, self.declared = machine, declared
        self.logs = None if logs is None else Path(logs)
        self.bench = machine.session.prepare(protocol, accept_saturation)
        check(list(self.bench.findings))
        self.name = machine.key(self.bench.protocol.name)
        self.recording: Recording | None = None
        self.log: Path | None = None
        self._begun: DeviceStatus | None = None
        self._ended: DeviceStatus | None = None
        self._staged, self._stopped, self._handed = False, "", False
        self._offset = np.inf

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name})"

    @property
    def hints(self) -> dict[str, Any]:
        """What to plot: what is measured."""
        return {"fields": [self.machine.key(n) for n in self.machine.names if self.machine.kinds[n][1] == "measured"]}

    @property
    def running(self) -> bool:
        """Whether a run goes on, from its kickoff to its end."""
        return self._ended is not None and not self._ended.done

    def stage(self) -> list[Self]:
        """A plan begins to use it."""
        self._staged = True
        return [self]

    def unstage(self) -> list[Self]:
        """The plan is over, however it ended: a run that goes on is stopped and vented, and its end waited for."""
        self._staged = False
        if self.running:
            self._halt("the plan that ran it is over")
            self._wait()
        return [self]

    def kickoff(self) -> DeviceStatus:
        """Let it go; done with its first sample. The machine goes by hand to where it begins, which takes its time.

        Raises:
            InputError: if it is not staged, or the machine is not in manual mode.
        """
        if not self._staged:
            allowed = "stage it: a RunEngine that aborts stops no flyer, but unstages what is staged"
            raise InputError("kickoff", self.name, allowed)
        self.machine.free(self.name)
        if self.running:
            raise InputError("kickoff", self.name, "it is running; allowed is after its end")
        self.recording, self.log, self._stopped, self._handed, self._offset = None, None, "", False, np.inf
        if self.logs is not None:
            self.logs.mkdir(parents=True, exist_ok=True)
            self.log = self.logs / f"{self.name}-{time.strftime('%Y%m%dT%H%M%S')}-{time.time_ns() % 10**9:09d}.mcap"
        self._begun, self._ended = DeviceStatus(f"begin of {self.name}"), DeviceStatus(f"run of {self.name}")
        threading.Thread(target=self._go, args=(self._begun, self._ended), name=self.name, daemon=True).start()
        return self._begun

    def _go(self, begun: DeviceStatus, ended: DeviceStatus) -> None:
        def shown(times: np.ndarray, _: Mapping[str, np.ndarray]) -> None:
            # the newest sample of the session is the last of the chunk, of which the run may want less at its end
            self._offset = min(self._offset, self.machine.session.latest()["time"] - float(times[-1]))
            begun.finish()

        error: BaseException | None = None
        try:
            record = self.machine.session.run(self.bench, log=self.log, display=shown)
            self.recording = record
            if record.meta["result"] != "done":
                error = MckibbenError(f"{self.name}: {record.meta['message']}")
        except BaseException as raised:
            error = raised
        begun.finish(error)
        ended.finish(error)

    def complete(self) -> DeviceStatus:
        """Done at the end of the run, which is that of the protocol; failed where something stopped it.

        Raises:
            InputError: if it was never let go.
        """
        if self._ended is None:
            raise InputError("complete", self.name, "it was not let go; allowed is after kickoff")
        return self._ended

    def describe_collect(self) -> Keys | dict[str, Keys]:
        """The channels; by the name of their stream where the plan does not declare it."""
        found = {self.machine.key(n): self.machine.described(n) for n in self.machine.names}
        return found if self.declared else {self.name: found}

    def collect_pages(self) -> Iterator[dict[str, Any]]:
        """The recording in pages of events, once; nothing before the end of the run.

        Every channel has the protocol's sample rate and the times of the machine; what a step does not record is left out.
        """
        record, machine = self.recording, self.machine
        if record is None or self._handed:
            return
        self._handed = True
        for first in range(0, len(record), PAGE):
            part = slice(first, first + PAGE)
            times = [machine.stamp(self._offset + t) for t in record.time[part].tolist()]
            yield {
                "time": times,
                "data": {machine.key(n): record[n][part].tolist() for n in machine.names},
                "timestamps": {machine.key(n): times for n in machine.names},
            }

    def stop(self, success: bool = True) -> None:
        """An emergency stop of a run that goes on, and where something went wrong of whatever goes on."""
        if self.running or not success:
            self._halt("it was asked to stop")

    def pause(self) -> None:
        """A protocol cannot wait in its midst: it is stopped, and the machine vents."""
        if self.running:
            self._halt("the plan was paused")

    def resume(self) -> None:
        """Refused where a pause has stopped it.

        Raises:
            InputError: says what is possible.
        """
        if self._stopped:
            allowed = "a protocol cannot be paused, and was stopped instead; allowed is to abort the plan"
            raise InputError("resume", self.name, allowed)

    def _halt(self, why: str) -> None:
        self._stopped = why
        self.machine.session.emergency_stop(f"{self.name}: {why}")

    def _wait(self) -> None:
        if self._ended is not None:
            try:
                self._ended.exception(ENDS)
            except TimeoutError:
                self.machine.session.note(f"{self.name} has not ended {ENDS:g} s after its stop", "stop")

    def _settings(self) -> dict[str, Any]:
        about = initial_metadata(self.bench)
        rate = {"sample_rate": self.bench.protocol.sample_rate}
        return {n: about[n] for n in ("title", "sentence", "digest", "plumbing")} | rate

    def read_configuration(self) -> Reading:
        """The protocol as a sentence, its hash, the rig and the specimen."""
        return self.machine.configuration(self.name, self._settings())

    def describe_configuration(self) -> Keys:
        """The units of that."""
        return self.machine.described_configuration(self.name, self._settings(), {"sample_rate": "1/s"})
