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
import tempfile
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import written

import mckibben as mk
from mckibben.estimation import akaike
from mckibben.identification.problem import Problem, solve
from mckibben.identification.shared_hysteresis import (
    NAMES,
    OPEN,
    BraidPath,
    ResistanceProblem,
    independent_samples,
    read_recordings,
)
from mckibben_benchmark import physics
from mckibben_benchmark.datasets import VENTING, BenchmarkRecord
from mckibben_benchmark.physics import LawModel
from mckibben_benchmark.tasks import task
from mckibben_benchmark.validation import AARL_ZERO, measured_data

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
BEGIN_FIT, END_FIT = (
    f"<!-- fit --hysteresis, {b} benchmarks/friction_in_time.py -->" for b in ("written by", "end of")
)

Paths = list[BraidPath]


def prepared() -> tuple[list[BenchmarkRecord], Paths, list[np.ndarray], list[np.ndarray], dict[str, float]]:
    """Runs, their paths at corrected lengths, what law and zeros leave [N], which samples count, and the zeros [N]."""
    folds = task("isometric-runs").load(measured_data(None))
    runs = [record for fold in folds for record in fold.test]
    step = -(-max(map(len, runs)) // SAMPLES)
    runs = [run.every(step) for run in runs]
    count = min(map(len, runs))
    runs = [run.select(np.arange(len(run)) < count) for run in runs]
    model = physics.SeatedBraidMemory()
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


def run_files(folder: Path) -> list[Path]:
    """The runs as files that anybody could have, as `fit --hysteresis` reads them."""
    folder.mkdir(parents=True, exist_ok=True)
    files = []
    for fold in task("isometric-runs").load(measured_data(None)):
        for run in fold.test:
            assert run.time is not None
            rest = np.full(len(run), run.dimensions["rest_length"])
            pressure = run.inputs["pressure"] + AARL_ZERO  # as its sensor reads it
            columns = (run.time, run.inputs["length"], rest, pressure, run.outputs["tension"])
            path = folder / f"{run.name.replace(' ', '_').replace(',', '')}.csv"
            header = "time_s,length_m,rest_length_m,pressure_Pa,force_N"
            later = np.diff(run.time, prepend=-np.inf) > 0.0  # the recorder wrote some times twice
            np.savetxt(path, np.column_stack(columns)[later], delimiter=",", header=header, comments="", fmt="%.7g")
            files.append(path)
    return files


def by_command(files: Sequence[Path], every: int) -> dict[str, Any]:
    """What `fit --hysteresis` says of files of which each of `every` samples is kept."""
    with tempfile.TemporaryDirectory() as folder:
        for path in files:
            header, *lines = path.read_text(encoding="utf-8").splitlines()
            kept = [header, *lines[::every]]
            Path(folder, path.name).write_text("\n".join(kept) + "\n", encoding="utf-8")
        plateaus = measured_data(None) / "aarl_10mm_isometric" / "quasistatic_plateaus.csv"
        points = mk.read_force_map(plateaus, pressure_zero=AARL_ZERO)
        recordings = read_recordings(f"{folder}/*.csv", pressure_zero=AARL_ZERO)
        known = {"rest_diameter": 0.010, "wall_thickness": 0.0018}
        fit = mk.fit(points, "seated_braid", known=known, schemes=(), length_error=LENGTH_ERROR, hysteresis=recordings)
    h = fit.hysteresis
    assert h is not None and h.held_back is not None
    return {
        "recordings": len(h.recordings),
        "samples": h.samples,
        "models": [[m.title, len(m.free), m.rmse, m.aicc] for m in h.models],
        "parameters": {name: [e.value, e.low, e.high] for name, e in h.parameters.items()},
        "left by the law, with its errors, with this [N]": [h.uncorrected_rmse, h.law_rmse, h.rmse],
        "held back, by this and by the law [N]": list(h.held_back),
    }


def drawn_command(found: dict[str, Any]) -> str:
    """The table of `fit --hysteresis`, and its words."""
    whole = found["1"]
    least = whole["models"][0][3]
    lines = [
        f"Of {found['runs']} runs {whole['recordings']} pull:",
        "",
        "| | free | rms, N | AICc above the least |",
        "|---|---:|---:|---:|",
    ]
    lines += [f"| {title} | {free} | {rms:.2f} | {aicc - least:.1f} |" for title, free, rms, aicc in whole["models"]]
    lines += [
        "",
        "| parameter | all samples | 95 % interval | every tenth | 95 % interval |",
        "|---|---:|---|---:|---|",
    ]
    words = {
        "constant": ("friction without pressure, N", 1.0),
        "per_pressure": ("friction per pressure, N/bar", 1e5),
        "stiffness": ("stiffness of the contact, N/mm", 1e-3),
        "creep": ("stiffness of creep, N/mm", 1e-3),
    }
    for name, (word, unit) in words.items():
        if any(name in found[e]["parameters"] for e in ("1", "10")):
            cells = []
            for every in ("1", "10"):
                e = found[every]["parameters"].get(name)
                value, low, high = (np.nan,) * 3 if e is None else unit * np.asarray(e)
                cells += ["", "left out"] if e is None else [f"{value:.3g}", f"{low:.2g} to {high:.2g}"]
            lines.append(f"| {word} | {' | '.join(cells)} |")
    law, own, left = whole["left by the law, with its errors, with this [N]"]
    mine, theirs = whole["held back, by this and by the law [N]"]
    lines += [
        "",
        f"The law leaves {law:.2f} N rms, {own:.2f} N with errors of its own, {left:.2f} N with friction and creep. "
        f"Recordings held back in turn are predicted within {mine:.2f} N, by the law alone within {theirs:.2f} N.",
    ]
    return "\n".join(lines)


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
    parser.add_argument("--draw", type=Path, metavar="FILE", help="Write the tables of results, and measure nothing.")
    parser.add_argument("--files", type=Path, help="Folder that keeps the runs as files.")
    chosen = parser.parse_args()
    if chosen.draw:
        written.write(WRITTEN, json.loads(chosen.draw.read_text()))
        return
    with tempfile.TemporaryDirectory() as folder:
        files = run_files(chosen.files or Path(folder))
        command = {str(every): by_command(files, every) for every in (1, 10)}
    found = measure()
    found["command"] = command | {"runs": len(files)}
    chosen.out.write_text(json.dumps(found, indent=1) + "\n")


PAGE = "explanation/friction.md"
WRITTEN = (
    written.WrittenPart(PAGE, BEGIN, END, drawn),
    written.WrittenPart(PAGE, BEGIN_FIT, END_FIT, lambda found: drawn_command(found["command"])),
)

if __name__ == "__main__":
    main()
