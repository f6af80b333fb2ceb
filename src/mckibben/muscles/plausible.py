"""Plausibility of values where they enter: cautions about what can hardly be meant, errors of what cannot be.

A law gives a tension at any pressure and length. What lies beyond the pressures that muscles are made for is said, and a
value that can only be a slip names the unit that was probably meant. Python, command line, screen and hosts take their
cautions from here; an answer keeps them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np

from .._jax import is_traced
from ..answers import Caution, collect
from ..components.flow import Environment
from ..components.paths import declared_values
from ..errors import InputError
from ..quantities import Quantity, amounts, with_unit
from ..slips import USUAL_ROOM, likely_unit, size_caution
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
LEAST_GAUGE = -1.1e5  # [Pa]; below it there is none: the air of the room is at most 1.1 bar
PRESSURE_UNITS = ("bar", "kPa", "psi", "mbar", "Pa", "MPa")
LENGTH_UNITS = ("cm", "mm", "m", "inch")
MEASURED_PRESSURE = "highest_measured_pressure"
MEASURED_LENGTHS = ("shortest_measured_length", "longest_measured_length")
WORKING_SHARE = 0.9  # of its rest length: where a muscle is mounted unless stated otherwise
TAUT_SHARE = 0.05  # of its rest length that it has to be longer there than when it is free
ROUNDING = 1e-9  # by which a length that was computed may exceed the longest one of a law, a share
BEYOND = 0.02  # by which a value may exceed the measured ones without a word, a share


def highest_pressure(spec: Specimen | None = None) -> tuple[float, str]:
    """Highest usual gauge pressure of a muscle [Pa], and the source of that limit."""
    for name, words in (("rated_pressure", "is rated for"), ("burst_pressure", "bursts at")):
        if spec is not None and name in spec.properties:
            return spec.property_si(name, "Pa"), f"{spec.id} {words}"
    return HIGHEST_PRESSURE, "McKibben muscles take at most"


def highest_usual_pressure(spec: Specimen | None = None) -> float:
    """Gauge pressure up to which nothing is said [Pa]: rated, and where the laws were measured, those."""
    most = highest_pressure(spec)[0]
    if spec is None or MEASURED_PRESSURE not in spec.properties:
        return most
    return min(most, (1.0 + BEYOND) * spec.property_si(MEASURED_PRESSURE, "Pa"))


def usual_pressure(spec: Specimen) -> float:
    """Gauge pressure at which a muscle is computed where none is stated [Pa]: 5 bar, less if rated or measured for less."""
    measured = spec.properties.get(MEASURED_PRESSURE)
    most = USUAL_PRESSURE if measured is None else spec.property_si(MEASURED_PRESSURE, "Pa")
    return min(USUAL_PRESSURE, most, highest_pressure(spec)[0])


def largest_strain(spec: Specimen | None = None) -> float:
    """Strain of a braid beyond the longest length of its law at which its threads break [1]."""
    if spec is None or "largest_strain" not in spec.properties:
        return LARGEST_STRAIN
    return spec.property_si("largest_strain", "1")


def stretch_caution(
    length: float, longest: float, spec: Specimen | None = None, *, name: str = "length"
) -> Caution | None:
    """Caution about a length beyond the longest that a law is made for [m], called by a name; None if it is within.

    Threads hold up to the largest strain of the specimen; beyond, the law still has a tension, which no muscle has.
    """
    if not length > longest:
        return None
    digits = next(digits for digits in (4, 6, 17) if with_unit(length, "m", digits) != with_unit(longest, "m", digits))
    shown, most = (with_unit(value, "m", digits) for value in (length, longest))
    said = f"overstretched: a {name} of {shown} is beyond the longest of this muscle's law, {most}"
    breaking = (1.0 + largest_strain(spec)) * longest
    if spec is not None and spec.kind == "biological":
        held = "there its filaments do not overlap"
    elif length <= breaking:
        held = "there its threads hold"
    else:
        held = f"its threads break at {with_unit(breaking, 'm')}, so that no muscle pulls like that"
    return Caution(f"{said}; {held}", name)


def pressure_caution(
    pressure: float, spec: Specimen | None = None, *, text: str | None = None, name: str = "pressure"
) -> Caution | None:
    """Caution about an unusual gauge pressure for a muscle [Pa]; None if it is usual.

    Args:
        pressure: gauge [Pa].
        spec: the muscle, whose own limit counts where its file states one.
        text: as it was typed; a slip then names the likely unit.
        name: of the pressure, in the sentence; the parameter of the caution.
    """
    most, whose = highest_pressure(spec)
    shown = with_unit(pressure, "Pa")
    if pressure < LEAST_GAUGE:
        return Caution(f"a {name} of {shown} is below vacuum: there is none", name)
    if 0.0 < pressure < LEAST_PRESSURE:
        meant = likely_unit(text, "Pa", PRESSURE_UNITS, LEAST_PRESSURE, most, USUAL_PRESSURE)
        return Caution(f"a {name} of {shown} inflates no muscle{meant}", name) if meant else None
    if pressure <= most:
        if spec is None or MEASURED_PRESSURE not in spec.properties:
            return None
        measured = spec.property_si(MEASURED_PRESSURE, "Pa")
        if pressure <= (1.0 + BEYOND) * measured:
            return None
        said = f"a {name} of {shown} is beyond the measured ones of {spec.id}, up to {with_unit(measured, 'Pa', 3)}"
        return Caution(f"{said}: the law alone answers there", name)
    said = f"a {name} of {shown} is beyond the range of the laws: {whose} {with_unit(most, 'Pa')}"
    if pressure > SLIP * most:
        said += likely_unit(text, "Pa", PRESSURE_UNITS, 0.02 * most, most, USUAL_PRESSURE)
    return Caution(said, name)


def measured_length_caution(lengths: Iterable[float], spec: Specimen | None, name: str = "length") -> Caution | None:
    """Caution about lengths outside of those to which a muscle's laws were fitted; None if all are within, or not known.

    Args:
        lengths: between the anchors [m].
        spec: the muscle, whose file may state the measured lengths.
        name: of the length, in the sentence; the parameter of the caution.
    """
    if spec is None or not set(MEASURED_LENGTHS) <= set(spec.properties):
        return None
    low, high = (spec.property_si(end, "m") for end in MEASURED_LENGTHS)
    beyond = [length for length in lengths if not (1.0 - BEYOND) * low <= length <= (1.0 + BEYOND) * high]
    if not beyond:
        return None
    shown, ends = with_unit(beyond[0], "m"), f"{with_unit(low, 'm', 3)} to {with_unit(high, 'm', 3)}"
    said = f"a {name} of {shown} is beyond the measured ones of {spec.id}, {ends}"
    return Caution(f"{said}: the law alone answers there", name)


def start_pressure_caution(
    pressure: float, ambient: float, spec: Specimen | None = None, *, text: str, name: str = "start pressure"
) -> Caution | None:
    """Caution about the gauge pressure of a muscle at the start [Pa].

    Args:
        pressure: gauge [Pa].
        ambient: absolute pressure of the surroundings [Pa].
        spec: the muscle.
        text: as it was typed.
        name: of the pressure, in the sentence; the parameter of the caution.

    Raises:
        InputError: it is no number, or there is no such pressure.
    """
    if not pressure > -ambient:
        problem = f"must be a gauge pressure above vacuum, {with_unit(-ambient, 'Pa')}"
        raise InputError(name, with_unit(pressure, "Pa"), problem)
    if pressure < 0.0:
        shown = with_unit(pressure, "Pa")
        return Caution(f"a {name} of {shown} is below that of the room, and inflates nothing", name)
    return pressure_caution(pressure, spec, text=text, name=name)


def free_length_caution(law: Any, pressures: Iterable[float], spec: Specimen | None) -> Caution | None:
    """Caution about free lengths at gauge pressures [Pa] outside of the measured lengths; None if all are within."""
    if spec is None or not set(MEASURED_LENGTHS) <= set(spec.properties):
        return None
    free = sorted(float(law.free_length(pressure)) for pressure in pressures)
    return measured_length_caution(free, spec, "free length")


def reached_cautions(
    lengths: np.ndarray, pressures: np.ndarray, law: Any, spec: Specimen | None, name: str
) -> tuple[Caution, ...]:
    """Cautions about the lengths of a braid [m] and the gauge pressures [Pa] that a muscle with a law reached in a run."""
    least, most, called = float(np.min(lengths)), float(np.max(lengths)), f"length of {name}"
    longest = float(law.length_range()[1])
    stretched = stretch_caution(most, longest, spec, name=called) if most > (1.0 + ROUNDING) * longest else None
    return collect(
        pressure_caution(float(np.max(pressures)), spec, name=f"pressure of {name}"),
        stretched,
        measured_length_caution((least, most) if stretched is None else (least,), spec, called),
    )


def length_caution(length: float, longest: float, *, text: str | None = None, name: str = "length") -> Caution | None:
    """Caution about a length of a muscle [m] far outside the range of its law; None if it is within.

    No muscle shortens to half of its longest length.

    Args:
        length: between the anchors [m].
        longest: that the law is made for [m].
        text: as it was typed.
        name: of the length, in the sentence; the parameter of the caution.
    """
    if longest / SLIP <= length <= longest * SLIP:
        return None
    shown, low, high = (with_unit(value, "m") for value in (length, 0.5 * longest, longest))
    said = f"a {name} of {shown} is far from those of this muscle, about {low} to {high}"
    return Caution(said + likely_unit(text, "m", LENGTH_UNITS, 0.5 * longest, longest, 0.75 * longest), name)


def argument_cautions(owner: Any, *, of: str = "") -> tuple[Caution, ...]:
    """Cautions about the arguments of an object that `quantities.amount` declares, each beside the sizes that are usual.

    Args:
        owner: such as a `Joint` or an `Air`.
        of: what the object is, behind the name of each argument, where there are several of its kind.
    """
    said = []
    for name, (unit, usual) in amounts(owner).items():
        value = getattr(owner, name)
        for one in value if isinstance(value, tuple | list) else (value,):
            if isinstance(one, str | float | int):
                said.append(size_caution(one, unit, name=f"{name.replace('_', ' ')}{of}", usual=usual))
    return collect(*said)


TURNS_MARGIN = 3.0  # the same of a speed, where turns per minute are a slip of 9.5
TYPICAL_MARGIN = 10.0  # by which a parameter may leave the range that its declaration calls typical without a word


def parameter_cautions(owner: Any) -> tuple[Caution, ...]:
    """Cautions about the declared parameters of what was built, beside the range that their declarations call typical.

    Args:
        owner: root objects by name, or an object, as `components.paths.parameters` takes them.
    """
    said = (parameter_caution(*declared) for declared in declared_values(owner))
    return collect(*(one for cautions in said for one in cautions))


def room_caution(environment: Environment) -> Caution | None:
    """Caution about surroundings in which nobody measures, such as a supply's pressure in the place of the room's."""
    return size_caution(float(environment.pressure_abs), "Pa", name="environment.pressure_abs", usual=USUAL_ROOM)


def parameter_caution(path: str, stated: Quantity, value: Any) -> tuple[Caution, ...]:
    """Cautions about the numbers of one declared parameter [SI], by its path and declaration."""
    low, high = stated.typical
    if value is None or is_traced(value) or stated.typical == stated.bounds or stated.unit == "1":
        return ()
    margin = TURNS_MARGIN if stated.unit == "rad/s" else TYPICAL_MARGIN
    usual = (low / margin, high * margin)
    numbers = (one for one in np.ravel(value).tolist() if one not in stated.bounds)  # a bound switches an effect off
    return collect(*(size_caution(one, stated.unit, name=path, usual=usual) for one in numbers))


# ---- a muscle where it is mounted

LEAST_SPAN = 1e-3  # [m]
LONGEST_STRAIN = 1.3  # of the longest length of a law, beyond which no law of a braid means anything


def working_span(law: Any, rest: float, spec: Specimen | None = None) -> float:
    """Span at which a muscle is mounted where none is stated [m].

    Nine tenths of the rest length if half the usual pressure pulls the muscle `TAUT_SHARE` further than that; else halfway
    from there to the rest length, so that it is taut at working pressures. Never outside the measured lengths.

    Args:
        law: of the muscle.
        rest: its rest length [m].
        spec: where its measured lengths may stand.
    """
    pressure = 0.5 * (USUAL_PRESSURE if spec is None else usual_pressure(spec))
    free = min(rest, float(law.free_length(pressure)))
    span = WORKING_SHARE * rest if free <= (WORKING_SHARE - TAUT_SHARE) * rest else 0.5 * (rest + free)
    if spec is not None and set(MEASURED_LENGTHS) <= set(spec.properties):
        low, high = (spec.property_si(name, "m") for name in MEASURED_LENGTHS)
        span = min(max(span, low), high)
    return span


def span_limits(law: Any) -> tuple[float, float, float]:
    """Spans from and to which a muscle can be mounted at all [m], and the longest length that its law is made for.

    Numbers; tracers where JAX traces the parameters of the law.
    """
    longest = law.length_range()[1]
    longest = longest if is_traced(longest) else float(longest)
    return LEAST_SPAN, LONGEST_STRAIN * longest, longest


def span_cautions(
    span: float, law: Any, rest: float, spec: Specimen | None = None, *, name: str = "span"
) -> tuple[Caution, ...]:
    """Cautions about a span at which a muscle is mounted [m].

    Args:
        span: between the anchors [m].
        law: of the muscle.
        rest: its rest length [m].
        spec: of the muscle, for the strain at which its threads break.
        name: of the span, in the sentence; the parameter of the cautions.

    Raises:
        InputError: no muscle can be that long or short; names the lengths that it can take.
    """
    shortest, most, longest = span_limits(law)
    shown, at_rest = (with_unit(value, "m") for value in (span, rest))
    if not shortest <= span <= most:
        problem = f"must be from 1 mm to {with_unit(most, 'm')} for a muscle of {at_rest} at rest"
        raise InputError(name, shown, problem)
    if span > (1.0 + ROUNDING) * longest:
        return collect(stretch_caution(span, longest, spec, name=name))
    far = length_caution(span, longest, name=name)
    if far is None and span < 0.5 * longest:
        half = with_unit(0.5 * longest, "m")
        far = Caution(f"a {name} of {shown} leaves the muscle slack: none contracts to less than {half}", name)
    return collect(far)
