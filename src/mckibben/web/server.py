"""The server of a laboratory: pages, sheets, the socket of every page, and downloads; nothing comes from elsewhere."""

from __future__ import annotations

import asyncio
import contextlib
import html
import importlib
import os
import socket
import tempfile
import webbrowser
from collections.abc import AsyncIterator, Callable
from importlib import resources
from pathlib import Path
from typing import Any

from .. import __version__
from ..errors import InputError
from .guard import Guard, is_loopback
from .laboratory import Laboratory
from .live import Lines
from .reader import return_large_blocks
from .shell import HOME, PAGES, TITLE, Page

AWAY = 30.0  # time for which a page that lost the line finds its state again [s]
LOOK = 0.25  # time between two looks at what time alone brings about [s]
_current: list[Laboratory] = []


def laboratory() -> Laboratory:
    """The laboratory of this process's server."""
    return _current[-1]


def build(lab: Laboratory, host: str, port: int, token: str | None = None) -> Guard:
    """The application of a laboratory, guarded.

    Args:
        lab: itself.
        host: address that the server listens on.
        port: its port.
        token: that is asked for; a new one where left out.
    """
    from fastapi import FastAPI
    from nicegui import ui

    _current.append(lab)

    @contextlib.asynccontextmanager
    async def life(_: FastAPI) -> AsyncIterator[None]:
        # Not before: NiceGUI looks through all objects of the interpreter when it begins, and a thread that makes a tuple of
        # a generator meanwhile, as JAX's tracing does all the time, then fails with a SystemError.
        lab.begin()
        ticking = asyncio.create_task(_tick(lab))
        try:
            yield
        finally:
            ticking.cancel()

    app = FastAPI(lifespan=life, docs_url=None, redoc_url=None, openapi_url=None)
    _routes(app, lab, host, port)
    for page in PAGES[1:]:
        ui.page(page.path, title=f"{page.name} \u00b7 {TITLE}", dark=None)(_built(page))
    ui.run_with(
        app,
        title=TITLE,
        tailwind=False,
        show_welcome_message=False,
        favicon=_static("favicon.svg"),
        reconnect_timeout=AWAY,
    )
    return Guard(app, host, port, token)


async def _tick(lab: Laboratory) -> None:
    while True:
        lab.tick()
        await asyncio.sleep(LOOK)


def _built(page: Page) -> Callable[..., Any]:
    async def show(request: Any) -> None:
        module = importlib.import_module(f".pages.{page.module}", __package__)
        found = module.build(laboratory(), request)
        if asyncio.iscoroutine(found):
            await found

    from starlette.requests import Request

    show.__annotations__ = {"request": Request}
    return show


def _static(name: str) -> str:
    return str(resources.files(__package__) / "static" / name)


def _routes(app: Any, lab: Laboratory, host: str, port: int) -> None:
    from starlette.requests import Request
    from starlette.responses import FileResponse, HTMLResponse, PlainTextResponse, Response
    from starlette.routing import Mount, Route, WebSocketRoute
    from starlette.staticfiles import StaticFiles
    from starlette.websockets import WebSocket

    from .pages import bench as bench_page

    lines = Lines(lab, {"address": f"{host}:{port}", "version": __version__})

    async def live(line: WebSocket) -> None:
        await line.accept()
        await lines.run(line)

    async def bench(_: Request) -> Response:
        return HTMLResponse(bench_page.build(), headers={"cache-control": "no-store"})

    async def stop(request: Request) -> Response:
        begun = await anext(request.stream(), b"")  # no stop waits for the rest of what is sent
        reason = begun[:80].decode("utf-8", "replace")
        answer = await asyncio.to_thread(lab.act, "nobody", "emergency_stop", {"reason": reason})
        return PlainTextResponse(answer["said"])

    async def recording(request: Request) -> Response:
        try:
            path = lab.recordings.found(request.path_params["name"])
        except InputError as error:
            return PlainTextResponse(f"mckibben: {error}\n", 404)
        return FileResponse(path, filename=path.name, media_type="application/octet-stream")

    app.router.routes += [
        Route("/", bench), WebSocketRoute("/live", live), Route("/emergency-stop", stop, methods=["POST"]),
        Route("/files/{name:path}", recording, methods=["GET"]), Mount(HOME, StaticFiles(directory=_static(""))),
    ]  # fmt: skip


def listen(host: str, port: int) -> socket.socket:
    """A socket at an address; port 0 is a free one.

    Raises:
        InputError: if it is taken, or there is no such address here.
    """
    found = None
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        found = socket.socket(family, socket.SOCK_STREAM)
        found.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        found.bind((host, port))
        found.listen(128)
    except (OSError, OverflowError, UnicodeError) as error:
        if found is not None:
            found.close()
        why = getattr(error, "strerror", None) or str(error)
        raise InputError("--port" if port else "--host", f"{host}:{port}", f"nobody can listen there ({why})") from None
    return found


def serve(lab: Laboratory, line: socket.socket, host: str, *, show: bool, tell: Callable[[str], None]) -> None:
    """Serve until somebody ends it; the laboratory is closed then.

    Args:
        lab: itself.
        line: from `listen`.
        host: address as it was asked for.
        show: open a browser.
        tell: given the lines that a person has to see.
    """
    import uvicorn

    return_large_blocks()
    port = line.getsockname()[1]
    app = build(lab, host, port)
    shown = f"[{host}]" if ":" in host else host
    address = f"http://{shown}:{port}/?token={app.token}"
    tell(f"The laboratory is at {address}")
    others = "" if is_loopback(host) else "Others reach this address: "
    tell(f"{others}{'w' if others else 'W'}hoever has the token in it is let in, and may operate the machine.")
    config = uvicorn.Config(
        app, log_level="warning", access_log=False, ws_max_size=2**22, timeout_graceful_shutdown=2, lifespan="on",
        ws_per_message_deflate=False,
    )  # fmt: skip
    server = uvicorn.Server(config)
    with tempfile.TemporaryDirectory(prefix="mckibben-") as folder:
        if show:
            webbrowser.open(leading_to(address, Path(folder)))
        try:
            server.run(sockets=[line])
        except KeyboardInterrupt:
            pass  # the way in which a server ends
        finally:
            tell("Venting ..")
            lab.close()


def leading_to(address: str, folder: Path) -> str:
    """The address of a file that leads a browser to another address.

    A browser is opened by a command, and the words of a command are seen by everybody on the machine: so that the token is
    not among them, they name a file that nobody else may read.
    """
    place = folder / "laboratory.html"
    with open(place, "w", encoding="utf-8", opener=lambda name, flags: os.open(name, flags, 0o600)) as file:
        file.write(f'<!doctype html><meta http-equiv="refresh" content="0;url={html.escape(address)}">')
    return place.as_uri()
