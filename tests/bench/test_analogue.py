"""Sensors and converters: counts, rails, noise, filter and skew."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben.bench.hardware import AnalogOut, Converter, Encoder, Sensor
from mckibben.bench.hardware.converters import Converters
from mckibben.errors import InputError

SPANS = [(0.0, 6.8e5), (-264.0, 264.0), (-10.0, 110.0)]
BITS = [2, 8, 12, 24]


def sensor(bits=8, skew=0.0, **fields):
    """0 to 100 N, as the paper's cell."""
    return Sensor(converter=Converter(bits=bits, low=0.0, high=100.0, skew=skew), low=0.0, high=100.0, **fields)


@pytest.mark.parametrize("bits", BITS)
@pytest.mark.parametrize(("low", "high"), SPANS)
def test_a_conversion_is_wrong_by_half_a_count_at_most_and_reaches_that(bits, low, high):
    converter = Converter(bits=bits, low=low, high=high)
    resolution = float(converter.resolution)
    assert resolution == pytest.approx((high - low) / 2**bits, rel=1e-15)
    x = np.random.default_rng(1).uniform(low, float(converter.top), 20_000)
    code = np.asarray(converter.code(x))
    assert np.array_equal(code, np.round(code))
    error = np.abs(np.asarray(converter.value(code)) - x)
    assert error.max() <= 0.5 * resolution + 1e-15 * high  # the sum low + n q rounds
    assert error.max() > 0.49 * resolution  # of 20,000 draws, some lie near the middle between two counts
    assert np.array_equal(np.asarray(converter.code(converter.value(code))), code)


@pytest.mark.parametrize("bits", BITS)
def test_beyond_its_range_a_converter_stays_at_its_rail(bits):
    converter = Converter(bits=bits, low=-5.0, high=5.0)
    code = converter.code(jnp.array([-1e9, -5.1, 0.0, 5.0, 1e9]))
    assert np.array_equal(np.asarray(code)[[0, 1, 3, 4]], [0.0, 0.0, 2.0**bits - 1.0, 2.0**bits - 1.0])
    assert 0.0 < float(code[2]) < float(converter.counts) - 1.0
    assert float(converter.value(code[2])) == 0.0  # zero is a count of a range that is symmetric about it
    assert float(converter.top) == pytest.approx(5.0 - float(converter.resolution))


def test_an_output_is_held_at_a_count_and_at_its_ends():
    out = AnalogOut(bits=8, low=0.0, high=1e6)
    assert float(out.output(5e5)) == 5e5
    asked = np.linspace(-2e5, 1.2e6, 1001)
    held = np.asarray(out.output(asked))
    assert len(np.unique(held)) == 256
    inside = (asked >= 0.0) & (asked <= float(out.top))
    assert np.abs(held - asked)[inside].max() <= 0.5 * float(out.resolution) * (1.0 + 1e-12)
    assert held[0] == 0.0
    assert held[-1] == float(out.top)


def test_a_command_that_is_no_number_gives_nothing():
    motor = AnalogOut(bits=8, low=-264.0, high=264.0)
    valve = AnalogOut(bits=8, low=1e5, high=1e6)
    for command in (np.nan, np.inf, -np.inf):
        assert float(motor.output(command)) == 0.0
        assert float(valve.output(command)) == 1e5  # nearest to zero


def test_a_reading_that_is_no_number_is_not_hidden():
    value, code = sensor().reading(jnp.nan, 1.0, 0.0, 0.0)
    assert np.isnan(value)
    assert np.isnan(code)


def test_the_transducer_saturates_before_the_filter():
    """A filter that had seen 1000 N would take longer to come back than one that saw 100 N."""
    cell = sensor()
    assert float(cell.initial(1e3)) == 100.0
    assert float(cell.initial(-50.0)) == 0.0
    assert float(cell.rate(40.0, 1e3)) == float(cell.rate(40.0, 100.0))
    assert float(cell.rate(100.0, 1e3)) == 0.0


def test_a_converter_may_reach_beyond_its_transducer():
    """A live zero: nothing that the transducer can see brings the converter to a rail, a broken wire does."""
    cell = Sensor(converter=Converter(bits=8, low=-25.0, high=110.0), low=0.0, high=100.0)
    for force in (-1e3, 0.0, 50.0, 1e3):
        _, code = cell.reading(cell.initial(force), force)
        assert 0.0 < float(code) < float(cell.converter.counts) - 1.0
    value, code = cell.reading(cell.initial(50.0), 50.0, 0.0, 1.0)
    assert float(code) == float(cell.converter.counts) - 1.0
    assert float(value) == float(cell.converter.top)


def test_gain_and_offset_change_a_reading_as_they_say():
    cell = sensor(bits=24, gain_error=0.02, offset=-0.3)
    for force in (1.0, 40.0, 90.0):
        value, _ = cell.reading(cell.initial(force), force)
        assert float(value) == pytest.approx(1.02 * force - 0.3, abs=0.5 * float(cell.resolution))


def test_the_noise_has_the_stated_rms_and_the_same_draws_give_the_same_bits():
    cell = sensor(bits=24, noise=0.4)
    draws = np.random.default_rng(7).standard_normal(40_000)
    first, _ = cell.reading(jnp.full(draws.shape, 50.0), 50.0, draws, 0.0)
    again, _ = cell.reading(jnp.full(draws.shape, 50.0), 50.0, draws.copy(), 0.0)
    assert np.asarray(first).tobytes() == np.asarray(again).tobytes()
    # The standard error of the rms of n draws is 1/sqrt(2 n), 0.35 %; four of them.
    assert float(np.std(first)) == pytest.approx(0.4, rel=0.014)
    assert float(np.mean(first)) == pytest.approx(50.0, abs=4.0 * 0.4 / 200.0)


def test_rounding_alone_has_the_rms_of_a_count_over_root_twelve():
    cell = sensor()
    force = np.random.default_rng(5).uniform(0.0, 99.0, 40_000)
    value, _ = cell.reading(force, force)
    # An even distribution of error; the rms of n draws of it is known to 0.45/sqrt(n), 0.2 %; four of them.
    assert float(np.std(np.asarray(value) - force)) == pytest.approx(float(cell.resolution) / 12.0**0.5, rel=0.009)


def filtered(cell, x, h):
    """The filter by classical Runge-Kutta steps with x at every half step, (2 n + 1,)."""

    def one(y, three):
        k1 = cell.rate(y, three[0])
        k2 = cell.rate(y + 0.5 * h * k1, three[1])
        k3 = cell.rate(y + 0.5 * h * k2, three[1])
        k4 = cell.rate(y + h * k3, three[2])
        new = y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return new, new

    x = jnp.asarray(x)
    start = cell.initial(x[0])
    rows = jnp.stack([x[:-2:2], x[1:-1:2], x[2::2]], axis=1)
    return np.concatenate([[float(start)], np.asarray(jax.lax.scan(one, start, rows)[1])])


H = 50e-6


def test_the_filter_answers_a_step_like_one_pole():
    cell = sensor(cutoff=200.0)
    x = np.full(401, 80.0)
    y = filtered(cell, np.concatenate([[20.0], x[1:]]), H)  # the first half step's jump is over at its middle
    t = H * np.arange(len(y))
    exact = 80.0 - 60.0 * np.exp(-2.0 * np.pi * 200.0 * t)
    # The first stage still sees 20 N: a sixth of a step of the rate, 60 N * 2 pi 200 / s * 50 us / 6 = 0.63 N
    assert np.abs(y - exact).max() < 0.7
    late = filtered(cell, x, H)
    assert np.abs(late - 80.0).max() == 0.0  # settled it stays
    ratio = (80.0 - y[2:]) / (80.0 - y[1:-1])
    assert ratio == pytest.approx(np.exp(-2.0 * np.pi * 200.0 * H), rel=1e-7)  # (rate h)^5/120 of each step


@pytest.mark.parametrize("frequency", [20.0, 200.0, 1000.0])
def test_the_filter_answers_a_sine_like_one_pole(frequency):
    cell = sensor(cutoff=200.0)
    steps = round(0.1 / H)  # whole periods; the first half lets the start die away
    half = H * 0.5 * np.arange(2 * steps + 1)
    y = filtered(cell, 50.0 + 20.0 * np.sin(2.0 * np.pi * frequency * half), H)
    t, part = H * np.arange(steps + 1), slice(steps // 2, steps)
    found = 2.0 * np.mean((y[part] - 50.0) * np.exp(-2j * np.pi * frequency * t[part])) / (20.0 / 1j)
    exact = 1.0 / (1.0 + 1j * frequency / 200.0)
    assert abs(found / exact - 1.0) < 1e-4  # (2 pi 1 kHz 50 us)^4/120 of the Runge-Kutta steps


def test_a_skewed_channel_reads_the_signal_of_its_own_instant_to_second_order():
    """Of a sine that passes the filter; halving the skew divides the error by four."""
    fc, f, at = 200.0, 30.0, 4e-3
    w, pole = 2.0 * np.pi * f, 2.0 * np.pi * fc

    def x(t):
        return 50.0 + 40.0 * np.sin(w * t)

    def y(t):
        return 50.0 + 40.0 * (np.sin(w * t) * pole**2 - np.cos(w * t) * w * pole) / (pole**2 + w**2)

    errors = []
    for skew in (1e-4, 5e-5, 2.5e-5):
        cell = sensor(bits=24, cutoff=fc, skew=skew)
        value, _ = cell.reading(y(at), x(at))
        errors.append(abs(float(value) - y(at + skew)))
    assert errors[0] < 0.1 * abs(y(at + 1e-4) - y(at))  # without it, the whole change would be missed
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert np.all((orders > 1.85) & (orders < 2.15)), orders


def test_a_skew_far_longer_than_the_filter_reads_what_stands_at_the_transducer():
    cell = sensor(bits=24, cutoff=8e3, skew=1e-2)
    assert float(cell.reading(10.0, 60.0)[0]) == pytest.approx(60.0, abs=float(cell.resolution))


@pytest.mark.parametrize("bits", [1, 25, 0, -8, 8.0, True])
def test_numbers_of_bits_that_no_converter_has_are_refused(bits):
    with pytest.raises(InputError, match="must be a whole number from 2 to 24"):
        Converter(bits=bits, low=0.0, high=1.0)


def test_a_range_upside_down_is_refused():
    for make in (lambda: Converter(low=1.0, high=1.0), lambda: AnalogOut(low=1.0, high=-1.0)):
        with pytest.raises(InputError, match="high must be more than low"):
            make()
    with pytest.raises(InputError, match="high must be more than low"):
        Sensor(converter=Converter(low=0.0, high=1.0), low=2.0, high=1.0)


def wired(**fields):
    analog = {"tension": Converter(bits=8, low=0.0, high=100.0), "pressure": Converter(bits=12, low=0.0, high=1e6)}
    valve, motor = AnalogOut(bits=8, low=0.0, high=1e6), AnalogOut(bits=8, low=-264.0, high=264.0)
    whole = {"analog": analog, "encoder": Encoder(pulley_radius=0.02), "valve": valve, "motor": motor, "mounted": 0.14}
    return Converters(**whole | {"gain": {}, "zero": {}} | fields)


def test_measured_channels_are_their_counts_with_the_calibration_of_those_that_have_one():
    counts = {"tension": 51.0, "pressure": 2048.0, "span": -100.0}
    travel = -100.0 * 2.0 * np.pi * 0.02 / 6400.0
    plain = wired().read(counts)
    assert plain == {"tension": 51.0 * 100.0 / 256.0, "pressure": 5e5, "span": pytest.approx(0.14 + travel)}
    stated = wired(gain={"tension": 1.1, "span": 1.01}, zero={"tension": 3.0, "span": 1e-4}).read(counts)
    assert stated["pressure"] == plain["pressure"]
    assert float(stated["tension"]) == pytest.approx(1.1 * (plain["tension"] - 3.0))
    assert float(stated["span"]) == pytest.approx(0.14 + 1.01 * (travel - 1e-4))
    assert set(wired().read({"pressure": 0.0})) == {"pressure"}
    assert set(wired(encoder=None).read(counts)) == {"tension", "pressure"}
    assert wired().names == ("pressure", "tension")


@pytest.mark.parametrize("opened", [0.0, 0.5, 0.6, 1.0])
def test_commands_are_held_at_their_counts_and_a_motor_without_converter_gets_them_as_they_are(opened):
    commands = {"valve": 3.21e5, "motor": -17.3, "open": opened}
    for motor, near in ((wired().motor, 0.5 * 528.0 / 256.0), (None, 0.0)):
        machine = wired(motor=motor)
        held = machine.held(machine.write(commands))
        assert float(held["valve"]) == pytest.approx(3.21e5, abs=0.5 * 1e6 / 256.0)
        assert float(held["motor"]) == pytest.approx(-17.3, abs=near)
        assert float(held["open"]) == float(opened > 0.5)


def test_a_range_that_does_not_rise_is_refused_in_arrays_too():
    for high in (1.0, np.float64(1.0), np.array([2.0, 1.0])):
        with pytest.raises(InputError, match="high must be more than low, 1"):
            Converter(bits=8, low=np.float64(1.0) if np.ndim(high) == 0 else np.array([1.0, 1.0]), high=high)
