"""Muscles with their air beside the muscles of an OpenSim model: both are stepped by turns.

    from mckibben_hosts.opensim import CoSimulation

    together = CoSimulation(model, Part("nylon", span=0.14), {"muscle": "pam"})
    seen = together.step(muscle=0.3)

Each muscle is a `PathActuator` of the model, whose length is the span and whose force the part gives. In each step the part
goes first, along the lengthening speeds of the moment; the model is then integrated with the mean tensions of the same
step, by its own integrator. As `mckibben conform` sees OpenSim, the scenarios are paths between points on a slider, or two
of constant moment arms on a hinge.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple

import numpy as np

from mckibben.errors import ConvergenceError, InputError
from mckibben.extras import library
from mckibben.muscles import Muscle
from mckibben.muscles.laws.ideal import Ideal

from .adapters import HostAdapter, HostedMechanism, OwnActuator, PartReadings, RebuiltMechanism
from .part import Part
from .scenarios import HostMoment, Scenario

ACCURACY = 1e-6  # of OpenSim's integrator


def actuator_tensions(lengths: Iterable[float], *, thread_length: float, turns: float, pressure: float) -> list[float]:
    """Forces of OpenSim's own ``McKibbenActuator`` at some lengths [N], negative where it pushes.

    Args:
        lengths: of its path [m].
        thread_length: of its threads [m].
        turns: of each thread.
        pressure: gauge, its control [Pa].
    """
    osim = library("opensim", "Forces of a McKibbenActuator need")
    model, zero = osim.Model(), osim.Vec3(0.0)
    body = osim.Body("end", 1.0, zero, osim.Inertia(1.0))
    model.addBody(body)
    model.addJoint(osim.SliderJoint("slider", model.getGround(), body))
    actuator = osim.McKibbenActuator("own", turns, thread_length)
    actuator.addNewPathPoint("a", model.getGround(), zero)
    actuator.addNewPathPoint("b", body, zero)
    model.addForce(actuator)
    controller = osim.PrescribedController()
    controller.addActuator(actuator)
    controller.prescribeControlForActuator("own", osim.Constant(pressure))
    model.addController(controller)
    model.finalizeConnections()
    state, forces = model.initSystem(), []
    for length in lengths:
        state.setQ(osim.Vector(1, float(length)))
        model.realizeDynamics(state)
        forces.append(float(actuator.getActuation(state)))
    return forces


class CoSimulationState(NamedTuple):
    """A moment of a co-simulation.

    Attributes:
        time: [s].
        model: continuous state of the model, as OpenSim orders it.
        part: state of the muscles with their air.
    """

    time: float
    model: np.ndarray
    part: np.ndarray


class CoSimulation:
    """An OpenSim model and muscles with their air, stepped together.

    Args:
        model: an ``opensim.Model``; its system is initialized here.
        part: muscles and their air.
        actuators: name of the model's `PathActuator` for each muscle.
        period: of the steps in which tensions are exchanged [s].
        accuracy: of OpenSim's integrator.
        start: of the model, as ``model.initSystem()`` returns it and perhaps changed since; a new one by default.

    Attributes:
        model: the model.
        part: muscles and their air.
        state: the model's state at the present moment, which goes on with every step.

    Raises:
        InputError: an actuator that the model does not have, or a muscle without one.
    """

    def __init__(
        self,
        model: Any,
        part: Part,
        actuators: Mapping[str, str],
        *,
        period: float = 1e-3,
        accuracy: float = ACCURACY,
        start: Any = None,
    ) -> None:
        self._opensim = library("opensim", "Muscles in OpenSim need")
        if not period > 0.0:
            raise InputError("period", f"{period:g} s", "must be greater than 0 s")
        self.model, self.part, self.period = model, part, float(period)
        self.state = model.initSystem() if start is None else start
        forces = model.updForceSet()
        known = [forces.get(k).getName() for k in range(forces.getSize())]
        self._actuators = {}
        for muscle in part.muscles:
            if muscle not in actuators:
                raise InputError("actuators", None, f"is missing for the muscle {muscle}")
            if actuators[muscle] not in known:
                raise InputError("actuators", actuators[muscle], known=known)
            actuator = self._opensim.PathActuator.safeDownCast(forces.get(actuators[muscle]))
            if actuator is None:
                raise InputError("actuators", actuators[muscle], "must be a PathActuator")
            actuator.overrideActuation(self.state, True)
            self._actuators[muscle] = actuator
        self._manager = self._opensim.Manager(model)
        self._manager.setIntegratorAccuracy(accuracy)
        self._manager.setWriteToStorage(False)
        self._part_state: np.ndarray | None = None
        self._count = round(self.time / self.period)

    def __repr__(self) -> str:
        return f"CoSimulation({self.model.getName()!r}, {self.part!r}, {self.time:g} s)"

    @property
    def time(self) -> float:
        """Of the model [s]."""
        return float(self.state.getTime())

    @property
    def part_state(self) -> np.ndarray | None:
        """State of the part, as `Part.step` takes it; None before the first step."""
        return self._part_state

    def span(self) -> dict[str, float]:
        """Span of each muscle [m]."""
        self.model.realizePosition(self.state)
        return {name: float(actuator.getLength(self.state)) for name, actuator in self._actuators.items()}

    def span_rate(self) -> dict[str, float]:
        """Rate of each span [m/s]."""
        self.model.realizeVelocity(self.state)
        return {name: float(actuator.getLengtheningSpeed(self.state)) for name, actuator in self._actuators.items()}

    def step(self, **commands: Any) -> Any:
        """Go on by one period.

        Args:
            **commands: by name [SI]; those that are left out stay as they were.

        Returns:
            The outputs of the part, see `Part.step`: of a single muscle ``tension`` first, the mean over the step [N].

        Raises:
            InputError: an unknown command.
            ConvergenceError: the state of the muscles is not possible any more, or OpenSim cannot integrate the model.
        """
        spans, rates = self.span(), self.span_rate()
        if self._part_state is None:
            self._part_state = self.part.rest(spans, **commands)
        self._part_state, readings = self.part.step(
            self._part_state, period=self.period, span=spans, rate=rates, **commands
        )
        for place, name in enumerate(sorted(self._actuators)):  # tensions come first, by muscle
            self._actuators[name].setOverrideActuation(self.state, readings[place])
        self._count += 1
        try:
            self._manager.initialize(self.state)
            after = self._manager.integrate(self._count * self.period)
        except RuntimeError as error:
            raise ConvergenceError(f"OpenSim could not integrate the model at {self.time:g} s: {error}") from None
        # Into the same state: a copied one keeps lengthening speeds of another moment.
        self.state.setTime(after.getTime())
        self.state.setY(after.getY())
        return readings

    def observe(self, **commands: Any) -> Any:
        """Outputs of the muscles at the present moment, without going on."""
        spans = self.span()
        state = self.part.rest(spans, **commands) if self._part_state is None else self._part_state
        return self.part.observe(state, span=spans, rate=self.span_rate(), **commands)

    def save_state(self) -> CoSimulationState:
        """The present moment, for `load_state`."""
        numbers = self.state.getY()
        part = np.zeros(0) if self._part_state is None else self._part_state
        return CoSimulationState(self.time, np.array([numbers.get(k) for k in range(numbers.size())]), part)

    def load_state(self, saved: CoSimulationState) -> None:
        """Return to a moment, perhaps of another co-simulation of the same model and part."""
        numbers = self._opensim.Vector(len(saved.model), 0.0)
        for k, value in enumerate(saved.model):
            numbers.set(k, float(value))
        self.state.setTime(saved.time)
        self.state.setY(numbers)
        self._count = round(saved.time / self.period)
        self._part_state = saved.part if saved.part.size else None


CONFORM_ACCURACY = 1e-9  # so that the errors are those of the coupling
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


class _OpensimMechanism(RebuiltMechanism):
    """A scenario in OpenSim."""

    def build(self) -> None:
        scenario, period = self.scenario, self.period
        part = scenario.part.with_parameters(scenario.parameters)
        names = {name: name for name in part.muscles}
        self.coupled = CoSimulation(_model(scenario), part, names, period=period, accuracy=CONFORM_ACCURACY)
        forces = self.coupled.model.updForceSet()
        self._outside = _opensim().CoordinateActuator.safeDownCast(forces.get(TO_LARGER_POSITIONS))
        self._outside.overrideActuation(self.coupled.state, True)

    @property
    def position(self) -> float:
        return float(self.coupled.state.getQ().get(0))

    @property
    def rate(self) -> float:
        return float(self.coupled.state.getU().get(0))

    def _put(self, moment: HostMoment) -> None:
        osim, state = _opensim(), self.coupled.state
        if moment.position is not None:
            state.setQ(osim.Vector(1, moment.position))
            state.setU(osim.Vector(1, moment.rate))
        self._outside.setOverrideActuation(state, self.scenario.mechanism.load + moment.force)

    def step(self, moment: HostMoment) -> PartReadings:
        self._put(moment)
        outputs = self.coupled.step(**moment.commands)
        state = self.coupled.part_state
        assert state is not None  # after a step
        return PartReadings.of(self.coupled.part, state, outputs)

    def save(self) -> Any:
        return self.coupled.save_state()

    def restore(self, saved: Any) -> None:
        self.coupled.load_state(saved)

    def look(self, moment: HostMoment) -> None:
        self._put(moment)
        self.coupled.observe(**moment.commands)


class OpensimHost(HostAdapter):
    """OpenSim, co-simulated from Python."""

    name, title, staggered = "opensim", "OpenSim, co-simulation in Python, Runge-Kutta-Merson", False

    def __init__(self) -> None:
        # It stays quiet for good, because it prints a line when it is let speak again.
        _opensim().Logger.removeFileSink()  # it would write opensim.log into the working directory
        _opensim().Logger.setLevelString("error")

    def version(self) -> str:
        """Version of OpenSim."""
        return f"OpenSim {_opensim().GetVersion().split('-')[0]}"

    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The model of a scenario at its start."""
        return _OpensimMechanism(scenario, period)

    def own_actuator(self) -> OwnActuator:
        """OpenSim's McKibbenActuator beside a part with the same ideal law."""
        braid = {"thread_length": 0.30, "turns": 1.5}
        (own,) = actuator_tensions([SLACK_SPAN], pressure=SLACK_PRESSURE, **braid)
        part = Part(Muscle(Ideal(**braid)), span=SLACK_SPAN, pressure=SLACK_PRESSURE)
        tension = float(part.observe(part.rest(), span=SLACK_SPAN).tension)
        title = "OpenSim's McKibbenActuator, threads of 30 cm with 1.5 turns, 5 bar"
        return OwnActuator(title, SLACK_SPAN, own, tension)
