"""Words become SI numbers at the edges, once, and a wrong dimension is named."""

import dataclasses
import math
import re
from fractions import Fraction
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from mckibben import quantities
from mckibben.components import Module
from mckibben.errors import InputError
from mckibben.quantities import (
    Quantity,
    as_array,
    from_si,
    has_dimension,
    in_si,
    parse,
    quantity,
    to_si,
    values_in_si,
    with_unit,
)


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
        made.append(as_array(2.0625))  # as a field of a module that is kept is; of a number that no other test has made
        return made[0] * x

    # JAX 0.6 leaves a put in the trace, whose result nothing takes
    assert all(e.primitive.name != "device_put" or str(e.outvars[0]) == "_" for e in jax.make_jaxpr(doubled)(1.0).eqns)
    assert float(made[0]) == 2.0625 and float(jax.jit(lambda x: made[0] + x)(1.0)) == 3.0625


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


class Declared(Module):
    """A stiffness that is needed, a length that only some uses have, and a word."""

    stiffness: Any = quantity("N/m", (0.0, 1e3), "of the spring", along=-1)
    length: Any = quantity("m", (0.1, math.inf), "at rest", typical=(0.2, 0.3), default=None)
    count: int = 3


@dataclasses.dataclass
class Stated:
    """Arguments that words may state."""

    mass: float | str = quantities.amount("kg", (0.1, 10.0))
    speed: float | str = quantities.amount("m/s", default=2.0)
    name: str = ""


def test_what_is_declared_is_found_by_name_and_what_has_no_value_is_none():
    one = Declared(stiffness=5)
    assert list(quantities.declared(one)) == ["stiffness", "length"] == list(quantities.declared(Declared))
    assert one.length is None and quantities.values(one) == {"stiffness": 5.0}
    two = Declared(stiffness=[1.0, 2.0], length=0.5)
    assert quantities.values(two) == {"stiffness": [1.0, 2.0], "length": 0.5} and isinstance(two.length, jax.Array)
    assert two.length.dtype == float and not isinstance(one.length, jax.Array)
    stiffness, length = quantities.declared(one).values()
    assert (stiffness.typical, length.typical, stiffness.along, length.along) == ((0.0, 1e3), (0.2, 0.3), -1, 0)
    assert quantities.amounts(Stated) == {"mass": ("kg", (0.1, 10.0)), "speed": ("m/s", None)}
    with pytest.raises(TypeError):
        Stated()
    assert Stated("1 kg").speed == 2.0


@pytest.mark.parametrize("value", [0.0, 1e3, [0.0, 1e3], 5])
def test_bounds_of_a_declaration_are_inclusive(value):
    quantities.check_fields(Declared(stiffness=value))


@pytest.mark.parametrize(
    "value", [math.nextafter(0.0, -1.0), math.nextafter(1e3, 2e3), math.nan, math.inf, [1.0, -1.0]]
)
def test_what_is_out_of_the_bounds_of_a_declaration_is_refused(value):
    with pytest.raises(InputError, match="stiffness must be between 0 N/cm and 10 N/cm, got"):
        Declared(stiffness=value)
    with pytest.raises(InputError, match="a.toml: stiffness must be"):
        quantities.declared(Declared)["stiffness"].check("stiffness", np.asarray(value), where="a.toml")


def test_an_open_end_is_said_as_one():
    assert quantities.declared(Declared)["length"].allowed() == "10 cm or more"
    assert quantities.declared(Declared)["stiffness"].allowed() == "between 0 N/cm and 10 N/cm"


def test_arrays_of_jax_stay_what_they_are_and_all_else_becomes_floats():
    given = jnp.asarray([1.0, 2.0])
    assert as_array(given) is given
    for value in (jnp.asarray([1, 2]), np.asarray([1, 2]), [1, 2], jnp.asarray(2.0, jnp.float32)):
        made = as_array(value)
        assert made.dtype == float and made.tolist() == np.asarray(value).tolist()


def test_numbers_of_the_same_bits_are_one_array_of_jax_and_no_others():
    assert as_array(0.375) is as_array(np.float64(0.375)) and as_array(0.375).shape == ()
    assert np.signbit(as_array(-0.0)) and not np.signbit(as_array(0.0)) and np.isnan(as_array(math.nan))
    assert as_array(0.375) is not as_array([0.375])


@pytest.mark.parametrize(
    ("unit", "powers"),
    [
        ("N", {"kg": 1, "m": 1, "s": -2}), ("Pa", {"kg": 1, "m": -1, "s": -2}),
        ("N m/rad", {"kg": 1, "m": 2, "s": -2, "rad": -1}),
        ("m^3/s", {"m": 3, "s": -1}), ("1", {}), ("J/(kg*K)", {"m": 2, "s": -2, "K": -1}),
        ("V", {"kg": 1, "m": 2, "s": -3, "A": -1}),
    ],
)  # fmt: skip
def test_an_si_unit_is_a_product_of_powers_of_base_units(unit, powers):
    assert quantities.base_exponents(unit) == powers


@pytest.mark.parametrize("unit", ["bar", "cm", "m^0.5", "cd", "N/cm"])
def test_what_is_no_product_of_whole_powers_of_base_units_is_refused(unit):
    with pytest.raises(ValueError, match=re.escape(unit)):
        quantities.base_exponents(unit)


def test_units_are_known_as_people_write_them():
    assert all(quantities.is_unit(one) for one in ("bar", "N/cm", "cm^2", "l/min", "%", "1", "furlong"))
    assert not any(quantities.is_unit(one) for one in ("barr", "12 **", "9**9**9", "m" * 70, "nonsense"))
    assert quantities.usual_units("Pa")[0] == "Pa" and "bar" in quantities.usual_units("Pa")


@pytest.mark.parametrize(
    ("value", "taken"), [(3, True), (3.5, True), (np.float64(2.0), True), (Fraction(1, 2), True), ([1, 2], True),
                         (range(3), True), (np.arange(3), True), (True, False), ([True, 1.0], False), ([True], False),
                         ({}, False), (1j, False), (np.array(["a"]), False), ([[1], [2, 3]], False)],
)  # fmt: skip
def test_numbers_pass_as_they_are_and_what_only_looks_like_one_is_refused(value, taken):
    if taken:
        assert np.asarray(in_si(value, "m", field="x"), float).tolist() == np.asarray(value, float).tolist()
    else:
        with pytest.raises(InputError, match="x must be a number in m, or words with a unit, or an array of them"):
            in_si(value, "m", field="x")


def test_whole_numbers_and_values_by_name_are_what_they_say():
    assert [quantities.whole_number(one, "seed", least=1) for one in (1, np.int64(5))] == [1, 5]
    for wrong in (0, -1, 1.0, True, "1", None):
        with pytest.raises(InputError, match="seed must be a whole number from 1, got"):
            quantities.whole_number(wrong, "seed", least=1)
    assert quantities.whole_number(0, "seed") == 0
    assert quantities.named_values({"a": 1}, "changes") == {"a": 1}
    for wrong in ([1], "a", None):
        with pytest.raises(InputError, match="changes must be values by name"):
            quantities.named_values(wrong, "changes")


def test_a_list_in_words_is_parted_by_commas_or_semicolons_and_no_number_is():
    assert quantities.split_values("1 bar, 3 bar; 4 bar,", field="p") == ["1 bar", "3 bar", "4 bar"]
    assert values_in_si("1 bar, 3 bar", "Pa", field="p") == [1e5, 3e5]
    with pytest.raises(InputError, match="'1.5 bar' for one number or '1; 5 bar' for a list"):
        quantities.split_values("1,5 bar", field="p")
    with pytest.raises(InputError, match="write '1; 2; 3 bar' for a list"):
        quantities.split_values("1,2,3 bar", field="p")


@pytest.mark.parametrize(("text", "unit"), [("12 cm", "m"), ("1e-99 m", "m"), ("0 m", "m"), ("-1 bar", "Pa")])
def test_any_size_that_a_person_can_mean_is_taken(text, unit):
    assert math.isfinite(parse(text, unit, field="x"))


@pytest.mark.parametrize("text", ["1e-100 m", "1e100 m", "-1e101 m", "inf m", "nan m", "5"])
def test_no_size_that_nobody_can_mean_is_taken(text):
    with pytest.raises(InputError, match="x must be"):
        parse(text, "m", field="x")
    assert parse("5", "m", field="x", bare=True) == parse("5", "1", field="x") == 5.0


def test_an_unknown_unit_is_answered_by_the_one_that_is_near():
    for text, unit, near in (("5 Psi", "Pa", "psi"), ("5 CM", "m", "cm")):
        with pytest.raises(InputError, match=f"Did you mean '{near}'"):
            parse(text, unit, field="x")
    with pytest.raises(InputError) as caught:
        parse("5 Psi", "m", field="x")
    assert "psi" not in str(caught.value)
