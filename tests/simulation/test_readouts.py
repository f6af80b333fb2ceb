"""Laws of what stands around a mechanism: readouts, limits of a command, weight on a spring, a valve on its muscle."""

from __future__ import annotations

import numpy as np
import pytest

import mckibben as mk
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.valves import PressureRegulator
from mckibben.simulation import Readout


def spring(**options):
    return mk.Simulation(
        mk.Spring("nylon", stiffness="2 N/mm"), mk.Air(valve="regulator", tube="none"), period="5 ms", **options
    )


def stepped(sim, count=60):
    sim.reset()
    return [sim.step(muscle=3e5 if k < 30 else 1e5) for k in range(count)]


def test_a_readout_is_rounded_late_and_the_middle_of_its_last_samples():
    true = stepped(spring())
    read = stepped(spring(readouts={"position": Readout(rounding="0.5 mm", median=3, delay="10 ms")}))
    start = spring().reset().position
    counts = np.round(np.array([start] * 4 + [one.position for one in true]) / 5e-4) * 5e-4
    # the fourth entry is the start, and a reading is two samples late
    wanted = [np.median(counts[i - 1 : i + 2]) for i in range(1, len(true) + 1)]
    assert [one.position for one in read] == pytest.approx(wanted, abs=1e-15)
    assert [one.pressure for one in read] == [one.pressure for one in true]


def test_a_readout_that_does_nothing_changes_no_bit():
    assert stepped(spring(readouts={"position": Readout()})) == stepped(spring())


def test_a_lane_reads_what_its_simulation_reads_alone():
    sim = spring(readouts={"position": Readout(rounding=1e-4, median=3, delay="5 ms")})
    alone, batch = stepped(sim), sim.batch(3)
    batch.reset()
    lanes = [batch.step(muscle=3e5 if k < 30 else 1e5) for k in range(60)]
    assert [one.position for one in alone] == [one.position[1] for one in lanes]


def test_a_saved_state_goes_on_with_what_the_readouts_remember():
    sim = spring(readouts={"position": Readout(median=5, delay="15 ms")})
    sim.reset()
    for _ in range(10):
        sim.step(muscle=3e5)
    state = sim.save_state()
    ends = [[sim.load_state(state), *(sim.step(muscle=2e5) for _ in range(6))] for _ in range(2)]
    assert ends[0] == ends[1]


@pytest.mark.parametrize(
    ("readouts", "sentence"),
    [
        ({"positon": Readout()}, "Did you mean 'position'"),
        ({"position": Readout(median=2)}, "odd number of samples"),
        ({"position": Readout(median=-3)}, "odd number of samples, 1 for none, got -3"),
        ({"position": Readout(median=True)}, "odd number of samples"),
        ({"position": Readout(delay="-5 ms")}, "whole number of periods"),
        ({"position": Readout(delay="7 ms")}, "whole number of periods"),
        ({"position": Readout(rounding=-1.0)}, "must be 0 or more"),
        ({"position": 3}, "must be a Readout"),
    ],
)
def test_what_is_no_readout_is_refused_in_a_sentence(readouts, sentence):
    with pytest.raises(mk.InputError, match=sentence):
        spring(readouts=readouts)


def test_a_command_beyond_its_limits_acts_as_there_in_single_runs_and_lanes():
    sim = spring(limits={"muscle": ("1 bar", "2 bar")})
    free, held = stepped(spring()), stepped(sim)
    sim.reset()
    at_end = [sim.step(muscle=2e5 if k < 30 else 1e5) for k in range(60)]
    assert held == at_end and held != free
    batch = sim.batch(2)
    batch.reset()
    assert batch.step(muscle=np.array([4e5, 2e5])).pressure.tolist() == [at_end[0].pressure] * 2
    assert "limits" in repr(sim) and "limits" not in repr(spring())
    with pytest.raises(mk.InputError, match="must be the smallest and then the largest value"):
        spring(limits={"muscle": (2e5, 1e5)})


def test_spring_and_weight_are_carried_together_at_rest():
    hung = mk.Spring("nylon", stiffness="2 N/mm", weight="30 N", start="13 cm", relaxed="12.5 cm")
    sim = mk.Simulation(hung, mk.Air(valve="regulator"))
    seen = sim.reset()
    assert seen.tension == pytest.approx(30.0 - 2000.0 * 5e-3, rel=1e-9)
    for _ in range(50):
        seen = sim.step()
    assert seen.position == pytest.approx(0.13, abs=1e-6)


def test_a_start_at_a_tension_is_where_spring_and_weight_pull_with_it():
    sim = mk.Simulation(mk.Spring("nylon", stiffness="2 N/mm", weight="30 N", start="40 N", relaxed="13 cm"))
    seen = sim.reset()
    assert seen.position == pytest.approx(0.13 - 10.0 / 2000.0) and seen.tension == pytest.approx(40.0, rel=1e-6)


@pytest.mark.parametrize(
    ("start", "mass", "way"),
    [(0.253, 0.1, "be a shorter span"), (0.22, 70.0, "be a longer span"), (0.253, 1000.0, "carry less")],
)
def test_a_start_that_no_pressure_carries_says_which_way(start, mass, way):
    # rubber pulls without pressure where it is longer than at rest
    muscle = mk.Muscle(mk.muscle("DMSP-10-250").law)
    with pytest.raises(mk.InputError, match=f"start must {way}"):
        mk.Simulation(mk.Weight(muscle, mass=mass, start=start))


def test_a_relief_band_of_its_own_opens_the_relief_alone_and_an_equal_one_changes_no_bit():
    flow = Orifice(conductance=2e-9)

    def run(**options):
        valve = PressureRegulator(fill=flow, relief=flow, band=3e4, **options)
        sim = mk.Simulation(mk.Plate("nylon"), mk.Air(valve=valve), period="5 ms")
        sim.reset()
        return np.array([sim.step(muscle=3e5 if k < 80 else 1e5).pressure for k in range(100)])

    plain, equal, wide = run(), run(relief_band=3e4), run(relief_band=3e5)
    assert np.array_equal(plain, equal)
    below = plain < 2.9e5
    assert np.array_equal(plain[:80][below[:80]], wide[:80][below[:80]])  # on the way up only the fill is open
    assert np.all(wide[85:] > plain[85:] + 1e3)


def test_a_valve_on_its_muscle_has_no_port():
    machine = spring().machine
    assert not any(name.endswith((".port", ".tube")) for name in (*machine.circuit.nodes, *machine.circuit.elements))
