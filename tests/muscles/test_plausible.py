"""Cautions begin where they say: nothing up to an end, beyond it one sentence of value, end and parameter."""

import math

import pytest

import mckibben as mk
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.muscles import plausible
from mckibben.quantities import usual_units, with_unit
from mckibben.slips import USUAL_SIZES, likely_unit, size_caution
from mckibben.specimens import Specimen, SpecimenNumber

NYLON = mk.muscle("nylon")
LONGEST = 0.2
MEASURED = mk.muscle("DMSP-10-250")  # its file states measured lengths and pressures


def measured(name: str) -> float:
    return MEASURED.specimen.property_si(name, "m" if "length" in name else "Pa")


def of_span(value: float):
    return next(iter(plausible.span_cautions(value, NYLON.law, NYLON.rest_length)), None)


LAW_ENDS = float(NYLON.law.length_range()[1])
# what is asked, the end up to which nothing is said, the side of it where something is, and words of the sentence
ENDS = {
    "stretched": (lambda x: plausible.stretch_caution(x, LONGEST), LONGEST, 1, "longest of this muscle's law, 20 cm"),
    "too long": (lambda x: plausible.length_caution(x, LONGEST), 3.0 * LONGEST, 1, "about 10 cm to 20 cm"),
    "too short": (lambda x: plausible.length_caution(x, LONGEST), LONGEST / 3.0, -1, "about 10 cm to 20 cm"),
    "pressure of any muscle": (plausible.pressure_caution, plausible.HIGHEST_PRESSURE, 1, "at most 10 bar"),
    "pressure that inflates nothing": (
        lambda x: plausible.pressure_caution(x, text=repr(x)), plausible.LEAST_PRESSURE, -1, "inflates no muscle; was",
    ),
    "vacuum": (plausible.pressure_caution, plausible.LEAST_GAUGE, -1, "is below vacuum: there is none"),
    "measured pressure": (
        lambda x: plausible.pressure_caution(x, MEASURED.specimen), 1.02 * measured("highest_measured_pressure"), 1,
        f"up to {with_unit(measured('highest_measured_pressure'), 'Pa', 3)}",
    ),
    "longest measured length": (
        lambda x: plausible.measured_length_caution([0.22, x], MEASURED.specimen),
        1.02 * measured("longest_measured_length"), 1, "beyond the measured ones",
    ),
    "shortest measured length": (
        lambda x: plausible.measured_length_caution([0.22, x], MEASURED.specimen),
        0.98 * measured("shortest_measured_length"), -1, "beyond the measured ones",
    ),
    "start pressure": (lambda x: plausible.start_pressure_caution(x, 1e5, text=""), 0.0, -1, "below that of the room"),
    "long span": (of_span, (1.0 + plausible.ROUNDING) * LAW_ENDS, 1, "overstretched: a span of"),
    "slack span": (of_span, 0.5 * LAW_ENDS, -1, f"less than {with_unit(0.5 * LAW_ENDS, 'm')}"),
}  # fmt: skip


@pytest.mark.parametrize("name", ENDS)
def test_nothing_is_said_up_to_an_end_and_one_sentence_beyond(name):
    ask, end, side, words = ENDS[name]
    room = max(abs(end), 1.0) if end == 0.0 else abs(end)
    inside, beyond = end - 1e-6 * side * room, end + 1e-6 * side * room
    assert ask(inside) is None
    said = ask(beyond)
    assert said is not None and words in str(said) and said.parameter
    assert ask(math.nextafter(end, -side * math.inf)) is None  # up to the last bit


@pytest.mark.parametrize("beyond", [1e-1, 1e-5, 1e-8, 1e-15])
def test_a_sentence_never_shows_two_different_lengths_as_one(beyond):
    shown = str(plausible.stretch_caution(LONGEST * (1.0 + beyond), LONGEST))
    assert with_unit(LONGEST, "m") in shown and shown.count(f" {with_unit(LONGEST, 'm')}") == 1


@pytest.mark.parametrize("pressures", [[-9e5, 9e5], [9e5, 1e5, -9e5], [-9e5, 9e5, math.nan]])
def test_both_ends_of_an_array_of_pressures_are_judged(pressures):
    with pytest.warns(PlausibilityWarning) as said:
        NYLON.volume(0.13, pressures)
    said = [str(one.message) for one in said]
    assert any("9 bar is beyond" in one for one in said) and any("-9 bar is below vacuum" in one for one in said)


def test_no_gauge_pressure_is_below_vacuum_and_no_span_outside_what_a_braid_can_take():
    for pressure in (-1e5, -2e5, math.nan):
        with pytest.raises(InputError, match="above vacuum, -1 bar"):
            plausible.start_pressure_caution(pressure, 1e5, text="")
    assert plausible.start_pressure_caution(-99999.0, 1e5, text="") is not None
    least, most, _ = plausible.span_limits(NYLON.law)
    for span in (math.nextafter(least, 0.0), math.nextafter(most, 1.0), math.nan):
        with pytest.raises(InputError, match="span must be from 1 mm to"):
            of_span(span)
    assert of_span(least) is not None and of_span(most) is not None
    longest = plausible.span_limits(NYLON.law)[2]
    assert of_span((1.0 + 0.5 * plausible.ROUNDING) * longest) is None, "a length that was computed"
    assert of_span((1.0 + 3.0 * plausible.ROUNDING) * longest) is not None
    assert of_span(0.501 * longest) is None and "leaves the muscle slack" in str(of_span(0.499 * longest))


@pytest.mark.parametrize("unit", USUAL_SIZES)
def test_usual_sizes_have_their_ends_and_beyond_them_a_unit_is_asked_for(unit):
    low, typical, high = USUAL_SIZES[unit]
    for value in (0.0, low, typical, high, -low, -high):
        assert size_caution(value, unit) is None
    for value in (0.99 * low, 1.01 * high, -1.01 * high):
        said = size_caution(value, unit, name="width")
        assert said is not None and said.parameter == "width" and "a width of" in str(said)
    # the number of a usual value in another unit, taken for one in SI: it is asked for, unless the number is usual as well
    for other in usual_units(unit):
        number = typical / mk.quantities.to_si(1.0, other, unit, field="") if other != "in" else typical
        said = size_caution(number, unit)
        assert said is None or f"; was {number:g}" in str(said)


def test_the_unit_that_is_asked_for_is_the_one_that_makes_the_number_most_usual():
    # 300: 3 bar in kPa, 0.3 bar in mbar, 20.7 bar in psi; 5: bar before MPa
    most = plausible.HIGHEST_PRESSURE
    asked = {
        text: likely_unit(text, "Pa", plausible.PRESSURE_UNITS, 0.02 * most, most, plausible.USUAL_PRESSURE)
        for text in ("300", "5", "0.5", "90", "4000", "1e30", "bar")
    }
    for text, unit in (("300", "kPa"), ("5", "bar"), ("0.5", "MPa"), ("90", "psi"), ("4000", "mbar")):
        assert asked[text] == f"; was {text} {unit} meant?"
    assert asked["1e30"] == asked["bar"] == ""
    assert likely_unit("3", "1", ("%",), 0.0, 1.0, 0.5) == likely_unit(None, "m", ("cm",), 0.0, 1.0, 0.5) == ""
    assert "1e-06 to 20 are usual" in str(size_caution(50.0, "1", usual=(1e-6, 20.0)))


def test_nothing_is_said_up_to_what_is_rated_or_was_measured():
    assert plausible.highest_usual_pressure() == plausible.HIGHEST_PRESSURE
    assert plausible.highest_usual_pressure(MEASURED.specimen) == min(
        plausible.highest_pressure(MEASURED.specimen)[0], 1.02 * measured("highest_measured_pressure")
    )


def test_what_a_run_reached_is_said_of_its_extremes():
    low, high = measured("shortest_measured_length"), measured("longest_measured_length")
    pressure = measured("highest_measured_pressure")

    def reached(lengths, pressures, spec=MEASURED.specimen):
        return plausible.reached_cautions(lengths, pressures, MEASURED.law, spec, "a")

    assert reached([low, high, 0.5 * (low + high)], [0.0, pressure]) == ()
    for lengths in ([0.9 * low, high], [high, 1.1 * high, low]):
        (said,) = reached(lengths, [pressure])
        assert said.parameter == "length of a"
    assert str(reached([high, 1.1 * high, low], [pressure])[0]).startswith("overstretched: a length of a of")
    assert len(reached([0.9 * low, 1.1 * high], [pressure])) == 2  # each end is said
    (said,) = reached([low, high], [0.0, 2.0 * pressure, 1e5])
    assert said.parameter == "pressure of a"
    assert reached([1e-3, high], [1e5], None) == ()


def test_a_free_length_is_judged_beside_the_measured_lengths_the_shortest_first():
    class Law:
        def free_length(self, pressure):
            return 0.22 - 1e-7 * pressure

    low = measured("shortest_measured_length")
    far = (0.22 - 0.97 * low) / 1e-7  # the pressure that leaves it shorter than any that was measured
    assert plausible.free_length_caution(Law(), [far], None) is None
    assert plausible.free_length_caution(Law(), [0.0, 1e5], MEASURED.specimen) is None
    said = plausible.free_length_caution(Law(), [0.0, far], MEASURED.specimen)
    assert said.parameter == "free length" and with_unit(0.97 * low, "m") in str(said)


def test_a_muscle_is_mounted_where_it_is_taut_at_working_pressures_and_within_what_was_measured():
    class Law:
        """Free lengths at half the usual pressure, whatever it is."""

        def __init__(self, free):
            self.free = free

        def free_length(self, pressure):
            assert pressure == 0.5 * plausible.USUAL_PRESSURE
            return self.free

    # at nine tenths, if it is 5 % longer there than when it is free; else halfway from there to its rest length, or at that
    for free, span in ((0.7, 0.9), (0.8499, 0.9), (0.8501, 0.92505), (0.96, 0.98), (1.2, 1.0)):
        assert plausible.working_span(Law(free), 1.0) == pytest.approx(span, rel=1e-12)
    low, high = measured("shortest_measured_length"), measured("longest_measured_length")
    for rest, span in ((0.5 * low, low), (2.0 * high, high)):
        assert plausible.working_span(MEASURED.law, rest, MEASURED.specimen) == span


@pytest.mark.parametrize(
    ("stated", "usual", "quiet"),
    [
        ({}, 5e5, 10e5),
        ({"rated_pressure": 3.0}, 3e5, 3e5),
        ({"burst_pressure": 4.0}, 4e5, 4e5),
        ({"burst_pressure": 4.0, "rated_pressure": 6.0}, 5e5, 6e5),  # what it is rated for comes first
        ({"highest_measured_pressure": 2.0}, 2e5, 2.04e5),
        ({"highest_measured_pressure": 4.0, "rated_pressure": 3.0}, 3e5, 3e5),
        ({"highest_measured_pressure": 8.0}, 5e5, 8.16e5),
    ],
)
def test_a_muscle_is_computed_at_5_bar_or_at_what_it_is_rated_or_measured_for_if_that_is_less(stated, usual, quiet):
    numbers = {name: SpecimenNumber(value=value, unit="bar") for name, value in stated.items()}
    spec = Specimen(**{**vars(NYLON.specimen), "properties": numbers})
    assert plausible.usual_pressure(spec) == pytest.approx(usual)
    assert plausible.highest_usual_pressure(spec) == pytest.approx(quiet)
