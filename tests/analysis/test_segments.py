"""Steps of a recording by label and case: the very samples of a step, none of its neighbours, and words as amounts."""

import numpy as np
import pytest

from machine_records import machine_record
from mckibben.analysis.segments import cases, same_amount, segments, varied
from mckibben.errors import InputError
from mckibben.recordings import Channel, Recording

RECORD = machine_record(pressure=["1 bar", "3 bar", "5 bar"])


def stepped(count: int, rate: float) -> Recording:
    """Steps of one second, back to back; the channel holds the number of the step."""
    samples = np.arange(round(count * rate))
    steps = [
        {"index": i + 1, "label": "hold", "case": {"n": str(i)}, "start": float(i), "end": i + 1.0}
        for i in range(count)
    ]
    return Recording(samples / rate, {"a": Channel(samples // rate, "1")}, {"steps": steps})


@pytest.mark.parametrize("rate", [10.0, 30.0, 1000.0, 4096.0])
def test_steps_back_to_back_share_no_sample_and_lose_none(rate):
    # the start belongs to a step, its end to the next one; 0.1 and 1/30 are no binary numbers
    record = stepped(7, rate)
    parts = segments(record)
    assert [np.unique(p["a"]).tolist() for p in parts] == [[float(i)] for i in range(7)]
    assert np.array_equal(np.concatenate([p.time for p in parts]), record.time)


def test_a_segment_knows_its_step_and_keeps_time_channels_and_meta():
    (part,) = segments(RECORD, "loops", pressure="5 bar")
    step = part.meta["step"]
    assert (step["label"], step["case"]["pressure"]) == ("loops", "5 bar")
    assert part.time[0] == pytest.approx(step["start"], abs=1e-9)
    assert len(part) == round((step["end"] - step["start"]) / RECORD.period)
    assert part.names() == RECORD.names()
    assert part.meta["specimen"] == "nylon"
    assert np.all(part["command.pressure"] == 5e5)
    # a segment is a recording of one step
    assert segments(part, "loops") == [part]


def test_words_are_compared_as_amounts():
    (part,) = segments(RECORD, pressure="500 kPa")
    assert part == segments(RECORD, pressure="5 bar")[0] == segments(RECORD, pressure=5e5)[0]
    assert len(segments(RECORD, "loops", range="large", frequency="1000 mHz")) == 3


@pytest.mark.parametrize(
    ("a", "b", "same"),
    [
        ("5 bar", "500 kPa", True), ("5bar", "5.0 bar", True), ("0 bar", "0 Pa", True), ("0.75 L0", "0.750 L0", True),
        ("3", 3, True), ("1 Hz", 1.0, True), ("oil", "oil", True), ("72.5188689 psi", "5 bar", True),
        ("5 bar", "5 N", False), ("5", "5 bar", False), ("0.75 L0", "0.75 m", False), ("oil", "talc", False),
        ("0.75 L0", 0.75, False), ("5 bar", "5.0001 bar", False), ("5 bar", "5 furlongs per", False),
    ],
)  # fmt: skip
def test_the_same_amount_is_the_same_in_any_unit(a, b, same):
    assert same_amount(a, b) is same
    assert same_amount(b, a) is same


def test_cases_are_those_that_were_recorded_in_their_order():
    assert [c["pressure"] for c in cases(RECORD)] == ["1 bar", "3 bar", "5 bar"]
    assert varied(RECORD) == {"pressure": ["1 bar", "3 bar", "5 bar"]}


@pytest.mark.parametrize(
    ("label", "case", "says"),
    [
        ("lops", {}, "Did you mean 'loops'. The recording has approach, settle, preconditioning, loops, vent"),
        (None, {"presure": "5 bar"}, "Did you mean 'pressure'. The recording has range, pressure"),
        (None, {"pressure": "2 bar"}, "pressure must be 1 bar, 3 bar or 5 bar as in the recording, got 2 bar"),
        ("vent", {"pressure": "5 bar"}, "not together; the recording has vent"),
        ("settle", {}, "not recorded are settle"),
    ],
)
def test_what_nothing_matches_is_told_with_what_there_is(label, case, says):
    with pytest.raises(InputError, match=says):
        segments(RECORD, label, **case)


def test_a_selection_leaves_the_steps_that_it_holds():
    assert [p.meta["step"]["case"]["pressure"] for p in segments(RECORD.select(10.0, 14.0))] == ["3 bar"]
    (part,) = segments(RECORD.select(13.0, 14.0))
    assert (part.time[0], part.time[-1]) == (13.0, 14.0)


@pytest.mark.parametrize(
    ("steps", "says"),
    [
        (None, "are not in the recording"),
        ([], "are not in the recording"),
        ("all", "must be a list"),
        ([3], "must be a table with start, end, label and case"),
        ([{"start": 0.0}], "steps.1.end"),
        ([{"start": float("nan"), "end": 1.0}], "steps.1.start"),
        ([{"start": 0.0, "end": 1.0, "case": "x"}], "steps.1.case"),
    ],
)
def test_steps_that_are_none_are_refused(steps, says):
    record = Recording(np.arange(3.0), {"a": Channel(np.zeros(3), "1")}, {} if steps is None else {"steps": steps})
    with pytest.raises(InputError, match=says):
        segments(record)
