"""Parts for Warp: the numbers of the part itself, parameters of each instance, MuJoCo Warp, Newton, and PTX."""

import importlib.util
import types
from pathlib import Path

import numpy as np
import pytest

from learned_muscle import learned_muscle
from mckibben.simulation.air import Air
from mckibben_hosts import Part, conform, export

wp = pytest.importorskip("warp", reason="Warp is not installed")
SPAN, STEP = 0.14, 1e-3


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Part:
    return Part(learned_muscle(tmp_path_factory.mktemp("learned")), Air(supply="6 bar"), span=SPAN)


@pytest.fixture(scope="module")
def path(part: Part, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export(part, "warp", tmp_path_factory.mktemp("warp"), name="tested")[0]


@pytest.fixture(scope="module")
def module(path: Path) -> types.ModuleType:
    wp.config.log_level = wp.LOG_WARNING
    wp.config.optimization_level = 0  # compiled sooner
    wp.set_device("cpu")
    spec = importlib.util.spec_from_file_location(path.stem, path)
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def given(muscles, spans, rates, commands) -> None:
    numbers = np.zeros(muscles.inputs.shape)
    numbers[:, muscles_places(muscles)] = np.transpose([spans, rates, commands])
    muscles.inputs.assign(numbers)


def muscles_places(muscles) -> list[int]:
    inputs = type(muscles).__init__.__globals__["INPUTS"]
    return [inputs[name] for name in ("span.muscle", "rate.muscle", "command.muscle")]


def test_instances_in_warp_step_as_the_part_does(part, module):
    """Equations and steps are the same, compilers differ: 1e-9 is far above rounding and far below any error of a step."""
    muscles, commands = module.Muscles(3, "cpu"), [0.3, 0.0, -0.2]
    states = [part.rest(SPAN, muscle=command) for command in commands]
    for k in range(20):
        span, rate = SPAN + 1e-3 * np.sin(0.1 * k), 0.1 * np.cos(0.1 * k)
        given(muscles, [span] * 3, [rate] * 3, commands)
        muscles.step(STEP)
        wp.copy(muscles.state, muscles.following)
        results = [
            part.step(state, period=STEP, span=span, rate=rate, staggered=True, muscle=command)
            for state, command in zip(states, commands, strict=True)
        ]
        states = [state for state, _ in results]
    assert results[0][1].pressure > 1.1 * results[1][1].pressure > 0.0
    for name, field in (("tension.muscle", "tension"), ("muscle.muscle.pressure", "pressure"), ("work.muscle", "work")):
        np.testing.assert_allclose(muscles.output(name), [getattr(seen, field) for _, seen in results], rtol=1e-9)


def test_parameters_may_differ_from_instance_to_instance(module):
    muscles = module.Muscles(2, "cpu", {"circuit.nodes.supply.pressure_abs": [3e5, 7e5]})
    for _ in range(10):
        given(muscles, [SPAN] * 2, [0.0] * 2, [1.0] * 2)
        muscles.step(STEP)
        wp.copy(muscles.state, muscles.following)
    low, high = muscles.output("muscle.muscle.pressure")
    assert high > 1.5 * low > 0.0
    with pytest.raises(KeyError, match="Unknown parameter"):
        module.Muscles(1, "cpu", {"supply": 1.0})


def test_rows_of_zeros_rest_at_the_next_span_while_the_others_go_on(part, module):
    """What an actuator of another simulator needs, which is asked for efforts and reset row by row."""
    muscles, at = module.Muscles(2, "cpu"), {"period": STEP, "span": SPAN, "staggered": True, "muscle": 0.5}
    state = again = None
    for k in range(12):
        if k == 8:
            muscles.state.numpy()[1] = 0.0
            again = None
        given(muscles, [SPAN] * 2, [0.0] * 2, [0.5] * 2)
        muscles.step(STEP)
        wp.copy(muscles.state, muscles.following)
        state, seen = part.step(part.rest(SPAN, muscle=0.5) if state is None else state, **at)
        again, anew = part.step(part.rest(SPAN, muscle=0.5) if again is None else again, **at)
    assert seen.pressure > 2.0 * anew.pressure > 0.0
    # as above: other compilers
    np.testing.assert_allclose(muscles.output("muscle.muscle.pressure"), [seen.pressure, anew.pressure], rtol=1e-9)


def test_models_that_cannot_work_are_refused(module):
    mujoco = pytest.importorskip("mujoco", reason="MuJoCo is not installed")
    text = '<mujoco><option integrator="RK4"/></mujoco>'
    with pytest.raises(ValueError, match="integrator must be Euler or implicitfast"):
        module.MujocoMuscles(mujoco.MjModel.from_xml_string(text), None, None)
    with pytest.raises(ValueError, match="actuators must be 1, got 2"):
        module.MujocoMuscles(mujoco.MjModel.from_xml_string(text), None, None, actuators=("a", "b"))


@pytest.mark.slow  # Newton takes seconds to load
def test_a_newton_drive_turns_a_joint_as_the_part_does(part, module):
    """Moments are float32 there, rounded at 6e-8."""
    actuators = pytest.importorskip("newton.actuators", reason="Newton is not installed")
    drive = module.newton_drive(1, arms={"muscle": 0.02}, spans={"muscle": SPAN}, device="cpu")
    actuator = actuators.Actuator(wp.array([0], dtype=wp.uint32, device="cpu"), drive)
    now, following = actuator.state(), actuator.state()
    one = lambda value: wp.array([value], dtype=float, device="cpu")  # noqa: E731
    state, moments, ours = None, [], []
    for k in range(10):
        angle, rate = (float(np.float32(x)) for x in (-0.02 - 0.01 * np.sin(0.2 * k), -2.0 * np.cos(0.2 * k)))
        control = types.SimpleNamespace(
            joint_target_q=one(0.0),
            joint_target_qd=one(0.0),
            joint_target_pos=one(0.0),
            joint_target_vel=one(0.0),
            joint_act=one(0.0),
            joint_f=one(0.0),
            muscle_commands=wp.array([[1.0]], dtype=float, device="cpu"),
        )
        actuator.step(types.SimpleNamespace(joint_q=one(angle), joint_qd=one(rate)), control, now, following, STEP)
        now, following = following, now
        moments.append(float(control.joint_f.numpy()[0]))
        moment = {"span": SPAN - 0.02 * angle, "rate": -0.02 * rate, "muscle": 1.0}
        state = part.rest(moment["span"], muscle=1.0) if state is None else state
        state, seen = part.step(state, period=STEP, staggered=True, **moment)
        ours.append(0.02 * seen.tension)
    assert ours[-1] > 0.1
    np.testing.assert_allclose(moments, ours, rtol=1e-6)


@pytest.mark.slow  # MuJoCo Warp compiles its kernels, about a minute
def test_a_weight_in_mujoco_warp_meets_the_limits():
    pytest.importorskip("mujoco_warp", reason="MuJoCo Warp is not installed")
    certificate = conform("warp", scenarios=["hang"], steps=(1e-3, 2e-3), states=False)
    assert len(certificate.verdicts) == 4 and certificate.holds


@pytest.mark.slow  # Newton takes seconds to load, its kernels half a minute to compile
def test_a_weight_in_newton_meets_the_limits():
    pytest.importorskip("newton", reason="Newton is not installed")
    certificate = conform("newton", scenarios=["hang"], steps=(1e-3, 2e-3), states=False)
    assert len(certificate.verdicts) == 4 and certificate.holds


@pytest.mark.slow
def test_the_muscles_compile_to_ptx(module, tmp_path, monkeypatch):
    monkeypatch.setattr(wp.config, "optimization_level", 1)  # 0 is refused for GPUs
    wp.compile_aot_module(module, arch=90, module_dir=str(tmp_path), use_ptx=True)
    (code,) = tmp_path.glob("*.ptx")
    assert ".f64" in code.read_text()
