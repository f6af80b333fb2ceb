"""What a muscle pulls on, one file each: a given motion, a body in line, a joint."""

from .body import Body
from .joint import Joint, MomentArm
from .load import Load, SpanState
from .plate import Plate

__all__ = ["Body", "Joint", "Load", "MomentArm", "Plate", "SpanState"]
