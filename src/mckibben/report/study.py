"""What a fit of several laws to one table found, as one value for tables, figures and reports."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..identification import Fit, evaluate
from ..muscles.build import law_from_specimen
from ..recordings import ForceMap
from ..specimens import Specimen


@dataclass(frozen=True)
class Study:
    """One force map and everything that was fitted to it, best law first.

    `published` holds laws with printed coefficients as (title, error at the taut points [N]); `skipped` says why a law
    could not be fitted.
    """

    title: str
    specimen: Specimen | None
    points: ForceMap
    fits: list[Fit]
    published: list[tuple[str, np.ndarray]] = field(default_factory=list)
    skipped: dict[str, str] = field(default_factory=dict)


def known_of(spec: Specimen | None) -> dict[str, float]:
    """Dimensions of a specimen that laws of it need and a fit does not find [SI], by the parameter's name."""
    places = {"rest_inner_diameter": ("rest_diameter", "m"), "wall_thickness": ("wall_thickness", "m")}
    properties = {} if spec is None else spec.properties
    return {
        parameter: spec.property_si(name, unit)  # type: ignore[union-attr]
        for name, (parameter, unit) in places.items()
        if name in properties
    }


def published_of(spec: Specimen | None, points: ForceMap) -> list[tuple[str, np.ndarray]]:
    """Title and error at the taut points [N] of each law whose coefficients somebody else printed for this map."""
    found = []
    for name in spec.laws if spec is not None and spec.map else ():
        if spec is not None and not any(p.note.startswith("fitted") for p in spec.laws[name].values()):
            built = law_from_specimen(spec, name)
            found.append((f"{built.title}, as published", evaluate(built, points)))
    return found
