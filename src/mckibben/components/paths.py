"""Parameters by dotted path, such as ``elements.tube.loss``: the address that fits, sweeps and the command line share."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from .._jax import Scalar, Tree
from ..documents import JsonValue
from ..errors import InputError
from ..quantities import Quantity
from .module import Module


def parameters(owner: Tree, prefix: str = "") -> Iterator[tuple[str, Quantity]]:
    """Iterate over the declared parameters below an object as (dotted path, declaration)."""
    return ((path, q) for path, q, _ in declared_values(owner, prefix))


def declared_values(owner: Tree, prefix: str = "") -> Iterator[tuple[str, Quantity, Tree]]:
    """Iterate over the declared parameters below an object as (dotted path, declaration, value [SI])."""
    if isinstance(owner, Mapping):
        for name, value in owner.items():
            yield from declared_values(value, f"{prefix}{name}.")
    elif isinstance(owner, Module):
        for f in dataclasses.fields(owner):
            value = getattr(owner, f.name)
            if "quantity" in f.metadata:
                if value is None:  # a parameter that this one does not have
                    continue
                yield prefix + f.name, f.metadata["quantity"], value
            else:
                yield from declared_values(value, f"{prefix}{f.name}.")


def resolved(owner: Tree) -> dict[str, dict[str, JsonValue]]:
    """Return value [SI] and unit of every parameter below an object, by dotted path."""
    known = declared_values(owner)
    return {path: {"value": np.asarray(value).tolist(), "unit": q.unit} for path, q, value in known}


def declaration(owner: Tree, path: str) -> Quantity:
    """The declaration of the parameter at a path; raises `InputError` with the nearest known paths."""
    known = dict(parameters(owner))
    if path not in known:
        import difflib

        near = difflib.get_close_matches(path, known, n=3) or sorted(known)
        raise InputError("parameter", path, known=near)
    return known[path]


def get(owner: Tree, path: str) -> Tree:
    """The value at a dotted path [SI]; a name in a table may have dots itself."""
    while path:
        head, path = _first(owner, path)
        owner = owner[head] if isinstance(owner, Mapping) else getattr(owner, head)
    return owner


def put(owner: Tree, changes: Mapping[str, Scalar]) -> Tree:
    """A copy with the values at some dotted paths replaced [SI]; they may be traced."""
    for path, value in changes.items():
        owner = _put(owner, path, value)
    return owner


def _put(owner: Tree, path: str, value: Any) -> Any:
    head, rest = _first(owner, path)
    if isinstance(owner, Mapping):
        return {**owner, head: _put(owner[head], rest, value) if rest else value}
    return owner.replace(**{head: _put(getattr(owner, head), rest, value) if rest else value})


def _first(owner: Tree, path: str) -> tuple[str, str]:
    """The part of a path that belongs to an object, the longest of its names that fits, and what follows."""
    head, _, rest = path.partition(".")
    if isinstance(owner, Mapping):
        head = max((name for name in owner if f"{path}.".startswith(f"{name}.")), key=len, default=head)
        rest = path[len(head) + 1 :]
    return head, rest
