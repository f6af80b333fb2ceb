"""Blow-down of a tank into four muscles of a jumping robot (GTDynamics): fitted to three jumps, the fourth is predicted.

The data do not ship, see `measured_data`.
"""

import pytest
from measured_data import FOLDER, needs

from mckibben.studies.jumping_robot import MUSCLES, read_trial, robot_study

NAME = "gtdynamics_jumping_robot"
JUMPS = FOLDER / NAME
TRIALS = ("0p02_knee_80psi", "0p06_65psi", "0p09_65psi", "0p12_65psi")
pytestmark = needs(NAME)


def test_a_trial_is_read_with_its_valves_and_angles() -> None:
    record = read_trial(JUMPS / "0p09_65psi")
    assert record["tank.pressure"][0] == pytest.approx(466.1e3)
    for m in MUSCLES:
        # open for 90 ms of samples 2 ms apart
        assert record[f"open_{m}"].sum() == pytest.approx(45, abs=1)
        assert record[f"angle_{m}"][0] == 0.0
        assert record[f"angle_{m}"].max() > 2.0


def test_a_jump_that_was_not_fitted_is_predicted() -> None:
    fitted = [JUMPS / t for t in TRIALS if t != "0p09_65psi"]
    found, trials = robot_study(fitted, [JUMPS / "0p09_65psi"], evaluations=20)
    assert [t.name for t in trials][-1] == "0p09_65psi"
    # Measured when this was written: 6.1 kPa over all channels, of a swing of 260 kPa in the muscles and 140 in the tank;
    # the bound is that of the trial that was fitted worst.
    assert found.rms(fitted=False) < 9e3
    for error in found.errors:
        assert error.rms < 15e3, error
    # What the data fix well is what a reader would measure: 15 ms until a valve moves, and the tank's litre and a half.
    delay = found.parameters["elements.*.drive.opening_dead_time"]
    assert 0.01 < delay.low < delay.value < delay.high < 0.025
