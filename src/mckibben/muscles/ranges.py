"""How far a tension may be off because of numbers that nobody measured, as the ranges of a specimen's file say.

Each number is moved to both of its ends while the others stay; the changes to either side add as squares, for the numbers
are independent. The parameters of a braid all follow from its dimensions, so that there the dimensions are moved instead.
Ranges of a fitted law belong to parameters that only hold together; there the law's error says more (`evidence`).
"""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np

from ..quantities import declared
from ..specimens import Specimen
from .law import TensionLaw


def tension_range(
    spec: Specimen | None, name: str, law: TensionLaw, length: np.ndarray, pressure: np.ndarray
) -> tuple[np.ndarray, np.ndarray] | None:
    """Lowest and highest tension [N], shaped as length and pressure together; None where the file states no such ranges.

    Args:
        spec: states the ranges.
        name: of the law.
        law: as it is used.
        length: between the anchors [m].
        pressure: gauge [Pa].
    """
    if spec is None or name not in spec.laws or "rms" in spec.errors.get(name, {}):
        return None
    laws = [law.replace(**changes) for changes in _ends(spec, name, law)]
    if not laws:
        return None
    own = np.asarray(law.tension(length, pressure))
    changes = np.array([np.asarray(one.tension(length, pressure)) - own for one in laws])
    below, above = (np.sqrt(np.sum(np.square(np.clip(sign * changes, 0.0, None)), axis=0)) for sign in (-1.0, 1.0))
    return np.maximum(own - below, 0.0), own + above


def _ends(spec: Specimen, name: str, law: TensionLaw) -> list[dict[str, Any]]:
    """Changes of a law's parameters [SI], each for one number at one end of its range."""
    from .sleeve import varied_law

    units = {key: q.unit for key, q in declared(law).items()}
    varied = varied_law(spec, name, law)
    changes = [] if varied is None else [one for ends in varied.of_dimensions.values() for one in ends]
    for key, number in spec.laws[name].items():
        if number.range is None or key not in units or (varied is not None and key not in varied.unseen):
            continue
        for end in number.range:
            value = dataclasses.replace(number, value=end).si(units[key], field=f"laws.{name}.{key}", where=spec.where)
            changes.append({key: value})
    return changes
