"""Numbers that describe a static law: range, strength, stiffness, work, and the same per section and volume.

These are the rows of Table 1 of C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996,
doi:10.1109/70.481753, computed from any law.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from decimal import ROUND_HALF_EVEN, Decimal
from typing import NamedTuple

import numpy as np

from .._jax import Scalar
from ..components import derivative
from ..errors import InputError
from ..muscles.biological import BiologicalMuscle
from ..muscles.law import TensionLaw


class StaticCharacteristics(NamedTuple):
    """A column of Table 1 [SI]; lengths and stiffness also over the rest length L0."""

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


class DynamicRange(NamedTuple):
    """The lengths over which a muscle shortens usefully, over its rest length [1]."""

    shortest: float
    longest: float

    @property
    def width(self) -> float:
        """Difference of the ends [1]."""
        return self.longest - self.shortest

    def rounded(self, decimals: int = 2) -> DynamicRange:
        """Return a copy with the ends rounded as in print; halves go to the even digit."""
        step = Decimal(1).scaleb(-decimals)
        # Nine decimals first: what the search leaves in the last bits must not decide a tie.
        ends = (Decimal(f"{end:.9f}").quantize(step, ROUND_HALF_EVEN) for end in self)
        return DynamicRange(*(float(end) for end in ends))


class PeakPower(NamedTuple):
    """Largest power of shortening, and the conditions at which it occurs."""

    fraction: float  # power over Fmax vmax [1]
    relative_velocity: float  # shortening velocity over vmax [1]


class BiologicalCharacteristics(NamedTuple):
    """The rows in which Table 1 compares muscles [SI, lengths in rest lengths]."""

    dynamic_range: DynamicRange  # [L0]
    tension_intensity: float  # [N/m^2]
    stiffness_intensity: float  # [N/m^2 per L0]
    work_density: float  # [J/m^3] per shortening
    maximum_velocity: float  # [L0/s]
    peak_power_density: float  # [W/m^3]


def dynamic_range(curve: Callable[[Scalar], Scalar], *, search: tuple[float, float] = (0.0, 3.0)) -> DynamicRange:
    """The stretch of a tension-length curve that carries tension and does not fall: found, not assumed.

    Args:
        curve: tension against L/L0 [1], elementwise and differentiable; its scale does not matter.
        search: where to look [1]. A curve that is already rising at an end is cut there.

    Returns:
        The ends to 1e-12 for a curve whose features are wider than a thousandth of the search.

    Raises:
        InputError: if the curve is nowhere positive.
    """
    steps = 3001
    lengths = np.linspace(*search, steps)
    tension = np.asarray(curve(lengths))
    if not tension.max() > 0.0:
        raise InputError("curve", None, f"must have a tension above 0 N between {search[0]:g} and {search[1]:g} L0")
    flat = 1e-9 * float(np.abs(np.asarray(derivative(curve, lengths))).max())

    def carries(x: np.ndarray) -> np.ndarray:
        return (np.asarray(curve(x)) > 0.0) & (np.asarray(derivative(curve, x)) >= -flat)

    inside = carries(lengths)
    # The rise that leads to the top; the top itself may lie between two points or on a kink.
    top = int(np.argmax(tension))
    top = top if inside[top] or top == 0 else top - 1
    falls = np.flatnonzero(~inside)
    before, after = falls[falls < top], falls[falls > top]
    low = float(lengths[0]) if before.size == 0 else _edge(carries, lengths[before[-1]], lengths[before[-1] + 1])
    high = float(lengths[-1]) if after.size == 0 else _edge(carries, lengths[after[0]], lengths[after[0] - 1])
    return DynamicRange(low, high)


def _edge(carries: Callable[[np.ndarray], np.ndarray], outside: float, inside: float) -> float:
    """The border between a point outside and one inside, by four divisions into a thousand."""
    for _ in range(4):
        points = np.linspace(outside, inside, 1001)
        first = max(int(np.argmax(carries(points))), 1)
        outside, inside = points[first - 1], points[first]
    return float(inside)


def stiffness_intensity(tension_intensity: float, over: DynamicRange) -> float:
    """Average slope of tension per cross section over the dynamic range [N/m^2 per L0].

    Args:
        tension_intensity: rise of the tension across the range per cross section [N/m^2].
        over: the dynamic range [L0].
    """
    return tension_intensity / over.width


def work_density(
    curve: Callable[[Scalar], Scalar], tension_intensity: float, over: DynamicRange | None = None
) -> float:
    """Work of one slow shortening per volume of muscle [J/m^3]: the integral of tension over the dynamic range.

    Args:
        curve: relative tension against L/L0 [1].
        tension_intensity: tension per cross section where the curve is 1 [N/m^2].
        over: limits of the integral [L0]; the curve's own dynamic range by default.

    Returns:
        The integral by 20,000 trapezoids, to 1e-8 of the result for curves with kinks.
    """
    from scipy.integrate import trapezoid

    ends = over or dynamic_range(curve)
    lengths = np.linspace(ends.shortest, ends.longest, 20001)
    return tension_intensity * float(trapezoid(np.asarray(curve(lengths)), lengths))


def peak_power(curve: Callable[[Scalar], Scalar]) -> PeakPower:
    """The largest product of tension and shortening velocity on a tension-velocity curve.

    Args:
        curve: relative tension against dL/dt over vmax [1], shortening negative.
    """
    from scipy.optimize import minimize_scalar

    best = minimize_scalar(
        lambda u: -u * float(curve(-u)), bounds=(0.0, 1.0), method="bounded", options={"xatol": 1e-10}
    )
    return PeakPower(fraction=-float(best.fun), relative_velocity=float(best.x))


def peak_power_density(muscle: BiologicalMuscle, *, fraction: float | None = None) -> float:
    """Largest shortening power per volume at full activation and rest length [W/m^3].

    Args:
        muscle: gives tension intensity and largest velocity.
        fraction: power over Fmax vmax [1], such as McMahon's 0.1; from the muscle's own curve by default.
    """
    share = peak_power(muscle.velocity_curve).fraction if fraction is None else fraction
    return share * float(muscle.maximum_tension_intensity) * float(muscle.maximum_velocity)


def comparison(muscle: BiologicalMuscle) -> BiologicalCharacteristics:
    """Compute the rows of Table 1 for a biological muscle [SI]."""
    ends = dynamic_range(muscle.active_curve)
    intensity = float(muscle.maximum_tension_intensity)
    return BiologicalCharacteristics(
        dynamic_range=ends,
        tension_intensity=intensity,
        stiffness_intensity=stiffness_intensity(intensity, ends),
        work_density=work_density(muscle.active_curve, intensity, ends),
        maximum_velocity=float(muscle.maximum_velocity),
        peak_power_density=peak_power_density(muscle),
    )
