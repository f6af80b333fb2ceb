"""Run a job: the scripts and commands of a page as a user runs them, each in a process of its own, timed.

A page below `docs/jobs/` marks its blocks with the word ``job``:

    ```python job           a script; its output follows
    ```python job file=X    a file that the user writes, such as a class for a command
    ```console job          commands; the output of each follows

They run in the folder of the page, with empty caches, as just after the installation, and a second time in a copy of that
folder with the caches that the first time left. ``<!-- job -->`` becomes the number of lines, and the seconds of both times.
The page of the list, `docs/jobs/index.md`, gets the same of all jobs.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import NamedTuple

FOLDER = "jobs/"
FILE = "job.json"
SUMMARY = "<!-- job -->"
# What Matplotlib says on a busy machine when it begins with empty caches; no error.
SLOW_FONTS = "Matplotlib is building the font cache; this may take a moment.\n"
TIMEOUT = 300.0  # of one script or command on a busy machine [s]


class Measured(NamedTuple):
    """What a job takes: lines that the user writes, and seconds at the first time and later."""

    lines: int
    first: float
    later: float

    def sentence(self) -> str:
        """Return the numbers as a sentence."""
        lines = f"{self.lines} line{'s' * (self.lines != 1)}"
        return f"*{lines}; {self.first:.0f} s the first time, {self.later:.1f} s each time after that.*"


class Job:
    """The scripts and commands of one page, in order."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.steps: list[list[str]] = []
        self.lines = 0
        self.seconds = 0.0
        self._store = tempfile.TemporaryDirectory()
        self._room = Path(self._store.name)
        shutil.copytree(folder, self._room / "again")
        # Nothing is kept from before: neither kernels nor fonts.
        self._environment = {
            name: value
            for name, value in os.environ.items()
            if not name.startswith(("MCKIBBEN_", "JAX_", "LANEWISE_", "MPL"))
        } | {"XDG_CACHE_HOME": str(self._room / "cache"), "HOME": str(self._room)}
        source = Path(__file__).resolve().parents[1]
        own = [source / "src", *sorted(source.glob("packages/*/src"))]
        paths = [*map(str, own), os.environ.get("PYTHONPATH", "")]
        self._environment["PYTHONPATH"] = os.pathsep.join(filter(None, paths))

    def file(self, name: str, text: str) -> None:
        """Write a file as the user does."""
        self.lines += sum(bool(line.strip()) and not line.lstrip().startswith("#") for line in text.splitlines())
        for folder in (self.folder, self._room / "again"):
            (folder / name).write_text(text, encoding="utf-8")

    def script(self, text: str) -> tuple[str, int]:
        """Run a script; return its output and exit code."""
        name = f"job-{len(self.steps) + 1}.py"
        self.file(name, text)
        return self._run([name])

    def command(self, words: str) -> tuple[str, int]:
        """Run a command line that begins with ``mckibben``; return its output and exit code."""
        self.lines += words.count("\n") + 1
        return self._run(["-m", *shlex.split(words.replace("\\\n", " "))])

    def _run(self, step: list[str]) -> tuple[str, int]:
        self.steps.append(step)
        output, code, seconds = self._timed(step, self.folder)
        self.seconds += seconds
        return output, code

    def _timed(self, step: list[str], folder: Path) -> tuple[str, int, float]:
        begun = time.perf_counter()
        done = subprocess.run(
            [sys.executable, *step],
            cwd=folder,
            env=self._environment,
            text=True,
            capture_output=True,
            stdin=subprocess.DEVNULL,
            timeout=TIMEOUT,
            check=False,
        )
        seconds = time.perf_counter() - begun
        errors = done.stderr.replace(SLOW_FONTS, "") if done.returncode or step[0] != "-m" else ""
        return done.stdout + errors, done.returncode or int(bool(errors.strip())), seconds

    def finish(self) -> Measured:
        """Run all steps again in the copy of the folder; return what the job takes."""
        later = sum(self._timed(step, self._room / "again")[2] for step in self.steps)
        self._store.cleanup()
        return Measured(self.lines, self.seconds, later)


def save(measured: Measured, figures: Path) -> None:
    """Keep what a job takes beside the figures of its page."""
    figures.mkdir(parents=True, exist_ok=True)
    (figures / FILE).write_text(json.dumps(measured._asdict()), encoding="utf-8")


def load(figures: Path) -> Measured | None:
    """Return what the job of a page takes; None if the page has none."""
    path = figures / FILE
    return Measured(**json.loads(path.read_text(encoding="utf-8"))) if path.is_file() else None


def with_times(text: str, measured: dict[str, Measured]) -> str:
    """Return the list of the jobs with the lines and seconds of each, in the columns that its table leaves empty.

    Args:
        text: the page of the list; the row of a job links to its page.
        measured: what each job takes, by the name of its page.
    """
    rows = []
    for line in text.splitlines():
        link = re.search(r"\]\(([\w-]+\.md)\)", line)
        if line.startswith("|") and link and line.rstrip().endswith("| | | |"):
            one = measured[f"{FOLDER}{link[1]}"]
            line = f"{line.rstrip()[: -len('| | | |')]}| {one.lines} | {one.first:.0f} s | {one.later:.1f} s |"
        rows.append(line)
    return "\n".join(rows) + "\n"
