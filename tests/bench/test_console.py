"""The console: a line is a command, an answer or one clear complaint; what help names is what there is."""

import inspect

import numpy as np
import pytest
from short_runs import paper

from mckibben.bench.console import COMMANDS, Console
from mckibben.bench.session import Session
from mckibben.errors import InputError
from mckibben.experiments.read import protocol_names
from mckibben.recordings import read_any


@pytest.fixture(scope="module")
def session():
    with Session(paper(), "nylon", speed=None) as opened:
        yield opened


@pytest.fixture
def console(session):
    if session.why:
        session.reset()
    if session.status().recorded is not None:
        session.stop_recording()
    session.vent()
    while session.latest()["pressure"] > 2e3 or session.latest()["command.pressure"] > 0.0:
        session.wait(0.2)
    return Console(session)


def test_every_command_of_the_help_exists_and_every_command_is_in_the_help(console):
    done = {
        name.removeprefix("_")
        for name, method in inspect.getmembers(Console, inspect.isfunction)
        if list(inspect.signature(method).parameters) == ["self", "words"]
    }
    assert done == set(COMMANDS)
    text = console.execute("help")
    assert [line.split()[0] for line in text.splitlines()] == list(COMMANDS)
    for name, command in COMMANDS.items():
        assert command.usage.split()[0] == name
        assert console.execute(f"help {name}") == f"{command.usage}\n{command.about}"


def test_a_machine_is_operated_in_words(console):
    assert console.execute("pressure 2 bar") == "pressure to 2 bar, at 3.45 bar/s at most"
    assert console.execute("span 13.5 cm  # a comment") == "span to 13.5 cm, at 0.15 m/s at most"
    assert console.execute("") == "" and console.execute("  # nothing") == ""
    line = console.execute("wait 1.5 s")
    assert line.startswith("manual  pressure ") and line.endswith(" s")
    measured = console.session.status().measured
    # two counts of 8 bits, and what the motor's friction leaves
    assert measured["pressure"] == pytest.approx(2e5, abs=5.4e3) and measured["span"] == pytest.approx(0.135, abs=5e-4)
    status = console.execute("status")
    assert status.splitlines()[0] == "manual" and "set-point 2 bar" in status and "set-point 13.5 cm" in status
    console.execute("tension 10 N")
    console.execute("wait 500 ms")
    assert console.session.status().set_points["tension"] == pytest.approx(10.0)
    console.execute("velocity -1 cm/s")
    console.execute("wait 0.2 s")
    assert console.session.status().set_points["velocity"] == pytest.approx(-0.01)
    console.execute("vent")
    console.execute("wait 1 s")
    assert console.session.status().state == "idle"


def test_a_stop_from_the_console_vents_within_two_samples_of_the_loop(console):
    for line in ("pressure 3 bar", "wait 1.2 s", "record on", "wait 20 ms"):
        console.execute(line)
    console.news()
    console.execute("stop too loud")
    (told,) = console.news()
    assert told.endswith("too loud; stopped and vented")
    console.execute("record off")
    valve = console.recording["valve.command"]
    assert valve[19] > 2.9e5 and np.all(valve[21:] == 0.0)
    with pytest.raises(InputError, match="too loud.*reset it first"):
        console.execute("pressure 1 bar")
    console.execute("reset")
    assert console.execute("status").splitlines()[0] == "idle"


def test_a_protocol_is_loaded_changed_shown_run_and_saved(console, tmp_path):
    assert console.execute("load isotonic-triangle").startswith("isotonic-triangle: ")
    said = console.execute("set load=50 N frequency=5 Hz cycles=1")
    assert "load 50 N" in said and "frequency 5 Hz" in said
    shown = console.execute("show")
    assert shown.startswith("Isotonic shortening by triangles") and shown.endswith("the dry run passes.")
    table = console.execute("run")
    assert "200 samples" in table and "tension" in table
    assert any("The run reached its end" in line for line in console.news())
    for ending in (".nc", ".mcap", ".csv"):
        path = tmp_path / f"run{ending}"
        assert console.execute(f"save {path}") == f"Written: {path}"
        saved = read_any(path).recording
        assert saved.meta["protocol"]["name"] == "isotonic-triangle"
        assert np.array_equal(saved["tension"], console.recording["tension"])


@pytest.mark.slow
def test_several_values_by_commas_are_cases(console):
    console.execute("load quasi-static")
    assert "pressure 1 bar, 3 bar" in console.execute("set pressure=1 bar, 3 bar")
    assert "For each pressure of 1, 3 bar" in console.execute("show")


WAVES = {
    "pressure": ("t [s],p [bar]\n0,0\n0.2,1\n0.4,0\n", "Pressure as in wave.csv", "command.pressure", 1e5),
    "span": ("t [s],x [cm]\n0,14\n0.2,13.5\n0.4,14\n", "Span as in wave.csv", "command.span", 0.14),
}


@pytest.mark.slow
@pytest.mark.parametrize("channel", WAVES)
def test_a_recorded_waveform_is_followed_by_the_channel_of_its_unit(console, channel, tmp_path):
    text, title, name, most = WAVES[channel]
    (tmp_path / "wave.csv").write_text(text)
    assert console.execute(f"load {tmp_path / 'wave.csv'}") == f"wave: {title}"
    console.execute("run")
    assert console.recording[name].max() == pytest.approx(most, rel=1e-3) and len(console.recording) == 400


@pytest.mark.slow
def test_a_log_is_written_while_somebody_records(console, tmp_path):
    log = tmp_path / "live.mcap"
    for line in (f"record on {log}", "pressure 1 bar", "wait 0.3 s", "record off"):
        console.execute(line)
    kept = read_any(log).recording
    assert len(kept) == 300 and kept.meta["events"][0]["text"] == "pressure 1 bar"


WRONG = {
    "a word": ("presure 3 bar", "Did you mean 'pressure'"),
    "a unit": ("pressure 3 N", "must be a pressure such as '5 bar'"),
    "no unit": ("span 12", "the unit is missing"),
    "nothing": ("pressure", "Usage: pressure 3 bar, got 'pressure'"),
    "too much": ("pressure 30 bar", "allows 0 bar to 6.9 bar"),
    "more words": ("vent now", "Usage: vent, got 'vent now'"),
    "a protocol": ("load quasi-statik", "Did you mean 'quasi-static'"),
    "a file": ("load gone.toml", "not found"),
    "a table": ("load gone.csv", "not found"),
    "a channel": ("load gone.csv as presure", "Did you mean 'pressure'"),
    "no protocol": ("run", "must be loaded first"),
    "nothing to set": ("set pressure=3 bar", "must be loaded first"),
    "nothing to save": ("save x.nc", "there is no recording yet"),
    "a format": ("save x.docx", "must be a name that ends in .nc"),
    "a folder": ("save nowhere/x.nc", "older not found"),
    "a list": ("list muscle", "Usage: list protocols|muscles|rigs"),
    "help": ("help presure", "Did you mean 'pressure'"),
    "off": ("record off", "is off already"),
    "record": ("record maybe", "Usage: record on"),
    "reset": ("reset", "allowed only after a stop"),
    "a time": ("wait 3", "the unit is missing"),
    "back in time": ("wait -1 s", "must be between 0 s and"),
    "a quotation": ("load 'x", "quotation mark"),
    "a clock": ("run isometric-step", "must be 1000 Hz"),
    "a part": ("run leak-down", "shut-off"),
}


@pytest.mark.parametrize("case", WRONG)
def test_what_is_wrong_gets_one_line_and_the_console_stays(console, case):
    line, said = WRONG[case]
    before = console.session.status().set_points
    with pytest.raises(InputError) as complaint:
        console.execute(line)
    assert said in str(complaint.value) and len(str(complaint.value).splitlines()) == 1
    assert console.session.status().set_points == before and not console.over
    assert console.execute("wait 1 ms").startswith("idle")


def test_set_says_what_a_protocol_has(console):
    console.execute("load quasi-static")
    for line, said in (
        ("set presure=1 bar", "Did you mean 'pressure'"),
        ("set pressure=1 N", "pressure"),
        ("set", "NAME"),
    ):
        with pytest.raises(InputError, match=said):
            console.execute(line)


def test_lists_name_all_there_is(console):
    assert [line.split()[0] for line in console.execute("list protocols").splitlines()] == protocol_names()
    assert "nylon" in console.execute("list muscles") and "(mounted)" in console.execute("list muscles")
    assert "paper" in console.execute("list rigs")


def test_completion_knows_commands_protocols_units_values_and_files(console, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.toml").touch()
    (tmp_path / "more").mkdir()
    assert console.complete("pre") == ["pressure"] and set(console.complete("")) == set(COMMANDS)
    assert console.complete("pressure 3 ") == ["bar", "kPa", "mbar"] and console.complete("span 3 c") == ["cm"]
    assert console.complete("run iso") == [n for n in protocol_names() if n.startswith("iso")]
    assert console.complete("load m") == ["mine.toml", "more/"]
    assert console.complete("list p") == ["protocols"] and console.complete("record o") == ["on", "off"]
    assert console.complete("set pre") == []
    console.execute("load quasi-static")
    assert "pressure=" in console.complete("set pre") and console.complete("help ve") == ["velocity", "vent"]
    assert console.complete("nonsense x") == [] and console.complete("vent ") == []


def test_quit_ends_it(console):
    assert console.execute("quit") == "" and console.over
