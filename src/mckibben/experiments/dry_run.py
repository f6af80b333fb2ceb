"""The check before anything moves: every set-point of a plan against the limits of a rig, all that is wrong by step."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ..errors import InputError
from .checks_motion import motion, tension_control
from .checks_pressure import pressure
from .checks_tension import tension
from .checks_until import until
from .found import Found
from .limits import Estimate, Limits
from .plan import Plan, PlannedStep
from .protocol import Protocol, used_by
from .sentence import case_words
from .steps import Follow
from .waveforms import time_words


@dataclass(frozen=True)
class Finding:
    """One thing that is wrong, in words.

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
    """All that is wrong with a protocol on a rig; nothing moves, and an empty list means that it may start.

    Args:
        protocol: what to do.
        limits: of the rig and the muscle.
        rest_length: of the muscle [m].
        start_span: where the motor is [m]; the rest length where left out.
        muscle_estimate: the tension [N] expected at spans [m] and gauge pressures [Pa], or None to leave it unchecked.
    """
    try:
        plan = protocol.expand(rest_length=rest_length, start_span=start_span)
    except InputError as error:
        return [Finding(0, "", "", error.field, str(error.value), error.allowed, str(error))]
    return check_plan(plan, limits, muscle_estimate)


def check_plan(plan: Plan, limits: Limits, muscle_estimate: Estimate | None = None) -> list[Finding]:
    """The same for a plan; each thing is named once for a place and a case, however often it is repeated."""
    findings = [_finding(None, f) for f in _whole(plan, limits)]
    seen: dict[str, Finding] = {}
    for step in plan.steps:
        for found in _step(step, plan, limits, muscle_estimate):
            one = _finding(step, found, plan.protocol.varied())
            # what a step needs does not depend on the case
            seen.setdefault(f"{step.path} {found.value}" if found.field == "needs" else one.sentence, one)
    return findings + list(seen.values())


def check(findings: list[Finding], *, where: str | None = None) -> None:
    """Raise `InputError` with the first of the findings and their count, if there is one."""
    if not findings:
        return
    first = findings[0]
    more = "" if len(findings) == 1 else f" (first of {len(findings)} findings)"
    case = f" ({first.case})" if first.case else ""
    field = f"{first.path}{case}: {first.field}" if first.path else first.field
    raise InputError(field, first.value, f"{first.allowed}{more}", where=where)


def _step(step: PlannedStep, plan: Plan, limits: Limits, estimate: Estimate | None) -> Iterator[Found]:
    missing = sorted(used_by(step.step) - limits.has)
    yield from (_needed(need, limits) for need in missing)
    dt = 1.0 / plan.sample_rate
    yield from _resolved(step, plan.sample_rate)
    yield from pressure(step, limits, dt)
    if "motor" not in missing:
        yield from motion(step, limits, dt, estimate, plan.rest_length)
    yield from tension_control(step, limits, estimate)
    yield from tension(step, limits, estimate, dt)
    yield from until(step, plan, limits, estimate)


def _whole(plan: Plan, limits: Limits) -> Iterator[Found]:
    low, high = limits.sample_rates
    if not low <= plan.sample_rate <= high:
        yield Found("sample_rate", f"{plan.sample_rate:g} Hz", f"the rig allows {low:g} Hz to {high:g} Hz")
    for need in sorted(set(plan.protocol.needs) - limits.has):
        yield _needed(need, limits)


def _needed(need: str, limits: Limits) -> Found:
    has = f"the rig has {', '.join(sorted(limits.has))}"
    return Found("needs", need, has, f"needs {need}; {has}")


def _resolved(step: PlannedStep, rate: float) -> Iterator[Found]:
    for channel, command in (("pressure", step.step.pressure), (step.mode, step.step.motor)):
        if isinstance(command, Follow) and command.waveform.fastest > 0.5 * rate * (1.0 + 1e-9):
            need = time_words(0.5 / command.waveform.fastest)
            yield Found(
                f"{channel}.{command.waveform.kind}",
                f"sampled every {time_words(1.0 / rate)}",
                f"its {command.waveform.fastest:g} Hz need {need} or less",
            )


def _finding(step: PlannedStep | None, found: Found, varied: tuple[str, ...] = ()) -> Finding:
    if step is None:
        return Finding(0, "", "", found.field, found.value, found.allowed, found.text())
    case = case_words({k: v for k, v in step.case.items() if k in varied})
    section, _, place = step.path.partition(".")
    name = f"{'' if section == 'steps' else section + ' '}step {place.replace('steps.', '')}"
    label = f" {step.step.label!r}" if step.step.label else ""
    text = f"{name}{label}{f' ({case})' if case else ''}: {found.text()}"
    return Finding(step.index, step.path, case, found.field, found.value, found.allowed, text)
