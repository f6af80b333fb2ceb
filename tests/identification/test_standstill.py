"""A fit whose derivatives say that nothing changes, or that ended where it began, fails in one sentence.

Both return first guesses that look like findings. A fit that begins at its minimum ends there, and is right.
"""

import importlib

import numpy as np
import pytest

from mckibben.engine import held
from mckibben.errors import ConvergenceError, InputError
from mckibben.estimation import require_progress
from mckibben.identification import Trial, fit, fit_all, fit_circuit
from mckibben.identification import hysteresis_fit as loops
from mckibben.identification.circuit_fit import CircuitProblem
from mckibben.identification.path_record import PathRecord
from mckibben.identification.problem import Problem
from mckibben.pneumatics.circuit import Branch, Circuit
from mckibben.pneumatics.orifice import Leak
from mckibben.pneumatics.volume import FixedVolume, Isothermal, Reservoir
from mckibben.recordings import ForceMap

PERIOD, SAMPLES, ROOM = 5e-3, 40, 101325.0
LEAK = "elements.leak.conductance"
VESSELS = ("tank", "other")
STANDSTILL = "its first guesses are no minimum"


def leaking(noise: float = 1e3, conductance: float = 2e-9) -> Trial:
    """A tank that leaks, and another one beside it whose pressure nobody measured."""
    leaks = {"leak": Leak(conductance=conductance), "unseen": Leak(conductance=1e-9)}
    circuit = Circuit.of(
        {"room": Reservoir(pressure_abs=ROOM), **{n: FixedVolume(volume=5e-5, heat=Isothermal()) for n in VESSELS}},
        {n: Branch(leak, (v, "room")) for (n, leak), v in zip(leaks.items(), VESSELS, strict=True)},
    )  # fmt: skip
    still, initial = {"time": held(np.zeros(SAMPLES))}, {"tank": 5e5, "other": 5e5}
    first = Trial("leaking", circuit, still, initial, {"tank.pressure_abs": np.full(SAMPLES, 5e5)}, PERIOD)
    clean = np.asarray(first.run({LEAK: 2e-9}, step=PERIOD).outputs["tank.pressure_abs"])
    measured = clean + np.random.default_rng(3).normal(0.0, noise, SAMPLES)
    return first.replace(measured={"tank.pressure_abs": measured})


def test_a_parameter_of_a_circuit_that_no_record_shows_is_named():
    free = [LEAK, "elements.unseen.conductance", "nodes.other.volume"]
    with pytest.raises(InputError) as refused:
        fit_circuit([leaking(conductance=3e-9)], free, step=PERIOD)
    assert str(refused.value) == (
        "free is 'elements.unseen.conductance, nodes.other.volume': the data of leaking do not depend on them, so no fit "
        "can find them: fix these parameters, or begin with other values"
    )
    # fixed, they harm nothing
    assert fit_circuit([leaking(conductance=3e-9)], free[:1], step=PERIOD).parameters[LEAK].value == pytest.approx(
        2e-9, rel=0.02
    )  # 40 samples of 1 kPa know a fall of 60 kPa to half a percent


def test_a_fit_of_a_circuit_whose_derivatives_lead_nowhere_does_not_return_its_first_guesses(monkeypatch):
    right = CircuitProblem.jacobian
    monkeypatch.setattr(CircuitProblem, "jacobian", lambda self, x: -right(self, x))
    with pytest.raises(ConvergenceError) as refused:
        fit_circuit([leaking(conductance=3e-9)], [LEAK], step=PERIOD)
    assert str(refused.value) == (
        "The fit of leaking ended where it began, and its first guesses are no minimum; begin with other values."
    )


@pytest.mark.parametrize("noise", [0.0, 1e3])
def test_a_fit_that_begins_at_its_minimum_is_no_standstill(noise):
    trial = leaking(noise=noise)
    best = fit_circuit([trial], [LEAK], step=PERIOD).parameters[LEAK].value
    again = fit_circuit([trial], [LEAK], step=PERIOD, start={LEAK: best})
    # tolerance of the search: 1e-7 of the parameter, or 1e-9 of the sum of squares, whose root is 3e-5 of the interval
    assert again.parameters[LEAK].value == pytest.approx(best, rel=1e-6)


def test_one_evaluation_is_not_asked_to_move():
    assert not fit_circuit([leaking(conductance=3e-9)], [LEAK], step=PERIOD, evaluations=1).converged


def spring_map() -> ForceMap:
    length, pressure = (x.ravel() for x in np.meshgrid(np.linspace(0.13, 0.15, 5), np.linspace(2e5, 5e5, 4)))
    points = ForceMap(name="map", length=length, pressure=pressure, tension=4e-3 * pressure * (length - 0.1))
    return points.with_rest_length(0.14)


def test_a_law_whose_derivatives_lead_nowhere_is_refused_and_passed_over_among_all(monkeypatch):
    right = Problem.functions

    def turned(self):
        force, slopes = right(self)
        return force, lambda *at: -slopes(*at)

    monkeypatch.setattr(Problem, "functions", turned)
    with pytest.raises(ConvergenceError, match=f"map by the law gas_spring ended where it began, and {STANDSTILL}"):
        fit("gas_spring", spring_map(), schemes=())
    monkeypatch.setattr(importlib.import_module("mckibben.identification.fit"), "LAWS", ("gas_spring",))
    skipped: dict[str, str] = {}
    with pytest.raises(InputError, match="no law can be fitted"):
        fit_all(spring_map(), schemes=(), skipped=skipped)
    assert STANDSTILL in skipped["gas_spring"]


@pytest.mark.parametrize(
    ("sign", "refusal"), [(-1.0, STANDSTILL), (0.0, "data of the loop with dahl do not depend on them")]
)
def test_a_loop_whose_derivatives_lead_nowhere_is_refused(monkeypatch, sign, refusal):
    """The predictor of the loop is put in its place, so that nothing is compiled."""
    stroke = np.concatenate([np.linspace(0.0, 0.03, 20), np.linspace(0.03, 0.0, 20)[1:]])
    record = PathRecord(1e5 + 1e7 * stroke, stroke)
    row = np.linspace(1.0, 2.0, len(stroke))

    def predictor(record, seen, model, law, fixed, free, knots):
        table = np.outer(row, 1e-3 * (1.0 + np.arange(len(free)))) + 1e-4 * np.eye(len(row))[:, : len(free)]
        return (lambda x: table @ x), (lambda x: sign * table)

    monkeypatch.setattr(loops, "_predictor", predictor)
    with pytest.raises((InputError, ConvergenceError), match=refusal):
        loops.fit_loop(record, model="dahl", knots=4)


def test_a_fit_that_is_held_by_a_bound_may_end_there():
    bounds = np.array([0.0]), np.array([np.inf])
    there, slope, residual = np.array([1e-9]), np.ones((3, 1)), np.ones(3)
    require_progress(there, there, slope, residual, bounds, subject="it")  # downhill is beyond the bound
    with pytest.raises(ConvergenceError, match="ended where it began"):
        require_progress(there, there, slope, -residual, bounds, subject="it")
