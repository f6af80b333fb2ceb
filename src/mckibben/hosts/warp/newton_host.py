"""Newton as `mckibben conform` sees it: one robot of each scenario with a joint and a drive, on the processor."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...extras import library
from ..adapters import HostAdapter, HostedMechanism, PartReadings
from ..scenarios import HostMoment, Scenario
from .host import DEVICE, exported_module, quiet_warp


def _newton() -> Any:
    quiet_warp("The host newton needs")
    return library("newton", "The host newton needs")


class NewtonMechanism(HostedMechanism):
    """A scenario as a model of Newton with one joint, under the solver of Featherstone's method."""

    def __init__(self, scenario: Scenario, period: float) -> None:
        self.scenario, self.period = scenario, period
        newton, warp = _newton(), quiet_warp("The host newton needs")
        self.module = exported_module(scenario.part)
        mechanism, self.names = scenario.mechanism, scenario.part.muscles
        builder = newton.ModelBuilder(up_axis=newton.Axis.Z, gravity=(0.0, 0.0, 0.0))
        mass = 1.0 if mechanism.rotary else mechanism.inertia
        link = builder.add_link(mass=mass, inertia=warp.mat33(np.eye(3) * mechanism.inertia))
        add = builder.add_joint_revolute if mechanism.rotary else builder.add_joint_prismatic
        builder.add_articulation([add(-1, link, axis=newton.Axis.Z, armature=0.0)])
        model = builder.finalize(device=DEVICE)
        self._solver = newton.solvers.SolverFeatherstone(model, angular_damping=0.0)
        self.drive = self.module.newton_drive(
            1,
            arms=dict(mechanism.arms),
            spans=dict(mechanism.spans),
            device=DEVICE,
            parameters=dict(scenario.parameters),
        )
        joints = warp.zeros(len(self.names), dtype=warp.uint32, device=DEVICE)  # all muscles are at one joint
        self._actuator = newton.actuators.Actuator(joints, self.drive)
        self._state, self._after, self._control = model.state(), model.state(), model.control()
        self._now, self._following = self._actuator.state(), self._actuator.state()
        self._control.muscle_commands = warp.zeros((1, len(self.module.COMMANDS)), dtype=float, device=DEVICE)
        self._state.joint_q.fill_(mechanism.start)
        self._first = self.save()

    @property
    def position(self) -> float:
        """Position [m] or [rad]."""
        return float(self._state.joint_q.numpy()[0])

    @property
    def rate(self) -> float:
        """Rate of the position [m/s] or [rad/s]."""
        return float(self._state.joint_qd.numpy()[0])

    def _pull(self, moment: HostMoment) -> None:
        """Set what a moment gives, and let the drive step the part."""
        if moment.position is not None:
            self._state.joint_q.fill_(moment.position)
            self._state.joint_qd.fill_(moment.rate)
        commands = [[moment.commands[name] for name in self.module.COMMANDS]]
        self._control.muscle_commands.assign(np.array(commands, np.float32))
        self._control.joint_f.fill_(self.scenario.mechanism.load + moment.force)
        self._actuator.step(self._state, self._control, self._now, self._following, self.period)

    def step(self, moment: HostMoment) -> PartReadings:
        """Go on by one step of the solver."""
        self._pull(moment)
        self._solver.step(self._state, self._after, self._control, None, self.period)
        self._state, self._after = self._after, self._state
        self._now, self._following = self._following, self._now
        part: Any = self.drive.part
        seen = dict(zip(self.module.OUTPUTS, part.outputs.numpy()[0].tolist(), strict=True))
        return PartReadings(
            {name: seen[f"tension.{name}"] for name in self.names},
            {name: seen[f"muscle.{name}.pressure"] for name in self.names},
            sum(seen[f"work.{name}"] for name in self.names),
            self.scenario.part.gas_mass(part.following.numpy()[0]),
        )

    def _arrays(self) -> list[Any]:
        return [self._state.joint_q, self._state.joint_qd, self._now.drive_state.numbers]

    def save(self) -> Any:
        """Position, rate and the state of the drive."""
        return [one.numpy().copy() for one in self._arrays()]

    def restore(self, saved: Any) -> None:
        """Return to what `save` returned."""
        for one, values in zip(self._arrays(), saved, strict=True):
            one.assign(values)

    def copy(self) -> HostedMechanism:
        """Another one at the same moment, with a model of its own."""
        twin = NewtonMechanism(self.scenario, self.period)
        twin.restore(self.save())
        return twin

    def reset(self) -> None:
        """Return to the start."""
        self.restore(self._first)

    def look(self, moment: HostMoment) -> None:
        """Let the actuator compute, without keeping its state."""
        self._pull(moment)


class NewtonHost(HostAdapter):
    """Newton on the processor; its mechanics are in float32, the muscles in float64."""

    name, title, staggered = "newton", "Newton on the processor, Featherstone, float32 beside muscles in float64", True
    caveats = (
        "One robot on the processor, most of whose step is Newton's own; the code is compiled for GPUs too, on which it has "
        "not run.",
    )

    def __init__(self) -> None:
        _newton()

    def version(self) -> str:
        """Versions of Newton and Warp."""
        import importlib.metadata as metadata

        return f"Newton {metadata.version('newton')}, Warp {metadata.version('warp-lang')}"

    def open(self, scenario: Scenario, period: float) -> HostedMechanism:
        """The model of a scenario at its start."""
        quiet_warp("The host newton needs").set_device(DEVICE)
        return NewtonMechanism(scenario, period)

    def close(self) -> None:
        """Nothing is left open."""
