"""Systems that one steps: mechanism, muscles and air behind a user's own controller.

import mckibben as mk

sim = mk.Simulation(mk.Joint("nylon", arm="2 cm"), mk.Air(supply="6 bar", valve="mpye-5-1/8"), period=2e-3)
seen = sim.reset(seed=0)
seen = sim.step(flexor=0.2, extensor=-0.1)
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .._lazy import lazy_names

if TYPE_CHECKING:
    from .air import Air as Air
    from .estimator import Estimator as Estimator
    from .fit import SimulationFit as SimulationFit
    from .linear import SampledModel as SampledModel
    from .mechanisms import Chain as Chain
    from .mechanisms import Joint as Joint
    from .mechanisms import Link as Link
    from .mechanisms import Mechanism as Mechanism
    from .mechanisms import Plate as Plate
    from .mechanisms import Spring as Spring
    from .mechanisms import Weight as Weight
    from .readouts import Readout as Readout
    from .simulation import Simulation as Simulation
    from .stepping import SimulationState as SimulationState

lazy_names(__name__)
