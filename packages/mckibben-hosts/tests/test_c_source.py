"""A part in C: the same bits as from Python, no allocation, units of all that is read, and what the command writes."""

import ctypes
import json
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from learned_muscle import learned_muscle
from mckibben.cli import main
from mckibben.simulation.air import Air
from mckibben_hosts import Part
from mckibben_hosts.c_source import PartSource, c_source

COMPILER = shutil.which("gcc") or shutil.which("cc")
FLAGS = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O0", "-ffp-contract=off", "-fPIC", "-shared"]
pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler here")


@pytest.fixture(scope="module")
def part(tmp_path_factory: pytest.TempPathFactory) -> Part:
    learned = learned_muscle(tmp_path_factory.mktemp("learned"))
    return Part({"flexor": "nylon", "extensor": learned}, Air(supply="6 bar"), span=0.14)


@pytest.fixture(scope="module")
def source(part: Part) -> PartSource:
    return c_source(part, "pair")


def test_c_has_the_same_bits_as_python(part: Part, source: PartSource, tmp_path: Path) -> None:
    source.write(tmp_path)
    command = [COMPILER, *FLAGS, str(tmp_path / "pair.c"), "-o", str(tmp_path / "pair.so"), "-lm"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    library = ctypes.CDLL(str(tmp_path / "pair.so"))
    numbers = {group: int(sum(np.prod(v.shape) for v in source.of(group))) for group in ("state", "inputs", "outputs")}
    state, inputs, outputs = (np.zeros(numbers[group]) for group in ("state", "inputs", "outputs"))
    defaults = (ctypes.c_double * 1).in_dll(library, "pair_default_parameters")
    places = {v.path: k for k, v in enumerate(source.of("inputs"))}
    library.pair_step.argtypes = [ctypes.c_void_p] * 3 + [ctypes.c_double, ctypes.c_int, ctypes.c_void_p]
    mine = part.rest(0.139)
    for k in range(20):
        span, rate = 0.139 - 1e-4 * k, -0.1
        command = {"flexor": 0.5, "extensor": -0.2} if k else {"flexor": 0.0, "extensor": 0.0}
        for name in part.muscles:
            inputs[places[f"span.{name}"]], inputs[places[f"rate.{name}"]] = span, rate
            inputs[places[f"command.{name}"]] = command[name]
        pointers = (ctypes.byref(defaults), state.ctypes.data, inputs.ctypes.data)
        library.pair_step(*pointers, 1e-3, k % 2, outputs.ctypes.data)
        mine, seen = part.step(mine, period=1e-3, span=span, rate=rate, staggered=bool(k % 2), **command)
    assert np.array_equal(state, mine)  # the state of zeros that it began with means rest
    assert np.array_equal(outputs, np.array(seen))
    assert numbers["state"] == mine.size


def test_every_parameter_is_read_and_has_a_unit(source: PartSource) -> None:
    for variable in source.of("parameters"):
        assert variable.unit, variable.path
        assert variable.default is not None
        if not variable.shape:
            low, high = variable.bounds
            assert low <= variable.default <= high, variable
        # more often than in its struct: the default, and where it is read
        assert len(re.findall(rf"parameters->{variable.member}\b", source.files["pair.c"])) > 0, variable.path


def test_nothing_is_allocated_and_no_state_is_hidden(source: PartSource) -> None:
    text = source.files["pair.c"]
    assert not re.search(r"\b(malloc|calloc|realloc|free|alloca)\b", text)
    assert not re.search(r"^static (?!const|inline|void|PAIR_CLONES)\w", text, re.MULTILINE)


def test_the_command_writes_a_part_that_builds_and_says_what_it_is(tmp_path: Path, capsys) -> None:
    circuit = Path(__file__).parents[3] / "examples" / "circuits" / "muscle-on-a-valve.toml"
    with pytest.raises(SystemExit) as ended:
        main(["export", str(circuit), "--for", "c", "--out", str(tmp_path / "part"), "--name", "lift"])
    assert ended.value.code == 0
    printed = capsys.readouterr().out
    assert "commands opening" in printed and " g at 1 ms" in printed
    about = json.loads((tmp_path / "part" / "lift.json").read_text())
    assert about["commands"] == ["opening"]
    assert {"path", "member", "unit", "meaning", "least", "most", "default"} <= about["parameters"][0].keys()
    schema = json.loads((tmp_path / "part" / "lift.schema.json").read_text())["properties"]
    assert list(schema) == [stated["path"] for stated in about["parameters"]]
    for name, one in schema.items():
        ends = one.get("items", one)
        low, high = ends.get("minimum", -np.inf), ends.get("maximum", np.inf)
        assert one["unit"] and one["description"], name
        assert np.all((low <= np.asarray(one["default"])) & (np.asarray(one["default"]) <= high)), name
    out = str(tmp_path / "lift")
    sources = [str(tmp_path / "part" / f) for f in ("lift.c", "lift_example.c")]
    subprocess.run([COMPILER, "-O0", "-ffp-contract=off", *sources, "-o", out, "-lm"], check=True)
    lines = subprocess.run([out], capture_output=True, text=True, check=True).stdout.splitlines()
    tensions = [float(line.split()[2]) for line in lines]
    assert len(lines) == 5 and 0.0 < tensions[0] < tensions[1] and tensions[-1] > 50.0  # it fills
