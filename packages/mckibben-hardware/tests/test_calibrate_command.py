"""``mckibben calibrate``: simulated sessions, files that grow, recordings recalibrated, and one line for what is wrong."""

import json
import re
import sys

import numpy as np
import pytest
import typer

from mckibben.cli import main
from mckibben.recordings import Channel, Recording, read_recording
from mckibben_hardware import calibrate_commands
from mckibben_hardware.calibrate.session import OperatorTask

COUNTS = np.array([100.0, 32768.0, 40000.0, 65535.0])
Q = 2200.0 / 65536.0
RECORD = Recording(
    1e-3 * np.arange(4),
    {"tension": Channel(-1100.0 + COUNTS * Q, "N", "measured"), "load.tension": Channel(np.ones(4), "N")},
    {"rig": "modern", "converters": {"tension": {"low": -1100.0, "high": 1100.0 - Q, "bits": 16}}},
)
WEIGHTS = ("weights", "--rig", "modern", "--simulate", "--samples", 100)
KNOWN = ("--gravity", "9.81 m/s^2", "--gravity-uncertainty", "0.0001 m/s^2", "--uncertainty", "1 g")


@pytest.fixture
def run(capsys):
    def call(*words: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["calibrate", *map(str, words)])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def test_known_faults_are_found_and_channel_after_channel_joins_the_file(run, tmp_path):
    path = tmp_path / "calibration.toml"
    code, out, err = run(
        *WEIGHTS, *KNOWN, "--masses", "0 kg,1 kg,2 kg,5 kg", "--set", "rig.sensors.tension.offset=3 N",
        "--set", "rig.sensors.tension.gain_error=0.02", "--sensor", "S/N 123", "--valid-for", "365 day",
        "--out", path, "--json",
    )  # fmt: skip
    found = json.loads(out)
    tension = found["channels"]["tension"]
    assert (code, err, found["file"]) == (0, "", str(path))
    # seed 0: one draw, so four standard uncertainties instead of two
    for term, true in (("gain", 1.0 / 1.02), ("zero", 3.0)):
        assert abs(tension[term]["value"] - true) < 4.0 * tension[term]["uncertainty"]
    assert len(found["points"]["tension"]) == 7 and tension["gain"]["valid_for"] == 365 * 86400.0
    simulate = ("--rig", "modern", "--simulate", "--samples", 100, "--out", path)
    for words in (
        ("pressure", "--pressures", "0 bar,3 bar", "--uncertainty", "2 mbar", "--scale-uncertainty", "0.02 %"),
        ("encoder", "--travels", "0 mm,50 mm", "--uncertainty", "1 um", "--set", "rig.motor.pulley_radius=2.01 cm"),
        ("zero", "--channels", "valve_pressure", "--uncertainty", "1 mbar"),
    ):
        assert run(*words, *simulate)[0] == 0, words
    assert run("skew", "--rig", "modern", "--simulate", "--samples", 1000, "--out", path)[0] == 0
    code, out, _ = run("show", path, "--json")
    channels = json.loads(out)["channels"]
    assert code == 0 and set(channels) == {"tension", "pressure", "span", "valve_pressure"}
    assert (
        channels["tension"]["sensor"] == "S/N 123" and "skew" in channels["tension"] and "zero" in channels["tension"]
    )
    assert channels["span"]["gain"]["low"] < 1.005 < channels["span"]["gain"]["high"]
    code, out, _ = run("show", path)
    assert code == 0 and "EXPIRED" not in out and "S/N 123" in out and "reference gauge" in out


def test_a_person_sees_the_points_and_what_they_tell(run):
    code, out, _ = run(*WEIGHTS, *KNOWN, "--masses", "0 kg,5 kg")
    assert code == 0 and "49.05 N" in out and "gain" in out and "between up and down" in out


def test_gravity_that_nobody_states_is_unsure_by_where_on_earth_one_is(run):
    gains = [json.loads(run(*WEIGHTS, "--masses", "0 kg,5 kg", *more, "--json")[1]) for more in ((), KNOWN)]
    unknown, known = (g["channels"]["tension"]["gain"]["uncertainty"] for g in gains)
    assert unknown == pytest.approx(0.015 / 9.80665, rel=0.1) and known < 0.3 * unknown


def test_another_sensor_drops_what_was_known_of_the_one_before_and_says_so(run, tmp_path):
    path = tmp_path / "a.toml"
    run(*WEIGHTS, "--masses", "0 kg,5 kg", "--sensor", "A", "--out", path)
    code, out, _ = run("zero", "--rig", "modern", "--simulate", "--channels", "tension", "--sensor", "B", "--out", path)
    assert code == 0 and "Note: tension was of the sensor A" in out
    assert "gain" not in json.loads(run("show", path, "--json")[1])["channels"]["tension"]


def test_a_recording_is_recalibrated_and_taken_back_to_its_bits(run, tmp_path):
    raw, path = RECORD.save(tmp_path / "raw.nc"), tmp_path / "a.toml"
    run(*WEIGHTS, *KNOWN, "--masses", "0 kg,5 kg", "--set", "rig.sensors.tension.offset=3 N", "--out", path)
    code, out, err = run("apply", raw, "--calibration", path, "--out", tmp_path / "new.nc", "--json")
    found = json.loads(out)
    assert (code, err, found["changed"], found["warnings"]) == (0, "", ["tension"], [])
    done = read_recording(tmp_path / "new.nc")
    assert done["tension"] == pytest.approx(RECORD["tension"] - 3.0, abs=5.0)  # a gain within some permille of 1 kN
    assert json.loads(run("show", tmp_path / "new.nc", "--json")[1])["rig"] == "modern"
    code, out, _ = run("apply", tmp_path / "new.nc", "--off", "--out", tmp_path / "back.nc")
    assert code == 0 and "changed are tension" in out
    assert read_recording(tmp_path / "back.nc")["tension"].tobytes() == RECORD["tension"].tobytes()


def test_an_expired_calibration_is_marked_and_said(run, tmp_path):
    raw, path = RECORD.save(tmp_path / "raw.nc"), tmp_path / "a.toml"
    run(*WEIGHTS, "--masses", "0 kg,5 kg", "--valid-for", "30 day", "--out", path)
    path.write_text(re.sub(r'date = "\d{4}', 'date = "2020', path.read_text()))
    code, out, _ = run("show", path)
    assert (
        code == 0 and out.count("EXPIRED") == 2 and "Note: the calibration of tension (gain and zero by weights" in out
    )
    assert json.loads(run("show", path, "--json")[1])["channels"]["tension"]["gain"]["expired"] is True
    code, out, _ = run("apply", raw, "--calibration", path, "--out", tmp_path / "b.nc")
    assert code == 0 and "expired on 2020" in out


MASSES = ("--masses", "0 kg,5 kg")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ((*WEIGHTS, "--masses", "1 kg"), "masses must be two different ones or more"),
        ((*WEIGHTS, "--masses", "1 kg,1 kg"), "masses must be different ones"),
        ((*WEIGHTS, "--masses", "0 kg,-1 kg"), "masses must be 0 kg or more, got -1 kg"),
        ((*WEIGHTS, "--masses", "0 kg,1 m"), "--masses must be a value in kg"),
        ((*WEIGHTS, "--masses", "0; 1"), "got 0; the unit is missing"),
        ((*WEIGHTS, "--masses", "0,1 kg"), "write '0.1 kg' for one number or '0; 1 kg' for a list"),
        ((*WEIGHTS, "--masses", ","), "--masses must be two different ones"),
        ((*WEIGHTS, "--masses", "0 kg,nan kg"), "must be a finite number"),
        ((*WEIGHTS, "--masses", "0 kg,150 kg"), "reference for tension must be between -1000 N and 1000 N"),
        ((*WEIGHTS, *MASSES, "--channel", "tensio"), "Unknown --channel 'tensio'. Did you mean 'tension'? The rig has"),
        ((*WEIGHTS, *MASSES, "--set", "rig.sensors.tension.ofset=3 N"), "Did you mean 'offset'?"),
        ((*WEIGHTS, *MASSES, "--set", "law.turns=3"), "--set law.turns must be a value of the rig"),
        ((*WEIGHTS, *MASSES, "--valid-for", "0 s"), "--valid-for must be between 1 s"),
        ((*WEIGHTS, *MASSES, "--uncertainty", "-1 g"), "--uncertainty must be 0 kg or more, got -1 g"),
        ((*WEIGHTS, *MASSES, "--gravity", "1.6 m/s^2"), "--gravity must be between 9.7 m/s^2"),
        ((*WEIGHTS, *MASSES, "--gravity-uncertainty", "1 m/s^2"), "allowed only beside --gravity"),
        ((*WEIGHTS, *MASSES, "--samples", 3), "samples must be a whole number from 16"),
        ((*WEIGHTS, *MASSES, "--out", "a.txt"), "must be a name that ends in .toml"),
        (("weights", "--rig", "moden", "--simulate", *MASSES), "Unknown --rig 'moden'. Did you mean 'modern'?"),
        (("weights", "--rig", "modern", *MASSES), "--on is missing"),
        (("zero", "--rig", "paper", "--simulate"), "reading of pressure must lie between"),
        (("zero", "--rig", "modern", "--simulate", "--uncertainty", "1 N"), "for channels of one unit at a time"),
        (("skew", "--rig", "modern", "--simulate", "--frequency", "600 Hz"), "frequency must be between"),
        (("skew", "--rig", "modern", "--simulate", "--channels", "tension"), "two or more"),
        (("show", "none.toml"), "Calibration file not found: none.toml"),
        (("show", "none.nc"), "File not found"),
        (("apply", "none.nc", "--out", "a.nc"), "--calibration is missing: give a file, or --off"),
        (("apply", "none.nc", "--off", "--skew", "--out", "a.nc"), "--skew is allowed only"),
    ],
)  # fmt: skip
def test_what_is_wrong_ends_with_one_line_and_2(run, monkeypatch, tmp_path, words, said):
    monkeypatch.chdir(tmp_path)
    code, out, err = run(*words)
    assert (code, out) == (2, "") and said in err and err.count("\n") == 1, err
    assert not list(tmp_path.iterdir())


def test_files_that_do_not_fit_are_refused_before_anybody_is_asked(run, tmp_path):
    path, raw = tmp_path / "a.toml", RECORD.save(tmp_path / "raw.nc")
    path.write_text("schema = 2\n")
    for words in (
        (*WEIGHTS, *MASSES, "--out", path),
        ("show", path),
        ("apply", raw, "--calibration", path, "--out", raw),
    ):
        code, _, err = run(*words)
        assert (
            code == 2
            and f"{path}: schema must be 1 for this version of mckibben, got 2; a newer one wrote it" in err
            and err.count("\n") == 1
        )
    other = tmp_path / "b.toml"
    other.write_text('schema = 1\nrig = "paper"\ncreated = "2026-01-01"\n')
    assert "rig is 'modern': the calibration is of paper" in run(*WEIGHTS, *MASSES, "--out", other)[2]
    assert "rig is 'paper': the recording is of modern" in run("apply", raw, "--calibration", other, "--out", raw)[2]
    assert "is not in the recording" in run("show", raw)[2]


def test_a_person_at_a_terminal_is_asked_and_types_what_the_reference_shows(monkeypatch, capsys):
    answers = iter(["", "3 kg", "3.02 bar"])
    monkeypatch.setattr(typer, "prompt", lambda text, *_, **__: (print(text, file=sys.stderr), next(answers))[1])
    assert calibrate_commands.ask_person(OperatorTask("hang 2 kg on the cell", {"tension": 19.6})) is None
    assert calibrate_commands.ask_person(
        OperatorTask("set the pressure to 3 bar", {"pressure": 3e5}, True)
    ) == pytest.approx(3.02e5)
    out, err = capsys.readouterr()
    assert out == "" and "Hang 2 kg on the cell, then press Enter" in err
    assert "reference must be a pressure such as '5 bar', got 3 kg" in err
