"""The component of ros2_control, compiled with a stub of its interface: the motion of a loop, and what it refuses."""

import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import pytest

from mckibben.simulation.air import Air
from mckibben_hosts import Part, export

HERE = Path(__file__).parent
INERTIA, DAMPING, ARM, SPAN, STEP, COUNT = 4e-3, 0.05, 0.02, 0.135, 1e-3, 80
JOINT = (
    f"joint.inertia={INERTIA}",
    f"joint.damping={DAMPING}",
    f"joint.arm.flexor={ARM}",
    f"joint.arm.extensor={-ARM}",
)
needs_compilers = pytest.mark.skipif(
    not (shutil.which("g++") and shutil.which("gcc")), reason="no C and C++ compilers here"
)


@pytest.fixture(scope="module")
def part() -> Part:
    return Part({"flexor": "nylon", "extensor": "nylon"}, Air(supply="6 bar"), span=SPAN)


@pytest.fixture(scope="module")
def package(part, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("ros2")
    export(part, "ros2", folder, name="elbow")
    return folder


@pytest.fixture(scope="module")
def program(package: Path) -> Path:
    """The component with a program that steps it, compiled with all warnings but without optimisation."""
    made = package / "host"
    warnings = ["-O0", "-Wall", "-Wextra", "-Wpedantic", "-Werror"]
    subprocess.run(
        ["gcc", "-std=c99", "-O0", "-ffp-contract=off", "-c", package / "elbow.c", "-o", package / "elbow.o"],
        check=True,
    )
    sources = [package / "elbow_hardware.cpp", HERE / "ros2_host.cpp", package / "elbow.o"]
    folders = [f"-I{package}", f"-I{HERE / 'ros2_stub'}"]
    subprocess.run(["g++", "-std=c++17", *warnings, *folders, *sources, "-o", made, "-lm"], check=True)
    return made


def shown(program: Path, *words: str) -> dict[str, float]:
    done = subprocess.run([program, *words], capture_output=True, text=True, check=True)
    return {name: float(value) for name, value in (line.split() for line in done.stdout.splitlines())}


@needs_compilers
def test_controllers_see_the_motion_of_a_loop_with_mean_accelerations(part, program):
    seen = shown(program, *JOINT, str(COUNT // 2), str(2 * STEP), "0.2", "-0.1")  # two steps in each period
    position, rate, state = 0.0, 0.0, None
    commands = {"flexor": 0.2, "extensor": -0.1}
    for _ in range(COUNT):
        spans = {"flexor": SPAN - ARM * position, "extensor": SPAN + ARM * position}
        rates = {"flexor": -ARM * rate, "extensor": ARM * rate}
        state = part.rest(spans, **commands) if state is None else state
        state, out = part.step(state, period=STEP, span=spans, rate=rates, **commands)
        effort = ARM * (out.flexor_tension - out.extensor_tension)
        before = rate
        rate += STEP * (effort - DAMPING * rate) / INERTIA
        position += 0.5 * STEP * (before + rate)
    assert abs(position) > 0.1
    expected = {"joint/position": position, "joint/velocity": rate, "joint/effort": effort}
    expected |= {f"{m}/pressure": getattr(out, f"{m}_pressure") for m in commands}
    # C and Python have the same steps; sums in another order are rounded otherwise
    assert {name: seen[name] for name in expected} == pytest.approx(expected, rel=1e-6)
    assert seen["flexor/span"] == pytest.approx(SPAN - ARM * position, rel=1e-9)


@needs_compilers
@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (("joint.damping=0.1",), "joint: inertia is missing"),
        ((*JOINT, "joint.arm.biceps=0.02"), "joint: unknown muscle 'biceps'"),
        ((*JOINT, "step=soon"), "step must be a number of at least"),
        ((*JOINT, "mass=2"), "unknown parameter 'mass'"),
    ],
    ids=["inertia", "muscle", "step", "parameter"],
)
def test_a_wrong_robot_description_is_refused_with_a_sentence(program, words, sentence):
    done = subprocess.run([program, *words, "1", "0.001", "0", "0"], capture_output=True, text=True)
    assert done.returncode == 2 and sentence in done.stderr


def test_the_package_names_its_component_in_every_file(package):
    (plugin,) = ElementTree.parse(package / "elbow_hardware.xml").getroot().iter("class")
    description = ElementTree.parse(package / "elbow.ros2_control.xacro").getroot()
    assert description.findtext("ros2_control/hardware/plugin") == plugin.get("name") == "elbow/MuscleSystem"
    assert ElementTree.parse(package / "package.xml").getroot().findtext("name") == "elbow"
    assert {g.get("name") for g in description.iter("gpio")} == {"flexor", "extensor"}
    assert "not with ROS 2 itself" in (package / "elbow_hardware.cpp").read_text()
