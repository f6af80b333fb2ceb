"""What every verb keeps, whatever it computes: its faces say the same, and each parameter is declared, told and refused."""

import html
import json
import math
import os
import re
from pathlib import Path

import pytest

from mckibben import verbs
from mckibben.answers import named
from mckibben.cli import _values, main, verb_commands
from mckibben.cli._terminal import json_text
from mckibben.cli._verb import VerbCommand
from mckibben.cli.app import COMMANDS as EVERY
from mckibben.errors import InputError
from mckibben.registry import PACKAGES, plugins

CIRCUITS = Path(__file__).parents[1] / "examples" / "circuits"
DECLARED = {
    words: getattr(verb_commands, place.partition(":")[2])
    for words, (place, _) in EVERY.items()
    if place.startswith("verb_commands:")
}
# By the words that ask a verb; a command of several verbs asks each by other words.
COMMANDS = {words: one for words, one in DECLARED.items() if isinstance(one, VerbCommand)}
COMMANDS |= {
    "fit": verb_commands.fit_tables,
    "fit --friction": verb_commands.fit_friction,
    "fit printed.toml": verb_commands.fit_printed,
    "characterise": verb_commands.characterise_unknown,
    "characterise --like festo-10mm": verb_commands.characterise_like,
}
ANNOUNCED = {name.replace("-", " "): one for name, one in plugins("mckibben.commands").items()}
COMMANDS |= {name: one for name, one in ANNOUNCED.items() if isinstance(one, VerbCommand)}
COMMANDS["benchmark"] = ANNOUNCED["benchmark"].first
# A question for each verb, by the words of its command; with cautions where there are any to be had.
ASKED = {
    "muscles": "",
    "show": "MPYE-5-1-8-LF",
    "braid": "--length 300mm --angle 25deg --diameter 12mm --thread 0.25mm --bladder 1mm",
    "parts": "tubes",
    "protocols": "work-loop",
    "circuit show": f"{CIRCUITS / 'filling-a-tank.toml'}",
    "circuit run": f"{CIRCUITS / 'filling-a-tank.toml'} --set run.duration=0.2s",
    "circuit frequency": f"{CIRCUITS / 'muscle-behind-a-tube.toml'} --input regulator.pressure --output muscle.pressure_abs",
    "circuit fit": "no.toml no.nc",
    "calibrate zero": "--rig modern --simulate --channels valve_pressure",
    "calibrate weights": "--rig modern --simulate --samples 100 --masses 0kg,5kg",
    "calibrate pressure": "--rig modern --simulate --samples 100 --pressures 0bar,3bar",
    "calibrate encoder": "--rig paper --simulate --travels 0mm,50mm",
    "calibrate skew": "--rig modern --simulate --samples 1000",
    "calibrate show": "no.toml",
    "calibrate apply": "no.nc --off --out no.csv",
    "run": "work-loop --muscle nylon --rig modern --dry-run",
    "characterise": "--muscle nylon --max-pressure 20bar --out own",
    "characterise --like festo-10mm": "--muscle nylon --max-pressure 20bar --out own",
    "benchmark": "--task nothing",
    "reproduce": "--row valve.festo_power --no-recordings",
    "joint": "--command flexor=0.1 --duration 0.02s",
    "control": "--controller memory-inverse --plants 0 --duration 3s",
    "sweep": f"{CIRCUITS.parent / 'sweeps' / 'tube-and-threshold.toml'} --out sweep --dry-run",
    "tension": "nylon --length 11:12:0.5cm --pressure 5bar",
    "energy": "nylon --pressure 5bar --cycle maximal",
    "size": "--force 35N --stroke 2.8cm --pressure 5bar --no-lines --cycles 1Hz --working-time 8h",
    "compare": "nylon fast-fibre --pressure 12bar",
    "conform": "python --scenario hang --no-states",
    "fit": "twice.csv --law gas_spring --train-below 4bar",
    "fit --friction": "dahl loop.csv --set per_pressure=0",
    "fit printed.toml": "",
    "read": "pull.csv --as recording --unit force=N --unit length=mm",
    "record show": "pull.csv --unit force=N --unit length=mm",
    "record frequency": "pull.csv --unit force=N --unit length=mm --input length --output force",
    **{f"record {name}": "strokes.csv --length-channel length --to 6s" for name in ("loops", "work", "stiffness")},
    "record steps": "strokes.csv --command-channel pressure",
    "record leak": "strokes.csv --from 1s --gas-volume 100ml",
    # refused in one sentence; other tests have their answers
    **dict.fromkeys(("diagnose", "record energy", "record contraction", "record work-loops"), "no.nc"),
    "next": "--from no.json",
    **dict.fromkeys(("study robot", "study loops"), "nowhere"),
    "study tube": "--quick --out tube.gif",
    "study validation": "--only nothing",
    "record repeatability": "no.nc",
}
OTHERS = {
    "fit --friction": verb_commands.fit_tables,
    "fit printed.toml": verb_commands.fit_tables,
    "characterise --like festo-10mm": verb_commands.characterise_unknown,
}
PRINTED = """law = "linear_threshold"
[known]
rest_length = "14.7 cm"
upper_length = "15 cm"
[[constraint]]
what = "free_length"
value = "11.466 cm"
pressure = "5 bar"
"""
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


def test_every_verb_has_a_command_and_is_asked_here():
    assert set(ASKED) == set(COMMANDS)
    named = [one for name, one in COMMANDS.items() if EVERY.get(name, ("",))[0] not in PACKAGES]
    assert len(named) == sum(isinstance(one, VerbCommand) for one in vars(verb_commands).values())


@pytest.mark.parametrize("name", COMMANDS)
def test_no_help_holds_a_place_that_only_refusals_and_cautions_fill(name):
    """Names in braces are put in by whoever asks, in what is said of values: a help would show the braces."""
    verb = verbs.described(COMMANDS[name].place)
    said = [*verb.paragraphs, *(p.about for p in verb.parameters.values())]
    assert [words for words in said if re.search(r"\{\w+(=\w+)?\}", words)] == []


@pytest.mark.parametrize("name", COMMANDS)
def test_terminal_json_table_and_python_say_the_same(ask, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("mckibben.recordings.provenance.created", lambda: "2026-03-31T12:00:00+00:00")
    times = [0.01 * i for i in range(600)]
    lines = [f"{t},{100.0 + math.sin(t * t)},{30.0 + 5.0 * math.sin(t * t - 0.1)}" for t in times]
    (tmp_path / "pull.csv").write_text("\n".join(["time [s],length,force", *lines]), encoding="utf-8")
    rows = [f"{length},{bar},{0.4 * bar * (length - 110)}" for length in range(120, 140, 5) for bar in range(1, 7)]
    lines = [
        f"{t},{130 + 5 * math.sin(6 * t)},{30 + 5 * math.sin(6 * t - 0.1)},{3 + (t > 1)},{30 * (t > 1)}" for t in times
    ]
    (tmp_path / "strokes.csv").write_text("\n".join(["time [s],length [mm],force [N],pressure [bar],cell [N]", *lines]))
    (tmp_path / "twice.csv").write_text("\n".join(["length [mm],pressure [bar],force [N]", *rows, *rows[:3]]))
    strokes = [(4 - abs(4 - 0.3 * i), (i > 13) * 3 * math.sin(0.12 * i)) for i in range(27)]
    lines = [f"{bar},{10 * bar + more}" for bar, more in strokes]
    (tmp_path / "loop.csv").write_text("\n".join(["pressure [bar],stroke [mm]", *lines]))
    (tmp_path / "printed.toml").write_text(PRINTED)
    code, out, err, answer = ask(name, *ASKED[name].split())
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
    assert all(named(remark, COMMANDS[name]._called) in out for remark in answer.remarks())
    page = html.unescape(few._repr_html_())
    assert all(one.text in page for one in answer.cautions) and all(
        named(remark) in page for remark in answer.remarks()
    )
    for table in few.tables():
        assert all(f">{cell}</td>" in page for row in table.cells()[: table.most] for cell in row)
        assert table.title in page and all(note in page for note in table.notes)
    cautions = [one.text for one in answer.cautions]
    assert [line.partition("caution: ")[2] for line in err.splitlines() if "caution: " in line] == cautions
    file = tmp_path / "rows.json"
    written = ["--out", str(file)] if COMMANDS[name].outputs.kinds else []
    code, printed, *_ = ask(name, *ASKED[name].split(), "--json", *written)
    assert code == 0 and (not written or json.loads(printed) == json.loads(file.read_text()))
    unwritten = {"file": None} if "recording" in COMMANDS[name].outputs.kinds else {}
    assert json.loads(printed) == json.loads(json_text(few.to_dict() | {"warnings": cautions} | unwritten))


# Questions about one muscle, for the verbs whose answers are made from a specimen.
OF_A_MUSCLE = {
    "show": "{}",
    "tension": "{} --contraction 2% --pressure 3bar",
    "energy": "{} --pressure 3bar --cycle maximal",
    "size": "--muscle {} --force 10N --stroke 1cm --pressure 3bar --no-lines",
    "compare": "{} --pressure 3bar",
    "joint": "{} --command flexor=0.1 --duration 0.02s",
    "run": "isometric-step --muscle {} --rig modern --set cycles=1",
    "sweep": "{}.toml --out results-{} --scheduler serial",
    "control": "--plants 0 --duration 3s",
}
SWEPT_OF = {"festo-10mm": ("shear_modulus", '"1 MPa"'), "nylon": ("threshold_pressure", '"1 bar"')}
SWEPT = """schema = 1
protocol = "isometric-step"
muscle = "{}"
rig = "modern"
[set]
range = "full"
cycles = 1
sample_rate = "1 kHz"
[outputs.peak]
channel = "tension"
reduce = "max"
[[list]]
"muscle.law.{}" = {}
"""
# They compare a specimen with something measured, whose answer has intervals of its own.
OF_MEASUREMENTS = {
    "fit", "fit --friction", "diagnose", "record energy", "next", "characterise --like festo-10mm", "characterise",
}  # fmt: skip


@pytest.mark.parametrize("muscle", ["festo-10mm", "nylon"])
@pytest.mark.parametrize("name", OF_A_MUSCLE)
def test_an_answer_made_from_a_specimen_states_its_interval_or_that_it_has_none(
    ask, name, muscle, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / f"{muscle}.toml").write_text(SWEPT.format(muscle, *SWEPT_OF[muscle]))
    known = muscle == "festo-10mm" and name not in ("control", "sweep")  # which have muscles of their own
    words = "lies within 20 % of its largest tension (95 %)" if known else "no interval"
    asked = OF_A_MUSCLE[name].replace("{}", muscle).split()
    code, out, err, _ = ask(name, *asked)
    assert code == 0, err
    assert words.lower() in " ".join(out.lower().split())
    code, printed, *_ = ask(name, *asked, "--json")
    assert code == 0 and words in printed


def test_every_verb_about_a_muscle_is_asked_for_its_interval():
    about = {
        name
        for name, command in COMMANDS.items()
        for p in verbs.described(command.place).parameters.values()
        if p.type.word.partition("|")[0] == "SPECIMEN"
    }
    assert (
        about - {"export"} == set(OF_A_MUSCLE) - {"sweep", "control"} | OF_MEASUREMENTS
    )  # a file, a bench name theirs


@pytest.mark.parametrize(("name", "p"), QUANTITIES, ids=lambda one: getattr(one, "name", one))
def test_each_quantity_refuses_another_dimension_by_the_name_that_its_user_gave(name, p):
    command = COMMANDS[name]
    required = [q for q in verbs.described(command.place).parameters.values() if q.required]
    given = {p.name: "3 kelvin"} | {q.name: ["nylon"] if q.several else "nylon" for q in required if q is not p}
    with pytest.raises(InputError) as python:
        verbs.answer(verbs.load(command.place), given)
    with pytest.raises(InputError) as typed:
        verbs.answer(verbs.load(command.place), given, command.option)
    option = command.option(p.name)
    assert str(typed.value).startswith(f"{option} ") and "3 kelvin" in str(typed.value)
    assert str(python.value) == str(typed.value).replace(option, p.name)


@pytest.mark.parametrize("name", COMMANDS)
def test_each_parameter_is_told_in_the_help_with_its_kind(name, capsys, monkeypatch):
    monkeypatch.setitem(os.environ, "COLUMNS", "100")
    with pytest.raises(SystemExit):
        main([*(word for word in name.split() if "." not in word and word[0] != "-"), "--help"])
    told = " ".join(capsys.readouterr().out.split())
    # of a command of several verbs the first tells the arguments, and what others take as well
    shared = verbs.described(OTHERS[name].place).parameters if name in OTHERS else {}
    for one in verbs.described(COMMANDS[name].place).parameters.values():
        if shared and (one.name in shared or one.required and not one.keyword):
            continue
        for p in one.parts or (one,):
            if not p.flag and not p.type.word:
                continue  # only Python gives it
            assert p.about and p.about[0].isupper() and p.about.endswith("."), p.name
            assert "[" not in p.about.replace("'F [N]'", "") and (p.flag or p.type.word in _values.KINDS), p.name
            assert COMMANDS[name].is_argument(p) or COMMANDS[name].option(p.name) in told, p.name
            assert p.about[1:60].split(" ", 1)[1] in told, p.name
