"""Tension laws, one file each, named after their authors.

``LAWS`` lists them by the name under which they are addressed; the module is loaded on first use.
"""

from __future__ import annotations

import difflib
import importlib

from ...errors import InputError
from ..law import TensionLaw

LAWS = {
    "ideal": "Ideal",
    "thick_wall": "ThickWall",
    "gas_spring": "GasSpring",
    "linear_threshold": "LinearThreshold",
    "tondu_lopez": "TonduLopez",
    "martens_boblan": "MartensBoblan",
    "hyperelastic_braid": "HyperelasticBraid",
    "seated_braid": "SeatedBraid",
    "sarosi": "Sarosi",
    "three_element": "ThreeElement",
}


def law_type(name: str) -> type[TensionLaw]:
    """The class of a law by its name."""
    if name not in LAWS:
        near = difflib.get_close_matches(name, LAWS, n=1)
        hint = f"did you mean {near[0]}? " if near else ""
        raise InputError("law", name, f"{hint}known are {', '.join(LAWS)}")
    module = importlib.import_module(f".{name}", __package__)
    found: type[TensionLaw] = getattr(module, LAWS[name])
    return found
