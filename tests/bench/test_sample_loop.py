"""The loop by the wall clock: no sample is left out, the counts are the simulation's, and a stop vents at once."""

import os
import signal
import subprocess
import sys
from types import SimpleNamespace

import numpy as np
import pytest
from short_runs import SHORT, bench, closes, triangle

from mckibben.bench.hardware.simulated import Clock, SimulatedHardware
from mckibben.bench.rig_file import rig
from mckibben.bench.run import EmergencyStop, run
from mckibben.bench.segment import CHUNK, SegmentMachine, SensorNoise, timing_of
from mckibben.errors import InputError, LineLostError
from mckibben.recordings import read_any

VALUES = SHORT["isotonic-triangle"]


def machine(prepared, *, paced=False):
    (part,) = prepared.segments()
    return SimulatedHardware(
        SegmentMachine(prepared, 0, part, timing_of(prepared)).at_interface(), Clock() if paced else None
    )


class Until:
    """A stop that is asked at every sample, and says yes from some sample on."""

    reason = "pressed by the test"

    def __init__(self, at):
        self.at, self.asked = at, 0

    def __call__(self):
        self.asked += 1
        return self.asked > self.at


class Wrapped(SimulatedHardware):
    """A machine that is lost at some sample."""

    def __init__(self, inner, at):
        super().__init__(inner.machine)
        self.at = at

    def wait(self, sample):
        if sample == self.at:
            raise LineLostError("line test: nobody answers; stopped")
        return super().wait(sample)


@pytest.mark.slow
def test_by_the_wall_clock_every_sample_is_taken_and_the_channels_are_those_of_the_simulation(tmp_path):
    """The same pure step on the same arguments, compiled for one sample or for many: bit for bit, true channels too."""
    log = tmp_path / "run.mcap"
    clocked = run(bench("isotonic-triangle", **VALUES), real_time=True, log=log)
    deadlines = clocked.meta["deadlines"]
    assert len(clocked) == len(triangle())
    # not a sample is left out, however late a busy machine lets them be
    assert deadlines["samples"] == round(clocked.meta["steps"][-1]["end"] * 1000.0) + 1
    assert 0 <= deadlines["behind"] <= deadlines["late"] <= deadlines["samples"]
    assert sorted(clocked.channels) == sorted(triangle().channels)
    for name in clocked.channels:
        assert np.array_equal(clocked[name], triangle()[name], equal_nan=True), name
    closes(clocked)
    kept = read_any(log).recording
    assert kept.meta["result"] == "done" and kept.meta["digest"] == clocked.meta["digest"]
    for name in clocked.channels:
        assert np.array_equal(kept[name], clocked[name], equal_nan=True), name


@pytest.mark.slow
def test_at_the_border_there_are_counts_only_and_they_give_the_same_run():
    """Paced and unpaced runs differ in nothing but time: bit for bit."""
    prepared = bench("isotonic-triangle", **VALUES)
    at_once, paced = (run(prepared, hardware=machine(prepared, paced=p)) for p in (False, True))
    for name in at_once.channels:
        assert np.array_equal(at_once[name], paced[name], equal_nan=True), name
    assert at_once.meta["balance"] == {}  # of a machine that somebody else owns there are no accounts


@pytest.mark.slow
def test_samples_that_come_one_by_one_are_those_of_the_simulation_while_the_motor_moves_with_12_bits():
    """With counts finer than the noise no state may begin with more than was measured: bit for bit."""
    places = ("sensors.pressure", "sensors.tension", "sensors.valve_pressure", "outputs.valve", "outputs.motor")
    bits = {f"{p}{'.converter' if p.startswith('sensors') else ''}.bits": "12" for p in places}
    prepared = bench("sinusoids", on=rig("paper", bits), **SHORT["sinusoids"])
    scanned, sampled = run(prepared), run(prepared, hardware=machine(prepared))
    for name in sampled.channels:
        assert np.array_equal(scanned[name], sampled[name], equal_nan=True), name


def test_an_emergency_stop_vents_at_the_sample_that_sees_it_and_the_muscle_follows():
    prepared = bench("isotonic-triangle", **VALUES)
    rate = timing_of(prepared).sample_rate
    at = round(4.15 * rate)
    stopped = run(prepared, hardware=machine(prepared), stop=Until(at))
    assert stopped.meta["result"] == "stopped"
    (event,) = [e for e in stopped.meta["events"] if e.get("code") == "emergency_stop"]
    assert "pressed by the test" in event["text"] and "stopped and vented" in event["text"]
    assert event["time"] == pytest.approx(at / rate, abs=0.1 / rate)
    after = stopped.time >= event["time"] - 0.1 / rate
    command = stopped["valve.command"]
    assert command[after].max() == 0.0  # from that very sample on, of the two that are allowed
    assert stopped["pressure"][after][-1] < 0.2 * stopped["pressure"].max()
    assert stopped.time[-1] == pytest.approx(event["time"] + 0.5, abs=0.01)


def test_a_lost_line_ends_the_run_and_keeps_what_there_is():
    prepared = bench("isotonic-triangle", **VALUES)
    inner = machine(prepared)
    lost = Wrapped(inner, 4200)
    record = run(prepared, hardware=lost)
    assert record.meta["result"] == "stopped" and "nobody answers" in record.meta["message"]
    assert record.meta["events"][-1]["code"] == "lost_line"
    assert lost.venting and 100 < len(record) < len(triangle())


def test_a_machine_that_lacks_a_channel_is_refused_before_anything_moves():
    prepared = bench("isotonic-triangle", **VALUES)
    hardware = machine(prepared)
    hardware.names = ("pressure",)
    with pytest.raises(InputError, match="analogue channels of the machine"):
        run(prepared, hardware=hardware)


_CHILD = """
import sys
from types import SimpleNamespace
from mckibben.bench.run import EmergencyStop, prepare, run
from mckibben.experiments.read import protocol
button = EmergencyStop()
def show(times, arrays):
    if times[-1] > 0.2:
        print("going", flush=True)
with button.on_signals():
    record = run(prepare(protocol("isotonic-triangle", load="50 N", frequency="5 Hz", cycles=40), muscle="nylon"),
                 real_time=True, stop=button, display=show, log=sys.argv[1])
print(record.meta["message"])
"""


@pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
def test_a_signal_vents_and_the_log_says_so(tmp_path):
    log = tmp_path / "signalled.mcap"
    child = subprocess.Popen([sys.executable, "-c", _CHILD, str(log)], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline().strip() == "going"
    child.send_signal(signal.SIGTERM)
    said = child.communicate(timeout=60)[0].strip().splitlines()[-1]
    assert child.returncode == 0 and "signal SIGTERM; stopped and vented" in said
    kept = read_any(log).recording
    assert kept.meta["result"] == "stopped" and kept.meta["message"] == said
    (event,) = [e for e in kept.meta["events"] if e.get("code") == "emergency_stop"]
    assert kept["valve.command"][kept.time >= event["time"] - 1e-4].max() == 0.0


@pytest.mark.slow
def test_a_second_signal_ends_the_program():
    button = EmergencyStop()
    with button.on_signals():
        signal.raise_signal(signal.SIGINT)
        assert button() and button.reason == "signal SIGINT"
        with pytest.raises(KeyboardInterrupt):
            signal.raise_signal(signal.SIGINT)


def test_noise_open_wires_and_drifts_of_a_segment_go_by_its_seed_and_its_time():
    faults = [SimpleNamespace(channel="tension", at=6.005)]
    sensors = SimpleNamespace(sensors=["pressure", "tension"], faults=SimpleNamespace(drifts=lambda: {"pressure": 2.0}))
    about = SimpleNamespace(seed=3, plan=SimpleNamespace(sample_rate=100.0), rig=sensors, faults=faults)
    noise = SensorNoise(about, 1, begin=1.0, drifting=("span",))
    first, rows = noise.first(), [noise.next() for _ in range(2)]
    assert {kind: list(of) for kind, of in first.items()} == {kind: list(of) for kind, of in rows[0].items()}
    assert all(float(x) == 0.0 for of in first.values() for x in of.values())
    times = 1.0 + 0.01 * np.arange(2 * CHUNK)  # equal to the last bits, for sums of hundredths are rounded
    whole = {kind: {n: np.concatenate([row[kind][n] for row in rows]) for n in of} for kind, of in first.items()}
    assert whole["drift"]["pressure"] == pytest.approx(2.0 * times, rel=1e-12) and not whole["drift"]["span"].any()
    assert whole["lost"]["tension"].tolist() == (times > 6.005).tolist()
    assert not (whole["lost"]["pressure"].any() or whole["lost"]["span"].any())
    chance = np.random.default_rng([3, 1])
    drawn = np.concatenate([chance.standard_normal((2, CHUNK)) for _ in range(2)], axis=1)
    assert np.array_equal([whole["draws"]["pressure"], whole["draws"]["tension"]], drawn)
    sensors.faults.drifts = dict
    assert "drift" not in SensorNoise(about, 1).first() and "drift" not in SensorNoise(about, 1).next()
