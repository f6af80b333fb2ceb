"""Muscles with their air as a discrete system of Drake: spans in, tensions out.

    from mckibben_hosts.drake import add_muscles

    muscles = add_muscles(builder, plant, Part("nylon", span=0.14), arms={"muscle": {"slider": -1.0}}, spans={"muscle": 0.0})
    builder.ExportInput(muscles.get_input_port("command"), "valve")

The state is a vector of numbers in the context, so that contexts may be copied and brought back; a state of zeros, which is
that of a default context, rests at the first span and command. Systems are in float64 only.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from mckibben.errors import InputError
from mckibben.extras import library

from .part import Part

_framework: Any = library("pydrake.systems.framework", "Muscles in Drake need")
LeafSystem: Any = _framework.LeafSystem

SHOWN = ("tension", "pressure", "work")
"""Outputs of the last step that the state keeps, each for every muscle."""


class MuscleSystem(LeafSystem):  # type: ignore[misc] # a class of an optional library
    """Muscles with their air, stepped with a plant.

    Input ports are ``span`` [m] and ``span_rate`` [m/s] with a number for each of `muscles`, and ``command`` with one for
    each of `commands` [SI]. Output ports, a number for each muscle, are ``tension``, the mean over the coming step with
    which the plant is to be stepped [N]; and of the last step ``pressure``, gauge at its end [Pa], and ``work`` of the plant
    on the muscles since the start [J].

    The plant's positions and rates must be those of the same moment as the state when the tension is computed. In a
    discrete plant with sampled output ports, which Drake's `MultibodyPlant` has by default, they are at the unrestricted
    update; in one without them, at the discrete update; and a continuous plant gets a tension that is held for the period.

    Args:
        part: muscles and their air.
        period: of the steps; of a discrete plant its time step [s].
        continuous: whether the plant is integrated by the simulator; else it is discrete, semi-implicit.
        sampled: whether the discrete plant has sampled output ports.

    Attributes:
        part: muscles and their air.
        muscles: their names, in the order of the ports.
        commands: names of the commands, in the order of the port.

    Raises:
        InputError: the period is not positive.
    """

    def __init__(self, part: Part, period: float, *, continuous: bool = False, sampled: bool = True) -> None:
        super().__init__()
        if not period > 0.0:
            raise InputError("period", f"{period:g} s", "must be greater than 0 s")
        self.part, self.period, self.continuous = part, float(period), continuous
        self.muscles, self.commands = part.muscles, part.commands
        count, self._size = len(self.muscles), part.layouts.state.size
        self._started = int(part.layouts.state.unpack(np.arange(float(self._size))).started)
        self._numbers = self._size + len(SHOWN) * count
        names = [name if len(self.muscles) == 1 else f"{muscle}_{name}" for name in SHOWN for muscle in self.muscles]
        self._shown = [part.outputs.index(name) for name in names]
        self._span = self.DeclareVectorInputPort("span", count)
        self._rate = self.DeclareVectorInputPort("span_rate", count)
        self._command = self.DeclareVectorInputPort("command", len(self.commands))
        self._state = self.DeclareDiscreteState(self._numbers)
        before = {self.discrete_state_ticket(self._state)}
        inputs = {self.input_port_ticket(port.get_index()) for port in (self._span, self._rate, self._command)}
        value = _framework.ValueProducer(
            allocate=lambda: library("pydrake.common.value", "Muscles in Drake need").Value(np.zeros(self._numbers)),
            calc=self._calc,
        )
        self._next = self.DeclareCacheEntry("the state after the step", value, before | inputs)
        source = before if continuous else {self._next.ticket()}
        self.DeclareVectorOutputPort("tension", count, self._put_tension, source)
        for name in SHOWN[1:]:
            self.DeclareVectorOutputPort(
                name, count, lambda c, out, n=name: out.SetFromVector(self.shown(c, n)), before
            )
        if sampled and not continuous:
            self.DeclarePeriodicUnrestrictedUpdateEvent(
                self.period, 0.0, lambda c, state: self._update(c, state.get_mutable_discrete_state())
            )
        else:
            self.DeclarePeriodicDiscreteUpdateEvent(self.period, 0.0, self._update)

    def shown(self, context: Any, name: str) -> np.ndarray:
        """An output of the last step, one of `SHOWN`, for each muscle [SI]; the system's own context."""
        at = self._size + SHOWN.index(name) * len(self.muscles)
        return np.array(context.get_discrete_state(self._state).value()[at : at + len(self.muscles)])

    def part_state(self, context: Any) -> np.ndarray:
        """State of the part, as `Part.step` takes it; the system's own context."""
        return np.array(context.get_discrete_state(self._state).value()[: self._size])

    def _calc(self, context: Any, out: Any) -> None:
        numbers = context.get_discrete_state(self._state).value()

        def named(names: Sequence[str], port: Any) -> dict[str, float]:
            return dict(zip(names, port.Eval(context).tolist(), strict=True))

        spans, rates = named(self.muscles, self._span), named(self.muscles, self._rate)
        commands = named(self.commands, self._command)
        state = np.array(numbers[: self._size])
        if state[self._started] == 0.0:
            state = self.part.rest(spans, **commands)
        new, readings = self.part.step(
            state, period=self.period, span=spans, rate=rates, staggered=not self.continuous, **commands
        )
        out.set_value(np.concatenate([new, [readings[k] for k in self._shown]]))

    def _put_tension(self, context: Any, out: Any) -> None:
        if self.continuous:
            out.SetFromVector(self.shown(context, "tension"))
        else:
            after = self._next.Eval(context)
            out.SetFromVector(after[self._size : self._size + len(self.muscles)])

    def _update(self, context: Any, discrete: Any) -> Any:
        discrete.set_value(self._state, self._next.Eval(context))
        return _framework.EventStatus.Succeeded()


class JointTendons(LeafSystem):  # type: ignore[misc] # a class of an optional library
    """Tendons with constant moment arms on joints of a plant: spans from its state, generalized forces from tensions.

        span = span at zero - sum of arm * position,    force = sum of arm * tension

    Input ports are ``state`` of the plant and ``tension`` of each muscle [N]; output ports ``span`` [m], ``span_rate`` [m/s]
    and ``generalized_force`` of the plant [N] or [N m].

    Args:
        plant: a finalized `MultibodyPlant`.
        muscles: names of the muscles, in the order of the ports.
        arms: by muscle, moment arms by the name of a joint of one degree of freedom, positive where the position grows as
            the muscle shortens; [m] at a hinge, and 1 or -1 at a slider.
        spans: by muscle, at position zero of all joints [m].

    Raises:
        InputError: an unknown muscle or joint, or a joint with another number of degrees of freedom.
    """

    def __init__(
        self, plant: Any, muscles: tuple[str, ...], arms: Mapping[str, Mapping[str, float]], spans: Mapping[str, float]
    ) -> None:
        super().__init__()
        for field, values in (("arms", arms), ("spans", spans)):
            for name in values:
                if name not in muscles:
                    raise InputError(field, name, known=muscles)
            for name in muscles:
                if name not in values:
                    raise InputError(field, None, f"is missing for the muscle {name}")
        positions, rates = plant.num_positions(), plant.num_velocities()
        self._zero = np.array([float(spans[name]) for name in muscles])
        self._of_positions, self._of_rates = np.zeros((len(muscles), positions)), np.zeros((len(muscles), rates))
        joints = {plant.get_joint(index).name(): plant.get_joint(index) for index in plant.GetJointIndices()}
        for row, name in enumerate(muscles):
            for which, arm in arms[name].items():
                if which not in joints:
                    raise InputError("joint", which, known=tuple(joints))
                joint = joints[which]
                if joint.num_positions() != 1 or joint.num_velocities() != 1:
                    raise InputError("joint", which, "must have one degree of freedom")
                self._of_positions[row, joint.position_start()] = arm
                self._of_rates[row, joint.velocity_start()] = arm
        self._state = self.DeclareVectorInputPort("state", positions + rates)
        self._tension = self.DeclareVectorInputPort("tension", len(muscles))
        state = {self.input_port_ticket(self._state.get_index())}
        tension = {self.input_port_ticket(self._tension.get_index())}
        self.DeclareVectorOutputPort("span", len(muscles), self._put_span, state)
        self.DeclareVectorOutputPort("span_rate", len(muscles), self._put_rate, state)
        self.DeclareVectorOutputPort("generalized_force", rates, self._put_force, tension)

    def _put_span(self, context: Any, out: Any) -> None:
        positions = self._state.Eval(context)[: self._of_positions.shape[1]]
        out.SetFromVector(self._zero - self._of_positions @ positions)

    def _put_rate(self, context: Any, out: Any) -> None:
        out.SetFromVector(-self._of_rates @ self._state.Eval(context)[self._of_positions.shape[1] :])

    def _put_force(self, context: Any, out: Any) -> None:
        out.SetFromVector(self._of_rates.T @ self._tension.Eval(context))


def add_muscles(
    builder: Any,
    plant: Any,
    part: Part,
    *,
    arms: Mapping[str, Mapping[str, float]],
    spans: Mapping[str, float],
    period: float = 1e-3,
    force: Any = None,
) -> MuscleSystem:
    """Add muscles on joints to a diagram and connect them with its plant, all but their commands.

    Args:
        builder: of the diagram.
        plant: a finalized `MultibodyPlant` of the diagram, discrete or continuous.
        part: muscles and their air.
        arms: see `JointTendons`.
        spans: see `JointTendons`.
        period: of the muscles' steps if the plant is continuous; else they have its time step [s].
        force: output port with other generalized forces on the plant, which are added to those of the muscles.

    Returns:
        The muscles, whose port ``command`` is left to be connected.

    Raises:
        InputError: see `JointTendons`.
    """
    step = plant.time_step()
    made = MuscleSystem(
        part, step or period, continuous=step == 0.0, sampled=step > 0.0 and plant.has_sampled_output_ports()
    )
    muscles: MuscleSystem = builder.AddNamedSystem("muscles", made)
    tendons = builder.AddNamedSystem("tendons", JointTendons(plant, part.muscles, arms, spans))
    builder.Connect(plant.get_state_output_port(), tendons.get_input_port(0))
    for name in ("span", "span_rate"):
        builder.Connect(tendons.GetOutputPort(name), muscles.GetInputPort(name))
    builder.Connect(muscles.GetOutputPort("tension"), tendons.GetInputPort("tension"))
    pull = tendons.GetOutputPort("generalized_force")
    if force is not None:
        adder = library("pydrake.systems.primitives", "Muscles in Drake need").Adder
        both = builder.AddNamedSystem("forces", adder(2, plant.num_velocities()))
        builder.Connect(pull, both.get_input_port(0))
        builder.Connect(force, both.get_input_port(1))
        pull = both.get_output_port()
    builder.Connect(pull, plant.get_applied_generalized_force_input_port())
    return muscles
