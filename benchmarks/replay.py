"""Choice of points on a measured map: how well the whole map is predicted from some of its plateaus.

    MCKIBBEN_DATA=../shared/data python benchmarks/replay.py --out replay.json
    python benchmarks/replay.py --draw replay.json

The plateaus of a 10 mm muscle at rising pressure (AARL) are hidden; a method asks for some of them, and the posterior of one
law predicts the others. All methods begin with the same plateaus. `next` asks for those that lower the expected uncertainty
of the map, and fits anew after each stage; a Latin hypercube (five seeds) and an even grid ask for the plateaus nearest to
their points. A plateau is known to be of a run, and the plateaus of a run share an error. Beside them the error of what a
fit of three quarters of the map says of the last quarter, by turns: nothing that is measured afterwards improves on it.
The map was measured in three runs at each length. The band of the true tension is held against their mean, between their
plateaus in a straight line.
Beside it the D-efficiency of points that are chosen for the parameters alone, relative to the continuous
optimum, which no design of any program exceeds; pydex and Pyomo.DoE design for the same slopes, each in an environment of
its own. `--designs` measures these alone. `--draw` writes the learning curves and the tables of the documentation.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
import written

import mckibben as mk
from mckibben.identification.next_points import MOVE, READ, VENT, Candidates, candidates_of, choose, continuous_optimum
from mckibben.identification.posterior import posterior_of_fit
from mckibben.identification.problem import Problem, latin_hypercube
from mckibben.identification.sampler import MIXED

LAW = "linear_threshold"
ERRORS = (
    "errors [N]: posterior, law alone; readings inside the band of a reading, means of the runs inside that of the true "
    "tension; width of both bands [N]; R-hat"
)
RUN_ERRORS, DIFFERENCES = "error of a run by next [N]", "largest difference of a run by length [mm], [N]"
FULL, FOLDS = "whole map", 4
FIRST, STAGES, SEEDS = 8, (12, 16, 20, 32, 48), 5
SEARCHED = 8  # readings whose places Pyomo.DoE searches at once; each counts as a sixth of a quarter of the map
PRIOR = 1e6  # variance of the parameters before any reading, of a design that goes by the readings alone
DRAWS, WARM_UP = 1000, 400
DOCS = Path(__file__).resolve().parents[1] / "docs"
BEGIN, END = "<!-- written by benchmarks/replay.py; do not edit -->", "<!-- end -->"
ERROR_TICKS = (1, 2, 5, 10, 20, 50, 100)  # of the figure [N]


def plateaus(cut: str) -> tuple[mk.ForceMap, np.ndarray]:
    """Taut plateaus of rising pressure of one muscle, and the mean tension of the three runs at each (n,) [N].

    The mean is not a number where not every run was at that pressure.
    """
    data = Path(os.environ.get("MCKIBBEN_DATA", "../shared/data")) / "aarl_10mm_isometric" / "quasistatic_plateaus.csv"
    with data.open(encoding="utf-8") as file:
        rows = [r for r in csv.DictReader(file) if r["cut_length_mm"] == cut and r["branch"] == "inflate"]
    columns = {
        k: np.array([float(r[k]) for r in rows])
        for k in ("test_length_mm", "pressure_kPa", "force_N", "rest_length_mm", "test_id")
    }
    keep = (columns["force_N"] > 1.0) & (columns["pressure_kPa"] > 50.0)
    values = (1e-3 * columns["test_length_mm"], 1e3 * columns["pressure_kPa"], columns["force_N"])
    mean, run = np.empty(int(keep.sum())), columns["test_id"][keep]
    lengths = columns["test_length_mm"][keep]
    # a file holds one test at one length
    labels = np.array([f"{length:g} mm, test {one:g}" for length, one in zip(lengths, run, strict=True)])
    points = mk.ForceMap(f"AARL 10 mm, {cut} mm", *(column[keep] for column in values), run=labels)
    for length in np.unique(points.length):
        at = points.length == length
        tensions = []
        for one in np.unique(run):
            places = np.flatnonzero(at & (run == one))
            places = places[np.argsort(points.pressure[places])]
            curve = points.pressure[places], points.tension[places]
            tensions.append(np.interp(points.pressure[at], *curve, left=np.nan, right=np.nan))
        mean[at] = np.mean(tensions, axis=0)
    return points.with_rest_length(1e-3 * float(columns["rest_length_mm"][0])), mean


def nearest(points: mk.ForceMap, wanted: np.ndarray, taken: list[int]) -> list[int]:
    """The plateaus nearest to places in the unit square, each once."""
    places = np.stack([points.length, points.pressure], axis=1)
    places = (places - places.min(axis=0)) / np.ptp(places, axis=0)
    chosen = list(taken)
    for place in wanted:
        distance = ((places - place) ** 2).sum(axis=1)
        distance[chosen] = np.inf
        chosen.append(int(distance.argmin()))
    return chosen


def posterior_from(points: mk.ForceMap, chosen: list[int]):  # noqa: ANN201
    """Fit and posterior of some plateaus."""
    some = points.select(np.array(sorted(chosen)))
    fit = mk.fit(some, law=LAW, schemes=())
    return fit, posterior_of_fit(fit, draws=DRAWS, warm_up=WARM_UP)


def errors(points: mk.ForceMap, mean: np.ndarray, chosen: list[int], fit, posterior) -> list[float]:  # noqa: ANN001
    """Errors at the hidden plateaus, and shares of them inside the 95 % bands.

    Returns:
        Root mean square error of the posterior's median and of the law of the least squares [N], share of the hidden
        readings inside the band of a reading, share of the means of the runs inside the band of the true tension, mean
        widths of both bands [N], largest R-hat.
    """
    hidden = np.setdiff1d(np.arange(len(points)), chosen)
    at, rest = (points.length[hidden], points.pressure[hidden]), points.rest_length[0]
    band, true_band = (posterior.tension(*at, rest_length=rest, measured=reading) for reading in (True, False))
    law = np.maximum(
        Problem(LAW, tuple(fit.parameters), {k: float(np.max(v)) for k, v in fit.known.items()}, points.select(hidden))
        .functions()[0](np.array([e.value for e in fit.parameters.values()]) / scale_of(fit)), 0.0,
    )  # fmt: skip
    read, true = points.tension[hidden], mean[hidden]
    known = np.isfinite(true)
    inside = [
        float(((band.low <= read) & (read <= band.high)).mean()),
        float(((true_band.low <= true) & (true <= true_band.high))[known].mean()),
    ]
    wrong = [float(np.sqrt(np.mean((x - read) ** 2))) for x in (true_band.median, law)]
    widths = [float(np.mean(one.high - one.low)) for one in (band, true_band)]
    return [*wrong, *inside, *widths, posterior.r_hat]


def whole_map(points: mk.ForceMap, mean: np.ndarray) -> list[float]:
    """Errors as of `errors`, of each quarter of the map by the posterior of the other three, mean of all four."""
    order = np.random.default_rng(0).permutation(len(points))
    rows = []
    for hidden in np.array_split(order, FOLDS):
        chosen = [int(i) for i in np.setdiff1d(order, hidden)]
        rows.append(errors(points, mean, chosen, *posterior_from(points, chosen)))
    return [float(v) for v in (*np.mean(rows, axis=0)[:-1], np.max(rows, axis=0)[-1])]


def scale_of(fit) -> np.ndarray:  # noqa: ANN001
    return Problem(fit.law, tuple(fit.parameters), {}, fit.points).scale


def replay(points: mk.ForceMap, mean: np.ndarray) -> dict[str, Any]:
    """Errors by method and number of plateaus, and how far runs differ."""
    first = nearest(points, latin_hypercube(FIRST, 2, 0), [])
    curves: dict[str, dict[int, list[float]]] = {"next": {}, "Latin hypercube": {}, "grid": {}}
    chosen, about = list(first), np.arange(len(points))
    fit, posterior = posterior_from(points, chosen)
    curves["next"][FIRST] = errors(points, mean, chosen, fit, posterior)
    run_errors = {FIRST: posterior.run_error}
    for count in STAGES:
        every = candidates_of(posterior, points.length, points.pressure, runs=points.run)
        chosen = greedy(every, chosen, count, about)
        fit, posterior = posterior_from(points, chosen)
        curves["next"][count] = errors(points, mean, chosen, fit, posterior)
        run_errors[count] = posterior.run_error
        several = []
        for seed in range(1, SEEDS + 1):
            others = nearest(points, latin_hypercube(count - FIRST, 2, seed), first)
            several.append(errors(points, mean, others, *posterior_from(points, others)))
        curves["Latin hypercube"][count] = [*np.mean(several, axis=0)[:-1].tolist(), max(row[-1] for row in several)]
        side = int(np.ceil(np.sqrt(count - FIRST)))
        grid = np.stack(np.meshgrid(*[(np.arange(side) + 0.5) / side] * 2), axis=-1).reshape(-1, 2)
        grid = grid[np.linspace(0, len(grid) - 1, count - FIRST).round().astype(int)]
        even = nearest(points, grid, first)
        curves["grid"][count] = errors(points, mean, even, *posterior_from(points, even))
    curves[FULL] = {len(points) - len(points) // FOLDS: whole_map(points, mean)}
    return {ERRORS: curves, RUN_ERRORS: run_errors, DIFFERENCES: run_differences(points, mean)}


def run_differences(points: mk.ForceMap, mean: np.ndarray) -> dict[str, float]:
    """Largest mean difference of a run from the mean of all at its length [N], by length [mm]."""
    largest = {}
    for length in np.unique(points.length):
        differences = []
        for one in np.unique(points.run[points.length == length]):
            of = (points.run == one) & np.isfinite(mean)
            if of.any():
                differences.append(abs(float(np.mean(points.tension[of] - mean[of]))))
        largest[f"{1e3 * length:g}"] = max(differences)
    return largest


def greedy(every: Candidates, chosen: list[int], count: int, about: np.ndarray) -> list[int]:
    """More plateaus, each the one that leaves least variance of the map; what is known already is in the covariance."""
    new: list[int] = []
    while len(chosen) + len(new) < count:
        rest = [i for i in range(len(every.length)) if i not in chosen and i not in new]
        new.append(min(rest, key=lambda i: every.left([*new, i], about)))
    return chosen + new


def efficiency(points: mk.ForceMap) -> dict[str, float | str]:
    """D-efficiency of a quarter of the plateaus chosen for the parameters, and of other choices."""
    fit = mk.fit(points, law=LAW, schemes=())
    problem = Problem(LAW, tuple(fit.parameters), {k: float(np.max(v)) for k, v in fit.known.items()}, points)
    slopes = problem.functions()[1](np.array([e.value for e in fit.parameters.values()]) / problem.scale)
    slopes = slopes / np.sqrt(
        np.mean(slopes**2, axis=0)
    )  # of parameters in units in which all change the tension alike
    weights = continuous_optimum(slopes)
    best = np.linalg.slogdet(slopes.T @ (weights[:, None] * slopes))[1]
    width = slopes.shape[1]

    def of(chosen: list[int]) -> float:
        some = slopes[chosen]
        return float(np.exp((np.linalg.slogdet(some.T @ some / len(chosen))[1] - best) / width))

    plain = Candidates(
        length=np.zeros(len(points)), pressure=points.pressure, predicted=PRIOR * slopes @ slopes.T,
        discrepancy=np.zeros((len(points), len(points))), parameters=PRIOR * slopes, spread=PRIOR * np.eye(width), noise=1.0,
    )  # fmt: skip
    quarter = len(points) // 4
    budget = VENT + 1.0 + quarter * (MOVE + READ)
    ours = choose(plain, budget=budget, wait=0.0)
    sys.path.insert(0, str(Path(__file__).parent / "peers"))
    import peer_programs

    theirs: dict[str, float | str] = {}
    try:
        design = peer_programs.run("pydex", json.dumps({"slopes": slopes.tolist(), "count": quarter}))
        weighed = slopes.T @ (np.array(design["weights"])[:, None] * slopes) / sum(design["weights"])
        theirs["pydex"] = of([i for i, count in enumerate(design["readings"]) for _ in range(count)])
        theirs["pydex, continuous"] = float(np.exp((np.linalg.slogdet(weighed)[1] - best) / width))
    except peer_programs.LeftOutError as reason:
        theirs["pydex"] = f"left out: {reason}"
    places = np.stack([points.length, points.pressure], axis=1)
    places = (places - places.min(axis=0)) / np.ptp(places, axis=0)
    try:
        given = {"slopes": slopes.tolist(), "places": places.tolist(), "points": SEARCHED}
        found = np.array(peer_programs.run("Pyomo.DoE", json.dumps(given))["design"])
        theirs["Pyomo.DoE"] = of([int(((places - place) ** 2).sum(axis=1).argmin()) for place in found])
    except peer_programs.LeftOutError as reason:
        theirs["Pyomo.DoE"] = f"left out: {reason}"
    random = [of(nearest(points, latin_hypercube(quarter, 2, seed), [])) for seed in range(1, SEEDS + 1)]
    return {
        "next": of(ours),
        "next, each plateau once": of(choose(plain, budget=budget, wait=0.0, every=True)),
        **theirs,
        "Latin hypercube": float(np.mean(random)),
        "all plateaus": of(list(range(len(points)))),
        "continuous optimum": 1.0,
    }


def draw(result: dict[str, Any]) -> None:
    """Write the learning curves, and the tables between the marks of the documentation's page."""
    from matplotlib.ticker import NullLocator

    from mckibben.report.figures import style

    curves = {name: {int(count): row[0] for count, row in curve.items()} for name, curve in result[ERRORS].items()}
    ((_, whole),) = curves.pop(FULL).items()
    with style.styled():
        fig = style.figure(style.MIDDLE, 3.4)
        ax = fig.add_axes((0.07, 0.14, 0.72, 0.68))
        ax.set_yscale("log")
        first = curves["next"][FIRST]
        ends = []
        for (name, curve), dash in zip(curves.items(), style.RECORDING_DASHES, strict=True):
            points = {FIRST: first} | curve
            shade = style.COLOURS["tension"] if name == "next" else style.INK_2
            ax.plot(list(points), list(points.values()), ls=dash, color=shade, lw=style.LINE, marker="o", ms=3.5)
            ends.append((max(points), points[max(points)], name))
        ax.axhline(whole, color=style.INK_2, lw=0.5 * style.LINE)
        ends.append((max(curves["next"]), whole, FULL))
        ax.set_xlim(FIRST - 1, max(curves["next"]) + 1)
        ax.set_xticks(sorted({FIRST, *curves["next"]}))
        style.quantity_axes(
            ax, x=(f"Measured plateaus, of {result['plateaus']}", None), y=("Error of the hidden plateaus, N rms", None)
        )
        ax.set_xticks(sorted({FIRST, *curves["next"]}))
        lowest, highest = ax.get_ylim()
        ax.set_yticks([error for error in ERROR_TICKS if lowest < error < highest])
        ax.yaxis.set_major_formatter("{x:g}")
        ax.yaxis.set_minor_locator(NullLocator())
        style.end_labels(ax, ends, quantity=None)
        style.heading(ax, "Error over measured plateaus", above=24.0)
        mk.save_figure(fig, DOCS / "assets" / "replay.svg")
    written.write(WRITTEN, result)


def tables(result: dict[str, Any]) -> str:
    """What a quarter of the map leaves, errors by method and number of plateaus, and D-efficiencies of designs."""
    curves = result[ERRORS]
    ((fitted, whole),) = curves[FULL].items()
    last = max(curves["next"], key=int)
    ends = {name: curves[name][last][0] for name in ("next", "grid", "Latin hypercube")}
    apart = [f"{size:.1f} N at {length} mm" for length, size in result[DIFFERENCES].items()]
    differences = f"{', '.join(apart[:-1])} and {apart[-1]}"
    lines = [
        f"{last} of {result['plateaus']} plateaus leave an error of {ends['next']:.1f} N where `next` chose them, "
        f"{ends['grid']:.1f} N on a grid, and {ends['Latin hypercube']:.1f} N by Latin hypercubes; a fit of "
        f"{fitted} of them, three quarters of the map, leaves {whole[0]:.1f} N of the last quarter.",
        "",
        "| plateaus "
        + "".join(
            f"| {name} | readings inside | means inside " for name in ("next", "grid", "Latin hypercube, mean of five")
        )
        + "|",
        "|---" * 10 + "|",
    ]
    for count in curves["next"]:
        rows = [curves[name].get(count) for name in ("next", "grid", "Latin hypercube")]
        cells = [
            f"{row[0]:.1f} N | {100.0 * row[2]:.0f} % | {100.0 * row[3]:.0f} %" if row else " |  | " for row in rows
        ]
        lines.append(f"| {count} | {' | '.join(cells)} |")
    worst, name, count = max((row[-1], name, count) for name, curve in curves.items() for count, row in curve.items())
    lines += [
        "",
        "*readings inside* is the share of the hidden plateaus in the 95 % band of a reading of a further run "
        "(`posterior.tension(.., measured=True)`), *means inside* that of the means of the three runs at a length in "
        "the band of the true tension, at the pressures that all three reached. The posterior knows the run of each "
        f"plateau; it finds an error of a run of {result[RUN_ERRORS][last]:.1f} N from the {last} plateaus of `next`. "
        f"In fact a run differs from the mean of the three at its length by up to {differences}. The posterior has one "
        "size for all, so that its bands are wider than they need be where runs agree, as at the longest length, where "
        "most plateaus lie. "
        f"The largest R-hat of all these posteriors is {worst:.2f} ({name}, {count} plateaus), and a command warns above "
        f"{MIXED:g}.",
        "",
    ]
    lines += ["| design for the parameters | D-efficiency |", "|---|---|"]
    for name, value in result["efficiency"].items():
        lines.append(f"| {name} | {value if isinstance(value, str) else f'{100.0 * value:.1f} %'} |")
    return "\n".join(lines)


WRITTEN = (written.WrittenPart("explanation/uncertainty.md", BEGIN, END, tables),)


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--draw", type=Path, metavar="FILE", help="draw the figure of results, and measure nothing")
    options.add_argument(
        "--designs", type=Path, metavar="FILE", help="measure the D-efficiencies of a file of results anew"
    )
    options.add_argument("--curves", type=Path, metavar="FILE", help="measure the errors of a file of results anew")
    options.add_argument("--cut", default="300")
    options.add_argument("--out", type=Path)
    given = options.parse_args()
    if given.draw:
        draw(json.loads(given.draw.read_text(encoding="utf-8")))
        return
    if given.designs:
        result = json.loads(given.designs.read_text(encoding="utf-8"))
        result["efficiency"] = efficiency(plateaus(given.cut)[0])
        given.designs.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        return
    if given.curves:
        result = json.loads(given.curves.read_text(encoding="utf-8"))
        began = time.process_time()
        measured = replay(*plateaus(given.cut))
        kept = {name: result[name] for name in ("map", "plateaus", "largest", "efficiency")}
        result = kept | measured | {"seconds": round(time.process_time() - began, 1)}
        given.curves.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        return
    began, (points, mean) = time.process_time(), plateaus(given.cut)
    result = {"map": points.name, "plateaus": len(points), "largest": points.largest, "efficiency": efficiency(points),
              **replay(points, mean), "seconds": 0.0}  # fmt: skip
    result["seconds"] = round(time.process_time() - began, 1)
    text = json.dumps(result, indent=1)
    print(text)
    if given.out:
        given.out.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
