"""Bluesky's RunEngine on the machine: its plans move it, its documents have our channels, and what ends a plan vents it."""

import threading
import time

import bluesky.plan_stubs as bps
import bluesky.plans as bp
import bluesky.preprocessors as bpp
import bluesky.protocols as protocols
import numpy as np
import pytest
from bluesky import RunEngine
from bluesky.run_engine import call_in_bluesky_event_loop
from bluesky.simulators import check_limits
from bluesky.utils import FailedStatus, RunEngineInterrupted
from short_runs import paper

from mckibben.bench.session import Session
from mckibben.bench.session.proxy import SessionProxy
from mckibben.errors import InputError, MckibbenError, UnreachableError
from mckibben.experiments.read import parse_protocol, protocol
from mckibben.recordings import read_any
from mckibben_hardware.bluesky import bench_devices

VENTED = 5e3  # Pa; two counts of the 8 bits
LONG = protocol("isotonic-triangle", load="50 N", frequency="5 Hz", cycles=500)
SHORT = protocol("isotonic-triangle", load="50 N", frequency="5 Hz", cycles=1)
UNITS = {"pressure": "Pa", "tension": "N", "span": "m", "command-pressure": "Pa", "muscle-volume": "m^3"}


@pytest.fixture(scope="module")
def opened():
    with Session(paper(), "nylon", speed=None, keep=60.0) as session:
        yield session


@pytest.fixture
def session(opened):
    """The machine that all tests share, at rest and vented."""
    if opened.why:
        opened.reset()
    opened.set(pressure=0.0, span=0.14)
    opened.wait(2.5)
    opened.vent()
    return opened


@pytest.fixture
def machine(session, engine):
    return bench_devices(session, settle=0.05)


@pytest.fixture(scope="module")
def engine():
    """One RunEngine, with the signal handlers of its pauses left out."""
    return RunEngine({}, context_managers=[])


def awaited(function, *given, longest=60.0):
    """What a device gives, asked for and awaited in the loop of the RunEngine."""

    async def ask():
        found = function(*given)
        return await found if hasattr(found, "__await__") else found

    return call_in_bluesky_event_loop(ask(), timeout=longest)


def begun(function, *given):
    """The status of what a device begins in the loop of the RunEngine."""

    async def begin():
        return function(*given)

    return call_in_bluesky_event_loop(begin())


def failure(status, longest=60.0):
    """Why a status failed, once it has ended."""
    end = time.monotonic() + longest
    while not status.done:
        assert time.monotonic() < end, "it goes on"
        time.sleep(0.01)
    return status.exception()


@pytest.fixture
def documents(engine):
    found = []
    token = engine.subscribe(lambda name, document: found.append((name, document)))
    yield found
    engine.unsubscribe(token)
    assert engine.state == "idle"


def of(documents, kind):
    return [d for name, d in documents if name == kind]


def rows(documents, stream):
    """Data and time stamps of a stream, by key."""
    descriptor = next(d for d in of(documents, "descriptor") if d["name"] == stream)
    data, stamps = {k: [] for k in descriptor["data_keys"]}, {k: [] for k in descriptor["data_keys"]}
    for name, document in documents:
        if name in ("event", "event_page") and document["descriptor"] == descriptor["uid"]:
            for key in data:
                one = name == "event"
                data[key] += [document["data"][key]] if one else document["data"][key]
                stamps[key] += [document["timestamps"][key]] if one else document["timestamps"][key]
    return descriptor, {k: np.array(v) for k, v in data.items()}, {k: np.array(v) for k, v in stamps.items()}


def at(session, machine, stamps):
    """Index of the session's samples at time stamps, and all of its samples."""
    times, arrays = session.since(-1.0)
    index = np.searchsorted(times, stamps - machine.context.zero - 0.5 * session.period)
    # a time stamp is a double near 2e9 s, which is good to 0.5 us
    assert np.abs(times[index] - (stamps - machine.context.zero)).max() < 1e-6
    return index, arrays


READS = ("Readable", "Triggerable", "Configurable", "Subscribable", "HasHints", "HasParent", "HasName")
MOVES = ("NamedMovable", "Movable", "Locatable", "Checkable", "Stoppable", "Stageable")
FLIES = (
    "Flyable", "Collectable", "EventPageCollectable", "Configurable", "Stageable", "Stoppable", "Pausable", "HasHints",
)  # fmt: skip


def test_every_device_satisfies_the_protocols_of_bluesky(machine):
    moved = [machine.pressure, machine.span, machine.velocity, machine.tension]
    for device in moved:
        for name in (*READS, *MOVES):
            assert isinstance(device, getattr(protocols, name)), (device, name)
        assert not isinstance(device, protocols.Pausable)
    for device in (*machine.measured.values(), *machine.true.values()):
        for name in READS:
            assert isinstance(device, getattr(protocols, name)), (device, name)
        assert not isinstance(device, protocols.Movable)
    flyer = machine.flyer(SHORT)
    for name in FLIES:
        assert isinstance(flyer, getattr(protocols, name)), name
    # both ways to collect would make the RunEngine warn at every collection
    assert not isinstance(flyer, protocols.EventCollectable)


def test_what_is_described_is_what_is_read(machine, session):
    signals = [*machine.measured.values(), *machine.true.values(), machine.pressure, machine.span, machine.velocity]
    keys = [key for device in signals for key in awaited(device.read)]
    assert len(set(keys)) == len(keys) and not any("." in key for key in keys)
    for device in signals:
        described = awaited(device.describe)
        assert awaited(device.read).keys() == described.keys() == set(device.hints["fields"])
        assert awaited(device.read_configuration).keys() == awaited(device.describe_configuration).keys()
        assert described[device.name]["units"] == machine.context.kinds[device.channel][0]
    low, high = machine.pressure.limits
    assert awaited(machine.pressure.describe)["command-pressure"]["limits"] == {"control": {"low": low, "high": high}}
    assert (low, high) == (0.0, 6.9e5)
    assert awaited(machine.measured["span"].describe)["span"]["precision"] == 5  # steps of the encoder of some 1e-5 m
    assert awaited(machine.true["muscle.volume"].describe)["muscle-volume"]["kind"] == "true"
    two = bench_devices(session, "left")
    assert two.pressure.name == "left-command-pressure" and list(awaited(two.measured["span"].read)) == ["left-span"]


def test_a_scan_of_the_pressure_has_the_samples_of_the_session(engine, machine, session, documents):
    begun = time.time()
    detectors = [machine.measured["tension"], machine.measured["span"], machine.measured["pressure"]]
    engine(bp.scan(detectors, machine.pressure, 1e5, 4e5, 4))
    descriptor, data, stamps = rows(documents, "primary")
    assert {k: d["units"] for k, d in descriptor["data_keys"].items()} == {
        k: UNITS[k] for k in ("tension", "span", "pressure", "command-pressure")
    }
    assert descriptor["hints"]["command-pressure"] == {"fields": ["command-pressure"]}
    assert descriptor["configuration"]["tension"]["data"]["tension-specimen"] == "nylon"
    assert data["command-pressure"] == pytest.approx([1e5, 2e5, 3e5, 4e5])
    for key in data:
        index, arrays = at(session, machine, stamps[key])
        assert np.array_equal(arrays[key.replace("-", ".")][index], data[key]), key
        assert np.all(np.diff(index) > 0)
    assert np.all(np.diff(data["tension"]) > 5.0)  # N; a muscle at a fixed length pulls the more, the fuller it is
    assert data["pressure"] == pytest.approx(data["command-pressure"], abs=6.9e3)  # the 1 % within which it is there
    assert data["span"] == pytest.approx(0.14, abs=3e-4)
    assert stamps["tension"][0] > begun - 60.0  # since 1970, of a machine whose time goes as fast as it can
    assert of(documents, "stop")[0]["exit_status"] == "success"
    session.wait(2.5)  # what was staged is let down at the end
    assert session.latest()["pressure"] < VENTED and not session.why


@pytest.mark.slow
def test_what_is_moved_without_staging_is_held_after_the_plan(engine, machine, session):
    engine(bps.mv(machine.pressure, 2e5, machine.span, 0.13))
    session.wait(1.0)
    assert awaited(machine.pressure.locate) == {"setpoint": 2e5, "readback": pytest.approx(2e5, abs=6.9e3)}
    assert awaited(machine.span.locate) == {"setpoint": 0.13, "readback": pytest.approx(0.13, abs=3e-4)}
    engine(bps.mv(machine.tension, 20.0))
    assert awaited(machine.tension.locate) == {"setpoint": 20.0, "readback": pytest.approx(20.0, abs=1.0)}
    assert (
        awaited(machine.span.locate)["setpoint"] == awaited(machine.span.locate)["readback"]
    )  # not controlled any more
    engine(bps.mv(machine.velocity, 0.01))
    session.wait(0.2)
    assert session.latest()["command.velocity"] == 0.0  # a velocity ends with its plan
    assert session.latest()["command.pressure"] == 2e5


def test_a_flown_protocol_gives_the_samples_of_the_session(engine, machine, session, documents, tmp_path):
    flyer = machine.flyer(SHORT, logs=tmp_path / "logs")
    engine(bpp.stage_wrapper(bp.fly([flyer]), [flyer]))
    descriptor, data, stamps = rows(documents, "isotonic-triangle")
    record = flyer.recording
    assert set(data) == {n.replace(".", "-") for n in record.names()}
    assert {k: d["units"] for k, d in descriptor["data_keys"].items()} == {
        n.replace(".", "-"): record.unit(n) for n in record.names()
    }
    assert {k: descriptor["data_keys"][k]["units"] for k in UNITS} == UNITS
    assert len(record) == len(data["tension"]) == 200
    index, arrays = at(session, machine, stamps["tension"])
    assert np.all(np.diff(index) == 1)
    for name in record.names():
        key = name.replace(".", "-")
        assert np.array_equal(data[key], record[name], equal_nan=True), name
        assert np.array_equal(data[key], arrays[name][index], equal_nan=True), name
        assert np.array_equal(stamps[key], stamps["tension"])
    told = descriptor["configuration"]["isotonic-triangle"]["data"]
    assert told["isotonic-triangle-digest"] == SHORT.digest == record.meta["digest"]
    assert told["isotonic-triangle-rig"] == "paper-isothermal"
    assert told["isotonic-triangle-sample_rate"] == SHORT.sample_rate
    assert descriptor["hints"]["isotonic-triangle"]["fields"] == ["pressure", "span", "tension", "valve_pressure"]
    assert np.array_equal(read_any(flyer.log_file).recording["tension"], record["tension"])
    assert list(flyer.collect_pages()) == []  # handed out once


@pytest.mark.slow
def test_a_stream_may_be_declared_and_a_slower_protocol_keeps_its_rate(engine, machine, documents):
    text = 'schema = 1\nname = "slow"\ntitle = "Slow"\nsample_rate = "100 Hz"\n'
    text += '[[steps]]\npressure = { to = "1 bar", in = "1 s" }\n'
    flyer = machine.flyer(parse_protocol(text, where="slow.toml"), declared=True)

    def plan():
        yield from bps.open_run()
        yield from bps.declare_stream(flyer, name="ramp", collect=True)
        yield from bps.kickoff(flyer, wait=True)
        yield from bps.collect_while_completing([flyer], [flyer], flush_period=0.05, stream_name="ramp")
        yield from bps.close_run()

    for _ in range(2):  # as often as it is wanted
        engine(bpp.stage_wrapper(plan(), [flyer]))
    _, data, stamps = rows(documents, "ramp")
    assert len(data["pressure"]) == 100 and np.diff(stamps["pressure"]) == pytest.approx(0.01, abs=1e-6)
    assert len(of(documents, "event_page")) == 2


def test_what_the_rig_does_not_allow_is_refused_before_anything_moves(engine, machine, session):
    before = session.latest()["command.pressure"]
    for device, value in (
        (machine.pressure, 9e5),
        (machine.span, "50 cm"),
        (machine.velocity, 1.0),
        (machine.tension, 200.0),
    ):
        with pytest.raises(InputError, match="by hand"):
            engine(bps.mv(device, value))
        with pytest.raises(InputError, match="by hand"):
            device.check_value(value)
    with pytest.raises(InputError, match="0 bar to 6.9 bar"):
        check_limits(bp.scan([], machine.pressure, 1e5, 9e5, 3))
    check_limits(bp.scan([], machine.pressure, 1e5, 6e5, 3))
    with pytest.raises(InputError, match="burst|bar"):
        machine.flyer(protocol("isotonic-triangle", high="9 bar"))
    session.wait(0.5)
    assert session.latest()["command.pressure"] == before and session.status().state == "idle"


@pytest.mark.slow
def test_an_aborted_scan_leaves_nothing_under_pressure(engine, machine, session, documents):
    def paused(detectors, step, pos_cache):
        yield from bps.one_nd_step(detectors, step, pos_cache)
        if session.latest()["command.pressure"] > 2.5e5:
            yield from bps.pause()

    with pytest.raises(RunEngineInterrupted):
        engine(bp.scan([machine.measured["tension"]], machine.pressure, 1e5, 4e5, 4, per_step=paused))
    session.wait(1.0)
    assert session.latest()["pressure"] > 2.9e5  # a pause between two moves holds what is there
    engine.abort("by the test")
    session.wait(2.5)
    assert session.latest()["pressure"] < VENTED and session.status().state == "idle"
    assert of(documents, "stop")[0]["exit_status"] == "abort"


@pytest.mark.slow
def test_a_pressure_on_its_way_is_let_down_by_a_pause_and_goes_there_on_resumption(engine, machine, session):
    def plan():
        yield from bps.checkpoint()
        yield from bps.abs_set(machine.pressure, 4e5, group="there")
        if session.latest()["command.pressure"] < 1e5 and not seen:
            seen.append(True)
            yield from bps.pause()
        yield from bps.wait("there")

    seen = []
    with pytest.raises(RunEngineInterrupted):
        engine(plan())
    session.wait(2.5)
    assert session.latest()["pressure"] < VENTED
    engine.resume()
    assert session.latest()["pressure"] == pytest.approx(4e5, abs=6.9e3)


@pytest.mark.slow
def test_the_guard_vents_whatever_a_failed_plan_has_left(engine, machine, session):
    def plan():
        yield from bps.open_run()
        yield from bps.mv(machine.pressure, 2e5)
        raise RuntimeError("by the test")

    token = engine.subscribe(machine.guard)
    try:
        with pytest.raises(RuntimeError, match="by the test"):
            engine(plan())
    finally:
        engine.unsubscribe(token)
    session.wait(2.0)
    assert session.latest()["pressure"] < VENTED


def flown(flyer, then):
    yield from bps.open_run()
    yield from bps.kickoff(flyer, wait=True)
    yield from then()
    yield from bps.complete(flyer, wait=True)
    yield from bps.close_run()


def stopped(session, flyer, why):
    """The machine was stopped for a reason, stays vented, and what had been recorded is there."""
    assert not flyer.running and why in session.why and session.status().state == "stopped"
    session.wait(1.5)
    assert session.latest()["pressure"] < VENTED
    return flyer.recording


@pytest.mark.slow
@pytest.mark.parametrize("way", ["abort", "stop", "fail", "halt"])
def test_whatever_ends_a_plan_stops_its_protocol_and_vents(engine, machine, session, documents, way):
    flyer, asked = machine.flyer(LONG), []

    def end():
        if way == "fail":
            raise RuntimeError("by the test")
        thread = threading.Timer(0.05, getattr(engine, way))
        asked.append(thread)
        thread.start()
        yield from bps.sleep(60.0)

    def then():
        while session.latest()["time"] < before + 6.0:  # until samples are recorded
            yield from bps.sleep(0.02)
        yield from end()

    before = session.latest()["time"]
    with pytest.raises(RuntimeError if way == "fail" else RunEngineInterrupted):
        engine(bpp.stage_wrapper(flown(flyer, then), [flyer]))
    for thread in asked:
        thread.join()
    failure(begun(flyer.complete))  # the engine does not wait for what it unstages after a halt
    record = stopped(session, flyer, "the plan that ran it is over")
    assert record.meta["result"] == "stopped" and record.duration < 100.0
    (last,) = of(documents, "stop")
    assert last["exit_status"] == {"abort": "abort", "stop": "success", "fail": "fail", "halt": "abort"}[way]
    if way != "halt":  # which leaves the plan no time to clean up
        _, data, _ = rows(documents, flyer.name)  # what there is goes into the documents
        assert np.array_equal(data["tension"], record["tension"])


@pytest.mark.slow
def test_a_paused_plan_stops_its_protocol_which_cannot_be_resumed(engine, machine, session):
    flyer = machine.flyer(LONG)
    with pytest.raises(RunEngineInterrupted):
        engine(bpp.stage_wrapper(flown(flyer, bps.pause), [flyer]))
    failure(begun(flyer.complete))
    stopped(session, flyer, "the plan was paused")
    with pytest.raises(InputError, match="cannot be paused"):
        engine.resume()
    engine.abort()
    with pytest.raises(InputError, match="reset it first|manual mode"):
        begun(machine.pressure.set, 1e5)


def test_an_emergency_stop_fails_the_plan_that_waits_for_the_protocol(engine, machine, session, documents):
    flyer = machine.flyer(LONG)

    def press():
        machine.context.session.emergency_stop("somebody pressed it")
        yield from bps.null()

    with pytest.raises(FailedStatus) as caught:
        engine(bpp.stage_wrapper(flown(flyer, press), [flyer]))
    assert isinstance(caught.value.__cause__, MckibbenError) and "somebody pressed it" in str(caught.value.__cause__)
    stopped(session, flyer, "somebody pressed it")
    assert of(documents, "stop")[0]["exit_status"] == "fail"


@pytest.mark.slow
def test_what_has_to_wait_for_a_protocol_is_refused_and_not_kept_waiting(machine):
    flyer = machine.flyer(LONG)
    with pytest.raises(InputError, match="call kickoff first"):
        begun(flyer.complete)
    with pytest.raises(InputError, match="stage it"):
        begun(flyer.kickoff)
    awaited(flyer.stage)
    awaited(flyer.kickoff)
    try:
        for act, given in ((flyer.kickoff, ()), (machine.pressure.set, (1e5,))):
            with pytest.raises(InputError, match="isotonic-triangle is running; stop it first"):
                begun(act, *given)
        assert list(flyer.collect_pages()) == []
        begun(machine.pressure.stop)
        assert flyer.running  # the stop of a set-point that is not on its way
    finally:
        begun(flyer.stop)
        awaited(flyer.unstage)
    assert not flyer.running and not begun(flyer.complete).success


def test_an_emergency_stop_ends_a_move_and_so_does_another_set_point(machine, session):
    first = begun(machine.span.set, 0.12)
    awaited(machine.tension.set, 10.0)  # by the same motor
    assert "before another set-point was there" in str(failure(first, 5.0))
    moving = begun(machine.pressure.set, 6e5)
    begun(machine.pressure.stop, False)
    assert "stopped" in str(failure(moving, 5.0)) and "command-pressure was stopped" in session.why
    with pytest.raises(InputError, match="reset it first"):
        begun(machine.pressure.set, 1e5)


def test_a_set_point_that_another_hand_changes_fails_and_says_where_it_is(machine, session):
    moving = begun(machine.pressure.set, 4e5)
    session.set(pressure=1e5)
    error = failure(moving)
    assert isinstance(error, UnreachableError)
    assert "command-pressure: 4 bar was not reached; 1 bar is asked for and " in str(error)


def test_a_reading_is_a_later_sample_than_its_trigger_or_the_mean_over_a_time(engine, session):
    machine = bench_devices(session, over=0.05)
    before = session.latest()["time"]
    signal = machine.measured["tension"]
    awaited(signal.trigger)
    (reading,) = awaited(signal.read).values()
    times, arrays = session.since(before)
    assert len(times) == 50 and reading["value"] == arrays["tension"].mean()
    assert reading["timestamp"] == pytest.approx(machine.context.zero + before + 0.05, abs=1e-6)
    assert awaited(signal.read_configuration)["tension-over"]["value"] == 0.05


@pytest.mark.slow
def test_signals_can_be_monitored_while_a_plan_goes_on(engine, machine, session, documents):
    signal = machine.measured["pressure"]

    @bpp.monitor_during_decorator([signal])
    @bpp.run_decorator()
    def plan():
        for pressure in (1e5, 2e5, 3e5):
            yield from bps.mv(machine.pressure, pressure)
            yield from bps.sleep(0.3)  # the machine goes as fast as it can, and a display is told 20 times a second

    engine(plan())
    _, data, stamps = rows(documents, "pressure_monitor")
    assert len(data["pressure"]) >= 3 and np.all(np.diff(stamps["pressure"]) > 0.0)
    index, arrays = at(session, machine, stamps["pressure"])
    assert np.array_equal(arrays["pressure"][index], data["pressure"])


@pytest.mark.slow
def test_by_the_wall_clock_the_same_plans_go(engine):
    with Session(paper(), "nylon", speed=4.0) as session:
        machine = bench_devices(session, over=0.02)
        got = []
        detectors = [machine.measured["tension"], machine.measured["pressure"]]
        engine(bp.scan(detectors, machine.pressure, 1e5, 2e5, 2), {"event": lambda _, e: got.append(e["data"])})
        assert [e["pressure"] for e in got] == pytest.approx([1e5, 2e5], abs=6.9e3)
        flyer = machine.flyer(LONG)
        with pytest.raises(RuntimeError, match="by the test"):
            engine(bpp.stage_wrapper(flown(flyer, broken), [flyer]))
        assert "the plan that ran it is over" in session.why and not flyer.running
        stop = next(m for m in session.messages() if m.kind == "stop")
        times, arrays = session.since(stop.time)
        assert np.all(arrays["valve.command"] == 0.0) and len(times) > 100


def broken():
    yield from bps.sleep(0.2)
    raise RuntimeError("by the test")


@pytest.mark.slow
def test_a_machine_in_another_process_has_the_same_devices_and_plans(engine, documents):
    with SessionProxy(None, paper(), "nylon", speed=None) as session:
        machine = bench_devices(session, settle=0.05)
        assert set(machine.true) > {"muscle.tension"} and machine.measured["tension"].context.about["simulated"]
        engine(bp.scan([machine.measured["tension"]], machine.pressure, 1e5, 2e5, 2))
        _, data, _ = rows(documents, "primary")
        assert data["command-pressure"] == pytest.approx([1e5, 2e5]) and np.all(np.diff(data["tension"]) > 5.0)  # N
        flyer = machine.flyer(SHORT)
        engine(bpp.stage_wrapper(bp.fly([flyer]), [flyer]))
        assert len(flyer.recording) == len(rows(documents, flyer.name)[1]["tension"]) == 200
