"""The machine of a session as devices for Bluesky's RunEngine, on ophyd-async (the extra ``bluesky``).

    session -> bench_devices(session) -> set-points, signals, flyers -> plans -> documents

The session owns the machine, in this process or in another one; the devices are asynchronous clients of it.

Source of the protocols: bluesky.protocols of Bluesky 1.15, ophyd_async.core of ophyd-async 0.21, blueskyproject.io.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from mckibben.bench.session import MachineSession
from mckibben.bench.session.continued import SETTLE
from mckibben.documents import JsonValue
from mckibben.experiments.protocol import Protocol
from mckibben.extras import library

library("ophyd_async", "Devices for Bluesky need")

from .devices import AXES, ChannelDevice, DeviceContext, SetPoint  # noqa: E402  # after the library was asked for
from .flyer import ProtocolFlyer  # noqa: E402

__all__ = ["ChannelDevice", "Devices", "ProtocolFlyer", "SetPoint", "bench_devices"]


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
