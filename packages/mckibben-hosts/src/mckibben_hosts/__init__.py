"""Muscles with their air as a part of other programs: spans in, tensions out.

part = mckibben_hosts.Part("nylon", mckibben.Air(supply="6 bar"))
mckibben_hosts.export(part, "c", "elbow")
mckibben_hosts.conform("c").holds

With `import mckibben as mk` the package is `mk.hosts`. Its public names are loaded when they are first used: the help of its
commands computes nothing.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from mckibben._lazy import lazy_names
from mckibben.registry import join

if TYPE_CHECKING:
    from .conformance import conform as conform
    from .mujoco_muscles import MuscleCallbacks as MuscleCallbacks
    from .mujoco_muscles import act_size as act_size
    from .part import Part as Part
    from .part import part_of as part_of
    from .targets import export as export

__version__ = "1.0.0"

join(__name__)
lazy_names(__name__)
