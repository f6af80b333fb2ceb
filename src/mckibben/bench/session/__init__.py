"""A machine that goes on between runs: by hand, through protocols, and seen by whoever looks; `session.Session` is it."""

from .session import Session

__all__ = ["Session"]
