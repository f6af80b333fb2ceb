"""Single mutations drawn by a seed, each against the tests beside it: `python tests/mutations.py SEED`.

`python tests/mutations.py FILE` makes those again that were not caught in what an earlier run has said.

A mutation is drawn before anybody looks at it: a room, a function of it, a kind of mutation, and its place. It is made in a
copy of the sources, so that the working tree stays as it is. Only tests that reach the function run, quick files and quick
tests first, up to the first that fails; which these are is known where all of a file has run (`REACHED`). A mutation
that changes nothing that can be observed is left out by its number (`--leave-out`), and one more is drawn in its place: say
which and why.
"""

import argparse
import ast
import contextlib
import cProfile
import hashlib
import inspect
import itertools
import json
import os
import platform
import random
import re
import resource
import shutil
import signal
import sys
import tempfile
import threading
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from types import CodeType
from typing import Any, NamedTuple

import hypothesis  # noqa: F401  of the tests, as are the next ones
import jax.numpy  # noqa: F401
import pytest
import scipy.optimize  # noqa: F401
import scipy.stats  # noqa: F401

from mutations_beside import ROOMS

ROOT = Path(__file__).parents[1]
SHARES = ("physics", "software", "guards", "hosts", "hardware", "studies", "physics")  # of a round, in turn
REACHED = (
    ROOT / ".pytest_cache" / "reached"
)  # one file for each file of tests as it is now, a line for each of its tests
MOST = 100  # for a file of tests [s of processor time]
SURVIVED, CAUGHT = "SURVIVED", "caught by "
TURNED: dict[type, str] = {
    ast.Lt: ">=", ast.LtE: ">", ast.Gt: "<=", ast.GtE: "<", ast.Eq: "!=", ast.NotEq: "==",
    ast.Is: "is not", ast.IsNot: "is", ast.In: "not in", ast.NotIn: "in",
}  # fmt: skip
OTHER: dict[type, str] = {ast.Add: "-", ast.Sub: "+", ast.Mult: "/", ast.Div: "*"}
PASSED = ast.Raise | ast.JoinedStr | ast.FunctionDef | ast.ClassDef  # words, and what has its own turn
CLAMPS = {"minimum": "maximum", "maximum": "minimum", "min": "max", "max": "min"}


class Mutation(NamedTuple):
    room: str
    file: str  # below the root
    line: int
    function: str
    kind: str
    start: int  # bytes of the source that are replaced
    end: int
    new: str
    tests: tuple[str, ...]


def _changes(node: ast.AST, source: Callable[[ast.AST], str]) -> Iterator[tuple[str, ast.AST, str]]:
    """Yield kind, node and new text of what may be changed at one node."""

    match node:
        case ast.BinOp(left, op, right) if type(op) in OTHER and not re.search("[\"'\\[]", source(node)):
            yield "operator", node, f"({source(left)}) {OTHER[type(op)]} ({source(right)})"
            if isinstance(op, ast.Add | ast.Sub):
                yield "dropped term", node, f"({source(left)})"
        case ast.Compare(left, [op], [right]):
            yield "comparison", node, f"({source(left)}) {TURNED[type(op)]} ({source(right)})"
            if isinstance(op, ast.Lt | ast.LtE) and "len(" in source(node):
                yield (
                    "off by one",
                    node,
                    f"({source(left)}) {'<=' if isinstance(op, ast.Lt) else '<'} ({source(right)})",
                )
        case ast.BoolOp(op, values):
            word = " or " if isinstance(op, ast.And) else " and "
            yield "and/or", node, "(" + word.join(f"({source(value)})" for value in values) + ")"
        case ast.UnaryOp(ast.Not() | ast.USub(), operand):
            yield "sign", node, f"({source(operand)})"
        case ast.Constant(bool()):
            return
        case ast.Constant(float(value)):
            yield "constant", node, repr(2.0 * value if value else 1.0)
        case ast.Constant(int(value)):
            yield "off by one", node, repr(value + 1)
        case ast.Call(function, [first, second, *_]):
            name = source(function).rpartition(".")
            if name[2] in CLAMPS:
                yield "clamp", function, name[0] + name[1] + CLAMPS[name[2]]
                yield "dropped clamp", node, f"({source(first)})"
            elif (
                isinstance(first, ast.Name)
                and isinstance(second, ast.Name)
                and first.id != second.id
                and name[2] != "isinstance"
            ):
                yield "swapped arguments", first, second.id
        case ast.If(test, [ast.Raise() | ast.Return()], []):
            yield "dropped guard", test, "False"
        case ast.Expr(ast.Call()):
            yield "dropped statement", node, "pass"


def _nodes(node: ast.AST) -> Iterator[ast.AST]:
    """Yield what runs, without annotations, words and functions inside."""
    yield node
    for field, value in ast.iter_fields(node):
        if field in ("annotation", "returns", "decorator_list", "msg"):
            continue
        for part in value if isinstance(value, list) else [value]:
            if isinstance(part, ast.AST) and not isinstance(part, PASSED):
                yield from _nodes(part)


def mutations(room: str, file: str, tests: tuple[str, ...]) -> list[dict[str, list[Mutation]]]:
    """Return for each function of a file what may be changed in it, by kind."""
    text = (ROOT / file).read_bytes()
    starts = [0, *itertools.accumulate(len(row) for row in text.splitlines(keepends=True))]

    def place(node: Any) -> tuple[int, int]:
        return starts[node.lineno - 1] + node.col_offset, starts[node.end_lineno - 1] + node.end_col_offset

    def source(node: ast.AST) -> str:
        return text[slice(*place(node))].decode()

    functions = []
    for function in ast.walk(ast.parse(text)):
        if not isinstance(function, ast.FunctionDef) or function.name in ("__repr__", "__str__"):
            continue
        kinds: dict[str, list[Mutation]] = {}
        for node in _nodes(function):
            for kind, part, new in _changes(node, source):
                kinds.setdefault(kind, []).append(
                    Mutation(room, file, part.lineno, function.name, kind, *place(part), new, tests)
                )
        if kinds:
            functions.append(kinds)
    return functions


def pools(only: str = "") -> dict[str, list[dict[str, list[Mutation]]]]:
    """Return for each room the mutations of each function by kind, of one file where one is named."""
    return {
        room: [
            kinds
            for place, tests in beside.items()
            for path in (sorted((ROOT / home / place).rglob("*.py")) if place.endswith("/") else [ROOT / home / place])
            if only in (file := path.relative_to(ROOT).as_posix())
            for kinds in mutations(room, file, tuple(f"{tested}/{test}" for test in tests.split()))
        ]
        for room, (home, tested, beside) in ROOMS.items()
    }


def again(said: Path) -> Iterator[Mutation]:
    """Yield the mutations that were not caught in what an earlier run has said, where their lines are now."""
    for row in said.read_text().splitlines():
        number, *words = row.split("\t")
        if len(words) != 4 or words[3].startswith(CAUGHT):
            continue
        room, (file, line), mutation = words[0], words[1].split(":"), words[2]
        functions = pools(file)[room]
        same = [m for kinds in functions for some in kinds.values() for m in some if words_of(m) == mutation]
        if same:
            yield min(same, key=lambda one: abs(one.line - int(line)))
        else:
            print(f"{number} of {file}:{line} is no more: {mutation}")


def draw(seed: int, count: int, rooms: tuple[str, ...] = SHARES) -> list[Mutation]:
    """Draw mutations, no two in one function; those of a room are the same beside other rooms."""
    of_rooms = pools()
    chances = {room: random.Random(f"{seed} {room}") for room in ROOMS}
    for room, pool in of_rooms.items():
        chances[room].shuffle(pool)
    drawn = []
    for number in range(count):
        room = rooms[number % len(rooms)]
        kinds = of_rooms[room].pop()
        drawn.append(chances[room].choice(kinds[chances[room].choice(sorted(kinds))]))
    return drawn


def mutated(one: Mutation) -> bytes:
    """Return the source of a file with the mutation."""
    source = (ROOT / one.file).read_bytes()
    return source[: one.start] + one.new.encode() + source[one.end :]


def words_of(one: Mutation) -> str:
    """Return the kind of a mutation, what it replaces, and its line after it."""
    old = (ROOT / one.file).read_bytes()[one.start : one.end].decode().splitlines()[0]
    return f"{one.kind}: {old}  ->  {mutated(one).decode().splitlines()[one.line - 1].strip()}"


class _Failures:
    """A plugin that says which test failed, by its whole name."""

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        if report.failed:
            self.failed = True
            print(f"\nFAILED {report.nodeid}", file=sys.__stdout__, flush=True)


class _Chosen(_Failures):
    """A plugin that runs chosen tests in their order; with a file, others too, and it writes there what each calls.

    Others stand where the name of their file does; those that name the function come first. A line for each test that
    passed: its name, the processor time [s] of it and of the processes that it waited for, and `file:function` of all that
    is called by it. The import of its file counts, and `:Popen` says that it starts a process.
    The interpreter's profiler counts calls, one in each thread: a function of ours at each call would take several times
    as long as the tests.
    """

    def __init__(self, tests: list[str], function: str, file: Path | None = None) -> None:
        self.places, self.word, self.file = {test: place for place, test in enumerate(tests)}, function, file
        self.profiles: list[cProfile.Profile] = []
        self.imported: set[tuple[Path, str]] | None = None
        if file:
            threading.setprofile(self._begin)
            self._begin()

    def _begin(self, *_: Any) -> None:
        sys.setprofile(None)
        self.profiles.append(cProfile.Profile(subcalls=False, builtins=False))
        self.profiles[-1].enable()

    def _called(self) -> set[tuple[Path, str]]:
        codes = [row.code for profile in self.profiles for row in profile.getstats()]
        for profile in self.profiles:
            profile.clear()
        return {(Path(code.co_filename), code.co_name) for code in codes if isinstance(code, CodeType)}

    @pytest.hookimpl(trylast=True)
    def pytest_collection_modifyitems(self, items: list[pytest.Item]) -> None:
        def turn(one: Any) -> tuple[int, bool]:
            named = re.search(rf"\b{re.escape(self.word)}\b", inspect.getsource(one.function))
            return self.places.get(one.nodeid, self.places.get(one.nodeid.partition("::")[0], 0)), not named

        items[:] = sorted((one for one in items if self.file or one.nodeid in self.places), key=turn)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_protocol(self, item: pytest.Item) -> Iterator[None]:
        self.failed, begin = False, sum(os.times()[:4])
        if self.imported is None:
            self.imported = self._called()
        self._called()
        done = yield
        if self.file and not self.failed:
            paths = self.imported | self._called()
            here = Path.cwd()
            calls = {f"{path.relative_to(here)}:{name}" for path, name in paths if path.is_relative_to(here)}
            calls |= {":Popen" for path, _ in paths if path.name == "subprocess.py"}
            with self.file.open("a") as out:
                print(json.dumps([item.nodeid, sum(os.times()[:4]) - begin, sorted(calls)]), file=out)
        return done


def _tested(tests: list[str], tree: Path, said: Path, function: str, kept: Path | None) -> int:
    os.setsid()
    signal.signal(signal.SIGHUP, signal.SIG_DFL)  # whoever started this may ignore it, and a test would with him
    resource.setrlimit(resource.RLIMIT_CPU, (MOST, MOST + 5))
    os.chdir(tree)
    descriptor = os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
    os.dup2(descriptor, 1)
    os.dup2(descriptor, 2)
    own = [str(tree / "src"), *(str(path) for path in (tree / "packages").glob("*/src"))]
    sys.path[:0], os.environ["PYTHONPATH"] = own, os.pathsep.join(own)
    cache = ROOT / ".pytest_cache" / f"jax-{platform.node()}"  # of `conftest.py`, which is read after JAX was imported
    jax.config.update("jax_compilation_cache_dir", str(cache))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
    words = "-x -n 0 -s --tb=line -rE -W ignore::pytest.PytestAssertRewriteWarning -m".split()
    try:
        files = dict.fromkeys(test.partition("::")[0] for test in tests)
        return int(pytest.main([*words, "not slow", *files], [_Chosen(tests, function, kept)]))
    except BaseException:
        traceback.print_exc()
        raise


def run(tests: list[str], tree: Path, function: str = "", kept: Path | None = None) -> str:
    """Run the file of tests in a process that has imported the libraries, these first, and return which failed, if any."""
    said = tree / "said.txt"
    child = os.fork()
    if not child:
        code = 3
        with contextlib.suppress(BaseException):
            code = _tested(tests, tree, said, function, kept)
        os._exit(code)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    with contextlib.suppress(ProcessLookupError):  # what a test has left behind
        os.killpg(child, signal.SIGKILL)
    caught = re.search(r"^(?:FAILED|ERROR) (.+)$", said.read_text(), re.M)
    if status in (0, 5):  # 5: all of a file are slow tests
        return SURVIVED
    return f"{CAUGHT}{caught[1]}" if caught else f"NO ANSWER ({status}) {said.read_text()[-150:]!r}"


def judge(one: Mutation, tree: Path) -> str:
    """Run the tests beside a mutation, file by file, those first of which it is known that they reach it soon."""
    name, turns, unanswered = f"{one.file}:{one.function}", [], []
    REACHED.mkdir(parents=True, exist_ok=True)
    for place, file in enumerate(one.tests):
        whole = REACHED / f"{Path(file).stem}-{hashlib.sha256((ROOT / file).read_bytes()).hexdigest()[:16]}"
        part = whole.with_suffix(".part")  # what passed before a test that failed
        known = whole if whole.exists() else part
        rows = sorted(map(json.loads, known.read_text().splitlines() if known.exists() else ()), key=lambda row: row[1])
        reach = [row for row in rows if name in row[2]]
        starts = [row[0] for row in rows if ":Popen" in row[2]]
        # what nobody knows of the file after these, and last what passed without it: what is traced is called in the first
        # only that needs it
        tests = [*(row[0] for row in reach), file, *(row[0] for row in rows if row not in reach)]
        if reach:
            turns.append((0, reach[0][1], place, tests, whole, part))
        elif known == part:
            turns.append((1, 0.0, place, tests, whole, part))
        elif starts:
            turns.append((2, 0.0, place, starts, whole, part))
    for _, _, _, tests, whole, part in sorted(turns):
        result = run(tests, tree, one.function, None if whole.exists() else part)
        if result == SURVIVED and not whole.exists() and part.exists():
            part.rename(whole)
        if result.startswith(CAUGHT):
            return result
        if result != SURVIVED:
            unanswered.append(result)
    return "; ".join(unanswered) or (SURVIVED if turns else "NO TEST reaches it")


def unsound(tests: list[str], tree: Path) -> Iterator[str]:
    """Yield those of the tests that do not pass in the sources as they are."""
    for _, of_file in itertools.groupby(tests, key=lambda test: test.partition("::")[0]):
        left = list(of_file)
        while left and (result := run(left, tree)) != SURVIVED:
            failed = [test for test in left if result == CAUGHT + test] or left
            yield from failed
            left = [test for test in left if test not in failed]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seed", metavar="SEED|FILE")
    parser.add_argument("--count", type=int, default=40)
    parser.add_argument("--leave-out", type=int, nargs="*", default=[], metavar="N")
    parser.add_argument("--only", type=int, nargs="*", metavar="N")
    parser.add_argument("--list", action="store_true", help="say what was drawn, and run nothing")
    parser.add_argument("--room", choices=ROOMS)
    words = parser.parse_args()
    count, rooms = words.count + len(words.leave_out), (words.room,) if words.room else SHARES
    drawn = draw(int(words.seed), count, rooms) if words.seed.isdigit() else [*again(Path(words.seed))]
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        for path in ROOT.iterdir():
            if path.name in ("src", "packages"):
                shutil.copytree(path, tree / path.name, ignore=shutil.ignore_patterns("__pycache__"))
            elif path.name != ".git":
                (tree / path.name).symlink_to(path)
        results: dict[int, str] = {}
        for number, one in enumerate(drawn, 1):
            if number in words.leave_out or (words.only and number not in words.only):
                continue
            (tree / one.file).write_bytes(mutated(one))
            results[number] = "" if words.list else judge(one, tree)
            shutil.copyfile(ROOT / one.file, tree / one.file)
            print(number, one.room, f"{one.file}:{one.line}", words_of(one), results[number], sep="\t", flush=True)
        by = {number: result.removeprefix(CAUGHT) for number, result in results.items() if result.startswith(CAUGHT)}
        sound = set(by.values()) - set(unsound(sorted(set(by.values())), tree))
    for test in sorted(set(by.values()) - sound):
        print(f"{test} does not pass without any mutation: what it caught does not count")
    print(f"{sum(test in sound for test in by.values())} of {len(results)} caught")


if __name__ == "__main__":
    main()
