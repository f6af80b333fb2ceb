"""What a session decides of itself, beside stand-ins for its machine and its loop: no sample is computed here."""

import time
from types import SimpleNamespace

import numpy as np
import pytest

from mckibben.bench.rig_file import rig
from mckibben.bench.sample_loop import Lateness
from mckibben.bench.session import Session
from mckibben.bench.session.continued import EXACT, LONG, LOOK, NEAR, SETTLE, SPAN_TOLERANCE, Arrival, ContinuedMachine
from mckibben.bench.session.interface import (
    CLOSED,
    IDLE,
    LOST,
    MANUAL,
    MODES,
    RUNNING,
    STOPPED,
    ManualSetup,
    Messages,
    SampleRing,
    Status,
    session_rate,
)
from mckibben.bench.session.session import LONGEST, STEP_OF_TIME, VENTED
from mckibben.bench.software.interlocks import EmergencyStop
from mckibben.bench.software.sequencer import SPAN, TENSION, VELOCITY
from mckibben.errors import InputError, LineLostError

RIG = rig("modern")
PERIOD = 0.01


class Points(dict):
    """Set-points that can be looked at."""

    def change(self, **values):
        self.update(values)


class Loop:
    """A loop by hand that does nothing, and says what it was told."""

    def __init__(self, **facts):
        self.calls, self.alive, self.kept, self.pending = [], True, 0, False
        self.lost = self.failed = None
        self.halted, self.opened, self.motor = False, True, (SPAN, 0.13)
        vars(self).update(facts)

    def __getattr__(self, name):
        def call(*arguments, **named):
            self.calls.append((name, *arguments, *named))
            return self if name == "leave" else 2e5

        return call


@pytest.fixture
def session():
    """A session without a machine, made ready with stand-ins."""
    one = Session(RIG, by_hand=False, speed=4.0)
    one._setpoints, one._loop, one._ring = Points(pressure=2e5, mode=float(SPAN)), Loop(), SampleRing(10)
    one._setup = SimpleNamespace(amount=lambda name, value: float(value), manual=SimpleNamespace(hold=1.0))
    one.machine, one.period, one.ready = SimpleNamespace(number=150, mark=None), PERIOD, True
    yield one
    one.ready = False


@pytest.mark.parametrize(
    ("gone", "run", "why", "used", "state"),
    [
        ("", None, "", False, IDLE),
        ("", None, "", True, MANUAL),
        ("", None, "tripped", True, STOPPED),
        ("", "a run", "tripped", True, RUNNING),
        (LOST, "a run", "tripped", True, LOST),
        (CLOSED, None, "", False, CLOSED),
    ],
)
def test_the_state_is_the_first_of_gone_running_stopped_manual_and_idle(session, gone, run, why, used, state):
    session._gone, session._run, session._why, session._used = gone, run, why, used
    assert session._state() == state and session.gone == gone and session.why == why
    session._run = None
    assert session.status().state == (gone or (STOPPED if why else MANUAL if used else IDLE))


def test_a_session_is_busy_while_it_is_used_or_under_pressure(session):
    assert not session.busy and session.latest() == {}
    for pressure, busy in ((0.5 * VENTED, False), (VENTED, False), (1.5 * VENTED, True)):
        session._ring.add(np.array([1.0]), {"pressure": np.array([pressure])})
        assert session.busy is busy
    session._ring.add(np.array([2.0]), {"pressure": np.array([0.0])})
    session._used = True
    assert session.busy


def test_only_an_emergency_is_a_reason_and_the_reason_of_the_samples_comes_before_that_of_the_button(session):
    session.button.press("enough", ordinary=True)
    assert session.why == ""
    session.button.press("Esc")
    assert session.why == "Esc"
    session._why = "pressure above 9 bar"
    assert session.why == "pressure above 9 bar"
    for action in (lambda: session.set(pressure=1e5), session.vent):
        with pytest.raises(InputError, match="the machine is stopped .pressure above 9 bar.; reset it first"):
            action()


def test_a_reset_is_allowed_after_a_stop_while_nothing_runs_and_begins_with_what_comes(session):
    with pytest.raises(InputError, match="allowed only after a stop"):
        session.reset()
    session._why, session._run = "tripped", "a run"
    with pytest.raises(InputError, match="while nothing runs"):
        session.reset()
    session._run, button = None, session.button
    session.wait = lambda seconds: session.messages()
    session.reset()
    assert session.why == "" and session.button is not button and session._first_news == 151
    assert session._setpoints["pressure"] == 0.0 and ("renew",) in session._loop.calls
    (said,) = session.messages()
    assert (said.text, said.kind, said.time) == ("reset", "note", pytest.approx(150 * PERIOD))


def test_what_is_asked_for_by_hand_changes_what_is_named_and_nothing_else(session):
    session._alone = True
    session.ask_for(pressure=1e5)
    assert session._setpoints == {"pressure": 1e5, "mode": SPAN, "alone": 0.0} and session._used and not session._alone
    for name, mode in MODES.items():
        session.ask_for(**{name: 0.5})
        assert (session._setpoints["mode"], session._setpoints["motor"], session._setpoints["pressure"]) == (
            mode,
            0.5,
            1e5,
        )
    with pytest.raises(InputError, match="Unknown set-point 'presure'. Did you mean 'pressure'"):
        session.ask_for(presure=1.0)
    first, second = list(MODES)[:2]
    with pytest.raises(InputError, match=f"{second} is .*the motor controls one thing, and that is {first}"):
        session.ask_for(**{first: 0.1, second: 0.2})


@pytest.mark.parametrize("mode", [SPAN, TENSION, VELOCITY])
def test_vent_ends_a_velocity_and_leaves_what_holds(session, mode):
    session._setpoints.update(mode=float(mode), motor=0.3)
    session._used = True
    session.vent()
    assert (session._setpoints["pressure"], session._setpoints["open"], session._used) == (0.0, 1.0, False)
    if mode == VELOCITY:
        assert session._setpoints["mode"] == SPAN and np.isnan(session._setpoints["motor"])
    else:
        assert (session._setpoints["mode"], session._setpoints["motor"]) == (mode, 0.3)


@pytest.mark.parametrize("rests", [False, True])
def test_alone_a_machine_that_rests_goes_by_the_wall_clock_and_takes_its_speed_up_again(session, rests):
    session._rests = rests
    begin = time.monotonic()
    session.control_lost()
    assert session._alone and session._setpoints["alone"] == 1.0 and begin <= session._since_alone <= time.monotonic()
    assert session.clock.speed == (1.0 if rests else 4.0)
    session.set_speed(8.0)
    assert session.clock.speed == (1.0 if rests else 4.0), "while alone the new speed waits"
    session.control_back()
    assert not session._alone and session._setpoints["alone"] == 0.0
    assert session.clock.speed == (8.0 if rests else 4.0)
    session.set_speed(2.0)
    assert session.clock.speed == 2.0
    session._given = SimpleNamespace(state=lambda: None)
    with pytest.raises(InputError, match="a real machine has its own time"):
        session.set_speed(3.0)


def test_the_first_loss_is_the_reason_and_is_said_once(session):
    session._ended_by_hand(Loop())
    assert session.gone == "" and session.messages() == []
    session._ended_by_hand(Loop(failed=ValueError()))
    session._lose(LineLostError("later"))
    assert (session.gone, session.why) == (LOST, "ValueError")
    assert [(one.kind, one.text) for one in session.messages()] == [("stop", "ValueError")]
    with pytest.raises(InputError, match="the machine is lost: ValueError"):
        session.set(pressure=1e5)


@pytest.mark.parametrize(("mode", "value"), [(SPAN, 0.13), (VELOCITY, 0.2), (TENSION, 40.0)])
@pytest.mark.parametrize("halted", [False, True])
def test_after_a_run_a_tension_is_held_and_the_motor_stays_where_it_is_else(session, mode, value, halted):
    after = Loop(motor=(mode, value), halted=halted, opened=False)
    session.resume(after)
    held = session._setpoints
    if halted:
        assert (held["pressure"], held["open"], held["mode"], session._used) == (0.0, 1.0, SPAN, False)
    else:
        assert (held["pressure"], held["open"], session._used) == (2e5, 0.0, True)
    if mode == TENSION and not halted:
        assert (held["mode"], held["motor"]) == (TENSION, value)
    else:
        assert held["mode"] == SPAN and np.isnan(held["motor"])
    assert session._loop.calls == [("start", "after")]
    session.resume(Loop(lost=LineLostError("cut")))
    assert (session.gone, session.why) == (LOST, "cut") and session._loop.calls == [("start", "after")]


def test_a_loop_is_lent_with_its_last_samples_and_not_by_a_machine_that_is_gone(session):
    loop = session._loop
    assert session.lend("of a run") is loop and session._run_loop == "of a run"
    assert loop.calls == [("leave",), ("chunk",)]
    session._gone, session._why = LOST, ""
    with pytest.raises(LineLostError, match=f"^{LOST}$"):
        session.lend("of another")
    session._why = "cut"
    with pytest.raises(LineLostError, match="^cut$"):
        session.lend("of another")


def ended(code=None, result="stopped", ordinary=False):
    button = EmergencyStop()
    button.press("Esc", ordinary=ordinary)
    stop = None if code is None else {"code": code, "time": 1.5}
    state = SimpleNamespace(stop=stop, result=result, message="It ended.", time=2.5)
    return SimpleNamespace(stop=button, state=state, prepared=SimpleNamespace(protocol=SimpleNamespace(name="p")))


@pytest.mark.parametrize(
    ("run", "new_machine", "recorded", "why", "said"),
    [
        (ended(result="done"), False, True, "", [("done", "p: It ended.", 1.5)]),
        (ended("stop"), False, True, "It ended.", [("stop", "p: It ended.", 1.5)]),
        (ended("stop", ordinary=True), False, True, "", [("stop", "p: It ended.", 1.5), ("note", "reset", 1.5)]),
        (ended("pressure", ordinary=True), False, True, "It ended.", [("stop", "p: It ended.", 1.5)]),
        (ended("stop"), False, False, "", []),
        (ended("pressure"), True, True, "It ended.", [("stop", "It ended.", 1.5)]),
        (ended(), True, False, "It ended.", [("stop", "It ended.", 2.5)]),
        (ended("stop", ordinary=True), True, True, "", []),
        (ended(result="done"), True, True, "", []),
    ],
)
def test_a_run_that_was_stopped_leaves_its_reason_unless_its_user_ended_it(
    session, run, new_machine, recorded, why, said
):
    session.wait = lambda seconds: None
    session._settle(run, new_machine, recorded)
    assert session.why == why
    assert [(one.kind, one.text, pytest.approx(one.time)) for one in session.messages()] == said


def test_a_reason_that_was_told_is_not_told_again(session):
    session._why = "pressure above 9 bar"
    for new_machine in (False, True):
        session._settle(ended("pressure"), new_machine, True)
        assert session.why == "pressure above 9 bar" and session.messages() == []


def test_between_two_samples_is_at_once_where_no_sample_comes(session):
    numbers = []
    session._gone = LOST
    session._between(numbers.append)
    session._gone = ""
    session.clock.halt()
    session._between(numbers.append)
    session.clock.halt(False)

    class Marked(SimpleNamespace):
        """A machine whose next sample comes as soon as it is marked."""

        def __setattr__(self, name, value):
            super().__setattr__(name, value)
            if name == "mark":
                value(151)

    session.machine = Marked(number=150)
    session._between(numbers.append)
    assert numbers == [150, 150, 151]


def machine_at(**latest):
    """A session whose newest sample is stated, and that keeps what is asked of it."""
    one = SimpleNamespace(now=dict(latest), asked=[], notes=[], waited=[], why="")
    one.latest, one.note = lambda: dict(one.now), one.notes.append
    one.setup = SimpleNamespace(
        allowed=lambda name: {"pressure": (-1e5, 8e5), "span": (0.1, 0.2)}.get(name, (-2.0, 1.0))
    )

    def ask_for(**wanted):
        one.asked.append(wanted)
        one.now.update({f"command.{name}": value for name, value in wanted.items()}, **wanted)

    one.ask_for, one.wait = ask_for, one.waited.append
    return one


@pytest.mark.parametrize(
    ("goals", "off", "arrived"),
    [
        ({"pressure": 4e5}, {}, True),
        ({"pressure": 4e5}, {"pressure": 4e5 + 0.9 * NEAR * 8e5}, True),
        ({"pressure": 4e5}, {"pressure": 4e5 - 1.1 * NEAR * 8e5}, False),
        ({"pressure": 4e5}, {"command.pressure": 4e5 + 0.9 * EXACT * 8e5}, True),
        ({"pressure": 4e5}, {"command.pressure": 4e5 - 1.1 * EXACT * 8e5}, False),
        ({"span": 0.13}, {"span": 0.13 + 0.9 * SPAN_TOLERANCE}, True),
        ({"span": 0.13}, {"span": 0.13 + 1.1 * SPAN_TOLERANCE}, False),
        ({"velocity": 0.5}, {"velocity": -7.0}, True),
        ({"pressure": 4e5, "span": 0.13}, {"span": 0.14}, False),
    ],
)
def test_what_was_asked_for_has_arrived_where_set_points_are_there_exactly_and_channels_nearly(goals, off, arrived):
    at = goals | {f"command.{name}": value for name, value in goals.items()} | off
    look = Arrival(machine_at(**at), **goals)
    assert look.arrived() is arrived and look.apart == [n for n in goals if n in off and not arrived]


@pytest.mark.parametrize("moving", [False, True])
def test_set_points_that_stand_still_short_of_their_goal_are_stuck_after_a_while(moving):
    machine = machine_at(pressure=1e5, **{"command.pressure": 1e5})
    look, looks = Arrival(machine, pressure=4e5), 0
    while not look.stuck and looks < 3 * LONG / LOOK:
        looks += 1
        machine.now["command.pressure"] += 1.0 if moving else 0.0
        assert not look.arrived()
    # the first look knows no set-point before it
    assert look.stuck is not moving and (moving or abs(looks - LONG / LOOK) <= 1.5)


def continued(session, *, motor=True):
    one = object.__new__(ContinuedMachine)
    one.session, one._zero = session, 0
    one.prepared = SimpleNamespace(rig=SimpleNamespace(motor=motor or None), protocol=SimpleNamespace(name="p"))
    read = lambda spans: {"span": spans["span"] * 1e-3 + 0.05}  # noqa: E731
    session.setup.converters = SimpleNamespace(encoder=True, read=read)
    return one


SEGMENT = SimpleNamespace(start_pressure=3e5, start_span=0.13)


@pytest.mark.parametrize("motor", [False, True])
def test_a_machine_goes_down_along_and_up_to_where_a_protocol_begins(motor):
    session = machine_at(pressure=5e5, span=0.12, **{"command.pressure": 5e5, "command.span": 0.12})
    continued(session, motor=motor).bring(SEGMENT)
    if motor:
        assert session.asked == [{"pressure": 3e5}, {"pressure": 3e5, "span": 0.13}, {"pressure": 3e5, "span": 0.13}]
    else:
        assert session.asked == 3 * [{"pressure": 3e5}]
    assert session.notes == ["going to where p begins"] and session.waited[-1] == SETTLE
    low = machine_at(pressure=1e5, span=0.12, **{"command.pressure": 1e5, "command.span": 0.12})
    continued(low).bring(SEGMENT)
    assert [one["pressure"] for one in low.asked] == [1e5, 1e5, 3e5], "it is filled last"


@pytest.mark.parametrize(
    ("pressure", "span", "motor", "stays"),
    [(3e5, 0.13, True, True), (3e5 + 2.0, 0.13, True, False), (3e5, 0.1301, True, False), (3e5, 0.1301, False, True)],
)
def test_a_machine_that_is_where_a_protocol_begins_stays_there(pressure, span, motor, stays):
    at = {"command.pressure": pressure, "command.span": span}
    session = machine_at(pressure=pressure, span=span, **at)
    one = continued(session, motor=motor)
    one.bring(SEGMENT)
    assert (session.asked == []) is stays
    assert one._zero == 80  # of counts of 1 mm, the one at 0.05 m is none


def test_what_keeps_a_machine_from_where_a_protocol_begins_is_said():
    session = machine_at(pressure=5e5, span=0.12, **{"command.pressure": 5e5, "command.span": 0.12})
    session.ask_for = lambda **wanted: session.now.update({f"command.{name}": value for name, value in wanted.items()})
    with pytest.raises(InputError, match="pressure is 5 bar: the protocol begins at 3 bar, which was not reached"):
        continued(session).bring(SEGMENT)
    session.why = "tripped"
    with pytest.raises(InputError, match="on the way to its beginning: tripped"):
        continued(session).bring(SEGMENT)


def test_by_hand_a_rig_allows_what_its_weakest_part_does():
    setup = object.__new__(ManualSetup)
    setup.rig = SimpleNamespace(name="r", motor=object())
    setup.prepared = SimpleNamespace(plan=SimpleNamespace(rest_length=0.14))
    setup.manual, setup.watch = SimpleNamespace(speed=0.3), SimpleNamespace(most_tension=80.0)
    limits = {"pressure": (0.0, 7e5), "burst_pressure": 8e5, "span": (0.1, 0.2), "tension": 100.0, "motor_force": 90.0}
    setup.limits = SimpleNamespace(**limits)
    allowed = {name: setup.allowed(name) for name in ("pressure", "span", "velocity", "tension")}
    assert allowed == {"pressure": (0.0, 7e5), "span": (0.1, 0.2), "velocity": (-0.3, 0.3), "tension": (0.0, 80.0)}
    for weakest in ("burst_pressure", "motor_force", "tension"):
        setup.limits = SimpleNamespace(**limits | {weakest: 20.0})
        assert setup.allowed("pressure" if weakest == "burst_pressure" else "tension") == (0.0, 20.0)
    setup.limits = SimpleNamespace(**limits)
    assert setup.amount("span", "1 L0") == pytest.approx(0.14) and setup.amount("pressure", 7e5) == 7e5
    for name, value in (("pressure", 7.1e5), ("pressure", -1.0), ("span", "21 cm")):
        with pytest.raises(InputError, match="the rig r allows .* to .* by hand"):
            setup.amount(name, value)
    setup.rig.motor = None
    assert setup.amount("pressure", "2 bar") == pytest.approx(2e5)
    with pytest.raises(InputError, match="the rig r has no motor"):
        setup.amount("span", 0.14)


def test_a_stop_before_the_machine_is_there_is_its_reason_and_is_said_once_without_a_time():
    one = Session(RIG, by_hand=False)
    one.emergency_stop("Esc")
    one.emergency_stop("again")
    assert one.why == "emergency stop at 0 s: Esc; stopped and vented"
    assert [(said.time, said.kind, said.text) for said in one.messages()] == [(None, "stop", one.why)]
    running = Session(RIG, by_hand=False)
    running._run = "a run"  # which says itself why it was stopped
    running.emergency_stop("Esc")
    assert running._why == "" and running.why == "Esc" and running.messages() == []


@pytest.mark.parametrize(
    ("speed", "hardware", "rests", "halted", "resting"),
    [
        (None, None, False, True, False),
        (None, None, True, True, False),
        (1.0, None, False, False, False),
        (1.0, None, True, True, True),
        (None, "a real one", True, False, False),
    ],
)
def test_a_machine_stands_still_at_first_where_it_rests_or_goes_only_while_somebody_waits(
    speed, hardware, rests, halted, resting
):
    one = Session(RIG, hardware=hardware and SimpleNamespace(), by_hand=False, speed=speed, rests=rests)
    assert (one.clock.halted, one._rests, one._stepped) == (halted, resting, speed is None and hardware is None)
    assert one.clock._grain == (0.004 if resting else 0.0)


@pytest.mark.parametrize(("seconds", "steps"), [(0.25, [10, 10, 5]), (0.0, [1]), (0.004, [1]), (0.1, [10])])
def test_a_machine_whose_time_goes_while_somebody_waits_goes_on_by_as_many_samples_and_by_short_looks(
    session, seconds, steps
):
    assert STEP_OF_TIME == 0.1 and PERIOD == 0.01
    advances = []

    class Stepped(SimpleNamespace):
        def advance(self, until):
            advances.append(until - self.count)
            session.machine.number += until - self.count
            self.count = until

    session.clock, session._stepped = Stepped(count=7, halted=True), True
    session.wait(seconds)
    assert advances == steps
    advances.clear()
    session._collect = lambda: setattr(session, "_why", "tripped")
    session.wait(1.0)
    assert advances == [10], "a stop ends the wait"


@pytest.mark.parametrize(("leak", "waits"), [(0.0, 30), (2e5, 2), (9e9, 1)])
def test_a_session_that_closes_vents_for_a_while_ends_its_recording_and_releases_the_machine(session, leak, waits):
    pressure, calls = [3e5], []

    def wait(seconds):
        calls.append(seconds)
        pressure[0] -= leak

    session.latest, session.wait = lambda: {"pressure": pressure[0]}, wait
    session.machine.hardware = SimpleNamespace(close=lambda: calls.append("released"))
    session._recording, session.stop_recording = object(), lambda: calls.append("recorded")
    session._collect = lambda: None
    session.close()
    assert abs(len(calls) - 2 - waits) <= 1 and set(calls[:-2]) == {0.1}  # rounding of thirty tenths
    assert LONGEST == 3.0 and calls[-2:] == ["recorded", "released"] and session.gone == CLOSED
    assert session._loop.calls[-1] == ("leave",) and session._setpoints["pressure"] == 0.0
    session.close()
    assert calls.count("released") == 1


def test_a_session_that_is_closed_during_a_run_presses_its_button_first():
    one = Session(RIG, by_hand=False)
    one._run = "a run"
    one.close()
    assert one.button() and one.button.reason == "the session was closed" and one.gone == CLOSED


def test_a_status_shows_set_points_that_are_held_and_none_of_a_machine_that_was_stopped(session):
    session._loop.deadlines = lambda: LATE
    run = SimpleNamespace(
        prepared=SimpleNamespace(protocol=SimpleNamespace(name="p"), plan=SimpleNamespace(duration=9.0)),
        state=SimpleNamespace(time=2.0),
    )
    at = {"pressure": 1e5, "span": 0.12, "command.pressure": 2e5, "command.span": 0.13, "command.tension": np.nan}
    session._ring.add(np.array([1.5]), {name: np.array([value]) for name, value in at.items()})
    status = session.status()
    assert status.set_points == {"pressure": 2e5, "span": 0.13} and status.time == 1.5
    assert status.measured == {"pressure": 1e5, "span": 0.12} and (status.protocol, status.recorded) == (None, None)
    session._run, session._recording = run, SimpleNamespace(time=0.5)
    assert session.status().protocol == ("p", 2.0, 9.0) and session.status().recorded == 0.5
    session._run = session._recording = None
    session.rig = SimpleNamespace(motor=None)
    assert session.status().set_points == {"pressure": 2e5}
    session._why = "tripped"
    assert session.status().set_points == {}


LATE = Lateness.of(np.array([0.0, 2e-3, 2e-3, 5e-3]), 0.01)


def test_a_status_says_what_it_does_what_is_measured_and_what_was_asked_for():
    status = Status(MANUAL, "", 12.25, {"pressure": 1e5, "span": 0.12}, {"pressure": 2e5, "velocity": 0.5}, LATE)
    assert status.line() == f"{MANUAL}  pressure 1 bar  span 12 cm  12.2 s"
    first, pressure, span, velocity, last = status.lines()
    assert first == MANUAL and pressure.split() == ["pressure", "1", "bar", "set-point", "2", "bar"]
    assert span.split() == ["span", "12", "cm"] and velocity.split()[:2] == ["velocity", "set-point"]
    assert last == "12.250 s; 4 samples by hand, half of them late by 2 ms or more, the latest by 5 ms"
    stopped = Status(STOPPED, "Esc", 1.0, {}, {}, Lateness.of(np.zeros(3), 0.01), recorded=0.5)
    assert stopped.lines() == [f"{STOPPED}, recording 0.5 s: Esc", "1.000 s; 3 samples by hand"]
    running = Status(RUNNING, "", 1.0, {}, {}, LATE, protocol=("p", 2.0, 9.0), recorded=0.5)
    assert running.doing() == f"{RUNNING} p 2.0 s of 9.0 s"
    plain = running.plain()
    assert plain["protocol"] == ["p", 2.0, 9.0] and plain["deadlines"]["samples"] == 4
    assert status.plain()["protocol"] is None and plain["recorded"] == 0.5


def test_messages_are_numbered_from_one_told_to_their_listener_and_the_newest_are_kept(monkeypatch):
    monkeypatch.setattr("mckibben.bench.session.interface.REMEMBERED", 3)
    told = []
    messages = Messages(told.append)
    for text in "abcd":
        messages.say(text, 1.0, "done")
    messages.say("e")
    assert [(one.number, one.text) for one in messages.after(0)] == [(3, "c"), (4, "d"), (5, "e")]
    assert [one.number for one in messages.after(4)] == [5] and [one.text for one in told] == list("abcde")
    assert (told[0].time, told[0].kind, told[4].time, told[4].kind) == (1.0, "done", None, "note")


@pytest.mark.parametrize(("low", "high", "rate"), [(1.0, 5e3, 1e3), (2e3, 5e3, 2e3), (1.0, 500.0, 500.0)])
def test_by_hand_a_machine_is_sampled_a_thousand_times_a_second_where_its_computer_can(low, high, rate):
    computer = SimpleNamespace(lowest_rate=low, highest_rate=high)
    assert session_rate(SimpleNamespace(computer=computer)) == rate
