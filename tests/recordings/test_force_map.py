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
