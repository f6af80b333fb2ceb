"""Residuals of a measured loop: none against itself, an offset as it is, and ranges that do not meet are refused."""

import numpy as np
import pytest

from mckibben.analysis.loops import loop_residuals
from mckibben.errors import InputError
from mckibben.recordings import Channel, ForceMap, Recording

TURN = np.linspace(0.0, 6.0 * np.pi, 3000)


def loop(*, offset: float = 0.0, wide: float = 2.0, middle: float = 0.13, names=("span", "tension")) -> Recording:
    """Three turns of an ellipse: a spring of 2 N/mm with a friction that makes it `wide` [N]."""
    length = middle - 0.01 * np.cos(TURN)
    tension = 30.0 + 2e3 * (length - middle) + wide * np.sin(TURN) + offset
    channels = {names[0]: Channel(length, "m", "measured"), names[1]: Channel(tension, "N", "measured")}
    return Recording(TURN, channels, {"title": "Loop"})


def test_a_loop_has_no_residual_against_itself():
    assert loop_residuals(loop(), loop()).rms < 1e-9  # rounding of least squares on tens of newtons


def test_an_offset_is_the_residual_in_newtons_and_relative_to_the_measured_range():
    found = loop_residuals(loop(offset=1.5), loop())
    assert found.error == pytest.approx(1.5, abs=1e-6)  # rounding of least squares
    height = np.ptp(loop()["tension"])
    assert found.rms == pytest.approx(1.5, abs=1e-6) and found.relative == pytest.approx(1.5 / height, rel=1e-6)


def test_more_friction_is_more_on_the_rising_path_and_less_on_the_falling_one():
    found = loop_residuals(loop(wide=3.0), loop(wide=2.0))
    assert len(found.at) == len(found.error) == len(found.rising) == 2 * np.count_nonzero(found.rising)
    inner = np.abs(found.at - 0.13) < 0.004
    assert (found.error[inner & found.rising] > 0.8).all()  # 1 N in the middle, less towards the turning points
    assert (found.error[inner & ~found.rising] < -0.8).all()


def test_a_measured_recording_may_call_its_channels_length_and_force():
    assert loop_residuals(loop(), loop(names=("length", "force"))).rms < 1e-9  # rounding, as above


def test_static_points_are_compared_with_the_mean_of_both_paths():
    length = np.array([0.125, 0.13, 0.135, 0.2])
    points = ForceMap("points", length, np.full(4, 3e5), 30.0 + 2e3 * (length - 0.13) - 1.0)
    found = loop_residuals(loop(), points)
    assert len(found.at) == 3 and found.error == pytest.approx(1.0, abs=0.05)  # a parabola over 5 % of the ellipse


def test_loops_without_a_common_range_are_refused():
    with pytest.raises(InputError, match="in common"):
        loop_residuals(loop(), loop(middle=0.2))
    with pytest.raises(InputError, match="measured data have"):
        loop_residuals(loop(), loop(names=("angle", "tension")))
