"""Parameters that several laws share, each declared here once."""

from __future__ import annotations

from typing import Any

from .._jax import Scalar
from ..quantities import Quantity, quantity

REST_LENGTH = Quantity("m", (1e-3, 100.0), "length at rest", "L0", (1e-3, 100.0), 1)


def thread_length() -> Scalar:
    """Length of one thread b [m]."""
    length: Scalar = quantity("m", (1e-3, 100.0), "length of one thread", symbol="b", typical=(0.05, 1.0), along=1)
    return length


def turns() -> Scalar:
    """Turns of one thread around the braid n [1]."""
    meaning = "turns of one thread around the braid"
    turns: Scalar = quantity("1", (0.05, 1e3), meaning, symbol="n", typical=(0.8, 8.0), along=1)
    return turns


def rest_length() -> Scalar:
    """Length at rest L0 [m]."""
    unit, bounds, meaning, symbol, _, along = REST_LENGTH
    length: Scalar = quantity(unit, bounds, meaning, symbol=symbol, along=along)
    return length


def upper_length() -> Scalar:
    """Upper working length Lu [m]: the end of the range, where a stop begins."""
    length: Scalar = quantity("m", (1e-3, 100.0), "upper working length, where a stop begins", symbol="Lu", along=1)
    return length


def rest_diameter() -> Scalar:
    """Inner diameter at rest D0 [m]."""
    diameter: Scalar = quantity("m", (1e-4, 1.0), "inner diameter at rest", symbol="D0", typical=(5e-3, 4e-2))
    return diameter


def rubber_wall() -> Scalar:
    """Thickness of the rubber wall h [m]; 1.8 mm is that of Festo muscles."""
    wall: Scalar = quantity("m", (1e-5, 0.05), "thickness of the rubber wall", symbol="h", default=1.8e-3)
    return wall


def rest_angle(typical: tuple[float, float], **options: Any) -> Scalar:
    """Braid angle at rest theta0 [rad], with the range usual for a law's muscles."""
    meaning = "braid angle at rest, from the long axis"
    angle: Scalar = quantity("rad", (0.05, 1.5), meaning, symbol="theta0", typical=typical, **options)
    return angle


def rest_volume() -> Scalar:
    """Gas volume at rest length V0 [m^3], needed only for the volume itself and zero where unknown."""
    meaning = "gas volume at rest length; needed only for the volume itself"
    volume: Scalar = quantity("m^3", (0.0, 1.0), meaning, symbol="V0", default=0.0, along=1)
    return volume


def stop_stiffness() -> Scalar:
    """Coefficient of the end non-linearity knl [N/m^2], zero where none was inferred."""
    stiffness: Scalar = quantity(
        "N/m^2", (0.0, 1e12), "coefficient of the end non-linearity nl(L)", symbol="knl", default=0.0, along=-2
    )
    return stiffness


def threshold_width(default: float = 1e4) -> Scalar:
    """Range of pressure around the threshold over which the bladder reaches the braid, w [Pa]."""
    meaning = "range of pressure around the threshold in which the bladder fills to the braid"
    width: Scalar = quantity("Pa", (1e2, 1e6), meaning, symbol="w", default=default)
    return width


def seat_compliance(**options: Any) -> Scalar:
    """Take-up of both ends per square root of load q [m/N^0.5]."""
    meaning = "take-up of both ends per square root of load"
    compliance: Scalar = quantity("m/N^0.5", (1e-7, 1e-2), meaning, symbol="q", typical=(3e-5, 4e-4), **options)
    return compliance
