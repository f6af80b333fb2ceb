"""Intervals of samples of parameters, and what speaks against the use of samples."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .uncertainty import Estimate

MIXED, FEW = 1.05, 200  # largest R-hat, and fewest independent samples, of chains that are said to have mixed
LOST = 0.01  # largest share of the samples at which the sampler may lose its path
SampleWarnings = tuple[str, ...]


def interval_ends(
    samples: Mapping[str, np.ndarray], units: Mapping[str, str], confidence: float
) -> dict[str, Estimate]:
    """Median of each parameter with its interval between equal tails [SI]."""
    return _ends(samples, units, 0.5 - 0.5 * confidence)


def joint_interval_ends(
    samples: Mapping[str, np.ndarray], units: Mapping[str, str], confidence: float
) -> dict[str, Estimate]:
    """Intervals that hold all parameters of a sample at once, for a share `confidence` of the samples [SI].

    The ends lie at the same rank in all parameters.
    """
    values = np.stack(list(samples.values()))
    rank = np.argsort(np.argsort(values, axis=1), axis=1) / max(values.shape[1] - 1, 1)
    return _ends(samples, units, float(np.quantile(np.minimum(rank, 1.0 - rank).min(axis=0), 1.0 - confidence)))


def _ends(samples: Mapping[str, np.ndarray], units: Mapping[str, str], tail: float) -> dict[str, Estimate]:
    quantiles = {name: np.quantile(column, (0.5, tail, 1.0 - tail)) for name, column in samples.items()}
    return {
        name: Estimate(float(ends[0]), float(ends[1]), float(ends[2]), units[name]) for name, ends in quantiles.items()
    }


def mixing_warnings(r_hat: float, effective: float, divergences: int, count: int, worst: str = "") -> SampleWarnings:
    """What speaks against the use of samples, as text; empty if nothing does.

    Args:
        r_hat: largest ratio of the variances between and within the chains.
        effective: fewest independent samples of a parameter.
        divergences: count of the samples at which the sampler lost its path.
        count: count of the samples.
        worst: name of the parameter on which the chains agree least, if it is known.
    """
    warnings = []
    if r_hat > MIXED:
        place = f" about {worst}" if worst else ""
        warnings.append(
            f"the chains disagree{place} (R-hat {r_hat:.2f}) although they went on until the last round: "
            f"the data leave it open; fix {worst or 'a parameter'}, or measure more points"
        )
    elif effective < FEW:
        warnings.append(f"only {effective:.0f} samples are independent: draw more")
    if divergences > LOST * count:
        warnings.append(f"the sampler lost its path at {divergences} of {count} samples")
    return tuple(warnings)
