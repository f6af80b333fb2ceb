"""One muscle: against SciPy's LSODA with a right-hand side in plain Python, and on the yardstick S1."""

from __future__ import annotations

import dataclasses
import math
import tempfile
from pathlib import Path
from typing import Any

import cases
import numpy as np
import yardstick
from compiled_c import Kernel
from engines import ENGINES
from measure_batches import error
from plain_muscle import rate_of
from timing import in_turns

DURATION, TARGET = 2.0, 1e-3  # [s]; largest error over a channel's range
PATH = 10.0  # of S1 [s]


def muscle(quick: bool) -> tuple[list[Any], dict[str, float]]:
    """The full muscle for 2 s with outputs at 1 kHz: whoever is fastest with an error below 1e-3."""
    from scipy.integrate import odeint, solve_ivp

    case = dataclasses.replace(cases.tube(), straight=True)
    batch = cases.batch(case, 1, round(DURATION / cases.PERIOD))
    times = cases.PERIOD * np.arange(batch.samples + 1)
    names = [*case.paths, *case.constants]
    numbers = dict(zip(names, (float(x) for x in batch.parameters(names)[:, 0]), strict=True))
    rate = rate_of(numbers, lambda t: cases.ROOM + 2.5e5 - 2e5 * math.cos(4.0 * math.pi * t))
    start, span = batch.state()[:, 0], (0.0, float(times[-1]))
    scale = np.array([1e-3, 1e-2, 1e5, 1e-5, 1e-4, 1e-3])

    def lsoda(tolerance: float) -> Any:
        # LSODA's own loop, which `solve_ivp` would turn in Python
        found = odeint(rate, start, times, tfirst=True, rtol=tolerance, atol=tolerance * scale, hmax=0.05)
        return found[:, [0]], found[:, [2]]

    found = solve_ivp(rate, span, start, "DOP853", times, rtol=1e-9, atol=1e-9 * scale, max_step=0.05).y
    exact = found[0][:, None], found[2][:, None]
    runs: dict[str, Any] = {}
    for name, make in ENGINES.items():
        for inner in (1, 2, 5, 10):
            run = make(batch, inner=inner)
            if error(run(), exact) < TARGET:
                runs[f"{name}, {1e3 * cases.PERIOD / inner:g} ms"] = run
                break
    for tolerance in (1e-3, 1e-4, 1e-5, 1e-6, 1e-7):
        if error(lsoda(tolerance), exact) < TARGET:
            runs[f"LSODA, {tolerance:g}"] = lambda t=tolerance: lsoda(t)
            break
    off = {name: error(run(), exact) for name, run in runs.items()}
    taken = in_turns(runs, 3 if quick else 11)
    base = next(name for name in runs if name.startswith("LSODA"))
    rows = [
        {
            "group": "single",
            "case": "muscle",
            "engine": name,
            "seconds": taken.median(name),
            "dtype": "float64",
            "real_time": DURATION / taken.median(name),
            "error": off[name],
            "vs_lsoda": taken.ratio(base, name),
        }
        for name in runs
    ]
    best = {name.split(",")[0]: taken.ratio(base, name) for name in runs if name != base}
    return rows, best


def exact_path() -> Path:
    """A file with the exact path of S1 for 10 s, with which all programs are compared."""
    times = cases.PERIOD * np.arange(round(PATH / cases.PERIOD) + 1)
    exact = yardstick.reference(times)
    known = Path(tempfile.mkdtemp(prefix="mckibben-bench-"), "s1.npz")
    np.savez(known, time=times, contraction=exact[0], pressure=exact[2])
    return known


def s1(quick: bool, known: Path) -> tuple[list[Any], dict[str, float]]:
    """S1 for 10 s at 100 us, against the C kernel at the same step and the exact path."""
    batch = cases.batch(cases.s1(), 1, round(PATH / cases.PERIOD))
    exact = np.load(known)["contraction"]
    runs: dict[str, Any] = {"C": Kernel("s1", single=True).prepared(batch, cases.INNER, cases.PERIOD)}
    runs |= {name: make(batch) for name, make in ENGINES.items()}
    off = {name: float(np.abs(run()[0][:, 0] - exact).max()) for name, run in runs.items()}
    taken = in_turns(runs, 3 if quick else 11)
    rows = [
        {
            "group": "s1",
            "case": "s1",
            "engine": name,
            "seconds": taken.median(name),
            "dtype": "float64",
            "lanes": 1,
            "real_time": PATH / taken.median(name),
            "off": off[name],
            "vs_c": taken.ratio("C", name),
            "error": off[name] / float(np.ptp(exact)),
        }
        for name in runs
    ]
    return rows, {name: taken.ratio("C", name) for name in runs}


def curve(quick: bool, known: Path) -> list[Any]:
    """Work over precision on S1 for 10 s: the C kernel and ours at several steps, LSODA with plain Python at tolerances."""
    from scipy.integrate import odeint

    batch = cases.batch(cases.s1(), 1, round(PATH / cases.PERIOD))
    exact, times = np.load(known)["contraction"], cases.PERIOD * np.arange(batch.samples + 1)
    runs: dict[tuple[str, str], Any] = {}
    for inner in (1, 2, 5, 10, 20):
        step = f"{1e6 * cases.PERIOD / inner:g} us"
        runs["C by hand", step] = Kernel("s1", single=True).prepared(batch, inner, cases.PERIOD)
        runs["mckibben", step] = ENGINES["native"](batch, inner=inner)
    for tolerance in yardstick.TOLERANCES:
        atol = tolerance * 1e-3 * np.array([1e-2, 1e-1, 1e5])
        runs["LSODA, plain Python", f"{tolerance:g}"] = lambda rtol=tolerance, atol=atol: (
            odeint(yardstick.plain_rate, yardstick.START, times, tfirst=True, rtol=rtol, atol=atol),
        )
    errors = {name: float(np.abs(run()[0][:, 0] - exact).max() / np.ptp(exact)) for name, run in runs.items()}
    taken = in_turns({" ".join(name): run for name, run in runs.items()}, 3 if quick else 11)
    return [
        {
            "group": "curve",
            "program": program,
            "case": "S1, one muscle",
            "setting": setting,
            "dtype": "float64",
            "real_time": PATH / taken.median(f"{program} {setting}"),
            "error": errors[program, setting],
        }
        for program, setting in runs
    ]


def measure(quick: bool) -> dict[str, Any]:
    """All of them; the path of S1 is kept for the programs that are compared on it."""
    rows, vs_lsoda = muscle(quick)
    known = exact_path()
    more, vs_c = s1(quick, known)
    more += curve(quick, known)
    return {"rows": rows + more, "vs_lsoda": vs_lsoda, "s1_vs_c": vs_c, "reference": str(known)}
