"""Muscle models: braid, tension laws, friction with memory, passive elements, biological muscle."""

from typing import TYPE_CHECKING

from .._lazy import lazy_names, lazy_submodules
from .build import law as law
from .build import law_from_specimen as law_from_specimen
from .law import LawState as LawState
from .law import PressureLaw as PressureLaw
from .law import TensionLaw as TensionLaw
from .laws import LAWS as LAWS
from .laws import law_type as law_type
from .muscle import Muscle as Muscle
from .muscle import from_specimen as from_specimen

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


lazy_submodules(__name__)
lazy_names(__name__)
