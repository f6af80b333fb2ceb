"""Control periods per second: of environments of Gymnasium, single ones and lanes, and of lanes of `Simulation.batch`.

    python benchmarks/environments.py [--json]

A control period is 10 ms in 50 steps of the physics. Wall clock, the best of four rounds of random actions, on as
many threads as the machine has cores for the lanes. The batch is a weight on a muscle behind a regulator, at periods of
1 and of 10 ms. Needs `mckibben[gym]`.
"""

from __future__ import annotations

import json
import os
import sys
import time

import numpy as np

import mckibben as mk
from mckibben_hosts.gymnasium import TASKS, MuscleEnv, MuscleVectorEnv

LANES, PERIODS, ROUNDS = (64, 1024), 20, 4


def best(step: object, actions: np.ndarray) -> float:
    """Seconds of a call, with the actions in turn."""
    assert callable(step)
    took = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        for action in actions:
            step(action)
        took.append((time.perf_counter() - began) / len(actions))
    return min(took)


def measure() -> dict[str, float]:
    """Control periods per second, by task and number of lanes."""
    found = {}
    for name in TASKS:
        single = MuscleEnv(name)
        single.reset(seed=0)
        random = np.random.default_rng(0)
        actions = random.uniform(-1.0, 1.0, (10 * PERIODS, *single.action_space.shape))
        found[f"{name}, single"] = 1.0 / best(single.step, actions)
        for lanes in LANES:
            many = MuscleVectorEnv(lanes, name)
            many.reset(seed=0)
            actions = random.uniform(-1.0, 1.0, (PERIODS, *many.action_space.shape))
            found[f"{name}, {lanes} lanes"] = lanes / best(many.step, actions)
    for period in ("1 ms", "10 ms"):
        many = mk.Simulation(mk.Weight("nylon", mass="3 kg"), mk.Air(valve="regulator"), period=period).batch(LANES[-1])
        many.reset()
        pressures = np.random.default_rng(0).uniform(1e5, 4e5, (PERIODS, LANES[-1]))
        took = best(lambda row, lanes=many: lanes.step(muscle=row), pressures)
        found[f"Simulation.batch, {period}, {LANES[-1]} lanes"] = LANES[-1] / took
    return found


def main(words: list[str]) -> None:
    """Measure, and print a line for each figure."""
    figures = measure()
    if "--json" in words:
        print(json.dumps(figures))
        return
    print(f"load {os.getloadavg()[0]:.1f}, {time.strftime('%H:%M')}, control periods per second")
    for name, value in figures.items():
        print(f"{name:38s}{value:12,.0f}")


if __name__ == "__main__":
    main(sys.argv[1:])
