"""Messages to and from a port, safe to write for several threads, and the first words with a device."""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Mapping, Sequence
from typing import Any

from ....errors import InputError, LineLostError
from . import messages
from .frames import VERSION, Frames
from .messages import Hello, Message, Welcome
from .wire import Wire, open_port

GREETING = (
    0.25  # time between two greetings of a device that does not answer; many restart when their port is opened [s]
)
WRITING = 0.1  # longest time for which a message may wait to be written [s]


class SerialLine:
    """A port that carries messages.

    Attributes:
        name: of the port, for errors.
        unknown: sound frames that are no message.

    Raises:
        InputError: if the port cannot be opened.
    """

    def __init__(self, port: str | Any, baud: int) -> None:
        self.name = port if isinstance(port, str) else str(getattr(port, "name", "port"))
        self._wire = Wire(open_port(port, baud) if isinstance(port, str) else port)
        self._writing = threading.RLock()  # a signal may write in the middle of another message
        self.frames, self.unknown = Frames(), 0

    @property
    def undecodable(self) -> int:
        """What was dropped for other reasons than its checksum."""
        return self.frames.undecodable + self.frames.oversized + self.unknown

    @property
    def dropped(self) -> int:
        """What was dropped."""
        return self.undecodable + self.frames.bad_checksum

    def read(self, seconds: float) -> list[Message]:
        """What is there, or comes first within a time.

        Raises:
            OSError, EOFError: if nothing can come any more.
        """
        found = [messages.message_of(frame) for frame in self.frames.feed(self._wire.read(seconds))]
        self.unknown += found.count(None)
        return [message for message in found if message is not None]

    def write(self, message: Message, *, before: bytes = b"") -> None:
        """A message; `before` is a zero where it shall be read whatever was cut off earlier.

        Raises:
            OSError: if nobody takes it.
        """
        data = before + messages.encode(message)
        with self._writing:
            self._wire.write(data, WRITING)

    def close(self) -> None:
        """Let go of the port."""
        self._wire.close()


def greet(line: SerialLine, seconds: float) -> Welcome:
    """What the device says of itself.

    Raises:
        LineLostError: if none answers within a time.
        InputError: if it does not speak this version of the protocol.
    """
    ours = int.from_bytes(os.urandom(4), "little")
    until = time.perf_counter() + seconds
    try:
        while (now := time.perf_counter()) < until:
            line.write(Hello(ours, VERSION), before=b"\0")
            again = min(now + GREETING, until)
            while (ahead := again - time.perf_counter()) > 0.0:
                for message in line.read(ahead):
                    if isinstance(message, Welcome) and message.sequence == ours:
                        return _checked(line, message)
    except (OSError, EOFError) as error:
        raise LineLostError(f"{line.name}: unplugged: {reason(error)}") from None
    raise LineLostError(f"{line.name}: no device answered within {seconds:g} s")


def fit(welcome: Welcome, where: str, *, bits: Mapping[str, int], encoder: bool, motor: bool) -> None:
    """Refuse a device whose converters or outputs are not those that are needed.

    Raises:
        InputError: if so.
    """
    for name, found in zip(welcome.names, welcome.bits, strict=True):
        if bits.get(name, found) != found:
            raise InputError(f"bits of {name}", found, f"the rig has {bits[name]}", where=where)
    for what, needed, there in (("encoder", encoder, welcome.encoder), ("motor", motor, welcome.motor)):
        if needed and not there:
            raise InputError(what, "none at the device", "the rig has one", where=where)


def places(welcome: Welcome, names: Sequence[str], where: str) -> tuple[int, ...]:
    """Where channels stand among those of the device.

    Raises:
        InputError: if some are not there.
    """
    has = welcome.names
    absent = [name for name in names if name not in has]
    if absent:
        allowed = f"the rig needs {', '.join(absent)} too"
        raise InputError("channels of the device", ", ".join(has) or "none", allowed, where=where)
    return tuple(has.index(name) for name in names)


def reason(error: BaseException) -> str:
    """An error of the system in one line."""
    return " ".join(str(error).split())


def _checked(line: SerialLine, welcome: Welcome) -> Welcome:
    if welcome.version != VERSION:
        allowed = f"allowed is {VERSION}: install the firmware that belongs to this package"
        raise InputError("protocol of the device", welcome.version, allowed, where=line.name)
    if len(set(welcome.names)) != len(welcome.names):
        raise InputError("channels of the device", ", ".join(welcome.names), "each may be there once", where=line.name)
    return welcome
