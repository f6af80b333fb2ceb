"""Examples run as they are written, and the README shows what its commands print."""

import importlib
import re
import runpy
import shlex
import shutil
from pathlib import Path

import pytest

from mckibben.cli import main

ROOT = Path(__file__).resolve().parents[2]
README = (ROOT / "README.md").read_text(encoding="utf-8")
NUMBER = re.compile(r"[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


LONG = {
    "antagonist_joint.py",
    "learn_by_gradient.py",
    "learn_by_ppo.py",
    "elbow_in_opensim.py",
    "identify_in_mujoco.py",
    "learn_a_residual.py",
}  # up to a minute
NEEDS = {
    "elbow_in_opensim.py": "opensim",
    "identify_in_mujoco.py": "colorama",
}  # libraries that the tests do not install
SCRIPTS = sorted(p.name for p in (ROOT / "examples").glob("*.py"))


@pytest.mark.parametrize("script", [pytest.param(s, marks=pytest.mark.slow) if s in LONG else s for s in SCRIPTS])
def test_example_runs_and_draws(script: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    if script in NEEDS:
        pytest.importorskip(NEEDS[script], reason=f"{NEEDS[script]} is not installed")
    runpy.run_path(str(ROOT / "examples" / script))["main"](tmp_path)
    assert capsys.readouterr().out.strip()
    assert (tmp_path / script.replace("_", "-").replace(".py", ".svg")).stat().st_size > 1000


def readme_blocks() -> list[list[tuple[str, list[str]]]]:
    """Each block of `$ mckibben` lines of the README, every line with those shown below it."""
    found: list[list[tuple[str, list[str]]]] = []
    for block in re.findall(r"^```console\n(.*?)^```", README, re.M | re.S):
        found.append([])
        for line in block.splitlines():
            if line.startswith("$ "):
                found[-1].append((line[2:], []))
            elif line.strip():
                found[-1][-1][1].append(line)
    return found


@pytest.mark.parametrize("block", readme_blocks(), ids=lambda block: block[0][0][:40])
def test_readme_shows_what_its_commands_print(
    block: list[tuple[str, list[str]]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    for command, shown in block:
        check_command(command, shown, capsys)


def check_command(command: str, shown: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    words = shlex.split(command)
    assert words[0] == "mckibben"
    with pytest.raises(SystemExit) as ended:
        main(words[1:])
    assert ended.value.code == 0
    printed = [line for line in capsys.readouterr().out.splitlines() if line.strip()]
    assert printed
    for ours, theirs in zip(shown, printed, strict=False):
        assert words_of(ours) == words_of(theirs)
        a, b = numbers(ours), numbers(theirs)
        # Other processors and versions of the solvers move the last digits of a fit; a bound of an interval that is
        # nearly zero moves as much as the interval is wide.
        assert a == pytest.approx(b, rel=0.02, abs=0.02 * max(map(abs, a), default=0.0))
    assert len(shown) <= len(printed)


def test_readme_python_runs(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(ROOT)
    blocks = re.findall(r"^```python\n(.*?)^```", README, re.M | re.S)
    assert blocks
    for block in blocks:
        exec(compile(block, "README.md", "exec"), {})
    assert len(numbers(capsys.readouterr().out)) >= 5


def test_readme_begins_with_the_two_commands_and_their_picture() -> None:
    head = README[:1800]
    assert head.index("make demo") < head.index("make test") < head.index("docs/assets/figure-3a.svg")
    for picture in re.findall(r"\]\((docs/assets/[^)]+)\)", README):
        assert (ROOT / picture).is_file(), picture


def test_no_picture_lies_about_that_nobody_shows() -> None:
    text = README + "".join(page.read_text(encoding="utf-8") for page in (ROOT / "docs").rglob("*.md"))
    for picture in (ROOT / "docs/assets").glob("*.*g"):
        assert f"assets/{picture.name}" in text, picture.name


def words_of(line: str) -> list[str]:
    return re.sub(r"\s+", " ", NUMBER.sub("#", line)).split()


def numbers(line: str) -> list[float]:
    return [float(n) for n in NUMBER.findall(line)]


PAGE = """
```python quiet
hidden = 1
```
```python
print(hidden)
```
```console exit=2
$ test a = b || exit 2
$ true \\
  and more
```
```sh
$ false
true
```
```sh needs=board
exit 1
```
```python file=my.py
WORD = "from a file"
```
```python
from my import WORD
```
"""


def test_a_page_as_printed_runs_all_that_a_reader_sees_and_nothing_else(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A block that builds on a hidden one fails, and so does a command that ends otherwise than the page says."""
    monkeypatch.syspath_prepend(str(ROOT / "docs"))
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.chdir(tmp_path)
    ran, left_out, (unknown, ended, first) = importlib.import_module("examples").run_as_printed(PAGE, "a page")
    assert (
        ran == 7 and left_out == 1
    )  # three blocks of Python and four commands, one in two lines; one that needs a board
    assert "NameError: name 'hidden' is not defined" in unknown and unknown.startswith("a page, line 5")
    assert "`true" in ended and "and more` ended with 0 instead of 2" in ended
    assert "ended with 1 instead of 0" in first and first.startswith("a page, line 13")
