"""A card behind the unmodified `nidaqmx` client over gRPC, on a simulated device: nothing is lost, changed or delayed."""

import threading
import time
from collections.abc import Callable

import numpy as np
import pytest
from daq_machines import Clockwork, Mixer, clock_wiring, mixer_wiring, run, run_in_process, software

from mckibben.errors import LineLostError
from mckibben_hardware.daq import DaqHardware, SimulatedDevice

pytest.importorskip("nidaqmx", reason="needs the extra daq: pip install 'nidaqmx[grpc]'")
pytest.importorskip("grpc", reason="needs the extra daq: pip install 'nidaqmx[grpc]'")

PERIOD = 1e-3
SAMPLES = 500
PATIENT = {"patience": 10.0, "silence": 60.0}  # [s]: other tests share the processors


def until(what: Callable[[], bool], longest: float = 20.0) -> bool:
    end = time.monotonic() + longest
    while not what() and time.monotonic() < end:
        time.sleep(0.002)
    return what()


def test_in_lock_step_a_run_is_the_one_in_process_bit_for_bit() -> None:
    machine, alone, wired = Mixer(), Mixer(), mixer_wiring()
    with SimulatedDevice(machine, wired, zeroed=False) as device:
        hardware = DaqHardware(device.wiring, **PATIENT)
        hardware.start(PERIOD)
        seen = run(hardware, 0, SAMPLES)
        assert hardware.statistics.reads == SAMPLES
        assert hardware.statistics.overruns == 0
        assert seen == run_in_process(alone, wired, SAMPLES)
        assert machine.log == alone.log
        hardware.close()


def test_every_start_zeroes_the_encoder_and_the_machine_goes_on() -> None:
    machine, alone, wired = Mixer(), Mixer(), mixer_wiring()
    with SimulatedDevice(machine, wired) as device:
        hardware = DaqHardware(device.wiring, **PATIENT)
        for _ in range(3):
            zero = alone.sample()[1]
            hardware.start(PERIOD)
            seen = run(hardware, 0, 40)
            assert seen[0][1] == 0
            assert seen == run_in_process(alone, wired, 40, zero)
        hardware.close()


@pytest.mark.slow
@pytest.mark.parametrize(("count", "block"), [(2000, 1), (1000, 8)])
def test_by_its_own_clock_no_sample_is_lost_or_repeated(
    count: int, block: int, record_property: Callable[[str, object], None]
) -> None:
    # Times are reported and not asserted: client, server and clock share one interpreter and two processors.
    with SimulatedDevice(Clockwork(), clock_wiring(), lock_step=False) as device:
        hardware = DaqHardware(device.wiring, block=block, buffer=60.0, **PATIENT)
        hardware.start(PERIOD)
        late, began = np.zeros(count), time.perf_counter()
        for k in range(count):
            late[k] = hardware.wait(k)
            assert (hardware.counts[0], hardware.edges) == (k, k)
            hardware.write(k % 4096)
        took = time.perf_counter() - began
        statistics = hardware.statistics
        hardware.close()
    assert statistics.reads == count and statistics.overruns == 0
    assert statistics.late == (late > PERIOD).sum()
    assert (late >= 0.0).all()
    shares = [f"{1e3 * x:.2f}" for x in np.percentile(late, [50.0, 99.0, 99.9, 100.0])]
    told = f"blocks of {block}: {took:.2f} s for {count} samples of 1 ms, late by {', '.join(shares)} ms"
    record_property("lateness", told)
    print(told)


@pytest.mark.parametrize("sample", [0, 7])
def test_a_vent_from_another_thread_acts_within_two_samples_and_stays(sample: int) -> None:
    machine = Mixer()
    with SimulatedDevice(machine, mixer_wiring()) as device:
        hardware = DaqHardware(device.wiring, **PATIENT)
        hardware.start(PERIOD)
        run(hardware, 0, sample)
        other = threading.Thread(target=hardware.vent)
        other.start()
        other.join()
        run(hardware, sample, 20)
        hardware.close()
    asked = [entry[:1] + entry[2:] for entry in machine.log]
    assert len(asked) == sample + 20
    assert all(entry == (0, True) for entry in asked[sample + 1 :])
    assert any(entry != (0, True) for entry in asked[:sample]) or sample == 0
    assert len({motor for _, motor, _ in machine.log[sample + 1 :]}) > 10  # the software goes on to drive the motor


def test_a_vent_reaches_the_card_though_the_software_hangs() -> None:
    with SimulatedDevice(Mixer(), mixer_wiring(), lock_step=False) as device:
        hardware = DaqHardware(device.wiring, buffer=60.0, **PATIENT)
        hardware.start(PERIOD)
        hardware.wait(0)
        hardware.write(1234, 60000, opened=False)
        assert until(lambda: device.card.valve == 1234 and not device.card.opened)
        hardware.vent()
        assert until(lambda: device.card.valve == 0 and device.card.opened)
        assert device.card.motor == 60000
        hardware.close()


def test_who_sends_nothing_for_too_long_is_vented_and_told() -> None:
    with SimulatedDevice(Mixer(), mixer_wiring(), lock_step=False) as device:
        hardware = DaqHardware(device.wiring, buffer=60.0, patience=10.0, silence=0.1)
        hardware.start(PERIOD)
        hardware.wait(0)
        hardware.write(1234, 60000, opened=False)
        assert until(lambda: (device.card.valve, device.card.motor, device.card.opened) == (0, 32768, True))
        assert until(lambda: hardware.vented)
        for call in (hardware.send, lambda: hardware.wait(1)):
            with pytest.raises(LineLostError, match="nothing was sent for 0.1 s; the machine is vented"):
                call()
        hardware.start(PERIOD)  # begins anew
        assert hardware.wait(0) >= 0.0
        hardware.close()


def test_closing_vents_and_lets_the_motor_rest_once_and_for_all() -> None:
    machine = Mixer()
    with SimulatedDevice(machine, mixer_wiring()) as device:
        hardware = DaqHardware(device.wiring, **PATIENT)
        hardware.start(PERIOD)
        run(hardware, 0, 5)
        hardware.close()
        assert hardware.vented
        assert (device.card.valve, device.card.motor, device.card.opened) == (0, 32768, True)
        writes = device.card.writes
        hardware.close()
        assert device.card.writes == writes
        for call in (lambda: hardware.start(PERIOD), hardware.send, lambda: hardware.wait(5)):
            with pytest.raises(LineLostError, match="it was closed"):
                call()
        again = DaqHardware(device.wiring, **PATIENT)  # the terminals are free
        again.close()


def test_starting_puts_the_outputs_to_rest_and_opening_does_not_touch_them() -> None:
    with SimulatedDevice(Mixer(), mixer_wiring()) as device:
        device.card.write(77, 88, False)
        hardware = DaqHardware(device.wiring, **PATIENT)
        assert (device.card.valve, device.card.motor, device.card.opened) == (77, 88, False)
        hardware.start(PERIOD)
        assert (device.card.valve, device.card.motor, device.card.opened) == (0, 32768, True)
        hardware.close()


def test_a_machine_without_motor_encoder_and_shut_off_says_so() -> None:
    import dataclasses

    wired = dataclasses.replace(clock_wiring(), encoder=None)
    with SimulatedDevice(Clockwork(), wired) as device:
        hardware = DaqHardware(device.wiring, **PATIENT)
        assert not hardware.has_encoder and not hardware.has_motor
        hardware.start(PERIOD)
        for k in range(50):
            hardware.wait(k)
            assert hardware.counts == [k]
            hardware.write(software([k], 0, k)[0])
        hardware.close()
