"""What a tube model costs: the time of one run of a record, against that of another model."""

from __future__ import annotations

import functools
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from ..engine import STEP, march
from ..pneumatics.heat import HeatModel, Isothermal, WallHeat
from .tube_models import CHANNEL, Case, Result, models
from .tube_records import PERIOD

REPEATS = 25


class Cost(NamedTuple):
    """Least processor times of one run [s], which other work disturbs least, and their ratios, improved over inertial.

    `ratio` is that of the two tubes on one isothermal vessel; the other has the vessel that the improved model was fitted
    with.
    """

    inertial: float
    lumped: float
    lumped_with_vessel_heat: float
    ratio: float
    ratio_with_vessel_heat: float
    steps: int


def measure_cost(case: Case, known: Mapping[str, Result]) -> Cost:
    """Time the inertial and the improved model on one record at the default step, in turns.

    Args:
        case: what to run.
        known: the results ``inertial`` and ``lumped``, whose parameters and vessel are used.
    """
    heat = WallHeat(conductance=0.5) if known["lumped"].vessel == "wall_heat" else Isothermal()
    tube = {p: v for p, v in known["lumped"].changes.items() if p.startswith("elements.")}
    runs = (
        _runner(case, "inertial", Isothermal(), known["inertial"].changes),
        _runner(case, "lumped", heat, known["lumped"].changes),
        _runner(case, "lumped", Isothermal(), tube),
    )
    for run in runs:
        run()  # compiles
    times = np.array([[_seconds(run) for run in runs] for _ in range(REPEATS)])
    inertial, heated, lumped = (float(t) for t in np.min(times, axis=0))
    return Cost(
        inertial,
        lumped,
        heated,
        lumped / inertial,
        heated / inertial,
        (len(case.supply) - 1) * round(PERIOD / STEP),
    )


def _runner(case: Case, key: str, heat: HeatModel, changes: Mapping[str, float]) -> Callable[[], Any]:
    import jax

    trial = case.trial(models()[key].element, heat)
    circuit, signals = trial.with_parameters(changes)
    state = circuit.at_rest(trial.initial, {name: s.at(0, 0.0, PERIOD) for name, s in signals.items()})

    @functools.partial(jax.jit)
    def run(circuit: Any, state: Any, signals: Any) -> Any:
        _, kept = march(circuit, state, {}, signals, PERIOD, round(PERIOD / STEP), trial.samples, False)
        return kept[2][CHANNEL]

    return lambda: run(circuit, state, signals).block_until_ready()


def _seconds(run: Callable[[], Any]) -> float:
    begin = time.process_time()
    run()
    return time.process_time() - begin
