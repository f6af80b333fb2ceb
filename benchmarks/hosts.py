"""A muscle in MuJoCo: steps of 1 ms from Python, and steps of many environments at once.

    python benchmarks/hosts.py [--json]

The model is the one that `mckibben export --for mujoco` writes: one muscle with valve and tube, and a mass. Wall clock, the
best of three rounds, on as many threads as the machine has cores for the environments. Needs `mckibben[mujoco]`.
"""

from __future__ import annotations

import json
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import mujoco
import mujoco.rollout
import numpy as np

import mckibben as mk
from mckibben_hosts import Part, export

STEPS, ENVIRONMENTS, LENGTH = 20_000, 1024, 100
TARGETS = {"steps from Python [1/s]": 60_000, "steps of 1,024 environments [1/s]": 150_000}


def best(work: Callable[[], object], rounds: int = 3) -> float:
    """Shortest time of some rounds [s]."""
    times = []
    for _ in range(rounds):
        began = time.perf_counter()
        work()
        times.append(time.perf_counter() - began)
    return min(times)


def measure(folder: Path) -> dict[str, float]:
    """Build the plugin in a folder and measure it."""
    files = export(Part("nylon", mk.Air(supply="6 bar"), span="14 cm"), "mujoco", folder, name="timed")
    mujoco.mj_loadPluginLibrary(str(files[-1]))
    model = mujoco.MjModel.from_xml_path(str(folder / "timed.xml"))
    data = mujoco.MjData(model)
    data.ctrl[0] = 0.02

    def single() -> None:
        for _ in range(STEPS):
            mujoco.mj_step(model, data)

    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, mujoco.MjData(model), start, kind)
    starts = np.repeat(start[None], ENVIRONMENTS, 0)
    controls = np.random.default_rng(0).uniform(-0.3, 0.3, (ENVIRONMENTS, LENGTH, 1))
    threads = [mujoco.MjData(model) for _ in range(os.cpu_count() or 1)]

    with mujoco.rollout.Rollout(nthread=len(threads)) as pool:
        together = best(lambda: pool.rollout(model, threads, starts, controls))
    values = (STEPS / best(single), ENVIRONMENTS * LENGTH / together)
    return dict(zip(TARGETS, map(float, values), strict=True))


def main(words: list[str]) -> None:
    """Measure and print."""
    with tempfile.TemporaryDirectory() as folder:
        measured = measure(Path(folder))
    if "--json" in words:
        print(json.dumps({"cores": os.cpu_count(), "mujoco": mujoco.__version__} | measured))
        return
    for name, value in measured.items():
        print(f"{name}: {value:,.0f}, wanted {TARGETS[name]:,}, {os.cpu_count()} cores")


if __name__ == "__main__":
    main(sys.argv[1:])
