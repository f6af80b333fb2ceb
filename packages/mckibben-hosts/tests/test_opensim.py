"""Muscles beside those of OpenSim: the same motion as a loop of ours, equal bits in saved states, and what is refused."""

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben_hosts.conformance import STATE_CHECKS, adapter
from mckibben_hosts.scenarios import scenario

pytest.importorskip("opensim", reason="OpenSim is not installed")
STEP, COUNT = 1e-3, 80


@pytest.fixture(scope="module")
def host():
    opened = adapter("opensim")
    yield opened
    opened.close()


def test_opensim_moves_a_weight_as_a_loop_with_mean_accelerations_does(host):
    one = scenario("hang")
    hosted = host.open(one, STEP)
    state, span, rate = one.part.rest(**one.first_commands()), one.mechanism.start, 0.0
    for moment in one.moments(STEP, staggered=False)[:COUNT]:
        readings = hosted.step(moment)
        state, seen = one.part.step(state, period=STEP, span=span, rate=rate, **moment.commands)
        before = rate
        rate += STEP * one.mechanism.acceleration({"muscle": seen.tension}, moment.force)
        span += 0.5 * STEP * (before + rate)
    assert abs(span - one.mechanism.start) > 5e-3
    # under constant forces OpenSim's Runge-Kutta method is exact; lengths of paths are roots of sums of squares
    assert hosted.position == pytest.approx(span, abs=1e-9)
    assert readings.tension["muscle"] == pytest.approx(seen.tension, abs=1e-4)  # 1e-9 m on a cord of 1e5 N/m


def test_states_of_opensim_keep_their_bits_when_saved_copied_and_reset(host):
    assert {name: check(host) for name, check in STATE_CHECKS.items()} == dict.fromkeys(STATE_CHECKS, True)


def test_a_slack_muscle_gives_no_force_where_opensims_own_actuator_pushes(host):
    """p b^2 (3 L^2/b^2 - 1) / (4 pi n^2) of the ideal law, which that actuator has without an end at zero."""
    own, b, n = host.own_actuator(), 0.30, 1.5
    ideal = 5e5 * b**2 / (4.0 * np.pi * n**2) * (3.0 * (own.span / b) ** 2 - 1.0)
    assert own.own_tension == pytest.approx(ideal, rel=1e-9)  # rounding; -397.9 N
    assert own.own_tension < -397.0 and own.tension == 0.0


def test_a_muscle_without_a_path_is_refused():
    import opensim

    from mckibben_hosts.opensim import CoSimulation

    part = scenario("hang").part
    for actuators, sentence in (({}, "missing for the muscle muscle"), ({"muscle": "pam"}, "pam")):
        with pytest.raises(InputError, match=sentence):
            CoSimulation(opensim.Model(), part, actuators)
