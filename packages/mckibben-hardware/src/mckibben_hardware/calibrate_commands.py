"""``calibrate``: gain, zero and skew of a rig's channels by a reference, stored in a file and applied to recordings."""

from __future__ import annotations

import datetime
import math
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from mckibben.bench import hardware, rig_file
from mckibben.cli._outputs import OBJECT, SPECIMEN, OutputKinds, Paths
from mckibben.cli._terminal import Json, RigName, pairs, print_json, table
from mckibben.cli.calibration import correction_content, term_and_interval
from mckibben.cli.run import On
from mckibben.errors import InputError
from mckibben.quantities import parse, split_values, with_unit
from mckibben.recordings import calibration, calibration_file, provenance

from . import calibrate as calibrating

if TYPE_CHECKING:
    from mckibben.bench.rig import Rig
    from mckibben.documents import JsonValue
    from mckibben.recordings.calibration import Calibration

    from .calibrate.session import Ask, CalibrationOutcome, OperatorTask, Source


POINTS = 40  # rows of points that a person is shown
_FAULT = "rig.sensors.tension.offset='3 N'"
Simulate = Annotated[
    bool, typer.Option("--simulate", help="Apply each true value to simulated sensors instead of asking a person.")
]
Change = Annotated[
    list[str] | None, typer.Option("--set", metavar="PATH=VALUE", help=f"Change a value of the rig, such as {_FAULT}.")
]
Seed = Annotated[int, typer.Option(metavar="N", min=0, help="Random seed for sensor noise and reference errors.")]
Samples = Annotated[int, typer.Option(metavar="N", help="Number of samples averaged at each point.")]
Sensor = Annotated[str, typer.Option(metavar="TEXT", help="Serial number or name of the sensor.")]
Name = Annotated[str, typer.Option("--reference", metavar="TEXT", help="Name of the reference, such as 'M1 masses'.")]
Valid = Annotated[
    str | None,
    typer.Option(
        "--valid-for", metavar="TIME", help="Validity of the calibration, such as '365 day'; unlimited by default."
    ),
]
CALIBRATION = OutputKinds(calibration=SPECIMEN, result=OBJECT)
Out = Annotated[Paths, CALIBRATION.option(note="Entries of other channels of a calibration are kept.")]
Channels = Annotated[
    str, typer.Option("--channels", metavar="CHANNELS", help="Channels to calibrate, separated by commas.")
]
Own = Annotated[
    str | None,
    typer.Option(
        "--uncertainty", metavar="UNCERTAINTY", help="Standard uncertainty of each reference value, such as '1 kPa'."
    ),
]
Scale = Annotated[
    str,
    typer.Option(
        "--scale-uncertainty",
        metavar="SHARE",
        help="Standard uncertainty of a scale factor common to all reference values, such as '0.02 %'.",
    ),
]


def zero(
    rig: RigName,
    channel: Channels = "pressure,tension",
    uncertainty: Own = None,
    machine: On = None,
    simulate: Simulate = False,
    change: Change = None,
    seed: Seed = 0,
    samples: Samples = 1000,
    sensor: Sensor = "",
    valid_for: Valid = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Calibrate the zeros of channels without load and pressure.

    $ mckibben calibrate zero --rig modern --simulate --out calibration.toml
    """
    wanted = _Wanted(rig, change, machine, simulate, seed, samples, sensor, valid_for, out, as_json)
    names = _names(channel)
    units = {"tension": "N"}
    if uncertainty is not None and len({units.get(n, "Pa") for n in names}) > 1:
        raise InputError("--uncertainty", None, "is allowed only for channels of one unit at a time: say --channels")
    standard_uncertainty = _value("--uncertainty", uncertainty, units.get(names[0], "Pa"))
    with _session(wanted, None) as session:
        _done(wanted, session, session.zero(names, uncertainty=standard_uncertainty))


def weights(
    rig: RigName,
    masses: Annotated[str, typer.Option(metavar="MASSES", help="Two or more masses, such as '0 kg,1 kg,5 kg'.")],
    uncertainty: Own = None,
    gravity: Annotated[
        str | None,
        typer.Option(
            metavar="ACCELERATION",
            help="Local acceleration of gravity, such as '9.807 m/s^2'; by default the standard value to 0.15 %.",
        ),
    ] = None,
    gravity_uncertainty: Annotated[
        str | None, typer.Option(metavar="UNCERTAINTY", help="Standard uncertainty of --gravity.")
    ] = None,
    channel: Annotated[
        str, typer.Option("--channel", metavar="CHANNEL", help="Name of the load cell's channel.")
    ] = "tension",
    machine: On = None,
    simulate: Simulate = False,
    change: Change = None,
    seed: Seed = 0,
    samples: Samples = 1000,
    sensor: Sensor = "",
    reference: Name = "masses",
    valid_for: Valid = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Calibrate a load cell with dead weights, up and down.

    $ mckibben calibrate weights --rig modern --simulate --masses '0 kg,1 kg,5 kg' --out calibration.toml
    """
    wanted = _Wanted(rig, change, machine, simulate, seed, samples, sensor, valid_for, out, as_json)
    standard_uncertainty = _value("--uncertainty", uncertainty, "kg")
    if gravity is None and gravity_uncertainty is not None:
        raise InputError("--gravity-uncertainty", None, "is allowed only beside --gravity")
    g = calibrating.estimate.GRAVITY if gravity is None else _value("--gravity", gravity, "m/s^2", 9.7, 9.9)
    of_g = (
        calibrating.estimate.GRAVITY_UNCERTAINTY
        if gravity is None
        else _value("--gravity-uncertainty", gravity_uncertainty, "m/s^2")
    )
    # what is simulated hangs at standard gravity, unless it is said how far that is known
    simulated = calibrating.estimate.Reference(
        reference, standard_uncertainty * g, 0.0 if gravity is None else of_g / g, exact_nothing=True
    )
    with _session(wanted, simulated) as session:
        outcome = session.weights(
            _values("--masses", masses, "kg"),
            uncertainty=standard_uncertainty,
            gravity=g,
            gravity_uncertainty=of_g,
            name=reference,
            channel=channel,
        )
        _done(wanted, session, outcome)


def pressure(
    rig: RigName,
    pressures: Annotated[
        str, typer.Option(metavar="PRESSURES", help="Two or more gauge pressures, such as '0 bar,3 bar,6 bar'.")
    ],
    uncertainty: Own = None,
    scale_uncertainty: Scale = "0 %",
    channel: Channels = "pressure",
    machine: On = None,
    simulate: Simulate = False,
    change: Change = None,
    seed: Seed = 0,
    samples: Samples = 1000,
    sensor: Sensor = "",
    reference: Name = "reference gauge",
    valid_for: Valid = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Calibrate pressure sensors with a reference gauge.

    $ mckibben calibrate pressure --rig modern --simulate --pressures '0 bar,3 bar,6 bar' --out calibration.toml
    """
    wanted = _Wanted(rig, change, machine, simulate, seed, samples, sensor, valid_for, out, as_json)
    share = _value("--scale-uncertainty", scale_uncertainty, "1", 0.0, 1.0)
    gauge = calibrating.estimate.Reference(reference, _value("--uncertainty", uncertainty, "Pa"), share)
    with _session(wanted, gauge) as session:
        _done(wanted, session, session.pressure(_values("--pressures", pressures, "Pa"), gauge, _names(channel)))


def encoder(
    rig: RigName,
    travels: Annotated[str, typer.Option(metavar="LENGTHS", help="Two or more travels, such as '0 mm,50 mm'.")],
    uncertainty: Own = None,
    scale_uncertainty: Scale = "0 %",
    machine: On = None,
    simulate: Simulate = False,
    change: Change = None,
    seed: Seed = 0,
    samples: Samples = 100,
    sensor: Sensor = "",
    reference: Name = "gauge blocks",
    valid_for: Valid = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Calibrate the encoder with known travels, such as those of gauge blocks.

    The gain is metres per count relative to the nominal value.

    $ mckibben calibrate encoder --rig paper --simulate --travels '0 mm,50 mm' --out calibration.toml
    """
    wanted = _Wanted(rig, change, machine, simulate, seed, samples, sensor, valid_for, out, as_json)
    share = _value("--scale-uncertainty", scale_uncertainty, "1", 0.0, 1.0)
    blocks = calibrating.estimate.Reference(reference, _value("--uncertainty", uncertainty, "m"), share)
    with _session(wanted, blocks) as session:
        _done(wanted, session, session.encoder(_values("--travels", travels, "m"), blocks))


def skew(
    rig: RigName,
    channel: Channels = "pressure,tension",
    frequency: Annotated[
        str, typer.Option(metavar="FREQUENCY", help="Frequency of the sine, or of a sweep at its beginning.")
    ] = "20 Hz",
    to: Annotated[
        str | None,
        typer.Option(metavar="FREQUENCY", help="Frequency of a linear sweep at the last sample, such as '100 Hz'."),
    ] = None,
    machine: On = None,
    simulate: Simulate = False,
    change: Change = None,
    seed: Seed = 0,
    samples: Samples = 5000,
    valid_for: Valid = None,
    out: Out = None,
    as_json: Json = False,
) -> None:
    """Calibrate the lag of channels behind the first one, from a common signal.

    $ mckibben calibrate skew --rig modern --simulate --channels pressure,tension --out calibration.toml
    """
    wanted = _Wanted(rig, change, machine, simulate, seed, samples, "", valid_for, out, as_json)
    first = _value("--frequency", frequency, "1/s", 1e-3, 1e6)
    last = None if to is None else _value("--to", to, "1/s", 1e-3, 1e6)
    with _session(wanted, None) as session:
        _done(wanted, session, session.skew(_names(channel), frequency=first, to=last))


class _Wanted(NamedTuple):
    """Options common to all sessions."""

    rig: str
    change: list[str] | None
    machine: str | None
    simulate: bool
    seed: int
    samples: int
    sensor: str
    valid_for: str | None
    out: list[Path] | None
    as_json: bool

    @property
    def file(self) -> Path | None:
        """The calibration file, if one is written."""
        return next((path for path in self.out or [] if path.suffix == ".toml"), None)


@contextmanager
def _session(
    wanted: _Wanted, reference: calibrating.estimate.Reference | None
) -> Iterator[calibrating.session.CalibrationSession]:
    """Open a session with its source of readings; errors of the file are reported before an operator is asked."""
    with CALIBRATION.files(wanted.out):
        pass  # the paths are checked before anybody is asked
    changes = pairs(wanted.change, "--set", _FAULT)
    for path, value in changes.items():
        if not path.startswith("rig."):
            raise InputError(f"--set {path}", value, f"must be a value of the rig, such as {_FAULT}")
    valid = (
        math.inf if wanted.valid_for is None else _value("--valid-for", wanted.valid_for, "s", 1.0, calibration.LONGEST)
    )
    rig = rig_file.rig(wanted.rig, {path.removeprefix("rig."): value for path, value in changes.items()})
    date = provenance.created()
    if wanted.file is not None:
        calibration_file.merged(wanted.file, rig.name, {}, date)
    with _source(wanted, rig, reference) as (source, ask, again):
        yield calibrating.session.CalibrationSession(
            source=source,
            ask=ask,
            date=date,
            valid_for=valid,
            sensor=wanted.sensor,
            samples=wanted.samples,
            again=again,
        )


@contextmanager
def _source(
    wanted: _Wanted, rig: Rig, reference: calibrating.estimate.Reference | None
) -> Iterator[tuple[Source, Ask, Any]]:
    """Open the source of readings, the operator who sets the points, and a function that reports refused points."""
    if wanted.simulate:
        if wanted.machine is not None:
            raise InputError("--on", None, "is allowed only without --simulate")
        sensors = calibrating.session.SimulatedSensors(rig, wanted.seed)
        yield sensors, calibrating.session.SimulatedPerson(sensors, reference, wanted.seed), None
        return
    if wanted.machine is None:
        raise InputError("--on", None, "is missing: give --on MACHINE or --simulate")
    if not sys.stdin.isatty():
        raise InputError(
            "terminal", None, "is missing: nobody can be asked for the points; run it in a terminal, or with --simulate"
        )

    hardware.backends.check_connection(wanted.machine)
    with hardware.backends.connected(wanted.machine, rig, calibrating.session.PERIOD) as machine:
        assert machine is not None
        with calibrating.session.HardwareReadings(
            machine, rig.converters(0.0), scales=calibrating.session.grids(rig)
        ) as readings:
            yield readings, ask_person, tell_person


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


def _done(wanted: _Wanted, session: calibrating.session.CalibrationSession, outcome: CalibrationOutcome) -> None:
    """Save and show the result."""
    name = rig_file.rig(wanted.rig).name
    notes = []
    if wanted.file is None:
        whole = calibration.Calibration(rig=name, created=session.date, corrections=outcome.corrections)
    else:
        before = calibration_file.merged(wanted.file, name, {}, session.date).corrections
        whole = calibration_file.merged(wanted.file, name, outcome.corrections, session.date)
        for channel, one in outcome.corrections.items():
            other = before[channel].sensor if channel in before else one.sensor
            if other and one.sensor and other != one.sensor:
                notes.append(f"{channel} was of the sensor {other}: what was known of it is dropped")
    with CALIBRATION.files(wanted.out) as files:
        files.write("calibration", lambda path: calibration_file.write_calibration(whole, path))
        content = _content(whole, outcome, wanted.file, notes)
        files.write_result(content)
        if wanted.as_json:
            print_json(content)
        else:
            _print(whole, outcome, wanted.file, notes)


def _content(
    whole: Calibration, outcome: CalibrationOutcome, out: Path | None, notes: list[str]
) -> dict[str, JsonValue]:
    """Convert the result of a session to JSON."""
    now = datetime.datetime.now(datetime.UTC)
    points = {
        name: [
            {"true": p.true, "indicated": p.reading.mean, "scatter": p.reading.scatter}
            | ({"residual": float(outcome.lines[name].residuals[i])} if name in outcome.lines else {})
            for i, p in enumerate(some)
        ]
        for name, some in outcome.points.items()
    }
    return {
        "file": None if out is None else str(out),
        "rig": whole.rig,
        "warnings": notes,
        "channels": {name: correction_content(one, now) for name, one in outcome.corrections.items()},
        "points": points,
        "hysteresis": {name: one.hysteresis for name, one in outcome.lines.items()},
        "misfit": {name: one.misfit for name, one in outcome.lines.items()},
    }


def _print(whole: Calibration, outcome: CalibrationOutcome, out: Path | None, notes: list[str]) -> None:
    """Print the result of a session."""
    rows = []
    for name, some in outcome.points.items():
        unit = outcome.corrections[name].unit
        for i, p in enumerate(some[:POINTS]):
            left = with_unit(float(outcome.lines[name].residuals[i]), unit, 3) if name in outcome.lines else ""
            rows.append([name, with_unit(p.true, unit, 6), with_unit(p.reading.mean, unit, 7), left])
    if rows:
        table("", ["channel", "true", "indicated", "left"], rows, right=[1, 2, 3])
        typer.echo("")
    terms = [
        [name, key, *term_and_interval(one, key)] for name, one in outcome.corrections.items() for key in one.terms
    ]
    table("", ["channel", "", "value", "+- 95 %"], terms, right=[2, 3])
    for name, line in outcome.lines.items():
        unit = outcome.corrections[name].unit
        words = f"from the line at most {with_unit(line.linearity, unit, 3)}"
        typer.echo(f"{name}: {words}, between up and down at most {with_unit(line.hysteresis, unit, 3)}.")
    for note in notes:
        typer.echo(f"Note: {note}")
    if out is not None:
        typer.echo(f"Written: {out}, of {', '.join(whole.corrections)}")


def _names(words: str) -> Sequence[str]:
    names = [n.strip() for n in words.split(",") if n.strip()]
    if not names or len(set(names)) < len(names):
        raise InputError("--channels", words, "must be names of channels, parted by commas, each once")
    return names


def _value(option: str, words: str | None, unit: str, low: float = 0.0, high: float = 1e9) -> float:
    """An option as SI; nothing if it is left out."""
    if words is None:
        return 0.0
    value = parse(words, unit, field=option)
    if not low <= value <= high:
        ends = with_unit(low, unit), with_unit(high, unit)
        span = f"{ends[0]} or more" if high == 1e9 else f"between {ends[0]} and {ends[1]}"
        raise InputError(option, words, f"must be {span}")
    return value


def _values(option: str, words: str, unit: str) -> Sequence[float]:
    """Parse several values to SI."""
    values = [parse(word, unit, field=option) for word in split_values(words, field=option)]
    if not values:
        raise InputError(option, words, "must be two different ones or more, parted by commas")
    return values
