"""mckibben: a laboratory for McKibben pneumatic artificial muscles.

The verbs of the command line are functions here; importing the package is light, heavy libraries load on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

__version__ = "0.1.0"

if TYPE_CHECKING:
    from .bench.run import run
    from .identification.fit import fit, fit_all
    from .muscles import law
    from .recordings import read_force_map
    from .reproduction import reproduce
    from .specimens import specimen

_HOMES = {
    "specimen": "specimens",
    "law": "muscles",
    "read_force_map": "recordings",
    "fit": "identification",
    "fit_all": "identification",
    "reproduce": "reproduction",
    "run": "bench.run",
}
__all__ = ["__version__", "fit", "fit_all", "law", "read_force_map", "reproduce", "run", "specimen"]


def __getattr__(name: str) -> Any:
    """Load a verb's room when it is first used."""
    if name in _HOMES:
        import importlib

        # `import mckibben.reproduction` would shadow nothing: the verbs and the rooms have different names.
        return getattr(importlib.import_module(f".{_HOMES[name]}", __name__), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    """The verbs, for completion."""
    return sorted(__all__)
