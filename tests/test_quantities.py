"""Words become SI numbers at the edges, once, and a wrong dimension is named."""

import jax
import pytest

from mckibben import quantities
from mckibben.errors import InputError
from mckibben.quantities import Quantity, as_array, from_si, has_dimension, in_si, parse, to_si, values_in_si, with_unit


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [("12 cm", "m", 0.12), ("12cm", "m", 0.12), ("5 bar", "Pa", 5e5), ("72.5 psi", "Pa", 72.5 * 6894.757293168361),
     ("3.92 N/cm", "N/m", 392.0), ("5.63 cm^3", "m^3", 5.63e-6), ("28.6 deg", "rad", 0.49916416607037824),
     ("12 %", "1", 0.12), ("3.1", "1", 3.1), ("1e5 Pa", "Pa", 1e5), ("20 degC", "K", 293.15)],
)  # fmt: skip
def test_words_are_converted(text, unit, value):
    assert parse(text, unit, field="x") == pytest.approx(
        value, rel=1e-14
    )  # one rounding of the factor, one of the product


@pytest.mark.parametrize(
    "text", ["12", "12 kg", "twelve cm", "", "nan cm", "inf m", "12 furlongz", "5 bar bar", "12 **"]
)
def test_what_is_no_length_is_refused_in_one_line(text):
    with pytest.raises(InputError) as caught:
        parse(text, "m", field="--length")
    assert "--length" in str(caught.value) and "\n" not in str(caught.value)


def test_a_declared_bound_speaks_in_readable_units():
    q = Quantity("m", (0.001, 10.0), "length", "L", (0.05, 1.0))
    with pytest.raises(InputError, match=r"rest_length must be between 0.1 cm and 1000 cm, got -5 cm"):
        q.check("rest_length", -0.05)


def test_round_trip_of_shown_values():
    assert with_unit(0.12, "m") == "12 cm"
    assert with_unit(5e5, "Pa") == "5 bar"
    assert to_si(600.0, "l/min", "m^3/s", field="flow") == pytest.approx(0.01, rel=1e-12)


@pytest.mark.parametrize(("si_unit", "unit"), [(s, u) for s, known in quantities._USUAL.items() for u in known])  # noqa: SLF001
def test_the_usual_units_are_converted_as_pint_does_it(si_unit, unit, monkeypatch):
    numbers = [1.0, -3.7, 0.1, 1e-7, 123456.789, 6.02e23]
    usual = [(to_si(x, unit, si_unit, field="x"), from_si(x, si_unit, unit)) for x in numbers]
    assert all(a != x or si_unit in ("1", "1/s") for x, (a, _) in zip(numbers, usual, strict=True))
    monkeypatch.setattr(quantities, "_USUAL", {})
    # to the last bit: a number of a file must not depend on which of the two has read it
    assert usual == [(to_si(x, unit, si_unit, field="x"), from_si(x, si_unit, unit)) for x in numbers]


def test_a_comma_is_never_taken_for_a_point_nor_passed_over() -> None:
    for text, says in (("0,12 m", "write '0.12 m'"), ("1,000,000 m", "nothing between thousands")):
        with pytest.raises(InputError, match=says):
            parse(text, "m", field="length")


def test_a_flow_is_shown_as_catalogues_state_it() -> None:
    assert with_unit(0.00158333, "m^3/s") == "95 l/min"


def test_the_dimension_of_words_is_known_without_their_value() -> None:
    assert has_dimension("12 mm", "m") and has_dimension("12 furlong", "m")
    assert not any(has_dimension(text, "m") for text in ("12 Hz", "12", "0.9 L0", "sine", "12 s"))


@pytest.mark.parametrize(
    "unit",
    [
        "9**9**9*m", "9^9^9^9 m", "m**9**9**9", "m^-1^1000000", "m**(10**10**10)", "m**99999", "1e999*m", "10**400 m", "m/0",
        "2 m", "(" * 5_000 + "m" + ")" * 5_000, "m*" * 50_000 + "m", "a" * 1_000_000, "__import__('os').abort()", "[length]",
    ],
    ids=lambda unit: unit[:24],
)  # fmt: skip
def test_what_stands_for_a_unit_is_not_worked_out(unit):
    """pint would: the first ones for longer than anybody waits."""
    with pytest.raises(InputError, match="must be a length") as caught:
        parse(f"5 {unit}", "m", field="x")
    assert len(str(caught.value)) < 500


def test_a_number_that_only_its_unit_makes_infinite_is_refused():
    with pytest.raises(InputError, match="must be a finite number"):
        parse("1e99 Ym^9/m^8", "m", field="x")
    with pytest.raises(InputError, match=r"must be 0 or from 1e-100 to 1e\+100 in size"):
        parse("1e308 km", "m", field="x")  # by its number already


def test_text_with_a_unit_becomes_si_and_numbers_pass():
    assert in_si("12 cm", "m", field="length") == 0.12 and in_si(0.12, "m", field="length") == 0.12
    assert in_si(["1 bar", "2 bar"], "Pa", field="pressure").tolist() == [1e5, 2e5]


def test_a_range_in_words_has_both_ends():
    assert values_in_si("1:3 bar", "Pa", field="pressures") == [1e5, 2e5, 3e5]
    assert values_in_si("1:2:0.5 bar", "Pa", field="pressures") == [1e5, 1.5e5, 2e5]
    for tenths in range(1, 10):  # three tenths by one tenth is less than 3, and three times one tenth more than 0.3
        values = values_in_si(f"0:0.{tenths}:0.1 m", "m", field="lengths")
        assert len(values) == tenths + 1 and values[-1] == tenths / 10
    assert values_in_si("1 bar, 3 bar", "Pa", field="pressures") == [1e5, 3e5]
    assert values_in_si(2e5, "Pa", field="pressures") == [2e5]


@pytest.mark.parametrize("text", ["3:1 bar", "1:5:0 bar", "1:2:3:4 bar", "1:1e9 mbar"])
def test_a_range_without_a_way_from_end_to_end_is_refused(text):
    with pytest.raises(InputError, match="must be a range such as '1:5 bar'"):
        values_in_si(text, "Pa", field="pressures")


def test_a_number_that_is_declared_while_a_function_is_traced_outlives_the_trace():
    made = []

    def doubled(x):
        made.append(as_array(2.0))  # as a field of a module that is kept is
        return made[0] * x

    assert "device_put" not in str(jax.make_jaxpr(doubled)(1.0))
    assert float(made[0]) == 2.0 and float(jax.jit(lambda x: made[0] + x)(1.0)) == 3.0


@pytest.mark.parametrize(
    ("text", "si_unit", "said"),
    [
        ("50 Hz", "rad/s", "that of 314.159 rad/s"),
        ("3000 1/min", "rad/s", "that of 314.159 rad/s"),
        ("60 rpm", "Hz", "that of 1 Hz"),
        ("6.283185307 rad/s", "1/s", "that of 1 Hz"),
    ],
)
def test_an_angular_frequency_is_not_taken_for_an_ordinary_one(text, si_unit, said):
    with pytest.raises(InputError, match=said):
        parse(text, si_unit, field="speed")


def test_revolutions_are_angular_and_cycles_ordinary():
    assert parse("60 rpm", "rad/s", field="speed") == pytest.approx(2.0 * 3.141592653589793, rel=1e-15)
    assert parse("10 deg/s", "rad/s", field="speed") == pytest.approx(0.17453292519943295, rel=1e-15)
    assert parse("5 kHz", "Hz", field="rate") == 5000.0 and parse("120 1/min", "1/s", field="rate") == 2.0
