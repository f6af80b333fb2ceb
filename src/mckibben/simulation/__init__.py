"""Systems that one steps: mechanism, muscles and air behind a user's own controller.

import mckibben as mk

sim = mk.Simulation(mk.Joint("nylon", arm="2 cm"), mk.Air(supply="6 bar", valve="mpye-5-1/8"), period=2e-3)
seen = sim.reset(seed=0)
seen = sim.step(flexor=0.2, extensor=-0.1)
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .air import Air
    from .mechanisms import Chain, Joint, Link, Mechanism, Plate, Spring, Weight
    from .simulation import Simulation
    from .stepping import SimulationState

__all__ = ["Air", "Chain", "Joint", "Link", "Mechanism", "Plate", "Simulation", "SimulationState", "Spring", "Weight"]
_PLACES = {"Air": "air", "Simulation": "simulation", "SimulationState": "stepping"}


def __getattr__(name: str) -> Any:
    """Load a public name from the module that defines it."""
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(importlib.import_module(f"{__name__}.{_PLACES.get(name, 'mechanisms')}"), name)
    globals()[name] = value
    return value
