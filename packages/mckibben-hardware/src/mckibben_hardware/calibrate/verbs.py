"""Sessions with a reference, asked as functions: each calibrates some channels of a rig, simulated or real."""

from __future__ import annotations

import functools
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from mckibben import verbs
from mckibben.answers import Answer, Column, Table
from mckibben.bench import hardware, rig_file
from mckibben.bench.rig import Rig
from mckibben.documents import JsonValue
from mckibben.errors import InputError
from mckibben.formats.columns import column_numbers, table_labels
from mckibben.formats.labels import converts, parse_header, plain_stem
from mckibben.formats.registry import load
from mckibben.formats.table import ForeignTable
from mckibben.quantities import in_si, to_si, with_unit
from mckibben.recordings import calibration, provenance
from mckibben.recordings.calibration import Calibration
from mckibben.recordings.calibration_file import VALUES, correction_dict, merged, shown_term, write_calibration
from mckibben.verbs import ParameterType

from . import estimate
from . import session as sources
from .estimate import Point, Reference, ReferenceReading
from .session import Ask, CalibrationOutcome, CalibrationSession

PLACE = f"{__name__}:calibrate_weights"  # whose session the others take as well
POINTS = 40  # rows of points that a person is shown
FAULT = "rig.sensors.tension.offset='3 N'"

MachineName = Annotated[str, ParameterType("MACHINE")]
Found = Callable[[CalibrationOutcome], "CalibratedChannels"]  # of the outcome of a session
ChannelNames = Annotated[Sequence[str] | str, ParameterType("CHANNELS")]
Words = Annotated[str, ParameterType("TEXT")]
Uncertainty = Annotated[float | str, ParameterType("UNCERTAINTY")]
Session = Annotated[
    Mapping[str, Any],
    ParameterType(
        "SESSION",
        parts=(
            "mckibben_hardware.calibrate.verbs:calibrate_zero",
            ("rig", "machine", "simulate", "changes", "seed", "sensor", "valid_for", "file", "ask", "again"),
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

    def save(self, path: Path) -> Path:
        """Write the calibration as a TOML file."""
        return write_calibration(self.whole, path)

    def to_dict(self) -> dict[str, JsonValue]:
        """Corrections with their intervals, the points [SI], and how far these are from their lines."""
        at, outcome = calibration.moment(self.whole.created), self.outcome
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
            "channels": {name: correction_dict(one, at) for name, one in outcome.corrections.items()},
            "points": points,
            "hysteresis": {name: one.hysteresis for name, one in outcome.lines.items()},
            "misfit": {name: one.misfit for name, one in outcome.lines.items()},
        }

    def tables(self) -> list[Table]:
        """The points, and the terms of each channel."""
        points, lines = [], self.outcome.lines
        for name, some in self.outcome.points.items():
            unit = self.outcome.corrections[name].unit
            for i, p in enumerate(some[:POINTS]):
                row = {"true": with_unit(p.true, unit, 6), "indicated": with_unit(p.reading.mean, unit, 7)}
                row |= {"left": with_unit(float(lines[name].residuals[i]), unit, 3)} if name in lines else {}
                points.append({"channel": name} | row)
        numbers = (Column(key, right=True) for key in ("true", "indicated", "left"))
        known = self.outcome.corrections.items()
        terms = [{"channel": name, "term": key} | shown_term(one, key) for name, one in known for key in one.terms]
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


@contextmanager
def _opened(
    session: Mapping[str, Any], samples: int, reference: Reference | None
) -> Iterator[tuple[CalibrationSession, Found]]:
    """A session with its source of readings, and what joins its result with that of its file."""
    known = [part.name for part in verbs.described(PLACE).parameters["session"].parts]
    if (other := next((name for name in session if name not in known), None)) is not None:
        raise InputError("session", str(other), known=known)
    if (named := session.get("rig")) is None:
        raise InputError("rig", None, "is missing: paper, modern, or a .toml file")
    changes = dict(session.get("changes") or {})
    for path, value in changes.items():
        if not path.startswith("rig."):
            raise InputError(f"changes.{path}", value, f"must be a value of the rig, such as {FAULT}")
    if changes and isinstance(named, Rig):
        raise InputError("changes", None, "are allowed only of a rig that is named")
    valid = session.get("valid_for")
    valid_for = math.inf if valid is None else _within("valid_for", valid, "s", 1.0, calibration.LONGEST)
    changes = {path.removeprefix("rig."): str(value) for path, value in changes.items()}
    rig = named if isinstance(named, Rig) else rig_file.rig(named, changes)
    date, file, ask = provenance.created(), session.get("file"), session.get("ask")
    if file is not None:
        merged(file, rig.name, {}, date)  # refused before anybody is asked
    found = functools.partial(_found, rig.name, date, file)
    begin = functools.partial(
        CalibrationSession, date=date, valid_for=valid_for, sensor=session.get("sensor") or "", samples=samples
    )
    machine, seed = session.get("machine"), int(session.get("seed") or 0)
    if session.get("simulate"):
        if machine is not None:
            raise InputError("machine", None, "is allowed only without {simulate}")
        simulated = sources.SimulatedSensors(rig, seed)
        person = sources.SimulatedPerson(simulated, reference, seed)
        yield begin(source=simulated, ask=person), found
        return
    if machine is None:
        raise InputError("machine", None, "is missing: give {machine} MACHINE or {simulate=True}")
    if ask is None:
        raise InputError("ask", None, "is missing: a function that has an operator set each point")
    hardware.backends.check_connection(machine)
    with hardware.backends.connected(machine, rig, sources.PERIOD) as opened:
        assert opened is not None
        with sources.HardwareReadings(opened, rig.converters(0.0), sources.grids(rig)) as readings:
            yield begin(source=readings, ask=ask, again=session.get("again")), found


def _found(rig: str, date: str, file: Path | None, outcome: CalibrationOutcome) -> CalibratedChannels:
    """The result of a session, joined with what its file had."""
    if file is None:
        return CalibratedChannels(Calibration(rig=rig, created=date, corrections=outcome.corrections), outcome)
    before, notes = merged(file, rig, {}, date).corrections, []
    for channel, one in outcome.corrections.items():
        other = before[channel].sensor if channel in before else one.sensor
        if other and one.sensor and other != one.sensor:
            notes.append(f"{channel} was of the sensor {other}: what was known of it is dropped")
    return CalibratedChannels(merged(file, rig, outcome.corrections, date), outcome, file, tuple(notes))


def _within(field: str, value: Any, unit: str, low: float = 0.0, high: float = 1e9) -> float:
    """A value in its bounds [SI]; nothing where it is left out."""
    if value is None:
        return 0.0
    number = float(in_si(value, unit, field=field))
    if not low <= number <= high:
        ends = with_unit(low, unit), with_unit(high, unit)
        span = f"{ends[0]} or more" if high == 1e9 else f"between {ends[0]} and {ends[1]}"
        raise InputError(field, verbs.typed(value) or value, f"must be {span}")
    return number


def _several(field: str, values: Any) -> list[float]:
    if not values:
        raise InputError(field, verbs.typed(values), "must be two different ones or more, parted by commas")
    return [float(one) for one in values]


def _names(channels: Sequence[str] | str) -> list[str]:
    parts = channels.split(",") if isinstance(channels, str) else channels
    names = [n.strip() for n in parts if n.strip()]
    if not names or len(set(names)) < len(names):
        raise InputError("channels", str(channels), "must be names of channels, parted by commas, each once")
    return names


@verbs.verb
def calibrate_zero(
    *,
    rig: verbs.RigName,
    channels: ChannelNames = "pressure,tension",
    uncertainty: Uncertainty | None = None,
    machine: MachineName | None = None,
    simulate: bool = False,
    changes: verbs.Changes | None = None,
    seed: verbs.Seed = 0,
    samples: verbs.Count = 1000,
    sensor: Words = "",
    valid_for: verbs.Duration | None = None,
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
        >>> from mckibben_hardware.calibrate.verbs import calibrate_zero
        >>> answer = calibrate_zero(rig="modern", channels="valve_pressure", simulate=True)
        >>> list(answer.outcome.corrections)
        ['valve_pressure']
    """
    names, units = _names(channels), {"tension": "N"}
    if uncertainty is not None and len({units.get(n, "Pa") for n in names}) > 1:
        raise InputError("uncertainty", None, "is allowed only for channels of one unit at a time: say {channels}")
    standard = _within("uncertainty", uncertainty, units.get(names[0], "Pa"))
    session = {
        "rig": rig, "machine": machine, "simulate": simulate, "changes": changes,
        "seed": seed, "sensor": sensor, "valid_for": valid_for, "file": file, "ask": ask, "again": again,
    }  # fmt: skip
    with _opened(session, samples, None) as (opened, found):
        return found(opened.zero(names, uncertainty=standard))


@verbs.verb
def calibrate_weights(
    *,
    session: Session,
    masses: verbs.Masses,
    uncertainty: Uncertainty | None = None,
    gravity: verbs.Acceleration | None = None,
    gravity_uncertainty: Uncertainty | None = None,
    channel: verbs.ChannelName = "tension",
    samples: verbs.Count = 1000,
    reference: Words = "masses",
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
    of_cell = {"uncertainty": standard, "gravity": g, "gravity_uncertainty": of_g}
    with _opened(session, samples, simulated) as (opened, found):
        return found(opened.weights(_several("masses", masses), name=reference, channel=channel, **of_cell))


@verbs.verb
def calibrate_pressure(
    *,
    session: Session,
    pressures: verbs.Pressures | None = None,
    readings: verbs.DataFile | None = None,
    uncertainty: Uncertainty | None = None,
    scale_uncertainty: verbs.Share = "0 %",
    channels: ChannelNames = "pressure",
    samples: verbs.Count = 1000,
    reference: Words = "reference gauge",
) -> CalibratedChannels:
    r"""Calibrate pressure sensors with a reference gauge, whose points are set now or were read before.

    Args:
        pressures: two or more gauge pressures that are set now [Pa], such as '0 bar,3 bar,6 bar'.
        readings: table of readings already taken, of any format: a column reference, and one of each channel.
        session: rig, machine and what else `calibrate_zero` says of a session, such as ``{"rig": "modern"}``.
        uncertainty: standard uncertainty of each reference value, such as '1 kPa'.
        scale_uncertainty: standard uncertainty of a scale factor common to all reference values, such as '0.02 %'.
        channels: channels to calibrate, separated by commas.
        samples: number of samples averaged at each point.
        reference: name of the reference, such as 'WIKA CPG1500'.

    Raises:
        InputError: a value does not fit, a point is refused, or the table lacks a column.

    Examples:
        >>> from pathlib import Path
        >>> _ = Path("gauge.csv").write_text("reference [bar],pressure [bar]\n0,0.02\n3,3.05\n6,6.08\n3,3.05\n")
        >>> answer = calibrate_pressure(session={"rig": "modern"}, readings="gauge.csv")
        >>> round(answer.whole.corrections["pressure"].terms["zero"].value)  # of 6 bar on 6.06 bar
        2000
    """
    share = _within("scale_uncertainty", scale_uncertainty, "1", 0.0, 1.0)
    gauge = Reference(reference, _within("uncertainty", uncertainty, "Pa"), share)
    if readings is None:
        with _opened(session, samples, gauge) as (opened, found):
            return found(opened.pressure(_several("pressures", pressures), gauge, _names(channels)))
    for name, value in (
        ("pressures", pressures),
        ("simulate", session.get("simulate")),
        ("machine", session.get("machine")),
    ):
        if value:
            raise InputError(name, None, "is allowed only without {readings}, which were taken before")
    points = _taken(readings, _names(channels))
    # of which only the scales are asked
    with _opened({**session, "simulate": True}, samples, gauge) as (opened, found):
        answer = found(opened.taken_pressures(points, gauge))
    once = [name for name, some in points.items() if len({p.setting for p in some}) == len(some)]
    said = [f"{name} was read once at each pressure, so its uncertainty has no hysteresis" for name in once]
    return replace(answer, notes=(*answer.notes, *said))


REFERENCES = ("reference", "true", "gauge", "standard", "referenz", "referenzdruck", "normal", "soll", "etalon")


def _taken(file: Any, channels: Sequence[str]) -> dict[str, list[Point]]:
    """Points of each channel in a table of gauge pressures: its column, and that of the reference [Pa]."""
    where, table = str(file), load(Path(file))
    if not isinstance(table, ForeignTable):
        raise InputError("readings", None, "must be a table with a row for each reading", where=where)
    columns = {}
    for at, (label, column) in enumerate(zip(table_labels(table), table.columns, strict=True)):
        stem, source = parse_header(at, label)
        if source.unit is not None and converts(source.unit, "Pa"):
            if source.reference == "absolute":
                raise InputError(label, None, "must be a gauge pressure; the sensors are calibrated in it", where=where)
            scale = to_si(1.0, source.unit, "Pa", field=label, where=where)
            columns[plain_stem(stem)] = scale * column_numbers(column, table.rows, where)
    of_reference = [name for name in columns if name in REFERENCES]
    if len(of_reference) != 1 or any(channel not in columns for channel in channels):
        needs = f"a column reference and one of each channel ({', '.join(channels)}), in a unit of pressure"
        raise InputError("readings", ", ".join(table_labels(table)), f"must have {needs}", where=where)
    true = columns[of_reference[0]]
    return {
        name: [
            Point(float(t), float(t), ReferenceReading(float(r), 0.0, 0.0, 1.0))
            for t, r in zip(true, columns[name], strict=True) if math.isfinite(t) and math.isfinite(r)
        ]
        for name in channels
    }  # fmt: skip


@verbs.verb
def calibrate_encoder(
    *,
    session: Session,
    travels: verbs.Lengths,
    uncertainty: Uncertainty | None = None,
    scale_uncertainty: verbs.Share = "0 %",
    samples: verbs.Count = 100,
    reference: Words = "gauge blocks",
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
    """
    share = _within("scale_uncertainty", scale_uncertainty, "1", 0.0, 1.0)
    blocks = Reference(reference, _within("uncertainty", uncertainty, "m"), share)
    with _opened(session, samples, blocks) as (opened, found):
        return found(opened.encoder(_several("travels", travels), blocks))


@verbs.verb
def calibrate_skew(
    *,
    session: Session,
    channels: ChannelNames = "pressure,tension",
    frequency: verbs.Frequency = "20 Hz",
    to: verbs.Frequency | None = None,
    samples: verbs.Count = 5000,
) -> CalibratedChannels:
    """Calibrate the lag of channels behind the first one, from a common signal.

    Args:
        session: rig, machine and what else `calibrate_zero` says of a session, such as ``{"rig": "modern"}``.
        channels: channels to calibrate, separated by commas.
        frequency: frequency of the sine, or of a sweep at its beginning [1/s].
        to: frequency of a linear sweep at the last sample [1/s], such as '100 Hz'.
        samples: number of samples averaged at each point.
    """
    first = _within("frequency", frequency, "1/s", 1e-3, 1e6)
    last = None if to is None else _within("to", to, "1/s", 1e-3, 1e6)
    with _opened(session, samples, None) as (opened, found):
        return found(opened.skew(_names(channels), frequency=first, to=last))
