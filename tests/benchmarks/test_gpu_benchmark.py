"""The benchmark of GPUs tells results apart by single bits, and its derivatives are those by the commands."""

import importlib
import sys
from pathlib import Path

import numpy as np
import pytest


@pytest.fixture(scope="module")
def gpu():
    """The benchmark, a script and no package."""
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(str(Path(__file__).resolve().parents[2] / "benchmarks"))
        yield importlib.import_module("gpu")
        del sys.modules["gpu"]


@pytest.mark.parametrize("real", [np.float64, np.float32])
def test_a_single_changed_bit_is_one_unit_in_the_last_place(gpu, real):
    values = np.array([1.25, -3.5, 1e-9, 7e5], real)
    changed = values.copy()
    changed[1] = np.nextafter(changed[1], real(0.0))
    assert gpu.away([values, None], [values, None]) == {"equal bits [share]": 1.0, "largest deviation [ULP]": 0.0}
    assert gpu.away([values, None], [changed, None]) == {"equal bits [share]": 0.75, "largest deviation [ULP]": 1.0}


@pytest.mark.slow
def test_the_measured_derivatives_are_those_by_the_commands(gpu):
    example, step = gpu.Example(4), 1e-6
    program, values = gpu.differentiated(example)
    place = example.simulation.commands.index("muscle")
    slopes = program.call(values, lanes=4)[-1][place]
    ends = []
    for sign in (1.0, -1.0):
        moved = [*example.values]
        moved[2] = example.values[2].copy()
        moved[2][place] += sign * step
        ends.append(example.program.call(moved, lanes=4)[1])
    by_differences = (ends[0] - ends[1]) / (2.0 * step)
    pressure = example.simulation.programs.fields.index("pressure")
    assert abs(slopes[pressure]).min() > 1e3  # Pa: the valve acts in all lanes
    np.testing.assert_allclose(slopes[pressure], by_differences[pressure], rtol=1e-5)  # of the differences
