"""What is hidden from a fit moves not one bit of it: whatever it is, no scale, start or noise comes from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mckibben.identification.problem import Problem, groups, predict_rest
from mckibben.recordings import ForceMap
from mckibben.specimens import specimen

GARBAGE = {
    "ten times as large": lambda tension: 10.0 * tension,
    "no number": lambda tension: np.full(len(tension), np.nan),
}


def rests_of_two_muscles() -> ForceMap:
    """A measured map as if of two muscles, of which the shorter pulls a little more."""
    points = specimen("DMSP-20-300").force_map()
    both = {k: np.concatenate([getattr(points, k)] * 2) for k in ("length", "pressure", "tension")}
    rest = np.repeat([0.3, 0.2], len(points))
    scale = rest / 0.3
    tension = both["tension"] * np.where(rest < 0.3, 1.03, 1.0)
    return ForceMap("two muscles", both["length"] * scale, both["pressure"], tension, rest_length=rest)


# Without and with priors, with set lengths that err, and with a table of several muscles.
POSED = {
    "ideal": lambda: Problem.of("ideal", specimen("DMSP-20-300").force_map()),
    "tondu_lopez": lambda: Problem.of("tondu_lopez", specimen("DMSP-20-300").force_map(), known={"rest_length": 0.3}),
    "seated_braid": lambda: Problem.of("seated_braid", rests_of_two_muscles(), length_error=5e-4),
    "seated_hyperelastic_braid": lambda: Problem.of("seated_hyperelastic_braid", rests_of_two_muscles()),
}


@pytest.mark.parametrize("garbage", GARBAGE)
@pytest.mark.parametrize("scheme", ["pressure", "block"])
@pytest.mark.parametrize("law", POSED)
def test_a_fold_does_not_see_what_it_predicts(law: str, scheme: str, garbage: str) -> None:
    problem = POSED[law]()
    hidden = groups(problem.points, scheme) == groups(problem.points, scheme)[np.argmax(problem.points.tension)]
    tension = problem.points.tension.copy()
    tension[hidden] = GARBAGE[garbage](tension[hidden])
    assert problem.points.largest in problem.points.tension[hidden]  # what sets the scale of the whole is hidden
    points = object.__new__(ForceMap)  # which refuses what is no number
    points.__dict__.update(vars(problem.points) | {"tension": tension})
    clean, poisoned = (predict_rest(one, ~hidden) for one in (problem, replace(problem, points=points)))
    assert clean is not None
    assert poisoned is not None
    np.testing.assert_array_equal(clean.scaled, poisoned.scaled)
    np.testing.assert_array_equal(clean.tension, poisoned.tension)
    assert (clean.starts, clean.message) == (poisoned.starts, poisoned.message)
