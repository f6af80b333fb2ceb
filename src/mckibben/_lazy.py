"""Modules, and public names of packages, that are loaded when they are first asked for."""

from __future__ import annotations

import importlib
import os
import sys
import types
from typing import Any

_OWN_NAMES: Any = vars(types.ModuleType)["__dict__"].__get__  # of a module that stands for another one


class LazyModule(types.ModuleType):
    """A module by its full name, imported at the first look-up of one of its attributes."""

    def __getattr__(self, name: str) -> Any:
        if name in ("__path__", "__file__", "__wrapped__"):  # as `inspect` and `doctest` ask of whatever they meet
            raise AttributeError(name)
        return getattr(self._loaded(), name)

    def __setattr__(self, name: str, value: Any) -> None:
        setattr(self._loaded(), name, value)

    def __delattr__(self, name: str) -> None:
        delattr(self._loaded(), name)

    @property
    def __dict__(self) -> dict[str, Any]:  # type: ignore[override]
        """The names of the module itself, in which `vars` and `dir` look."""
        return vars(self._loaded())

    def _loaded(self) -> types.ModuleType:
        own = _OWN_NAMES(self)
        module: types.ModuleType | None = own.get("_module")
        if module is None:
            module = own["_module"] = importlib.import_module(self.__name__)
        return module


def lazy_submodules(package: str) -> None:
    """Let ``from package import module`` give modules that are imported at their first use.

    For packages that hold what computes or draws, from which a command needs one module at most, and none for its help.
    Their `public_names` are listed in ``__all__``.

    Args:
        package: the full name of the package, ``__name__`` in its ``__init__``.
    """
    room = sys.modules[package]
    for folder in room.__path__:
        for entry in os.scandir(folder):
            name, _, ending = entry.name.partition(".")
            whole = f"{package}.{name}"
            if ending == "py" or (entry.is_dir() and not ending and not name.startswith("__")):
                if not name.startswith("__") and whole not in sys.modules and not hasattr(room, name):
                    setattr(room, name, LazyModule(whole))
    vars(room).setdefault("__all__", sorted(public_names(package)))


def public_names(package: str) -> dict[str, str]:
    """Where the public names of a package are, as ``module:name`` with the dots of a relative import.

    They are those that its ``__init__`` imports for type checkers as ``from .module import name as name``, read from there.
    """
    room: Any = sys.modules[package]
    places = {}
    for line in room.__loader__.get_data(room.__file__).decode().splitlines():  # to parse it a library would be loaded
        match line.split():
            case ["from", module, "import", name, "as", known, *_] if module.strip(".") and not known.startswith("_"):
                places[known] = f"{module}:{name}"
    return places


def lazy_names(package: str) -> None:
    """Let a package have its `public_names`, each loaded when it is first used, and list them in ``__all__``.

    Args:
        package: the full name of the package, ``__name__`` in its ``__init__``. No name is that of a module of the package.
    """
    room = sys.modules[package]
    places = public_names(package)

    def load(name: str) -> Any:
        if name not in places:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        module, _, attribute = places[name].partition(":")
        value = getattr(importlib.import_module(module, package), attribute)
        setattr(room, name, value)
        return value

    vars(room).setdefault("__all__", sorted(places))
    setattr(room, "__getattr__", load)  # noqa: B010  # the type of a module has no such attribute
