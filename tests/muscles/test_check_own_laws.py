"""Nothing sound is accused, whatever the range of lengths; what is accused names the fault and the point."""

import re
from pathlib import Path

import pytest

from mckibben.assembly.check import check

OWN = str(Path(__file__).with_name("own_laws.py"))
# Parameters that differ from the defaults: the range ends above or below the free lengths, or the law is extreme.
SOUND = {
    "usual": {},
    "narrow": {"low": 0.98, "high": 1.02},
    "all above the free length": {"low": 0.99, "high": 1.2},
    "all below the wall's length": {"wall_length": 0.3, "high": 1.0},
    "steep": {"wall_stiffness": 1e6, "slope": 0.02, "bend": 0.0},
    "without walls": {"wall_stiffness": 0.0},
    "weak": {"area": 1e-7, "slope": 1e-6, "bend": 0.0, "wall_stiffness": 0.1, "rest_volume": 1e-7},
    "strong": {"area": 0.5, "slope": 5.0, "bend": 0.0, "wall_stiffness": 1e6, "rest_volume": 0.05},
    "tiny": {"rest_length": 2e-3, "wall_length": 2e-3, "area": 1e-7, "slope": 1e-4, "rest_volume": 1e-10},
    "huge": {"rest_length": 20.0, "wall_length": 20.0, "area": 0.1, "slope": 0.02, "bend": 0.0, "rest_volume": 2.0},
    "wide": {"low": 0.3, "high": 1.1, "bend": 0.0},
    "falling": {"slope": 1e-3, "bend": 0.0, "wall_length": 0.16},
}
UNSOUND = {
    "Free": ("potential", r"its tension is not the derivative of its potential: dF/dP' is .* at .* cm and .* bar"),
    "Lossy": ("potential", r"its tension is not the derivative of its potential: .* at .* cm and .* bar"),
    "Pushing": ("push", r"pushes with .* N, at .* cm and .* bar"),
    "Root": ("finite", r"dF/dL is .*, at .* cm and .* bar"),
    "Emptied": ("volume", r"has a gas volume of -.* cm\^3, at .* cm and .* bar"),
    "Snapping": ("snap", r"falls slack while it is lengthened, .* at .* cm and .* bar"),
}


@pytest.mark.parametrize("name", SOUND)
def test_a_sound_law_is_not_accused(name):
    assert check(f"{OWN}:GasSpring", SOUND[name]) == []


@pytest.mark.parametrize("pressure", [0.0, 8e4, 4e5])
def test_a_sound_law_with_a_threshold_is_not_accused(pressure):
    assert check(f"{OWN}:Offset", {"threshold_pressure": pressure}) == []


@pytest.mark.parametrize("name", UNSOUND)
def test_an_unsound_law_is_accused_of_its_fault_at_a_point(name):
    kind, sentence = UNSOUND[name]
    found = {finding.kind: finding for finding in check(f"{OWN}:{name}")}
    assert kind in found, found
    assert re.search(sentence, found[kind].sentence), found[kind].sentence
    assert found[kind].length is not None
    assert found[kind].pressure is not None
