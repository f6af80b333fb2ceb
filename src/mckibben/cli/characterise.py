"""``characterise``: an unknown muscle on a rig, from slack to a fitted specimen with friction, relaxation and leak."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import muscles
from ..bench import hardware as hardware_package
from ..bench import rig_file, software
from ..errors import InputError, StageError
from ..quantities import parse, with_unit
from ..report import study_reports
from ..studies import characterisation
from ._progress import INTERRUPTED, progress
from ._terminal import Json, LockStep, NoiseSeed, Plumbing, RigName, pairs, print_json, table
from .run import On

if TYPE_CHECKING:
    from ..studies.characterisation.verb import Characterisation, CharacterisationPlan


def characterise(
    muscle: Annotated[
        str | None,
        typer.Option("--muscle", metavar="SPECIMEN", help="Muscle of the simulated rig: id or .toml file."),
    ] = None,
    rig: RigName = "modern",
    law: Annotated[
        list[str] | None,
        typer.Option("--law", metavar="LAW", help="Law to fit; all laws by default."),
    ] = None,
    rest_length: Annotated[
        str | None,
        typer.Option(
            metavar="LENGTH",
            help="Length of the vented muscle between its clamps, where it is mounted, as '300 mm'; needed with --on.",
        ),
    ] = None,
    rest_length_error: Annotated[
        str,
        typer.Option(
            metavar="SHARE",
            help="Largest error of the rest length, such as '0.5 %'; a muscle that gets taut elsewhere is refused.",
        ),
    ] = "1 %",
    plumbing: Plumbing = None,
    max_pressure: Annotated[
        str | None,
        typer.Option(
            metavar="PRESSURE", help="Highest gauge pressure, such as '5 bar'; what the rig bears by default."
        ),
    ] = None,
    max_tension: Annotated[
        str | None,
        typer.Option(metavar="FORCE", help="Largest tension, such as '200 N'; what the rig bears by default."),
    ] = None,
    cord: Annotated[
        str | None,
        typer.Option(
            metavar="STIFFNESS",
            help="Stiffness of cord and frame in series, such as '100 N/mm', by which spans are longer than the muscle; "
            "that of a simulated rig by default, of a machine none.",
        ),
    ] = None,
    known: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME=VALUE",
            help="Parameter that is not fitted, such as wall_thickness='0.5 mm': a size that no tension tells.",
        ),
    ] = None,
    gain_error: Annotated[
        str,
        typer.Option(
            metavar="SHARE",
            help="Standard uncertainty of the gains of load cell and pressure sensor, such as '0.5 %', for the intervals.",
        ),
    ] = "0.2 %",
    seed: NoiseSeed = 0,
    machine: On = None,
    lock_step: LockStep = False,
    dry: Annotated[
        bool, typer.Option("--dry-run", help="Print the stages and their times without moving anything.")
    ] = False,
    out: Annotated[
        Path | None,
        typer.Option(
            "--out",
            metavar="FOLDER",
            help="Folder of recordings, report and specimen; the same command resumes from it.",
        ),
    ] = None,
    as_json: Json = False,
) -> None:
    """Characterise an unknown muscle on a test machine: map, friction, relaxation, leak, and a fitted specimen.

    The exit code is 1 if a stage failed or the held-out points were not predicted; Ctrl-C vents and keeps the stages so far.

    $ mckibben characterise --muscle nylon --rig modern --max-pressure '5 bar' --out nylon
    """
    if lock_step and machine is None:
        raise InputError("--lock-step", None, "is allowed only with --on, for a simulated device")
    hardware_package.backends.check_connection(machine)
    if (muscle is None) == (machine is None):
        problem = "is missing: the muscle of the simulated rig" if muscle is None else "is of a simulated rig"
        raise InputError("--muscle", None, problem)
    if machine is not None and rest_length is None:
        raise InputError("--rest-length", None, "is missing: the span at which the muscle is mounted")
    if out is None and not dry:
        raise InputError("--out", None, "is missing: the folder of recordings, report and specimen")
    for name in law or ():
        muscles.laws.law_type(name)
    gain = parse(gain_error, "1", field="--gain-error")
    if not 0.0 <= gain <= 0.2:
        raise InputError("--gain-error", gain_error, "must be between 0 and 20 %")
    on = rig_file.rig(rig)
    options: dict[str, Any] = {
        "rest_length": _amount(rest_length, "m", "--rest-length"),
        "plumbing": plumbing,
        "max_pressure": _amount(max_pressure, "Pa", "--max-pressure"),
        "max_tension": _amount(max_tension, "N", "--max-tension"),
        "rest_length_error": parse(rest_length_error, "1", field="--rest-length-error"),
    }
    if options["rest_length"] is None and muscle is not None:
        options["rest_length"] = characterisation.verb.rest_length_of_muscle(muscle)
    try:
        intended = characterisation.verb.plan(on, **options)
        if dry or out is None:
            _tell(intended, as_json)
            return
        if not as_json:
            _tell(intended, False)
        stiffness = _amount(cord, "N/m", "--cord")
        options |= {"cord": stiffness, "known": pairs(known, "--known", "wall_thickness='0.5 mm'"), "gain_error": gain}
        outcome = _run(intended, machine, on, options, muscle, law, out, seed, lock_step=lock_step)
    except InputError as error:
        raise error.changed(field=_option(error.field)) from None
    study_reports.write_characterisation_report(outcome, out / "report.html")
    if as_json:
        print_json(outcome.to_dict())
    else:
        _print(outcome, out)
    if not outcome.passed:
        raise StageError(*outcome.failed_stage)


def _amount(text: str | None, unit: str, option: str) -> float | None:
    return None if text is None else parse(text, unit, field=option)


def _option(field: str) -> str:
    """Name of the option of an argument."""
    named = "rest_length rest_length_error max_pressure max_tension plumbing out muscle rig law cord".split()
    first, _, rest = field.partition(".")
    return f"--{field.replace('_', '-')}" if field in named else f"--known {rest}" if first == "known" else field


def _run(
    intended: CharacterisationPlan,
    machine: str | None,
    rig: Any,
    options: dict[str, Any],
    muscle: str | None,
    law: list[str] | None,
    out: Path,
    seed: int,
    *,
    lock_step: bool,
) -> Characterisation:
    """Run the stages with the time left; Ctrl-C vents and keeps the stages so far."""
    button, period = software.interlocks.EmergencyStop(), 1.0 / characterisation.verb.rate_of(rig)

    def kept() -> str:
        stages = [name for name in intended.bounds.stages if characterisation.verb.place_of(out, name).exists()]
        if not stages:
            return "no stage was done, and nothing was kept"
        return f"{', '.join(stages)} of {len(intended.bounds.stages)} stages are in {out}, and the same command goes on"

    with (
        progress("characterising", intended.total, saved=kept, guarded=False) as bar,
        hardware_package.backends.connected(machine, rig, period, lock_step=lock_step) as hardware,
        button.on_signals(),
    ):
        try:
            return characterisation.verb.characterise(
                rig,
                muscle=muscle,
                laws=law or None,
                out=out,
                hardware=hardware,
                seed=seed,
                stop=button,
                progress=lambda done, total, stage: bar.reached(done, total, stage),
                **options,
            )
        except StageError as error:
            if not button():
                raise
            typer.echo(f"mckibben: interrupted in stage {error.stage}; vented; {kept()}", err=True)
            raise typer.Exit(INTERRUPTED) from None


def _tell(intended: CharacterisationPlan, as_json: bool) -> None:
    """Print the plan."""
    bounds = intended.bounds
    if as_json:
        print_json(
            {
                "stages": intended.seconds,
                "machine_time": intended.total,
                "rest_length": bounds.rest_length,
                "max_pressure": bounds.pressure,
                "max_tension": bounds.tension,
            }
        )
        return
    rows = [
        [name, characterisation.stages.STAGES[name], f"{seconds:.0f} s"] for name, seconds in intended.seconds.items()
    ]
    table("Stages", ["", "", "at most"], rows, right=(2,))
    highest, largest = with_unit(bounds.pressure, "Pa", 3), with_unit(bounds.tension, "N", 3)
    shut = "" if bounds.shut_off else " There is no shut-off valve, so leaks are not tested."
    typer.echo(f"At most {intended.total / 60.0:.1f} min of machine time, {highest} and {largest}.{shut}\n")


def _print(outcome: Characterisation, out: Path) -> None:
    """Print what was found and what was written."""
    rows = [
        [name, with_unit(e.value, e.unit), with_unit(e.low, e.unit), with_unit(e.high, e.unit)]
        for name, e in outcome.estimates.items()
    ]
    table(f"Characterised by the law {outcome.law}", ["", "value", "95 %: from", "to"], rows, right=(1, 2, 3))
    found = outcome.evaluation
    typer.echo(
        f"{len(found.held_out)} held-out points: {100.0 * outcome.held_out_error:.2g} % rms of the largest tension, "
        f"{with_unit(found.largest, 'N', 3)}; a predicted tension is known to {found.half_width:.2g} N (95 %)."
    )
    lowest, highest = (with_unit(p, "Pa", 3) for p in outcome.measured_pressures)
    change = found.gain_change
    shortest, longest = (with_unit(end, "m", 3) for end in found.lengths)
    typer.echo(f"The map is of {lowest} to {highest} and {shortest} to {longest}; beyond it the law alone answers.")
    if math.isfinite(change.value):
        half = 100.0 * (change.high - change.value)
        hidden = (
            ""
            if outcome.tells_gain
            else ", which is too uncertain to tell a gain that drifts: the muscle relaxes too much"
        )
        typer.echo(
            f"One loop, measured again at the end, has changed by {100.0 * change.value:+.2f} +- {half:.2f} %{hidden}."
        )
    for said in outcome.cautions:
        typer.echo(f"mckibben: caution: {said.replace('{known}', '--known')}", err=True)
    (short, long), cord = (with_unit(by, "m", 2) for by in found.clamp), outcome.bounds.cord
    beside = f"which may be {short} to {long} longer than the vented muscle itself"
    if cord is None:
        beside += ", and under tension by what cord and clamps stretch, too, which counts as the muscle's"
    else:
        beside = f"less what cord and frame stretch, {with_unit(float(cord.stiffness), 'N/m', 3)}, {beside}"
    typer.echo(f"Lengths are spans of the rig, {beside}.")
    typer.echo(f"{outcome.seconds / 60.0:.1f} min of machine time. Written: {out / 'report.html'}")
    if outcome.passed:
        typer.echo(f"Written: {out / outcome.specimen.id}.toml")
