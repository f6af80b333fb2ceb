"""What is hidden from a fit moves not one bit of it: whatever it is, no scale, start or noise comes from it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mckibben.identification.fit import SCHEMES, fit
from mckibben.identification.problem import Problem, groups, predict_rest
from mckibben.recordings import ForceMap
from mckibben.specimens import specimen

KNOWN = {"rest_diameter": 0.02, "wall_thickness": 0.0018}
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
@pytest.mark.parametrize("scheme", SCHEMES)
@pytest.mark.parametrize("law", POSED)
def test_a_fold_does_not_see_what_it_predicts(law: str, scheme: str, garbage: str) -> None:
    problem = POSED[law]()
    if len(np.unique(groups(problem.points, scheme))) < 2:
        return  # of one muscle none is left out
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


@pytest.mark.parametrize("law", ["sarosi", "seated_braid"])
def test_a_fit_to_lower_pressures_does_not_see_what_lies_above(law: str) -> None:
    """Its predictions are the errors and the tensions that were told; a rounding of their sum is all that may differ."""
    points = rests_of_two_muscles()
    above = points.pressure > 4e5
    garbage = np.where(above, 10.0 * points.tension + 5.0, points.tension)
    predicted = []
    for one in (points, replace(points, tension=garbage)):
        held = fit(law, one, known=KNOWN, schemes=(), train_below=4e5).holdout
        assert held is not None and held.trained_on == (points.taut & ~above).sum()
        predicted.append(
            dict(zip(np.flatnonzero(above & one.taut), held.error + one.tension[above & one.taut], strict=True))
        )
    both = predicted[0].keys() & predicted[1].keys()
    assert len(both) > 30
    size = 10.0 * points.largest * np.finfo(float).eps
    np.testing.assert_allclose(*([one[i] for i in sorted(both)] for one in predicted), rtol=0.0, atol=2.0 * size)
