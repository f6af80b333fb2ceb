"""Check of tests that cannot come true in their step."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .checks_tension import states
from .found import Found
from .limits import Estimate, Limits
from .plan import Plan, PlannedStep, Reach
from .waveforms import time_words
from .waveforms.waveform import words

UNITS = {"pressure": "Pa", "span": "m", "velocity": "m/s", "tension": "N"}
POINTS = 5000


def until(step: PlannedStep, plan: Plan, limits: Limits, estimate: Estimate | None) -> Iterator[Found]:
    """A test that the step can never pass."""
    test = step.until
    if test is None:
        return
    duration = step.count / plan.sample_rate
    if test.lasting > duration:
        yield _never(step, f"the step lasts {time_words(duration)} at most")
        return
    amount, unit = test.amount.si(plan.rest_length), UNITS[test.channel]
    count = limits.resolution.get(test.channel, 0.0)
    if test.kind in ("settled", "close") and amount < count:
        yield _never(step, f"the {test.channel} sensor counts in steps of {words(count, unit)}")
    elif test.kind in (">=", "<="):
        reach, why = _reach(step, plan, limits, estimate)
        # rounding of products with the rest length
        near = 1e-9 * max(abs(amount), abs(reach.low) if np.isfinite(reach.low) else 0.0)
        if test.kind == ">=" and amount > reach.high + near:
            yield _never(step, f"{test.channel} {why} {words(reach.high, unit)} at most")
        if test.kind == "<=" and amount < reach.low - near:
            yield _never(step, f"{test.channel} {why} {words(reach.low, unit)} at least")
    elif test.kind == "settled":
        driven = step.pressure if test.channel == "pressure" else step.motor if test.channel == step.mode else None
        if isinstance(driven, np.ndarray) and not _rests(driven, amount, test.lasting / duration):
            yield _never(step, f"the set-point of {test.channel} moves on all the time")


def _reach(step: PlannedStep, plan: Plan, limits: Limits, estimate: Estimate | None) -> tuple[Reach, str]:
    """Where the channel of a step's test can be, and by what."""
    assert step.until is not None
    channel = step.until.channel
    if channel == "pressure":
        before, now = step.pressure_before, step.pressure_reach
        return Reach(min(before.low, now.low), max(before.high, now.high)), "is set to"
    if channel == "span":
        low, high = max(step.span.low, limits.span[0]), min(step.span.high, limits.span[1])
        return Reach(low, high), "can be"
    if channel == "velocity":
        if step.mode == "velocity" and isinstance(step.motor, np.ndarray):
            return Reach(float(min(step.motor.min(), 0.0)), float(max(step.motor.max(), 0.0))), "is set to"
        if step.mode == "span" and isinstance(step.motor, np.ndarray) and step.count > 1:
            speed = np.diff(step.motor) * plan.sample_rate
            return Reach(float(min(speed.min(), 0.0)), float(max(speed.max(), 0.0))), "is driven at"
        return Reach(-limits.speed, limits.speed), "can be"
    if estimate is None or step.mode == "tension":
        return Reach(0.0, limits.tension), "is read up to"
    spans, pressures = states(step, limits, estimate, 1.0 / plan.sample_rate)
    force = np.asarray(estimate(spans, pressures), float)
    low = float(force.min())
    at_first = step.pressure_before.low  # the gas of the step before is still there when it begins
    if np.isfinite(at_first):
        low = min(low, float(np.min(np.asarray(estimate(spans, np.full(spans.shape, at_first))))))
    return Reach(min(low, limits.tension), min(float(force.max()), limits.tension)), "can be"


def _rests(values: np.ndarray, band: float, share: float) -> bool:
    """Whether a set-point stays within a band for a share of the step somewhere."""
    thinned = values[:: max(1, len(values) // POINTS)]
    window = max(1, int(share * len(thinned)))
    views = np.lib.stride_tricks.sliding_window_view(thinned, window)
    return bool(np.any(views.max(axis=1) - views.min(axis=1) <= 2.0 * band))


def _never(step: PlannedStep, why: str) -> Found:
    assert step.until is not None
    text = step.until.sentence()
    return Found("until", text, f"it cannot happen: {why}", f"until {text} cannot happen: {why}")
