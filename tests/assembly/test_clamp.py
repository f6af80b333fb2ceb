"""Clamp with a limited grip: it holds below, gives way at the grip, and never gives back."""

import numpy as np
import pytest

from mckibben.assembly.muscle_unit import Clamp
from mckibben.muscles.elements import Tendon

TENDON = Tendon(stiffness=1e5, slack_length=0.02, toe_length=5e-4)
CLAMP = Clamp(grip=60.0)


def force(stretch):
    return float(TENDON.force(TENDON.slack_length + stretch))


@pytest.mark.parametrize("pull", [1.0, 25.0, 60.0])  # in the toe, at its end, beyond
def test_the_stretch_of_a_tendon_is_the_inverse_of_its_force(pull):
    assert force(float(TENDON.stretch(pull))) == pytest.approx(pull, rel=1e-12)


def test_below_its_grip_a_clamp_holds():
    held = CLAMP.advance(np.float64(0.0), TENDON, np.float64(0.99) * TENDON.stretch(60.0))
    assert float(held.state) == 0.0 and float(held.dissipated) == 0.0


def test_a_clamp_slips_until_the_tendon_pulls_with_its_grip():
    stretch = 3.0 * float(TENDON.stretch(60.0))
    slipped = CLAMP.advance(np.float64(0.0), TENDON, stretch)
    assert force(stretch - float(slipped.state)) == pytest.approx(60.0, rel=1e-12)  # rounding
    # what the tendon held before and no longer holds is heat
    before, after = (float(TENDON.stored_energy(0.02 + stretch - z)) for z in (0.0, float(slipped.state)))
    assert float(slipped.dissipated) == pytest.approx(before - after, rel=1e-12) and float(slipped.dissipated) > 0.0
    assert float(slipped.work) == float(slipped.dissipated)


def test_a_clamp_that_slips_again_loses_what_the_tendon_held_since():
    """Not once more what it has lost before."""
    first, second = (k * float(TENDON.stretch(60.0)) for k in (2.0, 3.0))
    before = CLAMP.advance(np.float64(0.0), TENDON, first).state
    again = CLAMP.advance(before, TENDON, second)
    held, left = (float(TENDON.stored_energy(0.02 + second - float(z))) for z in (before, again.state))
    assert held > left
    assert float(again.dissipated) == pytest.approx(held - left, rel=1e-12)  # rounding


def test_what_has_slipped_does_not_come_back():
    slipped = CLAMP.advance(np.float64(1e-3), TENDON, -5e-3)
    assert float(slipped.state) == 1e-3 and float(slipped.dissipated) == 0.0
