"""JAX functions as native kernels: traced once, simplified, and written as vector code with one run in each lane.

    import lanewise

    run = lanewise.compile(function, *examples)     # a JAX function of trees, and trees like its arguments
    results = run(*arguments, lanes=100_000)        # a leaf with one more axis than its example has a value per lane

Names are loaded when they are first asked for: a saved `Program` is loaded and run without JAX.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from .errors import ArgumentError, CacheWarning, DriverError, LanewiseError, LoweringError, UnavailableError

if TYPE_CHECKING:
    from ._adjoint import adjoint
    from ._c import CFunction, CLibrary, dotted_path, to_c, to_c_library
    from ._compiled import CompiledFunction, Derivatives, compile, differentiable, lower
    from ._derivatives import tangents
    from ._gpu import to_gpu, to_ptx
    from ._program import Leaf, Program

__version__ = "1.0.0"
__all__ = [
    "ArgumentError", "CFunction", "CLibrary", "CacheWarning", "CompiledFunction", "Derivatives", "DriverError",
    "LanewiseError", "Leaf", "LoweringError", "Program", "UnavailableError", "adjoint", "compile", "differentiable",
    "dotted_path", "lower", "tangents", "to_c", "to_c_library", "to_gpu", "to_ptx",
]  # fmt: skip
_MODULES = {
    "CFunction": "_c",
    "dotted_path": "_c",
    "CLibrary": "_c",
    "CompiledFunction": "_compiled",
    "Derivatives": "_compiled",
    "Leaf": "_program",
    "Program": "_program",
    "adjoint": "_adjoint",
    "compile": "_compiled",
    "differentiable": "_compiled",
    "lower": "_compiled",
    "tangents": "_derivatives",
    "to_c": "_c",
    "to_c_library": "_c",
    "to_gpu": "_gpu",
    "to_ptx": "_gpu",
}


def __getattr__(name: str) -> object:
    """Load a public name from the module that defines it."""
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
    globals()[name] = value
    return value
