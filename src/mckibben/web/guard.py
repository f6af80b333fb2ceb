"""Who may speak to the server: pages that it served itself, from this machine, or with the token that it printed.

Every request and every socket is looked at here before anything else sees it. A name in ``Host`` that is not this server's
is refused, so that a foreign site cannot let a name of its own point here; so is a foreign ``Origin``. Where the server
listens on another address than the loopback, a token is asked for once, and then remembered by a cookie.
"""

from __future__ import annotations

import ipaddress
import secrets
from collections.abc import Awaitable, Callable, MutableMapping
from http.cookies import SimpleCookie
from typing import Any
from urllib.parse import parse_qs, urlencode, urlsplit

Scope = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[MutableMapping[str, Any]]]
Send = Callable[[MutableMapping[str, Any]], Awaitable[None]]

LARGEST = 201 * 2**20  # body of a request [B]
LOOPBACK = ("127.0.0.1", "localhost", "::1")
SAFE = {
    "x-content-type-options": "nosniff", "x-frame-options": "DENY", "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    # scripts of pages are written into them by NiceGUI, and its templates are compiled in the browser
    "content-security-policy": "default-src 'self'; script-src 'self' 'unsafe-inline' 'unsafe-eval'; "
    "style-src 'self' 'unsafe-inline'; img-src 'self' data: blob:; font-src 'self' data:; connect-src 'self'; "
    "object-src 'none'; base-uri 'none'; form-action 'self'; frame-ancestors 'none'",
}  # fmt: skip


def is_loopback(host: str) -> bool:
    """Whether only this machine reaches an address."""
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"


class Guard:
    """ASGI middleware.

    Args:
        app: what is guarded.
        host: address that the server listens on.
        port: its port.
        token: asked for; None: by the address, a new one where others than this machine reach it.
    """

    def __init__(self, app: Any, host: str, port: int, token: str | None = None) -> None:
        self.app, self.host, self.port = app, host, port
        self.token = token if token is not None else "" if is_loopback(host) else secrets.token_urlsafe(24)
        self.cookie = f"mckibben-{port}"

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Let through, or refuse."""
        if scope["type"] not in ("http", "websocket"):
            await self.app(scope, receive, send)
            return
        heads = {k.decode("latin-1").lower(): v.decode("latin-1") for k, v in scope["headers"]}
        why = self._refused(heads)
        if why:
            await _refuse(scope, receive, send, 403, why)
        elif self.token and not self._known(heads):
            await self._asked(scope, receive, send)
        elif scope["type"] == "http":
            await self._http(scope, heads, receive, send)
        else:
            await self.app(scope, receive, send)

    def _refused(self, heads: dict[str, str]) -> str:
        host = heads.get("host", "")
        name = urlsplit(f"//{host}").hostname or ""
        if not self.token and name not in {*LOOPBACK, self.host}:
            return f"host is {host[:120]!r}; allowed is {self.host}:{self.port}"
        origin = heads.get("origin")
        if origin is not None and urlsplit(origin).netloc.lower() != host.lower():
            return f"origin is {origin[:120]!r}; allowed is a page of this server"
        return ""

    def _known(self, heads: dict[str, str]) -> bool:
        found = SimpleCookie()
        found.load(heads.get("cookie", ""))
        return self.cookie in found and secrets.compare_digest(found[self.cookie].value.encode(), self.token.encode())

    async def _asked(self, scope: Scope, receive: Receive, send: Send) -> None:
        asked = parse_qs(scope.get("query_string", b"").decode("latin-1"))
        given = asked.pop("token", [""])[0]
        if scope["type"] != "http" or not secrets.compare_digest(given.encode(), self.token.encode()):
            said = "token is missing or another one; allowed is the address that the server printed when it began"
            await _refuse(scope, receive, send, 401, said)
            return
        rest = urlencode(asked, doseq=True)
        where = "/" + scope["path"].lstrip("/\\") + (f"?{rest}" if rest else "")
        cookie = f"{self.cookie}={self.token}; Path=/; HttpOnly; SameSite=Strict"
        heads = [(b"location", where.encode("latin-1", "replace")), (b"set-cookie", cookie.encode())]
        await send({"type": "http.response.start", "status": 303, "headers": heads})
        await send({"type": "http.response.body", "body": b""})

    async def _http(self, scope: Scope, heads: dict[str, str], receive: Receive, send: Send) -> None:
        length = heads.get("content-length", "0")
        if not length.isdigit() or int(length) > LARGEST:
            said = f"the upload is {length[:20]} B; allowed are {LARGEST >> 20} MB. Nothing was stored"
            await _refuse(scope, receive, send, 413, said)
            return
        taken, left = 0, False

        async def counted() -> MutableMapping[str, Any]:
            nonlocal taken, left
            message = await receive()
            left = left or message["type"] == "http.disconnect"
            taken += len(message.get("body", b""))
            return message if taken <= LARGEST else {"type": "http.disconnect"}

        async def safe(message: MutableMapping[str, Any]) -> None:
            if message["type"] == "http.response.start":
                message["headers"] = [*message.get("headers", []), *((k.encode(), v.encode()) for k, v in SAFE.items())]
            await send(message)

        try:
            await self.app(scope, counted, safe)
        except RuntimeError as error:
            # What Starlette raises where a browser went away before it was answered: nobody is left to tell.
            if not (left and "No response returned" in str(error)):
                raise


async def _refuse(scope: Scope, receive: Receive, send: Send, status: int, said: str) -> None:
    if scope["type"] == "websocket":
        await receive()
        await send({"type": "websocket.close", "code": 1008, "reason": said[:120]})
        return
    body = f"mckibben: {said}\n".encode()
    heads = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", str(len(body)).encode())]
    await send({"type": "http.response.start", "status": status, "headers": heads})
    await send({"type": "http.response.body", "body": body})
