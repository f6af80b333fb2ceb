"""Errors raised on purpose: each says where, which field and value, and what would do, and survives a process."""

import pickle

import pytest

from mckibben import errors
from mckibben.errors import InputError, compose_sentence


@pytest.mark.parametrize(
    ("error", "sentence"),
    [
        (
            InputError("pressure", "9 bar", "must be between 0 bar and 6.9 bar"),
            "pressure must be between 0 bar and 6.9 bar, got 9 bar",
        ),
        (InputError("a", 1.23456789, "must be 2; half of it will do"), "a must be 2, got 1.23457; half of it will do"),
        (InputError("a", "x y", "must be a number"), "a must be a number, got 'x y'"),
        (InputError("a", "-.5e3 mm", "must be a time"), "a must be a time, got -.5e3 mm"),
        (InputError("a", 3, "one is enough"), "a is 3: one is enough"),
        (InputError("muscle.law", None, "is missing"), "muscle.law is missing"),
        (
            InputError("kind", "volum", known=("junction", "volume")),
            "Unknown kind 'volum'. Did you mean 'volume'? Known are junction, volume",
        ),
        (InputError("kind", "x", "a tube has", known=("a", "b")), "Unknown kind 'x'. A tube has a, b"),
        (InputError("kind", "x", "C_valve has", known=("a", "b")), "Unknown kind 'x'. C_valve has a, b"),
        (
            InputError("part.lenght", None, known=("length",)),
            "Unknown field 'part.lenght'. Did you mean 'length'? Known are length",
        ),
        (InputError("kind", 4, known=()), "Unknown kind '4'. Known are none"),
        (InputError("a", 1, "is", sentence="So it is.", where="x.toml"), "x.toml: So it is."),
        (InputError("a", 1, "must be 2", where="two\nlines"), "'two\\nlines': a must be 2, got 1"),
        (InputError("a", None, "is missing", remedy="column pressure"), "a is missing, with columns={'pressure': ..}"),
        (InputError("a", None, "is missing", remedy="nothing known"), "a is missing"),
        (errors.not_found("x.csv"), "File not found: x.csv"),
        (errors.not_found(" x.csv", "toml file", where="run"), "run: Toml file not found: ' x.csv'"),
        (errors.not_found("a\tb", "folder"), "Folder not found: 'a\\tb'"),
        (
            errors.MissingLibraryError(
                "Spreadsheets need", "calamine", "files", instead="or write .csv", where="a.xlsx"
            ),
            "a.xlsx: Spreadsheets need calamine, which is not installed: pip install 'mckibben[files]'; or write .csv",
        ),
        (
            errors.MissingLibraryError("Rigs need", "mckibben-hardware", "hardware"),
            "Rigs need mckibben-hardware, which is not installed: pip install 'mckibben[hardware]'"
            ", or in a copy of the repository pip install './packages/mckibben-hardware'",
        ),
        (
            errors.MissingLibraryError("Cards need", "mckibben-hardware", "daq"),
            "Cards need mckibben-hardware, which is not installed: pip install 'mckibben[daq]'"
            ", or in a copy of the repository pip install './packages/mckibben-hardware[daq]'",
        ),
        (
            errors.MissingParametersError("ideal", [("turns", 1), ("b", 2)], "it is a count", where="m.toml"),
            "m.toml: ideal.turns is missing: it is a count",
        ),
        (errors.StageError("static", "no point is left"), "stage static: no point is left"),
    ],
)
def test_an_error_says_where_which_field_which_value_and_what_would_do_here_and_in_another_process(error, sentence):
    assert str(error) == sentence
    again = pickle.loads(pickle.dumps(error))
    assert (type(again), str(again), vars(again)) == (type(error), sentence, vars(error))


def test_what_a_user_gave_is_shown_whole_up_to_a_bound_and_its_ends_beyond():
    whole, long = "a" * errors.LONGEST, "b" * 500 + "c" * 500
    assert errors.shortened(whole) == whole
    assert len(errors.shortened(whole + "a")) == errors.LONGEST
    assert errors.shortened(long).startswith("b" * 280 + "..c") and errors.shortened(long).endswith("c" * 18)
    for sentence in (
        compose_sentence(long, None, "is"),
        compose_sentence("a", long, "is"),
        str(errors.not_found(long)),
    ):
        assert len(sentence) < errors.LONGEST + 30  # the words around it


def test_words_are_written_as_a_choice():
    assert [errors.choice(words) for words in (["a"], ["a", "b"], ["a", 2, "c"])] == ["a", "a or b", "a, 2 or c"]


@pytest.mark.parametrize(
    "error", [InputError("a", 1, "must be 2"), errors.MissingLibraryError("It needs", "x", "y", instead="or z")]
)
def test_an_error_is_located_the_outermost_first(error):
    assert str(error.at("b.toml")) == f"b.toml: {error}"
    assert str(error.at("b.toml").at("c.toml")) == f"c.toml: b.toml: {error}"
    assert type(error.at("b.toml")) is type(error)


@pytest.mark.parametrize(
    ("part", "value", "sentence"),
    [
        ("field", "b", "x: b is 1: no, with decimal='.' or decimal=','"),
        ("value", 2, "x: a is 2: no, with decimal='.' or decimal=','"),
        ("problem", "must be 2", "x: a must be 2, got 1, with decimal='.' or decimal=','"),
        ("where", "y", "y: a is 1: no, with decimal='.' or decimal=','"),
        ("where", "", "a is 1: no, with decimal='.' or decimal=','"),
        ("sentence", "No.", "x: No., with decimal='.' or decimal=','"),
        ("remedy", "", "x: a is 1: no"),
    ],
)
def test_an_error_with_one_part_changed_keeps_the_others(part, value, sentence):
    error = InputError("a", 1, "no", where="x", remedy="decimal")
    assert str(error.changed()) == str(error)
    assert str(error.changed(**{part: value})) == sentence
    known = InputError("kind", "x", known=("a", "b"), sentence="Kept.")
    assert known.changed().known == ("a", "b") and str(known.changed()) == "Kept."
