"""Muscle models: braid, tension laws, friction with memory, passive elements, biological muscle."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules
from .build import law, law_from_specimen
from .law import LawState, PressureLaw, TensionLaw
from .laws import LAWS, law_type
from .muscle import Muscle, from_specimen

if TYPE_CHECKING:
    from . import build as build
    from . import evidence as evidence
    from . import laws as laws
    from . import muscle as muscle
    from . import plausible as plausible
    from . import sleeve as sleeve
    from .elements import Tendon as Tendon
    from .learned import LearnedResidual as LearnedResidual
    from .sleeve import braid_laws as braid_laws

__all__ = [
    "LAWS",
    "LawState",
    "LearnedResidual",
    "Muscle",
    "Tendon",
    "PressureLaw",
    "TensionLaw",
    "braid_laws",
    "from_specimen",
    "law",
    "law_from_specimen",
    "law_type",
]

lazy_submodules(__name__)
lazy_names(__name__, {"elements": ["Tendon"], "learned": ["LearnedResidual"], "sleeve": ["braid_laws"]})
