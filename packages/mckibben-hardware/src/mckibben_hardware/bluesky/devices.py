"""What the devices of a session share, and its channels and set-points as devices.

A key is a channel's name with ``-`` for every dot, since documents do not hold dots: ``command-pressure``. Values are SI, as
in recordings. Time stamps are seconds since 1970: the time of the session's sample after that of its first one, so that of a
simulation as fast as it goes they tell the simulated time.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import Mapping
from typing import Any

import numpy as np
from bluesky.protocols import Checkable, Locatable, Location, Reading, Stoppable, Subscribable, Triggerable
from event_model import DataKey, Dtype
from ophyd_async.core import AsyncStatus, Callback, SignalBackend, SignalR, StandardReadable, StandardReadableFormat

from mckibben.bench import channels
from mckibben.bench.recorder import initial_metadata
from mckibben.bench.session import MachineSession
from mckibben.bench.session.continued import LOOK, Arrival
from mckibben.documents import JsonValue
from mckibben.errors import InputError, MckibbenError, UnreachableError
from mckibben.experiments.amounts import CHANNELS
from mckibben.quantities import with_unit

# Axes of manual operation: what they share the output with, and the unit and name of the rate of their set-points.
AXES = {
    "pressure": ("pressure", "Pa/s", "pressure_rate"), "span": ("motor", "m/s", "speed"),
    "velocity": ("motor", "m/s^2", "acceleration"), "tension": ("motor", "N/s", "tension_rate"),
}  # fmt: skip


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


class ChannelDevice(StandardReadable, Triggerable, Subscribable[Any]):
    """One channel of the machine: a signal of ophyd-async, and a trigger that waits for a later sample.

    Args:
        context: whose.
        channel: its name in recordings.
        over: time over which a reading is the mean, after the trigger [s]; 0: the newest sample.
        settings: what does not change during a plan, with its unit; how it is read by default.
        more: what else describes its values.

    Attributes:
        value: the signal.
    """

    def __init__(
        self, context: DeviceContext, channel: str, *, over: float = 0.0,
        settings: Mapping[str, tuple[float, str]] | None = None, **more: Any,
    ) -> None:  # fmt: skip
        self.context, self.channel, self.over = context, channel, over
        fine, unit = context.session.setup.limits.resolution.get(channel), context.kinds[channel][0]
        read = {"over": (over, "s")} | ({} if fine is None else {"resolution": (fine, unit)})
        self.settings = read if settings is None else settings
        with self.add_children_as_readables(StandardReadableFormat.HINTED_UNCACHED_SIGNAL):
            self.value = SignalR(ChannelBackend(context, channel, over, **more))
        super().__init__(name=context.key(channel))
        self.value.set_name(self.name)

    @AsyncStatus.wrap
    async def trigger(self) -> None:
        """Wait for a later sample, or where the mean over a time is read, for that time."""
        session = self.context.session
        until = session.latest()["time"] + max(self.over - session.period, 0.0)
        await asyncio.to_thread(self.context.after, until)

    def subscribe_reading(self, function: Callback[dict[str, Reading[float]]]) -> None:
        """Call a function with the newest reading and with later ones, about 20 a second; a flyer has every sample."""
        self.value.subscribe_reading(function)

    subscribe = subscribe_reading

    def clear_sub(self, function: Callback[dict[str, Reading[float]]]) -> None:
        """Remove a subscription."""
        self.value.clear_sub(function)

    async def read_configuration(self) -> dict[str, Reading[JsonValue]]:
        """Return the rig, the specimen, and how it is read."""
        return self.context.configuration(self.name, {n: value for n, (value, _) in self.settings.items()})

    async def describe_configuration(self) -> dict[str, DataKey]:
        """Describe that."""
        values = {name: value for name, (value, _) in self.settings.items()}
        units = {name: unit for name, (_, unit) in self.settings.items()}
        return self.context.described_configuration(self.name, values, units)


class SetPoint(ChannelDevice, Locatable[float], Checkable[float | str], Stoppable):
    """The pressure, or one of span, velocity and tension, which share the motor.

    It reads the machine's set-point, which goes where it is asked no faster than the manual rate; what is measured has
    devices of its own.

    Args:
        context: whose.
        axis: pressure, span, velocity or tension.
        settle: time at the end of a move [s].
    """

    def __init__(self, context: DeviceContext, axis: str, *, settle: float = 0.0) -> None:
        self.axis, self.settle = axis, settle
        self.output, unit, rate = AXES[axis]
        low, high = self.limits = context.session.setup.allowed(axis)  # [SI]
        settings = {"rate": (float(getattr(context.session.setup.manual, rate)), unit), "settle": (settle, "s")}
        limits = {"control": {"low": low, "high": high}}
        super().__init__(context, f"command.{axis}", settings=settings, limits=limits)
        self._to, self._moved = math.nan, False
        self._ended: asyncio.Future[None] | None = None

    def check_value(self, value: float | str) -> None:
        """Refuse a value that the rig does not permit.

        Raises:
            InputError: names what is allowed.
        """
        self.context.session.setup.amount(self.axis, value)

    def set(self, value: float | str) -> AsyncStatus[None]:
        """Go to a set-point, in SI or as text; done when it and what is measured are there, and the settling time over.

        Raises:
            InputError: if the rig does not allow it, or the machine is not in manual mode; then nothing moves.
        """
        context = self.context
        to = context.session.setup.amount(self.axis, value)
        context.session.require_manual(self.name)
        before, ended = context.moves.get(self.output), asyncio.get_running_loop().create_future()
        context.session.set(**{self.axis: to})
        self._to, self._moved = to, True
        context.moves[self.output] = self._ended = ended
        if before is not None and not before.done():
            worded = self._worded(to)
            before.set_exception(InputError(self.name, worded, "it was asked for before another set-point was there"))
        return AsyncStatus(self._go(to, ended), self.name)

    def _worded(self, value: float) -> str:
        return with_unit(value, CHANNELS[self.axis])

    async def _go(self, to: float, ended: asyncio.Future[None]) -> None:
        """Wait until it is there, or until the move was ended."""
        session, arrival = self.context.session, Arrival(self.context.session, **{self.axis: to})
        try:
            while not ended.done():
                await asyncio.to_thread(session.wait, LOOK)
                if ended.done():
                    break
                if session.why or session.gone:
                    raise MckibbenError(f"{self.name}: on the way to {self._worded(to)}: {session.why or session.gone}")
                if arrival.arrived():
                    await asyncio.to_thread(session.wait, self.settle)
                    return
                if arrival.stuck:
                    at = session.latest()
                    asked, measured = (self._worded(at.get(n, to)) for n in (self.channel, self.axis))
                    problem = f"{asked} is asked for and {measured} measured"
                    raise UnreachableError(f"{self.name}: {self._worded(to)} was not reached; {problem}")
            ended.result()
        finally:
            self._end(ended)

    async def locate(self) -> Location[float]:
        """Return where it is asked to be, and what is measured, which stands for both while something else is controlled.

        A velocity is not measured, and is that of the set-point [SI].
        """
        at = self.context.session.latest()
        asked = at[self.channel]
        measured = at.get(self.axis, 0.0 if math.isnan(asked) else asked)
        if self._ended is not None and not self._ended.done():
            asked = self._to
        return {"setpoint": measured if math.isnan(asked) else asked, "readback": measured}

    def stop(self, success: bool = True) -> None:
        """End a move; the RunEngine calls it after every plan, and at a pause, for all moved devices.

        A pressure on its way is let down, a motor on its way stops where it is, and whatever is there is held.

        Args:
            success: False: something went wrong; an emergency stop.
        """
        context = self.context
        if not success:
            self._end(self._ended, MckibbenError(f"{self.name} was stopped"))
            context.session.emergency_stop(f"{self.name} was stopped")
            return
        busy = self._ended is not None and not self._ended.done()
        driven = self.axis == "velocity" and abs(context.session.latest()[self.channel]) > 0.0
        self._end(self._ended)
        if busy and self.axis == "pressure":
            context.let_down(f"{self.name} was stopped")
        elif busy or driven:
            with contextlib.suppress(InputError):
                context.session.set(velocity=0.0)

    def _end(self, ended: asyncio.Future[None] | None, error: Exception | None = None) -> None:
        if ended is not None and not ended.done():
            ended.set_result(None) if error is None else ended.set_exception(error)

    def stage(self) -> AsyncStatus[None]:
        """Begin to be used by a plan."""
        self._moved = False
        return super().stage()

    def unstage(self) -> AsyncStatus[None]:
        """End the plan, however it ended: a pressure that it set is let down, and a velocity ends."""
        moved, self._moved = self._moved, False
        self.stop()
        if moved and self.axis == "pressure":
            self.context.let_down("the plan that set the pressure is over")
        return super().unstage()
