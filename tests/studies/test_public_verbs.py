"""Sizing and comparison as a user asks them: quantities with units, muscles by name or as objects."""

import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben.studies.sizing import Requirements


def test_text_with_units_states_the_same_requirements_as_si_numbers():
    words = {"force": "50 N", "stroke": "3 cm", "pressure": "5 bar", "rate": "1 Hz", "length": None}
    si = Requirements(force=50.0, stroke=0.03, pressure=5e5, frequency=1.0)
    assert mk.size(**words, lines=False).wish == si


def test_a_sizing_without_a_force_or_stroke_is_refused():
    with pytest.raises(InputError, match="Sizing needs a stroke, such as '3 cm'"):
        mk.size(force="50 N")


@pytest.mark.parametrize("name", ["pressure", "tube_length"])
def test_a_sizing_whose_usual_value_is_taken_away_is_refused(name):
    with pytest.raises(InputError, match=f"Sizing needs a {name.replace('_', ' ')}, such as"):
        mk.size(**{"force": "50 N", "stroke": "3 cm", name: None})


def test_muscles_are_compared_by_name_and_as_objects():
    named, made = mk.compare("nylon", ["fiberglass"]), mk.compare(mk.muscle("nylon"), "fiberglass", pressure="5 bar")
    assert named == made and repr(named).startswith("MuscleTable(nylon, fiberglass: ")
    frame = named.to_dataframe()
    assert frame.loc[("Resting length", "cm"), "nylon"] == pytest.approx(14.0)  # as printed


def test_a_comparison_draws_the_muscles_side_by_side():
    ax = mk.compare("nylon", "fast-fibre").plot()
    assert len(ax.lines) == 2  # force over length, a line of each


def test_a_muscle_without_a_specimen_is_refused_in_a_comparison():
    with pytest.raises(InputError, match="a comparison needs a muscle of a specimen"):
        mk.compare(mk.muscle("ideal", thread_length=0.16, turns=3.2))
