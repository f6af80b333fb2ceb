"""Waveforms: each is its formula, jumps where it says, and is refused by name where it is wrong."""

import math
import re

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.experiments.waveforms import KINDS, Binary, Noise, read_waveform
from mckibben.experiments.waveforms.shapes import TAPS, register_bits, uniform
from mckibben.experiments.waveforms.waveform import time_words

T = 1e-3 * np.arange(4001)
TABLES = {
    "constant": {"value": "3 bar"},
    "steps": {"times": ["0 s", "0.3 s", "1.1 s"], "values": ["0 bar", "3 bar", "1 bar"]},
    "pulse": {"start": "0.3 s", "width": "0.4 s", "high": "2 bar", "low": "0 bar"},
    "square": {"low": "0 bar", "high": "1 bar", "frequency": "2 Hz", "duty": "30 %"},
    "pwm": {"low": "0 bar", "high": "1 bar", "frequency": "10 Hz", "duty": {"kind": "constant", "value": 0.25}},
    "prbs": {"low": "0 bar", "high": "1 bar", "hold": "20 ms", "order": 5},
    "ramp": {"from": "1 bar", "to": "5 bar", "start": "1 s", "duration": "2 s"},
    "triangle": {"low": "1 bar", "high": "3 bar", "frequency": "1 Hz"},
    "sine": {"mean": "2 bar", "amplitude": "1 bar", "frequency": "0.5 Hz", "phase": "90 deg"},
    "chirp": {"amplitude": "1 bar", "from": "1 Hz", "to": "20 Hz", "duration": "2 s"},
    "multisine": {"amplitude": "0.1 bar", "frequencies": ["1 Hz", "3 Hz", "7 Hz"]},
    "noise": {"low": "1 bar", "high": "3 bar", "cutoff": "10 Hz", "seed": 4},
    "table": {"times": ["0 s", "1 s", "2 s"], "values": ["0 bar", "1 bar", "0 bar"]},
    "sum": {"parts": ["1 bar", {"kind": "sine", "amplitude": "1 bar", "frequency": "1 Hz"}]},
    "sequence": {
        "parts": [
            {"kind": "constant", "value": "1 bar", "lasts": "1 s"},
            {"kind": "ramp", "from": "1 bar", "to": "2 bar", "duration": "1 s", "lasts": "2 s"},
        ]
    },
}  # fmt: skip
FORMULAS = {
    "constant": lambda t: 3e5 + 0 * t,
    "sine": lambda t: 2e5 + 1e5 * np.cos(np.pi * t),
    "ramp": lambda t: np.clip(1e5 + 2e5 * (t - 1.0), 1e5, 5e5),
    "triangle": lambda t: 1e5 + 2e5 * (1 - np.abs(1 - 2 * np.mod(t, 1.0))),
    "table": lambda t: 1e5 * np.clip(1 - np.abs(t - 1.0), 0.0, 1.0),
    "sum": lambda t: 1e5 + 1e5 * np.sin(2 * np.pi * t),
    "sequence": lambda t: 1e5 + 1e5 * np.clip(t - 1.0, 0.0, 1.0),
    "chirp": lambda t: (
        1e5 * np.sin(2 * np.pi * np.where(t < 2, t + 9.5 / 2 * t**2, 2 + 9.5 / 2 * 4 + 20.0 * (t - 2.0)))
    ),
    "multisine": lambda t: sum(
        1e4 * np.sin(2 * np.pi * f * t - np.pi * k * (k + 1) / 3) for k, f in enumerate((1.0, 3.0, 7.0))
    ),
}


def made(kind, **changes):
    return read_waveform({"kind": kind, **TABLES[kind], **changes}, "Pa", field="signals.x", where="f.toml")


def test_every_kind_is_tried_here():
    assert set(TABLES) == set(KINDS)


@pytest.mark.parametrize("kind", FORMULAS)
def test_waveform_is_its_formula(kind):
    # rounding of arguments of up to 300 rad, in Pa of 1e5
    np.testing.assert_allclose(made(kind).at(T), FORMULAS[kind](T), atol=1e-6, rtol=1e-12)


def test_a_jump_belongs_to_its_sample_however_the_clock_rounds():
    # 300 * 1e-3 is not 0.3 in binary, nor is 0.3 + 0.4 = 0.7
    for period in (1e-3, 1e-4, 1 / 3000):
        t = period * np.arange(round(1.5 / period) + 1)
        start, end = round(0.3 / period), round(0.7 / period)
        pulse = made("pulse").at(t)
        assert np.flatnonzero(pulse == 2e5).tolist() == list(range(start, end))
    steps = made("steps").at(T)
    assert np.flatnonzero(np.diff(steps)).tolist() == [299, 1099]
    square = made("square").at(T)
    assert square[:500].sum() == 150 * 1e5
    np.testing.assert_array_equal(square[:3500], square[500:4000])


def test_pulse_width_follows_the_duty_of_each_cycle():
    ramp = {"kind": "ramp", "from": 0, "to": 1, "duration": "4 s"}
    wave = made("pwm", duty=ramp).at(T[:-1]).reshape(40, 100).mean(axis=1) * 1e-5
    # the share at each cycle's beginning, rounded up to whole samples of a hundred
    np.testing.assert_allclose(wave, np.ceil(np.arange(40) / 40 * 100 - 1e-9) / 100, atol=1e-12)


@pytest.mark.parametrize("order", TAPS)
def test_binary_sequence_has_the_longest_period_and_is_white(order):
    bits = register_bits(order)
    length = 2**order - 1
    assert len(bits) == length
    assert bits.sum() == 2 ** (order - 1)  # all states but zero occur once, and half of them and one end in 1
    signs = 2.0 * bits - 1.0
    spectrum = np.abs(np.fft.fft(signs)) ** 2
    # two-valued autocorrelation, 2^n - 1 and -1: a flat spectrum of 2^n beside its mean
    np.testing.assert_allclose(spectrum[1:], 2.0**order, rtol=1e-6)


def test_binary_sequence_repeats_and_starts_where_the_seed_says():
    a = Binary(low=0.0, high=1.0, hold=1e-3, order=5)
    b = Binary(low=0.0, high=1.0, hold=1e-3, order=5, seed=3)
    np.testing.assert_array_equal(a.at(T[31:62]), a.at(T[:31]))
    np.testing.assert_array_equal(b.at(T[:60]), a.at(T[3:63]))


def test_chance_is_the_published_hash_and_so_equal_everywhere():
    # first output of SplitMix64 from a seed of zero, as its authors' programs print it
    from mckibben.experiments.waveforms.shapes import _mix

    assert int(_mix(np.asarray(1, np.uint64))) == 0xE220A8397B1DCDAF
    assert not np.array_equal(uniform(0, np.arange(8)), uniform(1, np.arange(8)))


@pytest.mark.parametrize("seed", range(4))
def test_noise_keeps_its_bounds_and_its_band(seed):
    from scipy.signal import welch

    wave = Noise(low=-1.0, high=1.0, cutoff=20.0, seed=seed)
    values = wave.at(1e-3 * np.arange(400_000))
    assert values.min() >= -1.0
    assert values.max() <= 1.0
    assert values.max() - values.min() > 1.7  # the bounds are neared
    rate, power = welch(values, 1000.0, nperseg=4096)

    def decibel(f):
        near = np.abs(rate - f) < 1.0
        return 10 * math.log10(power[near].mean() / power[(rate > 0.5) & (rate < 2.0)].mean())

    # about 200 averages of 9 and 7 bins: 0.3 dB of scatter
    assert decibel(20.0) == pytest.approx(-3.01, abs=0.9)
    assert decibel(60.0) < -29.0


def test_same_seed_same_noise_at_any_times():
    wave = made("noise")
    whole, part = wave.at(T), wave.at(T[1234:1240])
    np.testing.assert_array_equal(whole[1234:1240], part)


def test_held_and_straight_are_told_apart():
    held = {k for k in TABLES if not made(k).straight}
    assert held == {"constant", "steps", "pulse", "square", "pwm", "prbs"}
    assert not made("table", between="held").straight
    assert not read_waveform({"kind": "sum", "parts": ["1 bar", "2 bar"]}, "Pa", field="x").straight


@pytest.mark.parametrize("kind", TABLES)
def test_every_waveform_says_what_it_is_in_one_line_and_the_same_again(kind):
    text = made(kind).sentence("Pa")
    assert "\n" not in text
    assert "bar" in text
    assert text == made(kind).sentence("Pa")


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ({"kind": "rmp"}, "Unknown signals.x.kind 'rmp'. Did you mean 'ramp'"),
        ({}, "signals.x.kind"),
        ("3", "the unit is missing"),
        (True, "bool"),
        ({"kind": "sine", "amplitude": "1 bar"}, "signals.x.frequency is missing"),
        ({"kind": "sine", "amplitude": "1 bar", "frequency": "0 Hz"}, "signals.x.frequency"),
        ({"kind": "sine", "amplitude": "1 cm", "frequency": "1 Hz"}, "must be a pressure"),
        ({"kind": "sine", "amplitude": "1 bar", "frequency": "1 Hz", "phse": 0}, "Did you mean 'phase'"),
        ({"kind": "steps", "times": ["0 s", "1 s"], "values": ["1 bar"]}, "one for each"),
        ({"kind": "steps", "times": ["1 s"], "values": ["1 bar"]}, "must begin with 0 s"),
        ({"kind": "steps", "times": ["0 s", "2 s", "1 s"], "values": ["1 bar"] * 3}, "they rise"),
        ({"kind": "steps", "times": [], "values": []}, "one or more"),
        ({"kind": "pulse", "width": "-1 s", "high": "1 bar"}, "signals.x.width"),
        ({"kind": "prbs", "low": "0 bar", "high": "1 bar", "hold": "1 ms", "order": 2}, "between 3 and 16"),
        ({"kind": "prbs", "low": "0 bar", "high": "1 bar", "hold": "1 ms", "order": 4.5}, "whole number"),
        ({"kind": "noise", "low": "0 bar", "high": "1 bar", "cutoff": "1 Hz", "seed": -1}, "signals.x.seed"),
        ({"kind": "chirp", "amplitude": "1 bar", "from": "1 Hz", "to": "2 Hz", "duration": "1 s", "sweep": "up"}, "log"),
        ({"kind": "multisine", "amplitude": "1 bar", "frequencies": ["1 Hz"], "phases": ["0 deg", "9 deg"]}, "one per"),
        ({"kind": "sum", "parts": ["1 bar", "nonsense"]}, "signals.x.parts.2"),
        ({"kind": "sequence", "parts": [{"kind": "constant", "value": "1 bar"}]}, "signals.x.parts.1.lasts"),
        ({"kind": "pwm", "frequency": "1 Hz", "duty": "3 bar"}, "signals.x.duty"),
        ({"kind": "table", "file": "x.csv"}, "no files"),
        ({"kind": "table", "times": ["0 s"], "values": ["1 bar"], "between": "curved"}, "straight or held"),
    ],
)  # fmt: skip
def test_bad_waveforms_are_refused_by_file_and_dotted_path(entry, says):
    with pytest.raises(InputError) as error:
        read_waveform(entry, "Pa", field="signals.x", where="f.toml")
    assert says in str(error.value)
    assert re.match("f.toml: (Unknown (field ')?)?signals.x", str(error.value))


FASTEST = {
    "constant": 0.0, "square": 2.0, "pwm": 5.0 * 10.0, "prbs": 0.5 / 20e-3, "triangle": 1.0, "sine": 0.5, "chirp": 20.0,
    "multisine": 7.0, "noise": 3.0 * 10.0, "sum": 1.0,
}  # fmt: skip


@pytest.mark.parametrize("kind", FASTEST)
def test_the_fastest_rate_of_a_waveform_is_what_its_numbers_say(kind):
    assert made(kind).fastest == pytest.approx(FASTEST[kind], rel=1e-12)  # one product
    if kind == "chirp":
        assert made(kind, **{"from": "20 Hz", "to": "1 Hz"}).fastest == 20.0


def test_a_held_table_keeps_each_value_until_the_next_point_and_a_straight_one_runs_through_them():
    held, straight = (made("table", between=between) for between in ("held", "straight"))
    assert held.at(np.array([0.0, 0.999, 1.0, 1.999, 2.0, 9.0])).tolist() == [0.0, 0.0, 1e5, 1e5, 0.0, 0.0]
    assert held.at(np.array([-1.0]))[0] == 0.0 and not held.straight and straight.straight
    assert straight.at(np.array([0.5, 1.5, 9.0])).tolist() == [5e4, 5e4, 0.0]
    with pytest.raises(InputError, match="straight or held"):
        made("table", between="curved")


def test_a_table_of_a_file_begins_at_zero_and_keeps_its_values():
    asked = []

    def files(file, time, column, unit):
        asked.append((file, time, column, unit))
        return np.array([3.0, 3.5, 5.0]), np.array([1.0, 2.0, 3.0])

    entry = {"kind": "table", "file": "a.csv", "time": "t", "column": "p"}
    wave = read_waveform(entry, "Pa", field="signals.x", where="f.toml", table=files)
    assert asked == [("a.csv", "t", "p", "Pa")]
    assert (wave.times, wave.values, wave.file) == ((0.0, 0.5, 2.0), (1.0, 2.0, 3.0), "a.csv")
    with pytest.raises(InputError, match="no files can be read here"):
        read_waveform(entry, "Pa", field="signals.x", where="f.toml")


JUMPS = {
    "steps": (0.3, 1.1), "pulse": (0.3, 0.3 + 0.4), "square": (0.15, 0.5, 0.65), "pwm": (0.025, 0.1, 0.125),
    "sequence": (), "prbs": tuple(0.02 * k for k in range(1, 31)),
}  # fmt: skip


@pytest.mark.parametrize("kind", JUMPS)
def test_just_before_a_jump_by_rounding_is_after_it_and_no_earlier(kind):
    wave = made(kind)
    for at in JUMPS[kind]:
        for near in (at, math.nextafter(at, 0.0), at * (1.0 - 4e-16)):
            assert wave.at(np.array([near])) == wave.at(np.array([at + 1e-6]))
        assert wave.at(np.array([at - 3e-9])) == wave.at(np.array([at - 1e-6]))


OTHERS = {
    "pulse": {"start": "0.1 s", "width": "0.2 s", "high": "1 bar", "low": "0.5 bar"},
    "square": {"low": "0.5 bar", "high": "2 bar", "frequency": "3 Hz", "duty": "40 %"},
    "pwm": {"low": "0.5 bar", "high": "2 bar", "frequency": "5 Hz", "duty": {"kind": "constant", "value": 0.5}},
    "prbs": {"low": "0.5 bar", "high": "2 bar", "hold": "30 ms", "order": 6, "seed": 1},
    "ramp": {"from": "2 bar", "to": "4 bar", "start": "2 s", "duration": "1 s"},
    "triangle": {"low": "2 bar", "high": "4 bar", "frequency": "2 Hz", "rising": 0.25},
    "sine": {"mean": "1 bar", "amplitude": "2 bar", "frequency": "1 Hz", "phase": "45 deg"},
    "chirp": {"mean": "1 bar", "amplitude": "2 bar", "from": "2 Hz", "to": "30 Hz", "duration": "1 s", "sweep": "log"},
    "multisine": {"amplitude": "0.2 bar", "frequencies": ["1 Hz", "3 Hz", "8 Hz"]},
    "noise": {"low": "0.5 bar", "high": "4 bar", "cutoff": "20 Hz", "seed": 5},
    "steps": {"times": ["0 s", "0.4 s", "1.1 s"], "values": ["0 bar", "3 bar", "2 bar"]},
    "table": {"values": ["0 bar", "2 bar", "0 bar"], "between": "held"},
}  # fmt: skip


@pytest.mark.parametrize(("kind", "key"), [(kind, key) for kind, keys in OTHERS.items() for key in keys])
def test_whatever_changes_a_waveform_changes_its_sentence(kind, key):
    one, other = made(kind), made(kind, **{key: OTHERS[kind][key]})
    assert not np.array_equal(one.at(T), other.at(T))
    assert one.sentence("Pa") != other.sentence("Pa")


def test_a_triangle_is_as_fast_as_its_shorter_side_and_a_logarithmic_chirp_grows_by_a_constant_ratio():
    assert made("triangle", rising=0.25).fastest == made("triangle", rising=0.75).fastest == 0.5 / 0.25
    sweep = made("chirp", sweep="log", **{"from": "1 Hz", "to": "16 Hz"})
    # whole cycles: the integral of 16^(t/2), (16^(t/2) - 1) 2/ln 16
    for cycles in (1, 2, 5, 10):
        at = 2.0 * math.log(1.0 + cycles * math.log(16.0) / 2.0) / math.log(16.0)
        slope = (sweep.at(np.array([at + 1e-7])) - sweep.at(np.array([at - 1e-7]))) / 2e-7
        assert sweep.at(np.array([at])) == pytest.approx(0.0, abs=1e-3)  # [Pa] of 1e5
        assert slope == pytest.approx(2.0 * math.pi * 1e5 * 16.0 ** (at / 2.0), rel=1e-6)  # second order in 1e-7 s


@pytest.mark.parametrize(
    ("seconds", "text"), [(0.0, "0 s"), (5e-5, "50 us"), (1e-3, "1 ms"), (1e-3 * (1.0 - 1e-10), "1 ms"), (0.999, "999 ms"),
                          (1.0 - 1e-10, "1 s"), (2.0, "2 s"), (-5e-5, "-50 us")],
)  # fmt: skip
def test_a_time_is_said_in_the_unit_that_fits(seconds, text):
    assert time_words(seconds) == text


@pytest.mark.parametrize(
    ("kind", "changes", "sentence"),
    [
        ("steps", {}, "steps 0 bar, 3 bar from 300 ms, 1 bar from 1.1 s"),
        ("chirp", {}, "chirp 0 bar +- 1 bar from 1 Hz to 20 Hz in 2 s"),
        ("chirp", {"sweep": "log"}, "chirp 0 bar +- 1 bar from 1 Hz to 20 Hz in 2 s, logarithmic"),
        ("triangle", {}, "triangle from 1 bar to 3 bar at 1 Hz"),
        ("triangle", {"rising": 0.25}, "triangle from 1 bar to 3 bar at 1 Hz, rising for 0.25 of each cycle"),
        ("sine", {}, "sine 2 bar +- 1 bar at 0.5 Hz, phase 90 deg"),
        ("sine", {"phase": "0 deg"}, "sine 2 bar +- 1 bar at 0.5 Hz"),
    ],
)
def test_a_sentence_says_what_is_there_and_nothing_of_what_is_as_usual(kind, changes, sentence):
    assert made(kind, **changes).sentence("Pa") == sentence


def test_before_it_begins_a_waveform_has_its_first_value_and_a_sequence_ends_with_its_last_part():
    assert made("steps").at(np.array([-1.0, -1e-3])).tolist() == [0.0, 0.0]
    held = made("table", between="held")
    for near in (1.0, math.nextafter(1.0, 0.0)):
        assert held.at(np.array([near])).tolist() == [1e5]
    parts = [{"kind": "constant", "value": f"{k} bar", "lasts": f"{k} s"} for k in (1, 2, 3)]
    sequence = made("sequence", parts=parts)
    assert sequence.at(np.array([0.0, 0.99, 1.0, 2.99, 3.0, 5.9, 20.0])).tolist() == [1e5, 1e5, 2e5, 2e5, 3e5, 3e5, 3e5]


def test_each_part_of_a_sequence_has_its_own_time_from_its_beginning_on():
    """Also the first one; 1e-6 s before and after a change lies beyond `JUMP`, by which a sample may come early."""
    sine = {"kind": "sine", "mean": "3 bar", "amplitude": "1 bar", "frequency": "0.7 Hz", "phase": "0 deg"}
    table = [
        {**sine, "lasts": f"{seconds} s", "frequency": f"{hertz} Hz"}
        for seconds, hertz in ((1, 0.7), (2, 0.3), (4, 1.1))
    ]
    parts = [made("sine", **{k: v for k, v in one.items() if k not in ("kind", "lasts")}) for one in table]
    sequence, ends = made("sequence", parts=table), (0.0, 1.0, 3.0, 9.0)
    for part, begin, end in zip(parts, ends, ends[1:], strict=False):
        own = np.linspace(1e-6, end - begin - 1e-6, 50)
        np.testing.assert_allclose(sequence.at(begin + own), part.at(own), rtol=1e-11)  # rounding of the time
    assert sequence.fastest == max(part.fastest for part in parts)
