"""Sessions: what a person is asked for, which points are refused, and readings from a machine at the hardware border."""

import re

import numpy as np
import pytest

from mckibben.bench.hardware.interface import Hardware
from mckibben.bench.rig_file import rig
from mckibben.errors import InputError, LineLostError
from mckibben_hardware.calibrate import verbs
from mckibben_hardware.calibrate.estimate import Reference
from mckibben_hardware.calibrate.session import (
    CalibrationSession,
    HardwareReadings,
    OperatorTask,
    SimulatedPerson,
    SimulatedSensors,
    grids,
)

DATE = "2026-03-31T12:00:00+00:00"
MODERN = rig("modern")


def session(source, ask, **more) -> CalibrationSession:
    return CalibrationSession(source=source, ask=ask, date=DATE, samples=64, **more)


def simulated(machine=MODERN, **more) -> CalibrationSession:
    source = SimulatedSensors(machine)
    return session(source, SimulatedPerson(source), **more)


def test_masses_are_asked_for_up_and_down_again():
    one = simulated()
    done = one.weights([2.0, 0.0, 1.0])
    nothing, first, second = "hang nothing on the cell", "hang 1 kg on the cell", "hang 2 kg on the cell"
    assert one.ask.asked == [nothing, first, second, first, nothing]
    assert [p.setting for p in done.points["tension"]] == [0.0, 1.0, 2.0, 1.0, 0.0]
    origin = done.corrections["tension"].terms["gain"].origin
    assert (origin.method, origin.date, origin.points) == ("weights", DATE, 5)


def test_what_the_reference_shows_counts_and_not_what_was_asked_for():
    source = SimulatedSensors(rig("modern", {"sensors.pressure.gain_error": "0.05", "sensors.pressure.noise": "0 bar"}))

    def ask(task: OperatorTask) -> float:
        shown = task.values["pressure"] * 1.03 + 200.0
        source.put({"pressure": shown})
        return shown

    done = session(source, ask).pressure([1e5, 5e5], Reference(), ["pressure"])
    assert done.points["pressure"][0].true == 1.03e5 + 200.0
    assert done.corrections["pressure"].gain == pytest.approx(1.0 / 1.05, abs=1e-4)  # a count of 18 Pa on 4e5 Pa


def test_several_channels_see_the_same_pressures_and_the_encoder_gets_no_zero():
    done = simulated().pressure([0.0, 4e5], Reference(), ["pressure", "valve_pressure"])
    assert set(done.corrections) == {"pressure", "valve_pressure"}
    span = simulated().encoder([0.0, 0.1], Reference()).corrections["span"]
    assert set(span.terms) == {"gain"}


@pytest.mark.parametrize(
    ("change", "call", "said"),
    [
        ({"sensors.tension.noise": "20 N"}, "weights", r"scatter of tension must be at most 11 N, got .* N; is it at rest"),
        ({"sensors.tension.offset": "1095 N"}, "weights", "are at an end of the converter"),
        ({"sensors.tension.high": "50 N"}, "weights", "reference for tension must be between -1000 N"),
        ({"sensors.pressure.offset": "-1.1 bar"}, "zero", "reading of pressure must lie between"),
    ],
)  # fmt: skip
def test_a_point_that_is_not_fit_for_use_is_refused_in_one_line(change, call, said):
    one = simulated(rig("modern", change))
    with pytest.raises(InputError, match=said) as error:
        one.zero(["pressure"]) if call == "zero" else one.weights([0.0, 10.0])
    assert "\n" not in str(error.value)


def test_a_sensor_that_repeats_its_reading_though_the_reference_moved_is_refused():
    class Stuck(SimulatedSensors):
        def put(self, values):
            super().put({n: min(v, 15.0) for n, v in values.items()})

    source = Stuck(MODERN)
    with pytest.raises(InputError, match="must follow the reference, which went from 19.61 N to 29.42 N"):
        session(source, SimulatedPerson(source)).weights([0.0, 1.0, 2.0, 3.0])


def test_a_refused_point_is_asked_for_again_where_somebody_can_do_it():
    source, told, asked = SimulatedSensors(MODERN), [], []

    def ask(task: OperatorTask) -> None:
        asked.append(task.sentence)
        forgot = task.values["tension"] > 0.0 and len(told) == 0
        source.put({"tension": 0.0 if forgot else task.values["tension"]})

    done = session(source, ask, again=lambda error: told.append(str(error))).weights([0.0, 5.0])
    assert asked.count("hang 5 kg on the cell") == 2 and len(told) == 1
    assert "must follow" in told[0]
    assert done.corrections["tension"].gain == pytest.approx(1.0, abs=1e-3)  # noise of 50 mN on 49 N


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda s: s.weights([1.0]), "masses must be two different ones or more"),
        (lambda s: s.weights([]), "masses must be two different ones"),
        (lambda s: s.weights([1.0, 1.0]), "masses must be different ones, got '1 kg, 1 kg'"),
        (lambda s: s.weights([-1.0, 1.0]), "masses must be 0 kg or more, got -1 kg"),
        (lambda s: s.weights([0.0, 1.0], channel="tenson"), "Unknown channel 'tenson'. Did you mean 'tension'"),
        (lambda s: s.zero(["span"]), "an encoder is zeroed where it is mounted"),
        (lambda s: s.skew(["pressure"], frequency=20.0), "two or more"),
        (lambda s: s.pressure([0.0, float("nan")], Reference(), ["pressure"]), "pressures must be"),
    ],
)
def test_what_no_session_can_be_made_of_is_refused_before_anybody_is_asked(call, said):
    one = simulated()
    with pytest.raises(InputError, match=said):
        call(one)
    assert not one.ask.asked


def test_a_rig_without_an_encoder_has_none_to_calibrate():
    source = SimulatedSensors(MODERN)
    source.grids = {n: g for n, g in source.grids.items() if n != "span"}
    with pytest.raises(InputError, match="Unknown channel 'span'. The rig has pressure"):
        session(source, SimulatedPerson(source)).encoder([0.0, 0.1], Reference())


class Machine(Hardware):
    """Counts that a session's tasks set; `lost` loses the line after so many samples."""

    def __init__(self, lost: int | None = None) -> None:
        super().__init__(("pressure", "tension", "valve_pressure"), encoder=True, motor=True)
        self.given, self.lost = dict.fromkeys(self.names, 40000), lost
        self.done: list[str] = []
        self.sent = 0

    def start(self, period: float) -> None:
        self.done.append("start")

    def _vent_now(self) -> None:
        self.done.append("vent")

    def wait(self, sample: int) -> float:
        assert sample == self.sent
        if self.lost is not None and sample >= self.lost:
            raise LineLostError("line is silent")
        self.counts = [self.given[n] for n in self.names]
        return 0.0

    def send(self) -> None:
        self.sent += 1

    def close(self) -> None:
        self.done.append("close")


def test_a_machine_is_vented_held_without_force_and_let_go_and_its_counts_become_nominal_values():
    machine = Machine()
    machine.edges = -3
    with HardwareReadings(machine, MODERN.converters(0.2), grids(MODERN)) as source:
        found = source.read(20)
        assert source.grids["tension"].resolution == pytest.approx(2200.0 / 65536)
    at = MODERN.sensors["tension"].converter
    assert np.array_equal(found["tension"], np.full(20, float(at.value(40000.0))))
    assert np.array_equal(found["span"], np.full(20, -3.0 * float(MODERN.encoder.resolution)))
    assert machine.done == ["start", "vent", "close"]
    assert machine.motor == 32768  # no force, in the middle of -900 N to 900 N
    assert machine.sent >= 20


def test_a_session_on_a_machine_finds_the_gain_of_its_counts():
    machine = Machine()
    with HardwareReadings(machine, MODERN.converters(0.2), grids(MODERN)) as source:

        def ask(task: OperatorTask) -> None:
            machine.given["tension"] = int(
                MODERN.sensors["tension"].converter.code(1.04 * task.values["tension"] + 2.0)
            )

        done = session(source, ask).weights([0.0, 1.0, 5.0, 10.0])
    low, high = done.corrections["tension"].term("gain").interval()
    assert low <= 1.0 / 1.04 <= high and high - low < 1e-3


def test_a_lost_line_ends_the_reading_with_its_reason_and_the_machine_is_let_go():
    machine = Machine(lost=10)
    with (
        pytest.raises(LineLostError, match="line is silent"),
        HardwareReadings(machine, MODERN.converters(0.2), grids(MODERN)) as source,
    ):
        source.read(1000)
    assert machine.done == ["start", "vent", "close"]


def test_channels_that_a_machine_does_not_have_are_named():
    machine = Machine()
    machine.names = ("pressure",)
    with pytest.raises(InputError, match="Unknown channels 'valve_pressure, tension'. The machine has pressure"):
        HardwareReadings(machine, MODERN.converters(0.2), grids(MODERN))


@pytest.mark.parametrize(
    ("session", "said"),
    [
        ({}, "rig is missing: paper, modern, or a .toml file"),
        ({"rigg": "modern"}, "Unknown session 'rigg'. Did you mean 'rig'?"),
        ({"rig": "modern"}, "machine is missing: give machine MACHINE or simulate=True"),
        ({"rig": "modern", "machine": "serial:/dev/none"}, "ask is missing: a function that has an operator set each"),
        ({"rig": MODERN, "changes": {"rig.sensors.tension.offset": "3 N"}}, "changes are allowed only of a rig"),
    ],
)
def test_what_is_wrong_with_a_session_is_said_to_python_in_its_words(session, said):
    with pytest.raises(InputError, match=f"^{re.escape(said)}"):
        verbs.calibrate_weights(session=session, masses="0 kg, 5 kg")


def test_a_session_takes_the_rig_itself_and_answers_as_for_its_name():
    named, itself = (
        verbs.calibrate_weights(session={"rig": one, "simulate": True}, masses=[0.0, 5.0]) for one in ("modern", MODERN)
    )
    assert named.to_dict()["points"] == itself.to_dict()["points"]
