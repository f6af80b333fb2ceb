"""Declarations of physical parameters, and conversion of units from and to text.

A parameter is declared once, as a field of the type that owns it::

    thread_length: Scalar = quantity("m", (1e-3, 10), "length of one thread", symbol="b")

Validation, bounds of an identification, help texts, forms and documentation are all read from that declaration. Inside
the package every number is an SI float; ``parse`` turns words such as ``"12 cm"`` into one at the edges.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import math
import re
from collections.abc import Mapping
from numbers import Integral, Real
from typing import TYPE_CHECKING, Any, NamedTuple, cast

from ._jax import Array, Scalar, is_loaded, is_traced, jax, jnp
from ._lazy import LazyModule
from .errors import InputError, shortened

if TYPE_CHECKING:
    import numpy as np
else:
    np = LazyModule("numpy")  # takes a tenth of a second, which the completion of a shell has no use for

# What a person reads; the SI unit on the left is what the package computes with.
_SHOWN = {
    "m": "cm", "Pa": "bar", "m^3": "cm^3", "N/m": "N/cm", "rad": "deg", "m^2": "cm^2", "N/m^2": "N/cm^2",
    "m^3/s": "l/min", "m^3/(s*Pa)": "l/min/bar", "Pa/s": "bar/s",
}  # fmt: skip

# Units that files and people use most, by SI unit: factor to it and factor back, as pint has them to the last bit. They
# spare most processes pint, which takes half a second to begin with.
_USUAL: dict[str, dict[str, tuple[float, float]]] = {
    "m": {"mm": (1e-3, 1e3), "cm": (1e-2, 1e2), "um": (1e-6, 1e6), "in": (0.0254, 39.37007874015748)},
    "m^2": {"mm^2": (1e-6, 1e6), "cm^2": (1e-4, 1e4), "N/bar": (1e-5, 1e5)},
    "m^3": {
        "cm^3": (1.0000000000000002e-06, 999999.9999999999),
        "ml": (1.0000000000000002e-06, 999999.9999999999),
        "l": (0.0010000000000000002, 999.9999999999999),
    },
    "s": {"us": (1e-6, 1e6), "ms": (1e-3, 1e3), "min": (60.0, 0.016666666666666666)},
    "kg": {"g": (1e-3, 1e3)},
    "Pa": {"bar": (1e5, 1e-5), "mbar": (1e2, 1e-2), "kPa": (1e3, 1e-3), "MPa": (1e6, 1e-6)},
    "Pa/s": {"bar/s": (1e5, 1e-5), "kPa/s": (1e3, 1e-3)},
    "N/m": {"N/cm": (1e2, 1e-2), "N/mm": (1e3, 1e-3)},
    "N/m^2": {"N/cm^2": (1e4, 1e-4)},
    "m/s": {"mm/s": (1e-3, 1e3), "cm/s": (1e-2, 1e2)},
    "m^3/s": {"l/min": (1.666666666666667e-05, 59999.99999999999)},
    "m^3/(s*Pa)": {"l/min/bar": (1.666666666666667e-10, 5999999999.999999)},
    "rad": {"deg": (0.017453292519943295, 57.29577951308232)},
    "Hz": {"kHz": (1e3, 1e-3)},
    "1/s": {"Hz": (1.0, 1.0), "kHz": (1e3, 1e-3)},
    "H": {"mH": (1e-3, 1e3)},
    "1": {"-": (1.0, 1.0), "%": (1e-2, 1e2)},
}


class Quantity(NamedTuple):
    """The declaration of one parameter: SI unit, bounds (inclusive), meaning, symbol, and a range usual in practice.

    `along` is the power of the rest length with which it goes where the same muscle is cut to another length: 1 of a
    length along the axis, of turns and of a volume, -1 of a stiffness, 0 of what belongs to cross-section and material.
    """

    unit: str
    bounds: tuple[float, float]
    doc: str
    symbol: str
    typical: tuple[float, float]
    along: int = 0

    def check(self, name: str, value: object, *, where: str | None = None) -> None:
        """Raise `InputError` when a concrete value is not finite or out of bounds."""
        number = np.asarray(_numbers(value, self.unit, name, where), float)
        low, high = self.bounds
        bad = ~np.isfinite(number) | (number < low) | (number > high)
        if np.any(bad):
            first = float(number[bad].flat[0])
            got = told_apart(self.unit, first, *self.bounds)[0]
            raise InputError(name, got, f"must be {self.allowed(first)}", where=where)

    def allowed(self, beside: float = math.nan) -> str:
        """Describe the bounds, with digits that tell them from a value [unit] beside them."""
        _, low, high = told_apart(self.unit, beside, *self.bounds)
        if math.isinf(self.bounds[1]):
            return f"{low} or more"
        return f"between {low} and {high}"


def quantity(
    unit: str,
    bounds: tuple[float, float],
    doc: str,
    *,
    symbol: str = "",
    typical: tuple[float, float] | None = None,
    default: Any = dataclasses.MISSING,
    along: int = 0,
) -> Any:
    """Declare a physical parameter as a field of a module.

    Args:
        unit: SI unit as text, ``"1"`` for a pure number.
        bounds: smallest and largest allowed value, inclusive [unit].
        doc: meaning, one phrase.
        symbol: as the field writes it.
        typical: range from which a fit draws its starting points [unit]; the bounds where it is left out.
        default: value where none is given [unit]; None for a parameter that only some uses have.
        along: power of the rest length with which it goes, see `Quantity`.

    Examples:
        >>> import mckibben as mk
        >>> from mckibben.components import Module
        >>> class Pulley(Module):
        ...     radius = mk.quantity("m", (1e-3, 0.5), "radius of the groove", default=0.02)
        >>> float(Pulley().radius)
        0.02
    """
    declared = Quantity(unit, bounds, doc, symbol, typical or bounds, along)
    options: dict[str, Any] = {} if default is dataclasses.MISSING else {"default": default}
    converter = _array_or_none if default is None else as_array
    return dataclasses.field(metadata={"quantity": declared, "converter": converter}, kw_only=True, **options)


def _array_or_none(value: object) -> Array | None:
    return None if value is None else as_array(value)


def amount(unit: str, usual: tuple[float, float] | None = None, *, default: Any = dataclasses.MISSING) -> Any:
    """Declare an argument of a data class that is a number in an SI unit, or words with a unit; or a pair of them.

    Args:
        unit: SI unit.
        usual: sizes from and to which it is usual [unit]; what lies beyond is said. Those of the dimension by default.
        default: value where none is given.
    """
    options: dict[str, Any] = {} if default is dataclasses.MISSING else {"default": default}
    return dataclasses.field(metadata={"amount": (unit, usual)}, **options)


def amounts(owner: Any) -> dict[str, tuple[str, tuple[float, float] | None]]:
    """Unit and usual sizes of the arguments of a data class that `amount` declares, by name, in order."""
    return {f.name: f.metadata["amount"] for f in dataclasses.fields(owner) if "amount" in f.metadata}


def as_array(value: object) -> Array:
    """A number or array, which may be traced, as an array of floats: of JAX where that is loaded, else of NumPy.

    It compiles nothing, as `jax.numpy.asarray` would. A plain number stays one while a function is traced: what is made of
    it may be kept, and be used after the trace has ended.
    """
    if not is_loaded():
        return np.asarray(value, float)
    if is_traced(value):
        return jnp.asarray(value, float)
    if isinstance(value, jax.Array) and value.dtype == float and not value.weak_type:
        return value
    number = np.asarray(value, float)
    return _device_array(number) if number.ndim else _device_number(number.tobytes())


@functools.lru_cache(maxsize=4096)
def _device_number(content: bytes) -> Array:
    """One array for all numbers of the same bits: JAX takes longer to make it than a kernel to evaluate a law."""
    return _device_array(np.frombuffer(content).reshape(()))


def _device_array(number: np.ndarray) -> Array:
    array: Array = jax.device_put(number)
    if is_traced(array):  # by the function around it
        with jax.ensure_compile_time_eval():
            array = jax.device_put(number)
    return array


def declared(owner: Any) -> dict[str, Quantity]:
    """Declared parameters of a type or an instance, by field name, in order."""
    return {f.name: f.metadata["quantity"] for f in dataclasses.fields(owner) if "quantity" in f.metadata}


def values(owner: Any) -> dict[str, float | list[float]]:
    """Declared parameters of an instance as plain floats, or lists of them [their SI units]."""
    stated = {name: getattr(owner, name) for name in declared(owner)}
    return {name: np.asarray(value).tolist() for name, value in stated.items() if value is not None}


def check_fields(owner: Any, *, where: str | None = None) -> None:
    """Check all concrete parameters of an instance against their declarations; traced ones are passed over."""
    for name, q in declared(owner).items():
        value = getattr(owner, name)
        if value is None or not hasattr(value, "shape") or is_traced(value):
            continue
        q.check(name, value, where=where)


LONGEST_UNIT = 60  # letters
# As displays and head lines write units that pint knows otherwise, or takes for others: kp is no kilopoise here.
_WRITTEN_OTHERWISE = {
    "PSI": "psi", "KPA": "kPa", "KPa": "kPa", "kPA": "kPa", "kpa": "kPa", "MPA": "MPa", "BAR": "bar", "Bar": "bar",
    "MBAR": "mbar", "mBar": "mbar", "kp": "kgf", "Kp": "kgf", "KN": "kN", "LBF": "lbf", "Lbf": "lbf", "lbs": "lbf",
    "SEC": "s", "sec.": "s", "Sec": "s", "MM": "mm", "IN": "in",
}  # fmt: skip
_POWER = re.compile(r"\*\*\s*(\(\s*[-+]?\d(\.\d+)?\s*\)|[-+]?\d(\.\d+)?)(?!\s*\*\*|[\d.])")  # none of a power
_NUMBER = re.compile(r"(?<!\w)(?!1(?![\w.]))\d")  # that is no part of a word; but 1, as in 1/s


@functools.cache
def _registry() -> Any:
    import pint

    return pint.UnitRegistry(cache_folder=None)


def _unit(text: str) -> Any:
    """A pint unit from the way people write it: ``N/cm``, ``cm^2``, ``l/min``, ``%``.

    Raises:
        ValueError: it is none. pint would work out whatever stands there, and 9**9**9 keeps it busy for ever.
    """
    text = _WRITTEN_OTHERWISE.get(text.strip(), text.strip()).replace("^", "**").replace("·", "*")
    rest = _POWER.sub("", text)
    if len(text) > LONGEST_UNIT or "**" in rest or _NUMBER.search(rest):
        raise ValueError(text)
    return _registry().Unit("percent" if text == "%" else "" if text in ("1", "-", "fraction") else text)


def base_exponents(si_unit: str) -> dict[str, int]:
    """Exponents of the SI base units in an SI unit, by their symbols: ``N`` is kg m s^-2.

    Raises:
        ValueError: the text is no unit, or not a product of powers of base units.
    """
    names = {
        "kg": "kilogram",
        "m": "meter",
        "s": "second",
        "A": "ampere",
        "K": "kelvin",
        "mol": "mole",
        "rad": "radian",
    }
    symbols = {name: symbol for symbol, name in names.items()}
    based = _registry().Quantity(1.0, _unit(si_unit)).to_base_units()
    powers = dict(based.unit_items())
    if based.magnitude != 1.0 or not all(n in symbols and float(p).is_integer() for n, p in powers.items()):
        raise ValueError(si_unit)
    return {symbols[name]: int(power) for name, power in powers.items()}


def usual_units(si_unit: str) -> tuple[str, ...]:
    """Units that files and people use most for an SI unit, that unit first."""
    return (si_unit, *_USUAL.get(si_unit, {}))


def is_unit(text: str) -> bool:
    """Whether a text is a unit as people write it, such as ``N/cm`` or ``1``."""
    if text in _USUAL or any(text in others for others in _USUAL.values()):
        return True
    try:
        _unit(text)
    except Exception:  # pint's parser meets nonsense with many kinds of error
        return False
    return True


def _usual(unit: str, si_unit: str) -> tuple[float, float] | None:
    """Factors to the SI unit and back; None if pint has to be asked."""
    unit = unit.strip()
    return (1.0, 1.0) if unit == si_unit else _USUAL.get(si_unit, {}).get(unit)


def to_si(value: float, unit: str, si_unit: str, *, field: str, where: str | None = None) -> float:
    """Convert a number with a unit to the SI unit, or raise `InputError` that states the permitted values."""
    usual = _usual(unit, si_unit)
    if usual is not None:
        return float(value * usual[0])
    import pint

    registry = _registry()
    _refuse_angular(value, unit, si_unit, field=field, where=where)
    try:
        # A gauge pressure or a force has no offset; a temperature in degC does, and pint handles both this way.
        return float(registry.Quantity(value, _unit(unit)).to(_unit(si_unit)).magnitude)
    except pint.UndefinedUnitError:
        known = (si_unit, *_USUAL.get(si_unit, {}), "psi" if si_unit == "Pa" else "")
        near = next((k for k in known if k.lower() == unit.strip().lower()), "")
        hint = f". Did you mean {near!r}?" if near else ""
        demand = f"must be {_kind(si_unit)}, got {value:g} {shortened(unit)}; the unit is unknown{hint}"
        raise InputError(field, None, demand, where=where) from None
    except pint.DimensionalityError:
        demand = f"must be {_kind(si_unit)}, got {value:g} {shortened(unit)}"
        raise InputError(field, None, demand, where=where) from None
    except (ArithmeticError, AssertionError, AttributeError, TypeError, ValueError, pint.PintError):
        # pint's parser meets nonsense such as "12 **" with an assertion
        demand = f"must be {_kind(si_unit)}, got {value:g} {shortened(unit)}; this is no unit"
        raise InputError(field, None, demand, where=where) from None


def _refuse_angular(value: float, unit: str, si_unit: str, *, field: str, where: str | None) -> None:
    """Refuse an angular frequency for an ordinary one, and the other way: pint takes a radian for 1, and is off by 2 pi.

    Raises:
        InputError: says what the value is in the unit that is wanted.
    """
    if si_unit not in ("rad/s", "Hz", "1/s"):
        return
    try:
        given = _unit(unit)
    except Exception:  # the caller says what is wrong with it
        return
    if given.dimensionality != _unit("Hz").dimensionality:
        return
    turns = any(name in str(given) for name in ("radian", "revolution", "degree", "turn", "rpm"))
    if turns == (si_unit == "rad/s"):
        return
    in_base = float(_registry().Quantity(value, given).to("1/s").magnitude)
    cured = in_base / (2.0 * math.pi) if turns else in_base * 2.0 * math.pi
    kinds = ("an angular frequency", "a frequency") if turns else ("a frequency", "an angular frequency")
    shown = f"{cured:.6g} {'Hz' if turns else 'rad/s'}"
    problem = f"must be {kinds[1]}; {value:g} {shortened(unit)} is {kinds[0]}, that of {shown}"
    raise InputError(field, None, problem, where=where)


def from_si(value: float, si_unit: str, unit: str) -> float:
    """Convert an SI number to another unit."""
    usual = _usual(unit, si_unit)
    if usual is not None:
        return float(value * usual[1])
    return float(_registry().Quantity(value, _unit(si_unit)).to(_unit(unit)).magnitude)


def parse(text: str, si_unit: str, *, field: str, where: str | None = None, bare: bool = False) -> float:
    """Parse a number with its unit to an SI float.

    Args:
        text: such as ``"12 cm"`` or ``"5 bar"``; for a pure number ``"3.1"`` or ``"12 %"``.
        si_unit: the SI unit of the result.
        field: name used in the error message.
        where: place used in the error message.
        bare: take a number without a unit as SI. Off where a forgotten unit would be a trap.

    Returns:
        The value [si_unit].

    Raises:
        InputError: it is no number, has no unit or one of another dimension, or has a comma between digits.
    """
    _refuse_comma(text, field=field, where=where, listed=False)
    words = text.strip().split(None, 1)
    try:
        number = float(words[0]) if words else math.nan
    except ValueError:
        head = leading_number(text)
        if head is None:
            raise InputError(field, text, f"must be {_kind(si_unit)}", where=where) from None
        number, words = float(head), [head, text.strip()[len(head) :]]
    if not math.isfinite(number):
        raise InputError(field, text, f"must be a finite number, {_kind(si_unit)}", where=where)
    if number and not SMALLEST < abs(number) < LARGEST:
        raise InputError(field, text, f"must be 0 or from {SMALLEST:g} to {LARGEST:g} in size", where=where)
    if len(words) == 1:
        if si_unit == "1" or bare:
            return number
        raise InputError(field, text, f"must be {_kind(si_unit)}; the unit is missing", where=where)
    value = to_si(number, words[1], si_unit, field=field, where=where)
    if not math.isfinite(value):  # as of 1e99 Ym^9/m^8
        raise InputError(field, text, f"must be a finite number, {_kind(si_unit)}", where=where)
    return value


def in_si(value: Any, si_unit: str, *, field: str) -> Scalar:
    """A quantity as people give it, as SI: text with a unit is converted, numbers and arrays pass as they are.

    Args:
        value: a number or an array [si_unit], a text such as ``"12 cm"``, or a list of such texts.
        si_unit: of the result.
        field: name used in the complaint.

    Returns:
        The number or array [si_unit]; of a list of texts an array (n,).

    Raises:
        InputError: see `parse`.
    """
    if isinstance(value, str):
        return parse(value, si_unit, field=field)
    if isinstance(value, list | tuple) and any(isinstance(one, str) for one in value):
        return np.array([in_si(one, si_unit, field=field) for one in value])
    number: float | np.ndarray = cast(Any, value) if value is None else _numbers(value, si_unit, field)
    return number


def _numbers(value: Any, si_unit: str, field: str, where: str | None = None) -> Any:
    """A number or an array of numbers as it is, a list as an array; what NumPy would make a number of is refused."""
    kind = getattr(getattr(value, "dtype", None), "kind", "")
    if kind and kind in "fiu" or type(value) in (float, int):
        return value
    if isinstance(value, list | tuple | range):
        with contextlib.suppress(ValueError, TypeError):
            array = np.asarray(value)
            if array.dtype.kind in "fiu" and not any(isinstance(one, bool) for one in value):
                return array
    elif not isinstance(value, bool) and isinstance(value, Real):
        return value
    wanted = "a number" if si_unit == "1" else f"a number in {si_unit}, or words with a unit"
    raise InputError(field, None, f"must be {wanted}, or an array of them, got {value!r}", where=where)


def whole_number(value: Any, field: str, *, least: int = 0) -> int:
    """A whole number, such as a count or the seed of a noise.

    Raises:
        InputError: it is none, or too small.
    """
    if isinstance(value, bool) or not isinstance(value, Integral) or value < least:
        raise InputError(field, None, f"must be a whole number from {least}, got {value!r}")
    return int(value)


def random_generator(seed: Any, field: str = "seed") -> np.random.Generator:
    """The generator of random numbers for a seed, a whole number from 0; raises `InputError` where it is none."""
    return np.random.default_rng(whole_number(seed, field))


def named_values(values: Any, field: str) -> Mapping[str, Any]:
    """Values by name as they are.

    Raises:
        InputError: they are not by name, as a list is.
    """
    if not isinstance(values, Mapping):
        raise InputError(field, None, f"must be values by name, as in {{'name': value}}, got {values!r}")
    return values


# Sizes of numbers that a person can mean: their squares and quotients stay within what a float holds.
SMALLEST, LARGEST = 1e-100, 1e100
MOST_VALUES = 10_000  # of a range in words


def values_in_si(values: object, si_unit: str, *, field: str) -> list[float]:
    """A list of quantities as people give it, as SI numbers.

    Args:
        values: numbers [si_unit], texts, or one text: a list such as ``"1 bar, 3 bar"``, or a range such as ``"1:5 bar"``,
            in steps of one unless a third number gives the step, as in ``"1:5:0.5 bar"``. Both ends belong to it.
        si_unit: of the result.
        field: name used in the complaint.

    Raises:
        InputError: see `parse`; or the range has no step from one end to the other.
    """
    if not isinstance(values, str):
        return [float(one) for one in np.ravel(in_si(values, si_unit, field=field))]
    if ":" not in values:
        return [parse(one, si_unit, field=field) for one in split_values(values, field=field)]
    head, _, tail = values.strip().rpartition(":")
    number = leading_number(tail) or ""
    unit = tail.strip()[len(number) :].strip()
    ends = [parse(f"{one} {unit}", si_unit, field=field) for one in (*head.split(":"), number)]
    first, last, step = ends if len(ends) == 3 else (*ends[:2], parse(f"1 {unit}", si_unit, field=field))
    if len(ends) > 3 or not (step > 0.0 and first <= last and (last - first) / step < MOST_VALUES):
        raise InputError(field, values, "must be a range such as '1:5 bar', or '1:5:0.5 bar' with its step")
    return [min(first + i * step, last) for i in range(math.floor((last - first) / step + 1e-9) + 1)]


def split_values(text: str, *, field: str, where: str | None = None) -> list[str]:
    """Split a list of values: ``"1 bar, 3 bar"`` or ``"1 bar; 3 bar"``; one value is a list of one.

    A comma between two digits may be a decimal comma, may part thousands or may part values, so it is refused.

    Args:
        text: the list.
        field: name used in the error message.
        where: place used in the error message.

    Raises:
        InputError: says how the number, and how the list, is written.
    """
    _refuse_comma(text, field=field, where=where, listed=True)
    return [word for part in text.replace(";", ",").split(",") if (word := part.strip())]


def _refuse_comma(text: str, *, field: str, where: str | None, listed: bool) -> None:
    if "," not in text or not re.search(r"\d,\d", text):
        return
    apart, pointed = re.sub(r"(?<=\d),(?=\d)", "; ", text), re.sub(r"(?<=\d),(?=\d)", ".", text)
    ways = [f"{pointed!r}{' for one number' if listed else ''}"] if pointed.count(".") == 1 else []
    ways += [f"{apart!r} for a list"] if listed else []
    written = " or ".join(ways) or "a decimal point, and nothing between thousands"
    raise InputError(field, text, f"a comma between two digits is ambiguous; write {written}", where=where)


def has_dimension(text: str, si_unit: str) -> bool:
    """Whether a text is a number with a unit of the dimension of an SI unit."""
    head = leading_number(text)
    unit = "" if head is None else text.strip()[len(head) :].strip()
    if not unit:
        return False
    if _usual(unit, si_unit) is not None:
        return True
    if any(_usual(unit, other) is not None for other in _USUAL if other != si_unit):
        return False  # asked without pint, which takes half a second to begin with
    try:
        to_si(1.0, unit, si_unit, field="")
    except InputError:
        return False
    return True


def leading_number(text: str) -> str | None:
    """The number with which a text begins; None if it begins with something else."""
    match = re.match(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)", text)
    return match.group(1) if match else None


def _kind(si_unit: str) -> str:
    examples = {
        "m": "a length such as '12 cm'",
        "Pa": "a pressure such as '5 bar'",
        "N": "a force such as '110 N'",
        "m^3": "a volume such as '5.6 cm^3'",
        "N/m": "a stiffness such as '3.92 N/cm'",
        "s": "a time such as '20 ms'",
        "K": "a temperature such as '300 K'",
        "rad": "an angle such as '28.6 deg'",
        "1": "a pure number",
    }
    return examples.get(si_unit, f"a value in {si_unit} or a unit of the same dimension")


def shown_unit(si_unit: str) -> str:
    """Usual unit for display of a quantity in this SI unit."""
    return _SHOWN.get(si_unit, si_unit)


def told_apart(si_unit: str, value: float, *limits: float) -> tuple[str, ...]:
    """A value and limits [si_unit] in their usual unit, with four digits, or as many as tell the value from each."""
    for digits in range(4, 18):
        first, *others = texts = tuple(with_unit(one, si_unit, digits) for one in (value, *limits))
        if not any(text == first and limit != value for text, limit in zip(others, limits, strict=True)):
            break
    return texts


def with_unit(value: float, si_unit: str, digits: int = 4) -> str:
    """Format a value with its usual unit: ``with_unit(0.12, "m")`` is ``"12 cm"``."""
    if si_unit == "1":
        return f"{value:.{digits}g}"
    unit = shown_unit(si_unit)
    return f"{from_si(value, si_unit, unit):.{digits}g} {unit}"
