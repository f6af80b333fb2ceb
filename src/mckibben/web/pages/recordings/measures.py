"""What is measured on both recordings: the shape of the last loop, and what was reached."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ....errors import MckibbenError
from .entries import places
from .overlay import Part


class Measure(NamedTuple):
    """One property: its name, unit, places after the point, and the value of each part; NaN where it has none."""

    name: str
    unit: str
    places: int
    values: list[float]


def measures(parts: Sequence[Part]) -> list[Measure]:
    """Of one or two parts; a property that none of them has is left out."""
    shapes = [_loop(part) for part in parts]
    found = [
        Measure(name, unit, digits, [scale * getattr(s, key) if s is not None else math.nan for s in shapes])
        for name, unit, digits, key, scale in (
            ("Loop width at mid-range", "cm", 3, "width", 1e2), ("Loop height at mid-range", "N", 2, "height", 1.0),
            ("Work per cycle", "J", 3, "work", 1.0), ("Stiffness", "N/cm", 2, "stiffness", 1e-2),
        )
    ]  # fmt: skip
    for name, unit, digits, what, best in (
        ("Largest tension", "N", 1, "tension", np.nanmax), ("Largest pressure", "bar", 2, "pressure", np.nanmax),
        ("Shortest length", "cm", 2, "length", np.nanmin),
    ):  # fmt: skip
        values = [part.values(what) for part in parts]
        found.append(Measure(name, unit, digits, [math.nan if v is None else float(best(v)) for v in values]))
    found.append(Measure("Duration", "s", 2, [part.record.duration for part in parts]))
    return [one for one in found if any(math.isfinite(v) for v in one.values)]


def _loop(part: Part) -> Any:
    from ....analysis.loops import loops

    there = places(part.record)
    try:
        return loops(part.record, length=there["length"], tension=there["tension"])[-1]
    except (KeyError, MckibbenError):
        return None
