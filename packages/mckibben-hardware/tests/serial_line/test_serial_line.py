"""A machine behind a serial line is the machine: the same counts in lock-step, and whatever goes wrong is said and vents."""

import threading
import time
from pathlib import Path
from typing import Any

import pytest
from serial_machines import PERIOD, Tiny, over_the_line, step, straight

from mckibben.bench.hardware.interface import Hardware
from mckibben.errors import InputError, LineLostError
from mckibben_hardware.serial_line import SerialHardware
from mckibben_hardware.serial_line.device import About
from mckibben_hardware.serial_line.link import Arrivals
from mckibben_hardware.serial_line.messages import SampleMessage
from mckibben_hardware.serial_line.microcontroller import Faults, in_process, in_thread

SLOW = 0.01  # [s]; a thread on a busy machine wakes late, and what is tested here is not how late
PATIENT = 2000  # samples; the watchdog is tested where it is meant
REST = 2048


def one_line(error: pytest.ExceptionInfo[Exception], *says: str) -> None:
    said = str(error.value)
    assert "\n" not in said
    assert all(words in said for words in says), said


def lost(hardware: SerialHardware, samples: int = 200, first: int = 0) -> tuple[int, LineLostError]:
    """The sample at which the line is lost; it stays so, and closing it is quiet."""
    for k in range(first, samples):
        try:
            step(hardware, k)
        except LineLostError as error:
            with pytest.raises(LineLostError) as again:
                hardware.wait(k)
            assert str(again.value) == str(error)
            with pytest.raises(LineLostError):
                hardware.send()
            hardware.vent()
            hardware.close()
            return k, error
    raise AssertionError("the line was never lost")


def until(condition: Any, seconds: float = 10.0) -> None:
    end = time.perf_counter() + seconds
    while not condition() and time.perf_counter() < end:
        time.sleep(0.001)
    assert condition()


def test_lock_step_is_the_same_machine_bit_for_bit(chosen: Path | None) -> None:
    with in_thread(Tiny(), library=chosen) as device:
        hardware: Hardware = SerialHardware(device.port, lock_step=True)
        assert over_the_line(hardware, 1500) == straight(Tiny(), 1500)
        assert hardware.statistics == (1500, 0, 0, 0, 0, 0, 0, 0)
        hardware.close()
        hardware.close()
        until(lambda: device.microcontroller.board.outputs == (0, 0, True))


def test_a_process_of_its_own_gives_the_same_and_another_run_begins_anew(chosen: Path | None) -> None:
    with in_process(Tiny, 3, library=chosen) as device:
        hardware = SerialHardware(device.port, lock_step=True)
        twin = Tiny(3)
        for _ in range(2):  # the machine goes on from where it was; the samples count from 0 again
            assert over_the_line(hardware, 100) == straight(twin, 100)
        hardware.close()
    assert device.report is not None
    assert device.report.dropped == 0


def test_the_channels_come_in_the_order_asked_for(chosen: Path | None) -> None:
    with in_thread(Tiny(), library=chosen) as device:
        names = ("channel.5", "channel.0")
        hardware = SerialHardware(device.port, names, bits=dict.fromkeys(names, 12), lock_step=True)
        hardware.start(PERIOD)
        hardware.wait(0)
        first = Tiny().sample()[0]
        assert hardware.names == names
        assert tuple(hardware.counts) == (first[5], first[0])
        hardware.close()


def test_free_running_gives_every_sample_once_and_by_the_clock(chosen: Path | None) -> None:
    with in_thread(Tiny(), library=chosen) as device:
        hardware = SerialHardware(device.port, watchdog=PATIENT)
        begun = time.perf_counter()
        hardware.start(SLOW)
        rows, times = [], []
        for k in range(100):
            late, row = step(hardware, k)
            assert late >= 0.0
            assert hardware.fresh
            rows.append(row)
            times.append(hardware.time)
        # By the wall clock: the first sample comes at once, the last 99 periods later and never before.
        assert time.perf_counter() - begun >= 99 * SLOW - 1e-3
        assert times == sorted(times)
        found = hardware.statistics
        assert (found.samples, found.lost, found.repeated, found.bad_checksum, found.undecodable) == (100, 0, 0, 0, 0)
        hardware.close()
        commands = device.microcontroller.board.machine.history
    if found.answers_late == 0:  # then each command governed its own period, and all is as in the same process
        assert rows == straight(Tiny(), 100)
    assert {(c[0], c[1]) for c in commands} <= {(row[2][0], row[2][1]) for row in rows} | {(0, 0), (0, rows[-1][2][1])}


@pytest.mark.parametrize(("fault", "lost_ones", "bad"), [("checksum", 1, 1), ("lost", 1, 0), ("repeated", 0, 0)])
def test_a_frame_lost_or_damaged_is_counted_and_its_sample_still_taken(
    chosen: Path | None, fault: str, lost_ones: int, bad: int
) -> None:
    with in_thread(Tiny(), library=chosen, faults=Faults({20: fault})) as device:
        hardware = SerialHardware(device.port, watchdog=PATIENT)
        hardware.start(SLOW)
        fresh, readings = [], []
        for k in range(40):
            _, row = step(hardware, k)
            fresh.append(hardware.fresh)
            readings.append(row[:2])
        assert [k for k in range(40) if not fresh[k]] == ([20] if lost_ones else [])
        if lost_ones:
            assert readings[20] == readings[19]
            assert readings[21] != readings[20]
        found = hardware.statistics
        assert (found.samples, found.lost, found.bad_checksum) == (40, lost_ones, bad)
        assert found.repeated == (fault == "repeated")
        hardware.close()


def test_a_damaged_frame_in_lock_step_is_lost_and_the_run_goes_on(chosen: Path | None) -> None:
    with in_thread(Tiny(), library=chosen, faults=Faults({20: "checksum", 30: "repeated"})) as device:
        hardware = SerialHardware(device.port, lock_step=True)
        rows = over_the_line(hardware, 40)
        assert rows[:20] == straight(Tiny(), 20)
        assert rows[20][:2] == rows[19][:2]
        found = hardware.statistics
        assert (found.lost, found.bad_checksum, found.repeated) == (1, 1, 1)
        hardware.close()


@pytest.mark.parametrize("fault", ["checksum", "lost"])
def test_more_missing_samples_than_patience_has_lose_the_line(chosen: Path | None, fault: str) -> None:
    with in_thread(Tiny(), library=chosen, faults=Faults(dict.fromkeys((20, 21, 22), fault))) as device:
        hardware = SerialHardware(device.port, watchdog=PATIENT, patience=2)
        hardware.start(SLOW)
        at, error = lost(hardware)
        assert 20 <= at <= 22  # at once where the next frame tells that three are missing
        assert device.port in str(error)
        assert "missing" in str(error)
        assert "told to vent" in str(error)
        until(lambda: device.microcontroller.board.outputs[::2] == (0, True))


def test_patience_begins_again_after_every_good_sample(chosen: Path | None) -> None:
    faults = Faults(dict.fromkeys((10, 11, 13, 14, 16, 17), "lost"))
    with in_thread(Tiny(), library=chosen, faults=faults) as device:
        hardware = SerialHardware(device.port, watchdog=PATIENT, patience=2)
        over_the_line(hardware, 30, SLOW)
        assert hardware.statistics.lost == 6
        hardware.close()


def test_a_late_frame_is_taken_late_and_counted(chosen: Path | None) -> None:
    with in_thread(Tiny(), library=chosen, faults=Faults({20: "late"}, delay=5 * SLOW)) as device:
        hardware = SerialHardware(device.port, watchdog=PATIENT)
        hardware.start(SLOW)
        late = [step(hardware, k)[0] for k in range(40)]
        # It was held for 5 periods, and the first sample may itself have been up to one late.
        assert late[20] > 4 * SLOW
        found = hardware.statistics
        assert (found.samples, found.lost) == (40, 0)
        assert found.late >= 3
        hardware.close()


def test_an_unplugged_device_loses_the_line(chosen: Path | None) -> None:
    for lock_step in (True, False):
        with in_thread(Tiny(), library=chosen, faults=Faults({20: "unplug"})) as device:
            hardware = SerialHardware(device.port, watchdog=PATIENT, lock_step=lock_step)
            hardware.start(SLOW)
            begun = time.perf_counter()
            at, error = lost(hardware)
            assert at in (19, 20)  # the command for sample 19 may already find nobody
            assert f"{device.port}: unplugged" in str(error)
            assert time.perf_counter() - begun < 0.9 + 20 * SLOW  # noticed, not timed out


def test_silence_loses_the_line_after_the_timeout(chosen: Path | None) -> None:
    with in_thread(Tiny(), library=chosen, faults=Faults({5: "silent"})) as device:
        hardware = SerialHardware(device.port, watchdog=PATIENT, timeout=0.2)
        hardware.start(SLOW)
        at, error = lost(hardware)
        assert at == 5
        assert "nothing came for 0.2 s at sample 5" in str(error)
        # The device heard the last words.
        until(lambda: device.microcontroller.board.outputs[::2] == (0, True))


def test_a_device_that_stops_says_why(chosen: Path | None) -> None:
    with in_thread(Tiny(fails_at=7), library=chosen) as device:
        hardware = SerialHardware(device.port, lock_step=True)
        hardware.start(PERIOD)
        at, error = lost(hardware)
        assert at == 7
        assert "the machine cannot be read (code 3)" in str(error)


def test_a_host_that_says_nothing_finds_the_machine_vented(chosen: Path | None) -> None:
    with in_thread(Tiny(), library=chosen, about=About(motor_rest=REST)) as device:
        hardware = SerialHardware(device.port, watchdog=2, timeout=2.0)
        hardware.start(5 * SLOW)
        machine = device.microcontroller.board.machine
        with pytest.raises(LineLostError) as error:
            for k in range(200):
                hardware.wait(k)
                if k < 5:
                    hardware.write(100, 200, opened=False)
        one_line(error, device.port, "vented by itself")
        until(lambda: len(machine.history) >= 12)
        held = [k for k, command in enumerate(machine.history) if command == (100, 200, False)]
        # Held in the period of its own sample and at most in the next; a host that is late lets it vent before.
        assert held[-1] <= 4 + 1
        assert set(machine.history[held[-1] + 1 :]) == {(0, REST, True)}
        hardware.close()


@pytest.mark.parametrize("lock_step", [True, False])
def test_a_vent_from_another_thread_takes_effect_within_two_samples(chosen: Path | None, lock_step: bool) -> None:
    with in_thread(Tiny(), library=chosen) as device:
        hardware = SerialHardware(device.port, watchdog=PATIENT, lock_step=lock_step)
        machine, taken = device.microcontroller.board.machine, 0
        pressed, at = threading.Event(), []

        def press() -> None:
            pressed.wait()
            at.append(len(machine.history))
            hardware.vent()

        thread = threading.Thread(target=press)
        thread.start()
        hardware.start(SLOW)
        for k in range(60):
            hardware.wait(k)
            hardware.write(100 + k, k, opened=False)
            if k == 30:
                pressed.set()
                thread.join()
            taken = k
        assert taken == 59
        hardware.close()
    before, after = machine.history[: at[0]], machine.history[at[0] + 2 :]
    assert before[-1][0] >= 100
    assert len(after) > 10
    assert {(valve, opened) for valve, _, opened in after} == {(0, True)}


def test_a_new_run_begins_unvented_and_forgets_the_old_one(chosen: Path | None) -> None:
    with in_thread(Tiny(), library=chosen) as device:
        hardware = SerialHardware(device.port, watchdog=PATIENT)
        hardware.start(SLOW)
        step(hardware, 0)
        hardware.vent()
        time.sleep(5 * SLOW)  # samples of this run that nobody takes
        hardware.start(SLOW)
        for k in range(5):
            hardware.wait(k)
            hardware.write(77, opened=False)
        until(lambda: device.microcontroller.board.outputs[::2] == (77, False))
        assert hardware.statistics.samples == 5
        hardware.close()


def test_the_wrong_firmware_is_refused(chosen: Path | None) -> None:
    with in_thread(Tiny(), library=chosen, faults=Faults(version=9)) as device:
        with pytest.raises(InputError) as error:
            SerialHardware(device.port)
        one_line(error, device.port, "protocol of the device must be 1, got 9")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        ({"channels": ["channel.0", "pressure"]}, "the rig needs pressure too"),
        ({"bits": {"channel.1": 16}}, "bits of channel.1 is 12: the rig has 16"),
        ({"encoder": True}, "encoder is missing on the device"),
        ({"motor": True}, "motor is missing on the device"),
    ],
)
def test_another_device_than_the_rig_needs_is_refused(chosen: Path | None, options: dict[str, Any], says: str) -> None:
    with in_thread(Tiny(), library=chosen, about=About(encoder=False, motor=False)) as device:
        with pytest.raises(InputError) as error:
            SerialHardware(device.port, **options)
        one_line(error, device.port, says)
        hardware = SerialHardware(device.port)  # the port is free again
        assert not hardware.has_encoder
        assert not hardware.has_motor
        with pytest.raises(InputError) as error:
            hardware.start(1e-5)
        one_line(error, "period", "0.0001 s")
        for value in (-1, 2**32, 1.5, "much"):
            with pytest.raises(InputError):
                hardware.write(value)
        hardware.close()
        with pytest.raises(LineLostError, match="closed"):
            hardware.wait(0)


@pytest.mark.parametrize("period", [0.0, -1.0, float("nan"), float("inf"), 5.0])
def test_a_period_that_the_line_cannot_say_is_refused(chosen: Path | None, period: float) -> None:
    with in_thread(Tiny(), library=chosen) as device:
        hardware = SerialHardware(device.port)
        with pytest.raises(InputError, match="period"):
            hardware.start(period)
        hardware.close()


def test_no_answer_no_port_and_a_port_in_use_are_said() -> None:
    with pytest.raises(InputError) as none:
        SerialHardware("/dev/no-such-port")
    one_line(none, "/dev/no-such-port", "can be opened", "there is none of this name")
    with pytest.raises(InputError, match="a speed behind @ is a whole number"):
        SerialHardware("/dev/no-such-port@fast")
    with pytest.raises(InputError, match="this is no serial port"):
        SerialHardware("/dev/null")
    with in_thread(Tiny()) as device:
        device.microcontroller.device.receive = lambda data: None  # deaf
        with pytest.raises(LineLostError) as silent:
            SerialHardware(device.port, greeting=0.1)
        one_line(silent, device.port, "no device answered within 0.1 s; nothing came")
    with in_thread(Tiny()) as device:
        hardware = SerialHardware(device.port)
        with pytest.raises(InputError) as busy:
            SerialHardware(device.port)
        one_line(busy, device.port, "another program has it open")
        hardware.close()


def test_without_pyserial_a_line_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "serial", None)
    with pytest.raises(InputError) as error:
        SerialHardware("/dev/ttyUSB0")
    one_line(error, "pyserial", "not installed", "mckibben[serial]")


@pytest.mark.parametrize(
    ("pace", "pause", "slowness"), [(1.0, 0.0, 1.0), (8.0, 0.0, 8.0), (1.0, 0.9, 1.0), (0.1, 0.0, 1.0)]
)
def test_a_device_may_be_silent_as_much_longer_as_its_time_is_slower(
    pace: float, pause: float, slowness: float
) -> None:
    arrivals, samples = Arrivals(1e-2, False, 2), 10_000
    for k in range(samples):
        # a pause is in the first samples, where it is most of the time that has passed
        arrivals.put(pace * k * 1e-2 + (pause if k > 3 else 0.0), SampleMessage(k, 1, 0, 0, 0, ()))
        arrivals.take(k)
        assert arrivals.slowness(1.0) <= max(slowness, 1.0)
    assert arrivals.slowness(1.0) == pytest.approx(
        slowness, rel=1.0 / (samples * 1e-2)
    )  # 1 s beside that of the device
