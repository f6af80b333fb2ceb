"""Interlocks: limits of muscle and motor, and detection of failed sensors.

A step sees what the software measures and asks for. The first code that it finds stays: the caller stops the motor and vents
the muscle. Limits count from the first sample. A reading at the upper end of its converter says nothing about the quantity:
it is an open wire, or more than the sensor reads, and counts as lost after `patience`. So do a reading below that of any
intact sensor, no pressure while the valve is requested some (for `implausible_after`), a span that keeps the very same
count though a full force is asked that no tension balances, and one that is farther than `most_lag` from its set-point. A
reading that is no number counts at once.
Straight-line; which channels there are is decided once, by their names.
"""

from __future__ import annotations

import math
import signal
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from enum import IntEnum
from types import FrameType
from typing import Any, NamedTuple

from ..._jax import Tree, jnp
from ...components import Module, Scalar, field
from ...components.system import SENSORS
from ...quantities import quantity, told_apart, with_unit


def stop_sentence(stop: Callable[[], bool], when: float) -> str:
    """Message describing a stop at a time [s]; a stop function without a text was requested by the user."""
    kind, done = ("stopped", "vented") if getattr(stop, "ordinary", False) else ("emergency stop", "stopped and vented")
    return f"{kind} at {when:.6g} s: {getattr(stop, 'reason', '') or 'asked to'}; {done}"


class EmergencyStop:
    """A latching stop button, for any thread or a signal of the system. Called as a function it returns its state.

    Args:
        told: given the reason, and whether it is ordinary, whenever it is pressed.

    Attributes:
        reason: reason given with the stop.
        ordinary: whether the user ended the run, without a fault; the machine does the same.
    """

    def __init__(self, listener: Callable[[str, bool], None] | None = None) -> None:
        """Create the button, not pressed."""
        self._pressed, self._told = threading.Event(), listener
        self.reason, self.ordinary = "", False

    def press(self, reason: str = "the button was pressed", *, ordinary: bool = False) -> None:
        """Press the button. The first reason stays; an ordinary stop can become an emergency."""
        if not self._pressed.is_set() or (self.ordinary and not ordinary):
            self.reason, self.ordinary = reason, ordinary
            self._pressed.set()
        if self._told is not None:
            self._told(reason, ordinary)

    def __call__(self) -> bool:
        """Return whether the button is pressed."""
        return self._pressed.is_set()

    @contextmanager
    def on_signals(self) -> Iterator[None]:
        """Press the button on Ctrl-C and on termination, within the context; a second signal ends the program.

        In a thread that is not the main one nothing is changed; nor is a hang-up that is ignored, as by `nohup`.
        """
        if threading.current_thread() is not threading.main_thread():
            yield
            return
        names = [n for n in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, n)]
        names = [n for n in names if n != "SIGHUP" or signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN]
        before = {name: signal.signal(getattr(signal, name), self._signalled) for name in names}
        try:
            yield
        finally:
            for name, handler in before.items():
                signal.signal(getattr(signal, name), handler)

    def _signalled(self, number: int, _: FrameType | None) -> None:
        if self():
            raise KeyboardInterrupt
        self.press(f"signal {signal.Signals(number).name}")


ASKED = 0.1  # share of the valve's range above which a pressure must show
NOTHING_READ = 0.02  # share of it below which there is none
SPAN_TOLERANCE = 3e-4  # within which a machine holds a span; at the end of its frame it may be so far beyond [m]
FULL = 0.999  # share of the motor's force from which it counts as full
UNBALANCED = 0.5  # share of the motor's force that no tension balances: then something must move
_DONE = "stopped and vented"


class Trip(IntEnum):
    """Codes of stops; at the same sample the lowest counts."""

    NOTHING = 0
    OVER_PRESSURE = 1
    OVER_FORCE = 2
    TOO_SHORT = 3
    TOO_LONG = 4
    OVER_SPEED = 5
    LOST_PRESSURE = 6
    LOST_TENSION = 7
    LOST_SPAN = 8
    EMERGENCY_STOP = 9
    OUT_OF_LIMITS = 10
    SPAN_LAG = 11


class InterlockState(NamedTuple):
    """The code of the stop, durations of sensor doubts and of a lag [s], and the span of the previous sample [m]."""

    code: Any
    pressure_lost: Scalar
    pressure_silent: Scalar
    tension_lost: Scalar
    span_still: Scalar
    span_lag: Scalar
    span: Scalar


class Interlocks(Module):
    """Limits of one rig with one muscle; pressures are gauge.

    A rail is what a sensor reads at the highest code of its converter, a floor the least that an intact one reads; their
    defaults are never met. `sensors` holds the least and largest allowed reading of sensors by name, in the unit of each; a
    reading that is no number trips, too. `watch_tension` is off where it was accepted that the cell saturates: then tension
    is neither limited nor lost at its rail.
    """

    burst_pressure: Scalar = quantity("Pa", (1.0, 1e9), "largest pressure of the muscle", typical=(1e5, 1e6))
    most_tension: Scalar = quantity("N", (1e-3, 1e7), "largest tension", typical=(10.0, 1000.0))
    shortest: Scalar = quantity("m", (-100.0, 100.0), "shortest span", typical=(0.05, 0.5))
    longest: Scalar = quantity("m", (-100.0, 100.0), "longest span", typical=(0.1, 0.6))
    most_speed: Scalar = quantity("m/s", (1e-6, 1e3), "largest speed", typical=(0.1, 10.0))
    most_lag: Scalar = quantity("m", (1e-6, 100.0), "largest distance of the span from its set-point", default=100.0)
    patience: Scalar = quantity("s", (0.0, 100.0), "time for which a sensor may be doubtful", default=0.01)
    implausible_after: Scalar = quantity("s", (0.0, 1e3), "time until a pressure must show", default=1.0)
    pressure_rail: Scalar = quantity("Pa", (1.0, 1e12), "pressure at the highest code", default=1e12)
    pressure_floor: Scalar = quantity("Pa", (-1e12, 1e9), "least pressure that an intact sensor reads", default=-1e12)
    tension_rail: Scalar = quantity("N", (1e-3, 1e12), "tension at the highest code", default=1e12)
    tension_floor: Scalar = quantity("N", (-1e12, 1e7), "least tension that an intact cell reads", default=-1e12)
    valve_range: Scalar = quantity("Pa", (1.0, 1e9), "full scale of the valve", default=1e6)
    motor_force: Scalar = quantity("N", (1e-3, 1e7), "full force of the motor", default=264.0)
    watch_tension: bool = field(static=True, kw_only=True, default=True)
    sensors: dict[str, tuple[Scalar, Scalar]] = field(kw_only=True, default_factory=dict)

    def initial(self) -> InterlockState:
        """Initial state: no violation, and a last span that equals no real span."""
        zero = jnp.zeros(())
        return InterlockState(jnp.zeros((), jnp.int32), zero, zero, zero, zero, zero, jnp.asarray(jnp.inf))

    def step(
        self,
        state: InterlockState,
        measured: Mapping[str, Scalar],
        asked: Mapping[str, Scalar],
        velocity: Scalar,
        dt: Scalar,
        pressed: Scalar = 0.0,
    ) -> tuple[InterlockState, Scalar]:
        """Compute one sample: the new state and the code of `Trip`, which stays, int32.

        Args:
            state: state of `initial` or of the sample before.
            measured: those of pressure [Pa] (else valve_pressure), tension [N] and span [m] that the rig measures.
            asked: those of valve [Pa], motor [N] and span [m] that the rig has, as asked at the sample before.
            velocity: velocity of the measured span [m/s]; not looked at without a span.
            dt: sampling period [s].
            pressed: 1 while the emergency stop is pressed.
        """
        pressure_times, pressure_found = self._pressure(state, measured, asked, dt)
        tension_time, tension_found = self._tension(state, measured, dt)
        span_state, span_found = self._span(state, measured, asked, velocity, dt)
        tripped = pressure_found | tension_found | span_found | self._sensors(measured)
        tripped[Trip.EMERGENCY_STOP] = jnp.asarray(pressed) > 0.5
        first_trip: Any = jnp.zeros((), jnp.int32)
        for trip in sorted(tripped, reverse=True):
            first_trip = jnp.where(tripped[trip], jnp.int32(trip), first_trip)
        code = jnp.where(state.code != Trip.NOTHING, state.code, first_trip)
        return InterlockState(code, *pressure_times, tension_time, *span_state), code

    def _pressure(
        self, state: InterlockState, measured: Mapping[str, Scalar], asked: Mapping[str, Scalar], dt: Scalar
    ) -> tuple[tuple[Any, Any], dict[Trip, Any]]:
        x = _pressure_of(measured)
        if x is None:
            return (state.pressure_lost, state.pressure_silent), {}
        railed = _at(x, self.pressure_rail)
        lost_for, lost = _lasting(railed | (x < self.pressure_floor), state.pressure_lost, dt, self.patience)
        silent_for, silent = state.pressure_silent, False
        if "valve" in asked:
            nothing = (asked["valve"] > ASKED * self.valve_range) & (x < NOTHING_READ * self.valve_range)
            silent_for, silent = _lasting(nothing, silent_for, dt, self.implausible_after)
        trips = {
            Trip.OVER_PRESSURE: (x > self.burst_pressure) & ~railed,
            Trip.LOST_PRESSURE: lost | silent | ~jnp.isfinite(x),
        }
        return (lost_for, silent_for), trips

    def _tension(
        self, state: InterlockState, measured: Mapping[str, Scalar], dt: Scalar
    ) -> tuple[Any, dict[Trip, Any]]:
        if "tension" not in measured:
            return state.tension_lost, {}
        x = measured["tension"]
        railed = _at(x, self.tension_rail) & self.watch_tension
        lost_for, lost = _lasting(railed | (x < self.tension_floor), state.tension_lost, dt, self.patience)
        trips = {Trip.LOST_TENSION: lost | ~jnp.isfinite(x)}
        if self.watch_tension:
            trips[Trip.OVER_FORCE] = (x > self.most_tension) & ~railed
        return lost_for, trips

    def _span(
        self,
        state: InterlockState,
        measured: Mapping[str, Scalar],
        asked: Mapping[str, Scalar],
        velocity: Scalar,
        dt: Scalar,
    ) -> tuple[tuple[Any, Any, Any], dict[Trip, Any]]:
        if "span" not in measured:
            return (state.span_still, state.span_lag, state.span), {}
        x = jnp.asarray(measured["span"], float)
        still_for, lag_for, stuck, lags = state.span_still, state.span_lag, False, False
        if "motor" in asked:
            force = asked["motor"]
            # a muscle against its stop may well hold the full force
            left = jnp.abs(force - measured.get("tension", 0.0)) > UNBALANCED * self.motor_force
            full = jnp.abs(force) >= FULL * self.motor_force
            still_for, stuck = _lasting(full & left & (x == state.span), still_for, dt, self.patience)
        if "span" in asked:
            lag_for, lags = _lasting(jnp.abs(x - asked["span"]) > self.most_lag, lag_for, dt, self.patience)
        trips: dict[Trip, Any] = {
            Trip.TOO_SHORT: (x < self.shortest) & jnp.isfinite(x),
            Trip.TOO_LONG: (x > self.longest) & jnp.isfinite(x),
            Trip.OVER_SPEED: jnp.abs(velocity) > self.most_speed,
            Trip.LOST_SPAN: stuck | ~jnp.isfinite(x),
        }
        if "span" in asked:
            trips[Trip.SPAN_LAG] = lags
        return (still_for, lag_for, x), trips

    def _sensors(self, measured: Mapping[str, Scalar]) -> dict[Trip, Any]:
        within = [
            (measured[n] >= low) & (measured[n] <= high) for n, (low, high) in self.sensors.items() if n in measured
        ]
        return {Trip.OUT_OF_LIMITS: ~jnp.stack(within).all()} if within else {}

    def reason(self, code: int, measured: Mapping[str, float], time: float) -> str:
        """Describe a violation: value, limit and action, in one sentence; empty for code 0."""
        trip = Trip(int(code))
        if trip is Trip.NOTHING:
            return ""
        velocity, limit, patience = measured.get("velocity"), float(self.most_lag), with_unit(float(self.patience), "s")
        velocity = None if velocity is None else abs(float(velocity))
        tension = measured.get("tension")
        span_reads = f"the span reads {_value(measured.get('span'), 'm')}"
        sentences: dict[Trip, Callable[[], str]] = {
            Trip.OVER_PRESSURE: lambda: _over("pressure", _pressure_of(measured), "Pa", self.burst_pressure),
            Trip.OVER_FORCE: lambda: _over("tension", measured.get("tension"), "N", self.most_tension),
            Trip.TOO_SHORT: lambda: _over("span", measured.get("span"), "m", self.shortest, "or more"),
            Trip.TOO_LONG: lambda: _over("span", measured.get("span"), "m", self.longest),
            Trip.OVER_SPEED: lambda: _over("speed", velocity, "m/s", self.most_speed),
            Trip.LOST_PRESSURE: lambda: self._lost_pressure(_pressure_of(measured)),
            Trip.LOST_TENSION: lambda: (
                _doubtful("tension", tension, "N", self.tension_rail, self.tension_floor, self.patience)
                or f"the tension sensor reads {_value(tension, 'N')}, which is doubtful"
            ),
            Trip.LOST_SPAN: lambda: self._lost_span(measured.get("span")),
            Trip.EMERGENCY_STOP: lambda: "the emergency stop was pressed",
            Trip.OUT_OF_LIMITS: lambda: self._out_of_limits(measured),
            Trip.SPAN_LAG: lambda: (
                f"{span_reads}, more than {with_unit(limit, 'm')} from its set-point for {patience}: "
                "an encoder that stands still, a blocked motor, or too low gains"
            ),
        }
        return f"{trip.name.lower().replace('_', ' ')} at {time:.6g} s: {sentences[trip]()}; {_DONE}"

    def _out_of_limits(self, measured: Mapping[str, float]) -> str:
        for name, (low, high) in self.sensors.items():
            x, label, unit = measured.get(name, 0.5 * (low + high)), name.replace("_", " "), SENSORS[name].unit
            if not math.isfinite(x):
                return f"the {label} sensor reads no number"
            if x < low:
                return _over(label, x, unit, low, "or more")
            if x > high:
                return _over(label, x, unit, high)
        return "a sensor is out of its limits"

    def _lost_pressure(self, x: float | None) -> str:
        said = _doubtful("pressure", x, "Pa", self.pressure_rail, self.pressure_floor, self.patience)
        if said is not None:
            return said
        asked = with_unit(ASKED * float(self.valve_range), "Pa")
        reads = _value(x, "Pa")
        return (
            f"the pressure sensor reads {reads} though the valve was asked for more than {asked} for "
            f"{with_unit(float(self.implausible_after), 's')}: no sensor, no supply or a muscle that is cut off"
        )

    def _lost_span(self, x: float | None) -> str:
        if x is not None and not math.isfinite(x):
            return "the span sensor reads no number"
        return (
            f"the span stayed at {_value(x, 'm')} for {with_unit(float(self.patience), 's')} though the motor was asked for "
            f"its full {with_unit(float(self.motor_force), 'N')}: no encoder, or the motor is blocked"
        )


def _pressure_of(measured: Mapping[str, Scalar]) -> Any:
    """Pressure at the muscle, or at the valve if there is no sensor at the muscle."""
    return measured.get("pressure", measured.get("valve_pressure"))


def _at(x: Any, rail: Any) -> Any:
    """Whether a reading is that of the highest code; the margin is for rounding only, a code is far wider."""
    return x >= rail * (1.0 - 1e-9)


def _lasting(true: Scalar, held: Any, dt: Scalar, limit: Scalar) -> tuple[Tree, Tree]:
    """Duration of a condition [s], and whether it is `limit` [s] or longer."""
    held = jnp.where(true, held + dt, 0.0)
    return held, true & (held > limit - 0.5 * dt)


def _value(x: Scalar | None, unit: str) -> str:
    return "unknown" if x is None else with_unit(float(x), unit)


def _over(label: str, x: Scalar | None, unit: str, limit: Scalar, side: str = "or less") -> str:
    reads, most = ("unknown", with_unit(float(limit), unit)) if x is None else told_apart(unit, float(x), float(limit))
    return f"the {label} is {reads}; it must be {most} {side}"


def _doubtful(label: str, x: float | None, unit: str, rail: Any, floor: Any, patience: Any) -> str | None:
    """Reason for which a single reading shows a failed sensor, or None."""
    if x is None:
        return None
    if not math.isfinite(x):
        return f"the {label} sensor reads no number"
    lasting = f"for {with_unit(float(patience), 's')}"
    if bool(_at(x, float(rail))):
        top = with_unit(float(rail), unit)
        return (
            f"the {label} sensor is at the end of its range of {top} {lasting}: an open wire, or more than it can read"
        )
    if x < float(floor):
        least = with_unit(float(floor), unit)
        return f"the {label} sensor reads {with_unit(float(x), unit)} {lasting}, an intact one reads {least} or more"
    return None
