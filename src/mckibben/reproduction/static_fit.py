"""Fig. 6b of the paper: eq. 13 through ten points of the quasi-static recordings.

The points lie above the rounded threshold, at 2, 3, 4 and 5 bar, on the stretch over which the muscle was taut: at its
thirds, and at the two highest pressures in its middle too. There rising and falling path lie about equally far from the
static tension, and their mean is free of friction. The stretch of cord and frame, which a stiff bar in the muscle's place
shows, is taken off the measured span.

Each point is the mean over a dozen cycles: Pa is the small difference of large numbers, and of three cycles the counts of an
8-bit converter and the noise scatter it by 0.015 bar from one recording to the next (eight seeds of the noise: 0.040 to
0.077 bar); of twelve cycles by half of that (0.049 to 0.065 bar, four seeds).
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from ..analysis.paths import paths
from ..analysis.sampling import LinearTensionFit, StaticPoint, fit_linear_tension, static_points
from ..recordings import Recording
from .quasi_static import triangle
from .recorded import SPAN, TENSION, reproduces
from .rows import Found

THIRDS = (1.0 / 3.0, 2.0 / 3.0)
SHARES = {
    "2 bar": THIRDS, "3 bar": THIRDS, "4 bar": (THIRDS[0], 0.5, THIRDS[1]), "5 bar": (THIRDS[0], 0.5, THIRDS[1]),
}  # fmt: skip
CYCLES = 12  # that are averaged
TAUT = 0.8  # tension from which the muscle counts as taut, two counts of the cell [N]
LENGTH = "length"  # channel of the span without the stretch of the machine


class Fits(NamedTuple):
    """Eq. 13 through ten points, with the stretch of the machine taken off and as measured."""

    corrected: LinearTensionFit
    raw: LinearTensionFit


def stiff(record: Recording) -> Recording:
    """The recording with a channel ``length``: the measured span less the stretch of cord and frame [m]."""
    known = record.meta["parameters"]
    cord, toe, frame = (
        known[name]["value"]
        for name in ("units.muscle.tendon.stiffness", "units.muscle.tendon.toe_length", "load.frame.stiffness")
    )
    tension = np.maximum(record[TENSION], 0.0)
    in_toe = tension < 0.5 * cord * toe
    stretch = np.where(in_toe, np.sqrt(2.0 * toe * tension / cord), tension / cord + 0.5 * toe) + tension / frame
    return record.with_channels({LENGTH: record.channels[SPAN].with_values(record[SPAN] - stretch)})


def ten_points(length: str) -> list[StaticPoint]:
    """Means of the rising and the falling path at the lengths of a channel."""
    found: list[StaticPoint] = []
    for pressure, shares in SHARES.items():
        record = stiff(triangle(pressure=pressure, cycles=CYCLES))
        rising, falling = paths(record, length=length, tension=TENSION)
        low, high = falling.length_at(TAUT), min(rising.length[-1], falling.length[-1])
        at = [low + share * (high - low) for share in shares]
        found += static_points(record, at, length=length, tension=TENSION, pressure="pressure")
    return found


@functools.cache
def fits() -> Fits:
    """Both fits."""
    return Fits(*(fit_linear_tension(ten_points(length)) for length in (LENGTH, SPAN)))


def _found(which: str, unit: str, scale: float, digits: int) -> Found:
    one, raw = (getattr(fit, which) for fit in fits())
    half = 0.5 * (one.high - one.low)
    return Found(
        one.value,
        f"95 % +-{half / scale:.{digits}f} {unit}; {raw.value / scale:.{digits}f} {unit} "
        "with the stretch of cord and frame left in the length",
    )


@reproduces("static.fit_Kg", "m")
def fit_kg() -> Found:
    """Kg of the fit."""
    return _found("stiffness_per_pressure", "cm", 1e-2, 3)


@reproduces("static.fit_Pa", "Pa")
def fit_pa() -> Found:
    """Pa of the fit."""
    return _found("offset_pressure", "bar", 1e5, 3)


@reproduces("static.fit_Lmin", "m")
def fit_lmin() -> Found:
    """Lmin of the fit."""
    return _found("shortest_length", "cm", 1e-2, 2)


@reproduces("static.fit_Fa", "N")
def fit_fa() -> Found:
    """Fa of the fit."""
    return _found("offset_tension", "N", 1.0, 1)
