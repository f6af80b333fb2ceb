"""The console: commands in words, on a session; without a terminal, which `cli.console` adds."""

from .console import Console

__all__ = ["Console"]
