"""The socket of a page: who the page is, its actions, and state, messages and samples for it, at most 60 times a second.

A page has an identity: a public name, and a secret that only the page itself and the server know. It gets both when it
connects, and shows the secret to be the same page again after a reload or a lost line. The secret is another one after
every connection: the one before ends as soon as the page says that it has the new one, so that a copy of it is worth
nothing. A name alone is worth nothing either.
"""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import json
import logging
import secrets
from collections import OrderedDict
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..documents import JsonValue, parse_json
from .elements import until_one_ends
from .workspace import Workspace

if TYPE_CHECKING:
    from starlette.websockets import WebSocket

KEPT = 256  # identities that are remembered; the one that connected longest ago is forgotten first


@dataclass
class Identity:
    """Identity of one page."""

    name: str
    digest: bytes = b""  # digest of the secret that the page is known to have; empty before it said so
    next_digest: bytes = b""  # digest of the secret that it was given last; empty once the page has confirmed it


class PageRegistry:
    """Identities of all pages of a server; for one thread."""

    def __init__(self) -> None:
        self._identities: OrderedDict[str, Identity] = OrderedDict()
        self._names: dict[bytes, str] = {}  # by the digest of a secret that is valid

    def admit(self, secret: str) -> tuple[str, str]:
        """Identity of a secret, or a new one if the secret is not valid."""
        digest = _digest(secret)
        identity = self._identities.get(self._names.get(digest, ""))
        if identity is None:
            identity = Identity(secrets.token_hex(6))
            self._identities[identity.name] = identity
        elif digest == identity.next_digest:
            self.confirm(identity.name)  # the page has it, whether it said so or not
        self._names.pop(identity.next_digest, None)
        fresh = secrets.token_urlsafe(24)
        identity.next_digest = _digest(fresh)
        self._names[identity.next_digest] = identity.name
        self._identities.move_to_end(identity.name)
        while len(self._identities) > KEPT:
            _, oldest = self._identities.popitem(last=False)
            self._names.pop(oldest.digest, None)
            self._names.pop(oldest.next_digest, None)
        return identity.name, fresh

    def confirm(self, name: str) -> None:
        """Confirm that the page has its new secret, which invalidates the previous one."""
        identity = self._identities.get(name)
        if identity is not None and identity.next_digest:
            self._names.pop(identity.digest, None)
            identity.digest, identity.next_digest = identity.next_digest, b""


def _digest(secret: str) -> bytes:
    """Digest of a secret, compared in its place so that the time of a comparison reveals nothing."""
    return hashlib.sha256(secret.encode("utf-8", "replace")).digest()


LOGGER = logging.getLogger(__name__)
TICK = 1.0 / 60.0  # time between two looks at what is new [s]
BEAT = 0.1  # time between two states while something moves [s]
LONGEST = 200_000  # characters of an action
FIRST = 10.0  # time for which a new line may say nothing [s]
RATE, BURST = 200.0, 400.0  # messages of a page per second, and at once, beyond which they are read later
AT_ONCE = 32  # actions of a page that are not answered yet, beyond which more get an error; stops have their own count
STOPS = ("emergency_stop", "stop")
SILENT, REPLACED = 4408, 4409  # codes with which a line is closed, beside those of `guard`
_STOPS = ThreadPoolExecutor(2, thread_name_prefix="stop")  # nothing else may keep a stop waiting
_ACTS = ThreadPoolExecutor(4, thread_name_prefix="act")


async def stop_at_once(workspace: Workspace, reason: str) -> str:
    """Press the emergency stop for a client without a page; return the answer."""
    loop = asyncio.get_running_loop()
    answer = await loop.run_in_executor(_STOPS, workspace.act, "nobody", "emergency_stop", {"reason": reason})
    return str(answer["said"])


class Lines:
    """Sockets of all pages; every page has an identity, and one socket."""

    def __init__(self, workspace: Workspace, served: dict[str, str]) -> None:
        self.workspace, self.served, self.registry = workspace, served, PageRegistry()
        self._open: dict[str, PageConnection] = {}
        self._ending: set[asyncio.Task[None]] = set()

    async def run(self, socket: WebSocket) -> None:
        """Serve an accepted socket until it closes."""
        from starlette.websockets import WebSocketDisconnect

        try:
            hello = _read(await asyncio.wait_for(socket.receive_text(), FIRST))
        except TimeoutError:
            await socket.close(SILENT, f"This line said nothing for {FIRST:.0f} s.")
            return
        except WebSocketDisconnect:
            return
        page, secret = self.registry.admit(str(hello.get("secret", ""))[:100])
        line = PageConnection(socket, self.workspace, page, lambda: self.registry.confirm(page))
        line.remember(hello)
        before, self._open[page] = self._open.get(page), line
        if before is not None:  # a line that the page lost, of which the server has not heard
            ending = asyncio.create_task(before.end(REPLACED, "The page has another line now."))
            self._ending.add(ending)
            ending.add_done_callback(self._ending.discard)
        try:
            saved = None  # by an earlier server, of the run of a page that was connected to it
            if hello.get("server") and hello["server"] != self.workspace.server:
                saved = self.workspace.saved_before(str(hello.get("file") or ""))
            await line.run({"page": page, "secret": secret, "saved": saved, **self.served})
        finally:
            if self._open.get(page) is line:
                del self._open[page]


class PageConnection:
    """Connection of one page."""

    def __init__(
        self, socket: WebSocket, workspace: Workspace, page: str, confirmed: Callable[[], None] = lambda: None
    ) -> None:
        self.socket, self.workspace, self.page, self._confirmed = socket, workspace, page, confirmed
        self.stream = False
        self._seen, self._told = (0, 0), 0
        self._moving, self._stops, self._acts = False, 0, 0
        # What a page asks for is done in the order in which it asks; stops wait for nothing.
        self._turn = asyncio.Lock()
        self._kept: dict[str, Any] = {}

    def remember(self, hello: dict[str, JsonValue]) -> None:
        """Store what the page has already; a page of another server has nothing."""
        self.stream = bool(hello.get("stream"))
        if hello.get("server") == self.workspace.server:
            self._seen = (_whole(hello.get("epoch")), _whole(hello.get("seen")))
            self._told = _whole(hello.get("log"))

    async def run(self, hello: dict[str, JsonValue]) -> None:
        """Greet the page, and serve it until its socket closes."""
        await self._send({"type": "hello", "server": self.workspace.server, **hello})
        self.workspace.control.join(self.page)
        self.workspace.changed()
        try:
            await until_one_ends(self._hear(), self._tell())
        finally:
            self.workspace.control.leave(self.page)
            self.workspace.changed()

    async def end(self, code: int, reason: str) -> None:
        """Close the socket."""
        from starlette.websockets import WebSocketDisconnect

        with contextlib.suppress(RuntimeError, WebSocketDisconnect):  # it is closed
            await self.socket.close(code, reason)

    async def _hear(self) -> None:
        loop, tasks = asyncio.get_running_loop(), set[asyncio.Task[None]]()
        budget, last = BURST, loop.time()
        while True:
            text = await self.socket.receive_text()
            now = loop.time()
            budget, last = min(BURST, budget + (now - last) * RATE) - 1.0, now
            await asyncio.sleep(max(0.0, -budget / RATE))  # others have their turn after every message
            asked = _read(text) if len(text) <= LONGEST else {}
            if "kept" in asked:
                self._confirmed()
                continue
            if "shown" in asked:
                # what is drawn after somebody wanted a stop lets the machine go no further
                if not self._stops:
                    self.workspace.note_drawn(self.page, _whole(asked.get("epoch")), _whole(asked["shown"]))
                continue
            action, words = str(asked.get("act", "")), asked.get("words")
            arguments = {str(k): v for k, v in words.items()} if isinstance(words, dict) else {}
            stops = action in STOPS
            if (self._stops if stops else self._acts) >= AT_ONCE:
                said = f"too many requests: {AT_ONCE} of this page have no answer yet"
                await self._send({"type": "answer", "id": asked.get("id"), "ok": False, "said": said})
                continue
            self._stops += stops
            self._acts += not stops
            task = asyncio.create_task(self._answer(asked.get("id"), action, arguments))
            tasks.add(task)
            task.add_done_callback(tasks.discard)

    async def _answer(self, number: Any, action: str, arguments: dict[str, JsonValue]) -> None:
        stops, loop = action in STOPS, asyncio.get_running_loop()
        try:
            async with contextlib.nullcontext() if stops else self._turn:
                threads = _STOPS if stops else _ACTS
                answer = await loop.run_in_executor(threads, self.workspace.act, self.page, action, arguments)
            await self._send({"type": "answer", "id": number, **answer})
        finally:  # with its answer taken, so that who reads none cannot have any number of them made
            self._stops -= stops
            self._acts -= not stops

    async def _send(self, message: dict[str, JsonValue]) -> None:
        await self._put(json.dumps(message, separators=(",", ":"), default=float))

    async def _put(self, text: str) -> None:
        from starlette.websockets import WebSocketDisconnect

        try:
            await self.socket.send_text(text)
        except (WebSocketDisconnect, RuntimeError):
            pass  # its listener ends

    async def _tell(self) -> None:
        machine, stream, clock = self.workspace.machine, self.workspace.machine.stream, asyncio.get_running_loop().time
        version, beat = None, 0.0
        while True:
            if self.workspace.version != version or (self._moving and clock() - beat > BEAT):
                version, beat = self.workspace.version, clock()
                await self._new(machine, stream)
            if self.stream:
                data, epoch, count = stream.frame(*self._seen)
                if data:
                    await self.socket.send_bytes(data)
                self._seen = (epoch, count)
            await asyncio.sleep(TICK)

    async def _new(self, machine: Any, stream: Any) -> None:
        status = self.workspace.told()
        self._moving = '"moving":true' in status
        for name, part in machine.describe().items():
            if self._kept.get(name) is not part:
                self._kept[name] = part
                await self._send({"type": "part", "name": name, "part": part})
        for kind, one in (("epoch", stream.head()), ("toasts", self.workspace.toasts.plain())):
            key = [(t["number"], t["waits"]) for t in one] if kind == "toasts" else one
            if self._kept.get(kind) != key:
                self._kept[kind] = key
                await self._send({"type": kind, kind: one})
        await self._put(f'{{"type":"status","status":{status}}}')
        log = machine.log(self._told)
        if log:
            self._told = log[-1]["number"]
            await self._send({"type": "log", "log": log})


def _read(text: str) -> dict[str, JsonValue]:
    """An object of JSON; nothing if it is something else."""
    try:
        message = parse_json(text[:LONGEST])
    except (ValueError, RecursionError):
        return {}
    return message if isinstance(message, dict) else {}


def _whole(value: Any) -> int:
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**53 else 0
