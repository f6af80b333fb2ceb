"""Compute the tension of a muscle from the dimensions of its braid.

    python examples/braid_to_law.py [FOLDER]

Prints tensions and free lengths, and saves a figure with the curves of the muscle in the folder (default `out`).
"""

import math
import sys
from pathlib import Path

import jax
import numpy as np

import mckibben
from mckibben.quantities import parse
from mckibben.report.figures import muscle_figures, style


def main(folder: Path) -> None:
    length = parse("200 mm", "m", field="length")
    diameter = parse("12 mm", "m", field="diameter")
    angle = parse("26 deg", "rad", field="angle")

    thread_length = length / math.cos(angle)
    turns = length * math.tan(angle) / (math.pi * diameter)
    law = mckibben.law(
        "thick_wall",
        {"thread_length": thread_length, "turns": turns, "wall_thickness": 1.5e-3, "upper_length": length},
    )

    lengths, pressures = np.linspace(0.13, length, 8), np.array([1e5, 2e5, 3e5, 4e5, 5e5])
    tension = np.asarray(jax.jit(law.tension)(lengths, pressures[:, None]))
    print("tension in N at 1 to 5 bar (rows) and lengths in cm (columns)")
    print("      " + "".join(f"{100 * x:8.1f}" for x in lengths))
    for pressure, row in zip(pressures, tension, strict=True):
        print(f"{pressure / 1e5:.0f} bar " + "".join(f"{f:8.1f}" for f in row))
    free = np.asarray(jax.jit(law.free_length)(pressures))
    print("free length in cm: " + ", ".join(f"{100 * x:.2f}" for x in free))

    style.save(muscle_figures.law_curves(law, title="The muscle on the desk"), folder / "braid-to-law.svg")


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    where.mkdir(exist_ok=True)
    main(where)
