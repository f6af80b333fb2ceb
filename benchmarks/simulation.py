"""A joint with two muscles that one steps: a step from Python, lanes of a batch against the batch kernel, time until ready.

    python benchmarks/simulation.py [--quick] [--json]

One core, processor time, medians over rounds in which all candidates take turns; a ratio is the median of those of the
rounds. The batch kernel is `engine.integration.compile_march` of the same machine with the same steps: one call for all
samples, with the observation's outputs alone. Time until ready is that of a process of its own, up to the end of its first
step.
"""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
from timing import in_turns, pin

import mckibben as mk
from mckibben.engine import held
from mckibben.engine.integration import compile_march

PERIOD, SAMPLES, LANES = 2e-3, 20, 1024
TARGETS = {"step [us]": 15.0, "batch over kernel": 0.6, "gradient over rollout": 4.0, "ready [s]": 2.0}
FIRST = """
import json, time
began, used = time.perf_counter(), time.process_time()
import mckibben as mk
sim = mk.Simulation(mk.Joint("nylon", arm="2 cm"), mk.Air(supply="6 bar", valve="mpye-5-1/8", tube=("1 m", "4 mm")))
sim.reset(seed=0)
sim.step(flexor=0.1)
print(json.dumps([time.perf_counter() - began, time.process_time() - used]))
"""


def joint() -> Any:
    """The joint of the documentation, at 500 Hz."""
    air = mk.Air(supply="6 bar", valve="mpye-5-1/8", tube=("1 m", "4 mm"))
    return mk.Simulation(mk.Joint("nylon", arm="2 cm", inertia=2e-3), air, period=PERIOD)


def measure_step(rounds: int) -> float:
    """Processor time of a step from Python [s]."""
    sim = joint()
    sim.reset(pressure="2 bar")

    def run() -> None:
        for k in range(500):
            sim.step(flexor=0.1 if k % 50 < 25 else -0.1, extensor=-0.1)
        sim.reset(pressure="2 bar")

    return in_turns({"step": run}, rounds).median("step") / 500.0


def measure_batch(rounds: int) -> tuple[float, float, float]:
    """Seconds per lane and sample of a batch that is stepped, and of the batch kernel; and their ratio of speeds."""
    sim = joint()
    random = np.random.default_rng(0)
    values = {name: random.uniform(-0.2, 0.2, (SAMPLES + 1, LANES)) for name in ("flexor", "extensor")}
    many = sim.batch(LANES)
    many.reset(pressure="2 bar")
    start = many.save_state()

    def stepped() -> None:
        many.load_state(start)
        for k in range(SAMPLES):
            many.step(flexor=values["flexor"][k], extensor=values["extensor"][k])

    carry, _ = sim.rest_state("2 bar")
    state, memory, _ = sim.programs.layouts.carry.unpack(np.array(carry))
    still = np.zeros(SAMPLES + 1)
    signals = {d.signal: held(still) for d in sim.drives}
    outputs = [output for _, output in sim.plant.shown]
    kernel = compile_march(
        sim.machine, state, memory, signals, period=PERIOD, inner=sim.inner, outputs=outputs, engine="native"
    )
    given = {d.signal: held(values.get(d.command, still)) for d in sim.drives}

    def marched() -> None:
        kernel(sim.machine, state, memory, given, lanes=LANES, threads=1)

    took = in_turns({"stepped": stepped, "kernel": marched}, rounds)
    each = LANES * SAMPLES
    return took.median("stepped") / each, took.median("kernel") / each, took.ratio("kernel", "stepped")


def measure_rollout(rounds: int) -> tuple[float, float, float]:
    """Time of a sample of a rollout and of its gradient [s], and the gradient, by the machine too, over the rollout."""
    sim = joint()
    sim.reset()
    policy = lambda p, seen: {"flexor": p * (0.1 - seen.angle), "extensor": -p * (0.1 - seen.angle)}  # noqa: E731
    run, steps = sim.rollout(policy, steps=80, cost=lambda seen, _: (seen.angle - 0.1) ** 2), 80
    names = ["load.inertia"]
    calls = {
        "XLA run": lambda: run(0.5),
        "XLA gradient": lambda: run.value_and_grad(0.5),
        "XLA machine": lambda: run.machine_gradient(0.5, names),
    }
    for call in calls.values():
        call()
    taken = in_turns(calls, rounds)
    of = {name: taken.median(name) / steps for name in calls}
    return of["XLA run"], taken.ratio("XLA gradient", "XLA run"), taken.ratio("XLA machine", "XLA run")


def measure_ready(rounds: int) -> dict[str, list[float]]:
    """Wall and processor seconds of a process until its first step: nothing compiled before, and all of it kept."""
    found: dict[str, list[list[float]]] = {"first": [], "later": []}
    with tempfile.TemporaryDirectory() as folder:
        settings = {**os.environ, "MCKIBBEN_KERNELS": folder, "JAX_COMPILATION_CACHE_DIR": str(Path(folder, "jax"))}
        settings.pop("PYTHONDONTWRITEBYTECODE", None)
        for k in range(rounds + 1):
            done = subprocess.run(
                [sys.executable, "-c", FIRST], capture_output=True, text=True, env=settings, check=True
            )
            found["later" if k else "first"].append(json.loads(done.stdout.splitlines()[-1]))
    return {name: [statistics.median(row[i] for row in rows) for i in range(2)] for name, rows in found.items()}


def main(words: list[str]) -> None:
    """Measure, and print a line for each figure beside its target."""
    rounds = 5 if "--quick" in words else 21
    ready = measure_ready(2 if "--quick" in words else 5)
    pin()
    step = measure_step(rounds)
    stepped, kernel, ratio = measure_batch(rounds)
    rollout, gradient, machine = measure_rollout(rounds)
    figures = {
        "step [us]": 1e6 * step,
        "rollout, per sample [us]": 1e6 * rollout,
        "gradient over rollout": gradient,
        "gradient by the machine over rollout": machine,
        "batch over kernel": ratio,
        "batch, per lane [us]": 1e6 * stepped,
        "kernel, per lane [us]": 1e6 * kernel,
        "ready [s]": ready["later"][0],
        "ready, processor time [s]": ready["later"][1],
        "ready the first time [s]": ready["first"][0],
        "ready the first time, processor time [s]": ready["first"][1],
    }
    if "--json" in words:
        print(json.dumps(figures))
        return
    print(f"load {os.getloadavg()[0]:.1f}, {time.strftime('%H:%M')}")
    for name, value in figures.items():
        print(f"{name:45s}{value:10.3g}" + (f"   target {TARGETS[name]:g}" if name in TARGETS else ""))


if __name__ == "__main__":
    main(sys.argv[1:])
