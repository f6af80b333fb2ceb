"""Friction of a braided muscle: one file per model, all under the interface `mckibben.components.element.Hysteresis`.

A model is advanced along the path and keeps its memory in an array; `Coulomb` alone has none. Every one of them is
passive, its limit may grow with the gas pressure, and `lubricated` scales that limit. `PlayMap` is no friction but
the same memory as a map from pressure to stroke.
"""

from ...components.element import Hysteresis
from ...registry import Registry
from .bouc_wen import BoucWen
from .coulomb import Coulomb
from .dahl import Dahl
from .maxwell_slip import MaxwellSlip
from .prandtl_ishlinskii import PlayMap, PrandtlIshlinskii
from .slip import FrictionLimit


def _required_of_friction(kind: object) -> str | None:
    if not (isinstance(kind, type) and issubclass(kind, Hysteresis)):
        return "a class derived from mckibben.components.Hysteresis"
    missing = sorted(getattr(kind, "__abstractmethods__", ()))
    return f"complete; missing: {', '.join(missing)}" if missing else None


# By the name of the module, as they are addressed; those of installed packages and of a user's files too.
HYSTERESES: Registry[type[Hysteresis]] = Registry(
    "mckibben.frictions",
    "friction",
    {
        "bouc_wen": BoucWen,
        "coulomb": Coulomb,
        "dahl": Dahl,
        "maxwell_slip": MaxwellSlip,
        "prandtl_ishlinskii": PrandtlIshlinskii,
    },
    accept=_required_of_friction,
)

__all__ = ["HYSTERESES", "BoucWen", "Coulomb", "Dahl", "FrictionLimit", "MaxwellSlip", "PlayMap", "PrandtlIshlinskii"]
