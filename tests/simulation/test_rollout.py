"""A run under a policy as a function: its value is that of the steps, its gradient that of differences."""

import functools

import numpy as np
import pytest
from stepped_systems import joint

from mckibben.errors import InputError

PARAMETERS = {"gain": 1.0, "damping": 0.02}


def policy(parameters, seen):
    push = parameters["gain"] * (0.3 - seen.angle) - parameters["damping"] * seen.velocity
    return {"flexor": push, "extensor": -push}


def cost(seen, commands):
    return (seen.angle - 0.3) ** 2 + 1e-3 * commands["flexor"] ** 2


@functools.cache
def rollout():
    sim = joint()
    sim.reset(pressure="2 bar")
    return sim.rollout(policy, steps=40, cost=cost)


def test_a_rollout_is_the_mean_cost_of_the_steps_that_a_loop_takes():
    run = rollout()
    sim = run.simulation
    seen, prices = sim.reset(pressure="2 bar"), []
    for _ in range(run.steps):
        commands = policy(PARAMETERS, seen)
        seen = sim.step(**commands)
        prices.append(cost(seen, commands))
    sim.reset(pressure="2 bar")
    assert run(PARAMETERS) == pytest.approx(np.mean(prices), rel=1e-10)  # rounding of sums, and of the policy by XLA
    path, held = run.trajectory(PARAMETERS)
    assert path.angle[-1] == pytest.approx(seen.angle, rel=1e-9) and len(held["flexor"]) == 40  # likewise


def test_the_gradient_of_a_rollout_is_the_slope_of_its_differences():
    run = rollout()
    run.simulation.reset(pressure="2 bar")
    value, slope = run.value_and_grad(PARAMETERS)
    assert value == pytest.approx(run(PARAMETERS), rel=1e-12)  # rounding
    for name, step in (("gain", 1e-4), ("damping", 1e-5)):
        ends = [run({**PARAMETERS, name: PARAMETERS[name] + sign * step}) for sign in (1.0, -1.0)]
        # differences see the kinks of friction and choked flow between their ends, the derivative only its own side
        assert float(slope[name]) == pytest.approx((ends[0] - ends[1]) / (2.0 * step), rel=1e-3)


def test_a_policy_may_return_its_cost():
    sim = joint()
    seen = sim.reset(pressure="2 bar")
    run = sim.rollout(lambda gain, seen: ({"flexor": gain}, gain * (seen.angle + 1.0)), steps=1)
    assert run(0.5) == pytest.approx(0.5 * (seen.angle + 1.0), rel=1e-12)  # rounding


def test_a_policy_with_a_command_that_is_none_is_refused():
    run = joint().rollout(lambda parameters, seen: {"biceps": parameters}, steps=2, cost=cost)
    with pytest.raises(InputError, match="flexor"):
        run(1.0)
    with pytest.raises(InputError, match="whole number"):
        joint().rollout(policy, steps=0, cost=cost)
