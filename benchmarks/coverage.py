"""Coverage of the posterior's intervals: virtual muscles with honest sensors, and how often 95 % intervals hold the truth.

    python benchmarks/coverage.py --out coverage.json     # 250 muscles whose law is right, 250 whose law is wrong, and 100
                                                          # loops, circuits and answers of sizing: half an hour on one core
    python benchmarks/coverage.py --muscles 20 --others 5 # a smoke test
    python benchmarks/coverage.py --draw coverage.json    # the tables of the documentation

Every muscle has parameters of its own, drawn around those of a specimen, and a map of 36 points that is read by sensors with
noise in tension, pressure and length and with errors of gain and zero that all points of the map share. The fit is told the
standard uncertainties of these sensors and nothing else. In `right`, the fitted law is the one that made the map; in
`wrong`, it is another one. Counted are the parameters (where the law is right), and the true tension at 25 points between
those of the map: once by the posterior and once by the linearised intervals of least squares.

A `loop` is 81 strokes with a friction and a curve of its own, whose bend the fitted curve of four knots does not have
exactly; counted are the friction's parameters and the true strokes. A `circuit` is a tank behind an orifice and with a leak,
whose pressure is read 101 times after two steps of the supply; counted are its three parameters and the true pressures.
`size` asks muscles like those of `right` and `wrong` in turn for the force at the end of a stroke and for the stroke at a
force, as `mckibben size --from-posterior` does. No kind shares its muscles or its errors with another: luck would be shared.
Some tens of shared errors decide a share, so beside it stand the intervals of `exact sensors`: the same map, the fitted law
taken for right, linear, and the covariance of the sensors as declared. Their true share is 95 %, where the law is right,
so that what they have more or less is chance. Deviations are the truth less the median, in standard deviations of a normal
distribution with the interval: mean 0 and rms 1 where intervals are right; less than 1 rms, and they are too wide.
The file is written after every tenth of a kind; one that is there is continued.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import written

import mckibben as mk
from mckibben.engine import STEP, ramped
from mckibben.errors import MckibbenError
from mckibben.identification import Trial, fit_circuit
from mckibben.identification.hysteresis_fit import AREA, fit_loop
from mckibben.identification.path_record import PathRecord
from mckibben.identification.posterior import MapSensors, posterior_of_fit
from mckibben.identification.problem import Problem
from mckibben.identification.record_posterior import RecordPosterior
from mckibben.muscles.build import build_law
from mckibben.muscles.hysteresis import Dahl, FrictionLimit
from mckibben.muscles.laws import law_type
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.orifice import Leak, Orifice
from mckibben.pneumatics.volume import FixedVolume, Isothermal, Reservoir
from mckibben.quantities import declared, values
from mckibben.studies.sizing import Requirements, of_specimen
from mckibben.studies.sizing.candidate import LawAtPressure
from mckibben.studies.sizing.size import answer_of_posterior

SENSORS = MapSensors(
    tension=0.6, pressure=500.0, length=2e-5, tension_gain=2e-3, tension_zero=0.3, pressure_zero=300.0, length_zero=5e-5
)
SPREAD = 0.05  # standard deviation of the logarithm of every parameter over the specimen's
CASES = {"right": ("linear_threshold", "linear_threshold"), "wrong": ("ideal", "linear_threshold")}
PRESSURES = np.linspace(1.5e5, 5e5, 6)
KNOWN = {"threshold_width": 85000.0, "stop_stiffness": 3e7, "rest_volume": 5.63e-6}
DRAWS, WARM_UP = 1000, 400
OTHERS = ("loop", "circuit", "size")
STREAMS = {"right": 5, "wrong": 6, "size": 7}  # of the random numbers of muscles; loops have 3, circuits 4
STROKES = np.concatenate([np.linspace(0.0, 0.03, 41), np.linspace(0.03, 0.0, 41)[1:]])  # of a loop [m]
STROKE_NOISE, PRESSURE_NOISE = 2e-5, 300.0  # of the sensors [m], [Pa]
ROOM = 101325.0
NORMAL = 1.96  # standard deviations from the median to the end of a 95 % interval
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


def fitted_muscle(
    case: str, number: int, discrepancy: float | None, stream: int
) -> tuple[mk.TensionLaw, tuple[np.ndarray, np.ndarray], mk.Fit, Any]:
    """A virtual muscle, the places between its points, its fit and its posterior."""
    truth, fitted = CASES[case]
    chance = np.random.default_rng([number, stream])
    law = drawn_law(truth, chance)
    points, *places = measured(law, chance)
    fit = mk.fit(points, law=fitted, known=KNOWN, schemes=())
    posterior = posterior_of_fit(
        fit, sensors=SENSORS, discrepancy=discrepancy, draws=DRAWS, warm_up=WARM_UP, seed=number
    )
    return law, (places[0], places[1]), fit, posterior


def study(case: str, number: int, discrepancy: float | None) -> dict[str, Any]:
    """One muscle: shares of its intervals that hold the truth, mean widths [N], and how well the samples mixed."""
    try:
        law, (lengths, pressures), fit, posterior = fitted_muscle(case, number, discrepancy, STREAMS[case])
    except MckibbenError as error:
        return {"number": number, "failed": str(error)}
    truth, fitted = CASES[case]
    true = np.asarray(law.tension(lengths, pressures))
    hits: dict[str, float] = {}
    deviations: dict[str, list[float]] = {}
    if truth == fitted:
        values = {name: float(getattr(law, name)) for name in fit.parameters}
        drawn = posterior.intervals()
        for kind, intervals in (("posterior", drawn), ("least squares", fit.parameters)):
            hits[f"{kind}, parameters"] = float(np.mean([e.low <= values[n] <= e.high for n, e in intervals.items()]))
        deviations["parameters"] = [deviation(values[n], e.low, e.value, e.high) for n, e in drawn.items()]
        exact = ExactSensors.of(fit, posterior.errors.covariance)
        hits["exact sensors, parameters"] = float(exact.parameters(np.array(list(values.values()))).mean())
        hits["exact sensors, tension"] = float(exact.tension(true, lengths, pressures).mean())
    band, alone = (posterior.tension(lengths, pressures, discrepancy=both) for both in (True, False))
    for kind, one in (("posterior", band), ("posterior, law alone", alone)):
        hits[f"{kind}, tension"] = float(np.mean((one.low <= true) & (true <= one.high)))
    deviations["tension"] = deviation(true, *band).tolist()
    half = linear_half_width(fit, lengths, pressures)
    middle = np.asarray(fit.build().tension(lengths, pressures))
    hits["least squares, tension"] = float(np.mean(np.abs(true - middle) <= half))
    return {
        "number": number,
        "inside": hits,
        "width": {"posterior": float(np.mean(band.high - band.low)), "least squares": float(2.0 * np.mean(half))},
        "deviations": deviations,
        "mixing": [posterior.r_hat, posterior.effective, posterior.divergences],
        "warned": bool(posterior.warnings),
    }


def deviation(value: Any, low: Any, median: Any, high: Any) -> Any:
    """A truth less the median, in standard deviations of a normal distribution with that 95 % interval."""
    return 2.0 * NORMAL * (value - median) / (high - low)


class ExactSensors(NamedTuple):
    """What the declared sensors leave open of a law that is right and linear at the fit.

    Attributes:
        problem: of the fit.
        x: scaled parameters (p,).
        covariance: of them (p, p).
    """

    problem: Problem
    x: np.ndarray
    covariance: np.ndarray

    @classmethod
    def of(cls, fit: mk.Fit, sensors: np.ndarray) -> ExactSensors:
        """Of a fit and the covariance of its sensors (n, n) [N^2]: one step of generalised least squares."""
        problem = Problem(fit.law, tuple(fit.parameters), dict(fit.known), fit.points)
        start = np.array([e.value for e in fit.parameters.values()]) / problem.scale
        force, slopes = problem.functions()
        root = np.linalg.cholesky(sensors)
        rows, off = np.linalg.solve(root, slopes(start)), np.linalg.solve(root, fit.points.tension - force(start))
        inverse = np.linalg.inv(rows.T @ rows)
        return cls(problem, start + inverse @ rows.T @ off, inverse)

    def parameters(self, truth: np.ndarray) -> np.ndarray:
        """Whether the 95 % interval of each parameter holds its truth [SI] (p,)."""
        off = truth / self.problem.scale - self.x
        return np.asarray(np.abs(off) <= NORMAL * np.sqrt(np.diag(self.covariance)))

    def tension(self, truth: np.ndarray, lengths: np.ndarray, pressures: np.ndarray) -> np.ndarray:
        """Whether the 95 % interval of each tension holds its truth [N] at points (q,)."""
        known = {name: float(np.max(value)) for name, value in self.problem.known.items()}
        places = mk.ForceMap("", lengths, pressures, np.ones(len(lengths)))
        force, slopes = Problem(self.problem.law, self.problem.free, known, places).functions()
        rows = slopes(self.x)
        return np.asarray(
            np.abs(truth - force(self.x)) <= NORMAL * np.sqrt(np.einsum("qi,ij,qj->q", rows, self.covariance, rows))
        )


def size_study(number: int, discrepancy: float | None) -> dict[str, Any]:
    """One muscle that is asked for force and stroke: whether the intervals hold those of its true law; widths [N], [m]."""
    try:
        case = list(CASES)[number % 2]
        law, (lengths, _), _, posterior = fitted_muscle(case, number, discrepancy, STREAMS["size"])
    except MckibbenError as error:
        return {"number": number, "failed": str(error)}
    chance = np.random.default_rng([number, 2])
    reach = float(posterior.points.length.max() - lengths.min())
    muscle = of_specimen("nylon", Requirements(force=20.0, stroke=0.02, pressure=3e5))
    muscle = replace(muscle, longest=float(posterior.points.length.max()), friction=0.0)
    pressure = float(chance.uniform(2e5, 4.5e5))
    true, stroke = LawAtPressure(law, pressure), float(chance.uniform(0.2, 0.8)) * reach
    force = float(true.added(muscle.longest - float(chance.uniform(0.2, 0.8)) * reach))
    answer = answer_of_posterior(posterior, muscle, Requirements(force=force, stroke=stroke, pressure=pressure))
    exact = float(true.added(muscle.longest - stroke)), muscle.longest - true.last_below(force, muscle.longest)
    bands = {"force at a stroke": answer.force, "stroke at a force": answer.stroke}
    return {
        "number": number,
        "inside": {
            f"posterior, {name}": float(band.low <= value <= band.high)
            for (name, band), value in zip(bands.items(), exact, strict=True)
        },
        "width": {name: float(band.high - band.low) for name, band in bands.items()},
        "deviations": {name: deviation(value, *band) for (name, band), value in zip(bands.items(), exact, strict=True)},
        "mixing": [posterior.r_hat, posterior.effective, posterior.divergences],
        "warned": bool(posterior.warnings),
    }


def record_hits(
    posterior: RecordPosterior, parameters: dict[str, float], true: np.ndarray, linear: dict[str, Any], number: int
) -> dict[str, Any]:
    """Shares of the intervals that hold true parameters, and of the band that holds the true record."""
    intervals, band = posterior.intervals(), posterior.band()
    hits = {
        f"{kind}, parameters": float(np.mean([some[n].low <= v <= some[n].high for n, v in parameters.items()]))
        for kind, some in (("posterior", intervals), ("least squares", linear))
    }
    return {
        "number": number,
        "inside": hits | {"posterior, record": float(np.mean((band.low <= true) & (true <= band.high)))},
        "deviations": {
            "parameters": [
                deviation(v, *(getattr(intervals[n], end) for end in ("low", "value", "high")))
                for n, v in parameters.items()
            ],
            "record": deviation(true, *band).tolist(),
        },
        "width": {"record": float(np.mean(band.high - band.low))},
        "mixing": [posterior.r_hat, posterior.effective, posterior.divergences],
        "warned": bool(posterior.warnings),
    }


def loop_study(number: int) -> dict[str, Any]:
    """One loop of a friction and a bent curve; its width [m]."""
    chance = np.random.default_rng([number, 3])
    truth = {"constant": 30.0 * np.exp(0.3 * chance.standard_normal()),
             "stiffness": 2e4 * np.exp(0.3 * chance.standard_normal())}  # fmt: skip
    friction = Dahl(limit=FrictionLimit(constant=truth["constant"]), stiffness=truth["stiffness"])
    state, force, before = friction.initial(), [], STROKES[0]
    for now in np.concatenate([STROKES, STROKES]):
        state = friction.advance(state, before - now, start_pressure=0.0, end_pressure=0.0).state
        force.append(float(friction.force(state)))
        before = now
    bend = chance.uniform(-0.2, 0.2)
    curve = 1e5 + 1e7 * STROKES * (1.0 + bend * (STROKES / 0.03 - 1.0))
    shown = STROKES + STROKE_NOISE * chance.standard_normal(len(STROKES))
    record = PathRecord(curve - np.array(force[len(STROKES) :]) / AREA, shown)
    try:
        fit = fit_loop(record, model="dahl", known={"per_pressure": 0.0}, knots=4)
        posterior = fit.posterior(noise=STROKE_NOISE, seed=number)
    except MckibbenError as error:
        return {"number": number, "failed": str(error)}
    return record_hits(posterior, truth, STROKES, fit.parameters, number)


def circuit_study(number: int) -> dict[str, Any]:
    """One tank behind an orifice; its width [Pa]."""
    chance = np.random.default_rng([number, 4])
    guess = {"elements.fill.conductance": 6e-9, "elements.fill.critical_ratio": 0.3, "elements.leak.conductance": 1e-9}
    truth = {name: value * float(np.exp(0.2 * chance.standard_normal())) for name, value in guess.items()}
    fill = Orifice(conductance=6e-9, critical_ratio=0.3)
    circuit = Circuit.of(
        {"supply": Reservoir(signal="wish"), "tank": FixedVolume(volume=5e-5, heat=Isothermal()),
         "room": Reservoir(signal="ambient")},
        {"fill": Branch(fill, ("supply", "tank")), "leak": Branch(Leak(conductance=1e-9), ("tank", "room"))},
    )  # fmt: skip
    wish = ROOM + np.repeat([0.0, 5e5, 2e5], [10, 50, 41])
    signals = {"wish": ramped(wish), "ambient": ramped(np.full(101, ROOM))}
    trial = Trial("tank", circuit, signals, {"tank": ROOM}, {"tank.pressure_abs": wish}, 1e-3)
    true = np.asarray(trial.run(truth, step=STEP).outputs["tank.pressure_abs"])
    noise = PRESSURE_NOISE * chance.standard_normal(101)
    noise[0] = 0.0  # the model begins where the record does
    trial = Trial("tank", circuit, signals, {"tank": ROOM}, {"tank.pressure_abs": true + noise}, 1e-3)
    try:
        fit = fit_circuit([trial], list(guess), step=STEP)
        posterior = fit.posterior([trial], noise=PRESSURE_NOISE, step=STEP, seed=number)
    except MckibbenError as error:
        return {"number": number, "failed": str(error)}
    return record_hits(posterior, truth, true, fit.parameters, number)


def of_kind(case: str, number: int, discrepancy: float | None) -> dict[str, Any]:
    """One case of a kind."""
    if case == "loop":
        return loop_study(number)
    if case == "circuit":
        return circuit_study(number)
    return size_study(number, discrepancy) if case == "size" else study(case, number, discrepancy)


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
        "deviations: mean, rms": {name: spread(done, name) for name in done[0]["deviations"]},
        "median of R-hat, independent samples, divergences": np.median(
            [row["mixing"] for row in done], axis=0
        ).tolist(),
    }


def without_chance(rows: list[dict[str, Any]], name: str) -> tuple[float, float]:
    """Share of the posterior's intervals that hold the truth, and its standard error, less the chance of `exact sensors`.

    Those hold 95 % of the truths of all muscles that could be drawn, so that what they hold more or less of these is taken
    off (a control variate, with the coefficient of least variance).
    """
    of, beside = (np.array([row["inside"][f"{kind}, {name}"] for row in rows if "inside" in row])
                  for kind in ("posterior", "exact sensors"))  # fmt: skip
    slope = np.cov(of, beside)[0, 1] / max(float(beside.var(ddof=1)), 1e-12)
    less = of - slope * (beside - 0.95)
    return float(less.mean()), float(less.std() / np.sqrt(len(less)))


def spread(rows: list[dict[str, Any]], name: str) -> tuple[float, float]:
    """Mean and root mean square of the deviations of all truths of a name."""
    every = np.concatenate([np.atleast_1d(row["deviations"][name]) for row in rows])
    return float(every.mean()), float(np.sqrt(np.mean(every**2)))


def table(cases: dict[str, list[dict[str, Any]]]) -> str:
    """The table of the documentation."""
    right, wrong = (summary(cases[case]) for case in CASES)

    def share(of: dict[str, Any], name: str) -> str:
        if name not in of["inside"]:
            return ""
        mean, error = of["inside"][name]
        return f"{100.0 * mean:.1f} ± {100.0 * error:.1f} %"

    lines = [
        "| intervals of | law is right: parameters | law is right: tension | law is wrong: tension | mean width, law right "
        "| mean width, law wrong |",
        "|---" * 6 + "|",
    ]
    for kind in ("posterior", "posterior, law alone", "exact sensors", "least squares"):
        cells = [
            share(right, f"{kind}, parameters"),
            share(right, f"{kind}, tension"),
            share(wrong, f"{kind}, tension"),
        ]
        cells += [f"{of['width'][kind]:.2f} N" if kind in of["width"] else "" for of in (right, wrong)]
        lines.append(f"| {kind} | {' | '.join(cells)} |")
    deviations = [
        f"{of['deviations: mean, rms'][name][0]:+.2f} and {of['deviations: mean, rms'][name][1]:.2f} ({words})"
        for of, name, words in (
            (right, "parameters", "parameters, law right"),
            (right, "tension", "tension, law right"),
            (wrong, "tension", "tension, law wrong"),
        )
    ]
    less = [
        f"{100.0 * mean:.1f} ± {100.0 * error:.1f} % of the {'parameters' if name == 'parameters' else 'tensions'}"
        for name in ("parameters", "tension")
        for mean, error in [without_chance(cases["right"], name)]
    ]
    lines += [
        "",
        f"{right['muscles']} muscles whose law is right and {wrong['muscles']} others whose law is wrong, each share with "
        f"its standard error. More samples were said to be needed for {right['warned']} and {wrong['warned']} of them. "
        "*exact sensors* are the intervals of a law that is known to be right, by the declared errors alone: they hold 95 % "
        "of the truths of all muscles, and what they hold more or less here is the chance of these, which the posterior "
        f"shares. Without it, the posterior holds {' and '.join(less)} where the law is right: the possibility of a "
        "discrepancy makes intervals wider, also where there is none. In standard deviations of a normal distribution with "
        f"the posterior's interval, the truth lies, mean and rms, {', '.join(deviations)} from the median; 0 and 1 are "
        "intervals that are just right.",
    ]
    return "\n".join([*lines, "", *others_table({case: cases[case] for case in OTHERS if case in cases})])


def others_table(cases: dict[str, list[dict[str, Any]]]) -> list[str]:
    """The table of loops, circuits and answers of sizing, as lines."""
    if not cases:
        return []
    lines = [
        "| kind | count | share of | posterior | least squares | deviations, mean and rms | more samples needed | failed |",
        "|---" * 8 + "|",
    ]
    for case, rows in cases.items():
        of = summary(rows)
        for name, (share, error) in of["inside"].items():
            kind, _, subject = name.partition(", ")
            if kind != "posterior":
                continue
            linear = of["inside"].get(f"least squares, {subject}")
            other = "" if linear is None else f"{100.0 * linear[0]:.1f} %"
            count = of["muscles"] - of["failed"]
            likely = (count * share + 1.0) / (count + 2.0)  # so that few cases that all hold the truth are not certain
            error = max(error, float(np.sqrt(likely * (1.0 - likely) / count)))
            share_text = f"{100.0 * share:.1f} ± {100.0 * error:.1f} %"
            mean, rms = of["deviations: mean, rms"][subject]
            lines.append(
                f"| {case} | {of['muscles']} | {subject} | {share_text} | {other} | {mean:+.2f} and {rms:.2f} "
                f"| {of['warned']} | {of['failed']} |"
            )
    sized = [row for row in cases.get("size", []) if "deviations" in row]
    if sized:
        sizes = [
            [np.sqrt(np.mean([row["deviations"][name] ** 2 for row in sized if row["number"] % 2 == place]))
             for place in range(len(CASES))]
            for name in sized[0]["deviations"]
        ]  # fmt: skip
        (force, force_wrong), (stroke, stroke_wrong) = sizes
        lines += [
            "",
            "How wide the intervals of `size` are: in standard deviations of a normal distribution with that interval, "
            f"the truth lies {force:.2f} (force) and {stroke:.2f} (stroke) rms from the median where the law "
            f"is right, {force_wrong:.2f} and {stroke_wrong:.2f} where it is wrong; 1 is an interval just wide enough. "
            "Force is what the gas adds, so that the tension without gas is taken off, and the maps end at 1.5 bar: below "
            "it the samples of a wrong law differ by newtons, and no point holds them together.",
        ]
    return lines


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
    written.write(WRITTEN, cases)


WRITTEN = (written.WrittenPart("explanation/uncertainty.md", BEGIN, END, table),)


def saved(cases: dict[str, list[dict[str, Any]]]) -> str:
    """The file of results: a muscle on each line, numbers to 5 digits."""

    def short(value: Any) -> Any:
        if isinstance(value, float):
            return float(f"{value:.5g}")
        if isinstance(value, dict):
            return {name: short(one) for name, one in value.items()}
        return [short(one) for one in value] if isinstance(value, list) else value

    lines = {case: ",\n".join(json.dumps(short(row)) for row in rows) for case, rows in cases.items()}
    return "{" + ",\n".join(f'"{case}": [\n{text}\n]' for case, text in lines.items()) + "}\n"


def main() -> None:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--muscles", type=int, default=250)
    options.add_argument("--others", type=int, default=100, help="count of loops, circuits and answers of sizing")
    options.add_argument("--cases", nargs="+", choices=[*CASES, *OTHERS], default=[*CASES, *OTHERS])
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
    most = max(given.muscles, given.others)
    for number in range(most):  # of all kinds in turn, so that a run that is ended has as many of each
        for case in given.cases:
            rows = cases.setdefault(case, [])
            if number == len(rows) and number < (given.others if case in OTHERS else given.muscles):
                rows.append(of_kind(case, number, given.discrepancy))
        if given.out and (number % 10 == 9 or number == most - 1):
            given.out.write_text(saved(cases), encoding="utf-8")
    for case, rows in cases.items():
        print(json.dumps({"case": case} | summary(rows)))


if __name__ == "__main__":
    main()
