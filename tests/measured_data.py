"""Measured data of others, which do not ship: the folder that MCKIBBEN_DATA names, else ``../shared/data``.

Tests that need them are marked ``validation`` and skip by name where they are not there. They run in `make test`, too.
"""

import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

VARIABLE = "MCKIBBEN_DATA"
# Beside the repository, where nothing else is named.
FOLDER = Path(os.environ.get(VARIABLE) or Path(__file__).parents[2] / "shared" / "data")


def needs(*names: str) -> list[Any]:
    """Marks of a test that needs some files or folders of the measured data."""
    absent = [name for name in names if not (FOLDER / name).exists()]
    reason = f"needs {' and '.join(absent)} in {FOLDER}, or in another folder that {VARIABLE} names"
    return [pytest.mark.validation, pytest.mark.skipif(bool(absent), reason=reason)]


def measured(*names: str) -> Callable[[Any], Any]:
    """A test of some files or folders of the measured data."""

    def marked(test: Any) -> Any:
        for mark in needs(*names):
            test = mark(test)
        return test

    return marked
