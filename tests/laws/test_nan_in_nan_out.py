"""What is no number makes none: a length, pressure, force or command of NaN is never answered by a number."""

import jax.numpy as jnp
import numpy as np
import pytest

from law_examples import example, examples
from mckibben import muscle
from mckibben.components.flow import GasState
from mckibben.components.module import flatten
from mckibben.errors import InputError
from mckibben.muscles.elements import KelvinVoigtChain, MaxwellChain, PassiveSpring, Tendon, Viscous
from mckibben.muscles.hysteresis import (
    HYSTERESES,
    BoucWen,
    Coulomb,
    Dahl,
    FrictionLimit,
    MaxwellSlip,
    PrandtlIshlinskii,
)
from mckibben.pneumatics.compressor import Compressor
from mckibben.pneumatics.orifice import Leak, Orifice
from mckibben.pneumatics.tubes import LumpedTube
from mckibben.pneumatics.valves import CheckValve, PressureRegulator, QuickExhaust, SpoolValve

NAN = float("nan")
QUESTIONS = ("tension", "volume", "stiffness", "braid_tension", "braid_volume", "braid_stiffness", "volume_change")
LIMIT = FrictionLimit(constant=0.5, per_pressure=4e-6)
FRICTIONS = {
    "coulomb": Coulomb(limit=LIMIT, smoothing_velocity=1e-3),
    "sharp coulomb": Coulomb(limit=LIMIT),
    "dahl": Dahl(limit=LIMIT, stiffness=2e3),
    "maxwell_slip": MaxwellSlip.geometric(LIMIT),
    "bouc_wen": BoucWen(limit=LIMIT, stiffness=2e3, share=0.7, exponent=1),
    "prandtl_ishlinskii": PrandtlIshlinskii(weight=[1e3, 50.0], threshold=[1e-4, 5e-3], threshold_per_pressure=[1e-9, 1e-8]),
}  # fmt: skip
SMALL, TINY = Orifice(conductance=3e-9), Orifice(conductance=1e-9)
ELEMENTS = {
    "orifice": SMALL,
    "leak": Leak.from_flow(2e-4, pressure=6e5),
    "check": CheckValve(passage=SMALL),
    "quick": QuickExhaust(feed=TINY, vent=SMALL, band=3e4),
    "spool": SpoolValve(fill=SMALL, vent=TINY, lag=3e-3, leakage=0.01, speed_limit=100.0),
    "regulator": PressureRegulator(fill=SMALL, relief=TINY, band=5e4, hysteresis=5e3, lag=5e-3),
    "compressor": Compressor(displacement=2e-5, speed=300.0, start_pressure=1.5e5, stop_pressure=2e5),
    "tube": LumpedTube(length=1.0, diameter=4e-3),
}


def lost(*values):
    """Whether at least one number of an answer is none."""
    return any(np.isnan(np.asarray(leaf, float)).any() for leaf in flatten(values)[0])


@pytest.mark.parametrize("question", QUESTIONS)
@pytest.mark.parametrize(
    "law", ["ideal", "thick_wall", "linear_threshold", "tondu_lopez", "martens_boblan", "hyperelastic_braid"]
)
def test_a_law_answers_a_nan_by_a_nan(law, question):
    ask = getattr(example(law), question)
    span = float(example(law).length_range()[1])
    for numbers in (np.array, jnp.array):  # by a kernel, and by JAX
        lengths, pressures = numbers([NAN, 0.9 * span, 0.9 * span, 1.2 * span]), numbers([3e5, NAN, 3e5, NAN])
        answer = np.asarray(ask(lengths, pressures))
        # A stiffness or volume may not depend on what is no number, as that of the threads does not on the pressure.
        assert np.isnan(answer[[0, 1]]).all(), answer
        assert np.isfinite(answer[2])
    assert np.isnan(ask(NAN, 3e5))


def test_seats_answer_a_nan_by_a_nan():
    law = examples()["seated_braid"]
    assert np.isnan(np.asarray(law.tension(jnp.array([NAN, 0.17]), jnp.array([3e5, NAN])))).all()


def test_a_state_of_a_nan_is_neither_slack_nor_overstretched():
    state = muscle("nylon").state(np.array([NAN, 0.12]), np.array([3e5, NAN]))
    for name in ("tension", "active", "volume", "stiffness"):
        assert np.isnan(getattr(state, name)).all(), (name, getattr(state, name))
    assert not state.slack.any()
    assert not state.overstretched.any()
    assert np.isnan(muscle("nylon").free_length(NAN))


def test_a_biological_muscle_answers_a_nan_by_a_nan():
    fibre = muscle("slow-fibre")
    length = fibre.rest_length
    for question in (fibre.tension, fibre.stiffness):
        assert np.isnan(question(np.array([NAN, length]), np.array([0.5, NAN]))).all()
    assert np.isnan(fibre.free_length(NAN))


@pytest.mark.parametrize("law", ["nylon", "slow-fibre"])
def test_no_pressure_is_sought_for_a_nan(law):
    subject = muscle(law)
    for force, span in ((NAN, 0.9 * subject.rest_length), (1.0, NAN)):
        with pytest.raises(InputError, match="got nan"):
            subject.pressure_for(force, span)
    assert subject.pressure_for(1.0, subject.rest_length) > 0.0


@pytest.mark.parametrize("name", FRICTIONS)
def test_a_friction_answers_a_nan_by_a_nan(name):
    friction = FRICTIONS[name]
    assert set(HYSTERESES) <= {word for key in FRICTIONS for word in (key, key.split()[-1])} | {"play"}
    assert lost(friction.largest_force(NAN)) or name == "prandtl_ishlinskii"
    pressed = {"start_pressure": 1e5, "end_pressure": 1e5, "duration": 1e-3}
    moved = friction.advance(friction.initial(), NAN, **pressed)
    assert lost(moved.work) and lost(moved.dissipated), moved
    assert lost(friction.force(moved.state, NAN, 1e5))
    pressed = friction.advance(friction.initial(), 1e-3, **(pressed | {"end_pressure": NAN}))
    assert lost(pressed, friction.force(pressed.state, 1e-3, NAN))


def test_creep_and_elements_answer_a_nan_by_a_nan():
    chains = (
        MaxwellChain.geometric(stiffness=1e3, shortest=0.1, longest=10.0),
        KelvinVoigtChain.geometric(compliance=1e-3, shortest=0.1, longest=10.0),
    )
    for chain in chains:
        assert lost(chain.advance(chain.initial(), NAN, duration=1e-3).state)
        assert lost(chain.advance(chain.initial(), 1.0, duration=NAN).work)
    tendon = Tendon(stiffness=1e5, loss=0.2, slack_length=0.1)
    assert lost(tendon.force(NAN, 0.0)) and lost(tendon.force(0.2, NAN)) and lost(tendon.stored_energy(NAN))
    assert lost(tendon.stretch(NAN))
    assert lost(PassiveSpring(rest_length=0.1, stiffness=1.0).force(NAN)) and lost(Viscous(damping=1.0).force(0.1, NAN))


@pytest.mark.parametrize("name", ELEMENTS)
def test_a_pneumatic_element_answers_a_nan_by_a_nan(name):
    element = ELEMENTS[name]
    pressures = [7e5, 3e5, 1e5][: len(element.ports)]
    state = element.initial()
    for place in range(len(pressures)):
        for bad in ("pressure_abs", "temperature"):
            gas = [GasState(jnp.asarray(p), jnp.asarray(293.15)) for p in pressures]
            sound = tuple(gas)
            memory = element.initial_memory(sound)
            gas[place] = gas[place]._replace(**{bad: jnp.asarray(NAN)})
            if bad == "temperature" and place == len(pressures) - 1:
                continue  # the gas that leaves does not carry the temperature where it goes
            answer = element.flows(tuple(gas), state, memory, 0.7), element.rates(tuple(gas), state, memory, 0.7)
            assert lost(answer), (name, place, bad, answer)
    if element.commanded or element.command_unit != "1":
        gas = tuple(GasState(jnp.asarray(p), jnp.asarray(293.15)) for p in pressures)
        memory = element.initial_memory(gas)
        assert lost(element.flows(gas, state, memory, NAN), element.rates(gas, state, memory, NAN)), name
