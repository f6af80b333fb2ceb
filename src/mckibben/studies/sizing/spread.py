"""How far the answers of a sizing may be off because of numbers that no source prints.

Each inferred number that has a range is moved to both of its ends, the others being as they are; the changes towards one
side are added, which is the worst case to first order; a muscle that would push is slack, and less air is a smaller share
of it, never less than nothing. A number without a range is left out, and named. Bounds of a gas
source are exact: its answers rise or fall with each of its numbers, so that all stand at their poor or their good end.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import NamedTuple

from ...answers import brief
from ...errors import InputError
from ...muscles.law import TensionLaw
from ...muscles.sleeve import varied_law
from ...quantities import declared
from ...specimens import Specimen, SpecimenNumber
from ...specimens.parts import KINDS as PART_UNITS
from ...specimens.parts import CataloguePart
from .candidate import Judged, LawAtPressure, LawEnds, air_of_cycle
from .requirements import Requirements

# Whether a source lasts longer, and costs less, with more of a number.
BETTER_WITH_MORE = {
    "efficiency": True, "stored_energy": True, "filling": True, "free_flow": True, "pressure": True, "hottest": True,
    "low_pressure": True, "volume": False, "filling_work": False, "mass": False,
}  # fmt: skip


class InferredRanges(NamedTuple):
    """Ranges that inferred numbers leave, for the chosen muscle.

    Attributes:
        force: what the gas adds at the end of the stroke, less friction [N].
        air: mass of a cycle, with the valve and tube where they are known [kg].
        from_numbers: inferred numbers that were moved.
        without_range: inferred numbers that have no range, and are not in it.
    """

    force: tuple[float, float]
    air: tuple[float, float]
    from_numbers: tuple[str, ...]
    without_range: tuple[str, ...]

    def __repr__(self) -> str:
        return brief(self)


def spread_of(muscle: Judged, wish: Requirements, dead: float = 0.0) -> InferredRanges:
    """Ranges of force and air of a muscle, whose air fills and empties a dead volume [m^3] too."""
    one = muscle.muscle
    ends = one.law_ends()
    end = one.longest - wish.stroke
    laws = ([LawAtPressure(law, wish.pressure) for law in pair] for pair in ends.pairs.values())
    forces = [[float(law.added(end)) - one.friction for law in pair] for pair in laws]
    moved = [*ends.pairs]
    if one.friction_range is not None:
        forces.append([muscle.end_force + one.friction - friction for friction in one.friction_range])
        moved.append("friction")
    airs = [[air_of_cycle(replace(one, law=law), wish, dead) for law in pair] for pair in ends.pairs.values()]
    force = tuple(max(0.0, end) for end in _summed(muscle.end_force, forces))
    air = air_of_cycle(one, wish, dead)
    # as factors: what is added up to first order would be less than no air where the ranges are wide
    least = air * math.prod(min(1.0, *(end / air for end in pair)) for pair in airs)
    return InferredRanges((force[0], force[1]), (least, _summed(air, airs)[1]), tuple(moved), ends.without_range)


def _summed(value: float, pairs: Iterable[Iterable[float]]) -> tuple[float, float]:
    low = high = value
    for pair in pairs:
        changes = [end - value for end in pair]
        low += min(0.0, *changes)
        high += max(0.0, *changes)
    return low, high


def at_end(part: CataloguePart, *, good: bool) -> CataloguePart:
    """A gas source with each inferred number that has a range at its good or its poor end."""
    values = dict(part.values)
    for name, number in part.stated.items():
        if number.inferred and number.range is not None and name in BETTER_WITH_MORE:
            unit = PART_UNITS["gas_source"][name]
            ends = [_si(number, end, unit, name) for end in number.range]
            values[name] = max(ends) if BETTER_WITH_MORE[name] is good else min(ends)
    return part._replace(values=values)


def _si(number: SpecimenNumber, value: float, unit: str, field: str) -> float:
    converted = replace(number, value=value).si(unit, field=field)
    assert isinstance(converted, float)
    return converted


def ends_of_specimen(spec: Specimen, law: TensionLaw, name: str, scale: Mapping[str, float] | None = None) -> LawEnds:
    """Vary a law to the ends of the range of each inferred parameter of its specimen.

    The parameters of a braid follow from its dimensions, which are moved in their place.

    Args:
        spec: the specimen.
        law: as it is used, perhaps cut to another length.
        name: of the law.
        scale: factors of parameters that were scaled.
    """
    units = {key: q.unit for key, q in declared(law).items()}
    varied = varied_law(spec, name, law)
    of_dimensions = {} if varied is None else varied.of_dimensions
    pairs: dict[str, tuple[TensionLaw, ...]] = {
        key: tuple(law.replace(**one) for one in changes) for key, changes in of_dimensions.items()
    }
    without = []
    for key, number in spec.laws.get(name, {}).items():
        if not number.inferred or key not in units:
            continue
        if varied is not None and key not in varied.unseen:  # upper_length too: as the dimensions make it
            continue
        if number.range is None:
            without.append(key)
            continue
        low, high = ((scale or {}).get(key, 1.0) * _si(number, end, units[key], key) for end in number.range)
        pairs[key] = (law.replace(**{key: low}), law.replace(**{key: high}))
    return LawEnds(pairs, tuple(without))


def ends_of_braid(build: Callable[..., TensionLaw], ranges: Mapping[str, tuple[float, float]]) -> LawEnds:
    """The law of a braid with each inferred number at the ends of its range; one whose end makes no law has no range."""
    pairs, without = {}, []
    for name, (low, high) in ranges.items():
        try:
            pairs[name] = (build(**{name: low}), build(**{name: high}))
        except InputError:
            without.append(name)
    return LawEnds(pairs, tuple(without))
