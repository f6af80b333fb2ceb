"""Channels and set-points of a session as devices, and a guard for the RunEngine that moves them."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Mapping
from typing import Any

from bluesky.protocols import Checkable, Locatable, Location, Reading, Stoppable, Subscribable, Triggerable
from event_model import DataKey
from ophyd_async.core import AsyncStatus, Callback, SignalR, StandardReadable, StandardReadableFormat

from ...documents import JsonValue
from ...errors import InputError, MckibbenError, UnreachableError
from ...experiments.amounts import CHANNELS
from ...experiments.protocol import Protocol
from ...quantities import with_unit
from ..session import MachineSession
from ..session.continued import LOOK, SETTLE, Arrival
from .context import ChannelBackend, DeviceContext
from .flyer import ProtocolFlyer

# Axes of manual operation: what they share the output with, and the unit and name of the rate of their set-points.
AXES = {
    "pressure": ("pressure", "Pa/s", "pressure_rate"), "span": ("motor", "m/s", "speed"),
    "velocity": ("motor", "m/s^2", "acceleration"), "tension": ("motor", "N/s", "tension_rate"),
}  # fmt: skip


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


class Devices:
    """Devices of a session, from `bench_devices`.

    Attributes:
        pressure, span, velocity, tension: set-points; without a motor there is only the pressure.
        measured: devices by channel.
        true: devices by channel, of a simulated machine.
        context: what they share.
    """

    pressure: SetPoint
    span: SetPoint
    velocity: SetPoint
    tension: SetPoint

    def __init__(self, context: DeviceContext, *, settle: float, over: float) -> None:
        self.context = context
        for axis in AXES if context.session.rig.motor is not None else ("pressure",):
            setattr(self, axis, SetPoint(context, axis, settle=settle))
        self.measured, self.true = (
            {n: ChannelDevice(context, n, over=over) for n, (_, kind, _) in context.kinds.items() if kind == wanted}
            for wanted in ("measured", "true")
        )

    def flyer(self, protocol: Protocol | str, **options: Any) -> ProtocolFlyer:
        """Return a flyer of a protocol, with the options of `ProtocolFlyer`."""
        return ProtocolFlyer(self.context, protocol, **options)

    def guard(self, name: str, document: Mapping[str, JsonValue]) -> None:
        """Subscriber for ``RE.subscribe``: after an aborted or failed run, stop the machine, or vent."""
        if name == "stop" and document.get("exit_status") != "success":
            why = document.get("reason") or document.get("exit_status")
            self.context.let_down(f"the plan did not end as planned: {why}")


def bench_devices(session: MachineSession, name: str = "", *, settle: float = SETTLE, over: float = 0.0) -> Devices:
    """Return a machine as devices for Bluesky.

    Args:
        session: the machine, in this process or in another one; its opener closes it.
        name: put before every key, where there is more than one machine.
        settle: time at the end of every move [s].
        over: time over which a reading of a measured channel is the mean [s]; 0: the newest sample.
    """
    return Devices(DeviceContext(session, name), settle=settle, over=over)
