"""D-optimal design by Pyomo.DoE over length and pressure, for slopes that are polynomials of both.

The argument is JSON: `slopes`, derivatives of the prediction to the parameters at each candidate, `places`, length and
pressure of the candidates in the unit square, and `points`, how many readings one design has. Pyomo.DoE searches the places
of all readings at once, where candidates lie. Printed are the `design`, and the largest `error` of the polynomials as a
share of a slope's root mean square. It needs a solver of nonlinear programs; ripopt comes with the package pyomo-ripopt.
"""

import json
import sys

import numpy as np
import pyomo.environ as pyo
import pyomo_ripopt  # noqa: F401 - registers its solver
from pyomo.contrib.doe import DesignOfExperiments

TERMS = ((0, 0), (1, 0), (0, 1), (1, 1), (2, 0), (0, 2), (2, 1), (1, 2))


class Readings:
    """Readings of a tension that is linear in its parameters, at places that are searched."""

    def __init__(self, coefficients, border, start):
        self.coefficients, self.border, self.start = coefficients, border, start

    def get_labeled_model(self):
        m = pyo.ConcreteModel()
        count = range(len(self.start))
        parameters = range(self.coefficients.shape[1])
        m.length = pyo.Var(count, bounds=(0.0, 1.0), initialize=lambda _, i: float(self.start[i][0]))
        m.pressure = pyo.Var(count, bounds=(0.0, 1.0), initialize=lambda _, i: float(self.start[i][1]))
        m.value = pyo.Var(parameters, initialize=1.0)
        m.value.fix()
        m.tension = pyo.Var(count, initialize=1.0)

        def slope(i, j):
            terms = zip(self.coefficients[:, j], TERMS, strict=True)
            return sum(float(c) * m.length[i] ** a * m.pressure[i] ** b for c, (a, b) in terms)

        @m.Constraint(count)
        def prediction(m, i):
            return m.tension[i] == sum(m.value[j] * slope(i, j) for j in parameters)

        @m.Constraint(count)
        def taut(m, i):
            return m.pressure[i] >= sum(float(c) * m.length[i] ** k for k, c in enumerate(self.border))

        m.experiment_inputs = pyo.Suffix(direction=pyo.Suffix.LOCAL)
        m.experiment_inputs.update((v[i], None) for v in (m.length, m.pressure) for i in count)
        m.experiment_outputs = pyo.Suffix(direction=pyo.Suffix.LOCAL)
        m.experiment_outputs.update((m.tension[i], None) for i in count)
        m.measurement_error = pyo.Suffix(direction=pyo.Suffix.LOCAL)
        m.measurement_error.update((m.tension[i], 1.0) for i in count)
        m.unknown_parameters = pyo.Suffix(direction=pyo.Suffix.LOCAL)
        m.unknown_parameters.update((m.value[j], 1.0) for j in parameters)
        return m


def main() -> None:
    given = json.loads(sys.argv[1])
    slopes, places = np.array(given["slopes"]), np.array(given["places"])
    slopes = slopes / np.sqrt(np.mean(slopes**2, axis=0))
    powers = np.stack([places[:, 0] ** a * places[:, 1] ** b for a, b in TERMS], axis=1)
    coefficients = np.linalg.lstsq(powers, slopes, rcond=None)[0]
    lengths = np.unique(places[:, 0])
    lowest = [places[places[:, 0] == length, 1].min() for length in lengths]
    border = np.polynomial.polynomial.polyfit(lengths, lowest, min(2, len(lengths) - 1))
    start = places[np.random.default_rng(0).choice(len(places), given["points"], replace=False)]
    doe = DesignOfExperiments(
        Readings(coefficients, border, start), fd_formula="central", step=1e-3, objective_option="determinant",
        scale_nominal_param_value=True, solver=pyo.SolverFactory("ripopt"), tee=False,
    )  # fmt: skip
    doe.run_doe()
    design = np.array(doe.results["Experiment Design"], float).reshape(2, -1).T
    error = float(np.abs(powers @ coefficients - slopes).max())
    print(json.dumps({"design": design.tolist(), "error": error, "status": str(doe.results["Solver Status"])}))


if __name__ == "__main__":
    main()
