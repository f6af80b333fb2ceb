"""``run``: the contract's JSON, files as asked, and bad input named step by step before anything moves."""

import json

import numpy as np
import pytest

import mckibben as mk
from mckibben.cli import main
from mckibben.quantities import declared
from mckibben.recordings import read_recording
from mckibben.studies.rig_run import record_run


@pytest.fixture
def run(capsys):
    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["run", *words])
        out, err = capsys.readouterr()
        return stop.value.code or 0, out, err

    return call


def test_a_run_prints_one_json_object_and_saves_a_recording_that_opens(run, tmp_path):
    out, figure = tmp_path / "step.nc", tmp_path / "step.png"
    code, text, err = run(
        "isometric-step", "--muscle", "nylon", "--set", "cycles=1", "--set", "range=half", "--set", "frequency=5 Hz",
        "--out", str(out), "--out", str(figure), "--json",
    )  # fmt: skip
    found = json.loads(text)
    assert (code, err) == (0, "")
    assert found["result"] == "done" and found["file"] == str(out)
    assert set(found["balance"]) == {"mass", "energy"}
    assert found["summary"]["tension"]["unit"] == "N" and found["summary"]["tension"]["max"] > 20.0
    recording = read_recording(out)
    assert recording.meta["specimen"] == "nylon" and recording.meta["rig"] == "paper"
    assert recording.meta["protocol"]["name"] == "isometric-step"
    assert figure.stat().st_size > 10_000


REFUSED = {
    "pressure above the regulator": (["quasi-static", "--set", "pressure=9.99 bar"], "the regulator allows up to"),
    "force above the cell": (["isotonic-triangle", "--set", "load=150 N"], "the load cell reads up to 100 N"),
    "speed above the motor": (["isokinetic", "--set", "speed=90 L0/s"], "motor"),
    "a rig without the part": (["leak-down"], "needs shut-off"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_exceeds_the_rig_is_named_step_by_step_and_nothing_moves(run, case, tmp_path):
    words, said = REFUSED[case]
    out = tmp_path / "never.nc"
    code, text, err = run(*words, "--muscle", "nylon", "--out", str(out))
    assert (code, text) == (2, "")
    lines = err.strip().splitlines()
    assert all(line.startswith("mckibben: ") for line in lines)
    assert any(said in line and "step" in line for line in lines), err
    assert not out.exists()


FILES = {
    "an until that cannot happen": (
        'pressure = "2 bar"\nspan = "1 L0"\nuntil = "tension >= 90 N"\nfor = "1 s"', "cannot happen",
    ),
    "a test finer than the sensor": (
        'pressure = "2 bar"\nspan = "1 L0"\nuntil = "pressure settled within 1 mbar for 0.2 s"\nfor = "1 s"',
        "the pressure sensor counts in steps of 0.0265",
    ),
    "a jump that the valve cannot follow": (
        'pressure = { kind = "triangle", low = "0 bar", high = "5 bar", frequency = "50 Hz" }\ncycles = 3',
        "the valve follows",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", FILES)
def test_a_protocol_file_is_checked_against_the_rig(run, case, tmp_path):
    text, said = FILES[case]
    file = tmp_path / "mine.toml"
    file.write_text(f'schema = 1\nname = "mine"\ntitle = "Mine"\n[[steps]]\n{text}\n')
    code, out, err = run(str(file), "--muscle", "nylon")
    assert (code, out) == (2, "")
    assert said in err, err
    code, out, err = run(str(file), "--muscle", "nylon", "--dry-run", "--json")
    found = json.loads(out)
    assert code == 2 and found["result"] == "refused" and found["findings"][0]["step"] == 1


def test_a_dry_run_of_what_fits_says_the_protocol_and_ends_well(run):
    code, out, err = run("sinusoids", "--muscle", "nylon", "--dry-run")
    assert (code, err) == (0, "")
    assert out.startswith("Sinusoids at constant pressure.") and "plumbing accumulators" in out


WRONG = {
    "muscle": (["quasi-static", "--muscle", "nylom"], "nylom"),
    "protocol": (["quasi", "--muscle", "nylon"], "quasi-static"),
    "rig": (["quasi-static", "--muscle", "nylon", "--rig", "papr"], "Did you mean"),
    "rig path": (["quasi-static", "--muscle", "nylon", "--set", "rig.sensors.pressure.cutof=1 1/s"], "cutoff"),
    "muscle path": (["quasi-static", "--muscle", "nylon", "--set", "muscle.law.stiffnes=1 m"], "stiffness"),
    "plumbing": (["quasi-static", "--muscle", "nylon", "--plumbing", "x"], "Known are direct, accumulators"),
    "step": (["quasi-static", "--muscle", "nylon", "--step", "1 s"], "must be between 0.1 us and 1 ms"),
    "a valve": (["quasi-static", "--muscle", "MPP-3-1-8"], "McKibben"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_words_get_one_line_that_says_what_is_allowed(run, case):
    words, said = WRONG[case]
    code, out, err = run(*words)
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1 and said in err, err


def test_a_waveform_of_another_file_becomes_part_of_the_protocol(run, tmp_path):
    (tmp_path / "walk.csv").write_text("t [ms],p [bar]\n0,0\n500,3\n1000,1\n")
    file = tmp_path / "mine.toml"
    wave = '{ kind = "table", file = "walk.csv", time = "t [ms]", column = "p [bar]" }'
    file.write_text(f'schema = 1\nname = "mine"\ntitle = "Mine"\n[[steps]]\npressure = {wave}\nfor = "1 s"\n')
    code, out, err = run(str(file), "--muscle", "nylon", "--dry-run")
    assert (code, err) == (0, "")
    assert "table of 3 points in 1 s, 0 bar to 3 bar" in out
    file.write_text(file.read_text().replace("walk.csv", "gone.csv"))
    code, out, err = run(str(file), "--muscle", "nylon", "--dry-run")
    assert (code, out) == (2, "") and "gone.csv" in err and len(err.splitlines()) == 1


def test_a_muscle_on_a_plate_is_mounted_where_the_protocol_says(run):
    code, out, err = run("isometric-step", "--muscle", "nylon", "--set", "span=0.9 L0", "--dry-run")
    assert (code, err) == (0, "")


NO_VOLUME = """
schema = 1
id = "no-volume"
kind = "mckibben"
title = "A muscle whose volume nobody knows"
sources = ["chou1996"]
law = "gas_spring"
[properties]
rest_length = { value = 14, unit = "cm" }
[laws.gas_spring]
stiffness_per_pressure = { value = 0.2, unit = "cm" }
shortest_length = { value = 9.9, unit = "cm" }
rest_length = { value = 14, unit = "cm" }
upper_length = { value = 15, unit = "cm" }
"""


def test_what_passes_the_dry_run_can_be_run(run, tmp_path):
    path = tmp_path / "no-volume.toml"
    path.write_text(NO_VOLUME)
    words = ["isometric-step", "--muscle", str(path), "--set", "range=half", "--set", "cycles=1"]
    code, out, err = run(*words, "--dry-run", "--json")
    found = json.loads(out)
    assert code == 2 and found["result"] == "refused"
    assert "does not know the volume" in found["findings"][0]["sentence"] and "rest_volume" in err
    path.write_text(NO_VOLUME + 'rest_volume = { value = 6, unit = "cm^3" }\n')
    assert run(*words, "--dry-run")[0] == 0


def test_a_figure_that_cannot_be_drawn_hides_nothing(run, tmp_path, monkeypatch):
    from mckibben.bench import run as protocol_run
    from mckibben.errors import InputError
    from mckibben.recordings import Channel, Recording
    from mckibben.report.figures import recording_figures

    meta = {
        "title": "Steps", "result": "stopped", "message": "The line was lost.", "specimen": "nylon", "rig": "paper",
        "balance": {}, "saturation": {}, "events": [], "steps": [],
    }  # fmt: skip
    one = Recording(np.zeros(1), {"pressure": Channel(np.ones(1), "Pa", "measured")}, meta)

    def refuse(*_, **__):
        raise InputError("figure", "one", "it cannot be drawn")

    monkeypatch.setattr(protocol_run, "run", lambda *_, **__: one)
    monkeypatch.setattr(recording_figures, "time_figure", refuse)
    words = ["isometric-step", "--muscle", "nylon", "--out", str(tmp_path / "one.svg")]
    code, out, err = run(*words)
    assert code == 2 and "The line was lost." in out and "it cannot be drawn" in err


# ---- biological muscles


def test_a_biological_muscle_runs_by_stimulation(run, tmp_path):
    out, figure = tmp_path / "twitch.nc", tmp_path / "twitch.svg"
    code, text, err = run(
        "twitch", "--muscle", "fast-fibre", "--set", "muscle.rise_time=30 ms", "--set", "width=10 ms",
        "--out", str(out), "--out", str(figure), "--json",
    )  # fmt: skip
    found = json.loads(text)
    assert (code, err) == (0, "")
    (one,) = found["contractions"]
    assert one["peak"] == pytest.approx(found["maximum_tension"] * -np.expm1(-10.0 / 30.0), rel=1e-4)  # steps of 0.1 ms
    assert read_recording(out).meta["specimen"] == "fast-fibre"
    assert figure.stat().st_size > 10_000
    code, text, err = run("stimulated-work-loop", "--muscle", "slow-fibre", "--set", "cycles=2")
    assert (code, err) == (0, "") and "net work per cycle" in text
    code, text, err = run("force-frequency", "--muscle", "slow-fibre", "--dry-run")
    assert (code, err) == (0, "") and "At most 10 s." in text


OF_A_MACHINE = {
    "--plumbing is of a test machine": ("twitch", "--plumbing", "direct"),
    "--real-time is of a test machine": ("twitch", "--real-time"),
    "--set rig.step": ("twitch", "--set", "rig.step=1 ms"),
    "steps.1.pressure cannot be shut off": ("shut.toml", "--dry-run"),
    "Unknown parameter 'turns'": ("twitch", "--set", "muscle.turns=3"),
    "--set rate must be": ("tetanus", "--set", "rate=0 Hz"),
}


@pytest.mark.parametrize("says", OF_A_MACHINE)
def test_a_biological_muscle_refuses_what_only_a_machine_has(run, says, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shut = 'schema = 1\nname = "shut"\n[[steps]]\npressure = "shut"\nfor = "1 s"\n'
    (tmp_path / "shut.toml").write_text(shut, encoding="utf-8")
    code, text, err = run(*OF_A_MACHINE[says], "--muscle", "fast-fibre")
    assert (code, text) == (2, "") and says in err and len(err.splitlines()) == 1


def test_a_mckibben_muscle_refuses_stimulation(run):
    code, text, err = run("twitch", "--muscle", "nylon")
    assert (code, text) == (2, "") and "only biological muscles are stimulated" in err


def test_bands_of_a_posterior_are_of_the_rig_with_its_faults(tmp_path):
    length, pressure = [0.12, 0.13, 0.14], [2e5, 3e5, 4e5]
    law = mk.muscle("nylon").law
    tension = np.asarray(law.tension(np.array(length), np.array(pressure))).tolist()
    samples = {"stiffness_per_pressure": [0.0069, 0.007, 0.0071], "shortest_length": [0.104, 0.105, 0.106]}
    one = {
        "law": "linear_threshold", "samples": samples, "noise_samples": [1.0] * 3, "discrepancy_samples": [0.5] * 3,
        "correlation_length": 0.3, "sensor_noise": [0.5] * 3, "shared_errors": [], "seed": 0, "r_hat": 1.0,
        "effective": 3.0, "divergences": 0, "points": {"length": length, "pressure": pressure, "tension": tension},
        "known": {name: float(getattr(law, name)) for name in declared(law) if name not in samples},
    }  # fmt: skip
    parameters = {name: {"value": values[1], "low": values[0], "high": values[2]} for name, values in samples.items()}
    fit = {"law": "linear_threshold", "n": 3, "parameters": parameters, "posterior": one}
    (tmp_path / "fit.json").write_text(json.dumps({"fits": [fit]}))
    asked = {"muscle": "nylon", "rig": "modern", "changes": {"cycles": "1"}, "posterior": tmp_path / "fit.json"}
    sound, leaking = (
        record_run("isometric-step", **asked, draws=3, faults=faults).to_dict()
        for faults in (None, {"leak": "50 l/min/bar"})
    )
    (measured, band), (of_leak, leaky) = (
        (run["summary"]["pressure"]["max"], run["posterior"]["bands"]["pressure"]["max"]) for run in (sound, leaking)
    )
    assert of_leak < 0.9 * measured and leaky["high"] < 0.9 * band["low"]
