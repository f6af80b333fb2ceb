"""Files of testing machines that hold one pressure each, with a zero of length of their own; and ranges of cells."""

import re
import zipfile

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben.recordings.tables import write_table


def pull(path, *, begin=0.12, head=(), count=6):
    """A pull from a length: travel from zero, and a force that says the length [mm] and nothing else."""
    rows = [*head, "Zeit;Standardweg;Standardkraft", "s;mm;N"]
    rows += [f"{i / 10},{0};{i};{1e3 * begin + i}".replace(",0;", ";") for i in range(count)]
    path.write_text("\n".join(rows) + "\n", encoding="cp1252")


@pytest.fixture
def pulls(tmp_path):
    folder = tmp_path / "pulls"
    folder.mkdir()
    return folder


def test_each_file_has_its_pressure_and_its_own_zero_of_length(pulls):
    for bar, begin in ((1, 0.116), (2.5, 0.118), (10, 0.12)):
        pull(pulls / f"pull {bar} bar.csv", begin=begin, head=[f"Einspannlänge;{1e3 * begin:g};mm"])
    for place in (pulls, pulls / "*bar.csv"):
        points = mk.read(place)
        assert sorted(set(points.pressure)) == [1e5, 2.5e5, 1e6] and len(set(points.run)) == 3
        assert points.length * 1e3 == pytest.approx(points.tension)


@pytest.mark.parametrize(
    ("head", "name"), [(["Pressure: 3 bar"], "a.csv"), (["Druck;3,0;bar"], "b.csv"), ([], "x_300kPa.csv")]
)
def test_the_pressure_is_that_of_the_head_or_of_the_name(pulls, head, name):
    pull(pulls / name, head=head)
    points = mk.read(pulls, length_zero="12 cm")
    assert set(points.pressure) == {3e5} and any("3 bar" in remark for remark in points.remarks)


@pytest.mark.parametrize(("head", "name"), [([], "a.csv"), ([], "m2_5bar.csv"), (["Druck;3;bar"], "x 4 bar.csv")])
def test_a_pressure_that_is_not_clear_is_asked_for(pulls, head, name):
    pull(pulls / name, head=head)
    with pytest.raises(InputError, match="pressure must be stated"):
        mk.read(pulls, length_zero="12 cm")
    assert set(mk.read(pulls, length_zero="12 cm", pressure="5 bar").pressure) == {5e5}


def test_stated_pressures_and_zeros_follow_the_names_by_number(pulls):
    for number, begin in ((2, 0.116), (10, 0.12)):
        pull(pulls / f"pull{number}.csv", begin=begin)
    points = mk.read(pulls, pressure="1 bar, 3 bar", length_zero=[0.116, 0.12])
    assert points.length * 1e3 == pytest.approx(points.tension)
    assert points.pressure[points.run == "pull10.csv"].tolist() == [3e5] * 6
    with pytest.raises(InputError, match="one for each of the 2 files pull2.csv, pull10.csv; got 3"):
        mk.read(pulls, pressure="1 bar, 2 bar, 3 bar", length_zero=0.12)


def test_a_muscle_that_is_slack_at_one_pressure_is_one_of_the_series(pulls):
    rows = ["length [mm],force [N]", *(f"{120 + i},{0.001 * i}" for i in range(5))]
    (pulls / "a 1 bar.csv").write_text("\n".join(rows) + "\n")
    pull(pulls / "b 3 bar.csv", head=["Einspannlänge;120;mm"])
    assert sorted(set(mk.read(pulls).pressure)) == [1e5, 3e5]
    (pulls / "b 3 bar.csv").unlink()
    with pytest.raises(InputError, match="must reach"):
        mk.read(pulls)


def test_a_stated_pressure_beside_a_column_of_it_is_refused(tmp_path):
    (tmp_path / "map.csv").write_text("length [mm],pressure [bar],force [N]\n120,3,20\n130,3,35\n")
    with pytest.raises(InputError, match="without a column"):
        mk.read(tmp_path / "map.csv", pressure="3 bar")


def test_a_shortening_is_counted_from_its_own_zero_too(tmp_path):
    (tmp_path / "a.csv").write_text("contraction [mm],force [N]\n0,40\n10,20\n20,5\n")
    points = mk.read(tmp_path / "a.csv", pressure=3e5, length_zero="14 cm")
    assert points.length == pytest.approx([0.14, 0.13, 0.12])


def test_a_range_of_cells_is_all_that_is_read_of_a_sheet(tmp_path):
    from mckibben.recordings.tables import write_table

    notes = ["measured by M.", "", "", "", ""]
    rows = [["", "length [mm]", "pressure [bar]", "force [N]", "7"]]
    rows += [["x", length, 3, force, 8] for length, force in ((120, 20), (130, 35), (140, 50))]
    second = ["", "total", 999, 999, ""]
    place = tmp_path / "book.xlsx"
    columns = [list(column) for column in zip(notes, *rows, second, strict=True)]
    write_table({f"c{i}": column for i, column in enumerate(columns)}, place)
    points = mk.read(place, sheet="B3:D6")
    assert points.length == pytest.approx([0.12, 0.13, 0.14]) and np.all(points.pressure == 3e5)
    with pytest.raises(InputError, match="holds cells"):
        mk.read(place, sheet="Z90:AA99")


@pytest.mark.parametrize(
    ("value", "kind", "kept"), [(True, "b", "1"), (False, "b", "0"), (2, None, "2"), (0.1, None, "0.1")]
)
def test_a_cell_of_a_spreadsheet_is_of_the_kind_of_its_value(tmp_path, value, kind, kept):
    write_table({"value": [value]}, tmp_path / "one.xlsx")
    sheet = zipfile.ZipFile(tmp_path / "one.xlsx").read("xl/sheet.xml").decode()
    assert re.findall(r'<c( t="b")?><v>(.*?)</v>', sheet) == [(' t="b"' if kind else "", kept)]
