"""What a recording says about where it comes from: versions, papers, resolved parameters, the date."""

from __future__ import annotations

import datetime
import platform
import sys
from typing import Any

import jax
import numpy as np

from ..components import paths


def versions() -> dict[str, str]:
    """Of this package and of what computes."""
    # The package's root gathers the verbs of all rooms, so a room cannot import it.
    root = sys.modules[__name__.partition(".")[0]]
    return {"mckibben": root.__version__, "jax": jax.__version__, "python": platform.python_version()}


def created() -> str:
    """Now, in UTC."""
    return datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds")


def resolved(owner: Any) -> dict[str, dict[str, Any]]:
    """Every parameter below an object by its dotted path: value [SI] and unit."""
    found = paths.parameters(owner)
    return {path: {"value": np.asarray(paths.get(owner, path)).tolist(), "unit": q.unit} for path, q in found}
