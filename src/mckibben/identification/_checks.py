"""Checks that a least-squares fit has converged to a usable solution.

A solver reports success as soon as it can go no further, also where it never moved because the derivatives that it was given
say that nothing changes. Such a fit returns its first guesses, with intervals, and looks like a finding.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ConvergenceError, InputError

STANDSTILL = 1e-8  # change of a scaled parameter below which it has not moved: solvers start this much inside of bounds
AT_BOUND = 1e-6  # distance from a bound, in scaled parameters, at which a parameter lies on it
# A fit may end where it began only at a minimum. There no parameter by itself lowers the sum of squares by more than a
# millionth, its cosine with the residual squared, or none would be moved by more than a millionth of its size.
FLAT_COSINE, FLAT_STEP = 1e-3, 1e-6
NAMED = 3  # parameters that a sentence names


def require_influence(jacobian: np.ndarray, names: Sequence[str], *, subject: str) -> None:
    """Refuse free parameters on which no residual depends.

    Args:
        jacobian: derivative of the residuals to each free parameter at the solution, (n, p); any scaling.
        names: names of the parameters.
        subject: was fitted, for the sentence.

    Raises:
        InputError: names the parameters whose columns are zero.
    """
    dead = [name for name, column in zip(names, np.asarray(jacobian).T, strict=True) if not np.any(column)]
    if dead:
        one = len(dead) == 1
        raise InputError(
            "free",
            listed(dead),
            f"the data of {subject} do not depend on {'it' if one else 'them'}, so no fit can find "
            f"{'it: fix this parameter' if one else 'them: fix these parameters'}, or begin with other values",
        )


def require_progress(
    start: np.ndarray,
    end: np.ndarray,
    jacobian: np.ndarray,
    residual: np.ndarray,
    bounds: tuple[np.ndarray, np.ndarray],
    *,
    subject: str,
) -> None:
    """Refuse a fit that ended where it began, unless it began at a minimum.

    Args:
        start: scaled parameters at the first evaluation (p,).
        end: the same at the solution (p,).
        jacobian: derivative of the residual to the scaled parameters at the solution, (n, p).
        residual: at the solution, (n,).
        bounds: bounds of the scaled parameters, lower and upper (p,) each.
        subject: was fitted, for the sentence.

    Raises:
        ConvergenceError: says that the values are the first guesses.
    """
    moved = np.abs(end - start) > STANDSTILL * np.maximum(1.0, np.abs(start))
    if moved.any():
        return
    slope, size = jacobian.T @ residual, np.linalg.norm(jacobian, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    outward = ((end - bounds[0] < AT_BOUND) & (slope > 0.0)) | ((bounds[1] - end < AT_BOUND) & (slope < 0.0))
    cosine = np.abs(slope) / (size * max(float(np.linalg.norm(residual)), 1e-300))
    step = np.abs(slope) / size**2
    if ((cosine > FLAT_COSINE) & (step > FLAT_STEP) & ~outward).any():
        raise ConvergenceError(
            f"The fit of {subject} ended where it began, and its first guesses are no minimum; begin with other values."
        )


def listed(names: Sequence[str]) -> str:
    """Some names, and how many more there are."""
    few, more = list(names[:NAMED]), len(names) - NAMED
    return ", ".join(few) if more <= 0 else f"{', '.join(few)} and {more} more"
