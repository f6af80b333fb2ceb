"""What macOS and Windows lack is not needed: names of files, line ends, calls, and runs with all of it taken away."""

import ast
import functools
import os
import subprocess
import sys
from collections import Counter
from pathlib import Path, PurePosixPath

import pytest

ROOT = Path(__file__).parents[2]
SOURCES = sorted(p for folder in (ROOT / "src", *ROOT.glob("packages/*/src")) for p in folder.rglob("*.py"))
SHIPPED = ("src", "packages", "tests", "docs", "examples", "benchmarks", "requirements")
# Names of devices, which Windows takes for no file, with any suffix.
RESERVED = {"con", "prn", "aux", "nul", *(f"{port}{n}" for port in ("com", "lpt") for n in range(1, 10))}
# Of `os` on Linux, and not on Windows; `kill` is there, and ends whatever is asked whether it lives.
ABSENT = set(
    "fork forkpty nice sched_getaffinity sched_setscheduler getloadavg getuid geteuid uname openpty wait4 setsid killpg"
    " sysconf statvfs mkfifo posix_fadvise ttyname fchmod chown O_NONBLOCK".split()
)
MODULES = {"fcntl", "resource", "termios", "tty", "pty", "pwd", "grp", "msvcrt", "winreg"}
# Words of a function that says what happens on a system without it.
GUARDS = ("hasattr(", "AttributeError", "ImportError", "os.name", "sys.platform")
SIMULATED_LINE = "_pair"  # a pseudo-terminal is what a simulated serial line is made of: `device serve` says so


@functools.cache
def functions(path: Path) -> list[tuple[str, str, ast.AST]]:
    """Name, source and tree of each function of a file, and of the file where it is none."""
    text = path.read_text(encoding="utf-8")
    tree, lines = ast.parse(text), text.splitlines()
    inner = [n for n in ast.walk(tree) if isinstance(n, ast.FunctionDef)]
    return [(n.name, "\n".join(lines[n.lineno - 1 : n.end_lineno]), n) for n in inner] + [("", text, tree)]


def calls(tree: ast.AST, name: str) -> list[ast.Call]:
    return [
        n for n in ast.walk(tree)
        if isinstance(n, ast.Call) and name == (getattr(n.func, "attr", "") or getattr(n.func, "id", ""))
    ]  # fmt: skip


def test_what_only_one_system_has_is_used_where_its_absence_is_thought_of() -> None:
    """Each use stands in a function that names the guard; no file does at its top."""
    unguarded = []
    for path in SOURCES:
        *inner, (_, _, tree) = functions(path)
        guarded = {
            id(n)
            for name, text, one in inner
            if name == SIMULATED_LINE or any(g in text for g in GUARDS)
            for n in ast.walk(one)
        }
        for n in ast.walk(tree):
            of_os = isinstance(n, ast.Attribute) and getattr(n.value, "id", "") == "os" and n.attr in ABSENT
            imported = isinstance(n, ast.Import) and any(alias.name in MODULES for alias in n.names)
            if (of_os or imported) and id(n) not in guarded:
                unguarded.append(f"{path.relative_to(ROOT)}, line {n.lineno}")
    assert not unguarded


def test_no_process_is_asked_by_a_signal_whether_it_lives() -> None:
    """Signal 0 is Ctrl-C to the whole group on Windows; a lock that the system frees says the same everywhere."""
    assert not [path for path in SOURCES if "os.kill(" in path.read_text(encoding="utf-8")]


def test_text_is_written_with_the_same_line_ends_everywhere() -> None:
    """`documents.write_text` writes bytes; who opens a file to write text states line ends, else Windows makes its own."""
    wrong = []
    for path in SOURCES:
        tree = functions(path)[-1][2]
        text = [c for c in calls(tree, "write_text") if any(k.arg == "encoding" for k in c.keywords)]
        for c in calls(tree, "open"):
            modes = [
                a.value
                for a in (*c.args[1:2], *(k.value for k in c.keywords if k.arg == "mode"))
                if isinstance(a, ast.Constant)
            ]
            text += [c] if any(str(m)[:1] in "wx" and "b" not in str(m) for m in modes) else []
        text = [c for c in text if "devnull" not in ast.unparse(c)]
        wrong += [
            f"{path.relative_to(ROOT)}, line {c.lineno}" for c in text if all(k.arg != "newline" for k in c.keywords)
        ]
    assert not wrong


def test_no_two_files_differ_by_case_and_none_has_a_name_that_windows_refuses() -> None:
    """A folder of macOS or Windows keeps one of two names that differ by case only."""
    paths = [p.relative_to(ROOT) for top in SHIPPED for p in (ROOT / top).rglob("*") if "__pycache__" not in p.parts]
    assert not [name for name, count in Counter(str(p).casefold() for p in paths).items() if count > 1]
    assert not [p for p in paths if RESERVED & {PurePosixPath(part).stem.casefold() for part in p.parts}]
    assert not [p for p in paths if any(set('<>:"|?*\\') & set(part) or part[-1] in ". " for part in p.parts)]
    assert max(len(p.as_posix()) for p in paths) < 160  # of 260 that Windows takes, with a folder above


WORK = """
import multiprocessing, os, pkgutil, importlib, sys
if __name__ == "__main__":
    assert not hasattr(os, "fork") and multiprocessing.get_start_method() == "spawn" and not os.path.exists("x")
    try:
        open("/proc/meminfo")
        raise SystemExit("the simulation does not work")
    except FileNotFoundError:
        pass
    import mckibben as mk
    from mckibben.documents import locked
    from mckibben.recordings.memory import UNKNOWN, free_memory
    assert free_memory() == UNKNOWN
    with open("map.csv", "w") as file:
        file.write("length [mm],pressure [bar],force [N]\\n120,3,20\\n130,3,35\\n120,5,30\\n130,5,60\\n")
    table = mk.read("map.csv", rest_length="150 mm")  # by a process that may be ended
    run = mk.run("work-loop", muscle="nylon", cycles=1)
    run.save("loop.nc")
    run.save("loop.csv")
    print(len(table), len(mk.read("loop.nc").time))
"""


def test_a_run_and_a_reading_need_nothing_that_only_linux_has(tmp_path: Path) -> None:
    (tmp_path / "work.py").write_text(WORK, encoding="utf-8")
    paths = [ROOT / "tests" / "other_system", ROOT / "src", *sorted(ROOT.glob("packages/*/src"))]
    env = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths)), "XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "work.py"], cwd=tmp_path, env=env, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-3000:]
    assert done.stdout.split()[0] == "4"


@pytest.mark.parametrize("held", [False, True])
def test_a_lock_is_of_one_and_ends_with_its_holder(tmp_path: Path, held: bool) -> None:
    from mckibben.documents import locked

    place = tmp_path / "a.lock"
    with locked(place) as first:
        assert first
        if held:
            with locked(place) as second:
                assert not second
    with locked(place) as third:
        assert third
