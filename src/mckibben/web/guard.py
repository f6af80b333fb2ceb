"""What a server takes from whom: connections, of which a stop always finds one, and requests with the token.

A connection waits until its request is there and known to have the token, and again after the answer. Those that wait
have `PATIENCE` for it, and where all places are taken the one that has waited longest gives way to a new one: a stop is
asked and answered within milliseconds, while what keeps places without asking for anything lets them go.

Every request and every socket is looked at here before anything else sees it. A name in ``Host`` that is not this server's
is refused, so that a foreign site cannot let a name of its own point here; so is a foreign ``Origin``. A token is requested
once, on the loopback too, for others who work on the same machine reach that as well; a cookie remembers it. The token is
another one for every server, and so is the cookie.
"""

from __future__ import annotations

import asyncio
import contextlib
import html
import ipaddress
import logging
import secrets
import socket
import time
from collections import Counter
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any
from urllib.parse import parse_qs, quote, urlencode, urlsplit

from ..documents import JsonValue
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
    """Open connections of a server; only for the thread of its loop."""

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
    """Filter of a handler that bounds rate and length of what others can make a server write."""

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


Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

LARGEST = 201 * 2**20  # body of a request [B]
LOOPBACK = ("127.0.0.1", "localhost", "::1")
SOCKETS, SOCKETS_EACH = 64, 32  # open at once: of all, and from one address; a page has one or two
REQUESTS = 64  # that are not answered yet; a stop is not counted
STOP = "/emergency-stop"
SLOWEST = 1e3  # least speed of an upload [B/s], beyond the first `STALLED`
STALLED = 30.0  # time for an upload to begin, and for a client to take what it is sent [s]
UNKNOWN, CROWDED = 4401, 4429  # codes with which a page's line is closed: without the token, and beyond the bound
NO_TEXT = 1003  # and with a frame that is no text
SCRIPTS = b"<script"
HEADERS = {
    "x-content-type-options": "nosniff", "x-frame-options": "DENY", "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin", "cross-origin-resource-policy": "same-origin",
}  # fmt: skip
# A script runs if it is a file of this server, or stands in the page with the nonce of its answer; text never becomes code.
# Style attributes are written by charts and by elements.
POLICY = (
    "default-src 'self'; script-src 'self'{nonce}; style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; "
    "font-src 'self' data:; connect-src 'self'; object-src 'none'; base-uri 'none'; form-action 'self'; "
    "frame-ancestors 'none'"
)
ASKS = "This server requires its token: open the address that mckibben serve printed at its start."
FULL = "This server has {} open lines, and allows no more: close pages that are not needed."
BUSY = f"This server has {REQUESTS} requests to answer, and takes no more."
SLOW = f"the upload must arrive at {SLOWEST / 1e3:.0f} kB/s or more. Nothing was stored"


def is_loopback(host: str) -> bool:
    """Whether an address can be reached from this machine only."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class Guard:
    """ASGI middleware that admits or refuses requests."""

    def __init__(
        self, app: Any, host: str, port: int, token: str | None = None, connections: Connections | None = None
    ) -> None:
        self.app, self.host, self.port = app, host, port
        self.connections = Connections() if connections is None else connections
        self._requests = 0
        self.token = token or secrets.token_urlsafe(24)
        self.cookie = f"mckibben-{port}"
        self._open: Counter[str] = Counter()  # sockets by address

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Admit or refuse a request."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        heads = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
        why = self._refused(heads)
        if why:
            await _refuse(scope, receive, send, 403, why)
        elif not self._known(heads):
            await self._asked(scope, heads, receive, send)
        elif scope["type"] == "websocket":
            await self._socket(scope, receive, send)
        elif scope["path"] != STOP and self._requests >= REQUESTS:
            await _refuse(scope, receive, send, 429, BUSY)
        else:
            counts = scope["path"] != STOP
            self._requests += counts
            self.connections.admit(scope.get("client"))
            try:
                await self._http(scope, heads, receive, send)
            finally:
                self._requests -= counts
                self.connections.release(scope.get("client"))

    def _refused(self, heads: dict[str, str]) -> str:
        host = heads.get("host", "")
        try:
            name = urlsplit(f"//{host}").hostname or ""
        except ValueError:
            name = ""
        if is_loopback(self.host) and name not in {*LOOPBACK, self.host}:
            return f"host must be {self.host}:{self.port}, got {host[:120]!r}"
        origin = heads.get("origin")
        if origin is not None and origin.partition("://")[2].lower() != host.lower():
            return f"origin must be a page of this server, got {origin[:120]!r}"
        return ""

    def _known(self, heads: dict[str, str]) -> bool:
        # one by one, whatever others on this address, of which a browser tells ports not apart, have written between them
        pairs = (one.strip().partition("=") for one in heads.get("cookie", "").split(";"))
        values = [value for name, _, value in pairs if name == self.cookie]
        return any([secrets.compare_digest(value.encode(), self.token.encode()) for value in values])

    async def _asked(self, scope: Scope, heads: dict[str, str], receive: Receive, send: Send) -> None:
        asked = parse_qs(scope.get("query_string", b"").decode("latin-1"), keep_blank_values=True)
        token = asked.pop("token", [""])[0]
        rest = urlencode(asked, doseq=True)
        where = "/" + quote(scope["path"].lstrip("/\\")) + (f"?{rest}" if rest else "")
        if scope["type"] != "http" or not secrets.compare_digest(token.encode(), self.token.encode()):
            if scope["type"] == "websocket" and scope["path"] == "/live":
                await _close(receive, send, UNKNOWN, ASKS)  # a page of an earlier server
            else:
                await _refuse(scope, receive, send, 401, ASKS, page=where if _is_page(heads) else "")
            return
        cookie = ("set-cookie", f"{self.cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict")
        if heads.get("sec-fetch-site", "none") in ("none", "same-origin"):
            await _answer(send, 303, "", {"location": where}, cookie)
        else:  # a browser sends no such cookie where another site, or a file, leads: it goes on from a page of this server
            body = f'<!doctype html><meta http-equiv="refresh" content="0;url={html.escape(where)}"><title>McKibben</title>'
            await _answer(send, 200, body, {"content-type": "text/html; charset=utf-8"}, cookie)

    async def _socket(self, scope: Scope, receive: Receive, send: Send) -> None:
        client = (scope.get("client") or ("",))[0]
        total = self._open.total()
        if total >= SOCKETS or self._open[client] >= SOCKETS_EACH:
            said = FULL.format(total if total >= SOCKETS else f"{self._open[client]} of this address")
            if scope["path"] == "/live":
                await _close(receive, send, CROWDED, said)
            else:
                await _refuse(scope, receive, send, 429, said)
            return
        closed = False

        async def texts() -> MutableMapping[str, Any]:
            nonlocal closed
            message = await receive()
            if message["type"] != "websocket.receive" or message.get("text") is not None:
                return message
            if not closed:
                closed = True
                await send({"type": "websocket.close", "code": NO_TEXT, "reason": "This line takes text."})
            return {"type": "websocket.disconnect", "code": NO_TEXT}

        self._open[client] += 1
        self.connections.admit(scope.get("client"))
        try:
            await self.app(scope, texts, send)
        finally:
            self.connections.release(scope.get("client"))
            self._open[client] -= 1
            self._open += Counter()  # forgets addresses that have none

    async def _http(self, scope: Scope, heads: dict[str, str], receive: Receive, send: Send) -> None:
        length = heads.get("content-length", "0")
        if not length.isdigit() or int(length) > LARGEST:
            said = f"the upload must be at most {LARGEST >> 20} MB, got {length[:20]} B. Nothing was stored"
            await _refuse(scope, receive, send, 413, said)
            return
        if _is_page(heads):  # it is not packed, for its scripts get a nonce
            scope = {**scope, "headers": [h for h in scope["headers"] if h[0].lower() != b"accept-encoding"]}
        taken, left, slow, begun = 0, False, False, False
        loop = asyncio.get_running_loop()
        since, coming = loop.time(), True

        async def counted() -> MutableMapping[str, JsonValue]:
            nonlocal taken, left, slow, coming
            try:
                async with asyncio.timeout_at(since + STALLED + taken / SLOWEST if coming else None):
                    message = await receive()
            except TimeoutError:
                slow, coming = True, False
                return {"type": "http.disconnect"}
            left = left or message["type"] == "http.disconnect"
            coming = coming and bool(message.get("more_body"))
            taken += len(message.get("body", b""))
            return message if taken <= LARGEST else {"type": "http.disconnect"}

        async def sent(message: MutableMapping[str, Any]) -> None:
            nonlocal begun
            begun = True
            async with asyncio.timeout(STALLED):
                await send(message)

        try:
            await self.app(scope, counted, _Safe(sent))
        except asyncio.CancelledError:  # the server ends before it has answered
            self.connections.cut(scope.get("client"))
        except Exception as error:
            # What Starlette raises where a browser went away before it was answered: nobody is left to tell.
            gone = type(error).__name__ == "ClientDisconnect" or "No response returned" in str(error)
            if slow and not begun:
                await _refuse(scope, receive, sent, 408, SLOW)
            elif isinstance(error, TimeoutError) and begun:
                self.connections.cut(scope.get("client"))
            elif not (gone and (left or slow or taken > LARGEST)):
                raise


class _Safe:
    """Sends an answer with security headers; scripts of a page get a nonce.

    A page is held back until all of it is there. What a user typed stands in it escaped (`elements`), so that a script in
    the page is one that this program wrote.
    """

    def __init__(self, send: Send) -> None:
        self._send = send
        self._start: MutableMapping[str, Any] | None = None
        self._body = b""

    async def __call__(self, message: MutableMapping[str, JsonValue]) -> None:
        if message["type"] == "http.response.start":
            heads = {k.lower(): v for k, v in message.get("headers", [])}
            if heads.get(b"content-type", b"").startswith(b"text/html") and b"content-encoding" not in heads:
                self._start = message
                return
            message["headers"] = [*message.get("headers", []), *_safe()]
        elif self._start is not None and message["type"] == "http.response.body":
            self._body += message.get("body", b"")
            if message.get("more_body"):
                return
            start, nonce = self._start, secrets.token_urlsafe(16)
            body = self._body.replace(SCRIPTS, f'<script nonce="{nonce}"'.encode())
            kept = [(k, v) for k, v in start.get("headers", []) if k.lower() != b"content-length"]
            length = (b"content-length", str(len(body)).encode())
            start["headers"] = [*kept, length, *_safe(f" 'nonce-{nonce}'")]
            self._start = None
            await self._send(start)
            message = {**message, "body": body}
        await self._send(message)


def _is_page(heads: dict[str, str]) -> bool:
    return "text/html" in heads.get("accept", "")


def _safe(nonce: str = "") -> list[tuple[bytes, bytes]]:
    policy = {"content-security-policy": POLICY.format(nonce=nonce)}
    return [(k.encode(), v.encode()) for k, v in {**HEADERS, **policy}.items()]


async def _refuse(scope: Scope, receive: Receive, send: Send, status: int, said: str, page: str = "") -> None:
    """Answer with a refusal; with the address of a page, as a page that links to it."""
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": said[:120]})
    elif page:
        # The link is for a browser that did not send its cookie, because another site led here.
        body = (
            '<!doctype html><html lang="en"><meta name="viewport" content="width=device-width">'
            '<meta name="color-scheme" content="light dark"><title>McKibben</title>'
            f'<p>{html.escape(said)}<p><a href="{html.escape(page)}">This browser has opened it: go on</a></html>'
        )
        await _answer(send, status, body, {"content-type": "text/html; charset=utf-8"})
    else:
        await _answer(send, status, f"mckibben: {said}\n", {"content-type": "text/plain; charset=utf-8"})


async def _close(receive: Receive, send: Send, code: int, said: str) -> None:
    """Close a page's socket with a message, which is sent only over an accepted socket."""
    await receive()
    await send({"type": "websocket.accept"})
    await send({"type": "websocket.close", "code": code, "reason": said[:120]})


async def _answer(send: Send, status: int, body: str, heads: dict[str, str], *more: tuple[str, str]) -> None:
    data = body.encode()
    pairs = [*heads.items(), *more, ("content-length", str(len(data))), ("cache-control", "no-store")]
    headers = [*((k.encode(), v.encode("latin-1", "replace")) for k, v in pairs), *_safe()]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": data})
