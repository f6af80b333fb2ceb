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
            raise InputError(name, None, "needs at least one element that leads to it", where="circuit")
    if not any(isinstance(node, Chamber) for node in nodes.values()):
        raise InputError("nodes", None, "must have at least one volume; they are reservoirs only", where="circuit")
    for name, branch in branches.items():
        for i, j in branch.element.paths:
            a, b = branch.ports[i], branch.ports[j]
            if isinstance(nodes[a], Reservoir) and isinstance(nodes[b], Reservoir):
                raise InputError(
                    name,
                    None,
                    f"joins two supplies, {a} and {b}: a volume must lie between them",
                    where="circuit",
                )


def _closed(name: str, branch: Branch, nodes: Mapping[str, Reservoir | Chamber]) -> tuple[str, ...]:
    wanted = branch.element.ports
    if len(branch.ports) != len(wanted):
        raise InputError(name, ", ".join(branch.ports), "its ports are", known=wanted, where="circuit")
    for port, end in zip(wanted, branch.ports, strict=True):
        if end not in nodes:
            raise InputError(
                f"{name}.{port}", end, "this port leads to no node; nodes are", known=nodes, where="circuit"
            )
    if len(set(branch.ports)) < len(branch.ports):
        raise InputError(name, ", ".join(branch.ports), "two of its ports lead to the same node", where="circuit")
    if branch.element.commanded and branch.command is None:
        raise InputError(f"{name}.command", None, "is missing: a signal must drive it", where="circuit")
    if branch.command == f"{name}.command" and branch.element.delay() is not None:
        problem = "must be another name; this one is kept for the signal as it is after the dead time"
        raise InputError(f"{name}.command", branch.command, problem, where="circuit")
    return branch.ports
