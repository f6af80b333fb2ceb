"""Pages made two at a time, each in a process beside others, and kept until something that they depend on changes.

A page depends on its own text, on the package, on the scripts of this folder, on the examples, and on the versions of everything
that is installed. Where none of these changed since a page was made, what was made then is taken. `build/kept` holds it.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import shutil
import sys
import time
import traceback
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from importlib import metadata
from pathlib import Path
from typing import NamedTuple

import examples

ROOT = Path(__file__).resolve().parents[1]
KEPT = ROOT / "build" / "kept"
WORKERS = min(2, os.cpu_count() or 1)
PAGES = 10  # that a process makes, about, before others take their place: what is compiled stays in memory


class Made(NamedTuple):
    """A page that is ready: its name, the folder with ``page.md`` and its figures, and the seconds that it took, 0 if kept."""

    name: str
    folder: Path
    seconds: float


def make_all(sources: dict[str, bytes], make: Callable[[str, Path], str], *, fresh: bool = False) -> Iterator[Made]:
    """Make all pages, those that took longest last time first.

    Args:
        sources: what each page is made of, by its name.
        make: given the name and an empty folder for figures, returns the page; runs in another process.
        fresh: make everything, whatever is kept.

    Raises:
        ExampleError: when all are done, with what was wrong on each page that could not be made.
    """
    base = _state()
    keys = {name: hashlib.sha256(base + name.encode() + b"\0" + text).hexdigest()[:24] for name, text in sources.items()}
    left = []
    for name, key in keys.items():
        folder = KEPT / key
        if not fresh and (folder / "page.md").is_file():
            yield Made(name, folder, 0.0)
        else:
            shutil.rmtree(folder, ignore_errors=True)
            left.append(name)
    took = _times()
    left.sort(key=lambda name: -took.get(name, 1.0))
    wrong = []
    KEPT.mkdir(parents=True, exist_ok=True)
    for first in range(0, len(left), PAGES * WORKERS):
        for name, error, seconds in _in_processes(make, left[first : first + PAGES * WORKERS], keys):
            if error:
                wrong.append(error)
                print(f"  {name}  FAILED", flush=True)
                continue
            took[name] = round(seconds, 1)
            _times(took)
            yield Made(name, KEPT / keys[name], seconds)
    if wrong:
        raise examples.ExampleError("\n\n".join(wrong))
    for folder in KEPT.iterdir():
        if folder.is_dir() and folder.name not in keys.values():
            shutil.rmtree(folder)


def _in_processes(
    make: Callable[[str, Path], str], names: list[str], keys: dict[str, str]
) -> Iterator[tuple[str, str, float]]:
    """Make some pages in new processes: of each its name, what was wrong in words, and how long it took [s]."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, mp_context=context, initializer=_begin) as pool:
        waiting = {pool.submit(_make, make, name, KEPT / keys[name]): name for name in names}
        for done in as_completed(waiting):
            yield (waiting[done], *done.result())


def _begin() -> None:
    """A worker takes warnings as errors, and finds what others compiled."""
    warnings.simplefilter("error")
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(ROOT / "build" / "compiled"))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.3")


def _make(make: Callable[[str, Path], str], name: str, folder: Path) -> tuple[str, float]:
    """Make one page into a folder; what was wrong in words, and how long it took [s]."""
    begun = time.perf_counter()
    figures = folder / "figures"
    figures.mkdir(parents=True)
    try:
        text = make(name, figures)
    except examples.ExampleError as error:
        return str(error), 0.0
    except Exception:
        return f"{name}:\n{traceback.format_exc()}", 0.0
    (folder / "page.md").write_text(text, encoding="utf-8", newline="\n")
    return "", time.perf_counter() - begun


def _state() -> bytes:
    """A digest of all that any page may depend on."""
    digest = hashlib.sha256(sys.version.encode())
    digest.update("\n".join(sorted(f"{d.name} {d.version}" for d in metadata.distributions())).encode())
    for folder, endings in (("src", None), ("examples", None), ("firmware", None), ("docs", {".py"})):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts and (endings is None or path.suffix in endings):
                digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return digest.digest()


def _times(new: dict[str, float] | None = None) -> dict[str, float]:
    """How long each page took when it was last made [s]; written where given."""
    path = KEPT / "times.json"
    if new is not None:
        path.write_text(json.dumps(new, indent=1, sort_keys=True), encoding="utf-8")
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return {}
