"""Muscle models: braid, tension laws, friction with memory, passive elements, biological muscle."""

from .build import build_law as law
from .build import from_specimen, law_from_specimen
from .law import LawState, TensionLaw
from .laws import LAWS, law_type
from .muscle import Muscle

__all__ = ["LAWS", "LawState", "Muscle", "TensionLaw", "from_specimen", "law", "law_from_specimen", "law_type"]
