"""FMUs: accepted by the checker, the bits of the part in two importers, saved states, model exchange, refusals."""

import re
import shutil
import subprocess
from importlib import resources
from pathlib import Path
from types import SimpleNamespace
from typing import NamedTuple
from xml.etree import ElementTree

import numpy as np
import pytest

import mckibben as mk
from host_loops import MASS, START, hanging_part, run_in_host
from learned_muscle import learned_muscle
from mckibben.errors import InputError
from mckibben.pneumatics.orifice import Orifice
from mckibben.pneumatics.valves import SpoolValve
from mckibben.quantities import base_exponents, declared
from mckibben.simulation.air import Air
from mckibben.specimens import specimen, specimen_ids
from mckibben_hosts import Part, export
from mckibben_hosts.c_source import PartSource, PartVariable
from mckibben_hosts.conformance import conform
from mckibben_hosts.fmi_description import fmu_variables, unit_definitions
from mckibben_hosts.fmi_export import fmu_cautions, fmu_files
from mckibben_hosts.fmi_host import instantiate_silently

fmpy = pytest.importorskip("fmpy", reason="FMPy is not installed")
COMPILER = shutil.which("gcc") or shutil.which("cc")
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler here")
LIFT = np.repeat([0.0, 0.06, 0.0, -0.05], [1, 4, 2, 3])


class Fmu(NamedTuple):
    path: Path
    folder: Path
    description: object

    def references(self, *names: str) -> list[int]:
        known = {v.name: v.valueReference for v in self.description.modelVariables}
        return [known[name] for name in names]


class Slave:
    """An instance in FMPy, of either version."""

    def __init__(self, fmu: Fmu, silent: bool = False, **starts: float) -> None:
        self.fmu, self.messages = fmu, []
        third = fmu.description.fmiVersion.startswith("3")
        kind = fmpy.fmi3.FMU3Slave if third else fmpy.fmi2.FMU2Slave
        described = fmu.description
        self.slave = kind(
            guid=described.instantiationToken if third else described.guid,
            unzipDirectory=str(fmu.folder),
            modelIdentifier="lift",
            instanceName="one",
        )
        if silent:
            instantiate_silently(fmpy, self.slave)
        elif third:
            self.slave.instantiate(logMessage=lambda e, status, category, text: self.messages.append(text.decode()))
        else:
            self.slave.instantiate()
        self.put, self.get = (
            (self.slave.setFloat64, self.slave.getFloat64) if third else (self.slave.setReal, self.slave.getReal)
        )
        for name, value in starts.items():
            self.put(fmu.references(name), [value])
        if not third:
            self.slave.setupExperiment()
        self.slave.enterInitializationMode()
        self.slave.exitInitializationMode()
        self.inputs = fmu.references("span", "rate", "command.muscle")
        self.time = 0.0

    def step(self, period: float, *inputs: float) -> float:
        """The mean tension."""
        self.put(self.inputs, list(inputs))
        self.slave.doStep(self.time, period)
        self.time += period
        return self.get(self.fmu.references("tension"))[0]

    def close(self) -> None:
        self.slave.terminate()
        self.slave.freeInstance()


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Part:
    return hanging_part(Air(supply="6 bar"), learned_muscle(tmp_path_factory.mktemp("learned")))


@pytest.fixture(scope="module", params=["fmi3", "fmi2"])
def fmu(request: pytest.FixtureRequest, part: Part, tmp_path_factory: pytest.TempPathFactory) -> Fmu:
    folder = tmp_path_factory.mktemp(request.param)
    with pytest.MonkeyPatch.context() as patch:
        # compiled sooner, in 2.0 for one kind of processor only; the bits are the same
        single = " -DLIFT_CLONES=" if request.param == "fmi2" else ""
        patch.setenv("CFLAGS", f"-O0 -Wall -Wextra -Werror{single}")
        (path,) = export(part, request.param, folder / "lift.fmu", name="lift")
    return Fmu(path, Path(fmpy.extract(str(path), str(folder / "unpacked"))), fmpy.read_model_description(str(path)))


def test_the_checker_of_fmpy_finds_no_problem(fmu: Fmu) -> None:
    assert fmpy.validation.validate_fmu(str(fmu.path)) == []
    tension = next(v for v in fmu.description.modelVariables if v.name == "tension")
    assert tension.unit == "N" and "same step" in tension.description
    cmake = (fmu.folder / "sources" / "CMakeLists.txt").read_text()
    assert "cmake_minimum_required(VERSION 3.16)" in cmake and f"of FMI {fmu.description.fmiVersion[0]}.0," in cmake


def test_an_importer_steps_the_bits_of_the_part(part: Part, fmu: Fmu) -> None:
    """A weight on the FMU moves exactly as on the part in Python, so that order and work at the border are the same too."""
    loop = run_in_host(part, 1e-3, LIFT, staggered=False)
    slave = Slave(fmu, span=START)
    span, rate = START, 0.0
    for k, expected in enumerate(loop.tensions):
        tension = slave.step(1e-3, span, rate, LIFT[k // 10])
        assert tension == expected
        acceleration, before = 9.80665 - tension / MASS, rate
        rate += 1e-3 * acceleration
        span += 1e-3 * 0.5 * (before + rate)
    assert slave.get(fmu.references("work"))[0] == loop.part_work
    slave.close()


def test_a_state_goes_on_with_equal_bits_in_another_instance(fmu: Fmu) -> None:
    one, other = Slave(fmu, span=START), Slave(fmu, span=START)
    for _ in range(5):
        one.step(1e-3, START, -0.1, 0.4)
    kept = one.slave.getFMUState()
    bytes_of = one.slave.serializeFMUState(kept)
    first = [one.step(7e-4, START - 5e-4, 0.05, 0.2) for _ in range(5)]
    one.slave.setFMUState(kept)
    assert [one.step(7e-4, START - 5e-4, 0.05, 0.2) for _ in range(5)] == first
    other.slave.setFMUState(other.slave.deserializeFMUState(bytes_of))
    assert [other.step(7e-4, START - 5e-4, 0.05, 0.2) for _ in range(5)] == first
    with pytest.raises(Exception, match="failed"):
        other.slave.deserializeFMUState(b"x" * len(bytes_of))
    other.slave.freeFMUState(kept)
    one.close()
    other.close()


def test_a_slack_muscle_does_not_pull(fmu: Fmu) -> None:
    slave = Slave(fmu, span=START)
    tensions = [slave.step(1e-3, START - 1e-3 * min(k, 30), -1.0 if k < 30 else 0.0, -1.0) for k in range(60)]
    assert min(tensions) >= 0.0 and tensions[-1] == 0.0
    slave.close()


def test_values_out_of_their_limits_are_refused(fmu: Fmu) -> None:
    slave = Slave(fmu, span=START)
    leakage = fmu.references("circuit.elements.muscle.valve.leakage")
    slave.put(leakage, [0.1])
    for reference, value in ((leakage, 0.7), (fmu.references("span"), np.nan), (fmu.references("start.muscle"), 1e5)):
        with pytest.raises(Exception, match="failed"):
            slave.put(reference, [value])
    assert slave.get(leakage) == [0.1]
    if slave.messages:
        assert "circuit.elements.muscle.valve.leakage must be between 0 and 0.5, got 0.7." in slave.messages
        assert "start.muscle is fixed after the initialization." in slave.messages
    with pytest.raises(Exception, match="failed"):
        slave.step(-1e-3, START, 0.0, 0.0)
    slave.close()


def test_a_span_that_no_muscle_can_have_is_refused_and_a_command_that_saturates_is_carried_out_with_a_warning(
    fmu: Fmu,
) -> None:
    slave = Slave(fmu, span=START)
    for span in (-1.0, 0.0, 14.0):
        with pytest.raises(Exception, match="failed"):
            slave.put(fmu.references("span"), [span])
    assert slave.get(fmu.references("span")) == [START]
    for value in (3e5, 2e5):
        slave.put(fmu.references("command.muscle"), [value])  # FMPy takes a warning for no failure
        assert slave.get(fmu.references("command.muscle")) == [value]
    if slave.messages:
        assert sum(text.startswith("span must be between") for text in slave.messages) == 3
        # once for a variable
        assert sum(text.startswith("command.muscle of 300000 can hardly be meant") for text in slave.messages) == 1
        assert not any("200000" in text for text in slave.messages)
    slave.close()
    stated = {v.name: (v.min, v.max) for v in fmu.description.modelVariables}
    low, high = (float(end) for end in stated["span"])
    assert 0.0 < low < START < high < 0.25


def test_a_refused_step_prints_nothing_between_the_lines_of_a_certificate(
    fmu: Fmu, capfd: pytest.CaptureFixture[str]
) -> None:
    slave = Slave(fmu, silent=True, span=START)
    with pytest.raises(Exception, match="failed"):
        slave.step(-1e-3, START, 0.0, 0.0)
    slave.close()
    assert "".join(capfd.readouterr()) == ""


def test_model_exchange_is_close_to_co_simulation(fmu: Fmu) -> None:
    ends = {}
    for kind in ("CoSimulation", "ModelExchange"):
        run = fmpy.simulate_fmu(
            str(fmu.folder),
            stop_time=0.05,
            output_interval=1e-3,
            step_size=1e-3,
            start_values={"command.muscle": 1.0},
            output=["tension_end", "pressure"],
            fmi_type=kind,
            fmi_call_logger=None,
        )
        ends[kind] = np.array([run["tension_end"][-1], run["pressure"][-1]])
    # friction follows the importer's steps of a millisecond: first order, some tenths of a newton of 80 N
    np.testing.assert_allclose(ends["ModelExchange"], ends["CoSimulation"], rtol=1e-2)


def test_model_exchange_by_an_integrator_that_runs_away_ends_with_an_error_and_says_so(fmu: Fmu) -> None:
    said: list[str] = []
    with pytest.raises(fmpy.fmi1.FMICallException):
        fmpy.simulate_fmu(
            str(fmu.folder),
            stop_time=0.5,
            solver="Euler",
            step_size=1e-3,
            output_interval=1e-3,
            start_values={"command.muscle": 1.0},
            output=["tension_end"],
            fmi_type="ModelExchange",
            logger=lambda *arguments: said.append(str(arguments)),
            fmi_call_logger=None,
        )
    why = "does not close: the importer's integrator needs a shorter step"  # long before a state is not finite
    assert any(why in text for text in said) or fmu.description.fmiVersion == "2.0"


def test_a_host_in_c_gets_the_bits_of_the_part(part: Part, fmu: Fmu, tmp_path: Path) -> None:
    if fmu.description.fmiVersion.startswith("2"):
        pytest.skip("the host in C is one of FMI 3.0")
    headers = str(resources.files("mckibben_hosts").joinpath("fmi", "headers"))
    source = str(Path(__file__).with_name("fmu_host.c"))
    host = str(tmp_path / "host")
    subprocess.run([COMPILER, "-std=c99", "-Wall", "-Wextra", f"-I{headers}", source, "-o", host, "-ldl"], check=True)
    library = str(next((fmu.folder / "binaries").glob("*/lift.*")))
    run = subprocess.run(
        [host, library, fmu.description.instantiationToken], capture_output=True, text=True, check=True
    )
    state, tensions = part.rest(START, muscle=0.0), []
    for _ in range(50):
        state, seen = part.step(state, period=1e-3, span=START, muscle=1.0)
        tensions.append(seen.tension)
    assert [float(line) for line in run.stdout.split()] == tensions
    assert subprocess.run([host, library, "{other}"], capture_output=True, check=False).returncode == 2


def test_all_functions_are_there(fmu: Fmu) -> None:
    version = fmu.description.fmiVersion[0]
    header = (fmu.folder / "sources" / f"fmi{version}Functions.h").read_text()
    names = re.findall(rf"^\s*FMI{version}_Export fmi{version}\w+TYPE\s+(\w+);", header, re.MULTILINE)
    assert len(names) == {"3": 75, "2": 44}[version]
    (library,) = (fmu.folder / "binaries").glob("*/lift.*")
    listed = subprocess.run(["nm", "-D", "--defined-only", str(library)], capture_output=True, text=True, check=True)
    exported = {line.split()[-1] for line in listed.stdout.splitlines()}
    assert exported == set(names)  # and nothing of the part, which another FMU might share


def test_units_are_products_of_base_units() -> None:
    assert base_exponents("N") == {"kg": 1, "m": 1, "s": -2}
    assert base_exponents("J/(kg*K)") == {"m": 2, "s": -2, "K": -1}
    assert base_exponents("1") == {}
    with pytest.raises(ValueError, match="bar"):
        base_exponents("bar")


def test_the_unit_of_every_parameter_of_every_shipped_muscle_can_be_stated() -> None:
    muscles = (s for s in map(specimen, specimen_ids()) if s.kind == "mckibben")
    units = {one.unit for s in muscles for one in declared(mk.muscle(s.id).law).values() if one.unit}
    whole = ElementTree.fromstring("".join(unit_definitions(units)))
    stated = {one.get("name"): one.find("BaseUnit") for one in whole}
    assert stated.keys() == units | {"s"} and stated["N/m"].attrib == {"kg": "1", "s": "-2"}
    assert stated["m/N^0.5"] is None  # FMI has no word for half a power


def test_a_file_of_another_kind_is_refused(part: Part, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"must end in .fmu"):
        export(part, "fmi3", tmp_path / "lift.zip", name="lift")


@pytest.mark.parametrize(
    ("muscles", "twice"),
    [(("command", "span"), "command.span"), (("rate", "command"), "command.rate"), (("a", "b"), None)],
)
def test_no_two_variables_have_one_name_whatever_muscles_are_called(
    muscles: tuple[str, ...], twice: str | None
) -> None:
    part = SimpleNamespace(muscles=muscles, command_limits=lambda command: (0.0, 1.0))
    paths = [f"{what}.{name}" for what in ("span", "rate", "command") for name in muscles]
    inputs = tuple(PartVariable("inputs", f"i{k}", path, "m", (0.0, 1.0), "", 0.0, ()) for k, path in enumerate(paths))
    if twice:
        with pytest.raises(InputError, match=f"muscles must have other names.*{twice}"):
            fmu_variables(PartSource("lift", part, {}, inputs), states=False)
    else:
        made = fmu_variables(PartSource("lift", part, {}, inputs), states=False)
        assert len({variable.name for variable in made}) == len(made) == len(inputs) + 1  # and `staggered`


@pytest.mark.slow
def test_dead_time_leaves_co_simulation_only(tmp_path: Path) -> None:
    usual = Orifice.from_flow(105e-3 / 60.0, pressure=6.9e5)
    late = SpoolValve(fill=usual, vent=usual, lag=3e-3, dead_time=12.5e-3)
    part = Part("nylon", Air(supply="6 bar", valve=late), span=START)
    assert b"<ModelExchange" not in fmu_files(part, "lift", 3)["modelDescription.xml"]
    assert "dead time" in fmu_cautions(part)[0]
    (path,) = export(part, "fmi3", tmp_path / "late", name="lift")
    described = fmpy.read_model_description(str(path))
    fmu = Fmu(path, Path(fmpy.extract(str(path), str(tmp_path / "unpacked"))), described)
    slave, state = Slave(fmu, span=START), part.rest(START)
    for k in range(40):
        command = 0.6 if k >= 10 else 0.0
        state, seen = part.step(state, period=1e-3, span=START, muscle=command)
        assert slave.step(1e-3, START, 0.0, command) == seen.tension
        if k < 22:  # the command of 10 ms arrives at 22.5 ms
            assert abs(slave.get(fmu.references("pressure"))[0]) < 1.0
    assert slave.get(fmu.references("pressure"))[0] > 1e4
    slave.close()


@pytest.mark.slow
@pytest.mark.parametrize("host", ["fmi3", "fmi2", "libcosim"])
def test_importers_meet_the_limits_of_conformance(host: str) -> None:
    if host == "libcosim":
        pytest.importorskip("libcosimpy", reason="libcosim is not installed")
    certificate = conform(host, scenarios=["hang"], steps=(1e-3, 2e-3), states=False)
    assert certificate.holds, certificate.verdicts
