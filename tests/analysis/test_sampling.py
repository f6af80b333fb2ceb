"""Eq. 13 recovered from points sampled from loops, repeatability of known scatter, and converters at their end."""

import numpy as np
import pytest
from analysis_records import COUNT, MIDDLE, clock, coulomb, counts, record, sine, triangle

from mckibben.analysis.channels import saturation
from mckibben.analysis.loops import StaticPoint, fit_linear_tension, static_points
from mckibben.analysis.repeatability import between_cycles, between_runs, spread, trend
from mckibben.errors import InputError
from mckibben.muscles.laws.linear_threshold import LinearThreshold

# The paper's four numbers, and what follows from them with L0 = 14 cm [m, Pa, m, N].
KG, PA, LMIN, FA, L0 = 0.466e-2, 0.062e5, 9.91e-2, -16.0, 0.14
PRESSURES = (2e5, 3e5, 4e5, 5e5)


def law() -> LinearThreshold:
    kp = FA / (LMIN - L0)
    return LinearThreshold(
        stiffness_per_pressure=KG,
        shortest_length=LMIN,
        threshold_pressure=PA + kp / KG,
        passive_stiffness=kp,
        rest_length=L0,
        upper_length=0.154,
        rest_volume=5.63e-6,
    )


def quasi_static(pressure, *, friction=2.5, noise=0.0, count=0.0, swing=3e3, seed=0):
    """A triangle at a pressure that swings a little with the length, the law, and friction of both signs."""
    time = clock(3.0)
    wave = triangle(time)
    length, gas = 0.13 + 0.018 * wave, pressure + swing * wave
    tension = np.asarray(law().tension(length, gas)) + friction * np.where(time % 1.0 < 0.5, 1.0, -1.0)
    random = np.random.default_rng(seed)
    tension = tension + random.normal(0.0, noise, time.size)
    gas = gas + random.normal(0.0, 100.0 * noise, time.size)
    return record(time, length=length, tension=counts(tension, count) if count else tension, pressure=gas)


def ten_points(**options):
    """Two to three lengths at each of four pressures, where the tension pulls."""
    found = []
    for k, pressure in enumerate(PRESSURES):
        lengths = (0.125, 0.145) if k < 2 else (0.120, 0.132, 0.145)
        found += static_points(quasi_static(pressure, seed=k, **options), lengths)
    return found


def test_ten_points_give_the_four_numbers_back():
    points = ten_points()
    assert len(points) == 10
    fit = fit_linear_tension(points)
    # Above the threshold the law is eq. 13 to 7e-14 N; a path whose pressure swings with the length is a parabola.
    assert fit.stiffness_per_pressure.value == pytest.approx(KG, rel=1e-6)
    assert fit.offset_pressure.value == pytest.approx(PA, rel=1e-4)
    assert fit.shortest_length.value == pytest.approx(LMIN, rel=1e-6)
    assert fit.offset_tension.value == pytest.approx(FA, rel=1e-5)
    assert fit.passive_stiffness(L0) == pytest.approx(392.0, rel=5e-3)
    assert fit.threshold_pressure(L0) == pytest.approx(0.903e5, rel=5e-3)
    assert fit.tension(0.154, 5e5) == pytest.approx(110.0, rel=0.02)


def test_friction_of_both_signs_leaves_no_trace():
    dry, none = ten_points(friction=2.5), ten_points(friction=0.0)
    assert np.array(dry) == pytest.approx(np.array(none), rel=1e-9)


def test_noise_and_counts_stay_within_the_tolerances_of_the_rows():
    """0.2 N of noise and counts of 0.39 N on points averaged over 300 samples: 0.02 N of some 40 N. Kg and Lmin to 2 %,
    Pa to 30 %, Fa to 5 %, as the rows of the paper allow.
    """
    fit = fit_linear_tension(ten_points(noise=0.2, count=COUNT))
    assert fit.stiffness_per_pressure.value == pytest.approx(KG, rel=0.02)
    assert fit.shortest_length.value == pytest.approx(LMIN, rel=0.02)
    assert fit.offset_pressure.value == pytest.approx(PA, rel=0.3)
    assert fit.offset_tension.value == pytest.approx(FA, rel=0.05)
    assert fit.rms < 0.1


def test_intervals_cover_as_often_as_they_say():
    """200 draws of 95 %: 190 expected, deviation 3.1, five of them for intervals to first order."""
    truth = (KG, PA, LMIN, FA)
    points = np.array(ten_points())
    random = np.random.default_rng(7)
    held = np.zeros(4)
    for _ in range(200):
        noisy = points + np.outer(random.normal(0.0, 0.1, 10), [0.0, 0.0, 1.0])
        fit = fit_linear_tension([StaticPoint(*p) for p in noisy])
        held += [i.low <= t <= i.high for i, t in zip(fit[:4], truth, strict=True)]
    assert (held >= 174).all()
    assert (held < 200).any()


def test_points_below_the_threshold_spoil_it():
    """CORE.md: two points at 1 bar, inside the rounded threshold, and Pa is off by about half."""
    low = static_points(quasi_static(1.0e5, swing=0.0), (0.135, 0.145))
    fit = fit_linear_tension([*ten_points()[2:], *low])
    assert abs(fit.offset_pressure.value / PA - 1.0) > 0.3


def test_points_that_do_not_tell_the_numbers_apart_are_refused():
    points = ten_points()
    for some in ([], points[:4], points[:2] * 5, [p for p in points if p.length > 0.14] * 2):
        with pytest.raises(InputError):
            fit_linear_tension(some)
    with pytest.raises(InputError, match="both paths"):
        static_points(quasi_static(5e5), [0.2])
    with pytest.raises(InputError, match="muscle.pressure"):
        static_points(coulomb(clock(3.0)), [0.13])


def test_the_scatter_between_cycles_is_the_noise():
    """200 phases fall on samples of 1000: 0.3 N is read whole, to 1/sqrt(2 x 9 x 200) = 2 %; phases of turns that noise
    of the length has moved would be read between samples, where it is less.
    """
    run = coulomb(clock(9.0), noise=0.3)
    found = between_cycles(run)
    assert found.repetitions == 9
    assert found.rms == pytest.approx(0.3, rel=0.06)
    assert found.relative_rms == pytest.approx(found.rms / (0.04 * 2300.0), rel=0.1)


def test_the_same_cycle_again_has_no_scatter_whatever_its_phase_at_the_start():
    for start in (0.0, 0.3, 0.62):
        found = between_cycles(coulomb(clock(4.0), wave=sine, start=start, friction=0.0))
        assert found.rms < 1e-9


def test_the_scatter_between_runs_is_that_of_their_offsets():
    runs = [coulomb(clock(2.0)) for _ in range(3)]
    runs = [
        record(r.time, length=r["muscle.length"], tension=r["muscle.tension"] + o)
        for r, o in zip(runs, (-0.4, 0.0, 0.4), strict=True)
    ]
    found = between_runs(runs)
    assert found.rms == pytest.approx(0.4)  # n - 1: sqrt(2 x 0.16/2)
    assert found.largest == pytest.approx(0.4)
    for few in ([], runs[:1], [runs[0], record(runs[1].time + 9.0, tension=runs[1]["muscle.tension"])]):
        with pytest.raises(InputError):
            between_runs(few)
    with pytest.raises(InputError, match="2 or more"):
        between_cycles(coulomb(clock(1.0)))


def test_spread_and_trend_of_numbers():
    found = spread([1.0, 2.0, 3.0])
    assert found == pytest.approx((2.0, 1.0, 2.0, 1.0))
    for bad in ([1.0], [1.0, -1.0], [1.0, np.nan]):
        with pytest.raises(InputError):
            spread(bad)
    speed = np.linspace(0.2, 2.0, 12)
    scatter = 0.02 * np.array([1, -1, -1, 1, 1, -1, 1, -1, -1, 1, 1, -1.0])
    assert not trend(speed, 5.0 + scatter).measurable
    viscous = trend(speed, 5.0 + 0.3 * speed + scatter)
    assert viscous.measurable
    assert viscous.slope.low < 0.3 < viscous.slope.high
    assert viscous.at_zero.value == pytest.approx(5.0, abs=0.03)
    with pytest.raises(InputError):
        trend([1.0, 2.0], [1.0, 2.0])


def clipped(count=COUNT, top=100.0, wave=triangle):
    """A force of up to 130 N on a sensor of 100 N."""
    time = clock(3.0)
    force = 65.0 + 65.0 * wave(time)
    return record(time, length=MIDDLE + 0.02 * wave(time), tension=np.minimum(counts(force, count), top))


@pytest.mark.parametrize("wave", [triangle, sine])
def test_a_clipped_sensor_is_reported_and_how_much(wave):
    run = clipped(wave=wave)
    share = np.mean(65.0 + 65.0 * wave(run.time) >= 100.0 - COUNT / 2.0)
    certain = saturation(run, "muscle.tension", ends=(0.0, 100.0))
    assert certain
    # the lower end of the converter is met at the shortest length too, by single counts
    assert certain.high / len(run) == pytest.approx(share, abs=2e-3)
    suspected = saturation(run, "muscle.tension")
    assert suspected.high == certain.high
    assert suspected.low == 0
    assert not suspected.certain
    assert "as if saturated" in suspected.sentence
    assert "% of the samples" in certain.sentence
    assert certain.longest == pytest.approx(share, rel=0.02)  # one cycle is one second


@pytest.mark.parametrize("wave", [triangle, sine])
@pytest.mark.parametrize("count", [COUNT, 1e-6])
def test_what_turns_below_the_end_is_not_suspected(wave, count):
    run = clipped(top=1e9, count=count, wave=wave)
    assert not saturation(run, "muscle.tension")
    assert not saturation(run, "muscle.tension", ends=(-150.0, 150.0))
    assert saturation(run, "muscle.tension").sentence == "no sign of saturation"
    assert saturation(run, "muscle.tension", ends=(None, 150.0)).sentence == "not saturated"


def test_the_resolution_is_the_count_and_ends_must_be_in_order():
    run = clipped()
    assert saturation(run, "muscle.tension", ends=(0.0, None)).resolution == pytest.approx(COUNT)
    with pytest.raises(InputError, match="lower end"):
        saturation(run, "muscle.tension", ends=(100.0, 0.0))
    with pytest.raises(InputError, match="muscle.pressure"):
        saturation(run, "muscle.pressure")
