"""What limits the prediction of a length that was not measured: muscles of other rest lengths, and the longest of a map.

    MCKIBBEN_DATA=../shared/data python benchmarks/lengths.py --out lengths.json
    python benchmarks/lengths.py --draw lengths.json

The law is fitted to the three 10 mm muscles of AARL at once, with an error of each of the twelve set lengths, and linearised
there. On top of it come random effects, each with a variance of its own: a shift of the length, a share or a zero of the
tension, one for each set length or one for each muscle; and trends of the same over the rest length. The marginal
likelihood says which of them the data show, with its interval. As in `mckibben.identification`, a curve of tension
over pressure counts as three independent points at most.

A *perfect law* is one whose parameters are known exactly: it leaves the random effect that was found, drawn anew,
and what lies within a curve. *This law* has its parameters from the two other muscles, whose errors are drawn as well. Both
have errors as in the benchmark: shares of the largest tension of each muscle.

For a map without its longest length the same law is fitted with each parameter held where the whole map has it, and with one
reading at the longest length.
"""

from __future__ import annotations

import argparse
import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import written

import mckibben as mk
from mckibben.identification import fit
from mckibben.identification.problem import CURVE_POINTS, Problem, solve
from mckibben.muscles.build import build_law
from mckibben.recordings import ForceMap, read_force_map
from mckibben_benchmark.physics import joined
from mckibben_benchmark.tasks import task
from mckibben_benchmark.validation import AARL_ZERO, measured_data

LAWS = ("seated_hyperelastic_braid", "seated_braid")
KNOWN = {"rest_diameter": 0.010, "wall_thickness": 0.0018}
ACTIVE_STEP = 1e-4  # step of the active length [m]
LINEARISED_AT = 5e-4  # error of each set length about which the law is linearised [m]
DRAWS, SEED = 4000, 1
SMALLEST, LARGEST = np.log(1e-3), np.log(50.0)  # of a standard deviation, in its unit
UNITS = {"shift": "mm", "gain": "%", "zero": "N"}
NAMES = {"shift": "shift of the length", "gain": "gain of the tension", "zero": "zero of the tension"}
GOALS = 0.025, 0.06
FILLED = np.linspace(1.5e5, 6e5, 10)  # pressures at which runs are compared [Pa]
DOCS = Path(__file__).resolve().parents[1] / "docs"
BEGIN, END = "<!-- written by benchmarks/lengths.py; do not edit -->", "<!-- end of lengths -->"


class MixedModel(NamedTuple):
    """A law linearised at its fit, rows weighted so that a curve counts as few points [N].

    `left` is what the law leaves (n,), `slopes` its derivative in standard deviations of the parameters (n, p), `groups` the
    columns of each random effect; `weight` (n,), `largest` the tension of each point's muscle, `muscle` and `curve` numbers.
    """

    points: ForceMap
    left: np.ndarray
    slopes: np.ndarray
    groups: dict[str, np.ndarray]
    trends: dict[str, np.ndarray]
    weight: np.ndarray
    largest: np.ndarray
    muscle: np.ndarray
    curve: np.ndarray


def linearised(law: str, points: ForceMap) -> MixedModel:
    """The law at its fit to all points with tension."""
    problem = Problem.of(law, points, known=KNOWN, slack=False, length_error=LINEARISED_AT)
    solution = solve(problem)
    assert solution.posterior is not None and problem.points.rest_length is not None
    force, slopes = problem.functions()
    curve, scaled = problem.curves, solution.scaled
    shift = solution.posterior.shifts[0][curve]
    pull, step = force(scaled, shift), 1e-6
    taut = pull > 0.0
    stiffness = taut * (force(scaled, shift + step) - force(scaled, shift - step)) / (2.0 * step) * 1e-3  # [N/mm]
    pull = np.maximum(pull, 0.0)
    rest = problem.points.rest_length
    rests, muscle = np.unique(rest, return_inverse=True)
    largest = np.array([problem.points.tension[rest == r].max() for r in rests])[muscle]
    weight = np.sqrt(np.minimum(1.0, CURVE_POINTS / np.bincount(curve)))[curve]
    # parameters without a prior may lie anywhere in their usual range
    spread = [
        problem.priors[n][1] if n in problem.priors else 0.5 * float(np.ptp(q.typical))
        for n, q in problem.quantities.items()
    ]
    effects = {"shift": stiffness, "gain": 0.01 * pull, "zero": np.ones(len(pull))}
    groups = {
        f"{name} of {whose}": np.eye(index.max() + 1)[index] * effect[:, None] * weight[:, None]
        for whose, index in (("set length", curve), ("muscle", muscle))
        for name, effect in effects.items()
    }
    over = (rest - rests.mean()) / 0.1  # per 100 mm of rest length
    trends = {name: effect * over * weight for name, effect in effects.items()}
    far = replace(points, length=points.length + ACTIVE_STEP, rest_length=np.asarray(points.rest_length) + ACTIVE_STEP)
    longer = Problem.of(law, far, known=KNOWN, slack=False, length_error=LINEARISED_AT).functions()[0]
    trends["end"] = (np.maximum(longer(scaled, shift), 0.0) - pull) / (1e3 * ACTIVE_STEP) * weight
    left = problem.points.tension - pull + stiffness * 1e3 * shift
    rows = taut[:, None] * slopes(scaled, shift) * np.array(spread) / problem.scale
    return MixedModel(
        problem.points, left * weight, rows * weight[:, None], groups, trends, weight, largest, muscle, curve
    )


def cost(model: MixedModel, names: tuple[str, ...], logs: np.ndarray, trend: str | None = None) -> tuple[float, Any]:
    """-2 log marginal likelihood at standard deviations exp(logs), the noise last; best slope of a trend, with its error."""
    deviations = np.exp(logs)
    noise = deviations[-1]
    columns = np.hstack([model.slopes, *(model.groups[n] * s for n, s in zip(names, deviations[:-1], strict=True))])
    inner = np.eye(columns.shape[1]) + columns.T @ columns / noise**2

    def inverse(vector: np.ndarray) -> np.ndarray:
        return vector / noise**2 - columns @ np.linalg.solve(inner, columns.T @ vector) / noise**4

    left, slope = model.left, (0.0, 0.0)
    if trend is not None:
        column = model.trends[trend]
        information = float(column @ inverse(column))
        slope = float(column @ inverse(left)) / information, information**-0.5
        left = left - slope[0] * column
    counted = float(np.sum(model.weight**2))
    size = 2.0 * counted * np.log(noise) + np.linalg.slogdet(inner)[1]
    return float(size + left @ inverse(left)), slope


def best(model: MixedModel, names: tuple[str, ...], trend: str | None = None) -> tuple[float, np.ndarray, Any]:
    """-2 log likelihood at its least, the standard deviations there, the noise last, and the slope of a trend."""
    from scipy import optimize

    start = np.log(np.append(np.full(len(names), 0.5), 8.0))
    bounds = [(SMALLEST, LARGEST)] * len(start)
    solution = optimize.minimize(lambda x: cost(model, names, x, trend)[0], start, method="L-BFGS-B", bounds=bounds)
    return float(solution.fun), np.exp(solution.x), cost(model, names, solution.x, trend)[1]


def profile(model: MixedModel, names: tuple[str, ...], values: np.ndarray) -> np.ndarray:
    """-2 log likelihood over the standard deviation of the last effect, the others as they fit best, (n,)."""
    from scipy import optimize

    rest, costs = np.log(np.append(np.full(len(names) - 1, 0.5), 6.0)), []
    for value in values:

        def whole(x: np.ndarray, value: float = value) -> np.ndarray:
            return np.concatenate([x[:-1], [np.log(value)], x[-1:]])

        solution = optimize.minimize(
            lambda x, whole=whole: cost(model, names, whole(x))[0],
            rest,
            method="L-BFGS-B",
            bounds=[(SMALLEST, LARGEST)] * len(rest),
        )
        rest = solution.x
        costs.append(float(solution.fun))
    return np.array(costs)


def interval(values: np.ndarray, costs: np.ndarray) -> tuple[float, float]:
    """Central 95 % of a standard deviation whose prior is flat."""
    density = np.exp(-0.5 * (costs - costs.min()))
    share = np.cumsum(density) / density.sum()
    return float(np.interp(0.025, share, values)), float(np.interp(0.975, share, values))


def spread(law: str, points: ForceMap) -> dict[str, Any]:
    """What the data show of random effects and trends."""
    model = linearised(law, points)
    none = best(model, ())
    rows = []
    base = ("shift of set length",)
    alternatives: list[tuple[str, ...]] = [(name,) for name in model.groups]
    alternatives += [(*base, name) for name in model.groups if name not in base]
    for names in alternatives:
        value, deviations, _ = best(model, names)
        sizes = {n: float(s) for n, s in zip(names, deviations[:-1], strict=True)}
        rows.append({"effects": sizes, "gain": none[0] - value, "noise": float(deviations[-1])})
    reference, deviations, _ = best(model, base)
    trends = {}
    for name in model.trends:
        value, _, (slope, error) = best(model, base, name)
        trends[name] = {"slope": slope, "standard_error": error, "gain": reference - value}
    grid = np.linspace(0.02, 2.0, 100)
    of_length = profile(model, base, grid)
    of_muscle = profile(model, (*base, "shift of muscle"), grid)
    density = np.exp(-0.5 * (of_muscle - of_muscle.min()))
    sigma = float(deviations[0])
    found = {
        "points": len(model.points),
        "set_lengths": int(model.curve.max()) + 1,
        "sd_of_set_length": sigma,
        "interval": interval(grid, of_length),
        "sd_of_muscle_at_most": float(np.interp(0.95, np.cumsum(density) / density.sum(), grid)),
        "structures": rows,
        "trends": trends,
    }
    chance = np.random.default_rng(SEED)
    density = np.exp(-0.5 * (of_length - of_length.min()))
    drawn = chance.choice(grid, DRAWS, p=density / density.sum())
    found["perfect_law"] = predicted(model, np.full(DRAWS, sigma), chance, known=True)
    found["perfect_law_any_sd"] = predicted(model, drawn, chance, known=True)
    found["this_law"] = predicted(model, np.full(DRAWS, sigma), chance, known=False)
    found["perfect_law_over_sd"] = {
        f"{sd:g}": predicted(model, np.full(DRAWS, sd), chance, known=True) for sd in (1e-3, 0.1, 0.2, 0.3, 0.4, 0.5)
    }
    found["errors"] = curve_errors(model)
    return found


def within(model: MixedModel, sigma: float, noise: float) -> np.ndarray:
    """What law and errors of the set lengths leave of the points (n,) [N]."""
    columns = np.hstack([model.slopes, model.groups["shift of set length"] * sigma])
    inner = np.eye(columns.shape[1]) + columns.T @ columns / noise**2
    effects = np.linalg.solve(inner, columns.T @ model.left) / noise**2
    left: np.ndarray = (model.left - columns @ effects) / model.weight
    return left


def curve_errors(model: MixedModel) -> list[dict[str, float]]:
    """The error of each set length that explains most of what the law leaves there [mm]."""
    rows = []
    for number in range(int(model.curve.max()) + 1):
        points = model.curve == number
        stiffness = model.groups["shift of set length"][points, number]
        first = int(np.flatnonzero(points)[0])
        assert model.points.rest_length is not None
        rest, length = float(model.points.rest_length[first]), float(model.points.length[first])
        error = float(stiffness @ model.left[points] / (stiffness @ stiffness))
        rows.append({"rest_length": rest, "length": length, "error": error})
    return rows


def predicted(model: MixedModel, sigmas: np.ndarray, chance: np.random.Generator, *, known: bool) -> dict[str, Any]:
    """Errors of a muscle left out if set lengths err by `sigmas` (draws,) [mm], as shares of its largest tension."""
    _, deviations, _ = best(model, ("shift of set length",))
    left = within(model, float(deviations[0]), float(deviations[1]))
    stiffness = model.groups["shift of set length"].sum(axis=1) / model.weight
    rms, largest = [], []
    gains = {}
    if not known:
        for muscle in np.unique(model.muscle):
            train = model.muscle != muscle
            group = model.groups["shift of set length"][train] * deviations[0]
            whole = np.hstack([model.slopes[train], group])
            inner = np.eye(whole.shape[1]) + whole.T @ whole / deviations[1] ** 2
            gains[muscle] = np.linalg.solve(inner, whole.T)[: model.slopes.shape[1]] / deviations[1] ** 2
    for sigma in sigmas:
        shifts = sigma * chance.normal(size=int(model.curve.max()) + 1)
        tension = stiffness * shifts[model.curve] + left
        error = -tension
        for muscle, gain in gains.items():
            train, out = model.muscle != muscle, model.muscle == muscle
            moved = gain @ (tension * model.weight)[train]
            error[out] += (model.slopes[out] / model.weight[out, None]) @ moved
        share = error / model.largest
        rms.append(float(np.sqrt(np.mean(share**2))))
        largest.append(float(np.abs(share).max()))
    met = (np.array(rms) <= GOALS[0], np.array(largest) <= GOALS[1])
    return {
        "rms": [float(np.quantile(rms, q)) for q in (0.5, 0.025, 0.975)],
        "largest": [float(np.quantile(largest, q)) for q in (0.5, 0.025, 0.975)],
        "goals_met": [float(m.mean()) for m in met] + [float((met[0] & met[1]).mean())],
    }


def repeats(path: Path) -> dict[str, float]:
    """Root mean square difference of runs at one set length, as a share of the muscle's largest tension."""
    with path.open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    runs: dict[tuple[str, ...], list[tuple[float, float]]] = {}
    largest: dict[str, float] = {}
    for row in rows:
        tension = float(row["force_N"])
        largest[row["rest_length_mm"]] = max(largest.get(row["rest_length_mm"], 0.0), tension)
        if tension > 0.0:
            key = row["rest_length_mm"], row["test_length_mm"], row["test_id"], row["branch"]
            runs.setdefault(key, []).append((1e3 * float(row["pressure_kPa"]), tension))
    curves = {}
    for key, pairs in runs.items():
        pressure, tension = np.array(sorted(pairs)).T
        curves[key] = np.interp(FILLED, pressure, tension, left=np.nan, right=np.nan) / largest[key[0]]

    def differences(first: tuple[str, str], second: tuple[str, str]) -> float:
        pairs = [(key[:2] + first, key[:2] + second) for key in curves if key[2:] == first]
        squares = np.concatenate([(curves[a] - curves[b]) ** 2 for a, b in pairs if b in curves])
        return float(np.sqrt(np.nanmean(squares)))

    return {
        "slow filling, twice": differences(("9", "inflate"), ("10", "inflate")),
        "slow venting, twice": differences(("9", "deflate"), ("10", "deflate")),
        "fast and slow filling": differences(("8", "inflate"), ("9", "inflate")),
        "venting and slow filling": differences(("9", "deflate"), ("9", "inflate")),
    }


def longest_out() -> list[dict[str, Any]]:
    """Maps without their longest length: what each parameter, and one reading there, changes."""
    law, found = LAWS[0], []
    folds = task("map-length-out").load(measured_data(None))
    for muscle in dict.fromkeys(fold.test[0].muscle for fold in folds):
        fold = max((f for f in folds if f.test[0].muscle == muscle), key=lambda f: f.test[0].inputs["length"][0])
        record, train = fold.test[0], fold.train[0]
        scored = fold.scored[0]
        length, pressure = record.inputs["length"][scored], record.inputs["pressure"][scored]
        tension = record.outputs["tension"][scored]
        dimensions = dict(record.dimensions) | {"upper_length": float(length.max())}

        def errors(
            held: dict[str, float], reading: int | None = None, *, record: Any = record, train: Any = train,
            scored: Any = scored, length: Any = length, pressure: Any = pressure, tension: Any = tension,
            dimensions: Any = dimensions,
        ) -> dict[str, float]:  # fmt: skip
            shown = [train]
            rest = np.ones(len(tension), bool)
            if reading is not None:
                rest[reading] = False
                shown.append(record.select(np.arange(len(record)) == np.flatnonzero(scored)[reading]))
            problem = Problem.of(law, joined(shown), known=dimensions | held)
            values = solve(problem).values(problem)
            error = np.asarray(build_law(law, dimensions | held | values).tension(length, pressure)) - tension
            share = error[rest] / tension.max()
            return {"rms": float(np.sqrt(np.mean(share**2))), "largest": float(np.abs(share).max())}

        whole = fit(law, joined([train, record]), known=dimensions, schemes=())
        part = fit(law, joined([train]), known=dimensions, schemes=())
        at = part.predict(length, pressure)
        values = {name: e.value for name, e in whole.parameters.items()}
        taut = np.unique(train.inputs["length"][train.outputs["tension"] > 0.0])
        middle = len(tension) // 2
        found.append(
            {
                "muscle": muscle,
                "length": float(length.max()),
                "next": float(taut.max()),
                "plain": errors({}),
                "fit_of_the_rest": float(part.rmse / tension.max()),
                "half_width": float(np.mean(at.high - at.low) / 2.0 / tension.max()),
                "held": {name: errors({name: value}) for name, value in values.items()},
                "reading": {f"{pressure[i] / 1e5:.2g} bar": errors({}, i) for i in (0, middle, len(tension) - 1)},
                "parameters": {
                    name: {"without": part.parameters[name]._asdict(), "with": e._asdict()}
                    for name, e in whole.parameters.items()
                },
            }
        )
    return found


def measure() -> dict[str, Any]:
    """All figures."""
    folder = measured_data(None)
    assert folder is not None
    path = Path(folder) / "aarl_10mm_isometric" / "quasistatic_plateaus.csv"
    points = read_force_map(path, pressure_zero=AARL_ZERO)
    assert points.rest_length is not None
    laws: dict[str, Any] = {}
    for law in LAWS:
        laws[law] = spread(law, points)
        laws[law]["without"] = {}
        for rest in np.unique(points.rest_length):
            model = linearised(law, points.select(points.rest_length != rest))
            grid = np.linspace(0.02, 2.0, 100)
            costs = profile(model, ("shift of set length",), grid)
            two = best(model, ("shift of set length",))
            laws[law]["without"][f"{1e3 * rest:.0f} mm"] = {
                "sd_of_set_length": float(two[1][0]),
                "interval": interval(grid, costs),
            }
    return {"laws": laws, "repeats": repeats(path), "longest_length_out": longest_out()}


def main() -> None:
    """Measure, or draw what was measured."""
    parser = argparse.ArgumentParser(description=str(__doc__).splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("lengths.json"), help="Figures.")
    parser.add_argument(
        "--draw", type=Path, metavar="FILE", help="Draw figure and tables of results, and measure nothing."
    )
    chosen = parser.parse_args()
    if chosen.draw:
        draw(json.loads(chosen.draw.read_text()))
        return
    result = measure()
    chosen.out.write_text(json.dumps(result, indent=1) + "\n")
    print(tables(result))


def draw(result: dict[str, Any]) -> None:
    """Write the figure, and the tables between the marks of the documentation's page."""
    from mckibben.report.figures import style

    found = result["laws"][LAWS[0]]
    errors = found["errors"]
    band = 1.96 * found["sd_of_set_length"]
    with style.styled():
        fig = style.figure(style.MIDDLE, 3.4)
        ax = fig.add_axes((0.08, 0.15, 0.74, 0.66))
        ends = []
        for side in (-band, 0.0, band):
            ax.axhline(side, color=style.INK_2, lw=0.5 * style.LINE)
        rests = sorted({row["rest_length"] for row in errors})
        for rest, dash, mark in zip(rests, style.RECORDING_DASHES, style.MARKERS.values(), strict=False):
            rows = sorted((r for r in errors if r["rest_length"] == rest), key=lambda r: r["length"])
            contraction = [100.0 * (1.0 - r["length"] / rest) for r in rows]
            values = [r["error"] for r in rows]
            ax.plot(contraction, values, ls=dash, color=style.COLOURS["length"], lw=style.LINE, marker=mark, ms=4.5)
            ends.append((contraction[0], values[0], f"{1e3 * rest:.0f} mm at rest"))
        ax.set_xlim(-0.6, 14.0)
        style.quantity_axes(ax, x=("Contraction as set, %", None), y=("Error of the set length, mm", "length"))
        style.end_labels(ax, ends, quantity="length")
        style.heading(
            ax, "What each set length is off by", f"lines at ±{band:.2f} mm: 95 % of the spread that the data show"
        )
        mk.save_figure(fig, DOCS / "assets" / "lengths.svg")
    written.write(WRITTEN, result)


def tables(result: dict[str, Any]) -> str:
    """The tables of the documentation's page."""

    def ranged(values: list[float]) -> str:
        return f"{100 * values[0]:.1f} % ({100 * values[1]:.1f} to {100 * values[2]:.1f})"

    lines = [
        "| | " + " | ".join(f"`{law}`" for law in LAWS) + " |",
        "|---|" + "---:|" * len(LAWS),
    ]

    def row(title: str, text: Any) -> None:
        lines.append(f"| {title} | " + " | ".join(text(result["laws"][law]) for law in LAWS) + " |")

    row(
        "spread of the set lengths, standard deviation, mm",
        lambda v: f"{v['sd_of_set_length']:.2f} ({v['interval'][0]:.2f} to {v['interval'][1]:.2f})",
    )
    for name in UNITS:
        row(
            f"what a {NAMES[name]} of each set length explains, in -2 log likelihood",
            lambda v, name=name: f"{structure(v, f'{name} of set length')['gain']:.1f}",
        )
    for name, unit in UNITS.items():
        row(
            f"{NAMES[name]} of each muscle beside that of set lengths, standard deviation, {unit}",
            lambda v, name=name: (
                f"{structure(v, 'shift of set length', f'{name} of muscle')['effects'][f'{name} of muscle']:.2f}"
            ),
        )
    row("shift of each muscle at most (95 %), mm", lambda v: f"{v['sd_of_muscle_at_most']:.1f}")
    for name, unit in UNITS.items():
        row(
            f"trend of the {NAMES[name]}, {unit} per 100 mm of rest length",
            lambda v, name=name: f"{v['trends'][name]['slope']:+.2f} ± {v['trends'][name]['standard_error']:.2f}",
        )
    row(
        "active length beyond the rest length, the same for all muscles, mm",
        lambda v: f"{v['trends']['end']['slope']:+.1f} ± {v['trends']['end']['standard_error']:.1f}",
    )
    row("a perfect law, rms", lambda v: ranged(v["perfect_law"]["rms"]))
    row("a perfect law, largest", lambda v: ranged(v["perfect_law"]["largest"]))
    row(
        "a perfect law meets 2.5 % rms and 6 % at most",
        lambda v: f"{100 * v['perfect_law']['goals_met'][2]:.0f} % of draws",
    )
    row("this law with its form exactly right, rms", lambda v: ranged(v["this_law"]["rms"]))
    row("this law with its form exactly right, largest", lambda v: ranged(v["this_law"]["largest"]))
    for sd in ("0.3", "0.2", "0.1"):
        row(
            f"a perfect law meets both if lengths are set to {sd} mm",
            lambda v, sd=sd: f"{100 * v['perfect_law_over_sd'][sd]['goals_met'][2]:.0f} % of draws",
        )
    lines += [
        "",
        "| longest length left out | next length | rms | largest | half width of the 95 % interval |",
        "|---|---:|---:|---:|---:|",
    ]
    for one in result["longest_length_out"]:
        rows = [("no reading there", one["plain"])] + [
            (f"one reading there, at {at}", e) for at, e in one["reading"].items()
        ]
        rows += [
            (f"{n} as the whole map has it", one["held"][n])
            for n in ("seat_compliance", "inactive_share", "length_factor")
        ]
        for title, e in rows:
            width = f"{100 * one['half_width']:.1f} %" if e is one["plain"] else ""
            lines.append(
                f"| {one['muscle']}, {1e3 * one['length']:.0f} mm, {title} | {1e3 * one['next']:.0f} mm "
                f"| {100 * e['rms']:.2f} % | {100 * e['largest']:.2f} % | {width} |"
            )
    lines += ["", "Runs of one muscle at one set length, not mounted anew, differ by (rms of the difference): "]
    lines[-1] += ", ".join(f"{name} {100 * value:.2f} %" for name, value in result["repeats"].items()) + "."
    return "\n".join(lines)


def structure(found: dict[str, Any], *names: str) -> dict[str, Any]:
    """The structure with these random effects."""
    one: dict[str, Any] = next(row for row in found["structures"] if set(row["effects"]) == set(names))
    return one


WRITTEN = (written.WrittenPart("explanation/laws.md", BEGIN, END, tables),)

if __name__ == "__main__":
    main()
