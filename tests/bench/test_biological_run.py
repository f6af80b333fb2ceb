"""Runs of biological muscles: twitch, tetanus, force-frequency and work loops against activation in closed form."""

import numpy as np
import pytest

import mckibben as mk
from mckibben.citations import known_keys
from mckibben.errors import InputError
from mckibben.muscles.muscle import from_specimen
from mckibben.specimens import specimen

WIDTH = 5e-3  # of the stimuli in the shipped protocols [s]


@pytest.fixture(scope="module")
def fibre():
    return from_specimen(specimen("fast-fibre"))


@pytest.fixture(scope="module")
def force_frequency():
    return mk.run("force-frequency", muscle="fast-fibre", rate=["5 Hz", "20 Hz", "50 Hz", "200 Hz"])


@pytest.fixture(scope="module")
def loops():
    return mk.run("stimulated-work-loop", muscle="fast-fibre", phase=[f"{p} deg" for p in (0, 30, 60, 90, 120, 240)])


def peak_activation(fibre, rate: float) -> float:
    """Largest activation between stimuli that have gone on for long: up for the width, down for the rest of the interval."""
    rest = np.exp(-WIDTH / fibre.rise_time)
    fall = np.exp(-(1.0 / rate - WIDTH) / fibre.fall_time)
    return float((1.0 - rest) / (1.0 - rest * fall))


def test_a_twitch_is_the_activation_of_one_stimulus(fibre):
    (one,) = mk.run("twitch", muscle="fast-fibre").stimulated_contractions()
    peak = float(fibre.maximum_tension) * -np.expm1(-WIDTH / fibre.rise_time)
    assert one.peak == pytest.approx(peak, rel=1e-5)  # steps of 0.1 ms
    assert one.time_to_peak == pytest.approx(WIDTH, abs=2.1e-4)  # a sample
    assert one.half_relaxation_time == pytest.approx(float(fibre.fall_time) * np.log(2.0), rel=1e-3)  # a straight line


def test_a_fused_tetanus_has_the_largest_isometric_tension(fibre):
    (one,) = mk.run("tetanus", muscle="fast-fibre").stimulated_contractions()
    assert one.peak == pytest.approx(float(fibre.maximum_tension), rel=1e-6)  # 20 time constants
    assert one.ripple < 1e-6


def test_tension_grows_and_ripple_falls_with_the_rate_of_stimulation(fibre, force_frequency):
    each = force_frequency.stimulated_contractions()
    rates = [float(one.case["rate"].split()[0]) for one in each]
    assert rates == [5.0, 20.0, 50.0, 200.0]
    assert np.all(np.diff([one.mean for one in each]) > 0.0) and np.all(np.diff([one.ripple for one in each]) < 0.0)
    for rate, one in zip(rates, each, strict=True):
        # after 0.5 s what is left of the start is below 1e-3 of the activation at 5 Hz, and less above
        assert one.peak == pytest.approx(float(fibre.maximum_tension) * peak_activation(fibre, rate), rel=1e-3)


def test_power_is_greatest_with_stimulation_from_shortly_before_shortening(loops):
    """Tension has to be there when shortening begins, at 90 degrees, and gone when it ends."""
    power = {one.case["phase"]: one.power for one in loops.stimulated_loops()}
    assert max(power, key=power.get) in ("60 deg", "90 deg")
    assert power["0 deg"] < 0.0 and power["240 deg"] < 0.0  # tension while it lengthens: the muscle is a brake


def test_the_work_of_a_cycle_is_what_the_tension_does_along_the_length(loops):
    """The last full cycle of 60 degrees by trapezoids; all cycles are alike after the first."""
    (part,) = loops.segments("cycles", phase="60 deg")
    last = part.select(part.time[0] + 0.6 - 1e-9, None)
    work = -np.trapezoid(last["tension"], last["span"])
    (one,) = [one for one in loops.stimulated_loops() if one.case["phase"] == "60 deg"]
    assert one.work == pytest.approx(work, rel=0.01)  # a sample is missing at the end of the record
    assert one.power == pytest.approx(5.0 * one.work, rel=1e-3)


def test_without_stimulation_a_cycle_yields_no_work():
    record = mk.run("stimulated-work-loop", muscle="fast-fibre", mean="1.2 L0", duty=0.0, cycles=3)
    (one,) = record.stimulated_loops()
    swing = np.ptp(record["tension"]) * np.ptp(record["span"])
    assert swing > 0.0 and abs(one.work) < 1e-5 * swing  # passive tension alone: trapezoids on both ways


def test_a_protocol_of_pressures_excites_by_their_share_of_the_full_pressure():
    record = mk.run("work-loop", muscle="fast-fibre", cycles=1, shortening="4 bar", lengthening="1 bar")
    assert record.meta["full_pressure"] == 5e5
    assert record["excitation"].min() == pytest.approx(0.2) and record["excitation"].max() == pytest.approx(0.8)


def test_a_recording_of_a_biological_muscle_holds_what_a_report_needs(force_frequency, tmp_path):
    meta = force_frequency.meta
    assert meta["specimen"] == "fast-fibre" and meta["result"] == "done"
    assert {"gordon1966", "hill1938"} <= set(meta["citations"]) <= set(known_keys())
    again = mk.read_recording(force_frequency.save(tmp_path / "ff.nc"))
    assert again.stimulated_contractions() == force_frequency.stimulated_contractions()
    (loop,) = mk.run("stimulated-work-loop", muscle=mk.muscle("slow-fibre"), cycles=2).loops()
    assert "josephson1985" in mk.run("stimulated-work-loop", muscle="slow-fibre", cycles=2).meta["citations"]
    assert np.isfinite(loop.work)


def test_stimulation_is_refused_by_mckibben_muscles_and_machines_by_biological_ones():
    with pytest.raises(InputError, match="since only biological muscles are stimulated"):
        mk.run("twitch", muscle="nylon")
    with pytest.raises(InputError, match="real_time is of a test machine"):
        mk.run("twitch", muscle="fast-fibre", real_time=True)
    with pytest.raises(InputError, match="a biological muscle has no gas"):
        mk.run("leak-down", muscle="fast-fibre")
