"""What an object of a lower package offers and a package above it carries out: found by name when it is first used.

A muscle has a ``plot`` and a recording an ``energy``, although `muscles` and `recordings` import neither figures nor
analysis. Such a method names its implementation as ``"package.module:name"``, as pandas names its plotting backend.
"""

from __future__ import annotations

import functools
import importlib
from typing import Any, Generic, TypeVar, overload

T = TypeVar("T")


@functools.cache
def implementation(place: str) -> Any:
    """The object that a place names, its module loaded.

    Args:
        place: ``"module:name"``, the module relative to the package, such as ``"report.figures.plots:MusclePlots"``.
    """
    module, _, name = place.partition(":")
    return getattr(importlib.import_module(f"{__package__}.{module}"), name)


class Accessor(Generic[T]):
    """An attribute that is an object about its owner: the class at `place`, called with the owner.

    Args:
        place: of the class, see `implementation`.
    """

    def __init__(self, place: str) -> None:
        self.place = place

    @overload
    def __get__(self, owner: None, kind: type) -> Accessor[T]: ...
    @overload
    def __get__(self, owner: object, kind: type) -> T: ...
    def __get__(self, owner: object, kind: type) -> Accessor[T] | T:
        """The object about the owner; the accessor itself where the owner is a class."""
        if owner is None:
            return self
        about: T = implementation(self.place)(owner)
        return about
