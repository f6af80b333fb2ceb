"""A calibration in a recording: what it says, when it ends, and that another one can be applied without any loss."""

import dataclasses
import datetime
import json
import math
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mckibben.errors import InputError
from mckibben.recordings import Channel, Recording, read_recording
from mckibben.recordings.calibration import (
    DAY,
    INDICATED,
    SCHEMA,
    Calibration,
    Correction,
    CorrectionTerm,
    Origin,
    carried,
    indicated,
    moment,
    read_plain,
    recalibrate,
    saturated,
)

DATE = "2026-03-31T12:00:00+00:00"
BITS, LOW, HIGH = 8, -10.0, 100.0
Q = (HIGH - LOW) / 2**BITS
COUNTS = np.array([0, 3, 40, 255, 255, 130, 129, 7.0])
TIME = 1e-3 * np.arange(len(COUNTS))
TRAVEL, MOUNTED = 6.283185307179586e-06, 0.1437


def origin(**more) -> Origin:
    return Origin(method="weights", date=DATE, reference="M1", reference_uncertainty=0.01, points=7, **more)


def calibration(
    gain=1.02, zero=3.0, skew=0.0, rig="modern", valid_for=365.0 * DAY, channel="tension", unit="N"
) -> Calibration:
    terms = {
        "gain": CorrectionTerm(gain, 2e-4, 12.5, origin(valid_for=valid_for)),
        "zero": CorrectionTerm(zero, 0.01, math.inf, origin(valid_for=valid_for)),
        "skew": CorrectionTerm(skew, 1e-7, 23.0, origin()),
    }
    one = Correction(unit=unit, terms=terms, sensor="S/N 1", correlation=0.4, linearity=0.02)
    return Calibration(rig=rig, created=DATE, corrections={channel: one})


def recording(meta=None) -> Recording:
    channels = {
        "tension": Channel(LOW + COUNTS * Q, "N", "measured"),
        "span": Channel(MOUNTED + np.arange(8) * TRAVEL, "m", "measured"),
        "muscle.tension": Channel(np.ones(8), "N"),
    }
    converters = {"tension": {"low": LOW, "high": HIGH - Q, "bits": BITS}}
    saturation = {"tension": {"share": 3 / 8, "longest": 1e-3, "sentence": "saturated"}}
    return Recording(
        TIME, channels, {"rig": "modern", "converters": converters, "saturation": saturation, **(meta or {})}
    )


def test_true_and_indicated_are_inverse_and_say_how_well_they_are_known():
    one = calibration().corrections["tension"]
    assert one.true(13.0) == 1.02 * 10.0
    assert one.indicated(one.true(13.0)) == pytest.approx(13.0, rel=1e-15)
    # by hand: gain's part 10 N * 2e-4, zero's part -1.02 * 0.01 N, correlation 0.4
    by_gain, by_zero = 2e-3, -1.02e-2
    expected = math.sqrt(by_gain**2 + by_zero**2 + 0.8 * by_gain * by_zero)
    assert one.uncertainty(13.0) == pytest.approx(expected, rel=1e-12)


def test_the_plain_table_reads_back_exactly_through_every_kind_of_file(tmp_path):
    whole = calibration()
    assert read_plain(whole.plain()) == whole
    for suffix in (".nc", ".csv"):
        known = read_recording(recording({"calibration": whole.plain()}).save(tmp_path / f"a{suffix}"))
        assert carried(known) == whole


def test_terms_that_nobody_determined_leave_the_reading_as_it_is_and_its_uncertainty_unknown():
    one = Correction(unit="N", terms={"zero": CorrectionTerm(2.0, 0.1)})
    assert (one.gain, one.skew, one.true(5.0)) == (1.0, 0.0, 3.0)
    assert math.isnan(one.uncertainty(5.0))


def test_it_expires_with_a_sentence_and_only_after_its_time():
    whole = calibration(valid_for=30.0 * DAY)
    end = datetime.datetime.fromisoformat(DATE) + datetime.timedelta(days=30)
    assert whole.expired(end) == ()
    (said,) = whole.expired(end + datetime.timedelta(seconds=1))
    assert said == (
        "the calibration of tension (gain and zero by weights on 2026-03-31, valid for 30 days) expired on 2026-04-30"
    )
    assert calibration(valid_for=math.inf).expired("9999-01-01") == ()


def test_a_recording_made_after_the_end_says_so_and_one_made_before_does_not():
    whole = calibration(valid_for=30.0 * DAY)
    late = recalibrate(recording({"created": "2026-06-01T00:00:00+00:00"}), whole)
    assert any("expired on 2026-04-30" in w for w in late.meta["warnings"])
    assert "warnings" not in recalibrate(recording({"created": "2026-04-01T00:00:00+00:00"}), whole)


def test_another_sensor_takes_nothing_over_and_the_same_one_keeps_its_other_terms():
    one = calibration().corrections["tension"]
    zero = Correction(unit="N", terms={"zero": CorrectionTerm(3.5, 0.02)}, sensor="S/N 1")
    kept = one.updated(zero)
    assert (kept.gain, kept.zero, kept.correlation) == (1.02, 3.5, 0.0)
    other = Correction(unit="N", terms={"zero": CorrectionTerm(3.5, 0.02)}, sensor="S/N 2")
    assert one.updated(other) == other


@pytest.mark.parametrize(
    ("path", "value", "allowed"),
    [
        ("schema", SCHEMA + 1, "a newer one wrote it"),
        ("schema", True, "must be 1"),
        ("rig", 3, "one line of text"),
        ("created", "yesterday", "a date such as"),
        ("colour", "red", "Known are schema"),
        ("channels", [1], "must be a table"),
        ("channels.tension.unit", "kN", "an SI unit"),
        ("channels.tension.gain", 1.02, "must be a table"),
        ("channels.tension.gain.value", math.nan, "must be between 0.001 and 1000"),
        ("channels.tension.gain.value", -1.0, "must be between 0.001 and 1000"),
        ("channels.tension.gain.value", "1", "must be a number"),
        ("channels.tension.gain.uncertainty", -1e-3, "must be between 0 and"),
        ("channels.tension.gain.degrees", 0.0, "must be between 0.5"),
        ("channels.tension.zero.valid_for", 0.0, "must be between 1 s"),
        ("channels.tension.zero.date", "2026-13-01", "a date such as"),
        ("channels.tension.correlation", 1.5, "must be between -1 and 1"),
        ("channels.tension.offset", 3.0, "A channel has unit"),
    ],
)
def test_a_table_that_is_wrong_is_refused_by_its_path(path, value, allowed):
    table = json.loads(json.dumps(calibration().plain()))
    *parents, last = path.split(".")
    at = table
    for key in parents:
        at = at[key]
    at[last] = value
    with pytest.raises(InputError, match=allowed) as error:
        read_plain(table, where="here")
    assert re.match(f"here: (Unknown field ')?{path}", str(error.value))
    with pytest.raises(InputError, match="calibration of the recording"):
        recalibrate(recording({"calibration": table}), None)


@given(
    st.lists(st.tuples(st.floats(0.5, 2.0), st.floats(-50.0, 50.0)), min_size=1, max_size=4),
    st.integers(4, 24), st.sampled_from([(-1100.0, 1100.0), (0.0, 6.8e5), (-1.7, 12.3), (0.1, 0.7)]), st.integers(0, 99),
)  # fmt: skip
def test_any_calibrations_after_another_give_the_bits_of_the_last_alone(steps, bits, ends, seed):
    q = (ends[1] - ends[0]) / 2.0**bits
    counts = np.random.default_rng(seed).integers(0, 2**bits, 50).astype(float)
    values = ends[0] + counts * q
    converters = {"tension": {"low": ends[0], "high": ends[0] + (2.0**bits - 1.0) * q, "bits": bits}}
    raw = Recording(1e-3 * np.arange(50), {"tension": Channel(values, "N", "measured")}, {"converters": converters})
    at = raw
    for gain, zero in steps:
        at = recalibrate(at, calibration(gain, zero))
    alone = recalibrate(raw, calibration(*steps[-1]))
    assert np.array_equal(at["tension"], alone["tension"])
    assert np.array_equal(recalibrate(at, None)["tension"], recalibrate(alone, None)["tension"])
    assert np.array_equal(indicated(at, "tension").counts, counts)
    if (q * 2.0**bits).is_integer():  # low + n q has no rounding then: the very bits of before
        assert np.array_equal(recalibrate(at, None)["tension"], values)


def test_the_old_calibration_goes_to_the_history_and_the_new_one_into_the_meta():
    first, second = calibration(1.02), calibration(1.03)
    done = recalibrate(recalibrate(recording(), first), second)
    assert carried(done) == second
    assert [read_plain(old) for old in done.meta["calibration_history"]] == [first]
    off = recalibrate(done, None)
    assert "calibration" not in off.meta and len(off.meta["calibration_history"]) == 2
    assert off["tension"].tobytes() == recording()["tension"].tobytes()
    assert np.array_equal(done["muscle.tension"], recording()["muscle.tension"])  # true ones are no readings


def test_saturated_samples_stay_marked_through_any_calibration_and_shift():
    raw = recording()
    expected = (COUNTS == 0) | (COUNTS == 255)
    assert np.array_equal(saturated(raw, "tension"), expected)
    done = recalibrate(raw, calibration())
    assert np.array_equal(saturated(done, "tension"), expected)
    assert done.meta["saturation"] == raw.meta["saturation"]
    moved = recalibrate(raw, calibration(skew=0.5e-3), skew=True)
    both = expected[:-1] | expected[1:]
    assert np.array_equal(saturated(moved, "tension")[:-1], both)


def test_a_shift_is_done_only_when_asked_says_so_and_is_taken_back_exactly():
    raw, shift = recording(), calibration(1.0, 0.0, 0.25e-3)
    assert np.array_equal(recalibrate(raw, shift)["tension"], raw["tension"])
    moved = recalibrate(raw, shift, skew=True)
    between = 0.75 * raw["tension"][:-1] + 0.25 * raw["tension"][1:]
    # straight lines, in another order of operations
    assert moved["tension"][:-1] == pytest.approx(between, rel=1e-12, abs=1e-12)
    assert math.isnan(moved["tension"][-1])
    assert moved.meta["skew_corrected"] == ["tension"]
    assert np.array_equal(moved["tension" + INDICATED], raw["tension"])
    back = recalibrate(moved, calibration(1.02, 3.0))
    assert back["tension"].tobytes() == recalibrate(raw, calibration(1.02, 3.0))["tension"].tobytes()
    assert "skew_corrected" not in back.meta and "tension" + INDICATED not in back


def test_nothing_is_interpolated_across_a_gap():
    raw = recording()
    late = Recording(np.where(TIME > 3.5e-3, TIME + 1.0, TIME), raw.channels, raw.meta)
    moved = recalibrate(late, calibration(1.0, 0.0, 0.25e-3), skew=True)
    assert np.flatnonzero(np.isnan(moved["tension"])).tolist() == [3, 7]


def test_a_gain_of_the_encoder_turns_about_where_it_was_zeroed():
    turned = calibration(1.05, 0.0, channel="span", unit="m")
    left = recalibrate(recording(), turned)
    assert np.array_equal(left["span"], recording()["span"])
    assert "does not say where its encoder was zeroed" in left.meta["warnings"][0]
    for mounted in (MOUNTED, [[0.0, MOUNTED]]):
        raw = recording({"encoder": {"resolution": TRAVEL, "mounted": mounted}})
        done = recalibrate(raw, turned)
        # the sum has the rounding of a span of 0.14 m
        assert done["span"] == pytest.approx(MOUNTED + 1.05 * np.arange(8) * TRAVEL, abs=1e-16)
        assert np.array_equal(recalibrate(done, None)["span"], raw["span"])
    two = recording({"encoder": {"resolution": TRAVEL, "mounted": [[0.0, MOUNTED], [4e-3, MOUNTED - 0.01]]}})
    travel = (recalibrate(two, turned)["span"] - two["span"]) / 0.05
    assert travel[4:] == pytest.approx(0.01 + np.arange(4, 8) * TRAVEL, rel=1e-9)  # differences of spans near 0.14 m


def test_a_resampled_channel_is_taken_back_to_rounding_and_says_so():
    raw = recording()
    some = raw.uniform(0.7e-3)
    done = recalibrate(recalibrate(some, calibration()), None)
    assert done["tension"] == pytest.approx(some["tension"], rel=1e-12, abs=1e-12)
    assert any("does not lie on the counts" in w for w in done.meta["warnings"])


def test_missing_samples_stay_missing():
    raw = recording()
    values = raw["tension"].copy()
    values[2] = math.nan
    done = recalibrate(raw.with_channels({"tension": raw.channels["tension"].with_values(values)}), calibration())
    assert np.flatnonzero(np.isnan(done["tension"])).tolist() == [2]


@pytest.mark.parametrize(
    ("new", "said"),
    [
        (calibration(rig="paper"), "rig is 'paper': the recording is of modern"),
        (calibration(channel="force"), "channels is 'force': measured in the recording: tension, span"),
        (calibration(unit="Pa"), "unit of tension is 'Pa': the recording has N"),
        (None, "calibration is not in the recording"),
    ],
)
def test_what_does_not_fit_the_recording_is_refused_in_one_line(new, said):
    with pytest.raises(InputError, match=said):
        recalibrate(recording(), new)


@pytest.mark.parametrize(
    "converter",
    [{"low": 0.0, "high": 1.0}, {"low": 1.0, "high": 0.0, "bits": 8}, {"low": "a", "high": 1.0, "bits": 8}, 3],
)
def test_a_converter_in_the_meta_that_is_none_is_refused(converter):
    with pytest.raises(InputError, match="converters.tension"):
        recalibrate(recording({"converters": {"tension": converter}}), calibration())


@pytest.mark.parametrize(
    ("degrees", "confidence", "factor"),
    # Student's t as printed: NIST/SEMATECH e-Handbook of Statistical Methods, table 1.3.6.7.2
    [(1.0, 0.95, 12.706), (10.0, 0.95, 2.228), (10.0, 0.99, 3.169), (math.inf, 0.95, 1.960), (math.inf, 0.99, 2.576)],
)
def test_an_interval_reaches_as_far_as_students_t_on_either_side(degrees, confidence, factor):
    low, high = CorrectionTerm(2.0, 0.1, degrees).interval(confidence)
    assert (low, high) == pytest.approx(
        (2.0 - 0.1 * factor, 2.0 + 0.1 * factor), abs=0.1 * 5e-4
    )  # three places printed


def test_terms_determined_later_leave_other_channels_and_take_over_new_ones():
    whole, zero = calibration(), Correction(unit="N", terms={"zero": CorrectionTerm(3.5, 0.02)}, sensor="S/N 1")
    other = Correction(unit="Pa", terms={"zero": CorrectionTerm(10.0, 1.0)})
    after = whole.updated({"tension": zero, "pressure": other}, "2026-07-01T00:00:00+00:00")
    assert after.corrections["tension"] == whole.corrections["tension"].updated(zero)
    assert (after.corrections["pressure"], after.created, after.rig) == (other, "2026-07-01T00:00:00+00:00", whole.rig)
    assert calibration(valid_for=math.inf).corrections["tension"].terms["gain"].origin.expires is None


def test_of_two_terms_the_one_that_is_too_old_is_named_alone():
    one = calibration(valid_for=30.0 * DAY).corrections["tension"]
    young = dataclasses.replace(one.terms["gain"], origin=origin(valid_for=math.inf))
    whole = dataclasses.replace(
        calibration(), corrections={"tension": dataclasses.replace(one, terms={**one.terms, "gain": young})}
    )
    (said,) = whole.expired("2027-01-01T00:00:00+00:00")
    assert said.startswith("the calibration of tension (zero by weights on 2026-03-31, valid for 30 days)")


def test_a_date_without_a_zone_is_in_utc_and_every_other_becomes_so():
    noon = datetime.datetime(2026, 3, 31, 12, tzinfo=datetime.UTC)
    for text in ("2026-03-31T12:00:00", "2026-03-31T12:00:00+00:00", "2026-03-31T14:00:00+02:00"):
        assert moment(text) == noon and moment(text).tzinfo == datetime.UTC
    assert moment(noon) is not None and moment(noon.replace(tzinfo=None)) == noon
    for wrong in ("yesterday", None, 5):
        with pytest.raises(InputError, match="must be a date"):
            moment(wrong)
