"""Angle and stiffness of an antagonist pair: the map, the controller alone, and runs that share one structure."""

import dataclasses
import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.assembly import pair_map as maps
from mckibben.assembly.build import rig_unit
from mckibben.bench.joint_run import joint_stand, run_joint
from mckibben.engine.signals import Value
from mckibben.errors import InputError

DT = 1e-3
COUNT = 2.0 * np.pi / 20000  # of the encoder [rad]


@functools.cache
def nylon(friction=1.0):
    unit = rig_unit("nylon")
    return unit.replace(friction=unit.friction.lubricated(friction))


@functools.cache
def stand(friction=1.0, damping=0.01, weight=0.0):
    return joint_stand(nylon(friction), joint={"damping": damping, "gravity_moment": weight})


SLICK = 1e-4  # of the friction: as good as none, with the structure of a muscle that has some


def course(*levels):
    """A function of time from (time, value) pairs, the first of them at zero."""
    return lambda t: np.select([t >= begins for begins, _ in levels[::-1]], [value for _, value in levels[::-1]])


@functools.cache
def stepped():
    return run_joint(stand(), duration=1.499, angle=course((0, 0), (0.2, 0.3)), stiffness=1.0)


@functools.cache
def stiffened():
    wanted = course((0, 0.7), (0.2, 1.4), (0.7, 0.7))
    return run_joint(stand(), duration=1.499, angle=0.15, stiffness=wanted)


@functools.cache
def contracted():
    wanted = course((0, 0.6), (0.3, 0.8), (0.6, 1.0), (0.9, 1.2), (1.2, 1.4))
    return run_joint(stand(SLICK), duration=1.499, angle=0.1, stiffness=wanted, active=0.0)


@functools.cache
def pushed(friction):
    push = course((0, 0), (0.1, 0.1))
    damped = stand(friction, damping=0.05)
    return run_joint(damped, duration=0.999, angle=0.0, stiffness=1.0, moment=push, active=0.0)


# ---- the map


@pytest.mark.slow
def test_the_map_is_the_inverse_of_balance_and_stiffness():
    """Points solved anew halfway between its rows: where it is furthest from them."""
    made, machine = stand().control.pair, stand().machine
    inputs = {n: Value(jnp.zeros(()), jnp.zeros(())) for n in machine.signals()}
    start = machine.initial(dict.fromkeys(machine.circuit.chambers, 4e5), inputs)
    halfway = 0.5 * (made.angles[1:] + made.angles[:-1])
    angles, given = jnp.append(halfway, halfway[-1]), jnp.linspace(1.4e5, 5e5, 37)  # shapes as before: compiled already
    found = maps._solved(machine, start, inputs, angles, given)
    compared = 0
    for i, angle in enumerate(np.asarray(angles)):
        low, high = made.stiffness_range(angle)
        for j in np.flatnonzero(np.asarray(found.sound[i])):
            common, difference, per_difference, stiffness = (float(x[i, j]) for x in found.point)
            if low < stiffness < high:
                point = made.at(angle, stiffness)
                assert abs(float(point.difference) - difference) * per_difference / stiffness < 2e-3  # [rad]
                assert float(point.common) == pytest.approx(common, rel=0.01)
                compared += 1
    assert compared > 200


@pytest.mark.slow
def test_the_map_rises_with_co_contraction_at_every_angle():
    made = stand().control.pair
    assert (np.diff(np.asarray(made.stiffness), axis=1) > 0.0).all()
    assert (np.diff(np.asarray(made.common), axis=1) > 0.0).all()
    assert (np.asarray(made.moment_per_difference) > 0.0).all()
    mirrored = np.asarray(made.difference)[::-1]
    assert np.asarray(made.difference) == pytest.approx(-mirrored, abs=1.0)  # the pair is the same on both sides


@pytest.mark.parametrize("angle", [-9.0, -0.5, 0.123, 0.5, 9.0])
def test_what_is_out_of_range_gets_the_end_of_the_range(angle):
    made = stand().control.pair
    low, high = made.stiffness_range(angle)
    assert float(made.at(angle, 0.0).stiffness) == pytest.approx(float(low), rel=1e-12)
    assert float(made.at(angle, 99.0).stiffness) == pytest.approx(float(high), rel=1e-12)
    for stiffness in (0.0, 99.0):
        point = made.at(angle, stiffness)
        for pressure in (point.common + point.difference, point.common - point.difference):
            assert 1.4e5 - 1.0 <= float(pressure) <= 5e5 + 1.0


# ---- the controller alone


@jax.jit
def followed(control, state, angles, measured, active):
    """Commands for measured angles, with valves that are obeyed at once."""

    def sample(carry, row):
        state, flexor, extensor = carry
        state, asked = control.step(state, row[0], 1.0, row[1], flexor, extensor, DT, row[2])
        return (state, asked.flexor, asked.extensor), (asked, state.trim.trim)

    first = control.pair.at(0.0, 1.0).common
    return jax.lax.scan(sample, (state, first, first), jnp.stack([angles, measured, active], axis=1))[1]


def test_the_integral_stands_still_while_both_valves_are_at_their_ends():
    control = stand().control.replace(kp=20.0, trim_limit=100.0)
    on = np.ones(3000)
    asked, trim = followed(control, control.initial(0.0, 1.0), 0.4 * on, 0.0 * on, on)
    assert np.asarray(asked.flexor).max() == pytest.approx(5e5)
    assert np.asarray(asked.extensor).min() == 0.0
    assert float(trim[-1]) < 0.05 * 15.0 * 0.4 * 3.0  # a twentieth of what ki would have gathered
    there = np.concatenate([0.0 * on, 0.4 * on])
    asked, trim = followed(control, control.initial(0.0, 1.0), 0.4 * np.ones(6000), there, np.ones(6000))
    held = control.pair.at(0.4, 1.0)
    # once it is there, the pressures are at once what holds it there, but for the little in the integral
    apart = (np.asarray(asked.flexor) - np.asarray(asked.extensor))[3200:] * float(held.moment_per_difference) / 2.0
    assert apart == pytest.approx(float(held.difference * held.moment_per_difference), abs=0.1)


def test_the_loop_begins_without_a_jump():
    control = stand().control
    active = np.where(np.arange(400) < 200, 0.0, 1.0)
    asked, _ = followed(control, control.initial(0.0, 1.0), np.zeros(400), np.full(400, 0.05), active)
    flexor = np.asarray(asked.flexor)
    begins = flexor[200] - flexor[199]
    # a sample of the integral; the proportional part alone would be 1.5 * 0.05 N m
    assert abs(begins) < 0.05 * 1.5 * 0.05 / float(control.pair.at(0.0, 1.0).moment_per_difference)
    assert flexor[399] < flexor[199] - 1e3  # and then it works


def test_a_step_is_straight_line_and_keeps_its_types():
    control = stand().control
    state = control.initial(0.1, 1.0)
    arguments = (0.2, 1.0, 0.1, 3e5, 2e5, DT, 1.0)
    text = str(jax.make_jaxpr(control.step)(state, *arguments))
    assert "select_n" in text
    assert not [name for name in ("while", "cond[", "scan", "gather", "scatter", "argmin") if name in text]
    after, asked = control.step(state, *arguments)
    assert [(y.shape, y.dtype) for y in jax.tree.leaves(after)] == [(x.shape, x.dtype) for x in jax.tree.leaves(state)]
    assert all(x.shape == () and x.dtype == jnp.float64 for x in asked)


# ---- runs


def test_stiffness_rises_with_co_contraction_at_a_constant_angle():
    """With the loop off: only the laws say which pressures keep the angle, so it may move by what the map is wrong."""
    record = contracted()
    ends = [300 * (i + 1) - 1 for i in range(5)]
    stiffness, common = record["joint.stiffness"][ends], 0.5 * (record["flexor_pressure"] + record["extensor_pressure"])
    assert (np.diff(stiffness) > 0.19).all()
    assert (np.diff(common[ends]) > 0.0).all()
    assert stiffness == pytest.approx(
        [0.6, 0.8, 1.0, 1.2, 1.4], rel=0.01
    )  # the map's straight lines, the sensors' noise
    assert np.abs(record["joint.angle"] - 0.1).max() < 4e-3  # 2 mrad of the map, and as much on the way
    assert (np.diff(record["joint.quick_stiffness"][ends]) > 0.0).all()


def test_a_step_of_the_angle_settles_without_a_steady_error():
    record = stepped()
    error = record["joint.angle"] - 0.3
    assert np.abs(error[550:]).max() < 6e-3  # within 2 % after 0.35 s
    assert error.max() < 3e-3  # 1 % of overshoot
    assert abs(error[-200:].mean()) < COUNT  # the encoder knows no better
    assert np.abs(error[-200:]).max() < 2.0 * COUNT
    assert np.abs(record["joint.stiffness"] - 1.0).max() < 0.05  # on the way as well


def test_a_wrong_model_costs_stiffness_and_no_steady_error():
    """The muscles are a tenth stronger than the map knows: the integral finds the angle all the same."""
    right = stand()
    unit = right.machine.units["flexor"]
    law = unit.law.replace(stiffness_per_pressure=1.1 * unit.law.stiffness_per_pressure)
    stronger = dict.fromkeys(("flexor", "extensor"), unit.replace(law=law))
    wrong = dataclasses.replace(right, machine=right.machine.replace(units=stronger))
    record = run_joint(wrong, duration=1.499, angle=course((0, 0), (0.2, 0.3)), stiffness=1.0)
    assert abs(record["joint.angle"][-200:].mean() - 0.3) < 2.0 * COUNT
    assert record["joint.stiffness"][-1] == pytest.approx(1.1, abs=0.05)


def test_the_stiffness_changes_while_the_angle_is_held():
    record = stiffened()
    assert np.abs(record["joint.angle"] - 0.15).max() < 2e-3
    assert record["joint.stiffness"][690] == pytest.approx(1.4, rel=0.01)
    assert record["joint.stiffness"][-1] == pytest.approx(0.7, rel=0.01)


def test_a_moment_turns_an_open_joint_by_moment_over_stiffness():
    record = pushed(SLICK)
    turned = record["joint.angle"][-200:].mean() - record["joint.angle"][:100].mean()
    assert turned == pytest.approx(0.1 / record["joint.stiffness"][-1], rel=0.02)  # it still swings a little


def test_friction_takes_its_part_of_a_push():
    """Between a joint whose friction slips freely and one that is stuck."""
    record = pushed(1.0)
    turned = record["joint.angle"][-200:].mean() - record["joint.angle"][:100].mean()
    assert 0.1 / record["joint.quick_stiffness"][-1] < turned < 0.9 * 0.1 / record["joint.stiffness"][-1]


def test_the_laws_carry_a_limb():
    record = run_joint(stand(SLICK, weight=0.3), duration=0.499, angle=0.2, stiffness=1.0, active=0.0)
    assert record["joint.moment"][-1] == pytest.approx(0.3 * np.sin(0.2), abs=2e-3)
    assert np.abs(record["joint.angle"] - 0.2).max() < 4e-3


@pytest.mark.parametrize("run", [stepped, stiffened, contracted, lambda: pushed(SLICK), lambda: pushed(1.0)])
def test_work_in_equals_work_out_and_losses(run):
    meta = run().meta
    assert max(meta["balance"].values()) < 1e-6, meta["balance"]
    assert meta["friction"]["dissipated"] >= 0.0


def test_the_same_seed_gives_the_same_bits():
    first, again, other = (
        run_joint(stand(), duration=0.499, angle=course((0, 0), (0.2, 0.3)), stiffness=1.0, seed=seed)
        for seed in (0, 0, 1)
    )
    assert dict(first.channels) == dict(again.channels)
    assert not np.array_equal(first["flexor_pressure"], other["flexor_pressure"])


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"duration": 0.0}, "duration"),
        ({"duration": np.nan}, "duration"),
        ({"angle": np.zeros(3)}, "angle"),
        ({"stiffness": np.nan}, "stiffness"),
        ({"moment": lambda t: np.full(t.shape, np.inf)}, "moment"),
        ({"sample_rate": 1e6}, "sample_rate"),
    ],
)
def test_bad_set_points_are_refused(change, said):
    with pytest.raises(InputError, match=said):
        run_joint(stand(), **{"duration": 0.1, "angle": 0.0, "stiffness": 1.0, **change})


def test_set_points_that_the_map_of_the_pair_does_not_have_are_said_and_beyond_a_stop_refused():
    quiet = run_joint(stand(), duration=0.01, angle=0.2, stiffness=1.0)
    assert not [one for one in quiet.meta["warnings"] if "set-point" in one]
    far = run_joint(stand(), duration=0.01, angle=course((0, 0.5), (0.005, 0.7)), stiffness=100.0).meta["warnings"]
    assert any("a set-point of 40.11 deg is beyond the map of the pair, -28.65 deg to 28.65 deg" in one for one in far)
    assert any("a set-point of 100 N*m/rad is beyond the map of the pair" in one for one in far)
    with pytest.raises(InputError, match=r"angle must be within the stops, -114.6 deg to 114.6 deg, got 143.2 deg"):
        run_joint(stand(), duration=0.01, angle=2.5, stiffness=1.0)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ({"rig": "ancient"}, "rig"),
        ({"layout": "none"}, "plumbing"),
        ({"pressures": (3e5, 2e5)}, "highest"),
        ({"pressures": (1e5, 20e5)}, "pressures"),
        ({"angles": (0.5, -0.5)}, "angles"),
        ({"angles": (-2.0, 2.0)}, "but at -114.6 deg no pressures between 1.4 bar and 5 bar"),
        ({"gains": {"kp": -1.0}}, "kp"),
    ],
)
def test_a_stand_that_cannot_be_is_refused(change, said):
    with pytest.raises(InputError, match=said):
        joint_stand(nylon(), **change)
