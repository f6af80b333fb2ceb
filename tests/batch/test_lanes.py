"""A lane of a batch is the run of its variant: the same numbers, results and sentences, whatever its neighbours do."""

import functools
from typing import Any, NamedTuple

import jax
import numpy as np
import pytest
from lanes_and_runs import (
    MEASURED,
    TRUE,
    read,
    runner,
    same_as_single_runs,
    single,
    step_protocol,
    template,
    triangle_protocol,
    whole,
)

import mckibben as mk
from mckibben.batch import Output, VariantOutcome, Variants, lanes
from mckibben.batch.lanes import build
from mckibben.batch.run import CAUTION, Runner
from mckibben.bench.run import run
from mckibben.errors import InputError, PlausibilityWarning

REDUCED = (
    Output("first", "first", "muscle.pressure"),
    Output("final", "final", "muscle.mass"),
    Output("least", "min", "muscle.length"),
    Output("most", "max", "muscle.load_tension"),
    Output("mean", "mean", "tension"),
    Output("rms", "rms", "pressure"),
    Output("air", "integral", "valve.supply_to_outlet.mass_flow"),
    Output("work", "area", "muscle.load_tension", "muscle.length"),
    Output("high", "mean", "muscle.pressure", step="high"),
    Output("rise", "time_to", "muscle.pressure", share=0.5, step="high"),
)
COLUMNS = {
    "muscle.law.passive_stiffness": ["3 N/cm", "4 N/cm", "5 N/cm", "4 N/cm", "4 N/cm", "4 N/cm"],
    "rig.plumbing.direct.tube.length": ["0.3 m", "1 m", "2 m", "1 m", "1 m", "1 m"],
    "high": ["2 bar", "3 bar", "4 bar", "9.9 bar", "4 bar", "3 bar"],
    "noise_seed": ["0", "1", "2", "0", "0", "0"],
    "rig.interlocks.most_tension": ["100 N", "100 N", "100 N", "100 N", "20 N", "100 N"],
    # steeper than the rig was made for: its law pulls so hard that the gas is sucked below vacuum
    "muscle.law.stiffness_per_pressure": [*["4.66 N/(cm*bar)"] * 5, "20 N/(cm*bar)"],
}
# A compiled batch orders additions in another way than a compiled run; 6e-13 of the largest value was measured in the
# tension, whose cord has 1e5 N/m, and 2e-14 elsewhere.
ROUNDING = 5e-12
GOOD, REFUSED, STOPPED = (0, 1, 2), 3, 4


@functools.cache
def batch():
    made = template(step_protocol(), COLUMNS, outputs=(*whole(*TRUE, *MEASURED), *REDUCED))
    variants = read(made, COLUMNS)
    one = runner(made, variants)
    return one, variants, one.run(variants)


@functools.cache
def recording(row):
    one, variants, _ = batch()
    return single(one, variants, row)


@pytest.mark.parametrize("row", GOOD)
def test_every_lane_is_the_run_of_its_variant(row):
    _, _, results = batch()
    count = int(np.isfinite(results.outputs["time"][row]).sum())
    assert results.code[row] == VariantOutcome.DONE
    assert count == len(recording(row))
    np.testing.assert_allclose(results.outputs["time"][row][:count], recording(row).time, atol=1e-12)
    for name in (*TRUE, *MEASURED):
        theirs = recording(row)[name]
        worst = np.abs(results.outputs[name][row][:count] - theirs).max() / np.abs(theirs).max()
        assert worst <= ROUNDING, (name, worst)


def test_measured_channels_of_a_lane_are_the_very_counts_of_its_run():
    _, _, results = batch()
    for row in GOOD:
        np.testing.assert_array_equal(results.outputs["tension"][row][: len(recording(row))], recording(row)["tension"])


@pytest.mark.parametrize("row", GOOD)
def test_reductions_are_those_of_the_recorded_channels(row):
    r, found = recording(row), {n: v[row] for n, v in batch()[2].outputs.items()}
    inside = (r.time >= 0.05 - 1e-9) & (r.time < 0.2 - 1e-9)  # the step "high"
    pressure, tension = r["muscle.pressure"], r["muscle.load_tension"]
    expected = {
        "first": pressure[0], "final": r["muscle.mass"][-1], "least": r["muscle.length"].min(), "most": tension.max(),
        "mean": r["tension"].mean(), "rms": np.sqrt(np.mean(r["pressure"] ** 2)),
        "air": np.trapezoid(r["valve.supply_to_outlet.mass_flow"], r.time),
        "work": np.trapezoid(tension, r["muscle.length"]), "high": pressure[inside].mean(),
    }  # fmt: skip
    for name, value in expected.items():
        scale = np.abs(tension).max() * np.ptp(r["muscle.length"]) if name == "work" else abs(value)
        assert abs(found[name] - value) <= ROUNDING * scale, name
    way = (pressure[inside] - pressure[inside][0]) / (pressure[inside][-1] - pressure[inside][0])
    passed = int(np.argmax(way >= 0.5))
    assert passed > 1 and (passed - 1) * 1e-3 < found["rise"] <= passed * 1e-3 + 1e-12


def test_a_lane_says_why_its_machine_stopped_as_its_run_does():
    one, variants, results = batch()
    meta = single(one, variants, STOPPED).meta
    assert results.code[STOPPED] == VariantOutcome.STOPPED and meta["result"] == "stopped"
    said, *cautions = results.message[STOPPED].split(CAUTION)  # of a stiffness of its own
    assert said == meta["message"] and set(cautions) <= set(meta["warnings"])
    samples = np.isfinite(results.outputs["time"][STOPPED]).sum()
    assert samples == len(single(one, variants, STOPPED))  # it is seen to vent, as in a run


def test_a_variant_that_the_dry_run_refuses_says_what_the_run_would():
    one, variants, results = batch()
    with (
        pytest.warns(PlausibilityWarning, match="a pressure of 9.9 bar is beyond the measured ones of nylon"),
        pytest.raises(InputError) as said,
    ):
        run(one.planner.factory.bench(variants.row(REFUSED)))
    assert results.code[REFUSED] == VariantOutcome.REFUSED and results.message[REFUSED] == str(said.value)
    assert results.duration[REFUSED] == 0.0


def test_a_lane_whose_physics_fails_gets_a_code_and_no_numbers():
    one, variants, results = batch()
    lane = len(COLUMNS["high"]) - 1
    with pytest.raises(InputError, match="volume of gas") as refused:
        single(one, variants, lane)
    assert results.code[lane] in (VariantOutcome.IMPOSSIBLE, VariantOutcome.NOT_FINITE)
    assert "step" in results.message[lane] and str(refused.value)[1:] in results.message[lane]
    assert np.isnan(results.outputs["most"][lane])


def test_bad_lanes_change_no_bit_of_the_others():
    one, variants, results = batch()
    rows = np.array([*GOOD, *GOOD])  # good ones in the place of the bad ones
    again = one.run(Variants({path: values[rows] for path, values in variants.columns.items()}))
    assert (again.code == VariantOutcome.DONE).all()
    for name, values in results.outputs.items():
        for row in GOOD:
            size = len(recording(row)) if values.ndim > 1 else 1
            np.testing.assert_array_equal(again.outputs[name][row].ravel()[:size], values[row].ravel()[:size])


def test_what_does_more_than_stand_in_the_machine_is_built_for_real():
    one, variants, _ = batch()
    assert one.planner.apart == {"high"}  # a table of set-points; all others are written into trees
    first, *_ = (build(one.planner.factory, variants.row(row)) for row in (0, 1))
    family = next(f for f in one.planner.families if f.fixed == first.fixed)
    # a number stands once, the law's with the muscle and not in the volume of its gas
    assert [len(family.places[p]) for p in ("muscle.law.passive_stiffness", "rig.plumbing.direct.tube.length")] == [
        1,
        1,
    ]


@pytest.mark.slow
def test_lanes_that_are_stiff_take_the_steps_of_their_runs():
    columns = {
        "rig.plumbing.direct.valve.flow_into_the_room": ["105 l/min", "600 l/min", "1500 l/min"],
        "rig.plumbing.direct.port_volume": ["2 cm^3", "1 cm^3", "0.1 cm^3"],
    }
    made = template(step_protocol(), columns)
    # the stiff method solves linear systems, whose pivots a batch rounds otherwise: 1.3e-11 was measured
    _, results = same_as_single_runs(made, read(made, columns), (0, 1, 2), 1e-10)
    assert (results.code == 0).all()


@pytest.mark.slow
def test_lanes_with_a_motor_and_its_control_are_their_runs():
    columns = {"muscle.law.passive_stiffness": ["3.5 N/cm", "4 N/cm"], "rig.control.force.kp": ["0.3", "0.35"]}
    made = template(triangle_protocol(), columns)
    same_as_single_runs(made, read(made, columns), (0, 1), ROUNDING)


@pytest.mark.slow
def test_accounts_and_balances_are_those_of_the_runs_recording():
    columns = {"muscle.law.passive_stiffness": ["3.5 N/cm", "4 N/cm"]}
    outputs = (
        Output("energy", "balance", "energy"),
        Output("mass", "balance", "mass"),
        Output("enthalpy", "account", "enthalpy"),
    )
    made = template(step_protocol(), columns, outputs=outputs)
    variants = read(made, columns)
    one = runner(made, variants)
    results = one.run(variants)
    for row in (0, 1):
        meta = single(one, variants, row).meta
        # a balance is a small difference of large sums: equal to what rounding makes of it
        assert abs(results.outputs["energy"][row] - meta["balance"]["energy"]) < 1e-11
        assert results.outputs["mass"][row] < 1e-12 and meta["balance"]["mass"] < 1e-12
        assert results.outputs["enthalpy"][row] == pytest.approx(
            _net_enthalpy(meta), rel=1e-9  # two sums of the same flow, half of what passed and half the difference
        )  # fmt: skip


def _net_enthalpy(meta):
    energy = meta["energy"]["energy"]
    return energy["into"]["enthalpy"] - energy["out"]["enthalpy"]


def test_an_engine_that_there_is_not_is_refused():
    made = template(step_protocol(), {}, outputs=(Output("x", "max", "tension"),))
    with pytest.raises(InputError, match="Known are auto, native, gpu, xla"):
        Runner(made, {}, engine="fast")


class Plant(NamedTuple):
    """What a lane's plant has of its muscle."""

    machine: Any


class Units(NamedTuple):
    """What a machine has of its muscles."""

    units: Any


class Unit(NamedTuple):
    """What a muscle of a machine has of its law."""

    law: Any


def test_the_largest_tension_of_every_lane_is_that_of_its_own_law_at_the_states_of_the_plan():
    """By it lanes are told that cannot be beyond a limit, and need no dry run of their own; 1e-12 is rounding."""
    laws = [mk.law("ideal", {"thread_length": 0.2, "turns": turns}) for turns in (2.0, 3.0)]
    trees = [{"plant": Plant(Units({lanes.MUSCLE: Unit(law)}))} for law in laws]
    leaves = tuple(np.stack(both) for both in zip(*map(jax.tree.leaves, trees), strict=True))
    span, pressure = np.array([0.15, 0.16, 0.17]), np.array([1e5, 3e5, 2e5])
    axes = (0,) * len(leaves)
    most = lanes._most_tension(jax.tree.structure(trees[0]), axes, leaves, np.arange(2), span, pressure)
    assert np.asarray(most) == pytest.approx([float(law.tension(span, pressure).max()) for law in laws], rel=1e-12)
