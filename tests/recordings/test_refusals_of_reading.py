"""What maps, calibrations, scales and readers refuse is one sentence about what was stated; what is next to it is taken."""

import gzip
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import mckibben as mk
from mckibben.errors import InputError
from mckibben.formats import columns as columns_of_tables
from mckibben.formats.table import ForeignColumn, ForeignTable, parse_scale
from mckibben.formats.text import MARKS, _decimal_mark, _mark, row_list
from mckibben.recordings import Channel, ForceMap, Recording, read_recording
from mckibben.recordings.calibration import (
    CorrectionTerm,
    Origin,
    indicated,
    saturated,
)
from mckibben.recordings.files import naming_file, read_any, read_points, understand
from mckibben.recordings.force_map import (
    choose_map_columns,
    even_table,
    map_of_table,
    preview_table,
    stated_unit,
)

MAP = "length [mm],pressure [bar],force [N],branch\n120,1,5,up\n130,1,9.5,down\n"
RECORD = "time [s],pressure [bar],force [N]\n0,1,5\n0.1,2,6\n0.2,3,7\n"


def refused(act, says):
    with pytest.raises(InputError) as error:
        act()
    assert says in str(error.value) and "\n" not in str(error.value)


@pytest.fixture
def files(tmp_path):
    (tmp_path / "map.csv").write_text(MAP)
    (tmp_path / "record.csv").write_text(RECORD)
    Recording([0.0, 0.1], {"force": Channel([1.0, 2.0], "N")}).save(tmp_path / "own.csv")
    return tmp_path


def test_a_map_has_one_number_per_point(files):
    for columns, says in (
        ({"pressure": [1e5]}, "pressure must be one number per point, (2,), got an array (1,)"),
        ({"length": [[0.1], [0.2]]}, "length must be one number per point"),
        ({"tension": ["5", "6"]}, "tension must be numbers in N"),
        ({"diameter": [True, False]}, "diameter must be numbers in m"),
        ({"branch": ["up"]}, "branch must be one number per point"),
    ):
        with pytest.raises(InputError) as error:
            ForceMap("m", **({"length": [0.1, 0.2], "pressure": [1, 2], "tension": [1.0, 2.0]} | columns))
        assert says in str(error.value)
    assert ForceMap("m", [1, 2], [1, 2], [0, 1], branch=["up", "down"]).largest == 1.0  # whole numbers are numbers


def test_a_slack_point_says_something_where_a_point_of_its_rest_length_pulls_at_no_higher_pressure():
    pressure, tension = [1e5, 2e5, 3e5, 1e5, 2e5, 3e5], [0.0, 5.0, 0.0, 0.0, 0.0, 0.0]
    two = ForceMap("m", [0.1] * 6, pressure, tension, rest_length=[0.1, 0.1, 0.1, 0.2, 0.2, 0.2])
    assert two.informative_slack.tolist() == [False, False, True, False, False, False]
    one = ForceMap("m", [0.1] * 6, pressure, tension)
    assert one.informative_slack.tolist() == [False, False, True, False, True, True]


def test_a_contraction_is_that_of_the_rest_length_which_has_to_be_known():
    points = ForceMap("m", [0.1, 0.2], [1e5, 1e5], [1.0, 2.0])
    refused(lambda: points.contraction, "rest_length is missing: give the rest length, or a column rest_length")
    np.testing.assert_allclose(points.with_rest_length(0.2).contraction, [0.5, 0.0])


HEADER = ["a [mm]", "pressure [bar]", "force [N]", "b [mm]", "b [cm]"]


def test_a_column_is_named_by_its_label_with_or_without_its_unit_or_by_its_number():
    for column in (1, "a", "a [mm]"):
        assert choose_map_columns(HEADER, {"length": column}, "f")["length"] == "a [mm]"
    assert choose_map_columns(HEADER, {"length": 5}, "f")["length"] == "b [cm]"
    for column, says in (
        (0, "column length must be between 1 and 5"),
        (6, "must be between 1 and 5"),
        ("b", "Unknown column 'b'"),
        ("c", "Unknown column 'c'"),
        ("-", "length is missing: the file has a [mm]"),
    ):
        refused(lambda column=column: choose_map_columns(HEADER, {"length": column}, "f"), says)
    refused(lambda: choose_map_columns(HEADER, {"lenght": 1}, "f"), "Did you mean 'length'")
    refused(lambda: choose_map_columns(["length", "1 bar", "2 bar"], {}, "f"), "the columns 1 bar to 2 bar seem to be")
    both = ["length [mm]", "contraction [%]", "pressure [bar]", "force [N]"]
    assert "contraction" not in choose_map_columns(both, {}, "f")  # the length is what was measured
    refused(
        lambda: choose_map_columns(["force [N]", "length [mm]"], {}, "f"), "pressure is missing: the file has force"
    )


def table(*columns, **more):
    columns = [ForeignColumn(label, np.asarray(values)) for label, values in columns]
    return ForeignTable(columns, {}, [], **({"named": True} | more))


def test_a_table_without_numbers_rows_or_names_is_no_map_and_an_infinity_is_no_number():
    refused(lambda: even_table(ForeignTable([], {}, []), "f"), "columns must be at least one column of numbers")
    sound = (("length [m]", [0.1, 0.2]), ("pressure [Pa]", [1e5, 1e5]), ("force [N]", [1.0, 2.0]))
    assert len(map_of_table(Path("f"), table(*sound))) == 2
    refused(lambda: map_of_table(Path("f"), ForeignTable([], {}, [])), "a header and at least one row, got 0 rows")
    refused(lambda: map_of_table(Path("f"), table(*((n, []) for n, _ in sound))), "at least one row, got 0 rows")
    refused(lambda: map_of_table(Path("f"), table(*sound, named=False)), "the first row must name the columns")
    refused(lambda: map_of_table(Path("f"), table(*sound), units={"forse": "N"}), "Unknown unit of 'forse'")
    endless = (*sound[:2], ("force [N]", [1.0, math.inf]))
    refused(lambda: map_of_table(Path("f"), table(*endless)), "force [N], sample 2 must be a finite number")


def test_a_preview_shows_what_stands_in_the_first_rows_and_what_each_column_means(files):
    seen = preview_table(files / "map.csv", rows=1)
    assert (seen.header[0], seen.total, len(seen.rows)) == ("length [mm]", 2, 1)
    assert seen.rows[0] == ["120", "1", "5", "up"] and seen.meant["tension"] == "force [N]"
    assert [stated_unit(label, "pressure") for label in ("p [bar abs]", "p [bar]")] == ["bar abs", "bar"]
    assert stated_unit("p", "pressure") == stated_unit("x [bar]", "nothing") == ""


def test_only_what_a_map_or_a_recording_takes_is_stated_with_it(files):
    assert isinstance(understand(files / "map.csv").data, ForceMap)
    assert isinstance(understand(files / "record.csv").data, Recording)
    up = mk.read(files / "map.csv", branch="up")
    assert up.tension.tolist() == [5.0]
    for path, options, says in (
        (3, {}, "file must be a name or the path of a file, got 3"),
        ("map.csv", {"kind": "maps"}, "Unknown kind 'maps'. Did you mean 'map'"),
        ("map.csv", {"branch": "left"}, "the file has down, up"),
        ("record.csv", {"ambient": "0.29 bar"}, "ambient must be the absolute pressure of the room, from"),
        ("record.csv", {"ambient": "2 bar"}, "ambient must be the absolute pressure of the room, from"),
        ("record.csv", {"kind": "recording", "pressure": "1 bar"}, "pressure is for a force map"),
        ("record.csv", {"kind": "recording", "length_zero": "1 m"}, "length_zero is for a force map"),
        ("map.csv", {"scales": {"force": "2 N/V"}}, "is for the channels of a recording, and this is a map"),
        ("own.csv", {"columns": {"force": 1}}, "a recording of mckibben says these itself"),
        ("own.csv", {"period": "1 s"}, "a recording of mckibben says these itself"),
        ("record.csv", {"scales": {"time": "2 s/V"}, "kind": "recording"}, "The columns are pressure, force"),
        ("record.csv", {"scales": {"forse": "2 N/V"}, "kind": "recording"}, "Did you mean 'force'"),
        ("record.csv", {"units": {"forse": "N"}, "kind": "recording"}, "Did you mean 'force'"),
        ("record.csv", {"decimal": ";"}, "Unknown decimal ';'"),
    ):
        place = path if path == 3 else files / path
        refused(lambda place=place, options=options: understand(place, **options), says)


def test_a_pressure_that_is_stated_as_absolute_is_named_so_once(files):
    once = understand(files / "record.csv", units={"pressure": "bar abs"}).data
    assert "pressure_abs" in once and "pressure" not in once
    assert once["pressure_abs"].tolist() == pytest.approx([1e5, 2e5, 3e5])


def test_a_recording_is_read_from_a_recording_and_its_file_is_named_where_there_is_one(files):
    own = read_recording(files / "own.csv")
    assert read_recording(own) is own and read_any(own).recording is own and read_any(own).remarks == []
    refused(lambda: read_recording(files / "own.xyz"), "File not found")
    (files / "own.xyz").touch()
    refused(lambda: read_recording(files / "own.xyz"), "Unknown suffix '.xyz'")
    (files / "lever.ddf").write_text("DMC")
    refused(lambda: read_recording(files / "lever.ddf"), "a file .ddf is converted into a recording of mckibben first")
    refused(lambda: read_recording(files / "record.csv"), "this is no recording of mckibben")
    for source, place in ((own, ""), (files / "own.csv", f"{files / 'own.csv'}: ")):
        with pytest.raises(InputError) as error, naming_file(source):
            raise InputError("a", 1, "must be 2")
        assert str(error.value) == f"{place}a must be 2, got 1"


def test_the_points_of_a_signal_are_one_column_in_its_unit(files):
    words = {"field": "s", "where": "p.toml"}
    path = files / "record.csv"
    time, values = read_points(path, None, "force", "N", **words)
    assert time.tolist() == [0.0, 0.1, 0.2] and values.tolist() == [5.0, 6.0, 7.0]
    assert read_points(path, "time", "pressure", "Pa", **words)[1].tolist() == pytest.approx([1e5, 2e5, 3e5])
    (files / "one.csv").write_text("time [s],a [N]\n0,1\n1,2\n2,4\n")
    assert read_points(files / "one.csv", None, None, "N", **words)[1].tolist() == [1.0, 2.0, 4.0]
    for time, column, unit, says in (
        ("time", None, "N", "s.column must name a column of the header, as time does"),
        (None, None, "N", "s.column is missing: the table has pressure, force; name one"),
        (None, "force", "Pa", "the signal is in Pa, gauge"),
        (None, "force", "m", "the signal is in m"),
    ):
        refused(lambda of=(time, column, unit): read_points(path, *of, **words), says)
    (files / "abs.csv").write_text("time [s],p [bar abs]\n0,1\n1,2\n2,3\n")
    refused(lambda: read_points(files / "abs.csv", None, None, "Pa", **words), "the signal is in Pa, gauge")


@pytest.mark.parametrize(
    ("text", "scale"),
    [
        ("2 bar/V", (2e5, 0.0, "Pa", "V")),
        ("0.5 N/mV - 3 N", (0.5, -3.0, "N", "mV")),
        ("-1e3 Pa/V+2 bar", (-1e3, 2e5, "Pa", "V")),
        ("4.9 mbar/count", (490.0, 0.0, "Pa", "1")),
        ("4.9 mbar/LSB", (490.0, 0.0, "Pa", "1")),
        ("2 N", (2.0, 0.0, "N", "1")),
        ("2 mm/V - 1.5", (2e-3, -1.5e-3, "m", "V")),
    ],
)
def test_a_scale_is_a_quantity_per_raw_unit_with_or_without_an_offset(text, scale):
    found = parse_scale(text, field="scale")
    assert (found.unit, found.raw) == scale[2:] and (found.gain, found.offset) == pytest.approx(scale[:2], rel=1e-12)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("much", "must be a quantity per raw unit"),
        ("2 bar/V - 3 N", "must have an offset in a unit such as bar"),
        ("2 bar/V - 3.1.2 bar", "must have an offset in a unit such as bar"),
        ("2 hops/V", "hops"),
    ],
)
def test_a_scale_that_cannot_be_says_what_would_do(text, says):
    refused(lambda: parse_scale(text, field="scale"), says)


def test_rows_of_text_are_numbered_as_in_the_file_packed_or_not(tmp_path):
    text = "# a comment\n\na,b\n1,2\n\n3,4\n"
    (tmp_path / "a.csv").write_text(text)
    with gzip.open(tmp_path / "a.csv.gz", "wt") as stream:
        stream.write(text)
    for name in ("a.csv", "a.csv.gz"):
        assert row_list(tmp_path / name, name) == [[3, ["a", "b"]], [4, ["1", "2"]], [6, ["3", "4"]]]
    refused(lambda: row_list(tmp_path / "none.csv", "none.csv"), "File not found: none.csv")
    (tmp_path / "b.csv").write_bytes(b"a,b\n\0\x01\x02\n")
    refused(lambda: row_list(tmp_path / "b.csv", "b.csv"), "unreadable as a CSV text file: it holds binary data")


TERM = CorrectionTerm(value=1.02)
CONVERTER = {"low": -10.0, "high": 10.0, "bits": 8}


def test_a_term_expires_after_its_validity_and_one_without_an_end_never():
    for valid, expires in ((86400.0, "2026-01-02"), (math.inf, None), (1e12, None)):  # and none beyond the year 9999
        origin = Origin(method="weights", date="2026-01-01T00:00:00+00:00", valid_for=valid)
        assert (origin.expires and origin.expires.strftime("%Y-%m-%d")) == expires


def converted(values, meta, unit="N"):
    values = np.asarray(values, float)
    return Recording(np.arange(len(values)) * 0.1, {"a": Channel(values, unit)}, meta)


def test_what_a_converter_gave_is_known_by_its_counts_and_its_ends():
    step = 20.0 / 255.0
    record = converted(-10.0 + step * np.array([0, 1, 100, 255]), {"converters": {"a": CONVERTER}})
    seen = indicated(record, "a")
    assert seen.counts.tolist() == [0, 1, 100, 255] and (seen.low_end, seen.last, seen.base) == (True, 255, 0)
    assert saturated(record, "a").tolist() == [True, False, False, True]
    above = converted(step * np.array([0, 1, 255]), {"converters": {"a": CONVERTER | {"low": 0.0, "high": 20.0}}})
    assert saturated(above, "a").tolist() == [False, False, True]  # a range that begins at zero has no lower end
    between = converted([0.0, 0.51 * step], {"converters": {"a": CONVERTER}})  # no value of that converter
    assert indicated(between, "a").counts is None and not saturated(between, "a").any()
    for meta in (
        {},
        {"converters": {"b": CONVERTER}},
        {"converters": [1]},
        {"encoder": {"mounted": 1, "resolution": 1}},
    ):
        free = converted([1.0, 2.0], meta)
        assert indicated(free, "a").counts is None and saturated(free, "a").tolist() == [False, False]


@pytest.mark.parametrize(
    ("one", "says"),
    [
        (CONVERTER | {"bits": 0.5}, "must be a rising range"),
        (CONVERTER | {"bits": 65}, "must be a rising range"),
        (CONVERTER | {"low": 10.0}, "must be a rising range"),
        (CONVERTER | {"high": "x"}, "converters.a.high must be a number"),
        (CONVERTER | {"low": True}, "converters.a.low must be a number"),
        ({"low": 1.0}, "converters.a.high must be a number"),
        (CONVERTER | {"bits": math.nan}, "converters.a.bits must be a number"),
        ("x", "converters.a.low must be a number"),
    ],
)
def test_a_converter_that_cannot_be_is_refused_by_its_number(one, says):
    refused(lambda: indicated(converted([1.0, 2.0], {"converters": {"a": one}}), "a"), says)
    for bits in (1, 64):
        indicated(converted([1.0, 2.0], {"converters": {"a": CONVERTER | {"bits": bits}}}), "a")


def test_the_travel_of_an_encoder_counts_from_the_span_at_which_it_was_zeroed_last():
    values = [0.1, 0.101, 0.202, 0.203]
    for mounted, counts in (
        (0.1, [0, 1, 102, 103]),
        ([[0.0, 0.1], [0.2, 0.2]], [0, 1, 2, 3]),
        ([0.05, 0.1], [0, 1, 102, 103]),
    ):
        meta = {"encoder": {"mounted": mounted, "resolution": 1e-3}}
        assert indicated(converted(values, meta, "m"), "a").counts.tolist() == counts
    for mounted in ("x", None, [1.0, 2.0, 3.0]):
        meta = {"encoder": {"mounted": mounted, "resolution": 1e-3}}
        refused(lambda meta=meta: indicated(converted(values, meta, "m"), "a"), "encoder.mounted must be a span [m]")


WHOLE = st.integers(-99, 99).map(str)
WORDS = st.sampled_from(["", "a.b", "x,y", "n.a.", "-", "1.2.3", "on"])  # with marks, and no numbers


def decimals(mark):
    """Numbers that only this decimal mark fits: not with three places, which might be thousands."""
    parts = st.tuples(st.integers(0, 999), st.sampled_from(["5", "25", "2505", "000001"]))
    return parts.map(lambda part: f"{part[0]}{mark}{part[1]}")


@given(st.sampled_from(".,"), st.data())
def test_the_decimal_mark_is_that_of_the_numbers_which_one_mark_alone_fits_and_others_decide_nothing(mark, data):
    other = "," if mark == "." else "."
    alone, both = decimals(mark), st.just(f"1{mark}234")
    plain = data.draw(st.lists(WHOLE | WORDS, max_size=5))
    certain = data.draw(st.lists(alone, min_size=1, max_size=3))
    cells = data.draw(st.permutations([*plain, *certain, data.draw(both), f"1{other}234{mark}5"]))

    def found(cells):
        return _decimal_mark([(["7"] * len(cells), "a [m]"), (cells, "b [N]")], range(len(cells)), "f")

    assert found(cells) == mark and found(plain) == "."
    with pytest.raises(InputError, match="if it parts thousands; all numbers of the file fit both"):
        found([*plain, f"1{mark}234"])
    with pytest.raises(InputError, match="a file is read with one decimal mark"):
        found([*cells, data.draw(decimals(other))])


@pytest.mark.parametrize(
    ("samples", "changes", "events"),
    [(6, 3, 3), (6, 4, 0), (20, 10, 10), (20, 11, 0), (4000, 1000, 1000), (4000, 1001, 0)],
)
def test_words_that_change_at_most_every_other_sample_are_events_and_others_are_none(samples, changes, events):
    cells = np.array([f"w{min(i, changes - 1)}" for i in range(samples)], object)
    found = columns_of_tables._events({"state": cells, "of another clock": cells[1:]}, np.arange(samples) * 0.5)
    assert len(found) == events
    assert found[:2] == [{"time": 0.5 * i, "text": f"w{i}", "column": "state"} for i in range(2)][: len(found)]


def test_a_blank_cell_is_no_event_and_one_that_comes_back_is_one_again():
    cells = np.array(["", "on", "on", "", "on", ""], object)
    found = columns_of_tables._events({"b": cells, "a": np.array(["x"] * 6, object)}, np.arange(6.0))
    assert [(one["time"], one["text"]) for one in found] == [(0.0, "x"), (1.0, "on"), (4.0, "on")]


@given(st.sampled_from(MARKS), st.integers(1, 5), st.integers(2, 4))
def test_cells_are_parted_by_what_parts_all_lines_alike_be_it_one_line_of_two_cells(mark, lines, cells):
    assert _mark([(mark or "  ").join(["12"] * cells)] * lines) == mark
    assert _mark(["12"] * lines) is None
