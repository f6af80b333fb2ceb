"""Numbers in a system that nobody stated for it: what each is, and where it comes from."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

from ..documents import JsonValue
from ..muscles import Muscle
from ..muscles.law import THREAD_STRAIN, law_name
from ..muscles.plausible import LARGEST_STRAIN
from ..quantities import with_unit
from ..specimens import Specimen, muscle_specimen
from .build import INFERRED
from .muscle_unit import SLACK_TIME, MuscleUnit


class Assumption(NamedTuple):
    """A number that was left at its default.

    Attributes:
        parameter: dotted path, or the name of the argument.
        value: [unit].
        unit: SI unit.
        note: where it comes from, one phrase.
    """

    parameter: str
    value: float
    unit: str
    note: str

    def __str__(self) -> str:
        return f"{self.parameter} {with_unit(self.value, self.unit)}"


def inferred(parameter: str, key: str) -> Assumption:
    """The assumption of one of the numbers of `INFERRED`."""
    stated = INFERRED[key]
    unit, _, note = stated.note.partition("; ")
    low, high = stated.range
    return Assumption(parameter, stated.value, unit.split(" at ")[0].replace(" ", "*"), f"{note}; {low:g} to {high:g}")


def of_unit(
    name: str, unit: MuscleUnit, muscle: str | Specimen | Muscle, *, usual_tendon: bool
) -> tuple[Assumption, ...]:
    """What a muscle that was named by its specimen or law has beside it.

    Args:
        name: of the muscle.
        unit: the muscle in a machine.
        muscle: as it was named; what it or its file states was not assumed.
        usual_tendon: whether only the stiffness of its tendon was stated.
    """
    at, stated = f"units.{name}", _stated(muscle, law_name(unit.law))
    made = [inferred(f"{at}.{key}", key) for key in ("viscosity", "stop_damping", "stop_travel")]
    for field, value, usual, note in (
        ("largest_strain", unit.largest_strain, LARGEST_STRAIN, "beyond the longest length; where aramid yarn breaks"),
        ("law.thread_strain", unit.law.thread_strain, THREAD_STRAIN, "of the threads at 10 bar, a seventh of that"),
    ):
        if float(value) == usual and field.rpartition(".")[2] not in stated:
            made.append(Assumption(f"{at}.{field}", usual, "1", note))
    if unit.tendon is None:
        note = f"what relaxes the slack braid in {with_unit(SLACK_TIME, 's')} where it is stiffest"
        return (*made, Assumption(f"{at}.slack_damping", float(unit.slack_damping), "N*s/m", note))
    made.append(inferred(f"{at}.end_mass", "end_mass"))
    if usual_tendon:
        made += [inferred(f"{at}.tendon.{n}", f"tendon_{k}") for n, k in (("toe_length", "toe"), ("loss", "loss"))]
    return tuple(made)


def _stated(muscle: str | Specimen | Muscle, law: str) -> set[str]:
    """Names of the numbers that a person has stated of a muscle, or its file does."""
    spec = muscle if isinstance(muscle, Specimen) else muscle.specimen if isinstance(muscle, Muscle) else None
    spec = muscle_specimen(muscle) if isinstance(muscle, str) else spec
    of_file = set() if spec is None else {*spec.properties, *spec.laws.get(law, {})}
    return of_file | set(muscle.stated if isinstance(muscle, Muscle) else ())


def table(assumptions: Iterable[Assumption]) -> dict[str, JsonValue]:
    """Assumptions as a table of a recording's metadata or a description."""
    return {a.parameter: {"value": a.value, "unit": a.unit, "note": a.note} for a in assumptions}
