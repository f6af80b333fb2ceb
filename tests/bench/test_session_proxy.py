"""A session in a separate process: it answers, records and refuses as one in the process of its user."""

import pickle
from types import SimpleNamespace

import numpy as np
import pytest
from short_runs import paper

from mckibben.bench.console import Console
from mckibben.bench.session import Session
from mckibben.bench.session.interface import CLOSED, LOST
from mckibben.bench.session.proxy import SessionProxy
from mckibben.bench.software.interlocks import EmergencyStop
from mckibben.errors import EngineError, InputError

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
