"""What tells recordings apart, and the sheets and topics of a file."""

import datetime
import sys

import jax
import numpy as np
import pytest

import mckibben
from mckibben.formats.registry import part_options, parts_of
from mckibben.recordings import provenance
from mckibben.recordings.provenance import conditions, differing_conditions, told_apart


def meta(pressure="5 bar", muscle="nylon", **more):
    protocol = {"name": "loops", "parameters": {"pressure": {"unit": "Pa", "value": pressure}, "cycles": {"value": 3}}}
    return {"specimen": muscle, "protocol": protocol, "rig": "paper", **more}


def test_recordings_are_told_apart_by_the_conditions_that_differ_and_by_no_others():
    all_ = [meta(), meta("3 bar"), meta(muscle="fiberglass")]
    assert differing_conditions([conditions(one) for one in all_]) == ["muscle", "pressure"]
    assert told_apart(all_)[1] == {"muscle": "nylon", "pressure": "3 bar"}


def test_where_all_conditions_are_the_same_numbers_of_the_machine_tell_recordings_apart():
    tubes = [{"circuit.tube.length": {"value": value, "unit": "m"}} for value in (1.0, 2.0)]
    told = told_apart([meta(parameters=tube) for tube in tubes])
    assert told == [{"circuit.tube.length": "100 cm"}, {"circuit.tube.length": "200 cm"}]
    assert told_apart([meta(), meta()]) == [{}, {}]


def test_more_numbers_of_the_machine_than_can_be_told_tell_nothing_and_conditions_are_told_whatever_their_number():
    for count, known in ((provenance.MOST, True), (provenance.MOST + 1, False)):
        paths = [f"circuit.tube.{i}" for i in range(count)]
        two = [meta(parameters={path: {"value": value, "unit": "1"} for path in paths}) for value in (1.0, 2.0)]
        assert told_apart(two) == [dict.fromkeys(paths, text) if known else {} for text in ("1", "2")]
        more = [{"protocol": {"parameters": {path: {"value": value} for path in paths}}} for value in ("a", "b")]
        assert told_apart(more)[0] == dict.fromkeys(paths, "a")


def test_a_file_of_another_program_has_no_conditions_that_it_does_not_state():
    assert conditions({"title": "map.csv", "protocol": None, "specimen": None}) == {}


@pytest.fixture
def book(tmp_path):
    """Two sheets with tables, and one without cells."""
    openpyxl = pytest.importorskip("openpyxl")
    work = openpyxl.Workbook()
    for name, factor in (("first", 1.0), ("second", 2.0)):
        sheet = work.create_sheet(name)
        sheet.append(["length [m]", "pressure [bar]", "force [N]"])
        for length in np.linspace(0.1, 0.14, 5):
            sheet.append([float(length), 5.0, factor * float(length)])
    path = tmp_path / "book.xlsx"
    work.save(path)
    return path


def test_the_sheets_with_cells_can_be_chosen_and_one_that_has_none_cannot(book):
    assert parts_of(book) == ("sheet", ["first", "second"])
    assert part_options(book, "second") == {"sheet": "second"} and part_options(book, "") == {}


def test_a_file_that_cannot_be_read_has_no_parts(tmp_path):
    broken = tmp_path / "broken.xlsx"
    broken.write_bytes(b"no book")
    assert parts_of(broken) == ("", [])
    assert parts_of(tmp_path / "table.csv") == ("", [])


def test_a_recording_is_of_now_in_utc_and_of_these_versions():
    before = datetime.datetime.now(datetime.UTC)
    stated = datetime.datetime.fromisoformat(provenance.created())
    assert stated.utcoffset() == datetime.timedelta(0) and abs(stated - before) < datetime.timedelta(seconds=60)
    assert stated.microsecond == 0
    assert provenance.versions() == {
        "mckibben": mckibben.__version__, "jax": jax.__version__, "python": sys.version.split()[0],
    }  # fmt: skip


def test_numbers_of_a_machine_have_their_unit_and_what_is_no_number_is_none():
    numbers = {
        "a": (0.5, "m"),
        "b": (0.123456, "1"),
        "c": (3.0, ""),
        "d": ("x", "m"),
        "e": (True, "1"),
        "f": (2.0, "xx"),
    }
    stated = {name: {"value": value, "unit": unit} for name, (value, unit) in numbers.items()}
    told = {"a": "50 cm", "b": "0.1235", "c": "3", "f": "2 xx"}
    assert provenance.machine_numbers({"parameters": stated | {"g": 3.0}}) == told
