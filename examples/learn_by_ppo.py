"""Train policies by proximal policy optimisation (PPO) on environments of muscles, with JAX alone.

    python examples/learn_by_ppo.py [Lift Joint Reach Pressure] [--varied] [--iterations 150] [--seed 0] [--out FOLDER]

With --varied each task is learned twice, on the nominal plant and on plants that differ from episode to episode, and both
policies are judged on 50 plants that neither has seen; drawn is what each does on its best, median and worst one.
Prints the mean error while training, at the end that of the trained policy without noise on 256 new episodes, and that
of valves which stay shut; draws the learning curves. Ctrl-C ends the training of a task; what was learned is evaluated.

J. Schulman et al., Proximal Policy Optimization Algorithms, 2017, arXiv:1707.06347; advantages as in J. Schulman et al.,
High-Dimensional Continuous Control Using Generalized Advantage Estimation, 2016, arXiv:1506.02438.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

import gymnasium
import jax
import jax.numpy as jnp
import numpy as np

import mckibben as mk
import mckibben_hosts.gymnasium
from mckibben.quantities import from_si, shown_unit, with_unit
from mckibben_hosts.gymnasium import PERIOD

LANES, STEPS = 128, 50  # samples of an iteration: 128 lanes of a quarter of an episode
QUARTERS = 4  # of an episode
# What differs: muscles and their friction, the valves' flows, what they move, and the delay of an action.
VARIED = {
    "units.*.law.rest_length": "2 %",
    "units.*.law.stiffness_per_pressure": "10 %",
    "units.*.friction.limit.*": "30 %",
    "circuit.elements.*.valve.*.conductance": "15 %",
}
MOVED = {"Lift": {"load.mass": "20 %"}, "Joint": {"load.inertia": "20 %"}}
UNSEEN, EPISODES = 50, 8  # plants, and episodes of each
EPOCHS, PARTS = 6, 8  # passes over them, each in 8 parts
DISCOUNT, TRACE, CLIP = 0.97, 0.95, 0.2
RATE, WIDTH = 1e-3, 64


def begin(random: np.random.Generator, senses: int, actions: int) -> dict:
    """Parameters of the policy's and the value's networks: two hidden layers each."""

    def network(outputs: int, last: float) -> list:
        sizes = (senses, WIDTH, WIDTH, outputs)
        gains = (1.0, 1.0, last)
        return [
            (random.normal(0.0, gain / np.sqrt(n), (n, m)), np.zeros(m))
            for n, m, gain in zip(sizes[:-1], sizes[1:], gains, strict=True)
        ]

    return {"policy": network(actions, 0.1), "value": network(1, 1.0), "spread": np.full(actions, -0.7)}


def network(layers: list, x: jax.Array) -> jax.Array:
    """Outputs of a network with tanh between its layers."""
    for weights, bias in layers[:-1]:
        x = jnp.tanh(x @ weights + bias)
    weights, bias = layers[-1]
    return x @ weights + bias


def log_density(parameters: dict, seen: jax.Array, action: jax.Array) -> jax.Array:
    """Logarithm of the probability density of actions."""
    spread = parameters["spread"]
    z = (action - network(parameters["policy"], seen)) / jnp.exp(spread)
    return -jnp.sum(0.5 * z * z + spread, axis=-1)


@jax.jit
def act(parameters: dict, seen: jax.Array, key: jax.Array) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Actions drawn from the policy, the logarithms of their densities, and values of the states."""
    middle = network(parameters["policy"], seen)
    action = middle + jnp.exp(parameters["spread"]) * jax.random.normal(key, middle.shape)
    return action, log_density(parameters, seen, action), network(parameters["value"], seen)[:, 0]


def loss(parameters: dict, part: tuple) -> jax.Array:
    """Clipped surrogate of the policy, squared error of the value, and a little entropy."""
    seen, action, before, advantage, target = part
    ratio = jnp.exp(log_density(parameters, seen, action) - before)
    gain = jnp.minimum(ratio * advantage, jnp.clip(ratio, 1.0 - CLIP, 1.0 + CLIP) * advantage)
    error = network(parameters["value"], seen)[:, 0] - target
    return -jnp.mean(gain) + 0.5 * jnp.mean(error * error) - 1e-3 * jnp.sum(parameters["spread"])


@partial(jax.jit, static_argnums=4)
def improve(parameters: dict, moments: tuple, samples: tuple, key: jax.Array, size: int) -> tuple[dict, tuple]:
    """All passes over the samples of an iteration, by Adam."""

    def one(carry: tuple, chosen: jax.Array) -> tuple[tuple, None]:
        parameters, (mean, square, count) = carry
        slope = jax.grad(loss)(parameters, tuple(x[chosen] for x in samples))
        norm = jnp.sqrt(sum(jnp.sum(g * g) for g in jax.tree.leaves(slope)))
        slope = jax.tree.map(lambda g: g * jnp.minimum(1.0, 0.5 / norm), slope)
        mean = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, mean, slope)
        square = jax.tree.map(lambda s, g: 0.999 * s + 0.001 * g * g, square, slope)
        count = count + 1
        a, b = 1.0 - 0.9**count, 1.0 - 0.999**count
        moved = jax.tree.map(lambda p, m, s: p - RATE * (m / a) / (jnp.sqrt(s / b) + 1e-8), parameters, mean, square)
        return (moved, (mean, square, count)), None

    orders = [jax.random.permutation(k, size).reshape(PARTS, -1) for k in jax.random.split(key, EPOCHS)]
    (parameters, moments), _ = jax.lax.scan(one, (parameters, moments), jnp.concatenate(orders))
    return parameters, moments


def advantages(rewards: np.ndarray, values: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Generalised advantage estimates (steps, lanes); `values` has one row more, `ends` ends an episode."""
    estimate = np.zeros_like(rewards)
    running = np.zeros(rewards.shape[1])
    for k in reversed(range(len(rewards))):
        going_on = 1.0 - ends[k]
        running = rewards[k] + DISCOUNT * going_on * values[k + 1] - values[k] + DISCOUNT * TRACE * going_on * running
        estimate[k] = running
    return estimate


def differing(task: str, varied: bool, plants_seed: int) -> dict:
    """What an environment is told of plants that differ."""
    return {"vary": VARIED | MOVED.get(task, {}), "delay": (0, 1), "plants_seed": plants_seed} if varied else {}


class Evaluation(NamedTuple):
    """Episodes of new seeds under a policy.

    Attributes:
        error: mean of each episode (episodes,), in the unit of the task.
        plant: which one each episode has (episodes,).
        motion: first wanted quantity and its goal (samples, 2, episodes), in the unit of the label.
        label: of the motion, for an axis.
        unit: of the error.
    """

    error: np.ndarray
    plant: np.ndarray
    motion: np.ndarray
    label: str
    unit: str


def evaluate(task: str, policy: object, episodes: int = 256, **differs: object) -> Evaluation:
    """Carry out episodes of new seeds."""
    env = gymnasium.make_vec(f"mckibben/{task}-v0", num_envs=episodes, **differs)
    of, (seen, about) = env.unwrapped.task, env.reset(seed=1_000_000)
    names = [sense.name for sense in of.senses]
    places = names.index(of.wanted[0]), next(k for k, name in enumerate(names) if name.startswith("goal"))
    sense = of.senses[places[0]]
    errors, motion = [], []
    for _ in range(of.samples):
        seen, _, _, _, info = env.step(np.asarray(policy(seen)))
        errors.append(info["error"])
        motion.append(sense.low + 0.5 * (seen[:, places].T + 1.0) * (sense.high - sense.low))
    plant, shown = about.get("plant", np.zeros(episodes, int)), shown_unit(sense.unit)
    moved = from_si(1.0, sense.unit, shown) * np.array(motion)
    return Evaluation(np.mean(errors, axis=0), plant, moved, f"{sense.name} ({shown})", of.error_unit)


def train(task: str, iterations: int, seed: int, varied: bool = False) -> tuple[dict, list[tuple[int, float, float]]]:
    """Parameters of the trained policy, and rows of the learning curve: control steps, seconds, mean error."""
    env = gymnasium.make_vec(
        f"mckibben/{task}-v0", num_envs=LANES, autoreset_mode="SameStep", **differing(task, varied, 0)
    )
    random, key = np.random.default_rng(seed), jax.random.PRNGKey(seed)
    parameters = begin(random, env.single_observation_space.shape[0], env.single_action_space.shape[0])
    zeros = jax.tree.map(np.zeros_like, parameters)
    moments = (zeros, zeros, 0)
    seen, _ = env.reset(seed=seed)
    curve, started = [], time.monotonic()
    try:
        for iteration in range(1, iterations + 1):
            kept: list[tuple] = []
            errors = []
            for _ in range(STEPS):
                key, own = jax.random.split(key)
                action, density, value = (np.asarray(x) for x in act(parameters, seen, own))
                after, reward, ended, cut, info = env.step(action)
                kept.append((seen, action, density, value, reward * (1.0 - DISCOUNT), ended | cut))
                errors.append(info["error"][info["_error"]])
                seen = after
            last = np.asarray(act(parameters, seen, key)[2])
            looks, actions, densities, values, rewards, ends = (np.array(x) for x in zip(*kept, strict=True))
            estimate = advantages(rewards, np.vstack([values, last]), ends)
            target = estimate + values
            scaled = (estimate - estimate.mean()) / (estimate.std() + 1e-8)
            samples = tuple(x.reshape(-1, *x.shape[2:]) for x in (looks, actions, densities, scaled, target))
            key, own = jax.random.split(key)
            parameters, moments = improve(parameters, moments, samples, own, STEPS * LANES)
            curve.append(
                (iteration * STEPS * LANES, time.monotonic() - started, float(np.mean(np.concatenate(errors))))
            )
            if iteration % 10 == 0:
                steps, seconds, error = curve[-1]
                print(f"  {steps:>9,} control steps  {seconds:6.1f} s  mean error {error:.4g}", flush=True)
    except KeyboardInterrupt:
        print("Stopped; what was learned so far is evaluated.")
    return parameters, curve


def draw(curves: dict[str, tuple[list[tuple[int, float, float]], float, str]], folder: Path) -> None:
    """Write the learning curves: error in the unit of the task, over control steps, with the error of shut valves."""
    import matplotlib.pyplot as plt

    with mk.figure_style("screen"):
        figure, axes = plt.subplots(
            1, len(curves), figsize=(2.6 * len(curves), 2.4), squeeze=False, layout="constrained"
        )
        for ax, (task, (curve, shut, unit)) in zip(axes[0], curves.items(), strict=True):
            whole = (
                np.array(curve)[: len(curve) // QUARTERS * QUARTERS].reshape(-1, QUARTERS, 3).mean(1)
            )  # whole episodes
            steps, _, errors = whole.T
            ax.semilogy(steps / 1e3, errors)
            ax.axhline(shut, color="0.5", lw=0.8, ls="--")
            ax.set(title=task, xlabel="control steps (thousand)", ylabel=f"mean error ({unit})", xlim=(0, None))
        mk.save_figure(figure, folder / "learn-by-ppo.svg")


def draw_plants(task: str, judged: dict[bool, Evaluation], folder: Path) -> None:
    """Draw what each policy does on the plant on which its mean error is least, median and largest: one episode each."""
    import matplotlib.pyplot as plt

    with mk.figure_style("screen"):
        figure, axes = plt.subplots(
            len(judged), 3, figsize=(7.4, 3.6), sharex=True, sharey=True, squeeze=False, layout="constrained"
        )
        for row, (kind, one) in zip(axes, judged.items(), strict=True):
            plants = np.unique(one.plant)
            each = np.array([one.error[one.plant == k].mean() for k in plants])
            order = np.argsort(each)
            for ax, words, k in zip(row, ("best", "median", "worst"), order[[0, len(order) // 2, -1]], strict=True):
                episode = np.flatnonzero(one.plant == plants[k])
                # of its episodes the one whose error is nearest to their mean
                episode = episode[np.argmin(np.abs(one.error[episode] - each[k]))]
                # the last observation is the first one of the next episode's goal
                time = np.arange(1, len(one.motion)) * PERIOD
                ax.plot(time, one.motion[:-1, 1, episode], color="0.5", lw=0.8, ls="--")
                ax.plot(time, one.motion[:-1, 0, episode])
                trained = "varied" if kind else "nominal"
                ax.set_title(f"{trained}, {words} plant: {with_unit(each[k], one.unit, 2)}", fontsize="small")
        for ax in axes[-1]:
            ax.set_xlabel("time (s)")
        figure.supylabel(one.label, fontsize="small")
        mk.save_figure(figure, folder / f"policies-on-plants-{task.lower()}.svg")


def main(
    folder: Path, tasks: Sequence[str] = ("Lift",), iterations: int = 150, seed: int = 0, varied: bool = False
) -> None:
    """Train policies, print their errors, and draw the learning curves."""
    curves = {}
    for task in tasks:
        print(f"{task}:")
        policies = {}
        for kind in (False, True) if varied else (False,):
            parameters, curve = train(task, iterations, seed, kind)
            policies[kind] = jax.jit(partial(network, parameters["policy"]))
            if not kind:
                moved = evaluate(task, policies[kind])
                shut = evaluate(task, lambda seen, count=parameters["spread"].size: np.zeros((len(seen), count)))
                said = f"mean error over 256 new episodes {moved.error.mean():.4g} {moved.unit}"
                print(f"  {said}; with valves shut {shut.error.mean():.4g} {moved.unit}")
                curves[task] = curve, float(shut.error.mean()), moved.unit
        judged = {}
        for kind, policy in policies.items() if varied else ():
            one = judged[kind] = evaluate(task, policy, UNSEEN * EPISODES, plants=UNSEEN, **differing(task, True, 1))
            each = np.array([one.error[one.plant == k].mean() for k in np.unique(one.plant)])
            words = "varied" if kind else "nominal"
            print(
                f"  trained on {words} plants, on {len(each)} unseen ones: median {np.median(each):.4g} {one.unit}, "
                f"worst {each.max():.4g} {one.unit}"
            )
        if judged:
            draw_plants(task, judged, folder)
    draw(curves, folder)


if __name__ == "__main__":
    known = [name.removeprefix("mckibben/").removesuffix("-v0") for name in mckibben_hosts.gymnasium.TASKS]
    parser = argparse.ArgumentParser(description="Train policies by PPO on environments of muscles.")
    parser.add_argument("task", nargs="*", default=["Lift"], choices=known, help="Tasks to train on")
    parser.add_argument("--varied", action="store_true", help="Learn on plants that differ, too, and judge both")
    parser.add_argument("--iterations", type=int, default=150, help="Iterations of 6,400 control steps each")
    parser.add_argument("--seed", type=int, default=0, help="Random seed of networks, actions and goals")
    parser.add_argument("--out", type=Path, default=Path("out"), help="Folder of the figure")
    options = parser.parse_args()
    options.out.mkdir(exist_ok=True)
    main(options.out, options.task, options.iterations, options.seed, options.varied)
