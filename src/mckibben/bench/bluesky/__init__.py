"""The machine of a session as devices for Bluesky's RunEngine, which satisfy its protocols and import nothing of it.

    session -> bench_devices(session) -> set-points, signals, flyers -> plans -> documents

Source of the protocols: bluesky.protocols of Bluesky 1.15, blueskyproject.io.
"""

from .devices import Devices, bench_devices
from .flyer import ProtocolFlyer
from .set_point import SetPoint
from .signals import ChannelSignal
from .status import DeviceStatus

__all__ = ["Devices", "ProtocolFlyer", "SetPoint", "ChannelSignal", "DeviceStatus", "bench_devices"]
