"""Build pages in parallel processes, and cache them until one of their dependencies changes.

A page depends on its own text, on the package, on the scripts of this folder, on the examples, and on the versions of all
installed distributions. If none of these changed since a page was built, the cached page in `build/page-cache` is used.
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
CACHE = ROOT / "build" / "page-cache"
WORKERS = min(2, os.cpu_count() or 1)
PAGES_PER_WORKER = 10  # on average; then the processes are replaced, because compiled functions stay in memory


class BuiltPage(NamedTuple):
    """A finished page: its name, the folder with ``page.md`` and its figures, and the build time [s], 0 if cached."""

    name: str
    folder: Path
    seconds: float


def build_all(
    sources: dict[str, bytes], build: Callable[[str, Path], str], *, fresh: bool = False
) -> Iterator[BuiltPage]:
    """Build all pages, in order of their last build time, the longest first.

    Args:
        sources: source text of each page, by the name of the page.
        build: called with the name and an empty folder for figures, returns the page; runs in another process.
        fresh: build all pages, ignoring the cache.

    Raises:
        ExampleError: at the end, with the errors of all pages that could not be built.
    """
    base = _dependencies_digest()
    keys = {
        name: hashlib.sha256(base + name.encode() + b"\0" + text).hexdigest()[:24] for name, text in sources.items()
    }
    outdated = []
    for name, key in keys.items():
        folder = CACHE / key
        if not fresh and (folder / "page.md").is_file():
            yield BuiltPage(name, folder, 0.0)
        else:
            shutil.rmtree(folder, ignore_errors=True)
            outdated.append(name)
    times = _times()
    outdated.sort(key=lambda name: -times.get(name, 1.0))
    errors = []
    CACHE.mkdir(parents=True, exist_ok=True)
    for first in range(0, len(outdated), PAGES_PER_WORKER * WORKERS):
        for name, error, seconds in _in_processes(build, outdated[first : first + PAGES_PER_WORKER * WORKERS], keys):
            if error:
                errors.append(error)
                print(f"  {name}  FAILED", flush=True)
                continue
            times[name] = round(seconds, 1)
            _times(times)
            yield BuiltPage(name, CACHE / keys[name], seconds)
    if errors:
        raise examples.ExampleError("\n\n".join(errors))
    for folder in CACHE.iterdir():
        if folder.is_dir() and folder.name not in keys.values():
            shutil.rmtree(folder)


def _in_processes(
    build: Callable[[str, Path], str], names: list[str], keys: dict[str, str]
) -> Iterator[tuple[str, str, float]]:
    """Build some pages in new processes; yield the name of each, its error message, and its build time [s]."""
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(WORKERS, mp_context=context, initializer=_init_worker) as pool:
        waiting = {pool.submit(_build_page, build, name, CACHE / keys[name]): name for name in names}
        for done in as_completed(waiting):
            yield (waiting[done], *done.result())


def _init_worker() -> None:
    """Turn warnings into errors, and share the cache of compiled functions with other workers."""
    warnings.simplefilter("error")
    # with every answer of a muscle whose law has a large error
    warnings.filterwarnings("ignore", "the tension of .* may be off by")
    os.environ.setdefault("JAX_COMPILATION_CACHE_DIR", str(ROOT / "build" / "compiled"))
    os.environ.setdefault("JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS", "0.3")


def _build_page(build: Callable[[str, Path], str], name: str, folder: Path) -> tuple[str, float]:
    """Build one page into a folder; return its error message and its build time [s]."""
    begun = time.perf_counter()
    figures = folder / "figures"
    figures.mkdir(parents=True)
    try:
        text = build(name, figures)
    except examples.ExampleError as error:
        return str(error), 0.0
    except Exception:
        return f"{name}:\n{traceback.format_exc()}", 0.0
    (folder / "page.md").write_text(text, encoding="utf-8", newline="\n")
    return "", time.perf_counter() - begun


def _dependencies_digest() -> bytes:
    """Return a digest of everything that any page may depend on."""
    digest = hashlib.sha256(sys.version.encode())
    digest.update("\n".join(sorted(f"{d.name} {d.version}" for d in metadata.distributions())).encode())
    digest.update((ROOT / "pyproject.toml").read_bytes())
    for folder, endings in (
        ("src", None),
        ("packages", None),
        ("examples", None),
        ("docs", {".py"}),
    ):
        for path in sorted((ROOT / folder).rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts and (endings is None or path.suffix in endings):
                digest.update(str(path.relative_to(ROOT)).encode() + b"\0" + path.read_bytes())
    return digest.digest()


def _times(new: dict[str, float] | None = None) -> dict[str, float]:
    """Return the last build time of each page [s], after storing new times if given."""
    path = CACHE / "times.json"
    if new is not None:
        path.write_text(json.dumps(new, indent=1, sort_keys=True), encoding="utf-8")
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError):
        return {}
