"""Parameters of a muscle that contradict each other are named, with values that would do."""

import pytest

import mckibben as mk
from mckibben.errors import InputError
from mckibben.muscles.evidence import volume_contradiction


def test_parameters_that_leave_no_volume_are_named_and_values_that_would_do():
    law = mk.muscle("nylon").law
    assert volume_contradiction(law, 0.14) is None
    error = volume_contradiction(law.replace(upper_length=0.3), 0.14)
    assert error is not None and error.field == "linear_threshold.upper_length"
    assert "upper_length 16.2 cm (not 30 cm)" in str(error)
    steep = volume_contradiction(law.replace(stiffness_per_pressure=0.02), 0.14)
    assert steep is not None and " or stiffness_per_pressure " in str(steep)
    assert float(law.replace(upper_length=0.162).volume(0.14, 0.0)) > 0.0


def test_a_law_that_leaves_its_volume_open_contradicts_nothing():
    assert volume_contradiction(mk.muscle("dmsp-20-300", law="martens_boblan").law, 0.3) is None


@pytest.mark.slow
def test_a_run_of_a_muscle_without_volume_says_which_parameter_is_wrong():
    muscle = mk.muscle("nylon")
    wrong = mk.Muscle(muscle.law.replace(upper_length=0.3), specimen=muscle.specimen)
    with pytest.raises(InputError, match="upper_length 16.2 cm"):
        mk.run("isometric-step", muscle=wrong, rig="modern", cycles=1)
