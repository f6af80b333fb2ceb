"""The machine of a session as devices for Bluesky's RunEngine, on ophyd-async (the extra ``bluesky``).

    session -> bench_devices(session) -> set-points, signals, flyers -> plans -> documents

The session owns the machine, in this process or in another one; the devices are asynchronous clients of it.

Source of the protocols: bluesky.protocols of Bluesky 1.15, ophyd_async.core of ophyd-async 0.21, blueskyproject.io.
"""

from ...extras import library

library("ophyd_async", "Devices for Bluesky need")

from .devices import ChannelDevice, Devices, SetPoint, bench_devices  # noqa: E402  # after the library was asked for
from .flyer import ProtocolFlyer  # noqa: E402

__all__ = ["ChannelDevice", "Devices", "ProtocolFlyer", "SetPoint", "bench_devices"]
