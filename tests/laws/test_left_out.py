"""What an argument means that is left out: rest, no pressure, the usual room, and the one usual value of its name."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.bench.hardware.converters import AnalogOut
from mckibben.components.flow import Environment
from mckibben.muscles.biological import BiologicalMuscle, passive_curve, velocity_curve
from mckibben.muscles.elements import Delay, MaxwellChain, Parallel, PassiveSpring, Series, Tendon, Viscous
from mckibben.muscles.hysteresis import (
    BoucWen,
    Coulomb,
    Dahl,
    FrictionLimit,
    MaxwellSlip,
    PrandtlIshlinskii,
)
from mckibben.pneumatics.orifice import Leak, Orifice

LIMIT = FrictionLimit(constant=0.5, per_pressure=4e-6)
FRICTIONS = {
    "coulomb": Coulomb(limit=LIMIT, smoothing_velocity=1e-3),
    "dahl": Dahl(limit=LIMIT, stiffness=2e3),
    "maxwell_slip": MaxwellSlip.geometric(LIMIT),
    "bouc_wen": BoucWen(limit=LIMIT, stiffness=2e3, share=0.7, exponent=1),
    "prandtl_ishlinskii": PrandtlIshlinskii(
        weight=[1e3, 200.0], threshold=[1e-4, 1e-3], threshold_per_pressure=[1e-9, 1e-9]
    ),
    "maxwell_chain": MaxwellChain.geometric(stiffness=300.0, shortest=0.1, longest=10.0),
}
ELEMENTS = {
    "spring": PassiveSpring(rest_length=0.1, stiffness=400.0, cubic_stiffness=1e6),
    "viscous": Viscous(damping=3.0),
    "tendon": Tendon(stiffness=1e5, slack_length=0.02, toe_length=5e-4, loss=0.2),
    "parallel": Parallel((Viscous(damping=3.0), Tendon(stiffness=1e3, slack_length=0.11))),
}
MUSCLE = BiologicalMuscle(rest_length=0.14, section_area=0.95e-4, maximum_tension_intensity=35e4, maximum_velocity=8.0)


@pytest.mark.parametrize("name", FRICTIONS)
def test_friction_and_creep_without_a_velocity_and_a_pressure_are_at_rest_without_pressure(name):
    element = FRICTIONS[name]
    state = element.advance(element.initial(), 3e-4, start_pressure=2e5, end_pressure=2e5, duration=0.5).state
    assert float(element.force(state)) == float(element.force(state, 0.0, 0.0))
    stated, zeros = {"start_pressure": 0.0, "end_pressure": 0.0}, {"duration": 0.0}
    if name == "maxwell_chain":
        stated, zeros = {"duration": 0.5}, stated
    for one, other in zip(
        element.advance(state, 1e-4, **stated), element.advance(state, 1e-4, **stated, **zeros), strict=True
    ):
        np.testing.assert_array_equal(one, other)


@pytest.mark.parametrize("name", [n for n in FRICTIONS if n != "maxwell_chain"])
def test_oil_takes_a_tenth_of_the_friction(name):
    friction = FRICTIONS[name]
    for at in (0.0, 3e5):
        assert float(friction.lubricated().largest_force(at)) == pytest.approx(0.9 * float(friction.largest_force(at)))


@pytest.mark.parametrize("element", ELEMENTS.values(), ids=ELEMENTS)
def test_an_element_without_a_velocity_stands_still(element):
    lengths = jnp.array([0.019, 0.0203, 0.021, 0.1, 0.12])
    np.testing.assert_array_equal(element.force(lengths), element.force(lengths, 0.0))


def test_elements_in_series_stand_still_and_a_delay_begins_at_none():
    series = Series((ELEMENTS["tendon"], PassiveSpring(rest_length=0.1, stiffness=400.0)))
    state = series.initial(jnp.array([0.0205]))
    for ask in (series.forces, series.force, series.rate):
        for one, other in zip(jax.tree.leaves(ask(state, 0.13)), jax.tree.leaves(ask(state, 0.13, 0.0)), strict=True):
            np.testing.assert_array_equal(one, other)
    delay = Delay.of(time=2e-3, sample_period=1e-3)
    np.testing.assert_array_equal(delay.initial(), delay.initial(0.0))


@pytest.mark.parametrize("name", ["active_tension", "tension", "stiffness", "damping"])
def test_a_biological_muscle_without_a_velocity_is_isometric(name):
    ask = getattr(MUSCLE, name)
    for span in (0.12, 0.14, 0.16):
        assert float(ask(span, 0.6)) == float(ask(span, 0.6, 0.0))
    assert MUSCLE.activation_for(10.0, 0.14) == MUSCLE.activation_for(10.0, 0.14, 0.0)
    assert float(MUSCLE.state(0.14, 0.6).tension) == float(MUSCLE.state(0.14, 0.6, 0.0).tension)


def test_curves_without_numbers_are_those_of_a_muscle_without_numbers():
    at = jnp.linspace(-1.0, 1.0, 21)
    np.testing.assert_array_equal(velocity_curve(at), MUSCLE.velocity_curve(at))
    np.testing.assert_array_equal(passive_curve(1.0 + at), MUSCLE.passive_curve(1.0 + at))


def test_every_way_to_an_orifice_has_the_same_critical_ratio_and_every_flow_goes_into_the_same_room():
    ways = (
        Orifice.from_flow(1e-3, pressure=6e5), Orifice.from_nominal_flow(1e-3), Orifice.from_kv(1e-5),
        Orifice.from_cv(0.1),
    )  # fmt: skip
    assert {float(one.critical_ratio) for one in ways} == {0.35}
    room = float(Environment().pressure_abs)
    flows = (Orifice.from_flow, Leak.from_flow)
    for flow in flows:
        assert float(flow(1e-3, pressure=6e5).conductance) == float(flow(1e-3, pressure=6e5, ambient=room).conductance)
    decay = {"volume": 1e-4, "pressure": 3e5}
    assert float(Leak.from_decay(5.0, **decay).conductance) == float(
        Leak.from_decay(5.0, **decay, ambient=room).conductance
    )
    hole = [float(Orifice.of_hole(1e-3, **more).conductance) for more in ({}, {"discharge": 0.8})]
    assert hole[0] == hole[1]


def test_a_converter_that_is_asked_for_no_number_writes_the_count_of_zero():
    out = AnalogOut(bits=12, low=-5.0, high=5.0)
    assert float(out.count(jnp.nan)) == float(out.count(0.0)) == float(out.count(jnp.inf))
