"""Update the output of commands and the figures in the README.

All commands of the console blocks run in order, in one empty folder with a copy of the examples. Output is inserted below a
command if the README shows output there; a figure that a command writes, and that the README shows, is copied to
`docs/assets`. `tests/habits/test_examples.py` fails if the README is out of date.
"""

from __future__ import annotations

import os
import re
import shlex
import shutil
import tempfile
from pathlib import Path

from examples import ExampleError, run_command

ROOT = Path(__file__).resolve().parents[1]
ASSETS = ROOT / "docs" / "assets"
# Figures of `make demo`, whose commands take minutes together.
DEMO = {
    "demo.png": ["fit", "DMSP-10-250", "DMSP-20-300", "--train-below", "4 bar", "--out", str(ASSETS / "demo.png")],
    "figure-3a.svg": ["reproduce", "--figure", "3a", "--out", str(ASSETS)],
}


def refresh(path: Path) -> None:
    """Rewrite the README; only output and figures of commands change."""
    text = path.read_text(encoding="utf-8")
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        shutil.copytree(ROOT / "examples", Path(folder) / "examples")
        os.chdir(folder)
        try:
            text = re.sub(r"(?ms)^```console\n(.*?)^```", lambda m: f"```console\n{_commands(m[1])}```", text)
        finally:
            os.chdir(before)
        for name in re.findall(r"\]\(docs/assets/([\w.-]+)\)", text):
            if (made := Path(folder) / name).is_file():
                shutil.copy(made, ASSETS / name)
            elif name in DEMO:
                _run(DEMO[name])
            else:
                raise ExampleError(f"README: no command writes {name}")
    path.write_text(text, encoding="utf-8", newline="\n")


def _commands(block: str) -> str:
    """Return each command, with its output if the block showed output."""
    out = []
    for piece in re.split(r"(?m)^(?=\$ )", block):
        if not piece.strip():
            continue
        command, _, shown = piece.partition("\n")
        out.append(command)
        text = _run(shlex.split(command)[2:])
        if shown.strip():
            out.append(re.sub(r"\n\n+\Z", "\n", text).rstrip("\n"))
    return "\n".join(out) + "\n"


def _run(words: list[str]) -> str:
    text, code = run_command(words)
    if code:
        raise ExampleError(f"README: `mckibben {shlex.join(words)}` ended with exit code {code}:\n{text}")
    return text
