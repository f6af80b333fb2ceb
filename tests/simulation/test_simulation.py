"""A system that one steps: its steps, its saved states, its recording, and what it refuses."""

import pickle
from pathlib import Path

import numpy as np
import pytest
from stepped_systems import AIR, drive, driven, joint

import mckibben as mk
from mckibben.errors import InputError
from mckibben.simulation.simulation import Simulation

CIRCUITS = Path(__file__).parents[2] / "examples" / "circuits"


def test_a_step_takes_plain_numbers_and_returns_a_named_tuple_of_them():
    sim = joint()
    seen = sim.reset(seed=0, pressure="2 bar")
    assert seen.time == 0.0 and seen.flexor_pressure == pytest.approx(2e5, rel=1e-12)  # rounding of gauge and absolute
    seen = sim.step(flexor=0.3, extensor=-0.3)
    assert seen._fields[:3] == ("time", "angle", "velocity")
    assert all(type(value) is float for value in seen) and seen.time == sim.period
    for _ in range(50):
        seen = sim.step()  # what is left out stays
    assert seen.angle > 0.05 and seen.flexor_pressure > 2.2e5 > 1.8e5 > seen.extensor_pressure


def test_a_half_as_long_step_of_the_physics_gives_the_same_motion():
    ends = []
    for step in (2e-4, 1e-4):
        sim = joint(step=step)
        sim.reset(pressure="2 bar")
        ends.append(np.array(driven(sim, 150)[-1]))
    # the error of the default step: second order in friction, 1e-6 of each quantity in a gentle motion
    np.testing.assert_allclose(ends[0], ends[1], rtol=1e-5, atol=1e-6)


def test_a_simulation_goes_on_from_a_saved_state_bit_for_bit():
    sim = joint()
    sim.reset(pressure="2 bar")
    driven(sim, 40)
    state = pickle.loads(pickle.dumps(sim.save_state()))
    went_on = driven(sim, 30, 40)
    sim.load_state(state)
    assert driven(sim, 30, 40) == went_on
    other = mk.Simulation(mk.Joint("nylon", arm="2 cm", inertia=2e-3), AIR, period=2e-3)
    other.load_state(state)
    assert driven(other, 30, 40) == went_on


def test_the_same_seed_draws_the_same_noise_and_another_one_does_not():
    sim = joint(noisy=True)
    runs = []
    for seed in (1, 1, 2):
        sim.reset(seed=seed, pressure="2 bar")
        runs.append(driven(sim, 5))
    assert runs[0] == runs[1] and runs[0] != runs[2]
    state = sim.save_state()
    went_on = driven(sim, 5)
    sim.load_state(state)
    assert driven(sim, 5) == went_on


def test_a_recording_has_the_steps_that_were_taken_and_its_balances_close():
    sim = joint(step=5e-5)
    sim.reset(pressure="2 bar")
    seen = driven(sim, 100)
    recording = sim.recording()
    assert len(recording) == 101 and recording.period == pytest.approx(sim.period, rel=1e-12)  # rounding of a sum
    # the same steps by another program, whose operations are in another order: rounding
    np.testing.assert_allclose(recording["joint.angle"][1:], [s.angle for s in seen], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(recording["flexor.pressure"][1:], [s.flexor_pressure for s in seen], atol=1e-4)
    np.testing.assert_array_equal(recording["flexor.command"][:-1], [drive(k)["flexor"] for k in range(100)])
    balance = recording.meta["balance"]
    assert balance["mass"] < 1e-12  # every flow leaves one account and enters another: rounding
    # what the integration of 2,000 steps of 50 us leaves, of the energy that passed; measured 3e-9
    assert balance["energy"] < 1e-6 and balance["gas"] < 1e-6 and balance["exergy"] < 1e-6
    assert recording.meta["specimen"] == "nylon" and "chou1996" in recording.meta["citations"]


def test_a_recording_of_noisy_observations_has_them_beside_the_true_values():
    sim = joint(noisy=True)
    sim.reset(seed=3, pressure="2 bar")
    seen = driven(sim, 20)
    recording = sim.recording()
    assert recording["measured.angle"][1:].tolist() == [s.angle for s in seen]
    assert recording.names("measured") == ["measured.angle", "measured.flexor_pressure"]
    off = recording["measured.angle"] - recording["joint.angle"]
    assert 0.3e-3 < off.std() < 3e-3  # of 21 draws with 1 mrad


def test_another_parameter_needs_no_other_program():
    sim = joint()
    heavy = sim.with_parameters({"load.inertia": "0.02 kg*m^2"})
    assert heavy.programs is sim.programs
    ends = []
    for one in (sim, heavy):
        one.reset(pressure="2 bar")
        ends.append(driven(one, 30)[-1].velocity)
    assert abs(ends[1]) < abs(ends[0])  # ten times as inert


def test_a_regulator_begins_at_the_pressure_of_its_muscle():
    sim = mk.Simulation(mk.Plate("nylon", span="13 cm"), mk.Air(supply="6 bar", valve="regulator"), period=1e-3)
    sim.reset(pressure="3 bar")
    for _ in range(20):
        seen = sim.step()
    assert seen.pressure == pytest.approx(3e5, abs=10.0)  # nothing moves: rounding, and the band's leak of some pascals
    for _ in range(400):
        seen = sim.step(muscle=4e5)
    assert seen.pressure == pytest.approx(4e5, rel=0.01)  # within a tenth of the regulator's band


def test_a_plate_is_at_a_commanded_span_at_the_end_of_the_step():
    sim = mk.Simulation(mk.Plate("nylon", span="13 cm"), mk.Air(supply="6 bar", valve="regulator"), period=1e-3)
    assert sim.reset().span == pytest.approx(0.13, rel=1e-12)
    seen = [sim.step(span=0.13 - 1e-4 * k) for k in range(1, 20)]
    np.testing.assert_allclose([s.span for s in seen], 0.13 - 1e-4 * np.arange(1, 20), rtol=1e-12)  # rounding


def test_a_circuit_file_supplies_the_muscle_and_its_dead_time_passes_first():
    sim = mk.Simulation(mk.Plate("nylon", span="13 cm"), CIRCUITS / "muscle-on-a-valve.toml", period="1 ms")
    assert sim.commands == ("opening", "span")
    first = sim.reset(pressure="1 bar")
    assert first.pressure == pytest.approx(1e5, rel=1e-9)  # rounding of gauge and absolute
    ends = []
    for opening in (0.0, 1.0):
        sim.reset(pressure="1 bar", opening=0.0)
        ends.append([sim.step(opening=opening).pressure for _ in range(6)])
    assert (
        ends[0][:2] == ends[1][:2] and ends[1][5] > ends[0][5]
    )  # 2 ms of dead time are two samples, then the spool moves


def refuse(**options):
    return lambda: mk.Simulation(mk.Joint("nylon", **options), AIR)


REFUSED = {
    "a command that is none": (lambda: joint().step(flexr=0.1), "flexor"),
    "a command without its name": (lambda: joint().step(0.7), r"as in step\(flexor=0.7, extensor=..., moment=...\)"),
    "a command without its name, of many": (
        lambda: joint().batch(2).step(0.7),
        r"as in step\(flexor=0.7, extensor=..., moment=...\)",
    ),
    "a pressure for a seed": (lambda: joint().reset("5 bar"), "seed must be a whole number from 0, got '5 bar'"),
    "lanes that are no number": (lambda: joint().batch("3"), "lanes must be a whole number from 1, got '3'"),
    "a command that is no number": (lambda: joint().step(flexor="wide"), "flexor"),
    "a command that is not a number": (lambda: joint().step(flexor=float("nan")), "flexor must be a finite number"),
    "a muscle that is none": (lambda: joint().reset(pressure={"biceps": 1e5}), "biceps"),
    "a pressure below vacuum": (lambda: joint().reset(pressure="-2 bar"), "vacuum"),
    "a moment arm of nothing": (refuse(arm="0 cm"), "arm"),
    "an unknown specimen": (lambda: mk.Simulation(mk.Joint("nylonn"), AIR), "nylon"),
    "an unknown valve": (lambda: mk.Air(valve="mpye-7").build({}), "MPYE"),
    "a period of nothing": (lambda: Simulation(mk.Joint("nylon"), AIR, period=0.0), "period"),
    "a frequency for a period": (
        lambda: mk.Simulation(mk.Joint("nylon"), AIR, period=250),
        "250 Hz are a period of 0.004 s",
    ),
    "no mechanism": (lambda: mk.Simulation("joint", AIR), "Joint, Chain"),
    "noise on nothing": (lambda: mk.Simulation(mk.Joint("nylon"), AIR, noise={"angel": 1.0}), "angle"),
    "a state of something else": (lambda: joint().load_state("state"), "saved"),
    "a circuit without the muscle": (
        lambda: mk.Simulation(mk.Joint("nylon"), CIRCUITS / "filling-a-tank.toml"),
        "muscle",
    ),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_does_not_fit_is_refused_with_what_is_allowed(case):
    call, word = REFUSED[case]
    with pytest.raises(InputError, match=word):
        call()
