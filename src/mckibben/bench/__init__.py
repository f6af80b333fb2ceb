"""Test rigs, simulated and real, and the runs on them and on circuits."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from .circuit_run import run_circuit as run_circuit
    from .joint_run import joint_stand as joint_stand
    from .joint_run import run_joint as run_joint
    from .prepare import OpenWire as OpenWire
    from .segment import SegmentMachine as SegmentMachine
    from .segment import timing_of as timing_of
    from .sensors import SENSORS as SENSORS
    from .sensors import SensorKind as SensorKind

lazy_submodules(__name__)
lazy_names(__name__)
