"""A fitted law that ships with a specimen meets its map as its note says."""

import re

import numpy as np
import pytest

from mckibben.identification import evaluate
from mckibben.muscles import law_from_specimen
from mckibben.recordings import read_force_map
from mckibben.specimens import map_file, specimen, specimens

FITTED = [
    (s.id, law, float(re.search(r"rmse ([\d.]+) N", note).group(1)))
    for s in specimens()
    if s.map
    for law, group in s.laws.items()
    for note in {p.note for p in group.values() if p.note.startswith("fitted")}
]


@pytest.mark.parametrize(("name", "law", "stated"), FITTED)
def test_the_stated_error_is_the_error(name, law, stated):
    spec = specimen(name)
    points = read_force_map(map_file(spec), rest_length=spec.property_si("rest_length", "m"))
    error = evaluate(law_from_specimen(spec, law), points)
    # parameters are stored with six digits and the error with two decimals
    assert float(np.sqrt(np.mean(error**2))) == pytest.approx(stated, rel=2e-3, abs=0.01)


def test_every_law_of_a_map_is_covered():
    assert len(FITTED) >= 10
