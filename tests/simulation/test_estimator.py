"""Length and tension are found from the pressure alone, and the interval knows what is not known of the muscle."""

import functools
import math

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben.muscles.elements import MaxwellChain
from mckibben.muscles.hysteresis.maxwell_slip import MaxwellSlip
from mckibben.muscles.hysteresis.slip import FrictionLimit

SECONDS = 5.0
NOISE = 580.0  # of the pressure [Pa]


def machine():
    """A weight on a muscle with friction and creep, on a spool valve, at 1 kHz."""
    travel, force = np.array([0.05e-3, 0.3e-3, 2e-3, 12e-3]), np.array([4.7, 2.1, 3.9, 20.4])
    muscle = mk.Muscle(
        mk.muscle("DMSP-10-250").law,
        friction=MaxwellSlip(
            limit=FrictionLimit(constant=0.25 * force, per_pressure=0.75 * force / 5e5), stiffness=force / travel
        ),
        creep=MaxwellChain(stiffness=np.array([553.0, 40.0]), time_constant=np.array([1.0, 30.0])),
    )
    load = mk.Weight(muscle, mass="5 kg", start="24.2 cm", damping=60.0)
    return mk.Simulation(load, mk.Air(valve="MPYE-5-1-8-LF"), period="1 ms")


def load_at(time):
    """Steps of 30 and -40 N, and 8 N at 0.3 Hz."""
    return 8.0 * math.sin(0.6 * math.pi * time) + 30.0 * (time > 1.5) - 40.0 * (time > 3.0)


@functools.cache
def followed(diameter=1.0, trusted=False):
    """Truth (n, 3) and estimate with its ends (n, 3, 3): length, tension, load; after a second."""
    sim = machine()
    path = "units.muscle.law.rest_diameter"
    real = machine().with_parameters({path: diameter * float(sim.machine.units["muscle"].law.rest_diameter)})
    spread = {} if trusted else {"muscle.law.rest_diameter": "2.5 %"}
    observer = sim.estimator(("pressure",), {"force": "25 N"}, spread=spread, noise={"pressure": NOISE})
    random, seen = np.random.default_rng(1), real.reset()
    observer.reset(pressure=seen.pressure)
    truth, known = [], []
    for k in range(round(SECONDS / 1e-3)):
        goal = 3e5 + 0.8e5 * math.sin(0.8 * math.pi * k * 1e-3)
        command = min(max((goal - seen.pressure) / 1e5, -1.0), 1.0)
        seen = real.step(muscle=command, force=load_at(k * 1e-3))
        found = observer.step(muscle=command, pressure=seen.pressure + NOISE * random.standard_normal())
        load = found.unknown["force"]
        truth.append([seen.length, seen.tension, load_at(k * 1e-3)])
        known.append(
            [[e.length, e.tension, v] for e, v in zip((found.mean, found.low, found.high), load[:3], strict=True)]
        )
    return np.array(truth)[1000:], np.array(known)[1000:]


def errors(truth, known):
    return np.sqrt(np.mean((known[:, 0] - truth) ** 2, axis=0))


def held(truth, known):
    return np.mean((truth >= known[:, 1]) & (truth <= known[:, 2]), axis=0)


def test_length_and_tension_of_a_known_muscle_are_found_from_its_pressure():
    length, tension, _ = errors(*followed(trusted=True))
    assert length < 0.25e-3
    assert tension < 3.0  # of some 250


@pytest.mark.parametrize("diameter", [1.0, 1.025])
def test_the_interval_holds_what_it_says_also_for_a_muscle_that_pulls_5_percent_more(diameter):
    assert np.all(held(*followed(diameter)) > 0.9)


def test_an_interval_that_trusts_a_wrong_muscle_does_not_hold():
    assert held(*followed(1.025, trusted=True))[0] < 0.5  # so that the test above can fail


def test_the_same_seed_gives_the_same_bits_and_a_missing_measurement_widens():
    sim, ends = machine(), []
    observer = sim.estimator(noise={"pressure": NOISE}, spread={"rest_diameter": 0.02}, lanes=16)
    for _ in range(2):
        observer.reset(seed=3, pressure="2.3 bar")
        for _ in range(20):
            seen = observer.step(muscle=0.1, pressure=2.3e5)
        ends.append(seen.mean)
    assert ends[0] == ends[1]
    width = seen.high.pressure - seen.low.pressure
    for _ in range(100):
        blind = observer.step(pressure=math.nan)
    assert blind.high.pressure - blind.low.pressure > width


def test_what_was_assumed_is_said():
    said = [str(c) for c in machine().estimator(lanes=8).cautions]
    assert any("noise of pressure" in one for one in said)
    assert any("no spread of muscles" in one for one in said)
    known = mk.Simulation(mk.Weight("festo-10mm", mass="5 kg")).estimator(noise={"pressure": "6 mbar"}, lanes=8)
    assert known.cautions == ()
    assert known.spread["units.muscle.law." + next(iter(known.spread)).rpartition(".")[2]] > 0.02


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"measured": ("presure",)}, "pressure"),
        ({"measured": "pressure"}, "names of fields"),
        ({"unknown": ("forc",)}, "force"),
        ({"unknown": {"force": "0 N"}}, "above zero"),
        ({"spread": {"rest_diametre": 0.02}}, "rest_diameter"),
        ({"spread": {"rest_diameter": 2.0}}, "share between 0 and 1"),
        ({"spread": {"muscle.friction.stiffness": 0.1}}, "is a number"),
        ({"lanes": 2}, "8 or more"),
        ({"noise": {"pressure": -600.0}}, "standard deviation above zero"),
    ],
)
def test_what_cannot_be_is_refused_in_a_sentence(options, said):
    with pytest.raises(InputError, match=said):
        machine().estimator(**options)


def test_a_step_takes_commands_and_measured_fields_by_name():
    observer = machine().estimator(lanes=8)
    with pytest.raises(InputError, match="by name"):
        observer.step(0.2)
    with pytest.raises(InputError, match="muscle"):
        observer.step(force=3.0)  # unknown, and no command


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({"pressure": "2 m"}, "pressure must be a pressure"),
        ({"pressure": None}, "pressure must be a number"),
        ({"pressure": True}, "pressure must be a number"),
        ({"pressure": "-3 bar"}, "pressure must be a gauge pressure above vacuum"),
        ({"muscle": math.nan}, "muscle must be a finite number"),
        ({"muscle": "2 bar"}, "muscle must be a pure number"),
    ],
)
def test_a_value_that_cannot_be_is_refused_before_a_lane_moves(values, said):
    observer = machine().estimator(lanes=8)
    observer.reset()
    with pytest.raises(InputError, match=said):
        observer.step(**values)
    fresh = machine().estimator(lanes=8)
    fresh.reset()
    assert observer.step(pressure="0.2 bar").mean == fresh.step(pressure=2e4).mean  # the same bits


@pytest.mark.parametrize(
    ("options", "sentence"),
    [
        ({"noise": {"pressure": "3e5 bar"}}, "a noise of pressure of 3e5 bar can hardly be meant"),
        ({"unknown": {"force": "5e6 N"}}, "a force of 5e6 N can hardly be meant"),
        ({"unknown": {"force": "5 mN"}}, "a force of 5 mN can hardly be meant"),
    ],
)
def test_a_size_that_can_hardly_be_meant_is_said(options, sentence):
    stated = {"unknown": {"force": "25 N"}, "noise": {"pressure": "6 mbar"}, "spread": {}} | options
    with pytest.warns(mk.errors.PlausibilityWarning, match=sentence):
        observer = machine().estimator(lanes=8, **stated)
    assert sentence in str(observer.cautions)


@pytest.mark.parametrize(("shown", "meant"), [(2.3, "2.3 bar"), (230.0, "230 kPa")])
def test_a_reading_that_another_unit_would_bring_to_the_lanes_is_said_once(shown, meant):
    """The filter would take it for a muscle without pressure, or find no lane that has it."""
    observer = machine().estimator(unknown={"force": "25 N"}, noise={"pressure": NOISE}, spread={}, lanes=16)
    observer.reset(pressure="2.3 bar")
    for off in (0.0, NOISE, 6.0 * NOISE):
        observer.step(muscle=0.0, pressure=2.3e5 + off)
    assert observer.cautions == ()
    with pytest.warns(mk.errors.PlausibilityWarning, match=f"was {meant} meant") as said:
        for _ in range(2):
            observer.reset(pressure="2.3 bar")
            observer.step(pressure=shown)
    assert len(said) == 1
    assert [one.parameter for one in observer.cautions] == ["pressure"]


def recorded():
    sim = machine()
    seen = sim.reset(seed=3)
    for k in range(40):
        seen = sim.step(muscle=min(max((3e5 - seen.pressure) / 1e5, -1.0), 1.0), force=10.0 * (k > 20))
    return sim.recording()


def test_a_record_is_gone_over_sample_by_sample_and_nothing_but_its_sensors_is_read():
    record, observer = recorded(), machine().estimator(unknown={"force": "25 N"}, noise={"pressure": NOISE}, lanes=16)
    known = observer.over(record, seed=4)
    observer.reset(seed=4, pressure=record["muscle.pressure"][0])
    for k in range(1, len(record)):
        found = observer.step(muscle=record["muscle.command"][k - 1], pressure=record["muscle.pressure"][k])
        for name in ("length", "tension", "pressure"):
            ends = [known[f"estimated.{name}{end}"][k] for end in ("", ".low", ".high")]
            assert ends == [getattr(one, name) for one in (found.mean, found.low, found.high)]  # the same steps
        assert known["estimated.force"][k] == found.unknown["force"].value
    sensors = ("muscle.command", "muscle.pressure")
    poisoned = {
        name: mk.Channel(np.full(len(record), 1e9), channel.unit, channel.kind)
        for name, channel in record.channels.items()
        if name not in sensors
    }
    hidden = observer.over(record.with_channels(poisoned), seed=4)
    assert all(np.array_equal(hidden[name], known[name]) for name in known.names("estimated"))
    assert known.meta["estimator"]["measured"] == {"pressure": "muscle.pressure"}
    assert any("no spread of muscles" in one for one in known.meta["warnings"])


def test_a_record_without_the_sensor_or_with_other_samples_is_refused():
    record, observer = recorded(), machine().estimator(lanes=8)
    bare = record.pick([name for name in record.names() if "pressure" not in name])
    with pytest.raises(InputError, match="pressure"):
        observer.over(bare)
    with pytest.raises(InputError, match="uniform"):
        observer.over(mk.Recording(2.0 * record.time, record.channels, record.meta))


def test_what_is_estimated_is_kept_in_a_file_as_such(tmp_path):
    known = machine().estimator(lanes=8).over(recorded())
    again = mk.read_recording(known.save(tmp_path / "observed.nc"))
    assert again.names("estimated") == known.names("estimated") != []
    assert np.array_equal(again["estimated.length.low"], known["estimated.length.low"])
