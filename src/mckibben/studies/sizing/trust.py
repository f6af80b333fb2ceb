"""How far a law may be wrong, as a share of the largest force of its muscle at the pressure, and who says so.

An error is carried as a deduction from the force that is promised. In order of preference: the largest error on the force
map that ships with the specimen, computed here; a cross-validated or published error; and, for a braid to be made, what the
chain from a braid's dimensions to its force misses on the nylon muscle, the only one whose braid and whose measured line are
both known. That chain has been tried on one muscle, and its error is no interval.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import numpy as np

from ...identification import evaluate
from ...muscles.build import law_from_specimen
from ...muscles.law import law_name
from ...recordings import read_force_map
from ...specimens import Specimen, map_file, specimen
from .braid_law import braid_law

# What is known of laws without a map, as shares of the largest force: share, kind, and where it comes from.
STATED: dict[tuple[str, str], tuple[float, str, str]] = {
    ("festo-10mm", "seated_braid"): (0.05, "cross-validated", "a length left out, see the law"),
    ("nylon", "linear_threshold"): (
        0.05,
        "inferred",
        "the paper fits ten points and prints no residual; a few N of 110",
    ),
    ("fiberglass", "linear_threshold"): (0.10, "inferred", "four parameters of two printed constraints"),
    ("bridgestone", "linear_threshold"): (0.10, "inferred", "four parameters of two printed constraints"),
}
PUBLISHED = (0.20, "published", "the ideal law errs by 10-20 % of the largest force on real muscles; the upper end")
OTHER_LENGTH = 0.05  # of a fluidic muscle of another length than the one measured, that of `seated_braid`
OTHER_BORE = 0.10  # of one scaled to another bore, inferred
REFERENCE, SHORTEST, LONGEST = "nylon", 0.105, 0.154  # working range of the nylon muscle, 0.75-1.1 L0 [m]
TRIED = (2e5, 5e5)  # gauge pressures in which its line was measured with a tension over most of its range [Pa]


class LawError(NamedTuple):
    """Largest error over the largest force [1], what kind of number that is, and where it comes from."""

    share: float
    kind: str
    source: str


@functools.lru_cache(maxsize=64)
def _on_map(id_: str, law: str) -> LawError:
    spec = specimen(id_)
    points = read_force_map(map_file(spec), rest_length=spec.property_si("rest_length", "m"))
    error = np.abs(np.asarray(evaluate(law_from_specimen(spec, law), points)))
    return LawError(float(error.max() / np.max(points.tension)), "largest on its map", spec.map or "")


def error_of_specimen(spec: Specimen, law: str) -> LawError:
    """The error of a law for a specimen."""
    if spec.map is not None:
        return _on_map(spec.id, law)
    return LawError(*STATED.get((spec.id, law), PUBLISHED))


def error_of_size(spec: Specimen, law: str, *, same_bore: bool) -> LawError:
    """The error of a law of a specimen taken to another length, or also to another bore."""
    own = error_of_specimen(spec, law)
    if not same_bore:
        return LawError(own.share + OTHER_BORE, "inferred", f"{spec.id} scaled to another bore and length")
    if own.kind == "cross-validated":
        return own  # that of another length it is
    return LawError(own.share + OTHER_LENGTH, "inferred", f"{spec.id} taken to another length")


@functools.lru_cache(maxsize=64)
def error_of_braid(law: str, pressure: float) -> LawError:
    """What a braid's law misses on the nylon muscle at a gauge pressure [Pa], over the law's own largest force."""
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
