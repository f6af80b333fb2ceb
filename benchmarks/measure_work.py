"""Whole pieces of work, as a user starts them: a fit, a sweep, a recorded machine, and the loop by the wall clock."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

from timing import CORES, pin

HERE = Path(__file__).parent
SWEEP = """schema = 1
title = "The isometric protocol on many muscles"
protocol = "isometric-step"
muscle = "nylon"
rig = "paper"
[set]
cycles = 1
sample_rate = "1 kHz"
[latin]
count = {count}
seed = 1
[latin.ranges]
"muscle.law.threshold_pressure" = {{ from = "0.8 bar", to = "1 bar" }}
"rig.plumbing.direct.tube.length" = {{ from = "0.2 m", to = "2 m" }}
[outputs.peak]
channel = "muscle.load_tension"
reduce = "max"
"""


def started(what: str, *arguments: str, patience: float = 1800.0) -> tuple[str, float, str]:
    """Standard output and seconds of a process on all cores, or why there is none."""
    pin(CORES)  # which the process inherits
    begin = time.perf_counter()
    try:
        done = subprocess.run([sys.executable, *arguments], capture_output=True, text=True, timeout=patience)
    except (OSError, subprocess.TimeoutExpired) as problem:
        return "", 0.0, f"{what}: {problem}"
    finally:
        pin()
    took = time.perf_counter() - begin
    if done.returncode:
        last = [line for line in done.stderr.splitlines() if line.strip()][-1:] or ["no message"]
        return "", took, f"{what}: {last[0]}"
    return done.stdout, took, ""


def fits(quick: bool, notes: list[str]) -> list[Any]:
    """Laws to a published force map with all cross-validations, as a command of its own."""
    rows = []
    for law in ("ideal",) if quick else ("ideal", "sarosi", "hyperelastic_braid"):
        runs = [
            started("fit", "-m", "mckibben", "fit", "DMSP-10-250", "--law", law, "--json")
            for _ in range(1 if quick else 3)
        ]
        if runs[-1][2]:
            notes.append(runs[-1][2])
            continue
        found = json.loads(runs[-1][0])["fits"][0]
        rows.append(
            {
                "group": "work",
                "case": f"fit of {law} to {found['n']} points",
                "engine": "mckibben",
                "seconds": statistics.median(run[1] for run in runs),
                "error": found["rmse"],
                "error_unit": "N",
            }
        )
    return rows


def sweep(quick: bool, notes: list[str]) -> list[Any]:
    """The isometric protocol on many variants, through the command line, on all cores."""
    count = 64 if quick else 2000
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "sweep.toml"
        file.write_text(SWEEP.format(count=count))
        said, took, why = started(
            "sweep", "-m", "mckibben", "sweep", str(file), "--out", str(Path(name) / "out"), "--json"
        )
    if why:
        notes.append(why)
        return []
    found = json.loads(said)
    return [
        {
            "group": "work",
            "case": f"sweep of {count} variants",
            "engine": "mckibben",
            "seconds": took,
            "rate": count / took,
            "failed": found["failed"],
            "real_time": found["muscle_seconds_per_second"],
        }
    ]


def scripts(quick: bool, notes: list[str]) -> list[Any]:
    """What one machine records, and how the loop by the wall clock keeps its deadlines."""
    rows = []
    said, _, why = started("recording rate", str(HERE / "recording_rate.py"), "--json", "--runs", "2" if quick else "5")
    if why:
        notes.append(why)
    for row in json.loads(said or "[]"):
        rows.append(
            {
                "group": "work",
                "case": f"recorded machine, {row['sample_rate']:g} samples/s, {row['channels']} channels",
                "engine": "mckibben",
                "rate": row["values_per_second"],
                "real_time": row["real_time"],
            }
        )
    if quick:
        return rows
    said, _, why = started("wall clock", str(HERE / "wall_clock.py"), "--json", "--seconds", "20")
    if why:
        notes.append(why)
    for row in json.loads(said or "[]"):
        rows.append({"group": "clock", "case": f"{row['way']}, {row['sample_rate']:g} samples/s", **row})
    return rows


def measure(quick: bool) -> dict[str, Any]:
    """All of them; what could not be run is noted."""
    notes: list[str] = []
    return {"rows": fits(quick, notes) + sweep(quick, notes) + scripts(quick, notes), "notes": notes}
