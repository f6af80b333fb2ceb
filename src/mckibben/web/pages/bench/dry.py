"""The dry run as a page shows it: violations, the distance to the limits, and the expected channels."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ....assembly.muscle_unit import MuscleUnit
from ....bench.prepare import PreparedRun, expected, prepare
from ....bench.rig import Rig
from ....bench.session.interface import prepare_for_session
from ....documents import JsonValue
from ....errors import InputError
from ....experiments.commands import names_in
from ....experiments.protocol import Protocol, ProtocolParameter
from ....experiments.read import with_values
from ....quantities import from_si, shown_unit, with_unit
from ....specimens import Specimen

SEEN, FINE, POINTS = 12.0, 3000, 1500  # the first seconds have so many points, the rest so many
CYCLES = 400  # drawn one by one
FAR = 10.0  # times a limit of the machine, beyond which nothing is drawn
TRIES = 9  # values that the search for a cure looks at
CAUSES = {
    "pressure": ("Pa",),
    "tension": ("Pa", "m", "N"),
    "span": ("m",),
    "velocity": ("m/s", "1/s"),
    "speed": ("m", "1/s"),
}


@dataclass(frozen=True)
class DryRun:
    """The result of a dry run.

    Attributes:
        prepared: the run, ready to start if the dry run passes; None if the protocol could not be prepared.
        plain: all of it for a page [SI].
    """

    prepared: PreparedRun | None
    plain: dict[str, Any]

    @classmethod
    def refused(cls, sentence: str, field: str = "") -> DryRun:
        """Return the result of a dry run that could not be made."""
        finding = {"sentence": sentence, "path": "", "field": field}
        return cls(
            None, {"passed": False, "findings": [finding], "limits": [], "cure": None, "duration": 0.0, "curves": {}}
        )

    @property
    def passed(self) -> bool:
        """Whether the run may start."""
        return self.prepared is not None and not self.prepared.findings

    @property
    def sentence(self) -> str:
        """The result in one line."""
        if not self.passed:
            return f"Dry run fails: {self.plain['findings'][0]['sentence']}"
        near = max(self.plain["limits"], key=lambda one: one["share"], default=None)
        words = f", nearest limit {near['name']} at {100.0 * near['share']:.0f} %" if near else ""
        return f"Dry run passed{words}."


def dry_run(protocol: Protocol, spec: Specimen, unit: MuscleUnit, rig: Rig, *, on_machine: bool = False) -> DryRun:
    """Make the dry run of a protocol; errors of the protocol become findings.

    Args:
        protocol: the protocol.
        spec: the muscle's specimen.
        unit: the muscle.
        rig: where.
        on_machine: for a session that has a real machine of the rig.
    """
    try:
        if on_machine:
            bench = prepare_for_session(protocol, rig, muscle=spec, unit=unit)
        else:
            bench = prepare(protocol, muscle=spec, unit=unit, rig=rig)
    except InputError as error:
        return DryRun.refused(str(error), error.field)
    findings = [{"sentence": f.sentence, "path": f.path, "field": f.field} for f in bench.findings]
    plain: dict[str, Any] = {
        "passed": not findings,
        "findings": findings,
        "cautions": list(bench.cautions),
        "duration": bench.plan.duration,
        "plumbing": bench.layout,
        "rest_length": bench.plan.rest_length,
        "lane": lane(bench),
    }
    curves = _curves(bench)
    plain["limits"] = _limits(bench, curves)
    plain["curves"] = {n: _plain(v) for n, v in _drawable(bench, curves).items()}
    plain["cure"] = _cure(bench) if findings else None
    return DryRun(bench, plain)


def lane(bench: PreparedRun) -> list[dict[str, JsonValue]]:
    """List the steps in time: path, label, start, end [s], and the period of their cycles [s] where they have any."""
    rate, steps = bench.plan.sample_rate, []
    for step in bench.plan.steps[:CYCLES]:
        frequency = step.step.frequency()
        steps.append(
            {
                "path": step.path,
                "label": step.step.label or "step",
                "start": step.start / rate,
                "end": (step.start + step.count) / rate,
                "period": 1.0 / frequency if frequency else 0.0,
            }
        )
    return steps


def _curves(bench: PreparedRun) -> dict[str, np.ndarray]:
    """Return time [s] and expected channels, (n,) each, NaN if only the machine decides."""
    plan = bench.plan
    rate, total = plan.sample_rate, plan.samples
    near = min(total, round(SEEN * rate))
    at = np.unique(
        np.concatenate([np.linspace(0, near - 1, min(near, FINE)), np.linspace(near - 1, total - 1, POINTS)]).astype(
            int
        )
    )
    names = ("pressure", "span", "pull")
    values = {n: np.full(len(at), np.nan) for n in names}
    for step in plan.steps:
        mine = (at >= step.start) & (at < step.start + step.count)
        if not mine.any():
            continue
        k = at[mine] - step.start
        if isinstance(step.pressure, np.ndarray):
            values["pressure"][mine] = step.pressure[k]
        if isinstance(step.motor, np.ndarray):
            name = {"span": "span", "tension": "pull"}.get(step.mode)
            if name:
                values[name][mine] = step.motor[k]
    tension = np.full(len(at), np.nan)
    known = np.isfinite(values["pressure"]) & np.isfinite(values["span"])
    if known.any():
        tension[known] = expected(bench.unit)(values["span"][known], values["pressure"][known])
    tension = np.where(np.isfinite(values["pull"]), values["pull"], tension)
    return {
        "time": at / rate,
        "pressure": values["pressure"],
        "length": values["span"],
        "tension": tension,
        "valve": values["pressure"] / float(bench.rig.valve_out.high),
        "flow": _flow(bench, at / rate, values["span"], values["pressure"]),
    }


def _drawable(bench: PreparedRun, curves: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """Replace values far beyond the limits of the machine by NaN."""
    limits = bench.rig.limits(bench.layout)
    tops = {
        "pressure": limits.pressure[1],
        "tension": min(limits.tension, limits.motor_force),
        "length": limits.span[1],
    }
    far = np.zeros(curves["time"].shape, bool)
    for name, top in tops.items():
        if math.isfinite(top):
            far |= np.abs(np.nan_to_num(curves[name])) > FAR * top
    return {n: v if n == "time" else np.where(far, np.nan, v) for n, v in curves.items()}


def _flow(bench: PreparedRun, time: np.ndarray, span: np.ndarray, pressure: np.ndarray) -> np.ndarray:
    """Return the flow of ambient air into the muscle while its gas stays at ambient temperature [m^3/s]."""
    law, room = bench.unit.law, float(bench.rig.environment.pressure_abs)
    if len(time) < 3 or not law.has_volume():
        return np.full(len(time), np.nan)
    known = np.where(np.isfinite(span), span, 0.0), np.where(np.isfinite(pressure), pressure, 0.0)
    gas = (known[1] + room) / room * np.asarray(law.braid_volume(*known))
    flow = np.gradient(gas, time)
    return np.where(np.isfinite(span) & np.isfinite(pressure), flow, np.nan)


def _limits(bench: PreparedRun, curves: dict[str, np.ndarray]) -> list[dict[str, JsonValue]]:
    """List name, peak and limit [SI] of each limited quantity, and the peak's share of the limit."""
    limits = bench.rig.limits(bench.layout)
    rows = []
    for name, limit in (
        ("pressure", limits.pressure[1]),
        ("tension", min(limits.tension, limits.motor_force)),
        ("length", limits.span[1]),
    ):
        values = curves[name][np.isfinite(curves[name])]
        if values.size and math.isfinite(limit):
            peak = float(values.max())
            rows.append({"name": name, "peak": peak, "limit": float(limit), "share": peak / float(limit)})
    return rows


def _cure(bench: PreparedRun) -> dict[str, JsonValue] | None:
    """Find the largest value of one number, below the given one, with which the dry run passes."""
    finding, protocol = bench.findings[0], bench.protocol
    units = next((u for key, u in CAUSES.items() if finding.field.startswith(key)), ())
    section, _, place = finding.path.partition(".")
    parts = getattr(protocol, section, ()) if section else ()
    number = place.split(".")[0]
    used = names_in(parts[int(number) - 1]) if number.isdigit() and int(number) <= len(parts) else set()
    for p in protocol.parameters:
        if p.name in used and p.unit in units and len(p.values) == 1:
            value = _fitting(bench, p)
            if value is not None:
                return {"name": p.name, "words": value, "sentence": f"Up to {value} fits."}
    return None


def _fitting(bench: PreparedRun, p: ProtocolParameter) -> str | None:
    """Find the largest value of a parameter, below the present one, with which the dry run passes."""
    number, _, unit = str(p.values[0]).partition(" ")
    try:
        top = float(number)
    except ValueError:
        return None
    places = max(1, len(number.partition(".")[2]))
    low, high, best = 0.0, top, None
    for _ in range(TRIES):
        middle = 0.5 * (low + high)
        words = f"{math.floor(middle * 10**places) / 10**places:g} {unit}".strip()
        if words == best:
            break
        if _holds(bench, p.name, words):
            low, best = middle, words
        else:
            high = middle
    return best


def _holds(bench: PreparedRun, name: str, words: str) -> bool:
    try:
        other = prepare(
            with_values(bench.protocol, {name: words}),
            muscle=bench.specimen or bench.unit,
            unit=bench.unit,
            rig=bench.rig,
        )
    except InputError:
        return False
    return not other.findings


def laws(unit: MuscleUnit, low: float, high: float, top: float) -> list[dict[str, JsonValue]]:
    """Compute the thin lines of the live plot: tension over length at whole bars [SI], with the pressure as text."""
    bar = 1.0 / from_si(1.0, "Pa", shown_unit("Pa"))
    lengths = np.linspace(low, high, 60)
    tension, lines = expected(unit), []
    for n in range(1, 6):
        if n * bar > top:
            break
        values = np.asarray(tension(lengths, np.full(len(lengths), n * bar)))
        lines.append({"words": with_unit(n * bar, "Pa"), "length": _plain(lengths), "tension": _plain(values)})
    return lines


def _plain(values: np.ndarray) -> list[float | None]:
    return [float(f"{v:.6g}") if math.isfinite(v) else None for v in values.tolist()]
