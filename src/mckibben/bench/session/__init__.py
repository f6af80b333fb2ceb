"""A machine and its clock in somebody's hands: by hand, through protocols, and seen by whoever looks."""

from ..._lazy import lazy_submodules
from .interface import MachineSession
from .session import Session
from .status import Message, Messages, Status

__all__ = ["MachineSession", "Message", "Messages", "Session", "Status"]

lazy_submodules(__name__)
