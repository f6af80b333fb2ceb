"""Energy of working cycles, Part IV of the paper: input, output, and losses.

    muscle = cycle_muscle(law, "potential")
    one = energy_cycle(muscle, "maximal", Conditions(pressure=5e5, stretched_length=0.155, friction=2.5))
    one.input, one.output, one.efficiency

Source: C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996, doi:10.1109/70.481753, and the
longer report of the same work, whose Part IV this is.
"""

from ..._lazy import lazy_submodules
from .cycles import CYCLES as CYCLES
from .cycles import READINGS as READINGS
from .cycles import Conditions as Conditions
from .cycles import CycleMuscle as CycleMuscle
from .cycles import EnergyCycle as EnergyCycle
from .cycles import cycle_muscle as cycle_muscle
from .cycles import energy_cycle as energy_cycle
from .working_cycles import CycleLoops as CycleLoops
from .working_cycles import CyclePath as CyclePath
from .working_cycles import EnergyCurve as EnergyCurve
from .working_cycles import WorkingCycles as WorkingCycles
from .working_cycles import best_pressure as best_pressure
from .working_cycles import cycle_loops as cycle_loops
from .working_cycles import energy as energy
from .working_cycles import energy_curve as energy_curve
from .working_cycles import zero_pressure as zero_pressure

lazy_submodules(__name__)
