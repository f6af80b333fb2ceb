"""The web server: pages, style sheets, the socket of every page, and downloads; nothing is loaded from elsewhere."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import html
import importlib
import logging
import os
import signal
import socket
import sys
import tempfile
import webbrowser
from collections.abc import AsyncIterator, Awaitable, Callable
from importlib import resources
from pathlib import Path
from typing import Any
from urllib.parse import quote

from .. import registry
from .._version import __version__
from ..errors import InputError, MckibbenError
from . import guard
from .bench import measured_data
from .charts import LARGEST_CHART, sent_figure
from .elements import Documents
from .live import Lines, stop_at_once
from .reader import bound_freed_memory
from .shelf import LARGEST, check_size, plain_name
from .transfers import receive_file
from .widgets import HOME, PAGES, Page, document, page_frame, piece, refused, written
from .workspace import Workspace

REASON = 0.5  # time for which a stop waits for its reason [s]
LOOK = 0.25  # time between two looks at what time alone brings about [s]
MOST_NAMES = 200  # of files that a list offers
UNKNOWN_DOCUMENT = 4404  # code with which a line is closed whose page is not known any more


def build(
    workspace: Workspace, host: str, port: int, token: str | None = None, connections: guard.Connections | None = None
) -> guard.Guard:
    """Build the application, guarded."""
    from starlette.applications import Starlette

    documents = Documents()
    connections = guard.Connections() if connections is None else connections

    @contextlib.asynccontextmanager
    async def life(_: Starlette) -> AsyncIterator[None]:
        async def tick() -> None:
            while True:
                workspace.tick()
                connections.tick()
                await asyncio.sleep(LOOK)

        workspace.machine.begin()
        ticking = asyncio.create_task(tick())
        try:
            yield
        finally:
            ticking.cancel()
            documents.close_all()
            workspace.end_work()  # before the loop waits for the threads that wait for it

    routes = [*_bench_routes(workspace, host, port), *_page_routes(workspace, documents)]
    return guard.Guard(Starlette(routes=routes, lifespan=life), host, port, token, connections)


def _page_routes(workspace: Workspace, documents: Documents) -> list[Any]:
    from starlette.requests import Request
    from starlette.responses import HTMLResponse, PlainTextResponse, Response
    from starlette.routing import Route, WebSocketRoute
    from starlette.websockets import WebSocket, WebSocketDisconnect

    building = asyncio.Lock()

    def of(page: Page) -> Callable[[Request], Awaitable[Response]]:
        async def show(request: Request) -> Response:
            # in a thread, for the first visitor of a page waits seconds for it, and a stop must not
            build_page = await asyncio.to_thread(_builder, page)
            async with building:  # one page after the other, so that a stop waits for one of many at most
                await asyncio.sleep(0)
                opened = documents.open()
                with opened.root:
                    build_page(workspace, request)
                content = written(opened)
            return HTMLResponse(content, headers={"cache-control": "no-store"})

        return show

    async def line(socket: WebSocket) -> None:
        await socket.accept()
        document = documents.find(socket.path_params["key"])
        with contextlib.suppress(WebSocketDisconnect):
            if document is None:
                await socket.close(UNKNOWN_DOCUMENT, "The server no longer has this page.")
            else:
                await documents.serve(document, socket)

    async def upload(request: Request) -> Response:
        document = documents.find(request.path_params["key"])
        element = None if document is None else document.elements.get(request.path_params["number"])
        handler = None if element is None else element.handler("came")
        if document is None or element is None or handler is None:
            return PlainTextResponse("mckibben: this page takes no file here\n", 404)
        try:
            file = await receive_file(request)
        except MckibbenError as error:
            return PlainTextResponse(f"mckibben: {error}\n", 507)
        document.spawn(document.handle(element, handler, file))
        return PlainTextResponse("")

    async def download(request: Request) -> Response:
        document = documents.find(request.path_params["key"])
        file = None if document is None else document.downloads.pop(request.path_params["file"], None)
        if file is None:
            return PlainTextResponse("mckibben: this file was downloaded already\n", 404)
        name, data = file
        disposition = f"attachment; filename*=utf-8''{quote(name)}"
        return Response(data, media_type="application/octet-stream", headers={"content-disposition": disposition})

    return [
        *(Route(page.path, of(page)) for page in PAGES[1:]),
        WebSocketRoute("/elements/{key}", line),
        Route("/upload/{key}/{number:int}", upload, methods=["POST"]),
        Route("/download/{key}/{file}", download, methods=["GET"]),
    ]


def _builder(page: Page) -> Callable[[Workspace, Any], None]:
    """The function that builds a page: of the module of its name, or of the package that announces it."""
    try:
        module = (
            registry.announced("mckibben.pages", page.module, page.extra, f"The page {page.name} needs")
            if page.extra
            else importlib.import_module(f".pages.{page.module}", __package__)
        )
    except InputError as error:
        return functools.partial(_build_refusal, page, f"{error}.")
    build_page: Callable[[Workspace, Any], None] = module.build
    return build_page


def _build_refusal(page: Page, sentence: str, workspace: Workspace, request: Any) -> None:
    with page_frame(page.module):
        refused(sentence)


def _static(name: str) -> str:
    return str(resources.files(__package__) / "static" / name)


def _bench_routes(workspace: Workspace, host: str, port: int) -> list[Any]:
    from starlette.requests import ClientDisconnect, Request
    from starlette.responses import FileResponse, HTMLResponse, JSONResponse, PlainTextResponse, Response
    from starlette.routing import Mount, Route, WebSocketRoute
    from starlette.staticfiles import StaticFiles
    from starlette.websockets import WebSocket

    static = StaticFiles(directory=_static(""))
    for page in PAGES:  # a package that announces a page has what belongs to it in a folder beside its module
        folder = registry.announced_folder("mckibben.pages", page.module, page.extra) if page.extra else None
        static.all_directories += [] if folder is None else [folder / "static"]
    lines = Lines(workspace, {"address": f"{host}:{port}", "version": __version__})

    async def live(line: WebSocket) -> None:
        await line.accept()
        await lines.run(line)

    async def favicon(_: Request) -> Response:
        return FileResponse(_static("favicon.svg"), media_type="image/svg+xml")

    async def bench(_: Request) -> Response:
        # drawn by its scripts alone: it lives by its socket, and is never built again while something moves
        page = document(PAGES[0], piece("bench.html"), sheets=("bench.css",), scripts=("js/bench.js",))
        return HTMLResponse(page, headers={"cache-control": "no-store"})

    async def stop(request: Request) -> Response:
        begun = b""
        with contextlib.suppress(TimeoutError, ClientDisconnect):  # no stop waits for what is sent with it
            async with asyncio.timeout(REASON):
                begun = await anext(request.stream(), b"")
        said = await stop_at_once(workspace, begun[:80].decode("utf-8", "replace"))
        return PlainTextResponse(said)

    async def figure(request: Request) -> Response:
        try:
            check_size("chart", int(request.headers.get("content-length", 0)), LARGEST_CHART)
            name, data = await asyncio.to_thread(sent_figure, await request.body())
        except MckibbenError as error:
            return PlainTextResponse(str(error), 400)
        return Response(data, media_type="application/octet-stream", headers={"x-name": quote(name)})

    async def measured(request: Request) -> Response:
        """Answer with the samples of a user's own file, which a POST brings; without a name with those that there are."""
        name, part = (request.query_params.get(key, "") for key in ("name", "part"))
        if not name:
            return JSONResponse({"names": [*workspace.recordings.names(), *workspace.uploads.names()][:MOST_NAMES]})
        try:
            if request.method == "POST":
                check_size(name, int(request.headers.get("content-length", 0)), LARGEST)
                file = await receive_file(request)
                path = await asyncio.to_thread(workspace.uploads.store_again, plain_name(name), file.path)
            else:
                path = measured_data.find(workspace, name)
            chosen = workspace.machine.chosen  # type: ignore[attr-defined]
            curves = chosen.parts.get("dry", {}).get("curves")
            return JSONResponse(await asyncio.to_thread(measured_data.measured_data, path, part, chosen.spec, curves))
        except MckibbenError as error:
            return PlainTextResponse(str(error).replace(f"{workspace.recordings.folder}/", ""), 400)

    async def recording(request: Request) -> Response:
        try:
            path = workspace.recordings.found(request.path_params["name"])
        except InputError as error:
            return PlainTextResponse(f"mckibben: {error}\n", 404)
        return FileResponse(path, filename=path.name, media_type="application/octet-stream")

    return [
        Route("/", bench),
        WebSocketRoute("/live", live),
        Route(guard.STOP, stop, methods=["POST"]),
        Route("/figure", figure, methods=["POST"]),
        Route("/measured", measured, methods=["GET", "POST"]),
        Route("/files/{name:path}", recording, methods=["GET"]),
        Route("/favicon.ico", favicon),
        Mount(HOME, static),
    ]


def listen(host: str, port: int) -> socket.socket:
    """Open a socket at an address; port 0 is a free one.

    Raises:
        InputError: if it is taken, or there is no such address here.
    """
    listener = None
    try:
        family = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0][0]
        listener = guard.Listener(family, socket.SOCK_STREAM)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.bind((host, port))
        listener.listen()
    except (OSError, OverflowError, UnicodeError) as error:
        if listener is not None:
            listener.close()
        why = getattr(error, "strerror", None) or str(error)
        raise InputError(
            "--port" if port else "--host", None, f"cannot be used: nobody can listen on {host}:{port} ({why})"
        ) from None
    return listener


def serve(workspace: Workspace, line: socket.socket, host: str, *, show: bool, tell: Callable[[str], None]) -> None:
    """Serve until interrupted, then close the machine.

    Args:
        workspace: state of the server.
        line: from `listen`.
        host: address as it was requested.
        show: open a browser.
        tell: given the lines that a person has to see.
    """
    import uvicorn

    bound_freed_memory()
    sys.setswitchinterval(guard.SWITCH)
    connections = guard.Connections(guard.reserve_descriptors())
    port = line.getsockname()[1]
    app = build(workspace, host, port, connections=connections)
    shown = f"[{host}]" if ":" in host else host
    address = f"http://{shown}:{port}/?token={app.token}"
    tell(f"The web interface is at {address}")
    others = "" if guard.is_loopback(host) else "Others reach this address: "
    tell(f"{others}{'w' if others else 'W'}hoever has the token in it is let in, and may operate the machine.")
    config = uvicorn.Config(
        app,
        http=guard.counted_protocol(connections),
        backlog=guard.BACKLOG,
        log_config=None,
        access_log=False,
        ws_max_size=2**22,
        timeout_graceful_shutdown=2,
        lifespan="on",
        ws_per_message_deflate=False,
    )
    server, log = uvicorn.Server(config), guard.bound_log()
    with tempfile.TemporaryDirectory(prefix="mckibben-") as folder:
        if show:
            webbrowser.open(leading_to(address, Path(folder)))
        hang_up = getattr(signal, "SIGHUP", None)  # of which uvicorn does not know
        if hang_up is not None and signal.getsignal(hang_up) is not signal.SIG_IGN:
            signal.signal(hang_up, server.handle_exit)
        try:
            server.run(sockets=[line])
        except KeyboardInterrupt:
            pass  # the way in which a server ends
        finally:
            tell("Venting ..")
            workspace.close()
            logging.getLogger().removeHandler(log)


def leading_to(address: str, folder: Path) -> str:
    """Write a file that redirects a browser to an address; return its own address.

    A browser is opened by a command, and the words of a command are seen by everybody on the machine: so that the token is
    not among them, they name a file that nobody else may read.
    """
    place = folder / "mckibben.html"
    with open(place, "w", encoding="utf-8", newline="\n", opener=lambda n, flags: os.open(n, flags, 0o600)) as file:
        file.write(f'<!doctype html><meta http-equiv="refresh" content="0;url={html.escape(address)}">')
    return place.as_uri()
