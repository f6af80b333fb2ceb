"""Environments of Gymnasium: its rules, equal bits alone and in lanes, and lanes that end."""

import functools

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import mckibben_hosts.gymnasium as environments
from mckibben.errors import InputError

LIFT = "mckibben/Lift-v0"


@functools.cache
def lift():
    """A single environment, which several tests share."""
    return environments.MuscleEnv(LIFT)


def same(first, second):
    """Whether two results of a step or two pieces of information are equal, bit for bit."""
    if isinstance(first, dict):
        return first.keys() == second.keys() and all(same(first[k], second[k]) for k in first)
    if isinstance(first, tuple):
        return len(first) == len(second) and all(map(same, first, second))
    first, second = np.asarray(first), np.asarray(second)
    if first.dtype == object:
        return all(map(same, first, second))
    return first.dtype == second.dtype and np.array_equal(first, second)


def test_the_checker_of_gymnasium_finds_nothing():
    check_env(gymnasium.make(LIFT, render_mode="rgb_array").unwrapped)


@pytest.mark.slow
@pytest.mark.parametrize("name", [name for name in environments.TASKS if name != LIFT])
def test_the_checker_of_gymnasium_finds_nothing_in_the_other_tasks(name):
    check_env(gymnasium.make(name, render_mode="rgb_array").unwrapped)


@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_lanes_are_single_environments_bit_for_bit_through_resets(mode):
    lanes, limit = 3, 6
    many = gymnasium.make_vec(LIFT, num_envs=lanes, max_episode_steps=limit, autoreset_mode=mode)
    one = functools.partial(gymnasium.make, LIFT, max_episode_steps=limit)
    each = SyncVectorEnv([one] * lanes, autoreset_mode=mode)
    assert many.metadata["autoreset_mode"] == each.metadata["autoreset_mode"]
    assert many.observation_space == each.observation_space and many.action_space == each.action_space
    assert same(many.reset(seed=7), each.reset(seed=7))
    random = np.random.default_rng(0)
    for _ in range(2 * limit + 3):
        actions = random.uniform(-1.0, 1.0, (lanes, 1)).astype(np.float32)
        ours, theirs = many.step(actions), each.step(actions)
        assert same(ours[:4], theirs[:4])
        for key, value in theirs[4].items():  # ours states an error for all lanes, and which of them have one
            assert same(ours[4][key], value), key


def test_the_same_seed_draws_the_same_goals_and_another_seed_others():
    env = lift()
    first, again, other = (env.reset(seed=s)[0] for s in (5, 5, 6))
    assert np.array_equal(first, again) and first[3] != other[3]


def test_lanes_that_are_reset_by_a_mask_leave_the_others_as_they_are():
    many = environments.MuscleVectorEnv(3, LIFT, autoreset_mode="Disabled", max_episode_steps=4)
    start, _ = many.reset(seed=1)
    for _ in range(4):
        seen, _, _, truncated, _ = many.step(np.ones((3, 1)))
    assert truncated.all()
    with pytest.raises(InputError, match="reset_mask"):
        many.step(np.ones((3, 1)))
    after, _ = many.reset(seed=1, options={"reset_mask": np.array([True, False, True])})
    assert np.array_equal(after[[0, 2]], start[[0, 2]]) and np.array_equal(after[1], seen[1])


def test_a_lane_that_cannot_go_on_is_truncated_alone_and_says_why():
    many = environments.MuscleVectorEnv(3, LIFT)
    many.reset(seed=0)
    kernel = many._kernel
    kernel.put_carry(np.array([1]), np.full_like(kernel.carry[:, 1], np.nan), kernel.observation[:, 1].copy())
    seen, rewards, terminated, truncated, infos = many.step(np.zeros((3, 1)))
    assert truncated.tolist() == [False, True, False] and not terminated.any()
    assert np.isfinite(seen).all() and rewards[1] == -100.0
    assert "not finite" in infos["message"][1] and infos["_message"].tolist() == [False, True, False]
    seen, rewards, _, truncated, infos = many.step(np.zeros((3, 1)))
    assert not truncated.any() and rewards[1] == 0.0 and infos["_error"].tolist() == [True, False, True]


def test_an_environment_that_cannot_go_on_is_truncated_and_says_why():
    env = lift()
    env.reset(seed=0)
    env.unwrapped._kernel.set_carry(*(np.full_like(x, np.nan) for x in env.unwrapped._plant.start))
    _, reward, terminated, truncated, info = env.step(np.zeros(1))
    assert truncated and not terminated and reward == -100.0 and "not finite" in info["message"]


def test_the_reward_is_the_error_in_tolerances_and_the_opening_of_the_valve():
    env = lift()
    env.reset(seed=2)
    _, reward, terminated, truncated, info = env.step(np.array([0.5]))
    wanted = -info["error"] / env.task.tolerance - 0.02 * 0.5
    assert reward == pytest.approx(wanted, rel=1e-12)  # rounding
    assert not terminated and not truncated


def test_an_observation_is_its_quantities_in_their_ranges():
    env = lift()
    seen, _ = env.reset(seed=2)
    senses = env.task.senses
    position = senses[0].low + 0.5 * (seen[0] + 1.0) * (senses[0].high - senses[0].low)
    assert position == pytest.approx(0.13, rel=1e-6)  # float32
    assert all(-1.0 < value < 1.0 for value in seen)


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: environments.MuscleEnv("mckibben/Jump-v0"), "mckibben/Lift-v0"),
        (lambda: environments.MuscleEnv(LIFT, render_mode="human"), "rgb_array"),
        (lambda: environments.MuscleVectorEnv(0), "1 or more"),
        (lambda: environments.MuscleVectorEnv(2).reset(seed=[1]), "2 of them"),
        (lambda: environments.MuscleVectorEnv(2).reset(options={"reset_mask": np.ones(3, bool)}), "2 booleans"),
    ],
)
def test_what_does_not_fit_is_refused(call, word):
    with pytest.raises(InputError, match=word):
        call()
