"""A force map that is wrong is refused in one line that names the file, the field, the value and what is allowed."""

import gzip
import re
from pathlib import Path

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.recordings import read_force_map
from mckibben.specimens import map_file, specimen

LENGTHS = (0.26, 0.27, 0.28, 0.29, 0.30)
PRESSURES = (1e5, 3e5, 5e5)


def rows(change=None) -> list[list[str]]:
    """A plausible muscle of 30 cm, one row per length (mm), pressure (bar) and tension (N)."""
    table = [[f"{L * 1e3:.1f}", f"{P / 1e5:.2f}", f"{4.7e-3 * P * (L - 0.22):.3f}"] for L in LENGTHS for P in PRESSURES]
    if change:
        for row in table:
            change(row)
    return table


def write(path: Path, header: str, table: list[list[str]]) -> Path:
    path.write_text("\n".join([header, *(",".join(row) for row in table)]) + "\n", encoding="utf-8")
    return path


GOOD = "length_mm,pressure_bar_gauge,force_N"


def refusal(path: Path, **options) -> str:
    with pytest.raises(InputError) as refused:
        read_force_map(path, **options)
    said = str(refused.value)
    assert "\n" not in said
    assert path.name in said  # the file
    assert str(refused.value.field) in said  # the field
    assert refused.value.problem or refused.value.known or refused.value.sentence  # what is allowed
    return said


def test_the_table_that_the_others_are_bent_from_is_good(tmp_path: Path) -> None:
    found = read_force_map(write(tmp_path / "good.csv", GOOD, rows()))
    assert len(found) == 15
    assert found.length.min() == pytest.approx(0.26)
    assert found.pressure.max() == pytest.approx(5e5)
    assert found.largest == pytest.approx(4.7e-3 * 5e5 * 0.08, abs=1e-3)


@pytest.mark.parametrize(
    ("header", "named"),
    [
        ("span_mm,pressure_bar_gauge,force_N", "length"),
        ("length_mm,supply_bar,force_N", "pressure"),
        ("length_mm,pressure_bar_gauge,current_A", "tension"),
    ],
)
def test_a_missing_column_is_named(tmp_path: Path, header: str, named: str) -> None:
    said = refusal(write(tmp_path / "map.csv", header, rows()))
    assert f"{named} is missing" in said
    assert header.split(",")[0] in said  # what The file has instead


@pytest.mark.parametrize(
    "header",
    [
        "pressure_bar_gauge,length_mm,force_N",  # 260 bar
        "length_mm,force_N,pressure_bar_gauge",  # 188 bar
    ],
)
def test_swapped_columns_are_refused(tmp_path: Path, header: str) -> None:
    said = refusal(write(tmp_path / "swapped.csv", header, rows()))
    assert "swapped" in said


def test_a_tension_that_falls_with_pressure_is_refused(tmp_path: Path) -> None:
    # The sign of the force turned: pushing counted as positive.
    top = 4.7e-3 * 5e5 * 0.08

    def turn(row: list[str]) -> None:
        row[2] = f"{top - float(row[2]):.3f}"

    said = refusal(write(tmp_path / "turned.csv", GOOD, rows(turn)))
    assert "falls" in said
    assert "sign" in said


def test_a_tension_that_is_not_monotonic_in_length_is_refused(tmp_path: Path) -> None:
    def dip(row: list[str]) -> None:
        if row[0] == "290.0":
            row[2] = "1.0"

    said = refusal(write(tmp_path / "dip.csv", GOOD, rows(dip)))
    assert "falls by" in said
    assert "29 cm" in said  # where


def test_hysteresis_and_noise_are_not_mistaken_for_a_wrong_sign(tmp_path: Path) -> None:
    # Loops of measured muscles are within 6 % of the largest tension.
    noise = iter(np.random.default_rng(5).uniform(-0.03, 0.03, 15) * 4.7e-3 * 5e5 * 0.08)

    def shake(row: list[str]) -> None:
        row[2] = f"{float(row[2]) + next(noise):.3f}"

    assert len(read_force_map(write(tmp_path / "noisy.csv", GOOD, rows(shake)))) == 15


@pytest.mark.parametrize(("column", "name"), [(0, "length_mm"), (1, "pressure_bar_gauge"), (2, "force_N")])
@pytest.mark.parametrize("cell", ["oops", "1e", "12,5"])
def test_a_cell_that_is_no_finite_number_is_named_with_its_row(
    tmp_path: Path, column: int, name: str, cell: str
) -> None:
    table = rows()
    table[6][column] = cell if "," not in cell else f'"{cell}"'
    said = refusal(write(tmp_path / "holes.csv", GOOD, table))
    assert f"{name}, row 8" in said  # the header is row 1
    assert repr(cell) in said
    assert "number" in said


@pytest.mark.parametrize(
    ("header", "hint"),
    [
        ("length_m,pressure_bar_gauge,force_N", "wrong unit"),  # 260 m
        ("length_mm,pressure_Pa_gauge,force_N", "wrong unit"),  # 5 Pa
        ("length_mm,pressure_MPa_gauge,force_N", None),  # 50 bar is possible ...
        ("length_mm,pressure_bar_gauge,force_kN", None),  # ... and so is 188 kN
        ("length_mm,pressure_bar_gauge,force_mN", None),  # 0.19 N
    ],
)
def test_a_column_in_the_wrong_unit_is_refused_where_it_can_be_seen(
    tmp_path: Path, header: str, hint: str | None
) -> None:
    path = write(tmp_path / "units.csv", header, rows())
    if hint is None:
        assert len(read_force_map(path)) == 15
    else:
        assert hint in refusal(path)


@pytest.mark.parametrize(
    ("header", "named"),
    [
        ("length,pressure_bar_gauge,force_N", "length"),
        ("length_mm,pressure,force_N", "pressure"),
        ("length_mm,pressure_bar_gauge,force", "force"),
    ],
)
def test_a_column_without_a_unit_is_refused(tmp_path: Path, header: str, named: str) -> None:
    said = refusal(write(tmp_path / "bare.csv", header, rows()))
    assert f"{named} has no unit" in said


@pytest.mark.parametrize(
    ("header", "value"),
    [
        ("length_N,pressure_bar_gauge,force_N", "N"),
        ("length_mm,pressure_mm,force_N", "mm"),
        ("length_mm,pressure_bar_gauge,force_bar", "bar"),
    ],
)
def test_a_unit_of_the_wrong_dimension_is_refused(tmp_path: Path, header: str, value: str) -> None:
    said = refusal(write(tmp_path / "dimension.csv", header, rows()))
    assert f"1 {value}" in said
    assert "such as" in said  # what is allowed


def contraction_rows(in_percent: bool) -> list[list[str]]:
    def change(row: list[str]) -> None:
        share = 1.0 - float(row[0]) / 300.0
        row[0] = f"{100.0 * share if in_percent else share:.5f}"

    return rows(change)


def test_contraction_in_percent_is_seen_and_explained(tmp_path: Path) -> None:
    path = write(tmp_path / "percent.csv", "contraction,pressure_bar_gauge,force_N", contraction_rows(True))
    said = refusal(path, rest_length=0.3)
    assert "percent" in said
    assert "contraction_percent" in said  # the way out


def test_contraction_is_read_as_fraction_and_as_declared_percent(tmp_path: Path) -> None:
    fraction = write(tmp_path / "fraction.csv", "contraction,pressure_bar_gauge,force_N", contraction_rows(False))
    percent = write(tmp_path / "percent.csv", "contraction_percent,pressure_bar_gauge,force_N", contraction_rows(True))
    lengths = [read_force_map(path, rest_length=0.3).length for path in (fraction, percent)]
    np.testing.assert_allclose(lengths[0], lengths[1], rtol=1e-5)  # five decimals were written
    np.testing.assert_allclose(np.unique(lengths[1].round(6)), LENGTHS, rtol=1e-5)


def test_contraction_without_a_rest_length_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "eps.csv", "contraction,pressure_bar_gauge,force_N", contraction_rows(False))
    assert "rest_length" in refusal(path)


def test_a_small_contraction_in_percent_is_seen_as_well(tmp_path: Path) -> None:
    # 0 to 1.3 %: one value above 0.9 is enough. 0-0.8 % could not be told from 0-80 %.
    def change(row: list[str]) -> None:
        row[0] = f"{100.0 * 0.1 * (1.0 - float(row[0]) / 300.0):.5f}"

    path = write(tmp_path / "small.csv", "contraction,pressure_bar_gauge,force_N", rows(change))
    assert "percent" in refusal(path, rest_length=0.3)


def test_a_contraction_beyond_100_percent_is_not_taken_for_percent_again(tmp_path: Path) -> None:
    path = write(
        tmp_path / "beyond.csv", "contraction [%],pressure_bar_gauge,force_N", [["0", "3", "9"], ["120", "3", "1"]]
    )
    said = refusal(path, rest_length=0.3)
    assert "got 120 %" in said and "between -60 % and 90 %" in said
    assert "is it in percent" not in said


def test_a_fraction_under_a_head_in_percent_is_suspected(tmp_path: Path) -> None:
    fraction, percent = contraction_rows(False), contraction_rows(True)  # 0 to 0.13, and 0 to 13
    paths = [
        write(tmp_path / f"{i}.csv", "contraction [%],pressure_bar_gauge,force_N", t)
        for i, t in enumerate((fraction, percent))
    ]
    remarks = [read_force_map(path, rest_length=0.3).remarks for path in paths]
    assert "if it is a fraction, name the column contraction" in remarks[0][0]
    assert remarks[1] == ()


def test_lengths_far_from_the_rest_length_are_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "map.csv", GOOD, rows())  # 26 to 30 cm
    said = refusal(path, rest_length=0.03)
    assert "between 0.1 and 1.6 times the rest length of 3 cm" in said and "got 26 cm" in said
    assert len(read_force_map(path, rest_length=0.3)) == 15


def test_a_table_with_a_column_per_pressure_is_one_with_a_row_per_point(tmp_path: Path) -> None:
    path = write(
        tmp_path / "wide.csv",
        "contraction [%],100 kPa,300 kPa,500 kPa",
        [["0", "10", "30", "50"], ["9", "5", "15", "25"]],
    )
    assert "force has no unit" in refusal(path, rest_length=0.2)
    points = read_force_map(path, rest_length=0.2, units={"force": "N"})
    assert points.pressure.tolist() == [1e5, 1e5, 3e5, 3e5, 5e5, 5e5]
    assert points.tension.tolist() == [10.0, 5.0, 30.0, 15.0, 50.0, 25.0]
    np.testing.assert_allclose(points.contraction, [0.0, 0.09] * 3, atol=1e-15)  # a rounding of 1 - L/L0
    assert "100 kPa to 500 kPa are forces at these pressures" in points.remarks[0]


def test_points_that_stand_twice_are_counted_in_a_remark(tmp_path: Path) -> None:
    once, slack = rows(), [["200.0", "3.00", "0.000"]]  # slack points are alike by nature, and tell nothing twice
    tables = {"once": once, "twice": once + once[:2], "slack": once + slack + slack}
    said = {n: read_force_map(write(tmp_path / f"{n}.csv", GOOD, t)).remarks for n, t in tables.items()}
    assert said["once"] == said["slack"] == ()
    assert said["twice"][0].startswith("2 points with tension equal earlier ones")


def test_an_absolute_pressure_is_told_by_its_name(tmp_path: Path) -> None:
    found = read_force_map(write(tmp_path / "abs.csv", "length_mm,pressure_bar_abs,force_N", rows()), ambient=1e5)
    assert found.pressure.min() == pytest.approx(0.0)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("", "file is empty"),
        (GOOD + "\n", "0 rows"),
        ("260,1,18.8\n270,1,23.5\n", "name the columns"),
        (GOOD + "\n260,1\n", "cells"),
        (GOOD + "\n260,1,18.8,7\n", "cells"),
    ],
)
def test_a_file_that_is_no_table_is_refused(tmp_path: Path, text: str, expected: str) -> None:
    path = tmp_path / "no_table.csv"
    path.write_text(text, encoding="utf-8")
    assert expected in refusal(path)


def test_a_file_that_is_not_there_is_named(tmp_path: Path) -> None:
    assert "not found" in refusal(tmp_path / "nowhere.csv")


def test_a_binary_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "picture.csv"
    path.write_bytes(bytes(range(256)) * 4)
    assert "CSV" in refusal(path)


def test_a_broken_gzip_file_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "map.csv.gz"
    whole = gzip.compress(b"\n".join([GOOD.encode(), *(",".join(r).encode() for r in rows())]))
    path.write_bytes(whole[: len(whole) // 2])
    assert "CSV" in refusal(path)


def german(path: Path, encoding: str = "cp1252", mark: str = ";", change=None) -> Path:
    """The table as a spreadsheet of another country writes it."""
    table = [[cell.replace(".", ",") for cell in row] for row in rows(change)]
    lines = ["L\u00e4nge [mm],Druck [bar],Kraft [N]".replace(",", mark), *(mark.join(row) for row in table), mark * 2]
    path.write_bytes(("\r\n".join(lines) + "\r\n").encode(encoding))
    return path


NAMED = {"length": "L\u00e4nge [mm]", "pressure": "Druck [bar]", "tension": "Kraft [N]"}


@pytest.mark.parametrize("encoding", ["cp1252", "utf-8", "utf-8-sig", "utf-16"])
@pytest.mark.parametrize("mark", [";", "\t"])
def test_tables_of_other_countries_are_read(tmp_path: Path, encoding: str, mark: str) -> None:
    good = read_force_map(write(tmp_path / "good.csv", GOOD, rows()))
    found = read_force_map(german(tmp_path / "Me\u00dfwerte \u6d4b.csv", encoding, mark), columns=NAMED)
    for name in ("length", "pressure", "tension"):
        assert getattr(found, name).tolist() == getattr(good, name).tolist()
    assert found.remarks == ()


def test_a_letter_with_an_accent_is_the_same_in_one_code_or_two(tmp_path: Path) -> None:
    path = german(tmp_path / "map.csv", "utf-8")
    path.write_text(path.read_text(encoding="utf-8").replace("\u00e4", "a\u0308"), encoding="utf-8")
    assert len(read_force_map(path, columns=NAMED)) == 15


def test_rows_with_a_blank_cell_are_left_out_and_named(tmp_path: Path) -> None:
    table = rows()
    table[6][2] = ""
    table[8][0] = "  "
    table[9].append("a note")
    for row in table:
        row.extend([""] * (4 - len(row)))
    found = read_force_map(write(tmp_path / "holes.csv", f"{GOOD},note", table))
    # a blank in a column that is not used is no matter
    assert len(found) == 13
    assert found.remarks == ("row 8 is left out: force_N is blank", "row 10 is left out: length_mm is blank")
    assert found.select(found.taut).remarks == found.remarks


def test_a_column_that_is_mostly_blank_is_refused(tmp_path: Path) -> None:
    table = rows()
    for row in table[1:]:
        row[2] = ""
    assert "blank in 14 of 15 rows" in refusal(write(tmp_path / "empty.csv", GOOD, table))


def test_no_reader_speaks_of_options_of_the_command_line() -> None:
    import ast

    import mckibben.identification
    import mckibben.recordings

    spoken = []
    for package in (mckibben.recordings, mckibben.identification):
        for path in Path(package.__file__).parent.glob("*.py"):
            tree = ast.parse(path.read_text(encoding="utf-8"))
            documents = {id(n.body[0].value) for n in ast.walk(tree) if hasattr(n, "body") and isinstance(n.body, list)
                         and n.body and isinstance(n.body[0], ast.Expr)}  # fmt: skip
            spoken += [
                f"{path.name}: {n.value}"
                for n in ast.walk(tree)
                if isinstance(n, ast.Constant) and isinstance(n.value, str) and id(n) not in documents
                and re.search(r"(?:^|[\s`'])--[a-z]|`mckibben ", n.value)
            ]  # fmt: skip
    assert not spoken, spoken


def test_two_columns_of_one_kind_must_be_chosen_between(tmp_path: Path) -> None:
    table = [[*row, row[2]] for row in rows()]
    path = write(tmp_path / "two.csv", "length_mm,pressure_bar_gauge,force_N,force_kN", table)
    assert "say which one is" in refusal(path)
    assert len(read_force_map(path, columns={"tension": "force_N"})) == 15


def test_an_unknown_column_choice_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "map.csv", GOOD, rows())
    assert "Known are" in refusal(path, columns={"colour": "force_N"})
    assert "The file has" in refusal(path, columns={"tension": "F"})


def test_an_unknown_branch_is_refused(tmp_path: Path) -> None:
    path = write(tmp_path / "map.csv", GOOD, rows())
    assert "branch" in refusal(path, branch="inflate")


@pytest.mark.parametrize("value", [0.0, -0.3, 300.0, float("nan")])
def test_an_impossible_rest_length_is_refused(tmp_path: Path, value: float) -> None:
    path = write(tmp_path / "map.csv", GOOD, rows())
    assert "rest_length" in refusal(path, rest_length=value)


@pytest.mark.parametrize("muscle", ["DMSP-10-250", "DMSP-20-300"])
def test_the_shipped_maps_are_read(muscle: str) -> None:
    assert read_force_map(map_file(specimen(muscle))).largest > 500.0
