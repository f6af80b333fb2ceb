"""What no muscle, element, circuit, tube, loop or clock can be is refused in a sentence; what lies next to it is taken."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

import mckibben as mk
from mckibben.analysis.loops import TensionLoop, TensionPath, closed_area, loop_ratio, mean_loop, path_distance
from mckibben.engine.integration import _samples
from mckibben.errors import InputError
from mckibben.muscles.elements import Delay
from mckibben.muscles.hysteresis.bouc_wen import BoucWen
from mckibben.muscles.hysteresis.maxwell_slip import MaxwellSlip
from mckibben.muscles.hysteresis.slip import FrictionLimit, require_each
from mckibben.pneumatics.circuit import Branch, Circuit, _closed
from mckibben.pneumatics.compressor import Compressor
from mckibben.pneumatics.distributed.ends import ReservoirEnd, Restriction
from mckibben.pneumatics.distributed.tube import DistributedTube, _sample_count, _start
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.volume import FixedVolume, Reservoir
from mckibben.simulation.simulation import _whole_steps

ONE, TWO = FrictionLimit(constant=1.0), FrictionLimit(constant=np.array([1.0, 2.0]))
PATH = TensionPath(np.linspace(0.1, 0.2, 11), np.linspace(1.0, 2.0, 11), 0.01)
TUBE = DistributedTube(length=1.0, diameter=4e-3, cells=4)
END = ReservoirEnd(pressure_abs=1e5)
VESSEL = {"a": FixedVolume(volume=1e-4), "b": Reservoir()}


def circuit(element, ports=("a", "b"), **command):
    return Circuit.of(VESSEL, {"v": Branch(element, ports, **command)})


def signals(*counts):
    return {str(i): SimpleNamespace(values=np.zeros(count)) for i, count in enumerate(counts)}


def hiding():
    class Law(mk.TensionLaw):
        tension: float = mk.quantity("N", (0.0, 1.0), "of it")


TAKEN = {
    "two elements with an amount each": lambda: require_each(
        "w", {"a": np.ones(2), "b": 0.0, "c": np.ones(1)}, np.ones(2)
    ),
    "one element": lambda: require_each("w", {"a": 1.0, "b": 2.0}),
    "exponents with a closed form": lambda: [BoucWen(limit=ONE, stiffness=1.0, exponent=n) for n in (1, 2)],
    "gamma up to beta": lambda: [BoucWen.from_coefficients(stiffness=1.0, beta=2.0, gamma=g) for g in (-1.9, 2.0)],
    "one contact": lambda: MaxwellSlip.geometric(limit=ONE, elements=1, shortest=1e-4, longest=1e-2),
    "no delay": lambda: [Delay.of(time=t, sample_period=1e-3) for t in (0.0, 3e-3, 3e-3 + 9e-10)],
    "a switch at one pressure": lambda: Compressor(
        displacement=1e-5, speed=100.0, start_pressure=5e5, stop_pressure=5e5
    ),
    "four cells": lambda: DistributedTube(length=1.0, diameter=4e-3, cells=4, roughness=2e-4),
    "a list of times": lambda: ReservoirEnd(pressure_abs=np.array([1e5, 2e5]), times=np.array([0.0, 1.0])),
    "a state in every cell": lambda: _start(TUBE, END, END, np.full(4, 1e5), 293.0, np.zeros(4)),
    "a function": lambda: Restriction(flow=lambda p, t, q: p - q),
    "whole samples": lambda: [_sample_count(1.0, p) for p in (1.0, 0.5, 0.1, 0.5 * (1.0 + 9e-7))],
    "two samples": lambda: _samples(signals(2, 2), 1e-3, 1e-3, "ros2"),
    "a minute of steps": lambda: [_whole_steps(1e-3, s) for s in (1e-3, 1.0)],
    "a pressure just above vacuum": lambda: circuit(Orifice(conductance=1e-8)).initial({"a": 1e-3}),
    "two points of a path": lambda: [path_distance(PATH, PATH, trim=t, points=2) for t in (0.0, 0.49)],
    "all contractions": lambda: [mk.muscle("nylon").length_at(c) for c in (-0.999, 0.0, 0.999)],
}
REFUSED = {
    "an amount without an axis": (
        lambda: require_each("w", {"a": np.ones(2), "b": 1.0}),
        "w: b must have a value for each of 2 elements, or all have 2 times as much together: share it",
    ),
    "other numbers of elements": (
        lambda: require_each("w", {"a": np.ones(2)}, np.ones(3)),
        "w: a must have as many elements as the others, got 2 and 3",
    ),
    "a third power": (lambda: BoucWen(limit=ONE, stiffness=1.0, exponent=3), "BoucWen: exponent must be 1 or 2, got 3"),
    "gamma above beta": (
        lambda: BoucWen.from_coefficients(stiffness=1.0, beta=2.0, gamma=2.1),
        "must be between -2 and 2",
    ),
    "gamma that is minus beta": (
        lambda: BoucWen.from_coefficients(stiffness=1.0, beta=2.0, gamma=-2.0),
        "with beta + gamma > 0",
    ),
    "no contact": (
        lambda: MaxwellSlip.geometric(limit=ONE, elements=0, shortest=1e-4, longest=1e-2),
        "elements must be 1 or more, got 0",
    ),
    "a part of a sample": (
        lambda: Delay.of(time=2.5e-3, sample_period=1e-3),
        "must be a multiple of the sample period",
    ),
    "a delay before its time": (lambda: Delay.of(time=-1e-3, sample_period=1e-3), "must be 0 s or more"),
    "a delay without a clock": (lambda: Delay.of(time=1e-3, sample_period=0.0), "with a sample period above 0 s"),
    "half a sample": (lambda: Delay(samples=1.5), "samples must be a whole number, 0 or more, got 1.5"),
    "a truth of samples": (lambda: Delay(samples=True), "samples must be a whole number, 0 or more"),
    "samples below none": (lambda: Delay(samples=-1), "samples must be a whole number, 0 or more, got -1"),
    "a parameter that hides a method": (hiding, "Law.tension hides what every law has of that name"),
    "a span that is none": (
        lambda: mk.muscle("nylon").law.pressure_for(10.0, math.nan),
        "span must be a number, got nan m",
    ),
    "a highest pressure that is none": (
        lambda: mk.muscle("nylon").law.pressure_for(10.0, 0.13, highest=math.inf),
        "highest must be a number, got inf Pa",
    ),
    "a switch that starts above its stop": (
        lambda: Compressor(displacement=1e-5, speed=100.0, start_pressure=6e5, stop_pressure=5e5),
        "must be up to the stop_pressure of 5 bar, got 6 bar",
    ),
    "a compressor without memory": (
        lambda: Compressor(displacement=1e-5, speed=100.0).running((), 1.0),
        "memory is missing: pass the circuit's",
    ),
    "three cells": (lambda: DistributedTube(length=1.0, diameter=4e-3, cells=3), "cells must be 4 or more, got 3"),
    "cells that are none": (lambda: DistributedTube(length=1.0, diameter=4e-3, cells=4.0), "cells must be 4 or more"),
    "another wall": (lambda: DistributedTube(length=1.0, diameter=4e-3, wall="warm"), "wall must be "),
    "a rough wall": (
        lambda: DistributedTube(length=1.0, diameter=4e-3, roughness=2.1e-4),
        "must be up to 5 % of the diameter",
    ),
    "times that stand": (
        lambda: ReservoirEnd(pressure_abs=np.ones(2) * 1e5, times=np.zeros(2)),
        "must be one list of rising times",
    ),
    "times in rows": (
        lambda: ReservoirEnd(pressure_abs=1e5, times=np.zeros((1, 1))),
        "must be one list of rising times",
    ),
    "a pressure too many": (
        lambda: ReservoirEnd(pressure_abs=np.ones(3) * 1e5, times=np.arange(2.0)),
        "pressure_abs must be one, or (2,), got (3,)",
    ),
    "a temperature too many": (
        lambda: ReservoirEnd(pressure_abs=1e5, temperature=np.full(2, 293.0)),
        "temperature must be one, or (), got (2,)",
    ),
    "no flow": (lambda: Restriction(flow=3.0), "flow must be an element or a function"),
    "a state in three of four cells": (
        lambda: _start(TUBE, END, END, np.full(3, 1e5), 293.0, 0.0),
        "pressure_abs must be one, or one for each of 4 cells",
    ),
    "no finite velocity": (lambda: _start(TUBE, END, END, 1e5, 293.0, math.nan), "velocity must be finite values"),
    "a cold start": (lambda: _start(TUBE, END, END, 1e5, 50.0, 0.0), "temperature must be between"),
    "no time": (lambda: _sample_count(0.0, 0.1), "duration must be a time above 0 s"),
    "no end": (lambda: _sample_count(math.inf, 0.1), "duration must be a time above 0 s"),
    "no sample": (lambda: _sample_count(1.0, -0.1), "sample_period must be a time above 0 s"),
    "a sample beyond the end": (
        lambda: _sample_count(1.0, 3.0),
        "sample_period must be a whole part of the duration, 1 s",
    ),
    "a broken sample": (lambda: _sample_count(1.0, 0.3), "sample_period must be a whole part of the duration, 1 s"),
    "no signal": (lambda: _samples({}, 1e-3, 1e-3, "auto"), "signals must be at least one, which says how long to run"),
    "one sample": (lambda: _samples(signals(1, 1), 1e-3, 1e-3, "auto"), "must be equal lengths of two samples or more"),
    "other lengths": (
        lambda: _samples(signals(3, 2), 1e-3, 1e-3, "auto"),
        "must be equal lengths of two samples or more",
    ),
    "no period": (lambda: _samples(signals(2), math.inf, 1e-3, "auto"), "period must be a time above 0 s"),
    "no step": (lambda: _samples(signals(2), 1e-3, 0.0, "auto"), "step_size must be a time above 0 s"),
    "another method": (lambda: _samples(signals(2), 1e-3, 1e-3, "rk5"), "Unknown method 'rk5'. Did you mean 'rk4'"),
    "a frequency for a period": (lambda: _whole_steps(50.0, 1e-3), "50 Hz are a period of 0.02 s"),
    "a step of no size": (lambda: _whole_steps(1.0, 1e-12), "a period takes at most"),
    "a period of no size": (lambda: _whole_steps(0.0, 1e-3), "period must be a time above 0 s, got 0 s"),
    "a step below none": (lambda: _whole_steps(1e-3, -1.0), "step must be a time above 0 s, got -1 s"),
    "a title that is none": (
        lambda: mk.Simulation(mk.Weight("nylon", mass="1 kg"), title=3),
        "title must be text, got 3",
    ),
    "a volume without a pressure": (
        lambda: circuit(Orifice(conductance=1e-8)).initial({}),
        "circuit: pressure of a is missing: every volume needs one",
    ),
    "a vacuum": (
        lambda: circuit(Orifice(conductance=1e-8)).initial({"a": 0.0}),
        "pressure of a must be an absolute pressure above 0 Pa",
    ),
    "a port too few": (
        lambda: circuit(Orifice(conductance=1e-8), ("a",)),
        "circuit: v must have a node at a and b, got 'a'",
    ),
    "no signal at a valve": (
        lambda: _closed("v", Branch(SimpleNamespace(ports=("a", "b"), commanded=True), ("a", "b")), VESSEL),
        "v.command is missing: a signal must drive it",
    ),
    "no loops": (lambda: mean_loop([]), "loops must be one or more"),
    "a flat loop": (
        lambda: loop_ratio(_loop(), _loop(width=0.0)),
        "loop must enclose an area",
    ),
    "a loop without an area": (
        lambda: loop_ratio(_loop(), _loop(area=0.0)),
        "loop must enclose an area",
    ),
    "other lengths of a loop": (lambda: closed_area([0.0, 1.0], [0.0]), "length and tension must be two of one length"),
    "a path cut to nothing": (lambda: path_distance(PATH, PATH, trim=0.5), "must be from 0 to below 0.5 and 2 or more"),
    "a path beyond its end": (
        lambda: path_distance(PATH, PATH, trim=-0.01),
        "must be from 0 to below 0.5 and 2 or more",
    ),
    "one point of a path": (lambda: path_distance(PATH, PATH, points=1), "must be from 0 to below 0.5 and 2 or more"),
    "paths that meet in a point": (
        lambda: path_distance(PATH, PATH._replace(length=PATH.length + 0.1)),
        "paths must be two with lengths in common",
    ),
    "a contraction to nothing": (
        lambda: mk.muscle("nylon").length_at(1.0),
        "contraction must be between -100 % and 100 %",
    ),
    "a creep that is none": (
        lambda: mk.muscle("nylon", creep=3),
        "creep must be an element such as MaxwellChain, got 3",
    ),
    "a friction that is none": (
        lambda: mk.muscle("nylon", friction=3),
        "friction must be a friction such as MaxwellSlip",
    ),
    "several rest lengths": (
        lambda: mk.muscle("nylon", rest_length=[0.1, 0.2]),
        "rest_length must be one number, got [0.1, 0.2]",
    ),
    "a law of a law": (
        lambda: mk.muscle("ideal", law="ideal", thread_length=0.2, turns=3.0),
        "law is allowed only with a specimen",
    ),
    "an unnamed muscle in a file": (
        lambda: mk.Muscle(mk.muscle("nylon").law).save("a.toml"),
        "specimen is missing: only a muscle of a specimen",
    ),
    "arrays that do not fit": (
        lambda: mk.muscle("nylon").tension([0.13, 0.14], [1e5, 2e5, 3e5]),
        "length and pressure must have shapes that fit together, got (2,) and (3,)",
    ),
}


def _loop(**changes):
    return TensionLoop(*[1.0] * len(TensionLoop._fields))._replace(**({"length_high": 2.0} | changes))


@pytest.mark.parametrize("case", TAKEN)
def test_what_lies_next_to_it_is_taken(case):
    TAKEN[case]()


@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_is_refused_in_one_sentence(case):
    act, says = REFUSED[case]
    with pytest.raises(InputError) as error:
        act()
    assert says in str(error.value) and "\n" not in str(error.value)


def test_whole_samples_and_steps_are_counted_and_rounding_makes_none_more():
    assert [_sample_count(1.0, p) for p in (1.0, 0.5, 0.1)] == [1, 2, 10] and _samples(
        signals(5), 1e-3, 1e-4, "rk4"
    ) == 4
    assert [_whole_steps(1e-3, s) for s in (2e-3, 1e-3, 0.5e-3, 0.3e-3, 1e-3 / 3.0)] == [1, 1, 2, 4, 3]
    assert [Delay.of(time=t, sample_period=1e-3).samples for t in (0.0, 2e-3)] == [0, 2]
    assert loop_ratio(_loop(width=2.0, height=3.0, area=5.0, length_high=8.0), _loop()) == (2.0, 3.0, 5.0, 7.0)
