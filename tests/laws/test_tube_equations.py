"""Equations of a resolved tube, state by state: what stays along a wave or a nozzle, what is carried, what a wall does."""

import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.components.gas import AIR
from mckibben.pneumatics.distributed.ends import OpenBore, Restriction
from mckibben.pneumatics.distributed.equations import (
    LAMINAR_NUSSELT,
    PRANDTL,
    Medium,
    Primitive,
    _one_sided,
    hllc,
    limited,
    nusselt,
    reconstruct,
    wall_rates,
)
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.tubes import haaland

R, CP, CV, GAMMA = (float(v) for v in (AIR.gas_constant, AIR.cp, AIR.cv, AIR.heat_ratio))
MEDIA = [Medium(), Medium(isothermal=True)]
STATE = Primitive(
    *(np.array(v) for v in ([1e5, 6e5, 3e5, 2e5], [0.0, 80.0, -150.0, 20.0], [293.0, 310.0, 250.0, 293.0]))
)
ROUNDING = 1e-11  # of powers near 3.5


def close(one, other):
    for a, b in zip(one, other, strict=True):
        np.testing.assert_allclose(a, np.broadcast_to(b, np.shape(a)), rtol=ROUNDING, atol=1e-9)


def sound(medium, temperature):
    return np.sqrt((1.0 if medium.isothermal else GAMMA) * R * temperature)


@pytest.mark.parametrize("medium", MEDIA)
def test_what_is_conserved_is_mass_momentum_and_inner_with_kinetic_energy(medium):
    kept = medium.conserved(STATE)
    density = STATE.pressure / (R * STATE.temperature)
    close(kept, (density, density * STATE.velocity, density * (CV * STATE.temperature + 0.5 * STATE.velocity**2)))
    close(medium.primitive(kept), STATE)
    np.testing.assert_allclose(medium.total_enthalpy(STATE), CP * STATE.temperature + 0.5 * STATE.velocity**2)
    np.testing.assert_allclose(medium.sound_speed(STATE.temperature), sound(medium, STATE.temperature))


@pytest.mark.parametrize("medium", MEDIA)
def test_a_nozzle_draws_gas_out_of_the_rest_to_which_it_would_come(medium):
    rest = medium.at_rest(STATE)
    assert np.all(rest.velocity == 0.0) and np.all(rest.pressure >= STATE.pressure)
    close(medium.nozzle(rest.pressure, rest.temperature, STATE.temperature, STATE.velocity), STATE)
    if medium.isothermal:  # R T ln(p0/p) is the kinetic energy
        np.testing.assert_allclose(
            R * STATE.temperature * np.log(rest.pressure / STATE.pressure), 0.5 * STATE.velocity**2, atol=1e-9
        )
    else:  # the enthalpy stays, and the entropy
        np.testing.assert_allclose(CP * rest.temperature, medium.total_enthalpy(STATE), rtol=ROUNDING)
        ratio = (rest.temperature / STATE.temperature) ** (GAMMA / (GAMMA - 1.0))
        np.testing.assert_allclose(rest.pressure / STATE.pressure, ratio, rtol=ROUNDING)


@pytest.mark.parametrize("medium", MEDIA)
def test_along_a_wave_its_invariant_and_the_entropy_stay(medium):
    for speed in (-40.0, 0.0, 120.0):
        after = medium.wave_state(STATE, speed)
        assert np.all(after.velocity == speed)
        if medium.isothermal:
            invariant = [s.velocity + sound(medium, s.temperature) * np.log(s.pressure) for s in (STATE, after)]
            np.testing.assert_allclose(after.temperature, STATE.temperature)
        else:
            invariant = [s.velocity + 2.0 * sound(medium, s.temperature) / (GAMMA - 1.0) for s in (STATE, after)]
            entropy = [s.pressure / s.temperature ** (GAMMA / (GAMMA - 1.0)) for s in (STATE, after)]
            np.testing.assert_allclose(*entropy, rtol=ROUNDING)
        np.testing.assert_allclose(*invariant, rtol=ROUNDING)
    close(medium.wave_state(STATE, STATE.velocity), STATE)
    assert float(medium.wave_state(STATE, 1e5).temperature[0]) > 0.0  # to a speed that no gas reaches


@pytest.mark.parametrize("medium", MEDIA)
def test_choked_gas_goes_at_its_own_speed_of_sound(medium):
    speed = medium.choked_exit_speed(STATE)
    leaving = medium.wave_state(STATE, speed)
    np.testing.assert_allclose(speed, sound(medium, leaving.temperature), rtol=ROUNDING)
    fast = STATE._replace(velocity=np.full(4, 900.0))
    np.testing.assert_allclose(medium.choked_exit_speed(fast), 900.0)
    entry = medium.choked_entry_speed(STATE.temperature, 280.0)
    drawn = medium.nozzle(STATE.pressure, STATE.temperature, 280.0, entry)
    np.testing.assert_allclose(
        np.broadcast_to(entry, 4), np.broadcast_to(sound(medium, drawn.temperature), 4), rtol=ROUNDING
    )


@pytest.mark.parametrize("medium", MEDIA)
def test_gas_that_enters_at_the_speed_of_sound_takes_what_the_drive_leaves(medium):
    entering, nozzle = STATE._replace(velocity=np.full(4, 250.0)), STATE._replace(pressure=STATE.pressure + 4e4)
    bore = OpenBore()
    left = bore.inward(medium, entering, nozzle, nozzle, 1e-5)
    np.testing.assert_allclose(bore.choked_pressure(medium, entering, left), nozzle.pressure, rtol=ROUNDING)
    restriction, more = Restriction(Orifice(conductance=2e-9, critical_ratio=0.35)), 30.0  # [kg/(m2 s)]
    taken = entering._replace(pressure=restriction.choked_pressure(medium, entering, more))
    flows = [medium.gas.density(s.pressure, s.temperature) * s.velocity for s in (entering, taken)]
    np.testing.assert_allclose(flows[1], flows[0] + more, rtol=ROUNDING)


@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_a_limited_slope_is_the_harmonic_mean_and_zero_at_an_extremum_at_any_scale(scale):
    before, after = (
        scale * np.array([1.0, 1.0, -2.0, 1.0, 0.0, 3.0]),
        scale * np.array([1.0, 3.0, -6.0, -1.0, 5.0, 0.0]),
    )
    np.testing.assert_allclose(limited(before, after), scale * np.array([1.0, 1.5, -3.0, 0.0, 0.0, 0.0]), rtol=1e-14)
    near, far = scale * np.array([1.0, 4.0, -4.0, 1.0, -1.0, 0.0]), scale * np.array([1.0, 1.0, -1.0, -1.0, 0.0, 1.0])
    np.testing.assert_allclose(_one_sided(near, far), scale * np.array([1.0, 3.0, -3.0, 0.0, 0.0, 0.0]), rtol=1e-14)


def test_a_straight_line_is_met_at_every_face_and_a_constant_is_kept():
    left, right = reconstruct(jnp.asarray([1.0, 3.0, 5.0, 7.0]))
    np.testing.assert_allclose(left, [0.0, 2.0, 4.0, 6.0])
    np.testing.assert_allclose(right, [2.0, 4.0, 6.0, 8.0])
    left, right = reconstruct(jnp.asarray([1.0, 2.0, 1.0, 2.0]))
    np.testing.assert_allclose(left, right)


def flux(medium, state):
    """Of the state itself: mass, momentum and energy that it carries."""
    density, momentum, energy = medium.conserved(state)
    return momentum, momentum * state.velocity + state.pressure, state.velocity * (energy + state.pressure)


@pytest.mark.parametrize("medium", MEDIA)
def test_between_equal_states_the_flux_is_theirs_and_a_mirror_turns_it(medium):
    close(hllc(medium, STATE, STATE), flux(medium, STATE))
    other = Primitive(STATE.pressure[::-1], STATE.velocity[::-1], STATE.temperature[::-1])
    mirrored = [s._replace(velocity=-s.velocity) for s in (other, STATE)]
    forth, back = hllc(medium, STATE, other), hllc(medium, *mirrored)
    close(forth, (-back.density, back.momentum, -back.energy))


@pytest.mark.parametrize("medium", MEDIA)
def test_faster_than_sound_only_what_comes_counts_and_a_contact_at_rest_stays(medium):
    fast = [s._replace(velocity=STATE.velocity + 900.0) for s in (STATE, STATE._replace(pressure=2.0 * STATE.pressure))]
    close(hllc(medium, *fast), flux(medium, fast[0]))
    back = [s._replace(velocity=-s.velocity) for s in fast]
    close(hllc(medium, *back), flux(medium, back[1]))
    warm, cold = (Primitive(np.array(2e5), np.array(0.0), np.array(t)) for t in (400.0, 200.0))
    close(hllc(medium, warm, cold), (0.0, 2e5, 0.0))


WALL = {"diameter": 4e-3, "roughness": 1e-6, "wall_temperature": 293.0, "friction_scale": 1.0}


def test_a_slow_flow_is_held_by_its_viscosity_alone_and_warmed_by_conduction():
    """Below the end of the laminar range: 32 mu/(rho D^2) [1/s], and 3.66 k/D over 4/D [W/(m^3 K)]."""
    state = Primitive(np.array([1e5, 3e5]), np.array([0.5, -0.2]), np.array([280.0, 300.0]))
    density, viscosity = state.pressure / (R * state.temperature), np.asarray(AIR.viscosity(state.temperature))
    rates = wall_rates(AIR, state, **WALL, heat=True)
    np.testing.assert_allclose(rates.friction, 32.0 * viscosity / (density * WALL["diameter"] ** 2), rtol=1e-12)
    per_kelvin = 4.0 * LAMINAR_NUSSELT * np.asarray(AIR.conductivity(state.temperature)) / WALL["diameter"] ** 2
    recovered = state.temperature + PRANDTL ** (1.0 / 3.0) * state.velocity**2 / (2.0 * CP)
    np.testing.assert_allclose(rates.heating, per_kelvin * (293.0 - recovered), rtol=1e-12)
    np.testing.assert_allclose(rates.exchange, per_kelvin / (density * CV), rtol=1e-12)
    cold = wall_rates(AIR, state, **WALL | {"friction_scale": 2.0}, heat=False)
    np.testing.assert_allclose(cold.friction, 2.0 * rates.friction, rtol=1e-12)
    assert np.all(cold.heating == 0.0) and np.all(cold.exchange == 0.0)


def test_a_fast_flow_is_held_by_its_turbulence_alone_either_way():
    state = Primitive(np.full(2, 5e5), np.array([100.0, -100.0]), np.full(2, 293.0))
    density, viscosity = 5e5 / (R * 293.0), float(AIR.viscosity(293.0))
    re, rough = density * 100.0 * WALL["diameter"] / viscosity, WALL["roughness"] / WALL["diameter"]
    rates = wall_rates(AIR, state, **WALL, heat=True)
    np.testing.assert_allclose(rates.friction, float(haaland(re, rough)) * 100.0 / (2.0 * WALL["diameter"]), rtol=1e-12)
    eighth = float(haaland(re, rough)) / 8.0  # Gnielinski
    known = eighth * (re - 1000.0) * 0.71 / (1.0 + 12.7 * np.sqrt(eighth) * (0.71 ** (2.0 / 3.0) - 1.0))
    np.testing.assert_allclose(nusselt(re, rough), known, rtol=1e-12)
    assert float(nusselt(500.0, rough)) == LAMINAR_NUSSELT
