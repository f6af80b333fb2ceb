"""Units of channels: SI units, and conversion of any other unit to SI."""

from __future__ import annotations

import re
from tokenize import TokenError

from ..errors import InputError
from ..quantities import to_si

# Whole SI units without prefixes. Coulomb, farad, tesla and henry are left out: "C" and "F" are temperatures in most files.
_SI_WORDS = frozenset("1 m kg s A K mol cd rad sr N Pa J W V Hz Ohm S Wb lx lm".split())
_PRESSURES = ("Pa", "N/m^2", "J/m^3")
# What a unit that is not SI may become, tried in order; angles apart, as they have no dimension of their own.
_TARGETS = (
    *("Pa", "s", "m", "N", "kg/s", "m^3/s", "K", "V", "A", "m^3", "m^2", "m/s", "m/s^2", "kg", "J", "W", "Hz"),
    *("Ohm", "Pa/s", "N/s", "N/m", "kg/m^3", "1"),
)
_ANGLES = ("rad", "rad/s", "rad/s^2")
_ANGLE_WORDS = re.compile(r"deg(rees?)?\b|°(?![CF])|rpm|rev|turn|rad\b|arcmin|arcsec")
_TEMPERATURES = {"°C": "degC", "C": "degC", "°F": "degF", "F": "degF"}


def is_si(unit: str) -> bool:
    """Whether every word of a unit such as ``m^3/(s Pa)`` is an SI unit without a prefix."""
    words = re.split(r"[ */()^]+", unit.removesuffix(")"))
    return words[0] in _SI_WORDS and all(word in _SI_WORDS or re.fullmatch(r"-?\d+(\.\d+)?", word) for word in words)


def is_pressure(si_unit: str) -> bool:
    """Whether an SI unit is that of a pressure."""
    return si_unit in _PRESSURES


def si_of(unit: str, *, field: str, where: str | None = None) -> tuple[str, float, float]:
    """SI unit of a unit, and the conversion: value [SI] = value * scale + offset.

    Raises:
        InputError: the unit is unknown.
    """
    if is_pressure(unit):
        return "Pa", 1.0, 0.0
    if is_si(unit):
        return unit, 1.0, 0.0
    word = _TEMPERATURES.get(unit, unit)
    for target in _ANGLES if _ANGLE_WORDS.search(word) else _TARGETS:
        try:
            offset = to_si(0.0, word, target, field=field)
        except (InputError, SyntaxError, TokenError):  # pint meets "m mm)" with the latter two
            continue
        # Only temperatures have an offset; a thousand degrees apart leave no rounding in the scale.
        scale = to_si(1.0, word, target, field=field) if offset == 0.0 else _slope(word, target, offset, field)
        return target, scale, offset
    raise InputError(field, unit, "must be a unit such as kPa, bar, psi, ms, mm, V, degC or 1", where=where)


def _slope(unit: str, target: str, offset: float, field: str) -> float:
    return round((to_si(1000.0, unit, target, field=field) - offset) / 1000.0, 12)
