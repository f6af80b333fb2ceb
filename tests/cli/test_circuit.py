"""``circuit show`` and ``circuit run``: one JSON object or a table, files as asked, and the exit codes 0, 1 and 2."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

import mckibben
from mckibben.cli import main
from mckibben.recordings import read_recording

EXAMPLES = Path(__file__).parents[2] / "examples" / "circuits"
TANK = str(EXAMPLES / "filling-a-tank.toml")


@pytest.fixture
def run(capsys):
    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["circuit", *words])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def test_show_says_what_there_is_how_fast_it_is_and_which_method_begins(run):
    code, out, err = run("show", TANK, "--json")
    found = json.loads(out)
    assert code == 0
    assert err == ""
    assert set(found) >= {"title", "nodes", "elements", "signals", "sentence", "rates"}
    assert found["elements"]["tube"]["ports"] == {"a": "source", "b": "tank"}
    assert found["elements"]["tube"]["parameters"]["length"] == {"value": 0.6, "unit": "m"}
    assert found["nodes"]["source"]["pressure"] == pytest.approx(5e5)
    assert found["sentence"].startswith("source (5 bar) -> tube (lumped tube, length 0.6 m")
    assert found["rates"]["fastest"] > 0.0
    assert found["rates"]["method"] == "rk4"  # nothing here is faster than 2.78/50 us = 5.6e4 1/s


def stiff(folder: Path) -> str:
    path = folder / "stiff.toml"
    text = (
        'schema = 1\n[nodes.a]\nkind = "reservoir"\npressure = "5 bar"\n[nodes.b]\nkind = "volume"\nvolume = "0.1 ml"\n'
    )
    text += '[elements.hole]\nkind = "orifice"\nfrom = "a"\nto = "b"\nconductance = "1e-7 m^3/(s*Pa)"\n'
    path.write_text(text + '[run]\nduration = "10 ms"\n')
    return str(path)


def test_a_small_volume_behind_a_large_orifice_begins_with_the_stiff_method(run, tmp_path):
    found = json.loads(run("show", stiff(tmp_path), "--json")[1])
    assert found["rates"]["method"] == "ros2"
    assert found["rates"]["fastest"] > 5.6e4


def test_a_run_that_fails_says_so_with_exit_code_1(run, tmp_path):
    code, out, err = run("run", stiff(tmp_path), "--set", "run.method=rk4", "--json")
    assert code == 1
    assert out == ""
    assert err.count("\n") == 1
    assert "stiff.toml: between 0 s and 0.01 s" in err
    assert "ros2" in err


def test_show_draws_the_circuit(run, tmp_path):
    code, out, _ = run("show", TANK, "--out", str(tmp_path / "circuit.svg"))
    assert code == 0
    assert "Written" in out
    drawn = (tmp_path / "circuit.svg").read_text()
    assert "tank" in drawn
    assert "tube" in drawn


def test_run_prints_one_object_and_writes_what_is_asked(run, tmp_path):
    out_file, figure = tmp_path / "rec.csv", tmp_path / "run.svg"
    words = ["--set", "elements.tube.length=1.2 m", "--set", "run.duration=0.2 s", "--out", str(out_file)]
    code, out, err = run("run", TANK, *words, "--out", str(figure), "--json")
    found = json.loads(out)
    assert code == 0
    # as every command says them
    assert err.splitlines() == [f"mckibben: caution: {said}" for said in found["warnings"]]
    assert set(found) == {"result", "message", "file", "summary", "warnings", "balance", "stiff", "step"}
    # 0.2 s are too short for 120 cm^3 behind 1.2 m of tube
    assert [w.split(":")[0] for w in found["warnings"]] == ["tank.pressure has not settled at the end of the run"]
    assert found["result"] == "done"
    assert found["step"] == pytest.approx(50e-6)
    assert found["balance"]["mass"] < 1e-10  # rounding
    tank = found["summary"]["tank.pressure"]
    assert set(tank) == {"min", "max", "mean", "final", "unit"}
    rec = read_recording(found["file"])
    assert rec.meta["warnings"] == found["warnings"]
    assert rec["tank.pressure"][-1] == pytest.approx(tank["final"], rel=1e-9)
    assert rec.meta["description"]["elements"]["tube"]["length"] == "1.2 m"
    assert len(rec.time) == 201
    assert "Mass flow, g/s" in figure.read_text()
    assert "not settled: tank.pressure" in figure.read_text()


def test_run_shows_a_person_words_with_units(run):
    code, out, err = run("run", TANK, "--set", "run.duration=0.1 s")
    assert code == 0
    assert "tank.pressure" in out
    assert "bar" in out
    assert "Balance: mass" in out
    assert "caution: tank.pressure has not settled at the end of the run" in err
    assert "The run reached its end." in out


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("run", "no-such.toml"), "not found"),
        (("run", TANK, "--out", "rec.xls"), "--out"),
        (("run", TANK, "--out", "missing-folder/x.svg"), "older not found"),
        (("run", TANK, "--set", "elements.tube.length"), "NAME=VALUE"),
        (("run", TANK, "--set", "elements.tube.lenght=1 m"), "Did you mean 'length'"),
        (("run", TANK, "--set", "elements.tube.length=1 bar"), "must be a length"),
        (("show", TANK, "--out", "x.txt"), "--out"),
    ],
)
def test_bad_words_give_one_line_and_exit_code_2(run, words, says):
    code, out, err = run(*words)
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert says in err


def test_help_loads_nothing_heavy():
    code = (
        "import sys, mckibben.cli.app; print([m for m in ('jax', 'matplotlib', 'pint', 'numpy') if m in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def copied(folder: Path, specimen: str) -> Path:
    """The example with a muscle on a valve, and a specimen file beside it."""
    shipped = Path(mckibben.__file__).parent / "specimens" / "data" / "nylon.toml"
    folder.mkdir()
    own = shipped.read_text(encoding="utf-8").replace('id = "nylon"', 'id = "own"')
    (folder / "own.toml").write_text(own, encoding="utf-8")
    text = (EXAMPLES / "muscle-on-a-valve.toml").read_text(encoding="utf-8")
    (folder / "circuit.toml").write_text(
        text.replace('specimen = "nylon"', f'specimen = "{specimen}"'), encoding="utf-8"
    )
    return folder / "circuit.toml"


def test_a_specimen_is_looked_for_beside_the_file_that_names_it(run, tmp_path, monkeypatch):
    path = copied(tmp_path / "here", "own.toml")
    for folder, name in ((tmp_path, "here/circuit.toml"), (tmp_path / "here", "circuit.toml"), (Path("/"), str(path))):
        monkeypatch.chdir(folder)
        code, out, err = run("show", name)
        assert code == 0 and "own by linear_threshold" in out, err
    # what is typed is from where it is typed
    monkeypatch.chdir(tmp_path)
    assert run("show", "here/circuit.toml", "--set", "nodes.muscle.specimen=here/own.toml")[0] == 0
    code, _, err = run("show", "here/circuit.toml", "--set", "nodes.muscle.specimen=own.toml")
    assert code == 2 and "own.toml" in err


def test_parameters_that_a_law_lacks_are_named_with_the_way_to_give_them(run, tmp_path):
    path = copied(tmp_path / "here", "own.toml")
    words = ["show", str(path), "--set", "nodes.muscle.law=hyperelastic_braid"]
    needed = {
        "rest_length": "14 cm", "rest_diameter": "1 cm", "rest_angle": "28 deg", "shear_modulus": "1 MPa",
        "upper_length": "15.4 cm",
    }  # fmt: skip
    code, out, err = run(*words)
    assert code == 2 and out == "" and err.count("\n") == 1
    assert str(path) in err and "own states linear_threshold" in err and "missing'" not in err
    for name in needed:
        assert f"{name} (" in err and f"nodes.muscle.parameters.{name} = '.." in err
    # part of it in the specimen: only the rest is asked for
    partly = tmp_path / "here" / "own.toml"
    partly.write_text(partly.read_text() + "\n[laws.hyperelastic_braid.rest_length]\nvalue = 14\nunit = 'cm'\n")
    code, _, err = run(*words)
    assert code == 2 and "own does not state all of it" in err and "parameters.rest_length" not in err
    given = [word for name, value in needed.items() for word in ("--set", f"nodes.muscle.parameters.{name}={value}")]
    code, out, _ = run(*words, *given)
    assert code == 0 and "own numbers by hyperelastic_braid" in out  # none is left of the specimen
