"""Force maps that are no CSV files, columns that are left out, absolute pressures, and notes on recordings."""

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.recordings import Channel, Recording, read_force_map, read_recording
from mckibben.recordings.files import understand
from mckibben.recordings.force_map import preview_table, stated_unit
from mckibben.recordings.recording import notes_of

LENGTH = np.array([250.0, 250.0, 280.0, 280.0])  # [mm]
PRESSURE = np.array([100.0, 300.0, 100.0, 300.0])  # [kPa]
TENSION = np.array([10.0, 120.0, 90.0, 400.0])  # [N]


def csv(path, header="length_mm,pressure_kPa,force_N"):
    columns = (v.tolist() for v in (LENGTH, PRESSURE, TENSION))
    rows = "\n".join(f"{a!r},{b!r},{c!r}" for a, b, c in zip(*columns, strict=True))
    path.write_text(f"{header}\n{rows}\n")
    return path


def mat(path):
    from scipy.io import savemat

    savemat(path, {"test": {"length_mm": LENGTH, "pressure_kPa": PRESSURE, "force_N": TENSION}})
    return path


def tdms(path):
    nptdms = pytest.importorskip("nptdms")
    told = (("length", "mm", LENGTH), ("pressure", "kPa", PRESSURE), ("force", "N", TENSION))
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("test", n, v, {"unit_string": u}) for n, u, v in told])
    return path


@pytest.mark.parametrize("mark", [",", "."])
def test_a_number_with_two_marks_shows_that_they_part_thousands_in_the_whole_file(tmp_path, mark):
    rows = "\n".join(
        f"{i};{c}" for i, c in enumerate(("1,234,567".replace(",", mark), "2,345".replace(",", mark), "-0"))
    )
    (tmp_path / "a.csv").write_text(f"time [s];force [N]\n{rows}\n")
    read = understand(tmp_path / "a.csv")
    assert read.data["force"].tolist() == [1234567.0, 2345.0, 0.0]
    assert "parts thousands" in " ".join(read.remarks)


@pytest.mark.parametrize("made", [mat, tdms])
def test_a_table_is_the_same_whatever_kind_of_file_holds_it(tmp_path, made):
    if made is mat:
        pytest.importorskip("pymatreader")
    told, same = read_force_map(made(tmp_path / f"map.{made.__name__}")), read_force_map(csv(tmp_path / "map.csv"))
    for name in ("length", "pressure", "tension"):  # exact: repr of a float reads back to the same bits
        assert np.array_equal(getattr(told, name), getattr(same, name))


def test_a_recording_is_a_table_of_its_samples(tmp_path):
    channels = {
        "length": Channel(LENGTH * 1e-3, "m"),
        "pressure": Channel(PRESSURE * 1e3),
        "tension": Channel(TENSION, "N"),
    }
    Recording(np.arange(4.0), channels).save(tmp_path / "run.nc")
    found = read_force_map(tmp_path / "run.nc")
    assert np.array_equal(found.tension, TENSION) and np.array_equal(found.length, LENGTH * 1e-3)


def test_a_dash_leaves_a_column_out_and_a_unit_may_say_what_a_pressure_refers_to(tmp_path):
    path = csv(tmp_path / "map.csv")
    absolute = read_force_map(path, units={"pressure": "kPa abs"})
    assert np.allclose(absolute.pressure, PRESSURE * 1e3 - 101325.0, rtol=0.0, atol=1e-9)  # rounding of one difference
    assert np.array_equal(read_force_map(path, units={"pressure": "kPa gauge"}).pressure, PRESSURE * 1e3)
    with pytest.raises(InputError, match="pressure is missing"):
        read_force_map(path, columns={"pressure": "-"})


def test_a_preview_tells_what_a_header_means_before_anything_is_refused(tmp_path):
    look = preview_table(csv(tmp_path / "map.csv", "length_mm,air_bar_abs,force_N"))
    assert look.meant == {"length": "length_mm", "tension": "force_N"} and look.total == 4
    assert stated_unit("air_bar_abs", "pressure") == "bar abs" and stated_unit("force", "tension") == ""


def test_notes_stand_in_the_file_by_their_time_and_only_within_it(tmp_path):
    record = Recording([1.0, 2.0, 3.0], {"x": Channel([1.0, 2.0, 3.0], "N")})
    both = record.with_note(2.5, "rough").with_note(1.5, " begins ")
    both.save(tmp_path / "noted.nc")
    kept = read_recording(tmp_path / "noted.nc").notes
    assert [(n.time, n.text) for n in kept] == [(1.5, "begins"), (2.5, "rough")]
    assert [n.text for n in both.without_note(kept[0]).notes] == ["rough"]
    for time, text in ((0.5, "early"), (2.0, ""), (2.0, "two\nlines"), (2.0, "x" * 201), (float("nan"), "when")):
        with pytest.raises(InputError, match="note"):
            record.with_note(time, text)
    assert notes_of({"notes": ["no note", {"time": "1 s", "text": 3}]}) == []
