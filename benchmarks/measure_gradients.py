"""Derivatives of whole runs: four forward tangents, and the adjoint of a sum over the path by eight parameters.

Both beside the run itself (the primal) of the same engine, and beside those that the compiler
makes of `jax.jvp` and `jax.value_and_grad` of the same source ("lowered"), and beside JAX's own by XLA.
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
    cost = summed(batch)

    def run(changes: Any, values: Any) -> Any:
        eight = {name: changes[name] for name in ADJOINTS}
        return jax.value_and_grad(lambda moved: cost({**changes, **moved}, values))(eight)

    return run


def summed(batch: cases.Batch) -> Any:
    """The sum of squares of the length's way of one lane."""
    one = batch.one()

    def cost(changes: Any, values: Any) -> Any:
        length, _ = one(changes, values)
        return jnp.sum((length - length[0]) ** 2)

    return cost


def by_xla(name: str, batch: cases.Batch) -> Any:
    """The run, its tangents or the adjoint of all lanes, by JAX itself."""
    function = {"primal": lambda b: b.one(), "tangents": tangents, "adjoint": adjoint}[name](batch)
    compiled, given = jax.jit(jax.vmap(function)), batch.arguments()
    return lambda: jax.block_until_ready(compiled(*given))


def by_native(name: str, batch: cases.Batch) -> Any:
    """The run, its tangents or the adjoint by the library's kernels; results as `by_xla` has them."""
    import lanewise

    one = batch.first(1)
    example = {name: np.asarray(v[0]) for name, v in one.changes.items()}, one.commands[:, :, 0]
    function = summed(batch) if name == "adjoint" else batch.one()
    program, _ = lanewise.lower(function, *example, title=name)
    names = [leaf.name for leaf in program.arguments]
    places = lambda wanted: [names.index(f"[0]['{n}']") for n in wanted]  # noqa: E731
    given = [np.asarray(leaf) for leaf in jax.tree.leaves((batch.changes, batch.commands))]
    if name == "tangents":
        program = lanewise.tangents(program, places(TANGENTS), len(TANGENTS))
        given += list(np.eye(len(TANGENTS)))
    if name == "adjoint":
        program = lanewise.adjoint(program, places(ADJOINTS))
        given.append(np.ones(()))

    def call() -> Any:
        found = [np.moveaxis(x, -1, 0) for x in program.call(given, lanes=batch.lanes, threads=1)]
        if name == "adjoint":
            return found[0], dict(zip(ADJOINTS, found[1:], strict=True))
        return (found[:2], found[2:]) if name == "tangents" else found

    return call


def by_lowering(name: str, batch: cases.Batch) -> Any:
    """The run, or the kernel that the compiler makes of JAX's own derivatives; results as `by_xla` has them."""
    import lanewise

    if name == "primal":
        return by_native(name, batch)
    one = batch.first(1)
    example = {name: np.asarray(v[0]) for name, v in one.changes.items()}, one.commands[:, :, 0]
    function = {"tangents": tangents, "adjoint": adjoint}[name](batch)
    program, tree = lanewise.lower(function, *example, title=name)
    given = [np.asarray(leaf) for leaf in jax.tree.leaves((batch.changes, batch.commands))]

    def call() -> Any:
        found = program.call(given, lanes=batch.lanes, threads=1)
        return jax.tree.unflatten(tree, [np.moveaxis(x, -1, 0) for x in found])

    return call


def measure(quick: bool) -> dict[str, Any]:
    """Both, each with its primal in turns; in a quick run without JAX's own, which compiles for minutes."""
    rows: list[Any] = []
    ratios: dict[str, float] = {}
    notes: list[str] = []
    rounds, samples = (3, 5) if quick else (7, 20)
    makers = {"native": by_native, "lowered": by_lowering} if "native" in ENGINES else {}
    makers |= {} if quick and makers else {"XLA": by_xla}
    for name in ("tangents", "adjoint"):
        lanes = LANES[name] // (8 if quick else 1)
        batch = cases.batch(cases.tube(), lanes, samples)
        runs: dict[str, Any] = {}
        for engine, build in makers.items():
            try:
                both = {f"{engine} primal": build("primal", batch), f"{engine} {name}": build(name, batch)}
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
        for engine, key in (("XLA", "vs_jax"), ("lowered", "vs_lowered")):
            if {f"native {name}", f"{engine} {name}"} <= set(runs):
                ratios[f"{name}_{key}"] = taken.ratio(f"{engine} {name}", f"native {name}")
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
