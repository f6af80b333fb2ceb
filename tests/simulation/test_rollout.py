"""A run under a policy as a function: its value is that of the steps, its gradient that of differences."""

import dataclasses
import functools

import jax
import numpy as np
import pytest
from stepped_systems import weight

from mckibben.components import paths
from mckibben.errors import InputError

PARAMETERS = {"gain": 30.0, "damping": 2.0}
GOAL = 0.122  # [m]; it begins at 0.126


def policy(parameters, seen):
    return {"muscle": parameters["gain"] * (seen.position - GOAL) + parameters["damping"] * seen.velocity}


def cost(seen, commands):
    return 1e4 * (seen.position - GOAL) ** 2 + 1e-3 * commands["muscle"] ** 2


@functools.cache
def rollout():
    sim = weight()
    sim.reset()
    return sim.rollout(policy, steps=40, cost=cost)


def test_a_rollout_is_the_mean_cost_of_the_steps_that_a_loop_takes():
    run = rollout()
    sim = run.simulation
    seen, prices = sim.reset(), []
    for _ in range(run.steps):
        commands = policy(PARAMETERS, seen)
        seen = sim.step(**commands)
        prices.append(cost(seen, commands))
    sim.reset()
    assert run(PARAMETERS) == pytest.approx(np.mean(prices), rel=1e-10)  # rounding of sums, and of the policy by XLA
    path, held = run.trajectory(PARAMETERS)
    assert path.position[-1] == pytest.approx(seen.position, rel=1e-9) and len(held["muscle"]) == 40  # likewise


def test_the_gradient_of_a_rollout_is_the_slope_of_its_differences():
    run = rollout()
    run.simulation.reset()
    value, slope = run.value_and_grad(PARAMETERS)
    assert value == pytest.approx(run(PARAMETERS), rel=1e-12)  # rounding
    for name, step in (("gain", 1e-3), ("damping", 1e-4)):
        ends = [run({**PARAMETERS, name: PARAMETERS[name] + sign * step}) for sign in (1.0, -1.0)]
        # differences see the kinks of friction and choked flow between their ends, the derivative only its own side
        assert float(slope[name]) == pytest.approx((ends[0] - ends[1]) / (2.0 * step), rel=1e-3)


def test_the_gradient_by_the_machine_is_the_slope_of_machines_that_differ():
    run = rollout()
    run.simulation.reset()
    value, slope, by_machine = run.machine_gradient(PARAMETERS, ["load.mass", "muscle.law.stiffness_per_pressure"])
    plain, same = run.value_and_grad(PARAMETERS)
    assert value == pytest.approx(plain, rel=1e-12)  # rounding
    assert slope["gain"] == pytest.approx(same["gain"], rel=1e-3)  # rounding puts a kink of friction to either side
    start = run.simulation.save_state()
    for path, found in by_machine.items():
        ends, number = [], float(paths.get(run.simulation.machine, path))
        for sign in (1.0, -1.0):
            other = run.simulation.with_arrays({path: np.asarray(number * (1.0 + sign * 1e-5))})
            other.load_state(dataclasses.replace(start, structure=other.fingerprint))
            ends.append(other.rollout(policy, steps=40, cost=cost)(PARAMETERS))
        # as above, differences see kinks that the derivative does not
        assert float(found) == pytest.approx((ends[0] - ends[1]) / (2e-5 * number), rel=1e-3)
    with pytest.raises(InputError, match="Unknown names"):
        run.machine_gradient(PARAMETERS, ["biceps"])


def test_runs_that_are_mapped_over_are_those_of_each_alone():
    run = rollout()
    run.simulation.reset()
    gains = np.array([20.0, 30.0])
    costs = jax.vmap(lambda gain: run.as_function()({**PARAMETERS, "gain": gain}))(gains)
    alone = [run({**PARAMETERS, "gain": gain}) for gain in gains]
    assert np.asarray(costs) == pytest.approx(alone, rel=1e-10)  # rounding of sums, and of the policy by XLA


def test_a_policy_may_return_its_cost():
    sim = weight()
    seen = sim.reset()
    run = sim.rollout(lambda gain, seen: ({"muscle": gain}, gain * (seen.position + 1.0)), steps=1)
    assert run(0.5) == pytest.approx(0.5 * (seen.position + 1.0), rel=1e-12)  # rounding


def test_a_policy_with_a_command_that_is_none_is_refused():
    run = weight().rollout(lambda parameters, seen: {"biceps": parameters}, steps=2, cost=cost)
    with pytest.raises(InputError, match="muscle, force"):
        run(1.0)
    with pytest.raises(InputError, match="whole number"):
        weight().rollout(policy, steps=0, cost=cost)


@pytest.mark.parametrize(
    ("own", "said"),
    [
        (lambda parameters, seen: {"muscle": parameters}, r"must return \(commands, cost\)"),
        (lambda parameters, seen: None, r"must return \(commands, cost\)"),
        (lambda parameters, seen: (parameters, 0.0), "must return its commands by name"),
        (0.5, "must be a function"),
    ],
)
def test_a_policy_that_returns_something_else_is_refused_in_a_sentence(own, said):
    with pytest.raises(InputError, match=f"policy {said}"):
        weight().rollout(own, steps=1)(0.5)
