"""Loops of which width, height, area and stiffness are known: parallelograms of friction, ellipses of viscosity."""

import numpy as np
import pytest
from analysis_records import (
    COUNT,
    FRICTION,
    MIDDLE,
    PULL,
    RANGE,
    STIFFNESS,
    clock,
    coulomb,
    record,
    sine,
    triangle,
)

from mckibben.analysis.frequency import advanced, corrected_loop, filter_effect
from mckibben.analysis.loops import (
    closed_area,
    loop,
    loop_ratio,
    loops,
    loops_by_held,
    mean_loop,
    path_distance,
    paths,
    peak_velocity,
    static_points,
    variation,
)
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.recordings import Channel, Recording

WIDTH, HEIGHT, AREA = 2.0 * FRICTION / STIFFNESS, 2.0 * FRICTION, 2.0 * FRICTION * RANGE


@pytest.mark.parametrize("wave", [triangle, sine])
def test_a_coulomb_loop_is_a_parallelogram(wave):
    """Straight paths are read exactly; the area loses the corner that one sample at each turn cuts off, below 1 in 500."""
    found = loop(coulomb(clock(3.0), wave=wave))
    assert found.width == pytest.approx(WIDTH, rel=1e-6)
    assert found.height == pytest.approx(HEIGHT, rel=1e-6)
    assert found.friction == pytest.approx(FRICTION, rel=1e-6)
    assert found.stiffness == pytest.approx(STIFFNESS, rel=1e-3)
    assert found.area == pytest.approx(AREA, rel=4e-3)
    assert (found.length_low, found.length_high) == pytest.approx((MIDDLE - RANGE / 2, MIDDLE + RANGE / 2))
    assert found.tension_high == pytest.approx(PULL + STIFFNESS * RANGE / 2 + FRICTION, rel=2e-3)


def test_a_viscous_loop_is_an_ellipse():
    """Width and height at the middle follow from the peak velocity pi f R; the polygon of 1000 samples loses 7e-6."""
    viscosity, frequency = 8.0, 2.0
    speed = np.pi * frequency * RANGE
    found = loop(coulomb(clock(3.0, 2000.0), wave=sine, frequency=frequency, friction=0.0, viscosity=viscosity))
    assert found.height == pytest.approx(2.0 * viscosity * speed, rel=1e-3)  # a local parabola of an ellipse's middle
    # The tension is a sine of the same frequency: its mid-range is passed at +-sin(phase) R/2, tan(phase) = c w/K.
    loss = viscosity * 2.0 * np.pi * frequency
    assert found.width == pytest.approx(RANGE * loss / np.hypot(loss, STIFFNESS), rel=1e-3)
    assert found.area == pytest.approx(np.pi * (RANGE / 2) ** 2 * loss, rel=1e-4)
    assert found.stiffness == pytest.approx(STIFFNESS, rel=1e-3)


@pytest.mark.parametrize("start", [0.0, 0.13, 0.25, 0.5, 0.71, 0.99])
@pytest.mark.parametrize("rate", [250.0, 1000.0, 10000.0])
def test_neither_the_phase_at_the_start_nor_the_clock_matters(start, rate):
    """At each turn up to the travel of one sample is lost, 0.8 % of the range at 250 Hz: 1.6 % of the area at most."""
    found = loop(coulomb(clock(3.0, rate), start=start))
    assert found.width == pytest.approx(WIDTH, rel=2e-3)
    assert found.height == pytest.approx(HEIGHT, rel=2e-3)
    assert found.area == pytest.approx(AREA, rel=4.0 / rate)


def test_time_reversed_a_loop_gives_back_what_it_took():
    forward = coulomb(clock(3.0), wave=sine)
    back = record(forward.time, length=forward["muscle.length"][::-1], tension=forward["muscle.tension"][::-1])
    a, b = loop(forward), loop(back)
    for name in ("width", "height", "area"):
        assert getattr(b, name) == pytest.approx(-getattr(a, name), rel=1e-9)
    assert b.stiffness == pytest.approx(a.stiffness, rel=1e-9)


def test_noise_and_counts_average_out():
    """0.2 N of noise and counts of 0.39 N: s = sqrt(0.2^2 + 0.39^2/12) = 0.23 N. A reading takes 50 samples of each path,
    a parabola 1.5 s/sqrt(50) = 0.05 N, a difference 0.07 N, the mean of 4 cycles 0.035 N; four times for the worst case.
    The mid-range of the tension is off by the noise of extremes, which moves both paths alike.
    """
    found = loop(coulomb(clock(4.0), noise=0.2, count=COUNT, seed=3))
    assert found.height == pytest.approx(HEIGHT, abs=0.14)
    assert found.width == pytest.approx(WIDTH, abs=0.14 / STIFFNESS)
    # the slopes: s/(R/2/sqrt(12)) /sqrt(250) = 2.5 N/m each
    assert found.stiffness == pytest.approx(STIFFNESS, abs=10.0)
    # the area: s times step times sqrt(1000) = 0.6 mJ a cycle, and half a count at both turns
    assert found.area == pytest.approx(AREA, rel=1e-2)


def test_the_mean_is_over_full_cycles_and_the_first_can_be_left_out():
    time = clock(4.0)
    steady = coulomb(time)
    first = np.where(time < 1.0, 2.0, 1.0)
    grown = steady["muscle.tension"] + (first - 1.0) * FRICTION * np.sign(np.sin(2.0 * np.pi * time))
    run = record(time, length=steady["muscle.length"], tension=grown)
    assert len(loops(run)) == 4
    assert loop(run, skip=1).height == pytest.approx(HEIGHT, rel=1e-6)
    assert loop(run).height == pytest.approx(HEIGHT * 5.0 / 4.0, rel=1e-6)


def test_holding_before_after_and_spikes_make_no_cycles():
    run = coulomb(clock(3.0))
    x, y = run["muscle.length"], run["muscle.tension"]
    time = clock(5.0)
    x, y = (np.concatenate([np.full(1000, v[0]), v, np.full(1000, v[-1])]) for v in (x, y))
    x = x.copy()
    x[[1300, 2777]] += 0.004
    assert len(loops(record(time, length=x, tension=y))) == 3


def test_half_the_range_with_the_lower_end_held_keeps_the_rising_path():
    """The same spring: the rising paths coincide to rounding, height and width too, the area halves."""
    whole, part = coulomb(clock(3.0)), coulomb(clock(3.0), span=RANGE / 2)
    apart = path_distance(paths(part).rising, paths(whole).rising)
    assert apart.largest < 1e-6
    assert MIDDLE - RANGE / 2 < apart.from_length < apart.to_length < MIDDLE
    ratio = loop_ratio(loop(part), loop(whole))
    assert (ratio.width, ratio.height, ratio.range) == pytest.approx((1.0, 1.0, 0.5), rel=1e-4)
    assert ratio.area == pytest.approx(0.5, rel=4e-3)


def test_the_distance_of_paths_is_that_of_their_tensions():
    a = coulomb(clock(3.0), noise=0.1, count=COUNT, seed=1)
    b = coulomb(clock(3.0), friction=FRICTION + 0.7, noise=0.1, count=COUNT, seed=2)
    apart = path_distance(paths(a).rising, paths(b).rising)
    # 0.15 N over 150 samples: 0.02 N each; the largest of 51 readings about three times that
    assert apart.rms == pytest.approx(0.7, abs=0.05)
    assert apart.largest == pytest.approx(0.7, abs=0.15)


def test_a_lag_narrows_the_loop_and_its_correction_gives_it_back():
    """At mid-range the length runs at pi f R: a lag t takes 2 t pi f R off the width of a sine."""
    lag, frequency, small = 1e-3, 10.0, 0.00892
    time = clock(2.0)
    run = coulomb(time, wave=sine, frequency=frequency, span=small, low=MIDDLE, lag=lag)
    both = corrected_loop(run, lag=lag)
    taken = 2.0 * lag * np.pi * frequency * small
    assert taken > 0.2 * WIDTH  # a fifth, as ERRATA has it
    assert both.raw.width == pytest.approx(WIDTH - taken, rel=0.02)
    # The cubic spline rings for some samples around the sudden turns only; 100 samples a cycle.
    assert both.corrected.width == pytest.approx(WIDTH, rel=0.02)
    assert both.corrected.width - both.raw.width == pytest.approx(taken, rel=0.05)


def test_a_force_filter_is_taken_out_by_its_phase():
    """An ellipse behind 200 Hz: raw off by the phase, corrected the phase is right and the gain 1/1.00125 remains."""
    frequency, cutoff, viscosity = 10.0, 200.0, 6.0
    time = clock(2.0, 5000.0)
    w = 2.0 * np.pi * frequency
    effect = filter_effect(frequency, cutoff=cutoff)
    x = MIDDLE - 0.005 * np.cos(w * time)

    def pull(phase):
        return 0.005 * (-STIFFNESS * np.cos(w * time + phase) + viscosity * w * np.sin(w * time + phase))

    run = record(time, length=x, tension=PULL + effect.gain * pull(effect.phase))
    truth = loop(record(time, length=x, tension=PULL + pull(0.0)))
    both = corrected_loop(run, cutoff=cutoff)
    assert effect.lag == pytest.approx(np.arctan(0.05) / w)
    assert both.lag == pytest.approx(effect.lag, rel=1e-5)
    late = corrected_loop(record(time, length=x, tension=np.roll(run["muscle.tension"], 5)), lag=1e-3, cutoff=cutoff)
    assert late.lag == pytest.approx(1e-3 + effect.lag, rel=1e-5)  # a dead time of 5 samples before the filter
    assert late.corrected.area == pytest.approx(both.corrected.area, rel=1e-3)
    assert abs(both.raw.area / truth.area - 1.0) > 0.2
    assert both.corrected.area == pytest.approx(effect.gain * truth.area, rel=1e-3)


def test_channels_move_by_parts_of_a_sample():
    time = clock(2.0)
    x = MIDDLE + 0.02 * np.sin(2.0 * np.pi * 3.0 * time) + 0.01 * np.sin(2.0 * np.pi * 7.1 * time)
    late = MIDDLE + 0.02 * np.sin(2.0 * np.pi * 3.0 * (time - 2.3e-3))
    late = late + 0.01 * np.sin(2.0 * np.pi * 7.1 * (time - 2.3e-3))
    run = record(time, length=x, pressure=late)
    moved = advanced(run, 2.3e-3, channels="muscle.pressure")
    assert len(moved) == len(run) - 3
    # A cubic spline of 140 samples in the shorter wave: (2 pi/140)^4/384 of it, 1e-10 m inside; free ends are worse.
    assert moved["muscle.pressure"] == pytest.approx(moved["muscle.length"], abs=1e-7)


def test_variation_and_peak_velocity():
    time = clock(3.0)
    run = coulomb(time, wave=sine, frequency=2.0)
    pressure = 5e5 + 3e3 * sine(2.0 * time)
    run = record(time, length=run["muscle.length"], tension=run["muscle.tension"], pressure=pressure)
    found = variation(run)
    assert found.largest == pytest.approx(6e3, rel=1e-4)
    assert found.around_mean == pytest.approx(3e3, rel=1e-2)
    assert found.mean == pytest.approx(5e5, rel=1e-4)
    # The frequency is timed on straight lines through a third of the range; the cycles are alike, so it is exact.
    assert peak_velocity(run) == pytest.approx(np.pi * 2.0 * RANGE, rel=1e-4)


def test_the_force_map_of_a_loop_leaves_friction_out():
    """The mean of both branches is the spring; straight paths are read exactly. The methods of a recording are the same."""
    run = coulomb(clock(3.0))
    run = run.with_channels({"muscle.pressure": Channel(np.full(len(run), 3e5), "Pa")}).with_meta(rest_length=0.14)
    names = {"length": "muscle.length", "tension": "muscle.tension", "pressure": "muscle.pressure"}
    lengths = [MIDDLE - RANGE / 4, MIDDLE, MIDDLE + RANGE / 4]
    points = run.force_map(lengths, **names)
    assert points.tension == pytest.approx(PULL + STIFFNESS * (np.array(lengths) - MIDDLE), rel=1e-6)
    assert points.pressure.tolist() == pytest.approx([3e5] * 3) and points.rest_length.tolist() == [0.14] * 3
    assert tuple(run.loops()) == loops(run)


def test_shoelace_of_a_square():
    assert closed_area([0.0, 0.0, 1.0, 1.0], [0.0, 1.0, 1.0, 0.0]) == pytest.approx(1.0)
    assert closed_area([0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0]) == pytest.approx(-1.0)


@pytest.mark.parametrize(
    ("run", "says"),
    [
        (coulomb(clock(0.9)), "full cycle"),
        (coulomb(clock(0.5)), "full cycle"),
        (coulomb(clock(1.0), span=0.0), "constant"),
        (record(clock(1.0), tension=np.ones(1001)), "muscle.length"),
        (record(clock(1.0), length=np.random.default_rng(0).normal(0.13, 1e-4, 1001), tension=np.ones(1001)), "noise"),
        (record(clock(3.0), length=coulomb(clock(3.0))["muscle.length"], tension=np.full(3001, np.nan)), "finite"),
    ],
)
def test_what_has_no_loop_is_refused_in_one_line(run: Recording, says):
    with pytest.raises(InputError, match=says) as error:
        loop(run)
    assert "\n" not in str(error.value)


def test_more_cycles_skipped_than_there_are_and_wrong_lags_are_refused():
    run = coulomb(clock(3.0))
    with pytest.raises(InputError, match="4 full cycles or more"):
        loop(run, skip=3)
    for lag in (np.nan, 4.0, -3.0):
        with pytest.raises(InputError, match="lag"):
            advanced(run, lag, channels="muscle.tension")
    with pytest.raises(InputError, match="cutoff"):
        corrected_loop(run, cutoff=0.0)
    with pytest.raises(InputError, match="in common"):
        path_distance(paths(run).rising, paths(coulomb(clock(3.0), low=0.5)).rising)


def held(blocks, *, friction=2.0, pressure=True):
    """Sines of 5 mm around 14 cm, one block after the other: (gauge pressure [bar], frequency [Hz], cycles).

    Tension 30 N and 2 N/mm at 1 bar, 60 N more for each further two bar, and Coulomb friction.
    """
    times, lengths, tensions, pressures, begun = [], [], [], [], 0.0
    for bar, frequency, cycles in blocks:
        time = np.arange(round(cycles / frequency / 0.005)) * 0.005
        phase = 2.0 * np.pi * frequency * time
        lengths.append(0.14 + 0.005 * np.sin(phase))
        tensions.append(30.0 * bar + 2000.0 * (lengths[-1] - 0.14) + friction * np.sign(np.cos(phase + 1e-9)))
        pressures.append(np.full(time.size, 1e5 * bar))
        times.append(begun + time)
        begun += time.size * 0.005
    channels = {"span": np.concatenate(lengths), "tension": np.concatenate(tensions)}
    channels |= {"pressure": np.concatenate(pressures)} if pressure else {}
    units = {"span": "m", "tension": "N", "pressure": "Pa"}
    return Recording(np.concatenate(times), {n: Channel(v, units[n], "measured") for n, v in channels.items()})


SPAN = {"length": "span", "tension": "tension"}


@pytest.mark.parametrize("pressure", [True, False])
def test_loops_are_cut_by_what_was_held(pressure):
    """One bar, then three: each pressure has its friction of 2 N and takes 4 N over 1 cm in; what lies between is no loop.

    Without the channel of the pressure, the tension tells. 200 samples in a turn: the polygon misses 2e-4 of the area.
    """
    record = held([(1, 0.5, 2), (3, 0.5, 2)], pressure=pressure)
    with pytest.warns(PlausibilityWarning, match="1 of 3 cycles .3.5 to 5.5 s. left out"):
        each = record.loops(**SPAN)
    assert [one.friction for one in each] == pytest.approx([2.0, 2.0], rel=1e-6)
    assert [one.work for one in each] == pytest.approx([-0.04, -0.04], rel=2e-3)
    groups, _ = loops_by_held(record, **SPAN)
    assert [group.words() for group, _ in groups] == (["1 bar", "3 bar"] if pressure else ["30 N", "90 N"])
    if pressure:
        assert [one.pressure for one in each] == pytest.approx([1e5, 3e5])
        with pytest.warns(PlausibilityWarning):
            points = static_points(record, [0.138, 0.142], **SPAN, pressure="pressure")
        # a quarter of a millimetre of sine within the reading window
        assert [p.tension for p in points] == pytest.approx([26.0, 34.0, 86.0, 94.0], abs=0.01)
        assert [p.pressure for p in points] == pytest.approx([1e5, 1e5, 3e5, 3e5])


def test_paths_and_variations_leave_out_what_is_no_loop_and_say_what_they_are_taken_over():
    """Between 1 and 3 bar a cycle varies by two bar that no loop has, and its path is none."""
    record = held([(1, 0.5, 2), (3, 0.5, 2)])
    with pytest.warns(PlausibilityWarning) as caught:
        both = paths(record, **SPAN)
    said = [str(w.message) for w in caught]
    assert [one.partition(" (")[0] for one in said] == [
        "1 of 3 cycles", "the paths are over loops in which different things were held",
    ]  # fmt: skip
    # one rising half of 200 samples for each pressure, ends and all
    assert len(both.rising.length) == len(both.falling.length) == 2 * 201
    with pytest.warns(PlausibilityWarning) as caught:
        found = variation(record, channel="pressure", drive="span")
    assert any("the variation is over loops" in str(w.message) and "1 bar; 3 bar" in str(w.message) for w in caught)
    assert (found.largest, found.mean) == (0.0, 2e5)
    alone = held([(1, 0.5, 3)])
    assert variation(alone, channel="tension", drive="span").largest == pytest.approx(24.0, rel=1e-3)


def test_loops_of_two_speeds_are_two_groups_and_their_mean_says_so():
    record = held([(1, 0.5, 3), (1, 1.0, 3)])
    groups, cautions = loops_by_held(record, **SPAN)
    # between them one cycle of which three quarters are of the slow kind in time
    assert [group.words() for group, _ in groups] == ["0.5 Hz", "0.8 Hz", "1 Hz"] and cautions == ()
    with pytest.warns(PlausibilityWarning, match="different things were held .0.5 Hz; 0.8 Hz; 1 Hz."):
        loop(record, **SPAN)


def test_the_closure_of_a_loop_is_what_its_tension_drifts_in_a_cycle():
    time = clock(3.0)
    steady = coulomb(time)
    drifting = steady["muscle.tension"] + 0.5 * time  # [N]
    found = loop(record(time, length=steady["muscle.length"], tension=drifting))
    assert found.closure == pytest.approx(0.5, abs=2e-3)  # of cycles of 1 s, which begin at a sample
    assert loop(steady).closure == pytest.approx(0.0, abs=1e-9)
    with pytest.raises(InputError, match="one or more"):
        mean_loop([])


def test_a_drift_parts_no_loops_and_is_said():
    """A leak of 0.3 bar over twenty loops: none of them is beside the others, and the mean is over all."""
    record = held([(3.0 - 0.015 * i, 0.5, 1) for i in range(20)])
    groups, cautions = loops_by_held(record, **SPAN)
    assert len(groups) == 1
    assert [str(c) for c in cautions] == ["pressure drifts from 2.989 bar to 2.719 bar over the loops of one mean"]


def test_cycles_of_which_none_is_closed_say_so():
    record = held([(1.0 + 0.5 * i, 0.5, 1) for i in range(6)], friction=0.0)
    _, cautions = loops_by_held(record, **SPAN)
    assert "cannot be cut by what was held" in str(cautions[0])


def test_an_account_leaves_out_cycles_that_are_no_loops():
    with pytest.warns(PlausibilityWarning, match="left out"), pytest.warns(PlausibilityWarning, match="1 bar to 3 bar"):
        account = held([(1, 0.5, 2), (3, 0.5, 2)]).energy(muscle="nylon")
    assert [c.shaft_work for c in account.cycles] == pytest.approx([-0.04, -0.04], rel=2e-3)
