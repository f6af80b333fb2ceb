"""What is said against the samples of a recording is said by the recording itself, and by every face that shows one."""

import json

import numpy as np
import pytest

from mckibben.cli import main
from mckibben.recordings import Channel, Recording
from mckibben.report.recording_report import recording_report
from mckibben.web.pages.recordings import listing

LINE = {"samples": 6001, "lost": 60, "repeated": 3, "late": 0, "bad_checksum": 60, "answers_late": 2}
LOST = "60 of 6,001 samples did not arrive, or damaged"


def recording(**meta) -> Recording:
    time = np.arange(50) * 1e-3
    return Recording(time, {"tension": Channel(np.sin(time), "N", "measured")}, {"title": "a run", **meta})


def said(**meta) -> list[str]:
    return [one.text for one in recording(**meta).cautions]


def test_a_sound_recording_has_none():
    assert said(hardware=dict.fromkeys(LINE, 0) | {"samples": 6001}, deadlines={"samples": 50, "behind": 0}) == []
    assert "caution" not in repr(recording())


def test_lost_samples_are_said_once_and_what_costs_nothing_is_not():
    first, second = said(hardware=LINE)
    assert first.startswith(LOST) and second.startswith("2 of 6,001 samples were taken by the device before")


@pytest.mark.parametrize(
    ("meta", "words"),
    [
        ({"deadlines": {"samples": 50, "late": 9, "behind": 7}}, "7 of 50 samples began more than a period late"),
        ({"hardware": {"reads": 50, "late": 4, "overruns": 0}}, "4 of 50 samples came more than a period late"),
        ({"hardware": {"reads": 50, "resyncs": 2}}, "2 of 50 samples resyncs"),  # of a hardware of one's own
        ({"saturation": {"tension": {"share": 0.012, "first": 1.5}}}, "tension was at an end of its range, 1.2 %"),
        ({"warnings": [{"text": "the log was not closed"}]}, "the log was not closed"),
        ({"source": {"left_out": ["3 rows below the table"]}}, "3 rows below the table"),
    ],
)
def test_facts_of_the_metadata_that_change_the_samples_are_cautions(meta, words):
    (one,) = said(**meta)
    assert one.startswith(words)


def test_every_face_says_that_samples_were_lost(tmp_path, capsys):
    path = recording(hardware=LINE).save(tmp_path / "run.nc")
    assert "2 cautions" in repr(recording(hardware=LINE))
    for words in (["record", "show", str(path)], ["record", "show", str(path), "--json"]):
        with pytest.raises(SystemExit) as stop:
            main(words)
        out = capsys.readouterr().out
        assert stop.value.code in (0, None) and LOST in out
        assert "--json" not in words or json.loads(out)["warnings"][0].startswith(LOST)
    page = recording_report(recording(hardware=LINE), name="run.nc").write(tmp_path / "run.html")
    assert LOST in page.read_text(encoding="utf-8")
    assert (
        listing._sign(recording(hardware=LINE).meta)[0] == "caution"
        and LOST in listing._sign(recording(hardware=LINE).meta)[1]
    )
