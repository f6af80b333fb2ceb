"""Muscles with their air as a part of other programs: spans in, tensions out.

part = mckibben.hosts.Part("nylon", mckibben.Air(supply="6 bar"))
mckibben.hosts.export(part, "c", "elbow")
mckibben.hosts.conform("c").holds
"""

from __future__ import annotations

from .conformance import conform
from .export import export
from .mujoco_muscles import MuscleCallbacks, act_size
from .part import Part, part_of

__all__ = ["MuscleCallbacks", "Part", "act_size", "conform", "export", "part_of"]
