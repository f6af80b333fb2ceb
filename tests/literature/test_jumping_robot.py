"""Blow-down of a tank into four muscles of a jumping robot (GTDynamics): fitted to three jumps, the fourth is predicted.

The data do not ship, see `measured_data`.
"""

import pytest

from mckibben.studies.jumping_robot import MUSCLES, read_trial, robot_study
from measured_data import FOLDER, needs

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
        # the first pressure comes 1 ms after the first frame, in which a joint turns by less than 3 rad/s
        assert 0.0 <= record[f"angle_{m}"][0] < 3e-3
        assert record[f"angle_{m}"].max() > 2.0


def test_a_jump_that_was_not_fitted_is_predicted_from_one_that_was() -> None:
    # Four parameters and one jump, where the study has nineteen and three.
    free = ("nodes.tank.size", "nodes.muscle_*_*.swept", "elements.*.drive.opening_dead_time", "signals.vent.delay")
    found, _ = robot_study([JUMPS / "0p06_65psi"], [JUMPS / "0p09_65psi"], free=free, evaluations=6)
    # 62 and 71 mbar, with the first guesses 148 and 158; the last of the six evaluations still gains, so 5 %.
    assert found.rms() == pytest.approx(6.2e3, rel=0.05)
    assert found.rms(fitted=False) == pytest.approx(7.1e3, rel=0.05)
    # What the data fix is when a valve moves: 13 ms after its command, 6 to 28 ms on the page of the study.
    delay = found.parameters["elements.*.drive.opening_dead_time"]
    assert 0.005 < delay.low < delay.value < delay.high < 0.03


@pytest.mark.slow
def test_a_jump_that_was_not_fitted_is_predicted() -> None:
    fitted = [JUMPS / t for t in TRIALS if t != "0p09_65psi"]
    found, trials = robot_study(fitted, [JUMPS / "0p09_65psi"], evaluations=12)
    assert [t.name for t in trials][-1] == "0p09_65psi"
    print(f"\nfitted {found.rms():.0f} Pa, predicted {found.rms(fitted=False):.0f} Pa")
    # The page of the study says 61 mbar, of a swing of 260 kPa in the muscles and 140 in the tank; with the first guesses
    # it is 158. Twelve evaluations instead of its forty leave 2 % of the error to be found.
    assert found.rms(fitted=False) == pytest.approx(6.1e3, rel=0.03)
    assert found.rms() == pytest.approx(6.2e3, rel=0.03)
    for error in found.errors:
        assert error.rms < 9e3, error
    # What the data fix is when a valve moves: 13 ms after its command, 6 to 28 ms on the page of the study.
    delay = found.parameters["elements.*.drive.opening_dead_time"]
    assert delay.value == pytest.approx(0.0134, rel=0.05)
    assert 0.005 < delay.low < delay.value < delay.high < 0.03
