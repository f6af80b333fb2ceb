"""Derivatives of whole runs: four forward tangents, and the adjoint of a sum over the path by eight parameters.

Both beside the run itself (the primal) of the same engine, and beside JAX's own of the same source.
"""

from __future__ import annotations

from typing import Any

import cases
import jax
import jax.numpy as jnp
import numpy as np
from compiled_c import Kernel
from engines import ENGINES
from timing import in_turns

TANGENTS = ("mass", "limit", "threshold", "tube_length")
ADJOINTS = (*TANGENTS, "per_pressure", "shortest", "viscosity", "turbulent")
LANES = {"tangents": 1024, "adjoint": 256}


def tangents(batch: cases.Batch) -> Any:
    """Both outputs, and their derivatives by four parameters, of one lane: a function of (changes, values)."""
    one = batch.one()

    def run(changes: Any, values: Any) -> Any:
        def moved(four: Any) -> Any:
            return one({**changes, **four}, values)

        four = {name: changes[name] for name in TANGENTS}
        units = {name: np.eye(len(TANGENTS))[i] for i, name in enumerate(TANGENTS)}
        push = lambda unit: jax.jvp(moved, (four,), (unit,))  # noqa: E731
        return jax.vmap(push, in_axes=0, out_axes=(None, 0))(units)

    return run


def adjoint(batch: cases.Batch) -> Any:
    """The sum of squares of the length's way, and its derivatives by eight parameters, of one lane."""
    one = batch.one()

    def run(changes: Any, values: Any) -> Any:
        def cost(eight: Any) -> Any:
            length, _ = one({**changes, **eight}, values)
            return jnp.sum((length - length[0]) ** 2)

        return jax.value_and_grad(cost)({name: changes[name] for name in ADJOINTS})

    return run


def by_xla(function: Any, batch: cases.Batch) -> Any:
    """A function of one lane over all of them, by JAX itself."""
    compiled, given = jax.jit(jax.vmap(function)), batch.arguments()
    return lambda: jax.block_until_ready(compiled(*given))


def by_native(function: Any, batch: cases.Batch) -> Any:
    """The same by the library's kernels."""
    from mckibben.engine.native import compiled

    one = batch.first(1)
    example = {name: np.asarray(v[0]) for name, v in one.changes.items()}, one.commands[:, :, 0]
    run = compiled(function, *example, engine="native")
    leaves = [np.asarray(leaf) for leaf in jax.tree.leaves((batch.changes, batch.commands))]
    structure = jax.tree.structure(jax.eval_shape(function, *example))

    def call() -> Any:
        found = jax.tree.unflatten(structure, run.program.call(leaves, lanes=batch.lanes, threads=1))
        return jax.tree.map(lambda x: np.moveaxis(x, -1, 0), found)

    return call


def measure(quick: bool) -> dict[str, Any]:
    """Both, each with its primal in turns; in a quick run without JAX's own, which compiles for minutes."""
    rows: list[Any] = []
    ratios: dict[str, float] = {}
    notes: list[str] = []
    rounds, samples = (3, 5) if quick else (7, 20)
    makers = {"native": by_native} if "native" in ENGINES else {}
    makers |= {} if quick and makers else {"XLA": by_xla}
    for name, make in (("tangents", tangents), ("adjoint", adjoint)):
        lanes = LANES[name] // (8 if quick else 1)
        batch = cases.batch(cases.tube(), lanes, samples)
        runs: dict[str, Any] = {}
        for engine, build in makers.items():
            try:
                both = {f"{engine} primal": build(batch.one(), batch), f"{engine} {name}": build(make(batch), batch)}
                for run in both.values():
                    run()
                runs |= both
            except Exception as problem:  # what one engine cannot do yet is said, and the other is measured
                notes.append(f"{name} by {engine}: {type(problem).__name__}: {problem}")
        taken = in_turns(runs, rounds)
        steps = lanes * samples * cases.INNER
        for engine in makers:
            if f"{engine} {name}" in runs:
                key = f"{name}_{engine.lower()}"
                ratios[key] = taken.ratio(f"{engine} {name}", f"{engine} primal")
                rows.append(
                    {
                        "group": "gradients",
                        "case": name,
                        "engine": engine,
                        "lanes": lanes,
                        "dtype": "float64",
                        "rate": steps / taken.median(f"{engine} {name}"),
                        "vs_primal": ratios[key],
                        "error": checked(name, batch, runs[f"{engine} {name}"]),
                    }
                )
        if {f"native {name}", f"XLA {name}"} <= set(runs):
            ratios[f"{name}_vs_jax"] = taken.ratio(f"XLA {name}", f"native {name}")
    return {"rows": rows, "gradients": ratios, "notes": notes}


def checked(name: str, batch: cases.Batch, run: Any) -> float:
    """Largest deviation of a derivative by the mass from central differences, over its largest value."""
    step = 1e-5
    ends = []
    for sign in (1.0, -1.0):
        changes = {**batch.changes, "mass": batch.changes["mass"] * (1.0 + sign * step)}
        shifted = cases.Batch(batch.case, changes, batch.commands)
        ends.append(Kernel("muscle").prepared(shifted, cases.INNER, cases.PERIOD)()[0].T.copy())
    found = run()
    width = 2.0 * step * batch.changes["mass"]
    if name == "adjoint":
        ends = [((e - e[:, :1]) ** 2).sum(axis=1) for e in ends]
        own, rough = np.asarray(found[1]["mass"]), (ends[0] - ends[1]) / width
    else:
        order = TANGENTS.index("mass")
        own, rough = np.asarray(found[1][0][:, order]), (ends[0] - ends[1]) / width[:, None]
    return float(np.abs(own - rough).max() / np.abs(rough).max())
