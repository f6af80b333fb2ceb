"""Formats of other packages are found by their entry points."""

import json
import sys

import numpy as np
import pytest

from mckibben import registry
from mckibben.errors import InputError, MissingLibraryError
from mckibben.formats import sidecar
from mckibben.formats.registry import parts_as_format
from mckibben.formats.store import NetCDF, Variable, _foreign_netcdf
from mckibben.formats.table import Channel, FileFormat, ForeignColumn, ForeignTable, StoredRecording
from mckibben.recordings import read_any, read_force_map, write


def read_pairs(path):
    values = np.loadtxt(path, delimiter="|", ndmin=2)
    columns = [ForeignColumn("time", values[:, 0], "ms"), ForeignColumn("tank.pressure", values[:, 1], "kPa")]
    return ForeignTable(columns, {"program": "pairs"}, ["the header was left out"])


FORMAT = FileFormat(title="Files of pairs", read=read_pairs)


@pytest.fixture
def installed(monkeypatch):
    """Another package with a format for ``.pairs``."""
    monkeypatch.setattr(registry, "plugins", lambda group: {"pairs": FORMAT} if group == "mckibben.formats" else {})


def test_a_format_of_another_package_is_read_by_its_suffix(installed, tmp_path):
    (tmp_path / "a.pairs").write_text("0|100\n10|150\n20|200\n")
    found = read_any(tmp_path / "a.pairs")
    assert found.remarks == ["the header was left out"] and found.recording.meta["source"]["program"] == "pairs"
    assert np.allclose(found.recording["tank.pressure"], [1e5, 1.5e5, 2e5], rtol=1e-15)
    assert np.allclose(found.recording.time, [0.0, 0.01, 0.02], rtol=1e-15)
    with pytest.raises(InputError, match="the file has time .ms., tank.pressure"):  # its columns are those of any table
        read_force_map(tmp_path / "a.pairs")


def test_a_format_that_is_only_read_is_not_written(installed, tmp_path):
    (tmp_path / "a.pairs").write_text("0|100\n10|150\n")
    record = read_any(tmp_path / "a.pairs").recording
    with pytest.raises(InputError, match="[Kk]nown are .nc, .csv, .mcap"):
        write(record, tmp_path / "b.pairs")


def test_without_other_packages_an_unknown_suffix_is_refused(tmp_path):
    (tmp_path / "a.pairs").write_text("1")
    with pytest.raises(InputError, match="[Kk]nown are .nc, .csv"):
        read_any(tmp_path / "a.pairs")


CHANNELS = {"tension": Channel([1.0, 2.0], "N", "measured", "of the cell"), "pressure_abs": Channel([3.0, 4.0], "Pa")}
LINE = json.loads(sidecar.dumps(CHANNELS, {"title": "a", "list": [1.0, 2]}, 2))


def test_the_line_beside_a_table_gives_back_channels_and_meta():
    meta = {"title": "Grösse", "numbers": [1.5, float("inf"), -float("inf")], "more": {"x": None, "y": True}}
    back = sidecar.loads(sidecar.dumps(CHANNELS, meta, 2))
    assert (back.meta, back.samples) == (meta, 2)
    assert sidecar.loads(sidecar.dumps(CHANNELS, meta)).samples is None
    columns = {"t": [0.0, 1.0], "a": [1.0, 2.0], "b": [3.0, 4.0]}
    read = back.from_columns(columns, "t", ["a", "b"], "f")
    assert read.time.tolist() == [0.0, 1.0]
    assert {name: (c.values.tolist(), c.unit, c.kind, c.meaning) for name, c in read.channels.items()} == {
        name: (c.values.tolist(), c.unit, c.kind, c.meaning) for name, c in CHANNELS.items()
    }
    for missing in ("t", "a", "b"):
        with pytest.raises(InputError, match=f"f: column {missing} is missing"):
            back.from_columns({k: v for k, v in columns.items() if k != missing}, "t", ["a", "b"], "f")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("{", "must be JSON"),
        ("[1]", "must be an object of JSON"),
        (json.dumps(LINE | {"schema": None}), "schema is missing"),
        (json.dumps(LINE | {"schema": 0}), "must be a whole number from 1"),
        (json.dumps(LINE | {"schema": True}), "must be a whole number from 1"),
        (json.dumps(LINE | {"schema": sidecar.SCHEMA + 1}), "a newer one wrote it"),
        (json.dumps(LINE | {"channels": {}}), "must be a list of objects"),
        (json.dumps(LINE | {"channels": [1]}), "must be a list of objects"),
        (json.dumps(LINE | {"channels": 2 * LINE["channels"]}), "must be each name once"),
        (json.dumps(LINE | {"channels": [{"name": "a", "unit": "furlong"}]}), "unit"),
        (json.dumps(LINE | {"meta": []}), "must be an object"),
    ],
)
def test_a_damaged_line_is_refused_by_what_is_wrong_in_it(line, said):
    with pytest.raises(InputError, match=said) as caught:
        sidecar.loads(line, "a.csv")
    assert str(caught.value).startswith("a.csv") and "\n" not in str(caught.value)


def test_a_place_in_a_file_is_named_by_its_row_or_counted_from_one():
    assert ForeignTable([]).place(0) == ", sample 1"
    assert ForeignTable([], rows=[7, 9]).place(1) == ", row 9"


@pytest.mark.parametrize(
    ("time", "channels", "said"),
    [
        ([0.0, 1.0], {"a": Channel([1.0], "N")}, "channel a must have 2 values, as the time has, got 1"),
        ([1.0, 0.0], {"a": Channel([1.0, 2.0], "N")}, "time"),
        ([0.0, 1.0], {"a": 3.0}, "channel a must be a Channel"),
        ([0.0, 1.0], [1.0], "channels must be a mapping"),
    ],
)
def test_what_a_file_holds_of_a_recording_is_checked_as_a_recording_is(time, channels, said):
    with pytest.raises(InputError, match=said):
        StoredRecording(np.array(time), channels, {})


def test_a_format_whose_library_is_missing_is_refused_before_it_is_written(monkeypatch):
    needs = FileFormat(title="Tables of somebody", read=read_any, requires="pandas")
    needs.check_libraries("a.tab")
    monkeypatch.setitem(sys.modules, "polars", None)
    with pytest.raises(MissingLibraryError, match=r"a.tab: Tables of somebody need polars, which is not installed"):
        FileFormat(title="Tables of somebody", read=read_any, requires="polars").check_libraries("a.tab")
    FileFormat(title="Tables of somebody", read=read_any).check_libraries("a.tab")


def test_a_file_whose_format_lists_no_parts_has_none(tmp_path):
    assert parts_as_format(tmp_path / "a.parquet") == [] == parts_as_format(tmp_path / "a.tdms")
    with pytest.raises(InputError):
        parts_as_format(tmp_path / "a.nothing")


def test_of_a_netcdf_file_of_others_rows_of_numbers_are_read_and_all_else_is_named():
    rows = {
        "time": Variable(("time",), np.arange(3.0), {"units": "seconds since 2020-01-01"}),
        "force": Variable(("time",), np.ones(3), {"units": "N"}),
        "picture": Variable(("time", "x"), np.ones((3, 2)), {}),
        "word": Variable(("time",), np.array(["a", "b", "c"], object), {}),
        "number": Variable((), np.array(1.0), {}),
    }
    table = _foreign_netcdf(NetCDF(rows, {"title": "a", "shape": (1, 2)}))
    assert [(one.label, one.unit, one.clock) for one in table.columns] == [
        ("time", "s", "time"),
        ("force", "N", "time"),
    ]
    said = "{} is left out: it is no row of numbers over one dimension"
    assert list(table.remarks) == [said.format(name) for name in ("picture", "word", "number")]
    assert table.notes == {"attributes": {"title": "a"}}
