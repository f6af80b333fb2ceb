"""Lumped models of a tube, one file each, with one interface: three of the paper, and one more accurate."""

from .inertial import InertialTube
from .linear import LinearTube
from .lumped import LumpedTube
from .quadratic import QuadraticTube

TUBES = {"linear": LinearTube, "quadratic": QuadraticTube, "inertial": InertialTube, "lumped": LumpedTube}

__all__ = ["TUBES", "InertialTube", "LinearTube", "LumpedTube", "QuadraticTube"]
