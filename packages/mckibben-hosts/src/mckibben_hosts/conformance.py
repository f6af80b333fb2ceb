"""Conformance of a host: the scenarios in it against the same systems integrated as one, and a certificate of the result.

Measured are the errors of span, mean tension and pressure at steps of 0.5, 1, 2 and 5 ms, the order of the coupling, the
gap between the host's work at the border and the part's account of it, whether states can be saved, restored, copied and
reset with equal bits, the smallest mass that the host can move, and its speed.
"""

from __future__ import annotations

import functools
import importlib
import itertools
import json
import math
import os
import platform
import threading
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import numpy as np

from mckibben.answers import Answer, Column, Table
from mckibben.documents import JsonValue, parse_json, read_text, write_text
from mckibben.errors import ConvergenceError, InputError
from mckibben.quantities import from_si, with_unit
from mckibben.recordings.provenance import versions
from mckibben.verbs import ParameterType, verb

from .adapters import HostAdapter, HostedMechanism
from .scenarios import SCENARIOS, START, STEPS, HostReference, Scenario, hanging, scenario

SCHEMA = 1
JUDGED = 1e-3  # step at which limits hold [s]
# Twice what an ideal host meets: largest error of the position at 1 ms [m] or [rad].
POSITION_LIMITS = {"hang": 0.06e-3, "slack": 0.1e-3, "joint": math.radians(0.25), "tank": 0.07e-3}
ORDERED = ("hang", "slack", "joint", "tank")  # scenarios whose order is judged
LEAST_ORDER = 1.7  # between 1 and 2 ms
LARGEST_GAP = 5e-3  # work at the border over turnover, at 1 ms
LARGEST_SLACK = 1e-9  # tension while the same system integrated as one is slack; at rest it is found to 1e-10 [N]
LARGEST_GAS_CHANGE = 1e-9  # of the gas in a closed part, over its mass: rounding of some hundred steps
CHECKED = 40  # steps after a restored state that are compared
THREADS = 4
LIGHT_LOAD = 40.0  # force on the mass whose smallest value is sought [N]
LIGHT_TIME, LIGHT_TAIL = 0.3, 0.1  # of a trial, and its end that is judged [s]
LIGHT_CALM = 4e-3  # largest motion at the end of a stable trial, in which the valve leaks and the mass swings [m]
LIGHT_RANGE = (1e-3, 4.0)  # of masses [kg]
TIMED = 400  # steps

HOSTS: dict[str, str] = {
    "python": "adapters:PythonHost",
    "c": "adapters:CHost",
    "mujoco": "mujoco_host:MujocoHost",
    "mujoco-python": "mujoco_host:MujocoPythonHost",
    "warp": "warp_host:WarpHost",
    "newton": "warp_host:NewtonHost",
    "drake": "drake_host:DrakeHost",
    "opensim": "opensim:OpensimHost",
    "fmi3": "fmi_host:Fmi3Host",
    "fmi2": "fmi_host:Fmi2Host",
    "libcosim": "fmi_host:LibcosimHost",
}
"""Adapters by the names of their hosts, as ``module:class`` of this package; a module is imported when it is asked for."""


HostName = Annotated[Any, ParameterType("HOST")]
ScenarioName = Annotated[str, ParameterType("SCENARIO")]


class HostTrace(NamedTuple):
    """A scenario as a host ran it.

    Attributes:
        positions: at every step, the start first [m] or [rad].
        tensions: mean over each step, by muscle [N].
        pressures: at the end of each step, by muscle [Pa].
        host_work: of the host at the border, by the kicks that it gave [J].
        part_work: by the part's account [J].
        gas: in all volumes of the part, at the end of each step [kg]; None where the host does not know it.
    """

    positions: np.ndarray
    tensions: dict[str, np.ndarray]
    pressures: dict[str, np.ndarray]
    host_work: float
    part_work: float
    gas: np.ndarray | None


class Verdict(NamedTuple):
    """A limit of a certificate: what was measured, the limit, and whether it holds."""

    what: str
    value: float
    limit: float
    unit: str
    holds: bool


@dataclass(frozen=True)
class Certificate(Answer):
    """What a host does with a part.

    Attributes:
        host: its name.
        content: all that was measured, as the JSON file has it.
        verdicts: limits that were judged.
    """

    host: str
    content: dict[str, Any]
    verdicts: tuple[Verdict, ...]

    @property
    def holds(self) -> bool:
        """Whether all limits hold."""
        return all(verdict.holds for verdict in self.verdicts)

    def to_dict(self) -> dict[str, JsonValue]:
        """The certificate as JSON."""
        return self.content | {"verdicts": [v._asdict() for v in self.verdicts], "holds": self.holds}

    def failure(self) -> str | None:
        """Nothing beside the table of limits, where one is missed."""
        return None if self.holds else ""

    def tables(self) -> list[Table]:
        """Largest differences of each scenario and step, and the limits."""
        rows = []
        for name, measured in self.content["scenarios"].items():
            for period, row in measured["steps"].items():
                off, unit, shown = row.get("position_error"), *(("rad", "deg") if measured["rotary"] else ("m", "mm"))
                position = "given" if off is None else f"{from_si(off, unit, shown):.3f} {shown}"
                named = {"scenario": name, "step": float(period), "position": position}
                rows.append(named | {key: row[key] for key in ("tension_error", "pressure_error", "gap_J")})
        columns = (
            Column("scenario"),
            Column("step", unit="s", shown="ms", places="g"),
            Column("position", right=True),
            Column("tension_error", "mean tension", "N", places=".3f"),
            Column("pressure_error", "pressure", "Pa", "mbar", ".2f"),
            Column("gap_J", "gap of work", "J", "mJ", ".2f"),
        )
        judged = [
            {
                "what": one.what,
                **{key: with_unit(getattr(one, key), one.unit, 3) for key in ("value", "limit")},
                "holds": "holds" if one.holds else "is missed",
            }
            for one in self.verdicts
        ]
        limits = (
            Column("what", ""),
            Column("value", "measured", right=True),
            Column("limit", right=True),
            Column("holds", ""),
        )
        c = self.content
        how = f"{c['title']}; {c['version']}; {'staggered' if c['staggered'] else 'synchronous'}"
        title = f"{how}\nLargest differences from the same system integrated as one"
        return [Table(title, columns, rows), Table("Limits", limits, judged)]

    def remarks(self) -> list[str]:
        """Smallest mass and speed, and what is to be known of the host."""
        said = []
        if "steps_per_s" in self.content:
            masses = ", ".join(
                f"{'none' if m is None else f'{1e3 * m:.3g} g'} at {1e3 * float(h):g} ms"
                for h, m in self.content["smallest_mass_kg"].items()
            )
            said.append(f"Smallest mass at the end of a muscle: {masses}.")
            said.append(f"{self.content['steps_per_s']:g} steps of 1 ms in a second, with one muscle.")
        return [*said, *self.content["caveats"]]

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the certificate as a JSON file."""
        return write_text(Path(path), json.dumps(self.to_dict(), indent=1, ensure_ascii=False) + "\n")


def read_certificate(path: str | os.PathLike[str]) -> Certificate:
    """A certificate from its file.

    Raises:
        InputError: the file is none.
    """
    try:
        content: dict[str, Any] = dict(parse_json(read_text(Path(path), form="JSON")))
        verdicts = tuple(Verdict(**verdict) for verdict in content.pop("verdicts"))
        content = {key: value for key, value in content.items() if key not in ("holds", "warnings")}
        return Certificate(str(content["host"]), content, verdicts)
    except (KeyError, TypeError, ValueError):
        raise InputError("file", str(path), "must be a certificate of mckibben conform") from None


def adapter(host: str) -> HostAdapter:
    """The adapter of a host.

    Raises:
        InputError: an unknown host, or a library of it is missing.
    """
    if host not in HOSTS:
        raise InputError("host", host, known=tuple(HOSTS))
    module, _, name = HOSTS[host].partition(":")
    made: HostAdapter = getattr(importlib.import_module(f".{module}", __package__), name)()
    return made


@verb
def conform(
    host: HostName,
    *,
    scenarios: Sequence[ScenarioName] | None = None,
    steps: Iterable[float] | None = None,
    states: bool = True,
    progress: Callable[[str], None] | None = None,
) -> Certificate:
    """Test a host of muscles: errors, order, work at the border, saved states, smallest mass and speed.

    Args:
        host: host to test: python, c, mujoco, mujoco-python, warp, newton, drake, opensim, fmi3, fmi2 or libcosim; in
            Python also an adapter of one's own.
        scenarios: scenario to run instead of all: isometric, hang, slack, loop, leak, joint or tank.
        steps: of the host [s]; those of the grid, 0.5, 1, 2 and 5 ms, by default.
        states: test saving, restoring and the like, the smallest mass, and speed.
        progress: called with what is done next.

    Raises:
        InputError: an unknown host or scenario, or a library of the host is missing.
    """
    own = isinstance(host, str)
    tested = adapter(host) if isinstance(host, str) else host
    try:
        chosen = [scenario(name) for name in (SCENARIOS if scenarios is None else scenarios)]
        return _certify(tested, chosen, tuple(steps or STEPS), states, progress or (lambda sentence: None))
    finally:
        if own:
            tested.close()


def _certify(
    tested: HostAdapter, chosen: list[Scenario], steps: tuple[float, ...], states: bool, progress: Callable[[str], None]
) -> Certificate:
    measured: dict[str, Any] = {}
    for one in chosen:
        progress(f"{one.name}: {one.title}")
        measured[one.name] = _measure(tested, one, steps)
    content: dict[str, Any] = {
        "schema": SCHEMA,
        "host": tested.name,
        "title": tested.title,
        "version": tested.version(),
        "staggered": tested.staggered,
        "made_by": f"mckibben {versions()['mckibben']}",
        "machine": f"{platform.system()} {platform.machine()}",
        "parts": {one.part.title: one.part.fingerprint for one in chosen},
        "scenarios": measured,
    }
    if states:
        progress("states: saved, restored, copied, reset")
        content["states"] = {
            name: bool(check(tested)) for name, check in STATE_CHECKS.items() if name not in tested.untested
        }
        progress("the smallest mass, and speed")
        single = scenario("hang").part
        content["slope_mass_kg"] = {f"{h:g}": single.slope(h) * h * h for h in steps}
        content["smallest_mass_kg"] = {f"{h:g}": smallest_mass(tested, h) for h in steps}
        content["steps_per_s"] = float(f"{steps_per_second(tested):.3g}")
        own = tested.own_actuator()
        if own is not None:
            content["own_actuator"] = own._asdict()
    content["caveats"] = list(tested.caveats)
    return Certificate(tested.name, content, tuple(_verdicts(content)))


def _measure(tested: HostAdapter, one: Scenario, steps: tuple[float, ...]) -> dict[str, Any]:
    reference = reference_of(one.name)
    rows = {f"{h:g}": _errors(one, reference, run(tested, one, h), h, tested.staggered) for h in steps}
    order, fine, coarse = None, rows.get("0.001"), rows.get("0.002")
    # A given path has no order: synchronous hosts follow it exactly.
    if one.mechanism.path is None and fine and coarse and fine["position_error"]:
        order = math.log2(coarse["position_error"] / fine["position_error"])
    return {
        "title": one.title,
        "rotary": one.mechanism.rotary,
        "range": float(np.ptp(reference.positions)),
        "turnover_J": reference.turnover,
        "order": order,
        "steps": rows,
    }


@functools.cache
def reference_of(name: str) -> HostReference:
    """The reference of a scenario."""
    return scenario(name).reference()


def run(tested: HostAdapter, one: Scenario, period: float) -> HostTrace:
    """Run a scenario in a host.

    Args:
        tested: the host.
        one: the scenario.
        period: of its steps [s].
    """
    hosted = tested.open(one, period)
    moments = one.moments(period, staggered=tested.staggered)
    mechanism = one.mechanism
    positions, readings, work = [mechanism.start], [], 0.0
    for moment, following in itertools.pairwise([*moments, moments[-1]]):
        before = moment.rate if moment.rate is not None else hosted.rate
        readings.append(hosted.step(moment))
        of_path = following.rate if tested.staggered else moment.rate
        after = of_path if of_path is not None else hosted.rate
        rates = mechanism.span_rate(0.5 * (before + after))
        work += sum(period * pull * rates[name] for name, pull in readings[-1].tension.items())
        positions.append(hosted.position)
    tension = {n: np.array([row.tension[n] for row in readings]) for n in mechanism.arms}
    pressure = {n: np.array([row.pressure[n] for row in readings]) for n in mechanism.arms}
    gas = None if readings[-1].gas is None else np.array([row.gas for row in readings], float)
    return HostTrace(np.array(positions), tension, pressure, work, readings[-1].work, gas)


def _errors(
    one: Scenario, reference: HostReference, trace: HostTrace, period: float, staggered: bool
) -> dict[str, float]:
    """Largest differences from the reference, largest tension where the reference is slack, and gas gained or lost."""
    count = one.count(period)
    at = np.arange(count) * period
    begins = at - 0.5 * period if staggered else at
    ends = begins + period
    errors = {}
    if one.mechanism.path is None:
        positions = np.interp(period * np.arange(count + 1), reference.time, reference.positions)
        errors["position_error"] = float(np.abs(trace.positions - positions).max())
    off, apart, slack = [], [], []
    for name in one.mechanism.arms:
        means = reference.mean_tensions(name, begins, ends)
        # Not the first step: that of a staggered host lasts half as long.
        off.append(np.abs(trace.tensions[name] - means)[1:].max())
        pressures = np.interp(ends, reference.time, reference.pressures[name])
        apart.append(np.abs(trace.pressures[name] - pressures).max())
        around = reference.mean_tensions(name, begins - period, ends + period)
        slack += trace.tensions[name][around == 0.0].tolist()
    if slack:
        errors["slack_tension"] = float(np.abs(slack).max())
    if one.closed and trace.gas is not None:
        errors["gas_change"] = float(np.ptp(trace.gas) / trace.gas[0])
    return errors | {
        "tension_error": float(max(off)),
        "pressure_error": float(max(apart)),
        "gap_J": trace.host_work - trace.part_work,
    }


def _verdicts(content: Mapping[str, Any]) -> Iterable[Verdict]:
    judged = f"{JUDGED:g}"
    for name, measured in content["scenarios"].items():
        row = measured["steps"].get(judged)
        if name in POSITION_LIMITS and row:
            limit, error = POSITION_LIMITS[name], row["position_error"]
            unit, factor = ("deg", math.degrees(1.0)) if measured["rotary"] else ("mm", 1e3)
            yield Verdict(f"{name}: error at 1 ms", error * factor, limit * factor, unit, error <= limit)
        if name in ORDERED and measured["order"] is not None:
            yield Verdict(f"{name}: order", measured["order"], LEAST_ORDER, "1", measured["order"] >= LEAST_ORDER)
        if row and measured["turnover_J"] > 0.0:
            gap = abs(row["gap_J"]) / measured["turnover_J"]
            yield Verdict(f"{name}: gap at the border", 100.0 * gap, 100.0 * LARGEST_GAP, "%", gap <= LARGEST_GAP)
        if row and "slack_tension" in row:
            pull = row["slack_tension"]
            yield Verdict(f"{name}: tension when slack", pull, LARGEST_SLACK, "N", pull <= LARGEST_SLACK)
        if row and "gas_change" in row:
            change = row["gas_change"]
            yield Verdict(f"{name}: gas gained or lost", change, LARGEST_GAS_CHANGE, "1", change <= LARGEST_GAS_CHANGE)
    if "own_actuator" in content:
        pull = abs(content["own_actuator"]["tension"])
        yield Verdict("slack beside the host's own actuator", pull, LARGEST_SLACK, "N", pull <= LARGEST_SLACK)
    for name, equal in content.get("states", {}).items():
        yield Verdict(f"{name}: equal bits", float(equal), 1.0, "1", equal)


# ---- states


def _started(tested: HostAdapter, steps: int = CHECKED) -> tuple[HostedMechanism, list[Any]]:
    """The hanging weight some steps after its start, while the valve fills, and the moments that follow."""
    one = scenario("hang")
    hosted, moments = tested.open(one, JUDGED), one.moments(JUDGED, staggered=tested.staggered)
    for moment in moments[:steps]:
        hosted.step(moment)
    return hosted, moments[steps : 2 * steps]


def _path(hosted: HostedMechanism, moments: list[Any]) -> list[tuple[float, ...]]:
    rows: list[tuple[float, ...]] = []
    for moment in moments:
        seen = hosted.step(moment)
        rows.append((hosted.position, hosted.rate, *seen.tension.values(), *seen.pressure.values(), seen.work))
    return rows


def _restores(tested: HostAdapter) -> bool:
    hosted, moments = _started(tested)
    saved = hosted.save()
    first = _path(hosted, moments)
    hosted.restore(saved)
    return _path(hosted, moments) == first


def _restores_elsewhere(tested: HostAdapter) -> bool:
    hosted, moments = _started(tested)
    other, _ = _started(tested, 7)
    other.restore(hosted.save())
    return _path(other, moments) == _path(hosted, moments)


def _copies(tested: HostAdapter) -> bool:
    hosted, moments = _started(tested)
    twin = hosted.copy()
    first = _path(hosted, moments)
    return _path(twin, moments) == first


def _resets(tested: HostAdapter) -> bool:
    hosted, _ = _started(tested)
    hosted.reset()
    fresh, _ = _started(tested, 0)
    _, moments = _started(tested, 1)
    return _path(hosted, moments) == _path(fresh, moments)


def _looks(tested: HostAdapter) -> bool:
    hosted, moments = _started(tested)
    twin = hosted.copy()
    rows = []
    for moment in moments:
        hosted.look(moment)
        hosted.look(moment)
        rows += _path(hosted, [moment])
    return rows == _path(twin, moments)


def _threads(tested: HostAdapter) -> bool:
    hosted, moments = _started(tested)
    twins, together = [hosted.copy() for _ in range(THREADS)], threading.Barrier(THREADS)

    def path(twin: HostedMechanism) -> list[tuple[float, ...]]:
        together.wait()  # so that none has ended before another begins
        return _path(twin, moments)

    with ThreadPoolExecutor(THREADS) as workers:
        paths = list(workers.map(path, twins))
    return paths == [_path(hosted, moments)] * THREADS


STATE_CHECKS: dict[str, Callable[[HostAdapter], bool]] = {
    "saved and restored": _restores,
    "restored elsewhere": _restores_elsewhere,
    "copied": _copies,
    "reset": _resets,
    "evaluated twice": _looks,
    "on four threads": _threads,
}
"""What a host must do without changing a bit."""


# ---- smallest mass, speed


def is_stable(tested: HostAdapter, mass: float, period: float) -> bool:
    """Whether a mass [kg] under a constant force comes to rest at the end of the muscle; the host's step [s]."""
    hang = scenario("hang")
    count = round(LIGHT_TIME / 1e-2)
    light = Scenario("light", "a light mass", hang.part, hanging(mass, LIGHT_LOAD), {"muscle": (0.0,) * count})
    try:
        spans = run(tested, light, period).positions
    except (ConvergenceError, InputError):  # of a mass that runs away, a part refuses the rate at last
        return False
    tail = spans[-round(LIGHT_TAIL / period) :]
    return bool(np.isfinite(spans).all() and np.ptp(tail) < LIGHT_CALM and abs(tail[-1] - START) < START)


def smallest_mass(tested: HostAdapter, period: float) -> float | None:
    """Smallest mass that the host moves stably [kg], to a tenth, None if it moves none; its step [s]."""
    low, high = LIGHT_RANGE
    if is_stable(tested, low, period):
        return low
    if not is_stable(tested, high, period):
        return None
    while high / low > 1.1:
        middle = math.sqrt(low * high)
        low, high = (low, middle) if is_stable(tested, middle, period) else (middle, high)
    return high


def steps_per_second(tested: HostAdapter) -> float:
    """Steps of 1 ms with one muscle that the host takes in a second, the best of three trials."""
    moment = scenario("hang").moments(JUDGED, staggered=tested.staggered)[0]
    best = math.inf
    for _ in range(3):
        hosted, _ = _started(tested)
        began = time.perf_counter()
        for _ in range(TIMED):
            hosted.step(moment)
        best = min(best, time.perf_counter() - began)
    return TIMED / best
