"""A protocol on the page Bench: a sentence with editable numbers, a form, the text of its file, and its dry run."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...assembly.muscle_unit import MuscleUnit
from ...bench.prepare import PreparedRun, expected, prepare
from ...bench.rig import Rig
from ...bench.rig_file import rig as rig_of
from ...bench.rig_file import rig_names
from ...bench.session.interface import prepare_for_session
from ...documents import JsonValue
from ...errors import InputError, MckibbenError
from ...experiments.commands import names_in
from ...experiments.protocol import Protocol, ProtocolParameter, clauses, is_inferred
from ...experiments.read import with_values
from ...quantities import from_si, shown_unit, split_values, with_unit
from ...specimens import Specimen
from ..charts import plain_numbers
from ..forms import plain_text

COLOURS = {"Pa": "pressure", "N": "tension", "m": "length"}  # of a number, by its unit
_NUMBER = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")
_TOKENS = re.compile(r"[-+]?(?<![\w.])\d[\d.]*(?:e[-+]?\d+)?(?: (?:bar/s|bar|L0/s|L0|cm/s|cm|m/s|mm|m|N/s|N|Hz|us|ms|s|deg|"
                     r"cycles|cycle|times)(?![\w/]))?|this \w+|\w+|\s+|.")  # fmt: skip
FACTORS = (1.01, 0.99, 1.5)


def faces(protocol: Protocol) -> dict[str, JsonValue]:
    """Return all three views."""
    views = {
        "sentence": sentence(protocol),
        "full": protocol.sentence(),
        "form": form(protocol),
        "text": protocol.toml(),
    }
    return {"name": protocol.name, "title": protocol.title, "source": protocol.source, **views}


def sentence(protocol: Protocol) -> list[dict[str, JsonValue]]:
    """Split the sentence into clauses: path of the step, and pieces of text, some of them fields of a parameter."""
    said = clauses(protocol)
    cut = [_TOKENS.findall(text) for _, text in said]
    owner: dict[tuple[int, int], ProtocolParameter] = {}
    for p in protocol.parameters:
        for other in _changed(protocol, p):
            for i, (mine, theirs) in enumerate(zip(cut, other, strict=True)):
                if len(mine) == len(theirs):
                    for j in [j for j, (a, b) in enumerate(zip(mine, theirs, strict=True)) if a != b]:
                        owner.setdefault((i, j), p)
    known = {f"this {p.name.replace('_', ' ')}": p for p in protocol.parameters if len(p.values) > 1}
    parts = []
    for i, (path, _) in enumerate(said):
        pieces: list[dict[str, Any]] = []
        for j, token in enumerate(cut[i]):
            owned = owner.get((i, j)) or known.get(token)
            if owned is not None:
                pieces.append({"text": token, "name": owned.name, "colour": COLOURS.get(owned.unit, "")})
            elif pieces and "name" not in pieces[-1]:
                pieces[-1]["text"] += token
            else:
                pieces.append({"text": token})
        if pieces and "name" not in pieces[0]:
            pieces[0]["text"] = pieces[0]["text"][:1].upper() + pieces[0]["text"][1:]
        parts.append({"path": path, "pieces": pieces})
    return parts


def _changed(protocol: Protocol, p: ProtocolParameter) -> list[list[list[str]]]:
    """Return the clauses with another value of a parameter, to locate its number."""
    match = _NUMBER.fullmatch(str(p.values[0])) if len(p.values) == 1 else None
    if match is None or p.unit == "word":
        return []
    number, unit = float(match[1]), match[2]
    for factor in FACTORS:
        whole = p.unit == "1" and number == int(number)
        other = number + (1.0 if factor > 1.0 else -1.0) if whole or number == 0.0 else number * factor
        words = f"{int(other) if whole else f'{other:.6g}'} {unit}".strip()
        try:
            return [[_TOKENS.findall(text) for _, text in clauses(with_values(protocol, {p.name: words}))]]
        except MckibbenError:
            continue
    return []


def form(protocol: Protocol) -> list[dict[str, JsonValue]]:
    """List a field of every choice and parameter: name, label, value, unit, meaning and what is allowed."""
    fields: list[dict[str, Any]] = []
    for c in protocol.choices:
        options = [o for o, _ in c.options]
        value = ", ".join(c.values)
        inferred = set(c.values) <= set(c.inferred)
        one = _field(c.name, value, "", c.about, f"one or more of {', '.join(options)}", "", inferred)
        fields.append(one | {"options": options})
    set_by = {k for c in protocol.choices for _, sets in c.options for k, _ in sets}
    for p in protocol.parameters:
        if not p.values and p.name in set_by:
            continue
        value, unit = _value(p)
        allowed = f"{p.bounds[0]} to {p.bounds[1]}" if p.bounds else ""
        inferred = any(is_inferred(p, v) for v in p.values)
        fields.append(_field(p.name, value, unit, p.about, allowed, COLOURS.get(p.unit, ""), inferred))
    return fields


def _field(
    name: str, value: str, unit: str, about: str, allowed: str, colour: str, inferred: bool
) -> dict[str, JsonValue]:
    words = name.replace("_", " ")
    label = words[:1].upper() + words[1:]
    text = {"name": name, "label": label, "value": value, "unit": unit, "about": about, "options": None}
    return {**text, "allowed": allowed, "colour": colour, "inferred": inferred}


def _value(p: ProtocolParameter) -> tuple[str, str]:
    """Return the values of a parameter as text, and their common unit."""
    if p.unit == "word":
        return ", ".join(map(str, p.values)), ""
    matches = [_NUMBER.fullmatch(str(v)) for v in p.values]
    units = {m[2] for m in matches if m}
    if len(units) == 1 and all(matches):
        return ", ".join(m[1] for m in matches if m), units.pop()
    return ", ".join(map(str, p.values)), ""


def changed(protocol: Protocol, name: str, words: str) -> Protocol:
    """Return the protocol with another value of a parameter or choice; plain numbers are in the unit of the field."""
    text = plain_text(words)
    if not text:
        raise InputError(name, None, "is empty")
    unit = next((_value(p)[1] for p in protocol.parameters if p.name == name), "")
    listed = split_values(text, field=name)
    full = [f"{w} {unit}" if unit and (m := _NUMBER.fullmatch(w)) and not m[2] else w for w in listed]
    return with_values(protocol, {name: full if len(full) > 1 else full[0] if full else text})


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
    """

    prepared: PreparedRun | None
    plain: dict[str, Any]  # all of it for a page [SI]

    @classmethod
    def refused(cls, sentence: str, field: str = "") -> DryRun:
        """Return the result of a dry run that could not be made."""
        findings = [{"sentence": sentence, "path": "", "field": field}]
        return cls(
            None, {"findings": findings, "passed": False, "limits": [], "cure": None, "duration": 0.0, "curves": {}}
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
    """Make the dry run of a protocol; errors of the protocol become findings."""
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
        "at_most": bench.plan.may_end_early,
        "plumbing": bench.layout,
        "rest_length": bench.plan.rest_length,
        "lane": lane(bench),
    }
    curves, limits = _curves(bench), bench.rig.limits(bench.layout)
    tension = min(limits.tension, limits.motor_force)
    tops = {"pressure": limits.pressure[1], "tension": tension, "length": limits.span[1]}
    far, rows = np.zeros(curves["time"].shape, bool), []
    for name, top in tops.items():
        if math.isfinite(top):
            far |= np.abs(np.nan_to_num(curves[name])) > FAR * top
            known = curves[name][np.isfinite(curves[name])]
            if known.size:
                peak = float(known.max())
                rows.append({"name": name, "peak": peak, "limit": float(top), "share": peak / float(top)})
    plain["limits"] = rows
    plain["curves"] = {n: plain_numbers(v if n == "time" else np.where(far, np.nan, v), 6) for n, v in curves.items()}
    plain["cure"] = _cure(bench) if findings else None
    lacking = [f for f in bench.findings if f.field == "needs"]
    plain["rigs"] = [] if on_machine or not lacking else _rigs_with({str(f.value) for f in lacking})
    return DryRun(bench, plain)


def _rigs_with(needs: set[str]) -> list[dict[str, JsonValue]]:
    """List the shipped rigs that have some parts, with their titles."""
    rigs = [rig_of(name) for name in rig_names()]
    having = [one for one in rigs if any(needs <= one.limits(layout).has for layout in one.plumbing)]
    return [{"name": one.name, "title": one.title} for one in having]


def lane(bench: PreparedRun) -> list[dict[str, JsonValue]]:
    """List the steps in time: path, label, start, end [s], and the period of their cycles [s] where they have any."""
    rate, steps = bench.plan.sample_rate, []
    for step in bench.plan.steps[:CYCLES]:
        frequency = step.step.frequency()
        times = {"start": step.start / rate, "end": (step.start + step.count) / rate}
        period = 1.0 / frequency if frequency else 0.0
        steps.append({"path": step.path, "label": step.step.label or "step", **times, "period": period})
    return steps


def _curves(bench: PreparedRun) -> dict[str, np.ndarray]:
    """Return time [s] and expected channels, (n,) each, NaN if only the machine decides."""
    plan = bench.plan
    rate, total = plan.sample_rate, plan.samples
    near = min(total, round(SEEN * rate))
    ends = np.linspace(0, near - 1, min(near, FINE)), np.linspace(near - 1, total - 1, POINTS)
    at = np.unique(np.concatenate(ends).astype(int))
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
    # the flow of ambient air into the muscle while its gas stays at ambient temperature
    law, room, flow = bench.unit.law, float(bench.rig.environment.pressure_abs), np.full(len(at), np.nan)
    if len(at) >= 3 and law.has_volume():
        span, pressure = (np.where(np.isfinite(values[n]), values[n], 0.0) for n in ("span", "pressure"))
        gas = (pressure + room) / room * np.asarray(law.braid_volume(span, pressure))
        flow = np.where(known, np.gradient(gas, at / rate), np.nan)
    return {
        "time": at / rate,
        "pressure": values["pressure"],
        "length": values["span"],
        "tension": tension,
        "valve": values["pressure"] / float(bench.rig.valve_out.high),
        "flow": flow,
    }


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
        try:
            changed = with_values(bench.protocol, {p.name: words})
            other = prepare(changed, muscle=bench.specimen or bench.unit, unit=bench.unit, rig=bench.rig)
            holds = not other.findings
        except InputError:
            holds = False
        low, high, best = (middle, high, words) if holds else (low, middle, best)
    return best


def laws(unit: MuscleUnit, low: float, high: float, top: float) -> list[dict[str, JsonValue]]:
    """Compute the thin lines of the live plot: tension over length at whole bars [SI], with the pressure as text."""
    bar = 1.0 / from_si(1.0, "Pa", shown_unit("Pa"))
    lengths = np.linspace(low, high, 60)
    tension, lines = expected(unit), []
    for n in range(1, 6):
        if n * bar > top:
            break
        values = np.asarray(tension(lengths, np.full(len(lengths), n * bar)))
        lines.append(
            {
                "words": with_unit(n * bar, "Pa"),
                "length": plain_numbers(lengths, 6),
                "tension": plain_numbers(values, 6),
            }
        )
    return lines
