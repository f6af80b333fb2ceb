"""``device``: a simulated machine behind a serial line, to test runs on real ones."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from ..bench import hardware, segment
from ..documents import write_text
from ..errors import InputError
from ..quantities import parse
from ._terminal import Muscle, NoiseSeed, Plumbing, RigName
from .run import Change, Protocol, prepared

LOOK = 0.2  # at whether somebody ends it [s]


def device(
    protocol: Protocol,
    muscle: Muscle,
    rig: RigName = "paper",
    change: Change = None,
    plumbing: Plumbing = None,
    seed: NoiseSeed = 0,
    duration: Annotated[
        str | None, typer.Option(metavar="TIME", help="Time after which the device ends, such as '10 s'.")
    ] = None,
    port: Annotated[
        Path | None, typer.Option("--out", metavar="OUT", help="Write the name of the port into this file.")
    ] = None,
) -> None:
    """Serve a simulated test machine on a virtual serial port.

    The machine is the one on which the protocol begins. Ctrl-C ends it.

    $ mckibben device work-loop --muscle nylon --out port.txt
    """
    seconds = None if duration is None else parse(duration, "s", field="--duration", bare=True)
    if seconds is not None and seconds < 0.0:
        raise InputError("--duration", duration, "must be 0 s or more")
    if port is not None and (not port.name or port.is_dir() or not port.absolute().parent.is_dir()):
        raise InputError("--out", str(port), "must be a file in a folder that is there")
    bench = prepared(protocol, muscle, rig, change, None, plumbing=plumbing, seed=seed)
    part = next(bench.segments())
    machine = segment.SegmentMachine(bench, 0, part, segment.timing_of(bench)).at_interface()
    out, converters = bench.rig.motor_out, bench.rig.converters(part.start_span)
    about = hardware.serial_line.device.About(
        encoder=converters.encoder is not None,
        motor=out is not None,
        motor_rest=0 if out is None else int(out.count(0.0)),
    )
    end = None if seconds is None else time.monotonic() + seconds
    with hardware.serial_line.microcontroller.in_thread(machine, about=about) as attached:
        typer.echo(f"serial:{attached.port}")
        if port is not None:
            write_text(port, attached.port, field="--out")
        typer.echo(f"Run {protocol} with --on serial:{attached.port}; Ctrl-C ends the device.", err=True)
        try:
            while end is None or time.monotonic() < end:
                time.sleep(LOOK)
        except KeyboardInterrupt:
            pass
