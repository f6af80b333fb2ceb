"""Which muscle, tube and valve: a front of response time, air per cycle and efficiency."""

from .front import dominated
from .study import Design, DesignStudy, design_study, design_sweep

__all__ = ["Design", "DesignStudy", "design_study", "design_sweep", "dominated"]
