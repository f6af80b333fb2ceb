"""The check before anything moves: every set-point of a plan against the limits of a rig, all that is wrong by step."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from ..answers import brief
from ..errors import InputError, compose_sentence
from ..quantities import told_apart
from .amounts import read_amount
from .commands import Follow, Reach
from .protocol import PlannedStep, Protocol, ProtocolPlan, case_words
from .waveforms import time_words
from .waveforms.waveform import words

SLACK = 1.0 + 1e-6  # rounding of a difference of two set-points, relative
TENSION_POINTS = 4000  # of a step at which the muscle is looked at, and the extremes of both set-points
REST_POINTS = 5000
# The tension of a muscle [N] at spans [m] and pressures [Pa], of the same shape: a law, or a table that was measured.
Estimate = Callable[[Any, Any], Any]


@dataclass(frozen=True, kw_only=True)
class Limits:
    """The limits of one rig with one muscle, all inclusive; a rig without a part has no limit for it.

    Pressures are gauge.
    """

    pressure: tuple[float, float]  # of the valve's set-point [Pa]
    pressure_rate: float  # steepest change that the valve can follow [Pa/s]
    burst_pressure: float = float("inf")  # of the muscle [Pa]
    tension: float  # largest that the cell reads [N]
    motor_force: float = float("inf")  # largest pull of the motor [N]
    span: tuple[float, float]  # of the frame and the motor [m]
    speed: float  # of the motor [m/s]
    acceleration: float = float("inf")  # of the motor [m/s^2]
    rounding: float = 5e-3  # time over which the motor may round a corner of its path [s]
    sample_rates: tuple[float, float] = (1.0, 5000.0)  # [1/s]
    resolution: Mapping[str, float] = field(default_factory=dict)  # smallest step of a measured channel [SI]
    has: frozenset[str] = frozenset(
        ("valve", "motor", "person", "pressure sensor", "span sensor", "tension sensor")
    )  # sensors and parts, in the words of `Step.needs`

    __repr__ = brief


class Violation(NamedTuple):
    """A field, its value and the permitted range, as text; `said` is the whole sentence if the three make no good one."""

    field: str
    value: str
    allowed: str
    said: str = ""

    def text(self) -> str:
        """Sentence without its place."""
        return self.said or compose_sentence(self.field, self.value, self.allowed)


@dataclass(frozen=True)
class Finding:
    """A violation found by the dry run.

    `step` is its number in the plan (0: the whole protocol), `path` its place in the protocol, `case` what was varied,
    `field` what is wrong, with its value and what is allowed.
    """

    step: int
    path: str
    case: str
    field: str
    value: str
    allowed: str
    sentence: str


def dry_run(
    protocol: Protocol,
    limits: Limits,
    *,
    rest_length: float,
    start_span: float | None = None,
    muscle_estimate: Estimate | None = None,
) -> list[Finding]:
    """Check a protocol against the limits of a rig without moving anything; an empty list permits the start.

    Args:
        protocol: the protocol.
        limits: limits of the rig and the muscle.
        rest_length: rest length of the muscle [m].
        start_span: where the motor is [m]; the rest length by default.
        muscle_estimate: the tension [N] expected at spans [m] and gauge pressures [Pa], or None to leave it unchecked.
    """
    try:
        plan = protocol.expand(rest_length=rest_length, start_span=start_span)
    except InputError as error:
        return [Finding(0, "", "", error.field, str(error.value), error.problem, str(error))]
    return check_plan(plan, limits, muscle_estimate)


def check_plan(plan: ProtocolPlan, limits: Limits, muscle_estimate: Estimate | None = None) -> list[Finding]:
    """Check a plan; each violation is reported once per place and case, however often it is repeated."""
    findings = [_finding(None, f) for f in _whole(plan, limits)]
    reported: dict[str, Finding] = {}
    for step in plan.steps:
        for violation in _step(step, plan, limits, muscle_estimate):
            one = _finding(step, violation, plan.protocol.varied())
            # what a step needs does not depend on the case
            reported.setdefault(f"{step.path} {violation.value}" if violation.field == "needs" else one.sentence, one)
    return findings + list(reported.values())


def check(findings: list[Finding], *, where: str | None = None) -> None:
    """Raise `InputError` with the first of the findings and their count, if there is one."""
    if not findings:
        return
    first = findings[0]
    more = "" if len(findings) == 1 else f" (first of {len(findings)} findings)"
    case = f" ({first.case})" if first.case else ""
    field = f"{first.path}{case}: {first.field}" if first.path else first.field
    raise InputError(field, first.value, f"{first.allowed}{more}", where=where)


def _step(step: PlannedStep, plan: ProtocolPlan, limits: Limits, estimate: Estimate | None) -> Iterator[Violation]:
    missing = sorted(step.step.needs() - limits.has)
    yield from (_needed(need, limits) for need in missing)
    dt = 1.0 / plan.sample_rate
    yield from _resolved(step, plan.sample_rate)
    yield from _check_pressure(step, limits, dt)
    if "motor" not in missing:
        yield from _check_motion(step, limits, dt, estimate, plan.rest_length)
    yield from _check_tension_control(step, limits, estimate)
    yield from _check_tension(step, plan.protocol, limits, estimate, dt)
    yield from _check_until(step, plan, limits, estimate)


def _whole(plan: ProtocolPlan, limits: Limits) -> Iterator[Violation]:
    low, high = limits.sample_rates
    if not low <= plan.sample_rate <= high:
        yield Violation("sample_rate", f"{plan.sample_rate:g} Hz", f"the rig allows {low:g} Hz to {high:g} Hz")
    for need in sorted(set(plan.protocol.needs) - limits.has):
        yield _needed(need, limits)


def _needed(need: str, limits: Limits) -> Violation:
    has = f"the rig has {', '.join(sorted(limits.has))}"
    return Violation("needs", need, has, f"needs {need}; {has}")


def _resolved(step: PlannedStep, rate: float) -> Iterator[Violation]:
    for channel, command in (("pressure", step.step.pressure), (step.mode, step.step.motor)):
        if isinstance(command, Follow) and command.waveform.fastest > 0.5 * rate * (1.0 + 1e-9):
            need = time_words(0.5 / command.waveform.fastest)
            now, field = f"sampled every {time_words(1.0 / rate)}", f"{channel}.{command.waveform.kind}"
            yield Violation(field, now, f"its {command.waveform.fastest:g} Hz need {need} or less")


def _finding(step: PlannedStep | None, violation: Violation, varied: tuple[str, ...] = ()) -> Finding:
    if step is None:
        return Finding(0, "", "", violation.field, violation.value, violation.allowed, violation.text())
    case = case_words({k: v for k, v in step.case.items() if k in varied})
    section, _, place = step.path.partition(".")
    name = f"{'' if section == 'steps' else section + ' '}step {place.replace('steps.', '')}"
    label = f" {step.step.label!r}" if step.step.label else ""
    text = f"{name}{label}{f' ({case})' if case else ''}: {violation.text()}"
    return Finding(step.index, step.path, case, violation.field, violation.value, violation.allowed, text)


def check_lengths(protocol: Protocol, limits: Limits, rest_length: float) -> None:
    """Refuse a length that exceeds the longest span of the rig, whether it is a place, a way or an amplitude.

    Args:
        protocol: whose parameters are checked, in every one of their values.
        limits: limits of the rig.
        rest_length: rest length of the muscle [m], which ``L0`` stands for.

    Raises:
        InputError: names the parameter, its value and the longest span.
    """
    longest = limits.span[1]
    for p in protocol.parameters:
        for value in p.values if p.unit == "m" else ():
            length = read_amount(value, "m", field=p.name).si(rest_length)
            if abs(length) > longest:
                allowed = f"is {value}: a length is at most {words(longest, 'm')}, the longest span of the rig"
                raise InputError(p.name, None, allowed)


def _check_pressure(step: PlannedStep, limits: Limits, dt: float) -> Iterator[Violation]:
    command = step.step.pressure
    if step.pressure is None or command is None:
        return  # what is kept was judged where it was set
    low, high = limits.pressure
    reach = step.pressure_reach
    target = command.target(0.0)
    if target is not None:
        reach = Reach(target, target)
    if reach.high > high:
        yield _beyond("pressure", "Pa", reach.high, high, "the regulator allows up to {}")
    if reach.low < low:
        yield _beyond("pressure", "Pa", reach.low, low, "the regulator allows {} or more")
    if reach.high > limits.burst_pressure:
        yield _beyond("pressure", "Pa", reach.high, limits.burst_pressure, "the muscle bursts at {}")
    if isinstance(step.pressure, np.ndarray):
        held = isinstance(command, Follow) and not command.waveform.straight
        before = step.pressure_before.low if step.pressure_before.known else step.pressure[0]
        values = np.append(before, step.pressure)
        yield from _jumps(values, limits, dt) if held else _slopes(values, limits, dt)


def _slopes(values: np.ndarray, limits: Limits, dt: float) -> Iterator[Violation]:
    """Check that a waveform of straight lines is within the permitted rate, since the pressure shall follow it."""
    change, follows = np.abs(np.diff(values)), f"the valve follows {_bar(limits.pressure_rate)}/s"
    if change[0] > limits.pressure_rate * dt * SLACK:
        ends = f"{_bar(values[0])} to {_bar(values[1])}"
        said = f"the set-point jumps from {ends} where the waveform begins; {follows}"
        yield Violation("pressure", f"a jump from {ends}", f"{follows}; begin at {_bar(values[0])}", said)
    steepest = float(change[1:].max(initial=0.0)) / dt
    if steepest > limits.pressure_rate * SLACK:
        said = f"the set-point changes by {_bar(steepest)}/s; {follows}"
        yield Violation("pressure", f"{_bar(steepest)}/s steep", follows, said)


def _jumps(values: np.ndarray, limits: Limits, dt: float) -> Iterator[Violation]:
    """A waveform that is held jumps on purpose, but the valve has to get there before the next jump."""
    change = np.diff(values)
    at = np.flatnonzero(change)
    for i, following in zip(at, at[1:], strict=False):
        need, lasts = abs(change[i]) / limits.pressure_rate, (following - i) * dt
        if need > lasts * SLACK:
            needs = f"the valve needs {time_words(float(f'{need:.3g}'))}"
            ends = f"from {_bar(values[i])} to {_bar(values[i + 1])} for {time_words(lasts)}"
            yield Violation("pressure", f"a jump {ends}", needs, f"the set-point jumps {ends}; {needs}")
            return


def _bar(value: float) -> str:
    return words(value, "Pa")


def _beyond(name: str, unit: str, value: float, limit: float, said: str) -> Violation:
    """A value beyond a limit [unit], which stands in the sentence's braces, with digits that show it."""
    reads, most = told_apart(unit, value, limit)
    return Violation(name, reads, said.format(most))


def _check_motion(
    step: PlannedStep, limits: Limits, dt: float, estimate: Estimate | None, rest_length: float
) -> Iterator[Violation]:
    if step.mode == "tension" or (step.mode == "span" and step.step.motor is None and step.index > 1):
        return  # what is kept was judged where it was set
    low, high = limits.span
    reach = step.span
    to = None if step.step.motor is None else step.step.motor.target(rest_length)
    if step.mode == "span" and to is not None:
        reach = Reach(to, to)
    # a micrometre: lengths in L0 come through a product
    if np.isfinite(reach.high) and reach.high > high + 1e-6:
        yield _beyond("span", "m", reach.high, high, "the rig allows up to {}")
    if np.isfinite(reach.low) and reach.low < low - 1e-6:
        yield _beyond("span", "m", reach.low, low, "the rig allows {} or more")
    if not isinstance(step.motor, np.ndarray):
        line = step.motor
        if step.mode == "span" and line.to is not None and line.seconds is not None:
            # a ramp from an unknown start is judged by the fastest case
            far = max(abs(line.to - x) for x in _starts(step, limits, estimate))
            if far / line.seconds > limits.speed * SLACK:
                yield _beyond("speed", "m/s", far / line.seconds, limits.speed, "the motor allows up to {}")
        return
    velocity = step.motor
    if step.mode == "span":
        before = step.motor_before.low if step.motor_before.known else step.motor[0]
        velocity = np.diff(np.append(before, step.motor)) / dt
        if abs(velocity[0]) > limits.speed * SLACK:
            ends = f"{words(before, 'm')} to {words(step.motor[0], 'm')}"
            allowed = f"the motor moves at {words(limits.speed, 'm/s')} at most; go there on a line"
            yield Violation("span", f"a jump from {ends}", allowed)
            velocity = velocity[1:]
    fastest = float(np.abs(velocity).max(initial=0.0))
    if fastest > limits.speed * SLACK:
        yield _beyond("speed", "m/s", fastest, limits.speed, "the motor allows up to {}")
        return
    window = max(1, round(limits.rounding / dt))
    window = min(window, max(1, len(velocity) - 1))
    change = np.abs(velocity[window:] - velocity[:-window]) / (window * dt)
    hardest = float(change.max(initial=0.0))
    if hardest > limits.acceleration * SLACK:
        yield _beyond("acceleration", "m/s^2", hardest, limits.acceleration, "the motor allows up to {}")


def _check_tension_control(step: PlannedStep, limits: Limits, estimate: Estimate | None) -> Iterator[Violation]:
    if step.mode != "tension" or not isinstance(step.motor, np.ndarray):
        return
    reach = Reach(float(step.motor.min()), float(step.motor.max()))
    if reach.high > limits.tension:
        yield _beyond("tension", "N", reach.high, limits.tension, "the load cell reads up to {}")
    if reach.high > limits.motor_force:
        yield _beyond("tension", "N", reach.high, limits.motor_force, "the motor pulls {} at most")
    if reach.low < 0.0:
        yield Violation("tension", words(reach.low, "N"), "must be 0 N or more; a muscle cannot push")
    if estimate is not None and np.isfinite(step.pressure_reach.high):
        longest, highest = limits.span[1], step.pressure_reach.high
        largest = float(np.max(np.asarray(estimate(np.asarray([longest]), np.asarray([highest])))))
        if reach.low > largest:
            most = f"the muscle makes {{}} at most, at {words(longest, 'm')} and {words(highest, 'Pa')}"
            yield _beyond("tension", "N", reach.low, largest, most)


def states(step: PlannedStep, limits: Limits, estimate: Estimate | None, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """Spans [m] and pressures [Pa] that a step passes through, (n,); from both ends if its start is uncertain."""
    if step.mode != "span":
        low, high = max(step.span.low, limits.span[0]), min(step.span.high, limits.span[1])
        return np.asarray([low, high]), np.asarray([step.pressure_reach.low, step.pressure_reach.high])
    stride = max(1, step.count // TENSION_POINTS)
    chosen = np.arange(0, step.count, stride)
    if isinstance(step.motor, np.ndarray) and isinstance(step.pressure, np.ndarray):
        marked = [int(f(x)) for f in (np.argmax, np.argmin) for x in (step.motor, step.pressure)]
        chosen = np.unique(np.append(chosen, marked))
    times = chosen * dt
    low, high = _starts(step, limits, estimate)
    spans = (
        [step.motor[chosen]] if isinstance(step.motor, np.ndarray) else [step.motor.at(x, times) for x in (low, high)]
    )
    if isinstance(step.pressure, np.ndarray):
        pressures = [step.pressure[chosen]]
    elif step.pressure is None:
        pressures = [np.full(times.shape, x) for x in (step.pressure_reach.low, step.pressure_reach.high)]
    else:
        pressures = [
            np.asarray(step.pressure.at(x, times)) for x in (step.pressure_before.low, step.pressure_before.high)
        ]
    pairs = [(x, p) for x in spans for p in pressures]
    return np.concatenate([x for x, _ in pairs]), np.concatenate([p for _, p in pairs])


def _starts(step: PlannedStep, limits: Limits, estimate: Estimate | None) -> tuple[float, float]:
    """Span [m] at which a step may begin, shortest and longest: a muscle that a force pulled is no longer than that."""
    low, high = max(step.motor_before.low, limits.span[0]), min(step.motor_before.high, limits.span[1])
    if estimate is None or step.pulled is None or not np.isfinite(step.pulled.high):
        return low, high
    tried = np.linspace(low, high, 201)
    force = np.asarray(estimate(tried, np.full(tried.shape, step.pressure_before.low)), float)
    return low, float(tried[force <= step.pulled.high].max(initial=low))


def _check_tension(
    step: PlannedStep, protocol: Protocol, limits: Limits, estimate: Estimate | None, dt: float
) -> Iterator[Violation]:
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
    cure = ""
    if fits is not None:  # say which parameters of the protocol ask for more
        stated = {p.name: step.case[p.name] for p in protocol.parameters if p.unit == "Pa" and p.name in step.case}
        higher = [name for name, value in stated.items() if read_amount(value, "Pa", field=name).value > fits]
        lower = f": lower {' and '.join(higher)}" if higher else ""
        cure = f". Up to {words(fits, 'Pa')} fits{lower}"
    value, most = told_apart("N", float(force[worst]), allowed)
    most = f"{who} up to {most}{cure}"
    yield Violation("tension", value, most, f"tension would reach {value} near {place}; {most}")


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


def _check_until(
    step: PlannedStep, plan: ProtocolPlan, limits: Limits, estimate: Estimate | None
) -> Iterator[Violation]:
    test = step.until
    if test is None:
        return
    duration = step.count / plan.sample_rate
    if test.lasting > duration:
        yield _never(step, f"the step lasts {time_words(duration)} at most")
        return
    amount, unit = test.amount.si(plan.rest_length), test.unit
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


def _reach(step: PlannedStep, plan: ProtocolPlan, limits: Limits, estimate: Estimate | None) -> tuple[Reach, str]:
    """Range of the channel that a step's condition tests, and its cause."""
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
    if channel != "tension":
        return Reach(float("-inf"), float("inf")), "can be"  # of a sensor that nothing here predicts
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
    thinned = values[:: max(1, len(values) // REST_POINTS)]
    window = max(1, int(share * len(thinned)))
    views = np.lib.stride_tricks.sliding_window_view(thinned, window)
    return bool(np.any(views.max(axis=1) - views.min(axis=1) <= 2.0 * band))


def _never(step: PlannedStep, why: str) -> Violation:
    assert step.until is not None
    text = step.until.sentence()
    return Violation("until", text, f"it cannot happen: {why}", f"until {text} cannot happen: {why}")
