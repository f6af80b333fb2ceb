"""CVODES of SUNDIALS on the yardstick S1, one muscle for 10 s at several tolerances, as CasADi brings and calls it.

The right-hand side is written here in CasADi's symbols, with the exact root and states of the size of one; its Jacobian is
CasADi's. Errors are of the contraction along the path, over its range, against the reference in the file that is named.
"""

import json
import statistics
import sys
import time

import casadi as ca
import numpy as np

SIZE = np.array([1e-2, 1e-1, 1e5])  # of contraction [m], its rate [m/s] and pressure [Pa]
METHODS = {"BDF": "bdf", "Adams": "adams"}


def system(n):
    """The equations of S1 for scaled states."""
    y, t = ca.SX.sym("y", 3), ca.SX.sym("t")
    x, v, p = ca.vertsplit(y * SIZE)
    length = n["rest"] - x
    per_turn = 1.0 / (4.0 * np.pi * n["turns"] ** 2)
    volume = length * (n["thread"] ** 2 - length**2) * per_turn
    per_length = (n["thread"] ** 2 - 3.0 * length**2) * per_turn
    u = ca.sin(2.0 * np.pi * t)
    a, b = ca.if_else(u >= 0.0, n["supply"], p), ca.if_else(u >= 0.0, p, n["room"])
    ratio = ca.fmin(a, b) / ca.fmax(a, b)
    square = 1.0 - (ca.fmax(ratio - n["ratio"], 0.0) / (1.0 - n["ratio"])) ** 2
    psi = ca.if_else(square > 1e-12, ca.sqrt(ca.fmax(square, 1e-12)), 0.0)
    w = ca.sign(a - b) * u * n["conductance"] * n["density"] * ca.fmax(a, b) * psi
    push = (n["room"] - p) * per_length - n["damping"] * v + n["stop"] * ca.fmax(-x, 0.0)
    filling = n["gas_constant"] * n["temperature"] * w + p * per_length * v
    rates = ca.vertcat(v, push / n["mass"] - n["gravity"], n["exponent"] * filling / volume)
    return {"x": y, "t": t, "ode": rates / SIZE}


def main() -> None:
    given = json.loads(sys.argv[1])
    known = np.load(given["reference"])
    times, exact = known["time"], known["contraction"]
    start = np.array([0.0, 0.0, given["numbers"]["room"] + 1000.0]) / SIZE
    rows = []
    for name, method in METHODS.items():
        for tolerance in given["tolerances"]:
            options = {"reltol": tolerance, "abstol": 1e-3 * tolerance, "linear_multistep_method": method}
            options |= {"max_num_steps": 1_000_000, "error_on_fail": True}
            run = ca.integrator("run", "cvodes", system(given["numbers"]), 0.0, times[1:], options)
            x = np.array(run(x0=start)["xf"])[0] * SIZE[0]
            spent = []
            for _ in range(given["repeats"]):
                begin = time.process_time()
                run(x0=start)
                spent.append(time.process_time() - begin)
            rows.append({
                "program": f"CVODES of SUNDIALS in CasADi {ca.__version__}", "case": "S1, one muscle", "states": 3,
                "dtype": "float64", "setting": f"{name}, {tolerance:g}",
                "real_time": float(times[-1]) / statistics.median(spent),
                "error": float(np.abs(x - exact[1:]).max() / np.ptp(exact)),
            })  # fmt: skip
    print(json.dumps({"rows": rows}))


if __name__ == "__main__":
    main()
