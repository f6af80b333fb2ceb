"""Linear models of machines agree with small motions of the machines themselves, and with what is known by hand."""

import dataclasses
import functools

import jax
import jax.flatten_util
import numpy as np
import pytest
from machines import PERIOD, ROOM, at, compiled, constant, plate, smooth, unit
from scipy.linalg import expm

from mckibben.assembly.linearise import LinearModel, Names, linearise, settle, state_names
from mckibben.assembly.pair_map import joint_stiffness, memory_stiffness, muscle_stiffness
from mckibben.engine import ramped
from mckibben.errors import ConvergenceError, InputError, UnreachableError

SAMPLES, SMALL = 100, 1e-4
POINT = {"m.fill": 0.4, "m.vent": 0.1, "push": 8.0}
OUTPUTS = ("m.tension", "m.pressure", "load.position")


@functools.cache
def settled():
    machine, inputs = smooth(), constant(**POINT)
    state, memory = machine.initial({"m": 3.6e5, "m.port": 4e5}, inputs)
    rest = settle(machine, state, memory, inputs)
    return machine, rest, memory, inputs


@functools.cache
def model():
    machine, rest, memory, inputs = settled()
    return linearise(machine, rest.state, memory, inputs, inputs_by_name=("m.fill", "push"), outputs=OUTPUTS)


def moved(state, signals):
    """Deviations of the outputs from the point of rest."""
    machine, rest, memory, inputs = settled()
    _, (_, _, out) = compiled(machine, state, memory, signals, PERIOD, 20, SAMPLES, False)
    zero = machine.outputs(rest.state, memory, inputs)
    return np.stack([np.asarray(out[n]) - float(zero[n]) for n in OUTPUTS])


def signals(name, deviation):
    given = {n: np.full(SAMPLES + 1, v) for n, v in POINT.items()}
    given[name] = given[name] + deviation
    return {n: ramped(v) for n, v in given.items()}


def test_a_settled_machine_rests():
    machine, rest, memory, inputs = settled()
    assert rest.residual < 1e-6
    still = moved(rest.state, signals("push", 0.0))
    # over 0.1 s: N, Pa and m beside 50 N, 3 bar and 14 cm
    assert np.all(np.abs(still).max(axis=1) < [1e-5, 1e-2, 1e-9])
    flows = machine.outputs(rest.state, memory, inputs)
    assert float(flows["m.fill.mass_flow"]) == pytest.approx(float(flows["m.vent.mass_flow"]), rel=1e-9)
    assert float(flows["m.fill.mass_flow"]) > 1e-6  # a steady flow, not a shut valve


def test_a_machine_that_has_no_time_to_settle_says_what_still_moves():
    machine, _, memory, inputs = settled()
    state, _ = machine.initial({"m": 2e5, "m.port": 2e5}, inputs)
    with pytest.raises(ConvergenceError, match="still moves"):
        settle(machine, state, memory, inputs, longest=1e-3, tolerance=1e-12)


@pytest.mark.parametrize("name", ["m.fill", "push"])
def test_a_small_step_moves_the_machine_as_the_model_says(name):
    _, rest, _, _ = settled()
    found, height = model(), SMALL * POINT[name]
    ours = moved(rest.state, signals(name, height)) / height
    column = found.names.inputs.index(name)
    n = found.A.shape[0]
    whole = np.zeros((n + 1, n + 1))  # the input as one more state, that stays
    whole[:n, :n], whole[:n, n] = found.A, found.B[:, column]
    once, x = expm(whole * PERIOD), np.eye(n + 1)[:, n]
    path = [x := once @ x if i else x for i in range(SAMPLES + 1)]
    theirs = found.C @ np.array(path)[:, :n].T + found.D[:, [column]]
    size = np.abs(theirs).max(axis=1, keepdims=True)
    assert np.all(size > 0.0)
    # of second order in the height of the step: 1e-4 of the point
    assert np.abs(ours - theirs).max(axis=1) == pytest.approx(
        np.zeros(3), abs=1.0 * SMALL * 10.0 * size.max(initial=0.0)
    )
    assert np.all(np.abs(ours - theirs) / size < 2e-3)


@pytest.mark.parametrize(("name", "frequency"), [("m.fill", 10.0), ("push", 20.0)])
def test_a_small_sine_is_answered_as_the_frequency_response_says(name, frequency):
    """Started on the periodic path, the machine stays on it: amplitude and phase at once, without waiting."""
    _, rest, _, _ = settled()
    found, height = model(), SMALL * POINT[name]
    w, time = 2.0 * np.pi * frequency, PERIOD * np.arange(SAMPLES + 1)
    column = found.names.inputs.index(name)
    orbit = np.linalg.solve(1j * w * np.eye(found.A.shape[0]) - found.A, found.B[:, column])
    flat, back = jax.flatten_util.ravel_pytree(rest.state)
    whole = np.zeros(flat.size)  # with what no taut muscle has
    whole[[state_names(rest.state).index(one) for one in found.names.states]] = orbit.real
    ours = moved(back(flat + height * whole), signals(name, height * np.cos(w * time))) / height
    turn = np.exp(1j * w * time)
    theirs = np.stack([(found.response(name, o, frequency)[0] * turn).real for o in OUTPUTS])
    size = np.abs(theirs).max(axis=1, keepdims=True)
    assert np.all(size > 0.0)
    # the signal is straight between samples: (w dt)^2/8 is 0.2 % at 20 Hz
    assert np.all(np.abs(ours - theirs) / size < 5e-3)


def test_modes_and_bandwidth_of_the_machine_make_sense_together():
    found = model()
    modes = found.modes()
    assert len([v for v in found.eigenvalues() if v.imag < 0.0]) == sum(m.damping < 1.0 - 1e-9 for m in modes)
    assert all(m.damping > 0.0 for m in modes)  # at rest, and stable
    edge = found.bandwidth("m.fill", "m.pressure")
    ratio = abs(found.response("m.fill", "m.pressure", edge)[0]) / abs(found.response("m.fill", "m.pressure", 0.01)[0])
    assert ratio == pytest.approx(1.0 / np.sqrt(2.0), rel=1e-6)
    assert modes[0].frequency < 3.0 * edge < 100.0


def by_hand(a, b=1.0):
    names = Names(tuple(f"x{i}" for i in range(len(a))), ("u",), ("y",))
    into, out = np.zeros((len(a), 1)), np.zeros((1, len(a)))
    into[-1, 0], out[0, 0] = b, 1.0
    return LinearModel(np.array(a, float), into, out, np.zeros((1, 1)), names)


def test_a_lag_has_the_bandwidth_of_its_time_constant():
    lag = by_hand([[-1.0 / 0.02]], 1.0 / 0.02)
    # -3 dB from 0.01 Hz, not from zero, and half is not quite 3 dB
    assert lag.bandwidth("u", "y") == pytest.approx(1.0 / (2.0 * np.pi * 0.02), rel=1e-5)
    assert lag.modes()[0].damping == pytest.approx(1.0)


def test_an_oscillator_has_its_natural_frequency_and_damping():
    (mode,) = by_hand([[0.0, 1.0], [-400.0, -4.0]]).modes()
    assert mode.frequency == pytest.approx(20.0 / (2.0 * np.pi))
    assert mode.damping == pytest.approx(0.1)


def test_a_response_that_never_falls_has_no_bandwidth():
    flat = by_hand([[-1e6]], 1e6)
    with pytest.raises(UnreachableError, match="does not fall by 3 dB"):
        flat.bandwidth("u", "y")


def on_a_plate(end_mass=None, **options):
    """With a cord where an end mass is stated, else tied."""
    machine = plate(corded=end_mass is not None)
    machine = dataclasses.replace(machine, units={"m": machine.units["m"].replace(end_mass=end_mass)})
    inputs = constant(x=0.142, **{"m.fill": 0.0, "m.vent": 0.0})
    state, memory = machine.initial(dict.fromkeys(machine.circuit.chambers, 4e5), inputs)
    names = {"inputs_by_name": ("x",), "outputs": ("m.tension",)}
    return machine, state, linearise(machine, state, memory, inputs, **(names | options))


def test_a_prescribed_motion_has_a_column_for_its_rate():
    machine, state, found = on_a_plate(end_mass=0.02)
    tendon, tension = machine.units["m"].tendon, float(machine.outputs(*arguments(machine, state))["m.tension"])
    assert found.names.inputs == ("x", "x.rate")
    # beyond its toe the tendon is a spring, and its loss is in proportion to the tension
    assert found.D[0] == pytest.approx([float(tendon.stiffness), float(tendon.loss) * tension], rel=1e-9)


def test_a_taut_muscle_that_is_tied_has_no_state_and_pulls_by_law_and_viscosity():
    machine, state, found = on_a_plate()
    assert not any(name.startswith("muscles") for name in found.names.states)
    muscle, gauge = machine.units["m"], 4e5 - ROOM
    stiff = float(muscle.law.braid_stiffness(0.142, gauge))
    assert found.D[0] == pytest.approx([stiff, float(muscle.viscosity)], rel=1e-9)
    _, _, stuck = on_a_plate(friction="stuck")
    springs = float(np.sum(np.asarray(muscle.friction.stiffness)))
    assert (stuck.D - found.D)[0] == pytest.approx([springs, 0.0], rel=1e-9)


def arguments(machine, state):
    inputs = constant(x=0.142, **{"m.fill": 0.0, "m.vent": 0.0})
    return state, machine.initial(dict.fromkeys(machine.circuit.chambers, 4e5), inputs)[1], inputs


def test_stuck_friction_is_a_spring_beside_the_braid():
    machine, state, free = on_a_plate(end_mass=0.02)
    _, _, stuck = on_a_plate(end_mass=0.02, friction="stuck")
    springs = float(np.sum(np.asarray(unit().friction.stiffness)))
    assert float(memory_stiffness(machine.units["m"], 3e5)) == pytest.approx(springs, rel=1e-12)
    row, column = (free.names.states.index(f"muscles.m.{n}") for n in ("velocity", "length"))
    assert (free.A - stuck.A)[row, column] == pytest.approx(springs / 0.02, rel=1e-9)
    fastest = [m.modes()[-1].frequency for m in (free, stuck)]
    assert fastest[1] > fastest[0]


def test_the_stiffness_of_the_model_is_that_of_the_muscle():
    """A quick motion finds the gas shut in, by the inertia of the tube's gas; a slow one shares it with port and wall."""
    machine, state, found = on_a_plate(end_mass=1e-4)
    own = muscle_stiffness(machine, *arguments(machine, state), "m")
    slow = abs(found.response("x", "m.tension", 0.05)[0])
    assert own.relaxed_at_pressure < slow < own.relaxed_at_mass
    quick, w = found.response("x", "m.tension", 300.0)[0].real, 2.0 * np.pi * 300.0
    braid = 1.0 / (1.0 / own.relaxed_at_mass - 1e-5) - 1e-4 * w**2  # without its tendon, less its inertia
    # the tube's gas swings with the muscle's volume at some 60 Hz, which at 300 Hz is felt by 7 %
    assert quick == pytest.approx(1.0 / (1.0 / braid + 1e-5), rel=0.1)


def test_names_that_are_not_there_are_refused():
    for options in ({"inputs_by_name": ("y",)}, {"outputs": ("m.colour",)}, {"friction": "loose"}):
        with pytest.raises(InputError):
            on_a_plate(**options)
    with pytest.raises(InputError, match="Known are x"):
        on_a_plate()[2].response("y", "m.tension", 1.0)
    with pytest.raises(InputError, match="above 0 Hz"):
        on_a_plate()[2].response("x", "m.tension", 0.0)
    machine, state, _ = on_a_plate()
    with pytest.raises(InputError, match="Known are m"):
        muscle_stiffness(machine, *arguments(machine, state), "n")
    with pytest.raises(InputError, match="must be a JointLoad"):
        joint_stiffness(machine, *arguments(machine, state))
    assert at({"x": ramped(np.zeros(2))}, 0)["x"].value == 0.0
