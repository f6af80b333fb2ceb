"""Muscles on one of NVIDIA's GPUs: bits against the processor, muscle-steps per second, a sweep, derivatives.

    python benchmarks/gpu.py [--quick] [--json]

The kernel is that of a `Simulation`: a control period of 10 ms of a weight on one muscle with valve and tube, in 50 steps.
The same program runs on the processor and, as PTX, on the GPU. Seconds are those of the GPU itself, copies left out, the
best of three; those of the processor are wall clock on all its cores. Without a GPU the PTX is made and
the processor measured.

Where Warp is installed (extra ``warp``), the part that `mckibben export --for warp` writes is measured too: a muscle with
valve and tube in each world, in steps of 1 ms, on one core of the processor and on the GPU, with the deviations between
them; wall clock.
"""

from __future__ import annotations

import importlib.util
import json
import sys
import tempfile
import time
from pathlib import Path
from types import ModuleType
from typing import Any

import jax
import numpy as np

import lanewise
import mckibben as mk
from lanewise.errors import UnavailableError
from mckibben import hosts
from mckibben.simulation.stepping import step_vectors

PERIOD, COMPARED, LANES = 10e-3, 4096, 262_144
ROLLOUTS, SAMPLES = 16_384, 10  # runs of some samples with their derivatives by all commands
VARIANTS = 1_048_576
ROUNDS = 3
TARGETS = {"float64": 2e10, "float32": 5e10}  # muscle-steps per second
REALS = ("float64", "float32")
WARP_COMPARED, WARP_STEPS, WARP_SUBSTEP = 512, 10, 5e-5  # worlds that are compared, steps of 1 ms, and substep [s]


class Example:
    """A control period of many weights with different valve commands.

    Args:
        lanes: how many.
    """

    def __init__(self, lanes: int) -> None:
        air = mk.Air(supply="6 bar", valve="mpye-5-1/8", tube=("50 cm", "4 mm"))
        self.simulation = mk.Simulation(mk.Weight("nylon", mass="3 kg", start="13 cm"), air, period=PERIOD)
        self.program = self.simulation.programs.step(False).program
        sim, self.lanes = self.simulation, lanes
        carry, _ = sim.rest_state()
        commands = np.repeat([[sim.start_commands()[name]] for name in sim.commands], lanes, axis=1)
        commands[sim.commands.index("muscle")] = np.random.default_rng(0).uniform(-1.0, 1.0, lanes)
        carries = np.repeat(carry[:, None], lanes, axis=1)
        self.values = [sim.parameters, carries, commands, np.float64(PERIOD), np.int64(sim.inner)]

    @property
    def steps(self) -> int:
        """Muscle-steps of a call."""
        return self.lanes * self.simulation.inner

    def swept(self) -> list[Any]:
        """Arguments with parameters of each lane's own."""
        return [np.repeat(self.values[0][:, None], self.lanes, axis=1), *self.values[1:]]


def differentiated(example: Example) -> tuple[lanewise.Program, list[Any]]:
    """The program with its derivatives by the commands, and its arguments."""
    count = len(example.simulation.commands)
    directions = np.eye(count)
    return lanewise.tangents(example.program, [2], count), [*example.values, directions]


def rollouts(lanes: int) -> tuple[lanewise.Program, list[Any]]:
    """Runs of `SAMPLES` samples with the derivatives of the sum of what they show by all commands, and the arguments."""
    example = Example(lanes)
    simulation, (parameters, carries, commands, *_) = example.simulation, example.values
    layouts, inner = simulation.programs.layouts, simulation.inner

    def run(plant: Any, carry: Any, commands: Any) -> Any:
        def step(carry: Any, now: Any) -> Any:
            return step_vectors(layouts, False, plant, carry, now, PERIOD, inner)

        return jax.lax.scan(step, carry, commands)[1].sum(axis=0)

    table = np.repeat(commands[None], SAMPLES, axis=0)
    program, _ = lanewise.lower(run, parameters, carries[:, 0], table[..., 0])
    adjoint = lanewise.adjoint(program, [2])
    return adjoint, [parameters, carries, table, np.ones(adjoint.arguments[3].shape)]


def measure_many(gpu: Any) -> dict[str, Any]:
    """Derivatives of many runs, and a sample of a million variants with the copying of their arguments."""
    found: dict[str, Any] = {}
    (adjoint, values), variants = rollouts(ROLLOUTS), Example(VARIANTS).swept()
    for real in REALS:
        seconds = on_gpu(lanewise.to_gpu(adjoint), values, ROLLOUTS, real, "default")
        found[f"GPU, {ROLLOUTS} rollouts of {SAMPLES} samples with derivatives, {real} [s]"] = seconds
        began = time.perf_counter()
        gpu.call(variants, lanes=VARIANTS, real=real)
        found[f"GPU, a sample of {VARIANTS} variants, {real}, wall clock [s]"] = time.perf_counter() - began
    return found


def away(ours: list[Any], theirs: list[Any]) -> dict[str, float]:
    """Share of numbers with equal bits, and the largest deviation in units in the last place."""
    pairs = [(np.asarray(a), np.asarray(b)) for a, b in zip(ours, theirs, strict=True) if a is not None]
    equal = sum(int((a == b).sum()) for a, b in pairs) / sum(a.size for a, _ in pairs)
    units = [np.abs(a - b) / np.spacing(np.maximum(np.abs(a), np.abs(b))) for a, b in pairs]
    return {"equal bits [share]": equal, "largest deviation [ULP]": max(float(np.nanmax(u)) for u in units)}


def on_processor(program: lanewise.Program, values: list[Any], lanes: int, real: str) -> float:
    """Seconds of a call on all cores."""
    program.call(values, lanes=lanes, real=real)
    took = []
    for _ in range(ROUNDS):
        began = time.perf_counter()
        program.call(values, lanes=lanes, real=real)
        took.append(time.perf_counter() - began)
    return min(took)


def on_gpu(program: Any, values: list[Any], lanes: int, real: str, mode: str) -> float:
    """Seconds that the GPU itself took for a call."""
    differs = [
        k for k, (leaf, v) in enumerate(zip(program.arguments, values, strict=True)) if np.shape(v) != leaf.shape
    ]
    kernel = program.kernel(frozenset(differs), lanes=True, mode=mode, real=real)
    took = []
    for _ in range(ROUNDS):
        program.call(values, lanes=lanes, real=real, mode=mode)
        took.append(kernel.seconds)
    return min(took)


def device() -> str:
    """Name of the GPU; the reason in one line where there is none."""
    try:
        return str(lanewise.to_gpu(Example(1).program).device.name)
    except UnavailableError as error:
        return f"none: {error}"


def measure_processor(lanes: int) -> dict[str, Any]:
    """What can be said without a GPU: speeds of the processor, and the PTX."""
    example = Example(lanes)
    names = [leaf.name for leaf in example.program.arguments]
    found: dict[str, Any] = {}
    for real in REALS:
        seconds = on_processor(example.program, example.values, lanes, real)
        found[f"processor, {real} [muscle-steps/s]"] = example.steps / seconds
        began = time.perf_counter()
        text = lanewise.to_ptx(example.program, names[1:3], real=real)
        found[f"PTX, {real} [lines]"] = text.count("\n")
        found[f"PTX, {real}, made in [s]"] = time.perf_counter() - began
    return found


def measure_gpu(lanes: int) -> dict[str, Any]:
    """Bits, speeds, a sweep and derivatives on the GPU."""
    few, many = Example(COMPARED), Example(lanes)
    found: dict[str, Any] = {}
    gpu = lanewise.to_gpu(many.program)
    for real in REALS:
        ours = gpu.call(few.values, lanes=COMPARED, real=real)
        theirs = few.program.call(few.values, lanes=COMPARED, real=real)
        found |= {f"{name}, {real}": value for name, value in away(ours, theirs).items()}
        for mode in ("default", "fast"):
            seconds = on_gpu(gpu, many.values, lanes, real, mode)
            found[f"GPU, {real}, {mode} [muscle-steps/s]"] = many.steps / seconds
        seconds = on_gpu(gpu, many.swept(), lanes, real, "default")
        found[f"GPU, sweep of parameters, {real} [muscle-steps/s]"] = many.steps / seconds
    program, values = differentiated(many)
    seconds = on_gpu(lanewise.to_gpu(program), values, lanes, "float64", "default")
    found["GPU, derivatives by the commands, float64 [muscle-steps/s]"] = many.steps / seconds
    return found | measure_many(gpu)


def warp_module(folder: Path) -> ModuleType | None:
    """The module of Warp of a muscle; None where Warp is not installed."""
    if importlib.util.find_spec("warp") is None:
        return None
    part = hosts.Part("nylon", mk.Air(supply="6 bar", tube=("50 cm", "4 mm")), span="13 cm")
    (path,) = hosts.export(part, "warp", folder, name="measured")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    assert spec is not None and spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def warp_steps(module: ModuleType, lanes: int, device: str) -> tuple[float, np.ndarray]:
    """Seconds of a step of 1 ms of many muscles in Warp, and their outputs after `WARP_STEPS`."""
    import warp

    muscles = module.Muscles(lanes, device)
    given = np.zeros(muscles.inputs.shape)
    given[:, module.SPANS["muscle"]] = 0.13
    given[:, module.CONTROLS["muscle"]] = np.random.default_rng(0).uniform(-1.0, 1.0, lanes)
    muscles.inputs.assign(given)
    best = np.inf
    for _ in range(WARP_STEPS):
        warp.synchronize_device(device)
        began = time.perf_counter()
        muscles.step(1e-3)
        warp.synchronize_device(device)
        best = min(best, time.perf_counter() - began)
        warp.copy(muscles.state, muscles.following)
    return best, muscles.outputs.numpy()


def measure_warp(lanes: int) -> dict[str, Any]:
    """Speed of the part in Warp on the processor, its PTX, and speed and deviations on the GPU where there is one."""
    with tempfile.TemporaryDirectory() as folder:
        module = warp_module(Path(folder))
        if module is None:
            return {"Warp": "not installed"}
        import warp

        warp.config.log_level = warp.LOG_WARNING
        warp.init()
        inner = round(1e-3 / WARP_SUBSTEP)
        seconds, ours = warp_steps(module, WARP_COMPARED, "cpu")
        found: dict[str, Any] = {"Warp, one core of the processor [muscle-steps/s]": WARP_COMPARED * inner / seconds}
        began = time.perf_counter()
        warp.compile_aot_module(module, arch=90, module_dir=folder, use_ptx=True)
        found["Warp, PTX for sm_90, made in [s]"] = time.perf_counter() - began
        if warp.is_cuda_available():
            _, theirs = warp_steps(module, WARP_COMPARED, "cuda:0")
            found |= {f"Warp, {name}": value for name, value in away([theirs], [ours]).items()}
            seconds, _ = warp_steps(module, lanes, "cuda:0")
            found["Warp, GPU [muscle-steps/s]"] = lanes * inner / seconds
    return found


def main(words: list[str]) -> None:
    """Measure, and print a line for each figure, with its target where there is one."""
    lanes = COMPARED if "--quick" in words else LANES
    figures: dict[str, Any] = {"GPU": device()}
    there = not figures["GPU"].startswith("none")
    figures |= measure_processor(COMPARED)
    if there:
        figures |= measure_gpu(lanes)
    figures |= measure_warp(lanes)
    if "--json" in words:
        print(json.dumps(figures))
        return
    for name, value in figures.items():
        target = next((t for real, t in TARGETS.items() if name == f"GPU, {real}, default [muscle-steps/s]"), None)
        shown = value if isinstance(value, str) else f"{value:.4g}"
        print(f"{name:62s}{shown}" + (f"   target {target:.0e}" if target else ""))


if __name__ == "__main__":
    main(sys.argv[1:])
