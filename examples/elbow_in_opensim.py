"""An elbow in OpenSim with a pneumatic muscle beside its brachialis, and OpenSim's own McKibben actuator when it is slack.

    python examples/elbow_in_opensim.py [--out FOLDER]

Needs OpenSim: pip install 'mckibben[opensim]'. A reflex lifts a load of 1 kg from 45 to 90 degrees by the brachialis, while
a pneumatic muscle with a regulator pulls beside it at 0, 2.5 or 5 bar. Path, length and strength of the brachialis are those
of the model Arm26 (K. R. S. Holzbaur et al., A Model of the Upper Extremity for Simulating Musculoskeletal Surgery and
Analyzing Neuromuscular Control, Annals of Biomedical Engineering 33, 2005, 829-840); forearm and load are round numbers.
"""

from __future__ import annotations

import argparse
from pathlib import Path
from typing import NamedTuple

import numpy as np
import opensim

import mckibben as mk
from mckibben_hosts import Part
from mckibben_hosts.opensim import CoSimulation, actuator_tensions

PERIOD, COUNT, LIFT = 1e-3, 2500, 1.0  # step [s], steps, and the moment at which the elbow is asked to go up [s]
LOW, HIGH = np.radians(45.0), np.radians(90.0)
PRESSURES = (0.0, 2.5e5, 5e5)  # of the regulator, gauge [Pa]
ANCHOR, HOLD = (0.028, -0.1796, 0.0), (0.0, -0.04, 0.0)  # of the pneumatic muscle on upper arm and forearm [m]
ELBOW = (0.0061, -0.2904, 0.0)
NYLON = {
    "thread_length": 0.1642,
    "number_of_turns": 3.1485976,
}  # of the braid, as specimen nylon infers them for the ideal law
HELD = 5e5  # gauge pressure at which the two actuators are compared [Pa]


class ElbowRun(NamedTuple):
    """Time [s], angle [rad], force of the brachialis [N], pneumatic tension [N] and excitation, each (steps,)."""

    time: np.ndarray
    angle: np.ndarray
    brachialis: np.ndarray
    tension: np.ndarray
    excitation: np.ndarray


def vector(values: tuple[float, float, float]) -> opensim.Vec3:
    """A vector of OpenSim."""
    return opensim.Vec3(*values)


def elbow() -> opensim.Model:
    """An upper arm that is fixed, a forearm with a load in its hand, a brachialis, and a path for a pneumatic muscle."""
    model = opensim.Model()
    model.setName("elbow")
    ground, zero = model.getGround(), opensim.Vec3(0.0)
    forearm = opensim.Body("forearm", 1.5, opensim.Vec3(0.0, -0.18, 0.0), opensim.Inertia(0.02, 0.002, 0.02))
    load = opensim.Body("load", 1.0, zero, opensim.Inertia(1e-3, 1e-3, 1e-3))
    model.addBody(forearm)
    model.addBody(load)
    hinge = opensim.PinJoint("elbow", ground, vector(ELBOW), zero, forearm, zero, zero)
    flexion = hinge.updCoordinate()
    flexion.setName("flexion")
    flexion.setDefaultValue(LOW)
    model.addJoint(hinge)
    model.addJoint(opensim.WeldJoint("hand", forearm, opensim.Vec3(0.0, -0.3, 0.0), zero, load, zero, zero))
    brachialis = opensim.Thelen2003Muscle("brachialis", 987.26, 0.0858, 0.0535, 0.0)
    brachialis.addNewPathPoint("origin", ground, opensim.Vec3(0.0068, -0.1739, 0.0))
    brachialis.addNewPathPoint("insertion", forearm, opensim.Vec3(-0.0032, -0.0239, 0.0))
    model.addForce(brachialis)
    beside = opensim.PathActuator()
    beside.setName("pneumatic")
    beside.addNewPathPoint("anchor", ground, vector(ANCHOR))
    beside.addNewPathPoint("hold", forearm, vector(HOLD))
    model.addForce(beside)
    reflex = opensim.PrescribedController()
    reflex.setName("reflex")
    reflex.addActuator(brachialis)
    reflex.prescribeControlForActuator("brachialis", opensim.Constant(0.1))
    model.addController(reflex)
    model.finalizeConnections()
    return model


def lift(part: Part, pressure: float) -> ElbowRun:
    """The elbow lifted by the reflex while the regulator holds a gauge pressure [Pa]."""
    model = elbow()
    state = model.initSystem()
    model.equilibrateMuscles(state)
    both = CoSimulation(model, part, {"muscle": "pneumatic"}, period=PERIOD, start=state)
    controller = opensim.PrescribedController.safeDownCast(model.updControllerSet().get("reflex"))
    control = opensim.Constant.safeDownCast(controller.upd_ControlFunctions().get(0))
    muscle = opensim.Muscle.safeDownCast(model.updForceSet().get("brachialis"))
    rows, gathered = [], 0.3
    for k in range(COUNT):
        angle, rate = both.state.getQ().get(0), both.state.getU().get(0)
        wanted = LOW + (HIGH - LOW) * min(1.0, max(0.0, (k * PERIOD - LIFT) / 0.5))
        gathered = min(1.0, max(0.0, gathered + 6.0 * PERIOD * (wanted - angle)))
        excitation = min(1.0, max(0.01, gathered + 1.5 * (wanted - angle) - 0.15 * rate))
        control.setValue(excitation)
        seen = both.step(muscle=pressure)
        model.realizeDynamics(both.state)
        rows.append((k * PERIOD, angle, muscle.getTendonForce(both.state), seen.tension, excitation))
    return ElbowRun(*np.array(rows).T)


def draw(runs: dict[float, ElbowRun], lengths: np.ndarray, theirs: np.ndarray, ours: np.ndarray, folder: Path) -> None:
    """Write the figure: angle, brachialis and pneumatic muscle over time, and forces of both actuators over length."""
    import matplotlib.pyplot as plt

    with mk.figure_style("screen"):
        figure, axes = plt.subplots(2, 2, figsize=(7.2, 4.8), layout="constrained")
        for pressure, run in runs.items():
            label = f"{pressure / 1e5:g} bar"
            axes[0, 0].plot(run.time, np.degrees(run.angle), label=label)
            axes[0, 1].plot(run.time, run.brachialis, label=label)
            axes[1, 0].plot(run.time, run.tension, label=label)
        axes[1, 1].plot(1e3 * lengths, theirs, label="OpenSim's actuator")
        axes[1, 1].plot(1e3 * lengths, ours, label="this package")
        axes[1, 1].axhline(0.0, color="0.5", lw=0.8)
        axes[0, 0].set(xlabel="time (s)", ylabel="flexion (deg)")
        axes[0, 1].set(xlabel="time (s)", ylabel="brachialis (N)", ylim=(0.0, None))
        axes[1, 0].set(xlabel="time (s)", ylabel="pneumatic muscle (N)", ylim=(0.0, None))
        axes[1, 1].set(xlabel="length (mm)", ylabel="tension at 5 bar (N)")
        axes[0, 0].legend()
        axes[1, 1].legend()
        mk.save_figure(figure, folder / "elbow-in-opensim.svg")


def main(folder: Path) -> None:
    """Lift the elbow at three pressures, compare both actuators, print a table, and draw both."""
    opensim.Logger.removeFileSink()
    opensim.Logger.setLevelString("error")
    part = Part("nylon", mk.Air(supply="6 bar", valve="regulator"), span=0.139)
    runs = {pressure: lift(part, pressure) for pressure in PRESSURES}
    print("regulator   brachialis at 45 deg   at 90 deg   pneumatic muscle at 45 deg   at 90 deg   highest excitation")
    for pressure, run in runs.items():
        low, high = (run.time > 0.8) & (run.time < LIFT), run.time > 2.2
        print(
            f"{pressure / 1e5:5.1f} bar   {run.brachialis[low].mean():16.0f} N {run.brachialis[high].mean():11.0f} N "
            f"{run.tension[low].mean():20.0f} N {run.tension[high].mean():16.0f} N {run.excitation.max():15.2f}"
        )
    lengths = np.linspace(0.06, 0.15, 46)
    theirs = np.array(
        actuator_tensions(lengths, thread_length=NYLON["thread_length"], turns=NYLON["number_of_turns"], pressure=HELD)
    )
    filled = Part("nylon", mk.Air(supply="6 bar"), span=0.139, pressure=HELD)
    ours = np.array([filled.observe(filled.rest(span), span=span).tension for span in lengths])
    for place in (0, 15, 25, 40):
        print(
            f"at {1e3 * lengths[place]:.0f} mm and 5 bar: OpenSim's actuator {theirs[place]:.1f} N, ours {ours[place]:.1f} N"
        )
    draw(runs, lengths, theirs, ours, folder)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="An elbow in OpenSim with a pneumatic muscle beside its brachialis.")
    parser.add_argument("--out", type=Path, default=Path("out"), help="Folder of the figure")
    options = parser.parse_args()
    options.out.mkdir(exist_ok=True)
    main(options.out)
