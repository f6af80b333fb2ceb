"""Short sweeps, and single runs of their variants to compare with."""

import dataclasses
import functools

import numpy as np

from mckibben.batch import Output
from mckibben.batch.run import Runner
from mckibben.batch.run_template import make_template
from mckibben.batch.variants import Variants, column
from mckibben.bench.run import run
from mckibben.experiments.read import parse_protocol, protocol

STEP = """
schema = 1
name = "step"
sample_rate = "1 kHz"
[parameters.high]
unit = "Pa"
value = "3 bar"
[parameters.span]
unit = "m"
value = "1 L0"
[[steps]]
label = "rest"
span = "$span"
pressure = "0 bar"
for = "50 ms"
[[steps]]
label = "high"
pressure = "$high"
for = "150 ms"
[[last]]
label = "vent"
pressure = "0 bar"
for = "50 ms"
record = false
"""
TRUE = ("muscle.load_tension", "muscle.length", "muscle.pressure", "port.pressure_abs", "muscle.mass")
MEASURED = ("tension", "pressure", "valve.command")


@functools.cache
def step_protocol():
    return parse_protocol(STEP, where="step.toml")


def triangle_protocol():
    return protocol("isotonic-triangle", load="50 N", frequency="5 Hz", cycles=1)


def whole(*names):
    """Whole channels as outputs."""
    return tuple(Output(name, "samples", name) for name in names)


def template(what, columns, *, outputs=None, muscle="nylon", **more):
    made = make_template(what, muscle, outputs=outputs or whole(*TRUE, *MEASURED), **more)
    return dataclasses.replace(made, settings={path: made.setting(path) for path in columns})


def read(made, columns):
    """Words by path as variants."""
    return Variants({p: column([made.settings[p].read(v) for v in values]) for p, values in columns.items()})


def runner(made, variants):
    numbers = {p: v for p, v in variants.columns.items() if v.dtype == float}
    return Runner(made, {p: (float(v.min()), float(v.max())) for p, v in numbers.items()})


def single(one, variants, row):
    """The recording of a variant that is run by itself."""
    return run(one.planner.factory.bench(variants.row(row)))


def same_as_single_runs(made, variants, rows, tolerance):
    """Largest difference of any channel between lanes and single runs, over the channel's largest value."""
    one = runner(made, variants)
    results = one.run(variants)
    for row in rows:
        recording = single(one, variants, row)
        assert results.code[row] == 0, results.message[row]
        count = int(np.isfinite(results.outputs["time"][row]).sum())
        assert count == len(recording)
        np.testing.assert_allclose(results.outputs["time"][row][:count], recording.time, atol=1e-12)
        for name in (o.name for o in made.outputs):
            ours, theirs = results.outputs[name][row][:count], recording[name]
            worst = np.abs(ours - theirs).max() / np.abs(theirs).max()
            assert worst <= tolerance, (row, name, worst)
    return one, results
