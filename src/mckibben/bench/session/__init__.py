"""A machine and its clock in somebody's hands: by hand, through protocols, and seen by whoever looks."""

from .session import Session
from .status import Message, Status

__all__ = ["Message", "Session", "Status"]
