"""Follow the pages as a reader does: install what they say into fresh environments, and run what they show.

    python docs/as_printed.py [PAGE ..] [--python PYTHON] [--folder FOLDER]

All pages by default: README.md, those of the packages, and those of this folder. Each is followed in a copy of the repository
with nothing beside it: the lines that install are run as README prints them, or as the page itself does where it has its own,
then those extras that the page names as such, and those libraries that it says to install by pip, and nothing else. Then
`examples.py` runs each visible block by the Python of that environment, with caches that were empty when the first page began.
Prints for each page how many commands and blocks of Python ran, how many were left out because they need what no library
brings, such as a board, and what failed; the exit code is 1 if anything did. With a folder, environments are kept there.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
INSTALL = re.compile(r"^```sh\n((?:(?!^```).*\n)*?.*-m pip install(?:.*\n)*?)^```", re.M)
EXTRA = re.compile(r"\bextras?(?:\]\([^)]*\))?\s+((?:`\w+`(?:,\s+|\s+and\s+)?)+)")
LIBRARY = re.compile(r"`python -m pip install (\w[\w ]*)`")
COUNTS = re.compile(r": (\d+) run, (\d+) left out, (\d+) failed")


class Recipe(NamedTuple):
    """What makes an environment: blocks of a shell that install this copy, and arguments of pip for what comes on top."""

    blocks: tuple[str, ...]
    more: tuple[str, ...]


def pages() -> list[Path]:
    """Return the pages that are followed: those with a block that runs."""
    every = [ROOT / "README.md", *sorted((ROOT / "packages").glob("*/README.md")), *sorted((ROOT / "docs").rglob("*.md"))]
    return [p for p in every if re.search(r"^```(python|console|sh)\b", p.read_text(encoding="utf-8"), re.M)]


def recipe(page: Path) -> Recipe:
    """Return what a page tells its reader to install: by its own blocks, else by those of README."""
    text = page.read_text(encoding="utf-8")
    blocks = INSTALL.findall(text) or INSTALL.findall((ROOT / "README.md").read_text(encoding="utf-8"))
    known = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["optional-dependencies"]
    extras = sorted({name for names in EXTRA.findall(text) for name in re.findall(r"`(\w+)`", names)} & known.keys())
    if page in (ROOT / "README.md", ROOT / "docs" / "index.md"):
        extras = []  # their blocks are the installation, and they list the extras for everybody
    libraries = sorted({word for words in LIBRARY.findall(text) for word in words.split()})
    return Recipe(tuple(blocks), (*([f"mckibben[{','.join(extras)}]"] if extras else []), *libraries))


def environment(made: dict[Recipe, Path], wanted: Recipe, folder: Path, python: str) -> Path:
    """Return a copy of the repository with an environment in `.venv`, made if no page before had the same."""
    if wanted in made:
        return made[wanted]
    place, plain = folder / str(len(made)), wanted._replace(more=())
    if wanted.more:
        shutil.copytree(environment(made, plain, folder, python), place, symlinks=True, copy_function=os.link)
        _moved(made[plain] / ".venv", place / ".venv")
    else:
        names = subprocess.check_output(["git", "-C", ROOT, "ls-files", "-z", "--cached", "--others", "--exclude-standard"])
        for name in filter(None, names.decode().split("\0")):
            if (ROOT / name).is_file():
                (place / name).parent.mkdir(parents=True, exist_ok=True)
                shutil.copy(ROOT / name, place / name)
        subprocess.run([python, "-m", "venv", place / ".venv"], check=True)
    lines = [f"python -m pip install {' '.join(map(repr, wanted.more))}"] if wanted.more else wanted.blocks
    quiet = {"PIP_QUIET": "2", "PIP_DISABLE_PIP_VERSION_CHECK": "1"}
    for line in lines:
        print(f"  installs: {' && '.join(line.strip().splitlines())}", flush=True)
        subprocess.run(["bash", "-ec", line], cwd=place, env=surroundings(place, folder) | quiet, check=True)
    made[wanted] = place
    return place


def _moved(before: Path, after: Path) -> None:
    """Let the scripts of a copied environment, which name the one that was copied, name the copy."""
    for script in [p for p in (after / "bin").iterdir() if p.is_file() and not p.is_symlink()]:
        text = script.read_bytes()
        script.unlink()  # it is the same file as in the other environment
        script.write_bytes(text.replace(bytes(before), bytes(after)))
        shutil.copymode(before / "bin" / script.name, script)


def surroundings(place: Path, folder: Path) -> dict[str, str]:
    """Environment variables of a reader: nothing of this project's, and empty caches at the beginning."""
    kept = {k: v for k, v in os.environ.items() if not k.startswith(("PYTHON", "MCKIBBEN", "LANEWISE", "JAX", "VIRTUAL_ENV"))}
    path = os.pathsep.join([str(place / ".venv" / "bin"), os.environ.get("PATH", "")])
    return kept | {"PATH": path, "XDG_CACHE_HOME": str(folder / "cache"), "MPLBACKEND": "agg", "PIP_CACHE_DIR": _pip_cache()}


def _pip_cache() -> str:
    """What pip has fetched before; only the programs' own caches are to be empty."""
    said = subprocess.run([sys.executable, "-m", "pip", "cache", "dir"], capture_output=True, text=True, check=False)
    return said.stdout.strip() or str(Path.home() / ".cache" / "pip")


def main() -> int:
    """Follow the pages, one after the other, and print a line for each and the sums."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pages", nargs="*", type=Path, help="pages to follow")
    parser.add_argument("--python", default=sys.executable, help="Python of the environments")
    parser.add_argument("--folder", type=Path, help="keep the environments here")
    chosen, began = parser.parse_args(), time.monotonic()
    made: dict[Recipe, Path] = {}
    sums, wrong = [0, 0, 0], []
    with tempfile.TemporaryDirectory(prefix="mckibben-pages-") as temporary:
        folder = (chosen.folder or Path(temporary)).resolve()
        for page in [p.resolve() for p in chosen.pages] or pages():
            name, since = page.relative_to(ROOT).as_posix(), time.monotonic()
            try:
                place = environment(made, recipe(page), folder, chosen.python)
            except subprocess.CalledProcessError as error:
                wrong.append(f"{name}: what it says to install cannot be installed ({error.returncode})")
                continue
            done = subprocess.run(
                [place / ".venv" / "bin" / "python", place / "docs" / "examples.py", name],
                cwd=place, env=surroundings(place, folder), capture_output=True, text=True, check=False,
            )  # fmt: skip
            print(f"{time.monotonic() - since:5.0f} s  {done.stdout.strip()}", flush=True)
            counts = COUNTS.search(done.stdout)
            if done.returncode or counts is None:
                wrong.append(name if counts else f"{name}: {done.stderr[-600:]}")
            sums = [a + int(b) for a, b in zip(sums, counts.groups() if counts else (0, 0, 1), strict=True)]
    print(f"{sums[0]} commands and blocks of Python ran, {sums[1]} were left out, {sums[2]} failed; "
          f"{len(made)} environments, {(time.monotonic() - began) / 60:.0f} min")  # fmt: skip
    print(*wrong, sep="\n")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main())
