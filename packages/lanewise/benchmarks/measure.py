"""Compare lanewise with Numba and with JAX's own compilation on equations that everybody knows.

    python benchmarks/measure.py [--quick]

Each equation is integrated by the classical Runge-Kutta method, once alone and once in many lanes, in float64 on one thread.
JAX runs the same function under `jit` and `vmap`; Numba runs the same steps as a loop over lanes, written by hand for it (it
is left out where it is not installed). The times are medians of the processor's time in rounds in which all take turns, so
that a busy machine does not favour one of them; the first call, which compiles, is measured apart.
"""

from __future__ import annotations

import argparse
import os
import statistics
import time
from collections.abc import Callable
from typing import Any

os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
os.environ.setdefault("LANEWISE_CACHE", "off")

import jax
import jax.numpy as jnp
import numpy as np

import lanewise

try:
    import numba
except ImportError:
    numba = None

jax.config.update("jax_enable_x64", True)
STEPS, LANES, ROUNDS = {"alone": 100_000, "in lanes": 1000}, 4096, 7


# ---- equations: rates of a state, as tuples, for JAX and for Numba alike


def lorenz(s: Any, p: Any) -> Any:
    """The Lorenz system; p is its largest parameter, rho."""
    x, y, z = s
    return 10.0 * (y - x), x * (p - z) - y, x * y - 8.0 / 3.0 * z


def van_der_pol(s: Any, p: Any) -> Any:
    """The van der Pol oscillator; p is its damping."""
    x, v = s
    return v, p * (1.0 - x * x) * v - x


def kepler(s: Any, p: Any) -> Any:
    """A planet in a plane; p is the attraction of its sun."""
    x, y, u, v = s
    square = x * x + y * y
    pull = p / (square * square**0.5)
    return u, v, -pull * x, -pull * y


EQUATIONS: dict[str, tuple[Callable[..., Any], tuple[float, ...], float, tuple[float, float]]] = {
    "Lorenz": (lorenz, (1.0, 1.0, 20.0), 0.002, (24.0, 32.0)),
    "van der Pol": (van_der_pol, (2.0, 0.0), 0.005, (0.5, 4.0)),
    "Kepler": (kepler, (1.0, 0.0, 0.0, 0.9), 0.005, (0.9, 1.1)),
}


def integrated(rates: Callable[..., Any], h: float, steps: int) -> Callable[..., Any]:
    """The state after a number of steps, as a JAX function of (state, parameter)."""

    def ahead(s: Any, k: Any, by: float) -> Any:
        return tuple(a + by * b for a, b in zip(s, k, strict=True))

    def step(_: Any, carry: Any) -> Any:
        s, p = carry
        a = rates(s, p)
        b = rates(ahead(s, a, 0.5 * h), p)
        c = rates(ahead(s, b, 0.5 * h), p)
        d = rates(ahead(s, c, h), p)
        slopes = zip(a, b, c, d, strict=True)
        change = tuple(w + 2.0 * x + 2.0 * y + z for w, x, y, z in slopes)
        return ahead(s, change, h / 6.0), p

    return lambda s, p: jax.lax.fori_loop(0, steps, step, (s, p))[0]


NUMBA_LOOP = """
@numba.njit(fastmath={{"contract"}}, error_model="numpy")
def run(start, parameters, h, steps):
    out = np.empty(({n}, parameters.size))
    for lane in range(parameters.size):
        p = parameters[lane]
        {s} = {start}
        for _ in range(steps):
            {a} = rates(({s}), p)
            {b} = rates(({sa}), p)
            {c} = rates(({sb}), p)
            {d} = rates(({sc}), p)
            {update}
        {store}
    return out
"""


def by_numba(rates: Callable[..., Any], start: tuple[float, ...], h: float, steps: int) -> Callable[..., Any]:
    """The same steps with all values in variables of their own, as Numba compiles them best."""
    n = range(len(start))
    listed = lambda word: ", ".join(f"{word}{i}" for i in n)  # noqa: E731
    ahead = lambda word, by: ", ".join(f"s{i} + {by} * h * {word}{i}" for i in n)  # noqa: E731
    text = NUMBA_LOOP.format(
        n=len(start), s=listed("s"), start=", ".join(f"start[{i}]" for i in n), a=listed("a"), b=listed("b"),
        c=listed("c"), d=listed("d"), sa=ahead("a", 0.5), sb=ahead("b", 0.5), sc=ahead("c", 1.0),
        update="; ".join(f"s{i} += h / 6.0 * (a{i} + 2.0 * b{i} + 2.0 * c{i} + d{i})" for i in n),
        store="; ".join(f"out[{i}, lane] = s{i}" for i in n),
    )  # fmt: skip
    names: dict[str, Any] = {"numba": numba, "np": np, "rates": numba.njit(rates)}
    exec(text, names)  # noqa: S102 - the text stands above
    return lambda parameters: names["run"](np.asarray(start), np.atleast_1d(parameters), h, steps)


def steps_of(lanes: int) -> int:
    """A lane alone takes more steps, so that its time is not that of the call."""
    return STEPS["alone" if lanes == 1 else "in lanes"]


def ways(name: str, lanes: int) -> dict[str, Callable[[], np.ndarray]]:
    """Each way to integrate an equation, ready to be called."""
    rates, start, h, (low, high) = EQUATIONS[name]
    steps = steps_of(lanes)
    function, state = integrated(rates, h, steps), tuple(map(np.asarray, start))
    parameters = np.linspace(low, high, lanes) if lanes > 1 else np.asarray(0.5 * (low + high))
    compiled = lanewise.compile(function, state, 1.0, engine="native", title=name)
    many = {"lanes": lanes} if lanes > 1 else {}
    made = {"lanewise": lambda: np.array(compiled(state, parameters, threads=1, **many))}
    by_jax = jax.jit(jax.vmap(function, (None, 0)) if lanes > 1 else function)
    made["JAX"] = lambda: np.array(jax.block_until_ready(by_jax(state, jnp.asarray(parameters))))
    if numba is not None:
        run = by_numba(rates, start, h, steps)
        made["Numba"] = lambda: run(parameters).reshape(len(start), *np.shape(parameters))
    return made


def measure(name: str, lanes: int, rounds: int) -> None:
    """Print a row for each way: seconds of the first call, steps of a lane per second, and the ratio to lanewise."""
    first, times = {}, {}
    runs = ways(name, lanes)
    results = {}
    for way, run in runs.items():
        begin = time.process_time()
        results[way] = run()
        first[way], times[way] = time.process_time() - begin, []
    # 1,000 steps of rounding; only Lorenz amplifies it, by a factor of some 1e3 in this time, and without end when alone
    for way, result in results.items() if lanes > 1 else ():
        np.testing.assert_allclose(result, results["lanewise"], rtol=1e-7, atol=1e-7, err_msg=f"{name} by {way}")
    for _ in range(rounds):
        for way, run in runs.items():
            begin = time.process_time()
            run()
            times[way].append(time.process_time() - begin)
    ours = statistics.median(times["lanewise"])
    for way, taken in times.items():
        rate = lanes * steps_of(lanes) / statistics.median(taken)
        ratio = statistics.median(taken) / ours
        print(f"| {name} | {lanes} | {way} | {first[way]:.2f} | {rate / 1e6:,.1f} | {ratio:.2f} |", flush=True)


def main() -> None:
    """Print a table of all equations, alone and in lanes."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="Fewer lanes and rounds")
    quick = parser.parse_args().quick
    print("| equation | lanes | by | first call [s] | million steps per second | time over lanewise |")
    print("|---|---|---|---|---|---|")
    for name in EQUATIONS:
        for lanes in (1, LANES // 8 if quick else LANES):
            measure(name, lanes, 3 if quick else ROUNDS)


if __name__ == "__main__":
    main()
