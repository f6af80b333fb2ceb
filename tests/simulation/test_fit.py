"""A simulation finds in a record of its motion the numbers with which it was made."""

import dataclasses
import functools
import math
import warnings

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben.muscles import LearnedResidual
from mckibben.muscles.elements import MaxwellChain
from mckibben.muscles.hysteresis.maxwell_slip import MaxwellSlip
from mckibben.muscles.hysteresis.slip import FrictionLimit
from mckibben.simulation.fit import RecordedDrive

FREE = {
    "muscle.law.rest_diameter": None,
    "muscle.law.rest_angle": ("15 deg", "40 deg"),
    "muscle.friction.*": None,
    "muscle.creep.stiffness": (0.5, 5.0),
}


@functools.cache
def bench(noise=False, window=None):
    """A weight on a muscle with friction and creep, on a regulator, at 50 Hz; perhaps with weights of zero in a window."""
    travel, force = np.array([0.05e-3, 0.3e-3, 2e-3, 12e-3]), np.array([4.7, 2.1, 3.9, 20.4])
    law = mk.muscle("DMSP-10-250").law
    if window is not None:
        law = LearnedResidual.beside(law, lengths=window, pressures=(1.5e5, 5.5e5), order=(3, 2))
    muscle = mk.Muscle(
        law,
        friction=MaxwellSlip(
            limit=FrictionLimit(constant=0.25 * force, per_pressure=0.75 * force / 5e5), stiffness=force / travel
        ),
        creep=MaxwellChain(stiffness=np.array([553.0, 40.0]), time_constant=np.array([1.0, 30.0])),
    )
    return mk.Simulation(
        mk.Weight(muscle, mass="5 kg", start="24.2 cm", damping=60.0),
        mk.Air(valve="regulator"),
        period="20 ms",
        step="1 ms",
        noise={"position": 5.8e-6, "pressure": 580.0} if noise else None,
    )


def other(noise=False):
    """The muscle of which the record is: as in CONTROL.md, another diameter and angle, more friction and creep."""
    unit = bench(noise).machine.units["muscle"]
    return bench(noise).with_arrays(
        {
            "units.muscle.law.rest_diameter": 1.05 * np.asarray(unit.law.rest_diameter),
            "units.muscle.law.rest_angle": np.asarray(unit.law.rest_angle) + math.radians(0.7),
            "units.muscle.friction.limit.constant": 1.5 * np.asarray(unit.friction.limit.constant),
            "units.muscle.friction.limit.per_pressure": 1.5 * np.asarray(unit.friction.limit.per_pressure),
            "units.muscle.friction.stiffness": 1.5 * np.asarray(unit.friction.stiffness),
            "units.muscle.creep.stiffness": 2.0 * np.asarray(unit.creep.stiffness),
        }
    )


TRUE = [1.05 * 0.01, None, 1.5, 2.0]


@functools.cache
def record(seed=11, noise=False, samples=600):
    """Random holds and ramps."""
    sim, random = other(noise), np.random.default_rng(seed)
    sim.reset(seed=seed)
    level = goal = 2.4e5
    for k in range(samples):
        if k % 40 == 0:
            goal, rate = random.uniform(2e5, 5e5), random.choice([2e3, 1e4, 1e6])
        level += float(np.clip(goal - level, -rate, rate))
        sim.step(muscle=level)
    return sim.recording()


@functools.cache
def fitted(noise=False):
    return bench(noise).fit(record(noise=noise), FREE, train=("0 s", "8 s"), measured=("position", "pressure"))


def test_four_numbers_of_another_muscle_are_found_in_the_record_of_its_motion():
    values = [e.value for e in fitted().estimates.values()]
    truth = [TRUE[0], float(bench().machine.units["muscle"].law.rest_angle) + math.radians(0.7), *TRUE[2:]]
    np.testing.assert_allclose(values, truth, rtol=5e-4)  # differences of the slopes leave 1e-6
    assert fitted().converged


def test_what_was_not_shown_is_predicted_as_well():
    assert fitted().rms("position", shown=False) < 1e-6  # of 20 mm
    seen = fitted().predict(record(seed=12))
    np.testing.assert_allclose(seen.position, record(seed=12)["load.position"], atol=1e-6)


def test_to_settle_for_a_time_is_to_hold_the_first_commands_that_long_before():
    sim = bench()
    run = RecordedDrive.of(sim, record(), None, "0.5 s", None)
    before = np.tile([run.held[name] for name in sim.commands], (25, 1))  # of 20 ms each
    longer = run._replace(commands=np.vstack([before, run.commands]), settle=0)
    whole = longer.predict(sim, {}, len(before) + 40, 1)
    assert np.array_equal(run.predict(sim, {}, 40, 1), whole[len(before) :])
    assert not np.array_equal(whole[:40], whole[len(before) :])  # creep goes on, so that the time counts


@pytest.mark.parametrize(("scale", "said"), [(1.0, 0), (1e-5, 1)])
def test_what_a_sensor_shows_at_rest_is_no_slip_of_a_unit_and_a_record_in_bar_is_one(scale, said):
    whole, name = record(samples=60), "muscle.command"
    vented = np.where(np.arange(61) % 20 < 10, 170.0, whole[name])  # some millibar off, for samples on end
    drive = whole.with_channels({name: mk.Channel(scale * vented, "Pa", whole.channels[name].kind, "pressure")})
    sim = bench().with_arrays({})
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        RecordedDrive.of(sim, drive, None, "0 s", None)
    assert len([one for one in caught if "inflates no muscle" in str(one.message)]) == said


SHOWN = np.arange(601)  # samples of `record`, with the one at the start
PARTS = {"half": SHOWN < 400, "what begins hidden, with gaps": (SHOWN % 200 >= 90) & (SHOWN < 500)}


@pytest.mark.parametrize("shown", PARTS.values(), ids=PARTS)
@pytest.mark.parametrize("learned", [False, True])
def test_what_is_not_shown_moves_no_bit(shown, learned):
    """Neither a start, a scale nor a weight of a learned potential comes from a sample that is hidden, whatever it is."""
    whole, free = record(noise=True), {"muscle.law.rest_diameter": None, "position.offset": None}
    if learned:
        free = {"muscle.law.weights": ("-0.1 J", "0.1 J"), "muscle.friction.*": None}

    def poisoned(by):
        return whole.with_channels(
            {
                name: mk.Channel(np.where(shown, c.values, by), c.unit, c.kind, c.meaning)
                for name, c in whole.channels.items()
                if not name.endswith(".command")
            }
        )

    sim = bench(True, INSIDE if learned else None)
    found = [sim.fit(one, free, train=shown, evaluations=4) for one in (whole, poisoned(np.nan), poisoned(1e9))]
    for other in found[1:]:
        assert other.estimates == found[0].estimates
        assert other.cautions == found[0].cautions


def test_intervals_hold_the_truth_under_noise_and_shrink_with_it():
    found = fitted(noise=True)
    truth = [TRUE[0], float(bench().machine.units["muscle"].law.rest_angle) + math.radians(0.7), *TRUE[2:]]
    for estimate, true in zip(found.estimates.values(), truth, strict=True):
        width = estimate.high - estimate.low
        assert (
            abs(estimate.value - true) < 1.5 * width
        )  # three standard deviations and more, one in 400 fails: seed fixed
        assert width < 0.05 * true
    assert found.rms("position") == pytest.approx(5.8e-6, rel=0.2)  # the noise of the sensor, and no more


def test_a_sensor_that_is_late_and_off_is_told_from_the_muscle():
    whole, late = record(), 2
    position = np.concatenate([np.full(late, whole["load.position"][0]), whole["load.position"][:-late]]) + 3e-4
    sensor = mk.Channel(position, "m", "measured", "laser")
    found = bench().fit(
        whole.with_channels({"laser": sensor}),
        {"muscle.law.rest_diameter": None, "muscle.law.rest_angle": None, "muscle.friction.*": None,
         "muscle.creep.stiffness": None, "position.delay": ("0 s", "0.2 s"), "position.offset": None},
        channels={"position": "laser"}, measured=("position",), train=slice(50, None),
    ).estimates  # fmt: skip
    assert found["position.offset"].value == pytest.approx(3e-4, rel=0.01)
    assert found["position.delay"].value == pytest.approx(0.04, rel=0.01)  # straight between samples


WEIGHTS = {"law.weights": ("-0.1 J", "0.1 J")}
INSIDE, BEYOND = (0.2, 0.25), (0.28, 0.3)  # of the lengths of the records [m]


def test_weights_of_a_residual_are_found_and_predict_what_was_not_shown():
    truth = np.array([[0.02, -0.01], [0.015, 0.02], [-0.01, 0.005]])
    none = bench(window=INSIDE)
    real = bench(noise=True, window=INSIDE).with_arrays({"units.muscle.law.weights": truth})
    real.reset(seed=1)
    for command in record()["muscle.command"]:
        real.step(muscle=float(command))
    shown = real.recording()
    found = none.fit(shown, WEIGHTS, train=("0 s", "8 s"), measured=("position",))
    off = dataclasses.replace(found, simulation=none).predict(shown).position - shown["measured.position"]
    before = np.sqrt(np.mean(off**2))
    assert before > 1e-4 and found.rms("position", shown=False) < 0.1 * before
    assert all(np.isfinite([e.low, e.high]).all() for e in found.estimates.values())


def test_weights_of_which_a_record_tells_nothing_are_held_at_zero():
    found = bench(window=BEYOND).fit(
        record(noise=True, samples=100), {**WEIGHTS, "load.mass": None}, measured=("position",)
    )
    weights = list(found.estimates.values())[:-1]
    assert [e.value for e in weights] == [0.0] * 6
    # the prior alone: ten sizes of 0.02 J are its deviation, so that 95 % are about twice as wide, and cut at the bounds
    assert all(e.low == -0.1 and e.high == 0.1 for e in weights)


def test_what_the_record_cannot_tell_is_said():
    found = bench().fit(
        record(), {"load.mass": ("1 kg", "4 kg"), "muscle.law.rest_diameter": None}, train=slice(0, 100)
    )
    assert any("bound" in str(c) for c in found.cautions)
    with pytest.raises(InputError, match="do not depend"):
        bench().fit(record(), {"muscle.law.thread_strain": None}, train=slice(0, 60))


@pytest.mark.parametrize(
    ("free", "said"),
    [
        ({}, "at least one parameter"),
        ({"muscle.law.rest_diametre": None}, "rest_diameter"),
        ({"rest_diameter": ("2 cm", "1 cm")}, "free rest_diameter must be a least value and then a larger one"),
        ({"law.rest_diameter": "1 cm"}, "pair"),
        ({"conductance": None}, "is one of"),
    ],
)
def test_a_free_parameter_that_cannot_be_is_refused_in_a_sentence(free, said):
    with pytest.raises(InputError, match=said):
        bench().fit(record(), free)


@pytest.mark.parametrize("evaluations", [0, -1, 2.5, math.nan, "5", None])
def test_a_number_of_runs_that_is_none_is_refused(evaluations):
    """NaN searched without an end."""
    with pytest.raises(InputError, match="evaluations must be a whole number from 1"):
        bench().fit(record(), {"load.mass": None}, evaluations=evaluations)


def test_a_record_of_another_clock_or_without_commands_is_refused():
    with pytest.raises(InputError, match=r"0\.02 s.*uniform\(0\.02\)"):
        bench().fit(record().uniform(0.01), {"load.mass": None})
    with pytest.raises(InputError, match="no command of muscle"):
        bench().fit(record().pick(["load.position"]), {"load.mass": None})
    with pytest.raises(InputError, match="laser"):
        bench().fit(record(), {"load.mass": None}, channels={"position": "laser"})
    with pytest.raises(InputError, match="Unknown channels 'positon'. Did you mean 'position'"):
        bench().fit(record(), {"load.mass": None}, channels={"positon": "position"})
    for measured in ([], "position"):
        with pytest.raises(InputError, match="measured must be names of one field or more"):
            bench().fit(record(), {"load.mass": None}, measured=measured)
    with pytest.raises(InputError, match=r"channel of position must be one in m, as position is, not in m/s"):
        bench().fit(record(), {"load.mass": None}, channels={"position": "load.velocity"})
    with pytest.raises(InputError, match="settle must be from 0 s to 1000 s, got 1e.09 s"):
        bench().fit(record(), {"load.mass": None}, settle=1e9)
    with pytest.raises(
        InputError, match="free load.mass must be a least value and then a larger one, got '3 kg and 1 kg'"
    ):
        bench().fit(record(), {"load.mass": ("3 kg", "1 kg")})
    with pytest.raises(InputError, match="two samples"):
        bench().fit(record(), {"load.mass": None}, train=slice(0, 1))


@pytest.mark.parametrize(("end", "words"), [(600, "was 600 ms meant"), ("600 s", "was 600 ms meant"), ("1 s", None)])
def test_a_train_that_ends_long_after_its_record_is_said(end, words):
    """All is shown then, and nothing is left to tell how far the numbers carry."""
    shown = record(samples=60)  # 0.6 s; of twice its length nothing is said
    found = bench().fit(shown, {"load.mass": None}, train=(0, end), evaluations=3)
    said = [str(one) for one in found.cautions if one.parameter == "train"]
    assert (words in said[0]) if words else said == []
