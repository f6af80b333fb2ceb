"""A real machine in a separate process, which here is a simulated one behind a serial line that waits for commands."""

import os
import pickle
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
from short_runs import paper

from mckibben.bench.console import Console
from mckibben.bench.hardware.serial_line.device import About
from mckibben.bench.hardware.serial_line.microcontroller import in_thread
from mckibben.bench.prepare import prepare
from mckibben.bench.segment import SegmentMachine, timing_of
from mckibben.bench.session import Session
from mckibben.bench.session.proxy import SessionProxy
from mckibben.errors import EngineError, InputError, LineLostError
from mckibben.specimens import specimen

OPERATED = """
import sys, time
from mckibben.bench.rig_file import rig
from mckibben.bench.session.proxy import SessionProxy
from mckibben.specimens import specimen
if __name__ == "__main__":
    with SessionProxy(sys.argv[1], rig("paper"), specimen("nylon"), lock_step=True) as machine:
        machine.set(pressure="2 bar")
        while machine.latest().get("pressure", 0.0) < 1.9e5:
            time.sleep(0.02)
        print("there", flush=True)
        time.sleep(100.0)
"""


class Device:
    """A machine behind a pseudo-terminal.

    Attributes:
        words: that name it.
        valve: commands of the valve, in counts.
    """

    def __init__(self):
        made = prepare("work-loop", muscle="nylon", rig="paper")
        part = next(made.segments())
        self.machine = SegmentMachine(made, 0, part, timing_of(made)).at_interface()
        self.rest, self.valve, self.words, advance = int(made.rig.motor_out.count(0.0)), [], "", self.machine.advance

        def told(valve, motor, opened):
            self.valve.append(valve)
            advance(valve, motor, opened)

        self.machine.advance = told


@pytest.fixture
def device():
    found = Device()
    with in_thread(found.machine, about=About(motor_rest=found.rest)) as attached:
        found.words = f"serial:{attached.port}"
        yield found


def until(true, what, longest=120.0):
    end = time.monotonic() + longest
    while not true():
        assert time.monotonic() < end, what
        time.sleep(0.02)


def still(device):
    """Whether nobody asks for samples, in a time in which there are hundreds otherwise."""
    count = len(device.valve)
    time.sleep(1.0)
    return len(device.valve) == count


def operated(device):
    from mckibben.bench.rig_file import rig

    return SessionProxy(device.words, rig("paper"), specimen("nylon"), lock_step=True)


def test_a_program_that_is_killed_leaves_a_vented_machine_that_nobody_has(device, tmp_path):
    script = tmp_path / "operated.py"
    script.write_text(OPERATED)
    program = subprocess.Popen([sys.executable, str(script), device.words], stdout=subprocess.PIPE, text=True)
    with program:
        assert program.stdout.readline() == "there\n"
        assert max(device.valve) > 0
        program.kill()
    until(lambda: device.valve[-1] == 0, "vented")
    # it goes on vented until the muscle is empty, and then lets go of the line: nobody asks for samples any more
    until(lambda: still(device), "the end of its samples")
    assert set(device.valve[-100:]) == {0}


def test_a_machine_whose_process_is_killed_is_lost_and_said_to_be_and_can_be_had_again(device):
    with operated(device) as machine:
        machine.set(pressure="1 bar")
        until(lambda: machine.latest()["pressure"] > 0.9e5, "1 bar")
        assert machine.status().state == "manual"
        os.kill(machine.process, signal.SIGKILL)
        until(lambda: machine.gone == "lost", "lost")
        assert "the process that had the machine ended" in machine.why
        assert machine.status().state == "lost" and machine.latest() == {}
        assert machine.messages()[-1].kind == "stop" and "process that had the machine" in machine.messages()[-1].text
        with pytest.raises(LineLostError, match="ended"):
            machine.set(pressure="2 bar")
        machine.button.press()  # nobody hears it; nothing is raised where a stop is pressed
    with operated(device) as again:
        assert again.status().state == "idle"


@pytest.mark.parametrize("words", ["serial:/dev/nothing-there", "radio"])
def test_a_machine_that_is_not_there_is_refused_by_its_name(device, words):
    device.words = words
    with pytest.raises((InputError, LineLostError), match=words.partition(":")[2] or words), operated(device):
        pass


SCRIPT = """\
pressure 2 bar
wait 0.7 s
record on
span 13.5 cm
wait 0.3 s
load isotonic-triangle
set load=50 N frequency=5 Hz cycles=1
run
record off
status
"""


def scripted(session):
    """What a console answers and is told, and the recording, of a script on a machine."""
    console = Console(session)
    answers = [console.execute(line) for line in SCRIPT.splitlines()]
    return answers, console.news(), console.recording


def test_a_session_in_another_process_answers_records_and_refuses_as_one_in_this_process():
    with Session(paper(), "nylon", speed=None) as here:
        ours = scripted(here)
    with SessionProxy(None, paper(), "nylon", speed=None) as there:
        assert there.simulated and there.setup.limits == here.setup.limits and there.period == here.period
        theirs = scripted(there)
        there.note("seen by both")
        assert there.messages()[-1].text == "seen by both"
        with pytest.raises(InputError) as refused:
            there.set(pressure="40 bar")
        assert refused.value.field == "pressure" and "by hand" in str(refused.value)
        with pytest.raises(InputError, match="allowed only after a stop"):
            there.reset()
        there.emergency_stop("tried")
        assert "tried" in there.why and there.status().state == "stopped"
        there.reset()
        assert not there.why and not there.button()
    assert there.gone == "closed"
    there.close()
    deadlines = ours[0][-1].splitlines()[-1]  # how late samples were is measured by the wall clock
    assert theirs[0][:-1] == ours[0][:-1] and theirs[1] == ours[1] and "samples by hand" in deadlines
    assert list(ours[2].channels) == list(theirs[2].channels)
    for name in ours[2].channels:
        assert np.array_equal(ours[2][name], theirs[2][name], equal_nan=True), name


@pytest.mark.parametrize(
    "error", [InputError("span", 3.0, "must be less", where="a.toml"), EngineError("no such operation")]
)
def test_an_error_goes_whole_from_one_process_to_another(error):
    found = pickle.loads(pickle.dumps(error))
    assert type(found) is type(error) and str(found) == str(error) and vars(found) == vars(error)
