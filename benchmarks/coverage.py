"""Coverage of the posterior's intervals: virtual muscles with honest sensors, and how often 95 % intervals hold the truth.

    python benchmarks/coverage.py --out coverage.json     # 250 muscles of each kind, sixteen minutes on one core
    python benchmarks/coverage.py --muscles 20            # a smoke test
    python benchmarks/coverage.py --draw coverage.json    # the table of the documentation

Every muscle has parameters of its own, drawn around those of a specimen, and a map of 36 points that is read by sensors with
noise in tension, pressure and length and with errors of gain and zero that all points of the map share. The fit is told the
standard uncertainties of these sensors and nothing else. In `right`, the fitted law is the one that made the map; in
`wrong`, it is another one. Counted are the parameters (where the law is right), and the true tension at 25 points between
those of the map: once by the posterior and once by the linearised intervals of least squares. The file is
written after every tenth muscle.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

import numpy as np

import mckibben as mk
from mckibben.errors import MckibbenError
from mckibben.identification.posterior import MapSensors, posterior_of_fit
from mckibben.muscles.build import build_law
from mckibben.muscles.laws import law_type
from mckibben.quantities import declared, values

SENSORS = MapSensors(
    tension=0.6, pressure=500.0, length=2e-5, tension_gain=2e-3, tension_zero=0.3, pressure_zero=300.0, length_zero=5e-5
)
SPREAD = 0.05  # standard deviation of the logarithm of every parameter over the specimen's
CASES = {"right": ("linear_threshold", "linear_threshold"), "wrong": ("ideal", "linear_threshold")}
PRESSURES = np.linspace(1.5e5, 5e5, 6)
DRAWS, WARM_UP = 1000, 400
BEGIN, END = "<!-- written by benchmarks/coverage.py; do not edit -->", "<!-- end of coverage -->"


def drawn_law(law: str, chance: np.random.Generator) -> mk.TensionLaw:
    """A muscle near the nylon one: every dimension that a fit would find, changed by itself."""
    source = mk.muscle("nylon", law=law).law
    free = type(source).fitted
    changes = {name: float(getattr(source, name)) * np.exp(SPREAD * chance.standard_normal()) for name in free}
    return build_law(law, {name: value for name, value in values(source).items()} | changes)


def measured(law: mk.TensionLaw, chance: np.random.Generator) -> tuple[mk.ForceMap, np.ndarray, np.ndarray]:
    """A map as the sensors show it, and the places (25,) and (25,) of points between."""
    # a braid cannot be longer than its threads: some muscles are too short for the longest length
    ends = 1.02 * float(law.free_length(PRESSURES[0])), min(0.152, 0.98 * float(law.length_range()[1]))
    lengths, pressures = (x.ravel() for x in np.meshgrid(np.linspace(*ends, 6), PRESSURES))
    force = np.asarray(law.tension(lengths, pressures))
    gain, zero = SENSORS.tension_gain * chance.standard_normal(), SENSORS.tension_zero * chance.standard_normal()
    shown = force * (1.0 + gain) + zero + SENSORS.tension * chance.standard_normal(36)
    read_pressure = pressures + SENSORS.pressure_zero * chance.standard_normal()
    read_length = lengths + SENSORS.length_zero * chance.standard_normal()
    read_pressure = read_pressure + SENSORS.pressure * chance.standard_normal(36)
    read_length = read_length + SENSORS.length * chance.standard_normal(36)
    points = mk.ForceMap("virtual", read_length, read_pressure, shown).with_rest_length(0.14)
    between = [0.5 * (x[1:] + x[:-1]) for x in (np.linspace(*ends, 6), PRESSURES)]
    return points, *(x.ravel() for x in np.meshgrid(*between))


def study(case: str, number: int, discrepancy: float | None) -> dict[str, Any]:
    """One muscle: shares of its intervals that hold the truth, mean widths [N], and how well the samples mixed."""
    truth, fitted = CASES[case]
    chance = np.random.default_rng([number, len(case)])
    law = drawn_law(truth, chance)
    points, lengths, pressures = measured(law, chance)
    known = {"threshold_width": 85000.0, "stop_stiffness": 3e7, "rest_volume": 5.63e-6}
    fit = mk.fit(points, law=fitted, known=known, schemes=())
    try:
        posterior = posterior_of_fit(
            fit, sensors=SENSORS, discrepancy=discrepancy, draws=DRAWS, warm_up=WARM_UP, seed=number
        )
    except MckibbenError as error:
        return {"number": number, "failed": str(error)}
    hits: dict[str, float] = {}
    if truth == fitted:
        values = {name: float(getattr(law, name)) for name in fit.parameters}
        for kind, intervals in (("posterior", posterior.intervals()), ("least squares", fit.parameters)):
            hits[f"{kind}, parameters"] = float(np.mean([e.low <= values[n] <= e.high for n, e in intervals.items()]))
    true = np.asarray(law.tension(lengths, pressures))
    band, alone = (posterior.tension(lengths, pressures, discrepancy=both) for both in (True, False))
    for kind, one in (("posterior", band), ("posterior, law alone", alone)):
        hits[f"{kind}, tension"] = float(np.mean((one.low <= true) & (true <= one.high)))
    half = linear_half_width(fit, lengths, pressures)
    middle = np.asarray(fit.build().tension(lengths, pressures))
    hits["least squares, tension"] = float(np.mean(np.abs(true - middle) <= half))
    return {
        "number": number,
        "inside": hits,
        "width": {"posterior": float(np.mean(band.high - band.low)), "least squares": float(2.0 * np.mean(half))},
        "mixing": [posterior.r_hat, posterior.effective, posterior.divergences],
        "warned": bool(posterior.warnings),
    }


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Means over the muscles, with the standard error of each share, and how many failed or were warned of."""
    done = [row for row in rows if "inside" in row]
    shares = {name: np.array([row["inside"][name] for row in done]) for name in done[0]["inside"]}
    return {
        "muscles": len(rows),
        "failed": len(rows) - len(done),
        "warned": sum(row["warned"] for row in done),
        "inside": {name: [float(v.mean()), float(v.std() / np.sqrt(len(v)))] for name, v in shares.items()},
        "width": {name: float(np.mean([row["width"][name] for row in done])) for name in done[0]["width"]},
        "median of R-hat, independent samples, divergences": np.median(
            [row["mixing"] for row in done], axis=0
        ).tolist(),
    }


def table(cases: dict[str, list[dict[str, Any]]]) -> str:
    """The table of the documentation."""
    right, wrong = (summary(cases[case]) for case in CASES)

    def share(of: dict[str, Any], name: str) -> str:
        return f"{100.0 * of['inside'][name][0]:.1f} %" if name in of["inside"] else ""

    lines = [
        "| intervals of | law is right: parameters | law is right: tension | law is wrong: tension | mean width, law right "
        "| mean width, law wrong |",
        "|---" * 6 + "|",
    ]
    for kind in ("posterior", "posterior, law alone", "least squares"):
        cells = [
            share(right, f"{kind}, parameters"),
            share(right, f"{kind}, tension"),
            share(wrong, f"{kind}, tension"),
        ]
        cells += [f"{of['width'][kind]:.2f} N" if kind in of["width"] else "" for of in (right, wrong)]
        lines.append(f"| {kind} | {' | '.join(cells)} |")
    error = 100.0 * max(of["inside"]["posterior, tension"][1] for of in (right, wrong))
    lines += [
        "",
        f"{right['muscles']} muscles whose law is right and {wrong['muscles']} whose law is wrong; standard error of the "
        f"posterior's shares of the tension: at most {error:.1f} %. More samples were said to be needed for "
        f"{right['warned']} and {wrong['warned']} of them.",
    ]
    return "\n".join(lines)


def linear_half_width(fit: mk.Fit, lengths: np.ndarray, pressures: np.ndarray) -> np.ndarray:
    """Half the linearised 95 % interval of the tension at points (q,) [N]."""
    names = list(fit.parameters)
    half = np.array([0.5 * (e.high - e.low) for e in fit.parameters.values()])
    slopes = []
    for name, e, h in zip(names, fit.parameters.values(), half, strict=True):
        low, high = declared(law_type(fit.law))[name].bounds
        at = np.clip([e.value - 1e-3 * h, e.value + 1e-3 * h], low, high)
        ends = [np.asarray(fit.build(**{name: value}).tension(lengths, pressures)) for value in at]
        slopes.append((ends[1] - ends[0]) / (at[1] - at[0]) * h)
    rows = np.stack(slopes, axis=1)
    return np.sqrt(np.einsum("qi,ij,qj->q", rows, np.asarray(fit.correlation), rows))


def draw(cases: dict[str, list[dict[str, Any]]]) -> None:
    """Write the table between the marks of the documentation's page."""
    page = Path(__file__).resolve().parents[1] / "docs" / "explanation" / "uncertainty.md"
    head, _, rest = page.read_text(encoding="utf-8").partition(BEGIN)
    _, _, tail = rest.partition(END)
    page.write_text(f"{head}{BEGIN}\n\n{table(cases)}\n\n{END}{tail}", encoding="utf-8")


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--muscles", type=int, default=250)
    options.add_argument("--cases", nargs="+", default=list(CASES))
    options.add_argument("--discrepancy", type=float)
    options.add_argument("--out", type=Path, help="file of all muscles; one that is there is continued")
    options.add_argument("--draw", type=Path, metavar="FILE", help="write the table of results, and measure nothing")
    given = options.parse_args()
    if given.draw:
        draw(json.loads(given.draw.read_text(encoding="utf-8")))
        return
    cases: dict[str, list[dict[str, Any]]] = {}
    if given.out and given.out.exists():
        cases = json.loads(given.out.read_text(encoding="utf-8"))
    for number in range(given.muscles):  # of all kinds in turn, so that a run that is ended has as many of each
        for case in given.cases:
            rows = cases.setdefault(case, [])
            if number == len(rows):
                rows.append(study(case, number, given.discrepancy))
        if given.out and (number % 10 == 9 or number == given.muscles - 1):
            given.out.write_text(json.dumps(cases, indent=1) + "\n", encoding="utf-8")
    for case, rows in cases.items():
        print(json.dumps({"case": case} | summary(rows)))


if __name__ == "__main__":
    main()
