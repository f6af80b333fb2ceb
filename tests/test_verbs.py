"""Verbs: what a command shows is what the function says, and Python is told what the command line is told."""

import pickle
import subprocess
import sys

import pytest

from mckibben import verbs
from mckibben.answers import Column, Table
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.studies.tension import tension


def test_help_is_read_from_the_source_and_imports_nothing_that_computes():
    code = "import sys; from mckibben.cli import verb_commands as v; v.energy.function(), v.tension.function()"
    code += "; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"jax", "scipy", "numpy", "mckibben.studies.tension", "mckibben.analysis.energy"}
    assert heavy & set(done.stdout.split()) == set()


def test_text_with_a_unit_and_a_number_in_si_are_one_question():
    by_text = tension("nylon", length="11:12 cm", pressure="5 bar").rows()
    assert by_text == tension("nylon", length=[0.11, 0.12], pressure=5e5).rows()
    assert len(by_text) == 2


def test_a_refusal_names_parameters_as_whoever_asks_calls_them():
    with pytest.raises(InputError, match=r"^length is missing: .* such as contraction '20 %'$"):
        tension("nylon", pressure="5 bar")
    with pytest.raises(InputError, match=r"^--length is missing: .* such as --contraction '20 %'$"):
        verbs.answer(tension, {"muscle": "nylon", "pressure": "5 bar"}, lambda name: f"--{name}")
    with pytest.raises(InputError, match="pressure must be a pressure such as '5 bar', got 5; the unit is missing"):
        tension("nylon", length="12 cm", pressure="5")


def test_a_slip_is_said_by_the_answer_and_as_a_warning():
    with pytest.warns(PlausibilityWarning, match="was 0.001 kN meant"):
        answer = tension("nylon", length="12 cm", target_tension="0.001 N")
    assert [one.parameter for one in answer.cautions] == ["target tension"]
    assert answer.to_dict()["warnings"] == [one.text for one in answer.cautions]


def test_a_number_that_was_typed_keeps_its_text_and_is_a_plain_number_in_arithmetic():
    number = pickle.loads(pickle.dumps(verbs.ParsedNumber(0.12, "12 cm")))
    assert (number, number.text, type(number + 0.0)) == (0.12, "12 cm", float)


def test_cells_keep_their_numbers_and_columns_say_how_they_are_read():
    columns = (Column("length", unit="m"), Column("share", unit="1", shown="%", places=".2f"), Column("word"))
    table = Table("", columns, [{"length": 0.12, "share": -1e-9}, {"length": float("nan"), "word": "slack"}])
    assert table.heads == ["length, cm", "share, %", "word"] and table.right == [0, 1]
    assert table.cells() == [["12", "0.00", ""], ["", "", "slack"]]
    assert table.rows[0]["length"] == 0.12
