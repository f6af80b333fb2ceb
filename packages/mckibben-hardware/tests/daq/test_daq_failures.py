"""What may go wrong with a card: one clear line that names it, and a machine that is vented where it can be."""

import ctypes.util
import dataclasses
import socket
import sys
import threading
import time

import pytest
from daq_machines import Clockwork, Mixer, clock_wiring, mixer_wiring, run

from mckibben.errors import InputError, LineLostError, MckibbenError
from mckibben_hardware.daq import DaqHardware, OverrunError, SimulatedDevice

pytest.importorskip("nidaqmx", reason="needs the extra daq: pip install 'nidaqmx[grpc]'")
pytest.importorskip("grpc", reason="needs the extra daq: pip install 'nidaqmx[grpc]'")

PERIOD = 1e-3
PATIENT = {"patience": 10.0, "silence": 60.0}  # [s]: other tests share the processors


def one_line(told: pytest.ExceptionInfo[MckibbenError], *words: str) -> str:
    line = str(told.value)
    assert "\n" not in line
    assert all(word in line for word in words), line
    return line


def test_samples_that_were_overwritten_end_the_run_and_are_named() -> None:
    # the buffer holds 50 samples; 500 pass
    with SimulatedDevice(Clockwork(), clock_wiring(), lock_step=False) as device:
        hardware = DaqHardware(device.wiring, buffer=0.05, **PATIENT)
        hardware.start(PERIOD)
        hardware.wait(0)
        time.sleep(0.5)
        with pytest.raises(OverrunError) as told:
            for k in range(1, 50):
                hardware.wait(k)
        one_line(told, "Dev1 at grpc://127.0.0.1", "Dev1/ai0", "overwritten", "-200279", "the machine is vented")
        assert hardware.statistics.overruns == 1
        assert hardware.statistics.reads < 50
        with pytest.raises(LineLostError, match="overwritten"):
            hardware.send()
        hardware.start(PERIOD)  # a new run has no gap yet
        hardware.wait(0)
        assert hardware.statistics.overruns == 0
        hardware.close()


def test_a_device_that_is_unplugged_is_told_by_reading_and_by_sending() -> None:
    for writes in (False, True):
        device = SimulatedDevice(Mixer(), mixer_wiring())
        with device:
            hardware = DaqHardware(device.wiring, **PATIENT)
            hardware.start(PERIOD)
            run(hardware, 0, 5)
            hardware.wait(5)
            device.stop()
            with pytest.raises(LineLostError) as told:
                hardware.send() if writes else hardware.wait(6)
            one_line(told, "Dev1 at grpc://127.0.0.1", "does not answer any more", "could not be told to vent")
            hardware.vent()
            hardware.close()
            assert not hardware.vented


def test_a_device_that_is_unplugged_while_a_sample_is_awaited_ends_the_wait() -> None:
    with SimulatedDevice(Mixer(), mixer_wiring()) as device:
        hardware = DaqHardware(device.wiring, patience=60.0, silence=60.0)
        hardware.start(PERIOD)
        hardware.wait(0)
        threading.Timer(0.2, device.stop).start()
        began = time.monotonic()
        with pytest.raises(LineLostError):
            hardware.wait(1)
        assert time.monotonic() - began < 30.0
        hardware.close()


def test_a_device_server_that_hangs_is_given_up() -> None:
    hang, free = threading.Event(), threading.Event()

    class Hanging(Clockwork):
        def sample(self) -> tuple[list[int], int]:
            if hang.is_set():
                free.wait(60.0)
            return super().sample()

    with SimulatedDevice(Hanging(), clock_wiring()) as device:
        hardware = DaqHardware(device.wiring, patience=0.3, silence=60.0)
        hardware.start(PERIOD)
        hardware.wait(0)
        hardware.send()
        hang.set()
        with pytest.raises(LineLostError) as told:
            hardware.wait(1)
        one_line(told, "Dev1 at grpc://", "did not answer in time", "could not be told to vent")
        free.set()
        hardware.close()


def test_a_sample_that_does_not_come_is_told() -> None:
    with SimulatedDevice(Mixer(), mixer_wiring()) as device:
        hardware = DaqHardware(device.wiring, patience=0.2, silence=60.0)
        hardware.start(PERIOD)
        hardware.wait(0)
        with pytest.raises(LineLostError) as told:
            hardware.wait(1)  # in lock-step it needs outputs first
        one_line(told, "Dev1/ai3, Dev1/ai0, Dev1/ai1", "not yet been acquired", "-200284", "the machine is vented")
        hardware.close()


def test_a_card_that_fails_is_told_in_its_own_words() -> None:
    class Broken(Clockwork):
        def sample(self) -> tuple[list[int], int]:
            if self.steps == 3:
                raise ZeroDivisionError("no physics")
            return super().sample()

    with SimulatedDevice(Broken(), clock_wiring()) as device:
        hardware = DaqHardware(device.wiring, **PATIENT)
        hardware.start(PERIOD)
        with pytest.raises(LineLostError) as told:
            run(hardware, 0, 10)
        one_line(told, "Device cannot be accessed", "no physics", "-201003")
        assert hardware.statistics.reads == 3
        hardware.close()


def test_what_is_no_number_is_no_sample(monkeypatch: pytest.MonkeyPatch) -> None:
    with SimulatedDevice(Clockwork(), clock_wiring()) as device:
        hardware = DaqHardware(device.wiring, **PATIENT)
        hardware.start(PERIOD)
        monkeypatch.setattr("mckibben_hardware.daq.Analog.volts", lambda *_: float("nan"))
        with pytest.raises(LineLostError) as told:
            hardware.wait(0)
        one_line(told, "no numbers came", "Dev1/ai0 nan V")
        monkeypatch.undo()
        hardware.close()


def test_samples_are_waited_for_one_after_another() -> None:
    with SimulatedDevice(Mixer(), mixer_wiring()) as device:
        hardware = DaqHardware(device.wiring, **PATIENT)
        with pytest.raises(InputError, match="none comes before the start"):
            hardware.wait(0)
        hardware.start(PERIOD)
        for wrong in (1, -1, 5):
            with pytest.raises(InputError, match="must be 0"):
                hardware.wait(wrong)
        assert hardware.wait(0) >= 0.0
        hardware.close()


@pytest.mark.parametrize(
    ("path", "terminal", "words"),
    [
        ("inputs", "Dev1/ai9", ("inputs.pressure.channel", "does not exist", "-200170")),
        ("inputs", "Dev7/ai0", ("inputs.pressure.channel", "Device identifier is invalid", "Dev7", "-200220")),
        ("valve", "Dev1/ao9", ("valve.channel", "does not exist", "ao9")),
        ("counter", "Dev1/ctr9", ("encoder.counter", "does not exist", "ctr9")),
        ("line", "Dev1/port0/line9", ("shut_off.line", "does not exist", "port0/line9")),
    ],
)
def test_a_terminal_that_the_card_lacks_is_the_users_mistake(path: str, terminal: str, words: tuple[str, ...]) -> None:
    wired, change = mixer_wiring(), dataclasses.replace
    with SimulatedDevice(Mixer(), wired) as device:
        wrong = {
            "inputs": lambda w: change(
                w, inputs={"pressure": change(w.inputs["pressure"], channel=terminal)}, encoder=None
            ),
            "valve": lambda w: change(w, valve=change(w.valve, channel=terminal)),
            "counter": lambda w: change(w, encoder=change(w.encoder, counter=terminal)),
            "line": lambda w: change(w, shut_off=change(w.shut_off, line=terminal)),
        }[path](device.wiring)
        with pytest.raises(InputError) as told:
            DaqHardware(wrong, **PATIENT)
        one_line(told, terminal, *words)
        DaqHardware(device.wiring, **PATIENT).close()  # nothing is left reserved


def test_a_clock_that_is_not_that_of_the_inputs_is_refused() -> None:
    with SimulatedDevice(Mixer(), mixer_wiring()) as device:
        hardware = DaqHardware(dataclasses.replace(device.wiring, clock="/Dev1/PFI3"), **PATIENT)
        with pytest.raises(InputError) as told:
            hardware.start(PERIOD)
        one_line(told, "clock", "/Dev1/PFI3", "route", "-89136")
        hardware.close()


def test_a_rate_that_the_card_cannot_make_is_refused() -> None:
    with SimulatedDevice(Mixer(), mixer_wiring()) as device:
        hardware = DaqHardware(device.wiring, **PATIENT)
        with pytest.raises(InputError) as told:
            hardware.start(1.003e-6)
        one_line(told, "period", "1e+06 Hz")
        hardware.close()


def test_a_channel_that_the_simulated_machine_lacks_is_refused() -> None:
    with pytest.raises(InputError) as told:
        SimulatedDevice(Clockwork(), mixer_wiring())
    one_line(told, "inputs.tension", "The machine has pressure")


def test_a_card_in_use_is_told() -> None:
    with SimulatedDevice(Mixer(), mixer_wiring()) as device:
        hardware = DaqHardware(device.wiring, **PATIENT)
        with pytest.raises(LineLostError) as told:
            DaqHardware(device.wiring, **PATIENT)
        one_line(told, "reserved", "-50103")
        hardware.close()


def test_a_server_that_nobody_runs_is_told() -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        where = f"grpc://127.0.0.1:{free.getsockname()[1]}"
    with pytest.raises(LineLostError) as told:
        DaqHardware(dataclasses.replace(mixer_wiring(), connection=where), patience=0.5)
    one_line(told, where, "no device server answers within 0.5 s")


@pytest.mark.skipif(ctypes.util.find_library("nidaqmx") is not None, reason="an NI-DAQmx driver is installed here")
def test_a_missing_driver_is_told() -> None:
    with pytest.raises(LineLostError) as told:
        DaqHardware(mixer_wiring())
    one_line(told, "Dev1", "no NI-DAQmx driver is installed", "grpc://host:port")


@pytest.mark.parametrize("module", ["nidaqmx.errors", "grpc"])
def test_a_missing_library_names_the_extra(module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    with pytest.raises(InputError) as told:
        DaqHardware(dataclasses.replace(mixer_wiring(), connection="grpc://127.0.0.1:1"))
    one_line(told, module.split(".")[0], "mckibben[daq]", "nidaqmx[grpc]")


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"block": 0}, ("block", "1 or more")),
        ({"block": 1.5}, ("block", "whole number")),
        ({"buffer": -1.0}, ("buffer", "1 ms")),
        ({"silence": float("nan")}, ("silence", "1 ms")),
    ],
)
def test_wrong_options_are_refused_before_anything_is_opened(options: dict[str, float], words: tuple[str, ...]) -> None:
    with pytest.raises(InputError) as told:
        DaqHardware(mixer_wiring(), **options)
    one_line(told, *words)
