"""The bench of the screen on a real machine, which here is a simulated one behind a serial line that waits for commands."""

import contextlib
import functools
import os
import signal
import time

import numpy as np
import pytest

from mckibben.bench.prepare import prepare
from mckibben.bench.segment import SegmentMachine, timing_of
from mckibben.experiments.read import parse_protocol
from mckibben.recordings import read_recording
from mckibben.web.bench import Bench, HardwareSpec
from mckibben.web.workspace import Workspace
from mckibben_hardware.serial_line.device import About
from mckibben_hardware.serial_line.microcontroller import Faults, in_thread

MOUNTED = """schema = 1
name = "mounted"
title = "Where the muscle is mounted"
[[steps]]
pressure = "0 bar"
span = "1 L0"
for = "0.1 s"
[[steps]]
span = { to = "13 cm", in = "1 s" }
"""
SHORT = """schema = 1
name = "short"
title = "Short"
[[steps]]
label = "up"
pressure = { to = "2 bar", in = "0.3 s" }
span = { to = "13 cm", in = "0.3 s" }
[[steps]]
label = "down"
pressure = { to = "0 bar", in = "0.3 s" }
span = "13 cm"
"""
HOLDING = SHORT.split('[[steps]]\nlabel = "down"')[0].replace('"short"', '"holding"')
FAR = """schema = 1
name = "far"
title = "Far from rest"
[[steps]]
pressure = "4 bar"
span = "11 cm"
for = "1 s"
"""
LONG = SHORT.replace('span = "13 cm"\n', 'span = "13 cm"\n[[steps]]\nfor = "60 s"\n').replace('"short"', '"long"')


@pytest.fixture(scope="module")
def mounted():
    """The rig with the muscle at its rest length, vented; on the motor, since something moves later."""
    return prepare(parse_protocol(MOUNTED, where="mounted"), muscle="nylon", rig="paper")


class Delayed:
    """A machine that a test can slow down, so that it cannot arrive before a busy processor comes back to the test."""

    def __init__(self, machine):
        self.machine, self.delay = machine, 0.0

    def __getattr__(self, name):
        return getattr(self.machine, name)

    def sample(self):
        time.sleep(self.delay)
        return self.machine.sample()


@contextlib.contextmanager
def open_workspace(folder, mounted, **options):
    """One whose bench is a machine behind a pseudo-terminal."""
    (part,) = mounted.segments()
    machine = Delayed(SegmentMachine(mounted, 0, part, timing_of(mounted)).at_interface())
    with in_thread(machine, about=About(motor_rest=int(mounted.rig.motor_out.count(0.0))), **options) as device:
        spec = HardwareSpec(f"serial:{device.port}", lock_step=True)
        workspace = Workspace(folder, functools.partial(Bench, spec=spec))
        workspace.control.join("me")
        workspace.machine.begin()
        try:
            until(lambda: workspace.machine.session.ready, "by hand")
            workspace.machine.device = machine
            yield workspace, workspace.machine
        finally:
            workspace.close()


@pytest.fixture(scope="module")
def shared(tmp_path_factory, mounted):
    """One for all tests that leave it as it was."""
    with open_workspace(tmp_path_factory.mktemp("real"), mounted) as found:
        yield found


@pytest.fixture
def at_rest(shared):
    """It, vented, with nothing to be reset."""
    workspace, bench = shared
    bench.control_back()
    if bench.status()["shape"] == "tripped":
        done(workspace, "reset")
    done(workspace, "vent")
    until(lambda: bench.session.latest()["pressure"] < 5e3, "vented")
    return workspace, bench


def until(true, what="", longest=120.0):
    end = time.monotonic() + longest
    while not (found := true()):
        assert time.monotonic() < end, what
        time.sleep(0.02)
    return found


def moved(session, span):
    """Whether the motor is not there any more."""
    return abs(session.latest()["span"] - span) > 1e-3


def done(workspace, action, **given):
    answer = workspace.act("me", action, given)
    assert answer["ok"], answer
    return answer["said"]


def loaded(workspace, text):
    done(workspace, "text", text=text)
    until(lambda: workspace.machine.chosen.dry is not None and workspace.machine.chosen.dry.passed, "the dry run")


def run(workspace, text):
    """Its recording."""
    loaded(workspace, text)
    done(workspace, "start")
    return ended(workspace)


def ended(workspace):
    """The recording of what runs."""
    until(lambda: workspace.machine.running is None, "the end of the run")
    return read_recording(workspace.recordings.folder / workspace.machine.ended["file"])


def test_a_real_machine_is_operated_by_hand_runs_a_protocol_and_is_by_hand_again(at_rest):
    workspace, bench = at_rest
    assert bench.describe()["setup"]["machine"].startswith("serial:")
    done(workspace, "set", pressure="1 bar")
    until(lambda: abs(bench.stream.latest().get("pressure", 0.0) - 1e5) < 5e3, "1 bar by hand")
    assert bench.stream.about["kind"] == "hand" and bench.status()["name"] == "By hand"
    record = run(workspace, SHORT)
    assert record.meta["result"] == "done", record.meta["message"]
    assert record.meta["hardware"]["lost"] == 0
    assert not any(name.startswith("muscle.") for name in record.channels)  # nobody knows what is true there
    # the ramp's top is asked for at its end, to a sample; 0.3 mm is what a session itself calls being there
    i = int(np.argmin(np.abs(record.time - 0.3)))
    assert abs(record["command.pressure"][i] - 2e5) < 4e3 and abs(record["span"][-1] - 0.13) < 3e-4
    assert record.time[0] == 0.0 and bench.stream.about == {"kind": "run", "name": "short"}
    assert not list(workspace.recordings.folder.glob("*.mcap"))  # the log of the run is in the recording
    held = run(workspace, HOLDING)
    assert held.meta["result"] == "done"
    # what the protocol ended with is held, and shown
    until(lambda: bench.stream.about["kind"] == "hand" and bench.stream.latest().get("pressure", 0.0) > 1.8e5, "held")
    done(workspace, "vent")
    until(lambda: bench.stream.latest()["pressure"] < 5e3, "vented")


def test_its_stops_vent_and_only_an_emergency_has_to_be_reset(at_rest):
    workspace, bench = at_rest
    for action in ("stop", "emergency_stop"):
        loaded(workspace, LONG)
        done(workspace, "start")
        until(lambda: bench.running is not None and bench.running.time > 0.5, "half a second of the run")
        done(workspace, action)
        record = ended(workspace)
        (event,) = [e for e in record.meta["events"] if "code" in e]
        assert event["code"] == action
        assert record["valve.command"][record.time > event["time"]].max() == 0.0 and record["pressure"][-1] < 2e4
        assert bench.status()["shape"] == {"stop": "idle", "emergency_stop": "tripped"}[action]
    refused = workspace.act("me", "start")
    assert not refused["ok"] and "reset it first" in refused["said"]
    done(workspace, "reset")
    assert run(workspace, SHORT).meta["result"] == "done"


def test_a_stop_on_the_way_to_where_a_protocol_begins_leaves_no_run_and_no_file(at_rest):
    workspace, bench = at_rest
    for action, far in (("stop", FAR), ("emergency_stop", FAR.replace("11 cm", "13 cm"))):
        loaded(workspace, far)
        here = bench.session.latest()["span"]
        bench.device.delay = 0.01
        done(workspace, "start")
        until(functools.partial(moved, bench.session, here), "on its way")
        done(workspace, action)
        bench.device.delay = 0.0
        until(lambda: bench.running is None, "the end")
        assert bench.status()["shape"] == {"stop": "idle", "emergency_stop": "tripped"}[action], bench.session.why
        assert bench.ended["file"] is None and not list(workspace.recordings.folder.glob("far*"))


def test_what_a_real_machine_cannot_is_refused_in_a_sentence(at_rest):
    workspace, bench = at_rest
    for action, given, said in (
        ("pace", {"name": "simulated"}, "own time"), ("rig", {"name": "modern"}, "mckibben serve --rig"),
    ):  # fmt: skip
        answer = workspace.act("me", action, given)
        assert not answer["ok"] and said in answer["said"], action
    loaded(workspace, LONG)
    done(workspace, "start")
    until(lambda: bench.running is not None and bench.running.time > 0.1, "the run")
    answer = workspace.act("me", "pause")
    assert not answer["ok"] and "own time" in answer["said"]
    done(workspace, "stop")
    until(lambda: bench.running is None, "the end of the run")


@pytest.mark.slow
def test_a_line_that_is_unplugged_keeps_what_there_is_and_says_so(tmp_path, mounted):
    with open_workspace(tmp_path, mounted, faults=Faults(at={2500: "unplug"})) as (workspace, bench):
        loaded(workspace, LONG)
        done(workspace, "start")
        until(lambda: bench.running is None and bench.status()["shape"] == "tripped", "the end of the run")
        assert "unplugged" in bench.session.why
        record = read_recording(tmp_path / bench.ended["file"])
        assert record.meta["events"][-1]["code"] == "lost_line" and len(record) > 500
        # another try ends with a sentence too, for the line is still gone
        done(workspace, "reset")
        until(lambda: bench.status()["shape"] == "tripped" and "serial" in bench.session.why, "the second try")


def test_a_machine_whose_process_ends_is_told_to_be_lost_and_can_be_had_again(at_rest):
    workspace, bench = at_rest
    os.kill(bench.session.process, signal.SIGKILL)
    until(lambda: bench.status()["shape"] == "tripped", "the trip")
    assert "the process that had the machine ended" in bench.session.why
    done(workspace, "reset")
    until(lambda: bench.session.ready, "by hand again")
    assert bench.status()["shape"] == "idle" and run(workspace, SHORT).meta["result"] == "done"


def test_when_nobody_is_in_control_a_real_machine_vents_after_5_s_of_its_own(at_rest):
    workspace, bench = at_rest
    done(workspace, "set", pressure="1 bar")
    until(lambda: bench.stream.latest().get("pressure", 0.0) > 0.9e5, "1 bar by hand")
    bench.control_lost()
    until(lambda: bench.stream.latest()["pressure"] < 5e3, "vented")
    bench.status()  # as a page asks for it
    assert any("nobody is in control" in m["text"] for m in bench.log(0))


def test_a_machine_that_is_not_there_is_refused_before_anything_is_made_ready(capsys):
    from mckibben.cli import main

    for words, said in ((("--on", "serial:/dev/nothing-there"), "nothing-there"), (("--lock-step",), "--on")):
        with pytest.raises(SystemExit) as stop:
            main(["serve", "--no-open", "--port", "0", *words])
        err = capsys.readouterr().err
        assert stop.value.code == 2 and err.count("\n") == 1 and said in err, err
