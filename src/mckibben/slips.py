"""Slips of the unit: a quantity of a size that nobody can have meant, and the unit that was probably meant."""

from __future__ import annotations

import math
from collections.abc import Iterable

from .answers import Caution
from .errors import InputError
from .quantities import has_dimension, leading_number, to_si, usual_units

# Sizes of quantities of muscles, rigs and their air, by SI unit of the dimension: smallest, typical, largest. What lies
# beyond is a slip.
USUAL_SIZES: dict[str, tuple[float, float, float]] = {
    "m": (1e-6, 0.15, 20.0), "m^2": (1e-12, 1e-4, 1.0), "m^3": (1e-10, 1e-4, 10.0), "s": (1e-7, 0.1, 1e10),
    "kg": (1e-6, 1.0, 2e3), "Pa": (1e2, 5e5, 3e7), "N": (1e-3, 50.0, 5e4), "N/m": (1e-1, 1e3, 1e8), "m/s": (1e-6, 0.1, 50.0),
    "1/s": (1e-4, 10.0, 1e6), "m^3/s": (1e-9, 1e-3, 1.0), "rad": (1e-5, 0.5, 7.0), "m/s^2": (1e-3, 9.8, 1e3),
    "kg*m^2": (1e-9, 2e-3, 10.0),
}  # fmt: skip
USUAL_ROOM = (0.3e5, 1.5e5)  # where people measure: on the highest mountain, in a caisson [Pa]
MORE_UNITS = {
    "rad/s": ("rpm",), "Pa": ("psi",), "N": ("kN", "mN"), "rad": ("deg",), "s": ("h", "day"), "m/s^2": ("cm/s^2",),
    "1/s": ("1/min",), "Pa/m": ("bar/mm",), "Pa/(m*s)": ("bar/(mm*s)",), "kg*m^2": ("g*cm^2", "kg*cm^2", "g*m^2"),
}  # fmt: skip


def size_caution(
    value: object, si_unit: str = "", *, name: str = "value", usual: tuple[float, float] | None = None
) -> Caution | None:
    """Caution about a quantity whose size can only be a slip; None if it is usual, zero, or no quantity.

    Args:
        value: a number [si_unit], or a text with a unit as it was typed.
        si_unit: of its dimension; empty to take the one of the text's own unit.
        name: of the quantity, in the sentence; the parameter of the caution.
        usual: sizes from and to which it is usual [si_unit]; those of the dimension by default.
    """
    text = value.strip() if isinstance(value, str) else f"{value:g} {'' if si_unit == '1' else si_unit}".strip()
    si_unit = si_unit or next((unit for unit in USUAL_SIZES if has_dimension(text, unit)), "")
    least, typical, most = USUAL_SIZES.get(si_unit, (0.0, 1.0, math.inf))
    low, high = usual or (least, most)
    number = leading_number(text)
    unit = "" if number is None else text[len(number) :].strip() or ("1" if si_unit == "1" else "")
    if number is None or not unit or ":" in unit:
        return None
    try:
        size = abs(to_si(float(number), unit, si_unit, field=name))
    except InputError:
        return None  # the reader says what is wrong
    if size == 0.0 or low <= size <= high:
        return None
    units = [u for u in (*usual_units(si_unit), *MORE_UNITS.get(si_unit, ())) if u != "in"]
    article = "an" if name[0] in "aeio" else "a"
    said = (
        f"{article} {name} of {text} can hardly be meant: {_short(low, si_unit)} to {_short(high, si_unit)} are usual"
    )
    return Caution(said + likely_unit(number, si_unit, units, low, high, min(max(typical, low), high)), name)


def noise_caution(value: object, si_unit: str, *, of: str) -> Caution | None:
    """Caution about noise of a sensor that is larger than what it is of; arguments as of `size_caution`."""
    if si_unit not in USUAL_SIZES:
        return None
    return size_caution(value, si_unit, name=f"noise of {of}", usual=(0.0, USUAL_SIZES[si_unit][1]))


def _short(value: float, si_unit: str) -> str:
    """A value in the unit that gives it the fewest digits."""
    if si_unit == "1":
        return f"{value:.4g}"
    shown = (f"{value / to_si(1.0, unit, si_unit, field=''):.4g} {unit}" for unit in usual_units(si_unit))
    return min(shown, key=lambda words: (len(words.split()[0]) + 9 * ("e" in words.split()[0]), len(words)))


def likely_unit(text: str | None, si_unit: str, units: Iterable[str], low: float, high: float, usual: float) -> str:
    """A question with the same number in the unit that makes it usual; nothing if there is none, or nothing was typed."""
    if si_unit == "1":
        return ""
    number = float("nan" if text is None else leading_number(text) or "nan")
    candidates = [
        (abs(math.log(si / usual)), unit)
        for unit in units
        if low <= (si := to_si(number, unit, si_unit, field="")) <= high
    ]
    return f"; was {number:g} {min(candidates)[1]} meant?" if candidates else ""
