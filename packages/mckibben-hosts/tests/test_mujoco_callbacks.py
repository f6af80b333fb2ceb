"""Muscles in MuJoCo by callbacks of Python: the motion of a loop of ours on one tank, copies, rollouts, and refusals."""

import copy
import pickle

import numpy as np
import pytest

from mckibben.engine.soundness import Soundness
from mckibben.errors import InputError, PlausibilityWarning
from mckibben_hosts import MuscleCallbacks, Part, act_size
from tank_part import tank_part

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
SPAN, INERTIA, ARM, STEP = 0.14, 4e-3, 0.02, 1e-3
COMMANDS = {"left": 0.1, "right": -0.1}
JOINT = """<mujoco><option timestep="0.001" gravity="0 0 0"/>
<worldbody><body><joint name="q" axis="0 1 0"/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.004 0.004 0.004"/></body></worldbody>
<actuator>
  <general name="left" joint="q" gear="-0.02" dyntype="user" actdim="SIZE" gainprm="0" biastype="user" biasprm="0.14"/>
  <general name="right" joint="q" gear="0.02" gainprm="0" biastype="user" biasprm="0.14"/>
</actuator></mujoco>"""
BOTH = ("left", "right")


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Part:
    return tank_part(tmp_path_factory.mktemp("tank"))


@pytest.fixture
def model(part: Part):
    return mujoco.MjModel.from_xml_string(JOINT.replace("SIZE", str(act_size(part))))


def motion(model, data, steps: int = 40) -> np.ndarray:
    rows = []
    for _ in range(steps):
        data.ctrl[:] = list(COMMANDS.values())
        mujoco.mj_step(model, data)
        rows.append([*data.qpos, *data.actuator_force])
    return np.array(rows)


def test_a_hinge_between_two_muscles_on_one_tank_moves_as_in_a_semi_implicit_loop(part, model):
    """Both take the same steps; ``act`` is divided by its size and comes back with a rounding per step."""
    with MuscleCallbacks(model, {BOTH: part}) as muscles:
        data = mujoco.MjData(model)
        rows = motion(model, data, 100)
        found = muscles.observe(model, data, "right")
    angle, rate, state, ours = 0.0, 0.0, part.rest(SPAN, **COMMANDS), []
    for _ in range(100):
        spans, rates = ({n: s * ARM * x for n, s in (("left", -1), ("right", 1))} for x in (angle, rate))
        spans = {name: SPAN + more for name, more in spans.items()}
        state, seen = part.step(state, period=STEP, span=spans, rate=rates, staggered=True, **COMMANDS)
        rate += STEP * ARM * (seen.left_tension - seen.right_tension) / INERTIA
        angle += STEP * rate
        ours.append(angle)
    assert rows[-1, 0] > 0.1
    np.testing.assert_allclose(rows[:, 0], ours, atol=1e-7)
    assert found.left_pressure == pytest.approx(seen.left_pressure, rel=1e-7)
    assert found.left_tension == pytest.approx(seen.left_tension, rel=1e-6)
    assert found.left_tension_end == pytest.approx(seen.left_tension_end, rel=1e-3)  # whose rate is a ramp's there


def test_copies_pickles_and_rollouts_have_the_bits_of_single_steps(part, model):
    rollout = pytest.importorskip("mujoco.rollout")
    with MuscleCallbacks(model, {BOTH: part}):
        data = mujoco.MjData(model)
        motion(model, data)
        others = [copy.copy(data), pickle.loads(pickle.dumps(data))]
        first = motion(model, data)
        for other in others:
            assert np.array_equal(motion(model, other), first)
        kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
        start = np.empty(mujoco.mj_stateSize(model, kind))
        mujoco.mj_getState(model, mujoco.MjData(model), start, kind)
        controls = np.array([[list(COMMANDS.values())] * 20, [[0.0, 0.2]] * 20, [list(COMMANDS.values())] * 20])
        threads = [mujoco.MjData(model) for _ in range(2)]
        states, _ = rollout.rollout(model, threads, start[None].repeat(3, 0), controls)
        alone = motion(model, mujoco.MjData(model), 20)
    assert np.array_equal(states[0], states[2])
    assert np.array_equal(states[0, :, 1], alone[:, 0])
    assert states[1, -1, 1] < 0.0 < states[0, -1, 1]


def test_callbacks_end_with_their_context(part, model):
    before = mujoco.get_mjcb_act_dyn()
    with MuscleCallbacks(model, {BOTH: part}):
        assert mujoco.get_mjcb_act_dyn() is not before
    assert mujoco.get_mjcb_act_dyn() is before


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('name="right"', 'name="rigth"', "Did you mean 'rigth'"),
        ('actdim="SIZE"', 'actdim="3"', "actdim of the actuator left must be"),
        ('gravity="0 0 0"', 'integrator="RK4"', "integrator must be Euler"),
        ('dyntype="user" actdim="SIZE"', "", 'dyntype of the actuator left must be "user"'),
        ('biastype="user" biasprm="0.14"/>\n</actuator>', "/>\n</actuator>", "biastype of the actuator right must be"),
    ],
    ids=["name", "actdim", "integrator", "dyntype", "biastype"],
)
def test_models_that_do_not_fit_are_refused(part, old, new, sentence):
    wrong = JOINT.replace(old, new).replace("SIZE", str(act_size(part)))
    with pytest.raises(InputError, match=sentence):
        MuscleCallbacks(mujoco.MjModel.from_xml_string(wrong), {BOTH: part})


def test_a_muscle_without_its_offset_is_said_once_and_does_not_pull(part):
    text = JOINT.replace("SIZE", str(act_size(part))).replace('biasprm="0.14"', 'biasprm="0"')
    model = mujoco.MjModel.from_xml_string(text)
    with MuscleCallbacks(model, {BOTH: part}), pytest.warns(PlausibilityWarning, match="none that .* can take") as said:
        rows = motion(model, mujoco.MjData(model), 5)
    assert np.array_equal(rows, np.zeros((5, 3))) and len(said) == 2


def test_a_part_needs_an_actuator_for_each_muscle(part, model):
    with pytest.raises(InputError, match="one actuator for each of left, right"):
        MuscleCallbacks(model, {"left": part})


def test_a_step_that_cannot_be_relied_on_is_warned_of_once(part, model, monkeypatch):
    real = part.step_vector

    def unsound(state, inputs, period, staggered):
        new, out = real(state, inputs, period, staggered=staggered)
        out[part.outputs.index("sound")] = float(Soundness.MECHANICS)
        return new, out

    monkeypatch.setattr(part, "step_vector", unsound)
    with (
        MuscleCallbacks(model, {BOTH: part}),
        pytest.warns(PlausibilityWarning, match="mechanics does not close") as said,
    ):
        motion(model, mujoco.MjData(model), 5)
    assert len(said) == 1
