"""Environments of Gymnasium: its rules, equal bits alone and in lanes, and lanes that end."""

import copy
import functools
import pickle
import subprocess
import sys

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv

import mckibben_hosts.gymnasium as environments
from learned_muscle import learned_muscle
from mckibben.errors import InputError
from mckibben.simulation import Weight
from mckibben_hosts.gymnasium.tasks import LiftTask

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


class LearnedLift(LiftTask):
    """The muscle that lifts has learned what its law leaves."""

    def __init__(self, file):
        self.file = file

    def system(self):
        return Weight(self.file, mass="3 kg", start="13 cm", damping="5 N*s/m")


@pytest.mark.parametrize("muscle", ["nylon", "learned"])
@pytest.mark.parametrize("mode", [AutoresetMode.NEXT_STEP, AutoresetMode.SAME_STEP])
def test_lanes_are_single_environments_bit_for_bit_through_resets(mode, muscle, tmp_path):
    lanes, limit = 3, 6
    task = LIFT if muscle == "nylon" else LearnedLift(learned_muscle(tmp_path))
    many = gymnasium.make_vec(LIFT, num_envs=lanes, max_episode_steps=limit, autoreset_mode=mode, task=task)
    one = functools.partial(gymnasium.make, LIFT, max_episode_steps=limit, task=task)
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
    env.unwrapped._kernel.set_carry(*(np.full_like(x, np.nan) for x in env.unwrapped._plant.start(0)))
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


DIFFERS = {
    "vary": {"units.*.law.rest_length": "2 %", "load.mass": ("2 kg", "4 kg")},
    "noise": {"position": "0.2 mm"},
    "offset": {"position": "+-1 mm"},
    "delay": (0, 3),
    "plants": 5,
}


def test_lanes_with_their_own_plants_sensors_and_delays_are_single_environments_bit_for_bit():
    many = gymnasium.make_vec(LIFT, num_envs=3, max_episode_steps=6, autoreset_mode="SameStep", **DIFFERS)
    each = [gymnasium.make(LIFT, max_episode_steps=6, **DIFFERS) for _ in range(3)]
    seen, about = many.reset(seed=3)
    alone = [env.reset(seed=3 + k) for k, env in enumerate(each)]
    assert same(seen, np.array([one for one, _ in alone])) and about["plant"].tolist() == [i["plant"] for _, i in alone]
    random = np.random.default_rng(0)
    for _ in range(5):
        actions = random.uniform(-1.0, 1.0, (3, 1)).astype(np.float32)
        ours, theirs = many.step(actions), [env.step(action) for env, action in zip(each, actions, strict=True)]
        assert same(ours[0], np.array([one[0] for one in theirs])) and same(ours[1], np.array([t[1] for t in theirs]))
    many.step(actions)  # each lane begins again, with a plant, an offset and a delay drawn anew
    again = [env.reset()[1]["plant"] for env in each]
    assert many.unwrapped._which.tolist() == again


def test_a_plant_of_an_environment_is_the_simulation_with_its_numbers():
    env = environments.MuscleEnv(LIFT, vary=DIFFERS["vary"], plants=4)
    _, about = env.reset(seed=8)
    numbers = {path: values[about["plant"]] for path, values in env.plants.items()}
    assert set(numbers) == {"units.muscle.law.rest_length", "load.mass"}
    sim = env.task.simulation().with_parameters(numbers)
    sim.reset(pressure=env.task.pressure)
    for _ in range(10):
        env.step(np.array([0.4]))
        seen = sim.step(muscle=0.4)
    assert env._seen()["position"] == seen.position and env._seen()["pressure"] == seen.pressure


def test_an_action_acts_after_its_delay():
    at_once, late = environments.MuscleEnv(LIFT), environments.MuscleEnv(LIFT, delay=2)
    for env in (at_once, late):
        env.reset(seed=0)
    late.step(np.ones(1)), late.step(np.ones(1))
    held = [late._seen()["pressure"]]
    late.step(np.zeros(1))
    at_once.step(np.zeros(1)), at_once.step(np.zeros(1))
    assert held == [at_once._seen()["pressure"]]
    at_once.step(np.ones(1))
    assert late._seen()["pressure"] == at_once._seen()["pressure"] > held[0] + 1e3


def test_environments_and_their_lanes_are_copied_and_pickled_at_any_moment():
    for env, action in (
        (environments.MuscleEnv(LIFT, **DIFFERS), 1),
        (environments.MuscleVectorEnv(3, LIFT, **DIFFERS), 3),
    ):
        env.reset(seed=1)
        actions = np.full((action, 1), 0.3)
        env.step(actions)
        others = copy.deepcopy(env), pickle.loads(pickle.dumps(env))
        after = env.step(actions)
        assert all(same(after[:4], other.step(actions)[:4]) for other in others)


def test_a_fresh_process_makes_an_environment_by_the_module_before_its_name():
    code = "import gymnasium; print(gymnasium.make('mckibben_hosts.gymnasium:mckibben/Lift-v0').spec.id)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == LIFT


@pytest.mark.filterwarnings("ignore:os.fork:RuntimeWarning")  # of JAX, which the child does not use
def test_processes_that_are_forked_or_spawned_after_a_step_go_on():
    env = lift()
    env.reset(seed=0)
    env.step(np.zeros(1))
    for context in ("fork", "spawn"):
        lanes = gymnasium.vector.AsyncVectorEnv([_made] * 2, context=context)
        try:
            lanes.reset(seed=0)
            lanes.step_async(np.zeros((2, 1)))
            assert np.isfinite(lanes.step_wait(timeout=120.0)[1]).all()
        finally:
            lanes.close(terminate=True)


def _made():
    return gymnasium.make("mckibben_hosts.gymnasium:mckibben/Lift-v0")


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda: environments.MuscleEnv(LIFT, vary={"load.masss": "5 %"}), "load.mass"),
        (lambda: environments.MuscleEnv(LIFT, vary={"load.mass": "5 bar"}), "range of two ends"),
        (lambda: environments.MuscleEnv(LIFT, vary={"load.mass": ("-1 kg", "1 kg")}), "between"),
        (lambda: environments.MuscleEnv(LIFT, vary={"load.stiffness": "5 %"}), "nothing of 0"),
        (lambda: environments.MuscleEnv(LIFT, noise={"angle": 0.1}), "position"),
        (lambda: environments.MuscleEnv(LIFT, delay=(3, 1)), "control periods"),
        (lambda: environments.MuscleEnv(LIFT, muscles={"no_such": np.ones(3)}), "no_such"),
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
