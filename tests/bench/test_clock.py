"""The clock of a simulated machine: it stands still, takes single samples, and never runs away from its viewer."""

import threading
import time

import numpy as np
import pytest

from mckibben.bench.hardware import simulated as clock_module
from mckibben.bench.hardware.simulated import LEAD, Clock
from mckibben.web.bench.machine import GRAIN


def test_a_clock_halts_steps_and_goes_on():
    clock, count = Clock(None, grain=GRAIN), []
    done = threading.Event()

    def loop():
        while not done.is_set():
            clock.wait(1e-3)
            count.append(1)
            if len(count) > 10**6:
                return

    clock.halt()
    thread = threading.Thread(target=loop, daemon=True)
    thread.start()
    time.sleep(0.05)
    assert not count
    clock.step(3)
    time.sleep(0.1)
    assert len(count) == 3
    clock.halt(False)
    time.sleep(0.05)
    done.set()
    thread.join(5.0)
    assert len(count) > 100


@pytest.mark.parametrize("speed", [None, 1.0])
def test_no_clock_goes_further_than_the_lead_over_what_the_page_in_control_has_shown(speed, monkeypatch):
    monkeypatch.setattr(clock_module, "PATIENCE", 60.0)  # longer than this test, on a busy machine too
    clock, period, through = Clock(speed, grain=GRAIN), 1e-3, []
    clock.begin()
    clock.viewed(0.0)

    def run():
        while len(through) < 200:
            clock.wait(period)
            through.append(time.perf_counter())

    thread = threading.Thread(target=run, daemon=True)
    thread.start()
    lead = round(LEAD / period)
    for shown in (0, 20, 60):
        clock.viewed(shown * period)
        end = time.monotonic() + 10.0
        while len(through) < shown + lead - 2 and time.monotonic() < end:
            time.sleep(0.01)
        time.sleep(0.1)  # in which a hundred more would come, if nothing held them
        # a sample counts when it is asked for, and rounding may let one more or less through
        assert shown + lead - 2 <= len(through) <= shown + lead + 1
    clock.viewed(None)  # nobody is in control any more
    thread.join(20.0)
    assert len(through) == 200


def test_a_page_that_says_nothing_is_waited_for_and_then_time_is_real(monkeypatch):
    monkeypatch.setattr(clock_module, "PATIENCE", 0.05)
    clock, period, free = Clock(None, grain=GRAIN), 1e-3, round(LEAD / 1e-3) - 1
    clock.begin()
    begun = time.perf_counter()
    clock.viewed(0.0)
    asked, taken = [], []
    for _ in range(free + 30):
        asked.append(time.perf_counter())
        clock.wait(period)
        taken.append(time.perf_counter())
    # a sample is let through a period after the one before, which was not before it was asked for; the clock is the same
    assert (np.array(taken[free + 1 :]) - asked[free:-1]).min() >= 0.99 * period
    assert taken[free + 1] - begun >= 0.05
    clock.viewed(period * len(taken))
    free_again = []
    for _ in range(free):
        clock.wait(period)
        free_again.append(time.perf_counter())
    assert np.median(np.diff(free_again)) < 0.5 * period  # the median of samples that wait for nothing
