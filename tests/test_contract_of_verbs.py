"""What every verb keeps, whatever it computes: its faces say the same, and each parameter is declared, told and refused."""

import json
import os

import pytest

from mckibben import verbs
from mckibben.cli import _values, main, verb_commands
from mckibben.cli._terminal import json_text
from mckibben.cli._verb import VerbCommand
from mckibben.errors import InputError

COMMANDS = {name: one for name, one in vars(verb_commands).items() if isinstance(one, VerbCommand)}
# A question for each verb, by the words of its command; with cautions where there are any to be had.
ASKED = {
    "tension": "nylon --length 11:12:0.5cm --pressure 5bar",
    "energy": "nylon --pressure 5bar --cycle maximal",
    "size": "--force 35N --stroke 2.8cm --pressure 5bar --no-lines --cycles 1Hz --working-time 8h",
    "compare": "nylon fast-fibre --pressure 12bar",
    "conform": "python --scenario hang --no-states",
    "diagnose": "no.nc",  # refused in one sentence; tests/studies/test_diagnosis.py has answers
}
QUANTITIES = [
    (name, p)
    for name, command in COMMANDS.items()
    for p in verbs.described(command.place).parameters.values()
    if p.type.unit
]


@pytest.fixture
def ask(capsys, monkeypatch):
    """Run a command; its exit code, what it printed, and the answer that it had."""
    had = []
    original = verbs.answer
    monkeypatch.setattr(verbs, "answer", lambda *a, **k: had.append(original(*a, **k)) or had[-1])

    def call(name: str, *more: str):
        had.clear()
        with pytest.raises(SystemExit) as stop:
            main([*name.split(), *more])
        out, err = capsys.readouterr()
        return stop.value.code, out, err, had[-1] if had else None

    return call


def test_every_verb_is_asked_here():
    assert set(ASKED) == set(COMMANDS)


@pytest.mark.parametrize("name", COMMANDS)
def test_terminal_json_table_and_python_say_the_same(ask, name, tmp_path):
    code, out, err, answer = ask(name.replace("_", "-"), *ASKED[name].split())
    if answer is None:
        assert code == 2 and out == "" and err.count("\n") == 1
        return
    assert code == 0
    few = answer.first(COMMANDS[name].top) if COMMANDS[name].top else answer
    for table in few.tables():
        assert table.title in out and all(note in out for note in table.notes)
        lines = [line.split() for line in out.splitlines()]
        for row in table.cells():  # in one line, in this order
            assert [word for cell in row for word in cell.split()] in lines
    assert all(remark in out for remark in answer.remarks())
    cautions = [one.text for one in answer.cautions]
    assert [line.partition("caution: ")[2] for line in err.splitlines() if "caution: " in line] == cautions
    file = tmp_path / "rows.json"
    code, printed, *_ = ask(name.replace("_", "-"), *ASKED[name].split(), "--json", "--out", str(file))
    assert code == 0 and json.loads(printed) == json.loads(file.read_text())
    assert json.loads(printed) == json.loads(json_text(few.to_dict() | {"warnings": cautions}))


@pytest.mark.parametrize(("name", "p"), QUANTITIES, ids=lambda one: getattr(one, "name", one))
def test_each_quantity_refuses_another_dimension_by_the_name_that_its_user_gave(name, p):
    command = COMMANDS[name]
    given = {q.name: "nylon" for q in verbs.described(command.place).parameters.values() if q.required}
    with pytest.raises(InputError) as python:
        verbs.answer(verbs.load(command.place), given | {p.name: "3 kelvin"})
    with pytest.raises(InputError) as typed:
        verbs.answer(verbs.load(command.place), given | {p.name: "3 kelvin"}, command.option)
    option = command.option(p.name)
    assert str(typed.value).startswith(f"{option} ") and "3 kelvin" in str(typed.value)
    assert str(python.value) == str(typed.value).replace(option, p.name)


@pytest.mark.parametrize("name", COMMANDS)
def test_each_parameter_is_told_in_the_help_with_its_kind(name, capsys, monkeypatch):
    monkeypatch.setitem(os.environ, "COLUMNS", "100")
    with pytest.raises(SystemExit):
        main([name.replace("_", "-"), "--help"])
    told = " ".join(capsys.readouterr().out.split())
    for p in verbs.described(COMMANDS[name].place).parameters.values():
        if not p.flag and not p.type.word:
            continue  # only Python gives it
        assert p.about and p.about[0].isupper() and p.about.endswith("."), p.name
        assert "[" not in p.about and (p.flag or p.type.word in _values.KINDS), p.name
        assert p.required or COMMANDS[name].option(p.name) in told, p.name
        assert p.about[1:60].split(" ", 1)[1] in told, p.name
