"""The machine behind a serial line and behind a card: the same counts give the same run, bit for bit."""

import contextlib
import dataclasses

import numpy as np
import pytest
from short_runs import bench, triangle

from mckibben.bench.hardware.backends import connected
from mckibben.bench.run import run
from mckibben.bench.segment import SegmentMachine, timing_of
from mckibben.errors import InputError, LineLostError
from mckibben_hardware.serial_line.device import About
from mckibben_hardware.serial_line.microcontroller import Faults, in_thread

MEASURED = ("pressure", "valve_pressure", "tension", "span")
SHORTER = {"load": "50 N", "frequency": "10 Hz", "cycles": 1}


def prepared(**values):
    return bench("isotonic-triangle", **(SHORTER | values))


def simulated(made):
    (part,) = made.segments()
    return SegmentMachine(made, 0, part, timing_of(made)).at_interface()


@contextlib.contextmanager
def serial(made, *, lock_step=True, **options):
    """The bench's machine behind a pseudo-terminal, and the rig's hardware at its other end."""
    rest = int(made.rig.motor_out.count(0.0))
    with in_thread(simulated(made), about=About(motor_rest=rest), **options) as device:
        with connected(f"serial:{device.port}", made.rig, 1.0 / made.plan.sample_rate, lock_step=lock_step) as hardware:
            yield hardware, device.microcontroller


def same(one, other):
    for name in MEASURED:
        assert np.array_equal(one[name], other[name]), name
    for name in ("valve.command", "motor.command", "command.pressure", "command.tension"):
        assert np.array_equal(one[name], other[name]), name


def test_in_lock_step_the_serial_line_gives_the_simulated_run_bit_for_bit():
    made = prepared()
    with serial(made) as (hardware, _):
        there = run(made, hardware=hardware)
    assert there.meta["result"] == "done" and there.meta["hardware"]["lost"] == 0
    same(there, run(made, real_time=True))
    assert not any(name.startswith("muscle.") for name in there.channels)  # nobody knows what is true there


def test_a_line_that_is_unplugged_ends_the_run_and_what_there_is_is_kept():
    made = prepared()
    with serial(made, faults=Faults(at={4080: "unplug"})) as (hardware, _):
        there = run(made, hardware=hardware)
    assert there.meta["result"] == "stopped" and "unplugged" in there.meta["message"]
    assert there.meta["events"][-1]["code"] == "lost_line" and len(there) > 50


def test_an_interlock_vents_the_real_machine_at_the_sample_that_sees_it():
    made = prepared()
    tight = made.rig.interlocks.replace(most_tension=52.0)
    made = dataclasses.replace(made, rig=dataclasses.replace(made.rig, interlocks=tight))
    with serial(made) as (hardware, _):
        there = run(made, hardware=hardware)
    assert there.meta["result"] == "stopped" and "over force" in there.meta["message"]
    (event,) = [e for e in there.meta["events"] if e.get("code") == "over_force"]
    assert there["valve.command"][there.time >= event["time"] - 1e-4].max() == 0.0


def test_a_device_that_is_not_the_rigs_is_refused():
    made = prepared()
    machine = simulated(made)
    machine.bits = (12, *machine.bits[1:])
    with in_thread(machine) as device, pytest.raises(InputError, match="bits"):
        with connected(f"serial:{device.port}", made.rig, 1e-3):
            pass
    with pytest.raises(InputError, match="must be serial:PORT"), connected("usb", made.rig, 1e-3):
        pass
    with pytest.raises(InputError, match="how the card is wired"), connected("daq", made.rig, 1e-3):
        pass


def test_a_machine_refuses_another_period():
    machine = simulated(prepared())
    machine.period = 1e-3
    with pytest.raises(LineLostError, match="made for samples every 0.001 s"):
        machine.period = 2e-4


@pytest.mark.slow
def test_in_lock_step_the_card_gives_the_simulated_run_bit_for_bit():
    pytest.importorskip("nidaqmx")
    from mckibben_hardware.daq import Analog, CardWiring, Counter, DaqHardware, Drive, SimulatedDevice

    made = bench("isotonic-triangle", load="50 N", frequency="5 Hz", cycles=2)
    of = {n: s.converter for n, s in made.rig.sensors.items()}
    inputs = {
        n: Analog(channel=f"Dev1/ai{i}", low=0.0, high=10.0, bits=of[n].bits, range=(0.0, 10.0))
        for i, n in enumerate(sorted(of))
    }
    out, motor = made.rig.valve_out, made.rig.motor_out
    wiring = CardWiring(
        inputs=inputs, valve=Analog(channel="Dev1/ao0", low=0.0, high=10.0, bits=out.bits, range=(0.0, 10.0)),
        motor=Drive(channel="Dev1/ao1", low=-10.0, high=10.0, bits=motor.bits, range=(-10.0, 10.0), rest=0.0),
        encoder=Counter(counter="Dev1/ctr0", bits=made.rig.encoder.counter_bits),
    )  # fmt: skip
    with SimulatedDevice(simulated(made), wiring, lock_step=True, zeroed=False) as device:
        hardware = DaqHardware(device.wiring, patience=60.0, silence=60.0)
        try:
            there = run(made, hardware=hardware)
        finally:
            hardware.close()
    assert there.meta["result"] == "done"
    same(there, triangle())
