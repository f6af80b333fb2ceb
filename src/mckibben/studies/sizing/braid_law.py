"""The law of a braid from its dimensions: the chain of the paper, eq. 10 to eq. 11 to eq. 12.

    F = Kg (P' - Pth)(L - Lmin) + Kp (L - L0)

Kg and Lmin are the straight line through the force per pressure of the virtual-work law with wall (eq. 10) over the stroke,
as the paper takes Kg (0.461 cm of it for the nylon muscle, 0.466 measured). What a braid does not tell is the bladder's:
threshold, and passive stiffness over Kg, which are pressures, are those of the nylon muscle, and the wall keeps its share
of the diameter. So all forces go with the square of the diameter, and the stress in the wall is that of the nylon muscle.
The laws `thick_wall` and `ideal` leave threshold and bladder out. Range: braid angles of 20.5-45 degrees at the long end,
less than 54.7 at the short one; a muscle at least four diameters long, for ends are no cylinders.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from ..._jax import Scalar, jnp
from ...muscles import braid, sleeve
from ...muscles.build import law_from_specimen
from ...muscles.evidence import error_of, growth_at
from ...muscles.law import TensionLaw, law_name
from ...muscles.laws.ideal import Ideal
from ...muscles.laws.linear_threshold import LinearThreshold
from ...muscles.laws.thick_wall import ThickWall
from ...muscles.sleeve import InferredDimension, straight_line
from ...specimens import Specimen, specimen

BRAID_LAWS = ("linear_threshold", "thick_wall", "ideal")


INFERRED: dict[str, InferredDimension] = {
    **{name: sleeve.INFERRED[name] for name in ("threshold_pressure", "threshold_width", "friction_share")},
    "wall_share": InferredDimension(
        0.0762 / 1.66,
        (0.03, 0.06),
        "wall over the diameter at 90 degrees, of the nylon muscle; a thicker one leaves no room at 20 degrees",
    ),
    "passive_pressure": InferredDimension(392.0 / 0.466e-2, (0.0, 2e5), "Pa; Kp/Kg of the nylon muscle"),
    "rest_share": InferredDimension(1.0 / 1.1, (0.85, 1.0), "length at rest over the longest, of the nylon muscle"),
    "fitting_share": InferredDimension(1.0, (0.5, 3.0), "length of each fitting over the contracted diameter"),
    "wall_density": InferredDimension(1150.0, (950.0, 1300.0), "kg/m3; rubber and nylon"),
    "fitting_density": InferredDimension(1400.0, (600.0, 2700.0), "kg/m3; half of a fitting's cylinder is aluminium"),
    "slenderness": InferredDimension(4.0, (3.0, 10.0), "least length over diameter, when contracted"),
}


def usual(name: str) -> float:
    """Value of an inferred number [SI]."""
    return INFERRED[name].value


# Inferred numbers of `INFERRED` that each law contains.
INFERRED_IN: dict[str, tuple[str, ...]] = {
    "linear_threshold": ("wall_share", "threshold_pressure", "threshold_width", "passive_pressure", "rest_share"),
    "thick_wall": ("wall_share",),
    "ideal": (),
}


def braid_law(
    name: str, *, thread_length: Scalar, diameter: Scalar, longest: Scalar, shortest: Scalar, **inferred: float
) -> TensionLaw:
    """Build the law of a braid; arrays broadcast.

    Args:
        name: name of `BRAID_LAWS`.
        thread_length: b [m].
        diameter: D0 at 90 degrees, b/(n pi) [m].
        longest: length from which it shortens [m].
        shortest: to which the straight line is taken [m].
        inferred: numbers of `INFERRED` to use instead of the usual ones [SI].
    """
    numbers = {key: one.value for key, one in INFERRED.items()} | inferred
    turns = thread_length / (jnp.pi * diameter)
    if name == "ideal":
        return Ideal(thread_length=thread_length, turns=turns)
    wall = numbers["wall_share"] * diameter
    thick = ThickWall(thread_length=thread_length, turns=turns, wall_thickness=wall, upper_length=longest)
    if name == "thick_wall":
        return thick
    per_pressure, zero = straight_line(thick, longest, shortest)
    rest = numbers["rest_share"] * longest
    volume = braid.inner_volume(rest, thread_length=thread_length, turns=turns, wall_thickness=wall)
    return LinearThreshold(
        stiffness_per_pressure=per_pressure,
        shortest_length=zero,
        threshold_pressure=numbers["threshold_pressure"],
        threshold_width=numbers["threshold_width"],
        passive_stiffness=numbers["passive_pressure"] * per_pressure,
        rest_length=rest,
        upper_length=longest,
        rest_volume=volume,
        stop_stiffness=3e7 * (diameter / 0.0166) ** 2,
    )


PUBLISHED = (0.20, "published", "the ideal law errs by 10-20 % of the largest force on real muscles; the upper end")
OTHER_BORE = 0.10  # of one scaled to another bore, inferred
REFERENCE, SHORTEST, LONGEST = "nylon", 0.105, 0.154  # working range of the nylon muscle, 0.75-1.1 L0 [m]
TRIED = (2e5, 5e5)  # gauge pressures in which its line was measured with a tension over most of its range [Pa]


class LawError(NamedTuple):
    """Largest error over the largest force [1], its kind, and its source."""

    share: float
    kind: str
    source: str


def error_of_specimen(spec: Specimen, law: str) -> LawError:
    """Largest error of a law for a specimen, as its file states it."""
    stated = error_of(spec, law)
    if stated is None or stated.largest is None:
        return LawError(*PUBLISHED)
    return LawError(stated.largest, "inferred" if spec.errors[law]["largest"].inferred else "measured", stated.source)


def error_of_size(spec: Specimen, law: str, length: float, *, scale: float = 1.0) -> LawError:
    """Largest error of a specimen's law for a muscle cut to another rest length, or also of another bore.

    Args:
        spec: the specimen.
        law: name of its law.
        length: at rest [m].
        scale: bore over that of the specimen [1]. Alike is a muscle whose length goes with it: ends go with the bore.
    """
    error, stated = error_of_specimen(spec, law), error_of(spec, law)
    more = growth_at(spec, stated, length / scale) or 0.0
    if abs(scale - 1.0) > 1e-6:
        return LawError(error.share + more + OTHER_BORE, "inferred", f"{spec.id} scaled to another bore and length")
    if not more:
        return error
    assert stated is not None  # from which it grows
    return LawError(
        error.share + more, "inferred", f"{spec.id} taken to another length, as it was off by {stated.at_other_length}"
    )


@functools.lru_cache(maxsize=64)
def error_of_braid(law: str, pressure: float) -> LawError:
    """Error of a braid's law on the nylon muscle at a gauge pressure [Pa], relative to the law's largest force."""
    spec = specimen(REFERENCE)
    shape = law_from_specimen(spec, "thick_wall")
    measured = law_from_specimen(spec)
    at = float(np.clip(pressure, *TRIED))
    lengths = np.linspace(SHORTEST, LONGEST, 50)
    made = braid_law(
        law,
        thread_length=shape.thread_length,  # type: ignore[attr-defined]
        diameter=shape.thread_length / (shape.turns * np.pi),  # type: ignore[attr-defined]
        longest=LONGEST,
        shortest=SHORTEST,
    )
    pull = np.asarray(made.tension(lengths, at))
    off = np.abs(pull - np.asarray(measured.tension(lengths, at)))
    where = f"against the {law_name(measured)} of the nylon muscle, one muscle"
    return LawError(float(off.max() / pull.max()), "computed", where)
