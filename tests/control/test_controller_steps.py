"""Laws of controllers that are pure steps: the C of a board does what Python does, and gains come from the simulation."""

from __future__ import annotations

import shutil
import subprocess

import numpy as np
import pytest

from mckibben.control import CONTROLLERS, LQI, control_task
from mckibben.control.benches import NOISE
from mckibben.control.steps import StepControl

COMPILER = shutil.which("gcc") or shutil.which("clang") or shutil.which("cc")
PURE = ("pid", "inverse", "memory-inverse", "lqi-memory")
MAIN = """#include <stdio.h>
#include "board.h"
int main(void) {
    board_state state = board_default_state;
    board_sample sample;
    board_outputs outputs;
    double wanted, output, pressure;
    while (scanf("%la %la %la", &wanted, &output, &pressure) == 3) {
        sample.wanted = wanted; sample.output = output;
#ifdef PRESSURE
        sample.pressure = pressure;
#endif
        board_step(&board_default_parameters, &state, &sample, &outputs);
        printf("%a\\n", (double)outputs.number);
    }
    return 0;
}
"""


@pytest.fixture(scope="module")
def task():
    return control_task("B1")


def in_c(controller: StepControl, samples: np.ndarray, folder, real: str) -> np.ndarray:
    """The numbers of a controller's C, compiled for this processor."""
    texts = controller.c_source("board", real=real) | {"main.c": MAIN}
    for name, text in texts.items():
        (folder / name).write_text(text)
    flags = ["-std=c99", "-Wall", "-Wextra", "-Werror", "-O2", "-ffp-contract=off"]
    flags += ["-DPRESSURE"] if " pressure;" in texts["board.h"] else []
    command = [COMPILER, *flags, str(folder / "board.c"), str(folder / "main.c"), "-o", str(folder / "board"), "-lm"]
    subprocess.run(command, check=True, capture_output=True)
    lines = "".join(" ".join(float(v).hex() for v in row) + "\n" for row in samples)
    done = subprocess.run([str(folder / "board")], input=lines, check=True, capture_output=True, text=True)
    return np.array([float.fromhex(line) for line in done.stdout.split()])


@pytest.mark.bits("C and Python run the same operations in the same order")
@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("name", PURE)
def test_the_c_of_a_step_returns_the_bits_of_python(name, task, tmp_path):
    controller, random = CONTROLLERS[name](task), np.random.default_rng(4)
    assert isinstance(controller, StepControl)
    first = task.model.reset()
    # far outputs too, so that limits, rests and shaped references have their turns
    wanted = np.repeat(random.uniform(2e-3, 24e-3, 10), 30)
    output = wanted + random.normal(0.0, 1e-3, len(wanted)) * (np.arange(len(wanted)) > 20)
    samples = np.stack([wanted, output, random.uniform(0.5e5, 4e5, len(wanted))], axis=1)
    window = np.full(controller.preview + 1, wanted[0])
    controller.reset(first, window)
    numbers = []
    for goal, length, pressure in samples:
        measured = first._replace(position=task.zero + task.sign * length, pressure=pressure)
        samples[len(numbers), 1] = task.output(measured)
        numbers.append(controller.step(measured, np.full(controller.preview + 1, goal)))
    assert np.array_equal(in_c(controller, samples, tmp_path, "float64"), numbers)
    assert np.ptp(numbers) > 1e5
    # in float32 within a tenth of the noise of the measured pressure
    assert np.abs(in_c(controller, samples, tmp_path, "float32") - numbers).max() < 0.1 * NOISE["pressure"]


def test_the_gains_of_the_lqi_hold_its_own_model_still(task):
    controller = LQI(task)
    model, p = controller.model, controller._parameters
    # the closed loop of state and integral decays: what is left after the reference has stopped goes away
    size = len(model.A)
    loop = np.block(
        [
            [model.A - np.outer(p["B"], p["gain"]), -p["B"][:, None] * p["integral"]],
            [-task.period * p["C"][1], np.ones((1, 1))],
        ]
    )
    assert np.abs(np.linalg.eigvals(loop)).max() < 1.0
    assert np.abs(np.linalg.eigvals((np.eye(size) - p["filter"] @ p["C"]) @ model.A)).max() < 1.0
    # the model has the dead time of the valve as samples
    assert sum(name.startswith("past ") for name in model.states) == task.model.depth - 2
