"""Counts and levels of a card: the way there and back loses nothing, and a wrong wiring is told in one line."""

import subprocess
import sys
import tomllib
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest
from daq_machines import mixer_wiring

from mckibben.bench.hardware.converters import Scale
from mckibben.errors import InputError
from mckibben_hardware.daq import Analog, Counter, wiring

RANGES = [(0.0, 10.0), (-10.0, 10.0), (0.5, 4.5), (-0.2, 0.2), (1.0, 5.1)]
TABLE = """
[daq]
[daq.inputs.tension]
channel = "Dev1/ai3"
low = "-10 V"
high = "10 V"
bits = 16
[daq.inputs.pressure]
channel = "Dev1/ai0"
low = "0 V"
high = "10000 mV"
bits = 16
range = ["-10 V", "10 V"]
[daq.inputs.valve_pressure]
channel = "Dev1/ai1"
low = "0.5 V"
high = "4.5 V"
bits = 12
terminal = "rse"
[daq.valve]
channel = "Dev1/ao0"
low = "0 V"
high = "10 V"
bits = 12
[daq.motor]
channel = "Dev1/ao1"
low = "-10 V"
high = "10 V"
bits = 16
rest = "0 V"
[daq.shut_off]
line = "Dev1/port0/line0"
open_at = "low"
[daq.encoder]
counter = "Dev1/ctr0"
a = "/Dev1/PFI8"
b = "/Dev1/PFI10"
"""


def scale(low: float, high: float, bits: int) -> Analog:
    return Analog(channel="Dev1/ai0", low=low, high=high, bits=bits)


@pytest.mark.parametrize("bits", [12, 16])
@pytest.mark.parametrize(("low", "high"), RANGES)
def test_every_count_survives_its_level(low: float, high: float, bits: int) -> None:
    one = scale(low, high, bits)
    for count in range(1 << bits):
        assert one.count(one.volts(count)) == count


@pytest.mark.parametrize(("low", "high"), RANGES)
def test_a_level_counts_as_what_is_nearest(low: float, high: float) -> None:
    # 0.499 of a count: rounding of the levels themselves is 1e-12 of a count
    one = scale(low, high, 12)
    for count in range(1 << 12):
        for off in (-0.499, 0.499):
            assert one.count(one.volts(count) + off * one.step) == count


@pytest.mark.parametrize("bits", [12, 16])
@pytest.mark.parametrize(("low", "high"), RANGES)
def test_counts_and_levels_are_those_of_the_rigs_converters(low: float, high: float, bits: int) -> None:
    one, house = scale(low, high, bits), Scale(bits=bits, low=low, high=high)
    counts = np.arange(1 << bits)
    assert [one.volts(int(n)) for n in counts] == np.asarray(house.value(jnp.asarray(counts, float))).tolist()
    levels = np.random.default_rng(5).uniform(1.5 * low - 0.5 * high, 1.5 * high - 0.5 * low, 5000)
    assert [one.count(x) for x in levels.tolist()] == np.asarray(house.code(levels)).astype(int).tolist()


def test_beyond_the_scale_the_rail_is_shown() -> None:
    one = scale(-10.0, 10.0, 12)
    assert [one.count(x) for x in (-1e9, -10.1, 10.0, 1e300, float("inf"), float("-inf"))] == [
        0,
        0,
        4095,
        4095,
        4095,
        0,
    ]
    assert one.volts(-1) == one.volts(0) == -10.0
    assert one.volts(4096) == one.volts(10**30) == one.volts(4095) < 10.0


def test_what_is_no_number_has_no_count() -> None:
    with pytest.raises(ValueError, match="NaN"):
        scale(0.0, 10.0, 12).count(float("nan"))


@pytest.mark.parametrize("bits", [24, 32])
def test_an_encoder_below_its_zero_is_negative_however_the_card_shows_it(bits: int) -> None:
    counter = Counter(counter="Dev1/ctr0", bits=bits)
    for count in (0, 1, -1, 12345, -12345, (1 << (bits - 1)) - 1, -(1 << (bits - 1))):
        assert counter.signed(float(count)) == count
        assert counter.signed(float(count % (1 << bits))) == count


def test_a_table_in_words_is_the_wiring_in_numbers() -> None:
    assert wiring(tomllib.loads(TABLE)["daq"], where="lab.toml") == mixer_wiring()


def test_the_clock_is_that_of_the_inputs_device_or_its_chassis() -> None:
    assert mixer_wiring().sample_clock == "/Dev1/ai/SampleClock"
    moved = TABLE.replace("Dev1/a", "cDAQ1Mod2/a").replace('"/Dev1', '"/cDAQ1').replace("Dev1/ctr", "cDAQ1Mod3/ctr")
    assert wiring(tomllib.loads(moved)["daq"]).sample_clock == "/cDAQ1/ai/SampleClock"


WRONG: dict[str, tuple[str, Any, tuple[str, ...]]] = {
    "unit": ("valve.high", "10 bar", ("daq.valve.high", "10 bar", "V")),
    "no unit": ("valve.high", 10, ("daq.valve.high", "unit is missing")),
    "level": ("valve.high", "1 kV", ("daq.valve.high", "1000 V", "-100 V and 100 V")),
    "bits": ("inputs.pressure.bits", 40, ("daq.inputs.pressure.bits", "40", "2 to 24")),
    "bits in words": ("inputs.pressure.bits", "16", ("daq.inputs.pressure.bits", "whole number")),
    "upside down": ("valve.low", "11 V", ("daq.valve.high", "10 V", "more than low, 11 V")),
    "range": ("inputs.pressure.range", ["-5 V", "5 V"], ("daq.inputs.pressure.range", "-5 V to 5 V", "10 V or more")),
    "half a range": ("inputs.pressure.range", ["-5 V"], ("daq.inputs.pressure.range", "two levels")),
    "terminal": ("inputs.pressure.terminal", "diff", ("daq.inputs.pressure.terminal", "differential")),
    "terminal of an output": ("valve.terminal", "rse", ("daq.valve.terminal", "Unknown field")),
    "channel": ("inputs.pressure.channel", "Dev1/ao0", ("daq.inputs.pressure.channel", "Dev1/ao0", "Dev1/ai0")),
    "several channels": ("inputs.pressure.channel", "Dev1/ai0:3", ("daq.inputs.pressure.channel", "Dev1/ai0:3")),
    "taken": ("motor.channel", "dev1/AO0".replace("AO", "ao"), ("daq.motor.channel", "taken by valve.channel")),
    "other device": ("inputs.pressure.channel", "Dev2/ai0", ("daq.inputs.pressure.channel", "Dev2/ai0", "one clock")),
    "rest": ("motor.rest", "12 V", ("daq.motor.rest", "12 V", "-10 V")),
    "line": ("shut_off.line", "Dev1/line0", ("daq.shut_off.line", "Dev1/port0/line0")),
    "open": ("shut_off.open_at", "on", ("daq.shut_off.open_at", "high, low")),
    "counter": ("encoder.counter", "Dev1/counter0", ("daq.encoder.counter", "Dev1/ctr0")),
    "decoding": ("encoder.decoding", "X3", ("daq.encoder.decoding", "X1, X2, X4")),
    "signal": ("encoder.a", "PFI8", ("daq.encoder.a", "/Dev1/PFI8")),
    "connection": ("connection", "tcp://there", ("daq.connection", "tcp://there", "grpc://")),
    "unknown": ("valv", {}, ("daq.valv", "Unknown field", "valve")),
    "no table": ("valve", 5, ("daq.valve", "table")),
    "no channel": ("valve", {"low": "0 V"}, ("daq.valve.channel", "missing")),
    "nothing sampled": ("inputs", {}, ("daq.inputs", "one or more")),
}


@pytest.mark.parametrize("wrong", WRONG)
def test_a_wrong_table_is_told_in_one_line(wrong: str) -> None:
    path, value, named = WRONG[wrong]
    table = tomllib.loads(TABLE)["daq"]
    *above, last = path.split(".")
    at = table
    for key in above:
        at = at[key]
    at[last] = value
    with pytest.raises(InputError) as told:
        wiring(table, where="lab.toml")
    line = str(told.value)
    assert line.startswith("lab.toml: ") and "\n" not in line
    assert all(word in line for word in named), line


@pytest.mark.parametrize("key", ["inputs", "valve"])
def test_what_is_required_is_asked_for(key: str) -> None:
    table = tomllib.loads(TABLE)["daq"]
    del table[key]
    with pytest.raises(InputError, match=f"lab.toml: daq.{key} is missing"):
        wiring(table, where="lab.toml")


def test_importing_the_border_loads_nothing_of_the_card() -> None:
    code = "import sys, mckibben_hardware.daq; print({'nidaqmx', 'grpc', 'google.protobuf'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "set()"
