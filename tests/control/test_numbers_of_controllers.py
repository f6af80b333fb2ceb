"""Laws of the numbers that a controller, its task, its plant and its reference take: no slip is taken without a word.

Every number is tried a thousand times too large and too small, negative, not a number, and as something else than a number;
each is a sentence or a caution, which is a warning too.
"""

import inspect
import math
import re
import warnings

import numpy as np
import pytest

import mckibben as mk
from mckibben.control import (
    BENCHES,
    LQI,
    PID,
    REFERENCES,
    ControlTask,
    InverseControl,
    IterativeLearning,
    Plant,
    PredictiveControl,
    control_task,
    score,
    unseen_plants,
)
from mckibben.control.controllers import PID_GAINS, USUAL
from mckibben.control.steps import RestingIntegral
from mckibben.control.task import RANGES

MADE = (PID, InverseControl, LQI, IterativeLearning, PredictiveControl)
BENCH = {"m": "B1", "rad": "J1"}


@pytest.fixture(scope="module")
def tasks():
    return {unit: control_task(bench) for unit, bench in BENCH.items()}


def said(make):
    """The sentence of a refusal, or the cautions, of which each has to be a warning too."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            made = make()
        except mk.MckibbenError as error:
            return str(error)
    sentences = [str(one) for one in made.cautions]
    assert {str(one.message) for one in caught} == set(sentences)
    return "; ".join(sentences)


def arguments(*units, quantities=False):
    """Each number of each controller that ships, for the units of output that it takes; perhaps without flags and counts."""
    return [
        pytest.param(made, name, unit, id=f"{made.__name__}-{name}-{unit}")
        for made in MADE
        for name in list(inspect.signature(made.__init__).parameters)[2:]
        for unit in (("m",) if made is LQI else units)
        if not (quantities and made.settings[name].unit in ("flag", "count"))
    ]


def usual(made, name, unit):
    default = inspect.signature(made.__init__).parameters[name].default
    return (PID_GAINS if made is PID else USUAL)[name][unit] if default is None else default


@pytest.mark.parametrize(("made", "name", "unit"), arguments("m", "rad", quantities=True))
@pytest.mark.parametrize("factor", [1e3, 1e-3])
def test_a_number_a_thousand_times_off_is_said_and_the_usual_one_is_not(made, name, unit, factor, tasks):
    value = usual(made, name, unit)
    if value == 0.0:
        value = math.sqrt(math.prod(made.settings[name].usual)) / RANGES[unit]  # none by default
    assert name.replace("_", " ") in said(lambda: made(tasks[unit], **{name: factor * value}))


@pytest.mark.parametrize("made", MADE)
def test_a_controller_with_its_usual_numbers_is_made_without_a_word(made, tasks):
    for unit in ("m",) if made is LQI else BENCH:
        assert said(lambda unit=unit: made(tasks[unit])) == ""


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0, "5 furlongz", "3 K", "many", True, [], {}])
@pytest.mark.parametrize(("made", "name", "unit"), arguments("m"))
def test_what_is_no_number_for_a_controller_is_refused_in_a_sentence_that_names_it(made, name, unit, value, tasks):
    if value is True and made.settings[name].unit == "flag":
        return
    with pytest.raises(mk.InputError, match=name):
        made(tasks[unit], **{name: value})


def test_words_with_a_unit_are_the_numbers_that_they_say(tasks):
    words, numbers = (
        PID(tasks["m"], proportional=gain, velocity_lag=lag) for gain, lag in (("0.3 bar/mm", "20 ms"), (3e7, 0.02))
    )
    assert np.array_equal(
        *(np.concatenate([np.ravel(v) for v in one._parameters.values()]) for one in (words, numbers))
    )


@pytest.mark.parametrize("made", MADE)
def test_what_is_no_task_is_refused(made):
    with pytest.raises(mk.InputError, match="task must be a ControlTask"):
        made("B1")


def of_task(tasks, **changes):
    task = tasks["m"]
    fields = {
        "model": task.model,
        "field": "position",
        "zero": task.zero,
        "sign": -1.0,
        "actuators": {"muscle": (0.0, 1.0)},
    }
    return ControlTask(**fields | {"limits": task.limits} | changes)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"field": "positon"}, "Did you mean 'position'"),
        ({"zero": math.nan}, "zero must be a finite number"),
        ({"zero": 246.0}, "was 246 mm meant"),
        ({"sign": 2.0}, "sign must be 1 or -1"),
        ({"actuators": {"musle": (0.0, 1.0)}}, "Did you mean 'muscle'"),
        ({"actuators": {}}, "must name one command"),
        ({"actuators": {"muscle": 3}}, "must be a pair, offset and slope"),
        ({"limits": (0, 6)}, "was 6 bar meant"),
        ({"limits": (6e5, 0)}, "limits must be the smallest"),
        ({"limits": (0, math.nan)}, "limits must be a finite number"),
        ({"limits": 3}, "limits must be a pair"),
        ({"unit": "mm"}, "unit must be that of the field position, m"),
        ({"unit": "rad"}, "unit must be that of the field position, m"),
        ({"model": "B1"}, "model must be a Simulation"),
    ],
)
def test_a_task_that_cannot_be_is_refused_or_said(changes, sentence, tasks):
    assert sentence in said(lambda: of_task(tasks, **changes))


def test_what_is_said_of_a_task_stays_with_its_controllers_and_their_scores(tasks):
    with pytest.warns(mk.errors.PlausibilityWarning, match="was 6 bar meant"):
        task = of_task(tasks, limits=("0 bar", 6))
    assert PID(task).cautions == task.cautions != ()

    def slow(task):
        return PID(task, velocity_lag=20.0)

    with pytest.warns(mk.errors.PlausibilityWarning, match="was 20 ms meant"):
        answer = score([slow], plants=0, duration="3 s")
    assert "was 20 ms meant" in str(answer.cautions)


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: Plant(friction="maxwel"), "Did you mean 'maxwell'"),
        (lambda: Plant(band="x"), "band"),
        (lambda: Plant(load=math.nan), "load must be a finite number"),
        (lambda: Plant(mass=-1.0), "mass must be zero or more"),
        (lambda: unseen_plants(-3), "count must be a whole number"),
        (lambda: unseen_plants(1.5), "count must be a whole number"),
        (lambda: REFERENCES["R2"].samples(0.0), "period must be above zero"),
        (lambda: REFERENCES["R2"].samples(-1), "period must be above zero"),
        (lambda: REFERENCES["R2"].samples("10 us", duration="1 day"), "period must be above zero"),
        (lambda: REFERENCES["R2"].samples(math.nan), "period must be a finite number"),
        (lambda: REFERENCES["R2"].samples(0.01, -1), "preview must be a whole number"),
        (lambda: REFERENCES["R2"].samples(0.01, 0, -5), "the duration, -5 s, a sample or more"),
        (lambda: score([], plants=0), "controller must be one name or more"),
        (lambda: score("pid", plants=1.5), "plants must be a whole number"),
        (lambda: PredictiveControl(control_task("B1"), moves=17), "moves must be 16 at most"),
    ],
)
def test_a_plant_a_reference_and_a_score_that_cannot_be_are_refused_in_a_sentence(make, sentence):
    with pytest.raises(mk.InputError, match=sentence):
        make()


def test_a_plant_takes_words_with_a_unit():
    assert Plant(dead_time="30 ms", supply="7 bar", friction_scale="160 %") == Plant(friction_scale=1.6)
    assert BENCHES["B1"].simulation(Plant(supply="7 bar")).cautions == ()


def test_an_integral_rests_alike_by_numpy_and_by_jax():
    one = other = RestingIntegral(0.0, 0.0)
    for k, rests in enumerate([0.0, 3.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0]):
        one, other = one.add(0.1 * k, rests, 0.01), other.add(0.1 * k, rests, 0.01, np)
        assert float(one.value) == float(other.value) and float(one.rests) == float(other.rests)


@pytest.mark.parametrize(
    ("slope", "sentence"),
    [
        (0.0, "slope of muscle is 0: must not be 0|slope of muscle must not be 0"),
        (1e5, "slope of muscle of 100000 makes commands of"),
        (1e-5, "was 6 bar meant"),
    ],
)
def test_a_slope_that_turns_limits_into_commands_that_cannot_be_meant_is_said(slope, sentence, tasks):
    assert re.search(sentence, said(lambda: of_task(tasks, actuators={"muscle": (0.0, slope)}, limits=(0.0, 6e5))))


def test_a_slope_that_hardly_moves_a_valve_is_said():
    spool = mk.Simulation(mk.Weight("nylon", mass="2 kg"), mk.Air(), period="5 ms")
    fields = {"model": spool, "field": "position", "zero": 0.1, "sign": 1, "limits": (-1, 1)}
    assert "hardly any of its range" in said(lambda: ControlTask(**fields, actuators={"muscle": (0, 1e-3)}))
    assert said(lambda: ControlTask(**fields, actuators={"muscle": (0, 0.5)})) == ""


@pytest.mark.parametrize("reference", REFERENCES.values())
def test_samples_show_their_reference_or_are_refused(reference):
    with pytest.raises(mk.InputError, match=f"period .*must be shorter: between samples {reference.name}"):
        reference.samples("10 s" if reference.duration > 10.0 else "5 s")
    with pytest.raises(mk.InputError, match="must be shorter"):
        reference.samples(2.5 if reference.hold else 1.0)
    assert len(reference.samples("10 ms")) == round(reference.duration / 0.01)


def test_a_controller_is_scored_once():
    with pytest.raises(mk.InputError, match="controller .*must be stated once"):
        score("memory-inverse, pid, memory-inverse", plants=0, duration="4 s")
    with pytest.raises(mk.InputError, match="must be stated once"):
        score([lambda task: PID(task), lambda task: LQI(task)], plants=0, duration="4 s")
