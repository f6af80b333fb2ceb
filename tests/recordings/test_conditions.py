"""What tells recordings apart, and the sheets and topics of a file."""

import numpy as np
import pytest

from mckibben.formats.registry import part_options, parts_of
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
