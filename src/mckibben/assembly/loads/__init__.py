"""Loads of muscles, one file each: a prescribed motion, a body on a line, a joint."""

from .body import Body
from .joint import Joint, MomentArm
from .load import Load, SpanState
from .plate import Plate

__all__ = ["Body", "Joint", "Load", "MomentArm", "Plate", "SpanState"]
