"""Checks of a network's topology: closed at every node, driven, and without short-circuited supplies."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ..errors import InputError
from .volume import Chamber, Reservoir

if TYPE_CHECKING:
    from .circuit import Branch


def check_topology(nodes: Mapping[str, Reservoir | Chamber], branches: Mapping[str, Branch]) -> None:
    """Raise `InputError` that names the element or node, and what is wrong with it."""
    touched = {end for name, branch in branches.items() for end in _closed(name, branch, nodes)}
    for name in nodes:
        if name not in touched:
            raise InputError(name, "no element", "a node needs at least one element that leads to it", where="circuit")
    if not any(isinstance(node, Chamber) for node in nodes.values()):
        raise InputError("nodes", "reservoirs only", "a circuit needs at least one volume", where="circuit")
    for name, branch in branches.items():
        for i, j in branch.element.paths:
            a, b = branch.ports[i], branch.ports[j]
            if isinstance(nodes[a], Reservoir) and isinstance(nodes[b], Reservoir):
                raise InputError(
                    name, f"{a} - {b}", "two supplies in short circuit; a volume must lie between them", where="circuit"
                )


def _closed(name: str, branch: Branch, nodes: Mapping[str, Reservoir | Chamber]) -> tuple[str, ...]:
    wanted = branch.element.ports
    if len(branch.ports) != len(wanted):
        raise InputError(name, ", ".join(branch.ports), f"its ports are {', '.join(wanted)}", where="circuit")
    for port, end in zip(wanted, branch.ports, strict=True):
        if end not in nodes:
            raise InputError(
                f"{name}.{port}", end, f"this port leads to no node; known are {', '.join(nodes)}", where="circuit"
            )
    if len(set(branch.ports)) < len(branch.ports):
        raise InputError(name, ", ".join(branch.ports), "two of its ports lead to the same node", where="circuit")
    if branch.element.commanded and branch.command is None:
        raise InputError(f"{name}.command", "missing", "a signal must drive it", where="circuit")
    if branch.command == f"{name}.command" and branch.element.delay() is not None:
        raise InputError(
            f"{name}.command",
            "the name of its signal",
            "this name is kept for the signal as it is after the dead time; give the signal another one",
            where="circuit",
        )
    return branch.ports
