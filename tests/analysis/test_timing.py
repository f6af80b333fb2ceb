"""A shift in time is found to a hundredth of a sample where records are smooth on their clock."""

import numpy as np
import pytest

from mckibben.analysis.frequency import time_lead
from mckibben.errors import InputError

PERIOD = 1e-3
TIME = PERIOD * np.arange(2001)


def smooth(t: np.ndarray) -> np.ndarray:
    """Up to 9 Hz: a hundred samples and more per wave."""
    phases = np.random.default_rng(4).uniform(0.0, 2.0 * np.pi, 9)
    return sum(np.sin(2.0 * np.pi * f * t + p) / f for f, p in enumerate(phases, start=1))


@pytest.mark.parametrize("samples", [0.0, 0.13, 0.5, 3.0, 7.37, -0.21, -12.5, 40.25])
def test_shifts_that_are_no_whole_samples_are_found(samples):
    """The parabola misses the top of a correlation by the fourth derivative: (9 Hz of 1 kHz)^2 of a sample, below 1e-2."""
    found = time_lead(smooth(TIME + samples * PERIOD), smooth(TIME), period=PERIOD)
    assert found.time == pytest.approx(samples * PERIOD, abs=1e-2 * PERIOD)
    assert found.correlation == pytest.approx(1.0, abs=1e-4)


def test_a_step_that_comes_later_lags_and_scale_and_offset_do_not_matter():
    def rise(start: float) -> np.ndarray:
        return 1.0 - np.exp(-np.maximum(TIME - start, 0.0) / 0.05)

    found = time_lead(3.0 * rise(0.5) + 7.0, rise(0.5125), period=PERIOD)
    # the record ends before it rests, and what both cover changes with the shift; a fifth of a sample is left for this
    assert found.time == pytest.approx(0.0125, abs=0.2 * PERIOD)
    back = time_lead(rise(0.5125), 3.0 * rise(0.5) + 7.0, period=PERIOD)
    assert back.time == pytest.approx(-found.time, abs=1e-9)


def test_noise_moves_the_shift_little():
    """1 % of noise: the top is blurred by its share over the slope, some 0.01/(2 pi 1 Hz)/sqrt(2000) = 36 us, four times."""
    random = np.random.default_rng(8)
    a, b = (smooth(TIME + s) + random.normal(0.0, 0.01, TIME.size) for s in (0.00437, 0.0))
    assert time_lead(a, b, period=PERIOD).time == pytest.approx(0.00437, abs=1.5e-4)


def test_a_shift_beyond_the_search_is_held_at_its_end():
    found = time_lead(smooth(TIME + 0.05), smooth(TIME), period=PERIOD, longest=0.02)
    assert found.time == pytest.approx(0.02)
    assert found.correlation < 0.99


@pytest.mark.parametrize(
    ("first", "second", "says"),
    [
        (np.ones(500), smooth(TIME[:500]), "must change"),
        (smooth(TIME[:500]), np.zeros(500), "must change"),
        (smooth(TIME[:500]), smooth(TIME[:501]), "two of one length"),
        (smooth(TIME[:399]), smooth(TIME[:399]), "must have 400"),
        (np.ones((500, 2)), np.ones((500, 2)), "two of one length"),
        (np.full(500, np.nan), smooth(TIME[:500]), "finite"),
    ],
)
def test_records_that_have_no_shift_are_refused(first, second, says):
    with pytest.raises(InputError, match=says):
        time_lead(first, second, period=PERIOD)


@pytest.mark.parametrize("options", [{"period": 0.0}, {"period": np.nan}, {"period": 1e-3, "longest": -1.0}])
def test_a_clock_that_does_not_run_is_refused(options):
    with pytest.raises(InputError, match="must be a time"):
        time_lead(smooth(TIME), smooth(TIME), **options)
