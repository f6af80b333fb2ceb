"""Checks of a step's motion: span, speed and acceleration of the motor, and its control of force."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .checks_pressure import SLACK
from .checks_tension import starts
from .found import Found
from .limits import Estimate, Limits
from .plan import Deferred, PlannedStep, Reach
from .steps import Go
from .waveforms.waveform import words


def motion(
    step: PlannedStep, limits: Limits, dt: float, estimate: Estimate | None, rest_length: float
) -> Iterator[Found]:
    """Everything wrong with the span and the velocity of a step."""
    if step.mode == "tension" or (step.mode == "span" and step.step.motor is None and step.index > 1):
        return  # what is kept was judged where it was set
    low, high = limits.span
    reach = step.span
    if step.mode == "span" and isinstance(step.step.motor, Go):
        to = step.step.motor.to.si(rest_length)
        reach = Reach(to, to)
    # a micrometre: lengths in L0 come through a product
    if np.isfinite(reach.high) and reach.high > high + 1e-6:
        yield Found("span", words(reach.high, "m"), f"the rig allows up to {words(high, 'm')}")
    if np.isfinite(reach.low) and reach.low < low - 1e-6:
        yield Found("span", words(reach.low, "m"), f"the rig allows {words(low, 'm')} or more")
    if not isinstance(step.motor, np.ndarray):
        yield from _uncertain(step, step.motor, limits, estimate)
        return
    velocity = step.motor
    if step.mode == "span":
        before = step.motor_before.low if step.motor_before.known else step.motor[0]
        velocity = np.diff(np.append(before, step.motor)) / dt
        if abs(velocity[0]) > limits.speed * SLACK:
            ends = f"{words(before, 'm')} to {words(step.motor[0], 'm')}"
            allowed = f"the motor moves at {words(limits.speed, 'm/s')} at most; go there on a line"
            yield Found("span", f"a jump from {ends}", allowed)
            velocity = velocity[1:]
    fastest = float(np.abs(velocity).max(initial=0.0))
    if fastest > limits.speed * SLACK:
        yield Found("speed", words(fastest, "m/s"), f"the motor allows up to {words(limits.speed, 'm/s')}")
        return
    window = max(1, round(limits.rounding / dt))
    window = min(window, max(1, len(velocity) - 1))
    change = np.abs(velocity[window:] - velocity[:-window]) / (window * dt)
    hardest = float(change.max(initial=0.0))
    if hardest > limits.acceleration * SLACK:
        value = words(hardest, "m/s^2")
        yield Found("acceleration", value, f"the motor allows up to {words(limits.acceleration, 'm/s^2')}")


def _uncertain(step: PlannedStep, line: Deferred, limits: Limits, estimate: Estimate | None) -> Iterator[Found]:
    """A line whose beginning is not known beforehand is as fast as from the farthest place."""
    if step.mode != "span" or line.to is None or line.seconds is None:
        return
    far = max(abs(line.to - x) for x in starts(step, limits, estimate))
    if far / line.seconds > limits.speed * SLACK:
        value = words(far / line.seconds, "m/s")
        yield Found("speed", value, f"the motor allows up to {words(limits.speed, 'm/s')}")


def tension_control(step: PlannedStep, limits: Limits, estimate: Estimate | None) -> Iterator[Found]:
    """Everything wrong with the force that the motor shall hold."""
    if step.mode != "tension" or not isinstance(step.motor, np.ndarray):
        return
    reach = Reach(float(step.motor.min()), float(step.motor.max()))
    if reach.high > limits.tension:
        yield Found("tension", words(reach.high, "N"), f"the load cell reads up to {words(limits.tension, 'N')}")
    if reach.high > limits.motor_force:
        yield Found("tension", words(reach.high, "N"), f"the motor pulls {words(limits.motor_force, 'N')} at most")
    if reach.low < 0.0:
        yield Found("tension", words(reach.low, "N"), "allowed is 0 N or more: a muscle cannot push")
    if estimate is not None and np.isfinite(step.pressure_reach.high):
        longest, highest = limits.span[1], step.pressure_reach.high
        largest = float(np.max(np.asarray(estimate(np.asarray([longest]), np.asarray([highest])))))
        if reach.low > largest:
            most = f"{words(largest, 'N')} at most, at {words(longest, 'm')} and {words(highest, 'Pa')}"
            yield Found("tension", words(reach.low, "N"), f"the muscle makes {most}")
