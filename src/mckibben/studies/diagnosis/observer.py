"""The rig as an observer: what its sensors should show, from the valve's command and the span that were recorded.

The machine is that of the simulated rig, with its circuit, muscle and tendon; only its motor is replaced by the recorded
span, and its software by the recorded command. So neither controllers nor a protocol are needed, and noise does not enter.
The frame swings under the predicted tension as that of the simulated rig does: taken as a spring under the recorded one, a
fast step of pressure left the braid's friction off by 15 mN for as long as the pressure stayed. Between two samples the
motion follows a cubic spline, since the corners of straight lines would shake the muscle's end; commands are held, and
sensors filter what is between.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
from scipy.interpolate import CubicSpline

from ..._jax import Scalar, Tree, jnp
from ...assembly.loads import Load, SpanState
from ...assembly.machine import Machine
from ...assembly.muscle_unit import MuscleUnit
from ...bench.hardware.converters import Sensor
from ...bench.hardware.stand import Frame, FrameState
from ...bench.rig import DRIFT, SOUND, Plumbing, Rig, RigFaults
from ...bench.sensors import MUSCLE, PORT
from ...components import Environment, field, paths
from ...components.system import Value
from ...engine import STEP, held, march, ramped
from ...engine.native import call_in_lanes
from ...engine.rates import RK4_LIMIT
from ...errors import ConvergenceError
from ...pneumatics.valves import PressureRegulator

CHANNELS = {
    "pressure": f"{MUSCLE}.pressure",
    "valve_pressure": f"{PORT}.pressure_abs",
    "tension": f"{MUSCLE}.load_tension",
}
POSITION = f"{MUSCLE}.position"  # signal of the moved end [m]
SIMULATED = (
    "leak", "valve_blockage", "valve_sticking", "span_drift", "clamp_slack", "clamp_grip", "lost_threads", "rubber_warming",
)  # fmt: skip
# What no recording says of its start; none is a fault.
START_GAS = "start_gas"  # share by which the muscle holds more gas at first than at room temperature
START_FRICTION = "start_friction"  # way of the braid before the start, after which its friction was relaxed [m]
START_PORT = "start_port"  # share by which the pressure at the valve is higher than it was measured
START_SLIP = "start_slip"  # span that the clamp lost in the sections before [m]
# Share by which the motion is another one that the recording could as well be of: smoothed by a wider parabola, and counted
# by an encoder that is half a count off. The two differ where the motion jolts within some samples or nearly stands still.
MOTION = "motion"
STARTS = (START_GAS, START_FRICTION, START_PORT, START_SLIP, MOTION)
# Weights of the middle of a parabola fitted to five and to nine samples: A. Savitzky and M. J. E. Golay, Anal. Chem. 36(8),
# 1964.
PARABOLA = np.array([-3.0, 12.0, 17.0, 12.0, -3.0]) / 35.0
WIDER_PARABOLA = np.array([-21.0, 14.0, 39.0, 54.0, 59.0, 54.0, 39.0, 14.0, -21.0]) / 231.0
# Of a count: least noise; beyond which, and over how many, it is averaged.
LEAST_NOISE, COUNTS, COUNTS_BESIDE = 0.02, 1.0, 6
SUBSAMPLES = 5  # of each sample, at which motion and sensors are evaluated
MOST_PARTS = 16  # of the usual step, before a run is given up


class RecordedSection(NamedTuple):
    """Samples without a gap: times since the start of the run [s], recorded commands and measured channels (n,) [SI]."""

    time: np.ndarray
    span: np.ndarray
    valve: np.ndarray
    opened: np.ndarray
    measured: dict[str, np.ndarray]


class StatedNumber(NamedTuple):
    """A number of the muscle's or the rig's file, and how far it may be off.

    Attributes:
        path: such as ``muscle.law.passive_stiffness``.
        value: as stated [SI].
        deviation: standard deviation of the true value about it [SI].
        unit: of both.
    """

    path: str
    value: np.ndarray
    deviation: np.ndarray
    unit: str


LENGTH_OFF = 5e-4  # standard deviation of a stated length, at most `NUMBER_OFF` of it [m]
NUMBER_OFF, FRICTION_OFF, FLOW_OFF = 0.05, 0.2, 0.015  # shares of other numbers, of friction, and of a valve's flow
LENGTHS, PRESSURES = 9, np.array([0.0, 2e5, 4e5, 6e5])  # at which a law's numbers are tried, gauge [Pa]
# What a rig's file knows well, what a run tells nothing of, and what is a fault by itself.
WELL_KNOWN = ("gas.", "tendon.", "end_mass", "viscosity", "stop_", "largest_strain", "threshold_width", "upper_length")


def stated_numbers(plumbing: Plumbing, unit: MuscleUnit) -> tuple[StatedNumber, ...]:
    """Numbers of the law, of friction and creep, and of the valve's flow, with the deviations that files usually have."""
    found = []
    for path, q, value in paths.declared_values({"muscle": unit, "plumbing": plumbing}):
        kind, stated = path.split(".")[1], np.asarray(value, float)
        if any(f".{name}" in path for name in WELL_KNOWN) or not np.any(stated):
            continue
        if kind in ("law", "friction", "creep") and path.startswith("muscle."):
            share = NUMBER_OFF if kind == "law" else FRICTION_OFF
            size = share * np.abs(stated)
            size = np.minimum(size, LENGTH_OFF) if q.unit == "m" and kind == "law" else size
            size = size * _bearable(unit, path.removeprefix("muscle."), stated, size) if kind == "law" else size
        elif kind == "valve" and path.endswith(".conductance"):
            size = FLOW_OFF * np.abs(stated)
        else:
            continue
        found.append(StatedNumber(path, stated, size, q.unit))
    return tuple(found)


def _bearable(unit: MuscleUnit, path: str, stated: np.ndarray, size: np.ndarray) -> float:
    """Share of a deviation of a law's number that changes no tension by more than `NUMBER_OFF` of the largest.

    Numbers that cancel, such as the moduli of a polynomial, are known far better than each alone would seem to need.
    """
    low, high = (float(end) for end in unit.law.length_range())
    length, pressure = (axis.ravel() for axis in np.meshgrid(np.linspace(low, high, LENGTHS), PRESSURES))
    usual, moved = (np.asarray(one.law.tension(length, pressure))
                    for one in (unit, paths.put(unit, {path: stated + size})))  # fmt: skip
    change = float(np.nanmax(np.abs(moved - usual)))
    return min(1.0, NUMBER_OFF * float(np.nanmax(usual)) / change) if change > 0.0 else 1.0


class Observer(NamedTuple):
    """A rig with a muscle, ready to predict.

    Attributes:
        plumbing: the way in which the parts are joined.
        unit: the muscle.
        rig: the rig.
        latency: from a sample to the action of its commands [s].
        description: numbers of muscle and rig that may be off, each by a share of its deviation, see `stated_numbers`.
    """

    plumbing: Plumbing
    unit: MuscleUnit
    rig: Rig
    latency: float
    description: tuple[StatedNumber, ...] = ()

    @property
    def channels(self) -> tuple[str, ...]:
        """Measured channels that are predicted."""
        return tuple(name for name in CHANNELS if name in self.rig.sensors)

    def predict(self, section: RecordedSection, values: Sequence[Mapping[str, float]]) -> np.ndarray:
        """Predict the measured channels for several sets of faults at once.

        Args:
            section: recorded inputs.
            values: of each set, by the name of the fault [SI], of `STARTS`, and of the stated numbers by their paths, in
                standard deviations; others are zero.

        Returns:
            Mean readings (sets, channels, n) [SI].

        Raises:
            ConvergenceError: the rig cannot be simulated with these inputs.
        """
        return self.predict_all([section], values)[0]

    def predict_all(
        self, sections: Sequence[RecordedSection], values: Sequence[Mapping[str, float]]
    ) -> list[np.ndarray]:
        """Predict sections of one run after another, of which each begins with what the clamp has slipped before.

        Args:
            sections: in the order of time.
            values: as of `predict`.

        Returns:
            Mean readings (sets, channels, n) of each [SI].

        Raises:
            ConvergenceError: the rig cannot be simulated with these inputs.
        """
        slips, tables = [float(one.get(START_SLIP, 0.0)) for one in values], []
        for section in sections:
            begun = [{**one, START_SLIP: slip} for slip, one in zip(slips, values, strict=True)]
            done = self._simulate(section, begun)
            tables.append(self._read(done, section, values))
            slips = [float(lane[-1]) for lane in done["slip"]]
        return tables

    def _simulate(self, section: RecordedSection, values: Sequence[Mapping[str, float]]) -> Mapping[str, np.ndarray]:
        """Simulate a section for several sets of faults: channels and slip (sets, n) before the sensors [SI]."""
        period = float(np.mean(np.diff(section.time)))
        described = tuple(one.path for one in self.description)
        names = (*SIMULATED, *STARTS, *described)
        table = np.array([[float(one.get(name, SOUND.get(name, 0.0))) for name in names] for one in values])
        room = self.rig.environment
        start = np.array([self._start(section, name) for name in ("valve_pressure", "pressure")])
        begun = np.float64(section.time[0])
        span = _smooth(section.span, PARABOLA)
        count = 0.0 if self.rig.encoder is None else float(self.rig.encoder.resolution)
        other = count * (np.floor((span - section.span[0]) / count) + 0.5) + section.span[0] if count else span
        other = _smooth(other, WIDER_PARABOLA)
        times = section.time[0] + period / SUBSAMPLES * np.arange(SUBSAMPLES * (len(section.time) - 1) + 1)
        fine, also = (CubicSpline(section.time, values)(times) for values in (span, other))
        asked, opened = (np.repeat(values, SUBSAMPLES)[: len(times)] for values in (section.valve, section.opened))
        recorded = times - begun, fine, also - fine, asked, opened
        stated = tuple((one.value, one.deviation) for one in self.description)
        parts = self.plumbing, self.unit, self.rig.frame, room
        shared = (*parts, *recorded, start, np.float64(self.latency), begun, stated)
        part = period / SUBSAMPLES
        steps = max(1, math.ceil(part / STEP - 1e-9))
        for finest in (1, 2, 4, 8, MOST_PARTS):
            inner = steps * finest
            done: Mapping[str, np.ndarray] = call_in_lanes(
                _outputs, shared, (table,), described=described, period=part, inner=inner, samples=len(times) - 1
            )
            if np.isfinite(done["rate"]).all() and done["rate"].max() * part / inner <= RK4_LIMIT:
                return done
        raise ConvergenceError(
            "The rig cannot be simulated with the recorded command and span; is the recording of another rig?"
        )

    def _read(
        self, done: Mapping[str, np.ndarray], section: RecordedSection, values: Sequence[Mapping[str, float]]
    ) -> np.ndarray:
        """Filter each channel as its sensor does, up to the skew of its converter; add its drift, and count."""
        time = section.time
        part = float(np.mean(np.diff(time))) / SUBSAMPLES
        rows = []
        for name in self.channels:
            sensor = self.rig.sensors[name]
            signals = filtered(sensor, done[name], part)[:, ::SUBSAMPLES]
            drifts = np.array([one.get(f"{name}{DRIFT}", 0.0) for one in values])
            rows.append(mean_reading(sensor, signals + drifts[:, None] * time))
        return np.moveaxis(np.array(rows), 0, 1)

    def _start(self, section: RecordedSection, name: str) -> float:
        """Absolute pressure at the start [Pa]: as measured, at the valve where only that is."""
        room = float(self.rig.environment.pressure_abs)
        values = section.measured.get(name, section.measured.get("pressure", section.valve))
        return max(room + float(np.mean(values[:10])), 0.5 * room)


class RecordedStand(Load):
    """The frame of a rig, whose moved end is where the recording says: `bench.hardware.TestStand` without its motor."""

    frame: Frame = field(kw_only=True)

    def muscles(self) -> tuple[str, ...]:
        """Return the name of the one muscle."""
        return (MUSCLE,)

    def signals(self) -> tuple[str, ...]:
        """Return the name of the signal of the moved end's position."""
        return (POSITION,)

    def initial(self) -> FrameState:
        """State of a frame without load."""
        return FrameState(jnp.zeros(()), jnp.zeros(()))

    def at_rest_under(self, tension: Scalar) -> FrameState:
        """State of the frame at rest under a tension [N]."""
        return FrameState(tension / self.frame.stiffness, jnp.zeros(()))

    def spans(self, state: Tree, inputs: Mapping[str, Value]) -> dict[str, SpanState]:
        """Span of the muscle, reduced by the frame's deflection."""
        moved = inputs[POSITION]
        return {MUSCLE: SpanState(moved.value - state.deflection, moved.rate - state.deflection_velocity)}

    def rates(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> FrameState:
        """Rates of change of the frame's state."""
        return self.frame.rates(state, tensions[MUSCLE])

    def stored_energy(self, state: Tree) -> Scalar:
        """Kinetic and elastic energy of the frame [J]."""
        return self.frame.stored_energy(state)

    def powers(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> tuple[Scalar, Scalar]:
        """Power of what moves the end, and that which the frame's damping loses [W]."""
        return tensions[MUSCLE] * inputs[POSITION].rate, self.frame.lost_power(state)

    def outputs(self, state: Tree, tensions: Mapping[str, Scalar], inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Deflection of the frame [m]."""
        return {"deflection": state.deflection}


def _outputs(
    plumbing: Plumbing, unit: MuscleUnit, frame: Frame, room: Environment, clock: Any, span: Any, other: Any, valve: Any,
    opened: Any, start: Any, latency: Scalar, begun: Scalar, stated: Any, values: Any,
    *, described: tuple[str, ...], period: float, inner: int, samples: int,
) -> dict[str, Tree]:  # fmt: skip
    """Compute channels (n,) and the bound of the fastest mode [1/s] for one set of faults."""
    faults = RigFaults(**{name: values[i] for i, name in enumerate(SIMULATED)})
    unknown = {name: values[len(SIMULATED) + i] for i, name in enumerate(STARTS)}
    off = values[len(SIMULATED) + len(STARTS) :]
    numbers = {
        path: value + off[i] * size for i, (path, (value, size)) in enumerate(zip(described, stated, strict=True))
    }
    parts = paths.put({"muscle": unit, "plumbing": plumbing}, numbers)
    faulty, muscle = faults.on_every_part(parts["plumbing"], parts["muscle"])
    load = RecordedStand(frame=frame)
    machine = Machine.of(faulty.circuit({MUSCLE: muscle}, room), {MUSCLE: muscle}, load, room)
    signals = {
        POSITION: ramped(span + unknown[MOTION] * other - faults.span_drift * (begun + clock)),
        "valve": held(valve).delayed(latency),
    }
    if plumbing.shut_off is not None:
        signals["open"] = held(opened).delayed(latency)
    now = {n: s.at(0, 0.0, period) for n, s in machine.commands(signals).items()}
    port = start[0] * (1.0 + unknown[START_PORT])
    begin = now[POSITION]
    resting = now | {POSITION: begin._replace(value=begin.value - unknown[START_SLIP])}
    pressures = {n: start[1] if n == MUSCLE else port for n in machine.circuit.chambers}
    state, memory = machine.at_rest(pressures, resting)
    yielded = load.at_rest_under(machine.pulls(state, memory, resting)[2][MUSCLE])
    resting = resting | {POSITION: begin._replace(value=begin.value - unknown[START_SLIP] - yielded.deflection)}
    state, memory = machine.at_rest(pressures, resting)  # the muscle's length with the frame's deflection
    state = state | {"load": yielded}
    masses = state["circuit"]["mass"]
    masses = masses | {MUSCLE: masses[MUSCLE] * (1.0 + unknown[START_GAS])}
    state = state | {"circuit": state["circuit"] | {"mass": masses}}
    memory = _memory_before(machine, state, memory, port, unknown)
    _, kept = march(machine, state, memory, signals, period, inner, samples, False, integrals=False)
    channels = {name: kept[2][output] for name, output in CHANNELS.items()} | {"slip": kept[2][f"{MUSCLE}.slip"]}
    rate = jnp.zeros(()) + machine.max_rate_bound(state, memory, now)
    return channels | {"valve_pressure": channels["valve_pressure"] - room.pressure_abs, "rate": rate}


def _memory_before(machine: Machine, state: Tree, memory: Tree, port: Scalar, unknown: Mapping[str, Scalar]) -> Tree:
    """Set the memory with which a section begins.

    A regulator that was at rest is shut, so that what it senses is its set-point, as far as its play allows; from the
    middle of the play it would settle on the wrong side of it.

    Args:
        machine: the rig.
        state: state at the start.
        memory: memory of a machine that was never moved.
        port: absolute pressure at the valve [Pa].
        unknown: what no recording says of the start, by its name.
    """
    valve, unit = machine.circuit.elements["valve"], machine.units[MUSCLE]
    if isinstance(valve, PressureRegulator):
        asked = state["circuit"]["elements"]["valve"] + machine.environment.pressure_abs
        memory = memory | {"circuit": memory["circuit"] | {"valve": valve.sensed(asked, port)}}
    ledgers = memory["muscles"][MUSCLE]
    if unit.friction is not None:
        gauge = machine.gauge(state, MUSCLE)
        moved = unit.friction.advance(
            ledgers["friction"].state, unknown[START_FRICTION], start_pressure=gauge, end_pressure=gauge, duration=0.0
        )
        ledgers = ledgers | {"friction": ledgers["friction"]._replace(state=moved.state)}
    ledgers = ledgers | {"clamp": ledgers["clamp"]._replace(state=unknown[START_SLIP])}
    return memory | {"muscles": memory["muscles"] | {MUSCLE: ledgers}}


def _smooth(values: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Smooth a counted channel (n,) by the parabola through some samples about each; held at its ends."""
    padded = np.pad(values, len(weights) // 2, mode="edge")
    return np.convolve(padded, weights, mode="valid")


def filtered(sensor: Sensor, signals: np.ndarray, period: float) -> np.ndarray:
    """Signals (sets, n) as the converter of a sensor gets them: behind its filter, and late by its skew.

    Between two values a signal is a straight line, for which this solves the filter of `Sensor` exactly; it begins settled.
    """
    from scipy.signal import lfilter

    pole = 2.0 * math.pi * float(sensor.cutoff)
    kept = math.exp(-pole * period)
    lag = (1.0 - kept) / (pole * period)  # share of a value's change by which the filter is behind at its end
    seen = np.clip(signals, float(sensor.low), float(sensor.high))
    begun = seen[:, :1] * (lag - kept)
    settled, _ = lfilter([1.0 - lag, lag - kept], [1.0, -kept], seen[:, 1:], axis=1, zi=begun + kept * seen[:, :1])
    behind = np.concatenate([seen[:, :1], settled], axis=1)
    share = -math.expm1(-pole * float(sensor.converter.skew))
    late: np.ndarray = behind + share * (seen - behind)
    return late


def mean_reading(sensor: Sensor, values: np.ndarray) -> np.ndarray:
    """Mean reading of a sensor whose noise is smaller or larger than a count.

        E[x] = low + q sum_k Phi((v - edge_k)/s),   edge_k = low + (k - 1/2) q

    Args:
        sensor: transducer and converter.
        values: filtered signals [unit of the channel].
    """
    from scipy.special import ndtr

    low, step = float(sensor.converter.low), float(sensor.converter.resolution)
    spread = max(float(sensor.noise) / step, LEAST_NOISE)
    shown = (1.0 + float(sensor.gain_error)) * np.clip(values, float(sensor.low), float(sensor.high))
    mean: np.ndarray
    counts = (shown + float(sensor.offset) - low) / step
    if spread > COUNTS:  # noise over several counts leaves nothing of them in the mean
        mean = low + step * counts
        return mean
    nearest = np.floor(counts + 0.5)
    edges = np.arange(-COUNTS_BESIDE, COUNTS_BESIDE) + 0.5
    above = ndtr((counts[..., None] - nearest[..., None] - edges) / spread).sum(axis=-1)
    mean = low + step * (nearest + above - COUNTS_BESIDE)
    return mean
