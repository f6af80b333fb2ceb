"""Choices of a visitor on the Energy page, as stated in links, and the resulting muscle and conditions."""

from __future__ import annotations

import functools
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

from ....analysis.energy import CYCLES, READINGS, Conditions, WorkingCycles, energy
from ....analysis.energy.cycles import SETTINGS
from ....errors import InputError, MckibbenError
from ....muscles.build import built_muscle
from ....quantities import from_si, parse, shown_unit
from ....specimens import specimen, specimen_ids
from ...shelf import Shelf
from ...specimen_files import SpecimenFile, own_titles, specimen_file


@dataclass(frozen=True)
class EnergyChoice:
    """Choices of a visitor; None stands for the muscle's own value.

    Attributes:
        muscle: id of a specimen, or the name of a visitor's file.
        law: where it states several.
        cycle: cycle of `CYCLES`.
        pressure: gauge pressure of the supply [Pa].
        exchange: ``atmosphere`` or ``accumulator``.
        accumulator_pressure: gauge pressure of that [Pa]; the threshold where None.
        friction: while shortening [N].
        stretched_length: where cycles begin [m].
        volume: volume of `VOLUMES`; the paper's where the law has it, if empty.
        reading: reading of `READINGS`.
        file: file of the muscle, if it is the visitor's.
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
    file: SpecimenFile | None = None

    @property
    def source(self) -> str:
        """Id of the specimen, or path of the visitor's file."""
        return self.muscle if self.file is None else self.file.path


WORDS = {"cycle": CYCLES, "exchange": ("atmosphere", "accumulator"), "reading": READINGS}
LINKED = ("muscle", "law", "cycle", "exchange", "volume", "reading", *SETTINGS)


def from_link(words: Mapping[str, str], own: Shelf) -> tuple[EnergyChoice, list[str]]:
    """Read a choice from a link, with a sentence for each refused value, which gets its default.

    Args:
        words: of the link.
        own: specimen files of the visitor.
    """
    choice, said = EnergyChoice(), []
    for name, text in words.items():
        try:
            value: Any = text
            if name in SETTINGS:
                value = parse(text, SETTINGS[name].unit, field=name, bare=True)
                SETTINGS[name].check(name, value)
            elif name in WORDS and text not in WORDS[name]:
                raise InputError(name, text, known=WORDS[name])
            tried = with_muscle(choice, text, own) if name == "muscle" else replace(choice, **{name: value})
            described(tried) if name in ("muscle", "law", "volume") else None
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


def with_muscle(choice: EnergyChoice, name: str, own: Shelf) -> EnergyChoice:
    """The choice with another muscle, its usual law and its usual volume.

    Args:
        choice: the present choice.
        name: id of a specimen, or the name of a visitor's file; a path is neither.
        own: specimen files of the visitor.

    Raises:
        InputError: there is no such muscle.
    """
    files = own.names()
    if name not in files and name not in specimen_ids():
        raise InputError("specimen", name, known=[*specimen_ids(), *files])
    file = specimen_file(own, name) if name in files else None
    return replace(choice, muscle=name, file=file, law="", volume="")


def muscles(own: Shelf) -> dict[str, str]:
    """Muscles with a volume, those of the visitor first: id or name of the file, and title."""
    titles = own_titles(own, lambda path: _has_volume(str(path), path.stat().st_mtime_ns))
    return titles | {one: specimen(one).title for one in specimen_ids("mckibben") if _has_volume(one, 0)}


@functools.lru_cache(maxsize=64)
def _has_volume(source: str, changed: int) -> bool:
    muscle = built_muscle(source)
    return not muscle.is_biological and muscle.law.has_volume()


def described(choice: EnergyChoice) -> WorkingCycles:
    """Muscle of a choice with the conditions that it has where none are chosen, without cycles.

    Raises:
        InputError: there is none, or it is of another kind.
        NoVolumeError: the law does not say how large the volume is.
    """
    return _computed(EnergyChoice(choice.muscle, choice.law, volume=choice.volume, file=choice.file), False)


def conditions(choice: EnergyChoice, exchange: str | None = None) -> Conditions:
    """Conditions of the cycle; with the other exchange, if it is named."""
    return _computed(replace(choice, exchange=exchange or choice.exchange), False).conditions


def working_cycle(choice: EnergyChoice, exchange: str | None = None) -> WorkingCycles:
    """Cycle of a choice under each volume; with the other exchange, if it is named."""
    return _computed(replace(choice, exchange=exchange or choice.exchange), True)


@functools.lru_cache(maxsize=64)
def _computed(choice: EnergyChoice, cycles: bool) -> WorkingCycles:
    accumulated, pressure = choice.exchange == "accumulator", choice.accumulator_pressure
    return energy(
        choice.source,
        pressure=choice.pressure,
        cycles=choice.cycle if cycles else (),
        law=choice.law or None,
        volume=choice.volume or None,
        stretched_length=choice.stretched_length,
        accumulator=accumulated and pressure is None,
        accumulator_pressure=pressure if accumulated else None,
        friction=choice.friction,
        reading=choice.reading,
    )
