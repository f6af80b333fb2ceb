"""The first result of a fresh process, run by `measure_startup`: what stands on the command line, a line of JSON with times.

python startup.py machine xla|native     build the machine, compile, run one muscle for 2 s
python startup.py saved FILE INPUTS      run a saved program on its inputs, without JAX
"""

import json
import sys
import time

BEGIN = time.perf_counter()


def machine(engine: str) -> dict[str, float]:
    import jax  # noqa: F401
    import jax.numpy  # noqa: F401

    imported, spent = time.perf_counter(), time.process_time()
    import cases
    import engines

    batch = cases.batch(cases.tube(), 1, 2000)
    built = time.perf_counter()
    length, _ = (engines.native if engine == "native" else engines.xla)(batch)()
    done = time.perf_counter()
    cpu = time.process_time() - spent
    return {
        "jax": imported - BEGIN,
        "built": built - imported,
        "beyond": done - imported,
        "cpu": cpu,
        "last": float(length[-1, 0]),
    }


def saved(path: str, inputs: str) -> dict[str, float]:
    import numpy as np

    from lanewise import Program

    with np.load(inputs) as known:
        given = [known[f"{i:04d}"] for i in range(len(known.files))]
    found = Program.load(path).call(given, threads=1)
    done = time.perf_counter()
    if "jax" in sys.modules:
        raise SystemExit("JAX was imported")
    return {"beyond": done - BEGIN, "cpu": time.process_time(), "last": float(found[0][-1])}


if __name__ == "__main__":
    print(json.dumps(machine(sys.argv[2]) if sys.argv[1] == "machine" else saved(*sys.argv[2:])))
