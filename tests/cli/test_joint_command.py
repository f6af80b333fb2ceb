"""``mckibben joint``: commands over time and tables become a recording, and set-points are held by a rig's controller."""

import json

import numpy as np
import pytest

from mckibben.cli import main
from mckibben.recordings import read_recording


@pytest.fixture
def run(capsys):
    def call(*words):
        with pytest.raises(SystemExit) as stop:
            main(["joint", *words])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def test_commands_over_time_become_a_recording_that_can_be_played_again(run, tmp_path):
    first, again = tmp_path / "first.nc", tmp_path / "again.nc"
    commands = ("--command", "flexor=0, 0.3 @ 20 ms", "--command", "extensor=-0.1")
    code, out, err = run(*commands, "--duration", "0.1 s", "--out", str(first))
    assert code == 0 and f"Written: {first}" in out
    # the supply of 6 bar fills the flexor beyond the 5 bar of the map of nylon
    assert err.count("\n") == 1 and "beyond the measured ones of nylon, up to 5 bar" in err
    assert run("--play", str(first), "--out", str(again))[0] == 0
    records = [read_recording(path) for path in (first, again)]
    np.testing.assert_array_equal(
        records[0]["joint.angle"], records[1]["joint.angle"]
    )  # the same commands, the same bits
    np.testing.assert_array_equal(records[0]["flexor.command"][[0, 9, 10, 49]], [0.0, 0.0, 0.3, 0.3])


def test_a_command_after_the_end_is_said_to_be_left_out(run):
    code, _, err = run("--command", "flexor=0, 0.1 @ 20 s", "--duration", "20 ms")
    assert (
        code == 0 and "command flexor changes at 20 s, and the run ends at 0.02 s: what begins then is left out" in err
    )
    assert "left out" not in run("--command", "flexor=0, 0.1 @ 18 ms", "--duration", "20 ms")[2]


@pytest.mark.parametrize("times", [("0", "0.05", "0.1"), ("5", "5.05", "5.1")])
def test_a_table_is_played_from_its_first_time_on(run, tmp_path, times):
    table = tmp_path / "commands.csv"
    rows = "".join(f"{t},{value},-{value}\n" for t, value in zip(times, (0.2, 0, 0), strict=True))
    table.write_text(f"time [s],flexor [1],extensor [1]\n{rows}")
    code, out, _ = run("--play", str(table), "--json")
    shown = json.loads(out)
    assert code == 0 and shown["duration"] == pytest.approx(0.1, rel=1e-9)  # rounding of a sum
    played = shown["channels"]["flexor.command"]
    assert played["max"] == 0.2 and played["min"] == 0.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--command", "flexr=0"), "Did you mean 'flexor'?"),
        (("--command", "flexor=0, 1"), "further ones with their times"),
        (("--command", "flexor=0, 1 @ 0.2 s, 0 @ 0.1 s"), "rising times"),
        (("--angle", "0.1 rad", "--command", "flexor=0"), "drive the valves directly"),
        (("--duration", "0 s"), "one period"),
        (("--valve", "mpye-7"), "MPYE-5-1-8-LF"),
        (("--out", "joint.txt"), ".nc"),
    ],
)
def test_what_does_not_fit_is_refused_in_one_sentence(run, words, said):
    code, out, err = run(*words)
    assert code == 2 and out == "" and said in err and err.count("\n") == 1
