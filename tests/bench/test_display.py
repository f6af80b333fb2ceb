"""The live chart: nothing that was seen is lost, no frame comes too often, and chunks leave no trace."""

import json

import numpy as np
import pytest

from mckibben.bench.software.display import DisplayFeed
from mckibben.errors import InputError

RNG = np.random.default_rng(11)
TIMES = 1e-3 * np.arange(1234)
ARRAYS = {"tension": RNG.normal(size=1234), "pressure": RNG.normal(size=1234) ** 2}


def fed(cuts=(), times=TIMES, arrays=ARRAYS, **options):
    feed = DisplayFeed(**options)
    frames = []
    for part in np.split(np.arange(len(times)), cuts):
        frames += feed.push(times[part], {name: values[part] for name, values in arrays.items()})
    return frames + feed.finish()


def known(frames, name, key):
    return [x for f in frames for x in f["channels"][name][key] if x is not None]


@pytest.mark.parametrize("buckets", [1, 2, 7])
def test_no_extreme_is_lost(buckets: int) -> None:
    frames = fed(buckets=buckets)
    for name, values in ARRAYS.items():
        assert min(known(frames, name, "min")) == values.min()
        assert max(known(frames, name, "max")) == values.max()
        assert known(frames, name, "last")[-1] == values[-1]


def test_each_column_has_the_samples_of_its_time() -> None:
    # 50 frames a second of 2 columns: 10 samples of 1 ms in each, of which the first is at the left edge
    frames = fed(buckets=2)
    for k, frame in enumerate(frames):
        assert frame["start"] == pytest.approx(0.02 * k)
        assert frame["width"] == pytest.approx(0.01)
        for j in range(2):
            part = ARRAYS["tension"][20 * k + 10 * j : 20 * k + 10 * (j + 1)]
            seen = [frame["channels"]["tension"][key][j] for key in ("min", "max", "last")]
            assert seen == ([part.min(), part.max(), part[-1]] if len(part) else [None] * 3)


@pytest.mark.parametrize("cuts", [(), (1,), (19, 20, 21), (500, 500), tuple(range(0, 1234, 7)), (1233,)])
def test_chunks_leave_no_trace(cuts: tuple[int, ...]) -> None:
    assert fed(cuts) == fed()


@pytest.mark.parametrize("rate", [3.0, 50.0, 400.0, 5000.0])
def test_frames_come_no_more_often_than_asked(rate: float) -> None:
    starts = [f["start"] for f in fed(frames_per_second=rate)]
    assert np.all(np.diff(starts) > 1.0 / rate * (1.0 - 1e-9))
    assert len(starts) <= np.ceil(TIMES[-1] * rate) + 1


def test_a_frame_is_sent_once_it_is_complete() -> None:
    feed = DisplayFeed(frames_per_second=50.0)
    assert feed.push(TIMES[:20], {"x": TIMES[:20]}) == []  # the 20th may still have a sample behind it in its frame
    assert len(feed.push(TIMES[20:21], {"x": TIMES[20:21]})) == 1
    assert len(feed.finish()) == 1
    assert feed.finish() == []
    assert feed.push([], {}) == []


def test_a_pause_sends_no_empty_frames() -> None:
    times = np.array([0.0, 0.001, 5.0])
    frames = fed(times=times, arrays={"x": np.array([1.0, 2.0, 3.0])})
    assert [f["start"] for f in frames] == [0.0, 5.0]


def test_frames_are_json_even_with_gaps_and_infinities() -> None:
    values = np.where(np.arange(1234) % 5 == 0, np.nan, 1.0)
    values[40:60] = np.nan
    values[100:110] = np.inf
    frames = fed(arrays={"x": values})
    assert json.loads(json.dumps(frames, allow_nan=False)) == frames
    assert frames[2]["channels"]["x"]["max"] == [None, None]
    assert frames[0]["channels"]["x"] == {"min": [1.0, 1.0], "max": [1.0, 1.0], "last": [1.0, 1.0]}


def test_a_channel_may_come_and_go() -> None:
    feed = DisplayFeed(buckets=1)
    frames = feed.push([0.0], {"a": [1.0]}) + feed.push([0.021], {"b": [2.0]}) + feed.finish()
    assert frames[0]["channels"]["a"]["last"] == [1.0]
    assert frames[1]["channels"] == {
        "a": {"min": [None], "max": [None], "last": [None]},
        "b": {"min": [2.0], "max": [2.0], "last": [2.0]},
    }


def test_after_the_end_a_new_run_begins_at_any_time() -> None:
    feed = DisplayFeed()
    feed.push([5.0], {"x": [1.0]})
    with pytest.raises(InputError, match="times is 'from 5 s'; allowed are finite times that rise"):
        feed.push([5.0], {"x": [1.0]})
    feed.finish()
    assert feed.push([0.0, 0.1], {"x": [1.0, 2.0]})


@pytest.mark.parametrize(
    ("times", "arrays", "words"),
    [
        ([[0.0]], {}, "times"),
        ([0.0, 1.0], {"x": [1.0]}, "channel x"),
        ([1.0, 0.5], {"x": [1.0, 2.0]}, "times"),
        ([np.nan], {"x": [1.0]}, "times"),
    ],
)
def test_bad_chunks_are_refused(times, arrays, words: str) -> None:
    with pytest.raises(InputError, match=words):
        DisplayFeed().push(times, arrays)


@pytest.mark.parametrize(
    "options", [{"frames_per_second": 0.0}, {"frames_per_second": np.nan}, {"buckets": 0}, {"buckets": 1.5}]
)
def test_bad_settings_are_refused(options: dict) -> None:
    with pytest.raises(InputError, match=next(iter(options))):
        DisplayFeed(**options)
