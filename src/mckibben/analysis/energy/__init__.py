"""Energy of working cycles, Part IV of the paper: input, output, and losses.

    muscle = cycle_muscle(law, "potential")
    one = energy_cycle(muscle, "maximal", Conditions(pressure=5e5, stretched_length=0.155, friction=2.5))
    one.input, one.output, one.efficiency

Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753, and the
longer report of the same work, whose Part IV this is.
"""

from ..._lazy import lazy_submodules
from .cycles import (
    CYCLES,
    READINGS,
    VOLUMES,
    Conditions,
    CycleMuscle,
    EnergyCycle,
    cycle_muscle,
    energy_cycle,
    has_paper_volume,
)
from .working_cycles import (
    LOSSES,
    CycleLoops,
    CyclePath,
    EnergyCurve,
    WorkingCycles,
    best_pressure,
    cycle_loops,
    energy,
    energy_curve,
    zero_pressure,
)

__all__ = [
    "CYCLES",
    "LOSSES",
    "READINGS",
    "VOLUMES",
    "Conditions",
    "CycleLoops",
    "CycleMuscle",
    "CyclePath",
    "EnergyCurve",
    "EnergyCycle",
    "WorkingCycles",
    "best_pressure",
    "cycle_loops",
    "cycle_muscle",
    "energy",
    "energy_curve",
    "energy_cycle",
    "has_paper_volume",
    "zero_pressure",
]

lazy_submodules(__name__)
