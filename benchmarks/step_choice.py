"""Whether the steps that a simulation chooses are short enough: every shipped muscle, three mechanisms, three valves.

    python benchmarks/step_choice.py [--quick] [--json FILE]

Each case is filled from 1 bar towards its rated pressure and vented again, with the default step and with a tenth of it.
Printed are the worst balance of its recording (relative), and by how much pressures and tensions, at the end and at their
extremes over the samples, differ from the run with short steps (percent, of the value or of a tenth of the largest one).
A case that is refused is a failure.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

import mckibben as mk
from mckibben.errors import MckibbenError
from mckibben.specimens import specimen, specimen_ids

VALVES = ("regulator", "mpye-5-1/8", "MHE2-3-2")
MECHANISMS = ("Plate", "Weight", "Joint")
PERIODS = (1e-3, 2e-3, 5e-3, 1e-2)
START, DURATION = 1e5, 0.4  # gauge pressure [Pa], simulated time [s]
LIMITS = {"balance": 1e-3, "percent": 1.0}
USUAL = 2e-4  # the default step of a simulation [s]


class Case(NamedTuple):
    """A muscle on a mechanism behind a valve, and the period of the samples [s]."""

    muscle: str
    mechanism: str
    valve: str
    period: float


class Outcome(NamedTuple):
    """What a case came to: its worst balance and which, largest differences [%], steps, and why it was refused."""

    balance: float = np.inf
    which: str = ""
    end: float = np.inf
    extremes: float = np.inf
    steps: int = 0
    refusal: str = ""

    @property
    def passed(self) -> bool:
        """Whether it is within all limits."""
        return self.balance < LIMITS["balance"] and max(self.end, self.extremes) < LIMITS["percent"]


def cases(quick: bool = False) -> list[Case]:
    """All combinations of muscle, mechanism and valve, with the periods in turn; or each pair of them once."""
    muscles = [one for one in specimen_ids("mckibben") if mk.muscle(one).law.has_volume()]
    chosen = []
    for k, muscle in enumerate(muscles):
        for m, v in itertools.product(range(3), range(3)):
            if not quick or (m + v + k) % 3 == 0:
                chosen.append(Case(muscle, MECHANISMS[m], VALVES[v], PERIODS[(k + m + 2 * v) % 4]))
    return chosen


def rated(muscle: str) -> float:
    """Rated gauge pressure [Pa]; 6 bar where the specimen states none."""
    stated = specimen(muscle)
    return float(stated.property_si("rated_pressure", "Pa")) if "rated_pressure" in stated.properties else 6e5


def simulation(case: Case, step: float) -> Any:
    """The case with a largest step [s]."""
    air = mk.Air(supply=rated(case.muscle), valve=case.valve)
    muscle = mk.muscle(case.muscle)
    if case.mechanism == "Weight":
        span = 0.97 * float(muscle.rest_length)
        pulls = [float(muscle.tension(span, pressure)) for pressure in (START, rated(case.muscle))]
        system: Any = mk.Weight(case.muscle, mass=max(pulls[0], 0.1 * pulls[1]) / 9.80665, start=span)
    else:
        system = getattr(mk, case.mechanism)(case.muscle)
    return mk.Simulation(system, air, period=case.period, step=step)


def commands(case: Case, share: float) -> dict[str, float]:
    """Fill for half of the time and vent for the other; an extensor keeps what it has."""
    filling = share < 0.5
    value = {
        "regulator": rated(case.muscle) if filling else START,
        "mpye-5-1/8": 0.6 if filling else -0.4,
        "MHE2-3-2": 1.0 if filling else 0.0,
    }[case.valve]
    if case.mechanism != "Joint":
        return {"muscle": value}
    return {"flexor": value, "extensor": START if case.valve == "regulator" else 0.0}


def run(case: Case, step: float) -> tuple[np.ndarray, dict[str, float], int]:
    """Pressures and tensions (samples + 1, channels), balances, and the most steps of a sample."""
    sim = simulation(case, step)
    seen, rows = sim.reset(pressure=START), []
    names = [n for n in seen._fields if n.endswith(("pressure", "tension"))]
    samples = round(DURATION / case.period)
    for k in range(samples + 1):
        rows.append([getattr(seen, n) for n in names])
        if k < samples:
            seen = sim.step(**commands(case, k / samples))
    meta = sim.recording().meta
    return np.array(rows), dict(meta["balance"]), round(case.period / meta["timing"]["shortest_step"])


def outcome(case: Case) -> Outcome:
    """Compare a case with a run of short steps."""
    try:
        rows, balance, steps = run(case, USUAL)
        fine, _, _ = run(case, USUAL / 10.0)
    except MckibbenError as error:
        return Outcome(refusal=str(error))
    which = max(balance, key=lambda name: balance[name])
    floor = 0.1 * np.abs(fine).max(axis=0)

    def off(value: np.ndarray, wanted: np.ndarray) -> float:
        return float((100.0 * np.abs(value - wanted) / np.maximum(np.abs(wanted), floor + 1e-9)).max())

    extremes = max(off(rows.max(axis=0), fine.max(axis=0)), off(rows.min(axis=0), fine.min(axis=0)))
    return Outcome(balance[which], which, off(rows[-1], fine[-1]), extremes, steps)


def main() -> None:
    """Print the table, and how many cases fail."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="Each pair of muscle, mechanism and valve once.")
    parser.add_argument("--json", type=Path, help="File for the outcomes.")
    parser.add_argument("--only", default="", help="Cases whose words contain this text.")
    options = parser.parse_args()
    rows, began = {}, time.perf_counter()
    print("muscle        mechanism valve         period   balance of           end % extr. %  steps")
    for case in cases(options.quick):
        words = f"{case.muscle:14}{case.mechanism:10}{case.valve:12}{case.period:8g}"
        if options.only not in words:
            continue
        result = rows[case] = outcome(case)
        ended = result.refusal or (
            f"{result.balance:10.1e} {result.which:10}{result.end:8.3f}{result.extremes:8.3f}{result.steps:7}"
        )
        print(f"{words}{ended}{'' if result.passed else '  FAILS'}", flush=True)
    failed = sum(not one.passed for one in rows.values())
    print(f"{len(rows) - failed} of {len(rows)} cases pass, in {time.perf_counter() - began:.0f} s")
    if options.json:
        table = [{**case._asdict(), **one._asdict()} for case, one in rows.items()]
        options.json.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
