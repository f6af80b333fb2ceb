"""Storage: what was kept comes back as it was, gaps are said, and what is missing is said to be missing."""

from typing import NamedTuple

import numpy as np
import pytest

from mckibben.bench.recorder import BLOCK, Chunks, StepTable, saturated
from mckibben.errors import InputError
from mckibben.recordings import Channel, Recording, read_recording

PERIOD = 1e-3
KINDS = {
    "muscle.pressure": ("Pa", "measured", "gauge pressure at the muscle"),
    "muscle.tension": ("N", "true", "tension"),
    "valve.set_pressure": ("Pa", "command", "asked of the valve"),
}
RNG = np.random.default_rng(2)


def chunk(start, count, names=tuple(KINDS)):
    return PERIOD * (start + np.arange(count)), {name: RNG.normal(size=count) for name in names}


def test_what_is_added_comes_back() -> None:
    chunks, kept = Chunks(PERIOD, KINDS), []
    for start, count in ((0, 100), (100, 1), (101, 399)):
        times, arrays = chunk(start, count)
        chunks.add(times, arrays, np.ones(count, bool))
        kept.append((times, arrays))
    found = chunks.recording({"title": "a run"})
    assert np.array_equal(found.time, np.concatenate([t for t, _ in kept]))
    for name, (unit, kind, meaning) in KINDS.items():
        assert np.array_equal(found[name], np.concatenate([a[name] for _, a in kept]))
        channel = found.channels[name]
        assert (channel.unit, channel.kind, channel.meaning) == (unit, kind, meaning)
    assert list(found.channels) == list(KINDS)  # in the order of the table
    assert found.meta["title"] == "a run"
    assert "gaps" not in found.meta
    assert len(chunks) == len(found) == 500


def test_steps_that_are_not_recorded_leave_gaps_that_are_said() -> None:
    chunks = Chunks(PERIOD, KINDS)
    times, arrays = chunk(0, 100)
    keep = (np.arange(100) < 20) | ((np.arange(100) >= 50) & (np.arange(100) < 90))
    chunks.add(times, arrays, keep)
    chunks.add(*chunk(100, 50), np.zeros(50, bool))
    chunks.add(*chunk(150, 50), True)
    found = chunks.recording()
    assert np.array_equal(found.time[:60], times[keep])
    assert len(found) == 60 + 50
    assert [list(g) for g in found.meta["gaps"]] == [pytest.approx([0.019, 0.050]), pytest.approx([0.089, 0.150])]


def test_a_clock_that_rounds_has_no_gaps() -> None:
    chunks = Chunks(PERIOD, KINDS)
    times = np.cumsum(np.full(20_000, PERIOD))  # sums of periods: late by some 1e-12 s
    chunks.add(times, {"muscle.tension": times})
    assert "gaps" not in chunks.recording().meta


def test_a_channel_that_was_missing_is_not_known_there() -> None:
    chunks = Chunks(PERIOD, KINDS)
    chunks.add(*chunk(0, 3, ("muscle.tension",)))
    chunks.add(*chunk(3, 2, ("muscle.tension", "muscle.pressure")))
    found = chunks.recording()
    assert np.isnan(found["muscle.pressure"]).tolist() == [True] * 3 + [False] * 2
    assert not np.isnan(found["muscle.tension"]).any()
    assert "valve.set_pressure" not in found  # it never came


def test_samples_are_copied() -> None:
    chunks = Chunks(PERIOD, KINDS)
    times, arrays = chunk(0, 5)
    before = arrays["muscle.tension"].copy()
    chunks.add(times, arrays)
    times += 1.0
    arrays["muscle.tension"][:] = 0.0
    found = chunks.recording()
    assert np.array_equal(found["muscle.tension"], before)
    assert found.time[0] == 0.0


def test_an_interrupted_run_has_what_it_has_so_far() -> None:
    chunks = Chunks(PERIOD, KINDS)
    chunks.add(*chunk(0, 10))
    assert len(chunks.recording()) == 10
    chunks.add(*chunk(10, 10))
    assert len(chunks.recording()) == 20


def test_a_recording_goes_to_a_file_and_back(tmp_path) -> None:
    chunks = Chunks(PERIOD, KINDS)
    chunks.add(*chunk(0, 10), np.arange(10) != 4)
    kept = chunks.recording({"title": "a run"})
    assert read_recording(kept.save(tmp_path / "run.nc")) == kept


@pytest.mark.parametrize("keep", [None, False, np.zeros(5, bool)])
def test_an_empty_collection_says_so(keep) -> None:
    chunks = Chunks(PERIOD, KINDS)
    if keep is not None:
        chunks.add(*chunk(0, 5), keep)
    with pytest.raises(InputError, match="recording is empty: the run recorded no sample") as error:
        chunks.recording()
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("times", "arrays", "keep", "words"),
    [
        ([0.1, 0.2], {"other": [1.0, 2.0]}, True, "Unknown channel 'other'"),
        ([0.1, 0.2], {"muscle.tension": [1.0]}, True, "channel muscle.tension"),
        ([0.1, 0.2], {}, [True], "keep"),
        ([[0.1]], {}, True, "times"),
        ([0.2, 0.1], {}, True, "times"),
        ([0.0], {}, True, "times"),
        ([np.nan], {}, True, "times"),
    ],
)
def test_bad_chunks_are_refused_and_leave_nothing(times, arrays, keep, words: str) -> None:
    chunks = Chunks(PERIOD, KINDS)
    chunks.add([0.0], {"muscle.tension": [1.0]})
    with pytest.raises(InputError, match=words):
        chunks.add(times, arrays, keep)
    assert len(chunks.recording()) == 1


@pytest.mark.parametrize("period", [0.0, -1.0, np.nan, np.inf])
def test_a_bad_period_is_refused(period: float) -> None:
    with pytest.raises(InputError, match="period"):
        Chunks(period, KINDS)


class Planned(NamedTuple):
    """What a table of steps asks of one."""

    index: int
    count: int

    def entry(self, start: float, end: float) -> dict:
        return {"index": self.index, "start": start, "end": end}


@pytest.mark.parametrize("chunk", [1, 3, 7, 12])
def test_a_table_of_steps_has_their_times_however_the_samples_come_in(chunk: int) -> None:
    steps, period = [Planned(1, 3), Planned(2, 5), Planned(4, 4)], 0.1
    index = np.repeat([0, 1, 2], [3, 5, 4])
    table, times = StepTable(period), period * np.arange(12)
    for i in range(0, 12, chunk):
        table.add(times[i : i + chunk], index[i : i + chunk], steps)
    table.end(1.2, "stop")
    found = [(step["index"], step["start"], step["end"], step.get("ended_by")) for step in table.steps]
    begins = [times[0], times[3], times[8], 1.2]
    assert found == [(n, a, b, None) for n, a, b in zip((1, 2, 4), begins, begins[1:], strict=False)]
    table.end(9.0, "stop")  # it has ended
    assert table.steps[-1]["end"] == 1.2


@pytest.mark.parametrize(("end", "by"), [(0.2, "until"), (0.26, None), (0.3, None)])
def test_a_step_that_ends_more_than_half_a_sample_early_says_by_what(end: float, by: str | None) -> None:
    table = StepTable(0.1)
    table.end(0.0)  # nothing has begun
    table.add(np.array([0.0]), np.array([0]), [Planned(1, 3)])
    table.end(end)
    assert table.steps == [{"index": 1, "start": 0.0, "end": end} | ({} if by is None else {"ended_by": by})]


def test_many_small_chunks_are_joined_and_come_back_in_their_order() -> None:
    chunks, size = Chunks(PERIOD, KINDS), BLOCK // 4
    names = list(KINDS)
    parts = [chunk(i * size, size, names[: 1 + i % 3]) for i in range(11)]
    lengths = []
    for times, arrays in parts:
        chunks.add(times, arrays)
        lengths.append(len(chunks._times))
    assert lengths == [1, 2, 3, 1, 2, 3, 4, 2, 3, 4, 5]  # four make a block, which stays one piece
    found = chunks.recording()
    assert len(chunks) == 11 * size and np.array_equal(found.time, np.concatenate([times for times, _ in parts]))
    for name in names:
        whole = [arrays.get(name, np.full(size, np.nan)) for _, arrays in parts]
        assert np.array_equal(found[name], np.concatenate(whole), equal_nan=True)


@pytest.mark.parametrize(
    ("low", "values", "share"),
    [
        (-1.0, [-1.0, -1.0, 0.0, 0.5], 0.5),
        (0.0, [0.0, 0.0, 0.0, 0.5], None),  # at zero of a range that begins there, zero is measured
        (0.0, [1.0, 0.0, 1.0, 1.0], 0.75),
        (-1.0, [np.nan, -1.0, -1.0, -1.0], None),
    ],
)
def test_a_channel_saturates_at_the_ends_of_its_converter_but_for_a_zero(low, values, share) -> None:
    record = Recording(PERIOD * np.arange(4), {"tension": Channel(np.array(values), "N", "measured")})
    ends = {"low": low, "high": 1.0}
    found = saturated(record, {"tension": ends, "pressure": ends})
    assert list(found) == ([] if share is None else ["tension"])
    assert share is None or found["tension"]["share"] == pytest.approx(share)
