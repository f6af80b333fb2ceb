"""``device``: a simulated machine behind a serial line, the commissioning of a real one, and of one that is not here."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated

import typer

from mckibben.bench import hardware, prepare, rig_file, segment
from mckibben.cli._outputs import OBJECT, RECORDING, SPECIMEN, OutputKinds, Paths, write_recording
from mckibben.cli._progress import progress
from mckibben.cli._reading import Change, Muscle, NoiseSeed, On, Plumbing, ProtocolName, RigName
from mckibben.cli._terminal import CHANGE, Json, pairs, print_json, table
from mckibben.documents import write_text
from mckibben.errors import InputError, LineLostError
from mckibben.quantities import parse

from . import commissioning, replay, serial_line

LOOK = 0.2  # at whether it is ended [s]
LONGEST_SERVICE = 31_557_600.0  # [s]; a longer one is a slip


def serve(
    protocol: ProtocolName,
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

    $ mckibben device serve work-loop --muscle nylon --out port.txt
    """
    seconds = None if duration is None else parse(duration, "s", field="--duration", bare=True)
    if seconds is not None and not 0.0 <= seconds <= LONGEST_SERVICE:
        raise InputError(
            "--duration", duration, f"must be from 0 s to {LONGEST_SERVICE:g} s, a year; without it Ctrl-C ends it"
        )
    if port is not None and (not port.name or port.is_dir() or not port.absolute().parent.is_dir()):
        raise InputError("--out", str(port), "must be a file in a folder that is there")
    try:
        changes = pairs(change, "--set", CHANGE)
        bench = prepare.prepare(protocol, muscle=muscle, rig=rig, changes=changes, plumbing=plumbing, seed=seed)
    except InputError as error:
        raise error.changed(field=error.field.replace("changes.", "--set ")) from None
    part = next(bench.segments())
    machine = segment.SegmentMachine(bench, 0, part, segment.timing_of(bench)).at_interface()
    out, converters = bench.rig.motor_out, bench.rig.converters(part.start_span)
    about = serial_line.device.About(
        encoder=converters.encoder is not None,
        motor=out is not None,
        motor_rest=0 if out is None else int(out.count(0.0)),
    )
    end = None if seconds is None else time.monotonic() + seconds
    with serial_line.microcontroller.in_thread(machine, about=about) as attached:
        typer.echo(f"serial:{attached.port}")
        if port is not None:
            write_text(port, attached.port, field="--out")
        typer.echo(f"Run {protocol} with --on serial:{attached.port}; Ctrl-C ends the device.", err=True)
        try:
            while end is None or time.monotonic() < end:
                time.sleep(LOOK)
        except KeyboardInterrupt:
            pass


def _ask(pressure: str, motor: bool) -> None:
    """Let the operator agree before air flows."""
    if not sys.stdin.isatty():
        raise InputError("--yes", None, "is missing: nobody can be asked at a terminal whether air may flow")
    moves = " and the motor will pull" if motor else ""
    asked = f"Air of {pressure} will flow into the muscle{moves}: keep clear of it, then press Enter"
    typer.prompt(asked, "", show_default=False, err=True)


CHECKED = OutputKinds(rig=SPECIMEN, recording=RECORDING, record=OBJECT)
REPLAYED = OutputKinds(rig=SPECIMEN, recording=RECORDING, result=OBJECT)
PRINTED = ("rig", "pressure", "period", "passed", "results", "measured")  # of a check
VERDICT = {True: "passed", False: "FAILED", None: "not tested"}


def check(
    muscle: Annotated[
        str, typer.Option("--muscle", metavar="SPECIMEN", help="Muscle of the simulated machine.")
    ] = "nylon",
    rig: RigName = "paper",
    plumbing: Plumbing = None,
    seed: NoiseSeed = 0,
    machine: On = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="Check a simulated machine of the rig instead of a real one.")
    ] = False,
    pressure: Annotated[
        str, typer.Option(metavar="PRESSURE", help="Gauge pressure that the valve is asked for.")
    ] = "1 bar",
    rate: Annotated[str, typer.Option(metavar="FREQUENCY", help="Rate of the samples.")] = "250 Hz",
    motor: Annotated[
        bool,
        typer.Option("--motor", help="Let the motor pull, with 5 % of its largest force, to 2 mm beyond the mount."),
    ] = False,
    yes: Annotated[bool, typer.Option("--yes", help="Begin without a question.")] = False,
    out: Annotated[
        Paths,
        CHECKED.option(
            note="The rig file is the one that was read, with the measured values; device replay takes the record."
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Check that each sensor answers valve and motor: sign, scale, noise, range, delay; and that the machine vents.

    It lasts about 8 s, lets air of the stated pressure into the muscle, and vents at the end. The exit code is 1 if a test
    failed.

    $ mckibben device check --rig modern --simulate
    """
    one = rig_file.rig(rig)
    asked = parse(pressure, "Pa", field="--pressure")
    period = one.computer.period(parse(rate, "1/s", field="--rate"))
    if simulate == (machine is not None):
        problem = "is allowed only without --simulate" if simulate else "is missing: give --on MACHINE or --simulate"
        raise InputError("--on", None, problem)
    commissioning.layout_of(one, plumbing, asked)
    with CHECKED.files(out) as files:
        hardware.backends.check_connection(machine)
        if machine is not None and not yes:
            _ask(pressure, motor)
        try:
            with (
                hardware.backends.connected(machine, one, period) as real,
                progress("checking", 1.0, saved="The machine was vented.", guarded=False) as bar,
            ):
                checked = real or commissioning.simulated_machine(
                    one, muscle, period=period, plumbing=plumbing, motor=motor, seed=seed
                )
                record = commissioning.record_check(
                    checked, one, period=period, pressure=asked, plumbing=plumbing, motor=motor, progress=bar.at
                )
        except (InputError, LineLostError) as error:  # as much as is known of the machine, for whoever is to help
            layout = commissioning.layout_of(one, plumbing, asked)
            record = commissioning.CheckRecord(
                rig=one, plumbing=layout, pressure=asked, period=period, motor=motor, refused=str(error)
            )
            files.write("record", lambda path: replay.write_check(path, record, None))
            raise
        outcome = None if record.refused else record.judge()
        files.write("record", lambda path: replay.write_check(path, record, outcome))
        outcome = outcome or record.judge()  # which says why the machine was lost
        source = rig if rig.lower().endswith(".toml") else None
        files.write("rig", lambda path: commissioning.write_measured_rig(path, outcome, one, source))
        files.write("recording", lambda path: write_recording(outcome.recording(), path))
        if as_json:
            print_json({key: replay.check_content(record, outcome)[key] for key in PRINTED})
        else:
            _print_check(outcome)
            files.say()
    if not outcome.passed:
        raise typer.Exit(1)


def _print_check(check: commissioning.MachineCheck) -> None:
    results = check.results
    new = [not i or results[i - 1].channel != r.channel for i, r in enumerate(results)]
    rows = [
        [r.channel if first else "", r.test, VERDICT[r.passed], r.sentence]
        for first, r in zip(new, results, strict=True)
    ]
    table(f"Check of the rig {check.rig}", ["", "test", "", ""], rows)


def replay_machine(
    file: Annotated[
        Path, typer.Argument(metavar="FILE", help="What device check --out FILE.json has written, here or elsewhere.")
    ],
    muscle: Annotated[
        str, typer.Option("--muscle", metavar="SPECIMEN", help="Muscle that the dry run of the protocol assumes.")
    ] = "nylon",
    out: Annotated[Paths, REPLAYED.option()] = None,
    as_json: Json = False,
) -> None:
    """Run check, calibration and first protocol on a machine that is not here, from the file of its check.

    The machine gives the recorded samples while it is asked what it was asked then, and answers other commands of the valve
    as it answered those. Other commands take it as --on replay:FILE. The exit code is 1 if something failed.

    $ mckibben device replay check.json
    """
    with REPLAYED.files(out) as files:
        found = replay.replay_check(file, muscle=muscle)
        record, check = found.record, found.check
        if check is None and (files["rig"] or files["recording"]):
            raise LineLostError(f"{file}: {record.refused}")
        if check is not None:
            files.write("rig", lambda path: commissioning.write_measured_rig(path, check, record.rig, None))
            files.write("recording", lambda path: write_recording(check.recording(), path))
        content = {
            "file": str(file),
            "rig": record.rig.name,
            "passed": found.passed,
            "steps": [step._asdict() for step in found.steps],
            "results": [] if check is None else [r.to_dict() for r in check.results],
            "versions": dict(record.versions),
            "identity": dict(record.machine.get("identity", {})),
        }
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            if check is not None:
                _print_check(check)
            rows = [[step.name, VERDICT[step.passed], step.sentence] for step in found.steps]
            table(f"Replay of {file}, written {record.created}", ["", "", ""], rows)
            files.say()
    if not found.passed:
        raise typer.Exit(1)
