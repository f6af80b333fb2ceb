"""How the cost grows: with cores, with the size of a batch, and with the number of muscles in one machine."""

from __future__ import annotations

import argparse
import contextlib
import os
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import cases
import jax
import numpy as np
from compiled_c import Kernel
from engines import ENGINES, native, xla
from measure_batches import peak, samples_for
from timing import CORES, in_turns, pin

from mckibben.engine.coupled import CoupledRun
from mckibben.engine.side_by_side import SideBySide

LANES = 16384
PIECES = 8  # of the C kernel's batch, so that a thread that is held up does not keep the other waiting
RIGS = (1, 10, 64, 256, 1000)
RIG_SAMPLES = 20
COUPLED_FROM = 64  # muscles from which on machines whose muscles share something are measured


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
    """Machines of 1 to 1,000 muscles, one lane: compilation and cost per muscle-step, by what the muscles share."""
    rows: list[Any] = []
    notes = []
    begun = time.perf_counter()
    cases_run = [(shared, n) for shared in cases.SHARED for n in (RIGS[:2] if quick else RIGS)]
    for shared, muscles in cases_run:
        if shared != cases.SHARED[0] and muscles < COUPLED_FROM:
            continue
        if time.perf_counter() - begun > patience:
            notes.append(
                f"{muscles} muscles in one machine ({shared}) were left out: the others took {patience:g} s to compile"
            )
            continue
        rows.append(rig(shared, muscles, 3 if quick else 7))
    return {"rows": rows, "notes": notes}


def rig(shared: str, muscles: int, rounds: int, spread: float = 0.0) -> dict[str, Any]:
    """One machine, see `cases.rig`, beside as many single muscles as a batch; nothing is taken from disk."""
    from mckibben.engine import held
    from mckibben.engine.integration import compile_march

    engine = "native" if "native" in ENGINES else "xla"
    machine, start, signal = cases.rig(muscles, shared, spread)
    values = cases.tube().wave(cases.PERIOD * np.arange(RIG_SAMPLES + 1), 0.0)[0]
    given = (machine, *start, {signal: held(values)})
    names = [f"m{i:04d}.length" for i in range(muscles)]
    with nothing_kept():
        begin, spent = time.perf_counter(), time.process_time()
        run = compile_march(*given, period=cases.PERIOD, inner=cases.INNER, outputs=names, engine=engine)
        run(*given)
        compiling, spent = time.perf_counter() - begin, time.process_time() - spent
    call = (lambda r=run, g=given: r(*g)) if engine == "xla" else leaves_of(run, given)
    taken = in_turns({engine: call, "batch": batch_of(muscles, engine)}, rounds)
    return {
        "group": "rig",
        "case": shared,
        "engine": engine,
        "muscles": muscles,
        "dtype": "float64",
        "compile": compiling,
        "compile_processor": spent,
        "vs_batch": taken.ratio(engine, "batch"),
        "rate": muscles * RIG_SAMPLES * cases.INNER / taken.median(engine),
    }


@contextlib.contextmanager
def nothing_kept() -> Iterator[None]:
    """Compile everything anew, and keep nothing on disk."""
    before = os.environ.get("MCKIBBEN_KERNELS")
    os.environ["MCKIBBEN_KERNELS"] = "off"
    try:
        yield
    finally:
        del os.environ["MCKIBBEN_KERNELS"]
        if before is not None:
            os.environ["MCKIBBEN_KERNELS"] = before


def leaves_of(run: Any, given: Any) -> Any:
    """A call without the search for the leaves of the trees."""
    if isinstance(run, CoupledRun):
        given = run.arguments(*given)
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


def main() -> None:
    """Print the machines of many muscles alone."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--muscles", type=int, nargs="+", default=[64, 256, 1000], help="numbers of muscles")
    parser.add_argument("--shared", nargs="+", choices=cases.SHARED, default=cases.SHARED, help="what they share")
    parser.add_argument("--spread", type=float, default=0.0, help="relative spread of masses, viscosities and tubes")
    parser.add_argument("--rounds", type=int, default=7, help="rounds of machine and batch in turns")
    given = parser.parse_args()
    print(f"{'shared':12} {'muscles':>7} {'first step':>10} {'processor':>9} {'ns/muscle-step':>14} {'of a batch':>10}")
    for shared in given.shared:
        for muscles in given.muscles:
            row = rig(shared, muscles, given.rounds, given.spread)
            times = f"{row['compile']:8.2f} s {row['compile_processor']:7.2f} s {1e9 / row['rate']:14.1f}"
            print(f"{shared:12} {muscles:7,} {times} {row['vs_batch']:10.2f}", flush=True)


if __name__ == "__main__":
    main()
