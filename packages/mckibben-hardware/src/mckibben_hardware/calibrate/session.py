"""Calibration sessions: an operator sets one point after the other, the sensors are read, and the points are fitted.

Readings are *indicated* values: what the nominal scale of the rig's converters makes of the counts. They come from a machine
at rest, or from the sensors of a rig simulated at known true values, which a simulated operator sets.

A point is refused, in one clear line, where its samples scatter too much, where they touch an end of the converter, and
where the reading did not follow the reference. What is then done, `again` says: without it the session ends.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from mckibben._jax import jit, jnp
from mckibben.bench.hardware.converters import SPAN, Converters, Sensor
from mckibben.bench.hardware.interface import Hardware
from mckibben.bench.hardware.stand import Encoder
from mckibben.bench.rig import Rig
from mckibben.bench.sensors import SENSORS
from mckibben.components.system import Moment, System
from mckibben.engine.integration import integrate
from mckibben.engine.signals import ramped
from mckibben.errors import InputError, LineLostError
from mckibben.experiments.waveforms import Chirp, Sine, Waveform
from mckibben.quantities import with_unit
from mckibben.recordings.calibration import Correction, CorrectionTerm, Origin

from . import estimate
from .estimate import GRAVITY, CalibrationLine, Point, Reference, ReferenceReading, skew

PERIOD = 1e-3  # of the samples [s]
FINE = 8  # straight pieces per sample from which a filter sees a waveform
SWING = 0.4  # of a sensor's range, to either side of its middle, that a waveform takes
LEAD = 0.5  # time for which a filter has seen a waveform before the first sample is kept [s]
LEAST_FOLLOWED = 0.1  # of a step of the reference, that a reading has to make
LEAST_SAMPLES, MOST_SAMPLES = 16, 1_000_000


class ChannelScale(NamedTuple):
    """Nominal scale of a channel [unit]."""

    low: float  # lowest value that its converter shows; minus infinity for an encoder
    high: float  # highest
    resolution: float  # one count
    unit: str  # SI unit
    least: float = -math.inf  # lowest true value that its transducer sees
    most: float = math.inf  # highest

    @property
    def range(self) -> float:
        """Full range [unit]; of an encoder, a thousand counts."""
        return self.high - self.low if math.isfinite(self.high - self.low) else 1000.0 * self.resolution


class OperatorTask(NamedTuple):
    """A task for the operator during a calibration."""

    sentence: str  # as text
    values: Mapping[str, float]  # true values to bring about, by channel [unit]; empty if a waveform is requested
    gauge: bool = False  # whether the reference shows a value that the person may answer with
    wave: Waveform | None = None  # wave of unit amplitude, for all channels at once


# Brings a task about; gives what the reference shows [unit], or None where that is what was asked for.
Ask = Callable[[OperatorTask], float | None]


class Source(Protocol):
    """Readings of a rig's channels at rest."""

    @property
    def period(self) -> float:
        """Sample period [s]."""

    @property
    def grids(self) -> Mapping[str, ChannelScale]:
        """Nominal scales of the channels."""

    def read(self, samples: int) -> Mapping[str, np.ndarray]:
        """Return the next samples of every channel (n,), indicated [unit]."""


def grids(rig: Rig) -> dict[str, ChannelScale]:
    """Nominal scales of a rig's channels; of the encoder that of its travel."""
    scales = {}
    for name, sensor in rig.sensors.items():
        at = sensor.converter
        ends = float(sensor.low), float(sensor.high)
        scales[name] = ChannelScale(float(at.low), float(at.top), float(at.resolution), SENSORS[name].unit, *ends)
    if rig.encoder is not None:
        scales[SPAN] = ChannelScale(-math.inf, math.inf, float(rig.encoder.resolution), "m")
    return scales


class SimulatedSensors:
    """The sensors of a rig without the rest of the machine, with adjustable true values.

    The encoder turns with the motor's pulley, so a motor's pulley radius that differs from the encoder's is an error of its
    gain; it was zeroed anywhere within a count.
    """

    def __init__(self, rig: Rig, seed: int = 0) -> None:
        self.period, self.grids = PERIOD, grids(rig)
        self._sensors = dict(rig.sensors)
        self._nominal = rig.encoder
        self._draw = np.random.default_rng([seed, 1])
        self._encoder: Encoder | None = rig.encoder
        if rig.encoder is not None and rig.motor is not None:
            self._encoder = rig.encoder.replace(pulley_radius=rig.motor.pulley_radius)
        self._zeroed = float(self._draw.uniform()) * self.grids[SPAN].resolution if SPAN in self.grids else 0.0
        self.true = dict.fromkeys(self.grids, 0.0)
        self.wave: Waveform | None = None
        self._waves: dict[tuple[Waveform, int], tuple[dict[str, Any], dict[str, Any]]] = {}

    def put(self, values: Mapping[str, float]) -> None:
        """Set the true values of channels [unit]."""
        self.true |= values
        self.wave = None

    def read(self, samples: int) -> dict[str, np.ndarray]:
        """Return the next samples; of a waveform from its start."""
        draws = {n: self._draw.standard_normal(samples) for n in self._sensors}
        rest = {n: np.float64(self.true[n]) for n in self._sensors}
        y: dict[str, Any] | None = None
        x: dict[str, Any] = rest
        if self.wave is not None:  # filtered once, since they are always the same
            if (self.wave, samples) not in self._waves:
                self._waves = {(self.wave, samples): self._filtered(self.wave, samples)}
            y, x = self._waves[self.wave, samples]
        readings = {n: np.asarray(v) for n, v in _readings(self._sensors, y, x, draws).items()}
        if self._encoder is not None and self._nominal is not None:
            count = self._encoder.count(self.true[SPAN], self._zeroed)
            readings[SPAN] = np.full(samples, float(self._nominal.span(count, 0.0)))
        return readings

    def _filtered(self, wave: Waveform, samples: int) -> tuple[dict[str, Any], dict[str, Any]]:
        lead = round(LEAD / self.period)
        times = self.period / FINE * np.arange(-lead * FINE, (samples - 1) * FINE + 1)
        shape = wave.at(np.maximum(times, 0.0)) if wave.kind == "chirp" else wave.at(times)
        middle = {n: 0.5 * float(s.low + s.high) for n, s in self._sensors.items()}
        swing = {n: SWING * float(s.high - s.low) for n, s in self._sensors.items()}
        signals = {n: ramped(middle[n] + swing[n] * shape) for n in self._sensors}
        first = {n: s.initial(signals[n].values[0]) for n, s in self._sensors.items()}
        run = integrate(_Filters(self._sensors), first, signals, period=self.period / FINE, method="rk4")
        return (
            {n: run.outputs[n][lead * FINE :: FINE] for n in self._sensors},
            {n: np.asarray(s.values)[lead * FINE :: FINE] for n, s in signals.items()},
        )


class SimulatedPerson:
    """A simulated operator who sets simulated sensors by a reference with normally distributed errors."""

    def __init__(self, sensors: SimulatedSensors, reference: Reference | None = None, seed: int = 0) -> None:
        self.sensors, self.reference = sensors, reference or Reference()
        self._draw = np.random.default_rng([seed, 2])
        self._common = self.reference.scale * float(self._draw.standard_normal())
        self._errors: dict[float, float] = {}
        self.asked: list[str] = []

    def __call__(self, task: OperatorTask) -> None:
        """Set the sensors to the true value of the reference; equal settings have equal errors."""
        self.asked.append(task.sentence)
        true = dict.fromkeys(task.values, 0.0)
        for name, value in task.values.items():
            if value == 0.0 and self.reference.exact_nothing:
                continue
            if value not in self._errors:
                self._errors[value] = self.reference.uncertainty * float(self._draw.standard_normal())
            true[name] = value * (1.0 + self._common) + self._errors[value]
        self.sensors.put(true)
        self.sensors.wave = task.wave


class _Filters(System):
    sensors: dict[str, Sensor]

    def rate(self, state: Any, memory: Any, inputs: Any) -> Any:
        return {n: s.rate(state[n], inputs[n].value) for n, s in self.sensors.items()}

    def integrands(self, state: Any, memory: Any, inputs: Any) -> Any:
        return ()

    def advance_memory(self, memory: Any, start: Moment, end: Moment, duration: Any) -> Any:
        return memory

    def outputs(self, state: Any, memory: Any, inputs: Any) -> dict[str, Any]:
        return dict(state)


@jit
def _readings(sensors: Any, y: Any, x: Any, draws: Any) -> dict[str, Any]:
    """Compute readings (n,) from filtered signals y, settled if there are none, and true values x."""
    y = {n: s.initial(x[n]) for n, s in sensors.items()} if y is None else y
    return {n: s.reading(y[n], x[n], draws[n])[0] + jnp.zeros_like(draws[n]) for n, s in sensors.items()}


PATIENCE = 5.0  # beyond the time that the samples take [s]


class HardwareReadings:
    """A machine, vented and without motor force, sampled continuously in a thread.

    It is sampled between the readings too, since a machine that is told nothing takes its line for lost. The encoder is
    zeroed once, at the beginning. To be used in a ``with``.
    """

    def __init__(self, hardware: Hardware, converters: Converters, scales: Mapping[str, ChannelScale]) -> None:
        """Prepare the readings of a machine that is not started yet, with the scales of its counts."""
        self.period, self._hardware = PERIOD, hardware
        self._scales = dict(converters.analog)
        self._encoder = converters.encoder if hardware.has_encoder else None
        self._rest = 0 if converters.motor is None else int(converters.motor.count(0.0))
        missing = [n for n in self._scales if n not in hardware.names]
        if missing:
            raise InputError("channels", ", ".join(missing), "the machine has", known=hardware.names)
        known = {*self._scales} | ({SPAN} if self._encoder is not None else set())
        self.grids = {n: one for n, one in scales.items() if n in known}
        self._news = threading.Condition()
        self._wanted, self._request, self._ended = 0, 0, False
        self._rows: list[tuple[tuple[int, ...], int]] = []
        self._error: Exception | None = None
        self._thread = threading.Thread(target=self._sample, name="calibration", daemon=True)

    def __enter__(self) -> HardwareReadings:
        self._hardware.start(self.period)
        self._hardware.vent()
        self._thread.start()
        return self

    def __exit__(self, *_: Any) -> None:
        with self._news:
            self._ended = True
        self._thread.join(PATIENCE)
        self._hardware.close()

    def read(self, samples: int) -> dict[str, np.ndarray]:
        """Return the next samples.

        Raises:
            LineLostError: if the machine does not give them.
        """
        with self._news:
            self._rows, self._wanted, self._request = [], samples, self._request + 1
            self._news.wait_for(
                lambda: not self._wanted or self._error is not None, samples * self.period * 2.0 + PATIENCE
            )
            if self._error is not None:
                raise LineLostError(str(self._error)) from self._error
            if self._wanted:
                raise LineLostError(f"machine: {len(self._rows)} of {samples} samples came in time")
            rows = self._rows
        names = self._hardware.names
        counts = np.array([row for row, _ in rows], float).reshape(samples, len(names))
        readings = {n: np.asarray(s.value(counts[:, names.index(n)])) for n, s in self._scales.items()}
        if self._encoder is not None:
            readings[SPAN] = np.asarray(self._encoder.span(np.array([c for _, c in rows], float), 0.0))
        return readings

    def _sample(self) -> None:
        machine, k = self._hardware, 0
        try:
            while not self._ended:
                request = self._request  # a sample that was taken before the request does not count
                machine.wait(k)
                k += 1
                counts, edges = tuple(int(c) for c in machine.counts), machine.edges
                machine.write(0, self._rest)
                with self._news:
                    if self._wanted and request == self._request:
                        self._rows.append((counts, edges))
                        self._wanted -= 1
                        if not self._wanted:
                            self._news.notify_all()
        except Exception as error:
            with self._news:
                self._error = error
                self._news.notify_all()


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
        reference = Reference(name, uncertainty * gravity, gravity_uncertainty / gravity, exact_nothing=True)
        weights = [p._replace(true=p.setting * gravity) for p in points]
        resolution = self._grid(channel).resolution
        line = estimate.line(weights, resolution=resolution, reference=reference, subject="masses")
        return self._outcome("weights", reference, {channel: line}, {channel: points})

    def pressure(self, pressures: Sequence[float], reference: Reference, channels: Sequence[str]) -> CalibrationOutcome:
        """Calibrate pressure sensors with a reference gauge, at gauge pressures [Pa], up and down again."""
        _different("pressures", pressures, "Pa")
        asked = {
            p: OperatorTask(f"set the pressure to {with_unit(p, 'Pa')}", dict.fromkeys(channels, p), True)
            for p in pressures
        }
        return self.taken_pressures(self._points(asked, channels), reference)

    def taken_pressures(self, points: Mapping[str, Sequence[Point]], reference: Reference) -> CalibrationOutcome:
        """Calibrate pressure sensors by points that were read before, of each channel with those of the reference."""
        for name, some in points.items():
            grid = self._grid(name)
            _different("readings", [*dict.fromkeys(p.true for p in some)], "Pa")
            for p in some:
                if not grid.least <= p.true <= grid.most:
                    ends = f"{with_unit(grid.least, grid.unit)} and {with_unit(grid.most, grid.unit)}"
                    problem = f"must be between {ends}, the range of the sensor"
                    raise InputError(f"reference for {name}", with_unit(p.true, grid.unit), problem)
        lines = {
            n: estimate.line(some, resolution=self._grid(n).resolution, reference=reference, subject="pressures")
            for n, some in points.items()
        }
        return self._outcome("pressure", reference, lines, points)

    def encoder(self, travels: Sequence[float], reference: Reference) -> CalibrationOutcome:
        """Calibrate the encoder by known travels [m], such as of gauge blocks.

        Only the gain is determined, metres per count over the nominal ones: the zero is where the counter stood in this
        session, and says nothing about the next one.
        """
        _different("travels", travels, "m")
        asked = {x: OperatorTask(f"move the end to the travel {with_unit(x, 'm', 6)}", {SPAN: x}) for x in travels}
        points = self._points(asked, [SPAN])
        resolution = self._grid(SPAN).resolution
        line = estimate.line(points[SPAN], resolution=resolution, reference=reference, subject="travels")
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
    shown = [_mass(value) if unit == "kg" else with_unit(value, unit) for value in values]
    for value, word in zip(values, shown, strict=True):
        if not (math.isfinite(value) and value >= least):
            raise InputError(subject, word, f"must be {least:g} {unit} or more")
    words = ", ".join(shown) or None
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
