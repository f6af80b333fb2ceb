"""Mass and energy of random circuits close from integrals that know nothing of the states.

Fixed topologies with drawn parameters, so that each is compiled once: a source valve and a vent into a manifold, any tube
to a moving muscle, an orifice on to a tank that leaks. With adiabatic and wall-heat chambers the energy balance is a proof;
isothermal and polytropic chambers report the heat that their temperature asks for, and close by construction.
"""

from typing import Any

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.engine import held, integrate, march, ramped
from mckibben.muscles import law_from_specimen
from mckibben.pneumatics.circuit import Branch, Circuit, balance
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.tubes import TUBES, LumpedTube
from mckibben.pneumatics.volume import FixedVolume, Isothermal, MovingVolume, Polytropic, Reservoir, WallHeat, adiabatic
from mckibben.specimens import specimen

PERIOD, SAMPLES = 1e-3, 241
# Steps per sample. Without inertia the quadratic tube settles in 50-200 us near equal pressures, and asks for half the step.
INNER = {"linear": 20, "quadratic": 40, "inertial": 20, "lumped": 20}
HEATS = {
    "isothermal": lambda x: Isothermal(),
    "polytropic": lambda x: Polytropic(exponent=1.0 + 0.4 * x),
    "adiabatic": lambda x: adiabatic(),
    "wall": lambda x: WallHeat(conductance=0.02 + 2.0 * x, wall_temperature=280.0 + 40.0 * x),
}
MUSCLE = law_from_specimen(specimen("nylon"))
compiled = jax.jit(march, static_argnums=(6, 7))  # the number of steps is an argument: one compilation for all


def a_tube(kind: str, x: float, y: float) -> Any:
    length, diameter = 0.2 + 1.8 * x, 2e-3 + 3e-3 * y
    area = 0.25 * np.pi * diameter**2
    return {
        "linear": lambda k: k(resistance=10.0 ** (8.0 + x)),
        "quadratic": lambda k: k(viscous=20.0 + 200.0 * x, turbulent=5.0 + 40.0 * y, area=area),
        "inertial": lambda k: k(viscous=20.0 + 200.0 * x, turbulent=5.0 + 40.0 * y, area=area, length=length),
        "lumped": lambda k: k(length=length, diameter=diameter),
    }[kind](TUBES[kind])


def network(tube: str, heats: tuple[str, str, str], x: list[float]) -> Circuit:
    manifold, muscle, tank = (HEATS[name](x[i]) for i, name in enumerate(heats))
    valve = Orifice(conductance=4e-9 + 2e-8 * x[3], critical_ratio=0.2 + 0.4 * x[4])
    return Circuit.of(
        {
            "supply": Reservoir(pressure_abs=4e5 + 5e5 * x[5], temperature=280.0 + 30.0 * x[6]),
            "manifold": FixedVolume(volume=2e-5 + 1e-4 * x[7], heat=manifold),
            "muscle": MovingVolume(of=MUSCLE.braid_volume, dead_volume=2e-6, heat=muscle),
            "tank": FixedVolume(volume=5e-5 + 5e-4 * x[8], heat=tank),
            "room": Reservoir(temperature=300.0),
        },
        {
            "fill": Branch(valve, ("supply", "manifold"), "fill"),
            "vent": Branch(valve, ("manifold", "room"), "vent"),
            "tube": Branch(a_tube(tube, x[9], x[10]), ("manifold", "muscle")),
            "cross": Branch(Orifice(conductance=5e-10 + 2e-9 * x[11]), ("tank", "muscle")),
            "leak": Branch(Orifice(conductance=1e-10), ("tank", "room")),
        },
    )


def signals(x: list[float]) -> dict[str, Any]:
    """Switching valves, now and then half open, and a length that swings."""
    step = np.arange(SAMPLES)
    fill = (step // (20 + int(60 * x[0]))) % 2
    half = np.where(step > 0.7 * SAMPLES, 0.5, 1.0)
    length = 0.14 + 0.008 * x[1] * np.sin(2.0 * np.pi * (1.0 + 7.0 * x[2]) * PERIOD * step)
    return {"fill": held(half * fill), "vent": held(half * (1 - fill)), "length": ramped(length)}


def closure(
    circuit: Circuit, given: dict[str, Any], pressures: dict[str, float], inner: int, scale: float = 1.0
) -> Any:
    """The balance of a run, and what went through; `scale` falsifies the accounts of what crossed the border."""
    start = circuit.initial(pressures, {"length": given["length"].values[0]}, temperature=295.0)
    (end, _, integrals), kept = compiled(circuit, start, (), given, PERIOD, inner, SAMPLES - 1, False)
    assert all(np.isfinite(np.asarray(leaf)).all() for leaf in jax.tree.leaves((end, kept)))
    first = {name: s.at(0, 0.0, PERIOD) for name, s in given.items()}
    last = {name: s.at(SAMPLES - 2, 1.0, PERIOD) for name, s in given.items()}
    sums = {name: float(value) * (scale if name in ("mass", "enthalpy") else 1.0) for name, value in integrals.items()}
    return balance(circuit, start, end, first, last, sums), sums["mass_turnover"]


unit = st.floats(0.0, 1.0)


PROOFS = ("adiabatic", "wall", "adiabatic"), ("wall", "adiabatic", "wall")
STATED = ("isothermal", "polytropic", "wall")
# Every tube with the heats that prove it, and each heat with one tube; the other pairs are among the slow ones.
PAIRS = [pytest.param(tube, heats, id="-".join((tube, *heats))) for tube in TUBES for heats in PROOFS] + [
    pytest.param(tube, STATED, id="-".join((tube, *STATED)), marks=[pytest.mark.slow] if tube != "lumped" else [])
    for tube in TUBES
]


@pytest.mark.parametrize(("tube", "heats"), PAIRS)
@settings(max_examples=12, deadline=None, derandomize=True, database=None)
@given(parameters=st.lists(unit, min_size=15, max_size=15), start=st.lists(unit, min_size=3, max_size=3))
def test_mass_and_energy_of_random_circuits_close(tube, heats, parameters, start):
    pressures = {name: 101325.0 + 5e5 * x for name, x in zip(("manifold", "muscle", "tank"), start, strict=True)}
    found, turnover = closure(network(tube, heats, parameters[:12]), signals(parameters[12:]), pressures, INNER[tube])
    assert turnover > 1e-8  # [kg]: something flowed
    assert found.mass < 1e-10  # linear in the flows: only rounding is left
    assert found.energy < 1e-6  # quadrature of order 4 at 50 us; each edge of choking costs a step of order 2


def test_the_balance_can_fail():
    circuit = network("lumped", ("adiabatic", "wall", "adiabatic"), [0.5] * 12)
    pressures = dict.fromkeys(("manifold", "muscle", "tank"), 101325.0)
    right, wrong = (closure(circuit, signals([0.5] * 3), pressures, 20, scale)[0] for scale in (1.0, 1.0 + 1e-4))
    assert right.mass < 1e-10 < 1e-6 < wrong.mass
    assert right.energy < 1e-6 < 1e-5 < wrong.energy


def test_a_stiff_circuit_keeps_its_accounts_too():
    """ROS2 integrates the accounts as states of their own; mass stays exact, energy is of its order 2."""
    valve = Orifice.from_flow(600e-3 / 60, pressure=6.9e5)
    circuit = Circuit.of(
        {
            "supply": Reservoir(pressure_abs=7.9e5),
            "valve": FixedVolume(volume=1e-6, heat=adiabatic()),
            "tank": FixedVolume(volume=1e-4, heat=WallHeat(conductance=0.2)),
        },
        {
            "fill": Branch(valve, ("supply", "valve"), "fill"),
            "tube": Branch(LumpedTube(length=0.1, diameter=2e-3), ("valve", "tank")),
        },
    )
    start = circuit.initial({"valve": 101325.0, "tank": 101325.0})
    given = {"fill": held(np.concatenate([np.ones(120), np.zeros(81)]))}
    run = integrate(circuit, start, given, period=PERIOD)
    assert run.stiff
    ends = ({"fill": given["fill"].at(i, 0.0, PERIOD)} for i in (0, 199))
    found = balance(circuit, start, run.state, *ends, run.integrals)
    assert found.mass < 1e-10 and found.energy < 1e-4
