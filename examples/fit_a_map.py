"""Fit two laws to a measured force map, and predict the tension at pressures left out of the fit.

    python examples/fit_a_map.py [FOLDER]

The map is that of M. Martens and I. Boblan, Actuators 2017, 6(4), 33, CC BY 4.0. Saves a figure of the law with
the smallest error above 4 bar in the folder.
"""

import sys
from pathlib import Path

import mckibben
from mckibben.report.figures import fit_figures, style
from mckibben.specimens import map_file


def main(folder: Path) -> None:
    muscle = mckibben.specimen("DMSP-10-250")
    points = mckibben.read_force_map(map_file(muscle), rest_length=muscle.property_si("rest_length", "m"))
    known = {
        "rest_diameter": muscle.property_si("rest_inner_diameter", "m"),
        "wall_thickness": muscle.property_si("wall_thickness", "m"),
    }
    fits = mckibben.fit_all(
        points, laws=["sarosi", "hyperelastic_braid"], known=known, schemes=("pressure",), train_below=4e5
    )
    for fit in fits:
        assert fit.holdout is not None and fit.cv_max_error is not None
        left_out, above = (100 * e / points.largest for e in (fit.cv_max_error, fit.holdout.max_error))
        print(
            f"{fit.law:19} rmse {fit.rmse:5.2f} N; largest error with a pressure left out {left_out:5.2f} %,", end=" "
        )
        print(f"above 4 bar {above:5.2f} %")
    trusted = min(fits, key=lambda fit: fit.holdout.max_error if fit.holdout else float("inf"))
    for name, e in trusted.parameters.items():
        print(f"  {name} = {e.value:.5g} {e.unit}  ({e.low:.5g} to {e.high:.5g})")
    style.save(fit_figures.tension_curves(trusted, points), folder / "fit-a-map.svg")


if __name__ == "__main__":
    where = Path(sys.argv[1] if len(sys.argv) > 1 else "out")
    where.mkdir(exist_ok=True)
    main(where)
