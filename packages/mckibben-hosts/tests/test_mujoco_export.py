"""The plugin of MuJoCo with two muscles on one tank: the motion of a loop of ours, equal bits, and what it refuses."""

import copy
import pickle
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from mckibben_hosts import Part, export
from mckibben_hosts.mujoco_muscles import ActuatorRole, actuator_roles
from mckibben_hosts.part import part_of
from tank_part import tank_part

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
pytestmark = pytest.mark.skipif(not (shutil.which("gcc") or shutil.which("cc")), reason="no C compiler here")
SPAN, MASS, STEP = 0.14, 4.0, 1e-3
COMMANDS = {"left": 0.3, "right": 0.1}


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Part:
    return tank_part(tmp_path_factory.mktemp("tank"))


@pytest.fixture(scope="module")
def text(part: Part, tmp_path_factory: pytest.TempPathFactory) -> str:
    folder = tmp_path_factory.mktemp("plugin")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("CFLAGS", "-O0")  # compiled sooner; the bits are the same
        files = export(part, "mujoco", folder, name="tested")
    mujoco.mj_loadPluginLibrary(str(files[-1]))
    return (folder / "tested.xml").read_text()


@pytest.fixture
def model(text: str):
    return mujoco.MjModel.from_xml_string(text)


def motion(model, data, steps: int = 60) -> np.ndarray:
    rows = []
    for _ in range(steps):
        data.ctrl[:] = list(COMMANDS.values())
        mujoco.mj_step(model, data)
        rows.append([*data.qpos, *data.actuator_force, *data.sensordata])
    return np.array(rows)


def test_mujoco_moves_two_weights_on_one_tank_as_a_semi_implicit_loop_does(part, model):
    """Both take the same steps; ``act`` is divided by its size and comes back with a rounding per step."""
    rows = motion(model, mujoco.MjData(model), 100)
    spans, rates = dict.fromkeys(part.muscles, SPAN), dict.fromkeys(part.muscles, 0.0)
    state, ours = part.rest(SPAN, **COMMANDS), []
    for _ in range(100):
        state, seen = part.step(state, period=STEP, span=spans, rate=rates, staggered=True, **COMMANDS)
        for name in part.muscles:
            rates[name] += STEP * (9.81 - getattr(seen, f"{name}_tension") / MASS)
            spans[name] += STEP * rates[name]
        ours.append(list(spans.values()))
    assert np.ptp(rows[:, 0]) > 5e-3
    np.testing.assert_allclose(SPAN - rows[:, :2], ours, atol=1e-9)
    np.testing.assert_allclose(rows[-1, [4, 11]], [seen.left_pressure, seen.right_pressure], rtol=1e-7)


def test_copies_pickles_and_restored_states_go_on_with_the_same_bits(model):
    data = mujoco.MjData(model)
    motion(model, data)
    kind = mujoco.mjtState.mjSTATE_INTEGRATION
    state = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, data, state, kind)
    restored, twin = mujoco.MjData(model), mujoco.MjData(model)
    mujoco.mj_setState(model, restored, state, kind)
    mujoco.mj_copyData(twin, model, data)
    others = [copy.copy(data), pickle.loads(pickle.dumps(data)), restored, twin]
    first = motion(model, data)
    for other in others:
        assert np.array_equal(motion(model, other), first)


def test_a_rollout_on_two_threads_has_the_bits_of_single_steps(model):
    rollout = pytest.importorskip("mujoco.rollout")
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty(mujoco.mj_stateSize(model, kind))
    mujoco.mj_getState(model, mujoco.MjData(model), start, kind)
    controls = np.random.default_rng(0).uniform(-0.3, 0.3, (3, 1, 2)).repeat(20, axis=1)
    states, sensors = rollout.rollout(
        model, [mujoco.MjData(model) for _ in range(2)], start[None].repeat(3, 0), controls
    )
    for k in range(3):
        data = mujoco.MjData(model)
        data.ctrl[:] = controls[k, 0]
        mujoco.mj_step(model, data, nstep=20)
        assert np.array_equal(sensors[k, -1], data.sensordata)
        assert np.array_equal(states[k, -1, 1 : 1 + model.nq], data.qpos)


def test_data_that_are_stepped_with_another_model_take_its_numbers(text):
    """As rollouts of many models on few data do, with a state of one of them; so does MuJoCo's system identification."""
    rollout = pytest.importorskip("mujoco.rollout")
    spec = mujoco.MjSpec.from_string(text)
    models = [spec.compile()]
    spec.plugins[0].config = {"muscles.left.law.threshold_pressure": "2e5"}
    models.append(spec.compile())
    kind = mujoco.mjtState.mjSTATE_FULLPHYSICS
    start = np.empty(mujoco.mj_stateSize(models[0], kind))
    mujoco.mj_getState(models[0], mujoco.MjData(models[0]), start, kind)
    controls = np.tile(list(COMMANDS.values()), (2, 60, 1))
    states, _ = rollout.rollout(models, [mujoco.MjData(models[0])], np.repeat(start[None], 2, 0), controls)
    alone = [motion(model, mujoco.MjData(model)) for model in models]
    for together, single in zip(states, alone, strict=True):
        np.testing.assert_array_equal(together[:, 1:3], single[:, :2])
    assert np.ptp([single[-1, 0] for single in alone]) > 1e-4


def test_evaluating_does_not_go_on_and_reset_returns_to_the_start(model):
    data, plain = mujoco.MjData(model), mujoco.MjData(model)
    first = motion(model, data, 10)
    mujoco.mj_resetData(model, data)
    assert np.array_equal(motion(model, data, 10), first)
    motion(model, plain, 10)
    mujoco.mj_forward(model, data)
    mujoco.mj_forward(model, data)
    assert np.array_equal(motion(model, data, 10), motion(model, plain, 10))


def test_a_slack_muscle_does_not_pull(model):
    data = mujoco.MjData(model)
    motion(model, data, 10)
    data.qpos[0] += 0.03  # the hook comes 3 cm closer
    mujoco.mj_step(model, data)
    assert data.actuator_force[0] <= 0.0
    mujoco.mj_step(model, data)
    assert data.actuator_force[0] == 0.0


@pytest.mark.parametrize(
    ("old", "new"),
    [
        (r'actdim="\d+"', 'actdim="3"'),
        ('timestep="0.001"', 'timestep="0.001" integrator="RK4"'),
        (r'    <plugin name="right".*/>\n', ""),
    ],
    ids=["too few numbers in act", "RK4", "a muscle without an actuator"],
)
def test_models_that_cannot_work_are_refused(text, old, new, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings to a file there
    wrong = re.sub(old, new, text)
    assert wrong != text
    with pytest.raises((ValueError, mujoco.FatalError)):
        mujoco.MjData(mujoco.MjModel.from_xml_string(wrong))


def test_a_muscle_without_its_offset_is_said_once_and_does_not_pull(text, monkeypatch):
    warned = []
    mujoco.set_mju_user_warning(warned.append)
    try:
        model = mujoco.MjModel.from_xml_string(text)
        data = mujoco.MjData(model)
        data.qpos[:] += 0.14  # the hook is at the anchor, as a joint at zero is without the offset
        rows = motion(model, data, 5)
        assert np.array_equal(rows[:, 2:4], np.zeros((5, 2)))
        said = [sentence for sentence in warned if "is none that its muscle can take" in sentence]
        assert len(said) == 2 and "offset.left" in said[0]  # one for each muscle
        data.ctrl[:] = 3e5
    finally:
        mujoco.set_mju_user_warning(None)


@pytest.mark.parametrize(("model", "source"), [("elbow", "nylon"), ("leg", "leg.toml")])
def test_the_models_of_the_examples_have_room_for_the_state_of_their_plugins(model, source):
    """What a part keeps beside its physics is in it: a change there leaves no model of ours that MuJoCo refuses."""
    examples = Path(__file__).parents[3] / "examples" / "mujoco"
    stated = re.findall(r'actdim="(\d+)"', (examples / f"{model}.xml").read_text(encoding="utf-8"))
    part = part_of(examples / source if source.endswith(".toml") else source)
    assert set(stated) == {str(part.rest().size)}


class StatedPart:
    """The names of a part."""

    def __init__(self, muscles: str, commands: str) -> None:
        self.muscles, self.commands = tuple(muscles.split()), tuple(commands.split())


def test_commands_without_a_muscle_go_to_the_next_free_actuator_and_then_to_one_of_their_own():
    roles = actuator_roles(StatedPart("a b c", "x b y z"))
    assert roles == (ActuatorRole("a", "x"), ActuatorRole("b", "b"), ActuatorRole("c", "y"), ActuatorRole(None, "z"))
    assert actuator_roles(StatedPart("a b", "both")) == (ActuatorRole("a", "both"), ActuatorRole("b", None))
