"""Characterisation of an unknown muscle on a rig: stages, their evaluation, and the fitted specimen."""

from typing import TYPE_CHECKING

from ..._lazy import lazy_submodules

if TYPE_CHECKING:
    from . import evaluation as evaluation
    from . import readings as readings
    from . import stages as stages
    from . import verb as verb

lazy_submodules(__name__)
