"""Tension laws, one file each, named after their authors.

`LAWS` has them by the name under which they are addressed, those of installed packages too (entry points of the group
``mckibben.laws``); a module is loaded on first use.
"""

from __future__ import annotations

from ...registry import Registry
from ..law import TensionLaw, required_of_law

LAWS: Registry[type[TensionLaw]] = Registry(
    "mckibben.laws",
    "law",
    {
        "ideal": f"{__name__}.ideal:Ideal",
        "thick_wall": f"{__name__}.thick_wall:ThickWall",
        "gas_spring": f"{__name__}.gas_spring:GasSpring",
        "linear_threshold": f"{__name__}.linear_threshold:LinearThreshold",
        "tondu_lopez": f"{__name__}.tondu_lopez:TonduLopez",
        "martens_boblan": f"{__name__}.martens_boblan:MartensBoblan",
        "hyperelastic_braid": f"{__name__}.hyperelastic_braid:HyperelasticBraid",
        "seated_braid": f"{__name__}.seated_braid:SeatedBraid",
        "seated_hyperelastic_braid": f"{__name__}.seated_hyperelastic_braid:SeatedHyperelasticBraid",
        "sarosi": f"{__name__}.sarosi:Sarosi",
        "three_element": f"{__name__}.three_element:ThreeElement",
    },
    accept=required_of_law,
)


def law_key(law: str | type[TensionLaw]) -> str:
    """The name of a law that is given by its name or as its class; a class of one's own gets a name for this process."""
    return law if isinstance(law, str) else LAWS.register(law)


def law_type(name: str) -> type[TensionLaw]:
    """The class of a law by its name.

    Raises:
        InputError: there is none of that name.
    """
    return LAWS.find(name)
