"""Work and power of shortening at constant tension; Hill's curve recovered from points on it."""

import numpy as np
import pytest
from analysis_records import COUNT, clock, counts, record, sine, triangle

from mckibben.analysis.loops import path_work
from mckibben.analysis.shortening import (
    fit_hill,
    force_velocity_point,
    peak_power,
    power_density,
    shortening_power,
    tension_error,
)
from mckibben.errors import InputError

PULL, STROKE, F = 50.0, 0.028, 5.0


def isotonic(wave=sine, rate=1000.0, ripple=0.0, noise=0.0, count=0.0, start=0.3, encoder=0.0, seed=0):
    time = clock(2.0, rate)
    length = 0.12 + 0.5 * STROKE * wave(F * time + start)
    pull = PULL + ripple * np.sin(2.0 * np.pi * 37.0 * time) + np.random.default_rng(seed).normal(0.0, noise, time.size)
    return record(
        time,
        length=counts(length, encoder) if encoder else length,
        tension=counts(pull, count) if count else pull,
    )


def test_work_is_tension_times_stroke_and_power_twice_the_frequency_of_it():
    """The longest and shortest samples of 200 in a cycle miss the turns by (pi/200)^2/2 of half the stroke, 1e-4."""
    found = shortening_power(isotonic())
    assert found.work == pytest.approx(PULL * STROKE, rel=3e-4)
    assert found.frequency == pytest.approx(F, rel=1e-6)
    assert found.mean_power == pytest.approx(2.0 * F * PULL * STROKE, rel=3e-4)
    assert found.stroke == pytest.approx(STROKE, rel=3e-4)
    assert found.mean_tension == pytest.approx(PULL)
    assert found.cycles == 9
    # A parabola over 5 of 200 samples loses (2 pi 2.5/200)^2/10 = 6e-4 of a sine's velocity.
    assert found.peak_power == pytest.approx(PULL * np.pi * F * STROKE, rel=1e-3)
    assert found.peak_velocity == pytest.approx(np.pi * F * STROKE, rel=1e-3)
    assert found.positive_velocity_work == pytest.approx(PULL * STROKE, rel=2e-3)


def test_at_constant_speed_peak_and_mean_power_are_one():
    """The parabola rounds the turns of a triangle; away from them it is exact."""
    found = shortening_power(isotonic(triangle, rate=5000.0))
    assert found.peak_power == pytest.approx(found.mean_power, rel=1e-3)


def test_a_bounce_counts_as_positive_work_but_not_from_longest_to_shortest():
    """A second shortening of a quarter of the stroke on the way back."""
    time = clock(6.0)
    nodes = [0.0, 0.5, 0.65, 0.8, 1.0]
    length = 0.12 + STROKE * np.interp(time % 1.0, nodes, [1.0, 0.0, 0.5, 0.25, 1.0])
    found = shortening_power(record(time, length=length, tension=np.full_like(time, PULL)), window=4e-3)
    assert found.work == pytest.approx(PULL * STROKE, rel=1e-9)
    # A parabola over w flattens each of four turns, speeds about 3 strokes/s: by 3 w/8, 1 % of the stroke in all.
    assert found.positive_velocity_work == pytest.approx(1.25 * PULL * STROKE, rel=1e-2)
    assert found.window == 4e-3


@pytest.mark.parametrize("start", [0.0, 0.2, 0.5, 0.8])
def test_the_phase_at_the_start_does_not_matter(start):
    assert shortening_power(isotonic(start=start)).work == pytest.approx(PULL * STROKE, rel=3e-4)


@pytest.mark.parametrize("seed", range(3))
def test_counts_noise_and_the_encoder_leave_the_work(seed):
    """Turns are found to the noise of the encoder, a count of 20 um at both: 2 x 20 um x 50 N = 2 mJ of 1.4 J. The tension:
    s = 0.5 N over 100 samples of a shortening, 9 cycles: 0.5/sqrt(900) = 0.03 %, and half a count at most.
    """
    found = shortening_power(isotonic(noise=0.5, count=COUNT, encoder=19.6e-6, seed=seed))
    assert found.work == pytest.approx(PULL * STROKE, rel=3e-3)
    # velocity: 5.7 um of counts x sqrt(12/5^3)/1 ms = 2 mm/s of 440, tension 0.5 N x sqrt(9/20) of 50: the largest of 200
    assert found.peak_power == pytest.approx(PULL * np.pi * F * STROKE, rel=0.04)


def test_work_changes_its_sign_with_the_direction():
    x, t = np.linspace(0.14, 0.10, 50), np.linspace(60.0, 20.0, 50)
    assert path_work(x, t) == pytest.approx(0.04 * 40.0)
    assert path_work(x[::-1], t[::-1]) == pytest.approx(-0.04 * 40.0)


def test_the_error_of_a_controlled_tension():
    found = tension_error(isotonic(ripple=4.0, rate=5000.0), set_point=PULL)
    # 37 Hz over 9 cycles of 5 Hz: 66.6 waves; what is left over changes the mean square by 1/66 at most
    assert found.rms == pytest.approx(4.0 / np.sqrt(2.0), rel=0.01)
    assert found.relative_rms == pytest.approx(found.rms / PULL)
    assert found.relative_rms_shortening == pytest.approx(found.relative_rms, rel=0.1)
    assert (found.lowest, found.highest) == pytest.approx((PULL - 4.0, PULL + 4.0), abs=0.01)


def test_power_density_is_that_of_the_paper():
    assert power_density(14.0, section_area=0.95e-4, rest_length=0.14) == pytest.approx(1.05e6, rel=5e-3)


def test_what_has_no_shortening_is_refused():
    run = isotonic()
    with pytest.raises(InputError, match="full cycle"):
        shortening_power(run.select(0.0, 0.15))
    with pytest.raises(InputError, match="muscle.tension"):
        shortening_power(run.pick(["muscle.length"]))
    with pytest.raises(InputError, match="window"):
        shortening_power(run, window=5.0)
    with pytest.raises(InputError, match="frequency"):
        shortening_power(run, frequency=0.0)
    with pytest.raises(InputError, match="set_point"):
        tension_error(run, set_point=0.0)
    uneven = record(
        np.concatenate([run.time[:1000], run.time[1000:] + 0.1]),
        length=run["muscle.length"],
        tension=run["muscle.tension"],
    )
    with pytest.raises(InputError, match="uniform"):
        shortening_power(uneven)


F0, A, B = 100.0, 25.0, 0.1  # [N], [N], [m/s]


def hill(v):
    return (F0 + A) * B / (v + B) - A


def test_hills_numbers_come_back_from_points_on_his_curve():
    v = np.linspace(0.0, 0.35, 8)
    found = fit_hill(v, hill(v))
    assert found.isometric_tension.value == pytest.approx(F0, rel=1e-6)
    assert found.a.value == pytest.approx(A, rel=1e-6)
    assert found.b.value == pytest.approx(B, rel=1e-6)
    assert found.maximum_velocity.value == pytest.approx(F0 * B / A, rel=1e-6)
    assert found.rms < 1e-6
    power, speed = peak_power(found)
    grid = np.linspace(0.0, 0.4, 100001)
    assert power == pytest.approx((hill(grid) * grid).max(), rel=1e-6)
    assert speed == pytest.approx(grid[(hill(grid) * grid).argmax()], rel=1e-3)


def test_intervals_of_hills_numbers_cover_as_often_as_they_say():
    """200 draws of 95 %: 190 expected, deviation 3.1; five of them, for intervals to first order of a curved law."""
    v = np.linspace(0.0, 0.35, 12)
    random = np.random.default_rng(5)
    held = np.zeros(4)
    for _ in range(200):
        found = fit_hill(v, hill(v) + random.normal(0.0, 1.0, v.size))
        numbers = zip((found.isometric_tension, found.a, found.b, found.maximum_velocity), (F0, A, B, 0.4), strict=True)
        held += [i.low <= truth <= i.high for i, truth in numbers]
    assert (held >= 175).all()
    assert (held <= 200).all()


def test_a_point_is_read_where_a_release_passes_its_length():
    time = clock(1.0)
    length = 0.14 - 0.2 * np.maximum(time - 0.5, 0.0)
    tension = 50.0 - 30.0 * (time > 0.5)
    found = force_velocity_point(record(time, length=length, tension=tension), at_length=0.10)
    assert (found.velocity, found.tension, found.time) == pytest.approx((0.2, 20.0, 0.7), rel=1e-6)
    with pytest.raises(InputError, match="must be passed"):
        force_velocity_point(record(time, length=length, tension=tension), at_length=0.2)


@pytest.mark.parametrize(
    ("v", "f", "says"),
    [
        ([0.0, 0.1, 0.2], [3.0, 2.0, 1.0], "4 or more"),
        ([0.1, 0.1, 0.1, 0.1], [3.0, 2.0, 1.0, 2.0], "3 velocities or more"),
        ([-0.1, 0.1, 0.2, 0.3], [3.0, 2.0, 1.0, 0.5], "shortening"),
        ([0.0, 0.1, 0.2, 0.3], [-1.0, -1.0, 0.0, 0.0], "pulling"),
        ([0.0, 0.1, 0.2, 0.3], [1.0, 1.0, np.nan, 0.0], "finite"),
        ([0.0, 0.1, 0.2, 0.3], [1.0, 1.0, 0.0], "one length"),
    ],
)
def test_points_that_are_no_hill_curve_are_refused(v, f, says):
    with pytest.raises(InputError, match=says):
        fit_hill(v, f)


def test_points_on_a_straight_line_give_a_wide_interval_and_no_crash():
    """A line is Hill's curve with an infinite a: the curvature is then bounded from below only."""
    v = np.linspace(0.0, 0.3, 8)
    found = fit_hill(v, 60.0 - 100.0 * v)
    assert found.rms < 0.05
    assert found.curvature.value > 50.0
    assert found.isometric_tension.value == pytest.approx(60.0, rel=1e-3)
