"""Numbers that describe a static law: range, strength, stiffness, work, and the same per section and volume.

These are the rows of Table 1 of C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996,
doi:10.1109/70.481753, computed from any law.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..muscles.law import TensionLaw


class StaticCharacteristics(NamedTuple):
    """One column of Table 1 [SI]; lengths and stiffness also over the rest length L0."""

    rest_length: float  # [m]
    zero_tension_length: float  # [m]
    upper_length: float  # [m]
    dynamic_range: float  # [L0]
    maximum_tension: float  # [N]
    stiffness: float  # [N per L0]
    work: float  # [N L0]
    section_area: float  # [m^2]
    tension_intensity: float  # [N/m^2]
    stiffness_intensity: float  # [N/m^2 per L0]
    work_density: float  # [J/m^3]


def static_characteristics(
    law: TensionLaw, *, pressure: float, rest_length: float, upper_length: float, section_area: float
) -> StaticCharacteristics:
    """Table 1 for one muscle.

    Args:
        law: its tension law.
        pressure: gauge pressure [Pa].
        rest_length: L0 [m].
        upper_length: upper end of the working range [m].
        section_area: cross section at maximal shortening [m^2], the space the muscle takes in a limb.

    Returns:
        Stiffness is the mean slope between the zero-tension length and the upper end.
    """
    shortest = float(law.free_length(pressure))
    strongest = float(law.tension(upper_length, pressure))
    stiffness = strongest / (upper_length - shortest)
    work = work_of_shortening(law, pressure=pressure, longest=upper_length, shortest=shortest)
    return StaticCharacteristics(
        rest_length=rest_length,
        zero_tension_length=shortest,
        upper_length=upper_length,
        dynamic_range=(upper_length - shortest) / rest_length,
        maximum_tension=strongest,
        stiffness=stiffness * rest_length,
        work=work / rest_length,
        section_area=section_area,
        tension_intensity=strongest / section_area,
        stiffness_intensity=stiffness * rest_length / section_area,
        work_density=work / (section_area * rest_length),
    )


def circle_area(diameter: float) -> float:
    """Area of a round cross section [m^2]; diameter [m]."""
    return 0.25 * np.pi * diameter**2


def work_of_shortening(law: TensionLaw, *, pressure: float, longest: float, shortest: float) -> float:
    """Work at constant pressure from the longest to the shortest length [J]; gauge pressure [Pa], lengths [m]."""
    nodes, weights = np.polynomial.legendre.leggauss(64)
    lengths = shortest + 0.5 * (longest - shortest) * (nodes + 1.0)
    return float(0.5 * (longest - shortest) * weights @ np.asarray(law.tension(lengths, pressure)))


def stiffness_per_pressure(law: TensionLaw, *, lengths: Sequence[float], pressure: float) -> float:
    """Least-squares slope of dF/dP' over length, Kg [m]; lengths [m], gauge pressure [Pa]."""
    at = np.asarray(lengths, float)
    per_pressure = np.asarray(law.tension(at, pressure)) / pressure
    return float(np.polyfit(at, per_pressure, 1)[0])
