"""OpenSim as `mckibben conform` sees it: a path between points on a slider, or two of constant moment arms on a hinge."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..extras import library
from ..muscles import Muscle
from ..muscles.laws.ideal import Ideal
from .adapters import HostAdapter, HostedMechanism, OwnActuator, PartReadings
from .opensim import CoSimulation, actuator_tensions
from .part import Part
from .scenarios import HostMoment, Scenario

ACCURACY = 1e-9  # of OpenSim's integrator, so that the errors are those of the coupling
SLACK_SPAN, SLACK_PRESSURE = 0.15, 5e5  # where a braid that is free at 17.3 cm is slack [m], [Pa]
TO_LARGER_POSITIONS = "outside"  # name of the actuator by which load and force act


def _opensim() -> Any:
    return library("opensim", "The host opensim needs")


def _model(scenario: Scenario) -> Any:
    """The model of a scenario: a mass on a slider at the end of a path, or a hinge with paths of constant moment arms."""
    osim, mechanism = _opensim(), scenario.mechanism
    model = osim.Model()
    model.setName(scenario.name)
    model.setGravity(osim.Vec3(0.0))
    inertia = mechanism.inertia if mechanism.rotary else 1.0
    mass = 1.0 if mechanism.rotary else mechanism.inertia
    body = osim.Body("load", mass, osim.Vec3(0.0), osim.Inertia(inertia, inertia, inertia))
    model.addBody(body)
    zero, ground = osim.Vec3(0.0), model.getGround()
    if mechanism.rotary:
        joint = osim.PinJoint("joint", ground, zero, zero, body, zero, zero)
    else:
        joint = osim.SliderJoint("joint", ground, zero, zero, body, zero, zero)
    coordinate = joint.updCoordinate()
    coordinate.setName("q")
    coordinate.setDefaultValue(mechanism.start)
    model.addJoint(joint)
    for name, arm in mechanism.arms.items():
        actuator = osim.PathActuator()
        actuator.setName(name)
        if mechanism.rotary:
            path, names = osim.FunctionBasedPath(), osim.StdVectorString()
            names.append("/jointset/joint/q")
            path.setCoordinatePaths(names)
            line = osim.Vector.createFromMat(np.array([mechanism.spans[name], -arm]))
            path.setLengthFunction(osim.MultivariatePolynomialFunction(line, 1, 1))
            actuator.set_path(path)
        else:
            actuator.addNewPathPoint("anchor", ground, zero)
            actuator.addNewPathPoint("hook", body, zero)
        model.addForce(actuator)
    outside = osim.CoordinateActuator("q")
    outside.setName(TO_LARGER_POSITIONS)
    model.addForce(outside)
    model.finalizeConnections()
    return model


class OpensimMechanism(HostedMechanism):
    """A scenario in OpenSim."""

    def __init__(self, scenario: Scenario, period: float) -> None:
        self.scenario, self.period = scenario, period
        part = scenario.part.with_parameters(scenario.parameters)
        names = {name: name for name in part.muscles}
        self.coupled = CoSimulation(_model(scenario), part, names, period=period, accuracy=ACCURACY)
        forces = self.coupled.model.updForceSet()
        self._outside = _opensim().CoordinateActuator.safeDownCast(forces.get(TO_LARGER_POSITIONS))
        self._outside.overrideActuation(self.coupled.state, True)
        self._first = self.coupled.save_state()

    @property
    def position(self) -> float:
        """Position [m] or [rad]."""
        return float(self.coupled.state.getQ().get(0))

    @property
    def rate(self) -> float:
        """Rate of the position [m/s] or [rad/s]."""
        return float(self.coupled.state.getU().get(0))

    def _put(self, moment: HostMoment) -> None:
        osim, state = _opensim(), self.coupled.state
        if moment.position is not None:
            state.setQ(osim.Vector(1, moment.position))
            state.setU(osim.Vector(1, moment.rate))
        self._outside.setOverrideActuation(state, self.scenario.mechanism.load + moment.force)

    def step(self, moment: HostMoment) -> PartReadings:
        """Go on by one period."""
        self._put(moment)
        outputs = self.coupled.step(**moment.commands)
        state = self.coupled.part_state
        assert state is not None  # after a step
        return PartReadings.of(self.coupled.part, state, outputs)

    def save(self) -> Any:
        """Numbers of the model and of the part."""
        return self.coupled.save_state()

    def restore(self, saved: Any) -> None:
        """Return to saved numbers."""
        self.coupled.load_state(saved)

    def copy(self) -> HostedMechanism:
        """Another model at the same moment."""
        twin = OpensimMechanism(self.scenario, self.period)
        twin.restore(self.save())
        return twin

    def reset(self) -> None:
        """Return to the start."""
        self.coupled.load_state(self._first)

    def look(self, moment: HostMoment) -> None:
        """Observe."""
        self._put(moment)
        self.coupled.observe(**moment.commands)


class OpensimHost(HostAdapter):
    """OpenSim, co-simulated from Python."""

    name, title, staggered = "opensim", "OpenSim, co-simulation in Python, Runge-Kutta-Merson", False

    def __init__(self) -> None:
        _opensim().Logger.removeFileSink()  # it would write opensim.log into the working directory
        _opensim().Logger.setLevelString("error")

    def version(self) -> str:
        """Version of OpenSim."""
        return f"OpenSim {_opensim().GetVersion().split('-')[0]}"

    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The model of a scenario at its start."""
        return OpensimMechanism(scenario, period)

    def own_actuator(self) -> OwnActuator:
        """OpenSim's McKibbenActuator beside a part with the same ideal law."""
        braid = {"thread_length": 0.30, "turns": 1.5}
        (own,) = actuator_tensions([SLACK_SPAN], pressure=SLACK_PRESSURE, **braid)
        part = Part(Muscle(Ideal(**braid)), span=SLACK_SPAN, pressure=SLACK_PRESSURE)
        return OwnActuator(
            "OpenSim's McKibbenActuator, threads of 30 cm with 1.5 turns, 5 bar",
            SLACK_SPAN,
            own,
            float(part.observe(part.rest(), span=SLACK_SPAN).tension),
        )

    def close(self) -> None:
        """Nothing was built; OpenSim stays quiet, because it prints a line when it is let speak again."""
