"""The tube models under study: what each leaves free, how it is fitted on one accumulator and taken to another.

The three of the paper stand before a vessel with C = V/RT, as the paper has it. The improved one is fitted twice, before an
isothermal vessel and before one whose wall conducts heat, and the records of the large accumulator alone decide which.
A fitted conductance goes to another accumulator by the share of the surfaces; nothing else changes.

Free are only what the records can tell apart: a velocity head at the ends acts like friction along the tube, so that the
improved model keeps the heads of the reference's ends and frees the friction alone; the bore of the quadratic and the
inertial model is the geometric one, for R1, R2 and the length scale with it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from ..analysis.timing import time_lead
from ..components import Environment
from ..components.flow import TwoPort
from ..engine import ramped
from ..identification import Estimate, Trial, fit_circuit
from ..pneumatics import AIR
from ..pneumatics.circuit import Branch, Circuit
from ..pneumatics.heat import HeatModel, Isothermal, WallHeat
from ..pneumatics.tubes import InertialTube, LinearTube, LumpedTube, QuadraticTube
from ..pneumatics.volume import FixedVolume, Reservoir
from .tube_records import ACCUMULATORS, AREA, DIAMETER, LARGE, LENGTH, PERIOD, Record, surface_share

STEP = 2e-4  # of the lumped models; a quarter of it moves a pressure by less than 1 Pa rms [s]
CHANNEL, HEAT = "vessel.pressure_abs", "nodes.vessel.heat.conductance"
LONGEST_LEAD = 0.05  # looked for [s]
# Printed for the quadratic model on 10 in3 (Figs. 8 and 9): where the fits begin.
R1, R2, CUTOFF = 49.1, 20.7, 4.0 * np.pi  # [Pa s/m, Pa s2/m2, 1/s]


@dataclass(frozen=True)
class Model:
    """A tube model before a vessel: dotted paths of what is free, and first guesses beyond the element's own values [SI].

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


def models() -> dict[str, Model]:
    """All of them by key."""
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
        Model("linear", "linear", linear, ("elements.tube.resistance",)),
        Model("quadratic", "quadratic", quadratic, two),
        Model("inertial", "inertial", inertial, three),
        Model("lumped_isothermal", "improved, isothermal vessel", lumped, scale),
        Model("lumped", "improved", lumped, (*scale, HEAT), wall, (some, little)),
        Model("lumped_unfitted_isothermal", "improved, nothing fitted, isothermal vessel", lumped, ()),
        Model("lumped_unfitted_adiabatic", "improved, nothing fitted, adiabatic vessel", lumped, (), wall),
        Model("inertial_heat", "inertial, vessel with heat", inertial, (*three, HEAT), wall, (some,)),
    )
    return {m.key: m for m in many}


class Case(NamedTuple):
    """One record into one accumulator, with the reference's answer; absolute pressures [Pa]."""

    record: Record
    accumulator: str
    supply: np.ndarray
    vessel: np.ndarray

    @property
    def volume(self) -> float:
        """Of the accumulator [m^3]."""
        return ACCUMULATORS[self.accumulator]

    def trial(self, element: TwoPort, heat: HeatModel) -> Trial:
        """The record as something to fit."""
        circuit = Circuit.of(
            {"supply": Reservoir(signal="supply"), "vessel": FixedVolume(size=self.volume, heat=heat)},
            {"tube": Branch(element, ("supply", "vessel"))},
        )
        name = f"{self.record.name}, {self.accumulator}"
        start = {"vessel": float(self.vessel[0])}
        return Trial(name, circuit, {"supply": ramped(self.supply)}, start, {CHANNEL: self.vessel}, PERIOD)


class Comparison(NamedTuple):
    """A model against the reference on one record: rms error [Pa], lead of the model [s], its pressure [Pa]."""

    record: str
    rms: float
    lead: float
    predicted: np.ndarray


@dataclass(frozen=True)
class Result:
    """A model on one accumulator: fitted there, or with what another one gave.

    `vessel` is ``isothermal`` or ``wall_heat``; `changes` are the values by dotted path [SI], the conductance as on the
    large accumulator.
    """

    model: str
    accumulator: str
    fitted: bool
    vessel: str
    parameters: Mapping[str, Estimate]
    changes: Mapping[str, float]
    comparisons: tuple[Comparison, ...]
    warnings: tuple[str, ...] = ()

    @property
    def rms(self) -> float:
        """Over all records [Pa]."""
        return float(np.sqrt(np.mean([c.rms**2 for c in self.comparisons])))

    @property
    def lead(self) -> float:
        """Mean over the records [s]."""
        return float(np.mean([c.lead for c in self.comparisons]))

    def value(self, name: str) -> float:
        """A fitted value by its short name [SI]."""
        return self.parameters[name].value


def fitted(model: Model, cases: Sequence[Case]) -> Result:
    """Fit a model to records of one accumulator; where nothing of it is free it is run as it is."""
    if not model.free:
        return _judged(model, model.heat, cases, {})
    return min((_fit(model, cases, start) for start in model.starts), key=lambda r: r.rms)


def _fit(model: Model, cases: Sequence[Case], start: Mapping[str, float]) -> Result:
    share = surface_share(cases[0].volume)
    trials = [c.trial(model.element, model.heat) for c in cases]
    first = {path: value * share if path == HEAT else value for path, value in start.items()}
    found = fit_circuit(trials, model.free, start=first, step=STEP)
    return Result(
        model=model.key, accumulator=cases[0].accumulator, fitted=True, vessel=_vessel(model.heat),
        parameters={path.rpartition(".")[2]: e for path, e in found.parameters.items()},
        changes={path: value / share if path == HEAT else value for path, value in found.changes.items()},
        comparisons=tuple(compare(c, found.predicted[t.name][CHANNEL]) for c, t in zip(cases, trials, strict=True)),
        warnings=found.warnings if found.converged else (*found.warnings, f"not converged: {found.message}"),
    )  # fmt: skip


def transferred(model: Model, known: Result, cases: Sequence[Case]) -> Result:
    """The same parameters on other records, nothing refitted."""
    heat = WallHeat(conductance=0.0) if known.vessel == "wall_heat" else Isothermal()
    return replace(_judged(model, heat, cases, known.changes), parameters=known.parameters)


def _judged(model: Model, heat: HeatModel, cases: Sequence[Case], changes: Mapping[str, float]) -> Result:
    comparisons = tuple(compare(c, predict(model, heat, c, changes)) for c in cases)
    return Result(model.key, cases[0].accumulator, False, _vessel(heat), {}, dict(changes), comparisons)


def predict(model: Model, heat: HeatModel, case: Case, changes: Mapping[str, float]) -> np.ndarray:
    """Pressure in the vessel [Pa]; a conductance in `changes` is that of the large accumulator."""
    share = surface_share(case.volume)
    own = {path: value * share if path == HEAT else value for path, value in changes.items()}
    return np.asarray(case.trial(model.element, heat).run(own, step=STEP).outputs[CHANNEL])


def compare(case: Case, predicted: np.ndarray) -> Comparison:
    """Error and lead of a prediction."""
    rms = float(np.sqrt(np.mean((predicted - case.vessel) ** 2)))
    lead = time_lead(predicted, case.vessel, period=PERIOD, longest=LONGEST_LEAD).time
    return Comparison(case.record.name, rms, lead, predicted)


def _vessel(heat: Any) -> str:
    return "wall_heat" if isinstance(heat, WallHeat) else "isothermal"
