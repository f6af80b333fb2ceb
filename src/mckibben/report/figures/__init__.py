"""Figures, in the colours of the quantities; no other package draws."""

from typing import TYPE_CHECKING

from ..._lazy import lazy_names, lazy_submodules

if TYPE_CHECKING:
    from .muscle_figures import DrawnLoop as DrawnLoop
    from .muscle_figures import loop_figure as loop_figure
    from .recording_figures import time_figure as time_figure
    from .run_figures import joint_figure as joint_figure

lazy_submodules(__name__)
lazy_names(__name__)
