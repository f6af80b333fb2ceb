"""Loop and creep of a Festo DMSP-10-250 (public data of tbazina/pam_lqi_pid), each predicted where the fit did not look.

The data state no licence and do not ship, see `measured_data`. The sensor's
volts are read by its sheet (0.9 bar/V less 1 bar) and not cut off at zero, as the table's own pressures are.
"""

import csv
import functools

import numpy as np
import pytest

from mckibben.identification.creep_fit import LAWS, CreepFit, creep_half, fit_creep
from mckibben.identification.hysteresis_fit import LoopFit, fit_loops
from mckibben.identification.path_record import PathRecord
from measured_data import FOLDER, needs

LOOP = "dmsp_10_250_hysteresis/pressure_stroke_loop.csv"
STEPS = "dmsp_10_250_hysteresis/step_response_100hz.csv"
pytestmark = needs(LOOP, STEPS)
# Of each half: rms and largest error [m], where knots, scale and bounds come from the shown samples alone. While all samples
# set them, the second half looked better than it was: 0.148 and 0.449 mm.
LIMITS = ((0.124e-3, 0.310e-3), (0.157e-3, 0.569e-3))
BANDS = np.array([1.5, 2.0, 2.5, 2.7, 3.0, 3.5, 4.0, 4.5]) * 1e5


def rows(file: str) -> list[dict[str, str]]:
    with (FOLDER / file).open(encoding="utf-8") as text:
        return list(csv.DictReader(text))


@functools.cache
def record() -> PathRecord:
    table = rows(LOOP)
    pressure = np.array([0.9 * float(r["p_sensor_V"]) - 1.0 for r in table]) * 1e5
    return PathRecord(pressure, np.array([float(r["stroke_mm"]) for r in table]) * 1e-3, LOOP)


@functools.cache
def halves() -> tuple[LoopFit, LoopFit]:
    """Every other run of ten samples (0.6 bar), and the rest: each half is predicted by the other's best friction."""
    train = record().split("blocks")
    best = [fit_loops(record(), train=t, known={"per_pressure": 0.0}, knots=9)[0] for t in (train, ~train)]
    return best[0], best[1]


def unseen() -> PathRecord:
    one, other = halves()
    return record().with_stroke(np.where(one.train, other.predicted, one.predicted))


def test_the_loop_is_the_one_that_was_described() -> None:
    measured = record()
    assert len(measured.turning_points) == 1
    assert np.ptp(measured.stroke) == pytest.approx(39.0e-3, abs=0.1e-3)
    # At most 6.9 mm at 2.7 bar in the description of the data; read by straight lines between noisy samples.
    assert measured.width(2.7e5) == pytest.approx(6.9e-3, rel=0.02)


@pytest.mark.parametrize("half", [0, 1])
def test_each_half_of_the_loop_is_predicted_from_the_other(half: int) -> None:
    found = halves()[half]
    print(
        f"\n{found.model}: seen {found.rmse(seen=True) * 1e3:.3f} mm, unseen {found.rmse(seen=False) * 1e3:.3f} mm, "
        f"largest {found.max_error(seen=False) * 1e3:.3f} mm"
    )
    assert found.converged
    assert found.warnings == ()
    # Stated is what was measured, met within 5 % of itself; 0.39 mm is 1 % of the stroke.
    assert found.rmse(seen=False) <= LIMITS[half][0] * 1.05
    assert found.max_error(seen=False) <= LIMITS[half][1] * 1.05


def test_the_width_of_the_unseen_loop_is_right_to_a_tenth() -> None:
    share = unseen().width(BANDS) / record().width(BANDS)
    print("\nwidth over measured: " + ", ".join(f"{p / 1e5:g} bar {s:.3f}" for p, s in zip(BANDS, share, strict=True)))
    # The aim; where the loop narrows to its ends (1 bar and below, 5 bar and above) it is missed, see the next test.
    np.testing.assert_allclose(share, 1.0, atol=0.10)


def test_the_branches_are_in_order_to_both_ends() -> None:
    bands = np.array([0.0, 0.25, 0.5, 0.75, 1.0, *BANDS / 1e5, 5.0, 5.25, 5.5]) * 1e5
    predicted, measured = unseen().width(bands), record().width(bands)
    ends = [f"{p / 1e5:g} bar {a * 1e3:.2f}/{b * 1e3:.2f}" for p, a, b in zip(bands, predicted, measured, strict=True)]
    print("\nwidth predicted/measured in mm: " + ", ".join(ends))
    assert (predicted > 0.0).all()
    assert (measured > 0.0).all()
    # At the ends the width is 1 to 3 mm and the error of either branch counts most: 0.5 mm is 1.3 % of the stroke.
    assert np.abs(predicted - measured).max() <= 0.5e-3


@functools.cache
def held(segment: str, start: float) -> np.ndarray:
    """Time [s], stroke [m] and sensor pressure [Pa] of a step from where its pressure is held."""
    table = [r for r in rows(STEPS) if r["segment"] == segment]
    names = {"t_since_segment_start_s": 1.0, "stroke_mm": 1e-3, "p_bar_sensor": 1e5}
    found = np.array([[float(r[name]) * size for name, size in names.items()] for r in table])
    return found[found[:, 0] >= start - 1e-6]


def creep(segment: str, start: float) -> CreepFit:
    time, stroke, _ = held(segment, start).T
    return min((fit_creep(time, stroke, train=creep_half(time), law=law) for law in LAWS), key=lambda f: f.aicc)


def test_what_the_record_of_the_step_holds() -> None:
    up, down = held("step_up", 0.0), held("step_down", 0.0)
    # The rise ends at 0.95 s and 9.00 mm: the 9.98 mm of the description is the first sample of the next step.
    assert up[-1, 0] == pytest.approx(0.95)
    assert up[-1, 1] == pytest.approx(9.00e-3)
    assert down[0, 1] == pytest.approx(9.98e-3)
    assert down[0, 2] == pytest.approx(2.10e5)


@pytest.mark.parametrize(
    ("segment", "start", "rms", "largest"),
    [("step_up", 0.49, 0.049e-3, 0.089e-3), ("step_down", 0.37, 0.030e-3, 0.054e-3)],
)
def test_the_second_half_of_the_creep_is_predicted_from_the_first(
    segment: str, start: float, rms: float, largest: float
) -> None:
    found = creep(segment, start)
    moved = abs(found.stroke[-1] - found.stroke[0])
    print(
        f"\n{segment}: {found.law}, seen {found.rmse(seen=True) * 1e3:.3f} mm, "
        f"unseen {found.rmse(seen=False) * 1e3:.3f} mm, "
        f"largest {found.max_error(seen=False) * 1e3:.3f} mm of {moved * 1e3:.2f} mm"
    )
    # Stated is what was measured, met within 5 % of itself; all samples are rounded to 0.02 mm.
    assert found.rmse(seen=False) <= 1.05 * rms
    assert found.max_error(seen=False) <= 1.05 * largest


def test_four_seconds_are_not_told_by_a_quarter_of_a_second() -> None:
    # The hold lasted 4 s by the source's protocol, of which 0.24 s are fitted: the end is missed, and this says by how much.
    late = creep("step_up", 0.49).predict(4.0 - 0.49)
    print(f"\nat 4 s: {late * 1e3:.2f} mm predicted, 9.98 mm measured")
    assert 8.9e-3 < late < 9.98e-3
