"""``calibrate show`` and ``calibrate apply``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from .. import recordings
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import with_unit
from ..recordings import calibration as calibration_module
from ..recordings import calibration_file
from ._outputs import KEPT_RECORDING, OBJECT, OutputFiles, OutputKinds, Paths, write_recording
from ._terminal import Json, print_json, table

if TYPE_CHECKING:
    import datetime

    from ..recordings.calibration import Calibration, Correction


SHOWN = OutputKinds(result=OBJECT)
APPLIED = OutputKinds(recording=KEPT_RECORDING)
UNITS = {"gain": "1", "skew": "s"}  # that of the channel for the rest


def show(
    file: Annotated[
        Path,
        typer.Argument(
            metavar="CALIBRATION|RECORDING", help="Calibration file (.toml), or a recording that carries a calibration."
        ),
    ],
    out: Annotated[Paths, SHOWN.option()] = None,
    as_json: Json = False,
) -> None:
    """Show a calibration: values, 95 % intervals, origin and age.

    Values that have expired are marked.

    $ mckibben calibrate show calibration.toml
    """
    with SHOWN.files(out) as files:
        whole = _known(file)
        now = _now()
        content = {
            "file": str(file),
            "rig": whole.rig,
            "created": whole.created,
            "expired": list(whole.expired(now)),
            "channels": {name: correction_content(one, now) for name, one in whole.corrections.items()},
        }
        files.write_result(content)
        if as_json:
            print_json(content)
        else:
            _print(whole, now)
            files.say()


def _print(whole: Calibration, now: datetime.datetime) -> None:
    rows = []
    for name, one in whole.corrections.items():
        over = one.expired(now)
        for key, term in one.terms.items():
            origin = term.origin
            age, until, by = "", "", ""
            if origin is not None:
                age = f"{(now - calibration_module.moment(origin.date)).total_seconds() / 86400.0:.0f} days"
                until = "for ever" if origin.expires is None else f"{origin.expires:%Y-%m-%d}"
                by = f"{origin.method}, {origin.reference}" if origin.reference else origin.method
            rows.append(
                [name, key, *term_and_interval(one, key), by, one.sensor, age, until, "EXPIRED" if key in over else ""]
            )
    columns = ["channel", "", "value", "+- 95 %", "by", "sensor", "age", "valid until", ""]
    table(f"Calibration of the rig {whole.rig}, {whole.created}", columns, rows, right=[2, 3])
    for sentence in whole.expired(now):
        typer.echo(f"Note: {sentence}")


def apply(
    recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recording, with or without a calibration.")],
    out: Annotated[list[Path], APPLIED.option()],
    calibration: Annotated[Path | None, typer.Option(metavar="CALIBRATION", help="Calibration file to apply.")] = None,
    off: Annotated[bool, typer.Option("--off", help="Remove the calibration that the recording carries.")] = False,
    skew: Annotated[bool, typer.Option("--skew", help="Also shift the channels by their skews.")] = False,
    as_json: Json = False,
) -> None:
    """Apply a calibration to a recording in place of the one it carries.

    The raw values can always be recovered.

    $ mckibben calibrate apply raw.nc --calibration calibration.toml --out true.nc
    """
    with APPLIED.files(out) as files:
        _apply(recording, files, calibration, off=off, skew=skew, as_json=as_json)


def _apply(
    recording: Path, files: OutputFiles, calibration: Path | None, *, off: bool, skew: bool, as_json: bool
) -> None:
    """Apply a calibration and write the recording."""
    if off == (calibration is not None):
        raise InputError(
            "--calibration",
            *(
                (None, "is missing: give a file, or --off")
                if calibration is None
                else (str(calibration), "must be a file, or --off")
            ),
        )
    if off and skew:
        raise InputError("--skew", None, "is allowed only beside --calibration")
    new = None if calibration is None else calibration_file.read_calibration(calibration)
    known = recordings.read_recording(recording)
    try:
        done = calibration_module.recalibrate(known, new, skew=skew)
    except InputError as error:
        raise error.at(str(recording)) from None
    files.write("recording", lambda path: write_recording(done, path))
    out = files["recording"][0]
    before = known.meta.get("warnings") or []
    notes = [w for w in done.meta.get("warnings") or [] if w not in before]
    if new is not None:
        notes += [s for s in new.expired(_now()) if s not in notes]
    measured = [n for n in known.names("measured") if n in done and (done[n] != known[n]).any()]
    if as_json:
        print_json(
            {
                "file": str(out),
                "source": str(recording),
                "changed": measured,
                "skew_corrected": done.meta.get("skew_corrected") or [],
                "warnings": notes,
                "summary": done.summary(),
                "saturation": done.meta.get("saturation") or {},
            }
        )
        return
    typer.echo(f"Written: {out}, changed are {', '.join(measured) or 'no channels'}")
    for note in notes:
        typer.echo(f"Note: {note}")


def _known(file: Path) -> Calibration:

    if file.suffix.lower() == ".toml":
        return calibration_file.read_calibration(file)
    try:
        calibration = calibration_module.carried(recordings.read_recording(file))
    except InputError as error:
        raise error if error.where == str(file) else error.at(str(file)) from None
    if calibration is None:
        raise InputError("calibration", None, "is not in the recording", where=str(file))
    return calibration


def correction_content(one: Correction, now: datetime.datetime) -> dict[str, JsonValue]:
    """Convert a correction to JSON: every term with its interval, its origin and whether it has expired."""
    over = one.expired(now)
    out: dict[str, Any] = {
        "unit": one.unit,
        "sensor": one.sensor,
        "correlation": one.correlation,
        "linearity": one.linearity,
    }
    for key, term in one.terms.items():
        low, high = term.interval()
        number = {
            "value": term.value,
            "uncertainty": term.uncertainty,
            "degrees": term.degrees,
            "low": low,
            "high": high,
        }
        origin = {} if term.origin is None else dict(vars(term.origin))
        out[key] = {**number, "unit": UNITS.get(key, one.unit), "expired": key in over, **origin}
    return out


def term_and_interval(one: Correction, key: str) -> list[str]:
    """Value of a term and half its interval, formatted."""
    term = one.terms[key]
    low, high = term.interval()
    if key == "skew":
        return [f"{1e6 * term.value:.5g} us", f"{5e5 * (high - low):.2g} us"]
    unit = UNITS.get(key, one.unit)
    return [with_unit(term.value, unit, 7), with_unit(0.5 * (high - low), unit, 2)]


def _now() -> datetime.datetime:
    import datetime

    return datetime.datetime.now(datetime.UTC)
