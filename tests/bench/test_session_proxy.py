"""A session in a separate process: it answers, records and refuses as one in the process of its user."""

import contextlib
import os
import pickle
import socket
import threading
import time
from types import SimpleNamespace

import numpy as np
import pytest
from short_runs import paper

from mckibben.bench.console import Console
from mckibben.bench.prepare import PreparedRun
from mckibben.bench.protocol_run import RunState
from mckibben.bench.rig_file import rig
from mckibben.bench.sample_loop import Lateness
from mckibben.bench.session import Session
from mckibben.bench.session.interface import CLOSED, IDLE, LOST, Messages, Status
from mckibben.bench.session.proxy import ENDED, NOBODY, SessionProxy, SessionServer
from mckibben.bench.software.interlocks import EmergencyStop
from mckibben.errors import EngineError, InputError, LineLostError, MckibbenError
from mckibben.recordings import Channel, Recording

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


def test_a_machine_that_no_backend_opens_is_refused_by_its_name():
    with pytest.raises(InputError, match="radio"), SessionProxy("radio", paper(), "nylon"):
        pass


@pytest.mark.parametrize(
    "error", [InputError("span", 3.0, "must be less", where="a.toml"), EngineError("no such operation")]
)
def test_an_error_goes_whole_from_one_process_to_another(error):
    found = pickle.loads(pickle.dumps(error))
    assert type(found) is type(error) and str(found) == str(error) and vars(found) == vars(error)


@pytest.mark.parametrize(
    ("ready", "lost", "pressed", "why"),
    [
        (False, "", False, ""),
        (False, "", True, "emergency stop: Esc"),
        (False, "it ended", True, "it ended"),
        (True, "", False, "asked why"),
        (True, "", True, "asked why"),
        (True, "it ended", False, "it ended"),
    ],
)
def test_a_stop_has_the_reason_of_the_button_until_the_machine_is_there_to_say_its_own(ready, lost, pressed, why):
    button = EmergencyStop()
    if pressed:
        button.press("Esc")
    proxy = SimpleNamespace(
        ready=ready, _lost=lost, _closed=False, button=button, ask=lambda what, otherwise: f"asked {what}"
    )
    assert SessionProxy.why.fget(proxy) == why
    assert SessionProxy.gone.fget(proxy) == (LOST if lost else "asked gone")
    proxy._closed = True
    assert SessionProxy.gone.fget(proxy) == (CLOSED if lost else "asked gone")
    proxy.ask = lambda what, otherwise: otherwise
    assert SessionProxy.gone.fget(proxy) == (CLOSED if lost or ready else "")


class Spoken:
    """A session that says what it is asked, and a run that asks, tells and may lose its log."""

    period, busy, why, gone = 0.01, True, "", ""

    def __init__(self):
        self.calls, self.button, self.run_events = [], EmergencyStop(), [{"code": "log"}]
        self.answered = []

    def status(self):
        return Status("manual", "", 2.5, {"pressure": 1e5}, {}, Lateness.of(np.zeros(0), 1.0))

    def latest(self):
        return {"time": 2.5, "pressure": 1e5}

    def since(self, at):
        return np.array([at + 1.0]), {"pressure": np.array([1e5])}

    def messages(self, after=0):
        return []

    def set(self, **wanted):
        if "tension" in wanted:
            raise InputError("tension", 9.0, "must be less")
        self.calls.append(("set", wanted))

    def vent(self):
        raise ZeroDivisionError("no valve")

    def emergency_stop(self, reason):
        self.calls.append(("emergency_stop", reason))

    def reset(self):
        self.calls.append("reset")

    def start_recording(self, log):
        self.calls.append(("record", log))

    def close(self):
        self.calls.append("close")

    def run(self, prepared, *, begun, progress, ask, log, new_machine):
        self.calls.append(("run", type(prepared), new_machine))
        begun(RunState(time=0.5, events=self.run_events))
        progress("half")
        try:
            ask("hold it")
            self.answered.append(None)
        except MckibbenError as error:
            self.answered.append(str(error))
        return Recording(np.arange(3.0), {"pressure": Channel(np.zeros(3), "Pa")})


def cut(line):
    """End a line at both of its ends, as a process that ends does."""
    with contextlib.suppress(OSError), socket.socket(fileno=os.dup(line.fileno())) as end:
        end.shutdown(socket.SHUT_RDWR)


@contextlib.contextmanager
def spoken():
    """The two ends of the line in one process: a proxy, and the server of a session that does nothing."""
    session = Spoken()
    proxy = SessionProxy(None, rig("modern"), "nylon", by_hand=False, messages=Messages())
    server, proxy._other = SessionServer(proxy._other), SimpleNamespace(close=lambda: None)

    def serve():
        server.serve(session)
        cut(server.line)

    thread = threading.Thread(target=serve, daemon=True)
    proxy._process = SimpleNamespace(start=thread.start, pid=None)
    proxy.make_ready()
    try:
        yield proxy, session, server
    finally:
        proxy.close()
        thread.join(5.0)


def soon(what):
    """Wait until something is so."""
    end = time.monotonic() + 5.0
    while not what() and time.monotonic() < end:
        time.sleep(1e-3)
    return what()


def test_what_a_session_answers_says_and_refuses_goes_over_the_line_until_it_is_closed():
    with spoken() as (proxy, session, server):
        assert proxy.ready and proxy.period == 0.01 and proxy.simulated and proxy.process is None
        assert (proxy.busy, proxy.why, proxy.gone, proxy.latest()["pressure"]) == (True, "", "", 1e5)
        assert proxy.since(3.0)[0].tolist() == [4.0] and proxy.status().state == "manual"
        proxy.set(pressure=2e5)
        with pytest.raises(InputError, match="tension must be less, got 9"):
            proxy.set(tension=9.0)
        with pytest.raises(MckibbenError, match="^ZeroDivisionError: no valve$"):
            proxy.vent()
        proxy.start_recording()
        proxy.start_recording("x.mcap")
        messages = Messages(lambda message: server.say(0, "message", message))
        messages.say("It moves.", 1.5, "caution")
        assert soon(proxy.messages)
        (said,) = proxy.messages()
        assert (said.time, said.kind, said.text) == (1.5, "caution", "It moves.") and proxy.messages(said.number) == []
        proxy.emergency_stop("Esc")
        assert soon(session.button) and session.button.reason == proxy.button.reason == "Esc"
        pressed = proxy.button
        proxy.reset()
        assert proxy.button is not pressed and not proxy.button()
        assert soon(lambda: len(session.calls) == 5)
        assert session.calls[:2] == [("set", {"pressure": 2e5}), ("record", None)]
        kind, path = session.calls[2]
        assert kind == "record" and path.endswith("/x.mcap") and path.startswith("/")
        assert sorted(map(str, session.calls[3:])) == ["('emergency_stop', 'Esc')", "reset"]
    assert session.calls[-1] == "close" and soon(lambda: bool(proxy._lost)) and proxy.gone == CLOSED
    assert (proxy.busy, proxy.latest(), proxy.since(0.0)[0].tolist(), proxy.since(0.0)[1]) == (False, {}, [], {})
    assert (proxy.status().state, proxy.status().time) == (CLOSED, 2.5)
    with pytest.raises(LineLostError, match="released"):
        proxy.set(pressure=1e5)
    assert all(one.kind != "stop" for one in proxy._messages.after(0)), "whoever closes it knows"


@pytest.mark.parametrize("refused", [False, True])
def test_a_run_on_the_line_tells_asks_and_gives_what_the_log_did_not_take(refused):
    heard = []

    def ask(what):
        heard.append(what)
        if refused:
            raise MckibbenError("nobody is here")

    with spoken() as (proxy, session, _):
        prepared, before = object.__new__(PreparedRun), proxy.button
        record = proxy.run(prepared, begun=lambda state: heard.append(state.time), progress=heard.append, ask=ask)
        assert len(record.time) == 3 and heard == [0.5, "half", "hold it"]
        assert session.answered == ["nobody is here" if refused else None]
        assert session.calls == [("run", PreparedRun, False)] and proxy.button is before
        proxy.run(prepared, new_machine=True, progress=heard.append, ask=ask, begun=None)
        assert session.calls[-1] == ("run", PreparedRun, True) and proxy.button is not before
        with pytest.raises(InputError, match="clock must be left out"):
            proxy.run(prepared, clock=object())
        session.run_events = []  # the log took all, and here none was written
        with pytest.raises(InputError, match="run.mcap"):
            proxy.run(prepared, progress=heard.append, ask=ask)


def test_a_program_that_ends_stops_the_machine_and_a_machine_that_ends_is_lost():
    with spoken() as (proxy, session, server):
        cut(server.line)
        assert soon(session.button) and "program that operated the machine ended" in session.button.reason
        assert str(server._answers.get(timeout=5.0)) == NOBODY
        assert soon(lambda: bool(proxy._lost)) and proxy.gone == LOST and proxy.why == ENDED
        assert [(one.kind, one.text) for one in proxy._messages.after(0)] == [("stop", ENDED)]
        assert proxy.status().state == LOST != IDLE
