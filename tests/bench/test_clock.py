"""The clock of a simulated machine: it stands still, takes single samples, and never runs away from its viewer."""

import threading
import time

import numpy as np
import pytest

from mckibben.bench.hardware import simulated as clock_module
from mckibben.bench.hardware.interface import WaitInterrupted
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


class Wall:
    """A wall clock that goes on by 10 us at every look, and as long as somebody sleeps."""

    def __init__(self, monkeypatch):
        self.now, self.slept = 100.0, []
        monkeypatch.setattr(clock_module, "perf_counter", self.look)
        monkeypatch.setattr(clock_module.time, "sleep", self.sleep)

    def look(self):
        self.now += 1e-5
        return self.now

    def sleep(self, seconds):
        self.slept.append(seconds)
        self.now += seconds


def test_samples_come_a_period_apart_by_the_speed_and_a_late_one_is_made_up_for(monkeypatch):
    wall = Wall(monkeypatch)
    clock = Clock(2.0)
    assert clock.wait(0.01) < 1e-4 and wall.now == pytest.approx(100.0, abs=1e-3)
    for k in range(1, 5):
        assert 0.0 <= clock.wait(0.01) < 1e-4  # some looks, of the machine's time
        assert wall.now == pytest.approx(100.0 + 0.005 * k, abs=1e-4)
    assert all(0.0 < one < 0.005 - 0.9 * clock_module.SPIN for one in wall.slept), "it spins at last"
    wall.now += 0.3
    assert clock.wait(0.01) == pytest.approx(2.0 * 0.295, abs=1e-3)
    assert clock.wait(0.01) == pytest.approx(2.0 * 0.290, abs=1e-3)
    clock.speed = None
    before = wall.now
    assert clock.wait(0.01) == 0.0 and wall.now - before < 1e-3
    clock.speed = 1.0
    assert clock.wait(0.01) < 1e-3, "another speed begins anew"
    wall.now += clock_module.BEHIND + 0.5
    assert clock.wait(0.01) == pytest.approx(clock_module.BEHIND + 0.49, abs=1e-3)
    assert clock.wait(0.01) < 1e-3, "nobody hurries after so much"
    assert clock.count == 11


def test_with_a_grain_a_machine_sleeps_that_long_and_is_late_only_beyond_it(monkeypatch):
    wall = Wall(monkeypatch)
    clock = Clock(1.0, grain=0.004)
    for _ in range(5):
        assert clock.wait(1e-3) == 0.0
    assert wall.slept and all(one == 0.004 for one in wall.slept) and wall.now < 100.0 + 5e-3 + 0.004
    wall.now += 0.1
    assert clock.wait(1e-3) == pytest.approx(0.1, abs=0.005)
    wall.slept.clear()
    slow = Clock(1.0, grain=0.004)
    slow.wait(0.05)
    slow.wait(0.05)
    assert wall.slept == [pytest.approx(0.05, abs=1e-3)]
    free = Clock(None, grain=0.004)
    wall.slept.clear()
    for _ in range(2 * clock_module.BREATH):
        assert free.wait(1e-3) == 0.0
    assert wall.slept == [0.0, 0.0], "others have their turn"


def test_a_halted_clock_lets_through_what_it_is_told_and_an_interrupted_one_nothing(monkeypatch):
    wall = Wall(monkeypatch)
    clock = Clock(1.0, halted=True)
    clock.step(2)
    clock.step()
    assert [clock.wait(0.01) for _ in range(3)] == [0.0] * 3 and clock.count == 3 and not wall.slept
    clock.interrupt()
    for _ in range(2):
        with pytest.raises(WaitInterrupted):
            clock.wait(0.01)
    clock.advance(100)  # waits for nothing
    clock.interrupt(False)
    clock.halt(False)
    assert clock.wait(0.01) < 1e-3 and clock.count == 4 and not clock.halted
    clock.halt()
    assert clock.halted
    clock.begin()
    assert not clock.halted and clock.wait(0.01) < 1e-3


def test_who_sees_nothing_of_a_machine_lets_it_go_by_the_wall_clock_after_the_patience(monkeypatch):
    wall, waits = Wall(monkeypatch), []
    clock = Clock(None)
    clock.begin()
    clock.viewed(0.0)
    heard = wall.now

    def wait_for(true, timeout=None):
        waits.append(timeout)
        if timeout is not None:
            wall.now += timeout
        return true()

    for _ in range(4):  # the lead is 70 ms, of which these are 60
        clock.wait(0.015)
        assert clock._near()
    monkeypatch.setattr(clock._changed, "wait_for", wait_for)
    clock.wait(0.015)
    assert not clock._near() and wall.now == pytest.approx(heard + clock_module.PATIENCE, abs=1e-3)
    clock.wait(0.015)
    assert wall.now == pytest.approx(heard + clock_module.PATIENCE + 0.015, abs=1e-3)
    clock.viewed(0.05)
    before = wall.now
    clock.wait(0.015)
    assert wall.now - before < 1e-3 and waits[-1] is None
    clock.viewed(None)
    assert clock._near()
