"""Parameters of a muscle that contradict each other are named, with values that would do."""

import pytest

import mckibben as mk
from mckibben.cli.app import main
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
@pytest.mark.filterwarnings("ignore:a span of 14 cm leaves the muscle slack:mckibben.errors.PlausibilityWarning")
def test_a_run_of_a_muscle_without_volume_says_which_parameter_is_wrong():
    muscle = mk.muscle("nylon")
    wrong = mk.Muscle(muscle.law.replace(upper_length=0.3), specimen=muscle.specimen)
    with pytest.raises(InputError, match="upper_length 16.2 cm"):
        mk.run("isometric-step", muscle=wrong, rig="modern", cycles=1)


IMPOSSIBLE = {  # by command and in Python: what is changed, and what is named
    "wall in a law": (
        ("thick_wall", {"thread_length": 0.16, "turns": 3.2, "wall_thickness": 5e-3, "upper_length": 0.15}, None),
        "thick_wall.wall_thickness must be less than 0.427 cm, or it fills the braid, which is 0.854 cm wide at 13.5 cm",
    ),
    "wall in a specimen": (
        ("nylon", {"wall_thickness": 0.01}, "thick_wall"),
        "thick_wall.wall_thickness must be less than 0.434 cm, or it fills the braid, which is 0.867 cm wide at 14 cm",
    ),
    "no gas": (("nylon", {"rest_length": 0.14, "upper_length": 0.3}, None), "upper_length 16.2 cm (not 30 cm)"),
}


@pytest.mark.parametrize(("muscle", "words"), IMPOSSIBLE.values(), ids=IMPOSSIBLE)
def test_geometry_that_cannot_be_is_refused_before_it_answers(muscle, words, capsys):
    name, changes, law = muscle
    with pytest.raises(InputError) as error:
        mk.muscle(name, law=law, **changes)
    assert words in str(error.value)
    sets = [word for key, value in changes.items() for word in ("--set", f"{key}={value}")]
    with pytest.raises(SystemExit) as ended:
        main(["tension", name, *(["--law", law] if law else []), *sets, "--length", "13 cm", "--pressure", "3 bar"])
    assert ended.value.code == 2 and words in capsys.readouterr().err
