"""A mounted muscle at any moment, without a run: what its end takes is stored, goes into the braid or is lost."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.assembly.build import unit_from_specimen
from mckibben.assembly.muscle_unit import RETURN_RATE, TiedState, UnitState
from mckibben.muscles.elements import Tendon

TENDON = Tendon(stiffness=1e5, toe_length=5e-4, loss=0.2)
CORDED = unit_from_specimen("nylon", tendon=TENDON, end_mass=0.05).replace(viscosity=jnp.asarray(3.0))
TIED = unit_from_specimen("nylon").replace(viscosity=jnp.asarray(3.0))
CHANCE = np.random.default_rng(8)
# span [m] and its rate [m/s], length beyond the span [m] and its rate [m/s], gauge pressure [Pa]
ENDS = ((0.10, 0.165), (-0.5, 0.5), (-3e-3, 3e-3), (-0.5, 0.5), (0.0, 5e5))
MOMENTS = [tuple(float(CHANCE.uniform(*ends)) for ends in ENDS) for _ in range(12)]


@pytest.mark.parametrize("moment", MOMENTS)
def test_what_a_tendon_takes_goes_into_braid_mass_and_heat(moment):
    span, rate, beyond, velocity, pressure = moment
    memory = CORDED.initial_memory()
    state = UnitState(jnp.asarray(span + beyond), jnp.asarray(velocity))
    motion = CORDED.motion(state, memory, pressure, span, rate)
    assert (float(motion.length), float(motion.velocity)) == (span + beyond, velocity)
    assert float(motion.tension) >= 0.0 and (beyond < 0.0 or float(motion.tension) == 0.0)
    assert float(motion.tension) == float(CORDED.tension(state, memory, pressure, span, rate))
    changes = CORDED.rate(state, motion, rate)
    stored = jax.jvp(CORDED.kinetic_and_elastic, (state, jnp.asarray(span)), (changes, jnp.asarray(rate)))[1]
    taken, given = motion.tension * rate, motion.inner * velocity
    lost = CORDED.lost(motion, span, rate)
    size = abs(float(taken)) + abs(float(given)) + abs(float(lost))
    assert float(lost) >= 0.0
    assert float(stored) == pytest.approx(float(taken - given - lost), abs=1e-9 * size)  # rounding
    force = CORDED.law.braid_tension(span + beyond, pressure) + CORDED.memory_force(memory, velocity, pressure)
    assert float(motion.inner) == pytest.approx(float(force), rel=1e-12)


@pytest.mark.parametrize("moment", MOMENTS)
def test_a_tied_muscle_loses_what_its_end_takes_and_its_braid_does_not(moment):
    span, rate, beyond, _, pressure = moment
    memory, sag = TIED.initial_memory(), max(beyond, 0.0)
    state = TiedState(jnp.asarray(sag))
    motion = TIED.motion(state, memory, pressure, span, rate)
    lost = float(TIED.lost(motion, span, rate))
    assert lost == pytest.approx(float(motion.tension * rate - motion.inner * motion.velocity), rel=1e-12)
    assert lost >= -1e-12 * abs(float(motion.inner * motion.velocity))
    assert float(motion.length) == span + sag == float(TIED.length(state, span))
    assert float(TIED.kinetic_and_elastic(motion, span)) == 0.0
    sagging = float(TIED.rate(state, motion, rate).sag)
    assert sagging == pytest.approx(float(motion.velocity) - rate, rel=1e-12)
    if sag > 0.0:
        assert float(motion.tension) == 0.0  # what is slack pulls nothing
        # and its braid goes where its own force pulls it, or rests
        assert float(motion.velocity) * float(motion.inner) <= 0.0
    elif float(motion.tension) > 0.0:
        assert sagging == -RETURN_RATE * sag
        braid = float(TIED.law.braid_tension(span, pressure) + TIED.memory_force(memory, rate, pressure))
        assert float(motion.tension) <= braid + float(TIED.damping(span)) * rate + 1e-9


def test_the_damping_rises_beyond_the_longest_length_to_that_of_the_stop_and_no_further():
    longest, travel = float(TIED.law.length_range()[1]), float(TIED.stop_travel)
    least, most = float(TIED.viscosity), float(TIED.viscosity) + float(TIED.stop_damping)
    found = [float(TIED.damping(longest + share * travel)) for share in (-1.0, 0.0, 0.5, 1.0, 2.0)]
    assert found == pytest.approx([least, least, least + 0.25 * (most - least), most, most], rel=1e-9)
    assert float(TIED.breaking_length()) == pytest.approx((1.0 + float(TIED.largest_strain)) * longest, rel=1e-12)


@pytest.mark.parametrize("pressure", [1e5, 4e5])
def test_a_muscle_at_rest_balances_what_holds_it(pressure):
    for span in (0.125, 0.138):
        for unit in (CORDED, TIED):
            at = unit.equilibrium(span, pressure)
            state, memory = unit.resting(at, span), unit.initial_memory()
            motion = unit.motion(state, memory, pressure, span, 0.0)
            assert float(motion.tension) == pytest.approx(float(unit.law.tension(at.length, pressure)), rel=1e-6)
            rates = jax.tree.leaves(unit.rate(state, motion, 0.0))
            assert max(abs(float(x)) for x in rates) < 1e-3  # m/s^2 of a force to 1e-10 of 100 N on 50 g; m/s of a sag
    assert "tied to its anchors" == TIED.mounting and CORDED.mounting.startswith("by a tendon of 1")
