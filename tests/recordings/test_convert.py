"""From any file to any other: recordings come back bit for bit, files of others as SI; what cannot be is said in a line."""

import contextlib
import random
import struct
import sys
import tempfile
import warnings
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_recording import assert_same, recordings, some

from mckibben.errors import InputError
from mckibben.formats import sidecar, store
from mckibben.formats.registry import readable, writable
from mckibben.formats.sidecar import KEY
from mckibben.formats.text import plain_names
from mckibben.recordings import Channel, Recording, convert, read_any, write

TIME = 1e-3 * np.arange(50)
PRESSURE = 2.0 + np.sin(TIME)


@pytest.mark.parametrize("suffix", writable())
@pytest.mark.parametrize(
    "kept",
    [some(10), some(5000), Recording([0.0], {"a": Channel([1.0])}), Recording([0.0, 1.0], {}, {"title": ""})],
    ids=["hard numbers", "long", "one sample", "no channels"],
)
def test_every_format_gives_back_the_same_bits(tmp_path: Path, suffix: str, kept: Recording) -> None:
    told = write(kept, tmp_path / f"run{suffix}")
    read = read_any(tmp_path / f"run{suffix}")
    assert_same(read.recording, kept)
    assert read.remarks == []
    # Only MATLAB holds something otherwise, and an RO-Crate lacks an author: it is said; nothing is left beside the file.
    says = suffix == ".zip" or (suffix == ".mat" and "tank.pressure" in kept)
    assert told == (told[:1] if says else []) and bool(told) >= (suffix == ".zip")
    assert [p.name for p in tmp_path.iterdir()] == [f"run{suffix}"]


@settings(max_examples=12, deadline=None)
@given(recordings())
def test_random_recordings_survive_all_formats_in_a_row(kept: Recording) -> None:
    with tempfile.TemporaryDirectory() as folder:
        before = write_to(kept, Path(folder) / "run.nc")
        for suffix in (".mcap", ".mat", ".tdms", ".parquet", ".csv", ".nc"):
            after = Path(folder) / f"next{suffix}"
            convert(before, after)
            before = after
        assert_same(read_any(before).recording, kept)


def write_to(kept: Recording, path: Path) -> Path:
    write(kept, path)
    return path


def test_units_kinds_and_meanings_stand_in_words_that_other_programs_read(tmp_path: Path) -> None:
    import nptdms
    import polars
    from scipy.io import loadmat

    kept = some()
    name = "tank.pressure_abs"
    found = loadmat(write_to(kept, tmp_path / "a.mat"), squeeze_me=True)
    assert np.array_equal(found["tank_pressure_abs"], kept[name], equal_nan=True)
    assert (str(found["units"]["tank_pressure_abs"]), str(found["units"]["time"])) == ("Pa", "s")
    with nptdms.TdmsFile.open(write_to(kept, tmp_path / "a.tdms")) as file:
        channel = file["recording"][name]
        assert np.array_equal(channel[:], kept[name], equal_nan=True)
        about = {"unit_string": "Pa", "kind": "true", "description": "absolute pressure, in the tank"}
        assert dict(channel.properties) == about
        assert file.properties["title"] == kept.meta["title"]
    table = polars.read_parquet(write_to(kept, tmp_path / "a.parquet"))
    assert table.columns[:2] == ["time [s]", "tank.pressure_abs [Pa]"]
    assert np.array_equal(table["tank.pressure_abs [Pa]"].to_numpy(), kept[name], equal_nan=True)


def test_names_that_matlab_does_not_allow_are_changed_and_said(tmp_path: Path) -> None:
    names = ["a.b", "a_b", "time", "Time", "1st", "µ", "x" * 90, "x" * 91, "end"]
    plain = plain_names(names, lambda name: name.replace(".", "_").replace("µ", "_"))
    assert len(set(plain)) == len(names)
    assert all(p.isidentifier() and p.isascii() and len(p) <= 63 and p[0].isalpha() for p in plain)
    kept = Recording([0.0], {n: Channel([float(i)], "N") for i, n in enumerate(names) if n != "time"})
    (told,) = write(kept, tmp_path / "a.mat")
    assert told.startswith("7 names are written as MATLAB allows them, such as a_b for a.b")
    assert "end" not in variables_of(tmp_path / "a.mat")  # a word of the language, which no variable can be called
    assert_same(read_any(tmp_path / "a.mat").recording, kept)


@pytest.mark.parametrize("suffix", writable())
def test_a_channel_may_have_the_name_of_what_a_format_keeps_beside_it(tmp_path: Path, suffix: str) -> None:
    kept = Recording(
        [0.0, 0.1], {name: Channel([1.0, 2.0], "N") for name in (KEY, "units", "meta", "schema")}, {"a": "b"}
    )
    write(kept, tmp_path / f"run{suffix}")
    assert_same(read_any(tmp_path / f"run{suffix}").recording, kept)


def variables_of(path: Path) -> list[str]:
    from scipy.io import whosmat

    return [name for name, *_ in whosmat(path)]


# Files of others.


def old_matlab(path: Path, **variables) -> Path:
    from scipy.io import savemat

    savemat(path, variables)
    return path


def new_matlab(path: Path, **variables) -> Path:
    """Version 7.3, as MATLAB lays it into HDF5."""
    with h5py.File(path, "w", userblock_size=512) as file:
        for name, value in variables.items():
            _into(file, name, value)
    with open(path, "r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file".ljust(116) + bytes(8) + b"\x00\x02IM")
    return path


def _into(group: h5py.Group, name: str, value) -> None:
    if isinstance(value, dict):
        inner = group.create_group(name)
        inner.attrs["MATLAB_class"] = np.bytes_("struct")
        for key, one in value.items():
            _into(inner, key, one)
    elif isinstance(value, str):
        made = group.create_dataset(name, data=np.array([[ord(c)] for c in value], np.uint16))
        made.attrs["MATLAB_class"] = np.bytes_("char")
    else:
        # MATLAB stores the transpose
        made = group.create_dataset(name, data=np.atleast_2d(np.asarray(value, float)))
        made.attrs["MATLAB_class"] = np.bytes_("double")


@pytest.mark.parametrize("make", [old_matlab, new_matlab])
def test_matlab_files_of_others_both_versions(tmp_path: Path, make) -> None:
    struct = {"t_ms": 1e3 * TIME, "Pressure": PRESSURE, "force_N": 3.0 * TIME, "who": "me", "matrix": np.eye(3)}
    path = make(tmp_path / "a.mat", data=struct, gain=3.0)
    line = refusal(path)
    assert "a.mat: pressure has no unit: state one, such as bar, N" in line
    for given_to in ("pressure", "Pressure"):
        read = read_any(path, units={given_to: "bar"})
        assert np.array_equal(read.recording["pressure"], PRESSURE * 1e5)
        # a thousand and a thousandth: two roundings
        assert np.allclose(read.recording.time, TIME, rtol=4e-16, atol=0)
        assert read.recording.unit("force") == "N"
        assert read.remarks == ["data.matrix is left out: its shape is 3 x 3, and a channel is one row of numbers"]
        assert read.recording.meta["source"]["values"] == {"data.who": "me", "gain": 3.0}
    told = make(tmp_path / "b.mat", time=TIME, Pressure=PRESSURE, units={"Pressure": "kPa"})
    assert np.array_equal(read_any(told).recording["pressure"], PRESSURE * 1e3)


def tdms(path: Path, *channels: tuple[str, str, np.ndarray, dict], **root) -> Path:
    import nptdms

    with open(path, "wb") as stream, nptdms.TdmsWriter(stream) as writer:
        parts = [nptdms.ChannelObject(*one) for one in channels]
        writer.write_segment([nptdms.RootObject(root), *parts])
    return path


def test_tdms_files_of_others(tmp_path: Path) -> None:
    wave = {"wf_increment": 1e-3, "wf_start_offset": 0.5}
    path = tdms(
        tmp_path / "a.tdms",
        ("Log", "cDAQ1/ai0", PRESSURE, {"unit_string": "bar", **wave}),
        ("Log", "Force", TIME.astype(np.float32), {"NI_UnitDescription": "kN", **wave}),
        operator="me",
    )
    record = read_any(path).recording
    assert record.names() == ["cdaq1_ai0", "force"]
    assert np.array_equal(record.time, 0.5 + TIME)
    assert np.array_equal(record["force"], TIME.astype(np.float32).astype(float) * 1e3)
    assert record.meta["source"]["properties"] == {"operator": "me"}
    begin = np.datetime64("2026-01-02T03:04:05", "us")
    dated = [
        ("A", "Time", begin + (TIME * 1e6).astype("timedelta64[us]"), {}),
        ("A", "p", PRESSURE, {"unit_string": "bar"}),
        ("A", "other", PRESSURE[:7], {"unit_string": "bar"}),
    ]
    read = read_any(tdms(tmp_path / "b.tdms", *dated))
    assert np.allclose(read.recording.time, TIME, rtol=0, atol=1e-9)  # dates in whole microseconds, binary seconds
    assert read.recording.meta["source"]["start"].startswith("2026-01-02T03:04:05")
    assert read.remarks == ["other is left out: the time has other samples"]


def test_parquet_files_of_others(tmp_path: Path) -> None:
    import polars

    columns = {"t [ms]": 1e3 * TIME, "Tank.Pressure_abs [bar]": PRESSURE, "on": TIME > 0.01, "note": ["a"] * 50}
    polars.DataFrame(columns).write_parquet(tmp_path / "a.parquet")
    read = read_any(tmp_path / "a.parquet")
    assert np.array_equal(read.recording["tank.pressure_abs"], PRESSURE * 1e5)
    assert (read.recording.unit("on"), read.recording["on"].sum()) == ("1", float((TIME > 0.01).sum()))
    assert read.remarks == ["note is left out: it holds no real numbers"]


def test_tables_of_others_take_the_same_words(tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_text("t;p\n" + "".join(f"{t!r};{p!r}\n" for t, p in zip(TIME.tolist(), PRESSURE.tolist(), strict=True)))
    assert "a.csv: p has no unit" in refusal(path)
    assert "or state it" in refusal(path)
    assert np.array_equal(read_any(path, units={"p": "bar"}).recording["p"], PRESSURE * 1e5)


def refusal(path: Path, **options) -> str:
    with pytest.raises(InputError) as refused:
        read_any(path, **options)
    assert "\n" not in str(refused.value)
    assert path.name in str(refused.value)
    return str(refused.value)


@pytest.mark.parametrize(
    ("variables", "options", "says"),
    [
        ({"p_bar": PRESSURE}, {}, "time is in no column"),
        ({"p_bar": PRESSURE, "t": TIME}, {"period": 0.1}, "give one of the two"),
        ({"p_bar": PRESSURE}, {"period": -1.0}, "above 0 s"),
        ({"p_bar": PRESSURE, "t_bar": TIME}, {}, "must be a time such as s or ms"),
        ({"p_bar": PRESSURE - 10.0, "t": TIME}, {}, "below vacuum"),
        ({"p": PRESSURE, "t": TIME}, {"units": {"p": "glug"}}, "must be a unit such as"),
        ({"p_bar": PRESSURE, "t": TIME}, {"units": {"q": "bar"}}, "The columns are p"),
        ({"p_bar": PRESSURE, "t": TIME}, {"columns": {"time": "t", "x": "q"}}, "The file has p_bar, t"),
        ({"p_bar": PRESSURE, "t": TIME}, {"columns": {"time": "t", "x": 9}}, "must be between 1 and 2"),
        ({"p_bar": PRESSURE, "q_N": TIME[:9]}, {}, "have 2 clocks"),
        ({"t": TIME}, {}, "at least one column beside the time"),
        ({"word": "a"}, {}, "at least one column of numbers"),
    ],
)
def test_what_cannot_be_a_recording_is_said_in_one_line(tmp_path: Path, variables, options, says) -> None:
    assert says in refusal(old_matlab(tmp_path / "a.mat", **variables), **options)


def test_a_period_and_chosen_columns_make_a_recording(tmp_path: Path) -> None:
    path = old_matlab(tmp_path / "a.mat", p=PRESSURE, q=TIME[:9], r=PRESSURE)
    read = read_any(path, columns={"tank.pressure": "p"}, units={"tank.pressure": "bar"}, period=0.002)
    assert read.recording.names() == ["tank.pressure"]
    assert np.array_equal(read.recording.time, 0.002 * np.arange(50))


@pytest.mark.parametrize("suffix", writable())
def test_a_file_of_a_newer_version_is_refused_in_one_line(tmp_path: Path, suffix: str, monkeypatch) -> None:
    for module in (sidecar, store):
        monkeypatch.setattr(module, "SCHEMA", 2)
    write(some(), tmp_path / f"new{suffix}")
    monkeypatch.undo()
    line = refusal(tmp_path / f"new{suffix}")
    assert "schema must be at most 1 for this version of mckibben, got 2; a newer one wrote it" in line


@pytest.mark.parametrize("suffix", [s for s in readable() if s != ".csv.gz"])
@pytest.mark.parametrize("content", [b"", b"\x00" * 300, b"nonsense\n1,2", b"# mckibben recording\n"])
def test_what_is_no_such_file_is_refused_in_one_line(tmp_path: Path, suffix: str, content: bytes) -> None:
    (tmp_path / f"a{suffix}").write_bytes(content)
    refusal(tmp_path / f"a{suffix}")


@pytest.mark.parametrize("suffix", [".mat", ".tdms", ".parquet"])
@settings(max_examples=15, deadline=None)
@given(data=st.data())
def test_damaged_files_are_read_or_refused_and_never_crash(suffix: str, data: st.DataObject) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = write_to(some(30), Path(folder) / f"a{suffix}")
        content = bytearray(path.read_bytes())
        for _ in range(data.draw(st.integers(0, 5))):
            content[data.draw(st.integers(0, len(content) - 1))] ^= data.draw(st.integers(1, 255))
        path.write_bytes(content[: data.draw(st.integers(0, len(content)))])
        try:
            read_any(path)
        except InputError as error:
            assert "\n" not in str(error)


def test_what_polars_says_of_a_broken_file_is_not_shown(tmp_path: Path, capfd) -> None:
    """Some damage makes its threads panic, with forty lines each on standard error, below Python's."""
    content = write_to(some(30), tmp_path / "a.parquet").read_bytes()
    rng = random.Random(0)
    for _ in range(30):
        data = bytearray(content)
        for _ in range(20):
            data[rng.randrange(len(data))] = rng.randrange(256)
        (tmp_path / "a.parquet").write_bytes(data)
        with contextlib.suppress(InputError):
            read_any(tmp_path / "a.parquet")
    assert capfd.readouterr() == ("", "")


def test_a_panic_of_polars_is_one_line(tmp_path: Path, monkeypatch, read_here) -> None:
    class Panic(BaseException):
        """As polars raises."""

    def panic(*_: object, **__: object) -> None:
        raise Panic("assertion failed: offset + length <= self.length")

    path = write_to(some(30), tmp_path / "a.parquet")
    monkeypatch.setattr("polars.read_parquet", panic)
    with pytest.raises(InputError, match="cannot be read as a Parquet file .assertion failed"):
        read_any(path)


def test_a_matlab_variable_without_checksum_cannot_bring_us_down(tmp_path: Path) -> None:
    path = old_matlab(tmp_path / "a.mat", t=TIME, p_bar=PRESSURE)
    assert len(read_any(path).recording) == 50
    content = bytearray(path.read_bytes())
    # The number of dimensions of the first variable; SciPy's reader would end with a segmentation fault.
    content[128 + 8 + 16 + 4 : 128 + 8 + 16 + 8] = struct.pack("<I", 0x7FFFFFF0)
    path.write_bytes(content)
    assert "cannot be read as a MATLAB file" in refusal(path)


def test_a_tdms_file_that_was_cut_off_says_so_and_prints_nothing(tmp_path: Path, capfd) -> None:
    path = tdms(tmp_path / "a.tdms", ("A", "t", TIME, {}), ("A", "p", PRESSURE, {"unit_string": "bar"}))
    path.write_bytes(path.read_bytes()[:-80])
    read = read_any(path)
    assert np.array_equal(read.recording["p"], 1e5 * PRESSURE[:40])  # 80 bytes are 10 of its numbers
    assert "less data than expected" in read.remarks[0]
    own = write_to(some(1000), tmp_path / "own.tdms")
    own.write_bytes(own.read_bytes()[:-80])
    assert "damaged or cut off" in refusal(own)
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(("suffix", "library"), [(".tdms", "nptdms"), (".parquet", "polars"), (".mat", "pymatreader")])
def test_a_missing_library_is_told_with_what_to_install(
    tmp_path: Path, suffix, library, monkeypatch, read_here
) -> None:
    path = write_to(some(), tmp_path / f"a{suffix}")
    monkeypatch.setitem(sys.modules, library, None)
    assert "pip install 'mckibben[formats]'" in refusal(path)
    if suffix != ".mat":
        with pytest.raises(InputError, match=r"mckibben\[formats\]"):
            write(some(), tmp_path / f"b{suffix}")
        assert not (tmp_path / f"b{suffix}").exists()


def test_plain_formats_need_no_library_of_these(tmp_path: Path, monkeypatch) -> None:
    for library in ("nptdms", "polars", "pymatreader"):
        monkeypatch.setitem(sys.modules, library, None)
    for suffix in (".nc", ".csv", ".mcap"):
        assert_same(read_any(write_to(some(), tmp_path / f"a{suffix}")).recording, some())
    write(some(), tmp_path / "a.mat")  # SciPy writes it


def test_words_for_files_of_others_are_refused_for_recordings(tmp_path: Path) -> None:
    for suffix in writable():
        path = write_to(some(), tmp_path / f"a{suffix}")
        assert "unit is" in refusal(path, units={"tank.pressure": "bar"})
        assert "period is" in refusal(path, period=0.1)


def test_places_that_cannot_be_written_are_refused_before_anything_is_read(tmp_path: Path) -> None:
    path = write_to(some(), tmp_path / "a.nc")
    for target, says in (
        ("a.xyz", "Known are .nc"),
        ("none/a.csv", "there is no folder"),
        ("a.nc", "choose another name"),
    ):
        with pytest.raises(InputError, match=says):
            convert(path, tmp_path / target)
    with pytest.raises(InputError, match="not found"):
        convert(tmp_path / "missing.mat", tmp_path / "b.nc")
    assert [p.name for p in tmp_path.iterdir()] == ["a.nc"]
    assert_same(read_any(path).recording, some())


def test_a_matlab_file_too_long_for_its_version_is_refused(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("mckibben.formats.exchange._LARGEST", 79)
    with pytest.raises(InputError, match="take netCDF"):
        write(some(10), tmp_path / "a.mat")
    assert not list(tmp_path.iterdir())


def test_a_warning_of_the_reader_becomes_a_remark(tmp_path: Path, monkeypatch, read_here) -> None:
    import pymatreader
    from scipy.io import savemat

    def read(path):
        warnings.warn("Complex objects are\nnot supported", stacklevel=1)
        return {"t": TIME, "f_N": PRESSURE}

    monkeypatch.setattr(pymatreader, "read_mat", read)
    savemat(tmp_path / "a.mat", {"t": TIME}, do_compression=True)
    assert read_any(tmp_path / "a.mat").remarks == ["Complex objects are not supported"]
