"""The tube models under study: what each leaves free, how it is fitted on one accumulator and taken to another.

The three of the paper stand before a vessel with C = V/RT, as the paper has it. The improved one is fitted twice, before an
isothermal vessel and before one whose wall conducts heat, and the records of the large accumulator alone decide which.
A fitted conductance goes to another accumulator by the share of the surfaces; nothing else changes.
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

STEP = 1e-4  # of the lumped models; half of it moves no rms error by more than 1 Pa [s]
CHANNEL, HEAT = "vessel.pressure_abs", "nodes.vessel.heat.conductance"
LONGEST_LEAD = 0.05  # looked for [s]
# Printed for the quadratic model on 10 in3 (Figs. 8 and 9): where the fits begin.
R1, R2, CUTOFF = 49.1, 20.7, 4.0 * np.pi  # [Pa s/m, Pa s2/m2, 1/s]


class Vessel(NamedTuple):
    """A heat model of the vessel, and the first guesses of its conductance [W/K]; none where it has none."""

    heat: HeatModel
    starts: tuple[float, ...] = ()


ISOTHERMAL = Vessel(Isothermal())
CONDUCTING = Vessel(WallHeat(conductance=0.5), (0.5, 0.05))


@dataclass(frozen=True)
class Model:
    """A tube model with its free parameters, before one vessel or several among which the fit chooses."""

    key: str
    title: str
    element: TwoPort
    free: tuple[str, ...]
    vessels: tuple[Vessel, ...] = (ISOTHERMAL,)


def capacity(volume: float) -> float:
    """Mass per pressure of an isothermal vessel at the study's temperature [kg/Pa]; volume [m^3]."""
    return float(AIR.mass(1.0, volume, Environment().temperature))


def models() -> dict[str, Model]:
    """All of them by key."""
    inertial = InertialTube(viscous=R1, turbulent=R2, area=AREA, length=LENGTH)
    # The reference's open bore loses the speed at its exit and nothing at its entry.
    lumped = LumpedTube(length=LENGTH, diameter=DIAMETER, ends=1.0)
    linear = LinearTube(resistance=1.0 / (CUTOFF * capacity(ACCUMULATORS[LARGE])))
    many = (
        Model("linear", "linear", linear, ("resistance",)),
        Model(
            "quadratic",
            "quadratic",
            QuadraticTube(viscous=R1, turbulent=R2, area=AREA),
            ("viscous", "turbulent"),
        ),
        Model("inertial", "inertial", inertial, ("viscous", "turbulent", "length")),
        Model("lumped", "improved", lumped, ("friction_scale",), (ISOTHERMAL, CONDUCTING)),
        Model("lumped_isothermal", "improved, vessel isothermal", lumped, ("friction_scale",)),
        Model("lumped_unfitted", "improved, nothing fitted, vessel isothermal", lumped, ()),
        Model("inertial_heat", "inertial, vessel as improved", inertial, ("viscous", "turbulent", "length"), (CONDUCTING,)),
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
    """A model against the reference on one record: rms error [Pa], lead [s] (positive: the model is early), pressure [Pa]."""

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


def fitted(model: Model, cases: Sequence[Case], start: Mapping[str, float] | None = None) -> Result:
    """Fit a model to records of one accumulator; the best of its vessels and their first guesses.

    Args:
        model: what to fit.
        cases: of one accumulator.
        start: first guesses by dotted path [SI].
    """
    best: Result | None = None
    for vessel in model.vessels:
        for guess in vessel.starts or (None,):
            found = _fit(model, vessel.heat, cases, guess, start or {})
            if best is None or found.rms < best.rms:
                best = found
    assert best is not None
    return best


def _fit(
    model: Model, heat: HeatModel, cases: Sequence[Case], guess: float | None, start: Mapping[str, float]
) -> Result:
    share = surface_share(cases[0].volume)
    free = [f"elements.tube.{name}" for name in model.free]
    first = dict(start)
    if guess is not None:
        free.append(HEAT)
        first.setdefault(HEAT, guess)
        first[HEAT] *= share
    trials = [c.trial(model.element, heat) for c in cases]
    if not free:
        return _judged(model, heat, cases, {}, fitted=False)
    found = fit_circuit(trials, free, start=first, step=STEP)
    changes = {path: value / share if path == HEAT else value for path, value in found.changes.items()}
    predicted = [found.predicted[t.name][CHANNEL] for t in trials]
    return Result(
        model=model.key, accumulator=cases[0].accumulator, fitted=True, vessel=_vessel(heat),
        parameters={_short(path): e for path, e in found.parameters.items()}, changes=changes,
        comparisons=tuple(compare(c, p) for c, p in zip(cases, predicted, strict=True)), warnings=found.warnings,
    )  # fmt: skip


def transferred(model: Model, known: Result, cases: Sequence[Case]) -> Result:
    """The same parameters on other records, nothing refitted."""
    heat = WallHeat(conductance=1.0) if known.vessel == "wall_heat" else Isothermal()
    moved = _judged(model, heat, cases, known.changes, fitted=False)
    return replace(moved, parameters=known.parameters)


def _judged(
    model: Model, heat: HeatModel, cases: Sequence[Case], changes: Mapping[str, float], *, fitted: bool
) -> Result:
    comparisons = tuple(compare(c, predict(model, heat, c, changes)) for c in cases)
    return Result(model.key, cases[0].accumulator, fitted, _vessel(heat), {}, dict(changes), comparisons)


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


def _short(path: str) -> str:
    return path.rpartition(".")[2]


def _vessel(heat: Any) -> str:
    return "wall_heat" if isinstance(heat, WallHeat) else "isothermal"
