"""``record convert`` and ``record repair``: from file to file, what a killed process left, a line for what is wrong."""

import json
import os
import signal
import subprocess
import sys

import numpy as np
import pytest

from mckibben.cli import main
from mckibben.recordings import Channel, LiveLog, Recording, read_recording

TIME = 1e-3 * np.arange(400)
RECORD = Recording(
    TIME,
    {"muscle.tension": Channel(np.cos(TIME), "N", "measured"), "valve": Channel(TIME > 0.2, "1", "command")},
    {"title": "a run", "events": [{"time": 0.2, "text": "valve opened"}]},
)


@pytest.fixture
def run(capsys):
    def call(*words: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["record", *map(str, words)])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def broken_log(path, cut: float = 0.5):
    """A log whose process ended somewhere."""
    with LiveLog(path, RECORD.channels, RECORD.meta, flush=0.02, sync=None) as log:
        for i, at in enumerate(TIME):
            log.append(at, [RECORD["muscle.tension"][i], RECORD["valve"][i]])
    data = path.read_bytes()
    path.write_bytes(data[: int(cut * len(data))])
    return path


def test_all_the_way_round_and_back(run, tmp_path):
    before = RECORD.save(tmp_path / "a.nc")
    for suffix in (".mcap", ".tdms", ".parquet", ".mat", ".csv"):
        after = tmp_path / f"a{suffix}"
        code, out, err = run("convert", before, after, "--json")
        found = json.loads(out)
        assert (code, err, found["samples"]) == (0, "", 400)
        assert (found["file"], found["source"], found["end"]) == (str(after), str(before), TIME[-1])
        assert found["channels"]["valve"] == {"unit": "1", "kind": "command"}
        assert bool(found["warnings"]) == (suffix == ".mat")  # it knows no dots in names
        before = after
    assert read_recording(before) == RECORD


def test_a_person_is_told_what_was_written_and_what_is_otherwise(run, tmp_path):
    code, out, _ = run("convert", RECORD.save(tmp_path / "a.nc"), tmp_path / "a.mat")
    assert code == 0
    assert "400 samples of 2 channels, 0 s to 0.399 s" in out
    assert "Note: 1 names are written as MATLAB allows them, such as muscle_tension for muscle.tension" in out


def test_a_table_of_others_needs_its_units(run, tmp_path):
    table, out_file = tmp_path / "logger.csv", tmp_path / "logger.nc"
    table.write_text("Zeit,Druck\n" + "".join(f"{i},{i % 7}\n" for i in range(30)))
    words = ["convert", table, out_file, "--column", "time=Zeit", "--column", "tank.pressure=2"]
    code, out, err = run(*words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert f"{table}: tank.pressure has no unit" in err
    assert "--unit tank.pressure=UNIT" in err
    assert not out_file.exists()
    code, _, _ = run(*words, "--unit", "tank.pressure=bar", "--unit", "time=ms")
    found = read_recording(out_file)
    assert code == 0
    assert (found["tank.pressure"].max(), found.time[1]) == (6e5, 1e-3)
    code, _, err = run(
        "convert", table, tmp_path / "b.nc", "--column", "p=Druck", "--unit", "p=bar", "--period", "5 ms"
    )
    assert code == 0
    assert read_recording(tmp_path / "b.nc").time[1] == 0.005


def test_repair_saves_what_is_left_beside_the_log(run, tmp_path):
    log = broken_log(tmp_path / "run.mcap")
    kept = log.read_bytes()
    code, out, err = run("repair", log, "--json")
    found = json.loads(out)
    assert (code, err, found["whole"], found["file"]) == (0, "", False, str(tmp_path / "run.nc"))
    assert any("was not closed" in line for line in found["lost"])
    record = read_recording(tmp_path / "run.nc")
    assert 0 < len(record) == found["samples"] < 400
    assert np.array_equal(record["muscle.tension"], np.cos(record.time))
    assert record.meta["warnings"] == found["lost"]
    assert log.read_bytes() == kept
    code, out, _ = run("show", tmp_path / "run.nc")
    assert (code, "Warning: the log was not closed" in out) == (0, True)


def test_repair_says_what_is_lost_or_that_nothing_is(run, tmp_path):
    log = broken_log(tmp_path / "run.mcap")
    code, out, _ = run("repair", log, "--out", tmp_path / "run.csv")
    assert code == 0
    assert "Note: the log was not closed: what came after 0." in out
    whole = broken_log(tmp_path / "whole.mcap", 1.0)
    assert "The log was complete." in run("repair", whole)[1]
    assert read_recording(tmp_path / "whole.nc") == RECORD


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="a process is killed as POSIX does")
def test_repair_opens_what_kill_9_left(run, tmp_path):
    code = (
        "import sys, numpy as np\nfrom mckibben.recordings import Channel, LiveLog\n"
        "log = LiveLog(sys.argv[1], {'a': Channel(np.empty(0), 'N')})\n"
        "for i in range(300): log.append(i * 1e-3, [i])\nprint('go', flush=True)\nsys.stdin.read()\n"
    )
    command = [sys.executable, "-c", code, str(tmp_path / "run.mcap")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == b"go\n"
        os.kill(process.pid, signal.SIGKILL)
    found = json.loads(run("repair", tmp_path / "run.mcap", "--json")[1])
    assert 0.299 - found["end"] < 0.1
    assert not found["whole"]


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("convert", "missing.mat", "a.nc"), "ile not found"),
        (("convert", "a.nc", "a.doc"), "Known are .nc, .csv"),
        (("convert", "a.nc", "none/a.csv"), "there is no folder"),
        (("convert", "a.nc", "b.csv", "--unit", "valve=bar"), "unit is"),
        (("convert", "a.nc", "b.csv", "--unit", "valve"), "NAME=VALUE"),
        (("convert", "a.nc", "b.csv", "--period", "1 bar"), "--period"),
        (("convert", "text.mcap", "b.csv"), "text.mcap"),
        (("convert", "text.tdms", "b.csv"), "cannot be read as a TDMS file"),
        (("repair", "b.mcap"), "ile not found"),
        (("repair", "text.mcap"), "no log of mckibben"),
        (("repair", "empty.mcap"), "empty"),
        (("repair", "run.mcap"), "this file exists already"),
        (("repair", "run.mcap", "--out", "b.mat"), "ends in .nc or .csv"),
    ],
)
def test_wrong_words_give_one_line_exit_code_2_and_no_file(run, tmp_path, monkeypatch, words, says):
    monkeypatch.chdir(tmp_path)
    RECORD.save("a.nc")
    RECORD.save("run.nc")
    broken_log(tmp_path / "run.mcap")
    for name in ("text.mcap", "text.tdms"):
        (tmp_path / name).write_text("a text")
    (tmp_path / "empty.mcap").touch()
    before = sorted(p.name for p in tmp_path.iterdir())
    code, out, err = run(*words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert sorted(p.name for p in tmp_path.iterdir()) == before
