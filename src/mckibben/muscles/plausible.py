"""Plausibility of pressures and lengths: cautions about unusual values, which stop nothing.

A law gives a tension at any pressure and length. What lies beyond the pressures that muscles are made for is said, and a
value that can only be a slip names the unit that was probably meant.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from ..quantities import leading_number, to_si, with_unit
from ..specimens import Specimen

# Muscles of catalogues are rated for 6 to 8 bar; the maps that ship reach 6.75 bar. Gauge [Pa].
HIGHEST_PRESSURE = 10e5
USUAL_PRESSURE = 5e5  # [Pa]
# Beyond this multiple of what is usual a value is a slip, not a choice.
SLIP = 3.0
LEAST_PRESSURE = 2e3  # [Pa]; inflates nothing
PRESSURE_UNITS = ("bar", "kPa", "psi", "mbar", "Pa", "MPa")
LENGTH_UNITS = ("cm", "mm", "m", "inch")


def highest_pressure(spec: Specimen | None = None) -> tuple[float, str]:
    """Highest usual gauge pressure of a muscle [Pa], and the source of that limit."""
    for name, words in (("rated_pressure", "is rated for"), ("burst_pressure", "bursts at")):
        if spec is not None and name in spec.properties:
            return spec.property_si(name, "Pa"), f"{spec.id} {words}"
    return HIGHEST_PRESSURE, "McKibben muscles take at most"


def pressure_caution(pressure: float, spec: Specimen | None = None, *, text: str | None = None) -> str | None:
    """Caution about an unusual gauge pressure for a muscle [Pa]; None if it is usual.

    Args:
        pressure: gauge [Pa].
        spec: the muscle, whose own limit counts where its file states one.
        text: as it was typed; a slip then names the likely unit.
    """
    most, whose = highest_pressure(spec)
    shown = with_unit(pressure, "Pa")
    if 0.0 < pressure < LEAST_PRESSURE:
        meant = _likely(text, "Pa", PRESSURE_UNITS, LEAST_PRESSURE, most, USUAL_PRESSURE)
        return f"a pressure of {shown} inflates no muscle{meant}" if meant else None
    if pressure <= most:
        return None
    said = f"a pressure of {shown} is beyond the range of the laws: {whose} {with_unit(most, 'Pa')}"
    if pressure <= SLIP * most:
        return said
    return said + _likely(text, "Pa", PRESSURE_UNITS, 0.02 * most, most, USUAL_PRESSURE)


def likely_pressure(text: str) -> str:
    """A question after a pressure that can only be a slip, such as ``; was 500 kPa meant?``; nothing if it is none."""
    return _likely(text, "Pa", PRESSURE_UNITS, 0.02 * HIGHEST_PRESSURE, HIGHEST_PRESSURE, USUAL_PRESSURE)


def length_caution(length: float, longest: float, *, text: str | None = None, name: str = "length") -> str | None:
    """Caution about a length of a muscle [m] far outside the range of its law; None if it is within.

    No muscle shortens to half of its longest length.

    Args:
        length: between the anchors [m].
        longest: that the law is made for [m].
        text: as it was typed.
        name: name of the length, in the sentence.
    """
    if longest / SLIP <= length <= longest * SLIP:
        return None
    shown, low, high = (with_unit(value, "m") for value in (length, 0.5 * longest, longest))
    said = f"a {name} of {shown} is far from those of this muscle, about {low} to {high}"
    return said + _likely(text, "m", LENGTH_UNITS, 0.5 * longest, longest, 0.75 * longest)


def _likely(text: str | None, si_unit: str, units: Iterable[str], low: float, high: float, usual: float) -> str:
    """A question with the same number in the unit that makes it usual; nothing if there is none, or nothing was typed."""
    number = float("nan" if text is None else leading_number(text) or "nan")
    candidates = [
        (abs(math.log(si / usual)), unit)
        for unit in units
        if low <= (si := to_si(number, unit, si_unit, field="")) <= high
    ]
    return f"; was {number:g} {min(candidates)[1]} meant?" if candidates else ""
