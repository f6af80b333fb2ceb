"""Checks of machines that were never here: each fault is found again in its file; a bad file is refused in a sentence."""

import json
from pathlib import Path

import numpy as np
import pytest

import check_files
from check_files import CASES, FOLDER
from mckibben.bench.hardware.backends import connected
from mckibben.bench.rig_file import rig
from mckibben.bench.run import prepare, run
from mckibben.errors import InputError, LineLostError
from mckibben_hardware import commissioning
from mckibben_hardware.replay import ReplayedHardware, read_check, replay_check, write_check

FAULTS = [name for name in CASES if name != "sound"]


@pytest.fixture
def sound() -> commissioning.CheckRecord:
    return read_check(FOLDER / "sound.json")[0]


@pytest.mark.parametrize("name", FAULTS)
def test_the_fault_of_a_machine_that_is_not_here_is_found_and_told(name: str):
    case, found = CASES[name], replay_check(FOLDER / f"{name}.json")
    steps = {step.name: step for step in found.steps}
    assert not found.passed and not steps["check"].passed
    if case.failed is None:  # the machine was lost or refused
        assert found.check is None and case.told in steps["check"].sentence
        assert not case.later or case.later in steps["check"].sentence
        return
    assert steps["as then"].passed, steps["as then"].sentence
    told = {(r.channel, r.test): r.sentence for r in found.check.failures()}
    assert case.told in told[case.failed]
    assert case.later in steps["calibrate zero"].sentence
    assert case.later in ("", "zeros of") or not steps["calibrate zero"].passed


def test_a_sound_machine_that_is_not_here_passes_check_calibration_and_first_protocol(sound):
    found = replay_check(FOLDER / "sound.json")
    assert found.passed, found.steps
    assert [step.name for step in found.steps] == ["check", "as then", "calibrate zero", "isometric-step"]


def test_the_first_protocol_goes_as_on_the_machine_of_the_file(sound):
    there, here = (
        run(
            prepare(
                "isometric-step", muscle="nylon", rig=sound.rig, plumbing=sound.plumbing, accept_saturation=True,
                sample_rate="25 Hz", high="1 bar", cycles=1,
            ),
            hardware=hardware,
        )
        for hardware in (None, ReplayedHardware(sound))
    )  # fmt: skip
    apart = np.abs(there["pressure"] - here["pressure"])
    # Choked flow is not linear: a tenth of the step in samples where it moves, and where it rests the noise of 5 counts.
    assert np.max(apart) < 0.1e5 and np.median(apart) < 0.005e5


def test_a_machine_asked_the_same_answers_the_same_counts(sound):
    again = commissioning.record_check(
        ReplayedHardware(sound), sound.rig, period=sound.period, pressure=sound.pressure, plumbing=sound.plumbing,
        motor=sound.motor,
    )  # fmt: skip
    for now, then in zip(again.samples, sound.samples, strict=True):
        assert np.array_equal(now, then)


def test_half_a_step_is_answered_by_half_the_change_and_another_period_by_the_same_time(sound):
    none = int(sound.rig.valve_out.count(0.0))
    asked, at = int(sound.rig.valve_out.count(sound.pressure)), sound.samples.names.index("pressure")
    rest = sound.samples.counts[sound.samples.phase == "rest"][:, at]

    def settled(share: float, period: float) -> float:
        machine, counts = ReplayedHardware(sound), []
        machine.start(period)
        for k in range(round(3.0 / period)):
            machine.wait(k)
            counts.append(machine.counts[at])
            machine.write(none + round(share * (asked - none)))
        return float(np.mean(counts[-10:])) - float(rest.mean())

    whole = settled(1.0, 0.04)
    # Means of 10 and 25 samples with 5 counts of noise, twice: 5 sqrt(2/10 + 2/25) = 2.7 counts rms; four times that.
    assert settled(0.5, 0.04) == pytest.approx(0.5 * whole, abs=11.0)
    assert settled(1.0, 0.013) == pytest.approx(whole, abs=11.0)


def test_a_shut_muscle_keeps_its_counts_where_it_did_so_in_the_check(sound):
    none, asked = (int(sound.rig.valve_out.count(p)) for p in (0.0, sound.pressure))
    machine, at = ReplayedHardware(sound), sound.samples.names.index("pressure")
    for k in range(120):
        machine.wait(k)
        if k == 60:
            full = machine.counts[at]
        machine.write(asked if k < 60 else none, opened=k < 60)
    assert machine.counts[at] == pytest.approx(full, abs=40.0)  # noise of 5 counts rms, twice, at most 5 of these
    machine.write(none, opened=True)
    for k in range(120, 180):
        machine.wait(k)
        machine.write(none, opened=True)
    assert machine.counts[at] < 0.6 * full  # the scale begins at -1 bar: 5461 of 10922 counts are nothing


def test_the_machine_of_a_file_is_a_machine_for_every_command(sound):
    place = f"replay:{FOLDER / 'sound.json'}"
    with connected(place, rig("modern"), sound.period) as hardware:
        assert hardware.names == sound.samples.names and hardware.identity["firmware"] == "mckibben reference 1"
    with pytest.raises(InputError, match="channels"), connected(place, _with_a_sensor_more(), sound.period):
        pass


def _with_a_sensor_more():
    class More:
        def converters(self, span):
            return type("Converters", (), {"names": ("pressure", "strain")})

    return More()


def test_a_check_that_is_written_and_read_is_the_same(sound, tmp_path: Path):
    outcome = sound.judge()
    again, then = read_check(write_check(tmp_path / "again.json", sound, outcome))
    assert then == tuple(outcome.results) and again.judge().results == outcome.results
    assert again.machine == sound.machine and again.versions == sound.versions
    for now, before in zip(again.samples, sound.samples, strict=True):
        assert np.array_equal(now, before)


def _changed(**changes):
    content = json.loads((FOLDER / "sound.json").read_text())
    for path, value in changes.items():
        at, keys = content, path.split("__")
        for key in keys[:-1]:
            at = at[key]
        at[keys[-1]] = value
    return json.dumps(content)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[1, 2", "is no JSON"),
        (b"\x89HDF\r\n", "must be JSON in UTF-8"),  # the recording of the check, by another name
        ("[" * 100_000, "is no JSON"),
        ('{"fits": []}', "must be what mckibben device check --out FILE.json has written"),
        (lambda: _changed(schema=2), "schema must be 1"),
        (lambda: _changed(period="soon"), "period must be a number from 1e-06 to 10"),
        (lambda: _changed(plumbing="none"), "plumbing"),
        (lambda: _changed(samples__counts__pressure=[1, 2]), "pressure must have"),
        (lambda: _changed(samples__counts__strain=[]), "strain"),
        (lambda: _changed(samples__counts__pressure=[0.5]), "must be a list of whole numbers"),
        (lambda: _changed(samples__phases={"rest": 10**9}), "rest must be"),
        (lambda: _changed(samples__commands=[[5, 0, 0, 1]]), "commands.0"),
        (lambda: _changed(machine__motor_rest=-1), "motor_rest must be"),
        (lambda: _changed(samples=None), "samples is missing"),
        (lambda: _changed(rig_document={"schema": 1, "name": "x"}), "shortest is missing"),
        (lambda: _changed(rig_document__sensors__pressure__kind="own.py:KIND"), "own.py"),
    ],
)
def test_a_bad_file_is_refused_in_one_sentence_that_names_it(text, words: str, tmp_path: Path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    Path("own.py").write_text("raise SystemExit('a file has run code')\n")
    text = text() if callable(text) else text
    Path("bad.check").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(InputError) as caught:
        read_check("bad.check")
    said = str(caught.value)
    assert words in said and "bad.check" in said and "\n" not in said


def test_a_machine_without_samples_refuses_to_run(tmp_path: Path, sound):
    record, _ = read_check(FOLDER / "other_converter.json")
    assert record.samples is None
    with pytest.raises(LineLostError, match="bits of pressure"):
        ReplayedHardware(record)


def test_every_file_is_small_and_of_a_case():
    files = {path.stem: path.stat().st_size for path in FOLDER.glob("*.json")}
    assert set(files) == set(CASES)
    assert max(files.values()) < 24_000, check_files.__doc__
