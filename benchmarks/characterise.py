"""Characterisation of virtual muscles drawn from wide priors: held-out error, coverage, and failures that were not said.

    python benchmarks/characterise.py                   # 50 muscles
    python benchmarks/characterise.py --muscles 3       # a smoke test
    python benchmarks/characterise.py --draw            # the table in the documentation, from the results
    python benchmarks/characterise.py --coverage 20 --out coverage.json     # intervals of muscles whose truth is known

Every muscle has dimensions, rubber, friction, relaxation and a leak of its own and hangs on the rig `modern`, whose sensors
have noise, zeros and gain errors of their own; the ruler misses its rest length by up to 1 %. Its law is not among those
that are fitted. Ten of 50 have a fault that nobody told of: a gross leak, a drifting load cell, a slack clamp, a drifting
pressure sensor. The error is that of the fitted static tension at 40 points of span and pressure between those of the map,
over the largest true tension there. A muscle that passed with a worst error above `WRONG` is wrong without saying so.

`--coverage` characterises each of `MUSCLES` once on each of `RIGS` with quiet sensors and the sizes that no tension tells.
Then as many times as stated their noise, zeros and gains, the ruler's error and the cord's are drawn, and the recordings are
evaluated as those sensors would have shown them: with the muscle's own law, whose fitted parameters have to be in their
intervals, and with `OTHERS` but the own one, whose tension has to be in its interval.
"""

from __future__ import annotations

import argparse
import dataclasses
import json
import math
import time
from pathlib import Path
from typing import Any

import numpy as np
import written

import mckibben as mk
from mckibben.assembly.build import unit_from_muscle
from mckibben.assembly.muscle_unit import MuscleUnit
from mckibben.bench.rig import Rig
from mckibben.errors import MckibbenError, NoVolumeError, StageError
from mckibben.identification.tension_path_fit import WINDOW
from mckibben.muscles.build import build_law
from mckibben.muscles.elements import MaxwellChain, Tendon
from mckibben.muscles.hysteresis import FrictionLimit, MaxwellSlip
from mckibben.muscles.laws import LAWS, law_key
from mckibben.studies.characterisation.evaluation import (
    CORD_ERROR,
    GAIN_ERROR,
    MOST_GAIN,
    advance,
    evaluate,
    gain_change,
    specimen_of,
)
from mckibben.studies.characterisation.stages import Progression

OUT = Path(__file__).with_suffix(".json")
BEGIN, END = "<!-- written by benchmarks/characterise.py; do not edit -->", "<!-- end of outcome -->"
STEP = 2e-4  # of the physics at most [s]; the machine takes smaller ones where its rates ask for them
LEAST = 10.0  # tension at 5 bar and the rest length, below which dimensions are drawn again [N]
WRONG = 0.05  # worst error, of the largest tension, above which a result is wrong
# Law that made the muscle, and laws that are not fitted then: itself, and those of which it is a limit.
TRUTHS = {
    "hyperelastic_braid": ("hyperelastic_braid", "seated_hyperelastic_braid"),
    "linear_threshold": ("linear_threshold", "three_element"),
}
FAULTS = ("leak", "tension_drift", "clamp_slack", "pressure_drift")
DRIFT = 0.01  # of a gain over the whole run, of which the table says how often it is found
SHARES = np.linspace(0.08, 0.96, 8)  # of the taut length range at a pressure


@dataclasses.dataclass(frozen=True)
class VirtualMuscle:
    """A muscle on its rig: what the characterisation is not told, and the rest length that it is."""

    truth: str
    unit: MuscleUnit
    rig: Rig
    rest_length: float
    fault: str


def log_uniform(chance: np.random.Generator, low: float, high: float) -> float:
    """A draw between two values, uniform in its logarithm."""
    return float(np.exp(chance.uniform(math.log(low), math.log(high))))


def drawn_law(truth: str, chance: np.random.Generator) -> tuple[mk.TensionLaw, float]:
    """A law with drawn dimensions, and its rest length [m]."""
    rest = log_uniform(chance, 0.08, 0.35)
    diameter, angle = log_uniform(chance, 6e-3, 20e-3), chance.uniform(0.37, 0.54)
    wall, modulus = diameter * chance.uniform(0.06, 0.14), log_uniform(chance, 3e5, 2e6)
    area = math.pi * diameter**2 / 4.0
    gain = 3.0 / math.tan(angle) ** 2 - 1.0 / math.sin(angle) ** 2  # largest tension per pressure over that area
    if truth == "linear_threshold":
        shortest = rest * chance.uniform(0.68, 0.76)
        stiffness = area * gain / (rest - shortest)
        parameters = {
            "stiffness_per_pressure": stiffness, "shortest_length": shortest,
            "threshold_pressure": chance.uniform(2e4, 9e4),
            "passive_stiffness": chance.uniform(0.02, 0.1) * stiffness * 5e5, "rest_length": rest,
            "upper_length": 1.08 * rest, "rest_volume": area * rest,
        }  # fmt: skip
    else:
        parameters = {
            "rest_length": rest, "rest_diameter": diameter, "wall_thickness": wall, "rest_angle": angle,
            "thread_depth": chance.uniform(0.3, 0.7), "length_factor": 1.0, "shear_modulus": modulus,
            "thread_compliance": chance.uniform(0.0, 8e-9), "inactive_share": chance.uniform(0.1, 0.6),
            "upper_length": 1.05 * rest,
        }  # fmt: skip
    return build_law(truth, parameters), rest


def draw(number: int, seed: int) -> VirtualMuscle:
    """Draw a muscle and its rig by their number; every fifth has a fault."""
    chance = np.random.default_rng([seed, number])
    truth, full = list(TRUTHS)[number % len(TRUTHS)], 0.0
    while full < LEAST:
        law, rest = drawn_law(truth, chance)
        full = float(law.tension(rest, 5e5))
    limit = FrictionLimit(
        constant=chance.uniform(0.0, 0.005) * full, per_pressure=chance.uniform(0.005, 0.05) * full / 5e5
    )
    shortest_travel = log_uniform(chance, 1e-4, 5e-4)
    friction = MaxwellSlip.geometric(
        limit,
        elements=8,
        shortest=shortest_travel,
        longest=min(shortest_travel * chance.uniform(8.0, 40.0), 0.06 * rest),
    )
    stiffness = chance.uniform(0.01, 0.12) * full / (0.25 * rest)
    creep = MaxwellChain.geometric(
        stiffness=stiffness, shortest=log_uniform(chance, 0.5, 2.0), longest=log_uniform(chance, 5.0, 25.0), elements=3
    )
    fault = FAULTS[number // 5 % len(FAULTS)] if number % 5 == 4 else ""
    sizes = {
        "leak": f"{log_uniform(chance, 2e-10, 1e-9)!r} m^3/(s*Pa)",
        "tension_drift": f"{float(chance.choice([-1.0, 1.0])) * log_uniform(chance, 1e-4, 1e-3) * full!r} N/s",
        "clamp_slack": f"{chance.uniform(0.01, 0.03) * rest!r} m",
        "pressure_drift": f"{log_uniform(chance, 20.0, 200.0)!r} Pa/s",
    }
    changes = {
        "sensors.tension.noise": f"{log_uniform(chance, 0.05, 0.5)!r} N",
        "sensors.tension.offset": f"{chance.normal(0.0, 1.0)!r} N",
        "sensors.tension.gain_error": f"{chance.normal(0.0, 2e-3)!r}",
        "sensors.pressure.noise": f"{log_uniform(chance, 50.0, 500.0)!r} Pa",
        "sensors.pressure.offset": f"{chance.normal(0.0, 500.0)!r} Pa",
        "sensors.pressure.gain_error": f"{chance.normal(0.0, 2e-3)!r}",
        "faults.leak": f"{log_uniform(chance, 1e-14, 3e-12)!r} m^3/(s*Pa)",
    }
    if fault:
        changes[f"faults.{fault}"] = sizes[fault]
    unit = unit_from_muscle(mk.Muscle(law, friction, creep), tendon=Tendon(stiffness=2e5, toe_length=1e-4, loss=0.2))
    mounted = round(rest * (1.0 + chance.uniform(-0.01, 0.01)), 4)
    return VirtualMuscle(truth, unit, mk.rig("modern", changes), mounted, fault)


def true_tensions(unit: MuscleUnit, spans: np.ndarray, pressures: np.ndarray) -> np.ndarray:
    """Static tension of the machine at spans and pressures (n,), without friction and relaxation [N]."""
    lengths = np.array([float(unit.equilibrium(x, p).length) for x, p in zip(spans, pressures, strict=True)])
    return np.asarray(unit.tendon.force(spans - lengths))


def study(number: int, seed: int) -> dict[str, Any]:
    """Characterise one muscle and compare the result with the truth."""
    muscle = draw(number, seed)
    row: dict[str, Any] = {"number": number, "truth": muscle.truth, "fault": muscle.fault}
    laws = [name for name in LAWS if name not in TRUTHS[muscle.truth]]
    begin = time.process_time()
    try:
        found = mk.characterise(
            muscle.rig, muscle=muscle.unit, rest_length=muscle.rest_length, laws=laws, seed=number, step=STEP
        )
    except StageError as error:
        return row | {"outcome": "failed", "why": str(error), "seconds": round(time.process_time() - begin, 2)}
    row["seconds"] = round(time.process_time() - begin, 2)
    row |= {"outcome": "passed" if found.passed else "failed", "why": found.failure() or "", "law": found.law}
    row |= {"machine_time": found.seconds, "held_out": found.held_out_error}
    points = found.evaluation.points
    levels = np.unique(np.round(points.pressure / 1e4))  # pressures are the same to the regulator's error
    groups = [points.select(np.round(points.pressure / 1e4) == p) for p in levels]
    groups = [g for g in groups if len(g) > 5]
    spans, pressures = [], []
    for a, b in zip(groups[:-1], groups[1:], strict=True):
        shortest = max(float(a.length.min()), float(b.length.min()))
        longest = min(float(a.length.max()), float(b.length.max()))
        spans += list(shortest + SHARES * (longest - shortest))
        pressures += [0.5 * (float(np.mean(a.pressure)) + float(np.mean(b.pressure)))] * len(SHARES)
    at, under = np.array(spans), np.array(pressures)
    law = found.muscle
    predicted = np.asarray(law.tension(at, under))
    cord = found.bounds.cord
    assert cord is not None  # of a simulated rig
    spans_there = at + np.asarray(cord.stretch(predicted))
    error = predicted - true_tensions(muscle.rig.faults.unit(muscle.unit), spans_there, under)
    # The same lengths of the muscle itself, without the slack of a clamp.
    alone = np.asarray(muscle.unit.law.tension(at, under))
    intervals = [found.tension_interval(float(x), float(p)) for x, p in zip(at, under, strict=True)]
    inside = np.array([low <= t <= high for t, (low, high) in zip(alone, intervals, strict=True)])
    largest = float(alone.max())
    middle = 0.7 * float(under.max())
    rubbed = [float(np.sum(m.friction.largest_force(middle))) for m in (law, muscle.unit)]
    total = found.evaluation.relaxation.total
    own = np.abs(predicted - alone) / largest
    return row | {
        "gain_change": gain_changes(found),
        "error": [round(float(e), 5) for e in error / largest],
        "worst": float(np.abs(error).max() / largest),
        "rms": float(np.sqrt(np.mean(error**2)) / largest),
        "covered": float(np.mean(np.abs(error) <= found.evaluation.half_width)),
        "half_width": found.evaluation.half_width / largest,
        "alone": float(own.max()),
        "alone_covered": float(np.mean(inside)),
        "alone_half_width": float(np.median([high - low for low, high in intervals]) / 2.0 / largest),
        "silent": float(np.max(own * ~inside)),
        "largest": largest,
        "friction": rubbed,
        "relaxation": [total.value, total.low, total.high, true_relaxation(muscle.unit, found.records["relaxation"])],
        "volume": [volume_of(m, muscle.rest_length, middle) for m in (law.law, muscle.unit.law)],
    }


def gain_changes(found: mk.Characterisation) -> dict[str, list[float]]:
    """Change of a loop at its repetition with the end of its interval nearer to zero, as recorded and with gains that drift.

    The readings of a sensor are multiplied by a gain that goes evenly from 1 to 1 +- `DRIFT` over the whole run.
    """
    made, total = {}, sum(stage.seconds for stage in found.stages)
    for name, sensor, drift in (
        ("sound", "tension", 0.0),
        ("load cell up", "tension", DRIFT),
        ("load cell down", "tension", -DRIFT),
        ("pressure sensor up", "pressure", DRIFT),
        ("pressure sensor down", "pressure", -DRIFT),
    ):
        records, before = {}, 0.0
        for stage in found.stages:
            record = found.records[stage.stage]
            channel = record.channels[sensor]
            values = channel.values * (1.0 + drift * (before + record.time) / total)
            channels = record.channels | {sensor: dataclasses.replace(channel, values=values)}
            records[stage.stage] = dataclasses.replace(record, channels=channels)
            before += stage.seconds
        known = Progression()
        for stage in found.stages:
            known = advance(stage.stage, records[stage.stage], found.bounds, known)
        change = gain_change(records, found.bounds, known)
        nearest = max(change.low, -change.high, 0.0)
        made[name] = [change.value, nearest]
    return made


def volume_of(law: Any, length: float, pressure: float) -> float | None:
    """Volume of gas that a law states [m^3]; none where it leaves it open."""
    try:
        return float(law.volume(length, pressure))
    except NoVolumeError:
        return None


def true_relaxation(unit: MuscleUnit, record: mk.Recording) -> float:
    """Tension per step of the span that relaxes from 1 s to 30 s after it, as the load cell reads it [N/m].

    A cord in series passes the share k_t/(k_t + k) of a step on to a muscle of stiffness k, and the same share of the
    muscle's force back.
    """
    hold = record.segments("hold")[0]
    span, pressure = float(hold["span"][-1]), float(np.mean(hold["pressure"]))
    slope = float(unit.law.tension(span, pressure) - unit.law.tension(span - 1e-3, pressure)) / 1e-3
    share = unit.tendon.stiffness / (unit.tendon.stiffness + slope)
    times = np.asarray(unit.creep.time_constant)
    relaxed = np.exp(-WINDOW[0] / times) - np.exp(-WINDOW[1] / times)
    return float(np.asarray(unit.creep.stiffness) @ relaxed * share**2)


MUSCLES = ("nylon", "fiberglass", "bridgestone", "DMSP-10-250", "SM20", "own braid")
RIGS = ("modern", "uno", "stm32f405")
OTHERS = ("linear_threshold", "three_element", "sarosi", "hyperelastic_braid")
ALIKE = {
    "hyperelastic_braid",
    "seated_hyperelastic_braid",
    "martens_boblan",
}  # braids with a rubber wall: none is another
MEASURED_SIZES = ("wall_thickness", "thread_depth")  # which a caliper tells, and no tension
QUIET = {"tension": "0.001 N", "pressure": "1 Pa"}


def known_muscle(name: str) -> mk.Muscle:
    """A muscle whose law is known: a specimen or a braid of one's own."""
    if name != "own braid":
        return mk.muscle(name)
    return mk.Muscle(drawn_law("hyperelastic_braid", np.random.default_rng(5))[0])


def coverage(name: str, rig: str, draws: int, seed: int) -> dict[str, Any]:
    """How often the intervals of one muscle on one rig hold what is true."""
    row: dict[str, Any] = {"muscle": name, "rig": rig, "parameters": [], "tension": [], "failed": []}
    muscle, changes = known_muscle(name), {}
    on = mk.rig(rig)
    for sensor in QUIET:
        changes |= {f"sensors.{sensor}.noise": QUIET[sensor]}
    own = law_key(type(muscle.law))
    sizes = {name: float(getattr(muscle.law, name)) for name in MEASURED_SIZES if hasattr(muscle.law, name)}
    try:
        quiet = mk.characterise(mk.rig(rig, changes), muscle=muscle, laws=[own], known=sizes, seed=seed, step=STEP)
    except MckibbenError as error:
        return row | {"why": str(error)}
    others = [law for law in OTHERS if law != own and not {law, own} <= ALIKE]
    for number in range(draws):
        chance = np.random.default_rng([seed, number])
        gains = {s: chance.normal(0.0, GAIN_ERROR) for s in QUIET}
        zeros = {"tension": chance.normal(0.0, 1.0), "pressure": chance.normal(0.0, 500.0)}
        records = {}
        for stage, record in quiet.records.items():
            noisy = {}
            for sensor in QUIET:
                noise = float(on.sensors[sensor].noise) * chance.standard_normal(len(record))
                values = record[sensor] * (1.0 + gains[sensor]) + zeros[sensor] + noise
                noisy[sensor] = record.channels[sensor].with_values(values)
            records[stage] = record.with_channels(noisy)
        cord = quiet.bounds.cord
        cord = dataclasses.replace(cord, stiffness=float(cord.stiffness) * (1.0 + chance.normal(0.0, CORD_ERROR)))
        rest = quiet.bounds.rest_length * (1.0 + chance.uniform(-1.0, 1.0) * quiet.bounds.rest_length_error)
        bounds = dataclasses.replace(quiet.bounds, cord=cord, rest_length=rest)
        try:
            known = Progression()
            for stage in records:
                known = advance(stage, records[stage], bounds, known)
            for kind, laws in (("parameters", (own,)), ("tension", tuple(others))):
                found = evaluate(records, bounds, known, laws=laws, sizes=sizes)
                law, points = found.fits[0], found.points
                if kind == "parameters":
                    row[kind].append(
                        [bool(e.low <= float(getattr(muscle.law, n)) <= e.high) for n, e in law.parameters.items()]
                    )
                else:
                    spec = specimen_of(found, bounds, name="found", title="found")
                    made = dataclasses.replace(quiet, evaluation=found, specimen=spec, bounds=bounds)
                    places = chance.choice(len(points), 10, replace=False)
                    at = [(float(points.length[i]), float(points.pressure[i])) for i in places]
                    ends = [made.tension_interval(*one) for one in at]
                    true = [float(muscle.law.tension(*one)) for one in at]
                    row[kind].append([low <= t <= high for t, (low, high) in zip(true, ends, strict=True)])
        except MckibbenError as error:
            row["failed"].append(str(error))
    return row


def covered(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Shares inside, of each muscle and pooled, with the standard error over the draws."""
    made: dict[str, Any] = {}
    for name in (*MUSCLES, "pooled"):
        for kind in ("parameters", "tension"):
            shares = [float(np.mean(one)) for r in rows if name in (r["muscle"], "pooled") for one in r[kind]]
            if shares:
                error = float(np.std(shares) / math.sqrt(len(shares)))
                made[f"{name}, {kind}"] = [float(np.mean(shares)), error, len(shares)]
    return made


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Numbers of all muscles, and of those without a fault."""
    made: dict[str, Any] = {}
    for name, some in (
        ("all", rows),
        ("sound", [r for r in rows if not r["fault"]]),
        ("faulty", [r for r in rows if r["fault"]]),
    ):
        passed = [r for r in some if r["outcome"] == "passed"]
        errors = np.abs(np.concatenate([r["error"] for r in passed])) if passed else np.zeros(1)
        made[name] = {
            "muscles": len(some),
            "failed and said so": len(some) - len(passed),
            "wrong by more than 5 %": sum(r["alone"] > WRONG for r in passed),
            "of these, beyond the interval that was stated": sum(r["silent"] > WRONG for r in passed),
            "error, median": float(np.median(errors)),
            "error, 90 %": float(np.quantile(errors, 0.9)),
            "error, worst": float(errors.max()),
            "tensions within their 95 % interval": float(np.mean([r["covered"] for r in passed])) if passed else 0.0,
            "of the muscle itself, likewise": float(np.mean([r["alone_covered"] for r in passed])) if passed else 0.0,
            "relaxation within its 95 % interval": share_within(passed),
            "friction, median error": float(np.median([abs(a / b - 1.0) for r in passed for a, b in [r["friction"]]]))
            if passed
            else 0.0,
            "gain that drifts by 1 %, found": share_of_drifts(passed),
            "gain that must drift to be found, median": float(np.median(needed_drifts(passed) or [0.0])),
            "gain that must drift to be found, most": float(np.max(needed_drifts(passed) or [0.0])),
            "change without a drift, largest": max((abs(r["gain_change"]["sound"][0]) for r in passed), default=0.0),
            "machine time, longest": max((r["machine_time"] for r in passed), default=0.0),
        }
    return made


def share_within(rows: list[dict[str, Any]]) -> float:
    """Share of the muscles whose true relaxation lies in its interval."""
    ends = [r["relaxation"] for r in rows]
    return float(np.mean([low <= true <= high for _, low, high, true in ends])) if ends else 0.0


def share_of_drifts(rows: list[dict[str, Any]]) -> float:
    """Share of the drifting gains that the repeated loop shows."""
    ends = [ends for r in rows for name, ends in r["gain_change"].items() if name != "sound"]
    return float(np.mean([tells(value, end) and end > MOST_GAIN for value, end in ends])) if ends else 0.0


def tells(value: float, nearest: float) -> bool:
    """Whether a change, with the end of its interval nearer to zero, is known well enough to tell of a gain."""
    return abs(value) - nearest <= MOST_GAIN


def needed_drifts(rows: list[dict[str, Any]]) -> list[float]:
    """Drifts of a gain over the whole run from which on the repeated loop shows them, in proportion to that of `DRIFT`."""
    needed = []
    for changes in (row["gain_change"] for row in rows):
        sound = changes["sound"][0]
        for name, (value, nearest) in changes.items():
            if name != "sound" and tells(value, nearest):
                half, way = abs(value) - nearest, math.copysign(1.0, value - sound)
                needed.append(DRIFT * (MOST_GAIN + half - way * sound) / abs(value - sound))
    return needed


def table(result: dict[str, Any]) -> str:
    """The table of the documentation."""
    columns = {"sound": "sound", "faulty": "with a hidden fault"}
    lines = [f"| | {' | '.join(columns.values())} |", "|---|" + "---|" * len(columns)]
    for name in result["summary"]["all"]:
        cells = []
        for column in columns:
            value = result["summary"][column][name]
            some = result["summary"][column]
            if some["muscles"] == some["failed and said so"] and name.startswith(
                ("error", "tensions", "of the muscle", "relaxation", "friction", "gain", "change", "machine")
            ):
                cells.append("\N{EN DASH}")
                continue
            if name.startswith(("error", "tensions", "of the muscle", "relaxation", "friction", "gain", "change")):
                cells.append(f"{100.0 * value:.2g} %" if value < 0.995 else "100 %")
            elif name.startswith("machine"):
                cells.append(f"{value / 60.0:.1f} min")
            else:
                cells.append(str(value))
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


WRITTEN = (written.WrittenPart("how-to/characterise-a-muscle.md", BEGIN, END, table),)


def main() -> None:
    """Run the study, or write its table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--muscles", type=int, default=50)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=22)
    parser.add_argument("--out", type=Path, default=OUT)
    parser.add_argument("--draw", action="store_true", help="write the table of the documentation from the results")
    parser.add_argument(
        "--coverage", type=int, default=0, help="draws of each muscle on each rig, whose truth is known"
    )
    parser.add_argument("--only", default="", help="muscles of the coverage, with commas")
    asked = parser.parse_args()
    if asked.coverage:
        made: list[dict[str, Any]] = []
        for rig in RIGS:
            for name in asked.only.split(",") if asked.only else MUSCLES:
                begin = time.monotonic()
                made.append(coverage(name, rig, asked.coverage, asked.seed))
                print({k: v for k, v in made[-1].items()}, round(time.monotonic() - begin), flush=True)
                result = {"seed": asked.seed, "covered": covered(made), "runs": made}
                asked.out.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        return
    if asked.draw:
        written.write(WRITTEN, json.loads(asked.out.read_text(encoding="utf-8")))
        return
    stored = {"seed": asked.seed, "muscles": [], "seconds": 0.0}
    if asked.out.exists():
        stored = json.loads(asked.out.read_text(encoding="utf-8"))
    rows = stored["muscles"] if stored["seed"] == asked.seed else []
    begin, present = time.monotonic() - (stored["seconds"] if rows else 0.0), {row["number"] for row in rows}
    for number in range(asked.first, asked.first + asked.muscles):
        if number in present:
            continue
        rows.append(study(number, asked.seed))
        print({k: v for k, v in rows[-1].items() if k not in ("error",)}, flush=True)
        result = {
            "seed": asked.seed,
            "wrong": WRONG,
            "seconds": round(time.monotonic() - begin, 1),
            "summary": summary(rows),
            "muscles": rows,
        }
        asked.out.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    print(json.dumps(result["summary"], indent=1))


if __name__ == "__main__":
    main()
