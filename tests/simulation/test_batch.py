"""Many simulations side by side."""

import copy
import pickle

import numpy as np
import pytest
from stepped_systems import drive, driven, joint

from mckibben.errors import InputError


def test_every_lane_does_what_the_simulation_does_alone_bit_for_bit():
    sim, lanes = joint(), 70  # one more block than a whole number of them
    sim.reset(pressure="2 bar")
    alone = driven(sim, 30)
    many = sim.batch(lanes)
    many.reset(pressure="2 bar")
    for k in range(30):
        seen = many.step(**drive(k))
    for name, value in zip(seen._fields[1:], alone[-1][1:], strict=True):
        assert getattr(seen, name).tolist() == [value] * lanes


def test_lanes_differ_by_command_and_by_parameter():
    sim = joint()
    many = sim.batch(3, {"load.inertia": [2e-3, 4e-3, 8e-3]})
    many.reset(pressure="2 bar")
    for _ in range(15):
        seen = many.step(flexor=np.array([0.3, 0.3, 0.3]), extensor=-0.3)
    assert seen.angle[0] > seen.angle[1] > seen.angle[2] > 0.0
    lane = sim.with_parameters({"load.inertia": 8e-3})
    lane.reset(pressure="2 bar")
    for _ in range(15):
        alone = lane.step(flexor=0.3, extensor=-0.3)
    assert alone.angle == seen.angle[2]
    np.testing.assert_allclose(many.recording(2)["joint.angle"][-1], seen.angle[2], atol=1e-12)  # rounding


def test_a_batch_goes_on_from_a_saved_state_bit_for_bit():
    many = joint().batch(3)
    many.reset(pressure="2 bar")
    for _ in range(10):
        many.step(flexor=np.array([0.1, 0.2, 0.3]))
    state = many.save_state()
    first = [many.step(extensor=0.1).angle.tolist() for _ in range(5)]
    many.load_state(state)
    assert [many.step(extensor=0.1).angle.tolist() for _ in range(5)] == first


def test_copies_and_pickles_of_simulations_and_batches_go_on_bit_for_bit_and_apart():
    sim = joint(noisy=True)
    for whole in (sim, sim.batch(2, {"load.inertia": [2e-3, 4e-3]})):
        whole.reset(seed=3, pressure="2 bar")
        seen = whole.step(flexor=0.2)
        np.testing.assert_equal(pickle.loads(pickle.dumps(seen)), seen)
        others = copy.deepcopy(whole), pickle.loads(pickle.dumps(whole))
        after = [whole.step(extensor=0.1) for _ in range(5)]
        for other in others:  # what one does moves no other
            np.testing.assert_equal([other.step(extensor=0.1) for _ in range(5)], after)
            np.testing.assert_array_equal(other.recording()["joint.angle"], whole.recording()["joint.angle"])


@pytest.mark.parametrize(
    ("call", "word"),
    [
        (lambda many: many.step(flexor=np.zeros(4)), "3 values"),
        (lambda many: many.step(biceps=0.0), "flexor"),
        (lambda many: many.recording(3), "between 0 and 2"),
        (lambda many: many.simulation.batch(0), "whole number from 1"),
        (lambda many: many.simulation.batch(2, {"load.inertia": [1.0, 1.0, 1.0]}), "2 lanes"),
    ],
)
def test_what_does_not_fit_is_refused(call, word):
    with pytest.raises(InputError, match=word):
        call(joint().batch(3))


def test_a_lane_that_needs_shorter_steps_takes_them_alone():
    sim, lanes = joint(step=4e-4), 12  # twice the usual step, too long for some commands and not for others
    openings = np.linspace(0.0, 1.0, lanes)
    many = sim.batch(lanes)
    many.reset(pressure="2 bar")
    for _ in range(12):
        seen = many.step(flexor=openings, extensor=-openings)
    taken = []
    for lane in range(lanes):
        sim.reset(pressure="2 bar")
        steps = set()
        for _ in range(12):
            alone = sim.step(flexor=openings[lane], extensor=-openings[lane])
            steps.add(sim._kernel.steps_taken)
        taken.append(max(steps))
        assert alone[1:] == tuple(values[lane] for values in seen[1:])
    assert min(taken) < max(taken)


def test_lanes_go_on_from_moments_of_the_simulation_bit_for_bit():
    sim = joint()
    sim.reset(pressure="2 bar")
    moments = []
    for k in range(3):
        driven(sim, 5, 5 * k)
        moments.append(sim.save_state())
    many = sim.batch(3)
    many.load_states(moments)
    for _ in range(5):
        seen = many.step(**drive(40))
    for lane, moment in enumerate(moments):
        sim.load_state(moment)
        for _ in range(5):
            alone = sim.step(**drive(40))
        assert alone[1:] == tuple(values[lane] for values in seen[1:])
    assert many.load_states(moments[1]).angle.tolist() == [moments[1].observed[0]] * 3
    with pytest.raises(InputError, match="one or 3"):
        many.load_states(moments[:2])
