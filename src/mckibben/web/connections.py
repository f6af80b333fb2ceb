"""Bounds on connections and on the log, so that an emergency stop finds descriptors, a free place and a processor.

A connection waits until its request is there and known to have the token, and again after the answer. Those that wait
have `PATIENCE` for it, and where all places are taken the one that has waited longest gives way to a new one: a stop is
asked and answered within milliseconds, while what keeps places without asking for anything lets them go.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import time
from collections.abc import Callable
from typing import Any

from ..errors import InputError

MOST, LEAST = 256, 160  # connections at once, with the token or without; least that a server begins with
SHARE = 0.25  # of the descriptors that a process may open, those that connections may take
DESCRIPTORS = 4096  # that the server asks the system for
PATIENCE = 10.0  # time for a request to arrive and to be known, and for a closed line to be gone [s]
QUEUE, BACKLOG = 1024, 16  # connections that the system holds, and that are accepted before anything else is done
PIECE = 2048  # of what came for a web socket, taken apart before anything else is done [B]
SWITCH = 5e-4  # time for which a thread may keep the interpreter, while the loop waits for it at every call [s]
LINES, BURST = 0.5, 20.0  # of the log per second, and at once
LONGEST = 4000  # characters of one

Client = tuple[str, int] | None


class Connections:
    """Open connections of a server; only for the thread of its loop.

    Args:
        most: connections at once, more than `guard` admits.
        clock: seconds that only go forward.
    """

    def __init__(self, most: int = MOST, clock: Callable[[], float] = time.monotonic) -> None:
        self.most, self._clock = most, clock
        self._waiting: dict[Client, tuple[Any, float]] = {}  # the longest one first
        self._admitted: dict[Client, Any] = {}

    def __len__(self) -> int:
        return len(self._waiting) + len(self._admitted)

    def open(self, client: Client, transport: Any) -> None:
        """Note a new connection; where there are too many, the one that has waited longest is cut."""
        if len(self) >= self.most:
            self.tick()
        if len(self) >= self.most and self._waiting:
            self.cut(next(iter(self._waiting)))
        if len(self) >= self.most:  # all of them have the token: this one has to wait for theirs
            transport.abort()
            return
        self._waiting[client] = transport, self._clock()

    def admit(self, client: Client) -> None:
        """Note that a request with the token has arrived, which keeps the place of its connection."""
        if (entry := self._waiting.pop(client, None)) is not None:
            self._admitted[client] = entry[0]

    def release(self, client: Client) -> None:
        """Note that the request was answered."""
        if (transport := self._admitted.pop(client, None)) is not None:
            self._waiting[client] = transport, self._clock()

    def tick(self) -> None:
        """Forget connections that are gone, and cut those that have waited for too long."""
        self._admitted = {client: transport for client, transport in self._admitted.items() if not _is_gone(transport)}
        self._waiting = {client: entry for client, entry in self._waiting.items() if not _is_gone(entry[0])}
        latest = self._clock() - PATIENCE
        for client in [client for client, (_, since) in self._waiting.items() if since < latest]:
            self.cut(client)

    def cut(self, client: Client) -> None:
        """End a connection at once, whether its client takes what it was sent or not."""
        transport = self._admitted.pop(client, None) or self._waiting.pop(client, (None,))[0]
        if transport is not None:
            transport.abort()


def _is_gone(transport: Any) -> bool:
    """Whether a connection has given its descriptor back; one that is closing waits for its client to read the rest."""
    return bool(transport.get_extra_info("socket").fileno() < 0)


class Listener(socket.socket):
    """A socket that keeps a long queue, whatever is accepted of it at once: where it is full, a client waits seconds."""

    def listen(self, _: int = 0, /) -> None:
        """Listen, as a server asks for with the number that it accepts at once."""
        super().listen(QUEUE)


def counted_protocol(connections: Connections) -> type[asyncio.Protocol]:
    """Build the protocol of connections that are counted."""
    from uvicorn.protocols.http.h11_impl import H11Protocol

    class CountedConnection(H11Protocol):
        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            connections.open(self.client, transport)

        def handle_websocket_upgrade(self, event: Any) -> None:
            with contextlib.suppress(AttributeError):  # of a loop that reads otherwise
                self.transport.max_size = PIECE  # type: ignore[attr-defined]
            super().handle_websocket_upgrade(event)

    return CountedConnection


def reserve_descriptors() -> int:
    """Ask the system for enough descriptors; return how many connections leave enough to all else.

    Raises:
        InputError: if there are too few for a server.
    """
    try:
        import resource
    except ImportError:  # Windows counts otherwise
        return MOST
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    if soft != resource.RLIM_INFINITY and soft < DESCRIPTORS:
        soft = DESCRIPTORS if hard == resource.RLIM_INFINITY else min(DESCRIPTORS, hard)
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    most = MOST if soft == resource.RLIM_INFINITY else min(MOST, int(SHARE * soft))
    if most < LEAST:
        raise InputError("ulimit -n", soft, f"must be {int(LEAST / SHARE)} or more: a server keeps some for its stop")
    return most


class BoundedLog(logging.Filter):
    """Filter of a handler that bounds rate and length of what others can make a server write.

    Args:
        clock: seconds that only go forward.
    """

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._clock, self._last, self._budget, self._left_out = clock, clock(), BURST, 0

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether a record is written; it says how many before it were not."""
        now = self._clock()
        self._budget, self._last = min(BURST, self._budget + LINES * (now - self._last)), now
        if self._budget < 1.0:
            self._left_out += 1
            return False
        self._budget -= 1.0
        text = logging.Formatter().format(record)
        text = text if len(text) <= LONGEST else f"{text[: LONGEST // 2]}\n ..\n{text[-LONGEST // 2 :]}"
        more = f" ({self._left_out} more were left out before)" if self._left_out else ""
        record.msg, record.args, record.exc_info, record.exc_text, record.stack_info = text + more, (), None, None, None
        self._left_out = 0
        return True


def bound_log() -> logging.Handler:
    """Write warnings and errors of all libraries of this process to its error stream, bounded; return the handler."""
    handler = logging.StreamHandler()
    handler.addFilter(BoundedLog())
    handler.setLevel(logging.WARNING)
    logging.getLogger().addHandler(handler)
    return handler
