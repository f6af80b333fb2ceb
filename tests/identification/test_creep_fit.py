"""Creep elements from the stroke after a step: known ones are found again, the second half predicted, nonsense refused."""

import dataclasses

import numpy as np
import pytest

from mckibben.errors import InputError
from mckibben.identification.creep_fit import creep_half, fit_creep

TIME = np.arange(0.0, 4.0, 0.01)
NOISE = 5e-6  # [m]
TAU, STEPS = np.array([0.03, 0.3, 3.0]), np.array([2e-4, 4e-4, 6e-4])


def stroke(sign: float = 1.0) -> np.ndarray:
    """A chain of three elements from its closed form, which the fit does not use."""
    rise = sum(a * -np.expm1(-TIME / tau) for a, tau in zip(STEPS, TAU, strict=True))
    return 8e-3 + sign * rise + NOISE * np.random.default_rng(4).standard_normal(len(TIME))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_known_elements_are_found_again_within_their_intervals(sign: float) -> None:
    found = fit_creep(TIME, stroke(sign), shortest=0.03, longest=3.0, per_decade=1)
    np.testing.assert_allclose(found.time_constants, TAU)
    for estimate, truth in zip(found.amplitudes, STEPS, strict=True):
        # Twice the half width of a 95 % interval leaves no room for a fluke of the draw.
        assert abs(estimate.value - sign * truth) <= estimate.high - estimate.low
        assert estimate.high - estimate.low < 0.1 * truth
    chain = found.chain(100.0)
    np.testing.assert_allclose(chain.compliance, [abs(a.value) / 100.0 for a in found.amplitudes])
    # what yields by less than a chain takes is left out, and of a creep without any other step there is no chain
    least = found.amplitudes[1]._replace(value=sign * 0.5e-10)
    fewer = dataclasses.replace(found, amplitudes=(found.amplitudes[0], least, *found.amplitudes[2:])).chain(100.0)
    np.testing.assert_allclose(fewer.time_constant, np.delete(found.time_constants, 1))
    with pytest.raises(InputError, match="creep must be in a record that creeps"):
        dataclasses.replace(found, amplitudes=(least,) * len(found.amplitudes)).chain(100.0)


def test_the_second_half_is_predicted_from_the_first() -> None:
    found = fit_creep(TIME, stroke(), train=creep_half(TIME), shortest=0.03, longest=3.0, per_decade=1)
    assert found.train.sum() == 200
    # Slow amplitudes are read from less than their time constant: the error may grow to four times the noise, no more.
    assert found.rmse(seen=False) < 4.0 * NOISE
    assert found.rmse(seen=True) == pytest.approx(NOISE, rel=0.2)


@pytest.mark.parametrize("law", ["free", "logarithmic"])
def test_strokes_that_are_hidden_move_no_bit(law: str) -> None:
    """No sign, time constant, start or interval comes from a stroke that the fit does not see."""
    train = (TIME > 0.5) & (TIME % 1.0 < 0.7)  # what begins hidden, with gaps
    found = [
        fit_creep(TIME, np.where(train, stroke(), hidden), train=train, law=law)
        for hidden in (stroke(), np.full(len(TIME), -1e9), 5.0 * TIME)
    ]
    for other in found[1:]:
        assert (other.amplitudes, other.start, other.warnings) == (
            found[0].amplitudes,
            found[0].start,
            found[0].warnings,
        )
        np.testing.assert_array_equal(other.predicted, found[0].predicted)


def test_a_logarithmic_creep_is_continued_beyond_the_half_that_was_seen() -> None:
    tau = 0.03 * 10.0 ** (np.arange(5) / 2.0)
    s = 8e-3 + 1e-4 * sum(-np.expm1(-TIME / t) for t in tau)
    found = fit_creep(TIME, s, train=TIME < 0.4, law="logarithmic", shortest=0.03, longest=3.0)
    assert len(found.time_constants) == 5
    # One amplitude without noise: what is left is rounding.
    assert found.max_error(seen=False) < 1e-12


def test_the_drift_of_the_pressure_is_taken_off_with_the_slope_of_the_loop() -> None:
    pressure = 2e5 + 2e3 * np.floor(TIME)
    drifting = stroke() + 7e-8 * (pressure - pressure[0])
    options = {"shortest": 0.03, "longest": 3.0, "per_decade": 1}
    plain = fit_creep(TIME, stroke(), **options)
    found = fit_creep(TIME, drifting, pressure=pressure, pressure_slope=7e-8, **options)
    for one, other in zip(plain.amplitudes, found.amplitudes, strict=True):
        assert one.value == pytest.approx(other.value, rel=1e-6)  # the same linear problem, to the solver's tolerance
    assert found.predict(TIME[-1], pressure[-1] - pressure[0]) == pytest.approx(found.predicted[-1], abs=1e-12)


def test_elements_slower_than_the_record_are_named_as_not_told_apart() -> None:
    found = fit_creep(TIME, stroke(), train=TIME < 0.5, shortest=1.0, longest=100.0, per_decade=2)
    assert any("tell" in w for w in found.warnings)


@pytest.mark.parametrize(
    ("time", "values", "options", "told"),
    [
        (TIME[:5], TIME[:5], {}, "samples must be 8 or more, got 5"),
        (TIME[::-1], TIME, {}, "time must rise"),
        (TIME, TIME[:-1], {}, "got 400, 399 and 400"),
        (TIME, np.where(TIME > 1.0, np.nan, TIME), {}, "stroke must be one finite number"),
        (TIME, TIME, {"law": "power"}, "law must be free or logarithmic, got 'power'"),
        (TIME, TIME, {"shortest": 5.0}, "longest must be above the shortest, 5 s, up to 1e6 s"),
        (TIME, TIME, {"shortest": -1.0}, "shortest must be 1e-4 s or more, got -1"),
        (TIME, TIME, {"per_decade": 0}, "per_decade must be 1 or more, got 0"),
        (TIME, TIME, {"train": TIME < 0.03, "shortest": 0.01, "longest": 1.0}, "train is 3 samples"),
        (TIME, TIME, {"train": np.ones(2, bool)}, "must be bool"),
        (TIME, TIME, {"pressure_slope": np.inf}, "pressure_slope"),
    ],
)
def test_a_record_that_shows_no_creep_is_refused(time: object, values: object, options: dict, told: str) -> None:
    with pytest.raises(InputError, match=told):
        fit_creep(time, values, **options)
    with pytest.raises(InputError, match="force must be a force above 0 N, got -1"):
        fit_creep(TIME, stroke()).chain(-1.0)
