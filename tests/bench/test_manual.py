"""By hand nothing jumps: set-points go where they are asked to, no faster than the machine may be moved."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from short_runs import paper

from mckibben.bench.software.sequencer import ABANDONED, MANUAL, ROW, SPAN, TENSION, VELOCITY, Manual

DT = 1e-3
LIMITS = paper().limits("direct")
HAND = Manual.of(LIMITS)
RESTS = {"alone": 0.0, "mode": SPAN, "motor": np.nan, "open": 1.0, "pressure": 0.0}
ROUNDING = 1.0 + 1e-9  # sums of a thousand steps


@jax.jit
def _follow(rows, hand=HAND):
    """The set-points of samples whose muscle is where it is asked to be, pulls 40 N, and stands while pulled."""

    def one(place, row):
        place = hand.heard(place, dict(zip(ROW, row, strict=True)))
        asked = hand.set_points(place, DT)
        at = (place.span, place.velocity, jnp.asarray(40.0))
        return hand.advance(place, asked, {}, at, DT), (place, asked)

    return jax.lax.scan(one, hand.initial(0.0, 0.14), rows)[1]


def follow(*stretches):
    """Set-points of stretches of samples: each a count, and what differs from rest."""
    counts = [count for count, _ in stretches]
    rows = np.array([[float({**RESTS, **asked}[n]) for n in ROW] for _, asked in stretches])
    padded = np.repeat(rows, [*counts[:-1], 8000 - sum(counts[:-1])], axis=0)  # one size is compiled
    return jax.tree.map(lambda x: np.asarray(x)[: sum(counts)], _follow(jnp.asarray(padded)))


wishes = st.one_of(
    st.fixed_dictionaries({"pressure": st.floats(0.0, 6.9e5)}),
    st.fixed_dictionaries({"pressure": st.floats(0.0, 6.9e5), "motor": st.floats(0.05, 0.4)}),
    st.fixed_dictionaries({"mode": st.just(VELOCITY), "motor": st.floats(-3.0, 3.0)}),
    st.fixed_dictionaries({"mode": st.just(TENSION), "motor": st.floats(0.0, 100.0)}),
)


@settings(max_examples=30)
@given(st.lists(st.tuples(st.integers(1, 1500), wishes), min_size=1, max_size=5))
def test_whatever_is_asked_the_set_points_keep_the_rates_of_the_rig(stretches):
    places, _ = follow(*stretches)
    assert np.abs(np.diff(places.pressure)).max(initial=0.0) <= float(HAND.pressure_rate) * DT * ROUNDING
    driven = (places.mode[1:] != TENSION) & (places.mode[:-1] != TENSION)
    assert np.abs(np.diff(places.span)[driven]).max(initial=0.0) <= float(HAND.speed) * DT * ROUNDING
    assert np.abs(np.diff(places.velocity)[driven]).max(initial=0.0) <= float(HAND.acceleration) * DT * ROUNDING
    pulled = (places.mode[1:] == TENSION) & (places.mode[:-1] == TENSION)
    assert np.abs(np.diff(places.tension)[pulled]).max(initial=0.0) <= float(HAND.tension_rate) * DT * ROUNDING


def test_the_rates_lie_within_those_of_the_rig():
    assert float(HAND.pressure_rate) <= LIMITS.pressure_rate
    assert float(HAND.speed) <= LIMITS.speed and float(HAND.acceleration) <= LIMITS.acceleration


@settings(max_examples=30)
@given(st.floats(0.05, 0.4))
def test_a_span_arrives_without_overshoot_in_the_time_of_a_trapezoid(to):
    places, _ = follow((4000, {"motor": to}))
    way, side = abs(to - 0.14), np.sign(to - 0.14)
    assert np.all(side * (places.span - to) <= 1e-12)
    assert places.span[-1] == pytest.approx(to, abs=1e-12) and places.velocity[-1] == 0.0
    u, a = float(HAND.speed), float(HAND.acceleration)
    ideal = way / u + u / a if way > u * u / a else 2.0 * np.sqrt(way / a)
    there = np.argmax(np.abs(places.span - to) < 1e-12) * DT
    assert there <= ideal + 5.0 * DT  # whole samples at each of three corners


@pytest.mark.parametrize("speed", [-0.15, 0.15])
def test_a_velocity_ends_at_the_end_of_the_frame(speed):
    places, asked = follow((4000, {"mode": VELOCITY, "motor": speed}))
    end = LIMITS.span[0] if speed < 0.0 else LIMITS.span[1]
    assert places.span[-1] == pytest.approx(end, abs=1e-9) and abs(asked.motor[-1]) < 1e-9
    assert LIMITS.span[0] - 1e-12 <= places.span.min() and places.span.max() <= LIMITS.span[1] + 1e-12


def test_a_new_mode_begins_at_the_measured_channel():
    places, asked = follow((500, {"motor": 0.12}), (500, {"mode": TENSION, "motor": 20.0}), (500, {}))
    first = np.argmax(places.mode == TENSION)
    assert asked.motor[first] == pytest.approx(40.0, abs=float(HAND.tension_rate) * DT * ROUNDING)
    assert asked.motor[999] == pytest.approx(20.0)
    assert np.ptp(places.span[1001:]) == 0.0  # asked for nothing, it stays


def test_set_points_are_held_without_a_hand_for_a_time_and_then_it_vents_at_once():
    held = {"pressure": 3e5, "motor": 0.12}
    places, asked = follow((2000, held), (5998, {**held, "alone": 1.0}))
    gone = np.flatnonzero(places.step == ABANDONED)
    assert gone[0] == pytest.approx(2000 + 5.0 / DT, abs=1)
    assert (
        asked.pressure[gone[0] - 1] == 3e5 and np.all(asked.pressure[gone] == 0.0) and np.all(asked.open[gone] == 1.0)
    )
    assert np.ptp(places.span[gone]) == 0.0
    never, _ = follow((8000, held))
    assert np.all(never.step == MANUAL) and never.pressure[-1] == 3e5


def test_a_hand_that_comes_back_in_time_leaves_all_as_it_was():
    held = {"pressure": 3e5}
    places, _ = follow((1500, held), (4900, {**held, "alone": 1.0}), (10, held), (1500, {**held, "alone": 1.0}))
    assert np.all(places.step == MANUAL) and places.pressure[-1] == 3e5
