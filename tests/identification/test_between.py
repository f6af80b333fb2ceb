"""A new muscle of a make: its interval, and what readings of it tell."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mckibben.errors import InputError, PlausibilityWarning
from mckibben.estimation import NORMAL_QUANTILE
from mckibben.identification.between import (
    HELD_ELSEWHERE,
    OTHER_BORE_GAIN,
    Between,
    NewMuscle,
    TensionReading,
    read_readings,
)
from mckibben.identification.fit import Fit, fit
from mckibben.muscles.build import build_law
from mckibben.recordings import ForceMap
from mckibben.specimens.model import BETWEEN_COMPONENTS

ROOT = Path(__file__).resolve().parents[2]
KNOWN = {"rest_diameter": 0.010, "wall_thickness": 0.0018}
TRUE = {"rest_angle": 0.386, "shear_modulus": 1.0e6, "seat_compliance": 1.6e-4}
RESTS = (0.083, 0.182, 0.281)
OTHER = 0.130
LENGTHS, PRESSURES = np.array([0.88, 0.94, 0.97, 1.0]) * OTHER, np.array([2e5, 4e5, 5.5e5, 6e5])
AT = tuple(axis.ravel() for axis in np.meshgrid(LENGTHS, PRESSURES))


def made(rest: float, shift: float = 0.0, gain: float = 1.0) -> ForceMap:
    """Readings of a virtual muscle whose length and gain are off."""
    law = build_law("seated_braid", KNOWN | TRUE | {"rest_length": rest, "upper_length": rest + 1e-3})
    length, pressure = (a.ravel() for a in np.meshgrid(np.linspace(0.88, 1.0, 4) * rest, np.linspace(1e5, 6e5, 8)))
    tension = gain * np.asarray(law.tension(length + shift, pressure))
    return ForceMap("made up", length, pressure, tension, rest_length=np.full(len(length), rest))


TABLE = ForceMap.joined([made(r, s, g) for r, s, g in zip(RESTS, (3e-4, -4e-4, 2e-4), (1.02, 0.98, 1.01), strict=True)])


@pytest.fixture(scope="module")
def found() -> Fit:
    return fit("seated_braid", TABLE, known=KNOWN, schemes=())


def unread(found: Fit, between: Between | None = None, *, elsewhere: bool = False) -> NewMuscle:
    fitted = found if between is None else replace(found, between=between)
    return fitted.one_more(elsewhere=elsewhere, rest_length=OTHER)


def reading(share: float, pressure: float = 5.5e5) -> TensionReading:
    law = build_law("seated_braid", KNOWN | TRUE | {"rest_length": OTHER, "upper_length": OTHER + 1e-3})
    return TensionReading(share * OTHER, pressure, 0.96 * float(law.tension(share * OTHER - 5e-4, pressure)))


def test_several_rest_lengths_have_an_interval_between_muscles_and_the_mean_keeps_its_digits(found: Fit) -> None:
    assert found.between == Between()
    alone = fit("seated_braid", TABLE, known=KNOWN, schemes=(), between=False)
    assert alone.between is None
    with_it, without = (f.predict(*AT, rest_length=OTHER) for f in (found, alone))
    assert found.parameters == alone.parameters
    assert with_it.tension.tobytes() == without.tension.tobytes()
    stated = fit("seated_braid", TABLE, known=KNOWN, schemes=(), length_error="0.5 mm")
    assert stated.between is None
    one = fit("seated_braid", made(0.182), known=KNOWN, schemes=())
    assert one.between is None


def test_a_muscle_from_elsewhere_is_less_sure_than_one_of_the_rig(found: Fit) -> None:
    near, far = (found.predict(*AT, rest_length=OTHER, elsewhere=e) for e in (False, True))
    assert near.tension.tobytes() == far.tension.tobytes()
    taut = near.tension > 0.0
    assert (far.high > near.high)[taut].all()
    for rig in (Between(), Between().scaled(3.0), Between(noise=0.02, pressure_shape=0.05)):
        assert all(getattr(rig.elsewhere(), name) >= getattr(rig, name) for name in BETWEEN_COMPONENTS)
    assert replace(Between(), gain=0.3).elsewhere().gain == 0.3  # which is no surer there than here


def test_the_covariance_is_symmetric_and_positive(found: Fit) -> None:
    for new in (unread(found), unread(found, elsewhere=True), unread(found).conditioned([reading(1.0), reading(0.96)])):
        covariance = new.moments(*AT)[1]
        size = float(np.diag(covariance).max())
        assert np.abs(covariance - covariance.T).max() < 1e-12 * size  # rounding
        assert np.linalg.eigvalsh(covariance).min() > -1e-10 * size  # rounding of sixteen rows
        spread = np.linalg.eigvalsh(new.spread / np.sqrt(np.outer(np.diag(new.spread), np.diag(new.spread))))
        assert spread.min() > 0.0


def test_a_muscle_of_the_kind_writes_its_readings_and_how_far_muscles_differ(found: Fit) -> None:
    new = unread(found).conditioned([reading(1.0), reading(0.96)])
    plain = new.to_dict()
    assert plain["readings"] == [one._asdict() for one in (reading(1.0), reading(0.96))]
    assert plain["between"] == {name: getattr(new.between, name) for name in plain["between"]}
    assert {"whole_length", "gain", "noise"} <= set(plain["between"])


def test_a_reading_without_noise_is_met_exactly(found: Fit) -> None:
    exact = Between(noise=0.0, branch=0.0)
    for readings in ([reading(1.0)], [reading(1.0), reading(0.96)]):
        new = unread(found, exact).conditioned(readings)
        at = np.array(readings)
        mean, half = new.predict(at[:, 0], at[:, 1])
        # A solve with a condition of 1e4 at most, in rounding of 2e-16.
        assert mean == pytest.approx(at[:, 2], rel=1e-10)
        assert np.abs(half).max() < 1e-4 * new.muscle.largest  # root of the same rounding


def test_conditioning_twice_is_conditioning_at_once_in_any_order(found: Fit) -> None:
    new, one, two = unread(found), reading(1.0), reading(0.96)
    once = new.conditioned([one, two]).predict(*AT)
    for other in (new.conditioned(one).conditioned(two), new.conditioned([two, one])):
        for ours, theirs in zip(other.predict(*AT), once, strict=True):
            assert ours == pytest.approx(theirs, rel=1e-9)  # rounding of a solve of two
    # one after the other by the formula of a single reading
    points = np.append(AT[0], two.length), np.append(AT[1], two.pressure)
    mean, covariance = new.conditioned(one).moments(*points)
    # the reading's own branch is not known, so it shares nothing of it with any point
    own = (new.between.branch * new.muscle.largest) ** 2
    gain = covariance[:-1, -1] / (covariance[-1, -1] + new.noise**2)
    assert own > 0.0
    step = np.maximum(mean[:-1] + gain * (two.tension - mean[-1]), 0.0)  # what a muscle shows of the signed force
    assert step == pytest.approx(once[0], rel=1e-9)


def test_each_reading_narrows_the_interval_everywhere(found: Fit) -> None:
    new = unread(found)
    halves = [
        n.predict(*AT)[1] for n in (new, new.conditioned(reading(1.0)), new.conditioned([reading(1.0), reading(0.96)]))
    ]
    assert (halves[1] <= halves[0]).all()
    assert (halves[2] <= halves[1]).all()
    assert halves[2].mean() < 0.5 * halves[0].mean()


def test_where_the_law_hangs_slack_the_interval_holds_muscles_that_pull(found: Fit) -> None:
    """Of muscles that differ in length and gain as declared, the interval holds 95 % where the law itself says nothing."""
    declared = Between(branch=0.0, pressure_shape=0.0)
    new = replace(unread(found, declared), spread=np.zeros((3, 3)))
    at = tuple(axis.ravel() for axis in np.meshgrid(np.array([0.86, 0.88, 0.90]) * OTHER, np.linspace(1e5, 6e5, 26)))
    signed = new.muscle.points(*at).tension / new.muscle.largest
    near = (signed <= 0.0) & (signed > -0.03)  # slack by less than what differences of length make
    length, pressure = (axis[near] for axis in at)
    mean, half = new.predict(length, pressure)
    assert (mean == 0.0).all()
    assert (half >= 1.95 * new.noise).all()
    chance, inside, pulls = np.random.default_rng(2), [], []
    for _ in range(400):
        off = chance.standard_normal(3) * (declared.whole_length, declared.below_rest, declared.gain)
        each = {one: declared.set_length * chance.standard_normal() for one in np.unique(length)}
        longer = length + off[0] + off[1] + np.array([each[one] for one in length])
        true = (1.0 + off[2]) * np.asarray(new.muscle.law.tension(longer, pressure))
        pulls.append(true > 0.0)
        inside.append(np.abs(true + new.noise * chance.standard_normal(len(true)) - mean) <= half)
    assert np.mean(pulls) > 0.2  # else the test would mean nothing
    # 95 %, less three standard errors of 400 muscles, whose points share their errors; the law is not linear, and a muscle
    # that is slack shows noise alone, so that more may lie within
    assert np.mean(inside) > 0.95 - 3.0 * np.sqrt(0.05 * 0.95 / 400)
    # a reading where the law is slack tells of the length, as any other does
    read = new.conditioned((float(length[0]), float(pressure[0]), 0.02 * new.muscle.largest))
    assert read.predict(np.array([OTHER]), np.array([5e5]))[0] > new.predict(np.array([OTHER]), np.array([5e5]))[0]


def test_two_readings_halve_the_error_of_a_muscle_of_the_kind(found: Fit) -> None:
    law = build_law("seated_braid", KNOWN | TRUE | {"rest_length": OTHER, "upper_length": OTHER + 1e-3})
    truth = 0.96 * np.asarray(law.tension(AT[0] - 5e-4, AT[1]))
    calibrated = found.calibrate([reading(1.0), reading(0.96)], rest_length=OTHER)
    errors = [
        float(np.sqrt(np.mean((tension - truth) ** 2)))
        for tension in (
            found.predict(*AT, rest_length=OTHER).tension,
            calibrated.predict(*AT).tension,
            np.asarray(calibrated.muscle.law.tension(*AT)),
        )
    ]
    assert errors[1] < 0.5 * errors[0]
    assert errors[2] < 0.5 * errors[0]


def test_a_calibrated_muscle_is_one_law_whose_closed_cycle_yields_no_work(found: Fit) -> None:
    muscle = found.calibrate([reading(1.0), reading(0.96)], rest_length=OTHER).muscle
    assert muscle.law_name == "seated_braid"
    law, step = muscle.law, 1e-7
    for length in (0.118, 0.127):
        by_pressure = (float(law.tension(length, 4e5 + 10.0)) - float(law.tension(length, 4e5 - 10.0))) / 20.0
        by_length = (float(law.volume(length + step, 4e5)) - float(law.volume(length - step, 4e5))) / (2.0 * step)
        assert by_pressure == pytest.approx(-by_length, rel=1e-5)  # F and V of one potential; central differences


def test_what_is_hidden_moves_not_a_bit(found: Fit) -> None:
    del found
    hidden = made(OTHER, -5e-4, 0.96)
    read = [(hidden.length[i], hidden.pressure[i], hidden.tension[i]) for i in (-1, -2)]
    answers = []
    for poison in (hidden.tension, np.full(len(hidden), np.nan), np.full(len(hidden), 1e9)):
        whole = ForceMap.joined([TABLE, replace(hidden, tension=poison)])
        assert whole.rest_length is not None
        shown = fit("seated_braid", whole.select(whole.rest_length != OTHER), known=KNOWN, schemes=())
        calibrated = shown.calibrate(read, rest_length=OTHER)
        answers.append(
            b"".join(part.tobytes() for part in (*shown.predict(*AT, rest_length=OTHER), *calibrated.predict(*AT)))
        )
    assert len(set(answers)) == 1


def test_another_bore_is_told_within_more_and_with_a_word(found: Fit) -> None:
    own = found.predict(0.12, 5e5, rest_length=OTHER)
    with pytest.warns(
        PlausibilityWarning, match="fitted to muscles of another bore, beside which .* 15 % more or less"
    ):
        wide = found.predict(0.12, 5e5, rest_length=OTHER, rest_diameter="20 mm")
    same = found.predict(0.12, 5e5, rest_length=OTHER, rest_diameter=KNOWN["rest_diameter"])
    assert same == own
    shares = [float(one.high - one.tension) / float(one.tension) for one in (own, wide)]
    assert NORMAL_QUANTILE * OTHER_BORE_GAIN < shares[1]
    with pytest.warns(PlausibilityWarning, match="another bore"):
        found.predict(0.12, 5e5, rest_length=OTHER, rest_diameter=0.02, elsewhere=True)


def test_what_intervals_of_another_laboratory_held_is_what_was_measured(found: Fit) -> None:
    rows = json.loads((ROOT / "benchmarks" / "between.json").read_text(encoding="utf-8"))
    read = [
        one["declared"] for one in rows if one["task"] in ("DMSP-10-250", "DMSP-20-300") and one["readings"] != "none"
    ]
    assert len(read) == 6
    shares = [one["coverage"] for one in read]
    assert (min(shares), max(shares)) == pytest.approx(HELD_ELSEWHERE, abs=0.005)  # said in percent
    at_rest = {
        one["declared"]["coverage"] for one in rows if one["readings"] == "rest" and one["task"] == "DMSP-10-250"
    }
    assert min(shares) in at_rest
    far, near = (found.calibrate(reading(1.0), rest_length=OTHER, elsewhere=e).cautions for e in (True, False))
    assert any("held 56 to 100 % of further readings" in str(one) for one in far)
    assert near and not any("other laboratories" in str(one) for one in near)


def test_readings_are_refused_and_doubted_in_a_sentence(found: Fit) -> None:
    with pytest.raises(
        InputError, match=r"must be a length, a pressure and a tension, such as '126.75 mm, 5.5 bar, 140 N'"
    ):
        found.calibrate("126 mm, 5 bar", rest_length=OTHER)
    with pytest.raises(InputError, match="must be above zero"):
        found.calibrate("126 mm, 5 bar, 0 N", rest_length=OTHER)
    with pytest.raises(InputError, match="must be between 6.5 cm and 14.3 cm of a muscle of 13 cm at rest"):
        found.calibrate("126 cm, 5 bar, 100 N", rest_length=OTHER)
    with pytest.raises(InputError, match="must be 3 readings at most"):
        found.calibrate([reading(1.0)] * 4, rest_length=OTHER)
    doubted = [str(c) for c in found.calibrate("130 mm, 2 bar, 900 N", rest_length=OTHER).cautions]
    assert any("standard deviations from what muscles of the make pull" in one for one in doubted)
    assert any("at a low pressure" in one for one in doubted)
    assert any("12.48 cm (4 % shortened) and 5 to 6 bar" in one for one in doubted)
    assert any("correcting one number" in one for one in doubted)
    with pytest.raises(InputError, match="give a table of two or more rest lengths"):
        fit("seated_braid", made(0.182), known=KNOWN, schemes=()).calibrate(reading(1.0), rest_length=OTHER)


def test_a_reading_is_read_in_any_of_its_forms() -> None:
    one = TensionReading(0.12, 5e5, 100.0)
    for form in (
        "12 cm, 5 bar, 100 N",
        ["12 cm, 5 bar, 100 N"],
        (0.12, 5e5, 100.0),
        [("12 cm", "5 bar", "100 N")],
        one,
    ):
        assert read_readings(form) == (pytest.approx(one),)
