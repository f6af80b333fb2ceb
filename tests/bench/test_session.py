"""A session: one machine that goes on, by hand and by protocols, from any thread; stops stay, and nothing jumps."""

import threading
from types import SimpleNamespace

import numpy as np
import pytest
from short_runs import bench, closes, paper

from mckibben.bench.hardware.simulated import Clock, SimulatedHardware
from mckibben.bench.protocol_run import RunState
from mckibben.bench.run import EmergencyStop, run
from mckibben.bench.segment import SegmentMachine, timing_of
from mckibben.bench.session import Session
from mckibben.bench.session.interface import SampleRing
from mckibben.errors import InputError, LineLostError
from mckibben.experiments.read import parse_protocol, protocol
from mckibben.recordings import read_any

HEAD = 'schema = 1\nname = "short"\ntitle = "Short"\n'
UP = 'pressure = { to = "2 bar", in = "0.5 s" }\nspan = { to = "13 cm", in = "0.5 s" }\n'
SHORT = HEAD + f'[[steps]]\n{UP}[[steps]]\nfor = "0.3 s"\n'  # it ends under pressure
TRIANGLE = protocol("isotonic-triangle", load="50 N", frequency="5 Hz", cycles=1)


@pytest.fixture(scope="module")
def opened():
    with Session(paper(), "nylon", speed=None) as session:
        yield session
    assert session.status().state == "closed"
    session.close()


@pytest.fixture
def machine(opened):
    """The one that all tests share, at rest and vented."""
    if opened.why:
        opened.reset()
    if opened.status().recorded is not None:
        opened.stop_recording()
    opened.set(pressure=0.0, span=0.14)
    opened.wait(2.5)
    opened.vent()
    return opened


def short():
    return parse_protocol(SHORT, where="short.toml")


def whole(session, act):
    """The recording of a session while something is done."""
    session.start_recording()
    act()
    return session.stop_recording()


def test_the_machine_goes_on_across_a_run_without_a_gap_or_a_jump(machine):
    runs = []

    def act():
        machine.set(pressure="1 bar", span="13.5 cm")
        machine.wait(1.5)
        runs.append(machine.run(short()))
        machine.wait(0.3)

    record, (ran,) = whole(machine, act), runs
    period = machine.period
    assert np.allclose(np.diff(record.time), period, rtol=1e-6) and "gaps" not in record.meta  # not a sample is missing
    assert ran.meta["result"] == "done" and len(ran) == 800
    begin = next(i for i in range(len(record)) if np.array_equal(record["tension"][i : i + 800], ran["tension"]))
    true = record["muscle.pressure"]
    assert np.array_equal(true[begin : begin + 800], ran["muscle.pressure"])
    # where the machine changes hands nothing moves more from sample to sample than it does around there anyway
    for name, room in (("muscle.pressure", 10.0), ("muscle.tension", 0.05), ("muscle.span", 1e-6)):
        steps = np.abs(np.diff(record[name]))
        for edge in (begin - 1, begin + 799):
            around = np.r_[steps[edge - 200 : edge - 2], steps[edge + 3 : edge + 200]]
            assert steps[edge - 2 : edge + 3].max() <= around.max() + room, (name, edge)


def test_afterwards_the_last_set_points_are_held_by_hand(machine):
    ran = machine.run(short())
    machine.wait(0.5)
    status = machine.status()
    assert status.state == "manual" and status.protocol is None
    assert status.set_points["pressure"] == pytest.approx(ran["command.pressure"][-1], abs=1e-6)
    assert status.set_points["span"] == pytest.approx(ran["command.span"][-1], abs=1e-9)
    assert status.measured["pressure"] == pytest.approx(2e5, abs=2 * 2667.0)  # two counts of 8 bits
    assert status.measured["span"] == pytest.approx(0.13, abs=2e-4)


@pytest.mark.slow
def test_a_run_of_a_session_is_told_like_any_other(machine, tmp_path):
    """The machine was brought to where the protocol begins, so only the last bits and the noise differ."""
    log = tmp_path / "run.mcap"
    machine.set(pressure="3 bar", span="12.5 cm")
    machine.wait(1.0)
    ours = machine.run(TRIANGLE, log=log)
    alone = run(bench(TRIANGLE), real_time=True)
    assert set(ours.meta) == set(alone.meta) | {"hardware"} and set(ours.channels) == set(alone.channels)
    assert ours.meta["digest"] == alone.meta["digest"] and ours.meta["steps"] == alone.meta["steps"]
    closes(ours)
    for name, room in (("pressure", 2e4), ("span", 2e-3), ("tension", 12.0)):
        # an unstable touch at the motor differs from one that is let go from rest; both follow the same set-points
        assert np.median(np.abs(ours[name] - alone[name])) < room, name
    kept = read_any(log).recording
    assert kept.meta["result"] == "done" and np.array_equal(kept["pressure"], ours["pressure"])
    saved = ours.save(tmp_path / "run.nc")
    assert read_any(saved).recording.meta["protocol"]["name"] == "isotonic-triangle"


def test_a_recording_by_hand_has_all_that_one_of_a_run_has(machine, tmp_path):
    log = tmp_path / "hand.mcap"
    machine.start_recording(log)
    machine.set(pressure="2 bar")
    machine.wait(0.5)
    machine.set(tension="15 N")
    machine.wait(0.5)
    record = machine.stop_recording()
    ran = machine.run(short())
    assert set(ran.meta) - set(record.meta) == {"hardware"} and set(ran.channels) == set(record.channels)
    assert len(record) == 1000 and record.time[0] == 0.0
    closes(record)
    assert [e["text"] for e in record.meta["events"]] == ["pressure 2 bar", "tension 15 N"]
    assert record.meta["events"][1]["time"] == pytest.approx(0.5, abs=2e-3)
    kept, saved = read_any(log).recording, read_any(record.save(tmp_path / "hand.nc")).recording
    for name in record.channels:
        assert np.array_equal(kept[name], record[name], equal_nan=True)
        assert np.array_equal(saved[name], record[name], equal_nan=True)
    assert kept.meta["result"] == saved.meta["result"] == "done"


def test_by_hand_the_set_points_never_exceed_the_rates_of_the_rig(machine):
    def act():
        for pressure, span in ((5e5, 0.12), (0.0, 0.15), (3e5, 0.13)):
            machine.set(pressure=pressure, span=span)
            machine.wait(0.4)

    record, hand = whole(machine, act), machine.setup.manual
    for name, rate in (("command.pressure", hand.pressure_rate), ("command.span", hand.speed)):
        fastest = np.abs(np.diff(record[name])).max() / machine.period
        assert 0.9 * float(rate) < fastest <= float(rate) * (1.0 + 1e-9), name
    assert machine.why == ""


def test_an_emergency_stop_vents_within_two_samples_and_stays_until_it_is_reset(machine):
    machine.set(pressure="3 bar", span="13 cm")
    machine.wait(1.2)
    machine.start_recording()
    machine.wait(0.05)
    machine.emergency_stop("by the test")
    record = machine.stop_recording()
    (event,) = [e for e in record.meta["events"] if e.get("code") == "emergency_stop"]
    assert "by the test; stopped and vented" in event["text"]
    valve = record["valve.command"]
    assert valve[49] > 2.9e5 and np.all(valve[51:] == 0.0)  # pressed after sample 49
    assert record["muscle.pressure"][-1] < 0.2 * record["muscle.pressure"][0]
    with pytest.raises(InputError, match="stopped .*by the test.*; reset it first"):
        machine.set(pressure="1 bar")
    with pytest.raises(InputError, match="reset it first"):
        machine.run(short())
    assert machine.status().state == "stopped" and machine.status().set_points == {}
    machine.reset()
    assert machine.status().state == "idle"
    machine.set(pressure="1 bar")
    machine.wait(1.0)
    assert machine.status().measured["pressure"] > 0.9e5


@pytest.mark.slow
def test_an_emergency_stop_ends_a_run_and_the_machine_stays_vented(machine):
    def show(times, _):
        if times[-1] > 0.3:
            machine.emergency_stop("during a run")

    text = HEAD + '[[steps]]\npressure = { to = "3 bar", in = "0.5 s" }\n[[steps]]\nfor = "4 s"\n'
    ran = machine.run(parse_protocol(text, where="t"), display=show)
    assert ran.meta["result"] == "stopped" and "during a run" in ran.meta["message"]
    when = ran.meta["events"][-1]["time"]
    assert np.all(ran["valve.command"][ran.time >= when] == 0.0)
    machine.wait(1.0)
    assert machine.status().state == "stopped" and machine.status().measured["pressure"] < 5e3
    assert [m.kind for m in machine.messages()[-1:]] == ["stop"]


def test_interlocks_trip_by_hand(machine):
    machine.set(pressure="5.5 bar", span="15.5 cm")  # more than the cell reads
    machine.wait(4.0)
    assert "lost tension" in machine.why and "stopped and vented" in machine.why
    assert machine.messages()[-1].text == machine.why
    machine.wait(0.5)
    assert machine.status().measured["pressure"] < 5e3


@pytest.mark.parametrize(("code", "stays"), [("over_pressure", True), ("log", True), ("stop", False)])
def test_a_stop_by_hand_while_an_interlock_vents_leaves_its_reason(machine, code, stays):
    ended = RunState(result="stopped", message="as it ended", events=[{"time": 1.0, "text": "", "code": code}])
    run = SimpleNamespace(stop=EmergencyStop(), state=ended, prepared=SimpleNamespace(protocol=short()))
    run.stop.press("by hand", ordinary=True)
    machine._why = "as it ended"
    machine._settle(run, False, True)
    assert machine.why == ("as it ended" if stays else "")


def test_after_a_hand_is_lost_set_points_are_held_and_then_it_vents(machine):
    machine.set(pressure="2 bar")
    machine.wait(1.0)
    machine.control_lost()
    machine.wait(4.5)
    assert machine.status().measured["pressure"] > 1.9e5
    machine.wait(1.5)
    assert machine.status().measured["pressure"] < 5e3 and "nobody is in control" in machine.messages()[-1].text
    machine.control_back()
    machine.wait(0.5)
    assert machine.status().set_points["pressure"] == 0.0 and machine.status().state == "idle"
    machine.set(pressure="1 bar")
    machine.wait(1.0)
    assert machine.status().measured["pressure"] > 0.9e5


REFUSED = {
    "pressure": ({"pressure": "8 bar"}, "allows 0 bar to 6.9 bar by hand"),
    "span": ({"span": "50 cm"}, "allows 5 cm to 40 cm"),
    "velocity": ({"velocity": "1 m/s"}, "by hand"),
    "tension": ({"tension": "-5 N"}, "allows 0 N to 100 N"),
    "unit": ({"pressure": "3 N"}, "such as '5 bar'"),
    "two": ({"span": "12 cm", "tension": "5 N"}, "the motor controls one thing"),
    "unknown": ({"presure": "3 bar"}, "Known are pressure"),
    "nan": ({"pressure": float("nan")}, "allows 0 bar"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_the_rig_does_not_allow_is_refused_and_changes_nothing(machine, case):
    wanted, said = REFUSED[case]
    before = machine.status()
    with pytest.raises(InputError, match=said):
        machine.set(**wanted)
    machine.wait(0.01)
    assert machine.status().set_points == before.set_points and machine.status().state == before.state


def test_a_protocol_that_the_machine_cannot_do_is_refused_before_anything_moves(machine):
    before = machine.machine.number
    for name, said in (
        ("leak-down", "needs is 'shut-off'"),
        ("isometric-step", "1000 Hz, at which the session samples"),
    ):
        with pytest.raises(InputError, match=said):
            machine.run(name)
    with pytest.raises(InputError, match="Did you mean 'quasi-static'"):
        machine.run("quasi-statik")
    assert machine.machine.number == before and machine.status().state == "idle"


@pytest.mark.slow
def test_a_protocol_with_a_slower_clock_runs_on_the_loop_of_the_session(machine):
    slow = parse_protocol(SHORT.replace("[[steps]]", 'sample_rate = "100 Hz"\n[[steps]]', 1), where="slow.toml")
    ran = machine.run(slow)
    assert len(ran) == 80 and ran.period == pytest.approx(0.01)
    assert ran.meta["timing"]["control_rate"] == pytest.approx(1000.0)


def test_displays_get_every_sample_once_and_memory_is_bounded(machine):
    last, shown = machine.latest()["time"], []
    for _ in range(5):
        machine.wait(0.1)
        times, arrays = machine.since(shown[-1][-1] if shown else last)
        shown.append(times)
        assert all(len(v) == len(times) for v in arrays.values())
    assert np.allclose(np.diff(np.concatenate(shown)), machine.period)
    assert len(np.concatenate(shown)) == 500


def test_the_ring_keeps_the_newest_samples():
    ring = SampleRing(10)
    for first in range(0, 35, 7):
        times = np.arange(first, first + 7, dtype=float)
        ring.add(times, {"a": 2.0 * times} if first != 14 else {"b": times})
    times, arrays = ring.since(-1.0)
    assert list(times) == list(range(25, 35)) and list(arrays["a"]) == [2.0 * t for t in range(25, 35)]
    assert ring.latest() == pytest.approx({"time": 34.0, "a": 68.0, "b": np.nan}, nan_ok=True)
    ring.add(np.arange(100.0, 125.0), {"a": np.arange(25.0)})
    assert list(ring.since(120.0)[0]) == [121.0, 122.0, 123.0, 124.0] and list(ring.since(0.0)[1]["a"])[-1] == 24.0


@pytest.mark.slow
def test_many_hands_at_once_break_nothing(machine):
    failed = []

    def watch():
        try:
            for _ in range(50):
                machine.status().line()
                machine.since(0.0)
                machine.messages()
                machine.set(pressure=float(np.random.default_rng().uniform(0.0, 1e5)))
        except Exception as error:
            failed.append(error)

    threads = [threading.Thread(target=watch) for _ in range(4)]
    for thread in threads:
        thread.start()
    machine.wait(0.5)
    for thread in threads:
        thread.join()
    assert failed == [] and machine.status().state == "manual"


class Lost(SimulatedHardware):
    """A machine whose line is lost at some sample."""

    def wait(self, sample):
        if sample == 400:
            raise LineLostError("line test: unplugged; it was told to vent")
        return super().wait(sample)


def test_a_lost_line_ends_the_session_and_says_so():
    prepared = bench("isotonic-triangle", load="50 N", frequency="5 Hz", cycles=1)
    (part,) = prepared.segments()
    hardware = Lost(SegmentMachine(prepared, 0, part, timing_of(prepared)).at_interface())
    with Session(paper(), "nylon", hardware) as session:
        session.wait(5.0)
        assert session.status().state == "lost" and "unplugged" in session.why and hardware.venting
        for act in (lambda: session.set(pressure="1 bar"), session.reset, session.vent):
            with pytest.raises(InputError, match="lost"):
                act()
    assert session.status().state == "closed"


@pytest.mark.slow
def test_by_the_wall_clock_a_session_keeps_time_and_vents_when_it_ends():
    with Session(paper(), "nylon", speed=2.0) as session:
        session.set(pressure="1 bar")
        session.wait(0.8)
        status = session.status()
        assert status.state == "manual" and status.deadlines.samples >= 800
        session.emergency_stop("soon")
        assert "soon" in session.why
        session.reset()
        session.set(pressure="1 bar")
        session.wait(0.6)
        assert session.status().measured["pressure"] > 0.5e5
    assert session.status().measured["pressure"] < 2e3 + 2667.0


def test_a_session_for_runs_only_refuses_to_be_operated_and_says_how_it_would_not():
    with Session(paper(), "nylon", by_hand=False) as session:
        for act in (
            lambda: session.set(pressure="1 bar"), session.vent, session.start_recording,
            session.control_lost, session.control_back, lambda: session.wait(0.1), lambda: session.prepare(short()),
            lambda: session.run(short()),
        ):  # fmt: skip
            with pytest.raises(InputError, match="opened for runs only; open it with by_hand=True"):
                act()
        assert session.latest() == {} and session.status().state == "idle" and not session.busy
        assert session.since(0.0)[1] == {} and session.messages() == []
        session.emergency_stop("before a run")
        assert session.why == "emergency stop at 0 s: before a run; stopped and vented"
        assert [one.text for one in session.messages()] == [session.why]
        with pytest.raises(InputError, match="before a run.*reset it first"):
            session.run(bench(short()), new_machine=True)
        session.reset()
        record = session.run(
            bench(short()), new_machine=True, display=lambda *_: session.button.press("enough", ordinary=True)
        )
        # a stop of a run as fast as it goes ends it after a chunk; one that was wished for has not to be reset
        assert record.meta["result"] == "interrupted" and not session.why and not session.button()


def test_a_run_anew_is_shown_as_running_and_stopped_by_the_button_of_its_session(machine):
    seen = []

    def shown(times, arrays):
        seen.append((machine.status().state, machine.status().protocol[0]))
        machine.emergency_stop("by the test")

    record = machine.run(bench(short()), new_machine=True, display=shown)
    assert seen[0] == ("running", "short") and record.meta["result"] == "interrupted"


def test_what_trips_a_run_anew_stays_until_the_session_is_reset(machine):
    with pytest.raises(InputError, match="emergency stop at .*by the test.*reset it first"):
        machine.run(
            bench(short()),
            new_machine=True,
            clock=Clock(None),
            display=lambda *_: machine.emergency_stop("by the test"),
        )
        machine.run(bench(short()), new_machine=True)
    assert machine.status().state == "stopped" and machine.messages()[-1].kind == "stop"
    machine.reset()
    assert machine.status().state == "idle"


@pytest.mark.parametrize("speed", [0.0, -1.0, float("nan")])
def test_a_speed_is_a_factor_above_zero(speed):
    with pytest.raises(InputError, match="speed must be a factor above zero"):
        Session(paper(), "nylon", speed=speed, by_hand=False)


def test_a_simulated_machine_may_go_on_at_another_speed_and_a_real_one_has_its_own():
    with Session(paper(), "nylon", speed=1e-3, by_hand=False) as session:
        assert session.simulated and session.clock.speed == 1e-3
        session.set_speed(2.0)
        assert session.clock.speed == 2.0
    for state, real in ((None, True), ({}, False)):  # of a served simulation there is a state, of a real machine none
        with Session(paper(), "nylon", SimpleNamespace(state=lambda state=state: state), by_hand=False) as session:
            assert session.simulated is not real
            if real:
                with pytest.raises(InputError, match="speed must be left out: a real machine has its own time"):
                    session.set_speed(2.0)


def test_a_recording_is_begun_and_ended_once(machine):
    with pytest.raises(InputError, match="record is off already; use record on"):
        machine.stop_recording()
    machine.start_recording()
    with pytest.raises(InputError, match="record is on already; use record off"):
        machine.start_recording()
    assert machine.status().recorded is not None
    machine.wait(0.01)
    assert (
        len(machine.stop_recording()) == pytest.approx(0.01 / machine.period, abs=1)
        and machine.status().recorded is None
    )
    with pytest.raises(InputError, match="reset is allowed only after a stop, while nothing runs"):
        machine.reset()
