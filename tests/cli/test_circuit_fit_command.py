"""``circuit fit``: what `circuit run` recorded fits the same circuit exactly; bad words give one line and exit code 2."""

import json

import numpy as np
import pytest

from mckibben.cli import main

CIRCUIT = """
schema = 1
title = "A tank that fills"
[nodes.supply]
kind = "reservoir"
signal = "wish"
[nodes.tank]
kind = "volume"
volume = "50 ml"
[elements.hole]
kind = "orifice"
from = "supply"
to = "tank"
conductance = "6e-9 m^3/(s*Pa)"
[signals.wish]
kind = "steps"
times = ["0 s", "10 ms"]
values = ["1 bar", "5 bar"]
[run]
duration = "60 ms"
step = "250 us"
[fit]
free = ["elements.hole.conductance"]
start = { "elements.hole.conductance" = "9e-9 m^3/(s*Pa)" }
"""
HOLE = "elements.hole.conductance"
GOOD = ["time [s],tank.pressure [bar]", *(f"{0.001 * i:.3f},{4.0 - 3.0 * 0.9**i:.4f}" for i in range(30))]


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "c.toml").write_text(CIRCUIT)
    (tmp_path / "good.csv").write_text("\n".join(GOOD))

    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["circuit", *words])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def test_what_was_run_fits_the_same_circuit_and_predicts_another_run(run, tmp_path):
    for name, more in (("a.nc", []), ("b.csv", ["--set", "signals.wish.values=['2 bar', '4 bar']"])):
        assert run("run", "c.toml", *more, "--out", name, "--json")[0] == 0
    code, out, err = run("fit", "c.toml", "a.nc", "--predict", "b.csv", "--json", "--out", "fit.svg")
    found = json.loads(out)
    assert (code, err) == (0, "")
    assert set(found) == {"parameters", "errors", "rms", "converged", "message", "evaluations", "warnings"}
    hole = found["parameters"][HOLE]
    # the search ends when a step is 1e-7 of a parameter, and near the end each step is far smaller than the last
    assert hole["value"] == pytest.approx(6e-9, rel=1e-7)
    assert hole["low"] <= hole["value"] <= hole["high"]
    assert hole["unit"] == "m^3/(s*Pa)"
    assert found["rms"]["fitted"] < 1.0  # [Pa], of a step of 4 bar
    assert found["rms"]["predicted"] < 1.0
    assert [(e["trial"], e["channel"], e["fitted"]) for e in found["errors"]] == [
        ("a.nc", "tank.pressure_abs", True),
        ("b.csv", "tank.pressure_abs", False),
    ]
    assert found["converged"] is True
    drawn = (tmp_path / "fit.svg").read_text()
    for words in ("A tank that fills", "a.nc", "b.csv", "fitted: rms", "predicted: rms", "Pressure, bar abs", "tank"):
        assert words in drawn
    code, out, err = run("fit", "c.toml", "a.nc", "--predict", "b.csv")
    assert (code, err) == (0, "")
    for words in (HOLE, "95 %", "a.nc", "fitted", "predicted", "model leads"):
        assert words in out


def test_a_table_without_a_header_is_read_by_column_and_unit(run, tmp_path):
    time = 1e-3 * np.arange(60)
    table = np.stack([1e3 * time, 100.0 + 380.0 * (1.0 - np.exp(-np.maximum(time - 0.01, 0.0) / 0.012))], axis=1)
    np.savetxt(tmp_path / "bare.txt", table)
    words = ["--column", "time=1", "--column", "tank.pressure=2", "--unit", "time=ms", "--unit", "tank.pressure=kPa"]
    code, out, err = run("fit", "c.toml", "bare.txt", "--free", HOLE, "--start", f"{HOLE}=2e-8", *words, "--json")
    assert code == 0 and "the model does not describe the record" in err  # no orifice fills a tank in that way
    found = json.loads(out)
    assert found["converged"]
    # an exponential is no orifice: a tenth of the step is left
    assert 1e3 < found["rms"]["fitted"] < 4e4
    assert 2e-9 < found["parameters"][HOLE]["value"] < 5e-8


def bad(row: int, line: str) -> str:
    return "\n".join(line if i == row else text for i, text in enumerate(GOOD))


@pytest.mark.parametrize(
    ("text", "says"),
    [
        (bad(5, "0.004,-1.02"), "below vacuum"),
        ("\n".join(GOOD[:8] + GOOD[15:]), "a gap"),
        (bad(5, "0.003,2.0"), "each once"),
        (bad(5, "0.004,x"), "row 6"),
        (bad(0, "time [s],tank.pressure"), "no unit"),
        (
            bad(0, "time [s],tnak.pressure [bar]"),
            "No channel of the record can be compared with tank.pressure; it has tnak.pressure",
        ),
        (bad(0, "time [s],tank.pressure [V]"), "must be values in Pa"),
        ("", "empty"),
    ],
)
def test_a_bad_record_gives_one_line_and_exit_code_2(run, tmp_path, text, says):
    (tmp_path / "bad.csv").write_text(text)
    for words in (["bad.csv"], ["good.csv", "--predict", "bad.csv"]):
        code, out, err = run("fit", "c.toml", *words, "--json")
        assert code == 2
        assert out == ""
        assert err.count("\n") == 1
        assert "bad.csv" in err
        assert says in err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("missing.csv",), "missing.csv"),
        (("missing.nc",), "missing.nc"),
        (("good.csv", "good.csv"), "twice"),
        (("good.csv", "--free", "elements.hole.conductanec"), "Known are elements.hole.conductance"),
        (("good.csv", "--free", "signals.wihs.delay"), "Known are signals.wish.delay"),
        (("good.csv", "--free", HOLE, "--start", "nodes.tank.volume=1 l"), "it is not free"),
        (("good.csv", "--free", HOLE, "--start", f"{HOLE}=1 bar"), "start of elements.hole.conductance"),
        (("good.csv", "--free", HOLE, "--start", f"{HOLE}=-1e-9"), "must be"),
        (("good.csv", "--column", "tank.pressure=7"), "must be between 1 and 2"),
        (("good.csv", "--unit", "tnak.pressure=kPa"), "tnak.pressure"),
        (("good.csv", "--out", "x.doc"), "--out"),
        (("good.csv", "--set", "elements.hole.lenght=1 m"), "elements.hole.lenght"),
    ],
)
def test_bad_words_give_one_line_and_exit_code_2(run, words, says):
    code, out, err = run("fit", "c.toml", *words, "--json")
    assert code == 2
    assert out == ""
    assert err.count("\n") == 1
    assert says in err


def test_nothing_free_is_said(run, tmp_path):
    (tmp_path / "c.toml").write_text(CIRCUIT[: CIRCUIT.index("[fit]")])
    code, out, err = run("fit", "c.toml", "good.csv")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "--free" in err
    (tmp_path / "c.toml").write_text(CIRCUIT.replace('["elements.hole.conductance"]', "1"))
    code, out, err = run("fit", "c.toml", "good.csv")
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert "fit.free" in err
