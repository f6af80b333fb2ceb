"""Tube models, records and cases of the tube study, the reference of the distributed tube, fits and predictions.

100 cm of 1/8 in tube from a given pressure into an accumulator of 10 in3 or 3 in3. The paper does not say which pressures
its valve gave, so the study has its own: all between 0 and 5 bar gauge, on a clock of 1 kHz, 3 s long, straight between
samples, fixed by whole-number seeds and equal on every machine.

* noise: sines of equal amplitude at every multiple of 1/3 Hz up to 6 Hz, their phases from the seed, moved and stretched
  so that the samples reach from 0 to 5 bar exactly.
* steps: from 0 bar to 1, 3 and 5 bar and back, each edge in 5 ms; the order and the times between come from the seed.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..analysis.frequency import time_lead
from ..components import Environment
from ..components.flow import TwoPort
from ..components.gas import AIR
from ..engine import ramped
from ..experiments.waveforms import MultiSine, PointTable
from ..experiments.waveforms.shapes import uniform
from ..identification import Estimate, Trial, fit_circuit
from ..pneumatics.circuit import Branch, Circuit
from ..pneumatics.distributed import DistributedTube, ReservoirEnd, VesselEnd, simulate
from ..pneumatics.tubes import InertialTube, LinearTube, LumpedTube, QuadraticTube
from ..pneumatics.volume import FixedVolume, HeatModel, Isothermal, Reservoir, WallHeat
from ..quantities import with_unit

LENGTH, DIAMETER = 1.0, 3.175e-3  # 100 cm of 1/8 in tube [m]
AREA = 0.25 * np.pi * DIAMETER**2  # its bore [m^2]
ACCUMULATORS = {"10in3": 164e-6, "3in3": 49e-6}  # [m^3]
LARGE, SMALL = ACCUMULATORS  # fitted on the first, transferred to the second

PERIOD, DURATION = 1e-3, 3.0  # clock and length of a record [s]
TOP = 5e5  # highest gauge pressure [Pa]
LEVELS = (1e5, 3e5, 5e5)  # of the steps [Pa]
NOISE_CUTOFF = 6.0  # of the noise [1/s]
EDGE = 5e-3  # of a step [s]
FIRST = 0.1  # rest before the first step [s]
SEEDS = (1, 2)

THERMALS = ("isothermal", "adiabatic", "wall_heat")
CONDUCTANCE = 0.3  # from the large accumulator's gas to its wall, where there is wall heat [W/K]
CELLS = 25  # of the reference; 50 give a vessel pressure within 1 Pa rms of it

Wave = MultiSine | PointTable


class Record(NamedTuple):
    """Signal that drives the tube: gauge pressure in front of it [Pa], over samples of `PERIOD`."""

    name: str
    kind: str
    seed: int
    wave: Wave

    def pressure_abs(self) -> np.ndarray:
        """Absolute pressure [Pa], (samples,)."""
        pressures: np.ndarray = float(Environment().pressure_abs) + np.clip(self.wave.at(clock()), 0.0, TOP)
        return pressures

    def sentence(self) -> str:
        """Description as text."""
        if isinstance(self.wave, PointTable):
            levels = ", ".join(with_unit(v, "Pa") for v in self.wave.values[2::4])
            times = ", ".join(f"{t:.3f}" for t in self.wave.times[1::2])
            return f"steps from 0 bar to {levels} and back, at {times} s, edges of {1e3 * EDGE:g} ms, seed {self.seed}"
        count = len(self.wave.frequencies)
        top = with_unit(TOP, "Pa")
        return (
            f"noise, {count} sines of random phase up to {NOISE_CUTOFF:g} Hz, between 0 bar and {top}, seed {self.seed}"
        )


def clock() -> np.ndarray:
    """Times of the samples [s]."""
    return PERIOD * np.arange(round(DURATION / PERIOD) + 1)


def records(seeds: tuple[int, ...] = SEEDS) -> list[Record]:
    """Records of some seeds: noise first, then steps."""
    return [
        *(Record(f"noise {seed}", "noise", seed, noise(seed)) for seed in seeds),
        *(Record(f"steps {seed}", "steps", seed, steps(seed)) for seed in seeds),
    ]


def noise(seed: int) -> MultiSine:
    """Band-limited noise between 0 and `TOP`, gauge [Pa]."""
    count = round(NOISE_CUTOFF * DURATION)
    wave = MultiSine(
        amplitude=1.0,
        frequencies=tuple(k / DURATION for k in range(1, count + 1)),
        phases=tuple(2.0 * np.pi * uniform(seed, np.arange(count))),
    )
    values = wave.at(clock())
    stretch = TOP / (values.max() - values.min())
    return MultiSine(mean=-stretch * values.min(), amplitude=stretch, frequencies=wave.frequencies, phases=wave.phases)


def steps(seed: int) -> PointTable:
    """Steps to each of the `LEVELS` and back [Pa]."""
    drawn = uniform(seed, np.arange(3 * len(LEVELS)))
    order = np.argsort(drawn[: len(LEVELS)], kind="stable")
    holds = 1.0 + drawn[len(LEVELS) :]  # the longest lasts at most twice the shortest
    starts = FIRST + (DURATION - FIRST) * np.concatenate([[0.0], np.cumsum(holds)[:-1]]) / np.sum(holds)
    edges = np.round(starts / PERIOD) * PERIOD
    times, values = [0.0], [0.0]
    for i, at in enumerate(edges):
        times += [float(at), float(at + EDGE)]
        values += [values[-1], 0.0 if i % 2 else LEVELS[order[i // 2]]]
    return PointTable(times=tuple(times), values=tuple(values))


def surface_share(volume: float) -> float:
    """Surface of a vessel over that of the large accumulator of the same shape; volume [m^3]."""
    return float((volume / ACCUMULATORS[LARGE]) ** (2.0 / 3.0))


class ReferencePressures(NamedTuple):
    """Pressure in the vessel behind the distributed tube [Pa], and the hottest gas in it [K]."""

    pressure_abs: np.ndarray
    hottest: float


def reference(pressure_abs: np.ndarray, volume: float, thermal: str) -> ReferencePressures:
    """Response of the distributed tube to a record.

    Args:
        pressure_abs: in front of the tube [Pa], on the clock.
        volume: volume of the accumulator [m^3].
        thermal: ``isothermal``, ``adiabatic`` or ``wall_heat``, for the tube's wall and for the vessel's alike.
    """
    conductance = CONDUCTANCE * surface_share(volume) if thermal == "wall_heat" else 0.0
    start = float(pressure_abs[0])
    result = simulate(
        DistributedTube(length=LENGTH, diameter=DIAMETER, cells=CELLS, wall=thermal),
        ReservoirEnd(pressure_abs=pressure_abs, times=clock()),
        VesselEnd(
            volume=volume,
            pressure_abs=start,
            heat=Isothermal() if thermal == "isothermal" else WallHeat(conductance=conductance),
        ),
        duration=DURATION,
        sample_period=PERIOD,
        pressure_abs=start,
    )
    return ReferencePressures(
        np.asarray(result.right.outside_pressure), float(np.max(result.right.outside_temperature))
    )


STEP = 2e-4  # of the lumped models; a quarter of it moves a pressure by less than 1 Pa rms [s]
CHANNEL, HEAT = "vessel.pressure_abs", "nodes.vessel.heat.conductance"
LONGEST_LEAD = 0.05  # looked for [s]
# Printed for the quadratic model on 10 in3 (Figs. 8 and 9): where the fits begin.
R1, R2, CUTOFF = 49.1, 20.7, 4.0 * np.pi  # [Pa s/m, Pa s2/m2, 1/s]


@dataclass(frozen=True)
class TubeModel:
    """A tube model before a vessel: free dotted paths, and first guesses beyond the element's own values [SI].

    The fit begins from each of the guesses, and the best end counts.
    """

    key: str
    title: str
    element: TwoPort
    free: tuple[str, ...]
    heat: HeatModel = Isothermal()
    starts: tuple[Mapping[str, float], ...] = ({},)


def capacity(volume: float) -> float:
    """Mass per pressure of an isothermal vessel at the study's temperature [kg/Pa]; volume [m^3]."""
    return float(AIR.mass(1.0, volume, Environment().temperature))


def models() -> dict[str, TubeModel]:
    """All models by key."""
    linear = LinearTube(resistance=1.0 / (CUTOFF * capacity(ACCUMULATORS[LARGE])))
    quadratic = QuadraticTube(viscous=R1, turbulent=R2, area=AREA)
    inertial = InertialTube(viscous=R1, turbulent=R2, area=AREA, length=LENGTH)
    # The reference's open bore loses the speed at its exit and nothing at its entry.
    lumped = LumpedTube(length=LENGTH, diameter=DIAMETER, ends=1.0)
    scale, wall = ("elements.tube.friction_scale",), WallHeat(conductance=0.0)
    two = tuple(f"elements.tube.{name}" for name in ("viscous", "turbulent"))
    three = (*two, "elements.tube.length")
    some, little = {HEAT: 0.5}, {HEAT: 0.05}  # [W/K]
    many = (
        TubeModel("linear", "linear", linear, ("elements.tube.resistance",)),
        TubeModel("quadratic", "quadratic", quadratic, two),
        TubeModel("inertial", "inertial", inertial, three),
        TubeModel("lumped_isothermal", "improved, isothermal vessel", lumped, scale),
        TubeModel("lumped", "improved", lumped, (*scale, HEAT), wall, (some, little)),
        TubeModel("lumped_unfitted_isothermal", "improved, nothing fitted, isothermal vessel", lumped, ()),
        TubeModel("lumped_unfitted_adiabatic", "improved, nothing fitted, adiabatic vessel", lumped, (), wall),
        TubeModel("inertial_heat", "inertial, vessel with heat", inertial, (*three, HEAT), wall, (some,)),
    )
    return {m.key: m for m in many}


class Case(NamedTuple):
    """A record into an accumulator, with the response of the reference; absolute pressures [Pa]."""

    record: Record
    accumulator: str
    supply: np.ndarray
    vessel: np.ndarray

    @property
    def volume(self) -> float:
        """Volume of the accumulator [m^3]."""
        return ACCUMULATORS[self.accumulator]

    def trial(self, element: TwoPort, heat: HeatModel) -> Trial:
        """Record as a trial of a fit."""
        circuit = Circuit.of(
            {"supply": Reservoir(signal="supply"), "vessel": FixedVolume(volume=self.volume, heat=heat)},
            {"tube": Branch(element, ("supply", "vessel"))},
        )
        name = f"{self.record.name}, {self.accumulator}"
        start = {"vessel": float(self.vessel[0])}
        return Trial(name, circuit, {"supply": ramped(self.supply)}, start, {CHANNEL: self.vessel}, PERIOD)


class RecordError(NamedTuple):
    """Error of a model on one record: rms error [Pa], lead of the model [s], its pressure [Pa]."""

    record: str
    rms: float
    lead: float
    predicted: np.ndarray


@dataclass(frozen=True)
class TubeModelResult:
    """Result of a model on one accumulator: fitted there, or with parameters from another one.

    `vessel` is ``isothermal`` or ``wall_heat``; `changes` are the values by dotted path [SI], the conductance as on the
    large accumulator.
    """

    model: str
    accumulator: str
    fitted: bool
    vessel: str
    parameters: Mapping[str, Estimate]
    changes: Mapping[str, float]
    comparisons: tuple[RecordError, ...]
    warnings: tuple[str, ...] = ()

    @property
    def rms(self) -> float:
        """Rms error over all records [Pa]."""
        return float(np.sqrt(np.mean([c.rms**2 for c in self.comparisons])))

    @property
    def lead(self) -> float:
        """Mean lead over the records [s]."""
        return float(np.mean([c.lead for c in self.comparisons]))

    def value(self, name: str) -> float:
        """Fitted value by its short name [SI]."""
        return self.parameters[name].value


def fitted(model: TubeModel, cases: Sequence[Case]) -> TubeModelResult:
    """Fit a model to records of one accumulator; a model without free parameters is run unchanged."""
    if not model.free:
        return _judged(model, model.heat, cases, {})
    return min((_fit(model, cases, start) for start in model.starts), key=lambda r: r.rms)


def _fit(model: TubeModel, cases: Sequence[Case], start: Mapping[str, float]) -> TubeModelResult:
    share = surface_share(cases[0].volume)
    trials = [c.trial(model.element, model.heat) for c in cases]
    first = {path: value * share if path == HEAT else value for path, value in start.items()}
    result = fit_circuit(trials, model.free, start=first, step=STEP)
    return TubeModelResult(
        model=model.key,
        accumulator=cases[0].accumulator,
        fitted=True,
        vessel=_vessel(model.heat),
        parameters={path.rpartition(".")[2]: e for path, e in result.parameters.items()},
        changes={path: value / share if path == HEAT else value for path, value in result.changes.items()},
        comparisons=tuple(compare(c, result.predicted[t.name][CHANNEL]) for c, t in zip(cases, trials, strict=True)),
        warnings=result.warnings if result.converged else (*result.warnings, f"not converged: {result.message}"),
    )


def transferred(model: TubeModel, known: TubeModelResult, cases: Sequence[Case]) -> TubeModelResult:
    """Evaluate fitted parameters on other records, without refitting."""
    heat = WallHeat(conductance=0.0) if known.vessel == "wall_heat" else Isothermal()
    return replace(_judged(model, heat, cases, known.changes), parameters=known.parameters)


def _judged(model: TubeModel, heat: HeatModel, cases: Sequence[Case], changes: Mapping[str, float]) -> TubeModelResult:
    comparisons = tuple(compare(c, predict(model, heat, c, changes)) for c in cases)
    return TubeModelResult(model.key, cases[0].accumulator, False, _vessel(heat), {}, dict(changes), comparisons)


def predict(model: TubeModel, heat: HeatModel, case: Case, changes: Mapping[str, float]) -> np.ndarray:
    """Predict the pressure in the vessel [Pa]; a conductance in `changes` is that of the large accumulator."""
    share = surface_share(case.volume)
    parameters = {path: value * share if path == HEAT else value for path, value in changes.items()}
    return np.asarray(case.trial(model.element, heat).run(parameters, step=STEP).outputs[CHANNEL])


def compare(case: Case, predicted: np.ndarray) -> RecordError:
    """Error and lead of a prediction."""
    rms = float(np.sqrt(np.mean((predicted - case.vessel) ** 2)))
    lead = time_lead(predicted, case.vessel, period=PERIOD, longest=LONGEST_LEAD).time
    return RecordError(case.record.name, rms, lead, predicted)


def _vessel(heat: HeatModel) -> str:
    return "wall_heat" if isinstance(heat, WallHeat) else "isothermal"
