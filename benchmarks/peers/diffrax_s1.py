"""diffrax on the yardstick S1: Tsit5 with its own steps, one muscle for 10 s and a batch of 1,024 for 0.2 s.

The right-hand side is written here in plain JAX, with the exact root. Errors are of the contraction along the path, over its
range, against the reference in the file that is named.
"""

import json
import statistics
import sys
import time

import jax

jax.config.update("jax_enable_x64", True)

import diffrax  # noqa: E402
import jax.numpy as jnp  # noqa: E402
import numpy as np  # noqa: E402


def rate(t, y, n):
    x, v, p = y
    length = n["rest"] - x
    per_turn = 1.0 / (4.0 * jnp.pi * n["turns"] ** 2)
    volume = length * (n["thread"] ** 2 - length**2) * per_turn
    per_length = (n["thread"] ** 2 - 3.0 * length**2) * per_turn
    u = jnp.sin(2.0 * jnp.pi * t)
    a, b = jnp.where(u >= 0.0, n["supply"], p), jnp.where(u >= 0.0, p, n["room"])
    ratio = jnp.minimum(a, b) / jnp.maximum(a, b)
    square = 1.0 - (jnp.maximum(ratio - n["ratio"], 0.0) / (1.0 - n["ratio"])) ** 2
    psi = jnp.where(square > 1e-12, jnp.sqrt(jnp.maximum(square, 1e-12)), 0.0)
    w = jnp.sign(a - b) * u * n["conductance"] * n["density"] * jnp.maximum(a, b) * psi
    push = (n["room"] - p) * per_length - n["damping"] * v + n["stop"] * jnp.maximum(-x, 0.0)
    filling = n["gas_constant"] * n["temperature"] * w + p * per_length * v
    return v, push / n["mass"] - n["gravity"], n["exponent"] * filling / volume


def solve(n, times, tolerance):
    start = tuple(jnp.asarray(v) for v in (0.0, 0.0, n["room"] + 1000.0))
    control = diffrax.PIDController(rtol=tolerance, atol=tolerance * 1e-3)
    found = diffrax.diffeqsolve(
        diffrax.ODETerm(rate), diffrax.Tsit5(), 0.0, times[-1], 1e-4, start, n, saveat=diffrax.SaveAt(ts=times),
        stepsize_controller=control, max_steps=None, adjoint=diffrax.ForwardMode(),
    )  # fmt: skip
    return found.ys[0], found.stats["num_steps"]


def main() -> None:
    given = json.loads(sys.argv[1])
    repeats, numbers = given["repeats"], {k: jnp.asarray(v) for k, v in given["numbers"].items()}
    known = np.load(given["reference"])
    rows = []
    for tolerance in given["tolerances"]:
        one = jax.jit(lambda n, t, tol=tolerance: solve(n, t, tol))
        times = jnp.asarray(known["time"])
        x, steps = one(numbers, times)
        error = float(np.abs(np.asarray(x) - known["contraction"]).max() / np.ptp(known["contraction"]))
        spent = []
        for _ in range(repeats):
            begin = time.process_time()
            jax.block_until_ready(one(numbers, times))
            spent.append(time.process_time() - begin)
        row = {"program": f"diffrax {diffrax.__version__}", "case": "S1, one muscle", "states": 3, "dtype": "float64"}
        row |= {"setting": f"Tsit5, {tolerance:g}", "real_time": float(times[-1]) / statistics.median(spent)}
        rows.append(row | {"steps": int(steps), "error": error})
    lanes = 1024
    many = jax.jit(jax.vmap(lambda c: solve({**numbers, "conductance": c}, jnp.linspace(0.0, 0.2, 201), 1e-6)))
    sizes = numbers["conductance"] * (1.0 + 0.03 * jnp.linspace(-1.0, 1.0, lanes))
    _, steps = many(sizes)
    spent = []
    for _ in range(repeats):
        begin = time.process_time()
        jax.block_until_ready(many(sizes))
        spent.append(time.process_time() - begin)
    rows.append({
        "program": f"diffrax {diffrax.__version__}", "case": "S1, batch of 1,024", "setting": "Tsit5, 1e-06", "states": 3,
        "dtype": "float64", "rate": float(np.sum(np.asarray(steps))) / statistics.median(spent),
        "real_time": 0.2 * lanes / statistics.median(spent),
    })  # fmt: skip
    print(json.dumps({"rows": rows}))


if __name__ == "__main__":
    main()
