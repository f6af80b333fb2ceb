"""``serve``: the laboratory's screen, in a browser on this machine."""

from __future__ import annotations

import importlib.util
from pathlib import Path
from typing import Annotated

import typer

from ..errors import MckibbenError

NEEDED = ("nicegui", "uvicorn", "fastapi")


def add_to(app: typer.Typer) -> None:
    """Add this command to the table."""
    app.command("serve")(serve)


def serve(
    host: Annotated[
        str, typer.Option(help="Address to listen on; another than this machine's own demands a token.")
    ] = "127.0.0.1",
    port: Annotated[int, typer.Option(min=0, max=65535, help="Its port; 0 for a free one.")] = 8080,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open a browser.")] = True,
    folder: Annotated[Path, typer.Option(metavar="FOLDER", help="Where recordings are kept.")] = Path("recordings"),
) -> None:
    """Open the laboratory's screen: bench, fits, comparisons, recordings, in a browser; nothing comes from the internet."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        raise MckibbenError(f"serve needs {', '.join(missing)}, which come with: pip install 'mckibben[web]'")
    from ..web.bench import Bench
    from ..web.laboratory import Laboratory
    from ..web.server import listen
    from ..web.server import serve as go

    line = listen(host, port)  # an address that is taken is refused before anything is made ready
    typer.echo("Getting the laboratory ready ..", err=True)
    go(Laboratory(folder, Bench), line, host, show=show, tell=typer.echo)
