"""Recordings of the nylon law with Maxwell-slip friction show the history that the paper describes."""

from functools import cache

import numpy as np
import pytest
from analysis_records import clock, counts, record, sine, triangle
from scipy import signal
from test_sampling import law

from mckibben.analysis.lag import corrected_loop
from mckibben.analysis.loops import loop, loop_ratio, path_distance, paths, peak_velocity
from mckibben.analysis.repeatability import between_cycles, spread, trend
from mckibben.muscles.hysteresis.maxwell_slip import MaxwellSlip
from mckibben.muscles.hysteresis.slip import FrictionLimit
from mckibben.recordings import Recording

LOW, HIGH = 0.110, 0.145  # [m]
COUNT = 100.0 / 256


@cache
def nylon(
    pressure=5e5, frequency=1.0, share=1.0, wave=triangle, span=HIGH - LOW, cycles=3, rate=1000.0, cutoff=0.0, count=0.0
) -> Recording:
    """Friction 0.5 N + 0.4 N/bar on eight contacts of 0.2 to 8 mm, after a cycle of the whole range."""
    import jax

    friction = MaxwellSlip.geometric(FrictionLimit(constant=0.5, per_pressure=0.4e-5))
    time = clock(cycles / frequency, rate)
    length = LOW + 0.5 * share * span * (1.0 + wave(frequency * time))
    before = LOW + 0.5 * span * (1.0 + wave(np.linspace(0.0, 1.0, 1001)))
    driven = np.concatenate([before[:-1], length])

    def move(state, dx):
        state = friction.advance(state, dx, start_pressure=pressure, end_pressure=pressure).state
        return state, (friction.stiffness * state).sum()

    _, force = jax.lax.scan(move, np.zeros(8), np.diff(driven, prepend=driven[0]))
    tension = np.asarray(law().tension(length, pressure)) + np.asarray(force)[1000:]
    if cutoff:
        b, a = signal.butter(1, cutoff, fs=rate)
        tension = signal.lfilter(b, a, tension, zi=signal.lfilter_zi(b, a) * tension[0])[0]
    if count:
        tension = counts(tension + np.random.default_rng(0).normal(0.0, 0.1, tension.size), count)
    return record(time, length=length, tension=tension, pressure=np.full_like(time, pressure))


@pytest.mark.parametrize("count", [0.0, COUNT])
def test_the_loop_at_five_bar_is_as_wide_and_as_high_as_printed(count):
    """0.2-0.5 cm and 5-10 N; all contacts slip at mid-range, so the height is twice 2.5 N. Counts: as for loops."""
    found = loop(nylon(count=count))
    assert 0.2e-2 < found.width < 0.5e-2
    assert found.height == pytest.approx(5.0, abs=0.14 if count else 2e-3)


def test_a_quarter_of_the_frequency_changes_nothing():
    """Rate-independent: what is left is the sampling of the turns, 4 times as fine."""
    slow, fast = nylon(frequency=0.25, cycles=2), nylon()
    ratio = loop_ratio(loop(slow), loop(fast))
    assert (ratio.width, ratio.height, ratio.area) == pytest.approx((1.0, 1.0, 1.0), rel=1e-3)


def test_half_the_range_narrows_the_loop_and_keeps_the_rising_path():
    """The rising path is the same piece of the same memory: what is left is reading it with parabolas near the turn."""
    whole, half = nylon(), nylon(share=0.5)
    ratio = loop_ratio(loop(half), loop(whole))
    assert 0.3 < ratio.width < 0.98
    assert 0.3 < ratio.height < 0.98
    assert path_distance(paths(half).rising, paths(whole).rising).largest < 0.02
    falling = path_distance(paths(half).falling, paths(whole).falling)
    assert falling.largest > 1.0
    # A count of 0.39 N and 0.1 N of noise over 50 samples and more: 0.15/sqrt(50) = 0.02 N, both, the largest of 51
    counted = path_distance(paths(nylon(share=0.5, count=COUNT)).rising, paths(nylon(count=COUNT)).rising)
    assert counted.largest < 0.15


def test_widths_over_frequency_are_even_once_the_filter_is_taken_out():
    """Sines of 0.0318 L0 at 1, 5 and 10 Hz behind 200 Hz, corrected by their phase; harmonics of friction lag less."""
    runs = [
        nylon(frequency=f, wave=sine, span=8.9e-3, cycles=round(3 * f), rate=5000.0, cutoff=200.0)
        for f in (1.0, 5.0, 10.0)
    ]
    both = [corrected_loop(run, cutoff=200.0, skip=1) for run in runs]
    raw, corrected = spread([b.raw.width for b in both]), spread([b.corrected.width for b in both])
    assert raw.relative_range > 0.15
    assert corrected.relative_range < 0.02
    assert peak_velocity(runs[-1]) / 0.14 == pytest.approx(2.0, rel=0.01)
    speeds = [peak_velocity(run) for run in runs]
    raw_trend = trend(speeds, [b.raw.height for b in both])
    assert raw_trend.slope.value < 0.0  # the "slight decrease" is the filter's
    better = trend(speeds, [b.corrected.height for b in both])
    assert abs(better.slope.value) < 0.2 * abs(raw_trend.slope.value)


def test_cycles_repeat_to_the_noise():
    """0.1 N of noise and counts of 0.39 N: sqrt(0.01 + 0.39^2/12) = 0.15 N; counts of a triangle repeat in part."""
    found = between_cycles(nylon(count=COUNT))
    assert 0.05 < found.rms < 0.2
    assert between_cycles(nylon()).rms < 1e-6
