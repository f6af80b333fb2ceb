"""Force maps: joined, saved, and read back."""

import numpy as np
import pytest

import mckibben as mk

UP = mk.ForceMap("up", [0.12, 0.13], [3e5, 3e5], [0.0, 20.0], rest_length=[0.14, 0.14], branch=["up", "up"])
DOWN = mk.ForceMap("down", [1.0 / 7.0], [2e5], [5.0], rest_length=[0.14], remarks=("row 4 is blank",))


def test_a_saved_map_is_read_back_to_the_last_bit(tmp_path):
    both = mk.ForceMap.joined([UP, DOWN])
    read = mk.read(both.save(tmp_path / "both.csv"))
    for name in ("length", "pressure", "tension", "rest_length"):
        assert np.array_equal(getattr(read, name), getattr(both, name)), name


def test_joined_maps_keep_what_all_of_them_know_and_say_where_rows_were_left_out():
    both = mk.ForceMap.joined([UP, DOWN], name="bench")
    assert len(both) == 3 and both.branch is None and both.largest == 20.0
    assert both.remarks == ("down: row 4 is blank",)
    with pytest.raises(mk.InputError, match="maps must be one or more"):
        mk.ForceMap.joined([])
    with pytest.raises(mk.InputError, match="suffix"):
        both.save("both.xls")


def test_joined_maps_and_rows_with_a_label_are_runs(tmp_path):
    both = mk.ForceMap.joined([UP, DOWN])
    assert both.run.tolist() == ["up", "up", "down"]
    read = mk.read(both.save(tmp_path / "both.csv"))
    assert np.array_equal(read.run, both.run)
    again = mk.ForceMap.joined([read, UP])
    assert again.run.tolist() == ["both.csv up", "both.csv up", "both.csv down", "up", "up"]
    assert mk.ForceMap.joined([UP, UP]).run is None  # parts of one map
    (tmp_path / "tests.csv").write_text("length_mm,pressure_bar,force_N,test_id\n120,3,20,8\n130,3,35,9\n")
    assert mk.read(tmp_path / "tests.csv").run.tolist() == ["8", "9"]


@pytest.mark.parametrize(
    "header", ["contraction_fraction", "contraction [-]", "contraction_percent", "contraction [%]"]
)
def test_contractions_are_read_as_fractions_or_per_cent_by_their_header(tmp_path, header):
    scale = 100.0 if "percent" in header or "%" in header else 1.0
    file = tmp_path / "sheet.csv"
    file.write_text(
        f"{header},pressure_kPa_gauge,force_N\n"
        + "".join(f"{c * scale},200,{500 - c * 1e3}\n" for c in (0.0, 0.1, 0.2))
    )
    points = mk.read(file, rest_length=0.2)
    assert np.asarray(points.length) == pytest.approx([0.2, 0.18, 0.16], rel=1e-12)  # rounding of the text


def test_a_data_frame_has_a_column_for_each_quantity_that_is_known():
    pytest.importorskip("pandas")
    points = mk.ForceMap("map", np.array([0.11, 0.14]), np.array([2e5, 4e5]), np.array([8.0, 70.0]))
    frame = points.to_dataframe()
    assert {name: frame[name].tolist() for name in frame} == {
        "length": [0.11, 0.14],
        "pressure": [2e5, 4e5],
        "tension": [8.0, 70.0],
    }
