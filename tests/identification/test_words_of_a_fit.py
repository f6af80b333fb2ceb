"""What is said of a fit follows from its numbers: each finding alone gives its own words, and none where there is none."""

import dataclasses
import math

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import ConvergenceError, InputError
from mckibben.estimation import Estimate, Inseparable
from mckibben.identification.fit import STEP_SHARE, Fit, Holdout, _numbers, degenerate_words, fitted_specimen
from mckibben.identification.problem import CrossValidation
from mckibben.identification.ranking import ERRS, assumptions, cautions_of, verdict
from mckibben.muscles.laws import law_type
from mckibben.quantities import declared

POINTS = mk.ForceMap("t", [0.12, 0.13, 0.13], [3e5, 3e5, 1e5], [40.0, 100.0, 0.0])
LARGEST = 100.0
THREAD, TURNS = Estimate(0.2, 0.19, 0.21, "m"), Estimate(3.0, 2.9, 3.1, "1")
SOUND = Fit(
    "ideal",
    {"thread_length": THREAD, "turns": TURNS},
    {},
    POINTS,
    np.array([1.0, -3.0]),
    True,
    "it ended",
    (),
    {"pressure": CrossValidation("pressure", 2, 0, np.array([3.0, 4.0]))},
)


def fit(**changes):
    return dataclasses.replace(SOUND, **changes)


def cross(scheme, errors, failed=0):
    return {scheme: CrossValidation(scheme, 5, failed, np.asarray(errors, float))}


def held(worst):
    return Holdout(what="fitted to the lower pressures", trained_on=2, error=np.array([0.0, worst]))


OPEN = {"thread_length": THREAD, "turns": Estimate(3.0, -math.inf, math.inf, "1")}
PAIR = Inseparable(("thread_length", "turns"), 0.999)


def test_of_a_sound_fit_nothing_is_said():
    assert verdict(SOUND, LARGEST) == cautions_of(SOUND, LARGEST) == assumptions([SOUND]) == []
    assert (SOUND.degenerate, SOUND.assumed, SOUND.determined, SOUND.misses, SOUND.doubt) == ((), {}, True, False, "")


@pytest.mark.parametrize(
    ("changes", "words", "said"),
    [
        ({"converged": False, "message": "5 steps"}, ["did not converge"], "The fit did not converge (5 steps)."),
        ({"inseparable": (PAIR,)}, ["parameters hard to tell apart"], "Where two parameters cannot be told apart"),
        # why the ranking has set it behind the others, in words that no other law of the table has
        (
            {"parameters": OPEN, "inseparable": (PAIR,)},
            ["parameters not determined"],
            "Where two parameters cannot be told",
        ),
        (
            {"at_bound": ("turns",)},
            ["turns at its bound"],
            "turns describes nothing here, so the criterion counts 1 of 2",
        ),
        ({"not_contained": ("turns",)}, ["turns not in the data"], "turns describes nothing here"),
        (
            {"not_contained": ("turns",), "at_bound": ("thread_length",)},
            ["thread_length at its bound", "turns not in the data"],
            "thread_length and turns describe nothing here",
        ),
        (
            {"cross": cross("block", [31.0, 31.0])},
            ["misses what is left out"],
            "Points left out of the fit are missed by 31 N rms",
        ),
        (
            {"cross": cross("rest_length", [np.nan, 1.0], failed=2)},
            ["some points could not be predicted"],
            "With one muscle left out, 2 of 5 fits had too few points",
        ),
        (
            {"holdout": held(ERRS * LARGEST)},
            ["does not extrapolate in pressure"],
            "it misses what lies above by 20.00 %",
        ),
        ({"holdout": held(150.0)}, ["does not extrapolate in pressure"], "it misses what lies above by more than"),
        ({"holdout": held(math.inf)}, ["does not extrapolate in pressure"], "it misses what lies above without bound"),
        ({"warnings": ("turns_of a thing", "one more.")}, [], "turns_of a thing."),
        (
            {"parameters": {"thread_length": THREAD, "turns": Estimate(0.1, -0.1, 0.3, "1")}},
            [],
            "The interval of turns includes zero.",
        ),
    ],
)
def test_each_finding_has_its_words_and_its_sentence(changes, words, said):
    assert verdict(fit(**changes), LARGEST) == words
    found = cautions_of(fit(**changes), LARGEST)
    assert sum(said in one for one in found) == 1 and all(one.endswith(".") and not one.endswith("..") for one in found)


@pytest.mark.parametrize(
    "changes",
    [
        {"holdout": held(0.999 * ERRS * LARGEST)},
        {"cross": cross("block", [30.0, 30.0])},  # as much as tensions scatter
        {"warnings": ("did not converge: why",)},
        {"parameters": {"turns": Estimate(1.0, 0.0, 2.0, "1")}},
        {"parameters": {"turns": Estimate(1.0, -math.inf, 2.0, "1")}},
        {"cross": {}},
    ],
)
def test_next_to_a_finding_nothing_is_said(changes):
    assert verdict(fit(**changes), LARGEST) == cautions_of(fit(**changes), LARGEST) == []


def test_what_a_ranking_says_for_all_laws_is_not_said_again_of_each():
    one = fit(inseparable=(PAIR,), warnings=(str(PAIR), "another"), cross=cross("block", [50.0, 50.0]))
    assert cautions_of(one, LARGEST, alone=False) == ["Another."]
    assert len(cautions_of(one, LARGEST)) == 4


def test_a_doubt_is_that_points_are_missed_or_that_nothing_says_how_well_they_are_met():
    assert fit(cross={}).doubt == fit(cross={}).unchecked == "no points were left out of the fit"
    failed = fit(cross=cross("block", [np.nan], failed=3) | SOUND.cross)
    assert failed.unchecked == failed.doubt == "fits with points left out failed, 3 of 5 by block"
    assert failed.left_out_rmse == math.inf and not failed.misses
    missed = fit(cross=cross("block", [40.0, 40.0]))
    assert missed.unchecked == "" and "more than the 30 N by which tensions scatter" in missed.doubt
    both = fit(cross=cross("block", [1.0, 7.0]) | cross("length", [5.0, -5.0]))  # the mean of squares over schemes
    assert both.left_out_rmse == pytest.approx(5.0) and both.left_out_max_error == 7.0
    assert (both.cv_rmse, fit(cross={}).left_out_rmse, fit(cross={}).left_out_max_error) == (None, None, None)
    assert SOUND.cv_rmse == pytest.approx(math.sqrt(12.5)) and SOUND.cv_max_error == 4.0


def test_data_determine_what_has_an_interval_with_ends_or_describes_nothing():
    endless = {"thread_length": THREAD, "turns": Estimate(3.0, -math.inf, math.inf, "1")}
    assert not fit(parameters=endless).determined and fit(parameters=endless, at_bound=("turns",)).determined


def test_a_saved_number_states_its_interval_where_it_has_one_and_why_it_has_none():
    endless = {"thread_length": Estimate(0.2, 0.1, math.inf, "m"), "turns": TURNS}
    group = _numbers(fit(parameters=endless, not_contained=("turns",)))
    assert group["thread_length"].range is None and group["turns"].range is None
    assert group["turns"].note.endswith("; not in the data") and "in the data" not in group["thread_length"].note
    group = _numbers(fit(at_bound=("turns",)))
    assert group["turns"].note.endswith("; at its bound") and group["thread_length"].range == (0.19, 0.21)
    known = _numbers(fit(parameters={"turns": TURNS}, known={"thread_length": np.array([0.1, 0.14])}))["thread_length"]
    assert (known.value, known.unit, known.note) == (0.14, "m", "known")
    assert degenerate_words(fit(at_bound=("turns",))) == ["turns at its bound"]


def test_sizes_that_were_not_stated_are_said_once_for_all_laws_that_took_them():
    seated = fit(law="seated_braid", known={"rest_length": 0.3}, parameters={})
    assert seated.assumed["wall_thickness"] == 1.8e-3
    known = fit(law="seated_braid", known={"rest_length": 0.3, **seated.assumed}, parameters={})
    assert known.assumed == {}
    (line,) = [one for one in assumptions([seated]) if "wall_thickness" in one]
    assert line.startswith(
        "assumed, as not stated: wall_thickness = 0.18 cm; state it by {known} wall_thickness='0.18 cm'"
    )
    (line,) = [one for one in assumptions([seated, seated]) if "wall_thickness" in one]
    assert "wall_thickness = 0.18 cm (seated_braid, seated_braid); state it" in line
    assert any(one.startswith("Assumed, as not stated: ") for one in cautions_of(seated, LARGEST))


def test_texts_of_parameters_are_taken_in_si_and_other_words_are_left_to_the_law():
    assert SOUND._in_si({"thread_length": "20 cm", "turns": 3.0, "nothing": "2 m"}) == {
        "thread_length": pytest.approx(0.2),
        "turns": 3.0,
        "nothing": "2 m",
    }
    with pytest.raises(InputError, match="thread_length must be a length"):
        SOUND._in_si({"thread_length": "20 N"})


def test_nothing_is_kept_of_fits_of_which_none_converged():
    with pytest.raises(ConvergenceError, match="no fit converged"):
        fitted_specimen([fit(converged=False)])


def test_half_an_interval_is_the_slope_on_both_sides_or_within_the_bounds_where_a_parameter_lies_at_one():
    """Of a square, whose slope between two points is their sum; 1e-9 is what differences of some 1e-3 leave of 16 digits."""
    bound, width = declared(law_type("ideal"))["turns"].bounds[0], 0.1
    step = STEP_SHARE * width

    def half(value, width):
        turns = Estimate(value, value - width, value + width, "1")
        one = fit(parameters={"thread_length": THREAD, "turns": turns})
        return one._half_width(lambda turns: np.array([turns**2, 1.0]), "turns", width)

    assert half(3.0, width) == pytest.approx([2.0 * 3.0 * width, 0.0], rel=1e-9)
    assert half(bound, width) == pytest.approx([(2.0 * bound + step) * width, 0.0], rel=1e-9)
    assert half(3.0, 0.0).tolist() == [0.0, 0.0]
