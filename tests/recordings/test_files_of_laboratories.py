"""Files as instruments and laboratories write them: one reading of numbers, one clock, and nothing wrong without a word."""

import datetime
import itertools

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben.recordings.files import understand

HEAD = "time [s];pressure [bar];force [N]"


def put(path, text, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return path


def said(path, **options):
    with pytest.raises(InputError) as caught:
        mk.read(path, **options)
    return str(caught.value)


# Numbers: one way of writing for a file


@pytest.mark.parametrize(
    ("rows", "pressure", "force"),
    [
        ("0,0;1,234;1.234,5\n0,1;1,235;1.240,5\n0,2;1,236;1.250,5", 1.234e5, 1234.5),  # commas, for one cell needs them
        ("0.0;1.234;1,234.5\n0.1;1.235;1,240.5\n0.2;1.236;1,250.5", 1.234e5, 1234.5),
        ("0.0;0.500;998\n0.1;0.501;1,002\n0.2;0.502;1,010", 0.5e5, 998.0),  # 1,002 alone could be 1.002
        ("0,0;0,500;1 234,5\n0,1;0,501;1 235\n0,2;0,502;1 236", 0.5e5, 1234.5),
    ],
)
def test_one_decimal_mark_is_that_of_all_columns(tmp_path, rows, pressure, force):
    read = mk.read(put(tmp_path / "a.csv", f"{HEAD}\n{rows}\n"))
    assert read["pressure"][0] == pytest.approx(pressure, rel=1e-15)  # a rounding of bar to Pa
    assert read["force"][0] == force


def test_what_parts_thousands_is_said_with_a_number_and_its_row(tmp_path):
    read = understand(put(tmp_path / "a.csv", 'Time,Load\n(s),(N)\n0.0,"998"\n0.1,"1,002"\n0.2,"1,010"\n'))
    assert read.data["load"].tolist() == [998.0, 1002.0, 1010.0]
    assert read.remarks == (
        "the decimal mark of the file is the point, and a comma parts thousands: 1,002 in row 4 is 1002",
    )


@pytest.mark.parametrize(("mark", "name"), [(".", "point"), (",", "comma")])
def test_two_readings_that_both_fit_are_refused_with_both_and_decided_by_an_option(tmp_path, mark, name):
    text = f"t [ms];p [mbar]\n0;1{mark}013\n10;1{mark}113\n20;2{mark}013\n"
    path = put(tmp_path / "a.csv", text)
    problem = said(path)
    assert f"is 1.013 if the {name} is the decimal mark, and 1013 if it parts thousands" in problem
    assert mk.read(path, decimal=mark)["p"][0] == pytest.approx(101.3, rel=1e-14)
    assert mk.read(path, decimal="," if mark == "." else ".")["p"][0] == pytest.approx(101300.0, rel=1e-14)


def test_where_commas_part_the_cells_points_need_no_option(tmp_path):
    read = understand(put(tmp_path / "a.csv", "t [s],p [bar]\n0,1.013\n1,1.113\n2,1.213\n"))
    assert read.data["p"][0] == pytest.approx(1.013e5, rel=1e-15)
    assert read.remarks == ()


def test_both_marks_in_one_file_are_refused_with_the_odd_one_first(tmp_path):
    problem = said(put(tmp_path / "a.csv", f"{HEAD}\n0.0;1.5;3\n0.1;1.6;4\n0.2;1,75;5\n"))
    assert "pressure [bar], row 4: '1,75' is no number beside '0.0' in row 2 of time [s]" in problem


# Units and scales


@pytest.mark.parametrize(
    ("word", "name", "pascal"),
    [
        ("PSI", "pressure", 6894.757293168361), ("PSIA", "pressure_abs", 6894.757293168361), ("KPA", "pressure", 1e3),
        ("psi abs", "pressure_abs", 6894.757293168361), ("bar(g)", "pressure", 1e5), ("MPa", "pressure", 1e6),
    ],
)  # fmt: skip
def test_units_as_displays_write_them(tmp_path, word, name, pascal):
    read = mk.read(put(tmp_path / "a.csv", f"time [s];pressure [{word}]\n0;20\n1;21\n2;22\n"))
    assert read[name][0] == pytest.approx(20.0 * pascal, rel=1e-12)


def test_a_standard_flow_is_a_mass_flow_and_says_of_which_state(tmp_path):
    read = understand(put(tmp_path / "a.csv", "time [s],flow [SLPM]\n0,1\n1,2\n2,3\n"))
    # density of dry air at 0 C and 1.01325 bar, DIN 1343; four digits of it
    assert read.data["flow"][0] == pytest.approx(1.2929e-3 / 60.0, rel=1e-4)
    assert "DIN 1343" in read.remarks[0]


def test_a_stated_unit_of_another_kind_than_the_heads_is_refused_and_names_the_scale(tmp_path):
    path = put(tmp_path / "a.csv", "time [s],pressure [V]\n0,0.5\n1,1\n2,1.5\n")
    assert "must be of the kind that the file states, V" in said(path, units={"pressure": "bar"})
    read = mk.read(path, scales={"pressure": "2 bar/V - 1 bar"})
    np.testing.assert_allclose(read["pressure"], [0.0, 1e5, 2e5], rtol=1e-15)
    assert "must be per V" in said(path, scales={"pressure": "2 bar/mA"})


def test_counts_have_a_scale(tmp_path):
    read = mk.read(put(tmp_path / "a.csv", "t_ms,adc\n0,100\n10,300\n20,500\n"), scales={"adc": "4.9 mbar/count"})
    np.testing.assert_allclose(read["adc"], [49e3, 147e3, 245e3], rtol=1e-14)


def test_a_scaled_channel_is_the_scale_of_its_values():
    raw = mk.Channel([500.0, 1000.0], "V", "measured", "the cell")
    scaled = raw.scaled("0.5 N/mV - 3 N")
    assert (scaled.unit, scaled.kind, scaled.meaning) == ("N", "measured", "the cell")
    np.testing.assert_allclose(scaled.values, [500.0e3 * 0.5 - 3.0, 1000.0e3 * 0.5 - 3.0], rtol=1e-14)
    with pytest.raises(InputError, match="must be for a channel in V"):
        raw.scaled("2 bar/A")


# Clocks


def test_midnight_and_a_counter_that_begins_anew_go_on(tmp_path):
    day = understand(put(tmp_path / "a.csv", "Time,p [bar]\n23:59:59.8,1\n23:59:59.9,2\n00:00:00.0,3\n00:00:00.1,4\n"))
    np.testing.assert_allclose(day.data.time, [0.0, 0.1, 0.2, 0.3], atol=1e-9)  # of stamps of 1 us
    assert "midnight passes before row 4" in day.remarks[0]
    us = put(
        tmp_path / "b.csv",
        "Date,Time,p [bar]\n5/2/2024,11:59:59.8 PM,1\n5/2/2024,11:59:59.9 PM,2\n5/2/2024,12:00:00.0 AM,3\n",
    )
    np.testing.assert_allclose(mk.read(us).time, [0.0, 0.1, 0.2], atol=1e-9)
    top = 2**32
    counter = understand(put(tmp_path / "c.csv", f"time_ms,p_bar\n{top - 16},1\n{top - 6},2\n4,3\n14,4\n"))
    np.testing.assert_allclose(np.diff(counter.data.time), 0.01, rtol=1e-6)  # of 4.3e6 s in double
    assert "the counter of the time begins anew" in counter.remarks[0]


def test_equal_stamps_are_a_row_twice_or_a_coarse_clock(tmp_path):
    twice = understand(put(tmp_path / "a.csv", "t [s],p [bar]\n0,1\n0.1,2\n0.1,2\n0.2,3\n0.3,4\n"))
    assert twice.data.time.tolist() == [0.0, 0.1, 0.2, 0.3]
    assert twice.remarks == ("row 4 is left out: it has the time of the row before",)
    rows = "\n".join(f"{i // 4},{i}" for i in range(12))
    coarse = understand(put(tmp_path / "b.csv", f"t [s],p [bar]\n{rows}\n"))
    np.testing.assert_allclose(coarse.data.time, np.arange(12) / 4.0, rtol=1e-12)
    assert "spread evenly" in coarse.remarks[0]


def test_repeated_runs_are_runs_on_their_own_clocks_and_survive_a_file(tmp_path):
    once = ["0,1,10", "0.1,2,20", "0.2,3,30"]
    path = put(tmp_path / "a.csv", "\n".join(["t [s],p [bar],F [N]", *once, *once, *once]) + "\n")
    read = understand(path)
    assert (np.diff(read.data.time) > 0.0).all()
    assert "anew in row 5, row 8: 3 runs, one after another on one clock" in read.remarks[0]
    mk.read(path).save(tmp_path / "a.nc")
    for recording in (read.data, mk.read_recording(tmp_path / "a.nc")):
        assert len(recording.runs) == 3
        for run in recording.runs:
            np.testing.assert_allclose(run.time, [0.0, 0.1, 0.2], atol=1e-12)  # sums of intervals
            assert run["f"].tolist() == [10.0, 20.0, 30.0]
            assert run.runs == (run,)


@pytest.mark.parametrize("mark", [",", ";"])
def test_a_file_with_the_newest_sample_first_is_the_same_the_other_way_round(tmp_path, mark):
    rows = [f"{0.1 * i:.1f}{mark}{i * i}" for i in range(8)]
    head = f"t [s]{mark}p [bar]"
    forth, back = (
        understand(put(tmp_path / name, "\n".join([head, *some]) + "\n"))
        for name, some in (("a.csv", rows), ("b.csv", rows[::-1]))
    )
    np.testing.assert_array_equal(back.data.time, forth.data.time)
    np.testing.assert_array_equal(back.data["p"], forth.data["p"])
    assert back.remarks == ("the newest sample stands first; the rows are put in the order of their times",)


@pytest.mark.parametrize(
    ("times", "named"),
    [
        ([k // 3 for k in range(30)], "spread evenly"),  # a coarse clock
        ([*range(12), *range(12)], "anew in row 13: 2 runs"),
        ([0, 1, 1, 2, 3, 4, 5, 6, 8, 7, 9, 10], "the first in row 4;"),  # a stamp twice, and two rows exchanged
    ],
)
def test_a_clock_is_mended_with_the_newest_sample_first_as_with_the_oldest(tmp_path, times, named):
    rows = [f"{t},{i}" for i, t in enumerate(times)]
    forth, back = (
        understand(put(tmp_path / name, "\n".join(["t [s],p [bar]", *some]) + "\n"))
        for name, some in (("a.csv", rows), ("b.csv", rows[::-1]))
    )
    np.testing.assert_array_equal(back.data.time, forth.data.time)
    assert [(r.time[0], len(r.time)) for r in back.data.runs] == [(r.time[0], len(r.time)) for r in forth.data.runs]
    assert named in back.remarks[-1]  # by the rows of the file


def test_dates_with_the_newest_first_begin_at_the_oldest(tmp_path):
    rows = [f"2024-05-02 10:00:0{i},{i}" for i in (3, 2, 1, 0)]
    read = understand(put(tmp_path / "a.csv", "\n".join(["Date,p [bar]", *rows]) + "\n"))
    assert read.data.time.tolist() == [0.0, 1.0, 2.0, 3.0]
    assert read.data.meta["source"]["start"].startswith("2024-05-02T10:00:00")


def test_rows_that_are_named_after_others_were_left_out_are_those_of_the_file(tmp_path):
    times = (0, 1, 1, 2, 2, 3, 4, 5, 6, 8, 7, 9)
    rows = [f"{t},{i // 2}" for i, t in enumerate(times)]
    read = understand(put(tmp_path / "a.csv", "\n".join(["t [s],p [bar]", *rows]) + "\n"))
    assert "row 12" in next(remark for remark in read.remarks if "out of their order" in remark)


def test_two_days_are_two_days_and_no_midnight(tmp_path):
    rows = ["2024-05-03 20:00:00,1", "2024-05-03 20:00:01,2", "2024-05-03 00:00:00,3", "2024-05-03 00:00:01,4"]
    one = understand(put(tmp_path / "a.csv", "Time,p [bar]\n" + "\n".join(rows) + "\n"))
    assert "midnight passes" in one.remarks[0]  # the day of the beginning stands beside each time
    rows[2:] = [row.replace("03 00", "04 00") for row in rows[2:]]
    rows += [row.replace("-03 20", "-02 20") for row in rows[:2]]
    two = understand(put(tmp_path / "b.csv", "Time,p [bar]\n" + "\n".join(rows) + "\n"))
    assert "midnight" not in " ".join(two.remarks)
    assert "out of their order" in " ".join(two.remarks) or "runs" in " ".join(two.remarks)


@pytest.mark.parametrize("days", [("05/02/2024", "06/02/2024"), ("02/05/2024", "02/06/2024")])
def test_of_day_and_month_that_could_be_either_the_times_lie_close_together(tmp_path, days):
    rows = [f"{day} {clock},{i}" for i, (day, clock) in enumerate(zip(days, ("23:59:59", "00:00:01"), strict=True))]
    rows.append(f"{days[1]} 00:00:03,2")
    read = understand(put(tmp_path / "a.csv", "Time,p [bar]\n" + "\n".join(rows) + "\n"))
    np.testing.assert_allclose(read.data.time, [0.0, 2.0, 4.0], atol=1e-9)  # of stamps of 1 us


def test_what_was_mended_in_a_clock_goes_with_the_recording(tmp_path):
    path = put(tmp_path / "a.csv", "t [s],p [bar]\n0,1\n0.1,2\n0.2,3\n0,1\n0.1,2\n0.2,3\n")
    mk.read(path).save(tmp_path / "a.nc")
    said = [caution.text for caution in mk.read_recording(tmp_path / "a.nc").cautions]
    assert any("2 runs, one after another" in text for text in said)


def test_samples_out_of_order_are_put_in_order_and_said(tmp_path):
    read = understand(put(tmp_path / "a.csv", "time_s,force_N\n0,1\n0.1,2\n0.05,3\n0.2,4\n"))
    assert read.data["force"].tolist() == [1.0, 3.0, 2.0, 4.0]
    assert "out of their order" in read.remarks[0]


STAMPS = [f"10:00:0{i}" for i in range(4)]


@pytest.mark.parametrize(
    ("name", "stamps"),
    [
        ("Date", [f"2024-05-02 {clock}" for clock in STAMPS]),
        ("", [f"2024-05-02 {clock}" for clock in STAMPS]),  # an index of pandas
        ("", [f"0 days 00:00:0{i}" for i in range(4)]),
        ("", [f"0 days 00:00:0{i}.500000" for i in range(4)]),
        ("when", [f"02-May-2024 {clock}" for clock in STAMPS]),  # MATLAB's own
        ("when", [f"2024/05/02 10:0{i}" for i in range(4)]),
        ("", [str(datetime.timedelta(hours=23, minutes=59, seconds=58 + i)) for i in range(4)]),  # "1 day, 0:00:00"
        ("Time", [f"{24 + i // 4}:00:0{i}" for i in range(4)]),  # hours of a logger that go on after a day
        ("timestamps", ["0", "1", "2", "3"]),
        ("Time", [f"{i} sec" for i in range(4)]),  # a timetable of MATLAB
    ],
)
def test_the_only_column_of_times_is_the_time_whatever_it_is_called(tmp_path, name, stamps):
    rows = "\n".join(f'"{stamp}",{i}.5,{10 * i}' for i, stamp in enumerate(stamps))
    read = understand(put(tmp_path / "a.csv", f"{name},Pressure [bar],Force [N]\n{rows}\n"))
    step = 60.0 if "10:00" in stamps[0] and "/" in stamps[0] else 1.0
    np.testing.assert_allclose(read.data.time - read.data.time[0], step * np.arange(4), atol=1e-9)  # of stamps of 1 us
    assert read.data["pressure"][1] == 1.5e5 and read.data["force"][3] == 30.0
    assert next(use.name for use in read.columns) == "time"


def test_days_that_are_written_as_one_number_are_days(tmp_path):
    path = put(tmp_path / "a.csv", "date,p [bar]\n20240228,1\n20240229,2\n20240301,3\n")
    read = understand(path, columns={"time": "date"})
    np.testing.assert_allclose(read.data.time, [0.0, 86400.0, 172800.0], rtol=1e-12)  # a leap year
    assert read.remarks == ()


def test_a_map_with_a_column_of_dates_is_still_a_map(tmp_path):
    rows = "2024-05-01,150,1,10\n2024-05-02,160,2,20\n2024-05-03,170,3,30\n"
    points = mk.read(put(tmp_path / "a.csv", f"date,length [mm],pressure [bar],force [N]\n{rows}"))
    assert isinstance(points, mk.ForceMap) and points.tension.tolist() == [10.0, 20.0, 30.0]


@pytest.mark.parametrize("word", ["Volts", "VOLTS", "volts", "Volt"])
def test_a_unit_in_words_is_the_unit(tmp_path, word):
    read = mk.read(put(tmp_path / "a.csv", f"time [Seconds],Signal [{word}],M [Nm]\n0,1,2\n1,2,3\n2,3,4\n"))
    assert read.unit("signal") == "V" and read["m"].tolist() == [2.0, 3.0, 4.0]


@pytest.mark.parametrize(
    "text",
    [
        "| time [s] | pressure [bar] |\n|---|---|\n| 0 | 1 |\n| 1 | 2 |\n| 2 | 3 |\n",
        "|   time [s] |   pressure [bar] |\n|-----------:|:---------------|\n| 0 | 1 |\n| 1 | 2 |\n| 2 | 3 |\n",  # of pandas
        "time_s  pressure_bar\n======  ============\n0  1\n1  2\n2  3\n",
        "time [s],pressure [bar]\n0,1,\n1,2,\n2,3,\n",
        "time [s],pressure [bar]\n1,1,\n2,2,\n3,3,\n",  # as a table of R with numbered rows, but for the empty ends
    ],
)
def test_lines_that_are_drawn_are_no_rows_and_marks_at_their_ends_no_cells(tmp_path, text):
    read = mk.read(put(tmp_path / "a.txt", text))
    assert read["pressure"].tolist() == [1e5, 2e5, 3e5] and np.diff(read.time).tolist() == [1.0, 1.0]


def test_columns_of_which_none_can_be_a_channel_are_refused_in_a_sentence(tmp_path):
    path = put(tmp_path / "a.csv", "-,+\n1,2\n2,3\n3,4\n")
    assert "at least one column with a name and a unit" in said(path, period=0.1)


def test_rows_of_r_are_numbered_without_a_name(tmp_path):
    read = mk.read(put(tmp_path / "a.csv", "time [s],pressure [bar]\n1,0,1\n2,1,2\n3,2,3\n"))
    assert read["pressure"].tolist() == [1e5, 2e5, 3e5] and read.time.tolist() == [0.0, 1.0, 2.0]


def test_a_column_chosen_as_the_time_is_told_as_time_and_its_unit_is_said(tmp_path):
    path = put(tmp_path / "a.csv", "tick,p [bar]\n0,1\n10,2\n20,3\n")
    assert "columns={'time': ..}" in said(path)
    read = understand(path, columns={"time": "tick"})
    assert read.remarks == ("tick has no unit and is taken as seconds",)
    assert read.columns[0][1:] == ("time", "s")
    assert understand(path, columns={"time": "tick"}, units={"time": "ms"}).remarks == ()


def test_rows_of_an_hdf5_file_have_the_rate_that_stands_beside_them(tmp_path):
    import h5py

    stated = [("a.h5", "sample_rate", 50.0), ("b.hdf", "dt", 0.02), ("c.h5", "Fs", np.array([50.0]))]
    stated += [("d.h5", "SampleRate", "0.05 kHz"), ("e.h5", "sampling interval", "20 ms")]
    for (name, key, value), place in itertools.product(stated, ("data", "group", "file")):
        with h5py.File(tmp_path / name, "w") as file:
            data = file.create_dataset("run/pressure", data=[1.0, 2.0, 3.0])
            data.attrs["units"] = "bar"
            {"data": data, "group": data.parent, "file": file}[place].attrs[key] = value
        read = understand(tmp_path / name)
        np.testing.assert_allclose(read.data.time, [0.0, 0.02, 0.04], rtol=1e-15)
        assert f"by the attribute {key}" in read.remarks[0]


# What stands in the way is left out and said


@pytest.mark.parametrize(
    ("below", "words"),
    [
        ("\nPeak force,4\nEnd of test\n", ["row 6", "row 7"]),
        ('"Max","3","4"\n', ["row 5"]),
        ("Mean,1.5,3\nStdev,0.1,0.2\n", ["row 5", "row 6"]),
    ],
)
def test_summaries_below_the_numbers_are_left_out_and_named(tmp_path, below, words):
    read = understand(put(tmp_path / "a.csv", f"Time (s),Pressure (kPa),Force (N)\n0,1,2\n0.1,2,3\n0.2,3,4\n{below}"))
    assert read.data["force"].tolist() == [2.0, 3.0, 4.0]
    assert [line[:5] for line in read.remarks] == words


def test_a_word_among_numbers_is_still_refused(tmp_path):
    assert "row 3 must be a number, got 'O.5'" in said(put(tmp_path / "a.csv", "t [s],p [bar]\n0,1\n1,O.5\n2,3\n3,4\n"))
    assert "row 4 must be a number, got 'l0'" in said(put(tmp_path / "b.csv", "t [s],p [bar]\n0,1\n1,2\n2,l0\n"))


def test_words_beside_the_numbers_are_events(tmp_path):
    text = "Time (s),Pressure (kPa),Comment\n0,1,start\n0.1,2\n0.2,3,valve open\n0.3,4,valve open\n"
    read = understand(put(tmp_path / "a.csv", text))
    events = [{"time": 0.0, "text": "start"}, {"time": 0.2, "text": "valve open"}]
    assert read.data.meta["events"] == events
    assert "Comment is kept as 2 events" in read.remarks


# Instruments


def test_a_file_without_a_header_is_read_with_one_option(tmp_path):
    path = put(tmp_path / "a.txt", "23:59:58.100 -> 0.0,1\n23:59:58.200 -> 9.5,2\n23:59:58.300 -> 18.1,3\n")
    assert "the file has no header" in said(path)
    read = mk.read(path, header="time, pressure [kPa], force [N]")
    np.testing.assert_allclose(read.time, [0.0, 0.1, 0.2], atol=1e-9)
    assert read["pressure"].tolist() == [0.0, 9500.0, 18100.0]
    assert "must name each column, and the file has 3" in said(path, header="time, pressure [kPa]")


LABVIEW = """LabVIEW Measurement\t
Separator\tTab
Decimal_Separator\t,
X_Columns\tMulti
Date\t2024/05/02
Time\t14:41:45,5
***End_of_Header***\t
Channels\t2\t\t\t
Y_Unit_Label\tPSI\t\tN\t
X_Dimension\tTime\t\tTime\t
***End_of_Header***\t\t\t
X_Value\tMuscle Pressure\tX_Value\tLoad\tComment
0,00\t10,5\t0,00\t1,5\tstandby
0,01\t11,5\t0,01\t2,5
0,02\t12,5\t0,02\t3,5
"""


def test_a_file_of_labview_has_all_channels_of_several_x_columns(tmp_path):
    read = understand(put(tmp_path / "a.lvm", LABVIEW))
    np.testing.assert_allclose(
        read.data["muscle_pressure"], 6894.757293168361 * np.array([10.5, 11.5, 12.5]), rtol=1e-12
    )
    assert read.data["load"].tolist() == [1.5, 2.5, 3.5]
    assert read.data.meta["events"] == [{"time": 0.0, "text": "standby"}]


def test_oscilloscopes_say_their_clock_each_in_its_own_way(tmp_path):
    rigol = "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,-1.2e-02,2e-03\n0,1.0,0.0,,\n1,1.5,0.1,,\n2,1.9,0.2,,\n"
    old = "Record Length,3,,-0.1,0.02,\nSource,CH1,,-0.0999,0.03,\nVertical Units,V,,-0.0998,0.5,\n"
    new = "Model,MSO44\nHorizontal Units,s\nVertical Units,V,V\nLabel,pressure,force\nTIME,CH1,CH2\n0,1,2\n1e-3,2,3\n"
    new += "2e-3,3,4\n"
    a, b, c = (mk.read(put(tmp_path / f"{i}.csv", text)) for i, text in enumerate((rigol, old, new)))
    np.testing.assert_allclose(a.time, [-0.012, -0.010, -0.008], rtol=1e-12)
    assert b["ch1"].tolist() == [0.02, 0.03, 0.5] and b.unit("ch1") == "V"
    assert c.names() == ["pressure", "force"] and c.unit("force") == "V"


def test_opensim_and_testxpert_are_read_without_an_option(tmp_path):
    head = "forces\nversion=1\nnRows=3\nnColumns=3\ninDegrees=no\nendheader\n"
    motion = understand(
        put(tmp_path / "a.sto", head + "time\tpam_force\tpam_length\n0\t10\t0.2\n0.1\t12\t0.19\n0.2\t14\t0.18\n")
    )
    assert [motion.data.unit(n) for n in ("pam_force", "pam_length")] == ["N", "m"]
    assert "those of OpenSim" in motion.remarks[0]
    motion = head.replace("=no", "=yes") + "time\tknee_angle_r\tpelvis_tx\n0\t90\t0.2\n0.1\t45\t0.3\n0.2\t0\t0.4\n"
    angles = mk.read(put(tmp_path / "b.mot", motion))
    np.testing.assert_allclose(angles["knee_angle_r"], np.radians([90.0, 45.0, 0.0]), rtol=1e-12)
    assert angles.unit("pelvis_tx") == "m"
    machine = '"Prüfer";"Labor"\n"Vorkraft";5;"N"\n"Prüfzeit";"Weg";"Kraft"\n"s";"mm";"N"\n'
    machine += "0,00;0,0;5,01\n0,02;0,1;1.002,34\n0,04;0,2;1.010,1\n"
    read = mk.read(put(tmp_path / "a.TRA", machine, "cp1252"))
    assert read["kraft"].tolist() == [5.01, 1002.34, 1010.1]


def test_simulink_and_dspace_are_read_with_the_labels_that_are_printed(tmp_path):
    pytest.importorskip("pymatreader")
    from scipy.io import savemat

    time, wide = np.arange(5.0) / 10.0, np.arange(10.0).reshape(5, 2)
    signals = np.array([(time[:, None], "p [bar]"), (wide, "angles")], dtype=[("values", object), ("label", object)])
    savemat(tmp_path / "scope.mat", {"Scope": {"time": time[:, None], "signals": signals}})
    scope = mk.read(tmp_path / "scope.mat", units={"angles 1": "deg", "angles 2": "deg"})
    assert scope.names() == ["p", "angles_1", "angles_2"]
    np.testing.assert_allclose(scope["angles_2"], np.radians(wide[:, 1]), rtol=1e-12)
    savemat(tmp_path / "file.mat", {"ans": np.stack([time, time + 1.0])})  # To File: times in the first row
    file = understand(tmp_path / "file.mat", units={"ans_2": "bar"})
    np.testing.assert_allclose(file.data["ans_2"], 1e5 * (time + 1.0), rtol=1e-15)
    assert "taken as the time" in file.remarks[0]
    axes = {"Name": "Time", "Data": time, "Unit": "s"}
    channel = {"Name": '"Model Root"/Pressure/Out1', "Data": time + 1.0, "Unit": "bar", "XIndex": 1.0}
    savemat(tmp_path / "desk.mat", {"rec": {"X": axes, "Y": channel}})
    np.testing.assert_allclose(mk.read(tmp_path / "desk.mat")["pressure"], 1e5 * (time + 1.0), rtol=1e-15)


def test_channels_of_two_start_times_are_on_one_clock(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    start, time = np.datetime64("2024-05-02T10:00:00"), np.arange(0.0, 2.0, 0.01)

    def channel(name, unit, late):
        about = {"unit_string": unit, "wf_increment": 0.01, "wf_start_offset": 0.0}
        about["wf_start_time"] = start + np.timedelta64(round(1e3 * late), "ms")
        return nptdms.ChannelObject("Rig", name, np.sin(time + late), about)

    with nptdms.TdmsWriter(tmp_path / "a.tdms") as writer:
        writer.write_segment([channel("a", "V", 0.0), channel("b", "V", 0.5)])
    read = understand(tmp_path / "a.tdms")
    # One signal on two clocks: interpolation errs by at most step^2/8 = 1.3e-5; here samples meet, to rounding of the clock.
    np.testing.assert_allclose(read.data["a"], read.data["b"], atol=1e-9)
    assert read.data.time[0] == pytest.approx(0.5) and len(read.data) == 150
    assert "b is interpolated to the times of a" in read.remarks


# Maps


def test_a_hanging_mass_pulls_with_its_weight_and_it_is_said(tmp_path):
    points = mk.read(
        put(tmp_path / "a.csv", "mass [kg],p [kPa],L [mm]\n1,100,130\n2,100,135\n5,200,140\n"), rest_length="160 mm"
    )
    np.testing.assert_allclose(points.tension, 9.80665 * np.array([1.0, 2.0, 5.0]), rtol=1e-14)
    assert any("hangs on the muscle" in remark for remark in points.remarks)


def test_absolute_pressures_of_a_map_are_said(tmp_path):
    path = put(tmp_path / "a.csv", "Pressure,Contraction (%),Force (N)\n20,0,10\n20,5,8\n30,0,30\n")
    points = mk.read(path, rest_length="160 mm", units={"pressure": "psia"})
    assert points.pressure[0] == pytest.approx(20 * 6894.757293168361 - 101325.0, rel=1e-12)
    assert any("is absolute" in remark for remark in points.remarks)


def test_a_unit_of_the_kind_that_the_file_states_is_taken_whatever_its_size(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("time [s],length [mm],force [N]\n0,1,2\n1,3,4\n2,5,6\n3,7,8\n")
    assert mk.read(path, units={"length": "cm"})["length"].tolist() == pytest.approx([0.01, 0.03, 0.05, 0.07])
    with pytest.raises(InputError, match="must be of the kind that the file states, mm"):
        mk.read(path, units={"length": "ms"})  # as many of its SI unit as mm


def test_what_each_column_of_a_map_is_taken_for_is_told(tmp_path):
    path = tmp_path / "map.csv"
    path.write_text("length [mm],p abs [bar],operator,force [N]\n120,3,ab,10\n130,3,ab,20\n125,4,cd,30\n")
    uses = {use.label: use[1:] for use in understand(path, kind="map").columns}
    assert [uses[name] for name in ("length [mm]", "p abs [bar]", "force [N]")] == [
        ("length", "mm"), ("pressure", "bar abs"), ("tension", "N"),
    ]  # fmt: skip
    assert uses["operator"][0] == ""


# What public files of actuators and muscles showed


@pytest.mark.parametrize(
    ("label", "unit", "value"),
    [
        ("torque [Nmm]", "N*m", 1e-3), ("torque [N.m]", "N*m", 1.0), ("torque [kNm]", "N*m", 1e3),
        ("torque [in-lb]", "N*m", 0.0254 * 4.4482216152605), ("work [J]", "J", 1.0),
        ("acceleration [m/s2]", "m/s^2", 1.0), ("ax [g]", "m/s^2", 9.80665), ("load cell weight [g]", "kg", 1e-3),
        ("pressure [kg/cm2]", "Pa", 98066.5), ("position [rev]", "rad", 2.0 * np.pi), ("rectal [DegC]", "K", 274.15),
    ],
)  # fmt: skip
def test_a_unit_is_what_its_field_means_by_it(tmp_path, label, unit, value):
    """A moment is no energy, kilograms on gauges are forces, and g of an acceleration is no mass."""
    read = mk.read(put(tmp_path / "a.csv", f"Tiempo (segundos),{label}\n0,1\n1,1\n3,2\n"))
    (name,) = read.names()
    assert read.unit(name) == unit and read.time[-1] == 3.0
    assert read[name][0] == pytest.approx(value, rel=1e-12)  # rounding of the conversion


def test_seconds_since_1970_are_a_date_and_rows_of_one_time_are_said_in_whatever_order_they_stand(tmp_path):
    rows = "1738851054,1\n1738851060,2\n1738851057,3\n1738851055,4\n1738851060,5\n1738851070,6\n"
    read = understand(put(tmp_path / "a.csv", f"Timestamp,pressure [bar]\n{rows}"))
    assert read.data.time.tolist() == [0.0, 1.0, 3.0, 6.0, 16.0]
    assert read.data["pressure"].tolist() == [1e5, 4e5, 3e5, 2e5, 6e5]
    assert read.data.meta["source"]["start"].startswith("2025-02-06T14:10:54")
    assert [line for line in read.remarks if line == "row 6 is left out: another row has its time"]


def test_a_text_that_is_named_as_a_sheet_is_read_as_a_text(tmp_path):
    pytest.importorskip("python_calamine")
    read = understand(put(tmp_path / "a.xls", "time [s]\tpressure [bar]\n0\t1\n1\t2\n2\t4\n"))
    assert read.data["pressure"].tolist() == [1e5, 2e5, 4e5] and read.remarks == ("the file is a text, and no sheet",)


def test_the_first_line_of_a_terminals_log_is_no_header(tmp_path):
    path = put(tmp_path / "a.log.csv", "=~=~= PuTTY log 2017.08.23 13:06:09 =~=~=\n0, 1.5, 2\n1, 1.6, 3\n3, 1.7, 4\n")
    assert "the file has no header; name its columns" in said(path)
    read = mk.read(path, header="time [ms], pressure [bar], force [N]")
    assert read["pressure"].tolist() == [1.5e5, 1.6e5, 1.7e5] and read.time[-1] == 3e-3


def test_words_beside_a_table_are_left_out_and_said(tmp_path):
    read = understand(put(tmp_path / "a.csv", "time [s],pressure [bar]\n0,1,,1 deg = 2 mm\n1,2,,\n2,4,,\n"))
    assert read.data["pressure"].tolist() == [1e5, 2e5, 4e5]
    assert read.remarks == ("beside the table is left out: 1 deg = 2 mm",)


def test_samples_of_labview_without_times_are_at_the_interval_that_its_head_states(tmp_path):
    head = "LabVIEW Measurement\t\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\tNo\n***End_of_Header***\t\n\t\n"
    parts = (
        "Channels\t2\t\t\nSamples\t3\t3\t\nY_Unit_Label\tbar\tN\t\nX_Dimension\tTime\tTime\t\nX0\t0,5E+0\t0,5E+0\t\n"
    )
    rows = "Delta_X\t0,25\t0,25\t\n***End_of_Header***\t\t\t\n"
    rows += "X_Value\tp (a)\tf (b)\tComment\n\t1,5\t2\n\t1,75\t3\n\t2,5\t4\n"
    read = mk.read(put(tmp_path / "a.lvm", head + parts + rows))
    assert read.time.tolist() == [0.5, 0.75, 1.0] and [read[n].tolist() for n in read.names()] == [
        [1.5e5, 1.75e5, 2.5e5],
        [2.0, 3.0, 4.0],
    ]
