"""Choices of a visitor on the Energy page, as stated in links, and the resulting muscle and conditions."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

from ....analysis.energy import CYCLES, READINGS, Conditions, CycleMuscle
from ....analysis.energy.cycles import (
    SETTINGS,
    at_threshold,
    check_threads,
    coulomb_friction,
    cycle_muscles,
    stretched_length,
    surroundings,
)
from ....errors import InputError, MckibbenError
from ....quantities import from_si, parse, shown_unit
from ....specimens import Specimen, specimen, specimen_ids


@dataclass(frozen=True)
class EnergyChoice:
    """Choices of a visitor; None stands for the muscle's own value.

    Attributes:
        muscle: id of a specimen.
        law: where it states several.
        cycle: cycle of `CYCLES`.
        pressure: gauge pressure of the supply [Pa].
        exchange: ``atmosphere`` or ``accumulator``.
        accumulator_pressure: gauge pressure of that [Pa]; the threshold where None.
        friction: while shortening [N].
        stretched_length: where cycles begin [m].
        volume: volume of `VOLUMES`; the paper's where the law has it, if empty.
        reading: reading of `READINGS`.
    """

    muscle: str = "nylon"
    law: str = ""
    cycle: str = "maximal"
    pressure: float = 5e5
    exchange: str = "atmosphere"
    accumulator_pressure: float | None = None
    friction: float | None = None
    stretched_length: float | None = None
    volume: str = ""
    reading: str = "printed"


WORDS = {"cycle": CYCLES, "exchange": ("atmosphere", "accumulator"), "reading": READINGS}
LINKED = ("muscle", "law", "cycle", "exchange", "volume", "reading", *SETTINGS)


def from_link(words: Mapping[str, str]) -> tuple[EnergyChoice, list[str]]:
    """Read a choice from a link, with a sentence for each refused value, which gets its default."""
    choice, said = EnergyChoice(), []
    for name, text in words.items():
        try:
            value: Any = text
            if name in SETTINGS:
                value = parse(text, SETTINGS[name].unit, field=name, bare=True)
                SETTINGS[name].check(name, value)
            elif name == "muscle" and text not in specimen_ids():
                raise InputError("specimen", text, known=specimen_ids())  # a path is no name
            elif name in WORDS and text not in WORDS[name]:
                raise InputError(name, text, known=WORDS[name])
            tried = replace(choice, **{name: value})
            resolved(tried) if name in ("muscle", "law", "volume") else None
            choice = tried
        except MckibbenError as error:
            said.append(str(error))
    return choice, said


def to_link(choice: EnergyChoice) -> dict[str, str | None]:
    """Parameters of a link; None for default values."""
    usual = EnergyChoice()
    parameters: dict[str, str | None] = {}
    for name in LINKED:
        value = getattr(choice, name)
        unit = SETTINGS[name].unit if name in SETTINGS else ""
        same = value == getattr(usual, name)
        if same:
            parameters[name] = None
        elif unit:
            parameters[name] = f"{from_si(value, unit, shown_unit(unit)):.10g} {shown_unit(unit)}"
        else:
            parameters[name] = str(value)
    return parameters


def muscles() -> dict[str, str]:
    """Specimens with a volume: id and title."""
    titles = {}
    for one in specimen_ids("mckibben"):
        try:
            resolved(EnergyChoice(one))
        except MckibbenError:
            continue  # of another kind, or without a volume
        titles[one] = specimen(one).title
    return titles


class ResolvedMuscle(NamedTuple):
    """A choice with its specimen, its law's name, and the muscle under each volume."""

    spec: Specimen
    law: str
    muscles: dict[str, CycleMuscle]

    @property
    def volume(self) -> str:
        """Name of the requested volume."""
        return next(iter(self.muscles))


def resolved(choice: EnergyChoice) -> ResolvedMuscle:
    """Resolve the muscle of a choice.

    Raises:
        InputError: there is none, or it is of another kind.
        NoVolumeError: the law does not say how large the volume is.
    """
    return _resolved(choice.muscle, choice.law, choice.volume)


@functools.lru_cache(maxsize=32)
def _resolved(name: str, law: str, volume: str) -> ResolvedMuscle:
    spec = specimen(name)
    return ResolvedMuscle(spec, *cycle_muscles(spec, law, volume))


def conditions(choice: EnergyChoice, exchange: str | None = None) -> Conditions:
    """Conditions of the cycle; with the other exchange, if it is named."""
    spec, law, all_ = resolved(choice)
    muscle = next(iter(all_.values()))
    own = choice.stretched_length
    if own is not None:
        check_threads(spec, own)
    low = 0.0
    if (exchange or choice.exchange) == "accumulator":
        own_low = choice.accumulator_pressure
        low = at_threshold(muscle, law, cure="a pressure under Conditions") if own_low is None else own_low
    between = Conditions(
        pressure=choice.pressure,
        stretched_length=stretched_length(spec, muscle) if own is None else own,
        ambient=surroundings(spec),
        exchange_pressure=low,
        friction=coulomb_friction(spec) if choice.friction is None else choice.friction,
        reading=choice.reading,
    )
    between.check(muscle)
    return between
