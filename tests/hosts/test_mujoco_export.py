"""The plugin of MuJoCo: the same motion as a loop of ours, equal bits in copies, and what it refuses."""

import copy
import pickle
import re
import shutil
from pathlib import Path

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.hosts import Part, export
from mckibben.simulation.air import Air

mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
pytestmark = pytest.mark.skipif(not (shutil.which("gcc") or shutil.which("cc")), reason="no C compiler here")
SPAN, MASS, STEP = 0.14, 4.0, 1e-3


@pytest.fixture(scope="module")
def part() -> Part:
    return Part("nylon", Air(supply="6 bar"), span=SPAN)


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
        data.ctrl[0] = 0.3
        mujoco.mj_step(model, data)
        rows.append([*data.qpos, *data.actuator_force, *data.sensordata])
    return np.array(rows)


def test_mujoco_moves_a_weight_as_a_semi_implicit_loop_does(part, model):
    """Both take the same steps; ``act`` is divided by its size and comes back with a rounding per step."""
    rows = motion(model, mujoco.MjData(model), 100)
    span, rate, state, spans = SPAN, 0.0, part.rest(SPAN, muscle=0.3), []
    for _ in range(100):
        state, seen = part.step(state, period=STEP, span=span, rate=rate, staggered=True, muscle=0.3)
        rate += STEP * (9.81 - seen.tension / MASS)
        span += STEP * rate
        spans.append(span)
    assert np.ptp(rows[:, 0]) > 5e-3
    np.testing.assert_allclose(SPAN - rows[:, 0], spans, atol=1e-9)
    np.testing.assert_allclose(rows[-1, 2], seen.pressure, rtol=1e-7)


def test_copies_pickles_and_restored_states_go_on_with_the_same_bits(model):
    data = mujoco.MjData(model)
    motion(model, data)
    size = mujoco.mj_stateSize(model, mujoco.mjtState.mjSTATE_INTEGRATION)
    state = np.empty(size)
    mujoco.mj_getState(model, data, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    restored = mujoco.MjData(model)
    mujoco.mj_setState(model, restored, state, mujoco.mjtState.mjSTATE_INTEGRATION)
    others = [copy.copy(data), pickle.loads(pickle.dumps(data)), restored]
    first = motion(model, data)
    for other in others:
        assert np.array_equal(motion(model, other), first)


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
    [(r'actdim="\d+"', 'actdim="3"'), ('timestep="0.001"', 'timestep="0.001" integrator="RK4"')],
    ids=["too few numbers in act", "RK4"],
)
def test_models_that_cannot_work_are_refused(text, old, new, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # MuJoCo writes its warnings to a file there
    wrong = re.sub(old, new, text)
    assert wrong != text
    with pytest.raises((ValueError, mujoco.FatalError)):
        mujoco.MjData(mujoco.MjModel.from_xml_string(wrong))


def test_parts_with_several_muscles_are_refused(tmp_path):
    with pytest.raises(InputError, match="must have one muscle and one command for MuJoCo"):
        export(Part({"flexor": "nylon", "extensor": "nylon"}), "mujoco", tmp_path)
