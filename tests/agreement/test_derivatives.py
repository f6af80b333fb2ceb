"""The fit against independent judges: derivatives by differences, parameters by known ones, intervals by repetition."""

import jax
import numpy as np
import pytest

from law_examples import SEATED, SHIPPED, examples
from mckibben.estimation import uncertainty
from mckibben.identification.problem import Problem, solve
from mckibben.muscles.law import TensionLaw
from mckibben.muscles.laws import law_type
from mckibben.quantities import declared
from mckibben.recordings import ForceMap

# Half a minute of compilation: it solves an equilibrium in its law. Its potential, pull and closed cycles stay in the suite.
SEATED_LATER = [pytest.param(law, marks=pytest.mark.slow) if law in SEATED else law for law in SHIPPED]
TENSION = jax.jit(lambda law, length, pressure: law.tension(length, pressure))
REPLICATES = 200


def truth(law: str) -> TensionLaw:
    """An example; of the laws whose specimens were fitted, the stated one, whose numbers do not change with the fit."""
    named = {"linear_threshold": "linear_threshold nylon", "ideal": "ideal nylon", "thick_wall": "thick_wall nylon"}
    named["martens_boblan"] = "martens_boblan DMSP-20-300"
    return examples()[named.get(law, law)]


def table(law: str) -> ForceMap:
    """Noise-free points of more than a twentieth of the largest tension, so that noise leaves all of them taut."""
    muscle = truth(law)
    upper = float(getattr(muscle, "upper_length", 0.98 * muscle.length_range()[1]))
    length, pressure = np.meshgrid(np.linspace(0.8, 1.0, 12) * upper, np.linspace(1.5e5, 6e5, 9), indexing="ij")
    tension = np.asarray(TENSION(muscle, length, pressure))
    taut = tension > 0.05 * tension.max()
    return ForceMap(name="synthetic", length=length[taut], pressure=pressure[taut], tension=tension[taut])


def problem(law: str, points: ForceMap) -> Problem:
    kind = law_type(law)
    known = {k: float(getattr(truth(law), k)) for k in declared(kind) if k not in (*kind.fitted, "rest_volume")}
    return Problem.of(law, points, known=known)


def leave_out_priors(law: str, patch: pytest.MonkeyPatch) -> bool:
    """Only the data speak: what muscles like it have had draws an estimate away from the truth, as it is meant to."""
    had = bool(law_type(law).priors)
    patch.setattr(law_type(law), "priors", {})
    return had


def scaled_truth(posed: Problem) -> np.ndarray:
    return np.array([float(getattr(truth(posed.law), name)) for name in posed.free]) / posed.scale


@pytest.mark.parametrize("law", SEATED_LATER)
def test_the_derivative_of_a_fit_equals_central_differences(law: str) -> None:
    posed = problem(law, table(law))
    tension, slopes = posed.functions()
    at = scaled_truth(posed)
    ours = slopes(at)
    for i, name in enumerate(posed.free):
        step = np.zeros_like(at)
        # 1e-5 of the parameter: truncation 1e-10 of the third derivative (100 times the first where a law is stiff in a
        # parameter), rounding 1e-16/1e-5 of the tension.
        step[i] = 1e-5 * max(abs(at[i]), 1e-3)
        difference = (tension(at + step) - tension(at - step)) / (2.0 * step[i])
        largest = np.abs(difference).max()
        assert largest > 0.0, name
        assert np.abs(ours[:, i] - difference).max() <= 1e-6 * largest, name


@pytest.mark.parametrize("law", SEATED_LATER)
def test_a_fit_to_noise_free_points_finds_the_parameters(law: str, monkeypatch: pytest.MonkeyPatch) -> None:
    leave_out_priors(law, monkeypatch)
    posed = problem(law, table(law))
    found = solve(posed)
    assert found.converged
    for name, value in found.values(posed).items():
        # The project's promise. The condition number is below 1e5, so that rounding alone would leave 1e-11.
        assert value == pytest.approx(float(getattr(truth(law), name)), rel=1e-6), name


@pytest.mark.parametrize("law", SEATED_LATER)
def test_intervals_cover_the_truth_in_95_of_100_repetitions(law: str, monkeypatch: pytest.MonkeyPatch) -> None:
    from scipy.stats import binom

    # Without its priors, on which it leans where data hardly tell parameters apart, each of these spreads ten times as far.
    weak = leave_out_priors(law, monkeypatch)
    clean = table(law)
    true = scaled_truth(problem(law, clean))
    rng = np.random.default_rng(20)
    # Small enough that the law is straight over the spread of its parameters, as the linearised intervals assume.
    noise = (2e-4 if weak else 2e-3) * clean.largest
    covered = np.zeros(true.size)
    for _ in range(REPLICATES):
        noisy = ForceMap(
            name="noisy", length=clean.length, pressure=clean.pressure,
            tension=clean.tension + rng.normal(0.0, noise, len(clean)),
        )  # fmt: skip
        posed = problem(law, noisy)
        found = solve(posed, near=[true], search=False)
        spread = uncertainty(found.jacobian, found.tension - noisy.tension, posed.free)
        assert np.isfinite(spread.standard_error).all()
        # The Jacobian is scaled like the parameters.
        half = spread.quantile * spread.standard_error
        covered += np.abs(found.scaled - true) <= half
    # 1 in 10,000 either way by chance, for each of about forty parameters.
    low, high = binom.ppf([1e-4, 1.0 - 1e-4], REPLICATES, 0.95)
    assert (covered >= low).all(), dict(zip(posed.free, covered / REPLICATES, strict=True))
    assert (covered <= high).all(), dict(zip(posed.free, covered / REPLICATES, strict=True))
