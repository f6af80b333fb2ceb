"""A sensor of an installed package: declared once, it ends steps, stops the machine, and is recorded like any other."""

import importlib.metadata
import re

import numpy as np
import pytest
from short_runs import ADIABATIC, written

from mckibben import registry
from mckibben.bench.rig_file import rig
from mckibben.bench.run import run
from mckibben.errors import InputError
from mckibben.experiments.read import parse_protocol

SENSOR = {"low": "200 K", "high": "400 K", "noise": "0 K"}
CONVERTER = {"bits": "12", "low": "200 K", "high": "400 K"}
TEMPERATURE = {f"sensors.gas_temperature.{k}": v for k, v in SENSOR.items()} | {
    f"sensors.gas_temperature.converter.{k}": v for k, v in CONVERTER.items()
}
COUNT = 200.0 / 2**12  # K
FILL = '[[steps]]\nspan = "1 L0"\npressure = {{ to = "4 bar", in = "0.2 s" }}\nuntil = "{}"\nfor = "1 s"\n'


@pytest.fixture
def installed(monkeypatch):
    """A package that declares a sensor of the temperature."""
    point = importlib.metadata.EntryPoint("gas_temperature", "sensor_of_a_package:GAS_TEMPERATURE", "mckibben.sensors")
    registry.plugins.cache_clear()
    monkeypatch.setattr(registry, "_entry_points", lambda: [point])
    yield
    registry.plugins.cache_clear()


def test_a_step_ends_at_the_first_sample_at_which_the_sensor_of_a_package_reads_the_threshold(installed):
    recording = run(written(FILL.format("gas_temperature >= 310 K"), on=rig("paper", ADIABATIC | TEMPERATURE)))
    read = recording["gas_temperature"]
    assert recording.meta["steps"][0]["ended_by"] == "until" and recording.unit("gas_temperature") == "K"
    assert recording.channels["gas_temperature"].kind == "measured"
    assert read[-1] >= 310.0 > read[:-1].max()
    # without noise a reading lags the gas by the time of the 1 kHz filter, and is rounded to a count
    true = recording["muscle.temperature"]
    lag = np.abs(np.diff(true)).max() / 1e-3 / (2.0 * np.pi * 1e3)
    assert np.abs(read - true).max() < lag + COUNT


def test_an_interlock_on_the_sensor_of_a_package_stops_the_machine_and_says_why(installed):
    on = rig("paper", ADIABATIC | TEMPERATURE | {"sensors.gas_temperature.trip_above": "310 K"})
    recording = run(written(FILL.format("gas_temperature >= 350 K"), on=on))
    assert recording.meta["result"] == "stopped" and recording.meta["events"][-1]["code"] == "out_of_limits"
    said = (
        r"out of limits at [\d.]+ s: the gas temperature is 31\d(\.\d)? K; it must be 310 K or less; stopped and vented"
    )
    assert re.fullmatch(said, recording.meta["message"])
    over = np.flatnonzero(recording["gas_temperature"] > 310.0)[0]
    assert np.all(recording["valve.command"][over + 1 :] == 0.0)  # from the next sample on


def test_a_reading_after_the_end_of_the_protocol_stops_no_run(installed):
    # the gas goes on being compressed in the chunk in which the step has ended
    on = rig("paper", ADIABATIC | TEMPERATURE | {"sensors.gas_temperature.trip_above": "330 K"})
    recording = run(written(FILL.format("gas_temperature >= 310 K"), on=on))
    assert recording.meta["result"] == "done" and recording["gas_temperature"].max() < 330.0


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        ({"trip_above": "310 m"}, "trip_above must be a .*K"),
        ({"trip_above": "290 K", "trip_below": "300 K"}, "trip_above must be more than trip_below"),
    ],
)
def test_limits_that_make_no_sense_are_refused_with_their_place(installed, changes, said):
    with pytest.raises(InputError, match=said):
        rig("paper", TEMPERATURE | {f"sensors.gas_temperature.{k}": v for k, v in changes.items()})


def test_a_test_on_what_no_sensor_measures_is_refused_with_the_names(installed):
    head = 'schema = 1\nname = "t"\ntitle = "T"\n'
    with pytest.raises(InputError, match="Measured are pressure, span, velocity, tension, valve_pressure, .*gas_temp"):
        parse_protocol(head + FILL.format("humidity >= 1"), where="t.toml")
    with pytest.raises(InputError, match="must be a test without a set-point"):
        parse_protocol(head + FILL.format("gas_temperature within 1 K of its set-point"), where="t.toml")
