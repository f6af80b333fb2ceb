"""Drake as `mckibben conform` sees it: muscles beside a discrete plant with one joint."""

from __future__ import annotations

from importlib import metadata
from typing import Any

import numpy as np

from mckibben.extras import library

from .adapters import HostAdapter, HostedMechanism, PartReadings
from .scenarios import HostMoment, Scenario


def _drake(module: str) -> Any:
    return library(f"pydrake.{module}", "The host drake needs")


class _DrakeDiagram:
    """A plant with one joint and the muscles of a scenario on it, with free commands and a free force."""

    def __init__(self, scenario: Scenario, period: float) -> None:
        from .drake import add_muscles

        framework, tree = _drake("systems.framework"), _drake("multibody.tree")
        self.scenario, self.period, mechanism = scenario, period, scenario.mechanism
        builder = framework.DiagramBuilder()
        self.plant = plant = builder.AddSystem(_drake("multibody.plant").MultibodyPlant(period))
        inertia = mechanism.inertia if mechanism.rotary else 1.0
        mass = 1.0 if mechanism.rotary else mechanism.inertia
        shape = tree.UnitInertia(inertia / mass, inertia / mass, inertia / mass)
        body = plant.AddRigidBody("load", tree.SpatialInertia(mass, np.zeros(3), shape))
        joint = tree.RevoluteJoint if mechanism.rotary else tree.PrismaticJoint
        plant.AddJoint(joint("q", plant.world_frame(), body.body_frame(), [0.0, 0.0, 1.0]))
        plant.mutable_gravity_field().set_gravity_vector(np.zeros(3))
        plant.Finalize()
        outside = builder.AddSystem(_drake("systems.primitives").PassThrough(1))
        part = scenario.part.with_parameters(scenario.parameters)
        arms = {name: {"q": arm} for name, arm in mechanism.arms.items()}
        self.muscles = add_muscles(
            builder, plant, part, arms=arms, spans=mechanism.spans, force=outside.get_output_port()
        )
        builder.ExportInput(self.muscles.GetInputPort("command"), "command")
        builder.ExportInput(outside.get_input_port(), "force")
        self.diagram = builder.Build()


class _DrakeMechanism(HostedMechanism):
    """A scenario in Drake."""

    def __init__(self, built: _DrakeDiagram, context: Any = None) -> None:
        self.built = built
        self.simulator = _drake("systems.analysis").Simulator(built.diagram, context)
        self.context = self.simulator.get_mutable_context()
        self._plant = built.plant.GetMyMutableContextFromRoot(self.context)
        self._muscles = built.muscles.GetMyContextFromRoot(self.context)
        self._command = built.diagram.GetInputPort("command")
        self._force = built.diagram.GetInputPort("force")
        if context is None:
            self._put(HostMoment(built.scenario.first_commands(), 0.0, None, None))
            self.reset()
        else:
            self.simulator.Initialize()

    @property
    def position(self) -> float:
        return float(self.built.plant.GetPositions(self._plant)[0])

    @property
    def rate(self) -> float:
        return float(self.built.plant.GetVelocities(self._plant)[0])

    def _put(self, moment: HostMoment) -> None:
        if moment.position is not None:
            self.built.plant.SetPositions(self._plant, [moment.position])
            self.built.plant.SetVelocities(self._plant, [moment.rate])
        self._command.FixValue(self.context, [moment.commands[name] for name in self.built.muscles.commands])
        self._force.FixValue(self.context, [self.built.scenario.mechanism.load + moment.force])

    def step(self, moment: HostMoment) -> PartReadings:
        self._put(moment)
        steps = round(self.context.get_time() / self.built.period) + 1
        self.simulator.AdvanceTo(steps * self.built.period)
        muscles, context = self.built.muscles, self._muscles
        tension, pressure, work = (
            dict(zip(muscles.muscles, muscles.shown(context, name).tolist(), strict=True))
            for name in ("tension", "pressure", "work")
        )
        return PartReadings(tension, pressure, sum(work.values()), muscles.part.gas_mass(muscles.part_state(context)))

    def save(self) -> Any:
        return self.context.Clone()

    def restore(self, saved: Any) -> None:
        self.context.SetTimeStateAndParametersFrom(saved)
        self.simulator.Initialize()

    def copy(self) -> HostedMechanism:
        return _DrakeMechanism(self.built, self.context.Clone())

    def reset(self) -> None:
        self.context.SetTime(0.0)
        self.built.diagram.SetDefaultContext(self.context)
        self.built.plant.SetPositions(self._plant, [self.built.scenario.mechanism.start])
        self.simulator.Initialize()

    def look(self, moment: HostMoment) -> None:
        self._put(moment)
        self.built.muscles.GetOutputPort("tension").Eval(self._muscles)


class DrakeHost(HostAdapter):
    """Drake with muscles on a joint of a discrete plant with sampled output ports, as Drake makes it by default."""

    name, title, staggered = "drake", "Drake, leaf system beside a discrete plant", True

    def __init__(self) -> None:
        _drake("systems.framework")

    def version(self) -> str:
        """Version of Drake."""
        return f"Drake {metadata.version('drake')}"

    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The diagram of a scenario at its start."""
        return _DrakeMechanism(_DrakeDiagram(scenario, period))
