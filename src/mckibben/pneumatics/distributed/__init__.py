"""The distributed tube: one-dimensional compressible flow with friction and heat exchange, a reference for lumped tubes.

A tube from a reservoir into a vessel::

    tube = DistributedTube(length=1.0, diameter=3.175e-3, cells=50, wall="wall_heat")
    supply = ReservoirEnd(pressure_abs=6e5, opening=OpenBore(entry_loss=0.5))
    result = simulate(tube, supply, VesselEnd(volume=1.64e-4), duration=1.0, sample_period=1e-3, pressure_abs=1e5)
"""

from .ends import ClosedEnd, End, OpenBore, Opening, ReservoirEnd, Restriction, VesselEnd
from .tube import DistributedTube, EndRecord, TubeBalance, TubeResult, simulate

__all__ = [
    "TubeBalance",
    "ClosedEnd",
    "DistributedTube",
    "End",
    "EndRecord",
    "OpenBore",
    "Opening",
    "ReservoirEnd",
    "Restriction",
    "TubeResult",
    "VesselEnd",
    "simulate",
]
