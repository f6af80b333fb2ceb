"""The tables of `docs/how-to/score-a-controller.md`: controllers on plants that they were not built on, plant by plant.

    python benchmarks/control_scores.py [--duration SECONDS] [--reference R1,R2,R4] [--controller NAME,NAME]

Each line is printed as soon as its controller has driven all plants. Below are the plants on which a controller is no worse
than `pid` and than `published-lqi`.
"""

from __future__ import annotations

import argparse

import numpy as np

from mckibben.control import CONTROLLERS, control_task, unseen_plants
from mckibben.control.benches import BENCHES, NOMINAL
from mckibben.control.references import REFERENCES
from mckibben.control.scores import ControlScore, run_controller

RIVALS = ("published-lqi", "pid")
NAMES = (*RIVALS, "inverse", "memory-inverse", "lqi-memory", "mpc")
COLUMNS = {"settled": (1e3, ".3f"), "tracking": (1e3, ".3f"), "overshoot": (1e3, ".3f"), "air": (1e3, ".2f")}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--duration", type=float, default=60.0, help="Longest duration of a run in seconds")
    parser.add_argument("--reference", default="R1,R2,R4", help="References of bench B1")
    parser.add_argument("--controller", default=",".join(NAMES), help="Controllers; the rivals are always among them")
    given = parser.parse_args()
    task, bench = control_task("B1"), BENCHES["B1"]
    machines = [bench.simulation(plant) for plant in (NOMINAL, *unseen_plants())]
    for name in given.reference.split(","):
        reference, scores = REFERENCES[name], dict[str, np.ndarray]()
        print(f"\n| {name} | {' | '.join(COLUMNS)} | tracking, built on it |\n|---|---|---|---|---|---|", flush=True)
        seconds = min(given.duration, reference.duration)
        for one in dict.fromkeys((*RIVALS, *given.controller.split(","))):
            controller = CONTROLLERS[one](task)
            runs = [run_controller(controller, m, task, reference, duration=seconds).score for m in machines]
            scores[one] = np.array(runs)
            print(f"| `{one}` | {' | '.join(cells(scores[one][1:]))} | {1e3 * runs[0].tracking:.3f} |", flush=True)
        for one, rows in scores.items():
            for rival in (r for r in RIVALS if r != one):
                print(f"{one} no worse than {rival}: {', '.join(counts(rows[1:], scores[rival][1:]))}", flush=True)


def cells(scores: np.ndarray) -> list[str]:
    """Median and worst of the scores (plants, columns)."""
    made = []
    for column, (factor, style) in COLUMNS.items():
        values = factor * scores[:, ControlScore._fields.index(column)]
        made.append(f"{np.median(values):{style}} ({values.max():{style}})" if np.isfinite(values).all() else "-")
    return made


def counts(scores: np.ndarray, rivals: np.ndarray) -> list[str]:
    """In how many of all plants a controller is no worse, by column that the reference has."""
    places = {column: ControlScore._fields.index(column) for column in COLUMNS}
    had = {column: k for column, k in places.items() if np.isfinite(scores[:, k]).all()}
    return [f"{column} {(scores[:, k] <= rivals[:, k]).sum()} of {len(scores)}" for column, k in had.items()]


if __name__ == "__main__":
    main()
