"""One set of questions for every record: channels found or refused, runs with median and range, both kinds of muscle."""

import numpy as np
import pytest

import mckibben as mk
from mckibben.analysis.steps import step_responses
from mckibben.errors import InputError
from mckibben.pneumatics.orifice import Leak

TIME = np.linspace(0.0, 4.0, 801)
SWING = np.sin(2.0 * np.pi * 0.5 * TIME)


def strokes(friction=2.0, names=("span", "tension"), **more):
    """A loop of Coulomb friction about a spring of 2000 N/m."""
    pull = 60.0 + 10.0 * SWING + friction * np.sign(np.cos(2.0 * np.pi * 0.5 * TIME))
    channels = {
        names[0]: mk.Channel(0.13 + 0.005 * SWING, "m", "measured"),
        names[1]: mk.Channel(pull, "N", "measured"),
    }
    return mk.Recording(TIME, channels | more)


def runs_of(*records):
    """Records one after another, as a file that begins anew."""
    begins = [5.0 * i for i in range(len(records))]
    time = np.concatenate([r.time + b for r, b in zip(records, begins, strict=True)])
    channels = {
        n: mk.Channel(np.concatenate([r[n] for r in records]), c.unit, "measured")
        for n, c in records[0].channels.items()
    }
    runs = [{"start": b, "end": b + float(r.time[-1]), "began": 0.0} for r, b in zip(records, begins, strict=True)]
    return mk.Recording(time, channels, {"runs": runs})


@pytest.mark.parametrize(
    "names", [("span", "tension"), ("muscle.length", "muscle.tension"), ("length", "force"), ("x7", "cell")]
)
def test_the_channels_of_a_question_are_found_by_name_or_by_unit_and_told(names):
    answer = strokes(names=names).loops()
    assert answer.channels == {"length": names[0], "tension": names[1]} and answer.guessed == ("length", "tension")
    assert names[0] in answer.remarks()[0] and names[1] in answer.remarks()[0]
    assert not strokes(names=names).loops(length=names[0], tension=names[1]).guessed


def test_two_channels_that_could_be_meant_are_refused_by_name():
    record = strokes(names=("span", "left"), right=mk.Channel(TIME, "N", "measured"))
    with pytest.raises(InputError, match="left, right"):
        record.loops()
    assert record.loops(tension="left").channels["tension"] == "left"


def test_a_command_is_never_taken_for_what_was_measured():
    record = strokes(names=("x7", "tension"), **{"command.span": mk.Channel(TIME, "m", "command")})
    assert record.loops().channels["length"] == "x7"


def test_runs_have_the_median_and_range_of_what_each_says_by_itself():
    frictions = (1.0, 2.0, 4.0)
    record = runs_of(*map(strokes, frictions))
    answer = record.loops()
    assert (
        answer.runs == 3 and len({row["time"] for row in answer.numbers}) == len(answer) // 3
    )  # each on its own clock
    (line,) = answer.summary()
    # 1e-9: a path that is a straight line is read exactly
    assert [line[n] for n in ("friction", "friction_low", "friction_high")] == pytest.approx([2.0, 1.0, 4.0], abs=1e-9)
    for name in ("work", "stiffness"):
        alone = [getattr(strokes(f), name)()[0] for f in frictions]
        (line,) = getattr(record, name)().summary()
        assert [line[f"{name}{end}"] for end in ("", "_low", "_high")] == pytest.approx(
            [np.median(alone), min(alone), max(alone)]
        )


def test_a_run_without_a_cycle_is_left_out_with_a_word():
    still = strokes().with_channels({"span": mk.Channel(np.full(len(TIME), 0.13), "m", "measured")})
    with pytest.warns(UserWarning, match="run 2 is left out"):
        answer = runs_of(strokes(), still).loops()
    assert {row["run"] for row in answer.numbers} == {1}


def test_loops_at_other_pressures_are_told_apart_whichever_run_they_are_of():
    def held(bar):
        return mk.Channel(np.full(len(TIME), bar * 1e5), "Pa", "measured")

    record = runs_of(strokes(1.0, gauge=held(1.0)), strokes(3.0, gauge=held(3.0)))
    by_pressure = {line["group"]: line["friction"] for line in record.loops().summary()}
    assert by_pressure == pytest.approx({"1 bar": 1.0, "3 bar": 3.0}, abs=1e-9)


def test_a_loop_that_delivers_work_shows_no_friction():
    """Friction opposes both ways, so the tension of lengthening is the higher one; of a driven muscle it is the lower."""
    passive, driven = strokes(friction=2.0).loops(), strokes(friction=-2.0).loops()
    assert [one.height > 0.0 for one in (*passive, *driven)] == [True] * len(passive) + [False] * len(driven)
    assert [row["friction"] for row in passive.rows()] == pytest.approx([2.0] * len(passive))  # rounding
    assert {row["friction"] for row in driven.rows()} == {None}


def test_work_of_a_way_that_does_not_return_is_its_integral():
    record = strokes(0.0).select(0.5, 1.5)  # from the longest to the shortest
    answer = record.work()
    assert "no full cycle" in answer.remarks()[-1]
    assert answer[0] == pytest.approx(0.6, rel=1e-6)  # 60 N in the mean over 10 mm; trapezoids of a straight line
    assert record.stiffness()[0] == pytest.approx(2000.0, rel=1e-9)


def test_a_step_settles_when_it_stays_within_five_per_cent():
    time, tau = np.arange(0.0, 2.0, 1e-3), 0.05
    after = np.maximum(time - 0.5, 0.0)
    pressure = mk.Channel(1e5 + 3e5 * (1.0 - np.exp(-after / tau)), "Pa", "measured")
    command = mk.Channel(np.where(time >= 0.5, 4e5, 1e5), "Pa", "command")
    record = mk.Recording(time, {"valve.command": command, "pressure": pressure})
    (one,) = record.steps()
    # of an exponential 5 % is left after tau ln 20; a straight line between samples of tau/50 adds 1e-3 of it
    assert one.settling_time == pytest.approx(tau * np.log(20.0), rel=2e-3)
    (same,) = step_responses(record, command="valve.command", channel="pressure")
    assert (one.delay, one.transition) == (same.delay, same.transition)


def test_a_stimulus_is_timed_by_the_same_question_as_a_valve():
    time = np.arange(300) * 1e-3
    force = np.where(time > 0.05, (time - 0.05) / 0.02 * np.exp(1.0 - (time - 0.05) / 0.02), 0.0)
    stimulus = mk.Channel((np.arange(300) == 48).astype(float), "1", "command")
    record = mk.Recording(time, {"force": mk.Channel(force, "N", "measured"), "stimulus": stimulus})
    (one,) = record.steps()
    rise = record.contraction_timing(rising=(0.02, 0.9)).rising
    assert one.delay == rise[0].time - 0.048 and one.transition == rise[1].time - rise[0].time


def test_the_leak_is_that_of_the_hold_in_air_of_the_reference_atmosphere():
    time = np.linspace(0.0, 180.0, 1801)
    fall = np.where(time < 10.0, 5e4 * time, np.where(time < 160.0, 5e5 - 100.0 * (time - 10.0), 0.0))
    record = mk.Recording(time, {"druck": mk.Channel(fall, "Pa", "measured")})
    (hold,) = record.leak(gas_volume="200 ml")
    assert 10.0 <= hold.start < 20.0 and 150.0 < hold.end < 160.0
    assert hold.rate == pytest.approx(100.0, rel=1e-3)  # a bin of the search may hold a sample of the fill
    leak = Leak.from_decay(hold.rate, volume=2e-4, pressure=hold.pressure)
    assert hold.conductance == pytest.approx(float(leak.conductance), rel=1e-12)


def test_an_absolute_pressure_leaks_as_its_gauge_pressure_does():
    time = np.linspace(0.0, 60.0, 601)
    gauge = 5e5 - 200.0 * time
    absolute = mk.Recording(time, {"tank.pressure_abs": mk.Channel(gauge + 101325.0, "Pa", "measured")}).leak()
    same = mk.Recording(time, {"tank.pressure": mk.Channel(gauge, "Pa", "measured")}).leak()
    assert absolute[0] == pytest.approx(same[0], nan_ok=True, rel=1e-9) and "absolute" in absolute.remarks()[-1]


def test_a_hold_that_leaks_quicker_at_first_is_told():
    time = np.linspace(0.0, 60.0, 601)
    warm = mk.Channel(5e5 - 100.0 * time + 2e4 * np.exp(-time / 10.0), "Pa", "measured")
    with pytest.warns(UserWarning, match="first half of the hold"):
        mk.Recording(time, {"pressure": warm}).leak(start=0.0)


def test_a_frequency_response_of_alike_runs_is_that_of_one():
    time = np.linspace(0.0, 20.0, 2001)
    drive = np.sin(2.0 * np.pi * (0.2 + 0.1 * time) * time)
    one = mk.Recording(time, {"span": mk.Channel(drive, "m"), "tension": mk.Channel(3.0 * drive, "N")})
    both = runs_of(one.select(0.0, 4.0), one.select(0.0, 4.0)).frequency()
    assert both.response.magnitude == pytest.approx(3.0) and len(both.cutoffs) == 2
    assert both.guessed == ("source", "target")


def test_runs_of_one_file_are_compared_as_runs():
    answer = runs_of(strokes(1.0), strokes(3.0)).repeatability()
    assert answer.each == "run" and answer.compared.repetitions == 2
    assert answer.compared.largest == pytest.approx(1.0)


@pytest.mark.parametrize("question", ["stiffness", "work", "loops"])
def test_runs_that_never_move_have_no_loop_and_say_so(question):
    still = mk.Recording(
        TIME,
        {"span": mk.Channel(0.0 * TIME + 0.13, "m", "measured"), "tension": mk.Channel(60.0 + SWING, "N", "measured")},
    )
    for record in (still, runs_of(still, still)):
        with pytest.raises(InputError, match="span.*is constant"):
            getattr(record, question)()


def test_a_run_that_does_not_move_beside_one_that_does_has_no_stiffness():
    time = TIME[:200]
    still = mk.Recording(
        time,
        {"span": mk.Channel(0.0 * time + 0.13, "m", "measured"), "tension": mk.Channel(60.0 + time, "N", "measured")},
    )
    pull = mk.Recording(
        time,
        {
            "span": mk.Channel(0.13 + 1e-3 * time, "m", "measured"),
            "tension": mk.Channel(60.0 + 2.0 * time, "N", "measured"),
        },
    )
    rows = runs_of(pull, still).stiffness().to_dict()["rows"]
    assert [row["stiffness"] for row in rows] == [pytest.approx(2000.0, rel=1e-9), None]
