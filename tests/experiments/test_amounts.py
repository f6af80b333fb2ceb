"""Amounts in rest lengths and in SI: read, rewritten from one to the other, and said, whatever stands beside them."""

import math

import pytest

from mckibben.errors import InputError
from mckibben.experiments.amounts import Amount, has_both, in_metres, in_si, read_amount, relative_unit, table_words

RELATIVE = {"kind": "sine", "mean": "0.9 L0", "parts": ["0.1 L0", {"amplitude": "0.2 L0", "note": "up"}], "cycles": 3}
MIXED = {"kind": "sine", "mean": "0.9 L0", "amplitude": "1.2 cm"}
METRES = {"kind": "sine", "mean": "13 cm"}


def test_an_amount_in_rest_lengths_is_as_many_of_a_muscle_and_others_are_what_they_are():
    assert read_amount("0.75 L0", "m", field="a") == Amount(0.75, "L0")
    assert read_amount("2 L0/s", "m/s", field="a").si(0.14) == pytest.approx(0.28, rel=1e-15)
    assert read_amount("13 cm", "m", field="a").si(0.2) == pytest.approx(0.13, rel=1e-15)
    assert read_amount(3, "1", field="a") == Amount(3.0, "1")
    assert read_amount("1 L0", "m", field="a", bounds=(1.0, 1.0)).value == 1.0
    for raw, unit, bounds, said in (
        ("1 L0", "m/s", None, "must be a value in m/s"),
        ("1 L0", "Pa", None, "must be a value in Pa"),
        (True, "1", None, "must be a number with its unit in words"),
        ([1], "1", None, "must be a number with its unit in words"),
        (math.inf, "1", None, "finite"),
        ("1e999 L0", "m", None, "must be a finite number"),
        ("1.1 L0", "m", (0.5, 1.0), "must be between 50 cm and 100 cm"),
        ("49 cm", "m", (0.5, 1.0), "must be between 50 cm and 100 cm"),
    ):
        with pytest.raises(InputError, match=f"^b: a {said}|a {said}"):
            read_amount(raw, unit, field="a", where="b", bounds=bounds)


def test_a_table_in_rest_lengths_is_one_in_their_unit_and_any_other_stays():
    plain = {"kind": "sine", "mean": "0.9", "parts": ["0.1", {"amplitude": "0.2", "note": "up"}], "cycles": 3}
    assert relative_unit(RELATIVE, "m") == (plain, "L0")
    assert relative_unit({"rate": "2 L0/s"}, "m/s") == ({"rate": "2"}, "L0/s")
    for table, unit in ((MIXED, "m"), (METRES, "m"), (RELATIVE, "m/s"), (RELATIVE, "Pa")):
        assert relative_unit(table, unit) == (table, unit)
    assert [has_both(table, "m") for table in (RELATIVE, MIXED, METRES)] == [False, True, False]


def test_a_table_in_metres_is_that_of_a_muscle_of_that_length_and_in_si_only_its_unit_changes():
    made = in_metres(MIXED, "m", 0.2)
    assert made["amplitude"] == "1.2 cm" and made["kind"] == "sine"
    assert float(made["mean"].removesuffix(" m")) == pytest.approx(0.18, rel=1e-15)
    assert in_metres(MIXED, "m/s", 0.2) == MIXED
    assert in_si(MIXED, "m") == {"kind": "sine", "mean": "0.9 L0", "amplitude": "0.012 m"}
    assert in_si(MIXED, "Pa") == MIXED


def test_a_table_is_said_by_its_kind_and_its_amounts_by_their_names():
    assert table_words(MIXED, "m") == "sine, mean 0.9 L0, amplitude 1.2 cm"
    assert table_words({"high_level": "2 bar", "cycles": 3}, "Pa") == "high level 2 bar, cycles 3"
    assert table_words(["1 bar", ["2 bar", 3]], "Pa") == "(1 bar; (2 bar; 3))"
