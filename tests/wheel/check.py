"""What a person gets who installs the wheels and nothing else: `make wheel`.

    python tests/wheel/check.py [PYTHON ..] [--brief] [--keep FOLDER]

Source archives of mckibben, of its compiler and of the packages above it are built, wheels from these archives, and what
they say of themselves is checked as a package index does. The wheel of mckibben is built twice: the programs that the first
lowers for `FIRST` are brought by the second, so that nobody's first answer waits for JAX. For each Python (this one by
default) the compiler is installed alone into an empty environment, where the example of its README runs; then mckibben
without extras, with the first script of its README, whose commands that come with another package say which; then these
packages, each with the example of its README, and every command is called there, or those of `BRIEF`. It works; or it says
in one sentence, before it computes anything, which extra or file it needs, and ends with exit code 2. A command that is
not in `CALLS` is an error, so that a new one cannot be forgotten. The size of each installation is printed, and what needs
most of it.

Needs nothing of the package: the tools that build and check are installed into an environment of their own.
"""

import argparse
import json
import os
import re
import shutil
import subprocess
import sys
import tarfile
import tempfile
import time
import zipfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]
COMPILER = ROOT / "packages" / "lanewise"
ABOVE = sorted((ROOT / "packages").glob("mckibben-*"))  # distributions above mckibben
CIRCUITS = ROOT / "examples" / "circuits"
MAP = ROOT / "src" / "mckibben" / "specimens" / "maps" / "DMSP-20-300_force_map.csv"
OTHER_MAP = str(MAP.with_name("DMSP-10-250_force_map.csv"))
KEPT = ("README.md", "LICENSE", "NOTICE", "CHANGELOG.md", "CITATION.cff", "CODE_OF_CONDUCT.md", "SECURITY.md")
KEPT_ABOVE = ("README.md", "LICENSE", "NOTICE", "firmware/README.md", "firmware/bench.c")  # of those that have them
TOOLS = ("build", "hatchling>=1.27", "twine")
# With `--brief`, one command of each distribution, and of mckibben what people run first.
BRIEF = ("tension", "read", "run", "calibrate zero", "export", "benchmark", "reproduce")
# Arguments of Python; what they lower is in the wheel, in a folder that git ignores. The first script is README's.
LOWERED = ROOT / "src" / "mckibben" / "lowered"
FIRST = (
    ("-c", re.findall(r"^```python\n(.*?)^```", (ROOT / "README.md").read_text(encoding="utf-8"), flags=re.M | re.S)[0]),
    *(("-m", "mckibben", *words.split()) for words in (
        "tension nylon --length 12cm --pressure 5bar", "show nylon", "energy nylon --pressure 5bar",
        "compare nylon fast-fibre", "fit DMSP-20-300 --law hyperelastic_braid",
        "run work-loop --muscle nylon --set cycles=2 --out loop.nc",
    )),
)  # fmt: skip
AT_ONCE = 2  # commands that run beside each other
LONG = ("study tube", "size")  # begun first, so that nobody waits for them at the end
LONGEST = 300.0  # after which a command is ended [s]
# A refusal may import what it must, some 2 s of processor time on a slow machine, but not compile and run a model.
BEFORE = 6.0  # [s]


class Call(NamedTuple):
    """One call of a command: its words after the name, what is piped in, which files it writes, and how it is to end.

    Where `says` is empty, the command works; else it ends with exit code 2 and one sentence that has these words.
    """

    words: Sequence[str] = ()
    writes: Sequence[str] = ()
    says: Sequence[str] = ()
    piped: str = ""


def needs(extra: str, *words: str) -> Call:
    """A call for which an extra is missing."""
    return Call(words, says=("not installed", f"pip install 'mckibben[{extra}]'"))


def simulated(*words: str) -> Call:
    """A calibration of simulated sensors."""
    return Call((*words, "--rig", "modern", "--simulate", "--json"))


LEVER = """DMCv5.3 Data File
Sample Frequency (Hz): 1000
Calibration Data:
Channel\tAI0\tAI1
Units\tmm\tmN
Scale (units/V)\t1.0\t500.0
Offset (volts)\t0.0\t0.0
Test Comments:
Protocol Array:
0.0\tStimulus-Train\tStimulator\t.012,300,0.2,4,28
0.0\tSine Wave\tLength Out\t28,3.15,6
Test Data in Volts:
Sample\tAI0\tAI1\tStim
0\t0.1\t0.2\t0
1\t0.1\t0.2\t1
2\t0.1\t0.5\t0
3\t0.1\t0.3\t0
"""
TANK = """
schema = 1
title = "A tank that fills"
[nodes.supply]
kind = "reservoir"
signal = "wish"
[nodes.tank]
kind = "volume"
volume = "50 ml"
[elements.hole]
kind = "orifice"
from = "supply"
to = "tank"
conductance = "6e-9 m^3/(s*Pa)"
[signals.wish]
kind = "steps"
times = ["0 s", "10 ms"]
values = ["1 bar", "5 bar"]
[run]
duration = "60 ms"
step = "250 us"
[fit]
free = ["elements.hole.conductance"]
start = { "elements.hole.conductance" = "9e-9 m^3/(s*Pa)" }
"""
OWN_LAW = """
import mckibben as mk


class Spring(mk.TensionLaw):
    title = "gas spring"
    cites = ()
    fitted = ("area",)
    area = mk.quantity("m^2", (1e-6, 1e-1), "force per pressure at rest", default=1e-3)
    rest_length = mk.quantity("m", (1e-3, 10.0), "rest length")

    def elastic_tension(self, length):
        return 1e3 * (length - 0.95 * self.rest_length)

    def gas_energy(self, length, pressure):
        x = 1.2 * self.rest_length - length
        return pressure * self.area * (self.rest_length + x - 0.5 * x * x / self.rest_length)

    def length_range(self):
        return 0.5 * self.rest_length, 1.1 * self.rest_length
"""
MUSCLE, BENCH = "nylon", ("work-loop", "--muscle", "nylon")
# Commands of packages that are installed by themselves, where they are not: the extra that brings them.
PACKAGED = {
    "conform": Call(("python",), says=("pip install 'mckibben[hosts]'",)),
    "export": needs("hosts", MUSCLE),
    "benchmark": needs("benchmark", "--list"),
    "reproduce": needs("papers", "--row", "valve.festo"),
    **{f"study {name}": needs("benchmark", "nothing") for name in ("loops", "robot", "validation")},
    "device check": needs("hardware", "--rig", "modern", "--simulate"),
    "device replay": needs("hardware", "check.json"),
    "calibrate zero": needs("hardware", "--rig", "modern", "--simulate"),
    "run": Call((*BENCH, "--on", "serial:/dev/ttyACM0"), says=("mckibben-hardware", "pip install 'mckibben[serial]'")),
}
CALLS: dict[str, list[Call]] = {
    "muscles": [Call()],
    "show": [Call((MUSCLE, "--out", "show.svg"), ["show.svg"])],
    "tension": [
        Call((MUSCLE, "--length", "12 cm", "--pressure", "5 bar")),
        Call((MUSCLE, "--contraction", "0:20:5 %", "--pressure", "1:5 bar", "--out", "points.csv"), ["points.csv"]),
        Call((MUSCLE, "--length", "12 cm", "--pressure", "5 bar", "--out", "point.xlsx"), ["point.xlsx"]),
        Call(
            (MUSCLE, "--length", "12 cm", "--pressure", "5 bar", "--from-posterior", "no.json"),
            says=("File not found: no.json",),
        ),
    ],
    "completion": [Call(("bash",)), Call(("tcsh",), says=("Known are bash, zsh, fish",))],
    "help": [Call(("circuit", "run"))],
    "braid": [
        Call(
            (
                "--length", "300 mm", "--angle", "25 deg", "--diameter", "12 mm", "--thread", "0.25 mm", "--bladder", "1 mm",
                "--out", "braid.toml",
            ),
            ["braid.toml"],
        )
    ],
    "conform": [
        Call(("python", "--scenario", "hang", "--out", "python.json"), ["python.json"]),
        Call(("matlab",), says=["python"]),
        needs("mujoco", "mujoco"),
        needs("mujoco", "mujoco-python"),
        needs("warp", "warp"),
        needs("drake", "drake"),
        needs("warp", "newton"),
        needs("opensim", "opensim"),
        needs("libcosim", "libcosim"),
    ],
    "export": [
        Call((MUSCLE, "--out", "nylon_c"), ["nylon_c/muscle_part.c", "nylon_c/muscle_part.json"]),
        Call((MUSCLE, "--for", "fmi3", "--out", "nylon.fmu"), ["nylon.fmu"]),
        Call((MUSCLE, "--for", "ros2", "--out", "nylon_ros2"), ["nylon_ros2/muscle_part_hardware.cpp"]),
        needs("mujoco", MUSCLE, "--for", "mujoco", "--out", "nylon_mujoco"),
        Call((MUSCLE, "--for", "warp", "--out", "nylon_warp"), ["nylon_warp/muscle_part_warp.py"]),
    ],
    "read": [Call((str(MAP), "--rest-length", "30 cm"))],
    "fit": [
        Call(("DMSP-20-300", "--law", "ideal", "--out", "fit.html", "--out", "fit.toml"), ["fit.html", "fit.toml"]),
        Call(("DMSP-20-300", "--law", "ideal", "--length-error", "0.5 mm")),
        Call((str(MAP), OTHER_MAP, "--runs", "--rest-length", "30 cm", "--law", "ideal")),
        needs("report", "DMSP-20-300", "--out", "fit.pdf"),
        needs("posterior", "DMSP-20-300", "--law", "ideal", "--posterior"),
        Call(("no.csv", "--friction", "dahl"), says=("File not found: no.csv",)),
        Call(("DMSP-20-300", "--law", "ideal", "--hysteresis", "no.csv"), says=("File not found: no.csv",)),
    ],
    "next": [Call(("--from", "no.json"), says=("File not found: no.json",))],
    "check": [Call(("own.py:Spring",)), Call(("nowhere.py:Law",), says=("File not found: nowhere.py",))],
    "protocols": [Call()],
    "run": [
        Call((*BENCH, "--set", "cycles=3", "--out", "loop.nc", "--out", "loop.svg"), ["loop.nc", "loop.svg"]),
        Call(("twitch", "--muscle", "fast-fibre", "--out", "twitch.nc"), ["twitch.nc"]),
        Call((*BENCH, "--rig", "modern", "--fault", "leak=0.5 l/min/bar", "--out", "faulty.nc"), ["faulty.nc"]),
        needs("serial", *BENCH, "--on", "serial:/dev/ttyACM0"),
        needs("daq", *BENCH, "--on", "daq"),
        Call((*BENCH, "--from-posterior", "no.json"), says=("File not found: no.json",)),
    ],
    "characterise": [Call(("--muscle", MUSCLE, "--rig", "modern", "--dry-run", "--out", "own"))],
    "console": [
        Call(("--muscle", MUSCLE), piped="quit\n"),
        needs("serial", "--muscle", MUSCLE, "--on", "serial:/dev/ttyACM0"),
    ],
    "joint": [
        Call(("nylon", "--command", "flexor=0, 0.3 @ 50 ms", "--duration", "0.2 s", "--out", "joint.nc"), ["joint.nc"])
    ],
    "control": [
        Call(("--controller", "inverse", "--plants", "0", "--duration", "3 s", "--out", "control.csv"), ["control.csv"])
    ],
    "device serve": [Call((*BENCH, "--duration", "1 s"))],
    "device check": [Call(("--rig", "modern", "--simulate", "--out", "check.json"), ["check.json"])],
    "device replay": [Call(("check.json", "--out", "replayed.toml"), ["replayed.toml"])],
    "energy": [Call((MUSCLE, "--pressure", "5 bar", "--out", "energy.svg"), ["energy.svg"])],
    "compare": [Call((MUSCLE,)), needs("report", MUSCLE, "--out", "compare.pdf")],
    "reproduce": [
        Call(
            ("--row", "valve.festo", "--out", "papers", "--no-pdf", "--save-recordings", "raw"),
            ["papers/reproduction.html"],
        ),
        needs("report", "--out", "papers"),
    ],
    "diagnose": [Call(("faulty.nc", "--out", "faults.csv"), ["faults.csv"])],
    "benchmark": [
        Call(("--task", "map-above-4-bar", "--model", "ideal", "--out", "scores.json"), ["scores.json"]),
        Call(
            ("--task", "map-above-4-bar", "--model", "ideal", "--model", "gaussian_process", "--earlier", "scores.json")
            + ("--out", "benchmark.md"),
            ["benchmark.md"],
        ),
    ],
    "parts": [Call(("valves", "--min-flow", "100 l/min", "--out", "parts.csv"), ["parts.csv"]), Call(("PU-4x2",))],
    "size": [
        Call(("--force", "50 N", "--stroke", "3 cm", "--pressure", "5 bar", "--no-lines")),
        Call(
            (
                "--load", "3 kg", "--stroke", "3 cm", "--pressure", "5 bar", "--cycles", "1 Hz", "--working-time", "8 h",
                "--battery", "100 Wh", "--tank", "2 l at 200 bar", "--no-lines", "--out", "muscle.toml",
            ),
            ["muscle.toml"],
        ),
        Call(
            (
                "--force", "50 N", "--stroke", "3 cm", "--pressure", "5 bar", "--muscle", "nylon", "--from-posterior",
                "no.json",
            ),
            says=("File not found: no.json",),
        ),
    ],
    "sweep": [
        Call((str(ROOT / "examples" / "sweeps" / "tube-and-threshold.toml"), "--out", "sweep", "--dry-run")),
        needs("sweep", str(ROOT / "examples" / "sweeps" / "tube-and-threshold.toml"), "--out", "sweep"),
    ],
    "serve": [needs("web", "--port", "0", "--no-open")],
    "circuit show": [Call((str(CIRCUITS / "filling-a-tank.toml"), "--out", "circuit.svg"), ["circuit.svg"])],
    "circuit run": [Call(("tank.toml", "--out", "tank.nc", "--out", "tank.svg"), ["tank.nc", "tank.svg"])],
    "circuit frequency": [
        Call(
            (
                str(CIRCUITS / "muscle-behind-a-tube.toml"), "--input", "regulator.pressure", "--output",
                "muscle.pressure_abs", "--out", "bode.svg",
            ),
            ["bode.svg"],
        )
    ],
    "circuit fit": [
        Call(("tank.toml", "tank.nc", "--out", "fit.svg"), ["fit.svg"]),
        needs("posterior", "tank.toml", "tank.nc", "--posterior"),
    ],
    "record show": [Call(("loop.nc",))],
    "record plot": [
        Call(("loop.nc", "--out", "plot.svg"), ["plot.svg"]),
        Call(("loop.nc", "--out", "plot.pdf", "--width", "column", "--style", "gray"), ["plot.pdf"]),
        Call(("loop.nc", "--measured", "loop.nc", "--out", "over.svg"), ["over.svg"]),
        Call(("loop.nc", "loop.nc", "--out", "both.svg"), ["both.svg"]),
    ],
    "record list": [Call((".",))],
    "record convert": [
        Call(("loop.nc", "loop.csv"), ["loop.csv"]),
        Call(("loop.nc", "loop.mcap"), ["loop.mcap"]),
        needs("formats", "loop.nc", "loop.parquet"),
        needs("formats", "loop.nc", "loop.tdms"),
    ],
    "record energy": [Call(("loop.nc", "--out", "balance.svg"), ["balance.svg"])],
    "record frequency": [
        Call(("loop.nc", "--input", "span", "--output", "tension", "--out", "response.svg"), ["response.svg"])
    ],
    "record loops": [Call(("loop.nc",))],
    "record work": [Call(("loop.nc", "--json"))],
    "record stiffness": [Call(("loop.nc",))],
    "record steps": [Call(("lever.ddf",))],
    "record leak": [Call(("loop.nc", "--gas-volume", "100 ml"))],
    "record contraction": [Call(("--json", "lever.ddf"))],
    "record work-loops": [Call(("lever.ddf", "--cut", "peak"), says=("two peaks",))],
    "record repeatability": [Call(("loop.nc", "--out", "cycles.svg"), ["cycles.svg"])],
    "record repair": [Call(("loop.mcap", "--out", "repaired.nc"), ["repaired.nc"])],
    "record report": [
        Call(("loop.nc", "--out", "loop.html"), ["loop.html"]),
        needs("report", "loop.nc", "--out", "loop.pdf"),
    ],
    "calibrate zero": [simulated("--channels", "valve_pressure")],
    "calibrate weights": [simulated("--masses", "0 kg,5 kg")],
    "calibrate pressure": [simulated("--pressures", "0 bar,3 bar")],
    "calibrate encoder": [
        Call(
            ("--travels", "0 mm,50 mm", "--rig", "paper", "--simulate", "--out", "span.toml"), ["span.toml"]
        )
    ],
    "calibrate skew": [simulated("--samples", "1000")],
    "calibrate show": [Call(("span.toml",))],
    "calibrate apply": [Call(("loop.nc", "--calibration", "span.toml", "--out", "applied.nc"), ["applied.nc"])],
    "study tube": [Call(("--quick",))],
    "study robot": [Call(("nothing",), says=("nothing: no pres_filt.txt",))],  # measured trials do not ship
    "study loops": [Call(("nothing",), says=("nothing: no pressure_stroke_loop.csv",))],
    "study validation": [Call(("--only", "DMSP-10-250", "--law", "ideal", "--out", "page.md"), ["page.md"])],
}  # fmt: skip
# Sizes [MB] of all distributions of an environment, as pip has written them down and as Python has compiled them.
SIZES = """
import json
from importlib import metadata
size = lambda f: f.locate().stat().st_size if f.locate().is_file() else 0
print(json.dumps({d.name: sum(map(size, d.files or ())) / 1e6 for d in metadata.distributions()}))
"""
LIST = """
import json, typer
from mckibben.cli.app import app
def names(command, path=()):
    inner = getattr(command, "commands", None)
    return [" ".join(path)] if inner is None else [n for k, c in inner.items() for n in names(c, (*path, k))]
print(json.dumps(names(typer.main.get_command(app))))
"""


def main() -> int:
    """Build, install, call; the exit code is 1 if anything is wrong."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pythons", nargs="*", default=[sys.executable], help="Pythons to install for")
    parser.add_argument("--brief", action="store_true", help="call one command of each distribution, not every command")
    parser.add_argument("--keep", type=Path, metavar="FOLDER", help="copy wheels and source archives to this folder")
    chosen, began = parser.parse_args(), time.monotonic()
    with tempfile.TemporaryDirectory(prefix="mckibben-wheel-") as name:
        place = Path(name)
        tools = environment(place / "tools", sys.executable)
        subprocess.run([tools, "-m", "pip", "install", "--quiet", "--disable-pip-version-check", *TOOLS], check=True)
        compiler, wrong = built(tools, COMPILER, "lanewise", ("README.md", "LICENSE"), place / "built")
        shutil.rmtree(LOWERED, ignore_errors=True)  # else what it brings would not be lowered again
        wheel, _ = built(tools, ROOT, "mckibben", KEPT, place / "built")
        lower(compiler, wheel, place / "first")
        wheel, more = built(tools, ROOT, "mckibben", KEPT, place / "built")
        shutil.rmtree(LOWERED)  # the sources lower their own, and tests see what that takes
        wrong, above = wrong + more, []
        for folder in ABOVE:
            kept = [name for name in KEPT_ABOVE if (folder / name).is_file()]
            one, more = built(tools, folder, folder.name.replace("-", "_"), kept, place / "built")
            above.append(one)
            wrong += more
        wrong += accepted(tools, place / "built")
        if chosen.keep:
            shutil.copytree(place / "built", chosen.keep, dirs_exist_ok=True)
        for number, version in enumerate(chosen.pythons):
            wrong += installed(version, place / str(number), compiler, wheel, above, brief=chosen.brief)
    for line in wrong:
        print(f"wrong: {line}")
    print(f"{len(wrong)} things are wrong" if wrong else f"All right, after {time.monotonic() - began:.0f} s")
    return 1 if wrong else 0


def installed(version: str, place: Path, compiler: Path, wheel: Path, above: list[Path], *, brief: bool) -> list[str]:
    """Install the wheels for a Python, one after the other, and call what they bring; returns what is wrong."""
    began = time.monotonic()
    python = environment(place / "venv", version)
    install(python, compiler)
    wrong = example_runs(python, COMPILER, place, without="mckibben")
    tell_size(python, compiler)
    install(python, compiler, wheel)
    wrong += example_runs(python, ROOT, place)
    wrong += packaged_commands(python, place)
    tell_size(python, wheel)
    for one, folder in zip(above, ABOVE, strict=True):
        install(python, compiler, wheel, one)
        wrong += example_runs(python, folder, place)
    tell_size(python, *above)
    print(f"Installed for {version}: {time.monotonic() - began:.0f} s", flush=True)
    wrong += called(python, place, brief=brief)
    print(f"{len(wrong)} things are wrong with {version}", *wrong, sep="\n  ", flush=True)
    return [f"{version}: {line}" for line in wrong]


# ---- what is built


def built(tools: Path, root: Path, package: str, kept: Sequence[str], place: Path) -> tuple[Path, list[str]]:
    """The wheel of a package, made of the source archive, and what is wrong with either."""
    command = [tools, "-m", "build", "--no-isolation", "--outdir", place, root]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{root} cannot be built:\n{done.stdout}{done.stderr}")
    (wheel,), (archive,) = place.glob(f"{package}-*.whl"), place.glob(f"{package}-*.tar.gz")
    shipped = {p.relative_to(root / "src").as_posix() for p in (root / "src" / package).rglob("*") if p.is_file()}
    packed = names(wheel)
    wrong = [f"{p} is not in the wheel" for p in sorted(shipped - packed) if "__pycache__" not in p]
    wrong += [f"{p} is in the wheel and not in {root}" for p in sorted(packed - shipped) if ".dist-info/" not in p]
    if f"{package}/py.typed" not in packed:
        wrong.append(f"py.typed is not in the wheel of {package}, so that its types count for nobody")
    with tarfile.open(archive) as tar:
        inside = {m.name.split("/", 1)[-1] for m in tar.getmembers()}
    return wheel, wrong + [f"{p} is not in the source archive of {package}" for p in kept if p not in inside]


def lower(compiler: Path, wheel: Path, place: Path) -> None:
    """Leave the programs that `FIRST` lowers where the wheel that is built next finds them."""
    LOWERED.mkdir()
    python = environment(place / "venv", sys.executable)
    install(python, compiler, wheel)
    for words in FIRST:
        subprocess.run(
            [python, "-P", *words], cwd=place, env=surroundings(place), check=True, stdout=subprocess.DEVNULL
        )
    for kept in (place / "cache" / "mckibben" / "kernels").glob("*.program"):
        shutil.copy(kept, LOWERED / f"{kept.stem[:32]}.program")  # without the versions that it was lowered with
    print(f"{len(list(LOWERED.iterdir()))} programs are in the wheel", flush=True)


def accepted(tools: Path, place: Path) -> list[str]:
    """What an index that receives the distributions would object to."""
    words = [tools, "-m", "twine", "check", "--strict", *sorted(place.iterdir())]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    print(f"twine check --strict: {done.stdout.count('PASSED')} of {len(words) - 5} pass", flush=True)
    return [f"an index would refuse them: {done.stdout[-600:]}{done.stderr[-300:]}"] if done.returncode else []


def names(wheel: Path) -> set[str]:
    """Files of a wheel, without what pip writes of it."""
    with zipfile.ZipFile(wheel) as packed:
        return {n for n in packed.namelist() if not n.endswith("RECORD")}


def environment(place: Path, version: str) -> Path:
    """The Python of a new environment, made by another Python."""
    subprocess.run([version, "-m", "venv", str(place)], check=True)
    return place / ("Scripts/python.exe" if os.name == "nt" else "bin/python")


def install(python: Path, *wheels: Path) -> None:
    """Install wheels and what they need, at the versions of `requirements/run.txt`."""
    pins = ROOT / "requirements" / "run.txt"
    words = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "-c", str(pins), *map(str, wheels)]
    subprocess.run([str(python), *words], check=True)


def tell_size(python: Path, *wheels: Path) -> None:
    """Print the size of an environment after wheels were installed, less its tools, and what needs most of it."""
    sizes = json.loads(subprocess.run([python, "-P", "-c", SIZES], check=True, capture_output=True).stdout)
    sizes = {name: size for name, size in sizes.items() if name not in ("pip", "setuptools")}
    most = sorted(sizes, key=sizes.__getitem__)[:-9:-1]
    print(f"{sum(sizes.values()):.0f} MB with {', '.join(w.name for w in wheels)}; of these " + ", ".join(
        f"{name} {sizes[name]:.0f}" for name in most), flush=True)  # fmt: skip


def example_runs(python: Path, package: Path, place: Path, without: str = "") -> list[str]:
    """Run the first example of a package's README, and see that the package came without another one."""
    example = re.search(
        r"^```python\n(.*?)^```", (package / "README.md").read_text(encoding="utf-8"), flags=re.M | re.S
    )
    assert example is not None
    alone = f"import importlib.util\nassert importlib.util.find_spec('{without}') is None\n" if without else ""
    env = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "MCKIBBEN", "LANEWISE"))}
    began = time.monotonic()
    done = subprocess.run(
        [python, "-P", "-c", alone + example[1]], cwd=place,
        env=env | {"LANEWISE_CACHE": str(place / "cache"), "XDG_CACHE_HOME": str(place / "cache")},
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    name = "mckibben" if package == ROOT else package.name
    print(f"{time.monotonic() - began:5.1f} s  first example of the README of {name}", flush=True)
    return [f"the example of the README of {name}: {done.stderr[-300:]}"] if done.returncode else []


# ---- what is called


def surroundings(place: Path) -> dict[str, str]:
    """Environment variables of a call."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "MCKIBBEN", "JAX"))}
    return kept | {"XDG_CACHE_HOME": str(place / "cache"), "PYTHONDONTWRITEBYTECODE": "1"}


def packaged_commands(python: Path, place: Path) -> list[str]:
    """See that the help lists the commands of packages that are not installed, and that these commands name the packages."""
    env = surroundings(place)
    help_text = subprocess.run(
        [python, "-m", "mckibben", "--help"], cwd=place, env=env, check=True, capture_output=True, text=True
    ).stdout
    wrong = [f"{name}: the help does not list it" for name in PACKAGED if f"\n  {name.split()[0]} " not in help_text]
    for name, call in PACKAGED.items():
        wrong += judged(name, call, python=python, room=place, env=env)
    return wrong


def called(python: Path, place: Path, *, brief: bool = False) -> list[str]:
    """Call every command, or one of each distribution; returns what is wrong."""
    room, env = place / "room", surroundings(place)
    furnish(room)
    known = json.loads(subprocess.run([python, "-c", LIST], cwd=room, env=env, check=True, capture_output=True).stdout)
    wrong = [f"{name}: no command of that name" for name in CALLS if name not in known]
    wrong += [f"{name}: it is not called here; add it to CALLS" for name in known if name not in CALLS]
    every = [
        (name, call)
        for name in (BRIEF if brief else sorted(CALLS, key=lambda n: n not in LONG))
        if name in known
        for call in CALLS[name][: 1 if brief else None]
    ]

    def one(job: tuple[str, Call]) -> list[str]:
        return judged(*job, python=python, room=room, env=env)

    with ThreadPoolExecutor(AT_ONCE) as pool:
        for jobs in in_rounds(every):
            for sentences in pool.map(one, jobs):
                wrong += sentences
    return wrong


def furnish(room: Path) -> None:
    """Make the folder of the calls, with the files that they read and none of them writes."""
    (room / "nothing").mkdir(parents=True)
    for name, text in {"tank.toml": TANK, "own.py": OWN_LAW, "lever.ddf": LEVER}.items():
        (room / name).write_text(text, encoding="utf-8")


def in_rounds(jobs: list[tuple[str, Call]]) -> list[list[tuple[str, Call]]]:
    """The calls in rounds: whoever reads a file comes in a later round than the call that writes it."""
    writers = {path: call for _, call in jobs for path in call.writes}

    def round_of(call: Call) -> int:
        read = [writers[word] for word in call.words if word in writers and word not in call.writes]
        return 1 + max(map(round_of, read), default=-1)

    rounds = sorted({round_of(call) for _, call in jobs})
    return [[job for job in jobs if round_of(job[1]) == number] for number in rounds]


def judged(name: str, call: Call, *, python: Path, room: Path, env: dict[str, str]) -> list[str]:
    """Call a command once, say what it did, and return what is wrong with that."""
    words, began = [str(python), "-m", "mckibben", *name.split(), *call.words], time.monotonic()
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as err, tempfile.TemporaryFile() as piped:
        piped.write(call.piped.encode())
        piped.seek(0)
        process = subprocess.Popen(words, cwd=room, env=env, stdin=piped, stdout=out, stderr=err)
        code, used = waited(process)
        out.seek(0)
        err.seek(0)
        printed, said = out.read().decode(errors="replace"), err.read().decode(errors="replace").strip()
    shown = " ".join([name, *(w.rsplit("/", 1)[-1] if w.startswith(str(ROOT)) else w for w in call.words)])
    took = f"{time.monotonic() - began:5.1f} s, {used:4.1f} s of processor time"
    told = "works" if code == 0 else f"exit code {code}: {said.splitlines()[-1] if said else 'nothing said'}"
    print(f"{took}  {shown}\n    {told}", flush=True)
    wrong = ["a traceback"] if "Traceback" in said + printed else []
    if call.says:
        wrong += [] if code == 2 else [f"exit code {code} instead of 2"]
        wrong += [] if "\n" not in said and not printed else ["more than one sentence"]
        wrong += [f"it does not say: {part}" for part in call.says if part not in said]
        wrong += [f"{used:.1f} s of processor time before it says so"] if used > BEFORE else []
    else:
        wrong += [] if code == 0 else [f"exit code {code}: {said[-300:]}"]
        wrong += [f"{path} was not written" for path in call.writes if not (room / path).is_file()]
    return [f"{shown}: {line}" for line in wrong]


def waited(process: "subprocess.Popen[bytes]") -> tuple[int, float]:
    """Exit code of a process and the processor time that it used [s]; one that does not end is ended."""
    if not hasattr(os, "wait4"):
        return process.wait(LONGEST), 0.0
    until = time.monotonic() + LONGEST
    while True:
        found, status, usage = os.wait4(process.pid, os.WNOHANG)
        if found:
            process.returncode = os.waitstatus_to_exitcode(status)
            return process.returncode, usage.ru_utime + usage.ru_stime
        if time.monotonic() > until:
            process.kill()
        time.sleep(0.05)


if __name__ == "__main__":
    sys.exit(main())
