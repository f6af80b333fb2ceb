"""Check of the tension that a step is expected to reach, by an estimate of the muscle."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .found import Found
from .limits import Estimate, Limits
from .plan import PlannedStep
from .waveforms.waveform import words

POINTS = 4000  # of a step at which the muscle is looked at, and the extremes of both set-points


def states(step: PlannedStep, limits: Limits, estimate: Estimate | None, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Spans [m] and pressures [Pa] that a step goes through, (n,); from both ends where its beginning is uncertain."""
    if step.mode != "span":
        low, high = max(step.span.low, limits.span[0]), min(step.span.high, limits.span[1])
        return np.asarray([low, high]), np.asarray([step.pressure_reach.low, step.pressure_reach.high])
    stride = max(1, step.count // POINTS)
    chosen = np.arange(0, step.count, stride)
    if isinstance(step.motor, np.ndarray) and isinstance(step.pressure, np.ndarray):
        marked = [int(f(x)) for f in (np.argmax, np.argmin) for x in (step.motor, step.pressure)]
        chosen = np.unique(np.append(chosen, marked))
    times = chosen * dt
    low, high = starts(step, limits, estimate)
    spans = (
        [step.motor[chosen]] if isinstance(step.motor, np.ndarray) else [step.motor.at(x, times) for x in (low, high)]
    )
    if isinstance(step.pressure, np.ndarray):
        pressures = [step.pressure[chosen]]
    elif step.pressure is None:
        pressures = [np.full(times.shape, x) for x in (step.pressure_reach.low, step.pressure_reach.high)]
    else:
        pressures = [step.pressure.at(x, times) for x in (step.pressure_before.low, step.pressure_before.high)]
    pairs = [(x, p) for x in spans for p in pressures]
    return np.concatenate([x for x, _ in pairs]), np.concatenate([p for _, p in pairs])


def starts(step: PlannedStep, limits: Limits, estimate: Estimate | None) -> tuple[float, float]:
    """Span [m] at which a step may begin, shortest and longest: a muscle that a force pulled is no longer than that."""
    low, high = max(step.motor_before.low, limits.span[0]), min(step.motor_before.high, limits.span[1])
    if estimate is None or step.pulled is None or not np.isfinite(step.pulled.high):
        return low, high
    tried = np.linspace(low, high, 201)
    force = np.asarray(estimate(tried, np.full(tried.shape, step.pressure_before.low)), float)
    return low, float(tried[force <= step.pulled.high].max(initial=low))


def tension(step: PlannedStep, limits: Limits, estimate: Estimate | None, dt: float) -> Iterator[Found]:
    """The tension that the muscle would reach, where the motor does not control it."""
    if estimate is None or step.mode == "tension":
        return
    if step.mode == "span" and step.step.motor is None and step.step.pressure is None and step.index > 1:
        return  # the machine stays in a state that was judged before
    span, pressure = states(step, limits, estimate, dt)
    force = np.asarray(estimate(span, pressure), float)
    worst = int(np.argmax(force))
    allowed, who = min((limits.tension, "the load cell reads"), (limits.motor_force, "the motor pulls"))
    if not force[worst] > allowed:
        return
    place = f"{words(span[worst], 'm')} and {words(pressure[worst], 'Pa')}"
    fits = _fitting(estimate, float(span[worst]), float(pressure[worst]), allowed)
    cure = f". Up to {words(fits, 'Pa')} fits" if fits is not None else ""
    value, most = words(float(force[worst]), "N"), words(allowed, "N")
    yield Found(
        "tension",
        value,
        f"{who} up to {most}{cure}",
        f"tension would reach {value} near {place}; {who} up to {most}{cure}",
    )


def _fitting(estimate: Estimate, span: float, pressure: float, allowed: float) -> float | None:
    """Largest pressure [Pa] whose tension is allowed at a span, rounded down to 1 kPa; None if none is."""
    low, high = 0.0, pressure
    if float(np.asarray(estimate(np.asarray([span]), np.asarray([0.0])))[0]) > allowed:
        return None
    for _ in range(40):
        middle = 0.5 * (low + high)
        fine = float(np.asarray(estimate(np.asarray([span]), np.asarray([middle])))[0]) <= allowed
        low, high = (middle, high) if fine else (low, middle)
    return float(np.floor(low / 1e3) * 1e3)
