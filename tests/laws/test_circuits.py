"""Orifices, tubes and circuits: published limits, and accounts that close from independent integrals."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.components.flow import GasState
from mckibben.engine import held, integrate, ramped
from mckibben.errors import InputError
from mckibben.muscles import law_from_specimen
from mckibben.pneumatics import AIR
from mckibben.pneumatics.circuit import Branch, Circuit, balance
from mckibben.pneumatics.orifice import Orifice, steepest_slope
from mckibben.pneumatics.tubes import TUBES, LumpedTube, QuadraticTube, friction_factor, haaland, inertance, turbulence
from mckibben.pneumatics.volume import (
    FixedVolume,
    Inflow,
    Isothermal,
    MovingVolume,
    Polytropic,
    Reservoir,
    VolumeState,
    WallHeat,
    adiabatic,
)
from mckibben.specimens import specimen

T0 = 293.15
PERIOD = 1e-3


def test_orifice_with_b_0528_is_the_isentropic_nozzle():
    g = 1.4
    orifice = Orifice(conductance=1e-8, critical_ratio=0.528, linear_band=100.0)
    ratio = np.linspace(0.05, 0.995, 400)
    choked = (2 / (g + 1)) ** ((g + 1) / (2 * (g - 1))) * np.sqrt(g)
    subsonic = np.sqrt(2 * g / (g - 1) * np.maximum(ratio ** (2 / g) - ratio ** ((g + 1) / g), 0.0)) / choked
    exact = np.where(ratio < (2 / (g + 1)) ** (g / (g - 1)), 1.0, subsonic)
    flow = orifice.mass_flow(GasState(7e5, T0), GasState(7e5 * ratio, T0))
    # the ellipse of ISO 6358 is an approximation of the nozzle, known to be within 0.35 %
    np.testing.assert_allclose(np.asarray(flow) / float(flow[0]), exact, rtol=0.005)


def test_orifice_is_odd_continuous_and_of_finite_slope():
    orifice = Orifice(conductance=1e-8)
    forward = orifice.mass_flow(GasState(5e5, T0), GasState(4e5, T0))
    assert float(orifice.mass_flow(GasState(4e5, T0), GasState(5e5, T0))) == -float(forward)
    slope = jax.vmap(jax.grad(lambda p: orifice.mass_flow(GasState(jnp.asarray(5e5), T0), GasState(p, T0))))
    at = jnp.asarray([5e5 - 6e3, 5e5 - 1.0, 5e5, 5e5 + 1.0, 5e5 + 6e3])
    assert np.all(np.asarray(slope(at)) < 0.0)
    # steepest at equal pressures, where the catalogue formula's slope is infinite
    assert float(-slope(at)[2]) == pytest.approx(
        float(steepest_slope(orifice, GasState(5e5, T0), GasState(5e5, T0))), rel=0.02
    )


def test_orifice_from_a_catalogue_flow_gives_that_flow():
    orifice = Orifice.from_flow(600e-3 / 60, pressure=6.9e5)
    flow = orifice.mass_flow(GasState(6.9e5 + 101325.0, T0), GasState(101325.0, T0))
    assert float(flow) / 1.185 * 60e3 == pytest.approx(600.0, rel=1e-9)


def test_friction_is_laminar_below_2300_turbulent_from_4000_and_smooth_between():
    """Poiseuille's 64/Re, Haaland's formula, and half of each in the middle; a slope of zero at either end of the way."""
    shares = [float(turbulence(re)) for re in (1.0, 2300.0, 2725.0, 3150.0, 3575.0, 4000.0, 1e6)]
    assert shares == pytest.approx([0.0, 0.0, 0.15625, 0.5, 0.84375, 1.0, 1.0], abs=1e-15)  # 3 x^2 - 2 x^3
    assert float(jax.grad(turbulence)(2301.0)) < 1e-5 > float(jax.grad(turbulence)(3999.0))
    for rough in (0.0, 1e-2):
        formula = (-1.8 * np.log10((rough / 3.7) ** 1.11 + 6.9 / np.array([2300.0, 3150.0, 1e5]))) ** -2
        assert np.asarray(haaland(np.array([10.0, 3150.0, 1e5]), rough)) == pytest.approx(formula, rel=1e-12)
        found = [float(friction_factor(re, rough)) for re in (100.0, 2300.0, 3150.0, 1e5)]
        middle = 0.5 * (64.0 / 3150.0 + formula[1])
        assert found == pytest.approx([0.64, 64.0 / 2300.0, middle, formula[2]], rel=1e-12)


def test_inertance_of_the_papers_tube():
    area = 0.25 * np.pi * 3.175e-3**2
    value = float(inertance(length=1.0, area=area))  # [1/m] = [Pa s2/kg]
    assert value * 1e-8 == pytest.approx(1.26e-3, rel=5e-3)  # bar s2/g; printed with three digits
    assert value / 100.0 == pytest.approx(1260.0, rel=5e-3)  # 1/cm; the paper prints 126


def settled(tube, a, b):
    """The state of a tube after two seconds between constant pressures."""
    relax = lambda _, s: jax.tree.map(lambda v, r: v + 5e-5 * r, s, tube.rate(a, b, s, 0.0))  # noqa: E731
    return jax.lax.fori_loop(0, 40000, relax, tube.initial())


@pytest.mark.parametrize("name", TUBES)
def test_every_tube_flows_down_the_pressure_both_ways_and_rests_at_equal_pressures(name):
    tube = {
        "linear": lambda k: k(resistance=1e8),
        "quadratic": lambda k: k(viscous=50.0, turbulent=20.0, area=8e-6),
        "inertial": lambda k: k(viscous=50.0, turbulent=20.0, area=8e-6, length=1.0),
        "lumped": lambda k: k(length=1.0, diameter=3.2e-3),
    }[name](TUBES[name])
    flows = {}
    for low, high in ((3e5, 5e5), (5e5, 3e5), (4e5, 4e5)):
        a, b = GasState(jnp.asarray(high), T0), GasState(jnp.asarray(low), T0)
        state = settled(tube, a, b)
        flows[high - low] = float(tube.mass_flow(a, b, state, 0.0))
    assert flows[2e5] > 0.0 and flows[0.0] == 0.0
    assert flows[-2e5] == pytest.approx(-flows[2e5], rel=1e-9)


@pytest.mark.parametrize("p2", [4.9e5, 3e5])
def test_a_lumped_tube_at_rest_between_two_pressures_is_isothermal_pipe_flow(p2):
    length, diameter, ends, p1 = 2.0, 4e-3, 1.5, 5e5
    tube = LumpedTube(length=length, diameter=diameter, ends=ends)
    w = float(settled(tube, GasState(jnp.asarray(p1), T0), GasState(jnp.asarray(p2), T0)))
    area = 0.25 * np.pi * diameter**2
    reynolds = w * diameter / (area * float(AIR.viscosity(T0)))
    f = float(friction_factor(reynolds, 1.5e-6 / diameter))
    heads = f * length / diameter + ends + 2.0 * np.log(p1 / p2)
    exact = area * np.sqrt((p1**2 - p2**2) / (287.05 * T0 * heads))
    # the same formula but for its logarithm, a series within 0.6 %; that is 7 % of these heads at most
    assert w == pytest.approx(exact, rel=3e-4)


def test_a_lumped_tube_chokes():
    tube = LumpedTube(length=0.5, diameter=4e-3, ends=1.0)
    flows = [
        float(settled(tube, GasState(jnp.asarray(7e5), T0), GasState(jnp.asarray(p), T0))) for p in (2e5, 1e5, 1e4)
    ]
    # Whatever lies behind it, once the gas leaves with the speed of sound.
    assert flows[2] == pytest.approx(flows[1], rel=1e-9) and flows[1] == pytest.approx(flows[0], rel=0.02)
    back = float(settled(tube, GasState(jnp.asarray(1e4), T0), GasState(jnp.asarray(7e5), T0)))
    assert back == pytest.approx(-flows[2], rel=1e-12)


def circuit(block, muscle):
    valve = Orifice.from_flow(105e-3 / 60, pressure=6.9e5)
    law = law_from_specimen(specimen("nylon"))
    nodes = {
        "supply": Reservoir(pressure_abs=7.9e5),
        "valve": FixedVolume(volume=2e-6, heat=block),
        "muscle": MovingVolume(of=law.braid_volume, heat=muscle),
        "room": Reservoir(),
    }
    branches = {
        "fill": Branch(valve, ("supply", "valve"), "fill"),
        "vent": Branch(valve, ("valve", "room"), "vent"),
        "tube": Branch(LumpedTube(length=0.5, diameter=3.175e-3), ("valve", "muscle")),
    }
    return Circuit.of(nodes, branches)


@pytest.mark.parametrize(
    ("heat", "exponent"), [(Isothermal(), 1.0), (Polytropic(exponent=1.2), 1.2), (adiabatic(), float(AIR.heat_ratio))]
)
def test_a_closed_volume_that_moves_and_gives_with_its_pressure_keeps_p_v_to_the_exponent_of_its_heat(heat, exponent):
    pressure, volume = 4e5, VolumeState(value=3e-5, per_pressure=2e-11, moving=-4e-5)
    rate, _ = heat.rates(GasState(pressure, T0), volume, Inflow(0.0, 0.0))
    change = volume.moving + volume.per_pressure * rate
    assert float(rate / pressure) == pytest.approx(float(-exponent * change / volume.value), rel=1e-12)


@pytest.mark.parametrize(
    ("block", "muscle"),
    [(Polytropic(), Isothermal()), (adiabatic(), WallHeat(conductance=0.2)), (WallHeat(conductance=0.2), adiabatic())],
    ids=["polytropic-isothermal", "adiabatic-wall", "wall-adiabatic"],
)
def test_mass_and_energy_of_a_moving_muscle_close(block, muscle):
    samples = 401
    fill = (np.arange(samples) < 200).astype(float)
    length = 0.14 + 0.005 * np.sin(2 * np.pi * 5.0 * PERIOD * np.arange(samples))
    signals = {"fill": held(fill), "vent": held(1.0 - fill), "length": ramped(length)}
    system = circuit(block, muscle)
    start = system.initial({"valve": 101325.0, "muscle": 101325.0}, {"length": length[0]})
    run = integrate(system, start, signals, period=PERIOD)
    first = {k: s.at(0, 0.0, PERIOD) for k, s in signals.items()}
    last = {k: s.at(samples - 2, 1.0, PERIOD) for k, s in signals.items()}
    found = balance(system, start, run.state, first, last, run.integrals)
    assert found.mass < 1e-10  # linear in the flows, so only rounding is left
    assert found.energy < 1e-6  # quadrature of fourth order at 50 us, second at the valve's kinks
    assert run.outputs["muscle.pressure_abs"].max() > 7.5e5  # it did fill


@pytest.mark.parametrize(
    ("heat", "exponent"), [(Isothermal(), 1.0), (adiabatic(), 1.4)], ids=["isothermal", "adiabatic"]
)
def test_charging_a_vessel_ends_where_theory_says(heat, exponent):
    room = 300.0
    system = Circuit.of(
        {"supply": Reservoir(pressure_abs=6e5, temperature=room), "tank": FixedVolume(volume=1e-4, heat=heat)},
        {"valve": Branch(Orifice(conductance=2e-8), ("supply", "tank"), "open")},
    )
    start = system.initial({"tank": 1e5}, temperature=room)
    run = integrate(system, start, {"open": held(np.ones(2001))}, period=PERIOD)
    # first law of a rigid vessel filled from a reservoir: dm = V dp/(n R T0), whence the temperature follows
    gained = float(run.state["mass"]["tank"] - start["mass"]["tank"])
    assert gained == pytest.approx(1e-4 * 5e5 / (exponent * 287.05 * room), rel=1e-6)
    # 1 to 6 bar from 300 K: 393.75 K; the vessel is filled to 1e-6 of its pressure by then
    assert run.outputs["tank.temperature"][-1] == pytest.approx(room * 6.0 / (1.0 + 5.0 / exponent), rel=1e-5)


def test_two_volumes_and_a_linear_tube_follow_the_exact_exponential():
    v1, v2, r = 1e-4, 3e-4, 2e7
    tube = TUBES["linear"](resistance=r)
    system = Circuit.of({"a": FixedVolume(volume=v1), "b": FixedVolume(volume=v2)}, {"tube": Branch(tube, ("a", "b"))})
    start = system.initial({"a": 5e5, "b": 1e5})
    run = integrate(system, start, {"none": held(np.zeros(101))}, period=PERIOD, step_size=50e-6)
    rt = float(AIR.gas_constant) * T0
    decay = np.exp(-rt / r * (1 / v1 + 1 / v2) * run.time)
    # isothermal, linear: the difference decays exponentially; fourth-order error at 50 us is far below
    np.testing.assert_allclose(run.outputs["a.pressure_abs"] - run.outputs["b.pressure_abs"], 4e5 * decay, rtol=1e-8)


@pytest.mark.parametrize(
    ("nodes", "branches", "says"),
    [
        (
            {"a": FixedVolume(volume=1e-4)},
            {"v": Branch(Orifice(conductance=1e-8), ("a", "nowhere"))},
            "leads to no node",
        ),
        (
            {"a": FixedVolume(volume=1e-4), "b": Reservoir()},
            {"v": Branch(Orifice(conductance=1e-8), ("a", "a"))},
            "same node",
        ),
        (
            {"a": Reservoir(), "b": Reservoir()},
            {"v": Branch(Orifice(conductance=1e-8), ("a", "b"))},
            "at least one volume",
        ),
    ],
)
def test_an_open_circuit_is_refused(nodes, branches, says):
    with pytest.raises(InputError, match=says):
        Circuit.of(nodes, branches)


def test_bounds_are_checked():
    with pytest.raises(InputError, match="critical_ratio"):
        Orifice(conductance=1e-8, critical_ratio=1.2)
    with pytest.raises(InputError, match="volume"):
        FixedVolume(volume=0.0)


@pytest.mark.parametrize("conductance", [5e-9, 2e-8, 1e-7, 1e-6])
def test_a_small_pocket_fills_to_its_supply_however_large_the_orifice(conductance):
    """While it chokes, the slope that the stiff method sees is zero, and a step of 50 us is up to 2500 time constants."""
    pocket = Circuit.of(
        {"supply": Reservoir(pressure_abs=6e5), "pocket": FixedVolume(volume=1e-7, heat=adiabatic())},
        {"orifice": Branch(Orifice(conductance=conductance), ("supply", "pocket"))},
    )
    start, signals = pocket.initial({"pocket": 1e5}), {"clock": held(np.zeros(11))}
    run = integrate(pocket, start, signals, period=PERIOD)
    assert run.stiff and run.step < 5e-5
    pressure = run.outputs["pocket.pressure_abs"]
    # It is full within 0.1 ms, and nothing is left of the way there.
    assert pressure[1:] == pytest.approx(6e5, rel=1e-6)
    closed = balance(pocket, start, run.state, {}, {}, run.integrals)
    assert closed.mass < 1e-10 and closed.energy < 1e-10


def test_a_pressure_below_vacuum_is_no_result():
    pocket = Circuit.of(
        {"supply": Reservoir(pressure_abs=6e5), "pocket": FixedVolume(volume=1e-4)},
        {"tube": Branch(LumpedTube(length=1.0, diameter=4e-3), ("supply", "pocket"))},
    )
    state = pocket.initial({"pocket": 1e5})
    assert bool(pocket.admissible(state))
    assert not bool(pocket.admissible(state | {"pressure": {"pocket": jnp.asarray(-1.0)}}))
    assert not bool(pocket.admissible(state | {"mass": {"pocket": jnp.asarray(0.0)}}))


def test_the_papers_tube_drives_gas_of_the_density_of_where_it_comes_from():
    # Eqs. 20-24 solved backwards: the speed that gives the drop, at the density of the mean pressure (eq. 21).
    tube = QuadraticTube(viscous=50.0, turbulent=2.0, area=1e-5)
    cold, warm = (GasState(jnp.asarray(p), jnp.asarray(t)) for p, t in ((4e5, 290.0), (3e5, 350.0)))
    for a, b, sign in ((cold, warm, 1.0), (warm, cold, -1.0)):
        speed = float(tube.mass_flow(a, b)) / (float(AIR.density(3.5e5, 290.0)) * 1e-5)
        assert sign * speed > 0.0
        # to what the least viscous coefficient of 0.05 Pa s/m adds to 50
        np.testing.assert_allclose(50.0 * speed + 2.0 * speed * abs(speed), sign * 1e5, rtol=2e-6)
