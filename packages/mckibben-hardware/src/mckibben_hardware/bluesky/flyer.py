"""Protocols as Bluesky flyers: a protocol runs in the session's loop, and its recording becomes a stream of events."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from bluesky.protocols import (
    Configurable,
    EventPageCollectable,
    Flyable,
    HasHints,
    Hints,
    PartialEventPage,
    Pausable,
    Reading,
    Stageable,
    Stoppable,
)  # fmt: skip
from event_model import DataKey
from ophyd_async.core import AsyncStatus, Device

from mckibben.bench.recorder import initial_metadata
from mckibben.documents import JsonValue
from mckibben.errors import InputError, MckibbenError
from mckibben.experiments.dry_run import check
from mckibben.experiments.protocol import Protocol
from mckibben.recordings.recording import Recording

from .devices import DeviceContext

PAGE = 1000  # samples in a page of events
ENDS = 10.0  # time for which the end of a stopped run is waited for [s]


class ProtocolFlyer(
    Device, Flyable, EventPageCollectable, Configurable[Any], Stageable, Stoppable, Pausable, HasHints
):  # fmt: skip
    """A protocol on the machine of a session, run as often as requested.

    A protocol cannot wait in its midst: a pause stops it, and `resume` is refused. One that
    wants a person is refused.

    Args:
        context: whose.
        protocol: itself, the name of a shipped one, or the path of a ``.toml`` file.
        accept_saturation: go on where only the cell's range would be exceeded.
        logs: folder for a ``.mcap`` log of every run, which survives this program.
        declared: for plans that declare their streams, with any name; else the stream is called like the flyer, as ``fly``
            and its like want it.

    Raises:
        InputError: what cannot be read, or the first finding of the dry run.

    Attributes:
        recording: recording of the last run, once it is over.
        log_file: log file of the last run.
    """

    def __init__(
        self, context: DeviceContext, protocol: Protocol | str, *, accept_saturation: bool = False,
        logs: str | Path | None = None, declared: bool = False,
    ) -> None:  # fmt: skip
        self.context, self.declared = context, declared
        self.logs = None if logs is None else Path(logs)
        self.prepared = context.session.prepare(protocol, accept_saturation)
        check(list(self.prepared.findings))
        self.recording: Recording | None = None
        self.log_file: Path | None = None
        self._begun: asyncio.Future[None] | None = None
        self._run: asyncio.Task[None] | None = None
        self._staged, self._stopped, self._handed = False, "", False
        self._offset = np.inf
        super().__init__(name=context.key(self.prepared.protocol.name))

    @property
    def hints(self) -> Hints:
        """Channels to plot: the measured ones."""
        context = self.context
        return {"fields": [context.key(n) for n in context.names if context.kinds[n][1] == "measured"]}

    @property
    def running(self) -> bool:
        """Whether a run is in progress, from its kickoff to its end."""
        return self._run is not None and not self._run.done()

    @AsyncStatus.wrap
    async def stage(self) -> None:
        """Begin to be used by a plan."""
        self._staged = True

    def unstage(self) -> AsyncStatus[None]:
        """End the plan, however it ended: a run that goes on is stopped and vented, and its end waited for."""
        self._staged = False
        if self.running:
            self._halt("the plan that ran it is over")
        return AsyncStatus(self._over(), self.name)

    def kickoff(self) -> AsyncStatus[None]:
        """Start the protocol; done with its first sample. The machine first moves to the start of the protocol.

        Raises:
            InputError: if it is not staged, or the machine is not in manual mode.
        """
        if not self._staged:
            allowed = "stage it: a RunEngine that aborts stops no flyer, but unstages what is staged"
            raise InputError("kickoff", self.name, allowed)
        self.context.session.require_manual(self.name)
        if self.running:
            raise InputError("kickoff", self.name, "it is running; wait for its end")
        self.recording, self.log_file, self._stopped, self._handed, self._offset = None, None, "", False, np.inf
        if self.logs is not None:
            self.logs.mkdir(parents=True, exist_ok=True)
            stamp = f"{time.strftime('%Y%m%dT%H%M%S')}-{time.time_ns() % 10**9:09d}"
            self.log_file = self.logs / f"{self.name}-{stamp}.mcap"
        loop = asyncio.get_running_loop()
        self._begun = loop.create_future()
        self._run = loop.create_task(self._play(loop, self._begun))
        return AsyncStatus(self._wait_for(self._begun), self.name)

    async def _play(self, loop: asyncio.AbstractEventLoop, begun: asyncio.Future[None]) -> None:
        session = self.context.session

        def tell_begun() -> None:
            if not begun.done():
                begun.set_result(None)

        def show(times: np.ndarray, _: Mapping[str, np.ndarray]) -> None:
            # the newest sample of the session is the last of the chunk, of which the run may want less at its end
            self._offset = min(self._offset, session.latest()["time"] - float(times[-1]))
            loop.call_soon_threadsafe(tell_begun)

        try:
            self.recording = await asyncio.to_thread(session.run, self.prepared, log=self.log_file, display=show)
            if self.recording.meta["result"] != "done":
                raise MckibbenError(f"{self.name}: {self.recording.meta['message']}")
        except Exception as error:
            if begun.done():
                raise
            begun.set_exception(error)
        else:
            tell_begun()

    async def _wait_for(self, event: asyncio.Future[None]) -> None:
        await asyncio.shield(event)

    async def _over(self) -> None:
        if self._run is not None:
            done, _ = await asyncio.wait([self._run], timeout=ENDS)
            if not done:
                self.context.session.note(f"{self.name} has not ended {ENDS:g} s after its stop", "stop")
            for task in done:
                task.exception()  # told by the status of `complete`

    def complete(self) -> AsyncStatus[None]:
        """Wait for the end of the run, which is that of the protocol; failed where something stopped it.

        Raises:
            InputError: if it was never started by `kickoff`.
        """
        if self._run is None:
            raise InputError("complete", self.name, "it is not running; call kickoff first")
        return AsyncStatus(self._wait_for(self._run), self.name)

    async def describe_collect(self) -> JsonValue:
        """Return the channels; by the name of their stream where the plan does not declare it."""
        keys = {self.context.key(n): self.context.described(n) for n in self.context.names}
        return keys if self.declared else {self.name: keys}

    def collect_pages(self) -> Iterator[PartialEventPage]:
        """Yield the recording in pages of events, once; nothing before the end of the run.

        Every channel has the protocol's sample rate and the times of the machine; what a step does not record is left out.
        """
        record, context = self.recording, self.context
        if record is None or self._handed:
            return
        self._handed = True
        for first in range(0, len(record), PAGE):
            part = slice(first, first + PAGE)
            times = [context.stamp(self._offset + t) for t in record.time[part].tolist()]
            yield {
                "time": times,
                "data": {context.key(n): record[n][part].tolist() for n in context.names},
                "timestamps": {context.key(n): times for n in context.names},
            }

    def stop(self, success: bool = True) -> None:
        """Stop in an emergency a run that goes on, and where something went wrong whatever goes on."""
        if self.running or not success:
            self._halt("it was asked to stop")

    def pause(self) -> None:
        """Stop the protocol, since it cannot be interrupted and continued; the machine vents."""
        if self.running:
            self._halt("the plan was paused")

    def resume(self) -> None:
        """Refuse to go on where a pause has stopped it.

        Raises:
            InputError: says what is possible.
        """
        if self._stopped:
            allowed = "a protocol cannot be paused, and was stopped instead; abort the plan"
            raise InputError("resume", self.name, allowed)

    def _halt(self, why: str) -> None:
        self._stopped = why
        self.context.session.emergency_stop(f"{self.name}: {why}")

    def _settings(self) -> dict[str, JsonValue]:
        about = initial_metadata(self.prepared)
        rate = {"sample_rate": self.prepared.protocol.sample_rate}
        return {n: about[n] for n in ("title", "sentence", "digest", "plumbing")} | rate

    async def read_configuration(self) -> dict[str, Reading[JsonValue]]:
        """Return the protocol as a sentence, its hash, the rig and the specimen."""
        return self.context.configuration(self.name, self._settings())

    async def describe_configuration(self) -> dict[str, DataKey]:
        """Describe that."""
        return self.context.described_configuration(self.name, self._settings(), {"sample_rate": "1/s"})
