"""Formatting of numbers, units and flat tables for reports, and versions of the software."""

from __future__ import annotations

import math
import platform
import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from .. import __version__
from ..documents import JsonValue
from ..quantities import from_si, shown_unit

TIED = "\N{THIN SPACE}\N{WORD JOINER}"  # between a number and its unit: it never breaks
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_UNITS = {"1": "", "-": "", "deg": "°", "percent": "%", "ohm": "Ω", "kg/s": "g/s", "kg": "g"}
_SCALED = {"kg/s": "g/s", "kg": "g"}


def person_unit(si_unit: str) -> str:
    """Usual unit for display of a quantity."""
    return _SCALED.get(si_unit, shown_unit(si_unit))


def unit_text(unit: str) -> str:
    """Format a unit: ``m^3/(s*Pa)`` becomes m³/(s·Pa); empty for a pure number."""
    text = _UNITS.get(unit, unit) if unit not in _SCALED else unit
    text = text.replace("^0.5", "⁰·⁵")
    text = re.sub(r"\^(-?\d+)", lambda m: m[1].translate(_RAISED), text)
    text = re.sub(r"\b(L|[cm]?m)([23])\b", lambda m: m[1] + m[2].translate(_RAISED), text)
    return text.replace("L0", "L₀").replace("*", "·").replace(" ", "\N{NO-BREAK SPACE}")


def significant(value: float, digits: int = 4) -> str:
    """Format a number with significant digits, grouped; with powers of ten if it is very large or small."""
    if not math.isfinite(value):
        return "\N{EN DASH}" if math.isnan(value) else "∞" if value > 0 else "\N{MINUS SIGN}∞"
    size = abs(float(f"{value:.{digits}g}"))
    if size and not 1e-4 <= size < 1e7:
        mantissa, power = f"{value:.{digits - 1}e}".split("e")
        mantissa = mantissa.rstrip("0").rstrip(".") if "." in mantissa else mantissa
        return minus(mantissa) + power_text(int(power))
    places = max(digits - 1 - math.floor(math.log10(size)), 0) if size else 0
    text = f"{value:,.{places}f}"
    text = text.rstrip("0").rstrip(".") if "." in text else text
    return minus("0" if text == "-0" else text).replace(",", "\N{THIN SPACE}")


def power_text(power: int) -> str:
    """Format a power of ten: ``× 10`` and the exponent."""
    return f"\N{THIN SPACE}×\N{THIN SPACE}10{str(power).translate(_RAISED)}"


def minus(text: str) -> str:
    """Replace a hyphen before a digit by a typographic minus."""
    return re.sub(r"(?<![\w.\]])-(?=[\d.])", "\N{MINUS SIGN}", text)


def amount(value: float, si_unit: str, digits: int = 4) -> str:
    """Format an SI value with its usual unit."""
    unit = person_unit(si_unit)
    return tied(significant(from_si(value, si_unit, unit), digits), unit)


def tied(text: str, unit: str) -> str:
    """Join a number and its unit by a non-breaking space."""
    words = unit_text(unit)
    return f"{text}{TIED if words != '°' else ''}{words}" if words else text


def listed(words: Iterable[str]) -> str:
    """Join words by commas, with ``and`` before the last."""
    items = list(words)
    return items[0] if len(items) == 1 else ", ".join(items[:-1]) + f" and {items[-1]}" if items else ""


def mapping(value: object) -> Mapping[str, JsonValue]:
    """Return the value if it is a table, else an empty one, since recordings may contain anything."""
    return value if isinstance(value, Mapping) else {}


def is_number(value: object) -> bool:
    """Whether the value is a number, and not a truth value."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def flat(value: object, name: str = "") -> Iterator[tuple[str, str]]:
    """Iterate over the leaves of nested tables and lists: dotted name and text; a list of plain values is one leaf."""
    if isinstance(value, Mapping):
        for key, inner in value.items():
            yield from flat(inner, f"{name}.{key}" if name else str(key))
    elif isinstance(value, list | tuple) and any(isinstance(v, Mapping | list | tuple) for v in value):
        for i, inner in enumerate(value, 1):
            yield from flat(inner, f"{name}.{i}" if name else str(i))
    elif isinstance(value, list | tuple):
        yield name, ", ".join(_leaf(v) for v in value)
    else:
        yield name, _leaf(value)


def _leaf(value: Any) -> str:
    if value is None:
        return "\N{EN DASH}"
    if isinstance(value, bool):
        return "yes" if value else "no"
    return significant(float(value), 6) if is_number(value) else str(value)


def versions() -> list[tuple[str, str]]:
    """Names and versions of the package, of its libraries, and of Python."""
    from importlib.metadata import version

    return [
        ("mckibben", __version__),
        *((n, version(n)) for n in ("jax", "numpy", "scipy")),
        ("Python", platform.python_version()),
    ]


def versions_text() -> str:
    """Names and versions of the package, of its libraries, and of Python, as a line."""
    return ", ".join(f"{name} {version}" for name, version in versions())
