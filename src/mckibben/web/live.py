"""The socket of a page: actions go in; the state, messages and the samples come out, 60 times a second at most."""

from __future__ import annotations

import asyncio
import json
import logging
from concurrent.futures import ThreadPoolExecutor
from typing import Any

from .laboratory import Laboratory

LOGGER = logging.getLogger(__name__)
TICK = 1.0 / 60.0  # time between two looks at what is new [s]
BEAT = 0.1  # time between two states while something moves [s]
LONGEST = 200_000  # characters of an action
STOPS = ("emergency_stop", "stop")
_STOPS = ThreadPoolExecutor(2, thread_name_prefix="stop")  # nothing else may keep a stop waiting
_ACTS = ThreadPoolExecutor(4, thread_name_prefix="act")


class Line:
    """One page that is connected.

    Args:
        socket: accepted.
        lab: the laboratory.
        served: address and version, for the footer.
    """

    def __init__(self, socket: Any, lab: Laboratory, served: dict[str, str]) -> None:
        self.socket, self.lab, self.served = socket, lab, served
        self.page, self.stream = "", False
        self._seen, self._told = (0, 0), 0
        self._moving, self._stops = False, 0
        self._kept: dict[str, Any] = {}

    async def run(self) -> None:
        """Until it ends."""
        from starlette.websockets import WebSocketDisconnect

        try:
            hello = _read(await self.socket.receive_text())
        except WebSocketDisconnect:
            return
        self.page, self.stream = str(hello.get("page", ""))[:80] or "nobody", bool(hello.get("stream"))
        self._seen = (_whole(hello.get("epoch")), _whole(hello.get("seen")))
        self._told = _whole(hello.get("log"))
        self.lab.control.join(self.page)
        self.lab.changed()
        both = [asyncio.create_task(self._hear()), asyncio.create_task(self._tell())]
        try:
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in both:
                task.cancel()
            for one in await asyncio.gather(*both, return_exceptions=True):
                if isinstance(one, Exception) and not isinstance(one, WebSocketDisconnect | RuntimeError):
                    LOGGER.error("a page lost its line", exc_info=one)  # it comes back by itself
            self.lab.control.leave(self.page)
            self.lab.changed()

    async def _hear(self) -> None:
        loop = asyncio.get_running_loop()
        tasks: set[asyncio.Task[None]] = set()
        while True:
            text = await self.socket.receive_text()
            asked = _read(text) if len(text) <= LONGEST else {}
            if "shown" in asked:
                # what is drawn after somebody wanted a stop lets the machine go no further
                if not self._stops:
                    self.lab.shown(self.page, _whole(asked.get("epoch")), _whole(asked["shown"]))
                continue
            action, words = str(asked.get("act", "")), asked.get("words")
            given = {str(k): v for k, v in words.items()} if isinstance(words, dict) else {}
            stops = action in STOPS
            self._stops += stops
            future = loop.run_in_executor(_STOPS if stops else _ACTS, self.lab.act, self.page, action, given)
            task = asyncio.create_task(self._answer(asked.get("id"), future, stops))
            tasks.add(task)
            task.add_done_callback(tasks.discard)

    async def _answer(self, number: Any, future: Any, stops: bool) -> None:
        try:
            answer = await future
        finally:
            self._stops -= stops
        await self._send({"type": "answer", "id": number, **answer})

    async def _send(self, message: dict[str, Any]) -> None:
        await self._put(json.dumps(message, separators=(",", ":"), default=float))

    async def _put(self, text: str) -> None:
        from starlette.websockets import WebSocketDisconnect

        try:
            await self.socket.send_text(text)
        except (WebSocketDisconnect, RuntimeError):
            pass  # whoever listens to it ends

    async def _tell(self) -> None:
        machine, stream, clock = self.lab.machine, self.lab.machine.stream, asyncio.get_running_loop().time
        version, beat = None, 0.0
        while True:
            if self.lab.version != version or (self._moving and clock() - beat > BEAT):
                version, beat = self.lab.version, clock()
                await self._new(machine, stream)
            if self.stream:
                data, epoch, count = stream.frame(*self._seen)
                if data:
                    await self.socket.send_bytes(data)
                self._seen = (epoch, count)
            await asyncio.sleep(TICK)

    async def _new(self, machine: Any, stream: Any) -> None:
        told = self.lab.told()
        self._moving = '"moving":true' in told
        if not self._kept:
            await self._send({"type": "served", **self.served})
        for name, part in machine.describe().items():
            if self._kept.get(name) is not part:
                self._kept[name] = part
                await self._send({"type": "part", "name": name, "part": part})
        for kind, one in (("epoch", stream.head()), ("toasts", self.lab.toasts.plain())):
            key = _key(one) if kind == "toasts" else one
            if self._kept.get(kind) != key:
                self._kept[kind] = key
                await self._send({"type": kind, kind: one})
        await self._put(f'{{"type":"status","status":{told}}}')
        log = machine.log(self._told)
        if log:
            self._told = log[-1]["number"]
            await self._send({"type": "log", "log": log})


def _key(toasts: list[dict[str, Any]]) -> list[Any]:
    return [(t["number"], t["waits"]) for t in toasts]


def _read(text: str) -> dict[str, Any]:
    """An object of JSON; nothing where it is something else."""
    try:
        found = json.loads(text[:LONGEST])
    except (ValueError, RecursionError):
        return {}
    return found if isinstance(found, dict) else {}


def _whole(value: Any) -> int:
    return value if isinstance(value, int) and not isinstance(value, bool) and 0 <= value < 2**53 else 0
