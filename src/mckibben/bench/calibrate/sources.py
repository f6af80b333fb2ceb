"""Sources of calibration readings: the sensors of a rig, simulated at known true values, or a machine at rest.

Readings are *indicated* values: what the nominal scale of the rig's converters makes of the counts.
"""

from __future__ import annotations

import math
import threading
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..._jax import jit, jnp
from ...components.system import Moment, System
from ...engine.integration import integrate
from ...engine.signals import ramped
from ...errors import InputError, LineLostError
from ...experiments.waveforms import Waveform
from ..hardware.converters import SPAN, Converters, Sensor
from ..hardware.interface import Hardware
from ..hardware.stand import Encoder
from ..rig import Rig
from ..sensors import SENSORS
from .estimate import Reference

PERIOD = 1e-3  # of the samples [s]
FINE = 8  # straight pieces per sample from which a filter sees a waveform
SWING = 0.4  # of a sensor's range, to either side of its middle, that a waveform takes
LEAD = 0.5  # time for which a filter has seen a waveform before the first sample is kept [s]


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

    def __init__(
        self,
        hardware: Hardware,
        converters: Converters,
        *,
        scales: Mapping[str, ChannelScale] | None = None,
    ) -> None:
        """Prepare the readings of a machine that is not started yet, with the scales of its counts."""
        self.period, self._hardware = PERIOD, hardware
        self._scales = dict(converters.analog)
        self._encoder = converters.encoder if hardware.has_encoder else None
        self._rest = 0 if converters.motor is None else int(converters.motor.count(0.0))
        missing = [n for n in self._scales if n not in hardware.names]
        if missing:
            raise InputError("channels", ", ".join(missing), "the machine has", known=hardware.names)
        self.grids = {
            n: ChannelScale(float(s.low), float(s.top), float(s.resolution), SENSORS[n].unit if n in SENSORS else "1")
            for n, s in self._scales.items()
        }
        if self._encoder is not None:
            self.grids[SPAN] = ChannelScale(-math.inf, math.inf, float(self._encoder.resolution), "m")
        self.grids |= {n: one for n, one in (scales or {}).items() if n in self.grids}
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
