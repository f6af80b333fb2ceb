"""A recording is one immutable value, and files give back exactly what was saved."""

import copy
import inspect
import io
import json
import math
import os
import pickle
import tempfile
import time as clock
from pathlib import Path

import numpy as np
import pytest
import xarray
from hypothesis import given, settings
from hypothesis import strategies as st

from mckibben.accessors import PLACES, implementation
from mckibben.errors import InputError
from mckibben.recordings import Channel, Recording, read_record, read_recording
from mckibben.recordings.files import select_between
from mckibben.recordings.recording import KINDS

SUFFIXES = (".nc", ".csv")
# What makes floats hard: no shortest decimal, signed zero, the ends of the range, and what is no number.
HARD = [0.1 + 0.2, -0.0, 5e-324, 1.7976931348623157e308, math.pi, 1e-300, math.nan, math.inf, -math.inf, 1 / 3]
META = {
    "title": "Filling of a tank",
    "created": "2026-01-02T03:04:05Z",
    "result": "DONE",
    "parameters": {"tube.length": 0.1 + 0.2, "valve.conductance": 5e-9, "n": 10**17},
    "balance": {"mass": math.nan, "energy": -math.inf, "late": [1.0, math.inf, {"deep": None}]},
    "events": [{"time": 0.5, "what": "valve opens\nand more, with \"quotes\", # and 'µ'"}],
    "versions": {},
    "ok": True,
}


def some(n: int = 10) -> Recording:
    t = np.arange(n) * 1e-3
    return Recording(
        t,
        {
            "tank.pressure_abs": Channel((HARD * (n // 10 + 1))[:n], "Pa", "true", "absolute pressure, in the tank"),
            "tank.pressure": Channel(1e5 * np.sin(t), "Pa", "measured"),
            "tube.mass_flow": Channel(t / 3.0, "kg/s"),
            "valve.command": Channel(t > 0.004, "1", "command", "1 is open"),
        },
        META,
    )


def bits(values: np.ndarray) -> bytes:
    # NaN has many bit patterns, and all of them are NaN in a text.
    return np.where(np.isnan(values), np.nan, values).tobytes()


def assert_same(found: Recording, kept: Recording) -> None:
    assert found == kept
    assert list(found.channels) == list(kept.channels)  # their order too
    assert found.time.tobytes() == kept.time.tobytes()
    for name in kept.channels:
        assert bits(found[name]) == bits(kept[name]), name
        assert (found.unit(name), found.channels[name].kind) == (kept.unit(name), kept.channels[name].kind)
        assert found.channels[name].meaning == kept.channels[name].meaning


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_gives_back_the_same_bits(tmp_path: Path, suffix: str) -> None:
    path = some().save(tmp_path / f"run{suffix}")
    assert path == tmp_path / f"run{suffix}"
    found = read_recording(path)
    assert_same(found, some())
    assert found.meta["parameters"] == META["parameters"]
    assert math.isnan(found.meta["balance"]["mass"])
    assert found.meta["balance"]["late"][1] == math.inf


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize(
    "kept",
    [Recording([0.0], {"a": Channel([1.0])}), Recording([0.0, 1.0], {}, {"title": ""}), Recording([-1e9], {})],
    ids=["one sample", "no channels", "nothing"],
)
def test_the_smallest_recordings_survive(tmp_path: Path, suffix: str, kept: Recording) -> None:
    assert_same(read_recording(kept.save(tmp_path / f"small{suffix}")), kept)


NAMES = st.from_regex(r"[\w][\w.\- ()+%']{0,20}", fullmatch=True).filter(
    lambda name: name.isprintable() and name.strip() == name and name != "time"
)
NUMBERS = st.floats(width=64)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | NUMBERS | st.text(st.characters(exclude_categories=["Cs"])),
    lambda inner: (
        st.lists(inner, max_size=3)
        | st.dictionaries(st.text(st.characters(exclude_categories=["Cs"]), max_size=5), inner, max_size=3).filter(
            lambda d: not any(key.startswith("$") for key in d)
        )
    ),
    max_leaves=8,
)


@st.composite
def recordings(draw: st.DrawFn) -> Recording:
    time = sorted(draw(st.sets(st.floats(-1e6, 1e6), min_size=1, max_size=6)))
    column = st.lists(NUMBERS, min_size=len(time), max_size=len(time))
    channels = {
        name: Channel(
            draw(column),
            draw(st.sampled_from(["Pa", "kg/s", "1", "m^3/(s Pa)", "N m"])),
            draw(st.sampled_from(KINDS)),
            draw(st.text(st.characters(exclude_categories=["Cs"]), max_size=8).filter(str.isprintable)),
        )
        for name in draw(st.sets(NAMES, max_size=3))
    }
    meta = draw(st.dictionaries(st.sampled_from(["title", "created", "events", "balance"]), JSON, max_size=3))
    return Recording(time, channels, meta)


@settings(max_examples=60, deadline=None, database=None, derandomize=True)
@given(kept=recordings(), suffix=st.sampled_from(SUFFIXES))
def test_any_recording_survives_its_file(kept: Recording, suffix: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        assert_same(read_recording(kept.save(Path(folder) / f"any{suffix}")), kept)


def test_netcdf_looks_sensible_in_plain_xarray(tmp_path: Path) -> None:
    path = some().save(tmp_path / "run.nc")
    with xarray.open_dataset(path, engine="h5netcdf") as ds:
        assert dict(ds.sizes) == {"time": 10}
        assert list(ds.coords) == ["time"]
        assert ds.time.dtype == np.float64  # seconds stay numbers, they do not become dates
        assert ds.time.attrs["units"] == "s"
        assert list(ds.data_vars) == some().names()
        np.testing.assert_array_equal(ds["tank.pressure"].values, some()["tank.pressure"])
        assert ds["tank.pressure_abs"].attrs == {
            "units": "Pa",
            "long_name": "absolute pressure, in the tank",
            "kind": "true",
        }
        assert ds["tube.mass_flow"].attrs["long_name"] == "tube.mass_flow"  # no meaning was given
        assert ds.attrs["schema"] == 1
        assert ds.attrs["title"] == META["title"]
        # Standard JSON, which knows no NaN: other languages read it.
        meta = json.loads(ds.attrs["meta"], parse_constant=pytest.fail)
        assert meta["parameters"]["n"] == 10**17
        assert float(ds["valve.command"].sel(time=0.005)) == 1.0


def test_meta_may_be_larger_than_an_hdf5_attribute_used_to_be(tmp_path: Path) -> None:
    kept = some().with_meta(log=["a line of a long log"] * 20_000)  # 0.5 MB; compact attributes end at 64 KiB
    assert read_recording(kept.save(tmp_path / "long.nc")) == kept


def test_csv_opens_in_other_programs(tmp_path: Path) -> None:
    path = some().with_meta(note="no, # commas matter").save(tmp_path / "run.csv")
    lines = path.read_text(encoding="utf-8").splitlines()
    numbers = [line for line in lines if not line.startswith("#")]
    assert numbers[0] == "time [s],tank.pressure_abs [Pa],tank.pressure [Pa],tube.mass_flow [kg/s],valve.command [1]"
    table = np.genfromtxt(io.StringIO("\n".join(numbers[1:])), delimiter=",")  # another reader than ours
    np.testing.assert_array_equal(table[:, 3], some()["tube.mass_flow"])
    told = {line[2:].partition(": ")[0]: line.partition(": ")[2] for line in lines if line.startswith("#")}
    assert json.loads(told["schema"]) == 1
    assert json.loads(told["channels"])["valve.command"] == {"kind": "command", "meaning": "1 is open"}
    assert json.loads(told["meta"], parse_constant=pytest.fail)["title"] == META["title"]


def test_our_csv_reads_as_a_record_of_others_as_well(tmp_path: Path) -> None:
    kept = some().pick(["tank.pressure", "tube.mass_flow", "valve.command"])
    found = read_record(kept.save(tmp_path / "run.csv"))
    for name in kept.channels:
        np.testing.assert_array_equal(found[name], kept[name])  # SI stays SI without a rounding
        assert found.unit(name) == kept.unit(name)


def test_csv_of_a_minute_at_a_kilohertz_reads_in_seconds(tmp_path: Path) -> None:
    # 20 channels: 0.9 s to write and 0.3 to 0.4 s to read on one core of 2026; the bounds leave room for a busy machine.
    n, noise = 60_000, np.random.default_rng(3)
    kept = Recording(np.arange(n) * 1e-3, {f"node{i}.pressure": Channel(noise.normal(size=n)) for i in range(20)})
    begin = clock.perf_counter()
    path = kept.save(tmp_path / "long.csv")
    written = clock.perf_counter()
    assert read_recording(path) == kept
    assert written - begin < 30.0
    assert clock.perf_counter() - written < 15.0


@pytest.mark.parametrize("suffix", SUFFIXES)
@pytest.mark.parametrize("step", ["fsync", "replace"])
def test_a_write_that_fails_leaves_the_old_file_and_no_rest(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, step: str
) -> None:
    path = some().save(tmp_path / f"run{suffix}")
    before = path.read_bytes()

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, step, full)
    with pytest.raises(InputError, match="No space left"):
        some().with_meta(title="other").save(path)
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_file_is_replaced_whole(tmp_path: Path, suffix: str) -> None:
    path = some(500).save(tmp_path / f"run{suffix}")
    assert_same(read_recording(some(10).save(path)), some(10))
    assert list(tmp_path.iterdir()) == [path]


def test_a_recording_cannot_be_changed_in_place() -> None:
    rec, mine, meta = some(), np.ones(10), {"protocol": {"steps": [1]}}
    held = rec.with_channels({"x": Channel(mine)}).with_meta(meta)
    mine[:] = 7.0
    meta["protocol"]["steps"].append(2)
    assert held["x"].max() == 1.0
    assert held.meta["protocol"]["steps"] == [1]
    for change in (
        lambda: held["x"].__setitem__(0, 2.0),
        lambda: held.time.__setitem__(0, 2.0),
    ):
        with pytest.raises(ValueError, match="read-only"):
            change()
    for change in (
        lambda: held.meta.__setitem__("title", "x"),
        lambda: held.meta["protocol"].update(a=1),
        lambda: held.channels.pop("x"),
    ):
        with pytest.raises(TypeError, match="cannot be changed"):
            change()
    with pytest.raises(AttributeError):
        rec.time = mine  # type: ignore[misc]


def test_copies_and_pickles_are_equal() -> None:
    # Sweeps send recordings between processes.
    assert_same(pickle.loads(pickle.dumps(some())), some())
    assert_same(copy.deepcopy(some()), some())
    assert json.loads(json.dumps(some().meta))["title"] == META["title"]


def test_recordings_differ_by_anything_they_hold() -> None:
    rec = some()
    x = rec.channels["tank.pressure"]
    others = [
        rec.with_meta(title="x"),
        rec.pick(["tank.pressure"]),
        rec.select(0.001),
        rec.with_channels({"tank.pressure": Channel(x.values + 1e-9, x.unit, x.kind)}),
        rec.with_channels({"tank.pressure": Channel(x.values, "N", x.kind)}),
        rec.with_channels({"tank.pressure": Channel(x.values, x.unit, "true")}),
        rec.with_channels({"tank.pressure": Channel(x.values, x.unit, x.kind, "other")}),
    ]
    assert all(other != rec for other in others)
    assert rec != "a recording"


def test_channels_are_found_by_name_and_kind() -> None:
    rec = some()
    assert rec.names() == ["tank.pressure_abs", "tank.pressure", "tube.mass_flow", "valve.command"]
    assert rec.names("measured") == ["tank.pressure"]
    assert rec.names("command") == ["valve.command"]
    assert "tube.mass_flow" in rec
    assert "nothing" not in rec
    assert rec.unit("tube.mass_flow") == "kg/s"
    assert rec["time"] is rec.time
    assert rec.unit("time") == "s"
    assert list(rec.pick(["valve.command", "tank.pressure"]).channels) == ["valve.command", "tank.pressure"]
    assert "10 samples" in repr(rec)
    with pytest.raises(InputError, match="tank.pressure_abs"):
        rec["tank.temperature"]
    with pytest.raises(InputError, match="Known are true, measured, command"):
        rec.names("real")


def test_select_includes_its_ends_whatever_their_last_digit() -> None:
    t = np.arange(11) * 0.1  # 0.1 * 3 is 0.30000000000000004
    rec = Recording(t, {"x": Channel(t)}, {"title": "kept"})
    assert rec.select(0.1, 0.3)["x"].tolist() == t[1:4].tolist()
    assert rec.select(0.3).time[0] == t[3]
    assert len(rec.select(end=0.25)) == 3
    assert len(rec.select()) == 11
    assert rec.select(0.1, 0.3).meta == {"title": "kept"}
    for start, end in ((0.31, 0.39), (2.0, 3.0), (0.5, 0.2), (math.nan, 1.0)):
        with pytest.raises(InputError, match="holds no sample"):
            rec.select(start, end)


def test_a_stretch_may_have_one_end_and_one_without_samples_is_refused_with_both() -> None:
    rec = Recording(np.arange(11) * 0.1, {})
    assert select_between(rec, None, None) is rec
    assert len(select_between(rec, 0.3, None)) == 8 and len(select_between(rec, None, "0.25")) == 3
    with pytest.raises(InputError, match="start.*end.*holds no sample"):
        select_between(rec, 2.0, None)


def test_period_and_duration_are_those_of_the_clock() -> None:
    rec = Recording([1.0, 1.1, 1.2, 1.5], {})
    assert rec.period == pytest.approx(0.1, rel=1e-12)
    assert rec.duration == 0.5
    assert len(rec) == 4
    with pytest.raises(InputError, match="2 samples"):
        Recording([1.0], {}).period  # noqa: B018


@given(period=st.floats(1e-3, 0.5), slope=st.floats(-1e6, 1e6))
@settings(max_examples=50, deadline=None, database=None, derandomize=True)
def test_a_straight_line_stays_itself_on_a_uniform_clock(period: float, slope: float) -> None:
    t = 5.0 + np.sort(np.concatenate([[0.0, 1.0], np.random.default_rng(1).uniform(0.01, 0.99, 40)]))
    found = Recording(t, {"x": Channel(slope * t, "m", "measured", "way")}, {"title": "kept"}).uniform(period)
    assert found.time[0] == 5.0
    assert found.time[-1] <= 6.0 + 1e-9 * period  # nothing beyond the data ...
    assert found.time[-1] > 6.0 - period * (1.0 + 1e-9)  # ... and all that they cover
    np.testing.assert_allclose(np.diff(found.time), period, rtol=1e-11)  # 5 s has 1e-15 s
    # Rounding of the line through two points 1e-4 s apart at 5 s.
    np.testing.assert_allclose(found["x"], slope * found.time, rtol=1e-11, atol=1e-9)
    assert found.channels["x"].unit == "m"
    assert found.channels["x"].kind == "measured"
    assert found.meta == {"title": "kept"}


def test_a_uniform_clock_of_the_same_period_changes_nothing() -> None:
    # 0.1 * 3 / 0.1 is not 3 in binary: the last sample must not be lost.
    t = np.arange(1001) * 1e-3
    rec = Recording(t, {"x": Channel(np.sin(t))})
    assert len(rec.uniform(1e-3)) == 1001
    np.testing.assert_allclose(rec.uniform()["x"], rec["x"], rtol=0, atol=1e-12)  # the median differs by 1e-16 s a step
    jittered = Recording(t.round(3)[[0, 1, 3, 4, 7]], {})
    assert len(jittered.uniform(1e-3)) == 8


@pytest.mark.parametrize("period", [0.0, -1e-3, math.nan, math.inf, 1e-12])
def test_an_impossible_period_is_refused(period: float) -> None:
    with pytest.raises(InputError, match="period"):
        some().select(0.0, 0.009).uniform(period)


def test_the_summary_is_that_of_the_samples() -> None:
    rec = Recording([0.0, 1.0, 3.0], {"x": Channel([1.0, -2.0, 4.0], "N", "measured"), "gap": Channel([math.nan] * 3)})
    rec = rec.with_channels({"half": Channel([math.nan, 1.0, 3.0])})
    found = rec.summary()
    assert found["x"] == {"min": -2.0, "max": 4.0, "mean": 1.0, "unit": "N", "kind": "measured"}
    assert found["half"]["mean"] == 2.0
    assert math.isnan(found["gap"]["max"])


def test_the_dataset_is_what_the_file_holds(tmp_path: Path) -> None:
    with xarray.open_dataset(some().save(tmp_path / "run.nc"), engine="h5netcdf") as stored:
        assert some().to_xarray().identical(stored.load())


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda: Recording([0.0, 1.0, 1.0], {}), "time of sample 2 must be later than the one before, got 1.0 s"),
        (lambda: Recording([0.0, 1.0, 0.5], {}), "later than"),
        (lambda: Recording([0.0, math.nan], {}), "time of sample 1 must be a finite time, got nan"),
        (lambda: Recording([], {}), "at least one sample"),
        (lambda: Recording([[0.0, 1.0]], {}), "one dimension"),
        (lambda: Recording([0.0, 1.0], {"x": Channel([1.0])}), "channel x must have 2 values"),
        (lambda: Recording([0.0], {"x": [1.0]}), "must be a Channel"),
        (lambda: Recording([0.0], [("x", Channel([1.0]))]), "must be a mapping"),
        (lambda: Recording([0.0], {"time": Channel([1.0])}), "not 'time'"),
        (lambda: Recording([0.0], {"tank/pressure": Channel([1.0])}), "tank/pressure"),
        (lambda: Recording([0.0], {"a,b": Channel([1.0])}), "a,b"),
        (lambda: Recording([0.0], {" a": Channel([1.0])}), "' a'"),
        (lambda: Recording([0.0], {"": Channel([1.0])}), "name of a channel"),
        (lambda: Recording([0.0], {3: Channel([1.0])}), "name of a channel"),
        (lambda: Channel([1.0], "kPa"), "unit of a channel must be an SI unit"),
        (lambda: Channel([1.0], "bar"), "SI unit"),
        (lambda: Channel([1.0], "deg"), "SI unit"),
        (lambda: Channel([1.0], ""), "SI unit"),
        (lambda: Channel([1.0], "Pa", "guessed"), "Known are true, measured, command"),
        (lambda: Channel([1.0], "Pa", "true", "two\nlines"), "one line"),
        (lambda: Channel(["a"]), "real numbers"),
        (lambda: Channel([1j]), "real numbers"),
        (lambda: Channel([[1.0], [1.0, 2.0]]), "real numbers"),
        (lambda: Channel(3.0), "one dimension"),
        (
            lambda: Recording([0.0], {}, {"rig": {"serial": object()}}),
            "meta.rig.serial must be numbers, texts",
        ),
        (lambda: Recording([0.0], {}, {"a": [1, {2: 3}]}), "key of meta.a.1"),
        (lambda: Recording([0.0], {}, {"$float": "nan"}), "does not begin with"),
        (lambda: Recording([0.0], {}, {"a": "\ud800"}), "UTF-8"),
        (lambda: Recording([0.0], {}, "title"), "must be a mapping"),
        (lambda: some().pick("tank.pressure"), "list of names"),
        (lambda: some().pick(["nothing"]), "nothing"),
        (lambda: some().save("run.mat"), "Known are .nc, .csv"),
        (lambda: some().save("run"), "Known are .nc, .csv"),
        (lambda: some().save("no-such-folder/run.nc"), "no folder"),
        (lambda: read_recording(__file__), "Known are .nc, .csv"),
        (lambda: read_recording("nowhere.nc"), "not found"),
    ],
)
def test_what_no_recording_can_be_is_refused(change, said: str) -> None:
    with pytest.raises(InputError) as refused:
        change()
    assert said in str(refused.value)
    assert "\n" not in str(refused.value)


def test_arrays_and_numpy_scalars_are_plain_in_the_meta() -> None:
    rec = Recording([0.0], {}, {"a": np.arange(3), "b": np.float64(0.5), "c": (np.int64(2), np.bool_(True))})
    assert rec.meta == {"a": [0, 1, 2], "b": 0.5, "c": [2, True]}
    assert type(rec.meta["b"]) is float


def broken(path: Path, change) -> Path:
    path.write_text(change(path.read_text(encoding="utf-8")), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (
            lambda s: s.replace("# schema: 1", "# schema: 2"),
            "schema must be at most 1 for this version of mckibben, got 2",
        ),
        (lambda s: s.replace("# schema: 1\n", ""), "schema is missing"),
        (lambda s: s.replace("# schema: 1", "# schema: one"), "must be JSON"),
        (lambda s: s.replace("# schema: 1", '# schema: "1"'), "whole number"),
        (lambda s: s.replace("# schema: 1", "# schema: 0"), "whole number"),
        (lambda s: s.replace("# mckibben recording\n", ""), "a table of others is converted into one first"),
        (lambda s: s.replace('"result": "DONE"', '"result": DONE'), "meta must be JSON"),
        (lambda s: s.replace("time [s],", "t [s],"), "header must be 'time [s]' first, got 't [s]"),
        (
            lambda s: s.replace("tank.pressure [Pa]", "tank.tension [Pa]"),
            "header must be 'name [unit]' with",
        ),
        (
            lambda s: s.replace("tank.pressure [Pa]", "tank.pressure [kPa]"),
            "unit of a channel must be an SI unit",
        ),
        (lambda s: s.replace("0.003,", "0.001,"), "later than"),
        (lambda s: s[: s.rindex(",")], "numbers cannot be read"),
        (lambda s: s.replace("0.003,", "three,"), "three"),
        (
            lambda s: "\n".join(line + ",1" if line[0].isdigit() else line for line in s.splitlines()),
            "must have 5 columns",
        ),
        (lambda s: "\n".join(line for line in s.splitlines() if not line[0].isdigit()), "at least one sample"),
        (lambda s: "\n".join(s.splitlines()[:3]), "file has no numbers"),
        (lambda s: "", "file is empty"),
    ],
)
def test_a_broken_csv_is_refused_by_name(tmp_path: Path, change, said: str) -> None:
    path = broken(some().save(tmp_path / "run.csv"), change)
    with pytest.raises(InputError) as refused:
        read_recording(path)
    assert said in str(refused.value)
    assert path.name in str(refused.value)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda ds: ds.assign_attrs(schema=2), "schema must be at most 1 for this version of mckibben, got 2"),
        (lambda ds: ds.drop_attrs(), "no recording of mckibben"),
        (lambda ds: ds.assign_attrs(schema="one"), "whole number"),
        (lambda ds: ds.assign_attrs(meta="{"), "meta must be JSON"),
        (lambda ds: ds.rename(time="t"), "must have the dimension time"),
        (lambda ds: ds.drop_vars("time"), "time is missing"),
        (lambda ds: ds.assign({"tank.pressure": ds["tank.pressure"].assign_attrs(units="bar")}), "'bar'"),
        (lambda ds: ds.assign({"tank.pressure": ds["tank.pressure"].assign_attrs(kind="x")}), "kind of a channel"),
        (lambda ds: ds.assign_coords(time=("time", np.zeros(10))), "later than"),
    ],
)
def test_a_broken_netcdf_is_refused_by_name(tmp_path: Path, change, said: str) -> None:
    path = tmp_path / "run.nc"
    change(some().to_xarray()).to_netcdf(path, engine="h5netcdf")
    with pytest.raises(InputError) as refused:
        read_recording(path)
    assert said in str(refused.value)
    assert path.name in str(refused.value)


@pytest.mark.parametrize("keep", [0, 7, 0.3, 0.9])
def test_half_a_netcdf_file_is_refused(tmp_path: Path, keep: float) -> None:
    path = some(5000).save(tmp_path / "run.nc")
    whole = path.read_bytes()
    path.write_bytes(whole[: int(keep if keep > 1 else keep * len(whole))])
    with pytest.raises(InputError, match=r"run\.nc: file (cannot be read|is empty)"):
        read_recording(path)


def test_a_picture_called_csv_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "picture.csv"
    path.write_bytes(bytes(range(256)) * 4)
    with pytest.raises(InputError, match=r"picture.csv"):
        read_recording(path)


def test_a_data_frame_has_the_time_for_its_index_and_the_meta_beside_it() -> None:
    pytest.importorskip("pandas")
    record = Recording(
        [0.0, 0.5, 2.0], {"a": Channel([1.0, 2.0, 3.0], "N"), "b": Channel([4.0, 5.0, 6.0], "Pa")}, {"title": "t"}
    )
    frame = record.to_dataframe()
    assert (frame.index.name, frame.index.tolist()) == ("time", [0.0, 0.5, 2.0])
    assert {name: frame[name].tolist() for name in frame} == {"a": [1.0, 2.0, 3.0], "b": [4.0, 5.0, 6.0]}
    assert frame.attrs["title"] == "t"


def test_a_method_has_the_defaults_of_the_function_of_an_upper_room_that_it_calls() -> None:
    """They are stated twice, and one alone could be changed."""
    compared = set()
    for name, method in vars(Recording).items():
        if name not in PLACES or not inspect.isfunction(method):
            continue
        called = inspect.signature(implementation(name)).parameters
        for key, one in inspect.signature(method).parameters.items():
            if one.default is not inspect.Parameter.empty:
                compared.add(name)
                assert called[key].default == one.default, (name, key)
    assert {"contraction_timing", "lever_loops", "force_map"} <= compared
