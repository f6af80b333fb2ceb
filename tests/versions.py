"""Whether the packages work with every Python, and with the oldest and the newest libraries that they allow.

    python tests/versions.py [PYTHON ..] [--ends oldest newest] [--tests FILE ..] [--folder FOLDER]

For each Python that is named (python3.11, python3.12 and python3.13 by default; those that are missing are said), and for
each end of the ranges of numpy, scipy and JAX in `pyproject.toml`, an environment is made, the packages of this copy are
installed, and a quick part of the suite runs there. Prints rows of the table in `docs/reference/versions.md`; the exit
code is 1 if a test failed. Environments are kept in the folder, if one is named, and used again.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[1]
PYTHONS = ("python3.11", "python3.12", "python3.13")
VARIED = ("numpy", "scipy", "jax")
# The first version with a wheel for a Python that is younger than the oldest version allowed, by number of its minor.
FIRST_WHEEL = {("numpy", 13): "2.1", ("scipy", 13): "1.14.1"}
QUICK = (
    "tests/test_quantities.py", "tests/test_schema.py", "tests/muscles/test_muscle.py", "tests/engine/test_prediction.py",
    "packages/lanewise/tests/test_products.py", "packages/lanewise/tests/test_saved_programs.py",
)  # fmt: skip
SHOWN = "import platform, jax, numpy, scipy; print(platform.python_version(), *(m.__version__ for m in (numpy, scipy, jax)))"


def pins(end: str, minor: int) -> list[str]:
    """Requirements of an end of the allowed ranges: the last repair of each lower bound, or the ranges for pip to choose."""
    stated = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["dependencies"]
    ranges = {name: text for text in stated for name in VARIED if re.match(rf"{name}\b", text)}
    if end == "newest":
        return list(ranges.values())
    oldest = {name: re.search(r">=([\d.]+)", text)[1] for name, text in ranges.items()}  # type: ignore[index]
    oldest |= {name: version for (name, since), version in FIRST_WHEEL.items() if minor >= since}
    return [f"{name}~={v}.0" if v.count(".") == 1 else f"{name}=={v}" for name, v in oldest.items()] + [
        f"jaxlib~={oldest['jax']}.0"
    ]


def environment(python: str, end: str, folder: Path) -> Path:
    """The Python of an environment with the packages of this copy; made if it is not there yet."""
    place = folder / f"{Path(python).name}-{end}"
    own = place / ("Scripts" if os.name == "nt" else "bin") / "python"
    if (place / "installed").exists():
        return own
    minor = int(subprocess.check_output([python, "-c", "import sys; print(sys.version_info.minor)"]))
    subprocess.run([python, "-m", "venv", "--clear", place], check=True)
    packages = [str(ROOT / "packages" / "lanewise"), str(ROOT)]
    install = [own, "-m", "pip", "install", "--quiet", "--only-binary=:all:", *pins(end, minor), "pytest", "hypothesis"]
    subprocess.run([*install, *(word for one in packages for word in ("--editable", one))], check=True)
    (place / "installed").touch()
    return own


def main() -> int:
    """Make the environments one after the other, run the tests there, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pythons", nargs="*", default=PYTHONS, help="Pythons to try")
    parser.add_argument("--ends", nargs="+", choices=("oldest", "newest"), default=("oldest", "newest"))
    parser.add_argument("--tests", nargs="+", default=QUICK, help="tests to run")
    parser.add_argument("--folder", type=Path, help="keep the environments here")
    chosen = parser.parse_args()
    failed = 0
    print("| Python | numpy | scipy | JAX | range | tests |\n|---|---|---|---|---|---|", flush=True)
    with tempfile.TemporaryDirectory() as temporary:
        for python in chosen.pythons:
            if shutil.which(python) is None:
                print(f"| {python} | | | | | not on this machine |", flush=True)
                continue
            for end in chosen.ends:
                try:
                    own = environment(python, end, (chosen.folder or Path(temporary)).absolute())
                except subprocess.CalledProcessError as error:
                    failed += 1
                    print(f"| {python} | | | | {end} | cannot be installed: {error.cmd[0]} |", flush=True)
                    continue
                versions = subprocess.check_output([own, "-c", SHOWN], text=True).split()
                clean = {k: v for k, v in os.environ.items() if k != "PYTHONPATH"}
                done = subprocess.run(
                    [own, "-m", "pytest", *chosen.tests], cwd=ROOT, env=clean, capture_output=True, text=True
                )
                failed += done.returncode != 0
                said = (done.stdout or done.stderr).strip().splitlines()[-1:]
                print(f"| {' | '.join(versions)} | {end} | {' '.join(said).strip('= ')} |", flush=True)
                if done.returncode:
                    print(done.stdout[-4000:], done.stderr[-2000:], file=sys.stderr)
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
