"""Calibrations of a rig's channels: sessions with a reference, what a file of them holds, and recordings with another."""

from __future__ import annotations

import datetime
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from .. import recordings
from ..answers import Answer, Column, Table
from ..bench import hardware, rig_file
from ..bench.calibrate import estimate, sources
from ..bench.calibrate.estimate import Reference
from ..bench.calibrate.session import CalibrationOutcome, CalibrationSession, merged, read_calibration
from ..bench.calibrate.sources import Ask
from ..bench.rig import Rig
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import in_si, with_unit
from ..recordings import Recording, calibration, provenance
from ..recordings.calibration import Calibration, Correction
from ..verbs import (
    Changes,
    Count,
    Duration,
    Frequency,
    MachineName,
    ParameterType,
    RecordingFile,
    RigName,
    Seed,
    typed,
    verb,
)

POINTS = 40  # rows of points that a person is shown
UNITS = {"gain": "1", "skew": "s"}  # that of the channel for the rest
FAULT = "rig.sensors.tension.offset='3 N'"

CalibrationFile = Annotated[Any, ParameterType("CALIBRATION")]
CalibrationOrRecording = Annotated[Any, ParameterType("CALIBRATION|RECORDING")]
ChannelNames = Annotated[Sequence[str] | str, ParameterType("CHANNELS")]
OneChannel = Annotated[str, ParameterType("CHANNEL")]
Words = Annotated[str, ParameterType("TEXT")]
Uncertainty = Annotated[float | str, ParameterType("UNCERTAINTY")]
Share = Annotated[float | str, ParameterType("SHARE", "1", (1e-9, 2.0))]
Masses = Annotated[Sequence[float | str] | str, ParameterType("MASSES", "kg", (1e-3, 2e3), listed=True)]
Pressures = Annotated[Sequence[float | str] | str, ParameterType("PRESSURES", "Pa", (1e3, 3e6), listed=True)]
Travels = Annotated[Sequence[float | str] | str, ParameterType("LENGTHS", "m", (1e-4, 20.0), listed=True)]
Gravity = Annotated[float | str, ParameterType("ACCELERATION", "m/s^2", (1.0, 30.0))]
Session = Annotated[
    Mapping[str, Any],
    ParameterType(
        "SESSION",
        parts=(
            "studies.calibrations:calibrate_zero",
            ("rig", "machine", "simulate", "changes", "seed", "sensor", "valid_for"),
        ),
    ),
]


@dataclass(frozen=True)
class CalibratedChannels(Answer):
    """What a session with a reference found: what `calibrate_zero` and the other sessions compute.

    Attributes:
        whole: the calibration, with the entries of other channels that its file had.
        outcome: corrections by channel, their lines and points.
        file: of the calibration; None where there is none.
        notes: what was dropped of the file.
    """

    whole: Calibration
    outcome: CalibrationOutcome
    file: Path | None = None
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """Corrections with their intervals, the points [SI], and how far these are from their lines."""
        now, outcome = _now(), self.outcome
        points = {
            name: [
                {"true": p.true, "indicated": p.reading.mean, "scatter": p.reading.scatter}
                | ({"residual": float(outcome.lines[name].residuals[i])} if name in outcome.lines else {})
                for i, p in enumerate(some)
            ]
            for name, some in outcome.points.items()
        }
        return {
            "file": None if self.file is None else str(self.file),
            "rig": self.whole.rig,
            "warnings": list(self.notes),
            "channels": {name: _to_dict(one, now) for name, one in outcome.corrections.items()},
            "points": points,
            "hysteresis": {name: one.hysteresis for name, one in outcome.lines.items()},
            "misfit": {name: one.misfit for name, one in outcome.lines.items()},
        }

    def tables(self) -> list[Table]:
        """The points, and the terms of each channel."""
        points = []
        for name, some in self.outcome.points.items():
            unit = self.outcome.corrections[name].unit
            for i, p in enumerate(some[:POINTS]):
                left = (
                    with_unit(float(self.outcome.lines[name].residuals[i]), unit, 3)
                    if name in self.outcome.lines
                    else ""
                )
                row = {"true": with_unit(p.true, unit, 6), "indicated": with_unit(p.reading.mean, unit, 7)}
                points.append({"channel": name, "left": left} | row)
        numbers = (Column(key, right=True) for key in ("true", "indicated", "left"))
        terms = [
            {"channel": name, "term": key} | _shown(one, key)
            for name, one in self.outcome.corrections.items()
            for key in one.terms
        ]
        told = Table("", (Column("channel"), *numbers), points)
        return [*([told] if points else []), Table("", (Column("channel"), Column("term", ""), *VALUES), terms)]

    def remarks(self) -> list[str]:
        """How far points are from the lines, and what was dropped."""
        said = []
        for name, line in self.outcome.lines.items():
            unit = self.outcome.corrections[name].unit
            words = f"from the line at most {with_unit(line.linearity, unit, 3)}"
            said.append(f"{name}: {words}, between up and down at most {with_unit(line.hysteresis, unit, 3)}.")
        said += [f"Note: {note}" for note in self.notes]
        return said + ([] if self.file is None else [f"The calibration is of {', '.join(self.whole.corrections)}."])


VALUES = (Column("value", right=True), Column("half", "+- 95 %", right=True))


def _shown(one: Correction, key: str) -> dict[str, str]:
    """Value of a term and half its interval, as a person reads them."""
    term = one.terms[key]
    low, high = term.interval()
    if key == "skew":
        return {"value": f"{1e6 * term.value:.5g} us", "half": f"{5e5 * (high - low):.2g} us"}
    unit = UNITS.get(key, one.unit)
    return {"value": with_unit(term.value, unit, 7), "half": with_unit(0.5 * (high - low), unit, 2)}


def _to_dict(one: Correction, now: datetime.datetime) -> dict[str, JsonValue]:
    """Every term of a correction with its interval, its origin and whether it has expired."""
    over = one.expired(now)
    content: dict[str, Any] = {name: getattr(one, name) for name in ("unit", "sensor", "correlation", "linearity")}
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
        content[key] = {**number, "unit": UNITS.get(key, one.unit), "expired": key in over, **origin}
    return content


def _now() -> datetime.datetime:
    return datetime.datetime.now(datetime.UTC)


# ---- sessions


@contextmanager
def _opened(
    session: Mapping[str, Any],
    samples: int,
    reference: Reference | None,
    file: Path | None,
    ask: Ask | None,
    again: Callable[[InputError], None] | None,
) -> Iterator[tuple[CalibrationSession, Rig]]:
    """A session with its source of readings, and its rig; files and values are refused before anybody is asked."""
    changes = dict(session.get("changes") or {})
    for path, value in changes.items():
        if not path.startswith("rig."):
            raise InputError(f"changes.{path}", value, f"must be a value of the rig, such as {FAULT}")
    valid = session.get("valid_for")
    valid_for = math.inf if valid is None else _within("valid_for", valid, "s", 1.0, calibration.LONGEST)
    named = session["rig"]
    rig = named if isinstance(named, Rig) else rig_file.rig(named)
    changes = {path.removeprefix("rig."): str(value) for path, value in changes.items()}
    rig = rig_file.rig(named, changes) if changes else rig
    date = provenance.created()
    if file is not None:
        merged(file, rig.name, {}, date)
    stated = {"date": date, "valid_for": valid_for, "sensor": session.get("sensor") or "", "samples": samples}
    machine, seed = session.get("machine"), int(session.get("seed") or 0)
    if session.get("simulate"):
        if machine is not None:
            raise InputError("machine", None, "is allowed only without {simulate}")
        simulated = sources.SimulatedSensors(rig, seed)
        person = sources.SimulatedPerson(simulated, reference, seed)
        yield CalibrationSession(source=simulated, ask=person, **stated), rig
        return
    if machine is None:
        raise InputError("machine", None, "is missing: give {machine} MACHINE or {simulate=True}")
    if ask is None:
        raise InputError("ask", None, "is missing: a function that has an operator set each point")
    hardware.backends.check_connection(machine)
    with hardware.backends.connected(machine, rig, sources.PERIOD) as opened:
        assert opened is not None
        with sources.HardwareReadings(opened, rig.converters(0.0), scales=sources.grids(rig)) as readings:
            yield CalibrationSession(source=readings, ask=ask, again=again, **stated), rig


def _found(session: CalibrationSession, rig: Rig, outcome: CalibrationOutcome, file: Path | None) -> CalibratedChannels:
    """The result of a session, joined with what its file had."""
    if file is None:
        whole = Calibration(rig=rig.name, created=session.date, corrections=outcome.corrections)
        return CalibratedChannels(whole, outcome)
    before = merged(file, rig.name, {}, session.date).corrections
    notes = []
    for channel, one in outcome.corrections.items():
        other = before[channel].sensor if channel in before else one.sensor
        if other and one.sensor and other != one.sensor:
            notes.append(f"{channel} was of the sensor {other}: what was known of it is dropped")
    return CalibratedChannels(merged(file, rig.name, outcome.corrections, session.date), outcome, file, tuple(notes))


def _within(field: str, value: Any, unit: str, low: float = 0.0, high: float = 1e9) -> float:
    """A value in its bounds [SI]; nothing where it is left out."""
    if value is None:
        return 0.0
    number = float(in_si(value, unit, field=field))
    if not low <= number <= high:
        ends = with_unit(low, unit), with_unit(high, unit)
        span = f"{ends[0]} or more" if high == 1e9 else f"between {ends[0]} and {ends[1]}"
        raise InputError(field, typed(value) or value, f"must be {span}")
    return number


def _several(field: str, values: Any) -> list[float]:
    if not values:
        raise InputError(field, typed(values), "must be two different ones or more, parted by commas")
    return [float(one) for one in values]


def _names(channels: Sequence[str] | str) -> list[str]:
    parts = channels.split(",") if isinstance(channels, str) else channels
    names = [n.strip() for n in parts if n.strip()]
    if not names or len(set(names)) < len(names):
        raise InputError("channels", str(channels), "must be names of channels, parted by commas, each once")
    return names


@verb
def calibrate_zero(
    *,
    rig: RigName,
    channels: ChannelNames = "pressure,tension",
    uncertainty: Uncertainty | None = None,
    machine: MachineName | None = None,
    simulate: bool = False,
    changes: Changes | None = None,
    seed: Seed = 0,
    samples: Count = 1000,
    sensor: Words = "",
    valid_for: Duration | None = None,
    file: Path | None = None,
    ask: Ask | None = None,
    again: Callable[[InputError], None] | None = None,
) -> CalibratedChannels:
    """Calibrate the zeros of channels without load and pressure.

    Args:
        rig: rig of the test machine: paper, modern, or a .toml file.
        channels: channels to calibrate, separated by commas.
        uncertainty: standard uncertainty of each reference value, such as '1 kPa'.
        machine: run on a real machine: serial:/dev/ttyACM0, or daq (wired as the rig file says).
        simulate: apply each true value to simulated sensors instead of asking a person.
        changes: change a value of the rig, such as rig.sensors.tension.offset='3 N'.
        seed: random seed for sensor noise and reference errors.
        samples: number of samples averaged at each point.
        sensor: serial number or name of the sensor.
        valid_for: validity of the calibration [s], such as '365 day'; unlimited by default.
        file: calibration whose entries of other channels are kept.
        ask: has an operator set a point; returns what the reference shows, or None if that is what was asked for.
        again: called with the error of a refused point, which is then requested again; without it the error is raised.

    Raises:
        InputError: a value does not fit, or a point is refused.

    Examples:
        >>> from mckibben.studies.calibrations import calibrate_zero
        >>> answer = calibrate_zero(rig="modern", channels="valve_pressure", simulate=True)
        >>> list(answer.outcome.corrections)
        ['valve_pressure']
    """
    session = {
        "rig": rig,
        "machine": machine,
        "simulate": simulate,
        "changes": changes,
        "seed": seed,
        "sensor": sensor,
        "valid_for": valid_for,
    }
    names, units = _names(channels), {"tension": "N"}
    if uncertainty is not None and len({units.get(n, "Pa") for n in names}) > 1:
        raise InputError("uncertainty", None, "is allowed only for channels of one unit at a time: say {channels}")
    standard = _within("uncertainty", uncertainty, units.get(names[0], "Pa"))
    with _opened(session, samples, None, file, ask, again) as (opened, on):
        return _found(opened, on, opened.zero(names, uncertainty=standard), file)


@verb
def calibrate_weights(
    *,
    session: Session,
    masses: Masses,
    uncertainty: Uncertainty | None = None,
    gravity: Gravity | None = None,
    gravity_uncertainty: Uncertainty | None = None,
    channel: OneChannel = "tension",
    samples: Count = 1000,
    reference: Words = "masses",
    file: Path | None = None,
    ask: Ask | None = None,
    again: Callable[[InputError], None] | None = None,
) -> CalibratedChannels:
    """Calibrate a load cell with dead weights, up and down.

    Args:
        masses: two or more masses [kg], such as '0 kg,1 kg,5 kg'.
        session: rig, machine and what else `calibrate_zero` says of a session, such as ``{"rig": "modern"}``.
        uncertainty: standard uncertainty of each reference value, such as '1 g'.
        gravity: local acceleration of gravity [m/s^2], such as '9.807 m/s^2'; by default the standard value to 0.15 %.
        gravity_uncertainty: standard uncertainty of the gravity that is stated.
        channel: name of the load cell's channel.
        samples: number of samples averaged at each point.
        reference: name of the reference, such as 'M1 masses'.
        file: calibration whose entries of other channels are kept.
        ask: has an operator set a point, as `calibrate_zero` has it.
        again: called with the error of a refused point, which is then requested again.

    Raises:
        InputError: a value does not fit, or a point is refused.
    """
    standard = _within("uncertainty", uncertainty, "kg")
    if gravity is None and gravity_uncertainty is not None:
        raise InputError("gravity_uncertainty", None, "is allowed only beside {gravity}")
    g, of_g = estimate.GRAVITY, estimate.GRAVITY_UNCERTAINTY
    if gravity is not None:
        g = _within("gravity", gravity, "m/s^2", 9.7, 9.9)
        of_g = _within("gravity_uncertainty", gravity_uncertainty, "m/s^2")
    # what is simulated hangs at standard gravity, unless it is said how far that is known
    scale = 0.0 if gravity is None else of_g / g
    simulated = Reference(reference, standard * g, scale, exact_nothing=True)
    with _opened(session, samples, simulated, file, ask, again) as (opened, on):
        outcome = opened.weights(
            _several("masses", masses),
            uncertainty=standard,
            gravity=g,
            gravity_uncertainty=of_g,
            name=reference,
            channel=channel,
        )
        return _found(opened, on, outcome, file)


@verb
def calibrate_pressure(
    *,
    session: Session,
    pressures: Pressures,
    uncertainty: Uncertainty | None = None,
    scale_uncertainty: Share = "0 %",
    channels: ChannelNames = "pressure",
    samples: Count = 1000,
    reference: Words = "reference gauge",
    file: Path | None = None,
    ask: Ask | None = None,
    again: Callable[[InputError], None] | None = None,
) -> CalibratedChannels:
    """Calibrate pressure sensors with a reference gauge.

    Args:
        pressures: two or more gauge pressures [Pa], such as '0 bar,3 bar,6 bar'.
        session: rig, machine and what else `calibrate_zero` says of a session, such as ``{"rig": "modern"}``.
        uncertainty: standard uncertainty of each reference value, such as '1 kPa'.
        scale_uncertainty: standard uncertainty of a scale factor common to all reference values, such as '0.02 %'.
        channels: channels to calibrate, separated by commas.
        samples: number of samples averaged at each point.
        reference: name of the reference, such as 'WIKA CPG1500'.
        file: calibration whose entries of other channels are kept.
        ask: has an operator set a point, as `calibrate_zero` has it.
        again: called with the error of a refused point, which is then requested again.

    Raises:
        InputError: a value does not fit, or a point is refused.
    """
    share = _within("scale_uncertainty", scale_uncertainty, "1", 0.0, 1.0)
    gauge = Reference(reference, _within("uncertainty", uncertainty, "Pa"), share)
    with _opened(session, samples, gauge, file, ask, again) as (opened, on):
        outcome = opened.pressure(_several("pressures", pressures), gauge, _names(channels))
        return _found(opened, on, outcome, file)


@verb
def calibrate_encoder(
    *,
    session: Session,
    travels: Travels,
    uncertainty: Uncertainty | None = None,
    scale_uncertainty: Share = "0 %",
    samples: Count = 100,
    reference: Words = "gauge blocks",
    file: Path | None = None,
    ask: Ask | None = None,
    again: Callable[[InputError], None] | None = None,
) -> CalibratedChannels:
    """Calibrate the encoder with known travels, such as those of gauge blocks.

    The gain is metres per count relative to the nominal value.

    Args:
        travels: two or more travels [m], such as '0 mm,50 mm'.
        session: rig, machine and what else `calibrate_zero` says of a session, such as ``{"rig": "modern"}``.
        uncertainty: standard uncertainty of each reference value, such as '1 um'.
        scale_uncertainty: standard uncertainty of a scale factor common to all reference values, such as '0.02 %'.
        samples: number of samples averaged at each point.
        reference: name of the reference, such as 'grade 1 blocks'.
        file: calibration whose entries of other channels are kept.
        ask: has an operator set a point, as `calibrate_zero` has it.
        again: called with the error of a refused point, which is then requested again.

    Raises:
        InputError: a value does not fit, or a point is refused.
    """
    share = _within("scale_uncertainty", scale_uncertainty, "1", 0.0, 1.0)
    blocks = Reference(reference, _within("uncertainty", uncertainty, "m"), share)
    with _opened(session, samples, blocks, file, ask, again) as (opened, on):
        return _found(opened, on, opened.encoder(_several("travels", travels), blocks), file)


@verb
def calibrate_skew(
    *,
    session: Session,
    channels: ChannelNames = "pressure,tension",
    frequency: Frequency = "20 Hz",
    to: Frequency | None = None,
    samples: Count = 5000,
    file: Path | None = None,
    ask: Ask | None = None,
    again: Callable[[InputError], None] | None = None,
) -> CalibratedChannels:
    """Calibrate the lag of channels behind the first one, from a common signal.

    Args:
        session: rig, machine and what else `calibrate_zero` says of a session, such as ``{"rig": "modern"}``.
        channels: channels to calibrate, separated by commas.
        frequency: frequency of the sine, or of a sweep at its beginning [1/s].
        to: frequency of a linear sweep at the last sample [1/s], such as '100 Hz'.
        samples: number of samples averaged at each point.
        file: calibration whose entries of other channels are kept.
        ask: has an operator set a point, as `calibrate_zero` has it.
        again: called with the error of a refused point, which is then requested again.

    Raises:
        InputError: a value does not fit, or a point is refused.
    """
    first = _within("frequency", frequency, "1/s", 1e-3, 1e6)
    last = None if to is None else _within("to", to, "1/s", 1e-3, 1e6)
    with _opened(session, samples, None, file, ask, again) as (opened, on):
        return _found(opened, on, opened.skew(_names(channels), frequency=first, to=last), file)


# ---- what a calibration holds, and what it makes of a recording


@dataclass(frozen=True)
class CalibrationDescription(Answer):
    """What a calibration holds: what `describe_calibration` finds.

    Attributes:
        calibration: values by channel.
        file: of it, or of the recording that carries it.
        at: time for which ages are stated.
    """

    calibration: Calibration
    file: str
    at: datetime.datetime

    def to_dict(self) -> dict[str, JsonValue]:
        """Every term with its interval, its origin and whether it has expired."""
        return {
            "file": self.file,
            "rig": self.calibration.rig,
            "created": self.calibration.created,
            "expired": list(self.calibration.expired(self.at)),
            "channels": {name: _to_dict(one, self.at) for name, one in self.calibration.corrections.items()},
        }

    def tables(self) -> list[Table]:
        """Values, 95 % intervals, origin and age."""
        rows = []
        for name, one in self.calibration.corrections.items():
            over = one.expired(self.at)
            for key, term in one.terms.items():
                row = {"channel": name, "term": key, "sensor": one.sensor, "over": "EXPIRED" if key in over else ""}
                if (origin := term.origin) is not None:
                    days = (self.at - calibration.moment(origin.date)).total_seconds() / 86400.0
                    row |= {"age": f"{days:.0f} days", "by": ", ".join(filter(None, (origin.method, origin.reference)))}
                    row |= {"until": "for ever" if origin.expires is None else f"{origin.expires:%Y-%m-%d}"}
                rows.append(row | _shown(one, key))
        origins = (Column("by"), Column("sensor"), Column("age"), Column("until", "valid until"), Column("over", ""))
        title = f"Calibration of the rig {self.calibration.rig}, {self.calibration.created}"
        return [Table(title, (Column("channel"), Column("term", ""), *VALUES, *origins), rows)]

    def remarks(self) -> list[str]:
        """What has expired."""
        return [f"Note: {sentence}" for sentence in self.calibration.expired(self.at)]


@verb
def describe_calibration(file: CalibrationOrRecording) -> CalibrationDescription:
    """Show a calibration: values, 95 % intervals, origin and age.

    Values that have expired are marked.

    Args:
        file: calibration file (.toml), or a recording that carries a calibration.

    Raises:
        InputError: the file cannot be read, or the recording carries none.
    """
    if isinstance(file, Calibration):
        return CalibrationDescription(file, "", _now())
    path = Path(file)
    if path.suffix.lower() == ".toml":
        return CalibrationDescription(read_calibration(path), str(file), _now())
    try:
        carried = calibration.carried(recordings.read_recording(path))
    except InputError as error:
        raise error if error.where == str(path) else error.at(str(path)) from None
    if carried is None:
        raise InputError("calibration", None, "is not in the recording", where=str(path))
    return CalibrationDescription(carried, str(file), _now())


@dataclass(frozen=True)
class RecalibratedRecording(Answer):
    """A recording with another calibration: what `apply_calibration` computes.

    Attributes:
        recording: the new one.
        source: file of the one before.
        changed: measured channels whose values are others now.
        notes: what the calibration has to be said of.
    """

    recording: Recording
    source: str
    changed: tuple[str, ...]
    notes: tuple[str, ...] = ()

    def to_dict(self) -> dict[str, JsonValue]:
        """Changed channels, and all of them in numbers [SI]."""
        meta = self.recording.meta
        return {
            "source": self.source,
            "changed": list(self.changed),
            "skew_corrected": meta.get("skew_corrected") or [],
            "warnings": list(self.notes),
            "summary": self.recording.summary(),
            "saturation": meta.get("saturation") or {},
        }

    def remarks(self) -> list[str]:
        """Which channels are others now, and what has to be said of the calibration."""
        changed = f"Against {self.source} changed are {', '.join(self.changed) or 'no channels'}."
        return [changed, *(f"Note: {note}" for note in self.notes)]


@verb
def apply_calibration(
    recording: RecordingFile, *, calibration: CalibrationFile | None = None, off: bool = False, skew: bool = False
) -> RecalibratedRecording:
    """Apply a calibration to a recording in place of the one it carries.

    The raw values can always be recovered.

    Args:
        recording: recording, with or without a calibration.
        calibration: calibration file to apply.
        off: remove the calibration that the recording carries.
        skew: also shift the channels by their skews.

    Raises:
        InputError: a file cannot be read, or the calibration is of another rig.
    """
    if off == (calibration is not None):
        problem = "is missing: give a file, or {off}" if calibration is None else "must be a file, or {off}"
        raise InputError("calibration", None if calibration is None else str(calibration), problem)
    if off and skew:
        raise InputError("skew", None, "is allowed only beside {calibration}")
    new = calibration if calibration is None or isinstance(calibration, Calibration) else read_calibration(calibration)
    known = recording if isinstance(recording, Recording) else recordings.read_recording(recording)
    try:
        done = recordings.calibration.recalibrate(known, new, skew=skew)
    except InputError as error:
        raise error.at(str(recording)) from None
    before = known.meta.get("warnings") or []
    notes = [w for w in done.meta.get("warnings") or [] if w not in before]
    if new is not None:
        notes += [s for s in new.expired(_now()) if s not in notes]
    changed = tuple(n for n in known.names("measured") if n in done and (done[n] != known[n]).any())
    return RecalibratedRecording(done, str(recording), changed, tuple(notes))
