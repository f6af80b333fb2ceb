"""Verbs: what a command shows is what the function says, and Python is told what the command line is told."""

import inspect
import math
import pickle
import subprocess
import sys

import pytest

import mckibben as mk
from machine_records import machine_record
from mckibben import verbs
from mckibben.analysis import description, energy_accounts, frequency, repeatability
from mckibben.analysis.lever_answers import work_loops
from mckibben.answers import Column, Table
from mckibben.cli import _verb, verb_commands
from mckibben.errors import InputError, PlausibilityWarning
from mckibben.studies.tension import tension

COMMANDS = {name: one for name, one in vars(verb_commands).items() if isinstance(one, _verb.VerbCommand)}


def test_help_is_read_from_the_source_and_imports_nothing_that_computes():
    code = "import sys; from mckibben.cli import verb_commands as v; v.energy.function(), v.tension.function()"
    code += "; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    heavy = {"jax", "scipy", "numpy", "mckibben.studies.tension", "mckibben.analysis.energy"}
    assert heavy & set(done.stdout.split()) == set()


def test_text_with_a_unit_and_a_number_in_si_are_one_question():
    by_text = tension("nylon", length="11:12 cm", pressure="5 bar").rows()
    assert by_text == tension("nylon", length=[0.11, 0.12], pressure=5e5).rows()
    assert len(by_text) == 2


def test_a_refusal_names_parameters_as_whoever_asks_calls_them():
    with pytest.raises(InputError, match=r"^length is missing: .* such as contraction '20 %'$"):
        tension("nylon", pressure="5 bar")
    with pytest.raises(InputError, match=r"^--length is missing: .* such as --contraction '20 %'$"):
        verbs.answer(tension, {"muscle": "nylon", "pressure": "5 bar"}, lambda name: f"--{name}")
    with pytest.raises(InputError, match="pressure must be a pressure such as '5 bar', got 5; the unit is missing"):
        tension("nylon", length="12 cm", pressure="5")


def test_a_slip_is_said_by_the_answer_and_as_a_warning():
    with pytest.warns(PlausibilityWarning, match="was 0.001 kN meant"):
        answer = tension("nylon", length="12 cm", target_tension="0.001 N")
    assert [one.parameter for one in answer.cautions] == ["target tension"]
    assert answer.to_dict()["warnings"] == [one.text for one in answer.cautions]


@pytest.mark.parametrize("lengths", ["12 km", 12e3, [0.12, 12e3], (12e3, "12 cm")])
def test_a_slip_is_seen_in_words_numbers_and_lists_alike(lengths):
    kinds = {"length": verbs.described("studies.tension:tension").parameters["length"]}
    said = [one.text for one in verbs._slips(kinds, {"length": lengths})]
    assert len(said) == 1 and said[0].startswith("a length of 12") and "can hardly be meant" in said[0]


def test_a_number_that_was_typed_keeps_its_text_and_is_a_plain_number_in_arithmetic():
    number = pickle.loads(pickle.dumps(verbs.ParsedNumber(0.12, "12 cm")))
    assert (number, number.text, type(number + 0.0)) == (0.12, "12 cm", float)


def test_cells_keep_their_numbers_and_columns_say_how_they_are_read():
    columns = (Column("length", unit="m"), Column("share", unit="1", shown="%", places=".2f"), Column("word"))
    table = Table("", columns, [{"length": 0.12, "share": -1e-9}, {"length": float("nan"), "word": "slack"}])
    assert table.heads == ["length, cm", "share, %", "word"] and table.right == [0, 1]
    assert table.cells() == [["12", "0.00", ""], ["", "", "slack"]]
    assert table.rows[0]["length"] == 0.12


@pytest.fixture(scope="module")
def record():
    return machine_record(pressure=["1 bar", "5 bar"])


def test_a_recording_and_its_file_are_one_question(record, tmp_path):
    file = record.save(tmp_path / "loops.nc")
    asked = [
        (description.describe_recording, {}),
        (repeatability.repeatability, {"start": "13 s", "end": "17 s"}),
        (frequency.channel_response, {"source": "span", "target": "tension", "start": 13.0, "end": 16.5}),
    ]
    for verb, options in asked:
        one, other = verb(record, **options).to_dict(), verb(str(file), **options).to_dict()
        names = {"file", "files"}
        assert repr({k: v for k, v in one.items() if k not in names}) == repr(
            {k: v for k, v in other.items() if k not in names}
        )
    with pytest.raises(InputError, match="^start, end from 900 s to inf s holds no sample"):
        repeatability.repeatability(record, start=900.0)


def test_how_a_file_is_read_is_one_table_in_python_and_an_option_each_at_the_command_line(tmp_path):
    (tmp_path / "pull.csv").write_text("F,p\n1,2\n2,2\n3,2\n", encoding="utf-8")
    read = {"period": "2 ms", "columns": {"force": "F"}, "units": {"force": "kN"}}
    found = description.describe_recording(tmp_path / "pull.csv", read=read)
    assert found.content["channels"]["force"]["max"] == 3e3 and found.content["end"] == 4e-3
    typed = [one.name for one in verbs.described(COMMANDS["record_show"].place).parameters["read"].parts]
    assert set(read) < set(typed) and {*typed} <= {*verbs.described(COMMANDS["read"].place).parameters}
    with pytest.raises(InputError, match="period must be a time such as '20 ms', got 2 bar"):
        description.describe_recording(tmp_path / "pull.csv", read={"period": "2 bar"})
    with pytest.raises(InputError, match="read must be a table with some of columns, units"):
        description.describe_recording(tmp_path / "pull.csv", read="2 ms")


def test_what_only_python_takes_is_no_option_and_reaches_the_function(record):
    known = verbs.described(COMMANDS["record_energy"].place).parameters
    assert "cycle" in known and not known["cycle"].type.word
    named = inspect.signature(COMMANDS["record_energy"].function()).parameters
    assert "cycle" not in named and {"start", "measured", "accumulator_pressure"} <= set(named)
    with pytest.raises(InputError, match="must be a law that knows|is missing|must be a specimen|must have one"):
        energy_accounts.energy_account(record, measured=True, tension="muscle.tension", supply=6e5)


def test_times_may_lack_their_unit_and_a_list_may_be_none():
    parameters = verbs.described("analysis.lever_answers:contraction").parameters
    assert parameters["rising"].read("none") == [] and parameters["rising"].read("10 %, 90 %") == [0.1, 0.9]
    assert verbs.described("analysis.frequency:channel_response").parameters["start"].read("2") == 2.0
    with pytest.raises(InputError, match="the unit is missing"):
        verbs.described("analysis.frequency:channel_response").parameters["resolution"].read("2")


def test_a_caution_names_parameters_as_whoever_asks_calls_them():
    time = [0.001 * i for i in range(300)]
    length = [1e-3 * math.sin(2.0 * math.pi * 25.0 * t - 1.5) for t in time]
    channels = {"length": mk.Channel(length, "m"), "force": mk.Channel([1.0 + 300.0 * one for one in length], "N")}
    muscle, values = mk.Recording(time, channels), {"frequency": "25 Hz"}
    with pytest.warns(PlausibilityWarning, match="in the mean; keep takes others"):
        work_loops(muscle, **values)
    said = verbs.answer(work_loops, {"recording": muscle} | values, COMMANDS["record_work_loops"].option).cautions
    assert [one.text.rpartition("; ")[2] for one in said] == ["--keep takes others"]


def test_a_person_is_shown_few_rows_of_a_long_table_and_told_how_many_more_there_are(capsys):
    class Long(verbs.Answer):
        def tables(self):
            return [Table("[long]", (Column("n", unit="1"),), [{"n": float(i)} for i in range(50)], most=20)]

    _verb.show(Long())
    out = capsys.readouterr().out.splitlines()
    assert (len(out), out[0], out[-1]) == (23, "[long]", "... and 30 more; --json lists all.")
