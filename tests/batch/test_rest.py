"""Lanes begin at rest where single machines do, taut, hanging and slack."""

import functools

import jax
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.assembly.build import unit_from_specimen
from mckibben.batch import rest
from mckibben.components import paths


@functools.cache
def nylon():
    return unit_from_specimen("nylon")


@functools.cache
def mapped():
    return jax.jit(rest.equilibrium)


@settings(max_examples=60)
@given(
    span=st.floats(0.08, 0.17), pressure=st.floats(-0.9e5, 6e5), threshold=st.floats(0.3e5, 1.2e5),
    stiffness=st.floats(100.0, 800.0), slack=st.sampled_from([0.0, 0.01, 0.05]),
)  # fmt: skip
def test_the_equilibrium_of_a_lane_is_that_of_its_muscle(span, pressure, threshold, stiffness, slack):
    changes = {"law.threshold_pressure": threshold, "law.passive_stiffness": stiffness, "tendon.slack_length": slack}
    unit = paths.put(nylon(), changes)
    ours, theirs = float(mapped()(unit, span, pressure).length), float(unit.equilibrium(span, pressure).length)
    # the root finder stops within 1e-14 of the length
    assert abs(ours - theirs) <= 2e-14 * max(theirs, span)


def test_a_muscle_at_rest_pulls_as_hard_as_its_cord():
    unit, spans = nylon(), np.linspace(0.1, 0.16, 7)
    length = np.asarray(jax.vmap(lambda x: rest.equilibrium(unit, x, 3e5).length)(spans))
    pull = np.asarray(unit.law.braid_tension(length, 3e5))
    cord = np.asarray(unit.tendon.force(spans - length))
    taut = cord > 0.0
    assert taut.any() and not taut.all()
    # the cord has 1e5 N/m and lengths are resolved to 3e-17 m
    np.testing.assert_allclose(pull[taut], cord[taut], atol=1e-9)
