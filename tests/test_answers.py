"""How an answer shows its values: each cell is one value in its unit, and nothing is shown that is not there."""

import math
import warnings
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np
import pytest

from mckibben.answers import FEW, SHOWN, Answer, Caution, Column, Table, brief, collect, estimates, named, warn
from mckibben.errors import PlausibilityWarning

PRESSURE = Column("pressure", unit="Pa", places="")


@pytest.mark.parametrize(
    ("column", "value", "text"),
    [
        (PRESSURE, 5e5, "5"),  # bar
        (PRESSURE, 1e7, "100"),
        (PRESSURE, 9.994e6, "99.9"),
        (Column("x", unit="1", shown="%", places=".1f"), 0.1234, "12.3"),
        (Column("x", unit="1", shown="%", places=".1f"), -1e-9, "0.0"),  # what is rounded to zero has no sign
        (Column("x", unit="1"), -0.5, "-0.5"),
        (Column("x", unit="m", shown="mm", beside=True), 0.012, "12 mm"),
        (Column("x", unit="m", most=1.0), 1.0, "100"),
        (Column("x", unit="m", most=1.0), 1.0001, "> 100"),
        (Column("x", unit="1", failed="diverges"), math.inf, "diverges"),
        (Column("x", unit="1", failed="diverges"), -math.inf, "diverges"),
        (Column("x", unit="1", missing="-"), math.nan, "-"),
        (Column("x", unit="1", missing="-"), None, "-"),
        (Column("x", missing="-"), "word", "word"),
        (Column("x", own="of"), 0.5, "0.5"),
    ],
)
def test_a_cell_is_its_value_in_its_unit(column: Column, value, text: str) -> None:
    assert column.text(value) == text
    assert column.cell({column.key: value}) == text


def test_a_row_with_a_unit_of_its_own_shows_it() -> None:
    column = Column("value", own="unit", missing="-")
    assert column.cell({"value": 0.12, "unit": "m"}) == "12 cm"
    assert column.cell({"value": math.nan, "unit": "m"}) == column.cell({"value": None, "unit": "m"}) == "-"


def test_a_range_stands_in_brackets_or_for_the_value_and_not_where_it_is_none() -> None:
    column = Column("x", unit="1", ends=("low", "high"), missing="-")
    assert column.cell({"x": 2.0, "low": 1.0, "high": 3.0}) == "2 (1 to 3)"
    assert column.cell({"x": None, "low": 1.0, "high": 3.0}) == "1 to 3"
    assert column.cell({"x": None, "low": 1.0, "high": 1.0}) == "1"
    assert column.cell({"x": 2.0, "low": 2.0, "high": 2.0}) == "2"
    assert column.cell({"x": 2.0, "low": 2.0, "high": 3.0}) == "2 (2 to 3)"
    assert column.cell({"x": 2.0, "low": None, "high": None}) == "2"


def test_a_head_has_a_unit_unless_it_stands_beside_each_number() -> None:
    assert PRESSURE.head == "pressure, bar"
    assert Column("free_length", unit="m", shown="mm").head == "free length, mm"
    assert (
        Column("x", title="share", unit="1").head == Column("x", title="share", unit="m", beside=True).head == "share"
    )
    assert Column("x", title="", unit="m").head == ""
    words, number = Column("a"), Column("b", unit="1")
    assert Table("", (words, number, Column("c", right=True), Column("d", own="u")), ()).right == [1, 2, 3]


def test_the_columns_of_an_answer_are_its_rows() -> None:
    class Two(Answer):
        def rows(self):
            return [{"a": 1, "b": 2.0}, {"a": 3, "b": 4.0}]

    assert Two().data() == {"a": [1, 3], "b": [2.0, 4.0]} and Answer().data() == {}


def test_cautions_are_said_once_each_in_their_order_and_at_the_line_that_asked() -> None:
    one, two = Caution("first", "a"), Caution("second")
    assert collect(None, one, two, one, None) == (one, two)
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        (lambda: warn((one, two), stacklevel=1))()
    assert [(str(w.message), w.category) for w in said] == [
        ("first", PlausibilityWarning),
        ("second", PlausibilityWarning),
    ]
    assert said[0].filename == __file__
    assert named("{length} and {b}", lambda name: f"--{name}") == "--length and --b"


class Shown(NamedTuple):
    value: object


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (np.zeros((2, 3)), "array (2, 3)"),
        (np.float64(2.0), repr(np.float64(2.0))),
        ([1] * FEW, "[1, 1, 1]"),
        ([1] * (FEW + 1), "4 entries"),
        ({"a": np.zeros(2)}, "{'a': array (2,)}"),
        ({i: 0 for i in range(1234)}, "1,234 entries"),
        ("x" * (SHOWN - 2), repr("x" * (SHOWN - 2))),
        ("x" * (SHOWN - 1), repr("x" * SHOWN)[:SHOWN] + ".."),
    ],
)
def test_a_representation_is_one_line_however_much_it_holds(value: object, text: str) -> None:
    assert brief(Shown(value)) == f"Shown(value={text})"


def test_estimates_have_intervals_unless_something_else_is_said_of_all() -> None:
    one = SimpleNamespace(value=1.0, low=0.5, high=2.0, unit="N")
    said = (None, {"a": "at a bound"}, {"a": "x", "b": "y"})
    whole, some, none = (estimates("t", {"a": one, "b": one}, more=more) for more in said)
    assert whole.heads == ["parameter", "value", "95 %: from", "to"]
    assert whole.cells()[0] == ["a", "1 N", "0.5 N", "2 N"]
    assert some.heads == [*whole.heads, ""] and some.cells() == [
        ["a", "1 N", "", "", "at a bound"],
        ["b", "1 N", "0.5 N", "2 N", ""],
    ]
    assert none.heads == ["parameter", "value", ""] and none.cells()[1] == ["b", "1 N", "y"]


def test_a_column_that_only_some_rows_have_is_kept_with_gaps() -> None:
    class Unlike(Answer):
        def rows(self):
            return [{"a": 1}, {"a": 2, "b": 3}]

    assert Unlike().data() == {"a": [1, 2], "b": [None, 3]}
    assert "<svg" not in Unlike()._repr_html_()


def test_few_entries_of_a_mapping_are_shown_and_more_are_counted() -> None:
    assert brief(Shown({i: i for i in range(FEW)})) == "Shown(value={0: 0, 1: 1, 2: 2})"
    assert brief(Shown({i: i for i in range(FEW + 1)})) == "Shown(value=4 entries)"


def test_a_column_in_which_nothing_stands_is_not_shown_and_stays_in_the_rows():
    columns = (Column("name"), Column("length", unit="m"), Column("force", unit="N"))
    rows = [{"name": "a", "length": None, "force": 1.0}, {"name": "b", "length": math.nan, "force": None}]
    table = Table("", columns, rows)
    assert table.heads == ["name", "force, N"] and table.cells() == [["a", "1"], ["b", ""]] and table.right == [1]
    assert len(table.columns) == 3 and table._repr_html_().count("<th") == 2
    assert Table("", columns, []).heads == [one.head for one in columns]  # of no row nobody knows
