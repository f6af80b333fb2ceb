"""Sessions: a machine with its clock, operated manually and by protocols, observed by any number of clients."""

from ..._lazy import lazy_submodules
from .interface import MachineSession, Message, Messages, Status
from .session import Session

__all__ = ["MachineSession", "Message", "Messages", "Session", "Status"]

lazy_submodules(__name__)
