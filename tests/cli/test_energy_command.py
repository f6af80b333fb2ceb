"""``energy``: the contract's numbers in SI, curves and figures, and one line with exit code 2 for what makes no cycle."""

import json

import pytest

import mckibben as mk
from mckibben.analysis.energy import CYCLES, EnergyCycle
from mckibben.cli import main
from mckibben.errors import InputError

NYLON = ("energy", "nylon", "--pressure", "5 bar")


@pytest.fixture
def run(capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)

    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(list(words))
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def asked(run, *words):
    code, out, err = run(*NYLON, *words, "--json")
    assert (code, err) == (0, "")
    return json.loads(out)


def test_the_nylon_muscle_gives_the_papers_joules(run):
    found = asked(run)
    by = {c["name"]: c for c in found["cycles"]}
    assert list(by) == list(CYCLES)
    for cycle in by.values():
        assert {"title", "volume", "beside"} | set(EnergyCycle._fields) <= set(cycle)
    # the tolerances of the rows, for the law as the specimen states it
    assert by["maximal"]["input"] == pytest.approx(8.86, rel=3e-3)
    assert by["maximal"]["output"] == pytest.approx(2.59, rel=3e-3)
    assert by["maximal"]["efficiency"] == pytest.approx(0.2925, rel=3e-3)
    assert by["isotonic"]["input"] == pytest.approx(5.79, rel=5e-3)
    assert by["valve"]["input"] == pytest.approx(6.46, rel=5e-3)
    assert by["maximal"]["beside"]["potential"]["input"] == pytest.approx(8.93, rel=1e-3)
    assert found["stretched_length"] == pytest.approx(0.155) and found["overstretched"]
    assert found["ambient_pressure"] == 103360.0 and found["volume"] == "paper"


def test_a_muscle_is_computed_at_5_bar_or_at_its_lower_rated_pressure_where_none_is_stated(run, tmp_path):
    from mckibben.specimens import specimen, specimen_toml

    (tmp_path / "weak.toml").write_text(
        specimen_toml(specimen("nylon"))
        + '\n[properties.rated_pressure]\nvalue = 3\nunit = "bar"\nsource = "chou1996"\n'
    )
    assert json.loads(run("energy", "nylon", "--cycle", "maximal", "--json")[1])["pressure"] == 5e5
    assert json.loads(run("energy", "weak.toml", "--cycle", "maximal", "--json")[1])["pressure"] == 3e5


def test_accumulator_friction_reading_and_volume_are_taken(run):
    plain, full = (asked(run, "--cycle", "maximal", *more)["cycles"] for more in ((), ("--accumulator",)))
    assert len(plain) == 1
    assert full[0]["input"] == pytest.approx(5.51, rel=1e-3) and full[0]["output"] == pytest.approx(plain[0]["output"])
    smooth = asked(run, "--cycle", "maximal", "--accumulator", "--no-friction")["cycles"][0]
    assert smooth["efficiency"] == pytest.approx(0.490, abs=5e-4) and smooth["friction"] == 0.0
    other = asked(run, "--cycle", "isotonic", "--reading", "throughout", "--volume", "potential")
    assert other["reading"] == "throughout" and other["cycles"][0]["volume"] == "potential"
    assert "paper" in other["cycles"][0]["beside"]
    shorter = asked(run, "--stretched", "15 cm", "--ambient", "1.01325 bar", "--friction", "1 N", "--cycle", "maximal")
    assert (shorter["stretched_length"], shorter["friction"], shorter["overstretched"]) == (0.15, 1.0, False)
    assert asked(run, "--accumulator-pressure", "1.5 bar")["exchange_pressure"] == pytest.approx(1.5e5)


def test_a_changed_parameter_moves_the_input(run):
    more = asked(run, "--cycle", "maximal", "--set", "rest_volume=6 cm^3")["cycles"][0]["input"]
    # the volume enters eq. 34 only: dW01 = Ph (ln(Ph/P0) - 1 + P0/Ph) dV = 0.5645 J per cm3
    assert more - asked(run, "--cycle", "maximal")["cycles"][0]["input"] == pytest.approx(0.37 * 0.56453, rel=1e-3)


def test_a_person_reads_both_volumes_and_where_the_input_goes(run):
    code, out, _ = run(*NYLON)
    assert code == 0
    assert "paper" in out and "potential" in out and "29.24" in out and "29.02" in out
    assert "Where the input goes" in out and "Overstretched" in out and "Unaccounted" in out
    assert "-0.000" not in out


def test_curves_and_figures_come_on_request(run, tmp_path):
    found = asked(run, "--cycle", "maximal", "--curve", "--out", "curve.svg")
    (curve,) = found["curves"]
    assert curve["name"] == "maximal"
    assert len(curve["pressure"]) == len(curve["efficiency"]) > 20
    assert 0.903e5 < curve["pressure"][0] < curve["pressure"][-1] == pytest.approx(10e5)
    code, out, _ = run(*NYLON, "--cycle", "valve", "--cycle", "isotonic", "--curve", "--out", "loops.png")
    assert code == 0 and "Efficiency over pressure" in out
    assert run(*NYLON, "--accumulator", "--out", "all.svg")[0] == 0
    assert "Efficiency, %" in (tmp_path / "curve.svg").read_text()
    text = (tmp_path / "all.svg").read_text()
    assert "A′BCD′" in text and "E′F′GH′" in text and "Absolute pressure, bar" in text
    assert (tmp_path / "loops.png").stat().st_size > 10_000


def test_any_law_with_a_volume_works(run):
    found = json.loads(
        run("energy", "nylon", "--law", "ideal", "--pressure", "3 bar", "--stretched", "15 cm", "--json")[1]
    )
    assert found["law"] == "ideal" and found["volume"] == "potential"
    assert all(0.0 < c["efficiency"] < 1.0 and c["beside"] == {} for c in found["cycles"])


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--pressure", "0.8 bar"), "above the threshold of 0.903 bar"),
        (("--pressure", "5"), "unit is missing"),
        (("--stretched", "17 cm"), "below 16.42 cm, the length of its threads"),
        (("--stretched", "10 cm"), "must be longer"),
        (("--cycle", "otto"), "Known are maximal, isotonic, valve"),
        (("--reading", "third"), "Known are printed, throughout"),
        (("--volume", "mine"), "Known are paper, potential"),
        (("--law", "ideal", "--volume", "paper"), "eq. 38b"),
        (("--law", "ideal", "--accumulator"), "no threshold pressure"),
        (("--law", "sarosi"), "nylon states"),
        (("--law", " "), "Nylon states"),
        (("--stretched", "15 cm", "--contraction", "2 %"), "only without a stretched length"),
        (("--friction", "-1 N"), "not negative"),
        (("--friction", "1 N", "--no-friction"), "--no-friction"),
        (("--accumulator-pressure", "6 bar"), "exchange_pressure"),
        (("--accumulator", "--accumulator-pressure", "1 bar"), "--accumulator-pressure"),
        (("--ambient", "0 bar"), "pressure_abs"),
        (("--out", "a.gif"), "--out"),
        (("--set", "colour=3"), "linear_threshold has"),
    ],
)
def test_what_makes_no_cycle_gives_one_line(run, words, says):
    code, out, err = run(*NYLON, *words)
    assert (code, out) == (2, "")
    assert err.count("\n") == 1 and says in err


@pytest.mark.parametrize(("name", "says"), [("slow-fibre", "kind is biological"), ("unobtainium", "unobtainium")])
def test_what_is_no_muscle_gives_one_line(run, name, says):
    code, out, err = run("energy", name, "--pressure", "5 bar")
    assert (code, out) == (2, "")
    assert err.count("\n") == 1 and says in err


def test_a_muscle_whose_volume_is_unknown_says_so(run, tmp_path):
    text = 'schema = 1\nid = "mine"\nkind = "mckibben"\ntitle = "Mine"\nsources = ["chou1996"]\nlaw = "gas_spring"\n'
    for name, value, unit in (
        ("stiffness_per_pressure", 0.5, "cm"),
        ("shortest_length", 10, "cm"),
        ("rest_length", 14, "cm"),
        ("upper_length", 15, "cm"),
    ):
        text += f'[laws.gas_spring.{name}]\nvalue = {value}\nunit = "{unit}"\nsource = "chou1996"\n'
    (tmp_path / "mine.toml").write_text(text)
    code, out, err = run("energy", "mine.toml", "--pressure", "5 bar")
    assert (code, out) == (2, "")
    assert err.count("\n") == 1 and "rest_volume" in err


def test_a_cycle_is_asked_for_by_its_name_and_another_is_refused_with_those_there_are():
    found = mk.energy("nylon", pressure="5 bar", cycles=["maximal"])
    assert found["maximal"] is found.cycles["maximal"][found.volume]
    with pytest.raises(InputError, match="maximal"):
        found["maximum"]
