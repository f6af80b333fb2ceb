"""Loads of muscles, one file each: a prescribed motion, a body on a line, a joint, a chain of links, another program."""

from .body import Body
from .chain import ChainLink, LinkChain
from .host import HostLoad
from .joint import JointLoad, MomentArm
from .load import Load, SpanState
from .plate import PlateLoad

__all__ = ["Body", "ChainLink", "HostLoad", "JointLoad", "LinkChain", "Load", "MomentArm", "PlateLoad", "SpanState"]
