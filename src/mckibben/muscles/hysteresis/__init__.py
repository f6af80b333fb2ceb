"""Friction of a braided muscle: one file per model, all under the interface `mckibben.components.element.Hysteresis`.

A model is advanced along the path and keeps its memory in an array; `Coulomb` alone has none. Every one of them is
passive, its limit may grow with the gas pressure, and `lubricated` scales that limit. `PlayMap` is no friction but
the same memory as a map from pressure to stroke.
"""

from ...components.element import Hysteresis
from .bouc_wen import BoucWen
from .coulomb import Coulomb
from .dahl import Dahl
from .limit import FrictionLimit
from .maxwell_slip import MaxwellSlip
from .prandtl_ishlinskii import PlayMap, PrandtlIshlinskii

# By the name of the module, as they are addressed.
HYSTERESES: dict[str, type[Hysteresis]] = {
    "bouc_wen": BoucWen,
    "coulomb": Coulomb,
    "dahl": Dahl,
    "maxwell_slip": MaxwellSlip,
    "prandtl_ishlinskii": PrandtlIshlinskii,
}

__all__ = [
    "HYSTERESES",
    "BoucWen",
    "Coulomb",
    "Dahl",
    "FrictionLimit",
    "MaxwellSlip",
    "PlayMap",
    "PrandtlIshlinskii",
]
