"""The machine-readable face: one JSON object on standard output, SI values, and the exit codes 0, 1 and 2."""

import json
from pathlib import Path

import pytest

from mckibben.cli import main


@pytest.fixture
def run(capsys):
    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(list(words))
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def table(path: Path, rows: list[str], header: str = "length_mm,pressure_bar,force_N") -> Path:
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


# A noise-free gas spring, Kg = 0.466 cm and Lmin = 9.91 cm.
SPRING = [
    f"{mm},{bar},{0.466e-2 * bar * 1e5 * (mm - 99.1) * 1e-3:.9f}"
    for mm in (110, 120, 130, 140)
    for bar in (1, 2, 3, 4, 5)
]


def test_muscles_lists_every_specimen_with_its_source(run):
    code, out, err = run("muscles", "--json")
    found = json.loads(out)["specimens"]
    assert code == 0 and err == ""
    assert {"nylon", "fiberglass", "bridgestone", "DMSP-10-250", "DMSP-20-300"} <= {s["id"] for s in found}
    assert all({"id", "source", "law", "inferred"} <= set(s) for s in found)
    bridgestone = next(s for s in found if s["id"] == "bridgestone")
    assert "laws.linear_threshold.shortest_length" in bridgestone["inferred"]


def test_tension_prints_the_printed_tension(run):
    code, out, _ = run("tension", "nylon", "--length", "15.4 cm", "--pressure", "5 bar", "--json")
    found = json.loads(out)
    assert code == 0
    assert set(found) >= {"tension", "passive", "active", "volume", "slack", "overstretched", "law"}
    assert round(found["tension"]) == 110  # printed: 110 N at 1.1 L0 and 5 bar
    assert not found["slack"] and not found["overstretched"]


def test_tension_takes_a_law_by_name_and_a_parameter_by_path(run):
    words = ["tension", "ideal", "--length", "120 mm", "--pressure", "500 kPa", "--json", "--set"]
    expected = 5e5 * (3 * 0.12**2 - 0.17**2) / (4 * 3.141592653589793 * 3.0**2)  # eq. 8 with cos theta = L/b
    for path in ("law.thread_length=17 cm", "muscle.law.thread_length=0.17", "thread_length=170mm"):
        code, out, _ = run(*words, path, "--set", "turns=3")
        assert code == 0
        assert json.loads(out)["tension"] == pytest.approx(expected, rel=1e-12)


def test_a_law_without_a_volume_says_so(run):
    _, out, _ = run("tension", "DMSP-10-250", "--law", "sarosi", "--length", "24 cm", "--pressure", "5 bar", "--json")
    assert json.loads(out)["volume"] is None


def test_a_law_by_name_takes_no_number_of_any_muscle(run):
    words = ["tension", "ideal", "--length", "27 cm", "--pressure", "5 bar"]
    for given, missing in (([], ("thread_length", "turns")), (["--set", "thread_length=30 cm"], ("turns",))):
        code, out, err = run(*words, *given)
        assert code == 2 and out == "" and err.count("\n") == 1
        # each with its meaning and unit, how to give it, and what would do instead
        assert all(f"{name} (" in err and f"--set {name}=" in err for name in missing)
        assert "nylon" in err and ("in cm" in err) == ("thread_length" in missing)
    code, out, _ = run(*words, "--set", "thread_length=30 cm", "--set", "turns=3", "--json")
    found = json.loads(out)
    assert code == 0 and found["specimen"] is None
    assert found["parameters"]["turns"] == 3.0
    # what was not given and has a value all the same is named
    assert found["defaults"] == ["thread_strain", "threshold_width"]


def test_a_pressure_that_no_muscle_takes_is_said(run):
    words = ["tension", "nylon", "--length", "12 cm", "--json", "--pressure"]
    for pressure, meant in (("500 bar", "500 kPa"), ("72 bar", "72 psi"), ("5e5 bar", None), ("12 bar", None)):
        code, out, err = run(*words, pressure)
        if pressure == "5e5 bar":  # beyond what is computed at all
            assert code == 2
            continue
        said, also = json.loads(out)["warnings"]  # nor was anything measured where the muscle would then hang free
        assert "a free length of" in also and also in err
        assert code == 0 and said in err and "10 bar" in said
        assert ("meant" in said) == (meant is not None) and (meant or "") in said
    _, out, err = run(*words, "5 bar")  # the highest that was measured
    assert json.loads(out)["warnings"] == [] and err == ""


def test_a_length_that_is_no_length_of_the_muscle_is_said(run):
    _, out, err = run("tension", "nylon", "--length", "12 mm", "--pressure", "5 bar", "--json")
    assert "was 12 cm meant?" in json.loads(out)["warnings"][0] and "12 cm" in err


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("energy", "nylon", "--pressure", "500 bar", "--cycle", "maximal", "--json"), "was 500 kPa meant?"),
        (("compare", "nylon", "--pressure", "500 bar", "--json"), "was 500 kPa meant?"),
    ],
)
def test_other_commands_say_it_too(run, words, says):
    code, out, err = run(*words)
    assert code == 0 and says in err and says in json.loads(out)["warnings"][0]


def test_sizing_names_the_unit_that_was_probably_meant(run):
    code, _, err = run("size", "--force", "50 N", "--stroke", "3 cm", "--pressure", "500 bar")
    assert code == 2 and "was 500 kPa meant?" in err


def test_pressure_for_a_tension_inverts_it(run):
    _, out, _ = run("tension", "nylon", "--length", "12 cm", "--for", "50 N", "--json")
    found = json.loads(out)
    assert found["tension"] == pytest.approx(50.0, abs=1e-6)  # the search stops at 1e-6 Pa, 4e-10 N
    code, _, err = run("tension", "nylon", "--length", "12 cm", "--for", "5000 N")
    assert code == 2 and "not reached" in err and err.count("\n") == 1


def test_fit_recovers_a_gas_spring_from_its_table(run, tmp_path):
    path = table(tmp_path / "spring.csv", SPRING)
    code, out, _ = run("fit", str(path), "--law", "gas_spring", "--law", "ideal", "--rest-length", "14 cm", "--json")
    found = json.loads(out)
    assert code == 0
    best = found["fits"][0]
    assert set(best) >= {"law", "parameters", "rmse", "max_error", "cv_rmse", "cv_max_error", "aicc", "n"}
    assert best["law"] == "gas_spring" and best["n"] == len(SPRING)
    # noise-free data, written with nine decimals
    assert best["parameters"]["stiffness_per_pressure"]["value"] == pytest.approx(0.466e-2, rel=1e-7)
    assert best["parameters"]["shortest_length"]["value"] == pytest.approx(9.91e-2, rel=1e-7)
    assert set(best["parameters"]["shortest_length"]) == {"value", "low", "high", "unit"}


def test_a_file_of_several_laws_is_said_to_take_the_first_whichever_was_named(run, tmp_path):
    path, saved = table(tmp_path / "spring.csv", SPRING), tmp_path / "mine.toml"
    words = ("fit", str(path), "--law", "ideal", "--law", "gas_spring", "--rest-length", "14 cm", "--out", str(saved))
    said = f"{saved}: its law is gas_spring, the first of the ranking; --law takes another: ideal"
    assert run(*words)[1].rstrip().endswith(said)
    assert json.loads(run(*words, "--json")[1])["about_files"] == [said]
    assert 'law = "gas_spring"' in saved.read_text()


def test_fit_saves_a_specimen_that_tension_takes(run, tmp_path):
    path, saved = table(tmp_path / "spring.csv", SPRING), tmp_path / "mine.toml"
    run("fit", str(path), "--law", "gas_spring", "--rest-length", "14 cm", "--out", str(saved))
    code, out, _ = run("tension", str(saved), "--length", "13 cm", "--pressure", "4 bar", "--json")
    assert code == 0
    assert json.loads(out)["tension"] == pytest.approx(0.466e-2 * 4e5 * 30.9e-3, rel=1e-6)


def test_fit_of_printed_constraints_says_what_they_leave_open(run, tmp_path):
    path = tmp_path / "bridgestone.toml"
    text = 'law = "linear_threshold"\n[known]\nrest_length = "14.7 cm"\nupper_length = "15 cm"\n'
    text += '[[constraint]]\nwhat = "stiffness"\nvalue = "74.15 N/cm"\npressure = "5 bar"\nlength = "13 cm"\n'
    text += '[[constraint]]\nwhat = "free_length"\nvalue = "11.466 cm"\npressure = "5 bar"\n'
    path.write_text(text)
    code, out, _ = run("fit", str(path), "--json")
    found = json.loads(out)["fits"][0]
    assert code == 0
    assert "cannot tell" in found["warnings"][0]
    assert all(e["low"] is None and e["high"] is None for e in found["parameters"].values())


@pytest.mark.parametrize(
    ("rows", "header", "says"),
    [
        (["250,1,10", "240,1,5"], "length_mm,pressure_bar,force_N", "points"),
        (["25,1,10"], "contraction,pressure_bar,force_N", "percent"),
        (["250,1"], "length_mm,pressure_bar", "tension"),
        (["250,1,x"], "length_mm,pressure_bar,force_N", "row 2"),
        (["250,1,nan"], "length_mm,pressure_bar,force_N", "blank in 1 of 1 rows"),
        (["250,1,10"], "length_mm,pressure,force_N", "unit"),
        (["250,6,10", "240,5,9"], "length_mm,pressure_Pa,force_N", "wrong unit"),
    ],
)
def test_bad_tables_give_one_line_and_write_nothing(run, tmp_path, rows, header, says):
    path, report = table(tmp_path / "bad.csv", rows, header), tmp_path / "report.html"
    code, out, err = run("fit", str(path), "--law", "sarosi", "--rest-length", "300 mm", "--out", str(report), "--json")
    assert code == 2 and out == ""
    assert err.count("\n") == 1 and "bad.csv" in err and says in err
    assert not report.exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("tension", "nylon", "--length", "12", "--pressure", "5 bar"), "unit is missing"),
        (("tension", "nylon", "--length", "0,12 m", "--pressure", "5 bar"), "write '0.12 m'"),
        (("tension", "nylon", "--length", "12 cm", "--pressure", "5 bAr"), "Did you mean 'bar'?"),
        (("protocols", "sinusoids", "--set", "amplitude=0,08 L0"), "write '0.08 L0' for one number or '0; 08 L0'"),
        (("tension", "nylon", "--length", "12 kg", "--pressure", "5 bar"), "must be a length"),
        (("tension", "nylon", "--length", "-12 cm", "--pressure", "5 bar"), "above 0"),
        (("tension", "nylon", "--length", "12 cm", "--pressure", "nan bar"), "finite"),
        (("tension", "nylom", "--length", "12 cm", "--pressure", "5 bar"), "Did you mean 'nylon'"),
        (
            ("tension", "nylon", "--length", "12 cm", "--pressure", "5 bar", "--set", "law.trns=3"),
            "linear_threshold has",
        ),
        (("tension", "nylon", "--length", "12 cm", "--pressure", "5 bar", "--set", "rest_length=-1 cm"), "must be"),
        (("tension", "slow-fibre", "--length", "12 cm", "--pressure", "5 bar"), "--activation"),
        (("fit", "no-such-file.csv"), "not found"),
        (("fit", "DMSP-10-250", "--law", "sarozi"), "Did you mean 'sarosi'"),
        (("reproduce", "--part", "V"), "Known are"),
        (("bogus",), "No such command"),
        (("run", "work-loop", "-o", "loop.nc"), "Did you mean --on or --out?"),
        (("characterise", "nylon"), "A muscle is given as --muscle"),
        (("fit", "DMSP-10-250", "--law", "my.py"), "as in my.py:Name"),
    ],
)
def test_wrong_words_give_one_line(run, words, says):
    code, out, err = run(*words)
    assert code == 2 and out == ""
    assert err.count("\n") == 1 and says in err


def test_reproduce_gives_every_row_and_counts_failures(run):
    code, out, _ = run("reproduce", "--part", "discussion", "--json")
    found = json.loads(out)
    assert code == 0 and found["failed"] == 0
    assert all({"id", "paper", "ours", "unit", "expect", "ok", "calibrated", "note"} <= set(r) for r in found["rows"])
