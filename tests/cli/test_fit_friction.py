"""``mckibben fit --friction``: a loop of a file, its output, and one line for what is wrong."""

import json

import numpy as np
import pytest

from mckibben.cli import _values, main
from mckibben.cli._verb import show_tables
from mckibben.estimation import Estimate
from mckibben.identification.hysteresis_fit import MODELS
from mckibben.identification.shared_hysteresis import NOTHING, HysteresisModel, SharedHysteresis

WAY = np.concatenate([np.linspace(0.0, 4.0, 13), np.linspace(4.0, 0.0, 13)[1:]])
STROKE = 10.0 * WAY + np.where(np.arange(25) > 12, 3.0, 0.0) * np.sin(np.pi * WAY / 4.0)


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    rows = "\n".join(f"{p:.4f},{s:.4f}" for p, s in zip(WAY, STROKE, strict=True))
    (tmp_path / "loop.csv").write_text(f"pressure [bar],stroke [mm]\n{rows}\n")
    (tmp_path / "map.csv").write_text("length [mm],pressure [bar],force [N]\n" + "120,3,20\n130,3,35\n" * 8)

    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["fit", *words])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


@pytest.mark.slow
def test_a_loop_is_fitted_printed_and_drawn(run, tmp_path):
    code, out, err = run("loop.csv", "--friction", "dahl", "--set", "per_pressure=0", "--out", "loop.svg", "--json")
    found = json.loads(out)
    assert (code, err) == (0, "") and found["friction"] == "dahl" and found["n"] == 25
    assert set(found["parameters"]) == {"constant", "stiffness"} and found["posterior"] is None
    assert found["rmse"] < 1e-3  # [m]: the loop is 3 mm wide
    assert (tmp_path / "loop.svg").stat().st_size > 5000


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("loop.csv", "--friction", "coulomb"), "Known are maxwell_slip, dahl, bouc_wen"),
        (("loop.csv", "--friction", "dahl", "--law", "ideal"), "--law is allowed beside --friction only with --like"),
        (("loop.csv", "--friction", "dahl", "--set", "mass=1"), "--set mass"),
        (("loop.csv", "loop.csv", "--friction", "dahl"), "must be one loop, alone"),
        (("loop.csv", "--friction", "dahl", "--out", "fit.html"), "--out is allowed only without --friction"),
        # what a fit to a loop does not take is refused, not ignored
        (
            ("loop.csv", "--friction", "dahl", "--train-below", "3 bar"),
            "--train-below is allowed only without --friction",
        ),
        (("loop.csv", "--friction", "dahl", "--no-slack"), "--no-slack is allowed only without --friction"),
        (("some.toml", "--law", "ideal"), "--law is allowed only without a .toml file of constraints"),
        (("some.toml", "map.csv"), "must be one file, alone"),
        (("map.csv", "--friction", "dahl"), "has no turning point"),
        (("loop.csv", "--creep"), "--creep is allowed only with --friction"),
        (("none.csv", "--friction", "dahl"), "File not found: none.csv"),
        (
            ("loop.csv", "--friction", "dahl", "--hysteresis", "loop.csv"),
            "--hysteresis is allowed only without --friction",
        ),
        (("map.csv", "loop.csv", "--hysteresis", "loop.csv"), "--hysteresis is allowed only with one table"),
        (("map.csv", "--hysteresis", "none.csv"), "File not found: none.csv"),
        (("map.csv", "--hysteresis", "runs/*.csv"), "must hold at least one recording"),
    ],
)
def test_wrong_words_are_one_line(run, words, said):
    code, _, err = run(*words)
    assert code == 2 and err.count("\n") == 1 and said in err


def test_what_recordings_tell_is_printed_with_what_they_leave_out(capsys):
    models = [("constant friction", ("constant", "stiffness"), 0.5, 10.0), ("creep", ("creep",), 0.9, 14.0)]
    models += [("constant friction and creep", ("constant", "stiffness", "creep"), 0.5, 12.5), (NOTHING, (), 1.0, 40.0)]
    found = SharedHysteresis(
        title="constant friction",
        parameters={"constant": Estimate(3.0, 2.5, 3.6, "N"), "stiffness": Estimate(2e4, 1.0, 1e9, "N/m")},
        models=tuple(HysteresisModel(*m) for m in sorted(models, key=lambda m: m[3])),
        muscles=(0.083, 0.182), recordings=("a.csv", "b.csv"), samples=800, independent=200, rmse=0.5, law_rmse=1.0,
        uncorrected_rmse=1.5, held_back=(0.6, 1.0), warnings=("b.csv is short",),
    )  # fmt: skip
    show_tables(found.tables())
    said = capsys.readouterr().out
    assert "from 2 recordings of 2 muscles: 800 samples, 200 of them independent" in said
    rows = [" ".join(line.split()) for line in said.splitlines()]
    assert "friction without pressure (constant) 3 N 2.5 N 3.6 N" in rows
    assert "stiffness of the contact (stiffness)" in said and "its size is not in the data" in said
    assert "no creep: with it AICc is 2.5 higher" in said and "no friction" not in said
    assert "Recordings held back in turn: 0.6 N rms, 1 N by the law alone." in said and "note: b.csv is short" in said


def test_the_shell_completes_the_frictions_that_can_be_fitted():
    assert {name for name, _ in _values.frictions()} == {*MODELS, "all"}
