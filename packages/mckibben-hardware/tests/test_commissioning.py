"""The check of a machine before its first run: right wiring passes, and every wrong one is told by what it is."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from mckibben.bench.hardware.interface import Hardware
from mckibben.bench.rig_file import rig
from mckibben.errors import InputError, LineLostError
from mckibben_hardware.commissioning import check_machine, simulated_machine, write_measured_rig

PERIOD = 4e-3
MODERN = rig("modern")


class Bench(Hardware):
    """A tube and a load on the desk: the muscle's pressure lags behind the valve's, the cell and the motor follow."""

    dead_samples, time_constant, stiffness = 3, 0.05, 2000.0  # [1], [s], [N/m]

    def __init__(self, *, fault: str = "", motor: bool = True) -> None:
        converters = MODERN.converters(0.0)
        super().__init__(converters.names, encoder=True, motor=motor, motor_rest=int(converters.motor.count(0.0)))
        self.scales, self.fault, self.motor_rest = converters.analog, fault, self.motor
        self.pressure, self.closed, self.valve_asked = 0.0, 0.0, 0.0
        self.asked = [0.0] * self.dead_samples
        self.noise = np.random.default_rng(5)
        self.sent = 0
        self.low = [float(self.scales[n].low) for n in self.names]
        self.count = [float(self.scales[n].resolution) for n in self.names]
        self.rms = [float(MODERN.sensors[n].noise) for n in self.names]
        self.valve_low, self.valve_count = float(MODERN.valve_out.low), float(MODERN.valve_out.resolution)
        self.motor_low, self.motor_count = float(MODERN.motor_out.low), float(MODERN.motor_out.resolution)
        self.edge = float(MODERN.encoder.resolution)

    def start(self, period: float) -> None:
        self.period = period

    def true(self) -> dict[str, float]:
        force = self.motor_low + self.motor_count * self.motor if self.has_motor else 0.0
        tension = 2e-5 * self.pressure + force
        values = {"pressure": self.pressure, "valve_pressure": self.valve_asked, "tension": tension}
        self.edges = int(force / self.stiffness / self.edge)
        if self.fault in ("encoder turned", "motor turned"):
            self.edges = -self.edges
        if self.fault == "motor turned":  # it lets the muscle go slack
            values["tension"] = 0.0
        if self.fault == "one pressure":
            values["valve_pressure"] = self.pressure
        if self.fault == "cell turned":
            values["tension"] = -tension
        if self.fault == "scale":
            values["pressure"] *= 0.5
        if self.fault == "offset":
            values["pressure"] += 2e5
        if self.fault == "plug":
            values["pressure"] = 0.0
        if self.fault == "exchanged":
            values = {**values, "tension": self.as_counts("pressure", "tension", self.pressure)}
            values["pressure"] = self.as_counts("tension", "pressure", tension)
        if self.fault == "exchanged pressures":
            values["pressure"], values["valve_pressure"] = self.valve_asked, self.pressure
        if self.fault == "noise":
            values["tension"] += 60.0 * self.noise.standard_normal()
        return values

    def as_counts(self, wired: str, read: str, value: float) -> float:
        """What a channel reads where the signal of another is wired to it."""
        at, to = self.names.index(wired), self.names.index(read)
        return self.low[to] + (value - self.low[at]) / self.count[at] * self.count[to]

    def wait(self, sample: int) -> float:
        if self.fault == "torn line" and sample == 300:
            raise LineLostError("port: unplugged")
        true = self.true()
        counts = []
        for name, low, count, rms in zip(self.names, self.low, self.count, self.rms, strict=True):
            value = true[name] + rms * self.noise.standard_normal()
            counts.append(min(max(math.floor((value - low) / count + 0.5), 0), 65535))
            if self.fault == f"open {name}":
                counts[-1] = 65535
        self.counts = counts
        return 0.0

    def send(self) -> None:
        self.sent += 1
        vents = self.venting and self.fault != "does not vent"
        self.asked.append(0.0 if vents else self.valve_low + self.valve_count * self.valve)
        asked = self.valve_asked = self.asked.pop(0)
        shut = not (self.opened or vents) and self.fault != "shut-off"
        if not shut:
            self.pressure += (asked - self.pressure) * -math.expm1(-self.period / self.time_constant)

    def _vent_now(self) -> None:
        if self.fault != "does not vent":
            self.asked = [0.0] * self.dead_samples

    def close(self) -> None:
        self.vent()


def results(fault: str, **options):
    one = check_machine(Bench(fault=fault), MODERN, period=PERIOD, plumbing="tight", motor=True, **options)
    return one, {(r.channel, r.test) for r in one.failures()}


def test_a_machine_that_is_wired_right_passes_every_test_and_tells_noise_and_delay():
    machine = Bench()
    one = check_machine(machine, MODERN, period=PERIOD, plumbing="tight", motor=True)
    assert one.passed and one.failures() == [] and machine.venting
    assert {r.channel for r in one.results} == {
        "pressure",
        "valve_pressure",
        "tension",
        "shut-off",
        "span",
        "vent",
        "line",
    }
    assert all(r.passed for r in one.results)
    values = {(r.channel, r.test): r.value for r in one.results}
    # The command of a sample acts with the dead time; the first order needs another sample to leave 5 % of the change.
    assert values["pressure", "delay"] == pytest.approx((machine.dead_samples + 1) * PERIOD, abs=1.001 * PERIOD)
    # An rms value of 250 samples is known to 1/sqrt(500) = 4.5 %; three times that.
    assert values["pressure", "noise"] == pytest.approx(1e2, rel=0.14)
    assert values["pressure", "scale"] == pytest.approx(1.0, abs=1e-3)
    assert values["tension", "scale"] == pytest.approx(1.0, abs=0.02)
    assert float(one.measured["sensors.pressure.noise"].split()[0]) == pytest.approx(1e-3, rel=0.14)


@pytest.mark.parametrize(
    ("fault", "expected"),
    [
        ("cell turned", ("tension", "sign")),
        ("encoder turned", ("span", "sign")),
        ("motor turned", ("span", "sign")),
        ("scale", ("pressure", "scale")),
        ("offset", ("pressure", "zero")),
        ("plug", ("pressure", "answer")),
        ("noise", ("tension", "noise")),
        ("open valve_pressure", ("valve_pressure", "range")),
        ("shut-off", ("shut-off", "tight")),
        ("does not vent", ("vent", "time")),
    ],
)
def test_a_fault_is_found_where_it_is(fault: str, expected: tuple[str, str]):
    one, failed = results(fault)
    assert not one.passed and expected in failed
    # Nothing else than the channel of the fault is blamed; without an answer of the pressure the limits stop the rest.
    assert {channel for channel, _ in failed} <= {expected[0], "machine"}
    assert all(": " in r.sentence for r in one.failures())  # what to do about it


@pytest.mark.parametrize(
    ("fault", "channel", "sentence"),
    [
        ("exchanged", "pressure", "tension changes by as many counts as it should"),
        ("exchanged pressures", "shut-off", "exchange the wires of pressure and valve_pressure"),
        ("exchanged pressures", "valve_pressure", "is behind pressure by"),
    ],
)
def test_exchanged_wires_are_told_by_the_channel_that_answers_instead(fault: str, channel: str, sentence: str):
    one, _ = results(fault)
    assert any(sentence in r.sentence for r in one.failures() if r.channel == channel), one.failures()


def test_pressures_that_move_together_are_said_to_be_not_told_apart():
    one, failed = results("one pressure")
    order = [r for r in one.results if r.test == "order"]
    assert [r.passed for r in order] == [None] and ("valve_pressure", "order") not in failed


def test_the_order_of_pressures_is_not_judged_where_the_sensor_at_the_valve_is_the_slower_one():
    slow = rig("modern", {"sensors.valve_pressure.cutoff": "20 1/s"})
    check = check_machine(Bench(fault="exchanged pressures"), slow, period=PERIOD)
    assert [r.passed for r in check.results if r.test == "order"] == [None]


def test_a_machine_above_a_limit_of_its_interlocks_is_vented_for_the_rest_of_the_check():
    tender = rig("modern", {"interlocks.most_tension": "1 N"})
    machine = Bench()
    one = check_machine(machine, tender, period=PERIOD)
    assert ("machine", "limits") in {(r.channel, r.test) for r in one.failures()}
    assert "above the rig's interlock" in one.failures()[0].sentence
    # Nothing flows any more a second after the limit was passed: 20 time constants.
    assert one.readings["pressure"][500:].max() < 0.01 * 1e5


def test_a_torn_line_ends_the_check_and_the_machine_is_vented():
    machine = Bench(fault="torn line")
    with pytest.raises(LineLostError, match="unplugged"):
        check_machine(machine, MODERN, period=PERIOD)
    assert machine.venting


def test_a_pressure_that_the_rig_does_not_reach_is_refused_before_anything_moves():
    machine = Bench()
    with pytest.raises(InputError, match="above 0 bar, and at most"):
        check_machine(machine, MODERN, pressure=20e5)
    assert machine.sent == 0


def test_measured_values_go_into_the_file_of_the_user_and_its_comments_stay(tmp_path: Path):
    one, _ = results("")
    own = tmp_path / "own.toml"
    own.write_text('schema = 1\n# mine\nname = "own"\nbase = "modern"\n[changes]\n"frame.longest" = "70 cm"\n')
    write_measured_rig(tmp_path / "out.toml", one, rig(own), str(own))
    again = rig(tmp_path / "out.toml")
    assert "# mine" in (tmp_path / "out.toml").read_text() and again.longest == pytest.approx(0.7)
    assert float(again.sensors["tension"].noise) == pytest.approx(0.05, rel=0.14)


def test_a_recording_of_the_check_has_every_sample(tmp_path: Path):
    one, _ = results("")
    recording = one.recording()
    assert recording.duration == pytest.approx(one.time[-1]) and set(recording.channels) >= {
        "pressure",
        "tension",
        "span",
    }


@pytest.mark.slow
@pytest.mark.parametrize(("name", "motor"), [("modern", True), ("paper", False)])
def test_the_simulated_machines_of_the_shipped_rigs_pass(name: str, motor: bool):
    one = rig(name)
    check = check_machine(simulated_machine(one, "nylon", motor=motor), one, motor=motor)
    assert check.passed, check.failures()
