"""The table of commands lists what the commands say of themselves, and imports none of them to do so."""

import subprocess
import sys

import pytest
import typer

from mckibben.cli.app import COMMANDS, app


@pytest.mark.parametrize("words", [w for w, (place, _) in COMMANDS.items() if place])
def test_the_line_that_lists_a_command_is_the_first_of_its_own_help(words):
    command = typer.main.get_command(app)
    for word in words.split():
        command = command.commands[word]
    assert command.help.splitlines()[0] == COMMANDS[words][1]


def test_the_list_of_commands_imports_none_of_them():
    code = (
        "import sys; from mckibben.cli import main\ntry: main(['--help'])\n"
        "except SystemExit: print(sorted(m for m in sys.modules if m.startswith('mckibben.cli.')))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    shared = {f"mckibben.cli.{name}" for name in ("app", "_command", "_progress", "_terminal", "_values")}
    assert set(eval(done.stdout.splitlines()[-1])) == shared
