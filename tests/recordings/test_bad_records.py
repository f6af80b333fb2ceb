"""A measured record is read as SI, or refused in one line that names the file, the row, the value and what is allowed."""

import gzip
from pathlib import Path

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.recordings import Recording, read_any, read_record, read_recording
from measured_data import FOLDER, measured

N = 12
BAR = 1e5


def rows(change=None) -> list[list[str]]:
    """A filling at 500 Hz: time [s], gauge pressure [bar], command [V]."""
    table = [[f"{0.002 * i:.3f}", f"{4.0 - 3.0 * 0.9**i:.4f}", "5.0"] for i in range(N)]
    if change:
        change(table)
    return table


def text(table: list[list[str]], header: str | None, mark: str = ",") -> str:
    lines = [mark.join(row) for row in table]
    return "\n".join([header, *lines] if header is not None else lines)


GOOD = "time [s],tank.pressure [bar],valve.command [V]"


def write(path: Path, header: str | None = GOOD, change=None, mark: str = ",") -> Path:
    path.write_text(text(rows(change), header, mark) + "\n", encoding="utf-8")
    return path


def refusal(path: Path, **options) -> str:
    with pytest.raises(InputError) as refused:
        read_record(path, **options)
    said = str(refused.value)
    assert "\n" not in said
    assert path.name in said  # the file
    assert str(refused.value.field) in said  # the field
    assert refused.value.problem or refused.value.known or refused.value.sentence  # what is allowed
    return said


def assert_good(found: Recording, pressure: str = "tank.pressure", scale: float = BAR) -> None:
    np.testing.assert_allclose(found.time, 0.002 * np.arange(N), atol=1e-12)
    expected = scale * np.array([float(row[1]) for row in rows()])
    np.testing.assert_allclose(found[pressure], expected, rtol=1e-14)  # one product
    assert found.unit(pressure) == "Pa"
    assert found.channels[pressure].kind == "measured"


def test_the_record_that_the_others_are_bent_from_is_good(tmp_path: Path) -> None:
    found = read_record(write(tmp_path / "good.csv"), required=["tank.pressure"])
    assert_good(found)
    assert found.names("command") == ["valve.command"]
    assert found.unit("valve.command") == "V"
    assert found.meta["title"] == "good.csv"
    assert found.meta["source"]["columns"]["tank.pressure"] == {"column": "tank.pressure [bar]", "unit": "bar"}


@pytest.mark.parametrize(
    ("header", "name", "scale"),
    [
        ("time [s],tank.pressure [bar],valve.command [V]", "tank.pressure", 1e5),
        ("t,Tank.Pressure (kPa),u [V]", "tank.pressure", 1e3),
        ("time_s,pressure_bar_gauge,command_V", "pressure", 1e5),
        ("Time (s),p_abs [bar],u (V)", "p_abs", 1e5),
        ("time,pressure_abs_kPa,u_V", "pressure_abs", 1e3),
        ("time,pressure [bar abs],u_V", "pressure_abs", 1e5),
        ("time,pressure [bar(g)],u_V", "pressure", 1e5),
        ("time,pressure_barg,u_V", "pressure", 1e5),
        ("timestamp,tank pressure [psia],u [V]", "tank_pressure_abs", 6894.757293168361),
        ("time,pressure [N/m^2],u [V]", "pressure", 1.0),
        ("time,tank.pressure [Pa],strain_gauge [V]", "tank.pressure", 1.0),
    ],
)
def test_headers_say_name_unit_and_reference(tmp_path: Path, header: str, name: str, scale: float) -> None:
    found = read_record(write(tmp_path / "head.csv", header))
    assert_good(found, name, scale)
    assert len(found.names()) == 2
    if "strain" in header:
        assert "strain_gauge" in found


@pytest.mark.parametrize(
    ("unit", "si", "value"),
    [
        ("kg/s", "kg/s", 4.0),
        ("g/s", "kg/s", 4e-3),
        ("l/min", "m^3/s", 4e-3 / 60.0),
        ("mV", "V", 4e-3),
        ("degC", "K", 277.15),
        ("°C", "K", 277.15),
        ("K", "K", 4.0),
        ("deg", "rad", np.pi / 45.0),
        ("rpm", "rad/s", 8.0 * np.pi / 60.0),
        ("mm", "m", 4e-3),
        ("mm/s", "m/s", 4e-3),
        ("%", "1", 0.04),
        ("percent", "1", 0.04),
        ("-", "1", 4.0),
        ("1", "1", 4.0),
        ("m^3/(s Pa)", "m^3/(s Pa)", 4.0),
        ("Pa s", "Pa s", 4.0),
        ("kHz", "Hz", 4e3),
        ("kN", "N", 4e3),
        ("ml", "m^3", 4e-6),
        ("bar/s", "Pa/s", 4e5),
    ],
)
def test_every_unit_becomes_si(tmp_path: Path, unit: str, si: str, value: float) -> None:
    def last(table: list[list[str]]) -> None:
        table[-1][1] = "4"

    found = read_record(write(tmp_path / "units.csv", f"time,x [{unit}],u [V]", last))
    assert found.unit("x") == si
    assert found["x"][-1] == pytest.approx(value, rel=1e-12)  # pint's factors, and 300 K of offset


def test_time_may_be_in_milliseconds(tmp_path: Path) -> None:
    def milli(table: list[list[str]]) -> None:
        for row in table:
            row[0] = f"{1e3 * float(row[0]):.0f}"

    assert_good(read_record(write(tmp_path / "ms.csv", "time_ms,tank.pressure [bar],u [V]", milli)))
    bare = write(tmp_path / "ms.csv", "time,tank.pressure [bar],u [V]", milli)
    assert_good(read_record(bare, units={"time": "ms"}))
    assert read_record(bare).duration == 22.0  # without a unit: seconds


@pytest.mark.parametrize("mark", [",", ";", "\t", "  ", ", "])
def test_commas_semicolons_tabs_and_blanks_part_the_cells(tmp_path: Path, mark: str) -> None:
    where = {"time": 1, "tank.pressure": 2}
    path = write(tmp_path / "marks.txt", None, mark=mark)
    assert_good(read_record(path, columns=where, units={"tank.pressure": "bar"}))
    assert_good(read_record(write(path, f"t_s{mark}tank.pressure_bar{mark}u_V", mark=mark)))
    assert_good(read_record(write(path, f"time [s]{mark}tank.pressure (bar){mark}u [V]", mark=mark)))


def test_comments_blank_lines_gzip_byte_marks_and_a_missing_last_newline(tmp_path: Path) -> None:
    body = text(rows(), "# a log\n\n  # of a tank\n" + GOOD)  # no newline at the end
    path = tmp_path / "run.csv.gz"
    path.write_bytes(gzip.compress(b"\xef\xbb\xbf" + body.replace("\n", "\r\n").encode()))
    assert_good(read_record(path))


def test_a_file_without_header_needs_columns_and_units(tmp_path: Path) -> None:
    path = tmp_path / "bare.txt"
    path.write_text(text(rows(), None), encoding="utf-8")
    good = {"columns": {"time": 1, "tank.pressure": 2}, "units": {"tank.pressure": "bar"}}
    found = read_record(path, **good)
    assert_good(found)
    assert found.names() == ["tank.pressure"]  # only what was asked for
    assert "columns are missing" in refusal(path)
    assert "no unit" in refusal(path, columns=good["columns"])
    assert "must be between 1 and 3" in refusal(path, **{**good, "columns": {"time": 1, "tank.pressure": 4}})
    assert "must be between 1 and 3" in refusal(path, **{**good, "columns": {"time": 0, "tank.pressure": 2}})
    assert "no header" in refusal(path, **{**good, "columns": {"time": "t", "tank.pressure": 2}})
    assert "period" in refusal(path, columns={"tank.pressure": 2}, units=good["units"])


def test_columns_are_named_by_header_by_stem_or_by_number(tmp_path: Path) -> None:
    path = write(tmp_path / "names.csv", "clock,P1_bar,label")
    for column in ("P1_bar", "p1", 2):
        assert_good(read_record(path, columns={"time": "clock", "tank.pressure": column}))
    assert "The file has clock, P1_bar, label" in refusal(path, columns={"time": "clock", "tank.pressure": "P2"})
    twice = write(tmp_path / "twice.csv", "t,p_bar,p_kPa")
    assert "two columns" in refusal(twice)
    assert_good(read_record(twice, columns={"tank.pressure": "p_bar"}))
    assert "give a number" in refusal(twice, columns={"tank.pressure": "p"})


def test_a_period_stands_for_a_missing_time(tmp_path: Path) -> None:
    path = write(tmp_path / "clockless.csv", "n,tank.pressure [bar],u [V]")
    chosen = {"columns": {"tank.pressure": "tank.pressure"}}
    assert_good(read_record(path, period=0.002, **chosen))
    assert "time is in no column" in refusal(path, **chosen)
    for period in (0.0, -1.0, float("nan"), float("inf")):
        assert "above 0 s" in refusal(path, period=period, **chosen)
    assert "one of the two" in refusal(write(tmp_path / "both.csv"), period=0.002)


def test_the_zero_of_a_sensor_is_taken_off_gauge_pressures_only(tmp_path: Path) -> None:
    path = write(tmp_path / "zero.csv", "time,tank.pressure [bar],tank.pressure_abs [Pa]")
    found = read_record(path, pressure_zero=2000.0)
    assert found["tank.pressure"][0] == pytest.approx(98000.0, rel=1e-14)
    assert found["tank.pressure_abs"][0] == 5.0
    assert read_record(path, pressure_zero={"tank.pressure": 2000.0}) == found.with_meta(
        source={**found.meta["source"], "pressure_zero": {"tank.pressure": 2000.0}}
    )
    assert "tank.presure" in refusal(path, pressure_zero={"tank.presure": 2000.0})
    assert "finite" in refusal(path, pressure_zero=float("nan"))


def set_cell(row: int, column: int, cell: str):
    def change(table: list[list[str]]) -> None:
        table[row][column] = cell

    return change


@pytest.mark.parametrize("cell", ["0.008", "0.007", "-1"])
def test_a_time_that_repeats_or_goes_back_is_named_with_its_row(tmp_path: Path, cell: str) -> None:
    said = refusal(write(tmp_path / "back.csv", change=set_cell(5, 0, cell)))
    assert "time [s], row 7" in said  # the header is row 1
    assert f"{float(cell)} s after 0.008 s" in said


def test_lost_samples_are_a_gap(tmp_path: Path) -> None:
    def lose(count: int):
        def change(table: list[list[str]]) -> None:
            del table[4 : 4 + count]

        return change

    said = refusal(write(tmp_path / "gap.csv", change=lose(3)))  # 8 ms instead of 2 ms
    assert "got 0.008 s at 0.014 s" in said
    assert "0.006 s" in said  # what is allowed


def stamped(tmp_path: Path, intervals: list[float]) -> Path:
    """A record whose first rows have these intervals [ms] and whose others follow every 2 ms."""

    def change(table: list[list[str]]) -> None:
        steps = [*intervals, *[2.0] * len(table)]
        for i, row in enumerate(table):
            row[0] = f"{1e-3 * sum(steps[:i]):.4f}"

    return write(tmp_path / "stamped.csv", change=change)


@pytest.mark.parametrize("intervals", [[2.0 * 1.6**k for k in range(20)], [32, 16, 8, 4], [6, 18, 54, 18, 6]])
def test_intervals_that_grow_and_shrink_by_no_more_than_a_gap_are_none(tmp_path: Path, intervals) -> None:
    assert len(read_record(stamped(tmp_path, intervals))) == N


@pytest.mark.parametrize("intervals", [[2, 2, 8], [2, 8, 8], [8], [2, 2, 40, 4]])
def test_a_gap_stays_one_beside_another(tmp_path: Path, intervals) -> None:
    assert f"got {max(intervals) * 1e-3:g} s" in refusal(stamped(tmp_path, intervals))


# Cases in which three times the median falls short of the gap in binary; seconds since 1970 resolve 2e-7 s only.
@pytest.mark.parametrize(("epoch", "milliseconds"), [(0, 3), (0, 7), (1_700_000_000, 1), (1_700_000_000, 4)])
@pytest.mark.parametrize("at", [1, 2, 3])
def test_three_intervals_are_no_gap_whatever_the_last_binary_digit(
    tmp_path: Path, epoch: int, milliseconds: int, at: int
) -> None:
    def lose(table: list[list[str]]) -> None:
        for i, row in enumerate(table):
            row[0] = f"{epoch + i * milliseconds * 1e-3:.3f}"
        del table[at : at + 2]

    assert len(read_record(write(tmp_path / "close.csv", change=lose))) == N - 2


def test_stamps_rounded_to_milliseconds_pass(tmp_path: Path) -> None:
    stamps = ["0.001", "0.004", "0.005", "0.007", "0.009", "0.012", "0.013", "0.015", "0.017", "0.02", "0.021", "0.023"]

    def rounded(table: list[list[str]]) -> None:
        for row, stamp in zip(table, stamps, strict=True):
            row[0] = stamp

    assert read_record(write(tmp_path / "rounded.csv", change=rounded)).period == pytest.approx(0.002, rel=1e-9)


@pytest.mark.parametrize(
    ("header", "cell", "said"),
    [
        (GOOD, "-1.02", "below vacuum"),
        ("t,p [kPa],u [V]", "-101.4", "below vacuum"),
        ("t,p_abs [bar],u [V]", "-0.001", "below vacuum"),
        ("t,p [MPa],u [V]", "-0.2", "-1.013 bar gauge"),
        (GOOD, "-1.013", None),
        ("t,p_abs [bar],u [V]", "0", None),
        ("t,force [N],u [V]", "-900", None),  # no pressure, no vacuum
    ],
)
def test_a_pressure_below_vacuum_is_named_with_its_row(
    tmp_path: Path, header: str, cell: str, said: str | None
) -> None:
    path = write(tmp_path / "vacuum.csv", header, set_cell(3, 1, cell))
    if said is None:
        assert len(read_record(path)) == N
        return
    found = refusal(path)
    assert said in found
    assert "row 5" in found


def test_vacuum_lies_where_the_environment_says(tmp_path: Path) -> None:
    path = write(tmp_path / "mountain.csv", change=set_cell(3, 1, "-0.9"))
    assert len(read_record(path)) == N
    assert "below vacuum" in refusal(path, ambient=8e4)
    assert "ambient" in refusal(path, ambient=0.0)
    assert "ambient" in refusal(path, ambient=float("nan"))


@pytest.mark.parametrize(("column", "name"), [(0, "time [s]"), (1, "tank.pressure [bar]"), (2, "valve.command [V]")])
@pytest.mark.parametrize("cell", ["oops", "1e", "0.1.2", '"1,5"'])
def test_a_cell_that_is_no_finite_number_is_named_with_its_row(
    tmp_path: Path, column: int, name: str, cell: str
) -> None:
    said = refusal(write(tmp_path / "holes.csv", change=set_cell(6, column, cell)))
    assert f"{name}, row 8" in said
    assert repr(cell.strip('"')) in said


def commas(table: list[list[str]]) -> None:
    for row in table:
        row[:] = [cell.replace(".", ",") for cell in row]


def test_decimal_commas_are_read_where_no_comma_parts_the_cells(tmp_path: Path) -> None:
    with_points = read_record(write(tmp_path / "point.csv"))
    for mark in (";", "\t"):
        found = read_record(write(tmp_path / "comma.csv", GOOD.replace(",", mark), commas, mark=mark))
        assert found.time.tolist() == with_points.time.tolist()
        assert all(found[name].tolist() == with_points[name].tolist() for name in with_points.channels)


def test_points_and_commas_in_one_column_are_refused(tmp_path: Path) -> None:
    def one(table: list[list[str]]) -> None:
        table[4][1] = table[4][1].replace(".", ",")

    said = refusal(write(tmp_path / "both.csv", GOOD.replace(",", ";"), one, mark=";"))
    assert "row 6" in said and "is read with one decimal mark" in said


@pytest.mark.parametrize(("holes", "says"), [((4,), "row 6 is left out"), ((4, 9), "2 rows are left out, 6, 11")])
def test_rows_with_a_blank_cell_are_left_out_and_named(tmp_path: Path, holes: tuple[int, ...], says: str) -> None:
    def blank(table: list[list[str]]) -> None:
        for at in holes:
            table[at][1] = " "

    whole, found = read_record(write(tmp_path / "whole.csv")), read_any(write(tmp_path / "holes.csv", change=blank))
    assert found.recording.time.tolist() == np.delete(whole.time, holes).tolist()
    assert found.remarks == [f"{says}: tank.pressure [bar] is blank"]
    assert found.recording.meta["source"]["left_out"] == found.remarks


def test_a_column_that_is_mostly_blank_is_refused(tmp_path: Path) -> None:
    def blank(table: list[list[str]]) -> None:
        for row in table[1:]:
            row[1] = ""

    assert "tank.pressure [bar] is blank in" in refusal(write(tmp_path / "empty.csv", change=blank))


@pytest.mark.parametrize(("cells", "found"), [(2, "2 cells"), (4, "4 cells")])
def test_ragged_rows_are_named(tmp_path: Path, cells: int, found: str) -> None:
    def bend(table: list[list[str]]) -> None:
        table[5] = [*table[5], "7"][:cells]

    said = refusal(write(tmp_path / "ragged.csv", change=bend))
    assert f"row 7 has {found}, and the header has 3 columns" in said
    bare = write(tmp_path / "ragged.txt", None, bend)
    assert f"row 6 has {found}" in refusal(bare, columns={"time": 1, "p": 2}, units={"p": "bar"})


@pytest.mark.parametrize("unit", ["knopf", "Psi", "kg_f", "12 **", "m mm)", "$"])
def test_an_unknown_unit_is_refused(tmp_path: Path, unit: str) -> None:
    said = refusal(write(tmp_path / "unit.csv"), units={"tank.pressure": unit})
    assert unit in said
    assert "such as kPa" in said


def test_an_overload_is_no_reading_but_a_time_is_finite(tmp_path: Path) -> None:
    for word in ("inf", "-Inf", "OL", "∞", "Overload"):
        read = read_any(write(tmp_path / "over.csv", change=set_cell(6, 1, word)))
        assert len(read.recording) == N - 1
        assert "row 8 is left out: tank.pressure [bar] has no reading, but an overload" in read.remarks
        assert "time [s], row 8" in refusal(write(tmp_path / "time.csv", change=set_cell(6, 0, word)))


def test_a_column_whose_unit_is_not_known_and_that_nobody_asks_for_is_left_out_and_said(tmp_path: Path) -> None:
    path = write(tmp_path / "bare.csv", "t,velocity_m_s,u [V]")
    read = read_any(path)
    assert read.recording.names() == ["u"]
    assert read.remarks[0].startswith("velocity_m_s is left out: no unit is stated")
    assert "has no unit" in refusal(path, required=["velocity_m_s"])


@pytest.mark.parametrize("header", ["t,tank.pressure,u [V]", "t,tank.pressure [],u [V]", "t,velocity_m_s,u"])
def test_a_column_without_a_unit_is_refused(tmp_path: Path, header: str) -> None:
    said = refusal(write(tmp_path / "bare.csv", header))
    assert "has no unit" in said
    assert "or state it" in said  # the way out


def test_a_time_in_bar_is_refused(tmp_path: Path) -> None:
    assert "such as s or ms" in refusal(write(tmp_path / "t.csv", "time [bar],p [bar],u [V]"))
    assert "such as s or ms" in refusal(write(tmp_path / "t.csv"), units={"time": "m"})


def test_a_missing_required_channel_is_named(tmp_path: Path) -> None:
    said = refusal(write(tmp_path / "few.csv"), required=["tank.pressure", "supply.pressure"])
    assert "supply.pressure is missing" in said
    assert "tank.pressure, valve.command" in said  # what the file has
    assert "supply is" in refusal(write(tmp_path / "few.csv"), required="supply")


def test_units_for_channels_that_are_not_there_are_refused(tmp_path: Path) -> None:
    assert "tank.presure" in refusal(write(tmp_path / "typo.csv"), units={"tank.presure": "kPa"})


@pytest.mark.parametrize(
    ("header", "name"),
    [("t,p [bar abs],u [V]", "tank.pressure"), ("t,p [barg],u [V]", "tank.pressure_abs")],
)
def test_absolute_and_gauge_are_not_mixed_up(tmp_path: Path, header: str, name: str) -> None:
    assert "end in _abs" in refusal(write(tmp_path / "ref.csv", header), columns={name: 2})


def test_names_that_no_channel_may_have_are_refused(tmp_path: Path) -> None:
    said = refusal(write(tmp_path / "name.csv"), columns={"tank/pressure": 2})
    assert "tank/pressure" in said
    assert "dot" not in said.split("allowed")[0]


def first(count: int):
    def change(table: list[list[str]]) -> None:
        del table[count:]

    return change


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("", "empty"),
        ("\n\n# nothing\n", "empty"),
        (GOOD + "\n", "3 samples or more, got 0"),
        (text(rows(first(2)), GOOD), "must have 3 samples or more, got 2"),
        (text([[row[0], "4.0", "5.0"] for row in rows()], GOOD), "no channel changes"),
        ("time [s]\n" + "\n".join(row[0] for row in rows()), "must be at least one column beside the time"),
        ("time,2,3\n" + text(rows(), None), "a row of names"),
        (
            "0.0,n/a,5\n" + text(rows(), None),
            "row 1 must be a row of names, or one of numbers",
        ),
    ],
)
def test_a_file_in_which_nothing_happens_is_refused(tmp_path: Path, content: str, expected: str) -> None:
    path = tmp_path / "nothing.csv"
    path.write_text(content, encoding="utf-8")
    assert expected in refusal(path)


def test_a_dead_sensor_beside_a_live_command_is_refused(tmp_path: Path) -> None:
    def dead(table: list[list[str]]) -> None:
        for i, row in enumerate(table):
            row[1:] = ["4.0", f"{i}"]

    assert "tank.pressure is 4 bar throughout" in refusal(write(tmp_path / "dead.csv", change=dead))


def test_files_that_are_no_text_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "picture.csv"
    path.write_bytes(bytes(range(256)) * 4)
    assert "unreadable" in refusal(path)
    half = tmp_path / "half.csv.gz"
    half.write_bytes(gzip.compress(text(rows(), GOOD).encode())[:60])
    assert "unreadable" in refusal(half)
    assert "not found" in refusal(tmp_path / "nowhere.csv")
    assert "it is a folder" in refusal(tmp_path)


def test_a_record_of_others_survives_our_files(tmp_path: Path) -> None:
    found = read_record(write(tmp_path / "good.csv"), pressure_zero=1.0)
    for suffix in (".nc", ".csv"):
        assert read_recording(found.save(tmp_path / f"ours{suffix}")) == found


@measured("gtdynamics_jumping_robot")
def test_the_tanks_of_a_jumping_robot_are_read() -> None:
    # Headerless; time rounded to ms at 500 Hz, then kPa gauge. The first tank's supply is stated as 80 psi, the others' 65.
    files = sorted((FOLDER / "gtdynamics_jumping_robot").glob("*/pres_filt.txt"))
    assert files
    for file in files:
        found = read_record(
            file, columns={"time": 1, "tank.pressure": 2}, units={"tank.pressure": "kPa"}, required=["tank.pressure"]
        )
        assert len(found) == 500
        assert found.period == pytest.approx(0.002, rel=1e-9)
        supply = float(file.parent.name.removesuffix("psi").split("_")[-1]) * 6894.757
        # The sensor begins at the regulated supply, which its gauge shows to within a few psi.
        assert found["tank.pressure"][0] == pytest.approx(supply, rel=0.06)
        assert found.uniform(1e-3).period == pytest.approx(1e-3, rel=1e-9)
