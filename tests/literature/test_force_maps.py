"""The two published force maps of Martens and Boblan (2017), which ship with the package: what laws reach on them.

Percentages are of the largest measured force: 542.5 N for DMSP-10-250, 1653.5 N for DMSP-20-300.
"""

import functools

import numpy as np
import pytest

from mckibben.identification import Fit, evaluate, fit
from mckibben.muscles import law_from_specimen
from mckibben.recordings import ForceMap, read_force_map
from mckibben.specimens import map_file, specimen

MUSCLES = ("DMSP-10-250", "DMSP-20-300")
LARGEST = {"DMSP-10-250": 542.5, "DMSP-20-300": 1653.5}


@functools.cache
def force_map(muscle: str) -> ForceMap:
    spec = specimen(muscle)
    return read_force_map(map_file(spec), rest_length=spec.property_si("rest_length", "m"))


@functools.cache
def fitted(law: str, muscle: str) -> Fit:
    spec = specimen(muscle)
    known = {
        "rest_diameter": spec.property_si("rest_inner_diameter", "m"),
        "wall_thickness": spec.property_si("wall_thickness", "m"),
    }
    found = fit(law, force_map(muscle), known=known, schemes=("pressure", "length"), train_below=4e5)
    assert found.converged
    return found


def rms_of_taut(found: Fit) -> float:
    """Over the points with measured force, as the published errors are; the others would flatter every law."""
    taut = found.points.tension > 0.0
    return float(np.sqrt(np.mean(found.error[taut] ** 2)))


@pytest.mark.parametrize("muscle", MUSCLES)
def test_the_maps_are_the_published_ones(muscle: str) -> None:
    points = force_map(muscle)
    assert points.largest == LARGEST[muscle]
    assert (len(points), int(points.taut.sum())) == {"DMSP-10-250": (85, 40), "DMSP-20-300": (126, 60)}[muscle]
    assert points.pressure.max() == pytest.approx({"DMSP-10-250": 6.5e5, "DMSP-20-300": 6.75e5}[muscle])
    assert points.length.max() <= specimen(muscle).property_si("rest_length", "m") + 1e-9


@pytest.mark.parametrize(("muscle", "printed"), [("DMSP-10-250", 10.7), ("DMSP-20-300", 14.6)])
def test_the_published_coefficients_give_the_published_errors(muscle: str, printed: float) -> None:
    error = evaluate(law_from_specimen(specimen(muscle), "martens_boblan"), force_map(muscle))
    # Printed to three digits: one per cent is the rounding of the print and of the coefficients.
    assert np.sqrt(np.mean(error**2)) == pytest.approx(printed, rel=0.01)


@pytest.mark.parametrize(("muscle", "share"), [("DMSP-10-250", 0.043), ("DMSP-20-300", 0.024)])
def test_the_largest_error_of_the_published_coefficients_is_the_published_share(muscle: str, share: float) -> None:
    error = evaluate(law_from_specimen(specimen(muscle), "martens_boblan"), force_map(muscle))
    # 4.4 % and 2.35 % in the paper's own accounting, 4.3 % and 2.4 % here: two digits agree within one of the second.
    assert np.abs(error).max() / LARGEST[muscle] == pytest.approx(share, abs=1e-3)


@pytest.mark.parametrize("muscle", MUSCLES)
def test_the_angle_correction_read_in_degrees_misses_by_more_than_100_newton(muscle: str) -> None:
    law = law_from_specimen(specimen(muscle), "martens_boblan")
    misread = law.replace(angle_correction=np.radians(float(law.angle_correction)))
    assert np.sqrt(np.mean(evaluate(misread, force_map(muscle)) ** 2)) > 100.0


@pytest.mark.parametrize(("muscle", "limit"), [("DMSP-10-250", 1.2), ("DMSP-20-300", 6.3)])
def test_sarosi_refitted_stays_below_the_known_errors(muscle: str, limit: float) -> None:
    assert rms_of_taut(fitted("sarosi", muscle)) <= limit  # measured 1.10 and 6.20 N


@pytest.mark.parametrize("muscle", MUSCLES)
def test_the_hyperelastic_braid_predicts_a_pressure_that_was_left_out(muscle: str) -> None:
    # The aim is 1.2 %, of the largest error over all left-out points; measured 1.00 and 0.84 %.
    assert fitted("hyperelastic_braid", muscle).cross["pressure"].max_error <= 0.012 * LARGEST[muscle]


@pytest.mark.parametrize("muscle", MUSCLES)
def test_the_hyperelastic_braid_trained_to_4_bar_predicts_above(muscle: str) -> None:
    held = fitted("hyperelastic_braid", muscle).holdout
    assert held is not None
    assert held.max_error <= 0.03 * LARGEST[muscle]  # the aim; measured 2.31 and 0.98 %


@pytest.mark.parametrize("muscle", MUSCLES)
def test_the_hyperelastic_braid_predicts_a_length_that_was_left_out_within_5_percent(muscle: str) -> None:
    # Its docstring says 4-5 %, at the rest length; measured 4.66 and 4.81 %.
    assert fitted("hyperelastic_braid", muscle).cross["length"].max_error <= 0.05 * LARGEST[muscle]


def test_sarosi_interpolates_as_well_and_fails_to_extrapolate_on_one_map() -> None:
    """Six free coefficients without a reason behind them: the contrast for which a law with a reason was sought."""
    found = {muscle: fitted("sarosi", muscle) for muscle in MUSCLES}
    for muscle in MUSCLES:
        assert found[muscle].cross["pressure"].max_error <= 0.012 * LARGEST[muscle]  # 1.08 and 1.11 %
    held = {muscle: found[muscle].holdout for muscle in MUSCLES}
    assert held["DMSP-10-250"] is not None
    # Measured 8.5 %: it predicts no tension at all where 46 N were measured.
    assert held["DMSP-10-250"].max_error > 0.05 * LARGEST["DMSP-10-250"]


@pytest.mark.parametrize("muscle", MUSCLES)
def test_the_specimens_state_what_a_fit_to_their_map_finds(muscle: str) -> None:
    """Laws that a specimen states as fitted to its own map meet that map as well as a fresh fit does."""
    spec = specimen(muscle)
    assert {"hyperelastic_braid", "sarosi"} <= set(spec.laws)
    for law in ("hyperelastic_braid", "sarosi"):
        stated = evaluate(law_from_specimen(spec, law), force_map(muscle))
        # Stated to a few digits: a per cent of the error.
        assert np.sqrt(np.mean(stated**2)) <= 1.01 * rms_of_taut(fitted(law, muscle)), law
