"""Spread of set lengths: within muscles and between them."""

import numpy as np
import pytest

from mckibben.identification.problem import LengthEvidence

STATED, MUSCLES, LENGTHS = 5e-4, 8, 3


def evidence(of_muscles: float, of_lengths: float, muscles: int = MUSCLES) -> LengthEvidence:
    """Errors measured without noise whose analysis of variance says just this, in stated errors; no parameters beside."""

    chance = np.random.default_rng(1)

    def sized(values: np.ndarray, square: float) -> np.ndarray:
        return values * np.sqrt(square / np.mean(values**2))

    shared, own = chance.normal(size=muscles), chance.normal(size=(muscles, LENGTHS))
    shared = sized(shared, of_muscles**2 + of_lengths**2 / LENGTHS)
    own = sized(own - own.mean(axis=1, keepdims=True), of_lengths**2 * (LENGTHS - 1) / LENGTHS)
    errors = (shared[:, None] + own).ravel()
    information = 1e6 * np.eye(len(errors))  # 0.001 of a stated error
    return LengthEvidence(
        information, information @ errors, np.zeros((0, 0)), np.repeat(np.arange(muscles), LENGTHS), STATED
    )


@pytest.mark.parametrize(("of_muscles", "of_lengths"), [(1.0, 0.3), (0.3, 1.0), (2.0, 2.0)])
def test_the_reach_is_that_of_the_two_spreads(of_muscles: float, of_lengths: float) -> None:
    fitted, other = evidence(of_muscles, of_lengths).reach()
    # Of 24 lengths within 8 muscles the deviation is known to 18 %, of 8 muscles to 25 %; what is averaged over it is wider.
    assert fitted == pytest.approx(1.96 * STATED * of_lengths, rel=0.18)
    assert other == pytest.approx(1.96 * STATED * np.hypot(of_muscles, of_lengths), rel=0.25)


def test_a_muscle_that_was_not_fitted_is_less_sure_than_one_that_was_the_more_so_the_fewer_were() -> None:
    few, many = (evidence(1.0, 0.3, muscles).reach() for muscles in (2, MUSCLES))
    assert many[1] > many[0]
    assert few[1] > few[0]
    assert few[1] > many[1]


def test_one_muscle_says_nothing_of_how_muscles_differ() -> None:
    fitted, other = evidence(1.0, 1.0, 1).reach()
    assert other == pytest.approx(fitted, rel=1e-2)  # the least level of a difference of muscles is 0.02
