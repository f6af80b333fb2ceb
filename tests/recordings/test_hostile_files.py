"""What one file can cost is bounded: memory, time, and the ear for a stop, whatever it holds."""

import gzip
import importlib.util
import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import h5py
import numpy as np
import pytest

import mckibben as mk
from mckibben import isolation
from mckibben.documents import parse_json, parse_toml
from mckibben.errors import InputError
from mckibben.formats.registry import BUILT_IN, PLAIN_TEXT
from mckibben.formats.sidecar import undecodable, unreadable
from mckibben.formats.table import ForeignColumn, ForeignTable, StoredRecording
from mckibben.formats.text import read_text_table
from mckibben.recordings import Channel, Recording, read_recording

spec = importlib.util.spec_from_file_location(
    "hostile_files", Path(__file__).parents[2] / "benchmarks/hostile_files.py"
)
hostile_files = importlib.util.module_from_spec(spec)
spec.loader.exec_module(hostile_files)

HERE = os.pathsep.join((str(Path(mk.__file__).parents[1]), str(Path(__file__).parent)))
QUICK = [
    "sparse.xlsx",
    "repeated.ods",
    "zeros.h5",
    "zeros.nc",
    "definition.mcap",
    "empty.tdms",
    "brackets.txt",
    "columns.csv",
]

OF_MEMORY = ("sparse.xlsx", "zeros.h5", "zeros.nc", "definition.mcap")


def holds_the_interpreter(path):
    """As HDF5 does in a ring of pointers: no other thread runs, and no signal is heard."""
    re.match("(a|a)*b", "a" * 60)


@pytest.fixture
def fresh(monkeypatch):
    """A process that finds the functions of this file, and knows the limits of a test."""
    isolation.close()
    monkeypatch.setenv("PYTHONPATH", HERE)
    yield
    isolation.close()


def resident() -> float:
    return int(re.search(r"VmHWM:\s*(\d+)", Path("/proc/self/status").read_text())[1]) * 1024


@pytest.fixture
def small_memory(monkeypatch):
    monkeypatch.setenv(isolation.MEMORY, "400 MB")


def refused(path: Path) -> str:
    with pytest.raises(InputError) as error:
        mk.read(path)
    said = str(error.value)
    assert path.name in said and "\n" not in said
    return said


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory")
@pytest.mark.parametrize("name", QUICK)
def test_a_hostile_file_is_one_sentence_and_costs_little(tmp_path, small_memory, name):
    hostile_files.FILES[name](tmp_path / name)
    before = resident()
    said = refused(tmp_path / name)
    assert ("takes more than 0.373 GiB of memory" in said) == (name in OF_MEMORY)
    # What the largest of these would take is 500 GB; this process parses only what is short.
    assert resident() - before < 100e6


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory")
@pytest.mark.parametrize("line", [b"0,1\n", b"1"])
def test_a_text_that_unpacks_to_much_is_refused_with_the_limit_that_can_be_raised(tmp_path, small_memory, line):
    with gzip.open(tmp_path / "a.csv.gz", "wb") as stream:
        stream.write(b"time [s],pressure [bar]\n")
        for _ in range(100):
            stream.write(line * (1_000_000 // len(line)))
    begun = time.monotonic()
    said = refused(tmp_path / "a.csv.gz")
    assert "reading it takes more than 0.373 GiB of memory; if you trust the file, MCKIBBEN_READ_MEMORY='2 GB'" in said
    assert time.monotonic() - begun < 15.0  # it is unpacked, and not parsed


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux limits memory")
def test_a_limit_that_is_raised_lets_a_sound_file_through(tmp_path, monkeypatch):
    """20 million numbers in 1 MB: what they take here is refused before this process has them."""
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name in ("time", "force"):
            file.create_dataset(name, data=np.arange(10_000_000) // 1000 * 1.0, compression="gzip", chunks=(1_000_000,))
            file[name].attrs["units"] = "N"
    monkeypatch.setenv(isolation.MEMORY, "400 MB")
    assert "MCKIBBEN_READ_MEMORY='2 GB' allows more" in refused(tmp_path / "a.h5")
    monkeypatch.setenv(isolation.MEMORY, "2 GB")
    with pytest.raises(InputError, match="a time such as s"):  # the file was read, and its content is judged
        mk.read(tmp_path / "a.h5")


@pytest.mark.parametrize(("name", "text"), [(isolation.MEMORY, "much"), (isolation.TIME, "-1 s")])
def test_a_limit_that_is_none_is_refused(tmp_path, monkeypatch, name, text):
    (tmp_path / "a.h5").write_bytes(b"x")
    monkeypatch.setenv(name, text)
    with pytest.raises(InputError, match=f"{name} must be a"):
        mk.read(tmp_path / "a.h5")


def test_whoever_holds_the_interpreter_there_holds_nobody_here(tmp_path, fresh, monkeypatch):
    (tmp_path / "a.nc").write_bytes(b"x")
    monkeypatch.setenv(isolation.TIME, "3 s")
    late, done = [], threading.Event()

    def ticks() -> None:
        while not done.is_set():
            begun = time.perf_counter()
            time.sleep(0.001)
            late.append(time.perf_counter() - begun)

    thread = threading.Thread(target=ticks)
    thread.start()
    with pytest.raises(InputError, match="a.nc: reading it did not come to an end within 3 s; .*READ_TIME='12 s'"):
        isolation.call_outside(holds_the_interpreter, tmp_path / "a.nc")
    done.set()
    thread.join()
    assert len(late) > 100 and float(np.median(late)) < 0.05  # of a busy machine


READS = """
import sys
from pathlib import Path
from mckibben import isolation
import test_hostile_files
print("reads", flush=True)
isolation.call_outside(test_hostile_files.holds_the_interpreter, Path(sys.argv[1]))
"""


@pytest.mark.skipif(os.name != "posix", reason="signals")
@pytest.mark.parametrize("ending", [signal.SIGINT, signal.SIGTERM, signal.SIGKILL])
def test_a_signal_ends_a_program_that_reads_and_what_reads_for_it(tmp_path, ending):
    (tmp_path / "a.nc").write_bytes(b"x")
    # a reader that nobody ends any more ends by its time; an interrupt must not need it
    limit = "120 s" if ending == signal.SIGINT else "4 s"
    environment = {**os.environ, "PYTHONPATH": HERE, isolation.TIME: limit}
    program = subprocess.Popen(
        [sys.executable, "-c", READS, str(tmp_path / "a.nc")], env=environment, stdout=subprocess.PIPE,
        stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert program.stdout.readline() == "reads\n"
    begun = time.monotonic()
    while not (readers := hostile_files.memory(program.pid).keys() - {program.pid}):
        assert time.monotonic() - begun < 60.0  # of a busy machine
        time.sleep(0.05)
    (reader,) = readers
    time.sleep(1.0)  # it has been asked, and reads
    begun = time.monotonic()
    program.send_signal(ending)
    _, said = program.communicate(timeout=60)
    assert ("KeyboardInterrupt" in said) == (ending == signal.SIGINT)
    while os.path.exists(f"/proc/{reader}") and "Z" not in Path(f"/proc/{reader}/stat").read_text().split()[2]:
        # 5 s after its time the system ends it
        assert time.monotonic() - begun < 60.0
        time.sleep(0.1)


def test_no_kind_of_file_is_forgotten():
    assert {f".{name}" for name in BUILT_IN} == {*isolation.PARSED, *PLAIN_TEXT}


def test_what_is_read_there_is_what_would_be_read_here():
    t = np.arange(5.0)
    mixed = np.array(["1", None, 2.5, True, "\udce4"], object)
    words = np.array(["a", "", "b\nc", "ä", "x"], object)
    columns = [
        ForeignColumn("a", t, "N", "clock", t), ForeignColumn("b", mixed), ForeignColumn("c", words),
        ForeignColumn("d", t.astype("datetime64[us]")), ForeignColumn("e", np.empty(0, object)),
        ForeignColumn("f", np.empty((0, 3), ">f4")), ForeignColumn("g", np.array([["a\0", "b"]])),
    ]  # fmt: skip
    table = ForeignTable(
        columns, {"deep": [{"$": "map", "x": [1, float("inf"), None]}], "n": np.float32(2)}, ["one"], [2, 3]
    )
    arrays: list = []
    tree = json.loads(json.dumps(isolation.pack(table, arrays)))
    again = isolation.unpack(tree, iter(arrays))
    for one, other in zip(table.columns, again.columns, strict=True):
        assert one[0] == other[0] and one[2:4] == other[2:4]
        np.testing.assert_array_equal(one.values, other.values)
        assert one.values.dtype == other.values.dtype and one.values.shape == other.values.shape
    assert again.notes == {**table.notes, "n": 2.0} and again[2:] == table[2:]
    stored = StoredRecording(t, {"x": Channel(t, "N", "measured", "m")}, {"a": {"b": [1, float("inf")]}})
    again = isolation.unpack(json.loads(json.dumps(isolation.pack(stored, arrays := []))), iter(arrays))
    assert Recording(again.time, again.channels, again.meta) == Recording(stored.time, stored.channels, stored.meta)


@pytest.mark.parametrize("line", ["a [", "a (", "[ ", "1 ", "'1 000", "( [", '"'])
def test_a_text_is_read_in_proportional_time(tmp_path, line):
    """Small texts are read in this process."""

    def seconds(count: int) -> float:
        path = tmp_path / "a.txt"
        path.write_text((line * count + "\n") * 4)
        begun = time.process_time()
        try:
            read_text_table(path)
        except InputError:
            pass
        return time.process_time() - begun

    short = 15_000 // len(line)
    seconds(short)
    # Of a text eight times as long a quadratic reader takes 64 times as long; the rest is the clock of a busy machine.
    assert seconds(8 * short) < 24.0 * seconds(short) + 0.3


@pytest.mark.skipif(os.name != "posix", reason="pipes with a name")
@pytest.mark.parametrize("name", ["a.csv", "a.nc", "a.xlsx", "a.toml"])
def test_a_pipe_into_which_nobody_writes_is_refused(tmp_path, name):
    os.mkfifo(tmp_path / name)
    with pytest.raises(InputError, match="must be a plain file, got .*; it is a pipe"):
        mk.circuit(tmp_path / name) if name.endswith("toml") else mk.read(tmp_path / name)


@pytest.mark.parametrize("name", ["a\nb.csv", "a\nb.xlsx", "a\nb.nc", "a\nb.toml"])
def test_a_name_of_two_lines_is_told_in_one(tmp_path, name):
    (tmp_path / name).write_bytes(b"\0")
    with pytest.raises(InputError) as error:
        mk.circuit(tmp_path / name) if name.endswith("toml") else mk.read(tmp_path / name)
    assert "\n" not in str(error.value) and "a\\nb" in str(error.value)


@pytest.mark.parametrize("number", ["0x" + "F" * 3000, "1" + "0" * 400, "9223372036854775808", "-9223372036854775809"])
def test_a_whole_number_that_toml_does_not_have_is_refused(number):
    with pytest.raises(InputError, match="is not TOML: a whole number takes more than 64 bits"):
        parse_toml(f"[a]\nx = [{number}]", where="a.toml")


def test_a_whole_number_that_no_float_holds_is_refused_in_json():
    with pytest.raises(ValueError, match="300 digits"):
        parse_json('{"x": 1' + "0" * 400 + "}")
    assert parse_json('{"x": "1' + "0" * 400 + '", "y": 12}')["y"] == 12


def test_a_process_is_kept_for_the_next_file_and_not_after_a_large_one(tmp_path, monkeypatch):
    isolation.close()
    t = np.arange(5.0)
    path = Recording(t, {"x": Channel(t, "N")}).save(tmp_path / "a.nc")
    numbers = []
    for most in (1 << 20, 1 << 20, 10):
        monkeypatch.setattr(isolation, "KEPT", most)
        assert len(read_recording(path)) == 5
        numbers.append([reader.process.pid for reader in isolation._idle])
    assert len(numbers[0]) == 1 and numbers[1] == numbers[0] and numbers[2] == []


@pytest.mark.parametrize(
    "error", [OSError("Can't allocate memory for chunk"), MemoryError(), RuntimeError("out of memory")]
)
def test_a_lack_of_memory_is_not_taken_for_a_broken_file(error):
    with pytest.raises(MemoryError), unreadable("a file"):
        raise error
    with pytest.raises(type(error)), undecodable("its messages are not sound"):
        raise error
    with pytest.raises(InputError, match=r"cannot be read as a file \(no end\)"), unreadable("a file"):
        raise OSError("no end")
    for problem, met, said in (
        ("", OSError("no\nend"), "no end"),
        ("", KeyError(), "KeyError"),
        ("broken", OSError("no end"), "broken"),
    ):
        with pytest.raises(ValueError, match=f"^{said}$"), undecodable(problem):
            raise met
