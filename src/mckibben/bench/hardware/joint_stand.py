"""An antagonist pair on a joint with its converters; the software sees an angle and two pressures.

Measured are ``angle`` [rad] by an encoder on the joint's axis, and ``flexor_pressure`` and ``extensor_pressure`` (gauge)
[Pa] at the muscles. The software commands ``flexor`` and ``extensor`` [Pa], one valve each. An outside ``moment`` [N m]
passes unconverted: it comes from the world and not from a computer.
"""

from __future__ import annotations

from collections.abc import Mapping

from ..._jax import Tree
from ...assembly.pair_map import NAMES
from ...assembly.stiffness import joint_stiffness
from ...components import Scalar
from ...components.system import Value
from .analogue import AnalogOut
from .motor import Encoder
from .plant import MeasuredPlant

PRESSURES = {name: f"{name}_pressure" for name in NAMES}  # channels by muscle
MOMENT = "moment"  # signal of the joint


class RiggedJoint(MeasuredPlant):
    """A machine of `assembly.build.antagonist_pair` with sensors and output converters.

    Its valves are driven by ``flexor.valve`` and ``extensor.valve``, its joint by ``moment``. The encoder has a pulley of
    1 m radius, at which a metre is a radian. It was zeroed at angle zero.
    """

    encoder: Encoder
    valve_out: AnalogOut

    def convert(self, commands: Mapping[str, Scalar]) -> dict[str, Scalar]:
        """Values held by the output converters, and the external moment."""
        held = {f"{n}.valve": self.valve_out.output(commands[n]) for n in NAMES}
        return {**held, MOMENT: commands[MOMENT]}

    def seen(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Gauge pressures in the muscles [Pa]."""
        return {channel: self.machine.gauge(state, name) for name, channel in PRESSURES.items()}

    def sense(self, state: Tree, memory: Tree, inputs: Mapping[str, Value], row: Tree) -> dict[str, Scalar]:
        """Measured channels, and for each pressure ``<channel>.code``, the count of its converter."""
        count = self.encoder.count(state["machine"]["load"].angle, 0.0)
        return {**self.analogue(state, memory, inputs, row), "angle": self.encoder.span(count, 0.0)}

    def outputs(self, state: Tree, memory: Tree, inputs: Mapping[str, Value]) -> dict[str, Scalar]:
        """Outputs of the machine, and two stiffnesses of the joint [N m/rad]: for slow and for quick displacements."""
        stiffness = joint_stiffness(self.machine, state["machine"], memory, inputs)
        stiffnesses = {
            "joint.stiffness": stiffness.relaxed_at_pressure,
            "joint.quick_stiffness": stiffness.short_at_mass,
        }
        return super().outputs(state, memory, inputs) | stiffnesses
