"""What a line of the console becomes and what it answers, beside a stand-in for the session: no machine moves."""

from types import SimpleNamespace

import numpy as np
import pytest

from mckibben.bench.console import LONGEST, Console, _columns, _files, described_dry_run, loaded, words_of
from mckibben.bench.session.interface import Message
from mckibben.errors import InputError
from mckibben.experiments.read import shipped
from mckibben.recordings import Channel, Recording


class Session:
    """A session that notes what it is asked."""

    def __init__(self):
        manual = SimpleNamespace(pressure_rate=2e5, speed=0.15, acceleration=3.0, tension_rate=50.0)
        self.setup, self.calls, self.said = SimpleNamespace(manual=manual), [], []
        self.record = Recording(
            np.arange(5.0),
            {"pressure": Channel(1e5 * np.arange(5.0), "Pa", "measured"), "x": Channel(np.zeros(5), "m", "true")},
        )

    def __getattr__(self, name):
        def call(*arguments, **named):
            self.calls.append((name, *arguments, *named.items()))
            return self.record if name == "stop_recording" else None

        return call

    def status(self):
        return SimpleNamespace(line=lambda: "the line", lines=lambda: ["one", "two"])

    def messages(self, after):
        return [one for one in self.said if one.number > after]


@pytest.fixture
def console():
    return Console(Session())


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("pressure 3 bar", ["pressure", "3", "bar"]),
        ("load 'my file.toml' # of mine", ["load", "my file.toml"]),
        ('stop "it burns"', ["stop", "it burns"]),
        ("a#b # c", ["a#b"]),
        (r"load C:\x", ["load", r"C:\x"]),
        ("# nothing", []),
        ("", []),
    ],
)
def test_a_line_is_words_with_the_quotes_of_a_shell_up_to_a_comment(line, words):
    assert words_of(line) == words
    with pytest.raises(InputError, match="a quotation mark has no other one"):
        words_of(line + " 'x" if "#" not in line else "'x")


@pytest.mark.parametrize(
    ("line", "answer", "call"),
    [
        ("pressure 3 bar", "pressure to 3 bar, at 2 bar/s at most", ("set", ("pressure", "3 bar"))),
        ("SPAN 12 cm", "span to 12 cm, at 0.15 m/s at most", ("set", ("span", "12 cm"))),
        ("velocity 1 cm/s", "velocity to 1 cm/s, at 3 m/s^2 at most", ("set", ("velocity", "1 cm/s"))),
        ("tension 20 N", "tension to 20 N, at 50 N/s at most", ("set", ("tension", "20 N"))),
        ("vent", "", ("vent",)),
        ("stop", "", ("emergency_stop", "from the console")),
        ("stop it burns", "", ("emergency_stop", "it burns")),
        ("reset", "", ("reset",)),
        ("status", "one\ntwo", None),
        ("record on", "", ("start_recording", ("log", None))),
        ("record on a.mcap", "", ("start_recording", ("log", "a.mcap"))),
        ("wait 2 s", "the line", ("wait", 2.0)),
        ("wait 0 s", "the line", ("wait", 0.0)),
        (f"wait {LONGEST:g} s", "the line", ("wait", LONGEST)),
    ],
)
def test_a_command_asks_the_session_for_one_thing_and_answers(console, line, answer, call):
    assert console.execute(line) == answer
    assert console.session.calls == ([] if call is None else [call])


@pytest.mark.parametrize(
    "line",
    ["record on a b", "record", "record off now", "wait 86401 s", "reset now", "status x", "quit now", "list", "set"],
)
def test_a_command_with_other_words_asks_for_nothing(console, line):
    console.use_protocol(shipped("quasi-static"))
    with pytest.raises(InputError):
        console.execute(line)
    assert not console.session.calls and not console.over


def test_a_recording_is_told_by_its_measured_channels_in_columns(console):
    said = console.execute("record off").splitlines()
    assert console.recording is console.session.record
    assert said[0] == "5 samples, 4 s" and said[1].split() == ["lowest", "mean", "highest"]
    assert said[2].split() == ["pressure", "0", "bar", "2", "bar", "4", "bar"] and len(said) == 3
    assert _columns([("a", "b"), ("long", ""), ("cc", "d")]) == "a     b\nlong\ncc    d"


def test_messages_are_told_once_with_their_time_where_they_have_one(console):
    assert console.news() == []
    console.session.said += [Message(1, None, "stop", "early"), Message(2, 12.3456, "note", "later")]
    assert console.news() == ["early", "[   12.346 s] later"] and console.news() == []
    console.session.said.append(Message(3, 13.0, "note", "again"))
    assert console.news() == ["[   13.000 s] again"]


def test_values_are_set_several_at_once_and_a_unit_belongs_to_the_value_before(console):
    console.execute("load quasi-static")
    before = console.protocol
    assert "pressure 1 bar, 3 bar" in console.execute("set pressure=1 bar, 3 bar")
    assert [str(one) for one in console.protocol.variables()["pressure"]] == ["1 bar", "3 bar"]
    console.execute("set pressure=2 bar repeat=4")
    assert [str(one) for one in console.protocol.variables()["pressure"]] == ["2 bar"]
    assert console.protocol.repeat == 4 and before.repeat != 4, "the loaded one is not touched"
    for line in ("set bar", "set pressure=", "set 2 bar pressure=3 bar"):
        with pytest.raises(InputError, match="Usage: set NAME=VALUE"):
            console.execute(line)


def test_a_table_is_played_by_the_channel_that_is_named_or_the_first_of_its_unit(tmp_path):
    place = tmp_path / "wave.csv"
    place.write_text("t [s],p [bar]\n2,0.5\n2.2,1\n2.5,0\n")
    for channel in (None, "pressure"):
        protocol = loaded(str(place), channel)
        assert (protocol.name, protocol.title) == ("wave", "Pressure as in wave.csv")
        plan = protocol.expand(rest_length=0.14)
        first, second = plan.steps
        assert (first.record, second.record) == (False, True)
        assert first.count == pytest.approx(plan.sample_rate) and second.count == pytest.approx(0.5 * plan.sample_rate)
        assert first.pressure[-1] == pytest.approx(5e4, rel=1e-2) and second.pressure[0] == pytest.approx(5e4)
        assert second.pressure.max() == pytest.approx(1e5, rel=1e-2)
    place.write_text("t [s],x [cm]\n0,14\n0.2,13.5\n0.4,14\n")
    assert loaded(str(place)).title == "Span as in wave.csv"
    for channel, says in (("pressure", "wave.csv"), ("presure", "Did you mean 'pressure'")):
        with pytest.raises(InputError, match=says):
            loaded(str(place), channel)
    place.write_text("t [s],m [kg]\n0,14\n0.2,13.5\n0.4,14\n")
    with pytest.raises(InputError, match="wave.csv"):
        loaded(str(place))
    with pytest.raises(InputError, match="not found"):
        loaded(str(tmp_path / "gone.csv"))


def test_files_are_completed_by_their_endings_and_folders_are_gone_into(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("a.csv", "B.CSV", "a.txt", ".a.csv", "in/a.toml", "in/c.csv"):
        (tmp_path / name).parent.mkdir(exist_ok=True)
        (tmp_path / name).touch()
    assert _files("", (".csv",)) == ["B.CSV", "a.csv", "in/"]
    assert _files("a", (".csv", ".txt")) == ["a.csv", "a.txt"] and _files("in/", (".csv",)) == ["in/c.csv"]
    assert _files("in/c", (".csv", ".toml")) == ["in/c.csv"] and _files("gone/", (".csv",)) == []


def test_a_dry_run_is_its_findings_or_how_long_it_lasts_at_most():
    assert described_dry_run(["a", "b"], 2.0) == "a\nb"
    assert described_dry_run([], 12.3456) == "At most 12.35 s; the dry run passes."


def test_a_command_of_another_console_says_what_is_done_instead(console):
    console.elsewhere = {"record": "is a button of the page"}
    with pytest.raises(InputError, match="is a button of the page"):
        console.execute("record on")
