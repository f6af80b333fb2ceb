"""Muscle models: braid, tension laws, friction with memory, passive elements, biological muscle."""

from typing import TYPE_CHECKING

from .._lazy import lazy_submodules
from .build import build_law as law
from .build import from_specimen, law_from_specimen
from .law import LawState, TensionLaw
from .laws import LAWS, law_type
from .muscle import Muscle

if TYPE_CHECKING:
    from . import build as build
    from . import laws as laws
    from . import plausible as plausible
    from . import sleeve as sleeve

__all__ = ["LAWS", "LawState", "Muscle", "TensionLaw", "from_specimen", "law", "law_from_specimen", "law_type"]

lazy_submodules(__name__)
