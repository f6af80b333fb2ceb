"""The first result of a fresh process: cold, with kernels cached, and of a saved program without JAX."""

from __future__ import annotations

import json
import os
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import cases
import jax
import numpy as np
from engines import ENGINES, lowered

HERE = Path(__file__).parent


def fresh(arguments: list[str], caches: Path) -> dict[str, float]:
    """Times of a process of its own whose kernels and compilations are kept in a folder."""
    kept = {"MCKIBBEN_KERNELS": caches / "kernels", "JAX_COMPILATION_CACHE_DIR": caches / "jax"}
    settings = {**os.environ, **{k: str(v) for k, v in kept.items()}, "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0"}
    settings.pop("PYTHONDONTWRITEBYTECODE", None)  # an installed package has its byte code
    begin = time.perf_counter()
    done = subprocess.run(
        [sys.executable, str(HERE / "startup.py"), *arguments], capture_output=True, text=True, env=settings, check=True
    )
    found: dict[str, float] = json.loads(done.stdout.splitlines()[-1])
    return found | {"whole": time.perf_counter() - begin}


def measure(quick: bool) -> dict[str, Any]:
    """Every engine cold and cached, and a saved program."""
    rows: list[Any] = []
    times: dict[str, dict[str, float]] = {}
    for engine in ("native", "xla") if "native" in ENGINES else ("xla",):
        spent: dict[str, list[dict[str, float]]] = {"cold": [], "cached": []}
        for _ in range(1 if quick else 3):
            with tempfile.TemporaryDirectory() as folder:
                spent["cold"].append(fresh(["machine", engine], Path(folder)))
                spent["cached"] += [fresh(["machine", engine], Path(folder)) for _ in range(1 if quick else 3)]
        for state, found in spent.items():
            middle = {key: statistics.median(f[key] for f in found) for key in found[0]}
            times.setdefault(engine, {})[state] = middle["beyond"]
            rows.append(
                {
                    "group": "startup",
                    "case": f"first result, {state}",
                    "engine": engine,
                    "seconds": middle["beyond"],
                    "cpu": middle["cpu"],
                    "jax": middle["jax"],
                    "machine": middle["built"],
                    "whole": middle["whole"],
                }
            )
    if "native" in ENGINES:
        times["saved"] = {"whole": saved(rows, 1 if quick else 5)}
    return {"rows": rows, "startup": times}


def saved(rows: list[Any], rounds: int) -> float:
    """Seconds of a whole process that runs a saved program."""
    batch = cases.batch(cases.tube(), 1, 2000)
    run, trees = lowered(batch)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        run.program.save(folder / "muscle.kernel")
        leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(trees)]
        np.savez(folder / "inputs.npz", **{f"{i:04d}": leaf for i, leaf in enumerate(leaves)})
        call = ["saved", str(folder / "muscle.kernel"), str(folder / "inputs.npz")]
        found = [fresh(call, folder) for _ in range(rounds + 1)][1:]  # the first compiles
    whole = statistics.median(f["whole"] for f in found)
    rows.append(
        {
            "group": "startup",
            "case": "saved program, without JAX",
            "engine": "native",
            "whole": whole,
            "seconds": statistics.median(f["beyond"] for f in found),
            "cpu": statistics.median(f["cpu"] for f in found),
        }
    )
    return whole
