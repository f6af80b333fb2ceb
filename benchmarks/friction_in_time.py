"""Friction and creep of muscles at constant length: what runs in time of three muscles say of them together.

    python benchmarks/friction_in_time.py --out friction_in_time.json --draw ../docs/explanation/friction.md

All 36 runs of the three 10 mm muscles of AARL, in the folder that MCKIBBEN_DATA names, are fitted at once: one material,
the geometry of each muscle, an error of each set length, a zero of the tension of each muscle, and then one friction and one
creep for all, which the settling of the ends moves (`mckibben.identification.shared_hysteresis`). Runs whose friction and
creep are held back, one of three at each length, say whether these predict anything; law, errors and zeros are those of all
runs. Samples of a run follow one another, so that a fit counts as many samples as would be independent; intervals are as
much wider.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from mckibben.benchmarking.models import seated_memory
from mckibben.benchmarking.models.law import LawModel
from mckibben.benchmarking.moving import VENTING
from mckibben.benchmarking.records import BenchmarkRecord
from mckibben.benchmarking.tasks import task
from mckibben.identification.problem import Problem, solve
from mckibben.identification.shared_hysteresis import (
    NAMES,
    OPEN,
    BraidPath,
    ResistanceProblem,
    independent_samples,
)
from mckibben.identification.uncertainty import akaike
from mckibben.studies.validation import measured_data

LENGTH_ERROR = 5e-4  # what the static plateaus of these muscles say, `lengths.py` [m]
SAMPLES = 400  # of each run
WORDS = (
    "friction without pressure, N",
    "friction per pressure, N/bar",
    "stiffness of the contact, N/mm",
    "stiffness of creep, N/mm",
)
SHOWN = (1.0, 1e5, 1e-3, 1e-3)  # of each, in its unit
BEGIN, END = "<!-- written by benchmarks/friction_in_time.py; do not edit -->", "<!-- end of friction in time -->"

Paths = list[BraidPath]


def prepared() -> tuple[list[BenchmarkRecord], Paths, list[np.ndarray], list[np.ndarray], dict[str, float]]:
    """Runs, their paths at corrected lengths, what law and zeros leave [N], which samples count, and the zeros [N]."""
    folds = task("isometric-runs").load(measured_data(None))
    runs = [record for fold in folds for record in fold.test]
    step = -(-max(map(len, runs)) // SAMPLES)
    runs = [run.every(step) for run in runs]
    count = min(map(len, runs))
    runs = [run.select(np.arange(len(run)) < count) for run in runs]
    model = seated_memory.SeatedBraidMemory()
    model.static = LawModel("seated_braid", length_error=LENGTH_ERROR)
    model.static.fit(runs)
    problem = Problem.of("seated_braid", model.static.points, known=model.static.known, length_error=LENGTH_ERROR)
    solution = solve(problem)
    model.static.values = solution.values(problem)
    assert solution.posterior is not None
    shifts, rest = solution.posterior.shifts[0], np.asarray(problem.points.rest_length)
    errors = {
        (round(float(r), 6), round(float(x), 6)): float(shifts[c])
        for r, x, c in zip(rest, problem.points.length, problem.curves, strict=True)
    }

    def corrected(run: BenchmarkRecord) -> BenchmarkRecord:
        length = run.inputs["length"]
        key = round(run.dimensions["rest_length"], 6), round(float(length[0]), 6)
        return replace(run, inputs={**run.inputs, "length": length + errors[key]})

    paths = [model.path_of(corrected(run)) for run in runs]
    taut = [run.outputs["tension"] > 0.0 for run in runs]
    left = [run.outputs["tension"] - path[0] for run, path in zip(runs, paths, strict=True)]
    zeros = {}
    for muscle in dict.fromkeys(run.muscle for run in runs):
        some = [x[k] for x, k, run in zip(left, taut, runs, strict=True) if run.muscle == muscle]
        zeros[muscle] = float(np.mean(np.concatenate(some)))
    left = [x - zeros[run.muscle] for x, run in zip(left, runs, strict=True)]
    return runs, paths, left, taut, zeros


def scores(
    runs: list[BenchmarkRecord], taut: list[np.ndarray], errors: list[np.ndarray], free: int
) -> dict[str, float]:
    """Errors [N], and Akaike's criterion by the number of independent samples."""
    venting = np.concatenate([(run.phase == VENTING)[k] for run, k in zip(runs, taut, strict=True)])
    every, independent = np.concatenate(errors), independent_samples(errors)
    rms = float(np.sqrt(np.mean(every**2)))
    return {
        "rms": rms,
        "filling": float(np.sqrt(np.mean(every[~venting] ** 2))),
        "venting": float(np.sqrt(np.mean(every[venting] ** 2))),
        "bias_venting": float(every[venting].mean()),
        "samples": len(every),
        "independent": independent,
        "aicc": akaike(np.full(independent, rms), free + 1),
    }


def measure() -> dict[str, Any]:
    """All figures."""
    runs, paths, left, taut, zeros = prepared()
    problem = ResistanceProblem(paths, left, taut)
    models: dict[str, tuple[str, ...]] = {"law": (), "friction": NAMES[:3], "friction and creep": NAMES}
    tests = np.array([run.name.rsplit("Test", 1)[1] for run in runs])
    found: dict[str, Any] = {"runs": len(runs), "zeros": zeros, "models": {}}
    for name, free in models.items():
        values = problem.fit(free) if free else None
        row: dict[str, Any] = scores(runs, taut, problem.errors(values), len(free))
        row["parameters"] = {}
        if values is not None:
            places = dict(zip(NAMES, zip(WORDS, SHOWN, strict=True), strict=True))
            for key, e in problem.intervals(values, free).items():
                words, unit = places[key]
                row["parameters"][words] = [unit * e.value, unit * e.low, unit * e.high]
        held: list[np.ndarray] = [np.zeros(0)] * len(runs)
        for test in dict.fromkeys(tests):
            others = problem.without(tests == test).fit(free) if free else None
            for i in np.flatnonzero(tests == test):
                held[i] = problem.errors(others)[i]
        row["held_back"] = scores(runs, taut, held, len(free))["rms"]
        found["models"][name] = row
        print(name, row, flush=True)
    return found


def drawn(found: dict[str, Any]) -> str:
    """The tables."""
    lines = [
        "| | rms, N | while filling | while venting | bias while venting | runs held back, rms | AICc |",
        "|---|---:|---:|---:|---:|---:|---:|",
    ]
    for name, row in found["models"].items():
        cells = [f"{row[k]:.2f}" for k in ("rms", "filling", "venting")] + [
            f"{row['bias_venting']:+.2f}",
            f"{row['held_back']:.2f}",
        ]
        lines.append(f"| {name} | {' | '.join(cells)} | {row['aicc']:.0f} |")
    lines += ["", "| parameter | value | 95 % interval | with creep | 95 % interval |", "|---|---:|---|---:|---|"]
    one, both = (found["models"][name]["parameters"] for name in ("friction", "friction and creep"))
    for name in WORDS:
        cells = []
        for values in (one, both):
            value, low, high = values.get(name, (0.0, 0.0, 0.0))
            told = "not in the data" if high > OPEN * value else f"{low:.2g} to {high:.2g}"
            cells += [f"{value:.3g}", told] if name in values else ["", ""]
        lines.append(f"| {name} | {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Measure, write the figures and the table."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("friction_in_time.json"), help="Figures.")
    parser.add_argument("--draw", type=Path, help="Page whose table is written anew.")
    chosen = parser.parse_args()
    found = measure()
    chosen.out.write_text(json.dumps(found, indent=1) + "\n")
    if chosen.draw:
        before, _, rest = chosen.draw.read_text().partition(BEGIN)
        chosen.draw.write_text(f"{before}{BEGIN}\n\n{drawn(found)}\n\n{END}{rest.partition(END)[2]}")


if __name__ == "__main__":
    main()
