"""Pressure sensors calibrated by readings that were taken before."""

import pytest

from mckibben.errors import InputError
from mckibben_hardware.calibrate.verbs import calibrate_pressure

SESSION = {"rig": "modern"}


def table(path, rows, heads="Referenz [bar];pressure [bar]"):
    path.write_text("\n".join([heads, *(f"{true};{shown}" for true, shown in rows)]) + "\n")
    return path


def test_gain_and_zero_are_those_of_the_line_through_the_readings(tmp_path):
    rows = [(bar, 0.02 + 1.01 * bar) for bar in (0.0, 2.0, 4.0, 6.0, 3.0, 0.0)]
    answer = calibrate_pressure(session=SESSION, readings=table(tmp_path / "gauge.csv", rows), uncertainty="1 kPa")
    terms = answer.whole.corrections["pressure"].terms
    # points on a line give it but for rounding
    assert terms["gain"].value == pytest.approx(1.0 / 1.01, rel=1e-9)
    assert terms["zero"].value == pytest.approx(2e3, rel=1e-6)
    assert terms["gain"].origin.points == len(rows) and not answer.notes


def test_readings_that_differ_up_and_down_widen_the_uncertainty(tmp_path):
    def half(apart):
        rows = [(bar, bar + side * apart) for side in (0.0, 1.0) for bar in (0.0, 3.0, 6.0)]
        answer = calibrate_pressure(session=SESSION, readings=table(tmp_path / f"{apart}.csv", rows))
        return answer.whole.corrections["pressure"].terms["zero"].uncertainty

    assert half(0.05) > 2.0 * half(0.005)


def test_readings_taken_once_say_that_hysteresis_is_not_in_the_uncertainty(tmp_path):
    rows = [(0.0, 0.01), (3.0, 3.02), (6.0, 6.01)]
    assert "no hysteresis" in calibrate_pressure(session=SESSION, readings=table(tmp_path / "a.csv", rows)).notes[0]


@pytest.mark.parametrize(
    ("heads", "rows", "says"),
    [
        ("p [bar];pressure [bar]", [(0, 0), (3, 3)], "column reference"),
        ("reference [bar abs];pressure [bar]", [(1, 0), (4, 3)], "gauge"),
        ("reference [bar];pressure [bar]", [(3, 3), (3, 3.01)], "two different"),
        ("reference [bar];pressure [bar]", [(0, 0), (300, 300)], "range of the sensor"),
    ],
)
def test_a_table_that_gives_no_calibration_is_refused_in_one_sentence(tmp_path, heads, rows, says):
    with pytest.raises(InputError, match=says):
        calibrate_pressure(session=SESSION, readings=table(tmp_path / "a.csv", rows, heads))


def test_a_point_cannot_be_set_and_read_before(tmp_path):
    readings = table(tmp_path / "a.csv", [(0, 0), (3, 3)])
    with pytest.raises(InputError, match="only without readings"):
        calibrate_pressure(session=SESSION, readings=readings, pressures="0 bar, 3 bar")
