"""Running a protocol on a rig, simulated or real, from names to the recording."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from ..answers import warn
from ..assembly.muscle_unit import MuscleUnit
from ..documents import JsonValue
from ..errors import InputError
from ..experiments.protocol import Protocol
from ..muscles import Muscle
from ..recordings.recording import Recording
from ..specimens import Specimen
from .biological_run import biological_subject, run_biological
from .hardware.interface import Hardware
from .hardware.simulated import Clock
from .prepare import OpenWire, PreparedRun, prepare
from .protocol_run import Display, Progress
from .rig import Rig
from .session import Session
from .software.interlocks import EmergencyStop

__all__ = ["EmergencyStop", "OpenWire", "PreparedRun", "prepare", "run"]


def run(
    protocol: PreparedRun | Protocol | str | os.PathLike[str],
    rig: Rig | str | os.PathLike[str] = "paper",
    *,
    muscle: str | Specimen | Muscle | MuscleUnit | None = None,
    progress: Progress | None = None,
    display: Display | None = None,
    stop: Callable[[], bool] | None = None,
    ask: Callable[[str], None] | None = None,
    real_time: bool = False,
    hardware: Hardware | None = None,
    log: str | Path | None = None,
    **options: JsonValue,
) -> Recording:
    """Run a protocol on a rig; a keyboard interrupt ends the run and keeps the samples so far.

    A biological muscle needs no rig. It runs protocols that stimulate it, such as ``twitch``, ``tetanus``,
    ``force-frequency`` and ``stimulated-work-loop``, and those for McKibben muscles with 5 bar as full excitation.

    Args:
        protocol: a protocol, the name of a shipped one, a ``.toml`` file, or what `prepare` made.
        rig: a rig, its name or file; of what was prepared already it is known.
        muscle: a specimen, its id or file, or a muscle; likewise.
        progress: told how far it is, with every chunk.
        display: shown every chunk.
        stop: asked at every sample by the wall clock, else once per chunk, whether to end the run. An `EmergencyStop`
            gives its reason; the machine vents at the next sample.
        ask: told what a person has to do on a real machine; returns when it is done.
        real_time: run the simulated machine in real time; the metadata then contain ``deadlines``.
        hardware: a machine instead of the simulated one. It gives the clock, and stays open.
        log: a new ``.mcap`` file which has every sample within a tenth of a second, whatever becomes of this program.
        **options: of `prepare`, and values of the protocol's parameters, such as ``pressure="3 bar"``.

    Raises:
        InputError: what `prepare` cannot read, the first finding of the dry run, or a machine that does not fit the rig.
        ConvergenceError: if the physics failed; says why.

    Examples:
        >>> import mckibben as mk
        >>> recording = mk.run("isometric-step", muscle="nylon", pressure="3 bar")
        >>> recording.meta["result"]
        'done'
    """
    if isinstance(protocol, PreparedRun):
        prepared = protocol
    elif muscle is None:
        raise InputError("muscle", None, "is missing: a specimen, its id or file, or a muscle")
    elif (biological := biological_subject(muscle)) is not None:
        of_machine = {"display": display, "stop": stop, "ask": ask, "hardware": hardware, "log": log}
        stated = [name for name, value in of_machine.items() if value is not None] + ["real_time"] * real_time
        if stated:
            raise InputError(stated[0], None, "is of a test machine, and a biological muscle runs without one")
        return run_biological(protocol, biological, **options)
    else:
        prepared = prepare(protocol, muscle=muscle, rig=rig, **options)
    warn(prepared.set_point_cautions())
    session = Session(prepared.rig, prepared.specimen or prepared.unit, hardware, unit=prepared.unit, by_hand=False)
    return session.run(
        prepared,
        new_machine=True,
        clock=Clock() if real_time else None,
        progress=progress,
        display=display,
        stop=stop,
        ask=ask,
        log=log,
    )
