"""How good a fit is: on the samples that it saw, on those that it did not, and for the number of its parameters."""

from __future__ import annotations

import abc

import numpy as np


def akaike(error: np.ndarray, parameters: int, *, resolution: float = 1e-15) -> float:
    """Akaike's criterion with the correction for small samples (AICc) of errors (n,); infinite where they are too few.

    The noise level counts as a parameter, and belongs to `parameters`. Root mean square errors below `resolution` (in the
    unit of the errors) count as that: what is left of an exact fit is rounding, whose size says nothing.
    """
    n, k = error.size, parameters
    least = resolution**2
    variance = max(float(np.mean(error**2)), least) if n else least
    return n * float(np.log(variance)) + 2.0 * k * n / (n - k - 1.0) if n > k + 1 else float("inf")


class HalfSeen(abc.ABC):
    """A fit to some samples of a record, and its prediction of all; `train`, bool (n,), is what it saw."""

    train: np.ndarray

    @property
    @abc.abstractmethod
    def error(self) -> np.ndarray:
        """Error of every sample (n,)."""

    def rmse(self, *, seen: bool) -> float:
        """Root mean square error of the samples that the fit saw, or of those that it did not; NaN where there are none."""
        some = self.error[self.train == seen]
        return float(np.sqrt(np.mean(some**2))) if some.size else float("nan")

    def max_error(self, *, seen: bool) -> float:
        """Largest of those errors; NaN where there are none."""
        some = self.error[self.train == seen]
        return float(np.abs(some).max()) if some.size else float("nan")
