"""One muscle to compare, braided or biological, with the same questions for both.

drive          0 to 1: gauge pressure over the full pressure, or activation
F0             tension at the rest length L0, fully driven, at rest, without friction
relative       length over L0, tension over F0
"""

from __future__ import annotations

import os
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...analysis.characteristics import circle_area
from ...assembly.build import unit_from_specimen
from ...assembly.muscle_unit import MuscleUnit
from ...errors import InputError, NoVolumeError
from ...muscles.biological import BiologicalMuscle
from ...muscles.build import from_specimen
from ...quantities import with_unit
from ...specimens import Specimen, specimen

FULL_PRESSURE = 5e5  # at which the paper compares its muscles [Pa]
LEAST = 0.99  # of the rest length: a muscle that is free there already makes no tension worth comparing


@dataclass(frozen=True, eq=False)
class Subject:
    """A muscle in a comparison.

    `unit` is a braided muscle and `fibre` a biological one, the other is None; `full` is the drive that counts as 1: a
    gauge pressure [Pa], or an activation [1]. `section_area` [m^2] is None where nothing tells it, and `area_from` says what
    did.
    """

    spec: Specimen
    unit: MuscleUnit | None
    fibre: BiologicalMuscle | None
    full: float
    rest_length: float
    upper_length: float
    section_area: float | None
    area_from: str

    @property
    def id(self) -> str:
        """Of its specimen."""
        return self.spec.id

    @property
    def law(self) -> Any:
        """What tells its tension, stiffness and free length at a length [m] and a drive [Pa or 1]."""
        return self.fibre if self.fibre is not None else self.unit.law  # type: ignore[union-attr]

    @property
    def full_tension(self) -> float:
        """F0 [N]."""
        return float(self.law.tension(self.rest_length, self.full))

    def tension(self, relative_length: Any, drive: Any = 1.0) -> np.ndarray:
        """Static tension over F0 [1] at lengths over L0 [1] and drives [1], any shape."""
        length, pull = np.asarray(relative_length, float) * self.rest_length, np.asarray(drive, float) * self.full
        return np.asarray(self.law.tension(length, pull)) / self.full_tension

    def stiffness(self, relative_length: Any, drive: Any = 1.0) -> np.ndarray:
        """Static stiffness dF/dL times L0 over F0 [1], any shape."""
        length, pull = np.asarray(relative_length, float) * self.rest_length, np.asarray(drive, float) * self.full
        return np.asarray(self.law.stiffness(length, pull)) * self.rest_length / self.full_tension


def subject(
    what: str | os.PathLike[str] | Specimen, *, pressure: float = FULL_PRESSURE, law: str | None = None
) -> Subject:
    """A muscle from its specimen.

    Args:
        what: a specimen, its id or file.
        pressure: the gauge pressure that counts as the full drive of a McKibben muscle [Pa].
        law: one that the specimen states; its default law where left out.

    Raises:
        InputError: it is no muscle, the pressure is none, or the muscle does not pull at its rest length.
    """
    spec = what if isinstance(what, Specimen) else specimen(what)
    if spec.kind == "valve":
        raise InputError("specimen", spec.id, "it is a valve; allowed is a muscle", where=spec.where)
    if not 0.0 < pressure <= 1e8:
        raise InputError("pressure", with_unit(pressure, "Pa"), "allowed is above 0 up to 1000 bar gauge")
    if spec.kind == "biological":
        fibre: BiologicalMuscle = from_specimen(spec, law)
        return Subject(
            spec, None, fibre, 1.0, float(fibre.rest_length), float(fibre.plateau_end * fibre.rest_length),
            float(fibre.section_area), "stated",
        )  # fmt: skip
    unit = unit_from_specimen(spec, law=law)
    rest = _length(spec, unit, "rest_length")
    upper = _length(spec, unit, "upper_length")
    free = float(unit.law.free_length(pressure))
    if not free < LEAST * min(rest, upper):
        said = f"{spec.id} pulls nothing at its rest length of {with_unit(rest, 'm')}; allowed is a higher one"
        raise InputError("pressure", with_unit(pressure, "Pa"), said)
    area, area_from = _section(spec, unit, pressure, free)
    return Subject(spec, unit, None, pressure, rest, upper, area, area_from)


def _length(spec: Specimen, unit: MuscleUnit, name: str) -> float:
    if name in spec.properties:
        return spec.property_si(name, "m")
    own = getattr(unit.law, name, None)
    if own is None and name == "upper_length":
        own = unit.law.length_range()[1]
    if own is None:
        raise InputError(f"properties.{name}", "missing", "a comparison needs it", where=spec.where or spec.id)
    return float(own)


def _section(spec: Specimen, unit: MuscleUnit, pressure: float, free: float) -> tuple[float | None, str]:
    """Cross section at maximal shortening [m^2], and what tells it."""
    if "section_area" in spec.properties:
        return spec.property_si("section_area", "m^2"), "stated"
    if "diameter_shortened" in spec.properties:
        return circle_area(spec.property_si("diameter_shortened", "m")), "stated diameter"
    try:
        return float(unit.law.volume(free, pressure)) / free, "volume over length of the law, at its shortest"
    except NoVolumeError:
        return None, "unknown"
