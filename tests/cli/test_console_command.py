"""``console``: scripts and pipes do what a person would type, echo it, and stop at the first line that is wrong."""

import io
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from mckibben.cli import main
from mckibben.recordings import read_recording

FAST = ("--muscle", "nylon", "--as-fast-as-it-goes")


@pytest.fixture
def console(capsys, monkeypatch):
    def call(*words: str, piped: str = "") -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "stdin", io.StringIO(piped))
        with pytest.raises(SystemExit) as stop:
            main(["console", *words])
        out, err = capsys.readouterr()
        return stop.value.code or 0, out, err

    return call


GOOD = """\
# by hand, and a protocol
pressure 2 bar
wait 1 s
load isotonic-triangle
set load=50 N frequency=5 Hz cycles=1
run   # two tenths of a second are recorded
save {}
"""


def test_a_script_is_echoed_and_done_and_what_it_saves_opens(console, tmp_path):
    saved, script = tmp_path / "run.nc", tmp_path / "script.txt"
    script.write_text(GOOD.format(saved))
    code, out, err = console(*FAST, "--script", str(script))
    assert (code, err) == (0, "")
    assert [line for line in out.splitlines() if line.startswith("> ")] == [
        f"> {line}" for line in GOOD.format(saved).splitlines()[1:]
    ]
    assert "The run reached its end." in out and f"Written: {saved}" in out
    record = read_recording(saved)
    assert record.meta["specimen"] == "nylon" and record.meta["result"] == "done" and len(record) == 200


def test_as_fast_as_it_goes_the_same_script_gives_the_same_recording_to_the_last_bit(console, tmp_path):
    found = []
    for name in ("one.nc", "two.nc"):
        save = tmp_path / name
        lines = f"span 13.5 cm\nwait 0.3 s\nrecord on\npressure 3 bar\nwait 0.4 s\nrecord off\nsave {save}\n"
        assert console(*FAST, piped=lines)[0] == 0
        found.append(read_recording(save))
    for channel in found[0].channels:
        assert np.array_equal(found[0][channel], found[1][channel], equal_nan=True), channel


def test_what_is_piped_stops_at_the_first_line_that_is_wrong_with_its_number(console):
    code, out, err = console(*FAST, piped="# one\npressure 1 bar\n\nwait 10 ms\npresure 2 bar\npressure 3 bar\n")
    assert code == 2
    assert err.strip() == (
        "mckibben: standard input: line 5: Unknown command 'presure'. Did you mean 'pressure'? Known are "
        + err.partition("Known are ")[2].strip()
    )
    assert len(err.strip().splitlines()) == 1 and "> pressure 3 bar" not in out


@pytest.mark.slow
def test_a_machine_that_stops_by_itself_ends_a_script_with_its_reason(console):
    lines = "pressure 5.5 bar\nspan 15.5 cm\nwait 4 s\npressure 1 bar\n"
    code, out, err = console(*FAST, piped=lines)
    assert code == 1 and "line 3: lost tension" in err and "> pressure 1 bar" not in out


@pytest.mark.slow
def test_stop_reset_and_quit_are_no_errors(console):
    code, out, err = console(*FAST, piped="pressure 1 bar\nwait 0.5 s\nstop\nreset\nquit\npresure\n")
    assert (code, err) == (0, "") and "stopped and vented" in out and "presure" not in out


WRONG = {
    "muscle": (["--muscle", "nylom"], "Did you mean 'nylon'"),
    "rig": (["--muscle", "nylon", "--rig", "papr"], "Did you mean 'paper'"),
    "script": (["--muscle", "nylon", "--script", "gone.txt"], "gone.txt"),
    "plumbing": ([*FAST, "--plumbing", "x"], "Known are direct"),
    "span": ([*FAST, "--span", "2 m"], "the rig allows"),
    "rate": ([*FAST, "--rate", "100 kHz"], "rate"),
    "unit": ([*FAST, "--rate", "1 s"], "--rate"),
    "machine": (["--muscle", "nylon", "--on", "nothing"], "--on"),
    "both": ([*FAST, "--on", "daq"], "its own time"),
    "a valve": (["--muscle", "MPP-3-1-8"], "McKibben"),
}


@pytest.mark.parametrize("case", WRONG)
def test_wrong_words_get_one_line_before_anything_moves(console, case):
    words, said = WRONG[case]
    code, out, err = console(*words)
    assert (code, out) == (2, "")
    assert len(err.strip().splitlines()) == 1 and said in err, err


@pytest.mark.skipif(os.name != "posix", reason="terminals of POSIX")
def test_at_a_prompt_control_c_stops_what_goes_on_and_control_d_vents_and_leaves(tmp_path):
    """A person at a terminal: completion by tab, a wait that is interrupted, the reason, and the way out."""
    import pty

    place = {"TERM": "xterm", "XDG_STATE_HOME": str(tmp_path)}
    words = [sys.executable, "-m", "mckibben", "console", "--muscle", "nylon"]
    terminal, end = pty.openpty()
    child = subprocess.Popen(words, stdin=end, stdout=end, stderr=end, env=os.environ | place)
    os.close(end)
    seen = b""

    def until(expected: bytes, longest: float = 120.0) -> None:
        nonlocal seen
        last = time.monotonic() + longest
        while expected not in seen:
            assert time.monotonic() < last, seen[-2000:].decode(errors="replace")
            some = os.read(terminal, 65536)
            seen += some
            if b"\x1b[6n" in some:  # where is the cursor
                os.write(terminal, b"\x1b[1;1R")
        seen = seen.partition(expected)[2]

    with child:
        try:
            until(b"help says what it knows")
            until(b"mckibben>")
            os.write(terminal, b"load qu\t")
            until(b"asi-static")  # stands nowhere else, and what is completed is drawn at once
            os.write(terminal, b"\r")
            until(b"mckibben>")
            os.write(terminal, b"pressure 1 bar\r")
            until(b"pressure to 1 bar")
            until(b"mckibben>")
            os.write(terminal, b"wait 100 s\r")
            until(b"\x1b[?2004l")  # the prompt has let go of the terminal
            time.sleep(1.0)
            child.send_signal(signal.SIGINT)  # as the terminal does for Ctrl-C
            until(b"emergency stop at ")
            until(b"mckibben>")
            os.write(terminal, b"\x04")
            until(b"Vented.")
            assert child.wait(30.0) == 0
        finally:
            child.kill()
            os.close(terminal)
    assert "wait 100 s" in (tmp_path / "mckibben" / "console-history").read_text()
