"""A program of steps asks sample by sample for what its plan says, and after its end for what its last step said last."""

import numpy as np
import pytest

from mckibben.bench.software.sequencer import SPAN, TENSION, Sequencer
from mckibben.experiments.read import parse_protocol

L0, RATE = 0.14, 100.0
HEAD = 'schema = 1\nname = "x"\nsample_rate = "100 Hz"\n'
TEXT = (
    HEAD
    + '[[steps]]\npressure = { to = "3 bar", in = "50 ms" }\nspan = { to = "0.9 L0", in = "50 ms" }\nrecord = false\n'
    '[[steps]]\nspan = { kind = "sine", mean = "0.9 L0", amplitude = "0.05 L0", frequency = "5 Hz" }\nfor = "80 ms"\n'
    '[[steps]]\npressure = "shut"\nfor = "30 ms"\n'
    '[[steps]]\npressure = "2 bar"\ntension = "20 N"\nfor = "20 ms"\n'
)


@pytest.fixture(scope="module", params=[1, 2, 4])
def program(request):
    """The first steps of the plan, and their program, which has room for more."""
    steps = parse_protocol(TEXT, where="t").expand(rest_length=L0).steps[: request.param]
    return steps, Sequencer.of(steps, rest_length=L0, period=1.0 / RATE)


def go(program, samples):
    """Set-points of so many samples of a machine that does what it is asked for."""
    place, asked = program.initial(0.0, L0), []
    for _ in range(samples):
        points = program.set_points(place, 1.0 / RATE)
        asked.append(points)
        seen = {"pressure": points.pressure, "span": L0, "velocity": 0.0, "tension": 0.0}
        place = program.advance(place, points, seen, (points.motor, 0.0, 0.0), 1.0 / RATE)
    return asked


def test_every_sample_of_a_step_is_asked_for_in_its_order(program):
    steps, made = program
    asked = go(made, sum(s.count for s in steps))
    at = 0
    for number, step in enumerate(steps):
        part = asked[at : at + step.count]
        at += step.count
        assert [int(p.step) for p in part] == [number] * step.count and all(bool(p.running) for p in part)
        assert [bool(p.fresh) for p in part] == [True] + [False] * (step.count - 1)
        assert {bool(p.record) for p in part} == {step.record} and {int(p.mode) for p in part} == {
            (SPAN, TENSION)[step.mode == "tension"]
        }
        assert {float(p.open) for p in part} == {float(step.pressure is not None)}
        before = [0.0, 3e5, 3e5, 0.0][number]
        if step.pressure is None:
            assert [float(p.pressure) for p in part] == [before] * step.count  # as it was when it was shut
        else:
            np.testing.assert_allclose([float(p.pressure) for p in part], step.pressure, rtol=1e-12)
        np.testing.assert_allclose([float(p.motor) for p in part], step.motor, rtol=1e-12)


def test_after_its_end_the_last_set_points_stay_and_nothing_is_recorded(program):
    steps, made = program
    *_, last, after, later = go(made, sum(s.count for s in steps) + 2)
    for points in (after, later):
        assert (
            not (bool(points.running) or bool(points.record) or bool(points.fresh))
            and int(points.step) == len(steps) - 1
        )
        for name in ("mode", "open", "motor"):
            assert float(getattr(points, name)) == pytest.approx(float(getattr(last, name)), rel=0.05)


def test_a_line_has_its_rate_while_it_goes_and_a_wave_the_slope_between_its_samples():
    plan = parse_protocol(TEXT, where="t").expand(rest_length=L0).steps[:2]
    asked = go(Sequencer.of(plan, rest_length=L0, period=1.0 / RATE), 13)
    np.testing.assert_allclose([float(p.velocity) for p in asked[:5]], -0.1 * L0 / 0.05, rtol=1e-9)
    # a sine of 5 Hz over samples of 10 ms: differences are off by (pi 0.05)^2/6 of its fastest slope, below 1 %
    slope = 0.05 * L0 * 2.0 * np.pi * 5.0 * np.cos(2.0 * np.pi * 5.0 * np.arange(1, 7) / RATE)
    np.testing.assert_allclose([float(p.velocity) for p in asked[6:12]], slope, atol=0.02 * np.abs(slope).max())
