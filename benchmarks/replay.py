"""Choice of points on a measured map: how well the whole map is predicted from some of its plateaus.

    MCKIBBEN_DATA=../shared/data python benchmarks/replay.py --out replay.json

The plateaus of a 10 mm muscle at rising pressure (AARL) are hidden; a method asks for some of them, and the posterior of one
law predicts the others. All methods begin with the same plateaus. `next` asks for those that lower the expected uncertainty
of the map, and fits anew after each stage; a Latin hypercube (ten seeds) and an even grid ask for the plateaus nearest to
their points. Beside it the D-efficiency of points that are chosen for the parameters alone, relative to the continuous
optimum, which no design of any program exceeds.
"""

from __future__ import annotations

import argparse
import csv
import json
import os
import time
from pathlib import Path

import numpy as np

import mckibben as mk
from mckibben.identification.next_points import Candidates, candidates_of, choose, continuous_optimum
from mckibben.identification.posterior import posterior_of_fit
from mckibben.identification.problem import Problem, latin_hypercube

LAW = "linear_threshold"
FIRST, STAGES, SEEDS = 8, (12, 16, 20, 24), 10
DRAWS, WARM_UP = 400, 400


def plateaus(cut: str) -> mk.ForceMap:
    """Taut plateaus of rising pressure of one muscle."""
    data = Path(os.environ.get("MCKIBBEN_DATA", "../shared/data")) / "aarl_10mm_isometric" / "quasistatic_plateaus.csv"
    with data.open(encoding="utf-8") as file:
        rows = [r for r in csv.DictReader(file) if r["cut_length_mm"] == cut and r["branch"] == "inflate"]
    columns = {
        k: np.array([float(r[k]) for r in rows])
        for k in ("test_length_mm", "pressure_kPa", "force_N", "rest_length_mm")
    }
    keep = (columns["force_N"] > 1.0) & (columns["pressure_kPa"] > 50.0)
    values = (1e-3 * columns["test_length_mm"], 1e3 * columns["pressure_kPa"], columns["force_N"])
    points = mk.ForceMap(f"AARL 10 mm, {cut} mm", *(column[keep] for column in values))
    return points.with_rest_length(1e-3 * float(columns["rest_length_mm"][0]))


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


def errors(points: mk.ForceMap, chosen: list[int], fit, posterior) -> list[float]:  # noqa: ANN001
    """Root mean square error of the hidden plateaus: by the posterior, and by the law of the least squares [N]."""
    hidden = np.setdiff1d(np.arange(len(points)), chosen)
    band = posterior.tension(points.length[hidden], points.pressure[hidden], rest_length=points.rest_length[0])
    law = np.maximum(
        Problem(LAW, tuple(fit.parameters), {k: float(np.max(v)) for k, v in fit.known.items()}, points.select(hidden))
        .functions()[0](np.array([e.value for e in fit.parameters.values()]) / scale_of(fit)), 0.0,
    )  # fmt: skip
    true = points.tension[hidden]
    inside = (band.low <= true) & (true <= band.high)
    return [float(np.sqrt(np.mean((x - true) ** 2))) for x in (band.median, law)] + [float(inside.mean())]


def scale_of(fit) -> np.ndarray:  # noqa: ANN001
    return Problem(fit.law, tuple(fit.parameters), {}, fit.points).scale


def replay(points: mk.ForceMap) -> dict[str, dict[int, list[float]]]:
    """Errors by method and number of plateaus."""
    first = nearest(points, latin_hypercube(FIRST, 2, 0), [])
    curves: dict[str, dict[int, list[float]]] = {"next": {}, "Latin hypercube": {}, "grid": {}}
    chosen, about = list(first), np.arange(len(points))
    fit, posterior = posterior_from(points, chosen)
    curves["next"][FIRST] = errors(points, chosen, fit, posterior)
    for count in STAGES:
        every = candidates_of(posterior, points.length, points.pressure)
        chosen = greedy(every, chosen, count, about)
        fit, posterior = posterior_from(points, chosen)
        curves["next"][count] = errors(points, chosen, fit, posterior)
        several = []
        for seed in range(1, SEEDS + 1):
            others = nearest(points, latin_hypercube(count - FIRST, 2, seed), first)
            several.append(errors(points, others, *posterior_from(points, others)))
        curves["Latin hypercube"][count] = np.mean(several, axis=0).tolist()
        side = int(np.ceil(np.sqrt(count - FIRST)))
        grid = np.stack(np.meshgrid(*[(np.arange(side) + 0.5) / side] * 2), axis=-1).reshape(-1, 2)
        grid = grid[np.linspace(0, len(grid) - 1, count - FIRST).round().astype(int)]
        even = nearest(points, grid, first)
        curves["grid"][count] = errors(points, even, *posterior_from(points, even))
    return curves


def greedy(every: Candidates, chosen: list[int], count: int, about: np.ndarray) -> list[int]:
    """More plateaus, each the one that leaves least variance of the map; what is known already is in the covariance."""
    new: list[int] = []
    while len(chosen) + len(new) < count:
        rest = [i for i in range(len(every.length)) if i not in chosen and i not in new]
        new.append(min(rest, key=lambda i: every.left([*new, i], about)))
    return chosen + new


def efficiency(points: mk.ForceMap) -> dict[str, float]:
    """D-efficiency of a quarter of the plateaus chosen for the parameters, and of other choices."""
    fit, posterior = posterior_from(points, list(range(len(points))))
    problem = Problem(LAW, tuple(fit.parameters), {k: float(np.max(v)) for k, v in fit.known.items()}, points)
    slopes = problem.functions()[1](np.array([e.value for e in fit.parameters.values()]) / problem.scale)
    weights = continuous_optimum(slopes)
    best = np.linalg.slogdet(slopes.T @ (weights[:, None] * slopes))[1]
    width = slopes.shape[1]

    def of(chosen: list[int]) -> float:
        some = slopes[chosen]
        return float(np.exp((np.linalg.slogdet(some.T @ some / len(chosen))[1] - best) / width))

    plain = Candidates(
        length=np.zeros(len(points)), pressure=points.pressure, law=1e6 * slopes @ slopes.T,
        discrepancy=np.zeros((len(points), len(points))), parameters=slopes, noise=1.0,
    )  # fmt: skip
    quarter = len(points) // 4
    budget = 3.0 + 1.0 + quarter * 3.0
    ours = choose(plain, budget=budget, wait=0.0)
    random = [of(nearest(points, latin_hypercube(quarter, 2, seed), [])) for seed in range(1, SEEDS + 1)]
    return {
        "next": of(ours),
        "next, each plateau once": of(choose(plain, budget=budget, wait=0.0, every=True)),
        "Latin hypercube": float(np.mean(random)),
        "all plateaus": of(list(range(len(points)))),
        "continuous optimum": 1.0,
    }


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--cut", default="300")
    options.add_argument("--out", type=Path)
    given = options.parse_args()
    began, points = time.process_time(), plateaus(given.cut)
    result = {"map": points.name, "plateaus": len(points), "largest": points.largest, "efficiency": efficiency(points),
              "errors [N]: posterior, law alone; coverage": replay(points), "seconds": 0.0}  # fmt: skip
    result["seconds"] = round(time.process_time() - began, 1)
    text = json.dumps(result, indent=1)
    print(text)
    if given.out:
        given.out.write_text(text + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
