"""Common context of a session's devices: names and descriptions of channels, clock, and safe ending.

A key is a channel's name with ``-`` for every dot, since documents do not hold dots: ``command-pressure``. Values are SI, as
in recordings. Time stamps are seconds since 1970: the time of the session's sample after that of its first one, so that of a
simulation as fast as it goes they tell the simulated time.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from typing import Any

import numpy as np
from bluesky.protocols import Reading
from event_model import DataKey, Dtype
from ophyd_async.core import Callback, SignalBackend

from ...documents import JsonValue
from ...errors import InputError, MckibbenError
from .. import channels
from ..recorder import initial_metadata
from ..session import MachineSession
from ..session.continued import LOOK


class DeviceContext:
    """A session, as seen by its devices.

    Args:
        session: the machine, in this process or in another one.
        name: put before every key, where there is more than one machine.

    Attributes:
        names: names of the channels.
        moves: what ends the present move of the ``pressure`` and of the ``motor``.
    """

    def __init__(self, session: MachineSession, name: str = "") -> None:
        if any(c in name for c in "./"):
            raise InputError("name", name, "documents hold no keys with dots or slashes")
        self.session, self.prefix = session, f"{name}-" if name else ""
        newest = self.after(-1.0)
        self.zero = time.time() - newest["time"]
        self.names = [n for n in newest if n != "time"]
        self.kinds = channels.kinds(self.names)
        self.moves: dict[str, asyncio.Future[None]] = {}
        about = initial_metadata(session.setup.prepared)
        self.about = {"rig": about["rig"], "specimen": about["specimen"] or "", "simulated": session.simulated}
        self.place = f"mckibben-{'simulated' if session.simulated else 'machine'}:{about['rig']}"

    def after(self, time: float) -> dict[str, float]:
        """Return the newest sample, which is later than a time [s]; waits for it.

        Raises:
            MckibbenError: if there will be none.
        """
        session = self.session
        while not (newest := session.latest()) or newest["time"] < time + 0.5 * session.period:
            if session.gone:
                raise MckibbenError(f"the machine is {session.gone}: {session.why}")
            session.wait(session.period)
        return newest

    def key(self, channel: str) -> str:
        """Return the key of a channel, or of something else with a name."""
        return self.prefix + channel.replace(".", "-")

    def described(self, channel: str, **more: object) -> DataKey:
        """Describe the values of a channel for documents."""
        unit, kind, meaning = self.kinds[channel]
        fine = self.session.setup.limits.resolution.get(channel.removeprefix("command."))
        digits = {} if not fine else {"precision": max(0, math.ceil(-math.log10(fine)))}
        described: Any = {
            "source": f"{self.place}/{channel}", "dtype": "number", "dtype_numpy": "<f8", "shape": [], "units": unit,
            "kind": kind, "meaning": meaning, **digits, **more,
        }  # fmt: skip
        key: DataKey = described
        return key

    def stamp(self, when: float) -> float:
        """Return seconds since 1970 of a time of the session [s]."""
        return self.zero + when

    def configuration(self, own: str, values: dict[str, JsonValue]) -> dict[str, Reading[JsonValue]]:
        """Return what does not change during a plan, of a device by its name."""
        return {f"{own}-{n}": {"value": v, "timestamp": self.zero} for n, v in (self.about | values).items()}

    def described_configuration(
        self, own: str, values: dict[str, JsonValue], units: dict[str, str]
    ) -> dict[str, DataKey]:
        """Describe that."""
        described: dict[str, DataKey] = {}
        for n, v in (self.about | values).items():
            dtype: Dtype = "boolean" if isinstance(v, bool) else "string" if isinstance(v, str) else "number"
            described[f"{own}-{n}"] = {"source": f"{self.place}/{n}", "dtype": dtype, "shape": []}
            if n in units:
                described[f"{own}-{n}"]["units"] = units[n]
        return described

    def let_down(self, reason: str) -> None:
        """Leave nothing under pressure: stop what runs, or vent at the manual rate. Never raises `InputError`."""
        if self.session.status().protocol is not None:
            self.session.emergency_stop(reason)
        elif not self.session.why:
            with contextlib.suppress(InputError):
                self.session.vent()


class ChannelBackend(SignalBackend[float]):
    """One channel of a session as the backend of a signal of ophyd-async.

    Args:
        context: whose.
        channel: its name in recordings.
        over: time over which a reading is the mean [s]; 0: the newest sample.
        more: what else describes its values, such as their limits.
    """

    def __init__(self, context: DeviceContext, channel: str, over: float = 0.0, **more: object) -> None:
        super().__init__(float)
        self.context, self.channel, self.over, self.more = context, channel, over, more
        self._follower: asyncio.Task[None] | None = None

    def source(self, name: str, read: bool) -> str:
        """Return where values come from."""
        return f"{self.context.place}/{self.channel}"

    async def connect(self, timeout: float) -> None:
        """Do nothing: the session is there."""

    async def put(self, value: float | None) -> None:
        """Refuse: a channel is read; set-points are devices."""
        raise NotImplementedError(f"{self.channel} is read only")

    async def get_datakey(self, source: str) -> DataKey:
        """Return unit, kind and meaning."""
        return self.context.described(self.channel, **self.more)

    async def get_reading(self) -> Reading[float]:
        """Return the newest sample, or the mean over the newest time [SI]."""
        session = self.context.session
        newest = session.latest()
        value, when = newest[self.channel], newest["time"]
        if self.over > session.period:
            times, arrays = session.since(when - self.over + 0.5 * session.period)
            value, when = float(np.mean(arrays[self.channel])), float(times[-1])
        return {"value": value, "timestamp": self.context.stamp(when)}

    async def get_value(self) -> float:
        """Return the value of a reading [SI]."""
        return (await self.get_reading())["value"]

    async def get_setpoint(self) -> float:
        """Return the value, which nobody asks for."""
        return await self.get_value()

    def set_callback(self, callback: Callback[Reading[float]] | None) -> None:
        """Set a function that is called with new readings, some 20 a second, enough for a display."""
        if self._follower is not None:
            self._follower.cancel()
        self._follower = None if callback is None else asyncio.get_running_loop().create_task(self._follow(callback))

    async def _follow(self, callback: Callback[Reading[float]]) -> None:
        last = -1.0
        while not self.context.session.gone:
            reading = await self.get_reading()
            if reading["timestamp"] != last:
                last = reading["timestamp"]
                callback(reading)
            await asyncio.sleep(LOOK)
