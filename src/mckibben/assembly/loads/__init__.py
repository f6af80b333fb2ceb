"""Loads of muscles: a prescribed motion, a body on a line, a joint, a chain of links, another program."""

from .joint import ChainLink, JointLoad, LinkChain, MomentArm
from .load import Body, HostLoad, Load, PlateLoad, SpanState

__all__ = ["Body", "ChainLink", "HostLoad", "JointLoad", "LinkChain", "Load", "MomentArm", "PlateLoad", "SpanState"]
