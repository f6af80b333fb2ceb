"""How far a length that is yet to be set may be off, from the lengths at which tension was measured.

The error of a set length is that of the muscle, which all its set lengths share (where its rest length was measured, how it
sits in its fittings), and one of its own:

    d_jk = m_j + u_jk,   m_j ~ N(0, s_m^2),   u_jk ~ N(0, s_u^2)

Both deviations are averaged over their posterior. With the law linearised at its fit their likelihood follows in closed
form; the priors are half-Cauchy, as wide as the stated error. Where few muscles were measured, the data hardly bound how
far muscles differ, and the tails say so.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

LEVELS = np.geomspace(0.02, 20.0, 25)  # of both deviations, in stated errors
CONFIDENCE = 0.95
HALVINGS = 60  # of the bracket of a quantile, down to rounding


class LengthEvidence(NamedTuple):
    """What the data say about p parameters and the errors of c set lengths, linearised at a fit.

    Attributes:
        information: of the data (p + c, p + c), the errors last, in stated errors.
        pull: information times the values that data and the parameters' priors ask for (p + c,).
        prior: information of the parameters' priors (p, p).
        muscle: number of the muscle of each set length (c,).
        stated: standard deviation of an error as stated [m].
    """

    information: np.ndarray
    pull: np.ndarray
    prior: np.ndarray
    muscle: np.ndarray
    stated: float

    def reach(self) -> tuple[float, float]:
        """Half width of the 95 % interval of a length yet to be set, of a fitted muscle and of another one [m]."""
        muscles = len(set(self.muscle.tolist()))
        pairs = [(own, whole) for own in LEVELS for whole in (LEVELS if muscles > 1 else LEVELS[:1])]
        # Half-Cauchy densities times the deviations, because the levels are even in the logarithm.
        logs = np.array([0.5 * self._evidence(*p) + sum(math.log(s / (1.0 + s * s)) for s in p) for p in pairs])
        chance = np.exp(logs - logs.max())
        chance /= chance.sum()
        own, whole = np.array(pairs).T
        return self.stated * _half_width(own, chance), self.stated * _half_width(np.hypot(own, whole), chance)

    def _evidence(self, own: float, whole: float) -> float:
        """Twice the log likelihood of the two deviations, but for a constant."""
        count, curves = len(self.prior), len(self.muscle)
        covariance = own**2 * np.eye(curves) + whole**2 * (self.muscle[:, None] == self.muscle)
        inner = self.information.copy()
        inner[:count, :count] += self.prior
        inner[count:, count:] += np.linalg.inv(covariance)
        sizes = np.linalg.slogdet(covariance)[1] + np.linalg.slogdet(inner)[1]
        return float(self.pull @ np.linalg.solve(inner, self.pull) - sizes)


def _half_width(deviations: np.ndarray, chance: np.ndarray) -> float:
    """What a mixture of normal variables without mean exceeds, to either side, in 5 % of cases."""
    low, high = 0.0, 10.0 * float(deviations.max())
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        outside = sum(c * math.erfc(middle / (s * math.sqrt(2.0))) for s, c in zip(deviations, chance, strict=True))
        low, high = (middle, high) if outside > 1.0 - CONFIDENCE else (low, middle)
    return high
