"""The command line as one hand made it: rules over all commands and options, read from the parser."""

import re
import shlex
from collections import defaultdict
from typing import Any

import pytest

from mckibben.cli import _values
from mckibben.cli._command import described, help_text
from mckibben.cli.app import COMMANDS, table_of_commands
from mckibben.quantities import parse

WORDS = [words for words, (place, _) in COMMANDS.items() if place]
# Order of the options that several commands have; those of a command's own stand before or between them.
ORDER = ("--muscle", "--rig", "--law", "--set", "--width", "--style", "--out", "--json")


def command(words: str) -> Any:
    """A command of the table."""
    found = table_of_commands()
    for word in words.split():
        found = found.commands[word]
    return found


ALL = {words: command(words) for words in WORDS}


def options(words: str) -> list[Any]:
    """Options of a command that take a value."""
    return [p for p in ALL[words].params if p.param_type_name == "option" and not p.is_flag]


@pytest.mark.parametrize("width", [80, 100])
def test_no_line_of_a_help_is_wider_than_the_terminal_and_none_cuts_a_value(width):
    for words, one in ALL.items():
        lines = help_text(one, f"mckibben {words}", width).splitlines()
        typed = [line for line in lines if line.startswith(("Usage:", "  mckibben "))]  # to be copied whole
        assert [line for line in lines if len(line) > width and line not in typed] == [], words
        values = [value for p in one.params for value in re.findall(r"'[\d-][^']* [^']*'", p.help)]
        assert [value for value in values if not any(value in line for line in lines)] == [], words


def test_every_value_has_a_kind_that_says_what_it_is():
    for words, one in ALL.items():
        for p in one.params:
            assert getattr(p, "is_flag", False) or p.metavar in _values.KINDS, (words, p.name, p.metavar)
    used = {p.metavar for one in ALL.values() for p in one.params}
    assert set(_values.KINDS) <= used


def test_every_quantity_shows_its_unit_by_an_example_or_a_default():
    for words in WORDS:
        for p in options(words):
            unit = _values.KINDS[p.metavar].unit
            shown = re.findall(r"'(-?[\d.][^']*)'", p.help) + ([p.default] if isinstance(p.default, str) else [])
            if unit and unit != "1":
                assert shown, (words, p.name)
                for one in shown[0].replace(";", ",").split(","):
                    if ":" not in one:
                        parse(one, unit, field=p.name)  # of the right dimension


def test_every_help_begins_with_a_capital_and_ends_with_a_full_stop():
    for words, one in ALL.items():
        for p in one.params:
            assert p.help and p.help[-1] == "." and "repeatable" not in p.help, (words, p.name)
            assert p.help[0].isupper() or p.help.split(",")[0] in ("bash",), (words, p.name, p.help)


def test_every_command_has_an_example_that_its_parser_takes():
    for words, one in ALL.items():
        _, examples = described(one)
        assert examples, words
        for example in examples:
            typed = shlex.split(example)
            assert typed[: 1 + len(words.split())] == ["mckibben", *words.split()]
            one.make_context(words, typed[1 + len(words.split()) :])  # raises where it is not taken


def test_options_of_one_name_take_one_kind_of_value():
    kinds = defaultdict(set)
    for words in WORDS:
        for p in options(words):
            kinds[p.opts[0]].add(p.metavar)
    several = {name: found for name, found in kinds.items() if len(found) > 1}
    assert set(several) <= {
        "--from", "--to",  # ends of a range, of times or of frequencies
        "--set", "--start", "--unit", "--column", "--free", "--input", "--output",  # paths of what the command is about
        "--for", "--predict", "--angle", "--figure", "--stiffness", "--channel", "--out", "--friction",
        "--reading",  # of a muscle, and of the papers
        "--reference",  # of a calibration, and of a controller
    }, several  # fmt: skip


@pytest.mark.parametrize("words", WORDS)
def test_options_that_several_commands_have_stand_in_one_order(words):
    names = [p.opts[0] for p in ALL[words].params if p.param_type_name == "option"]
    own = (
        ("--out",) if words in ("record plot", "record report", "calibrate apply", "sweep") else ()
    )  # where it is required
    shared = [name for name in names if name in ORDER and name not in own]
    assert shared == [name for name in ORDER if name in shared]
    last = [name for name in names if name in ("--out", "--json")]
    assert names[len(names) - len(last) :] == last or words in (
        "record plot",
        "record report",
        "calibrate apply",
        "sweep",
    )


def test_all_that_can_be_written_is_written_by_out_and_all_that_ends_prints_json():
    lasting = {"console", "device serve", "serve", "help"}
    for words, one in ALL.items():
        names = {p.opts[0] for p in one.params if p.param_type_name == "option"}
        assert words in lasting or "--json" in names, words
        assert not names & {"--report", "--save", "--svg", "--output-file"}, words
    assert {p.opts[0] for p in ALL["reproduce"].params if p.opts[0] == "--figure"}  # which figure, not where to


def test_every_default_is_one_that_the_parser_takes():
    """What is typed is judged where it is read; what a command has by itself goes the same way, such as a folder."""
    for words, one in ALL.items():
        with one.make_context(words, [], resilient_parsing=True) as ctx:
            for param in one.params:
                if param.default is not None and not callable(param.default):
                    param.process_value(ctx, param.default)
