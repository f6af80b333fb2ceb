"""Calibration sessions: an operator sets one point after the other, the sensors are read, and the points are fitted.

A point is refused, in one clear line, where its samples scatter too much, where they touch an end of the converter, and
where the reading did not follow the reference. What is then done, `again` says: without it the session ends.

A calibration is kept as a TOML file (schema 1): one table per channel, every value as text with its unit.

    schema = 1
    rig = "modern"
    created = "2026-03-31T12:00:00+00:00"
    [channels.tension]
    unit = "N"
    sensor = "S/N 123"
    correlation = 0.4                  # of gain and zero
    linearity = "0.02 N"               # largest departure of a point from the line
    [channels.tension.gain]            # also zero and skew, those that were determined
    value = 1.0023
    uncertainty = 0.0002               # standard
    degrees = 14.2                     # of freedom of that; infinitely many by default
    method = "weights"
    date = "2026-03-31T12:00:00+00:00"
    reference = "M1 masses"
    reference_uncertainty = "0.01 N"   # standard, of each of its values
    scale_uncertainty = 0.0015         # standard, of all of them alike
    valid_for = "365 day"              # for ever by default
    points = 7

The terms of a channel may come from different days; each says where it comes from.
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...documents import JsonValue, read_toml, write_text
from ...errors import InputError
from ...experiments.waveforms import Chirp, Sine
from ...quantities import with_unit
from ...recordings.calibration import (
    DAY,
    TERMS,
    Calibration,
    Correction,
    CorrectionTerm,
    Origin,
    correction_table,
    read_plain,
)
from ..hardware.converters import SPAN
from . import estimate
from .estimate import GRAVITY, CalibrationLine, Point, Reference, ReferenceReading, skew
from .sources import Ask, ChannelScale, OperatorTask, Source


def read_calibration(path: str | os.PathLike[str]) -> Calibration:
    """Read a calibration.

    Raises:
        InputError: names the file, the dotted path, the value and what is allowed; a newer schema is refused.
    """
    where = os.fspath(path)
    return read_plain(read_toml(path, field="calibration"), where=where, bare=False)


def write_calibration(calibration: Calibration, path: str | os.PathLike[str]) -> Path:
    """Write a calibration, atomically; it reads back exactly.

    Raises:
        InputError: the file cannot be written.
    """
    import tomlkit

    return write_text(path, tomlkit.dumps(document(calibration)), field="calibration")


def merged(path: Path, rig: str, corrections: Mapping[str, Correction], date: str) -> Calibration:
    """Return the calibration of a file, updated with new corrections; a new calibration if there is no such file.

    Raises:
        InputError: the file is of another rig, or cannot be read.
    """
    before = read_calibration(path) if path.exists() else Calibration(rig=rig, created=date)
    if before.rig != rig:
        raise InputError("rig", rig, f"the calibration is of {before.rig}; choose another file", where=str(path))
    return before.updated(corrections, date)


def document(calibration: Calibration) -> dict[str, JsonValue]:
    """Tables of a calibration file."""
    channels = {name: correction_table(one, bare=False) for name, one in calibration.corrections.items()}
    for table in channels.values():
        for term in TERMS:
            if term in table and "valid_for" in table[term]:
                days = float(table[term]["valid_for"].removesuffix(" s")) / DAY
                if days == round(days):
                    table[term]["valid_for"] = f"{days:.0f} day"
    return {**calibration.plain(), "channels": channels}


# ---- sessions


LEAST_FOLLOWED = 0.1  # of a step of the reference, that a reading has to make
LEAST_SAMPLES, MOST_SAMPLES = 16, 1_000_000


@dataclass(frozen=True)
class CalibrationOutcome:
    """Result of a calibration session: corrections by channel, their lines, and the points [SI]."""

    corrections: Mapping[str, Correction]
    lines: Mapping[str, CalibrationLine] = field(default_factory=dict)
    points: Mapping[str, Sequence[Point]] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class CalibrationSession:
    """Calibrates channels of a source of indicated readings.

    Args:
        source: the readings.
        ask: brings a task about; what the reference shows, or None if that is what was requested.
        date: in ISO 8601.
        valid_for: time for which it holds [s].
        sensor: serial number or name of the sensor.
        samples: that are averaged at each point.
        most_scatter: standard deviation of the samples of a point, as a share of the channel's range.
        again: called with the error of a refused point, which is then requested again; without it the error is raised.
    """

    source: Source
    ask: Ask
    date: str
    valid_for: float = math.inf
    sensor: str = ""
    samples: int = 1000
    most_scatter: float = 0.005
    again: Callable[[InputError], None] | None = None

    def __post_init__(self) -> None:
        if not LEAST_SAMPLES <= self.samples <= MOST_SAMPLES:
            raise InputError("samples", self.samples, f"must be a whole number from {LEAST_SAMPLES} to {MOST_SAMPLES}")

    def zero(self, channels: Sequence[str], *, uncertainty: float = 0.0) -> CalibrationOutcome:
        """Calibrate the zero of channels.

        `uncertainty` is the standard uncertainty of the true zero [unit of the channels].
        """
        grids = {name: self._grid(name) for name in channels}
        if SPAN in grids:
            raise InputError("channel", SPAN, "must be analogue channels; an encoder is zeroed where it is mounted")
        task = OperatorTask(f"take all load and pressure off: {_and(channels)} at zero", dict.fromkeys(channels, 0.0))
        readings, _ = self._read(task, channels, {})
        corrections = {}
        for name in channels:
            term = estimate.zero(readings[name], resolution=grids[name].resolution, uncertainty=uncertainty)
            origin = self._origin("zero", Reference("nothing", uncertainty), 1)
            corrections[name] = self._correction(grids[name].unit, {"zero": (term, origin)})
        points = {name: [Point(0.0, 0.0, readings[name])] for name in channels}
        return CalibrationOutcome(corrections, points=points)

    def weights(
        self,
        masses: Sequence[float],
        *,
        uncertainty: float = 0.0,
        gravity: float = GRAVITY,
        gravity_uncertainty: float = 0.0,
        name: str = "",
        channel: str = "tension",
    ) -> CalibrationOutcome:
        """Calibrate a load cell by masses [kg], up and down; standard uncertainties of each mass [kg] and of gravity."""
        _different("masses", masses, "kg", least=0.0)
        asked = [
            OperatorTask(f"hang {_mass(m)} on the cell" if m else "hang nothing on the cell", {channel: m * gravity})
            for m in masses
        ]
        points = self._points(dict(zip(masses, asked, strict=True)), [channel])[channel]
        grid = self._grid(channel)
        line = estimate.dead_weights(
            [(p.setting, p.reading) for p in points],
            resolution=grid.resolution,
            uncertainty=uncertainty,
            gravity=gravity,
            gravity_uncertainty=gravity_uncertainty,
        )
        reference = Reference(name, uncertainty * gravity, gravity_uncertainty / gravity)
        return self._outcome("weights", reference, {channel: line}, {channel: points})

    def pressure(self, pressures: Sequence[float], reference: Reference, channels: Sequence[str]) -> CalibrationOutcome:
        """Calibrate pressure sensors with a reference gauge, at gauge pressures [Pa], up and down again."""
        _different("pressures", pressures, "Pa")
        asked = {
            p: OperatorTask(f"set the pressure to {with_unit(p, 'Pa')}", dict.fromkeys(channels, p), True)
            for p in pressures
        }
        points = self._points(asked, channels)
        lines = {
            n: estimate.pressure_reference(points[n], resolution=self._grid(n).resolution, reference=reference)
            for n in channels
        }
        return self._outcome("pressure", reference, lines, points)

    def encoder(self, travels: Sequence[float], reference: Reference) -> CalibrationOutcome:
        """Calibrate the encoder by known travels [m], such as of gauge blocks; only the gain is determined."""
        _different("travels", travels, "m")
        asked = {x: OperatorTask(f"move the end to the travel {with_unit(x, 'm', 6)}", {SPAN: x}) for x in travels}
        points = self._points(asked, [SPAN])
        line = estimate.encoder(points[SPAN], resolution=self._grid(SPAN).resolution, reference=reference)
        return self._outcome("encoder", reference, {SPAN: line}, points, ("gain",))

    def skew(self, channels: Sequence[str], *, frequency: float, to: float | None = None) -> CalibrationOutcome:
        """Determine the delays of channels behind the first one, from a common sine or linear sweep of frequency [Hz]."""
        grids = {name: self._grid(name) for name in channels}
        if len(grids) < 2:
            raise InputError("channels", ", ".join(grids), "must be two or more, for one is compared with another")
        duration = self.samples * self.source.period
        wave = (
            Sine(amplitude=1.0, frequency=frequency)
            if to is None
            else Chirp(amplitude=1.0, first=frequency, last=to, duration=duration)
        )
        wave_text = f"a sine of {frequency:g} Hz" if to is None else f"a sweep from {frequency:g} Hz to {to:g} Hz"
        self.ask(OperatorTask(f"let {_and(channels)} see {wave_text}", {}, wave=wave))
        samples = self.source.read(self.samples)
        for name in channels:
            _off_rails(name, np.asarray(samples[name]), grids[name])
        time = self.source.period * np.arange(self.samples)
        resolution = {name: grids[name].resolution for name in channels}
        terms = skew(time, {n: samples[n] for n in channels}, frequency=frequency, to=to, resolution=resolution)
        origin = self._origin("skew", Reference(f"{channels[0]}, {wave_text}"), self.samples)
        corrections = {n: self._correction(grids[n].unit, {"skew": (term, origin)}) for n, term in terms.items()}
        return CalibrationOutcome(corrections)

    def _grid(self, channel: str) -> ChannelScale:
        grids = self.source.grids
        if channel not in grids:
            raise InputError("channel", channel, "the rig has", known=grids)
        return grids[channel]

    def _points(self, asked: Mapping[float, OperatorTask], channels: Sequence[str]) -> dict[str, list[Point]]:
        for name in channels:
            self._grid(name)
        points: dict[str, list[Point]] = {name: [] for name in channels}
        up = sorted(asked)
        for setting in (*up, *up[-2::-1]):  # down again, for hysteresis shows between the two ways
            task = asked[setting]
            readings, shown = self._read(task, channels, {n: p[-1] for n, p in points.items() if p})
            for name in channels:
                points[name].append(Point(setting, task.values[name] if shown is None else shown, readings[name]))
        return points

    def _read(
        self, task: OperatorTask, channels: Sequence[str], before: Mapping[str, Point]
    ) -> tuple[dict[str, ReferenceReading], float | None]:
        while True:
            shown = self.ask(task)
            try:
                if shown is not None and not math.isfinite(shown):
                    raise InputError("reference", str(shown), "must be a finite number")
                samples = self.source.read(self.samples)
                readings = {}
                for name in channels:
                    true = task.values[name] if shown is None else shown
                    readings[name] = self._sound(name, np.asarray(samples[name]), true, before.get(name))
                return readings, shown
            except InputError as error:
                if self.again is None:
                    raise
                self.again(error)

    def _sound(self, name: str, samples: np.ndarray, true: float, before: Point | None) -> ReferenceReading:
        grid = self._grid(name)
        if not grid.least <= true <= grid.most:
            ends = f"{with_unit(grid.least, grid.unit)} and {with_unit(grid.most, grid.unit)}"
            problem = f"must be between {ends}, the range of the sensor"
            raise InputError(f"reference for {name}", with_unit(true, grid.unit), problem)
        _off_rails(name, samples, grid)
        reading = estimate.reading(samples)
        most = max(self.most_scatter * grid.range, 2.0 * grid.resolution)
        if reading.scatter > most:
            problem = f"must be at most {with_unit(most, grid.unit)}; is it at rest?"
            raise InputError(f"scatter of {name}", with_unit(reading.scatter, grid.unit), problem)
        if before is not None and true != before.true:
            step, moved = true - before.true, reading.mean - before.reading.mean
            if moved / step < LEAST_FOLLOWED:
                at = f"{with_unit(reading.mean, grid.unit, 6)} after {with_unit(before.reading.mean, grid.unit, 6)}"
                went = f"from {with_unit(before.true, grid.unit)} to {with_unit(true, grid.unit)}"
                raise InputError(f"reading of {name}", at, f"must follow the reference, which went {went}")
        return reading

    def _origin(self, method: str, reference: Reference, points: int) -> Origin:
        return Origin(
            method=method,
            date=self.date,
            reference=reference.name,
            reference_uncertainty=reference.uncertainty,
            scale_uncertainty=reference.scale,
            valid_for=self.valid_for,
            points=points,
        )

    def _correction(self, unit: str, terms: Mapping[str, tuple[CorrectionTerm, Origin]], **more: Any) -> Correction:
        made = {n: CorrectionTerm(t.value, t.uncertainty, t.degrees, origin) for n, (t, origin) in terms.items()}
        return Correction(unit=unit, terms=made, sensor=self.sensor, **more)

    def _outcome(
        self,
        method: str,
        reference: Reference,
        lines: Mapping[str, CalibrationLine],
        points: Mapping[str, Sequence[Point]],
        wanted: Sequence[str] = ("gain", "zero"),
    ) -> CalibrationOutcome:
        corrections = {}
        for name, line in lines.items():
            origin = self._origin(method, reference, len(points[name]))
            terms = {term: (getattr(line, term), origin) for term in wanted}
            correlation = line.correlation if "zero" in wanted else 0.0
            unit = self._grid(name).unit
            corrections[name] = self._correction(unit, terms, correlation=correlation, linearity=line.linearity)
        return CalibrationOutcome(corrections, lines, points)


def _different(subject: str, values: Sequence[float], unit: str, least: float = -math.inf) -> None:
    """Refuse settings that do not determine a line, before the operator is requested the first."""
    for value in values:
        if not (math.isfinite(value) and value >= least):
            raise InputError(
                subject, _mass(value) if unit == "kg" else with_unit(value, unit), f"must be {least:g} {unit} or more"
            )
    words = ", ".join(_mass(v) if unit == "kg" else with_unit(v, unit) for v in values) or None
    if len(values) < 2:
        raise InputError(subject, words, "must be two different ones or more, for there are a gain and a zero to find")
    if len(set(values)) < len(values):
        raise InputError(
            subject, words, "must be different ones; each is used on the way up and on the way down anyway"
        )


def _off_rails(name: str, samples: np.ndarray, grid: ChannelScale) -> None:
    room = 0.5 * grid.resolution
    ends = np.mean((samples <= grid.low + room) | (samples >= grid.high - room))
    if ends > 0.0:
        inside = f"between {with_unit(grid.low, grid.unit)} and {with_unit(grid.high, grid.unit)}"
        problem = f"must lie {inside}, but {100.0 * ends:.3g} % of the samples are at an end of the converter"
        raise InputError(f"reading of {name}", None, problem)


def _mass(value: float) -> str:
    return f"{value:g} kg"


def _and(words: Sequence[str]) -> str:
    return words[0] if len(words) == 1 else f"{', '.join(words[:-1])} and {words[-1]}"
