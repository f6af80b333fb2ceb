"""A log survives whatever ends its process: at most the last 0.1 s is lost, and what is left is exact."""

import os
import random
import signal
import struct
import subprocess
import sys
import threading
import time as clock
from pathlib import Path

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.recordings import Channel, LiveLog, Recording, read_recording
from mckibben.recordings.files import read_log

CHANNELS = {
    "muscle.tension": Channel([], "N", "measured", "behind the filter"),
    "muscle.pressure_abs": Channel([], "Pa", "true"),
    "valve.command": Channel([], "1", "command", "1 is open"),
}
META = {"title": "a run", "seed": 3, "nothing": float("nan"), "events": [{"time": 0.0, "text": "began"}]}

# Writers of one sample per millisecond, as a bench does; each notes what `append` has taken before it goes on.
WRITERS = """
import os, struct, sys, time
import numpy as np
import mcap.writer
from mckibben.recordings import Channel, LiveLog

folder, count, flush = sys.argv[1], int(sys.argv[2]), float(sys.argv[3])
pids = []
for i in range(count):
    pid = os.fork()
    if pid:
        pids.append(pid)
        continue
    channels = {f"c{j}": Channel([], "N", "measured") for j in range(20)}
    log = LiveLog(f"{folder}/{i}.mcap", channels, {"title": "killed"}, flush=flush)
    taken = os.open(f"{folder}/{i}.taken", os.O_WRONLY | os.O_CREAT | os.O_APPEND)
    begun = time.monotonic()
    for n in range(60_000):
        log.append(n * 1e-3, np.sin(n * 1e-3 + np.arange(20)))
        os.write(taken, struct.pack("<d", n * 1e-3))
        time.sleep(max(begun + n * 1e-3 - time.monotonic(), 0.0))
    os._exit(0)
print(*pids, flush=True)
for pid in pids:
    os.waitpid(pid, 0)
"""


def killed_writers(folder: Path, moments: list[int], flush: float = 0.05) -> list[np.ndarray]:
    """Start a writer per moment, `kill -9` each when it has taken so many samples; the times [s] that each had taken."""
    command = [sys.executable, "-c", WRITERS, str(folder), str(len(moments)), str(flush)]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as writers:
        assert writers.stdout is not None
        pids = dict(enumerate(map(int, writers.stdout.readline().split())))
        assert len(pids) == len(moments)
        try:
            until = clock.monotonic() + 60.0
            while pids and clock.monotonic() < until:
                for i, pid in list(pids.items()):
                    taken = folder / f"{i}.taken"
                    if taken.exists() and taken.stat().st_size >= 8 * moments[i]:
                        os.kill(pid, signal.SIGKILL)
                        del pids[i]
                clock.sleep(0.003)
            assert not pids, "the writers did not get on"
        finally:
            for pid in pids.values():
                os.kill(pid, signal.SIGKILL)
        writers.wait(timeout=30)
    return [np.frombuffer((folder / f"{i}.taken").read_bytes()) for i in range(len(moments))]


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked and killed as POSIX does")
def test_kill_9_at_twenty_random_moments_loses_at_most_the_last_tenth_of_a_second(tmp_path: Path) -> None:
    seed = random.SystemRandom().randrange(10**6)
    moments = [random.Random(seed + i).randrange(120, 900) for i in range(20)]
    for i, taken in enumerate(killed_writers(tmp_path, moments)):
        found = read_log(tmp_path / f"{i}.mcap")
        record = found.recording
        # 0.1 s is what is promised; the log brings out each 0.05 s.
        assert taken[-1] - record.time[-1] < 0.1, (seed, i)
        assert np.array_equal(record.time, np.arange(len(record)) * 1e-3)
        for j in range(20):
            assert record[f"c{j}"].tobytes() == np.sin(record.time + j).tobytes()
        assert not found.whole
        assert "was not closed" in found.remarks[-1]
        assert record.meta["title"] == "killed"


@pytest.mark.skipif(not hasattr(os, "fork"), reason="processes are forked and killed as POSIX does")
def test_without_bringing_out_a_killed_log_is_lost_so_that_the_test_above_can_fail(tmp_path: Path) -> None:
    killed_writers(tmp_path, [200], flush=100.0)
    with pytest.raises(InputError, match="no samples"):
        read_log(tmp_path / "0.mcap")


def rows(n: int, start: int = 0) -> tuple[np.ndarray, np.ndarray]:
    time = 1e-3 * np.arange(start, start + n)
    return time, np.stack([np.cos(time), 1e5 + time, np.where(time > 0.01, 1.0, np.nan)], axis=1)


def test_a_closed_log_gives_back_all_that_went_in(tmp_path: Path) -> None:
    time, values = rows(300)
    with LiveLog(tmp_path / "a.mcap", CHANNELS, META) as log:
        for at, row in zip(time[:100], values[:100], strict=True):
            log.append(at, row)
        log.annotate("burst 'µ'", 0.0995)
        log.append(time[100:200], values[100:200])
        log.append(time[200:], dict(zip(CHANNELS, values[200:].T, strict=True)))
        log.close("DONE", "all steps were done", {"balance": {"mass": 1e-12}})
    found = read_log(tmp_path / "a.mcap")
    assert (found.whole, found.remarks) == (True, [])
    columns = {n: c.with_values(v) for (n, c), v in zip(CHANNELS.items(), values.T, strict=True)}
    events = [*META["events"], {"time": 0.0995, "text": "burst 'µ'"}]
    end = {"result": "DONE", "message": "all steps were done", "balance": {"mass": 1e-12}}
    assert found.recording == Recording(time, columns, {**META, **end, "events": events})
    assert read_recording(tmp_path / "a.mcap") == found.recording


def test_a_pause_of_the_samples_keeps_nothing_in_memory(tmp_path: Path) -> None:
    log = LiveLog(tmp_path / "a.mcap", CHANNELS, sync=0.05)
    log.append(*rows(7))
    until = clock.monotonic() + 20.0
    while clock.monotonic() < until:
        try:
            found = read_log(tmp_path / "a.mcap")
            break
        except InputError:  # not yet
            clock.sleep(0.02)
    assert len(found.recording) == 7
    assert found.recording.meta["warnings"] == found.remarks  # a running log reads as one that was not closed
    log.close()
    assert read_log(tmp_path / "a.mcap").whole


def test_an_error_inside_ends_the_log_with_its_words(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), LiveLog(tmp_path / "a.mcap", CHANNELS) as log:
        log.append(*rows(5))
        raise RuntimeError("the valve\nstuck")
    meta = read_log(tmp_path / "a.mcap").recording.meta
    assert (meta["result"], meta["message"]) == ("INTERRUPTED", "RuntimeError: the valve stuck")


def test_several_threads_may_write(tmp_path: Path) -> None:
    log = LiveLog(tmp_path / "a.mcap", CHANNELS)
    notes = threading.Thread(target=lambda: [log.annotate(f"note {i}", i * 1e-3) for i in range(200)])
    notes.start()
    for i in range(200):
        log.append(*rows(1, i))
    notes.join()
    log.close()
    found = read_log(tmp_path / "a.mcap")
    assert found.whole
    assert len(found.recording) == 200
    assert [e["text"] for e in found.recording.meta["events"]] == [f"note {i}" for i in range(200)]


@pytest.mark.parametrize(
    ("times", "values", "says"),
    [
        (0.002, [1.0, 2.0, 3.0], "after 0.002 s"),
        ([0.01, 0.009], np.ones((2, 3)), "increasing"),
        (float("nan"), [1.0, 2.0, 3.0], "finite"),
        (0.01, [1.0, 2.0], "number per channel"),
        (0.01, {"muscle.tension": 1.0}, "valve.command"),
        (0.01, ["a", "b", "c"], "number per channel"),
        ([[0.01]], [1.0, 2.0, 3.0], "shape"),
    ],
)
def test_wrong_samples_are_refused_and_leave_no_trace(tmp_path: Path, times, values, says) -> None:
    with LiveLog(tmp_path / "a.mcap", CHANNELS) as log:
        log.append(*rows(3))
        with pytest.raises(InputError, match=says):
            log.append(times, values)
        log.append(*rows(3, 3))
    assert np.array_equal(read_log(tmp_path / "a.mcap").recording.time, rows(6)[0])


def test_a_log_is_never_written_over_and_not_after_its_end(tmp_path: Path) -> None:
    log = LiveLog(tmp_path / "a.mcap", CHANNELS)
    log.append(*rows(1))
    log.close()
    before = (tmp_path / "a.mcap").read_bytes()
    assert log.close("AGAIN") == tmp_path / "a.mcap"
    with pytest.raises(InputError, match="it is closed"):
        log.append(*rows(1, 1))
    with pytest.raises(InputError, match="never written over"):
        LiveLog(tmp_path / "a.mcap", CHANNELS)
    assert (tmp_path / "a.mcap").read_bytes() == before
    with pytest.raises(InputError, match="cannot be written"):
        LiveLog(tmp_path / "missing" / "a.mcap", CHANNELS)
    with pytest.raises(InputError, match="name of a channel"):
        LiveLog(tmp_path / "b.mcap", {"a/b": CHANNELS["valve.command"]})
    assert not (tmp_path / "b.mcap").exists()


def test_a_full_disk_is_told_in_one_line_and_keeps_what_was_written(tmp_path: Path, monkeypatch) -> None:
    log = LiveLog(tmp_path / "a.mcap", CHANNELS, flush=0.01)
    log.append(*rows(50))
    log._out()

    def full() -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(log._writer, "flush", full)
    with pytest.raises(InputError, match="No space left on device"):
        log.append(*rows(50, 50))
    with pytest.raises(InputError, match="No space left on device"):  # and it stays so
        log.append(*rows(50, 100))
    with pytest.raises(InputError, match="No space left on device"):
        log.close()
    assert len(read_log(tmp_path / "a.mcap").recording) == 50


def test_other_programs_read_it(tmp_path: Path) -> None:
    from mcap.reader import make_reader

    time, values = rows(120)
    with LiveLog(tmp_path / "a.mcap", CHANNELS, META, start=10**18) as log:
        log.append(time, values)
        log.annotate("half", 0.06)
    with open(tmp_path / "a.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert summary is not None and summary.statistics is not None
        assert summary.statistics.message_count == 121
        found = [(c.topic, s.encoding, m) for s, c, m in reader.iter_messages() if s]
    samples = [m for topic, encoding, m in found if (topic, encoding) == ("/recording", "ros2msg")]
    assert [m.log_time for m in samples] == [10**18 + 10**6 * i for i in range(120)]
    numbers = np.array([struct.unpack("<4d", m.data[4:]) for m in samples])
    assert np.array_equal(numbers, np.column_stack([time, values]), equal_nan=True)
    (schema,) = (s for s in summary.schemas.values() if s.name == "mckibben/msg/Recording")
    fields = [line.split()[:2] for line in schema.data.decode().splitlines()]
    assert fields == [["float64", n] for n in ("time", "muscle_tension", "muscle_pressure_abs", "valve_command")]


def test_programs_of_ros_read_it_as_messages_of_ros_2(tmp_path: Path) -> None:
    highlevel = pytest.importorskip("rosbags.highlevel")
    time, values = rows(5)
    with LiveLog(tmp_path / "a.mcap", CHANNELS, META, start=10**18) as log:
        log.append(time, values)
        log.annotate("half way: µ", 0.002)
    with highlevel.AnyReader([tmp_path / "a.mcap"]) as reader:
        assert {c.topic: c.msgtype for c in reader.connections} == {
            "/recording": "mckibben/msg/Recording", "/events": "mckibben/msg/Event",
        }  # fmt: skip
        read = [(c.topic, reader.deserialize(data, c.msgtype)) for c, _, data in reader.messages()]
    assert [message.time for topic, message in read if topic == "/recording"] == time.tolist()
    assert [(m.time, m.text) for topic, m in read if topic == "/events"] == [(0.002, "half way: µ")]
