"""Provenance of a recording: versions of the programs that made it, and the time at which they did."""

from __future__ import annotations

import datetime
import platform
import sys
from importlib import metadata


def versions() -> dict[str, str]:
    """Return the versions of this package, of JAX and of Python."""
    # The package's root gathers the verbs of all rooms, so a room cannot import it.
    root = sys.modules[__name__.partition(".")[0]]
    return {"mckibben": root.__version__, "jax": metadata.version("jax"), "python": platform.python_version()}


def created() -> str:
    """Return the present time in UTC, ISO 8601."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")
