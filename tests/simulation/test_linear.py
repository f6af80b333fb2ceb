"""The linear model of a simulation does on the sample clock what the simulation does in motion of the stated size."""

import functools
import math

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.valves import PressureRegulator


@functools.cache
def regulated(dead_time=0.0, offset=0.0):
    """A weight on a regulator, at 100 Hz."""
    flow = Orifice(conductance=2.2e-10, critical_ratio=0.3)
    slow = Orifice(conductance=4.5e-10, critical_ratio=0.3)
    valve = PressureRegulator(fill=flow, relief=slow, band=3e4, lag=5e-3, dead_time=dead_time, relief_offset=offset)
    return mk.Simulation(
        mk.Weight("DMSP-10-250", mass="5 kg", damping=60.0), mk.Air(supply="7 bar", valve=valve), period="10 ms"
    )


def sine(sim, size, frequency, field, turns=6):
    """Size of a field's first harmonic over the command's, and its phase, once a sine has gone on for some turns."""
    begin, count = sim.reset(), round(turns / frequency / sim.period)
    angle = 2.0 * math.pi * frequency * sim.period * np.arange(count + 1)
    seen = [getattr(begin, field)]
    for k in range(count):
        seen.append(getattr(sim.step(muscle=begin.pressure + size * math.sin(angle[k])), field))
    late = slice(count // 2, None)
    rows = np.column_stack([np.sin(angle), np.cos(angle), np.ones(count + 1), angle])[late]
    (a, b, *_), *_ = np.linalg.lstsq(rows, np.array(seen)[late], rcond=None)
    return math.hypot(a, b) / size, math.atan2(b, a)


def test_a_regulator_at_rest_holds_what_it_is_told():
    sim = regulated()
    sim.reset()
    model = sim.linearise("muscle", "pressure", amplitude="0.1 bar")
    # a step of 0.1 bar ends at 0.1 bar; 3 %: filling and relief of a real step differ in what they take from the volume
    assert model.gain("muscle", "pressure") == pytest.approx(1.0, rel=0.03)
    assert "fall" in str(model.cautions[0])  # it says that the two sides differ


@pytest.mark.parametrize("frequency", [0.5, 2.0, 8.0])
@pytest.mark.parametrize("dead_time", [0.0, 0.03])
def test_the_response_is_that_of_a_sine_of_the_stated_amplitude_dead_time_included(frequency, dead_time):
    sim = regulated(dead_time)
    sim.reset()
    model = sim.linearise("muscle", ("position", "pressure"), amplitude="0.1 bar")
    ours = model.response("muscle", "pressure", frequency)[0]
    size, phase = sine(sim, 1e4, frequency, "pressure")
    # a tenth: harmonics of a kink of 1 : 2 go round the loop, which a describing function leaves out
    assert abs(ours) == pytest.approx(size, rel=0.1)
    assert np.angle(ours / np.exp(1j * phase)) == pytest.approx(0.0, abs=0.15)


def test_dead_time_turns_the_phase_and_leaves_the_size():
    models = []
    for late in (0.0, 0.03):
        regulated(late).reset()
        models.append(regulated(late).linearise("muscle", "position"))
    prompt, late = (model.response("muscle", "position", [0.5, 3.0]) for model in models)
    np.testing.assert_allclose(
        late / prompt, np.exp(-2j * np.pi * np.array([0.5, 3.0]) * 0.03), rtol=1e-4
    )  # the run that finds amplitudes ends earlier
    assert np.all(np.isfinite(models[1].poles))
    np.testing.assert_allclose(models[0].poles, models[1].poles, rtol=1e-3)  # dead time has no pole of its own


def test_within_its_dead_zone_a_regulator_relieves_nothing_and_the_gain_depends_on_the_amplitude():
    sim = regulated(offset=2e4)
    sim.reset()
    small, large = (sim.linearise("muscle", "pressure", amplitude=a) for a in (1e4, 8e4))
    pole = [abs(model.poles[np.argmin(abs(model.poles + 20.0))]) for model in (small, large)]
    assert small.amplitudes["muscle"] == 1e4
    assert large.response("muscle", "pressure", 5.0) != pytest.approx(
        small.response("muscle", "pressure", 5.0), rel=0.02
    )
    assert pole[0] != pole[1]


def test_force_bends_the_position_by_the_stiffness_of_the_muscle():
    sim = regulated()
    seen = sim.reset()
    model = sim.linearise(("muscle", "force"), "position")
    for _ in range(600):
        after = sim.step(muscle=seen.pressure, force=1.0)
    # the regulator keeps the pressure, so that the gas is none of the spring; 5 % for its band
    assert model.gain("force", "position") == pytest.approx(after.position - seen.position, rel=0.05)


@pytest.mark.parametrize("name", ["muscle.valve", "muscle.valve.command"])
def test_a_name_that_is_no_command_is_refused_with_the_one_that_is(name):
    with pytest.raises(InputError, match="muscle drives it"):
        regulated().linearise(name)


def test_what_moves_nothing_and_what_is_unknown_is_refused():
    sim = regulated()
    sim.reset(muscle=0.0, pressure=0.0, force=-1e3)
    with pytest.raises(InputError, match="pressure"):
        sim.linearise("muscle", "presure")
    with pytest.raises(InputError, match="units differ"):
        sim.linearise(amplitude="0.1 bar")
    with pytest.raises(InputError, match="above zero"):
        sim.linearise("muscle", amplitude=0.0)
    with pytest.raises(InputError, match="half a sample"):
        regulated().linearise("muscle").response("muscle", "position", 60.0)


def test_a_supply_that_cannot_fill_is_an_input_that_moves_nothing():
    sim = mk.Simulation(mk.Weight("nylon", mass="2 kg"), mk.Air(valve="mpye-5-1/8"), period="2 ms")
    with pytest.warns(PlausibilityWarning, match="acts as 1"):
        sim.reset(muscle=3.0)  # a small change is beyond the end of its stroke, too
    with pytest.raises(InputError, match=r"moves nothing by 0\.1 .* force would do"):
        sim.linearise(("muscle", "force"))


def test_the_answer_says_for_which_amplitude_it_holds_and_tells_of_motion():
    sim = regulated()
    sim.reset()
    model = sim.linearise("muscle", "position", amplitude="0.2 bar")
    assert "0.2 bar of muscle" in model.remarks()[0]
    assert model.bode("muscle", "position").heads[1] == "gain, m per Pa"
    assert model.to_dict()["amplitudes"] == {"muscle": 2e4}
    sim.step(muscle=sim.reset().pressure + 2e4)
    assert any("not at rest" in str(c) for c in sim.linearise("muscle").cautions)


def test_stuck_contacts_are_springs_and_held_ones_are_none():
    sim = mk.Simulation(mk.Weight("nylon", mass="2 kg"), mk.Air(valve="regulator"), period="5 ms")
    sim.reset()
    stuck, held = (sim.linearise("force", "position", friction=kind) for kind in ("stuck", "held"))
    contacts = sim.machine.units["muscle"].friction
    # the regulator keeps the pressure, so that the two differ by the contacts' springs alone
    soft, stiff = (1.0 / model.gain("force", "position", 0.01) for model in (held, stuck))
    assert stiff - soft == pytest.approx(
        float(np.sum(contacts.stiffness)), rel=0.1
    )  # the band of the regulator gives way
