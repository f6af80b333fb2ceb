"""How the cost grows: with cores, with the size of a batch, and with the number of muscles in one machine."""

from __future__ import annotations

import os
import time
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import cases
import jax
import numpy as np
from compiled_c import Kernel
from engines import ENGINES, native, xla
from measure_batches import peak, samples_for
from timing import CORES, in_turns, pin

from mckibben.engine.side_by_side import SideBySide

LANES = 16384
PIECES = 8  # of the C kernel's batch, so that a thread that is held up does not keep the other waiting
RIGS = (1, 10, 64, 256, 1000)
RIG_SAMPLES = 20


def cores(quick: bool) -> dict[str, Any]:
    """One core and two, at the same batch; pieces of the C kernel's batch run in threads.

    Beside them what the two cores give at all: the bare peak of multiply and add. Where a machine calls two threads of one
    core two cores, nothing that keeps its units busy gains by the second.
    """
    if len(CORES) < 2:
        return {"note": "this machine has one core"}
    batch = cases.batch(cases.tube(), LANES, samples_for(LANES, 1e6 if quick else 4e6))
    kernel = Kernel("muscle")
    each = LANES // PIECES
    runs = [kernel.prepared(batch.part(k * each, (k + 1) * each), cases.INNER, cases.PERIOD) for k in range(PIECES)]
    whole = kernel.prepared(batch, cases.INNER, cases.PERIOD)
    pin(CORES[:2])
    with ThreadPoolExecutor(2) as pool:
        top = peak()["float64"][0]
        candidates: dict[str, Any] = {"C, 1": whole, "C, 2": lambda: list(pool.map(lambda run: run(), runs))}
        candidates |= {"peak, 1": lambda: [top(), top()], "peak, 2": lambda: list(pool.map(lambda _: top(), range(2)))}
        for name in ENGINES:
            if name == "native":
                candidates |= {f"{name}, {n}": native(batch, threads=n) for n in (1, 2)}
        taken = in_turns(candidates, 3 if quick else 11, wall=True)
    pin()
    steps = LANES * batch.samples * cases.INNER
    rows = [
        {
            "group": "cores",
            "case": "muscle",
            "engine": name,
            "lanes": LANES,
            "dtype": "float64",
            "rate": steps / taken.median(name),
        }
        for name in candidates
        if not name.startswith("peak")
    ]
    gains = {
        name.split(",")[0]: taken.ratio(name.replace(", 2", ", 1"), name) for name in candidates if name.endswith(", 2")
    }
    return {"rows": rows, "two_cores_vs_one": gains}


def growth(seen: list[tuple[int, float]]) -> dict[str, float]:
    """Time against the number of lanes: exponent of the best power, largest factor off it, and over how many decades."""
    lanes, seconds = (np.log([s[i] for s in sorted(seen)]) for i in (0, 1))
    exponent, level = np.polyfit(lanes, seconds, 1)
    off = float(np.exp(np.abs(seconds - level - exponent * lanes).max()))
    return {"exponent": float(exponent), "off": off, "decades": float((lanes[-1] - lanes[0]) / np.log(10.0))}


def rigs(quick: bool, patience: float = 600.0) -> dict[str, Any]:
    """Machines of 1 to 1,000 muscles, one lane: compilation and cost per muscle-step."""
    from mckibben.engine import held
    from mckibben.engine.integration import compile_march

    rows: list[Any] = []
    notes = []
    engine = "native" if "native" in ENGINES else "xla"
    begun = time.perf_counter()
    for muscles in RIGS[:2] if quick else RIGS:
        if time.perf_counter() - begun > patience:
            notes.append(
                f"{muscles} muscles in one machine were left out: the smaller ones took {patience:g} s to compile"
            )
            continue
        machine, start, signal = cases.rig(muscles)
        values = cases.tube().wave(cases.PERIOD * np.arange(RIG_SAMPLES + 1), 0.0)[0]
        given = (machine, *start, {signal: held(values)})
        begin = time.perf_counter()
        names = [f"m{i:04d}.length" for i in range(muscles)]
        run = compile_march(*given, period=cases.PERIOD, inner=cases.INNER, outputs=names, engine=engine)
        run(*given)
        compiling = time.perf_counter() - begin
        call = (lambda r=run, g=given: r(*g)) if engine == "xla" else leaves_of(run, given)
        batch = batch_of(muscles, engine)
        taken = in_turns({engine: call, "batch": batch}, 3 if quick else 7)
        steps = muscles * RIG_SAMPLES * cases.INNER
        rows.append(
            {
                "group": "rig",
                "case": "rig",
                "engine": engine,
                "muscles": muscles,
                "dtype": "float64",
                "compile": compiling,
                "vs_batch": taken.ratio(engine, "batch"),
                "rate": steps / taken.median(engine),
            }
        )
    return {"rows": rows, "notes": notes}


def leaves_of(run: Any, given: Any) -> Any:
    """A call without the search for the leaves of the trees."""
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves(given)]
    if isinstance(run, SideBySide):
        stacked, parts = run.split.stacked(leaves), len(run.split.outputs)
        return lambda: run.program.call(stacked, lanes=parts, threads=1)
    return lambda: run.program.call(leaves)


def batch_of(muscles: int, engine: str) -> Any:
    """As many machines of one muscle, run as a batch on one thread."""
    batch = cases.batch(cases.tube(), muscles, RIG_SAMPLES)
    return native(batch, threads=1) if engine == "native" else xla(batch)


def measure(quick: bool, batch_rows: list[Any]) -> dict[str, Any]:
    """All three."""
    by_cores, by_rig = cores(quick), rigs(quick)
    linear = {}
    for engine in ("C", *ENGINES):
        seen = [
            (r["lanes"], r["lanes"] / r["rate"])
            for r in batch_rows
            if r["group"] == "batch"
            and r["engine"] == engine
            and r["case"] == "muscle"
            and r["dtype"] == "float64"
            and r["lanes"] >= 16
        ]
        if len(seen) > 3:
            linear[engine] = growth(seen)
    return {
        "rows": by_cores.pop("rows", []) + by_rig["rows"],
        "linear": linear,
        "notes": by_rig["notes"],
        **by_cores,
        "load": os.getloadavg()[0] if hasattr(os, "getloadavg") else None,
    }
