"""Pressures for many tensions at once are those that `pressure_for` finds one by one, with the derivative of the law."""

import time

import jax
import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import UnreachableError


@pytest.mark.parametrize("name", ["nylon", "DMSP-10-250", "festo-20mm"])
def test_many_pressures_are_those_found_one_by_one(name):
    law, random = mk.muscle(name).law, np.random.default_rng(0)
    spans = float(law.length_range()[1]) * random.uniform(0.75, 0.99, 40)
    tensions = random.uniform(0.0, 150.0, 40)
    found = np.asarray(law.pressures_for(tensions, spans))
    for tension, span, pressure in zip(tensions, spans, found, strict=True):
        try:
            alone = law.pressure_for(tension, span)
        except UnreachableError:
            assert np.isnan(pressure)
        else:
            assert pressure == pytest.approx(alone, abs=1e-4)  # of 1e5 Pa; both end within 1e-6 Pa


def test_no_tension_needs_no_pressure_and_what_is_out_of_reach_is_no_number():
    law = mk.muscle("nylon").law
    assert float(law.pressures_for(0.0, 0.09)) == 0.0  # slack at any length below
    assert np.isnan(law.pressures_for(1e5, 0.12))
    assert np.isnan(law.pressures_for(float(law.tension(0.13, 1e5)) + 1.0, 0.13, 1e5))


def test_the_derivative_is_that_of_the_law():
    law = mk.muscle("nylon").law
    pressure = float(law.pressures_for(40.0, 0.12))
    slope = jax.grad(lambda tension: law.pressures_for(tension, 0.12))(40.0)
    assert float(slope) == pytest.approx(1.0 / float(jax.grad(lambda p: law.tension(0.12, p))(pressure)), rel=1e-9)


def test_a_sample_of_a_control_loop_takes_less_than_20_microseconds():
    law, count = mk.muscle("DMSP-10-250").law, 4096
    tensions, spans = np.linspace(5.0, 100.0, count), np.full(count, 0.23)
    law.pressures_for(tensions, spans)
    best = np.inf
    for _ in range(5):
        begin = time.perf_counter()
        law.pressures_for(tensions, spans)
        best = min(best, time.perf_counter() - begin)
    assert best / count < 20e-6  # ten times what an idle core takes
