"""``serve``: the web interface, for a browser on this machine."""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Annotated

import typer

from ..bench import hardware, rig_file, session
from ..errors import InputError
from ..extras import library
from ..registry import fix_code
from ._progress import protected
from ._reading import CalibrationFile, LockStep, On

NEEDED = ("starlette", "uvicorn", "websockets")


def serve_screen(
    host: Annotated[
        str,
        typer.Option(
            metavar="ADDRESS",
            help="Address to listen on; any other than the default can be reached from other machines.",
        ),
    ] = "127.0.0.1",
    port: Annotated[
        int, typer.Option(metavar="N", min=0, max=65535, help="Port to listen on; 0 chooses a free one.")
    ] = 8080,
    show: Annotated[bool, typer.Option("--open/--no-open", help="Open the web interface in a browser.")] = True,
    folder: Annotated[Path, typer.Option(metavar="FOLDER", help="Folder in which recordings are kept.")] = Path(
        "recordings"
    ),
    muscle: Annotated[str, typer.Option(metavar="SPECIMEN", help="Muscle mounted at start-up.")] = "nylon",
    rig: Annotated[
        str, typer.Option(metavar="RIG", help="Rig at start-up; for a real machine its own rig file.")
    ] = "paper",
    calibration: CalibrationFile = None,
    machine: On = None,
    lock_step: LockStep = False,
) -> None:
    """Serve the web interface to a browser on this machine.

    It has pages for the bench, fits, comparisons, energy, circuits, the papers and recordings. Nothing is loaded from the
    internet.

    $ mckibben serve --muscle nylon --rig modern
    """
    for name in NEEDED:
        library(name, "The web interface needs")
    from ..web.bench import Bench, HardwareSpec  # these import what comes with the extra
    from ..web.server import listen, serve
    from ..web.workspace import Workspace

    hardware.backends.check_connection(machine)
    with listen(host, port) as line:  # an address that is taken is refused before anything is made ready
        first, real = rig_file.rig(rig, calibration=calibration), None
        if machine is not None:
            real = HardwareSpec(machine, lock_step)
            with hardware.backends.connected(
                machine, first, first.computer.period(session.interface.RATE), lock_step=lock_step
            ):
                pass  # so is a machine that is not there, or not the rig's
        elif lock_step:
            raise InputError("--lock-step", None, "is allowed only with --on, for a simulated device")
        typer.echo("Preparing the web interface ..", err=True)
        fix_code()  # texts of a browser and files that were uploaded name code, too
        workspace = Workspace(folder, functools.partial(Bench, muscle=muscle, rig=first, spec=real))
        with protected():  # it ends by itself, after the machine has vented
            serve(workspace, line, host, show=show, tell=typer.echo)
