"""The clock of the test machine: whole ticks, whole steps, and rates that it refuses."""

import numpy as np
import pytest

from mckibben.bench.hardware import Computer
from mckibben.errors import InputError

RATES = np.geomspace(1.0, 5000.0, 97)


def test_a_period_is_the_whole_number_of_ticks_nearest_to_the_one_asked_for():
    clock = Computer(timer_resolution=1e-6)
    assert clock.period(1000.0) == pytest.approx(1e-3, rel=1e-15)
    assert clock.period(3000.0) == pytest.approx(333e-6, rel=1e-14)
    for rate in RATES:
        ticks = clock.period(rate) / 1e-6
        assert ticks == pytest.approx(round(ticks), abs=1e-6)  # 1 s has 1e6 ticks, known to 1e-16 of it
        assert abs(clock.period(rate) - 1.0 / rate) <= 0.5e-6 * (1.0 + 1e-9)


def test_rounding_to_a_tick_never_makes_the_clock_faster_than_it_can_be():
    coarse = Computer(timer_resolution=1e-4, highest_rate=4900.0)
    assert 1.0 / coarse.period(4900.0) <= 4900.0  # two ticks would be 5 kHz
    assert coarse.period(4900.0) == pytest.approx(3e-4)


@pytest.mark.parametrize("largest", [1e-3, 50e-6, 49.9e-6, 7e-6])
def test_a_period_holds_the_fewest_whole_steps_that_are_short_enough(largest):
    clock = Computer()
    for rate in RATES[-40:]:
        n, period = clock.steps(rate, largest), clock.period(rate)
        assert isinstance(n, int)
        assert n >= 1
        assert period / n <= largest * (1.0 + 1e-8)  # a step may be longer by rounding only
        assert n == 1 or period / (n - 1) > largest
    assert clock.steps(1000.0, 50e-6) == 20


@pytest.mark.parametrize("rate", [0.0, -1.0, 0.5, 5001.0, float("nan"), float("inf")])
def test_a_rate_that_it_cannot_run_at_is_refused_with_what_is_allowed(rate):
    with pytest.raises(InputError, match=r"sample_rate must be between 1 1/s"):
        Computer().period(rate)


@pytest.mark.parametrize("largest", [0.0, -1e-5, float("nan"), float("inf")])
def test_a_step_that_is_no_time_is_refused(largest):
    with pytest.raises(InputError, match="largest_step"):
        Computer().steps(1000.0, largest)


def test_a_clock_without_a_rate_it_can_run_at_is_refused():
    with pytest.raises(InputError, match="lowest_rate"):
        Computer(lowest_rate=100.0, highest_rate=10.0)
    with pytest.raises(InputError, match="timer_resolution"):
        Computer(timer_resolution=1e-2, lowest_rate=200.0)
    with pytest.raises(InputError, match="latency"):
        Computer(latency=-1e-3)


def test_a_loop_that_moves_the_motor_takes_the_least_multiple_of_the_protocols_rate_that_its_gains_allow():
    fast, slow = Computer(), Computer(highest_rate=500.0, lowest_motor_rate=400.0)
    assert [fast.samples_per_sample(rate) for rate in (5000.0, 1000.0, 999.0, 250.0)] == [1, 1, 2, 4]
    assert [slow.samples_per_sample(rate) for rate in (500.0, 400.0, 250.0, 125.0)] == [1, 1, 2, 4]
    with pytest.raises(InputError, match=r"its loop needs 600 Hz.* 500 Hz at most; state a higher rate"):
        slow.samples_per_sample(300.0)
    with pytest.raises(InputError, match=r"its loop needs 1000 Hz.* 500 Hz at most; use a faster computer"):
        Computer(highest_rate=500.0).samples_per_sample(250.0)
