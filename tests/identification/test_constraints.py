"""Printed constraints: solved where they suffice, and honest where they do not."""

import numpy as np
import pytest

from mckibben.errors import ConvergenceError, InputError
from mckibben.identification.constraints import Constraint, fit_constraints
from mckibben.muscles import law_from_specimen
from mckibben.specimens import specimen

L0 = 0.147
KNOWN = {"rest_length": L0, "upper_length": 1.02 * L0}
# Table 1: 1090 N per rest length at 5 bar, free at 0.78 L0.
BRIDGESTONE = [Constraint("stiffness", 1090 / L0, 5e5, 0.13), Constraint("free_length", 0.78 * L0, 5e5)]


def test_two_constraints_for_four_unknowns_leave_all_of_them_open():
    found = fit_constraints("linear_threshold", BRIDGESTONE, known=KNOWN)
    assert "leave 2 of 4 parameters open" in found.warnings[0]
    assert all(np.isinf(e.high) for e in found.parameters.values())
    # and yet the law meets what is printed
    assert float(found.build().free_length(5e5)) == pytest.approx(0.78 * L0, rel=1e-6)


def test_with_two_parameters_known_the_specimen_follows():
    known = KNOWN | {"threshold_pressure": 0.903e5, "passive_stiffness": 1263.0}
    found = fit_constraints("linear_threshold", BRIDGESTONE, known=known)
    shipped = law_from_specimen(specimen("bridgestone"))
    assert found.warnings == ()
    # the shipped numbers are rounded to four digits
    assert found.parameters["stiffness_per_pressure"].value == pytest.approx(
        float(shipped.stiffness_per_pressure), rel=1e-3
    )
    assert found.parameters["shortest_length"].value == pytest.approx(float(shipped.shortest_length), rel=1e-3)


def test_contradicting_constraints_are_refused():
    with pytest.raises(ConvergenceError, match="no parameters meet"):
        fit_constraints("linear_threshold", [*BRIDGESTONE, Constraint("stiffness", 900 / L0, 5e5, 0.13)], known=KNOWN)


def test_an_incomplete_constraint_is_named():
    with pytest.raises(InputError, match="needs the length"):
        fit_constraints("linear_threshold", [Constraint("tension", 100.0, 5e5)], known=KNOWN)
