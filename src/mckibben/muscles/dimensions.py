"""Parameters that several laws share, each declared here once."""

from __future__ import annotations

from typing import Any

from ..quantities import Quantity, quantity

REST_LENGTH = Quantity("m", (1e-3, 100.0), "length at rest", "L0", (1e-3, 100.0), 1)


def thread_length() -> Any:
    """Length of one thread b [m]."""
    return quantity("m", (1e-3, 100.0), "length of one thread", symbol="b", typical=(0.05, 1.0), along=1)


def turns() -> Any:
    """Turns of one thread around the braid n [1]."""
    meaning = "turns of one thread around the braid"
    return quantity("1", (0.05, 1e3), meaning, symbol="n", typical=(0.8, 8.0), along=1)


def rest_length() -> Any:
    """Length at rest L0 [m]."""
    unit, bounds, meaning, symbol, _, along = REST_LENGTH
    return quantity(unit, bounds, meaning, symbol=symbol, along=along)


def upper_length() -> Any:
    """Upper working length Lu [m]: the end of the range, where a stop begins."""
    return quantity("m", (1e-3, 100.0), "upper working length, where a stop begins", symbol="Lu", along=1)


def rest_diameter() -> Any:
    """Inner diameter at rest D0 [m]."""
    return quantity("m", (1e-4, 1.0), "inner diameter at rest", symbol="D0", typical=(5e-3, 4e-2))


def rubber_wall() -> Any:
    """Thickness of the rubber wall h [m]; 1.8 mm is that of Festo muscles."""
    return quantity("m", (1e-5, 0.05), "thickness of the rubber wall", symbol="h", default=1.8e-3)


def rest_angle(typical: tuple[float, float], **options: Any) -> Any:
    """Braid angle at rest theta0 [rad], with the range usual for a law's muscles."""
    meaning = "braid angle at rest, from the long axis"
    return quantity("rad", (0.05, 1.5), meaning, symbol="theta0", typical=typical, **options)


def rest_volume() -> Any:
    """Gas volume at rest length V0 [m^3], needed only for the volume itself and zero where unknown."""
    meaning = "gas volume at rest length; needed only for the volume itself"
    return quantity("m^3", (0.0, 1.0), meaning, symbol="V0", default=0.0, along=1)


def stop_stiffness() -> Any:
    """Coefficient of the end non-linearity knl [N/m^2], zero where none was inferred."""
    return quantity(
        "N/m^2", (0.0, 1e12), "coefficient of the end non-linearity nl(L)", symbol="knl", default=0.0, along=-2
    )


def stiffness_per_pressure() -> Any:
    """Stiffness per gauge pressure of a gas spring Kg [m]."""
    return quantity("m", (1e-6, 10.0), "stiffness per gauge pressure", symbol="Kg", typical=(5e-4, 5e-2), along=-1)


def shortest_length() -> Any:
    """Length at which a gas spring ceases to pull Lmin [m]."""
    return quantity("m", (1e-3, 100.0), "theoretical shortest length", symbol="Lmin", typical=(0.05, 0.5), along=1)


def thread_depth() -> Any:
    """Place of the threads in a rubber wall p [1]."""
    meaning = "place of the threads in the wall, 0 inside to 1 outside"
    return quantity("1", (0.0, 1.0), meaning, symbol="p", typical=(0.2, 1.0), default=0.5)


def threshold_width(default: float = 1e4) -> Any:
    """Range of pressure around the threshold over which the bladder reaches the braid, w [Pa]."""
    meaning = "range of pressure around the threshold in which the bladder fills to the braid"
    return quantity("Pa", (1e2, 1e6), meaning, symbol="w", default=default)


def seat_compliance(**options: Any) -> Any:
    """Take-up of both ends per square root of load q [m/N^0.5]."""
    meaning = "take-up of both ends per square root of load"
    return quantity("m/N^0.5", (1e-7, 1e-2), meaning, symbol="q", typical=(3e-5, 4e-4), **options)
