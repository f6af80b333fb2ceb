"""OpenSim's McKibbenActuator: a mass with spring and damper, a control of 2 Hz, its default integrator.

The actuator is a static law of pressure and length: no gas, no friction. Errors are against an accuracy of 1e-9.
"""

import json
import statistics
import sys
import time

import numpy as np
import opensim

DURATION, SAMPLE = 10.0, 0.02


def model() -> "opensim.Model":
    """A block that a muscle of 0.2 m pulls from the ground."""
    opensim.Logger.setLevelString("Off")
    made = opensim.Model()
    made.setGravity(opensim.Vec3(0))
    body = opensim.Body("block", 2.0, opensim.Vec3(0), opensim.Inertia(0.01))
    made.addBody(body)
    joint = opensim.SliderJoint("slide", made.getGround(), body)
    coordinate = joint.updCoordinate()
    coordinate.setName("x")
    coordinate.setDefaultValue(0.2)
    made.addJoint(joint)
    # thread of 0.22 m, 1.5 turns; the block pulls it long by a spring
    muscle = opensim.McKibbenActuator("muscle", 1.5, 0.22)
    muscle.set_cord_length(0.0)
    path = opensim.GeometryPath() if not hasattr(muscle, "updGeometryPath") else None
    if path is None:
        muscle.updGeometryPath().appendNewPathPoint("a", made.getGround(), opensim.Vec3(0))
        muscle.updGeometryPath().appendNewPathPoint("b", body, opensim.Vec3(0))
    else:
        path.appendNewPathPoint("a", made.getGround(), opensim.Vec3(0))
        path.appendNewPathPoint("b", body, opensim.Vec3(0))
        muscle.set_path(path)
    made.addForce(muscle)
    made.addForce(opensim.SpringGeneralizedForce("x"))
    spring = opensim.SpringGeneralizedForce.safeDownCast(made.updForceSet().get(1))
    spring.setStiffness(1500.0)
    spring.setRestLength(0.21)
    spring.setViscosity(20.0)
    control = opensim.PrescribedController()
    control.addActuator(muscle)
    control.prescribeControlForActuator("muscle", opensim.Sine(1e5, 4.0 * np.pi, 0.0, 2e5))
    made.addController(control)
    return made


def run(accuracy: float) -> tuple[np.ndarray, float]:
    """Position at the samples, and seconds."""
    made = model()
    state = made.initSystem()
    made.equilibrateMuscles(state)
    manager = opensim.Manager(made)
    manager.setIntegratorAccuracy(accuracy)
    manager.initialize(state)
    places = []
    begin = time.process_time()
    for i in range(1, round(DURATION / SAMPLE) + 1):
        state = manager.integrate(i * SAMPLE)
        places.append(made.getCoordinateSet().get(0).getValue(state))
    spent = time.process_time() - begin
    return np.array(places), spent


def main() -> None:
    repeats = int(sys.argv[1]) if len(sys.argv) > 1 else 5
    exact, rows = run(1e-9)[0], []
    for accuracy in (1e-3, 1e-5):
        found = run(accuracy)[0]
        spent = statistics.median(run(accuracy)[1] for _ in range(repeats))
        rows.append({
            "program": f"OpenSim {opensim.GetVersion()}", "case": "McKibbenActuator, mass, spring, damper", "states": 2,
            "setting": f"accuracy {accuracy:g}", "dtype": "float64", "real_time": DURATION / spent,
            "error": float(np.abs(found - exact).max() / np.ptp(exact)),
        })  # fmt: skip
    print(json.dumps({"rows": rows}))


if __name__ == "__main__":
    main()
