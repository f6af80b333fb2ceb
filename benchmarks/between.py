"""How far a new muscle is from the law of its make, and what one and two readings of it tell: on measured muscles.

    MCKIBBEN_DATA=../shared/data python benchmarks/between.py --out between.json
    python benchmarks/between.py --draw between.json

A law is fitted to all muscles of a table but one, by least squares, and `mckibben.identification.between` predicts the
one left out: without a reading, and with readings at rest, at the length nearest to 4 % contraction, and at both, each the
point nearest to 5.5 bar while filling. Of a muscle of another laboratory the second reading is at the shortest length but
one. Errors and half widths are shares of the largest tension of the table. Coverage is of 95 % intervals of single
readings; the points of one muscle share errors, so that it is given of each muscle, too. The interval score (Gneiting and
Raftery, 2007) is the width, and 40 times what lies outside: less is better.

Each row stands twice: with the variances as declared, which were chosen with muscles of 10 mm in view, and with variances
estimated anew from the training muscles alone, starting from declared ones as a weak prior (a factor of two either way).
"""

from __future__ import annotations

import argparse
import dataclasses
import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import written

from mckibben.identification.between import Between, MusclePoints, NewMuscle, thinned
from mckibben.identification.calibration import muscle_of_fit
from mckibben.identification.fit import Fit, fit
from mckibben.recordings import ForceMap, read_force_map
from mckibben.specimens.model import BETWEEN_COMPONENTS
from mckibben_benchmark.tasks import reading_places
from mckibben_benchmark.validation import AARL_ZERO, PLATEAUS, measured_data

LAW = "seated_braid"
TEN = {"rest_diameter": 0.010, "wall_thickness": 0.0018}
TWENTY = {"rest_diameter": 0.020, "wall_thickness": 0.002}
TWENTY_FILE = "aarl_20mm_isometric/quasistatic_plateaus.csv"
TWENTY_ZERO, TWENTY_SLACK = 11e3, 18.595  # pressure zero [Pa] and what the force reads of a slack muscle, downwards [N]
SET_LENGTHS = {0.219: 0.216, 0.209: 0.206}  # of the muscle of 225 mm: as its files are named, which fits better [m]
TAUT = 2.0  # below which the 20 mm muscle hangs slack, a count of its converter [N]
TWENTY_LENGTHS = 3.0  # lengths on the rig of the 20 mm muscles, over those of the other
HOW = ("none", "rest", "4 %", "both")
COMPARED = 60  # points of one muscle, of many evenly so many, from which variances are estimated
PRIOR = np.log(2.0)  # standard deviation of the logarithm of a variance's root
MAPS = {
    "DMSP-10-250": ("martens_boblan_2017/DMSP-10-250_force_map.csv", 0.250),
    "DMSP-20-300": ("martens_boblan_2017/DMSP-20-300_force_map.csv", 0.300),
}
LABELS = {  # what a reader knows of each task: how the muscle differs from those by which it is told
    "10 mm, one of three left out": "same bore and rig (10 mm)",
    "20 mm, one of three left out": "same bore and rig (20 mm)",
    "10 to 20 mm": "another bore (20 mm by 10 mm)",
    "DMSP-10-250": "another laboratory (10 mm)",
    "DMSP-20-300": "another laboratory (20 mm)",
    "10 mm to DMSP-20-300": "another bore and laboratory",
}
DOCS = Path(__file__).resolve().parents[1] / "docs"
BEGIN, END = "<!-- written by benchmarks/between.py; do not edit -->", "<!-- end of between -->"


class MuscleScore(NamedTuple):
    """Errors and half widths of one muscle, as shares of the largest tension of its table (n,)."""

    muscle: str
    error: np.ndarray
    half: np.ndarray


class Row(NamedTuple):
    """One task: fits of the training muscles, and the muscle that each predicts."""

    task: str
    fitted: Fit
    test: ForceMap
    rest_length: float
    largest: float
    between: Between
    changes: dict[str, float]
    far: bool


def ten_millimetres(folder: Path) -> ForceMap:
    """Plateaus of the three muscles of 10 mm bore."""
    return read_force_map(folder / PLATEAUS, pressure_zero=AARL_ZERO)


def twenty_millimetres(folder: Path) -> ForceMap:
    """Plateaus of the three muscles of 20 mm bore, with the zeros of pressure and force, and lengths by file names."""
    points = read_force_map(folder / TWENTY_FILE, pressure_zero=TWENTY_ZERO)
    length = points.length.copy()
    for stated, named in SET_LENGTHS.items():
        length[np.isclose(length, stated)] = named
    points = replace(points, length=length, tension=points.tension + TWENTY_SLACK)
    return points.select(points.tension > TAUT)


def one_map(folder: Path, name: str) -> ForceMap:
    """The measured map of one muscle, as if taken while filling."""
    file, rest = MAPS[name]
    points = read_force_map(folder / file, rest_length=rest)
    return replace(points, branch=np.full(len(points), "inflate"))


def rows(folder: Path, fit_law: Any = fit) -> list[Row]:
    """All tasks with the fits of their training muscles."""
    ten, twenty = ten_millimetres(folder), twenty_millimetres(folder)
    near, wide = Between(), Between().scaled(TWENTY_LENGTHS)
    made = []

    def fitted(points: ForceMap, known: dict[str, float], between: Between) -> Fit:
        found: Fit = fit_law(LAW, points, known=known, schemes=(), slack=False, between=between)
        return found

    for task, points, known, between in (("10 mm, one of three left out", ten, TEN, near),
                                         ("20 mm, one of three left out", twenty, TWENTY, wide)):  # fmt: skip
        assert points.rest_length is not None
        for rest in np.unique(points.rest_length):
            out = points.rest_length == rest
            made.append(
                Row(task, fitted(points.select(~out), known, between), points.select(out), float(rest), points.largest,
                    between, {}, False)
            )  # fmt: skip
    whole = fitted(ten, TEN, near), fitted(twenty, TWENTY, wide)
    assert twenty.rest_length is not None
    for rest in np.unique(twenty.rest_length):
        some = twenty.select(twenty.rest_length == rest)
        made.append(
            Row("10 to 20 mm", whole[0], some, float(rest), twenty.largest, wide.at_other_bore(), TWENTY, False)
        )
    for name, own, between in zip(MAPS, whole, (near, wide), strict=True):
        points = one_map(folder, name)
        made.append(Row(name, own, points, MAPS[name][1], points.largest, between.elsewhere(), {}, True))
    far = wide.elsewhere().at_other_bore()  # in which nothing was chosen on this muscle but what is unread
    made.append(Row("10 mm to DMSP-20-300", whole[0], points, MAPS[name][1], points.largest, far, TWENTY, True))
    return made


def estimated(row: Row) -> Between:
    """Variances from the training muscles alone: the most probable ones under a prior around the declared ones."""
    from scipy import optimize

    assert row.fitted.points.rest_length is not None
    muscles: list[tuple[MusclePoints, np.ndarray]] = []
    for rest in np.unique(row.fitted.points.rest_length):
        some = thinned(row.fitted.points.select(row.fitted.points.rest_length == rest))
        some = some.select(np.arange(len(some)) % max(1, len(some) // COMPARED) == 0)
        law = muscle_of_fit(
            row.fitted, row.fitted.between, row.fitted.build(rest_length=float(rest)), tuple(row.fitted.parameters)
        ).muscle
        at = law.points(some.length, some.pressure, some.branch)
        pulls = at.tension > 0.0  # of a law that is slack a tension is no error of the signed force
        seen = {
            name: getattr(at, name)[pulls]
            for name in ("length", "pressure", "branch", "tension", "stiffness", "slopes")
        }
        muscles.append((at._replace(**seen), (some.tension - at.tension)[pulls]))
    declared = np.array([getattr(row.fitted.between, name) for name in BETWEEN_COMPONENTS])
    slopes = np.concatenate([at.slopes for at, _ in muscles])
    size = np.linalg.norm(slopes, axis=0)

    def cost(logs: np.ndarray) -> float:
        between = Between(**dict(zip(BETWEEN_COMPONENTS, declared * np.exp(logs), strict=True)))
        total, information, pull = float(logs @ logs) / PRIOR**2, 0.0, 0.0
        for at, left in muscles:
            covariance = between.own_covariance(at) + (between.noise * at.largest) ** 2 * np.eye(len(left))
            factor = np.linalg.cholesky(covariance)
            trend, error = np.linalg.solve(factor, at.slopes / size), np.linalg.solve(factor, left)
            total += 2.0 * float(np.log(np.diag(factor)).sum()) + float(error @ error)
            information, pull = information + trend.T @ trend, pull + trend.T @ error
        return total - float(pull @ np.linalg.solve(information, pull)) + float(np.linalg.slogdet(information)[1])

    found = optimize.minimize(cost, np.zeros(len(declared)), method="L-BFGS-B", bounds=[(-3.0, 3.0)] * len(declared))
    return Between(**dict(zip(BETWEEN_COMPONENTS, declared * np.exp(found.x), strict=True)))


def places(row: Row, how: str) -> list[int]:
    """Indices of the readings of a muscle among its points with tension."""
    both = reading_places(row.test, row.rest_length, far=row.far)
    return {"none": [], "rest": both[:1], "4 %": both[1:], "both": both}[how]


def new_muscle(row: Row, between: Between | None = None) -> NewMuscle:
    """The muscle that a row leaves out, unread; with variances of its own, or as estimated anew."""
    whole: Any = row.changes | {"rest_length": row.rest_length}
    reach = float(row.test.length.max())
    law = row.fitted.build(**(whole | {"upper_length": max(reach, row.rest_length)}))
    fitted = row.fitted if between is None else dataclasses.replace(row.fitted, between=between)
    new = muscle_of_fit(fitted, fitted.between, law, tuple(row.fitted.parameters))
    if between is None:
        return replace(new, between=row.between)
    assert row.fitted.between is not None
    # How a muscle of another rig or laboratory differs from these stays as declared: no training muscle shows it.
    of_rig = {n: getattr(row.between, n) / getattr(row.fitted.between, n) for n in BETWEEN_COMPONENTS}
    return replace(
        new, between=replace(row.between, **{n: getattr(between, n) * of_rig[n] for n in BETWEEN_COMPONENTS})
    )


def score(row: Row, how: str, between: Between | None = None) -> MuscleScore:
    """Predict the muscle that a row leaves out, with variances as declared or as estimated anew."""
    row = row._replace(test=row.test.select(row.test.taut))
    new, read = new_muscle(row, between), places(row, how)
    test = row.test
    if read:
        new = new.conditioned([(test.length[i], test.pressure[i], test.tension[i]) for i in read])
    mean, half = new.predict(test.length, test.pressure, test.branch)
    rest = np.ones(len(test), bool)
    rest[read] = False
    return MuscleScore(
        f"{1e3 * row.rest_length:.0f} mm", ((mean - test.tension) / row.largest)[rest], (half / row.largest)[rest]
    )


def calibrated_error(row: Row, how: str) -> np.ndarray:
    """Errors of the calibrated muscle, one law with a potential, at the points that were not read (n,)."""
    row = row._replace(test=row.test.select(row.test.taut))
    read, test = places(row, how), row.test
    new = new_muscle(row).conditioned([(test.length[i], test.pressure[i], test.tension[i]) for i in read])
    law = new.muscle.law.replace(**new.calibrated())
    rest = np.ones(len(test), bool)
    rest[read] = False
    error: np.ndarray = (np.asarray(law.tension(test.length, test.pressure)) - test.tension)[rest] / row.largest
    return error


def summary(scores: list[MuscleScore]) -> dict[str, Any]:
    """Figures of one row of the table."""
    error, half = (np.concatenate([getattr(s, name) for s in scores]) for name in ("error", "half"))
    inside = {s.muscle: float(np.mean(np.abs(s.error) <= s.half)) for s in scores}
    outside = np.maximum(np.abs(error) - half, 0.0)
    return {
        "rms": float(np.sqrt(np.mean(error**2))),
        "max": float(np.abs(error).max()),
        "coverage": float(np.mean(np.abs(error) <= half)),
        "least": min(inside.values()),
        "half_width": float(half.mean()),
        "score": float(np.mean(2.0 * half + 40.0 * outside)),
        "muscles": inside,
    }


def table(folder: Path) -> list[dict[str, Any]]:
    """Every task by every set of readings, with variances as declared and estimated anew."""
    every, found = rows(folder), []
    for task in dict.fromkeys(row.task for row in every):
        some = [row for row in every if row.task == task]
        anew = [estimated(row) for row in some]
        for how in HOW:
            line: dict[str, Any] = {"task": task, "readings": how, "declared": summary([score(r, how) for r in some])}
            line["anew"] = summary([score(r, how, b) for r, b in zip(some, anew, strict=True)])
            if how != "none":
                error = np.concatenate([calibrated_error(r, how) for r in some])
                line["calibrated"] = {"rms": float(np.sqrt(np.mean(error**2))), "max": float(np.abs(error).max())}
            found.append(line)
            print(
                line["task"],
                how,
                {k: round(100 * v, 1) for k, v in line["declared"].items() if k != "muscles"},
                flush=True,
            )
            print(
                "   anew",
                {k: round(100 * v, 1) for k, v in line["anew"].items() if k != "muscles"},
                line.get("calibrated"),
            )
    return found


def main() -> None:
    """Measure, or draw what was measured."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("between.json"), help="Figures.")
    parser.add_argument(
        "--draw", type=Path, metavar="FILE", help="Draw figure and table of results, and measure nothing."
    )
    chosen = parser.parse_args()
    if chosen.draw:
        draw(json.loads(chosen.draw.read_text()))
        return
    folder = measured_data(None)
    assert folder is not None
    chosen.out.write_text(json.dumps(table(Path(folder)), indent=1) + "\n")


def lines(result: list[dict[str, Any]]) -> str:
    """The table, in percents."""
    made = [
        "| left out | readings | rms / max | inside, least muscle | half width | score | anew: inside, half width |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for one in result:
        ours, anew = one["declared"], one["anew"]
        p = {name: 100.0 * value for name, value in ours.items() if name != "muscles"}
        cells = [
            one["task"],
            one["readings"],
            f"{p['rms']:.1f} / {p['max']:.1f}",
            f"{p['coverage']:.0f}, {p['least']:.0f}",
            f"{p['half_width']:.1f}",
            f"{p['score']:.1f}",
            f"{100 * anew['coverage']:.0f}, {100 * anew['half_width']:.1f}",
        ]
        made.append(f"| {' | '.join(cells)} |")
    return "\n".join(made)


def draw(result: list[dict[str, Any]]) -> None:
    """Write the figure, and the table between the marks of the documentation's page."""
    from mckibben.report.figures import style

    with style.styled():
        fig = style.figure(style.MIDDLE, 3.2)
        axes = fig.subplots()
        fig.subplots_adjust(bottom=0.18)
        for task in dict.fromkeys(one["task"] for one in result):
            by = {one["readings"]: one["declared"] for one in result if one["task"] == task}
            rms = [100.0 * by[how]["rms"] for how in ("none", "rest", "both")]
            axes.plot([0, 1, 2], rms, "o-", label=LABELS[task])
        axes.set_xticks([0, 1, 2], ["none", "one, at rest", "two"])
        axes.set(xlabel="readings of the muscle that is told", ylim=(0.0, None))
        axes.set_ylabel("rms error, % of largest tension")
        axes.legend()
        style.save(fig, DOCS / "assets" / "between.svg")
    written.write(WRITTEN, result)


WRITTEN = (written.WrittenPart("explanation/how-far-to-trust-a-number.md", BEGIN, END, lines),)


if __name__ == "__main__":
    main()
