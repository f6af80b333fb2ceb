"""``record show`` and ``record plot``: what a recording holds, pictures of it, and one line for what is wrong."""

import json

import pytest

from machine_records import machine_record
from mckibben.cli import main
from mckibben.recordings import Channel, Recording

RECORD = machine_record(pressure=["1 bar", "5 bar"])


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return str(RECORD.save(tmp_path_factory.mktemp("records") / "loops.nc"))


@pytest.fixture
def run(capsys):
    def call(*words: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stop:
            main(["record", *words])
        out, err = capsys.readouterr()
        return stop.value.code, out, err

    return call


def test_show_prints_one_object_with_all_that_is_known(run, file):
    code, out, err = run("show", file, "--json")
    found = json.loads(out)
    assert (code, err) == (0, "")
    assert (found["protocol"], found["specimen"], found["rig"]) == ("quasi-static", "nylon", "simulated bench")
    assert found["sentence"] == RECORD.meta["sentence"]
    assert found["samples"] == len(RECORD)
    assert found["sample_rate"] == pytest.approx(1000.0)
    assert found["gaps"] == 1  # between the loops at 1 bar and those at 5 bar
    assert len(found["steps"]) == len(RECORD.meta["steps"])
    assert found["varied"] == {"pressure": ["1 bar", "5 bar"]}
    tension = found["channels"]["tension"]
    assert (tension["unit"], tension["kind"], tension["known"]) == ("N", "measured", 1.0)
    assert (tension["min"], tension["max"]) == (RECORD["tension"].min(), RECORD["tension"].max())
    assert found["channels"]["command.tension"]["min"] is None  # never in force
    assert found["balance"] == {"mass": 2e-12, "energy": 3e-9}
    assert found["saturation"]["tension"]["share"] == 0.012
    assert found["citations"][0]["reference"].startswith("Chou")


def test_csv_and_netcdf_show_the_same(run, file, tmp_path):
    other = str(RECORD.save(tmp_path / "loops.csv"))
    both = [json.loads(run("show", path, "--json")[1]) for path in (file, other)]
    assert {k: v for k, v in both[0].items() if k != "file"} == {k: v for k, v in both[1].items() if k != "file"}


def test_show_tells_a_person_steps_channels_and_what_is_out_of_order(run, file):
    out = run("show", file)[1]
    for words in ("For each pressure of 1, 5 bar", "every 1 ms (1000 Hz), 1 gap", "pressure 5 bar", "until",
                  "not recorded", "nothing known", "balance", "mass 2.0e-12", "loops began",
                  "Saturation: tension, 1.2 % of its samples", "doi:10.1109/70.481753"):  # fmt: skip
        assert words in out
    assert RECORD.meta["sentence"] not in out  # shortened


def test_a_recording_that_tells_little_is_shown_too(run, tmp_path):
    bare = Recording([0.0], {"a": Channel([1.0], "N")}).save(tmp_path / "bare.csv")
    found = json.loads(run("show", str(bare), "--json")[1])
    assert (found["samples"], found["sample_rate"], found["steps"]) == (1, None, [])
    odd = {"balance": 3, "events": [1], "citations": ["later2050"], "warnings": ["warm"], "saturation": {"a": {}}}
    strange = Recording([0.0, 1.0], {"a": Channel([1.0, 2.0], "N")}, odd).save(tmp_path / "odd.csv")
    code, out, _ = run("show", str(strange))
    assert code == 0
    assert "Warning: warm" in out
    assert "[later2050]" in out


@pytest.mark.parametrize(("ending", "head"), [("png", b"\x89PNG"), ("svg", b"<?xml"), ("pdf", b"%PDF")])
def test_plot_writes_the_picture_that_its_ending_says(run, file, tmp_path, ending, head):
    pictures = [tmp_path / f"{i}.{ending}" for i in range(2)]
    for picture in pictures:
        code, out, _ = run("plot", file, "--out", str(picture))
        assert code == 0
        assert "Written" in out
    first, again = (p.read_bytes() for p in pictures)
    assert first.startswith(head)
    assert first == again  # no date in it


def test_plot_draws_what_is_asked_for(run, file, tmp_path):
    picture = tmp_path / "a.svg"
    words = ["--against", "span", "--label", "loops", "--case", "pressure=500 kPa", "--from", "13", "--to", "13.5 s"]
    code, out, err = run("plot", file, "--out", str(picture), *words, "--title", "Half a loop", "--json")
    found = json.loads(out)
    assert (code, err) == (0, "")
    assert found == {"file": str(picture), "segments": 1, "samples": 501, "start": 13.0, "end": 13.5}
    text = picture.read_text()
    assert "Half a loop" in text
    assert "Span, cm" in text
    assert "Tension, N" in text
    assert RECORD.meta["title"] not in text


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (("--channels", "tenson"), "Did you mean 'tension'?"),
        (("--channels", ","), "--channels"),
        (("--channels", "command.tension"), "must be a channel with values"),
        (("--against", "spam"), "Did you mean 'span'?"),
        (("--against", "span", "--channels", "span"), "it stands on the other axis"),
        (("--label", "lops"), "The recording has approach"),
        (("--label", "vent"), "not recorded are vent"),
        (("--case", "pressure=2 bar"), "must be 1 bar or 5 bar"),
        (("--case", "pressure"), "NAME=VALUE"),
        (("--from", "100"), "--from, --to"),
        (("--from", "1 bar"), "--from"),
    ],
)
def test_wrong_words_give_one_line_exit_code_2_and_no_picture(run, file, tmp_path, words, says):
    picture = tmp_path / "a.svg"
    code, out, err = run("plot", file, "--out", str(picture), *words)
    assert (code, out, err.count("\n")) == (2, "", 1)
    assert says in err
    assert not picture.exists()


@pytest.mark.parametrize(
    ("name", "text", "says"),
    [
        ("notes.doc", "a", "Known are .nc, .csv"),
        ("broken.nc", "a", "netCDF"),
        (None, None, "not found"),
    ],
)
def test_what_is_no_recording_gives_one_line(run, tmp_path, name, text, says):
    path = tmp_path / (name or "missing.nc")
    if text is not None:
        path.write_text(text)
    for words in (["show", str(path)], ["plot", str(path), "--out", str(tmp_path / "a.png")]):
        code, out, err = run(*words)
        assert (code, out, err.count("\n")) == (2, "", 1)
        assert says in err


def test_a_picture_that_cannot_be_written_is_refused_before_the_file_is_read(run):
    code, _, err = run("plot", "missing.nc", "--out", "a.gif")
    assert code == 2
    assert "ends in .svg or .pdf or .png" in err
