"""``calibrate``: what the command line adds to sessions with a reference: a person at the terminal who sets each point."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from ..errors import InputError
from ..quantities import parse, with_unit
from ._outputs import KEPT_RECORDING, OBJECT, SPECIMEN, OutputFiles, OutputKinds, write_recording
from ._verb import VerbCommand

if TYPE_CHECKING:
    from ..bench.calibrate.sources import OperatorTask
    from ..studies.calibrations import CalibratedChannels, RecalibratedRecording

FAULT = "rig.sensors.tension.offset='3 N'"


def ask_person(task: OperatorTask) -> float | None:
    """Ask at the terminal, on standard error; the user types the value of the reference with its unit."""
    if not task.gauge:
        typer.prompt(
            f"{task.sentence[0].upper()}{task.sentence[1:]}, then press Enter", "", show_default=False, err=True
        )
        return None
    value = next(iter(task.values.values()))
    while True:
        asked = f"{task.sentence[0].upper()}{task.sentence[1:]}; what does the reference show"
        try:
            return parse(str(typer.prompt(asked, with_unit(value, "Pa"), err=True)), "Pa", field="reference")
        except InputError as error:
            tell_person(error)


def tell_person(error: InputError) -> None:
    """Report that a point was refused; it is requested again."""
    typer.echo(f"mckibben: {error}; once more", err=True)


@contextlib.contextmanager
def _person(given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    session = given.get("session", given)
    if session.get("machine") is not None and not session.get("simulate") and not sys.stdin.isatty():
        raise InputError(
            "terminal", None, "is missing: nobody can be asked for the points; run it in a terminal, or with --simulate"
        )
    yield {"ask": ask_person, "again": tell_person}


def _file(files: OutputFiles) -> dict[str, Any]:
    return {"file": files.first("calibration")}


def _write(answer: CalibratedChannels, path: Path) -> None:
    from ..bench.calibrate.session import write_calibration

    write_calibration(answer.whole, path)


def _session(name: str, example: str) -> VerbCommand:
    return VerbCommand(
        f"studies.calibrations:calibrate_{name}",
        OutputKinds(calibration=SPECIMEN, result=OBJECT),
        (f"calibrate {name} {example} --out calibration.toml",),
        options={"machine": "on", "changes": "set"},
        pairs={"changes": FAULT},
        writes={"calibration": _write},
        around=_person,
        from_files=_file,
        note="Entries of other channels of a calibration are kept.",
    )


def _write_applied(answer: RecalibratedRecording, path: Path) -> None:
    write_recording(answer.recording, path)


zero = _session("zero", "--rig modern --simulate")
weights = _session("weights", "--rig modern --simulate --masses '0 kg,1 kg,5 kg'")
pressure = _session("pressure", "--rig modern --simulate --pressures '0 bar,3 bar,6 bar'")
encoder = _session("encoder", "--rig paper --simulate --travels '0 mm,50 mm'")
skew = _session("skew", "--rig modern --simulate --channels pressure,tension")
show = VerbCommand(
    "studies.calibrations:describe_calibration",
    OutputKinds(result=OBJECT),
    ("calibrate show calibration.toml",),
)
apply = VerbCommand(
    "studies.calibrations:apply_calibration",
    OutputKinds(recording=KEPT_RECORDING),
    ("calibrate apply raw.nc --calibration calibration.toml --out true.nc",),
    required=("out",),
    writes={"recording": _write_applied},
)
