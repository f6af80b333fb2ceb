"""Characterisation of an unknown muscle on a rig: stages, their evaluation, and the fitted specimen."""

from typing import TYPE_CHECKING

from ..._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from . import evaluation as evaluation
    from . import readings as readings
    from . import stages as stages
    from . import verb as verb
    from .readings import characterise_like as characterise_like
    from .readings import measure_cord as measure_cord

lazy_submodules(__name__)
lazy_names(__name__)
