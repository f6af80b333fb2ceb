"""Frequency responses and repeatability from the command line: of systems whose answer is known."""

import json
from pathlib import Path

import numpy as np
import pytest

from mckibben.assembly.circuit_file import read_circuit
from mckibben.bench.circuit_run import run_circuit
from mckibben.cli import main
from mckibben.recordings import Channel, Recording

TUBE = str(Path(__file__).parents[2] / "examples" / "circuits" / "muscle-behind-a-tube.toml")
NAMES = ("--input", "regulator.pressure", "--output", "muscle.pressure_abs")


@pytest.fixture
def run(capsys):
    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(list(words))
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def test_a_small_sine_through_a_circuit_gives_the_response_of_the_linear_model(run, tmp_path):
    """At 10 mbar the tube's friction is laminar and the gas linear to 10 mbar/4 bar = 0.3 %; the transient of the slow
    mode, 0.16 Hz, has a share of 1e-3. One per cent is three times both.
    """
    text = Path(TUBE).read_text(encoding="utf-8")
    sine = 'kind = "sine"\nmean = "3 bar"\namplitude = "10 mbar"\nfrequency = "8 Hz"'
    file = tmp_path / "sine.toml"
    file.write_text(
        text.replace('kind = "constant"\nvalue = "3 bar"', sine).replace('"1 s"', '"3 s"'), encoding="utf-8"
    )
    run_circuit(read_circuit(file)).save(tmp_path / "sine.nc")
    words = ("--input", "regulator.pressure_abs", "--output", "muscle.pressure_abs", "--sines", "8 Hz", "--from", "2 s")
    code, out, _ = run("record", "frequency", str(tmp_path / "sine.nc"), *words, "--json")
    measured = json.loads(out)
    assert code == 0 and measured["coherence"][0] > 0.999
    code, out, _ = run("circuit", "frequency", TUBE, *NAMES, "--from", "8 Hz", "--to", "9 Hz", "--json")
    model = json.loads(out)
    assert code == 0 and model["unit"] == ""
    assert measured["magnitude"][0] == pytest.approx(model["magnitude"][0], rel=0.01)
    assert measured["phase"][0] == pytest.approx(model["phase"][0], abs=0.01)


def test_a_circuit_passes_slow_changes_whole_and_falls_beyond_its_resonance(run, tmp_path):
    picture = tmp_path / "bode.svg"
    code, out, _ = run("circuit", "frequency", TUBE, *NAMES, "--out", str(picture), "--json")
    found = json.loads(out)
    fastest = max(found["modes"], key=lambda m: m["frequency"])
    assert code == 0 and "Magnitude" in picture.read_text(encoding="utf-8")
    assert found["magnitude"][0] == pytest.approx(1.0, abs=1e-3)
    assert found["frequency"][int(np.argmax(found["magnitude"]))] == pytest.approx(fastest["frequency"], rel=0.05)
    assert found["cutoff"] > fastest["frequency"]
    assert found["level"] == pytest.approx(3e5 + 101325.0, rel=1e-6)


def loops(path: Path, gains: tuple[float, ...]) -> str:
    """A span that goes up and down once a second, and a tension in step with it whose height differs between cycles."""
    time = np.arange(1000 * len(gains) + 1) / 1000.0
    span = 0.13 - 0.01 * np.cos(2.0 * np.pi * time)
    gain = np.array([*gains, gains[-1]])[np.minimum(time.astype(int), len(gains))]
    tension = gain * (1.0 - np.cos(2.0 * np.pi * time))
    Recording(time, {"span": Channel(span, "m"), "tension": Channel(tension, "N")}).save(path)
    return str(path)


def test_cycles_that_grow_by_a_newton_drift_by_a_newton(run, tmp_path):
    code, out, _ = run("record", "repeatability", loops(tmp_path / "a.nc", (10.0, 10.5, 11.0, 11.5)), "--json")
    found = json.loads(out)
    assert code == 0
    assert found["between"] == "cycles" and found["repetitions"] == len(found["peaks"]["values"])
    assert found["drift"]["value"] == pytest.approx(
        1.0, rel=1e-2
    )  # of peaks at twice the gain; where cycles begin is sampled


def test_runs_that_are_equal_repeat_exactly_and_others_by_what_they_differ(run, tmp_path):
    files = [loops(tmp_path / f"{i}.nc", (10.0, 10.0)) for i in range(2)]
    code, out, _ = run("record", "repeatability", *files, "--json")
    assert code == 0 and json.loads(out)["largest"] == 0.0
    files.append(loops(tmp_path / "more.nc", (11.0, 11.0)))
    picture = tmp_path / "runs.svg"
    code, out, _ = run("record", "repeatability", *files, "--out", str(picture))
    assert code == 0 and "3 runs" in out and picture.exists()


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            ("circuit", "frequency", TUBE, "--input", "regulator.presure", "--output", "muscle.pressure_abs"),
            "regulator.pressure",
        ),
        (("circuit", "frequency", TUBE, *NAMES, "--from", "10 Hz", "--to", "1 Hz"), "--from must be above 0 Hz"),
        (("circuit", "frequency", TUBE, *NAMES, "--at", "9 s"), "--at must be between 0 s and 1 s"),
    ],
)
def test_what_is_wrong_ends_with_one_line_and_2(run, words, says):
    code, out, err = run(*words)
    assert (code, out, err.count("\n")) == (2, "", 1) and says in err


def test_a_signal_is_varied_by_the_name_that_the_file_gives_it(run):
    """Exact: it is the same input."""
    codes, answers = zip(*(run("circuit", "frequency", TUBE, "--input", n, *NAMES[2:], "--json")[:2]
                           for n in ("pressure", "regulator.pressure")), strict=True)  # fmt: skip
    assert codes == (0, 0) and answers[0] == answers[1] and max(json.loads(answers[0])["magnitude"]) > 0.9
