"""Train policies by the gradient of whole episodes on environments of muscles, beside proximal policy optimisation (PPO).

    python examples/learn_by_gradient.py [Lift Joint Reach Pressure] [--iterations 100] [--rate 4e-3] [--seed 0] [--no-ppo]

The policy is the network of `learn_by_ppo.py`, and it sees what the environments show. Each iteration runs 32 episodes as
lanes of one kernel, differentiates their cost by all weights of the network, and takes a step of Adam; an iteration of PPO
has as many control steps. Prints the mean error of both on 256 new episodes and draws the learning curves. Ctrl-C ends the
training of a task; what was learned is evaluated.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Sequence
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

import mckibben as mk
from mckibben_hosts.gymnasium import TASKS, Task

sys.path.insert(0, str(Path(__file__).parent))
import learn_by_ppo as ppo  # noqa: E402

LANES = 32  # episodes of an iteration
RATE, LEAST_RATE, LARGEST_SLOPE = 4e-3, 2e-4, 1.0  # of Adam at the start and at the end, and limit of the slope
SMOOTH = 0.05  # error over the tolerance below which the cost is a parabola
SEEN = 64  # episodes by which the learning curve is drawn


def episode_cost(task: Task):
    """The mean cost of an episode of a task as a function of network, goals and disturbances."""
    simulation = task.simulation()
    simulation.reset(pressure=task.pressure)

    def policy(parameters: dict, seen: tuple) -> tuple[dict, jax.Array]:
        now = jnp.round(seen.time / simulation.period).astype(int)
        goal = parameters["goals"][:, now]
        values = {s.name: getattr(seen, s.name, None) for s in task.senses}
        values |= dict(zip([s.name for s in task.senses if s.name.startswith("goal")], goal, strict=True))
        shown = jnp.stack([2.0 * (values[s.name] - s.low) / (s.high - s.low) - 1.0 for s in task.senses])
        actions = act(parameters["layers"], jnp.clip(shown, -1.0, 1.0))
        distance = jnp.stack([getattr(seen, name) for name in task.wanted]) - goal
        cost = jnp.sqrt(jnp.sum(distance**2) / task.tolerance**2 + SMOOTH**2)
        commands = dict(zip(task.actions, actions, strict=True))
        return commands | dict(zip(task.disturbed, parameters["disturbances"][:, now], strict=True)), cost

    rollout = simulation.rollout(policy, steps=task.samples)
    return rollout.as_function()


@jax.jit
def act(layers: list, shown: jax.Array) -> jax.Array:
    """Positions of the valves, from -1 to 1, with a soft limit, so that slopes do not vanish beyond it."""
    return jnp.tanh(ppo.network(layers, shown))


def train(
    name: str, iterations: int, seed: int, first_rate: float = RATE, *, limit_episodes: bool = False
) -> tuple[list, list[tuple[int, float, float]]]:
    """Network of the trained policy, and rows of the learning curve: control steps, seconds, mean error."""
    task, random = TASKS[f"mckibben/{name}-v0"], np.random.default_rng(seed)
    layers = ppo.begin(random, len(task.senses), len(task.actions))["policy"]
    cost = episode_cost(task)

    def one(layers: list, goals: jax.Array, disturbances: jax.Array) -> jax.Array:
        return cost({"layers": layers, "goals": goals, "disturbances": disturbances})

    def mean_cost(layers: list, goals: jax.Array, disturbances: jax.Array) -> jax.Array:
        return jnp.mean(jax.vmap(one, (None, 0, 0))(layers, goals, disturbances))

    def limited(slope: list) -> list:
        norm = jnp.sqrt(sum(jnp.sum(g * g) for g in jax.tree.leaves(slope)))
        return jax.tree.map(lambda g: g * jnp.minimum(1.0, LARGEST_SLOPE / norm), slope)

    def slope_of(layers: list, goals: jax.Array, disturbances: jax.Array) -> tuple:
        if not limit_episodes:
            value, slope = jax.value_and_grad(mean_cost)(layers, goals, disturbances)
            return value, limited(slope)
        values, slopes = jax.vmap(jax.value_and_grad(one), (None, 0, 0))(layers, goals, disturbances)
        return jnp.mean(values), jax.tree.map(lambda g: jnp.mean(g, 0), jax.vmap(limited)(slopes))

    @jax.jit
    def improve(layers: list, moments: tuple, goals: jax.Array, disturbances: jax.Array, count: jax.Array) -> tuple:
        value, slope = slope_of(layers, goals, disturbances)
        mean = jax.tree.map(lambda m, g: 0.9 * m + 0.1 * g, moments[0], slope)
        square = jax.tree.map(lambda s, g: 0.99 * s + 0.01 * g * g, moments[1], slope)
        a, b = 1.0 - 0.9**count, 1.0 - 0.99**count
        rate = LEAST_RATE + (first_rate - LEAST_RATE) * 0.5 * (1.0 + jnp.cos(jnp.pi * (count - 1) / iterations))
        step = lambda w, m, s: w - rate * (m / a) / (jnp.sqrt(s / b) + 1e-8)  # noqa: E731
        return value, jax.tree.map(step, layers, mean, square), (mean, square)

    moments = (jax.tree.map(np.zeros_like, layers),) * 2
    curve: list[tuple[int, float, float]] = []
    seconds = 0.0
    try:
        for iteration in range(1, iterations + 1):
            began = time.monotonic()
            episodes = [task.draw(random) for _ in range(LANES)]
            goals, disturbances = (np.stack([getattr(e, kind) for e in episodes]) for kind in ("goals", "disturbances"))
            value, changed, moments = improve(layers, moments, goals, disturbances, iteration)
            if not np.isfinite(value):
                print("  A run became too fast for the step of its simulation; what was learned before is evaluated.")
                break
            layers = jax.tree.map(np.asarray, changed)
            seconds += time.monotonic() - began  # without looking at what was learned
            errors = ppo.evaluate(name, lambda shown, now=layers: act(now, shown), SEEN).error
            curve.append((iteration * LANES * task.samples, seconds, float(errors.mean())))
            if iteration % 10 == 0:
                print(
                    f"  {curve[-1][0]:>9,} control steps  {seconds:6.1f} s  mean error {curve[-1][2]:.4g}", flush=True
                )
    except KeyboardInterrupt:
        print("Stopped; what was learned so far is evaluated.")
    return layers, curve


def draw(curves: dict[str, dict[str, list]], shut: dict[str, tuple[float, str]], folder: Path) -> None:
    """Write the learning curves of both methods: error in the unit of the task, over control steps."""
    import matplotlib.pyplot as plt

    with mk.figure_style("screen"):
        figure, axes = plt.subplots(
            1, len(curves), figsize=(2.9 * len(curves), 2.6), squeeze=False, layout="constrained"
        )
        for ax, (name, lines) in zip(axes[0], curves.items(), strict=True):
            for label, curve in lines.items():
                rows = np.array(curve)
                if label == "PPO":  # means over whole episodes
                    rows = rows[: len(rows) // ppo.QUARTERS * ppo.QUARTERS].reshape(-1, ppo.QUARTERS, 3).mean(1)
                ax.loglog(rows[:, 0] / 1e3, rows[:, 2], label=label)
            error, unit = shut[name]
            ax.axhline(error, color="0.5", lw=0.8, ls="--")
            ax.set(title=name, xlabel="control steps (thousand)", ylabel=f"mean error ({unit})")
        axes[0][0].legend()
        mk.save_figure(figure, folder / "learn-by-gradient.svg")


def main(
    folder: Path,
    tasks: Sequence[str] = ("Lift",),
    iterations: int = 60,
    seed: int = 0,
    *,
    rate: float = RATE,
    limit_episodes: bool = False,
    with_ppo: bool = False,
) -> None:
    """Train policies, print their errors, and draw the learning curves."""
    curves, shut = {}, {}
    for name in tasks:
        print(f"{name}, by gradient:")
        layers, curve = train(name, iterations, seed, rate, limit_episodes=limit_episodes)
        found = ppo.evaluate(name, lambda shown, now=layers: act(now, shown))
        still = ppo.evaluate(name, lambda shown, width=layers[-1][1].size: np.zeros((len(shown), width)))
        error, unit, shut[name] = found.error.mean(), found.unit, (float(still.error.mean()), still.unit)
        print(f"  mean error over 256 new episodes {error:.4g} {unit}; with valves shut {shut[name][0]:.4g} {unit}")
        curves[name] = {"gradient": curve}
        if with_ppo:
            print(f"{name}, by PPO:")
            parameters, curve = ppo.train(name, 150, seed)
            middle = jax.jit(lambda shown, policy=parameters["policy"]: ppo.network(policy, shown))
            error = ppo.evaluate(name, middle).error.mean()
            print(f"  mean error over 256 new episodes {error:.4g} {unit}")
            curves[name]["PPO"] = curve
    draw(curves, shut, folder)


if __name__ == "__main__":
    known = [name.removeprefix("mckibben/").removesuffix("-v0") for name in TASKS]
    parser = argparse.ArgumentParser(description="Train policies by gradients of episodes on environments of muscles.")
    parser.add_argument("task", nargs="*", default=["Lift"], choices=known, help="Tasks to train on")
    parser.add_argument("--iterations", type=int, default=100, help="Iterations of 6,400 control steps each")
    parser.add_argument("--rate", type=float, default=RATE, help="Rate of Adam at the start; Reach needs 2e-3")
    parser.add_argument(
        "--limit-episodes", action="store_true", help="Limit the slope of each episode, not of their mean; for Reach"
    )
    parser.add_argument("--seed", type=int, default=0, help="Random seed of networks and goals")
    parser.add_argument("--no-ppo", action="store_true", help="Leave out PPO")
    parser.add_argument("--out", type=Path, default=Path("out"), help="Folder of the figure")
    options = parser.parse_args()
    options.out.mkdir(exist_ok=True)
    main(
        options.out,
        options.task,
        options.iterations,
        options.seed,
        rate=options.rate,
        limit_episodes=options.limit_episodes,
        with_ppo=not options.no_ppo,
    )
