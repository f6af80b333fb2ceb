"""D-optimal design by pydex over candidates whose predictions are linear in the parameters.

The argument is JSON: `slopes`, derivatives of the prediction to the parameters at each candidate, and `count`, of the
readings. Printed are `weights` of the candidates in the continuous design, and `readings` at each of them.
"""

import json
import sys

import numpy as np
from pydex.core.designer import Designer


def main() -> None:
    given = json.loads(sys.argv[1])
    slopes = np.array(given["slopes"])
    slopes /= np.sqrt(np.mean(slopes**2, axis=0))  # an optimal design does not depend on the units of the parameters

    def predict(ti_controls, model_parameters):
        return np.array([slopes[round(float(ti_controls[0]))] @ model_parameters])

    designer = Designer()
    designer.simulate = predict
    designer.ti_controls_candidates = np.arange(len(slopes), dtype=float)[:, None]
    designer.model_parameters = np.ones(slopes.shape[1])
    designer.initialize(verbose=0)
    designer.design_experiment(criterion=designer.d_opt_criterion, package="cvxpy", optimizer="CLARABEL")
    weights = np.maximum(np.asarray(designer.efforts, float).ravel(), 0.0)
    designer.apportion(given["count"])
    readings = np.zeros(len(slopes), int)
    for candidate, number in zip(designer.optimal_candidates, np.ravel(designer.apportionments), strict=True):
        readings[candidate[0]] = int(number)
    print(json.dumps({"weights": weights.tolist(), "readings": readings.tolist()}))


if __name__ == "__main__":
    main()
