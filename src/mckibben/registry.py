"""Registries of kinds by name: those of this package, and those that installed packages add by entry points.

A package that has a tension law, a valve, a step of a protocol, a sensor or an import format of its own names it in its
``pyproject.toml``::

    [project.entry-points."mckibben.laws"]
    my_law = "my_package.laws:MyLaw"

The groups are ``mckibben.laws``, ``mckibben.valves``, ``mckibben.steps``, ``mckibben.sensors`` and ``mckibben.formats``.
"""

from __future__ import annotations

import functools
import importlib
from collections.abc import Iterator, Mapping
from typing import Any, Generic, TypeVar

from .errors import InputError, suggest

T = TypeVar("T")


@functools.cache
def plugins(group: str) -> dict[str, Any]:
    """Load what installed packages add to a group, by name.

    Raises:
        InputError: an entry point names what cannot be imported.
    """
    loaded = {}
    for point in _entry_points():
        if point.group != group:
            continue
        try:
            loaded[point.name] = point.load()
        except (ImportError, AttributeError) as error:
            demand = f"the entry point {point.value} of {group} cannot be loaded: {error}"
            raise InputError(point.name, point.value, demand, sentence=f"{point.name}: {demand}") from None
    return loaded


@functools.cache
def _entry_points() -> tuple[Any, ...]:
    """Entry points of the package's groups; searching all installed packages takes some milliseconds."""
    from importlib.metadata import distributions

    every = (point for package in distributions() for point in package.entry_points)
    return tuple(point for point in every if point.group.startswith("mckibben."))


class Registry(Mapping[str, T], Generic[T]):
    """Kinds by name, those of this package first.

    Args:
        group: group of the entry points.
        noun: what a kind is called in an error message, such as ``law``.
        known: kinds of this package; a text ``module:name`` is imported on demand.
    """

    def __init__(self, group: str, noun: str, known: Mapping[str, T | str]) -> None:
        self.group, self.noun = group, noun
        self._known: dict[str, Any] = dict(known)

    def __getitem__(self, name: str) -> T:
        if name not in self._known:
            kind: T = plugins(self.group)[name]
            return kind
        entry = self._known[name]
        if isinstance(entry, str):
            module, _, attribute = entry.partition(":")
            entry = self._known[name] = getattr(importlib.import_module(module), attribute)
        result: T = entry
        return result

    def __contains__(self, name: object) -> bool:
        return name in self._known or name in plugins(self.group)

    def __iter__(self) -> Iterator[str]:
        return iter((*self._known, *(name for name in plugins(self.group) if name not in self._known)))

    def __len__(self) -> int:
        return len(list(iter(self)))

    def add(self, name: str, kind: T) -> None:
        """Add a kind for this process, as a script or a test does; a package names it as an entry point instead.

        Raises:
            InputError: there is one of that name.
        """
        if name in self._known:
            raise InputError(self.noun, name, f"another {self.noun} has that name")
        self._known[name] = kind

    def own(self) -> tuple[T, ...]:
        """Kinds of this package and registered ones, without a search for installed packages."""
        return tuple(self[name] for name in self._known)

    def find(self, name: str, *, field: str = "", where: str | None = None) -> T:
        """The kind of a name.

        Args:
            name: name of the kind.
            field: dotted path for an error message; the noun where it is left out.
            where: file for an error message.

        Raises:
            InputError: there is none of that name.
        """
        if name not in self:
            raise InputError(field or self.noun, name, f"{suggest(name, self)}known are {', '.join(self)}", where=where)
        return self[name]
