"""A muscle of a circuit file that is cut to another length has the friction and the working length of that one."""

from pathlib import Path

import numpy as np
import pytest

from mckibben.assembly.build import unit_from_specimen
from mckibben.errors import PlausibilityWarning
from mckibben.specimens import specimen
from mckibben_hosts import Part

CIRCUIT = """
schema = 1
title = "a short muscle"
[nodes.supply]
kind = "reservoir"
pressure = "5 bar"
[nodes.muscle]
kind = "muscle"
specimen = "nylon"
parameters = { rest_length = "7 cm" }
length = "6.5 cm"
[elements.valve]
kind = "orifice"
conductance = "5 l/min/bar"
a = "supply"
b = "muscle"
[run]
duration = "0.1 s"
"""


def test_a_muscle_of_a_circuit_file_is_cut_by_its_rest_length_alone(tmp_path: Path):
    path = tmp_path / "short.toml"
    path.write_text(CIRCUIT)
    with pytest.warns(PlausibilityWarning, match="7 cm is beyond the measured ones of nylon"):
        unit = Part.from_circuit(path).hosted.machine.units["muscle"]
    whole = unit_from_specimen(specimen("nylon"))
    assert float(unit.law.tension(0.063, 4e5)) == pytest.approx(float(whole.law.tension(0.126, 4e5)))
    assert np.asarray(unit.friction.stiffness) == pytest.approx(2.0 * np.asarray(whole.friction.stiffness))
