"""Plausibility of pressures and lengths: cautions about unusual values, which stop nothing.

A law gives a tension at any pressure and length. What lies beyond the pressures that muscles are made for is said, and a
value that can only be a slip names the unit that was probably meant.
"""

from __future__ import annotations

import math
from collections.abc import Iterable

from ..errors import InputError
from ..quantities import has_dimension, leading_number, to_si, usual_units, with_unit
from ..specimens import Specimen

# Muscles of catalogues are rated for 6 to 8 bar; the maps that ship reach 6.75 bar. Gauge [Pa].
HIGHEST_PRESSURE = 10e5
USUAL_PRESSURE = 5e5  # [Pa]
# Beyond the longest length, where a specimen does not state another: aramid yarn breaks at 3.5 %, polyester at 13 %,
# polyamide at 20 % (Teijin, Tensile properties of Technora in comparison with other industrial fibers, table 3).
LARGEST_STRAIN = 0.035
# Beyond this multiple of what is usual a value is a slip, not a choice.
SLIP = 3.0
LEAST_PRESSURE = 2e3  # [Pa]; inflates nothing
PRESSURE_UNITS = ("bar", "kPa", "psi", "mbar", "Pa", "MPa")
LENGTH_UNITS = ("cm", "mm", "m", "inch")
MEASURED_PRESSURE, MEASURED_LENGTHS = (
    "highest_measured_pressure",
    ("shortest_measured_length", "longest_measured_length"),
)
BEYOND = 0.02  # by which a value may exceed the measured ones without a word, a share


def highest_pressure(spec: Specimen | None = None) -> tuple[float, str]:
    """Highest usual gauge pressure of a muscle [Pa], and the source of that limit."""
    for name, words in (("rated_pressure", "is rated for"), ("burst_pressure", "bursts at")):
        if spec is not None and name in spec.properties:
            return spec.property_si(name, "Pa"), f"{spec.id} {words}"
    return HIGHEST_PRESSURE, "McKibben muscles take at most"


def usual_pressure(spec: Specimen) -> float:
    """Gauge pressure at which a muscle is computed where none is stated [Pa]: 5 bar, less if rated or measured for less."""
    measured = spec.properties.get(MEASURED_PRESSURE)
    most = USUAL_PRESSURE if measured is None else spec.property_si(MEASURED_PRESSURE, "Pa")
    return min(USUAL_PRESSURE, most, highest_pressure(spec)[0])


def largest_strain(spec: Specimen | None = None) -> float:
    """Strain of a braid beyond the longest length of its law at which its threads break [1]."""
    stated = spec is not None and "largest_strain" in spec.properties
    return spec.property_si("largest_strain", "1") if spec is not None and stated else LARGEST_STRAIN


def stretch_caution(length: float, longest: float) -> str | None:
    """Caution about a length beyond the longest that a law is made for [m]; None if it is within."""
    if not length > longest:
        return None
    digits = next(digits for digits in (4, 6, 17) if with_unit(length, "m", digits) != with_unit(longest, "m", digits))
    shown, most = (with_unit(value, "m", digits) for value in (length, longest))
    return (
        f"overstretched: a length of {shown} is beyond the longest of this muscle's law, {most}; there its threads hold"
    )


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
        return None if spec is None else _beyond_measured_pressure(pressure, spec)
    said = f"a pressure of {shown} is beyond the range of the laws: {whose} {with_unit(most, 'Pa')}"
    if pressure <= SLIP * most:
        return said
    return said + _likely(text, "Pa", PRESSURE_UNITS, 0.02 * most, most, USUAL_PRESSURE)


def _beyond_measured_pressure(pressure: float, spec: Specimen) -> str | None:
    """Caution about a gauge pressure above those to which a muscle's laws were fitted [Pa]."""
    if MEASURED_PRESSURE not in spec.properties:
        return None
    measured = spec.property_si(MEASURED_PRESSURE, "Pa")
    if pressure <= (1.0 + BEYOND) * measured:
        return None
    shown, most = with_unit(pressure, "Pa"), with_unit(measured, "Pa", 3)
    return f"a pressure of {shown} is beyond the measured ones of {spec.id}, up to {most}: the law alone answers there"


def measured_length_caution(lengths: Iterable[float], spec: Specimen | None) -> str | None:
    """Caution about lengths outside of those to which a muscle's laws were fitted; None if all are within, or not known.

    Args:
        lengths: between the anchors [m].
        spec: the muscle, whose file may state the measured lengths.
    """
    if spec is None or not set(MEASURED_LENGTHS) <= set(spec.properties):
        return None
    low, high = (spec.property_si(name, "m") for name in MEASURED_LENGTHS)
    beyond = [length for length in lengths if not (1.0 - BEYOND) * low <= length <= (1.0 + BEYOND) * high]
    if not beyond:
        return None
    shown, ends = with_unit(beyond[0], "m"), f"{with_unit(low, 'm', 3)} to {with_unit(high, 'm', 3)}"
    return f"a length of {shown} is beyond the measured ones of {spec.id}, {ends}: the law alone answers there"


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


# Sizes of quantities of muscles, rigs and their air, by SI unit of the dimension: smallest, typical, largest. What lies
# beyond is a slip.
USUAL_SIZES: dict[str, tuple[float, float, float]] = {
    "m": (1e-6, 0.15, 20.0), "m^2": (1e-12, 1e-4, 1.0), "m^3": (1e-10, 1e-4, 10.0), "s": (1e-7, 0.1, 1e10),
    "kg": (1e-6, 1.0, 2e3), "Pa": (1e2, 5e5, 3e7), "N": (1e-3, 50.0, 5e4), "N/m": (1e-1, 1e3, 1e8), "m/s": (1e-6, 0.1, 50.0),
    "1/s": (1e-4, 10.0, 1e6), "m^3/s": (1e-9, 1e-3, 1.0), "rad": (1e-5, 0.5, 7.0), "m/s^2": (1e-3, 9.8, 1e3),
    "kg*m^2": (1e-9, 2e-3, 10.0),
}  # fmt: skip
MORE_UNITS = {
    "Pa": ("psi",), "N": ("kN", "mN"), "rad": ("deg",), "s": ("h", "day"), "m/s^2": ("cm/s^2",),
    "1/s": ("1/min",), "kg*m^2": ("g*cm^2", "kg*cm^2", "g*m^2"),
}  # fmt: skip


def dimension_caution(
    text: str, si_unit: str = "", *, name: str = "value", usual: tuple[float, float] | None = None
) -> str | None:
    """Caution about a quantity whose size can only be a slip; None if it is usual, zero, or no quantity.

    Args:
        text: as it was typed.
        si_unit: of its dimension; empty to take the one of the text's own unit.
        name: of the quantity, in the sentence.
        usual: sizes from and to which it is usual [si_unit]; those of the dimension by default.
    """
    si_unit = si_unit or next((unit for unit in USUAL_SIZES if has_dimension(text, unit)), "")
    least, typical, most = USUAL_SIZES.get(si_unit, (0.0, 1.0, math.inf))
    low, high = usual or (least, most)
    number = leading_number(text)
    unit = "" if number is None else text.strip()[len(number) :].strip()
    if number is None or not unit or ":" in unit:
        return None
    try:
        value = abs(to_si(float(number), unit, si_unit, field=name))
    except InputError:
        return None  # the reader says what is wrong
    if value == 0.0 or low <= value <= high:
        return None
    units = [u for u in (*usual_units(si_unit), *MORE_UNITS.get(si_unit, ())) if u != "in"]
    said = (
        f"a {name} of {text.strip()} can hardly be meant: {_short(low, si_unit)} to {_short(high, si_unit)} are usual"
    )
    return said + _likely(number, si_unit, units, low, high, min(max(typical, low), high))


def _short(value: float, si_unit: str) -> str:
    """A value in the unit that gives it the fewest digits."""
    shown = (f"{value / to_si(1.0, unit, si_unit, field=''):.4g} {unit}" for unit in usual_units(si_unit))
    return min(shown, key=lambda words: (len(words.split()[0]) + 9 * ("e" in words.split()[0]), len(words)))


def _likely(text: str | None, si_unit: str, units: Iterable[str], low: float, high: float, usual: float) -> str:
    """A question with the same number in the unit that makes it usual; nothing if there is none, or nothing was typed."""
    number = float("nan" if text is None else leading_number(text) or "nan")
    candidates = [
        (abs(math.log(si / usual)), unit)
        for unit in units
        if low <= (si := to_si(number, unit, si_unit, field="")) <= high
    ]
    return f"; was {number:g} {min(candidates)[1]} meant?" if candidates else ""
