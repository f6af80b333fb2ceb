"""``calibrate``: what the command line adds to sessions with a reference: a person at the terminal who sets each point."""

from __future__ import annotations

import contextlib
import sys
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

import typer

from mckibben.cli._outputs import OBJECT, SPECIMEN, OutputKinds
from mckibben.cli._verb import VerbCommand
from mckibben.errors import InputError
from mckibben.quantities import parse, with_unit

if TYPE_CHECKING:
    from .calibrate.session import OperatorTask

FAULT = "rig.sensors.tension.offset='3 N'"


def ask_person(task: OperatorTask) -> float | None:
    """Ask at the terminal, on standard error; the user types the value of the reference with its unit."""
    asked = f"{task.sentence[0].upper()}{task.sentence[1:]}"
    if not task.gauge:
        typer.prompt(f"{asked}, then press Enter", "", show_default=False, err=True)
        return None
    usual = with_unit(next(iter(task.values.values())), "Pa")
    while True:
        shown = typer.prompt(f"{asked}; what does the reference show", usual, err=True)
        try:
            return parse(str(shown), "Pa", field="reference")
        except InputError as error:
            tell_person(error)


def tell_person(error: InputError) -> None:
    """Report that a point was refused; it is requested again."""
    typer.echo(f"mckibben: {error}; once more", err=True)


@contextlib.contextmanager
def _person(given: Mapping[str, Any]) -> Iterator[dict[str, Any]]:
    session = given.get("session", given)
    if "readings" in given:
        yield {}
        return
    if session.get("machine") is not None and not session.get("simulate") and not sys.stdin.isatty():
        raise InputError(
            "terminal", None, "is missing: nobody can be asked for the points; run it in a terminal, or with --simulate"
        )
    people = {"ask": ask_person, "again": tell_person}
    yield {"session": session | people} if "session" in given else people


def _session(name: str, example: str) -> VerbCommand:
    return VerbCommand(
        f"mckibben_hardware.calibrate.verbs:calibrate_{name}",
        OutputKinds(calibration=SPECIMEN, result=OBJECT),
        (f"calibrate {name} {example} --out calibration.toml",),
        options={"machine": "on", "changes": "set"},
        pairs={"changes": FAULT},
        writes={"calibration": lambda answer, path: answer.save(path)},
        around=_person,
        from_files=lambda given, files: {"file": files.first("calibration")},
        note="Entries of other channels of a calibration are kept.",
    )


zero = _session("zero", "--rig modern --simulate")
weights = _session("weights", "--rig modern --simulate --masses '0 kg,1 kg,5 kg'")
pressure = _session("pressure", "--rig modern --simulate --pressures '0 bar,3 bar,6 bar'")
encoder = _session("encoder", "--rig paper --simulate --travels '0 mm,50 mm'")
skew = _session("skew", "--rig modern --simulate --channels pressure,tension")
