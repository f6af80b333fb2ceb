"""Bench B1 from the given holds, loop and step, by `Simulation.fit`, from numbers far off; and the published controllers.

    python benchmarks/bench_b1.py               # needs MCKIBBEN_DATA, or ../shared/data
    mckibben control --controller published-feedforward,published-pid,published-lqi --reference R1      # the controllers

One record: the loop with half a second for each of its 203 pressures, from the state in which the bench begins, 59 holds of
4 s, and the step up and down. The commands are the pressures that the sensor showed, for the regulator's scale of that day
is not that of its sheet; strokes are compared where there are any. Fitted are load, friction, creep and valve of the
simulation that the bench is. It takes two and a half minutes of a processor and comes to an rms of 0.44 mm on the holds and
0.61 mm on the loop; B1 as it is stated has 0.48 and 0.62 mm.
"""

from __future__ import annotations

import csv
import os
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

import mckibben as mk
from mckibben.components import paths
from mckibben.control.benches import NOMINAL, ZERO, find_bench
from mckibben.simulation.fit import find_parameters

DATA = Path(os.environ.get("MCKIBBEN_DATA", Path(__file__).parents[2] / "shared/data"))
PERIOD, REST, HOLD, STAND, AFTER = 1e-2, 8.0, 4.0, 0.5, 4.0  # [s]
PUBLISHED = {"holds": 0.54, "loop": 0.62}  # rms of 70 lines of one's own [mm]
# What is fitted, and where it begins: factors of all numbers of an array, and numbers [SI].
BEGIN = {
    "load.weight": (15.0, (1.0, 100.0)),
    "load.stiffness": (800.0, (50.0, 3000.0)),
    "load.spring_rest": (0.23, (0.2, 0.27)),
    "load.damping": (30.0, (1.0, 500.0)),
    "friction.limit.*": (0.4, None),
    "friction.stiffness": (0.6, None),
    "creep.stiffness": (0.3, None),
    "valve.fill.conductance": (4e-10, (2e-11, 5e-9)),
    "valve.relief.conductance": (4e-10, (2e-11, 5e-9)),
}


def rows(file: str) -> list[dict[str, str]]:
    """The rows of a table."""
    with (DATA / file).open(encoding="utf-8") as text:
        return list(csv.DictReader(text))


def record() -> tuple[mk.Recording, dict[str, np.ndarray]]:
    """The record, and which of its samples are of which measurement."""
    pressures, strokes, parts = [], [], []

    def add(part: str, seconds: float, pressure: float, stroke: float = np.nan) -> None:
        count = round(seconds / PERIOD)
        pressures.extend([max(pressure, 0.0)] * count)
        strokes.extend([np.nan] * (count - 1) + [stroke])
        parts.extend([part] * count)

    # the loop first: after the holds friction keeps the muscle shortened at no pressure, and the loop begins at stroke zero
    for row in rows("dmsp_10_250_hysteresis/pressure_stroke_loop.csv"):
        add("loop", STAND, 1e5 * float(row["p_bar_gauge"]), 1e-3 * float(row["stroke_mm"]))
    add("", REST, 0.0)
    for row in rows("dmsp_10_250_holds/random_holds.csv"):
        add("holds", HOLD, 1e5 * float(row["pressure_bar"]), 1e-3 * float(row["stroke_mm"]))
    add("", REST, 0.0)
    steps = rows("dmsp_10_250_hysteresis/step_response_100hz.csv")
    for part in ("step_up", "step_down"):
        here = [row for row in steps if row["segment"] == part]
        plateau = 1e5 * np.median([float(row["p_bar_sensor"]) for row in here[-20:]])
        for k, row in enumerate(here):  # the command of a row acts after it
            add(part, PERIOD, plateau if k or part == "step_down" else 0.0, 1e-3 * float(row["stroke_mm"]))
        if part == "step_up":
            add("", AFTER - PERIOD * len(here), plateau)
    # the observation of a sample is of its beginning, a stroke at the end of a hold of the next one's
    channels = {
        "muscle.command": mk.Channel(np.array(pressures), "Pa"),
        "measured.position": mk.Channel(ZERO - np.array(strokes), "m"),
    }
    made = mk.Recording(PERIOD * np.arange(len(pressures)), channels, {"timing": "given", "first_sample": 0})
    return made, {part: np.array(parts) == part for part in ("holds", "loop", "step_up", "step_down")}


def main() -> None:
    bench, (made, parts) = find_bench("B1"), record()
    sim = mk.Simulation(bench.mechanism(NOMINAL), NOMINAL.air(), period=PERIOD)
    places = {name: find_parameters(sim.machine, name, "free") for name in BEGIN}
    changes = {}
    for name, (value, bounds) in BEGIN.items():
        for path in places[name]:
            own = np.asarray(paths.get(sim.machine, path), float)
            changes[path] = np.asarray(value) if bounds else value * own
    begun = sim.with_arrays(changes)
    clock, used = time.perf_counter(), time.process_time()
    found = begun.fit(made, free={name: bounds for name, (_, bounds) in BEGIN.items()}, measured=("position",))
    print(
        f"{time.perf_counter() - clock:.0f} s, of the processor {time.process_time() - used:.0f} s; {found.evaluations} runs"
    )
    for name, e in found.estimates.items():
        print(f"{name}: {e.value:.4g} ({e.low:.4g} to {e.high:.4g}) {e.unit}")
    for words, one in (("begun", begun), ("bench B1", sim), ("fitted", found.simulation)):
        off = 1e3 * (replace(found, simulation=one).predict(made).position - made["measured.position"])
        said = (f"{part} {np.sqrt(np.nanmean(off[mask] ** 2)):.3f}" for part, mask in parts.items())
        print(f"rms of {words}, mm: {', '.join(said)}; of 70 own lines {PUBLISHED}")
    print(*found.cautions, sep="\n")


if __name__ == "__main__":
    main()
