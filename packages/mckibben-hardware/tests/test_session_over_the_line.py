"""A real machine in a separate process, which here is a simulated one behind a serial line that waits for commands."""

import os
import signal
import subprocess
import sys
import time

import pytest

from mckibben.bench.prepare import prepare
from mckibben.bench.segment import SegmentMachine, timing_of
from mckibben.bench.session.proxy import SessionProxy
from mckibben.errors import InputError, LineLostError
from mckibben.specimens import specimen
from mckibben_hardware.serial_line.device import About
from mckibben_hardware.serial_line.microcontroller import in_thread

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


def test_a_port_that_is_not_there_is_refused_by_its_name(device):
    device.words = "serial:/dev/nothing-there"
    with pytest.raises((InputError, LineLostError), match="/dev/nothing-there"), operated(device):
        pass
