"""Force and stroke of a measured muscle from the posterior of its law, with what the law has no parameter for."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...documents import JsonValue
from ...identification.posterior import Band, Posterior
from .candidate import Candidate
from .requirements import Requirements

SAMPLES, LENGTHS = 400, 64  # samples of the posterior, and lengths between which the end of a stroke lies


class PosteriorAnswer(NamedTuple):
    """Force and stroke from the samples of a posterior, with 95 % intervals.

    Attributes:
        law: name of the law.
        force: at the end of the wished stroke, less friction: low, median and high [N].
        stroke: until the force is the wished one [m], likewise.
        reached: share of the samples in which the muscle meets force and stroke.
        within: whether the wished pressure and the end of the stroke lie within the measured map.
    """

    law: str
    force: Band
    stroke: Band
    reached: float
    within: bool

    def to_dict(self) -> dict[str, JsonValue]:
        """Plain values [SI], for JSON."""
        both = {name: {k: float(v) for k, v in getattr(self, name)._asdict().items()} for name in ("force", "stroke")}
        return {"law": self.law, **both, "reached": self.reached, "within": self.within}


def answer_of_posterior(posterior: Posterior, muscle: Candidate, wish: Requirements) -> PosteriorAnswer:
    """Answer of a muscle's posterior to the requirements.

    The discrepancy of a sample is one draw along the whole stroke: a law that is too weak is so throughout.

    Args:
        posterior: samples of the muscle's law.
        muscle: the candidate, whose longest length and friction count.
        wish: force, stroke and pressure.
    """
    rows = posterior.rows(min(SAMPLES, len(posterior)))
    low = min(float(posterior.points.length.min()), muscle.longest - 1.5 * wish.stroke)
    # a fitted law ends at the longest measured length, from which on it states nothing
    lengths = np.linspace(low, min(muscle.longest, float(posterior.points.length.max())), LENGTHS)
    pressures = np.full(LENGTHS, wish.pressure)
    pull = posterior.signed_tensions(lengths, pressures)[rows]
    passive = np.maximum(posterior.signed_tensions(lengths, np.zeros(LENGTHS))[rows], 0.0)
    mean, deviation = posterior.discrepancy_along(rows, *(np.tile(x, (len(rows), 1)) for x in (lengths, pressures)))
    chance = np.random.default_rng(posterior.seed).standard_normal((len(rows), 1))
    force = pull - passive + mean + deviation * chance - muscle.friction
    end = muscle.longest - wish.stroke
    forces = np.array([np.interp(end, lengths, row) for row in force])
    strokes = np.array([muscle.longest - _last_below(wish.force, lengths, row) for row in force])
    points = posterior.points
    within = points.pressure.min() <= wish.pressure <= points.pressure.max()
    within &= points.length.min() <= end <= points.length.max()
    return PosteriorAnswer(
        law=posterior.law,
        force=_band(forces),
        stroke=_band(strokes),
        reached=float(np.mean(forces >= wish.force)),
        within=bool(within),
    )


def _band(values: np.ndarray) -> Band:
    return Band(*np.quantile(values, (0.025, 0.5, 0.975)))


def _last_below(force: float, lengths: np.ndarray, forces: np.ndarray) -> float:
    """Longest length at which a muscle pulls no more than a force [m]; the shortest of the lengths if there is none."""
    weak = np.flatnonzero(forces <= force)
    if not weak.size:
        return float(lengths[0])
    if weak[-1] == len(lengths) - 1:
        return float(lengths[-1])
    at = slice(weak[-1], weak[-1] + 2)
    return float(np.interp(force, forces[at], lengths[at]))
