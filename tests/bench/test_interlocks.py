"""Interlocks: what stops the machine and what does not, which reason counts, and what a person is told."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from short_runs import written

from mckibben.bench.rig_file import rig
from mckibben.bench.segment import software_of, timing_of
from mckibben.bench.software.interlocks import Interlocks, Trip

DT = 1e-3
HEALTHY = {"pressure": 3e5, "tension": 40.0, "span": 0.12}
ASKED = {"valve": 3e5, "motor": 40.0}


def locks(**changes):
    return Interlocks(
        **{
            "burst_pressure": 6e5,
            "most_tension": 100.0,
            "shortest": 0.09,
            "longest": 0.16,
            "most_speed": 4.0,
            "patience": 0.01,
            "pressure_rail": 6.8e5,
            "tension_rail": 110.0,
            "pressure_floor": -2e4,
            "tension_floor": -5.0,
            **changes,
        }
    )


STEP = jax.jit(lambda lock, *given: lock.step(*given))


def samples(lock, count, measured=None, asked=None, velocity=0.0, state=None):
    """Codes of some samples in which the span moves by a count each (else it is what is tested), and the last state."""
    state = lock.initial() if state is None else state
    codes = []
    for k in range(count):
        seen = dict(HEALTHY if measured is None else measured)
        if measured is None or measured.get("span") == HEALTHY["span"]:
            seen["span"] = HEALTHY["span"] + 2e-5 * (k % 2)
        state, code = STEP(lock, state, seen, ASKED if asked is None else asked, velocity, DT)
        codes.append(int(code))
    return codes, state


def first(lock, count, **options):
    """After how many samples it trips, and with what."""
    codes, _ = samples(lock, count, **options)
    found = np.flatnonzero(codes)
    return (int(found[0]) + 1, Trip(codes[found[0]])) if len(found) else None


def test_an_intact_machine_runs_on() -> None:
    assert first(locks(), 1500) is None


@pytest.mark.parametrize(
    ("channel", "inside", "beyond", "trip"),
    [
        ("pressure", 6e5, 6.01e5, Trip.OVER_PRESSURE),
        ("tension", 100.0, 100.4, Trip.OVER_FORCE),
        ("span", 0.09, 0.0899, Trip.TOO_SHORT),
        ("span", 0.16, 0.1601, Trip.TOO_LONG),
    ],
)
def test_a_limit_is_inclusive_and_counts_at_once(channel: str, inside: float, beyond: float, trip: Trip) -> None:
    assert first(locks(), 5, measured={**HEALTHY, channel: inside}) is None
    assert first(locks(), 5, measured={**HEALTHY, channel: beyond}) == (1, trip)


@pytest.mark.parametrize("velocity", [4.01, -4.01])
def test_too_fast_either_way_stops(velocity: float) -> None:
    assert first(locks(), 3, velocity=velocity) == (1, Trip.OVER_SPEED)
    assert first(locks(), 3, velocity=0.99 * velocity) is None


def test_the_first_code_stays() -> None:
    lock = locks()
    codes, state = samples(lock, 1, measured={**HEALTHY, "span": 0.2})
    assert codes == [Trip.TOO_LONG]
    codes, state = samples(lock, 3, measured={**HEALTHY, "pressure": 6.5e5}, state=state)
    assert codes == [Trip.TOO_LONG] * 3
    codes, _ = samples(lock, 3, state=state)
    assert codes == [Trip.TOO_LONG] * 3


def test_at_the_same_sample_the_lowest_code_counts() -> None:
    assert first(locks(), 1, measured={"pressure": 6.5e5, "tension": 105.0, "span": 0.2}, velocity=9.0) == (
        1,
        Trip.OVER_PRESSURE,
    )
    assert first(locks(), 1, measured={"pressure": 3e5, "tension": 105.0, "span": np.nan}) == (1, Trip.OVER_FORCE)


# Lost sensors


@pytest.mark.parametrize(
    ("channel", "reading", "trip"),
    [
        ("pressure", 6.8e5, Trip.LOST_PRESSURE),  # an open wire drives the converter to its highest code
        ("pressure", -5e4, Trip.LOST_PRESSURE),  # below the live zero
        ("tension", 110.0, Trip.LOST_TENSION),
        ("tension", -20.0, Trip.LOST_TENSION),
    ],
)
def test_a_lost_sensor_is_found_after_the_patience(channel: str, reading: float, trip: Trip) -> None:
    lock, lost = locks(), {**HEALTHY, channel: reading}
    assert first(lock, 30, measured=lost) == (10, trip)  # 10 ms of samples, not one more
    _, state = samples(lock, 9, measured=lost)
    codes, state = samples(lock, 1, state=state)
    assert codes == [0]  # a loose contact of 9 ms is forgiven
    codes, _ = samples(lock, 10, measured=lost, state=state)
    assert codes == [0] * 9 + [trip]  # and the next one begins anew


def test_the_rail_is_met_by_its_rounding_and_not_by_the_code_below() -> None:
    lock = locks(burst_pressure=1e6)
    code = 6.8e5 / 256
    assert first(lock, 30, measured={**HEALTHY, "pressure": 6.8e5 * (1 - 1e-12)}) == (10, Trip.LOST_PRESSURE)
    assert first(lock, 30, measured={**HEALTHY, "pressure": 6.8e5 - code}) is None


@pytest.mark.parametrize(("channel", "trip"), [("pressure", 6), ("tension", 7), ("span", 8)])
@pytest.mark.parametrize("reading", [np.nan, np.inf, -np.inf])
def test_a_reading_that_is_no_number_stops_at_once(channel: str, trip: int, reading: float) -> None:
    assert first(locks(), 3, measured={**HEALTHY, channel: reading}) == (1, trip)


def test_no_pressure_though_some_is_asked_for_a_second() -> None:
    silent = {**HEALTHY, "pressure": 1e4}
    assert first(locks(), 1200, measured=silent, asked={"valve": 1.01e5}) == (1000, Trip.LOST_PRESSURE)
    assert first(locks(), 1200, measured=silent, asked={"valve": 1e5}) is None  # a tenth of 10 bar is not more than it
    assert first(locks(), 1200, measured={**HEALTHY, "pressure": 2.1e4}, asked={"valve": 5e5}) is None
    assert first(locks(), 1200, measured=silent, asked={}) is None  # no valve: a manual regulator


@pytest.mark.parametrize("force", [264.0, -264.0])
def test_an_encoder_that_stands_still_under_full_force_is_lost(force: float) -> None:
    lock = locks()
    still = {**HEALTHY, "span": 0.121}
    # 10 ms of intervals: the first sample has none before it
    assert first(lock, 30, measured=still, asked={**ASKED, "motor": force}) == (11, Trip.LOST_SPAN)
    assert first(lock, 30, measured=still, asked={**ASKED, "motor": 0.99 * force}) is None
    assert first(lock, 30, asked={**ASKED, "motor": force}) is None  # it moves, by a count


def test_a_span_that_stays_away_from_its_set_point_stops_after_the_patience() -> None:
    lock, asked = locks(most_lag=3e-3), {**ASKED, "span": 0.1245}
    still = {**HEALTHY, "span": 0.121}  # 3.5 mm away, as with an encoder that stands still
    assert first(lock, 30, measured=still, asked=asked) == (10, Trip.SPAN_LAG)
    assert first(lock, 30, measured=still, asked={**asked, "span": 0.1235}) is None
    assert first(locks(), 30, measured=still, asked={**asked, "span": 1.0}) is None  # without a limit of the rig
    assert "3 mm" in lock.reason(Trip.SPAN_LAG, still, 1.0) or "0.3 cm" in lock.reason(Trip.SPAN_LAG, still, 1.0)


def test_a_muscle_that_holds_the_motor_is_no_lost_encoder() -> None:
    # at its stop a strong muscle takes the full force, and stands still
    lock = locks(most_tension=400.0, tension_rail=500.0)
    held = {"pressure": 3e5, "tension": 250.0, "span": 0.121}
    assert first(lock, 30, measured=held, asked={"motor": 264.0}) is None
    assert first(lock, 30, measured={"span": 0.121}, asked={"motor": 264.0}) == (11, Trip.LOST_SPAN)


def test_a_cell_whose_saturation_was_accepted_is_not_watched() -> None:
    for reading in (105.0, 110.0):
        assert first(locks(watch_tension=False), 50, measured={**HEALTHY, "tension": reading}) is None
    lock = locks(watch_tension=False)
    assert first(lock, 50, measured={**HEALTHY, "tension": -20.0}) == (10, Trip.LOST_TENSION)
    assert first(lock, 50, measured={**HEALTHY, "tension": np.nan}) == (1, Trip.LOST_TENSION)


# Rigs without some sensors


@pytest.mark.parametrize("missing", ["pressure", "tension", "span"])
def test_a_rig_without_a_sensor_is_watched_by_the_others(missing: str) -> None:
    rest = {name: x for name, x in HEALTHY.items() if name != missing}
    beyond = {"pressure": (6.5e5, 1), "tension": (105.0, 2), "span": (0.2, 4)}
    assert first(locks(), 50, measured=rest, velocity=0.0) is None
    for name, (reading, code) in beyond.items():
        if name != missing:
            assert first(locks(), 50, measured={**rest, name: reading}) == (1, code)


def test_without_a_sensor_at_the_muscle_the_pressure_of_the_valve_counts() -> None:
    rest = {"valve_pressure": 6.5e5, "tension": 40.0}
    assert first(locks(), 5, measured=rest) == (1, Trip.OVER_PRESSURE)
    assert first(locks(), 5, measured={**rest, "pressure": 3e5}) is None


def test_nothing_measured_is_nothing_found() -> None:
    assert first(locks(), 5, measured={}, asked={}, velocity=100.0) is None


# Words


def test_a_reason_names_the_value_what_is_allowed_and_what_was_done() -> None:
    lock = locks()
    assert lock.reason(0, HEALTHY, 1.0) == ""
    assert lock.reason(1, {"pressure": 6.5e5}, 1.234) == (
        "over pressure at 1.234 s: the pressure is 6.5 bar; it must be 6 bar or less; stopped and vented"
    )
    assert "the tension is 105 N; it must be 100 N or less" in lock.reason(2, {"tension": 105.0}, 0.1)
    assert "the span is 8 cm; it must be 9 cm or more" in lock.reason(3, {"span": 0.08}, 0.1)
    assert "the span is 20 cm; it must be 16 cm or less" in lock.reason(4, {"span": 0.2}, 0.1)
    assert "the speed is 5 m/s; it must be 4 m/s or less" in lock.reason(5, {"velocity": -5.0}, 0.1)
    assert "the pressure sensor is at the end of its range of 6.8 bar for 0.01 s" in lock.reason(
        6, {"pressure": 6.8e5}, 0.1
    )
    assert "reads -0.5 bar" in lock.reason(6, {"pressure": -5e4}, 0.1)
    assert "though the valve was asked for more than 1 bar for 1 s" in lock.reason(6, {"pressure": 0.0}, 0.1)
    assert "the tension sensor reads no number" in lock.reason(7, {"tension": float("nan")}, 0.1)
    assert "the span stayed at 12 cm" in lock.reason(8, {"span": 0.12}, 0.1)
    assert "the span sensor reads no number" in lock.reason(8, {"span": float("nan")}, 0.1)


@pytest.mark.parametrize("code", [t for t in Trip if t])
@pytest.mark.parametrize(
    "measured", [{}, HEALTHY, {"pressure": np.float64(7e5), "tension": np.nan, "span": jnp.asarray(0.3)}]
)
def test_every_code_has_a_sentence_on_one_line(code: Trip, measured: dict) -> None:
    text = locks().reason(int(code), measured, 12.5)
    assert text.isprintable()
    assert text.endswith("; stopped and vented")
    assert "at 12.5 s: " in text


# Form


@pytest.mark.parametrize("names", [("pressure", "tension", "span"), ("span",), ()])
def test_a_step_is_straight_line_and_keeps_its_types(names: tuple[str, ...]) -> None:
    lock = locks()
    measured = {name: HEALTHY[name] for name in names}
    text = str(jax.make_jaxpr(lock.step)(lock.initial(), measured, ASKED, 0.0, DT))
    assert not [word for word in ("while", "cond[", "scan", "gather", "scatter", "argmin") if word in text]
    state, code = lock.step(lock.initial(), measured, ASKED, 0.0, DT)
    assert [(y.shape, y.dtype) for y in jax.tree.leaves(state)] == [
        (x.shape, x.dtype) for x in jax.tree.leaves(lock.initial())
    ]
    assert code.shape == ()
    assert code.dtype == jnp.int32


def test_a_scan_and_the_loop_find_the_same() -> None:
    lock = locks()
    rng = np.random.default_rng(5)
    pressures = np.where(rng.random(200) < 0.9, 6.8e5, 3e5)

    def one(state, p):
        return lock.step(state, {**HEALTHY, "pressure": p}, ASKED, 0.0, DT)

    _, scanned = jax.lax.scan(one, lock.initial(), jnp.asarray(pressures))
    state, looped, step = lock.initial(), [], jax.jit(one)
    for p in pressures:
        state, code = step(state, p)
        looped.append(int(code))
    assert scanned.tolist() == looped
    assert set(looped) == {0, int(Trip.LOST_PRESSURE)}


@pytest.mark.parametrize(("how", "trip"), [('"shut"', Trip.NOTHING), ('"3 bar"', Trip.LOST_PRESSURE)])
def test_a_muscle_that_is_shut_off_may_lose_its_pressure(how, trip) -> None:
    """It need not have what the valve is asked for; one that is not shut off has to."""
    steps = (
        f'[[steps]]\npressure = "3 bar"\nspan = "1 L0"\nfor = "20 ms"\n[[steps]]\npressure = {how}\nfor = "100 ms"\n'
    )
    made = written(f'sample_rate = "1000 Hz"\n{steps}', on=rig("modern"))
    software = software_of(made, next(made.segments()), timing_of(made))
    software = software.replace(interlocks=locks(implausible_after=0.05, valve_range=1e6))
    seen = {"pressure": 3e5, "tension": 0.0, "span": 0.14}
    step = jax.jit(software.step)
    state, codes = software.initial(seen), []
    for k in range(110):
        state, _, shown = step(state, {**seen, "pressure": 3e5 if k < 20 else 0.0}, {}, DT)
        codes.append(int(shown["code"]))
    assert set(codes[:60]) == {Trip.NOTHING} and codes[-1] == trip


def test_a_sensor_that_leaves_its_limits_is_said_with_the_limit_and_the_first_one_alone() -> None:
    lock = locks(sensors={"valve_pressure": (1e4, 8e5), "tension": (-5.0, 90.0)})
    for measured, words in (
        ({"valve_pressure": 9e5, "tension": 100.0}, "the valve pressure is 9 bar; it must be 8 bar or less"),
        ({"valve_pressure": 0.0, "tension": 100.0}, "the valve pressure is 0 bar; it must be 0.1 bar or more"),
        ({"valve_pressure": 8e5, "tension": 100.0}, "the tension is 100 N; it must be 90 N or less"),
        ({"valve_pressure": np.nan}, "the valve pressure sensor reads no number"),
        ({"tension": -6.0}, "the tension is -6 N; it must be -5 N or more"),
        ({"tension": 0.0}, "a sensor is out of its limits"),
    ):
        said = lock.reason(int(Trip.OUT_OF_LIMITS), measured, 1.25)
        assert said.startswith(f"out of limits at 1.25 s: {words}; ")


@pytest.mark.parametrize(
    ("value", "trips"), [(1e4, False), (8e5, False), (9.99e3, True), (8.01e5, True), (np.nan, True), (None, False)]
)
def test_a_sensor_with_limits_of_its_own_trips_beyond_either_and_within_or_missing_never(value, trips) -> None:
    lock = locks(sensors={"valve_pressure": (1e4, 8e5), "tension": (-5.0, 90.0)})
    measured = dict(HEALTHY) | ({} if value is None else {"valve_pressure": value})
    assert first(lock, 2, measured=measured) == ((1, Trip.OUT_OF_LIMITS) if trips else None)
    assert first(lock, 2, measured={"pressure": 3e5, "span": 0.12}) is None
