"""Muscles at rest, one or in lanes, taut, hanging and slack: where a root finder of another kind finds them."""

import functools

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq

from mckibben.assembly.build import rig_unit, unit_from_specimen
from mckibben.components import paths


@functools.cache
def nylon():
    return rig_unit("nylon")


@functools.cache
def excess():
    return jax.jit(lambda unit, x, span, p: unit.law.braid_tension(x, p) - unit.tendon.force(span - x))


def expected(unit, span, pressure):
    """Where braid and tendon balance, by its definition and SciPy."""

    def pull(length):
        return float(excess()(unit, length, span, pressure))

    low, longest = (float(end) for end in unit.law.length_range())
    hanging = span - float(unit.tendon.slack_length)
    if hanging > low and pull(hanging) >= 0.0:
        high = hanging
    else:
        low, high = max(low, hanging), max(longest, hanging)
    if pull(low) >= 0.0:
        return low
    return high if pull(high) <= 0.0 else brentq(pull, low, high, xtol=1e-15, rtol=1e-14)


@settings(max_examples=60)
@given(
    span=st.floats(0.08, 0.17), pressure=st.floats(-0.9e5, 6e5), threshold=st.floats(0.3e5, 1.2e5),
    stiffness=st.floats(100.0, 800.0), slack=st.sampled_from([0.0, 0.01, 0.05]),
)  # fmt: skip
def test_a_muscle_rests_where_a_root_finder_finds_it(span, pressure, threshold, stiffness, slack):
    changes = {"law.threshold_pressure": threshold, "law.passive_stiffness": stiffness, "tendon.slack_length": slack}
    unit = paths.put(nylon(), changes)
    ours, theirs = float(unit.equilibrium(span, pressure).length), expected(unit, span, pressure)
    # the root finder stops within 1e-14 of the length
    assert abs(ours - theirs) <= 2e-14 * max(theirs, span)


def test_a_muscle_at_rest_pulls_as_hard_as_its_cord():
    unit, spans = nylon(), np.linspace(0.1, 0.16, 7)
    length = np.asarray(jax.vmap(lambda x: unit.equilibrium(x, 3e5).length)(spans))
    pull = np.asarray(unit.law.braid_tension(length, 3e5))
    cord = np.asarray(unit.tendon.force(spans - length))
    taut = cord > 0.0
    assert taut.any() and not taut.all()
    # the cord has 1e5 N/m and lengths are resolved to 3e-17 m
    np.testing.assert_allclose(pull[taut], cord[taut], atol=1e-9)


def test_a_tied_muscle_rests_as_its_span_or_at_its_free_length():
    unit = unit_from_specimen("nylon")
    spans = np.linspace(0.1, 0.16, 13)
    length = np.asarray(jax.vmap(lambda x: unit.equilibrium(x, 3e5).length)(spans))
    free = float(unit.law.free_length(3e5))
    assert length == pytest.approx(np.maximum(spans, free), rel=1e-14)
    assert np.array_equal(length[spans > free], spans[spans > free])
