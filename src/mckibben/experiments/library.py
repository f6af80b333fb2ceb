"""The shipped protocols: the classic experiments on a muscle, each a file of `protocols/` with parameters by name."""

from __future__ import annotations

import functools
from importlib import resources
from typing import Any

from ..errors import InputError
from .protocol import Protocol
from .waveforms import near


def protocol_names() -> list[str]:
    """Of all shipped protocols, sorted."""
    folder = resources.files(__package__) / "protocols"
    return sorted(f.name.removesuffix(".toml") for f in folder.iterdir() if f.name.endswith(".toml"))


def shipped(name: str, *, where: str | None = None) -> Protocol:
    """One of them as it ships.

    Raises:
        InputError: if there is none of that name.
    """
    if name not in protocol_names():
        known = protocol_names()
        raise InputError("protocol", name, f"{near(name, known)}known are {', '.join(known)}", where=where)
    return _shipped(name)


def protocol(name: str, **values: Any) -> Protocol:
    """One of them with other values of its parameters, such as ``protocol("quasi-static", pressure="5 bar")``.

    Raises:
        InputError: names what is unknown, out of bounds or in the wrong unit.
    """
    from .read import with_values

    return with_values(shipped(name), values)


@functools.cache
def _shipped(name: str) -> Protocol:
    from .read import parse_protocol

    file = resources.files(__package__) / "protocols" / f"{name}.toml"
    return parse_protocol(file.read_text(encoding="utf-8"), where=f"{name}.toml")
