"""Many muscles at once on one core: the library's engines against the C kernels and the processor's peak."""

from __future__ import annotations

import ctypes
from typing import Any

import cases
import numpy as np
from compiled_c import Kernel, built, operations
from engines import ENGINES
from timing import in_turns

SIZES = (1, 4, 16, 64, 256, 1024, 4096, 16384, 65536, 262144)
LOOKED_AT = 16  # lanes whose error is taken
ROUNDS = 300_000  # of the peak
FINE = 16  # the reference takes this many times the steps


def reference(batch: cases.Batch) -> tuple[np.ndarray, np.ndarray]:
    """The first lanes at a sixteenth of the step, (samples + 1, lanes); by the kernel, which a test holds to the library."""
    few = batch.first(LOOKED_AT)
    return Kernel(batch.case.name, single=few.lanes == 1).prepared(few, FINE * cases.INNER, cases.PERIOD)()


def error(found: Any, exact: Any) -> float:
    """Largest deviation of either output over the range of that output."""
    return max(
        float(np.abs(np.asarray(a)[:, : b.shape[1]] - b).max() / np.ptp(b)) for a, b in zip(found, exact, strict=True)
    )


def peak() -> dict[str, Any]:
    """Runs of nothing but multiply and add, and how many operations each is."""
    runs: dict[str, Any] = {}
    for name, options in (("float64", ()), ("float32", ("-DSINGLE",))):
        library = ctypes.CDLL(str(built("peak.c", *options)))
        library.peak.restype = ctypes.c_double
        library.peak.argtypes = [ctypes.c_long]
        library.operations_per_round.restype = ctypes.c_long
        runs[name] = (lambda call=library.peak: call(ROUNDS), ROUNDS * library.operations_per_round())
    return runs


def samples_for(lanes: int, budget: float) -> int:
    """So many samples that a run takes about `budget` muscle-steps."""
    return int(np.clip(budget / (lanes * cases.INNER), 2, 2000))


def against_c(
    case: cases.Case, lanes: int, dtype: str, rounds: int, budget: float, *, engines: Any, with_peak: bool = False
) -> Any:
    """Rows of one batch size: engines and the kernel in turns, and the peak with them."""
    batch = cases.batch(case, lanes, samples_for(lanes, budget))
    exact = reference(batch)
    kernel = Kernel(case.name, dtype=dtype, single=lanes == 1)
    runs = {"C": kernel.prepared(batch, cases.INNER, cases.PERIOD)}
    runs |= {name: make(batch, dtype) for name, make in engines.items()}
    found = {name: error(run(), exact) for name, run in runs.items()}
    top = peak()[dtype]
    times = in_turns(runs | ({"peak": top[0]} if with_peak else {}), rounds)
    steps = lanes * batch.samples * cases.INNER
    rows = [
        {
            "group": "batch",
            "case": case.name,
            "engine": name,
            "lanes": lanes,
            "dtype": dtype,
            "rate": steps / times.median(name),
            "vs_c": times.ratio("C", name),
            "error": found[name],
        }
        for name in runs
    ]
    if with_peak:
        done = operations(case.name, batch, cases.STEP)
        share = done * steps / top[1] * times.ratio("peak", "C")
        rows.append(
            {
                "group": "peak",
                "case": case.name,
                "dtype": dtype,
                "operations_per_step": done,
                "peak": top[1] / times.median("peak"),
                "reached": done * steps / times.median("C"),
                "share": share,
            }
        )
    return rows


def measure(quick: bool) -> dict[str, Any]:
    """All sizes, both precisions, and the circuits."""
    rounds, budget = (5, 5e5) if quick else (11, 2e6)
    tube = cases.tube()
    rows: list[Any] = []
    for lanes in (1, 1024) if quick else SIZES:
        for dtype in ("float64", "float32"):
            few = lanes in (1, 1024) if dtype == "float64" else lanes == 1024
            # XLA compiles each size anew, for ten seconds
            engines = ENGINES if few and (not quick or dtype == "float64") else without("XLA")
            rows += against_c(tube, lanes, dtype, rounds, budget, engines=engines, with_peak=lanes == 1024)
    for case in (cases.valve(), cases.s1()):
        for lanes in (1024,) if quick else (1, 1024):
            engines = without("XLA") if quick else ENGINES
            rows += against_c(case, lanes, "float64", rounds, budget, engines=engines, with_peak=lanes == 1024)
    return {"rows": rows}


def without(name: str) -> dict[str, Any]:
    """The engines but one."""
    return {key: make for key, make in ENGINES.items() if key != name}
