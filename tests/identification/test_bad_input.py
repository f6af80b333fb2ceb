"""A fit refuses what it cannot use in one line, and says what its data cannot tell."""

import importlib
from dataclasses import replace

import jax
import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.estimation import INVOLVED, uncertainty
from mckibben.identification import Fit, fit, fit_all, rank
from mckibben.identification.problem import Problem, solve
from mckibben.muscles import law_from_specimen
from mckibben.muscles.build import build_law
from mckibben.recordings import ForceMap
from mckibben.specimens import specimen

REST = 0.14
TENSION = jax.jit(lambda law, length, pressure: law.tension(length, pressure))


def nylon(lengths: int = 8, pressures: int = 6, noise: float = 0.0, upto: float = 0.154) -> ForceMap:
    """The nylon muscle's linear law as a table, all of it taut and above the threshold."""
    length, pressure = np.meshgrid(np.linspace(0.13, upto, lengths), np.linspace(1.5e5, 5e5, pressures), indexing="ij")
    tension = np.asarray(TENSION(law_from_specimen(specimen("nylon"), "linear_threshold"), length, pressure))
    tension = tension + np.random.default_rng(1).normal(0.0, noise, tension.shape) if noise else tension
    points = ForceMap(name="nylon", length=length.ravel(), pressure=pressure.ravel(), tension=tension.ravel())
    assert points.taut.all()
    return points.with_rest_length(REST)


def one_line(refused: pytest.ExceptionInfo[InputError]) -> str:
    said = str(refused.value)
    assert "\n" not in said
    assert "nylon" in said  # the table
    return said


@pytest.mark.parametrize("count", [0, 1, 3, 5, 7])
def test_a_law_of_six_parameters_refuses_seven_points(count: int) -> None:
    points = nylon()
    few = points.select(np.arange(len(points)) < count)
    with pytest.raises(InputError) as refused:
        fit("sarosi", few)
    said = one_line(refused)
    assert f"got {count}" in said
    assert "6 free parameters" in said
    assert "must be 8 or more" in said


def test_slack_points_do_not_count() -> None:
    points = nylon(3, 2)
    slack = replace(points, tension=np.where(np.arange(len(points)) < 3, points.tension, 0.0))
    with pytest.raises(InputError, match="got 3"):
        fit("linear_threshold", slack)


def test_a_missing_rest_length_is_asked_for() -> None:
    with pytest.raises(InputError) as refused:
        fit("linear_threshold", replace(nylon(), rest_length=None))
    assert "rest_length" in one_line(refused)
    assert refused.value.remedy == "rest_length"  # an edge adds its own words


def test_a_missing_dimension_is_asked_for() -> None:
    with pytest.raises(InputError) as refused:
        fit("seated_braid", nylon(), free=("rest_angle", "shear_modulus", "seat_compliance"))
    said = one_line(refused)
    assert "wall_thickness" in said or "rest_diameter" in said
    assert refused.value.remedy in ("parameter wall_thickness", "parameter rest_diameter")


def test_an_unknown_law_is_answered_with_the_nearest() -> None:
    with pytest.raises(InputError, match="Did you mean 'linear_threshold'"):
        fit("linear_treshold", nylon())


def test_a_training_limit_without_points_on_both_sides_is_refused() -> None:
    for limit in (1e5, 9e5):
        with pytest.raises(InputError, match="points on both sides"):
            fit("ideal", nylon(), schemes=(), train_below=limit)


@pytest.fixture
def all_but_the_slow_law(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without the seated braids, which take seconds to compile."""
    module = importlib.import_module("mckibben.identification.fit")
    monkeypatch.setattr(module, "LAWS", {k: v for k, v in module.LAWS.items() if not k.startswith("seated")})


@pytest.mark.usefixtures("all_but_the_slow_law")
def test_laws_that_the_table_cannot_feed_are_passed_over_with_a_reason() -> None:
    skipped: dict[str, str] = {}
    points = nylon(2, 3)  # six points
    found = fit_all(points, laws=None, schemes=(), skipped=skipped)
    assert {f.law for f in found} >= {"ideal", "gas_spring"}
    assert "sarosi" in skipped
    assert all("\n" not in reason for reason in skipped.values())
    assert not {f.law for f in found} & set(skipped)


def test_no_law_for_so_few_points_is_an_error() -> None:
    with pytest.raises(InputError, match="no law can be fitted"):
        fit_all(nylon(1, 2), laws=None, schemes=())


class TestConvergence:
    """A fit that did not reach its tolerance says so, and comes last whatever its error is."""

    def stuck(self, monkeypatch: pytest.MonkeyPatch, law: str) -> Fit:
        """A fit whose solver may evaluate twice only."""
        from scipy import optimize

        real = optimize.least_squares
        monkeypatch.setattr(optimize, "least_squares", lambda *a, **k: real(*a, **(k | {"max_nfev": 2})))
        found = fit(law, nylon(noise=0.5), schemes=())
        monkeypatch.undo()
        return found

    def test_a_fit_without_convergence_says_so(self, monkeypatch: pytest.MonkeyPatch) -> None:
        found = self.stuck(monkeypatch, "linear_threshold")
        assert not found.converged
        assert any("did not converge" in warning for warning in found.warnings)

    def test_a_fit_without_convergence_is_never_ranked_first(self, monkeypatch: pytest.MonkeyPatch) -> None:
        stuck = self.stuck(monkeypatch, "linear_threshold")
        worse = fit("ideal", nylon(noise=0.5), schemes=("pressure",))
        assert worse.converged
        best = replace(stuck, error=np.zeros_like(stuck.error))  # were the error all that counts
        assert [f.law for f in rank([best, worse])] == ["ideal", "linear_threshold"]
        assert [f.law for f in rank([worse, best])] == ["ideal", "linear_threshold"]

    def test_the_solver_reports_the_best_of_its_starts_that_converged(self) -> None:
        points = nylon(noise=0.5)
        posed = Problem.of("linear_threshold", points)
        found = solve(posed)
        assert found.converged
        assert found.agreeing >= 2  # several starts met
        again = solve(posed, near=[found.scaled], search=False)
        np.testing.assert_allclose(again.scaled, found.scaled, rtol=1e-6)


def apart(found: Fit) -> str:
    return "; ".join(w for w in found.warnings if "apart" in w)


def test_one_pressure_cannot_tell_stiffness_per_pressure_from_passive_stiffness() -> None:
    points = nylon(12, 1, noise=0.05)
    known = {"threshold_pressure": 0.903e5}
    found = fit(
        "linear_threshold", points, known=known, schemes=(),
        free=("stiffness_per_pressure", "shortest_length", "passive_stiffness"),
    )  # fmt: skip
    assert "apart" in apart(found)
    named = apart(found)
    assert all(n in named for n in ("stiffness_per_pressure", "shortest_length", "passive_stiffness"))
    assert all(np.isinf(e.high - e.low) for e in found.parameters.values())


def test_one_length_cannot_tell_the_line_from_its_origin() -> None:
    found = fit("gas_spring", nylon(1, 12, noise=0.05), schemes=())
    assert "stiffness_per_pressure" in apart(found)
    assert "shortest_length" in apart(found)


def test_a_wall_is_hardly_told_from_a_thinner_braid() -> None:
    law = law_from_specimen(specimen("nylon"), "thick_wall")
    length, pressure = np.meshgrid(np.linspace(0.138, 0.142, 6), np.linspace(1.5e5, 5e5, 6), indexing="ij")
    tension = np.asarray(TENSION(law, length, pressure))
    tension = tension + np.random.default_rng(2).normal(0.0, 0.2, tension.shape)
    points = ForceMap(name="short stroke", length=length.ravel(), pressure=pressure.ravel(), tension=tension.ravel())
    found = fit("thick_wall", points, schemes=())
    # 4 mm of stroke show a straight line, two numbers, to three parameters.
    assert found.warnings != ()


def test_data_below_the_threshold_do_not_contain_the_gas() -> None:
    law = law_from_specimen(specimen("nylon"), "linear_threshold")
    length, pressure = np.meshgrid(np.linspace(0.142, 0.154, 8), np.linspace(0.0, 0.4e5, 4), indexing="ij")
    tension = np.asarray(TENSION(law, length, pressure))
    points = ForceMap(name="unfilled", length=length.ravel(), pressure=pressure.ravel(), tension=tension.ravel())
    posed = {"schemes": (), "known": {"threshold_pressure": 0.903e5}}
    with pytest.raises(InputError) as refused:
        fit(
            "linear_threshold", points.with_rest_length(REST), **posed,
            free=("stiffness_per_pressure", "shortest_length", "passive_stiffness"),
        )  # fmt: skip
    said = str(refused.value)
    assert "unfilled by the law linear_threshold do not depend on them" in said
    assert "stiffness_per_pressure, shortest_length" in said
    assert "passive_stiffness" not in said
    # with these two fixed, the third is found
    posed["known"] |= {"stiffness_per_pressure": 4.66e-3, "shortest_length": 0.0991}
    found = fit("linear_threshold", points.with_rest_length(REST), **posed, free=("passive_stiffness",))
    assert found.parameters["passive_stiffness"].value == pytest.approx(392.0, rel=1e-6)


def test_enough_data_bring_no_warning() -> None:
    found = fit("linear_threshold", nylon(noise=0.05), schemes=(), known={})
    assert found.converged
    assert found.warnings == ()
    assert found.parameters["stiffness_per_pressure"].value == pytest.approx(4.66e-3, rel=1e-2)


def test_a_parameter_on_its_bound_is_named() -> None:
    # Less passive stiffness than none: the best value is the bound, zero.
    law = build_law(
        "gas_spring",
        {"stiffness_per_pressure": 4.66e-3, "shortest_length": 0.0991, "rest_length": REST, "upper_length": 0.154},
    )
    points = nylon()
    pull = np.asarray(TENSION(law, points.length, points.pressure - 0.903e5)) - 40.0 * (points.length - 0.1)
    found = fit(
        "linear_threshold", replace(points, tension=pull), schemes=(), known={"threshold_pressure": 0.903e5},
        free=("stiffness_per_pressure", "shortest_length", "passive_stiffness"),
    )  # fmt: skip
    assert "passive_stiffness lies on its bound" in found.warnings


def test_a_noisy_fit_keeps_its_error_and_interval_in_proportion() -> None:
    quiet, loud = (fit("gas_spring", nylon(noise=n), schemes=()) for n in (0.1, 1.0))
    assert loud.rmse > quiet.rmse
    width = [f.parameters["shortest_length"].high - f.parameters["shortest_length"].low for f in (quiet, loud)]
    assert width[1] > width[0] > 0.0


def test_two_open_directions_of_the_same_parameters_are_said_once():
    # two columns of numbers in four parameters, as one length is for a law of four: two directions change nothing
    chance = np.random.default_rng(0)
    slopes = chance.standard_normal((9, 2)) @ chance.uniform(0.5, 1.5, (2, 4))
    known = uncertainty(slopes, chance.standard_normal(9), ("a", "b", "c", "d"))
    assert known.warnings == ("the data cannot tell a, b, c and d apart",)
    assert np.isinf(known.standard_error).all()


def rotated(jacobian: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A singular value decomposition as another library returns it: any basis of what the data leave open."""
    left, strength, directions = np.linalg.svd(jacobian, full_matrices=False)
    chance = np.random.default_rng(seed)
    null = strength < 1e-12 * strength[0]
    turn, _ = np.linalg.qr(chance.standard_normal((null.sum(), null.sum())))
    directions[null] = turn @ directions[null]
    directions[~null] *= chance.choice([-1.0, 1.0], (~null).sum())[:, None]
    return left, strength, directions


@pytest.mark.parametrize("seed", range(5))
def test_what_data_cannot_tell_apart_is_of_the_data_and_of_no_basis(monkeypatch: pytest.MonkeyPatch, seed: int) -> None:
    chance = np.random.default_rng(0)
    a, b, c, e = chance.standard_normal((4, 9))
    # two columns that are one, three that are one but for sign and size, and one of its own
    slopes = np.stack([a + b, c, a + b, e, -2.0 * c, c], axis=1)
    turned = rotated(slopes / np.linalg.norm(slopes, axis=0), seed)
    monkeypatch.setattr(np.linalg, "svd", lambda *_, **__: turned)
    known = uncertainty(slopes, chance.standard_normal(9), tuple("abcdef"))
    assert known.warnings == ("the data cannot tell a and c apart", "the data cannot tell b, e and f apart")
    assert np.isinf(known.standard_error).tolist() == [True, True, True, False, True, True]


def test_fewer_values_than_parameters_leave_the_rest_open() -> None:
    # two values of a sum of three, and one of a fourth alone: no row of a decomposition is there for what is open
    slopes = np.array([[1.0, 2.0, 1.5, 0.0], [1.0, 1.0, 0.5, 0.0], [0.0, 0.0, 0.0, 1.0]])
    known = uncertainty(slopes, np.array([0.1, -0.1, 0.1]), tuple("abcd"))
    assert known.warnings == ("the data cannot tell a, b and c apart",)
    assert np.isinf(known.standard_error).tolist() == [True, True, True, False]


@pytest.mark.parametrize("share", [0.01, 0.002])
def test_a_parameter_that_hardly_takes_part_is_open_all_the_same(share: float) -> None:
    # so much of c is in b: what a and b leave open moves c by that share, and its interval has no end
    a, c = np.random.default_rng(0).standard_normal((2, 9))
    known = uncertainty(np.stack([a, a + share * c, c], axis=1), c, tuple("abc"))
    assert known.warnings == ("the data cannot tell a, b and c apart",)
    assert np.isinf(known.standard_error).all()


@pytest.mark.parametrize(("share", "named"), [(1.3, "a and b"), (1.6, "a, b and c")])
def test_a_parameter_is_named_from_a_thousandth_of_what_the_open_direction_moves(share: float, named: str) -> None:
    a, c = np.linalg.qr(np.random.default_rng(0).standard_normal((9, 2)))[0].T
    # the direction moves a and b by 1/sqrt(2) each
    known = uncertainty(np.stack([a, a + share * INVOLVED * c, c], axis=1), c, tuple("abc"))
    assert known.warnings == (f"the data cannot tell {named} apart",)
    assert np.isinf(known.standard_error).tolist() == [True, True, "c" in named]
