"""Felt speed: what a person waits for a command, from its call to the prompt, with warm caches but for the first script.

    python benchmarks/felt.py [--runs 7] [--before REVISION] [--busy 3] [--only WORD ..] [--json FILE]

Prints a table with a target for each command, and the minimum and median over the runs: seconds of the clock, and processor
seconds of the process and its children. `--before` checks out another revision beside this one and calls both in turns, so
that what disturbs the machine disturbs both. Every command is called once or twice before, for its kernels to be kept.
Use an idle machine: if other programs used more than a tenth of a core, the table says so, and its numbers are too large.
`--busy` measures beside as many processes that only compute; the targets are those of an idle machine all the same.
"""

from __future__ import annotations

import argparse
import json
import os
import re
import shlex
import statistics
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from pathlib import Path
from typing import Any, NamedTuple

ROOT = Path(__file__).resolve().parents[1]
WARM_UP = 2  # calls that are not counted: the first compiles
BUSY = 0.1  # cores that other programs may use
LAW = "import mckibben; law = mckibben.law('ideal', {'thread_length': 0.2, 'turns': 2.0})"
LATER = f"{LAW}; law.tension(0.15, 5e5); import time; t = time.perf_counter()"
LATER += "; [law.tension(0.15, 5e5) for _ in range(100)]; print((time.perf_counter() - t) / 100)"


class Case(NamedTuple):
    """A command with its target [s].

    Attributes:
        name: as the table shows it.
        target: seconds of the clock on an idle machine.
        words: arguments of Python.
        printed: whether the time is the last number that it prints, and not that of the process.
        prepare: arguments of Python that make what it reads, called once.
        cold: whether nothing is kept of earlier calls, as just after the installation.
    """

    name: str
    target: float
    words: tuple[str, ...]
    printed: bool = False
    prepare: tuple[str, ...] = ()
    cold: bool = False


def command(words: str, target: float) -> Case:
    """A call of the command line."""
    return Case(words, target, mckibben(words))


def mckibben(words: str) -> tuple[str, ...]:
    """Arguments of Python for a call of the command line, its words as a shell takes them."""
    return ("-m", "mckibben", *shlex.split(words))


def cases(folder: Path) -> list[Case]:
    """Return all commands; what they write goes to a folder."""
    circuit = ROOT / "examples" / "circuits" / "filling-a-tank.toml"
    loop = mckibben(f"run work-loop --muscle nylon --rig modern --set cycles=2 --out '{folder}/loop.nc'")
    moved = (
        f"joint nylon --command 'flexor=0, 0.3 @ 50 ms' --command extensor=-0.1 --duration 0.3s --out '{folder}/j.nc'"
    )
    sizing = "--force '50 N' --stroke '3 cm' --pressure '5 bar' --tank '2 l at 8 bar'"
    first = re.search(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.M | re.S)
    return [
        Case("the first script of README, nothing kept", 2.0, ("-c", first[1] if first else ""), cold=True),
        Case("import mckibben", 0.1, ("-c", "import mckibben")),
        Case("first law.tension in Python", 0.3, ("-c", f"{LAW}; law.tension(0.15, 5e5)")),
        Case("each later law.tension", 1e-3, ("-c", LATER), printed=True),
        command("--help", 0.3),
        command("tension --help", 0.3),
        command("run --help", 0.3),
        command("circuit run --help", 0.3),
        command("reproduce --help", 0.3),
        Case("tension", 0.4, ("-m", "mckibben", "tension", "nylon", "--length", "14 cm", "--pressure", "5 bar")),
        command("show nylon", 0.4),
        Case("energy", 1.0, ("-m", "mckibben", "energy", "nylon", "--pressure", "5 bar")),
        command("run work-loop --muscle nylon", 1.2),
        Case("circuit run", 1.5, ("-m", "mckibben", "circuit", "run", str(circuit), "--out", str(folder / "tank.nc"))),
        command("fit DMSP-20-300 --law hyperelastic_braid", 1.5),
        command("fit DMSP-20-300", 8.0),
        command("fit DMSP-10-250 --law seated_braid --posterior --draws 200", 10.0),
        command(f"size --muscle DMSP-10-250 {sizing}", 10.0),
        command("next --like festo-10mm --set 'rest_length=132 mm'", 5.0),
        Case("joint nylon", 5.0, mckibben(moved)),
        Case("export --for fmi3", 10.0, mckibben(f"export nylon --for fmi3 --out '{folder}/nylon.fmu' --span '14 cm'")),
        Case(
            "record report", 5.0, mckibben(f"record report '{folder}/loop.nc' --out '{folder}/loop.html'"), prepare=loop
        ),
        Case("diagnose", 10.0, mckibben(f"diagnose '{folder}/loop.nc'"), prepare=loop),
    ]


class Spent(NamedTuple):
    """Seconds of one call: by the clock, and of the processor."""

    wall: float
    processor: float


def call(case: Case, tree: Path) -> Spent:
    """Call a command with the sources of a tree.

    Raises:
        RuntimeError: it failed.
    """
    paths = [tree / "src", *tree.glob("packages/*/src")]
    settings = {**os.environ, "PYTHONPATH": os.pathsep.join(map(str, paths))}
    settings.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its byte code
    with tempfile.TemporaryDirectory() as empty:
        settings |= {"XDG_CACHE_HOME": empty} if case.cold else {}
        before, begin = os.times(), time.perf_counter()
        done = subprocess.run([sys.executable, *case.words], capture_output=True, text=True, env=settings)
        wall, after = time.perf_counter() - begin, os.times()
    if done.returncode:
        raise RuntimeError(f"{case.name}: {done.stderr.strip().splitlines()[-1:]}")
    if case.printed:
        return Spent(*[float(done.stdout.split()[-1])] * 2)
    used = (after.children_user - before.children_user) + (after.children_system - before.children_system)
    return Spent(wall, used)


def busy_seconds() -> float | None:
    """Processor seconds that all programs of this machine have used; None where it does not say."""
    try:
        with open("/proc/stat", encoding="ascii") as file:
            ticks = list(map(int, file.readline().split()[1:]))
    except OSError:
        return None
    return (sum(ticks[:8]) - ticks[3] - ticks[4]) / os.sysconf("SC_CLK_TCK")


@contextmanager
def busy(count: int) -> Iterator[None]:
    """Processes that only compute, beside what is measured."""
    started = [subprocess.Popen([sys.executable, "-c", "while True: pass"]) for _ in range(count)]
    try:
        yield
    finally:
        for process in started:
            process.kill()
            process.wait()


@contextmanager
def worktree(revision: str) -> Iterator[Path]:
    """A checkout of another revision, for as long as it is needed."""
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder, "before")
        subprocess.run(["git", "-C", ROOT, "worktree", "add", "--quiet", "--detach", place, revision], check=True)
        try:
            yield place
        finally:
            subprocess.run(["git", "-C", ROOT, "worktree", "remove", "--force", place], check=True)


def measure(chosen: list[Case], trees: dict[str, Path], runs: int) -> list[dict[str, Any]]:
    """Call every command in turns with the sources of all trees.

    Returns:
        A row per command: name, target, and by tree the lists of seconds, or the reason why it failed.
    """
    rows = []
    for case in chosen:
        row: dict[str, Any] = {"command": case.name, "target": case.target}
        live = dict(trees)
        if case.prepare:
            call(Case(f"what {case.name} reads", case.target, case.prepare), ROOT)
        spent: dict[str, list[Spent]] = {name: [] for name in trees}
        for k in range(WARM_UP + runs):
            for name, tree in list(live.items()):
                try:
                    one = call(case, tree)
                except RuntimeError as error:
                    row[name] = str(error)
                    del live[name]
                    continue
                if k >= WARM_UP:
                    spent[name].append(one)
        row |= {
            name: {"wall": [s.wall for s in spent[name]], "cpu": [s.processor for s in spent[name]]} for name in live
        }
        rows.append(row)
        print(line(row, list(trees)), flush=True)
    return rows


def line(row: dict[str, Any], names: list[str]) -> str:
    """A row of the table."""
    cells = [f"{row['command'][:44]:44s} {row['target']:7.3g}"]
    for name in names:
        if isinstance(row[name], str):
            cells.append(f"{'failed':>31s}")
            continue
        wall, cpu = row[name]["wall"], row[name]["cpu"]
        numbers = (min(wall), statistics.median(wall), min(cpu), statistics.median(cpu))
        cells.append(" ".join(f"{x:7.3g}" if x >= 1e-2 else f"{x:7.1e}" for x in numbers))
    return "  |".join(cells)


def main() -> None:
    """Measure, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=7, help="counted calls of each command")
    parser.add_argument("--busy", type=int, default=0, metavar="N", help="measure beside so many busy processes")
    parser.add_argument("--before", metavar="REVISION", help="revision of git to compare with")
    parser.add_argument(
        "--only", nargs="*", default=[], metavar="WORD", help="commands that contain one of these words"
    )
    parser.add_argument("--json", type=Path, metavar="FILE", help="write all times to this file, too")
    chosen = parser.parse_args()
    earlier = nullcontext(None) if chosen.before is None else worktree(chosen.before)
    with tempfile.TemporaryDirectory() as folder, earlier as before, busy(chosen.busy):
        trees = ({} if before is None else {"before": before}) | {"now": ROOT}
        known = [c for c in cases(Path(folder)) if not chosen.only or any(word in c.name for word in chosen.only)]
        columns = "wall min  median  cpu min median"
        print(f"{'seconds':44s}  target" + "".join(f"  | {columns} ({name})" for name in trees), flush=True)
        used, own, begin = busy_seconds(), sum(os.times()[:4]), time.perf_counter()
        rows = measure(known, trees, chosen.runs)
        others = None
        if used is not None:
            others = (busy_seconds() or 0.0) - used - (sum(os.times()[:4]) - own)
            others /= time.perf_counter() - begin
    if others is not None and others > BUSY and not chosen.busy:
        print(
            f"The machine was busy: other programs used {others:.1f} of {os.cpu_count()} cores. The times are too large."
        )
    late = [
        r["command"]
        for r in rows
        if not isinstance(r["now"], str) and statistics.median(r["now"]["wall"]) > r["target"]
    ]
    print(f"{len(rows) - len(late)} of {len(rows)} within their target" + (f"; not: {'; '.join(late)}" if late else ""))
    if chosen.json is not None:
        chosen.json.write_text(json.dumps({"rows": rows, "busy_cores": others}, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
