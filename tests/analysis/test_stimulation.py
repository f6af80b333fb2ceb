"""Contractions and work loops of stimulated muscles, from recordings made by formula."""

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.recordings import Channel, Recording

RATE = 1e4
WORDS = {"index": 1, "path": "steps.1", "case": {}, "ended_by": "time", "recorded": True, "sentence": ""}


def recording(tension, excitation, span) -> Recording:
    time = np.arange(len(tension)) / RATE
    channels = {"tension": (tension, "N"), "excitation": (excitation, "1"), "span": (span, "m")}
    steps = [WORDS | {"label": "train", "start": 0.0, "end": float(time[-1] + 1.0 / RATE)}]
    made = {n: Channel(np.broadcast_to(v, time.shape), unit) for n, (v, unit) in channels.items()}
    return Recording(time, made, {"steps": steps})


def test_a_contraction_is_read_off_its_line():
    """Up in a line for 20 ms while excited, then an exponential of 30 ms, on a rest of 2 N."""
    t = np.arange(0.0, 0.5, 1.0 / RATE)
    tension = 2.0 + np.where(t < 0.02, 500.0 * t, 10.0 * np.exp(-(t - 0.02) / 0.03))
    (one,) = recording(tension, (t < 0.02).astype(float), 0.1).stimulated_contractions()
    assert one.rest == pytest.approx(2.0) and one.peak == pytest.approx(10.0)
    assert one.time_to_peak == pytest.approx(0.02, abs=1.01 / RATE)  # a sample
    assert one.half_relaxation_time == pytest.approx(0.03 * np.log(2.0), abs=1.01 / RATE)
    assert np.isnan(one.mean) and np.isnan(one.ripple)


def test_mean_and_ripple_are_those_between_the_last_two_stimuli():
    """A sine of 2 N on 8 N at the 20 Hz of the stimuli: between two of them the mean is 8 N, the ripple 4 N of 10 N."""
    t = np.arange(0.0, 0.5, 1.0 / RATE)
    tension = np.where(t > 0.0, 8.0 + 2.0 * np.sin(2.0 * np.pi * 20.0 * t), 0.0)
    (one,) = recording(tension, (np.mod(t, 0.05) < 0.005).astype(float), 0.1).stimulated_contractions()
    assert one.mean == pytest.approx(8.0, rel=1e-9)
    assert one.ripple == pytest.approx(0.4, rel=1e-3)  # samples beside the extremes


def test_the_work_of_an_elliptic_loop_is_its_area():
    """Tension a quarter of a cycle ahead of length: work pi F A, power that times the frequency."""
    t = np.arange(0.0, 1.0, 1.0 / RATE)
    span = 0.1 + 0.005 * np.sin(2.0 * np.pi * 5.0 * t)
    tension = 20.0 - 6.0 * np.cos(2.0 * np.pi * 5.0 * t)
    (one,) = recording(tension, 1.0, span).stimulated_loops()
    assert one.work == pytest.approx(np.pi * 6.0 * 0.005, rel=1e-4)  # trapezoids of 2000 samples
    assert one.power == pytest.approx(5.0 * one.work, rel=1e-3)  # turns to a sample


def test_without_stimuli_or_cycles_there_is_nothing_to_read():
    t = np.arange(0.0, 0.5, 1.0 / RATE)
    quiet = recording(0.0 * t, 0.0, 0.1)
    with pytest.raises(InputError, match="has no stimulus in a recorded step at constant length"):
        quiet.stimulated_contractions()
    with pytest.raises(InputError, match="has no cycle in a recorded step"):
        quiet.stimulated_loops()
