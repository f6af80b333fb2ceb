"""Delays and transitions of exponential steps, whose every passing is known in closed form; twitches likewise."""

import numpy as np
import pytest
from analysis_records import COUNT, clock, counts, record

from mckibben.analysis.steps import find_steps, isometric_timing, step_responses, twitch, unsettled, unsettled_at_end
from mckibben.errors import InputError

DEAD, LATE = 5e-3, 7e-3  # command to pressure, pressure to tension [s]
UP, DOWN = 12e-3, 22e-3  # time constants [s]
PULL = 90.0  # [N]


def exponential(time, edges, dead):
    """Between 0 and 1, up at even edges and down at odd ones; settled before the next."""
    y = np.zeros_like(time)
    for k, edge in enumerate(edges):
        since = np.maximum(time - edge - dead, 0.0)
        y = y + (1.0 - np.exp(-since / UP) if k % 2 == 0 else np.exp(-since / DOWN) - 1.0)
    return y


def isometric(rate=10000.0, noise=0.0, count=0.0, duration=1.5, edges=(0.25, 0.75, 1.25), seed=0):
    time = clock(duration, rate)
    command = np.zeros_like(time)
    for k, edge in enumerate(edges):
        command[time >= edge - 1e-9] = 1.0 - k % 2
    random = np.random.default_rng(seed)
    pull = 5.0 + PULL * exponential(time, edges, DEAD + LATE) + random.normal(0.0, noise, time.size)
    pressure = 1e5 + 4e5 * exponential(time, edges, DEAD)
    return record(time, command=command, pressure=pressure, tension=counts(pull, count) if count else pull)


def passing(share, tau):
    """Time at which an exponential has covered a share of its way."""
    return -tau * np.log1p(-share)


def test_delay_rise_and_fall_of_an_exponential():
    """Straight lines between samples of 0.1 ms miss a curve of 12 ms by (0.1/12)^2/8 of it, 1 us; the dead time's corner
    falls on a sample.
    """
    found = step_responses(isometric())
    assert [r.rising for r in found] == [True, False, True]
    for r, tau in zip(found, (UP, DOWN, UP), strict=True):
        assert r.delay == pytest.approx(DEAD + LATE + passing(0.02, tau), abs=1e-5)
        assert r.transition == pytest.approx(passing(0.9, tau) - passing(0.02, tau), abs=1e-5)
        assert abs(r.step) == pytest.approx(PULL, rel=1e-4)
        assert r.threshold == 0.02


def test_the_delays_of_valve_pressure_and_tension_add_up():
    for timing in isometric_timing(isometric()):
        tau = UP if timing.rising else DOWN
        assert timing.valve_delay == pytest.approx(DEAD + passing(0.02, tau), abs=1e-5)
        assert timing.pressure_to_tension == pytest.approx(LATE, abs=2e-5)
        assert timing.total_delay == pytest.approx(timing.valve_delay + timing.pressure_to_tension)
        assert timing.command_step == (1.0 if timing.rising else -1.0)
        assert timing.settled


def test_at_one_kilohertz_and_eight_bits_times_stay_within_a_sample():
    """Half a count is 0.2 % of 90 N; the slope at 90 % is 0.1/12 ms: 0.3 ms, and at the onset 0.03 ms.
    Straight lines over 1 ms add (1/12)^2/8 of 12 ms; the corner inside a sample up to half of one.
    """
    for r, tau in zip(step_responses(isometric(1000.0, count=COUNT)), (UP, DOWN, UP), strict=True):
        assert r.delay == pytest.approx(DEAD + LATE + passing(0.02, tau), abs=5e-4)
        assert r.transition == pytest.approx(passing(0.9, tau) - passing(0.02, tau), abs=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_noise_moves_the_passings_by_noise_over_slope(seed):
    """1 N of noise, 0.55 N behind the median: the threshold rises to four deviations, 2.4 %, and is reported. At 90 % the
    first sample that noise lifts comes early: 2 x 0.55 N over 90 N x 0.1/12 ms = 1.5 ms; falling, which is slower, 2.7 ms.
    """
    found = step_responses(isometric(noise=1.0, seed=seed))
    for r, tau in zip(found, (UP, DOWN, UP), strict=True):
        assert 0.02 < r.threshold < 0.04
        assert r.delay == pytest.approx(DEAD + LATE + passing(r.threshold, tau), abs=6e-4)
        assert r.transition == pytest.approx(passing(0.9, tau) - passing(r.threshold, tau), abs=3e-3)


def approach(constants, noise=0.0, seed=0, rate=1000.0, swing=0.0, beat=10.0):
    """A step at 0.25 s that an exponential follows for so many of its time constants, 1 s in all."""
    time = clock(1.25, rate)
    since = np.maximum(time - 0.25, 0.0)
    pull = PULL * (1.0 - np.exp(-since * constants)) * (1.0 + swing * np.sin(2.0 * np.pi * beat * since))
    pull = pull + np.random.default_rng(seed).normal(0.0, noise, time.size)
    return record(time, command=(time >= 0.25) * 1.0, tension=pull)


@pytest.mark.parametrize("constants", [1.5, 2.0, 3.0, 4.0, 5.0])
def test_what_still_rises_has_not_settled_and_says_by_how_much(constants):
    """Over the last fifth of T an exponential covers exp(-0.8 T) - exp(-T) of its way; the step is what it had come to. A
    straight line through a curve of one time constant or less changes by its chord within 3 %.
    """
    (one,) = step_responses(approach(constants))
    assert not one.settled
    reached = 1.0 - np.exp(-0.9 * constants)  # the median lies in the middle of the last fifth
    assert one.after == pytest.approx(PULL * reached, rel=1e-3)
    assert one.drift == pytest.approx((np.exp(-0.8 * constants) - np.exp(-constants)) / reached, rel=0.03)
    assert f"still changes by {one.drift:.1%} of the step" in unsettled(one, "tension")


@pytest.mark.parametrize("constants", [5.3, 6.0, 10.0, 40.0])
def test_what_has_settled_is_within_a_hundredth_of_where_it_ends_and_its_time_within_four(constants):
    (one,) = step_responses(approach(constants, rate=5000.0))
    assert one.settled and unsettled(one, "tension") == ""
    assert one.after == pytest.approx(PULL, rel=0.01)
    assert one.delay + one.transition == pytest.approx(np.log(10.0) / constants, rel=0.04)


@pytest.mark.parametrize("seed", range(5))
def test_noise_is_no_drift_and_hides_none_of_its_size(seed):
    """2 N of 90 N: a line through 200 samples knows its change to 2 N sqrt(12/200) = 0.5 N, of which four are 2.2 % of the
    step; at three time constants it changes by 4.5 %.
    """
    assert step_responses(approach(20.0, noise=2.0, seed=seed))[0].settled
    assert not step_responses(approach(3.0, noise=2.0, seed=seed))[0].settled


def test_a_ripple_has_settled_at_its_level_and_a_slow_swing_has_not():
    """A line through n periods of amplitude A changes by 6 A/(pi n): 0.5 % of the step for 20 of 5 %, 5 % for 2."""
    (ripple,) = step_responses(approach(40.0, swing=0.05, beat=100.0))
    assert ripple.settled
    assert ripple.after == pytest.approx(PULL, rel=2e-3)
    assert not step_responses(approach(40.0, swing=0.05, beat=10.0))[0].settled


def test_a_next_step_that_comes_too_early_leaves_the_one_before_unsettled():
    early = isometric(edges=(0.25, 0.28, 1.25))
    assert [r.settled for r in step_responses(early)] == [False, True, True]
    assert [t.settled for t in isometric_timing(early)] == [False, True, True]


def test_the_end_of_a_run_is_told_of_channels_that_are_under_way_and_moved_at_all():
    slow, fast = approach(2.0), approach(20.0)
    still = 1e-3 * slow["muscle.tension"]
    run = record(slow.time, tension=slow["muscle.tension"], pressure=fast["muscle.tension"], command=still)
    (said,) = unsettled_at_end(run, ["muscle.tension", "muscle.pressure", "valve.command"], 0.25)
    assert said.startswith("muscle.tension has not settled at the end of the run: in the last fifth of the 1 s before")
    assert unsettled_at_end(run, ["muscle.tension"], 1.245) == []


def test_a_single_spike_is_no_onset():
    run = isometric()
    pull = run["muscle.tension"].copy()
    pull[2560] += 40.0
    spiked = record(run.time, command=run["valve.command"], tension=pull)
    assert step_responses(spiked)[0].onset == pytest.approx(step_responses(run)[0].onset, abs=1e-9)


def test_the_size_of_the_step_and_where_it_starts_do_not_matter():
    run = isometric()
    half = record(run.time, command=3.0 - 0.5 * run["valve.command"], tension=7.0 + 0.5 * run["muscle.tension"])
    for a, b in zip(step_responses(run), step_responses(half), strict=True):
        assert (a.delay, a.transition) == pytest.approx((b.delay, b.transition), abs=1e-9)


def test_a_command_that_takes_time_is_timed_at_half_its_step():
    time = clock(1.0)
    slow = np.clip((time - 0.5) / 4e-3, 0.0, 1.0)
    (step,) = find_steps(record(time, command=slow), "valve.command")
    assert step.time == pytest.approx(0.502, abs=1e-9)
    assert (step.before, step.after) == pytest.approx((0.0, 1.0))


@pytest.mark.parametrize(
    ("run", "says"),
    [
        (record(clock(1.0), command=np.zeros(1001), tension=np.zeros(1001)), "has no step"),
        (record(clock(1.0), command=np.linspace(0.0, 1.0, 1001), tension=np.zeros(1001)), "has no step"),
        (record(clock(1.0), command=(clock(1.0) > 0.5) * 1.0, tension=np.zeros(1001)), "12 times its noise"),
        (record(clock(1.0), command=(clock(1.0) > 0.5) * 1.0), "muscle.tension"),
        (record(clock(1.0), tension=np.zeros(1001)), "valve.command"),
        (record(clock(1.0), command=(clock(1.0) >= 0.999) * 1.0, tension=clock(1.0)), "must have 15 samples"),
    ],
)
def test_what_has_no_step_is_refused_in_one_line(run, says):
    with pytest.raises(InputError, match=says) as error:
        step_responses(run)
    assert "\n" not in str(error.value)


def test_thresholds_and_medians_that_mean_nothing_are_refused():
    for wrong in ({"onset": 0.0}, {"onset": 0.6}, {"reached": 1.0}, {"median": 4}):
        with pytest.raises(InputError):
            step_responses(isometric(), **wrong)


def falling_twitch(rate=5000.0, noise=0.0, tau=0.03, start=0.1, dead=0.004, seed=0):
    """t/tau exp(1 - t/tau): its peak, 20 N, at tau."""
    time = clock(0.5, rate)
    since = np.maximum(time - start - dead, 0.0) / tau
    pull = 2.0 + 20.0 * since * np.exp(1.0 - since)
    return record(time, tension=pull + np.random.default_rng(seed).normal(0.0, noise, time.size))


# t/tau where t/tau exp(1 - t/tau) is 0.02 rising and 0.5 falling: by Newton to the digits shown.
ONSET, HALF = 0.0074119, 2.6783470


@pytest.mark.parametrize("tau", [0.01, 0.03, 0.06])
def test_contraction_and_half_relaxation_of_a_critically_damped_twitch(tau):
    """The cubic over the top 15 % of the peak misses the skewed top by its fourth order, below 1 % of tau."""
    found = twitch(falling_twitch(tau=tau), stimulus=0.1)
    assert found.rest == pytest.approx(2.0)
    assert found.peak == pytest.approx(20.0, rel=1e-3)
    assert found.delay == pytest.approx(0.004 + ONSET * tau, abs=5e-5)
    assert found.contraction_time == pytest.approx((1.0 - ONSET) * tau, rel=1e-2)
    assert found.half_relaxation_time == pytest.approx((HALF - 1.0) * tau, rel=1e-2)


@pytest.mark.parametrize("seed", range(5))
def test_a_twitch_in_noise(seed):
    """0.2 N of 20 N, 0.11 N behind the median: the onset threshold is 2.2 % of the peak, 0.4 N on a slope of 1.8 N/ms. The
    cubic over 180 samples finds a top of curvature 20/tau^2 to 2 x 0.2/sqrt(180)/(0.8 x 20 N/tau): below 4 % of tau.
    """
    found = twitch(falling_twitch(noise=0.2, seed=seed), stimulus=0.1)
    assert found.peak == pytest.approx(20.0, abs=0.1)
    assert found.delay == pytest.approx(0.004 + ONSET * 0.03, abs=4e-4)
    assert found.contraction_time == pytest.approx(0.03 * (1.0 - ONSET), abs=0.04 * 0.03 + 4e-4)
    assert found.half_relaxation_time == pytest.approx(0.03 * (HALF - 1.0), abs=0.04 * 0.03 + 1e-3)


def test_what_is_no_twitch_is_refused():
    run = falling_twitch()
    for stimulus, part, says in (
        (0.0, run, "before it"),
        (0.9, run, "after it"),
        (0.1, run.select(0.0, 0.15), "until half the peak is lost"),
    ):
        with pytest.raises(InputError, match=says):
            twitch(part, stimulus=stimulus)
    with pytest.raises(InputError, match="twitch of 12 times"):
        twitch(record(clock(1.0), tension=np.random.default_rng(1).normal(0.0, 1.0, 1001)), stimulus=0.5)


def test_a_pulse_and_noise_are_no_steps():
    time = clock(1.0)
    pulse = np.where(np.arange(1001) == 500, 1.0, 0.0)
    with pytest.raises(InputError, match="has no step"):
        find_steps(record(time, command=pulse), "valve.command")
    one = np.where(time > 0.7, 1.0, 0.0) + 0.02 * pulse
    assert len(find_steps(record(time, command=one), "valve.command")) == 1
