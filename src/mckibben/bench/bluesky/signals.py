"""What is measured, and of a simulation what is true, as signals that are triggered, read and followed."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np

from ..session.continued import LOOK
from .machine import DeviceContext, Keys, Reading
from .status import DeviceStatus

Subscriber = Callable[[Reading], None]


class ChannelSignal:
    """One channel of the machine.

    Bluesky: Readable, Triggerable, Configurable, Subscribable, HasHints, HasParent.

    Args:
        machine: whose.
        channel: its name in recordings.
        over: time over which a reading is the mean, after the trigger [s]; 0: the newest sample.
    """

    parent = None

    def __init__(self, machine: DeviceContext, channel: str, *, over: float = 0.0) -> None:
        self.machine, self.channel, self.over = machine, channel, over
        self.name = machine.key(channel)
        self._subscribers: list[Subscriber] = []
        self._told: list[float | None] = []  # the time stamp that each of them knows
        self._lock = threading.Lock()
        self._thread: threading.Thread | None = None

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.name})"

    @property
    def hints(self) -> dict[str, Any]:
        """What to plot."""
        return {"fields": [self.name]}

    def trigger(self) -> DeviceStatus:
        """Done when a later sample is there, and where the mean over a time is read, that time."""
        session = self.machine.session
        until = session.latest()["time"] + max(self.over - session.period, 0.0)
        return DeviceStatus.of(f"trigger {self.name}", lambda _: self.machine.after(until))

    def read(self) -> Reading:
        """The newest sample, or the mean over the newest time [SI]."""
        session = self.machine.session
        newest = session.latest()
        value, when = newest[self.channel], newest["time"]
        if self.over > session.period:
            times, arrays = session.since(when - self.over + 0.5 * session.period)
            value, when = float(np.mean(arrays[self.channel])), float(times[-1])
        return {self.name: {"value": value, "timestamp": self.machine.stamp(when)}}

    def describe(self) -> Keys:
        """Unit, kind and meaning."""
        return {self.name: self.machine.described(self.channel)}

    def _settings(self) -> tuple[dict[str, Any], dict[str, str]]:
        """What does not change, and its units."""
        fine = self.machine.session.setup.limits.resolution.get(self.channel)
        known = {} if fine is None else {"resolution": fine}
        return {"over": self.over, **known}, {"over": "s", "resolution": self.machine.kinds[self.channel][0]}

    def read_configuration(self) -> Reading:
        """The rig, the specimen, and how it is read."""
        return self.machine.configuration(self.name, self._settings()[0])

    def describe_configuration(self) -> Keys:
        """The units of that."""
        return self.machine.described_configuration(self.name, *self._settings())

    def subscribe(self, function: Subscriber) -> None:
        """Tell a function of the newest reading, and of new ones, some 20 a second: what a display needs.

        A flyer has every sample.
        """
        with self._lock:
            self._subscribers.append(function)
            self._told.append(None)
            if self._thread is None:
                self._thread = threading.Thread(target=self._follow, name=f"follow {self.name}", daemon=True)
                self._thread.start()

    def clear_sub(self, function: Subscriber) -> None:
        """Tell it no more."""
        with self._lock:
            if function in self._subscribers:
                place = self._subscribers.index(function)
                del self._subscribers[place], self._told[place]

    def _follow(self) -> None:
        while True:
            with self._lock:
                if not self._subscribers or self.machine.session.gone:
                    self._thread = None
                    return
            reading = self.read()
            stamp = reading[self.name]["timestamp"]
            with self._lock:
                new = [f for f, known in zip(self._subscribers, self._told, strict=True) if known != stamp]
                self._told = [stamp] * len(self._subscribers)
            for function in new:
                self._tell(function, reading)
            time.sleep(LOOK)

    def _tell(self, function: Subscriber, reading: Reading) -> None:
        try:
            function(reading)
        except Exception:
            logging.getLogger(__name__).exception("a subscriber of %r failed", self)
