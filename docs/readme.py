"""Bring the README up to date: what its commands print, and its pictures. `tests/habits/test_examples.py` says when it is not.

All commands of its console blocks run, in order and in one empty folder with the examples beside. Output is put below a command where some
stood there; a picture that a command writes, and that the README shows, goes to `docs/assets`.
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
# Pictures of `make demo`, whose commands take minutes together.
DEMO = {
    "demo.png": ["fit", "DMSP-10-250", "DMSP-20-300", "--train-below", "4 bar", "--figure", str(ASSETS / "demo.png")],
    "figure-3a.svg": ["reproduce", "--figure", "3a", "--out", str(ASSETS)],
}


def refresh(path: Path) -> None:
    """Write the README anew; only what is made by commands changes."""
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
                raise ExampleError(f"README: no command makes {name}")
    path.write_text(text, encoding="utf-8", newline="\n")


def _commands(block: str) -> str:
    """Each command; its output where some was shown."""
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
        raise ExampleError(f"README: `mckibben {shlex.join(words)}` ended with {code}:\n{text}")
    return text
