"""Feedback on the sample clock: pressure by the valve, span or tension by the motor.

Each has `initial() -> state` and a pure `step(state, .., dt, active) -> (state, output)`. While `active` is 0 the trim
is held where a beginning controller asks for what the muscle pulls, so that a change of mode does not jump; the output of
an inactive controller means nothing.
"""

from .force import ForceControl
from .position import PositionControl
from .pressure import PressureControl
from .trim import TrimState

__all__ = ["ForceControl", "PositionControl", "PressureControl", "TrimState"]
