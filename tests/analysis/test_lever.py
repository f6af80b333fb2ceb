"""Muscles on a lever: cuts of cycles, work and power of known loops, timing of drawn contractions, and published numbers."""

import numpy as np
import pytest

import mckibben as mk
from mckibben.analysis import lever_answers
from mckibben.analysis.lever import (
    CUTS,
    contraction_timing,
    lever_cycles,
    lever_loops,
    lever_protocol,
    missing_cycles,
    partial_cycles,
    stimulus_phase,
)
from mckibben.errors import InputError
from mckibben.recordings import Channel, Recording
from measured_data import FOLDER, measured

RATE, FREQUENCY, AMPLITUDE, PULL, TWIST = 5000.0, 25.0, 1e-3, 0.8, 0.3  # [1/s], [1/s], [m], [N], [N]
TRAIN = [
    "0.000000 Stimulus-Train Stimulator .012, 300, 0.2, 4, 25", "0.010000 Sine Wave Length Out 25,1.0,6", "0.1 Stop",
]  # fmt: skip
# Cuts are found on a smoothed length whose filter starts at zero: one sample of 200 either way.
SAMPLE = 1.5


def lever(protocol=TRAIN, ratio=1.0, cycles=6.0):
    """A sine of the length, and a force that runs before it by a quarter cycle: every cycle takes pi TWIST AMPLITUDE."""
    time = np.arange(int(cycles * RATE / FREQUENCY)) / RATE
    phase = 2.0 * np.pi * FREQUENCY * time - 0.5 * np.pi
    channels = {
        "length": Channel(AMPLITUDE / ratio * np.sin(phase), "m"),
        "force": Channel(ratio * (PULL - TWIST * np.cos(phase)), "N"),
        "stimulus": Channel((time * FREQUENCY % 1.0 < 0.01).astype(float), "1"),
    }
    return Recording(time, channels, {"source": {"protocol": protocol, "gear_ratio": ratio}})


@pytest.mark.parametrize("cut", CUTS)
def test_a_cycle_of_an_elliptic_loop_delivers_its_area_wherever_it_is_cut(cut):
    loops = lever_loops(lever(), cut=cut)
    work = np.pi * TWIST * AMPLITUDE
    whole = loops[1:-1]  # at L0 the first and the last are three quarters of a cycle
    assert len(whole) >= 2
    for one in whole:
        # one sample too many or too few of 200 at the mean force adds that share of the ellipse, and PULL times its stretch
        assert one.work == pytest.approx(work, rel=0.02)
        assert one.power == one.work / one.duration
        assert one.duration == pytest.approx(1.0 / FREQUENCY, abs=SAMPLE / RATE)


def test_cycles_begin_where_they_are_cut():
    record = lever()
    length = record["length"]
    for cut, level in (("peak", AMPLITUDE), ("trough", -AMPLITUDE), ("L0", 0.0)):
        begins = [length[c.start] for c in lever_cycles(record, cut=cut)[1:]]
        steepest = 2.0 * np.pi * FREQUENCY * AMPLITUDE / RATE  # of one sample
        np.testing.assert_allclose(begins, level, atol=SAMPLE * steepest)
    cycles = lever_cycles(record, cut="peak")
    assert all(a.stop == b.start for a, b in zip(cycles[:-1], cycles[1:], strict=True))  # none is left out


def test_kept_cycles_have_their_numbers():
    every, some = lever_loops(lever(), cut="peak"), lever_loops(lever(), cut="peak", keep=(3, 2))
    assert some == (every[2], every[1]) and [one.cycle for one in some] == [3, 2]


@pytest.mark.parametrize("ratio", [1.0, 2.0])
def test_cycles_that_the_protocol_asks_for_and_the_recording_lacks_are_said(ratio):
    whole = [lever(ratio=ratio), lever(TRAIN[:1], ratio), lever(["0.010000 Sine Wave Length Out 25,1.0,6"], ratio)]
    assert [missing_cycles(one) for one in whole] == ["", "", ""]  # all are there, or none are stated
    short = missing_cycles(lever(cycles=4.2, ratio=ratio))
    assert short.startswith("the protocol asks for 6 cycles, and the recording has 4 peaks of the length")
    assert "it ends at 0.1678 s, and they would at 0.25 s" in short  # 0.01 s of waiting, and 6/25 s
    # one is missing only: its peak might lie at an end of a whole recording, but this one stops too early
    assert "has 5 peaks" in missing_cycles(lever(cycles=5.2, ratio=ratio))
    stroke = lever(cycles=6.5, ratio=ratio)
    caught = np.where(
        stroke.time < 3.0 / FREQUENCY, stroke["length"], -AMPLITUDE / ratio
    )  # a lever that stops half-way
    still = Recording(stroke.time, {**stroke.channels, "length": Channel(caught, "m")}, stroke.meta)
    assert missing_cycles(still).endswith("the recording has 3 peaks of the length")


def test_cycles_that_are_not_whole_are_named():
    time = np.arange(int(6.5 * RATE / FREQUENCY)) / RATE
    length = AMPLITUDE * np.sin(2.0 * np.pi * FREQUENCY * time)
    record = Recording(time, {"length": Channel(length, "m"), "force": Channel(0.0 * time + PULL, "N")}, lever().meta)
    at_l0 = lever_loops(record, cut="L0")  # the first half a cycle only, from the start to the first middle
    assert partial_cycles(at_l0) == tuple(one.cycle for one in at_l0 if not 0.9 < one.duration * FREQUENCY < 1.1) != ()
    assert partial_cycles(lever_loops(record, cut="peak")) == ()
    assert partial_cycles(at_l0[:2]) == ()  # of two neither is the usual one


def test_a_gear_changes_neither_work_nor_power():
    one, two = (lever_loops(lever(ratio=ratio), cut="peak") for ratio in (1.0, 2.0))
    for a, b in zip(one, two, strict=True):
        assert (a.work, a.power) == (pytest.approx(b.work, rel=1e-12), pytest.approx(b.power, rel=1e-12))
    assert lever_protocol(lever(ratio=2.0)).amplitude == 0.5e-3


def test_the_protocol_is_read_with_its_units():
    protocol = lever_protocol(lever())
    assert (protocol.kind, protocol.pulses, protocol.cycles) == ("work loop", 4, 6.0)
    assert (protocol.offset, protocol.pulse_width, protocol.pulse_frequency) == (0.012, pytest.approx(2e-4), 300.0)
    tetanus = lever_protocol(lever(["0.0 Stimulus-Tetanus Stimulator .1,275,.2, .081", "0.75 Stop"]))
    assert (tetanus.kind, tetanus.pulses, tetanus.cycle_frequency) == ("tetanus", 22, None)  # 275 Hz for 81 ms


def test_the_phase_of_a_stimulus_is_counted_from_the_longest_length():
    # stimulated at the trough, half a cycle before the peak, to one sample
    assert abs(stimulus_phase(lever())) == pytest.approx(0.5, abs=FREQUENCY / RATE)


def contraction(kind="Twitch", rest=0.2):
    """Force that rises linearly from 0.1 s to 0.2 s and falls to rest by 0.6 s."""
    time = np.arange(1001) / 1000.0
    force = rest + np.interp(time, [0.1, 0.2, 0.6], [0.0, 1.0, 0.0])
    channels = {"force": Channel(force, "N"), "stimulus": Channel((time == 0.1).astype(float), "1")}
    words = {"Twitch": ".1,.2", "Tetanus": ".1,275,.2,.08"}[kind]
    return Recording(time, channels, {"source": {"protocol": [f"0.0 Stimulus-{kind} Stimulator {words}"]}})


@pytest.mark.parametrize(("above", "rise", "fall"), [("rest", 0.15, 0.40), ("zero", 0.14, 0.44)])
def test_set_points_are_shares_of_the_development_above_rest_or_above_zero(above, rise, fall):
    timing = contraction_timing(contraction(), rising=(0.5,), relaxing=(0.5,), above=above)
    # Of 1.2 N above zero half is 0.6 N, 0.4 of the rise; one sample of 1 ms beyond its level.
    assert timing.rising[0].time == pytest.approx(rise, abs=1.1e-3)
    assert timing.relaxing[0].time == pytest.approx(fall, abs=1.1e-3)
    assert timing.developed_force == pytest.approx({"rest": 1.0, "zero": 1.2}[above], rel=1e-12)
    assert timing.time_to_peak == pytest.approx(0.1, rel=1e-12)


def test_a_set_point_below_the_force_at_rest_is_unknown():
    (low,) = contraction_timing(contraction(rest=0.5), rising=(0.1,), above="zero").rising
    assert np.isnan(low.time) and np.isnan(low.force)


def test_a_tetanus_has_no_relaxation_unless_it_is_asked_for():
    assert contraction_timing(contraction("Tetanus")).relaxing == ()
    assert len(contraction_timing(contraction("Tetanus"), relaxing=(0.5,)).relaxing) == 1
    assert len(contraction_timing(contraction()).relaxing) == 2


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda: lever_loops(lever(), cut="l0"), "cut is 'l0'|Unknown cut 'l0'"),
        (lambda: lever_loops(lever(), keep=(9,)), "keep must be from 1 to 6|from 1 to"),
        (lambda: lever_loops(lever(["0.0 Stop"])), "Stimulus-Twitch"),
        (lambda: lever_loops(lever(cycles=1.0)), "must have two peaks"),
        (lambda: lever_loops(lever(), frequency=4000.0), "several samples in a cycle"),
        (lambda: lever_protocol(lever(["0.0 Stimulus-Train Stimulator 1,2"])), "must state 5 numbers"),
        (lambda: contraction_timing(contraction(), above="bath"), "bath"),
        (lambda: contraction_timing(contraction(), rising=(1.0,)), "below 100 %"),
        (lambda: contraction_timing(contraction(), force="pull"), "pull"),
    ],
)  # fmt: skip
def test_what_cannot_be_evaluated_is_refused(ask, message):
    with pytest.raises(InputError, match=message):
        ask()


# Published with workloopR 1.1.4 in its tests, to the digits stated there; its clock begins one sample later.
EXAMPLES = "workloopR/inst/extdata"


@measured(EXAMPLES)
def test_the_published_twitch_and_tetanus_come_out():
    twitch = mk.read(FOLDER / EXAMPLES / "twitch.ddf").contraction_timing(rising=(0.43,), relaxing=(0.34,))
    found = [twitch.stimulus_force, twitch.peak_force, twitch.rising[0].force, twitch.relaxing[0].force]
    np.testing.assert_allclose(found, [224.067e-3, 412.4495e-3, 307.1295e-3, 288.4205e-3], rtol=1e-12)
    tetanus = mk.read(FOLDER / EXAMPLES / "tetanus.ddf").contraction_timing()
    times = [tetanus.stimulus_time, tetanus.peak_time, *(p.time for p in tetanus.rising)]
    np.testing.assert_allclose(np.add(times, 1e-4), [0.1002, 0.1364, 0.1097, 0.1282], atol=1e-9)
    assert tetanus.peak_force == pytest.approx(2626.289e-3, rel=1e-9)
    assert [p.force for p in tetanus.rising] == [pytest.approx(395.9985e-3), pytest.approx(2383.387e-3, rel=1e-6)]


@measured(EXAMPLES)
def test_the_published_work_loops_come_out():
    loops = mk.read(FOLDER / EXAMPLES / "workloop.ddf").lever_loops(cut="L0", keep=(2, 3, 4))
    np.testing.assert_allclose([one.work for one in loops], [0.002263076, 0.002708145, 0.003007098], rtol=1e-6)
    np.testing.assert_allclose([one.mean_power for one in loops], [0.06903262, 0.08220278, 0.09085517], rtol=1e-6)
    trials = sorted((FOLDER / EXAMPLES / "wl_duration_trials").glob("*.ddf"))
    works, powers = [], []
    for trial in trials:
        loops = mk.read(trial).lever_loops(cut="peak", keep=(2, 3, 4))
        works.append(np.mean([one.work for one in loops]))
        powers.append(np.mean([one.mean_power for one in loops]))
    np.testing.assert_allclose(works, [0.0028362363, 0.0009686570, -0.0001310863, 0.0024082708], rtol=1e-6)
    np.testing.assert_allclose(powers, [0.078967198, 0.026247519, -0.004017894, 0.066959552], rtol=1e-6)


def test_a_record_of_another_machine_is_asked_by_the_names_that_it_has():
    record = Recording(lever().time, lever().channels, {})
    names = {"force": "tension", "length": "span", "stimulus": "excitation"}
    other = Recording(record.time, {names[n]: c for n, c in record.channels.items()}, {})
    with pytest.raises(InputError, match="frequency is missing: the recording states no protocol of a lever"):
        lever_answers.work_loops(other)
    there, here = (lever_answers.work_loops(r, frequency=FREQUENCY, keep="2-4") for r in (other, record))
    assert there.loops == here.loops
    assert there.remarks()[-1] == "Chosen by name: the length is span, the force is tension."
    twitch, same = lever_answers.contraction(other), lever_answers.contraction(record)
    assert twitch.timing == same.timing and "the stimulus is excitation" in twitch.remarks()[-1]
    assert not here.guessed and not same.guessed  # of its own names nothing is said
