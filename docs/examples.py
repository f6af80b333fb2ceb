"""Run the examples of a page and insert their output below them, or run them as a reader does who sees the page only.

    python docs/examples.py PAGE ..      every visible block as printed, by this Python with what is installed for it

A ```python block runs in the namespace of its page, and its output follows as a block of text. In a ```console block every
line that begins with ``$ mckibben`` runs, and its output follows. A ```sh block runs as printed only, by a shell. Options
after the language control the output:

    ```console exit=2          the command must end with this exit code; standard error is shown
    ```console lines=12        show at most this many lines of the output, then an ellipsis
    ```python quiet            run without showing the code or its output
    ```python needs=LIBRARY    run only where the library is installed, which `make docs` does not install; else without output
    ```sh needs=board          never run: it needs what no library brings, such as a board, measured data or a second terminal;
                               any block may say so
    ```python job              a script of a job, which runs in a process of its own and is timed (see jobs.py)

Each page runs in an empty working directory; figures saved there become assets of the site. As printed it runs in a folder
with the entries of this copy, commands by a shell, without the blocks that a reader does not see, with warnings as they come
by default. Of each page the numbers of commands and blocks of Python are printed that ran and that were left out for what they
need, and what failed; commands of pip are what was done before (`as_printed.py` does it, for all pages).
"""

from __future__ import annotations

import contextlib
import importlib.util
import io
import os
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import traceback
from pathlib import Path

import jobs

FENCE = re.compile(r"^```(python|console|sh)\b([^\n]*)\n(.*?)^```[ \t]*$", re.M | re.S)
FIGURES = (".svg", ".png")


class ExampleError(Exception):
    """An example did not behave as its page states."""


def run_page(text: str, name: str, figures: Path) -> str:
    """Return a page with the output of its examples, and save their figures in a folder.

    Args:
        text: source of the page.
        name: name of the page in error messages.
        figures: folder for the figures that the examples save.
    """
    if not FENCE.search(text):
        return text
    before = Path.cwd()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        try:
            space: dict[str, object] = {"__name__": "__main__"}
            job: list[jobs.Job] = []
            shown = FENCE.sub(
                lambda m: _block(
                    m[1], m[2].split(), m[3], space, job, f"{name}, line {text[: m.start()].count(chr(10)) + 1}"
                ),
                text,
            )
            if job:
                measured = job[0].finish()
                jobs.save(measured, figures)
                shown = shown.replace(jobs.SUMMARY, measured.sentence())
        finally:
            os.chdir(before)
        for path in sorted(Path(folder).iterdir()):
            if path.suffix in FIGURES:
                figures.mkdir(parents=True, exist_ok=True)
                shutil.copy(path, figures / path.name)
    return shown


def _block(kind: str, words: list[str], body: str, space: dict[str, object], job: list[jobs.Job], where: str) -> str:
    options = dict(w.split("=") for w in words if "=" in w)
    most = int(options.get("lines", "0"))
    if "job" in words:
        if not job:
            job.append(jobs.Job(Path.cwd()))
        return _job_block(kind, body, job[0], options.get("file", ""), int(options.get("exit", "0")), most, where)
    if kind == "sh":
        return f"```sh\n{body}```"
    if kind == "console":
        return f"```console\n{_commands(body, int(options.get('exit', '0')), most, where)}```"
    if _lacks(words, where):
        return f"```python\n{body}```"
    printed = _python(body, space, where)
    if "quiet" in words:
        return ""
    out = f"\n\n```text\n{_shortened(printed, most)}```" if printed.strip() else ""
    return f"```python\n{body}```{out}"


def _lacks(words: list[str], where: str) -> bool:
    """Whether a block needs what is not there; says so."""
    needs = next((w.partition("=")[2] for w in words if w.startswith("needs=")), "")
    if lacks := bool(needs) and importlib.util.find_spec(needs) is None:
        print(f"{where}: left out, for it needs {needs}")
    return lacks


def _job_block(kind: str, body: str, job: jobs.Job, file: str, code: int, most: int, where: str) -> str:
    """Return a block of a job with the output of its script, or of each of its commands."""

    def done(result: tuple[str, int], what: str) -> str:
        output, ended = result
        if ended != code:
            raise ExampleError(f"{where}: {what} ended with {ended} instead of {code}:\n{output}")
        return _shortened(_plain(output), most)

    if file:
        job.file(file, body)
        return f"```python\n{body}```"
    if kind == "python":
        output = done(job.script(body), "the script")
        return f"```python\n{body}```" + (f"\n\n```text\n{output}```" if output.strip() else "")
    shown = []
    for line in re.split(r"(?m)^\$ ", body)[1:]:
        line = line.rstrip("\n")
        shown.append(f"$ {line}\n{done(job.command(line), f'`{line}`')}".rstrip("\n"))
    return "```console\n" + "\n".join(shown) + "\n```"


def _python(body: str, space: dict[str, object], where: str) -> str:
    stream = io.StringIO()
    ignored: list[object] = []  # a file left open is a warning that Python cannot raise
    sys.unraisablehook = lambda found: ignored.append(found.exc_value)
    try:
        with contextlib.redirect_stdout(stream):
            exec(compile(body, f"<{where}>", "exec", dont_inherit=True), space)
    except Exception:
        raise ExampleError(f"{where}:\n{body}\n{traceback.format_exc()}") from None
    finally:
        sys.unraisablehook = sys.__unraisablehook__
    if ignored:
        raise ExampleError(f"{where}:\n{body}\n{ignored[0]}")
    return _plain(stream.getvalue())


def _commands(body: str, code: int, most: int, where: str) -> str:
    """Return a block with the output of each command below it; other lines of the source are old output and are dropped."""
    lines = body.replace("\\\n", "\\\0").splitlines()
    shown = []
    for line in (x.replace("\\\0", "\\\n") for x in lines if x.startswith("$ ")):
        shown.append(line)
        words = shlex.split(line[2:].replace("\\\n", " "))
        if words[0] != "mckibben":
            raise ExampleError(
                f"{where}: only `mckibben` commands can be run, not {words[0]}; use another kind of block"
            )
        output, ended = run_command(words[1:])
        if ended != code:
            raise ExampleError(f"{where}: `{line[2:]}` ended with {ended} instead of {code}:\n{output}")
        shown.append(_shortened(output, most).rstrip("\n"))
    return "\n".join(x for x in shown if x) + "\n"


def run_command(words: list[str]) -> tuple[str, int]:
    """Run a command line in this process; return its output and exit code, with standard error if it fails."""
    from mckibben.cli import main

    out, err = io.StringIO(), io.StringIO()
    code = 0
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            main(words)
        except SystemExit as end:
            code = int(end.code or 0)
    return _plain(out.getvalue() + (err.getvalue() if code else "")), code


def _plain(text: str) -> str:
    """Remove terminal colour codes and trailing spaces."""
    return re.sub(r"[ \t]+$", "", re.sub(r"\x1b\[[0-9;]*m", "", text), flags=re.M).strip("\n") + "\n"


def _shortened(text: str, most: int) -> str:
    lines = text.splitlines()
    if most and len(lines) > most:
        lines = [*lines[:most], "..."]
    return "\n".join(lines) + "\n"


# ---- as printed


def run_as_printed(text: str, name: str) -> tuple[int, int, list[str]]:
    """Run the visible blocks of a page in the present folder.

    Returns:
        The numbers of commands and blocks of Python that ran, and that were left out; and what failed.
    """
    space: dict[str, object] = {"__name__": "__main__"}
    ran, left_out, failed = 0, 0, []
    for m in FENCE.finditer(text):
        kind, words, body = m[1], m[2].split(), m[3]
        where = f"{name}, line {text[: m.start()].count(chr(10)) + 1}"
        options = dict(w.split("=") for w in words if "=" in w)
        if "quiet" in words or (kind == "sh" and "-m pip install" in body):
            continue
        prompt = r"\$ " if kind == "console" else r"(?=\S)"
        # a block of Python is one; so is a command that goes on in the next line
        commands = [body] if kind == "python" else re.findall(rf"(?m)^{prompt}(.*(?:(?<=\\)\n.*)*)", body)
        if _lacks(words, where):
            left_out += len(commands)
            continue
        ran += len(commands)
        if kind == "sh":  # one line builds on another
            commands = ["set -e\n" + re.sub(r"(?m)^\$ ", "", body)]
        for command in commands:
            try:
                if "file" in options:
                    Path(options["file"]).write_text(body, encoding="utf-8")
                elif kind == "python" and "job" not in words:
                    _python(body, space, where)
                elif kind == "python":
                    _in_shell(f"{shlex.quote(sys.executable)} - <<'END'\n{body}END\n", 0, where)
                else:
                    _in_shell(command, int(options.get("exit", "0")), where)
            except (ExampleError, SystemExit) as error:
                failed.append(str(error))
    return ran, left_out, failed


def _in_shell(command: str, code: int, where: str) -> None:
    """Run a command by a shell that finds the programs of this Python first, and see that it ends with an exit code."""
    path = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
    try:
        done = subprocess.run(
            ["bash", "-c", command], env={**os.environ, "PATH": path}, stdin=subprocess.DEVNULL,
            capture_output=True, text=True, timeout=jobs.TIMEOUT, check=False,
        )  # fmt: skip
    except subprocess.TimeoutExpired:
        raise ExampleError(f"{where}: `{command.strip()}` did not end within {jobs.TIMEOUT:.0f} s") from None
    if done.returncode != code:
        said = (done.stderr or done.stdout).strip()[-600:]
        raise ExampleError(f"{where}: `{command.strip()}` ended with {done.returncode} instead of {code}:\n{said}")


def main(pages: list[str]) -> int:
    """Run pages as printed, each in a process and a folder of its own; the exit code is 1 if anything failed."""
    root = Path(__file__).resolve().parents[1]
    if len(pages) > 1:
        return max(subprocess.run([sys.executable, __file__, page], check=False).returncode for page in pages)
    text, name = Path(pages[0]).read_text(encoding="utf-8"), pages[0]
    sys.path[0] = ""  # as for a script of the reader's in that folder, and not the scripts beside this one
    with tempfile.TemporaryDirectory() as folder:
        for entry in root.iterdir():
            if entry.name not in ("build", "dist", "out", "site") and not entry.name.startswith("."):
                Path(folder, entry.name).symlink_to(entry)
        os.chdir(folder)
        ran, left_out, failed = run_as_printed(text, name)
        os.chdir(root)
    print(f"{name}: {ran} run, {left_out} left out, {len(failed)} failed", *failed, sep="\n  ", flush=True)
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
