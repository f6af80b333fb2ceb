"""Numbers by which biological and artificial muscles are compared: per cross section and per volume.

Following the discussion of C.-P. Chou and B. Hannaford, IEEE Trans. Robotics and Automation 12(1), 1996,
doi:10.1109/70.481753. Lengths are relative to the rest length L0, tensions to a cross section, so a muscle's size
cancels. Everything here is computed from the curves; nothing is a constant of the paper.

The paper prints the ends of the dynamic range with two decimals, 0.64 and 1.12, and computes with these: 0.48 L0 and
35/0.48 = 73 N/(L0 cm2). Gordon's nodes are 0.635 and 1.125: 0.49 L0 and 71. `DynamicRange.rounded` gives the former,
`dynamic_range` the latter; the work density 0.126 J/cm3 (printed 0.13) is that of the nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from decimal import ROUND_HALF_EVEN, Decimal
from typing import Any, NamedTuple

import numpy as np

from ..components import derivative
from ..errors import InputError
from ..muscles.biological import BiologicalMuscle


class DynamicRange(NamedTuple):
    """The lengths over which a muscle shortens usefully, over its rest length [1]."""

    shortest: float
    longest: float

    @property
    def width(self) -> float:
        """Difference of the ends [1]."""
        return self.longest - self.shortest

    def rounded(self, decimals: int = 2) -> DynamicRange:
        """With ends as they would be printed; halves go to the even digit."""
        step = Decimal(1).scaleb(-decimals)
        # Nine decimals first: what the search leaves in the last bits must not decide a tie.
        ends = (Decimal(f"{end:.9f}").quantize(step, ROUND_HALF_EVEN) for end in self)
        return DynamicRange(*(float(end) for end in ends))


class PeakPower(NamedTuple):
    """Where shortening yields the most power."""

    fraction: float  # power over Fmax vmax [1]
    relative_velocity: float  # shortening velocity over vmax [1]


class Comparison(NamedTuple):
    """The rows in which Table 1 compares muscles [SI, lengths in rest lengths]."""

    dynamic_range: DynamicRange  # [L0]
    tension_intensity: float  # [N/m^2]
    stiffness_intensity: float  # [N/m^2 per L0]
    work_density: float  # [J/m^3] per shortening
    maximum_velocity: float  # [L0/s]
    peak_power_density: float  # [W/m^3]


def dynamic_range(curve: Callable[[Any], Any], *, search: tuple[float, float] = (0.0, 3.0)) -> DynamicRange:
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
        raise InputError(
            "curve", "no tension", f"allowed is a tension above 0 between {search[0]:g} and {search[1]:g} L0"
        )
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


def work_density(curve: Callable[[Any], Any], tension_intensity: float, over: DynamicRange | None = None) -> float:
    """Work of one slow shortening per volume of muscle [J/m^3]: the integral of tension over the dynamic range.

    Args:
        curve: relative tension against L/L0 [1].
        tension_intensity: tension per cross section where the curve is 1 [N/m^2].
        over: limits of the integral [L0]; the curve's own dynamic range where left out.

    Returns:
        The integral by 20,000 trapezoids, to 1e-8 of the result for curves with kinks.
    """
    from scipy.integrate import trapezoid

    ends = over or dynamic_range(curve)
    lengths = np.linspace(ends.shortest, ends.longest, 20001)
    return tension_intensity * float(trapezoid(np.asarray(curve(lengths)), lengths))


def peak_power(curve: Callable[[Any], Any]) -> PeakPower:
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
        fraction: power over Fmax vmax [1], such as McMahon's 0.1; from the muscle's own curve where left out.
    """
    share = peak_power(muscle.velocity_curve).fraction if fraction is None else fraction
    return share * float(muscle.maximum_tension_intensity) * float(muscle.maximum_velocity)


def comparison(muscle: BiologicalMuscle) -> Comparison:
    """What Table 1 says about biological muscle, computed for one [SI]."""
    ends = dynamic_range(muscle.active_curve)
    intensity = float(muscle.maximum_tension_intensity)
    return Comparison(
        dynamic_range=ends,
        tension_intensity=intensity,
        stiffness_intensity=stiffness_intensity(intensity, ends),
        work_density=work_density(muscle.active_curve, intensity, ends),
        maximum_velocity=float(muscle.maximum_velocity),
        peak_power_density=peak_power_density(muscle),
    )
