"""Files that other programs wrote are read as what they hold, whatever their format and dialect; broken ones are refused."""

import csv
import gzip
import io
import json
import re
import sys

import numpy as np
import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben.recordings import understand

# One map and one run that all files hold; numbers that every format writes exactly.
LENGTH = np.array([250.0, 250.0, 265.0, 265.0, 280.0, 280.0])  # [mm]
PRESSURE = np.array([1.5, 3.0, 1.5, 3.0, 1.5, 3.0])  # [bar]
FORCE = np.array([10.5, 120.25, 60.0, 1250.5, 90.0, 1400.75])  # [N]
TIME = np.arange(8) * 4.0  # [ms]
FILLING = np.array([0.5, 1.25, 1.75, 2.0, 2.25, 2.5, 2.625, 2.75])  # [bar]
PULL = np.array([0.0, 10.25, 20.5, 30.75, 41.0, 51.25, 61.5, 1071.75])  # [N]
MAP = ("length", LENGTH), ("pressure", PRESSURE), ("force", FORCE)


def lines(header, columns, mark=",", form=repr):
    rows = ([form(float(v)) for v in row] for row in zip(*columns, strict=True))
    return [mark.join(header), *(mark.join(row) for row in rows)]


def comma(value):
    return repr(value).replace(".", ",")


def german(value):
    return f"{value:,.2f}".translate(str.maketrans(",.", ".,"))


def english(value):
    return f'"{value:,.2f}"'


def spreadsheet_export(path):
    text = lines(["Länge [mm]", "Druck [bar]", "Kraft [N]"], (LENGTH, PRESSURE, FORCE), ";", comma)
    path.write_bytes("\r\n".join([*text, ";;"]).encode("cp1252"))


def with_byte_order_mark(path):
    path.write_bytes(
        "\n".join(lines(["length_mm", "pressure_bar", "force_N"], (LENGTH, PRESSURE, FORCE))).encode("utf-8-sig")
    )


def unicode_text(path):
    text = lines(["Longueur (mm)", "Pression (bar)", "Force (N)"], (LENGTH, PRESSURE, FORCE), "\t", comma)
    path.write_bytes("\r\n".join(text).encode("utf-16"))


def unicode_without_mark(path):
    path.write_bytes(
        "\r\n".join(lines(["length_mm", "p_bar", "F_N"], (LENGTH, PRESSURE, FORCE), "\t")).encode("utf-16-le")
    )


def units_below_names(path):
    head, *rows = lines(["Muscle length", "Pressure", "Force", "Remark"], (LENGTH, PRESSURE, FORCE, LENGTH))
    path.write_text("\n".join([head, "mm,bar,N,", *(row.rpartition(",")[0] + ",ok" for row in rows)]))


def comments_and_blank_cells(path):
    head, *rows = lines(["length_mm", "pressure_bar", "force_N"], (LENGTH, PRESSURE, FORCE))
    path.write_text("\n".join(["# a rig", "", head, "# warm-up", *rows[:2], "255,,20", "255,2,NaN", *rows[2:]]))


def instrument_preamble(path):
    text = lines(["Length [mm]", "Pressure [bar]", "Force [N]"], (LENGTH, PRESSURE, FORCE), ";")
    path.write_text(
        "\n".join(["Universal testing machine", "Operator;me", "Date;2026-01-02", "Rate;10;mm/min", "", *text])
    )


def quoted_thousands(path):
    path.write_text("\n".join(lines(["length_mm", "pressure_bar", "force_N"], (LENGTH, PRESSURE, FORCE), ",", english)))


def german_thousands(path):
    path.write_text(
        "\n".join(lines(["length_mm", "pressure_bar", "Kraft in N"], (LENGTH, PRESSURE, FORCE), ";", german))
    )


def apostrophes(path):
    form = "{:,.2f}".format
    text = lines(
        ["length/mm", "pressure/bar", "force/N"], (LENGTH, PRESSURE, FORCE), ";", lambda v: form(v).replace(",", "’")
    )
    path.write_text("\n".join(text), encoding="utf-8")


def numpy_savetxt(path):
    np.savetxt(path, np.stack([LENGTH, PRESSURE, FORCE], 1), header="length_mm pressure_bar force_N")


def r_write_table(path):
    text = lines(['"length_mm"', '"pressure_bar"', '"force_N"'], (LENGTH, PRESSURE, FORCE), " ")
    path.write_text("\n".join([text[0], *(f'"{i}" {row}' for i, row in enumerate(text[1:], 1))]))


def pandas_csv(path):
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(
        {"length_mm": LENGTH, "pressure_bar": PRESSURE, "force_N": FORCE, "direction": list("uududu")}
    )
    frame.to_csv(path)


def polars_csv(path):
    frame = pytest.importorskip("polars").DataFrame({"L [mm]": LENGTH, "p [bar]": PRESSURE, "F [N]": FORCE})
    frame.write_csv(path, separator="\t")


def logs_joined(path):
    text = lines(["length_mm", "pressure_bar", "force_N"], (LENGTH, PRESSURE, FORCE))
    path.write_text("\n".join([*text[:3], text[0], *text[3:], "*** end of test ***"]))


def gzipped(path):
    path.write_bytes(gzip.compress("\n".join(lines(["length_mm", "p_bar", "F_N"], (LENGTH, PRESSURE, FORCE))).encode()))


def contractions(path):
    path.write_text(
        "\n".join(lines(["contraction_percent", "pressure_bar", "force_N"], (100 - LENGTH / 3, PRESSURE, FORCE)))
    )


def absolute_pressures(path):
    columns = (LENGTH, PRESSURE + 1.01325, FORCE / 1e3)
    path.write_text("\n".join(lines(["length_mm", "pressure [bar abs]", "force_kN"], columns)))


def other_names(path):
    path.write_text("\n".join(lines(["sensor 7", "p_meas", "F [N]"], (LENGTH / 10, PRESSURE, FORCE))))


def channels_with_units(path):
    path.write_text("\n".join(lines(["Ch1 (mm)", "Ch2 (bar)", "Ch3 (N)"], (LENGTH, PRESSURE, FORCE))))


def workbook(path, title=()):
    book = pytest.importorskip("openpyxl").Workbook()
    sheet = book.active
    for row in (
        *title,
        ["Length [mm]", "Pressure [bar]", "Force [N]"],
        *np.stack([LENGTH, PRESSURE, FORCE], 1).tolist(),
    ):
        sheet.append(row)
    return book, sheet


def excel(path):
    workbook(path)[0].save(path)


def excel_as_people_do(path):
    openpyxl = pytest.importorskip("openpyxl")
    book = openpyxl.Workbook()
    book.active.title = "Notes"
    book.active["A1"] = "measured on Monday"
    sheet = book.create_sheet("Data")
    for at, row in enumerate([["DMSP 20"], [], ["Length", "Pressure", "Force"], ["[mm]", "[bar]", "[N]"]], 2):
        for column, cell in enumerate(row, 3):
            sheet.cell(at, column, cell)
    for at, row in enumerate(np.stack([LENGTH, PRESSURE, FORCE], 1).tolist(), 6):
        for column, cell in enumerate(row, 3):
            sheet.cell(at, column, cell)
    book.save(path)


def open_document(path):
    document = pytest.importorskip("odf.opendocument").OpenDocumentSpreadsheet()
    from odf.table import Table, TableCell, TableRow
    from odf.text import P

    table = Table(name="Data")
    row = TableRow()
    for name in ("length_mm", "pressure_bar", "force_N"):
        cell = TableCell(valuetype="string")
        cell.addElement(P(text=name))
        row.addElement(cell)
    table.addElement(row)
    for numbers in np.stack([LENGTH, PRESSURE, FORCE], 1).tolist():
        row = TableRow()
        for number in numbers:
            row.addElement(TableCell(valuetype="float", value=str(number)))
        table.addElement(row)
    document.spreadsheet.addElement(table)
    document.save(path)


def matlab(path):
    pytest.importorskip("pymatreader")
    from scipy.io import savemat

    savemat(path, {"test": {"length_mm": LENGTH, "pressure_bar": PRESSURE, "force_N": FORCE}, "operator": "me"})


def parquet(path):
    frame = {"length_mm": LENGTH, "pressure_bar": PRESSURE, "force_N": FORCE, "note": ["a"] * 6}
    pytest.importorskip("polars").DataFrame(frame).write_parquet(path)


def hdf5(path):
    import h5py

    with h5py.File(path, "w") as file:
        for name, unit, values in (("length", "mm", LENGTH), ("pressure", "bar", PRESSURE), ("force", "N", FORCE)):
            file.create_dataset(f"run 1/{name}", data=values).attrs["units"] = unit


def hdf5_table(path):
    import h5py

    table = np.zeros(6, [("length_mm", "f8"), ("pressure_bar", "f4"), ("force_N", "f8")])
    table["length_mm"], table["pressure_bar"], table["force_N"] = LENGTH, PRESSURE, FORCE
    with h5py.File(path, "w") as file:
        file["measured"] = table


MAPS = {
    "excel-de.csv": (spreadsheet_export, {}),
    "mark.csv": (with_byte_order_mark, {}),
    "excel-fr.txt": (unicode_text, {}),
    "utf16.txt": (unicode_without_mark, {}),
    "units.csv": (units_below_names, {}),
    "blank.csv": (comments_and_blank_cells, {}),
    "preamble.csv": (instrument_preamble, {}),
    "thousands.csv": (quoted_thousands, {}),
    "thousands-de.csv": (german_thousands, {}),
    "thousands-ch.csv": (apostrophes, {}),
    "savetxt.dat": (numpy_savetxt, {}),
    "r.txt": (r_write_table, {}),
    "pandas.csv": (pandas_csv, {}),
    "polars.tsv": (polars_csv, {}),
    "joined.csv": (logs_joined, {}),
    "map.csv.gz": (gzipped, {}),
    "contraction.csv": (contractions, {"rest_length": "300 mm"}),
    "absolute.csv": (absolute_pressures, {}),
    "names.csv": (
        other_names,
        {
            "columns": {"length": 1, "pressure": "p_meas", "force": "F [N]"},
            "units": {"length": "cm", "pressure": "bar"},
        },
    ),
    "channels.csv": (channels_with_units, {}),
    "map.xlsx": (excel, {}),
    "people.xlsx": (excel_as_people_do, {"sheet": "Data"}),
    "map.ods": (open_document, {}),
    "map.mat": (matlab, {}),
    "map.parquet": (parquet, {}),
    "map.h5": (hdf5, {}),
    "table.hdf5": (hdf5_table, {}),
}


@pytest.mark.parametrize("name", MAPS)
def test_a_force_map_is_the_same_whatever_program_wrote_it(tmp_path, name):
    write, options = MAPS[name]
    write(tmp_path / name)
    points = mk.read(tmp_path / name, **options)
    assert isinstance(points, mk.ForceMap)
    # decimal numbers times a unit's factor: a few roundings, and that of 101325 Pa where pressures are absolute
    np.testing.assert_allclose(points.length, 1e-3 * LENGTH, rtol=4e-16 if "contr" not in name else 1e-14)
    np.testing.assert_allclose(points.pressure, 1e5 * PRESSURE, rtol=1e-15 if name != "absolute.csv" else 1e-9)
    np.testing.assert_allclose(points.tension, FORCE, rtol=1e-15)


def test_what_was_left_out_is_named_with_its_rows(tmp_path):
    comments_and_blank_cells(tmp_path / "a.csv")
    reading = understand(tmp_path / "a.csv")
    assert reading.remarks == ("row 7 is left out: pressure_bar is blank", "row 8 is left out: force_N is blank")
    assert [use.name for use in reading.columns] == ["length", "pressure", "tension"]
    assert [use.unit for use in reading.columns] == ["mm", "bar", "N"]
    instrument_preamble(tmp_path / "b.csv")
    assert understand(tmp_path / "b.csv").notes["preamble"][1] == "Operator me"
    logs_joined(tmp_path / "c.csv")
    assert understand(tmp_path / "c.csv").remarks == (
        "row 4 is left out: the header once more",
        "row 9 is left out: it holds no numbers (*** end of test ***)",
    )


# Runs over time


def csv_with_dates(path):
    stamps = [f"2026-01-02 03:04:05.{round(t):03d}" for t in TIME]
    with open(path, "w", newline="") as stream:
        csv.writer(stream).writerows(
            [["Timestamp", "pressure_bar", "force_N"], *zip(stamps, FILLING, PULL, strict=True)]
        )


def german_logger(path):
    stamps = [f"02.01.2026 03:04:05,{round(t):03d}" for t in TIME]
    rows = [";".join([s, comma(float(p)), comma(float(f))]) for s, p, f in zip(stamps, FILLING, PULL, strict=True)]
    path.write_bytes("\r\n".join(["Zeit;Druck [bar];Kraft [N]", *rows]).encode("cp1252"))


def tdms(path):
    nptdms = pytest.importorskip("nptdms")
    wave = {"wf_increment": 4e-3, "wf_start_offset": 0.0}
    channels = (("pressure", "bar", FILLING), ("force", "N", PULL))
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment([nptdms.ChannelObject("Log", n, v, {"unit_string": u, **wave}) for n, u, v in channels])


def edf(path):
    """16 bits over ranges that make a step of 1/8 bar and 1/4 N, so that all values are exact."""
    edfio = pytest.importorskip("edfio")
    channels = (("pressure", "bar", FILLING, (-4096, 4095.875)), ("force", "N", PULL, (-8192, 8191.75)))
    edfio.Edf(
        annotations=[edfio.EdfAnnotation(0.012, None, "valve opens")],
        signals=[edfio.EdfSignal(v, 250, label=n, physical_dimension=u, physical_range=r) for n, u, v, r in channels],
        patient=edfio.Patient(name="Somebody"),
        data_record_duration=0.032,
    ).write(path)


def c3d(path):
    ezc3d = pytest.importorskip("ezc3d")
    file = ezc3d.c3d()
    file["parameters"]["POINT"]["RATE"]["value"] = file["parameters"]["ANALOG"]["RATE"]["value"] = [250.0]
    file["parameters"]["ANALOG"]["LABELS"]["value"] = ["pressure", "force"]
    file["parameters"]["ANALOG"]["UNITS"]["value"] = ["bar", "N"]
    file["data"]["analogs"] = np.array([[FILLING, PULL]])
    file["data"]["points"] = np.zeros((4, 0, len(TIME)))
    file.write(str(path))


def mdf(path):
    asammdf = pytest.importorskip("asammdf")
    with asammdf.MDF() as file:
        channels = (("pressure", "bar", FILLING), ("force", "N", PULL), ("gear", "1", np.full(8, b"first")))
        file.append([asammdf.Signal(v, 1e-3 * TIME, u, n, encoding="utf-8") for n, u, v in channels])
        file.save(path)


def new_matlab(path):
    pytest.importorskip("pymatreader")
    import h5py

    with h5py.File(path, "w", userblock_size=512) as file:
        for name, values in (("t_ms", TIME), ("pressure_bar", FILLING), ("force_N", PULL)):
            made = file.create_dataset(name, data=values[None])
            made.attrs["MATLAB_class"] = np.bytes_("double")
    with open(path, "r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM")


def netcdf(path):
    import xarray

    channels = {"pressure": ("time", FILLING, {"units": "bar"}), "force": ("time", PULL, {"units": "N"})}
    times = {"time": ("time", TIME, {"units": "ms"})}
    xarray.Dataset(channels, times, {"rig": "B"}).to_netcdf(path, engine="h5netcdf")


def ros_store():
    typesys = pytest.importorskip("rosbags.typesys")
    return typesys.get_typestore(typesys.Stores.LATEST)


STAMP = 1_767_323_045 * 10**9  # 2026-01-02T03:04:05Z [ns]


def ros_messages(store):
    """A force of a load cell and an absolute pressure at the same instants."""
    types = store.types
    stamp, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    vector, wrench = types["geometry_msgs/msg/Vector3"], types["geometry_msgs/msg/Wrench"]
    for t, p, f in zip(TIME, FILLING, PULL, strict=True):
        tick = STAMP + round(t * 1e6)
        head = header(stamp(tick // 10**9, tick % 10**9), "rig")
        pull = wrench(vector(float(f), 0.0, 0.0), vector(0.0, 0.0, 0.0))
        yield tick, "/pressure", types["sensor_msgs/msg/FluidPressure"](head, 1e5 * float(p) + 101325.0, 0.0)
        yield tick, "/load_cell", types["geometry_msgs/msg/WrenchStamped"](head, pull)


def ros2(path, storage):
    rosbag2 = pytest.importorskip("rosbags.rosbag2")
    store = ros_store()
    plugin = getattr(rosbag2.StoragePlugin, storage)
    with rosbag2.Writer(path, version=9, storage_plugin=plugin) as writer:
        connections = {}
        for tick, topic, message in ros_messages(store):
            kind = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=store)
            writer.write(connections[topic], tick + 10**6, store.serialize_cdr(message, kind))


def bag_folder(path):
    ros2(path, "SQLITE3")


def bag_file(path):
    ros2(path.with_suffix(".d"), "SQLITE3")
    next(path.with_suffix(".d").glob("*.db3")).rename(path)


def mcap_of_ros2(path):
    ros2(path.with_suffix(".d"), "MCAP")
    next(path.with_suffix(".d").glob("*.mcap")).rename(path)


def mcap_writer(path, encoding, form, name, schema, payloads):
    from mcap.writer import Writer

    stream = io.BytesIO()
    writer = Writer(stream)
    writer.start()
    topic = writer.register_channel("/rig", encoding, writer.register_schema(name, form, schema))
    for t, data in zip(TIME, payloads, strict=True):
        writer.add_message(topic, STAMP + round(t * 1e6), data, STAMP + round(t * 1e6))
    writer.finish()
    path.write_bytes(stream.getvalue())


def mcap_of_json(path):
    rows = (
        {"pressure_bar": p, "force_N": f, "who": "me"} for p, f in zip(FILLING.tolist(), PULL.tolist(), strict=True)
    )
    mcap_writer(path, "json", "jsonschema", "rig", b"{}", [json.dumps(row).encode() for row in rows])


def mcap_of_protobuf(path):
    pytest.importorskip("mcap_protobuf")
    from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

    file = descriptor_pb2.FileDescriptorProto(name="rig.proto", package="rig", syntax="proto3")
    kind = file.message_type.add(name="Sample")
    for number, name in enumerate(("pressure_bar", "force_N"), 1):
        kind.field.add(name=name, number=number, type=1, label=1)  # double, optional
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    sample = message_factory.GetMessageClass(pool.FindMessageTypeByName("rig.Sample"))
    payloads = [sample(pressure_bar=p, force_N=f).SerializeToString() for p, f in zip(FILLING, PULL, strict=True)]
    schema = descriptor_pb2.FileDescriptorSet(file=[file]).SerializeToString()
    mcap_writer(path, "protobuf", "protobuf", "rig.Sample", schema, payloads)


ROS = {"columns": {"force": "load_cell.wrench.force.x", "pressure_abs": "pressure.fluid_pressure"}}
RUNS = {
    "dates.csv": (csv_with_dates, {}),
    "logger.txt": (german_logger, {"columns": {"pressure": "Druck [bar]", "force": "Kraft [N]"}}),
    "run.tdms": (tdms, {}),
    "run.edf": (edf, {}),
    "run.c3d": (c3d, {}),
    "run.mf4": (mdf, {}),
    "run.mat": (new_matlab, {}),
    "run.nc": (netcdf, {}),
    "bag": (bag_folder, ROS),
    "bag.db3": (bag_file, ROS),
    "ros.mcap": (mcap_of_ros2, ROS),
    "json.mcap": (mcap_of_json, {}),
    "proto.mcap": (mcap_of_protobuf, {}),
}


@pytest.mark.parametrize("name", RUNS)
def test_a_run_is_the_same_whatever_program_wrote_it(tmp_path, name):
    write, options = RUNS[name]
    write(tmp_path / name)
    record = mk.read(tmp_path / name, **options)
    assert isinstance(record, mk.Recording)
    np.testing.assert_allclose(record.time, 1e-3 * TIME, atol=1e-9)  # stamps in nanoseconds
    absolute = "pressure_abs" in record
    np.testing.assert_allclose(
        record["pressure_abs"] - 101325.0 if absolute else record["pressure"], 1e5 * FILLING, rtol=1e-14
    )
    np.testing.assert_allclose(record["force"], PULL, rtol=1e-15)
    assert record.unit("force") == "N"
    assert record.meta.get("events", []) == ([{"time": 0.012, "text": "valve opens"}] if name == "run.edf" else [])
    assert "Somebody" not in json.dumps(record.meta)  # whom a file was recorded of is nobody else's business


@pytest.mark.parametrize("suffix", ["edf", "bdf", "c3d", "mf4", "mdf"])
def test_bytes_that_are_no_recording_are_refused_in_one_line_whatever_the_library_says(tmp_path, suffix):
    pytest.importorskip({"c3d": "ezc3d", "mf4": "asammdf", "mdf": "asammdf"}.get(suffix, "edfio"))
    for content in (b"x" * 22, bytes(4096), b"\x02P" + b"\xff" * 4094):
        (tmp_path / f"a.{suffix}").write_bytes(content)
        with pytest.raises(InputError, match=rf"a\.{suffix}: .*(cannot be read as|damaged|no channel)") as refused:
            mk.read(tmp_path / f"a.{suffix}")
        assert "\n" not in str(refused.value)


# A muscle lever's file, in the layout of Aurora's DMC

HEAD = """DMCv5.4 Data File
Sample Frequency (Hz): 250
Reference Area: NaN sq. mm
Calibration Data:
Channel\tAI0\tAI1\tAI2\tAO0
Units\tmm\tmN\t\tmm
Scale (units/V)\t2.0\t500.0\t0.0\t2.0
Offset (volts)\t-0.5\t0.0\t0.0\t0.0
Test Comments:

Protocol Array:

0.000\tStimulus-Twitch\tStimulator\t.1,.2\t
0.400\tStop\t\t\t


Test Data in Volts:

Sample\tAI0\tAI1\tAI2\tAO0\tStim
"""


def muscle_lever(path, head=HEAD):
    rows = [f"{i}\t{i / 4 + 0.5}\t{f / 500}\t0.1\t0.25\t{int(i == 2)}" for i, f in enumerate(PULL)]
    path.write_bytes((head + "\n".join([*rows, "8\t0.000\t0.000\t0.000\t0.000\t0"])).replace("\n", "\r\n").encode())


def test_a_muscle_levers_file_is_read_with_its_gear_ratio(tmp_path):
    muscle_lever(tmp_path / "twitch.ddf")
    record = mk.read(tmp_path / "twitch.ddf")
    assert record.names() == ["length", "force", "length.command", "stimulus"]
    np.testing.assert_allclose(record.time, 1e-3 * TIME, rtol=1e-15)
    np.testing.assert_allclose(record["length"], 1e-3 * np.arange(8) / 2, rtol=1e-15)  # (volts - 0.5) * 2 mm/V
    np.testing.assert_allclose(record["force"], 1e-3 * PULL, rtol=1e-15)
    assert record["stimulus"].tolist() == [0, 0, 1, 0, 0, 0, 0, 0]
    assert record.meta["source"]["protocol"] == ["0.000 Stimulus-Twitch Stimulator .1,.2", "0.400 Stop"]
    doubled = mk.read(tmp_path / "twitch.ddf", gear_ratio=2)
    assert np.array_equal(doubled["length"], record["length"] / 2)
    assert np.array_equal(doubled["force"], record["force"] * 2)


PLAIN = HEAD + "".join(f"{i}\t{i / 4 + 0.5}\t{f / 500}\t0.1\t0.25\t{int(i == 2)}\n" for i, f in enumerate(PULL))
WRITTEN = {  # the same samples as different programs write them
    "Windows line ends and a BOM": ("\ufeff" + PLAIN.replace("\n", "\r\n")).encode(),
    "UTF-16": PLAIN.encode("utf-16"),
    "cp1252 in a comment": PLAIN.replace("Test Comments:\n", "Test Comments:\n\u00b5 at 25 \u00b0C\n").encode("cp1252"),
    "blanks and tabs at the ends": PLAIN.replace("\n", " \t\n").encode(),
    "decimal commas": re.sub(r"(\d)\.(\d)", r"\1,\2", PLAIN).encode(),
    "a comment that names parts": PLAIN.replace(
        "Comments:\n", "Comments:\nTest Data fine\nProtocol Array: no\n"
    ).encode(),
    "newtons": PLAIN.replace("mm\tmN", "mm\tN").replace("\t500.0", "\t0.5").encode(),
    "an unused channel without numbers": PLAIN.replace("500.0\t0.0", "500.0\tNaN").encode(),
    "two stimuli": re.sub(r"(?m)^(Sample|\d+)(\t.*)$", r"\1\2\t\1", PLAIN)
    .replace("Stim\tSample", "Stim\tStim2")
    .encode(),
}


@pytest.mark.parametrize("variant", WRITTEN)
def test_a_muscle_levers_samples_do_not_depend_on_how_they_are_written(tmp_path, variant):
    (tmp_path / "twitch.ddf").write_bytes(WRITTEN[variant])
    record = mk.read(tmp_path / "twitch.ddf", gear_ratio=2)
    assert record.names()[:4] == ["length", "force", "length.command", "stimulus"]
    np.testing.assert_allclose(record["length"], 1e-3 * np.arange(8) / 4, rtol=1e-15)
    np.testing.assert_allclose(record["force"], 2e-3 * PULL, rtol=1e-15)
    assert record["stimulus"].tolist() == [0, 0, 1, 0, 0, 0, 0, 0]
    assert [line.split()[1] for line in record.meta["source"]["protocol"]] == ["Stimulus-Twitch", "Stop"]


@pytest.mark.parametrize("rate", ["0.5", "1", "1e6"])
def test_a_muscle_lever_may_sample_as_slowly_and_as_fast_as_it_likes(tmp_path, rate):
    (tmp_path / "slow.ddf").write_text(re.sub(r"(Sample Frequency \(Hz\): *)\S+", rf"\g<1>{rate}", PLAIN))
    time = mk.read(tmp_path / "slow.ddf", gear_ratio=2).time
    assert np.diff(time) == pytest.approx(1.0 / float(rate), rel=1e-9)


def test_a_muscle_levers_file_without_a_protocol_is_read_and_says_so(tmp_path):
    (tmp_path / "twitch.ddf").write_text(re.sub(r"Protocol Array:.*?(?=Test Data)", "", PLAIN, flags=re.S))
    reading = understand(tmp_path / "twitch.ddf")
    np.testing.assert_allclose(reading.data["force"], 1e-3 * PULL, rtol=1e-15)
    assert reading.data.meta["source"]["protocol"] == []
    assert "it has no Protocol Array: what was done to the muscle is not known" in reading.remarks


# Broken files: file, place and remedy in one sentence

GOOD = "length_mm,pressure_bar,force_N\n250,1,10\n260,2,20\n270,3,30\n"
BROKEN = {
    "empty.csv": (b"", "file is empty"),
    "picture.csv": (bytes(range(256)), "the file is unreadable as a CSV text file: it holds binary data"),
    "cell.csv": (GOOD.replace("20", "2O").encode(), "force_N, row 3 must be a number, got '2O'"),
    "ragged.csv": (GOOD.replace("2,20", "2").encode(), "row 3 has 2 cells, and the header has 3 columns"),
    "mixed.csv": (
        GOOD.replace(",", ";").replace(";10", ";10,5").replace(";20", ";20.5").encode(),
        "force_N, row 2: '10,5' is no number beside '20.5' in row 3; "
        "a file is read with one decimal mark: write all its numbers with a point, or all with a comma",
    ),
    "unit.csv": (
        GOOD.replace("pressure_bar", "pressure").encode(),
        "pressure has no unit: write it into the header, such as pressure_bar, or state it, with units={'pressure': ..}",
    ),
    "names.csv": (
        GOOD.replace("length_mm", "travel").replace("pressure_bar", "air").encode(),
        "the columns are travel, air, force_N; "
        "a recording needs a time, or the period of its samples, a force map length, pressure and force; name the "
        "columns, with columns={'time': ..}",
    ),
    "numbers.csv": (
        GOOD.partition("\n")[2].encode(),
        "the file has no header; name its columns and their units, such as 'time [ms], pressure [bar]', with "
        "header='name [unit], ..'",
    ),
    "rest.csv": (
        GOOD.replace("length_mm", "contraction_percent").encode(),
        "rest_length is missing: contractions are shares of it; state it, or write a column rest_length, "
        "with rest_length='300 mm'",
    ),
    "no.xlsx": (b"PK\x03\x04 but not a spreadsheet", "file cannot be read as a spreadsheet"),
    "no.h5": (b"\x89HDF\r\n\x1a\n" + bytes(40), "file cannot be read as an HDF5 file"),
    "no.db3": (b"SQLite format 3\0" + bytes(90), "file cannot be read as a bag of ROS"),
    "no.mcap": (b"\x89MCAP0\r\n" + bytes(30), "the MCAP file has no message that can be read"),
    "no.ddf": (
        HEAD.partition("Protocol")[0].encode(),
        "the part Test Data is missing; the file is cut off, or no DMC Data File",
    ),
    "rate.ddf": (
        PLAIN.replace(" 250", " 10,000").encode(),
        "Sample Frequency",  # (Hz) must be a number
    ),
    "scale.ddf": (PLAIN.replace("500.0\t", "\t").encode(), "Scale of AI1 must be a number, got 'missing'"),
    "volts.ddf": (
        PLAIN.replace("in Volts", "in Engineering Units").encode(),
        "Test Data must be in Volts, got 'in Engineering Units'",
    ),
    "lost.ddf": (
        re.sub(r"\n3\t.*", "", PLAIN).encode(),
        "row 23 is sample 4 after 2; samples must be numbered one by one",
    ),
    "cut.ddf": (PLAIN[:-12].encode(), "row 27 has 3 cells, and the header has 6 columns"),
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_broken_file_is_refused_in_one_sentence(tmp_path, monkeypatch, name):
    content, sentence = BROKEN[name]
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).write_bytes(content)
    with pytest.raises(InputError) as refused:
        mk.read(name)
    # what the library says of its format follows in parentheses
    assert str(refused.value).partition(" (")[0] == f"{name}: {sentence}"
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("name", "library", "says"),
    [
        ("a.xlsx", "python_calamine", "Spreadsheets need python-calamine"),
        ("a.db3", "rosbags.highlevel", "Bags of ROS need rosbags"),
    ],
)
def test_a_missing_library_is_named_with_the_command_that_installs_it(
    tmp_path, monkeypatch, read_here, name, library, says
):
    (tmp_path / name).write_bytes(b"x")
    monkeypatch.setitem(sys.modules, library, None)
    with pytest.raises(
        InputError, match=re.escape(f"{name}: {says}, which is not installed: pip install 'mckibben[formats]'")
    ):
        mk.read(tmp_path / name)


def test_an_option_that_the_format_does_not_have_is_refused(tmp_path):
    (tmp_path / "a.csv").write_text(GOOD)
    with pytest.raises(InputError, match="CSV files have no such option; they take decimal, header"):
        mk.read(tmp_path / "a.csv", sheet="Data")
    workbook(tmp_path / "a.xlsx")[0].save(tmp_path / "a.xlsx")
    with pytest.raises(InputError, match="Unknown sheet 'Data'"):
        mk.read(tmp_path / "a.xlsx", sheet="Data")


def test_a_shortening_in_a_unit_of_length_is_a_contraction_over_the_rest_length(tmp_path):
    text = "Load cell (lbf),Gauge (psi),stroke (in)\n100,30,0\n80,30,0.4\n60,30,0.8\n"
    (tmp_path / "machine.csv").write_text(text)
    names = {"tension": "Load cell (lbf)", "pressure": "Gauge (psi)", "contraction": "stroke (in)"}
    points = mk.read(tmp_path / "machine.csv", columns=names, rest_length="220 mm")
    np.testing.assert_allclose(points.length, 0.22 - 0.0254 * np.array([0, 0.4, 0.8]), rtol=1e-14)  # rounding


def test_columns_of_other_names_are_suggested_by_their_units_and_none_is_guessed(tmp_path):
    text = "Traverse (mm);Manometer (mbar);Pr\u00fcfkraft (kN);Raum (degC)\n180,5;1500;0,12;21\n190,5;1500;0,2;21\n"
    (tmp_path / "machine.csv").write_bytes(text.encode("cp1252"))
    with pytest.raises(InputError) as refused:
        mk.read(tmp_path / "machine.csv")
    for words in ("Traverse (mm) may be the length", "Manometer (mbar) may be the pressure", "(kN) may be the tension"):
        assert words in str(refused.value)
    assert "Raum (degC) may" not in str(refused.value)


@pytest.mark.parametrize("counts", [(40, 40, 40), (40, 55)])
def test_an_array_of_structs_of_matlab_is_as_many_runs(tmp_path, counts):
    pytest.importorskip("pymatreader")
    from scipy.io import savemat

    trials = np.zeros(len(counts), [(name, object) for name in ("time", "force", "pressure", "operator")])
    for i, n in enumerate(counts):
        time = np.linspace(0.0, 1.0, n)
        trials[i] = (time, 10.0 * i + time, 2.0 + i, "me")  # a number is that of each sample of its trial
    savemat(tmp_path / "trials.mat", {"trials": trials, "units": {"time": "s", "force": "N", "pressure": "bar"}})
    runs = mk.read(tmp_path / "trials.mat").runs
    assert [len(run) for run in runs] == [*counts]
    for i, run in enumerate(runs):
        # to the rounding of the clock, on which the runs stand one after another
        assert np.allclose(run["force"] - 10.0 * i, run.time, rtol=0.0, atol=1e-12)
        assert np.allclose(run["pressure"], 1e5 * (2.0 + i), rtol=1e-15)
