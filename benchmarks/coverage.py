"""Coverage of the posterior's intervals: virtual muscles with honest sensors, and how often 95 % intervals hold the truth.

    python benchmarks/coverage.py                    # 250 muscles of each kind, eight minutes on one core
    python benchmarks/coverage.py --muscles 20       # a smoke test

Every muscle has parameters of its own, drawn around those of a specimen, and a map of 36 points that is read by sensors with
noise in tension, pressure and length and with errors of gain and zero that all points of the map share. The fit is told the
standard uncertainties of these sensors and nothing else. In `right`, the fitted law is the one that made the map; in
`wrong`, it is another one. Counted are the parameters (where the law is right), and the true tension at 25 points between
those of the map: once by the posterior and once by the linearised intervals of least squares.
"""

from __future__ import annotations

import argparse
import json
import time

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


def drawn_law(law: str, chance: np.random.Generator) -> mk.TensionLaw:
    """A muscle near the nylon one: every dimension that a fit would find, changed by itself."""
    source = mk.muscle("nylon", law=law).law
    free = type(source).fitted
    changes = {name: float(getattr(source, name)) * np.exp(SPREAD * chance.standard_normal()) for name in free}
    return build_law(law, {name: value for name, value in values(source).items()} | changes)


def measured(law: mk.TensionLaw, chance: np.random.Generator) -> tuple[mk.ForceMap, np.ndarray, np.ndarray]:
    """A map as the sensors show it, and the places (25,) and (25,) of points between."""
    shortest = 1.02 * float(law.free_length(PRESSURES[0]))
    lengths, pressures = (x.ravel() for x in np.meshgrid(np.linspace(shortest, 0.152, 6), PRESSURES))
    force = np.asarray(law.tension(lengths, pressures))
    gain, zero = SENSORS.tension_gain * chance.standard_normal(), SENSORS.tension_zero * chance.standard_normal()
    shown = force * (1.0 + gain) + zero + SENSORS.tension * chance.standard_normal(36)
    read_pressure = pressures + SENSORS.pressure_zero * chance.standard_normal()
    read_length = lengths + SENSORS.length_zero * chance.standard_normal()
    read_pressure = read_pressure + SENSORS.pressure * chance.standard_normal(36)
    read_length = read_length + SENSORS.length * chance.standard_normal(36)
    points = mk.ForceMap("virtual", read_length, read_pressure, shown).with_rest_length(0.14)
    between = [0.5 * (x[1:] + x[:-1]) for x in (np.linspace(shortest, 0.152, 6), PRESSURES)]
    return points, *(x.ravel() for x in np.meshgrid(*between))


def study(case: str, count: int, first: int, discrepancy: float | None) -> dict[str, object]:
    """Shares of the intervals that hold the truth, of `count` muscles from number `first` on."""
    truth, fitted = CASES[case]
    hits: dict[str, list[float]] = {}
    widths, mixing, failed, seconds = [], [], 0, time.process_time()
    for number in range(first, first + count):
        chance = np.random.default_rng([number, len(case)])
        law = drawn_law(truth, chance)
        points, lengths, pressures = measured(law, chance)
        known = {"threshold_width": 85000.0, "stop_stiffness": 3e7, "rest_volume": 5.63e-6}
        fit = mk.fit(points, law=fitted, known=known, schemes=())
        try:
            posterior = posterior_of_fit(
                fit, sensors=SENSORS, discrepancy=discrepancy, draws=DRAWS, warm_up=WARM_UP, seed=number
            )
        except MckibbenError:
            failed += 1
            continue
        failed += bool(posterior.warnings)
        mixing.append([posterior.r_hat, posterior.effective, posterior.divergences])
        if truth == fitted:
            for name, e in posterior.intervals().items():
                hits.setdefault(name, []).append(e.low <= float(getattr(law, name)) <= e.high)
            for name, e in fit.parameters.items():
                value = float(getattr(law, name))
                hits.setdefault("least squares, parameters", []).append(e.low <= value <= e.high)
        true = np.asarray(law.tension(lengths, pressures))
        band = posterior.tension(lengths, pressures)
        alone = posterior.tension(lengths, pressures, discrepancy=False)
        hits.setdefault("tension", []).append(float(np.mean((band.low <= true) & (true <= band.high))))
        hits.setdefault("tension, law alone", []).append(float(np.mean((alone.low <= true) & (true <= alone.high))))
        half = linear_half_width(fit, lengths, pressures)
        middle = np.asarray(fit.build().tension(lengths, pressures))
        hits.setdefault("least squares, tension", []).append(float(np.mean(np.abs(true - middle) <= half)))
        widths.append([float(np.mean(band.high - band.low)), float(2.0 * np.mean(half)), fit.rmse])
    mean = {name: round(float(np.mean(column)), 4) for name, column in hits.items()}
    parameters = [v for name, v in mean.items() if name in type(drawn_law(fitted, chance)).fitted]
    widths_of = np.mean(widths, axis=0).round(3).tolist()
    return {
        "muscles": count,
        "parameters": round(float(np.mean(parameters)), 4) if parameters else None,
        **mean,
        "mean width of the band, of that of least squares, rmse of the fit [N]": widths_of,
        "with warnings": failed,
        "median of R-hat, independent samples, divergences": np.median(mixing, axis=0).round(3).tolist(),
        "seconds": round(time.process_time() - seconds, 1),
    }


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


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--muscles", type=int, default=250)
    options.add_argument("--cases", nargs="+", default=list(CASES))
    options.add_argument("--first", type=int, default=0)
    options.add_argument("--discrepancy", type=float)
    given = options.parse_args()
    for case in given.cases:
        print(json.dumps({"case": case} | study(case, given.muscles, given.first, given.discrepancy)))


if __name__ == "__main__":
    main()
