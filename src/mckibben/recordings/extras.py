"""Libraries that only some files need: where one is missing, a line says what to install."""

from __future__ import annotations

import importlib
from typing import Any

from ..errors import InputError


def needed(module: str, package: str, what: str, where: str) -> Any:
    """A library that is no part of the plain installation.

    Args:
        module: its name in Python.
        package: its name for pip.
        what: what needs it, such as ``"TDMS files"``.
        where: the file.

    Raises:
        InputError: it is not installed.
    """
    try:
        return importlib.import_module(module)
    except ImportError:
        allowed = f"{what} need it: pip install 'mckibben[formats]', or pip install {package}"
        raise InputError(f"library {package}", "not installed", allowed, where=where) from None
