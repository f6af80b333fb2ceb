"""What is said of a law follows from what its specimen states: each number has its words, and a small one none."""

import dataclasses

import numpy as np
import pytest

import mckibben as mk
from mckibben.muscles.evidence import (
    NOTABLE,
    about_laws,
    beyond_braid_caution,
    error_of,
    interval_remarks,
    interval_words,
    law_cautions,
    law_error,
    make_spread,
    tension_interval,
)
from mckibben.specimens import Specimen, SpecimenNumber

LAW = mk.law("ideal", {"thread_length": 0.2, "turns": 3.0})
LENGTH, PRESSURE = 0.16, 3e5
PULL = float(LAW.tension(LENGTH, PRESSURE))


def number(value, unit="1", note=""):
    return SpecimenNumber(value=value, unit=unit, note=note)


def spec(errors=None, between=None, **properties):
    """A muscle that states no more than is given."""
    units = {"length": "m", "lengths": "m", "pressure": "Pa", "diameter": "m", "uncertainty": "N"}
    stated = {name: number(value, units[name.rpartition("_")[2]]) for name, value in properties.items()}
    shares = {name: number(share) for name, share in (between or {}).items()}
    of_laws = (
        {} if errors is None else {"ideal": {name: number(share, note=f"by {name}") for name, share in errors.items()}}
    )
    return Specimen(
        id="m",
        kind="mckibben",
        title="a muscle",
        sources=[],
        law="ideal",
        laws={"ideal": {"thread_length": number(0.2, "m"), "turns": number(3.0)}},
        errors=of_laws,
        between=shares,
        properties=stated,
    )


AT = {"rest_length": LENGTH, "highest_measured_pressure": PRESSURE}
MAKE = "another muscle of the make lies within 5 % of its largest tension (95 %)"
SPREAD = {"same_rig": 0.02, "elsewhere": 0.05}


def test_an_error_has_its_shares_their_sources_and_the_worst_of_them():
    assert error_of(None, "ideal") is error_of(spec(), "ideal") is error_of(spec({"rms": 0.1}), "other") is None
    one = error_of(spec({"rms": 0.01, "largest": 0.12, "other_muscle": 0.2}), "ideal")
    assert (
        f"{one}"
        == "1 % rms and 12 % at most of the largest tension (by largest), 20 % on another muscle (by other_muscle)"
    )
    assert (one.worst, one.other_length) == (0.2, None) and one.to_dict()["sentence"] == f"{one}"
    few = error_of(spec({"rms": 0.01}), "ideal")
    assert f"{few}" == "1 % rms of the largest tension (by rms)" and few.worst == 0.0
    assert error_of(spec({"largest": 0.12, "other_muscle": 0.05}), "ideal").worst == 0.12


@pytest.mark.parametrize("name", ["largest", "other_muscle"])
def test_a_large_error_is_said_and_one_up_to_a_tenth_is_not(name):
    (said,) = law_cautions(spec({name: NOTABLE + 1e-6}), LAW)
    assert said.text.startswith("the tension of m by ideal may be off by ") and said.parameter == "law"
    assert law_cautions(spec({name: NOTABLE}), LAW) == law_cautions(None, LAW) == ()


def test_a_make_is_as_wide_as_its_specimen_states_and_one_that_was_calibrated_by_its_own():
    assert (
        make_spread(None, LAW) is make_spread(spec(), LAW) is make_spread(spec(between={"same_rig": 0.1}), LAW) is None
    )
    said = {
        MAKE: {"elsewhere": 0.05},
        f"{MAKE}, on the rig of the measured ones 2 %": SPREAD,
        "this muscle, as calibrated, lies within 3 % of its largest tension (95 %)": SPREAD | {"calibrated": 0.03},
    }
    for words, shares in said.items():
        assert f"{make_spread(spec(between=shares), LAW)}" == words
    stated = make_spread(spec(between={"elsewhere": 0.05}), LAW).to_dict()
    assert list(stated) == ["elsewhere", "sentence"]
    for share in ({"elsewhere": 0.11}, {"elsewhere": 0.01, "calibrated": 0.11}):
        assert len(law_cautions(spec(between=share), LAW)) == 1
    assert law_cautions(spec(between={"elsewhere": NOTABLE}), LAW) == ()
    (both,) = law_cautions(spec({"largest": 0.2}, {"elsewhere": 0.2}), LAW)
    assert both.text.count("; ") == 1


def half_width(spec, law, *, same_rig=False):
    """Half of the interval above the law at a point [N]; None where nothing says it."""
    ends = tension_interval(spec, law, LENGTH, PRESSURE, same_rig=same_rig)
    return None if ends is None else float(ends[1]) - float(law.tension(LENGTH, PRESSURE))


def test_half_of_an_interval_is_the_share_of_the_largest_tension_that_counts_there():
    muscle = spec(between=SPREAD, **AT)
    assert half_width(muscle, LAW) == pytest.approx(0.05 * PULL, rel=1e-12)
    assert half_width(muscle, LAW, same_rig=True) == pytest.approx(0.02 * PULL, rel=1e-12)
    calibrated = spec(between=SPREAD | {"calibrated": 0.03}, **AT)
    assert half_width(calibrated, LAW) == half_width(calibrated, LAW, same_rig=True) == pytest.approx(0.03 * PULL)
    assert half_width(spec(between={"elsewhere": 0.05}, **AT), LAW, same_rig=True) is None
    for missing in AT:
        assert half_width(spec(between=SPREAD, **{k: v for k, v in AT.items() if k != missing}), LAW) is None
    assert half_width(spec(tension_uncertainty=7.0), LAW) == pytest.approx(7.0) and half_width(spec(), LAW) is None
    assert half_width(spec(between=SPREAD, tension_uncertainty=7.0, **AT), LAW) == pytest.approx(0.05 * PULL)


def test_a_law_of_another_bore_or_length_is_not_of_the_make_or_pulls_by_its_own_length():
    seated = mk.muscle("DMSP-20-300").law
    bore, rest = float(seated.rest_diameter), float(seated.rest_length)
    for share, known in ((1.0, True), (1.0199, True), (1.021, False), (0.979, False)):
        one = spec(
            between=SPREAD, rest_inner_diameter=bore * share, rest_length=0.1, highest_measured_pressure=PRESSURE
        )
        one = dataclasses.replace(one, laws=mk.specimen("DMSP-20-300").laws)
        found = half_width(one, seated)
        assert (found is not None) is known
        assert not known or found == pytest.approx(0.05 * float(seated.tension(rest, PRESSURE)), rel=1e-9)


def test_a_band_lies_around_the_law_and_never_below_zero():
    lengths, pressures = np.array([LENGTH, 0.15]), np.array([PRESSURE, 1e3])
    low, high = tension_interval(spec(between=SPREAD, **AT), LAW, lengths, pressures)
    own = np.asarray(LAW.tension(lengths, pressures))
    np.testing.assert_allclose(high - own, 0.05 * PULL, rtol=1e-12)
    np.testing.assert_allclose(low, np.maximum(own - 0.05 * PULL, 0.0), rtol=1e-12)
    assert low[1] == 0.0 < own[1] and tension_interval(spec(**AT), LAW, lengths, pressures) is None


def test_the_words_of_an_interval_are_of_what_is_known_best():
    assert interval_words(spec(between=SPREAD, tension_uncertainty=7.0), LAW).startswith("another muscle of the make")
    assert interval_words(spec(tension_uncertainty=7.0), LAW) == "this muscle, as characterised, lies within 7 N (95 %)"
    none = "no interval: nothing says how far another muscle of the make is from the law of m"
    assert interval_words(spec(), LAW) == none
    assert (
        interval_words(spec({"rms": 0.01}), LAW) == f"{none}; ideal was off by 1 % rms of the largest tension (by rms)"
    )


def test_metadata_have_what_is_stated_of_each_muscle_and_nothing_of_what_is_none():
    assert law_error(None, LAW) is law_error(dataclasses.replace(spec(), kind="valve"), LAW) is None
    assert law_error(spec(), LAW) == {"interval": interval_words(spec(), LAW)}
    whole = law_error(spec({"rms": 0.01}, SPREAD), LAW)
    assert (whole["rms"], whole["between_muscles"]["elsewhere"]) == (0.01, 0.05) and "interval" in whole
    two = about_laws({"a": (spec({"largest": 0.5}), LAW), "b": (spec({"largest": 0.5}), LAW), "c": (None, LAW)})
    assert len(two["warnings"]) == 1 and list(two["law_error"]) == ["a", "b", "c"]
    assert "warnings" not in about_laws({"a": (spec(), LAW)})
    assert interval_remarks(two["law_error"]) == [f"{n}: {two['law_error'][n]['interval']}." for n in "ab"]


def measured(rest, errors=None, low=0.15, high=0.25):
    one = spec(errors, rest_length=rest)
    lengths = SpecimenNumber(value=[low, high] if low != high else low, unit="m")
    return dataclasses.replace(one, properties=one.properties | {"measured_rest_lengths": lengths})


@pytest.mark.parametrize(("rest", "said"), [(0.147, 0), (0.1469, 1), (0.255, 0), (0.2551, 1), (0.2, 0)])
def test_a_rest_length_beyond_the_measured_ones_is_said(rest, said):
    found = law_cautions(measured(rest), LAW)
    assert len(found) == said
    for one in found:
        assert "beyond the measured ones of m, 15 cm to 25 cm: the tension there is that of a like muscle" in one.text
        assert one.parameter == "rest_length"
        (known,) = law_cautions(measured(rest, {"other_length": 0.03}), LAW)
        assert known.text.endswith("of the largest tension more than at these, as it was off by 3 % (by other_length)")


@pytest.mark.parametrize(("rest", "share"), [(0.2, 0.05), (0.1, np.hypot(0.05, 0.3)), (0.3, np.hypot(0.05, 0.3))])
def test_beyond_the_measured_rest_lengths_an_interval_holds_what_the_law_was_off_there(rest, share):
    one, at = measured(rest, {"other_length": 0.3}), spec(highest_measured_pressure=PRESSURE).properties
    one = dataclasses.replace(one, between=spec(between=SPREAD).between, properties=one.properties | at)
    unknown, own = (
        dataclasses.replace(one, errors={}),
        dataclasses.replace(one, between=spec(between={"calibrated": 0.03}).between),
    )
    characterised = dataclasses.replace(
        one, between={}, properties=one.properties | spec(tension_uncertainty=7.0).properties
    )
    assert make_spread(one, LAW).elsewhere == pytest.approx(share, rel=1e-12)
    assert half_width(one, LAW) == pytest.approx(share * float(LAW.tension(rest, PRESSURE)), rel=1e-9)  # rounding
    # readings were taken of this very muscle, whatever its length
    assert make_spread(own, LAW).calibrated == 0.03
    for nobody_looked in (unknown, characterised):
        known = half_width(dataclasses.replace(nobody_looked, errors={}), LAW)
        assert (known is None) is (rest != 0.2)


def test_a_law_that_was_cut_is_judged_by_its_own_length_also_beside_the_file_of_the_whole_muscle():
    """As in a size, whose muscles are cut one by one from the law of a file."""
    whole, cut = mk.muscle("DMSP-40-400"), mk.muscle("DMSP-40-400", rest_length="15 cm")
    share = make_spread(cut.specimen, cut.law).elsewhere
    assert make_spread(whole.specimen, cut.law).elsewhere == share > make_spread(whole.specimen, whole.law).elsewhere


def test_a_pull_at_a_length_to_which_no_gas_shortens_a_braid_is_said_of_the_longest_such():
    shortest = LAW.thread_length / np.sqrt(3.0)  # threads at 54.7 degrees
    lengths = shortest * np.array([0.9, 0.979, 0.981, 1.2])
    said = beyond_braid_caution(LAW, lengths, np.ones(4))
    assert f"at {mk.quantities.with_unit(float(lengths[1]), 'm', 4)} the threads stand at" in said.text
    assert said.parameter == "length"
    assert beyond_braid_caution(LAW, lengths, np.array([0.0, 0.0, 1.0, 1.0])) is None
    assert beyond_braid_caution(object(), lengths, np.ones(4)) is None
